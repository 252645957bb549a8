"""What `steadyslip.compiled.lockstep` kernels do between steps. Kernel text, not imported.

Quantity X of lane l is ``S[ROW_X*W + l]``. A row of `segments` is start, end, jump of the load point, then values and
slopes of the inputs.
"""

WELL, LOST = 0, 1


@njit(**PLAIN)
def load(S, group, jobs, constants, initial, settings):
    """Put the next W jobs into the lanes; lanes without one repeat the last."""
    for l in range(W):
        j = min(group + l, jobs - 1)
        c, i, s = min(j, constants.shape[0] - 1), min(j, initial.shape[0] - 1), min(j, settings.shape[0] - 1)
        for k in range(NC):
            S[(ROW_CONSTANT + k) * W + l] = constants[c, k]
        for k in range(N):
            S[(ROW_Y + k) * W + l] = initial[i, k]
            S[(ROW_ATOL + k) * W + l] = settings[s, 4 + k]
        S[ROW_RTOL * W + l] = settings[s, 0]
        S[ROW_Z * W + l] = settings[s, 1]
        S[ROW_Z_SCALE * W + l] = settings[s, 2]
        S[ROW_MOST * W + l] = settings[s, 3]
        S[ROW_H * W + l] = 1e300
        S[ROW_FAILURES * W + l] = 0.0
        S[ROW_ACCEPTED * W + l] = 0.0
        S[ROW_REJECTED * W + l] = 0.0
        S[ROW_ERROR * W + l] = 0.0
        S[ROW_ACTIVE * W + l] = 1.0


@njit(**PLAIN)
def enter(S, group, k, segments, input_rates):
    """Start row k of the table: new inputs, jump of the load point."""
    for l in range(W):
        row = segments[min(group + l, segments.shape[0] - 1), k]
        S[ROW_TAU * W + l] = 0.0
        S[ROW_START * W + l] = row[0]
        S[ROW_END * W + l] = row[1] - row[0]
        S[(ROW_Y + POSITION) * W + l] -= row[2]
        for i in range(3):
            S[(ROW_INPUT + i) * W + l] = row[3 + i]
            S[(ROW_SLOPE + i) * W + l] = row[6 + i]
        if input_rates.shape[1] > 0:
            own = min(group + l, input_rates.shape[0] - 1)
            for d in range(DIRECTIONS):
                for i in range(3):
                    place = INPUT_RATES[3 * d + i]
                    if place >= 0:
                        S[(ROW_CONSTANT + place) * W + l] = input_rates[own, d, k, i]


@njit(**PLAIN)
def move_nodes(S, group, k, node_rates):
    """Sensitivities jump where the start of a row moves with a direction: by the difference of the rates there."""
    moved = False
    for l in range(W):
        own = min(group + l, node_rates.shape[0] - 1)
        for d in range(DIRECTIONS):
            rate = node_rates[own, d, k]
            if rate != 0.0:
                moved = True
                for i in range(OWN):
                    change = S[(ROW_BEFORE + i) * W + l] - S[(ROW_F + i) * W + l]
                    S[(ROW_Y + OWN * (1 + d) + i) * W + l] += rate * change
    return moved


@njit(**PLAIN)
def cross(S):
    """Take every living lane to the end of the row."""
    while True:
        waiting = 0
        for l in range(W):
            if S[ROW_TAU * W + l] < S[ROW_END * W + l]:
                steps = S[ROW_ACCEPTED * W + l] + S[ROW_REJECTED * W + l]
                if S[ROW_ACTIVE * W + l] == 0.0 or S[ROW_FAILURES * W + l] >= 40.0 or steps >= S[ROW_MOST * W + l]:
                    S[ROW_ACTIVE * W + l] = 0.0
                    S[ROW_TAU * W + l] = S[ROW_END * W + l]
                else:
                    waiting += 1
        if waiting == 0:
            return
        step_lanes(S)


@njit(**PLAIN)
def keep(S, group, k, samples, seen):
    """Write down what is observed in every lane that has a sample here."""
    any_here = False
    for l in range(W):
        any_here = any_here or samples[min(group + l, samples.shape[0] - 1), k] >= 0
    if not any_here:
        return
    see_lanes(S)
    for l in range(W):
        sample = samples[min(group + l, samples.shape[0] - 1), k]
        if group + l < seen.shape[0] and sample >= 0:
            for i in range(1 + DIRECTIONS):
                value = S[(ROW_SEEN + i) * W + l]
                seen[group + l, i, sample] = value if S[ROW_ACTIVE * W + l] > 0.0 else math.nan


@njit(**ENTRY)
def through_table(constants, initial, settings, segments, samples, node_rates, input_rates, seen, steps):
    """Take all jobs through the table.

    One row per job, or one shared row: `constants`, `initial` (states), `settings` (rtol, guess, its scale, limit of
    steps, absolute tolerances), `segments` (jobs, k, 9), `samples` (jobs, k + 1), the place in `seen` (jobs,
    1 + directions, samples) of what is observed at the start of each row and at the end, -1 for none. `node_rates`
    (jobs, directions, k) and `input_rates` (jobs, directions, k, 3) have no directions where none moves the table.
    """
    S = np.zeros(ROWS * W)
    rows = segments.shape[1]
    jobs = seen.shape[0]
    for group in range(0, jobs, W):
        load(S, group, jobs, constants, initial, settings)
        for k in range(rows):
            for i in range(OWN * W):
                S[ROW_BEFORE * W + i] = S[ROW_F * W + i]
            enter(S, group, k, segments, input_rates)
            rates_lanes(S)
            if k > 0 and node_rates.shape[1] > 0 and move_nodes(S, group, k, node_rates):
                rates_lanes(S)
            keep(S, group, k, samples, seen)
            cross(S)
        keep(S, group, rows, samples, seen)
        for l in range(W):
            if group + l < jobs:
                steps[group + l, 0] = S[ROW_ACCEPTED * W + l]
                steps[group + l, 1] = S[ROW_REJECTED * W + l]
