"""What kernels do between steps: jobs, breakpoints, jumps, events, samples, the end. Kernel text, not imported.

`steadyslip.compiled.kernel` puts this behind the generated functions of a model (rates_at, outputs_at,
restore_at, balance_at, place_at, dense_at, step_lanes) and the numbers of its rows. ``S[ROW_X*W + l]`` is
quantity X of lane l; a lane that needs attention is copied to a record R, ``R[ROW_X]``, and back.

Arrays of the caller: one row per job (or a single row shared by all) of constants, initial continuous
variables, settings and segments; results are written to the job's own row, whatever the lane.
"""

RUNNING, DONE, CONTACT_LOST, BLOW_UP, TOO_MANY_STEPS, STUCK, NO_VELOCITY = 0, 1, 2, 3, 4, 5, 6
SETTLED, PERIODIC = 7, 8
NEXT_JOB, LAST_JOB, BUSY, PAUSED, LOGGED, RECORDED, FIRST_JOB = 0, 1, 2, 3, 4, 5, 6
# columns of `settings`
S_RTOL, S_MOST, S_V_HIGH, S_V_LOW, S_SIGMA_LOW, S_WATCH, S_RECORD = 0, 1, 2, 3, 4, 5, 6
S_GUESS, S_Z_SCALE, S_H, S_SETTLED, S_SAME, S_V_DRIVE, S_ATOL = 7, 8, 9, 10, 11, 12, 13
# kinds in the log
EVENT_BEGINS, EVENT_ENDS, PEAK, ARREST, RESTART, LOST, BLOWN, TROUGH = 1, 2, 3, 4, 5, 6, 7, 8
# columns of `tally`: what is known about a trajectory's slip events
EVENTS, V_MAX, V_MIN, LAST_BEGIN, LAST_DURATION, LAST_SLIP, LAST_DROP, LAST_PEAK, RECURRENCE, ARRESTS, PEAKS = (
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10,
)  # fmt: skip
PEAK_TIME, PEAK_PERIOD, PEAK_GROWTH = 11, 12, 13
NOW_BEGIN, NOW_STRESS, NOW_X, NOW_PEAK, LOAD_MOVED, TAKEN, PEAK_SIZE, DECIDED, ANY_BEGIN = (
    14,
    15,
    16,
    17,
    18,
    19,
    20,
    21,
    22,
)
NOW_FROM, NOW_EVENT, NOW_V, NOW_SIGMA, NOW_TAU, NOW_SEGMENT = 23, 24, 25, 26, 27, 28
LOG_COLUMNS = 8


@njit(**PLAIN)
def clock(R, tau):
    """Time since the start of the run, at tau into the segment: at its end that of the breakpoint, to the last bit."""
    return min(R[ROW_START] + tau, R[ROW_STOP]) if tau < R[ROW_END] else R[ROW_STOP]


@njit(**PLAIN)
def load_advance(R, tau):
    """How far the load point has moved since the start of the segment."""
    moved = R[ROW_INPUT] * tau + 0.5 * R[ROW_SLOPE] * tau * tau
    for h in range(HARMONICS):
        omega = R[ROW_OMEGA + h]
        if omega != 0.0:
            phase = R[ROW_PHASE + h]
            amplitude = R[ROW_AMPLITUDE + h]
            moved += amplitude / omega * (math.cos(phase) - math.cos(omega * tau + phase))
    return moved


@njit(**PLAIN)
def solve_balance(R, guess):
    """The w that balances forces, nearest to the guess: bracketed outwards, then safeguarded Newton."""
    w = guess
    value, slope = balance_at(R, w)
    if value == 0.0:
        return w
    if not math.isfinite(value):
        return math.nan
    step = 0.5 if value < 0.0 else -0.5
    low = high = w
    found = False
    for _ in range(200):
        trial = w + step
        other, slope = balance_at(R, trial)
        if math.isfinite(other):
            if (other > 0.0) != (value > 0.0) or other == 0.0:
                low, high = min(w, trial), max(w, trial)
                found = True
                break
            w, value = trial, other
            step = 2.0 * step
        else:
            step = 0.25 * step
            if abs(step) < 1e-12 * (1.0 + abs(w)):
                break
    if not found:
        return math.nan
    w = 0.5 * (low + high)
    for _ in range(200):
        value, slope = balance_at(R, w)
        if value == 0.0:
            break
        if value > 0.0:
            high = w
        else:
            low = w
        trial = w - value / slope if slope > 0.0 else math.nan
        if not (low < trial < high):
            trial = 0.5 * (low + high)
        if trial == w or high - low <= 4e-16 * abs(trial):
            w = trial
            break
        w = trial
    return w


@njit(**PLAIN)
def enter_segment(R, j, k, segments, y, out):
    """Start segment k: jump of the load point, new inputs, velocity from the balance. False if there is none."""
    s = j if segments.shape[0] > 1 else 0
    if k > 0:
        R[ROW_TALLY + LOAD_MOVED] += load_advance(R, R[ROW_END])
        restore_at(R)
    row = segments[s, k]
    R[ROW_SEGMENT] = k
    R[ROW_TAU] = 0.0
    R[ROW_START] = row[0]
    R[ROW_STOP] = row[1]
    R[ROW_END] = row[1] - row[0]
    R[ROW_CONTINUOUS] -= row[2]
    R[ROW_TALLY + LOAD_MOVED] += row[2]
    for i in range(3):
        R[ROW_INPUT + i] = row[3 + i]
        R[ROW_SLOPE + i] = row[6 + i]
    for i in range(3 * HARMONICS):
        R[ROW_AMPLITUDE + i] = row[9 + i]
        R[ROW_OMEGA + i] = row[9 + 3 * HARMONICS + i]
        R[ROW_PHASE + i] = row[9 + 6 * HARMONICS + i]
    w = R[ROW_Z]  # the velocity variable before the jump, as a guess
    if MASSLESS:
        w = solve_balance(R, w)
        R[ROW_Z] = w
    place_at(R, w)
    rates_at(R)
    good = math.isfinite(R[ROW_OUT])
    for i in range(N):
        good = good and math.isfinite(R[ROW_F + i])
    return good


@njit(**PLAIN)
def first_step(R):
    """A cautious first step: a hundredth of the time in which the fastest variable changes by its scale."""
    rtol = R[ROW_RTOL]
    fastest = 0.0
    for i in range(N):
        scale = R[ROW_ATOL + i] / rtol + abs(R[ROW_Y + i])
        fastest = max(fastest, abs(R[ROW_F + i]) / scale)
    most = R[ROW_H]
    return min(most, 0.01 * rtol**0.2 / fastest) if fastest > 0.0 else most


@njit(**PLAIN)
def start_job(R, j, cursor, log, arrays, y, out):
    """Load a job into a lane. False if there is no velocity to start with."""
    constants, initial, settings, segments, times = arrays
    for i in range(NC):
        R[ROW_CONSTANT + i] = constants[j if constants.shape[0] > 1 else 0, i]
    for i in range(NK):
        R[ROW_CONTINUOUS + i] = initial[j if initial.shape[0] > 1 else 0, i]
    own = settings[j if settings.shape[0] > 1 else 0]
    for i in range(TALLY_ROWS):
        R[ROW_TALLY + i] = 0.0
    R[ROW_RTOL] = own[S_RTOL]
    R[ROW_MOST] = own[S_MOST]
    R[ROW_V_HIGH] = own[S_V_HIGH]
    R[ROW_V_LOW] = own[S_V_LOW]
    R[ROW_SIGMA_LOW] = own[S_SIGMA_LOW]
    R[ROW_WATCH] = own[S_WATCH]
    R[ROW_RECORD] = own[S_RECORD]
    R[ROW_Z] = own[S_GUESS]
    R[ROW_Z_SCALE] = own[S_Z_SCALE]
    R[ROW_SETTLED] = own[S_SETTLED]
    R[ROW_SAME] = own[S_SAME]
    R[ROW_V_DRIVE] = own[S_V_DRIVE]
    R[ROW_H] = own[S_H]
    for i in range(N):
        R[ROW_ATOL + i] = own[S_ATOL + i]
    R[ROW_ACTIVE] = 1.0
    R[ROW_ACCEPTED] = 0.0
    R[ROW_REJECTED] = 0.0
    R[ROW_FAILURES] = 0.0
    R[ROW_ERROR] = 0.0
    R[ROW_GOOD] = 0.0
    R[ROW_FLAG] = 0.0
    if not enter_segment(R, j, 0, segments, y, out):
        return False
    await_sample(R, times)
    R[ROW_H] = first_step(R)
    v = R[ROW_OUT]
    R[ROW_TALLY + V_MAX] = v
    R[ROW_TALLY + V_MIN] = v
    for i in (LAST_BEGIN, LAST_PEAK, RECURRENCE, PEAK_TIME):  # there is none so far
        R[ROW_TALLY + i] = math.nan
    R[ROW_TALLY + PEAK_PERIOD] = math.nan
    R[ROW_TALLY + PEAK_GROWTH] = math.nan
    R[ROW_TALLY + NOW_BEGIN] = math.nan
    R[ROW_TALLY + NOW_FROM] = math.inf
    R[ROW_SLIPPING] = 1.0 if R[ROW_GAP] > 0.0 else 0.0
    R[ROW_RESTING] = 1.0 if abs(v) < own[S_V_LOW] else 0.0
    if R[ROW_WATCH] > 0.0 and R[ROW_SLIPPING] > 0.0:
        for i in range(N):
            y[i] = R[ROW_Y + i]
        outputs_at(R, 0.0, y, out)
        note(R, EVENT_BEGINS, 0.0, y, out, log, cursor)
    return True


@njit(**PLAIN)
def event_function(R, kind, theta, y, out):
    """Positive before the event of a kind, not after."""
    dense_at(R, theta, y)
    outputs_at(R, R[ROW_TAU_OLD] + theta * R[ROW_DONE], y, out)
    if kind == PEAK:
        return out[1]
    if kind == TROUGH:
        return -out[1]
    if kind == EVENT_BEGINS:
        return max(1.000001 * out[5], R[ROW_V_LOW]) - out[0]
    if kind == EVENT_ENDS:
        return out[0] - max(1.000001 * out[5], R[ROW_V_LOW])
    if kind == ARREST:
        return abs(out[0]) - R[ROW_V_LOW]
    if kind == RESTART:
        return R[ROW_V_LOW] - abs(out[0])
    return out[2] - R[ROW_SIGMA_LOW]


@njit(**PLAIN)
def located(R, kind, y, out):
    """Fraction of the last step at which an event happens: regula falsi (Illinois) on the dense output."""
    low, high = 0.0, 1.0
    at_low = event_function(R, kind, low, y, out)
    at_high = event_function(R, kind, high, y, out)
    if not at_low > 0.0:
        return 0.0
    if not at_high <= 0.0:
        return 1.0
    side = 0
    for _ in range(100):
        theta = high - at_high * (high - low) / (at_high - at_low)
        if not (low < theta < high):
            theta = 0.5 * (low + high)
        value = event_function(R, kind, theta, y, out)
        if value > 0.0:
            low, at_low = theta, value
            if side == 1:
                at_high = 0.5 * at_high
            side = 1
        else:
            high, at_high = theta, value
            if side == -1:
                at_low = 0.5 * at_low
            side = -1
        if high - low < 1e-13 or value == 0.0:
            break
    return high


@njit(**PLAIN)
def follow(R, cursor, log, y, out, order):
    """Events within the step just taken, in the order of time. True if the contact is lost in it."""
    tau_old, h = R[ROW_TAU_OLD], R[ROW_DONE]
    v, sigma = R[ROW_OUT], R[ROW_OUT + 2]
    slipping = 1.0 if R[ROW_GAP] > 0.0 else 0.0
    resting = 1.0 if abs(v) < R[ROW_V_LOW] else 0.0
    count = 0
    if sigma <= R[ROW_SIGMA_LOW]:
        order[count, 1] = LOST
        count += 1
    if slipping != R[ROW_SLIPPING]:
        order[count, 1] = EVENT_BEGINS if slipping > 0.0 else EVENT_ENDS
        count += 1
    if resting != R[ROW_RESTING]:
        order[count, 1] = ARREST if resting > 0.0 else RESTART
        count += 1
    if R[ROW_OUT_OLD + 1] * h > 1e-10 * abs(v) and R[ROW_OUT + 1] <= 0.0:
        order[count, 1] = PEAK
        count += 1
    elif R[ROW_OUT_OLD + 1] * h < -1e-10 * abs(v) and R[ROW_OUT + 1] >= 0.0:
        order[count, 1] = TROUGH
        count += 1
    for i in range(count):
        order[i, 0] = located(R, int(order[i, 1]), y, out)
    for _ in range(count):
        first = 0
        for i in range(count):
            if order[i, 0] < order[first, 0]:
                first = i
        theta, kind = order[first, 0], int(order[first, 1])
        order[first, 0] = 2.0
        dense_at(R, theta, y)
        tau = tau_old + theta * h
        outputs_at(R, tau, y, out)
        note(R, kind, tau, y, out, log, cursor)
        if kind == LOST:
            R[ROW_TAU] = tau
            for i in range(N):
                R[ROW_Y + i] = y[i]
            return True
    R[ROW_SLIPPING] = slipping
    R[ROW_RESTING] = resting
    R[ROW_TALLY + V_MAX] = max(R[ROW_TALLY + V_MAX], v)
    R[ROW_TALLY + V_MIN] = min(R[ROW_TALLY + V_MIN], v)
    R[ROW_TALLY + NOW_PEAK] = max(R[ROW_TALLY + NOW_PEAK], v)
    if R[ROW_TALLY + NOW_EVENT] == 0.0 and v >= SLIP_EVENT * R[ROW_TALLY + NOW_FROM]:
        for i in range(N):
            y[i] = R[ROW_Y + i]
        outputs_at(R, R[ROW_TAU], y, out)
        quicken(R, out, log, cursor)
    return False


@njit(**PLAIN)
def outrun(R, slowest, tau, y, out):
    """Keep where a block ahead of the load point was slowest: there its slip begins, if it becomes a slip event."""
    T = ROW_TALLY
    R[T + NOW_FROM] = slowest
    R[T + NOW_EVENT] = 0.0
    R[T + NOW_BEGIN] = R[ROW_START] + tau
    R[T + NOW_PEAK] = R[T + NOW_V] = out[0]
    R[T + NOW_SIGMA] = out[2]
    R[T + NOW_TAU] = out[3]
    R[T + NOW_STRESS] = out[4]
    R[T + NOW_X] = y[0] + R[T + LOAD_MOVED] + load_advance(R, tau)
    R[T + NOW_SEGMENT] = R[ROW_SEGMENT]


@njit(**PLAIN)
def quicken(R, out, log, cursor):
    """Slip becomes a slip event when the block is SLIP_EVENT times as fast as asked and as at its slowest.

    Asked is the velocity of the load point, or of the drive while the load point rests.
    """
    T = ROW_TALLY
    asked = out[5] if out[5] > R[ROW_V_LOW] else R[ROW_V_DRIVE]
    if R[T + NOW_EVENT] > 0.0 or not out[0] >= SLIP_EVENT * max(asked, R[T + NOW_FROM]):
        return
    R[T + NOW_EVENT] = 1.0
    if log.shape[0] > 0:
        i = cursor[LOGGED]
        log[i, 0], log[i, 1], log[i, 2], log[i, 3] = EVENT_BEGINS, R[T + NOW_BEGIN], R[T + NOW_V], R[T + NOW_SIGMA]
        log[i, 4], log[i, 5], log[i, 6] = R[T + NOW_TAU], R[T + NOW_STRESS], R[T + NOW_X]
        log[i, 7] = R[T + NOW_SEGMENT]
        cursor[LOGGED] = i + 1


@njit(**PLAIN)
def note(R, kind, tau, y, out, log, cursor):
    """Keep the tally of events, and the log where there is one."""
    time = clock(R, tau)
    place = y[0] + R[ROW_TALLY + LOAD_MOVED] + load_advance(R, tau)
    if kind == EVENT_BEGINS:  # logged once it is fast, if ever: see quicken
        outrun(R, out[0], tau, y, out)
        return
    is_event = R[ROW_TALLY + NOW_EVENT] > 0.0
    if kind == EVENT_ENDS:
        R[ROW_TALLY + NOW_FROM] = math.inf
        R[ROW_TALLY + NOW_EVENT] = 0.0
        if not is_event:
            return
    if log.shape[0] > 0:
        i = cursor[LOGGED]
        log[i, 0], log[i, 1], log[i, 2], log[i, 3] = kind, time, out[0], out[2]
        log[i, 4], log[i, 5], log[i, 6], log[i, 7] = out[3], out[4], place, R[ROW_SEGMENT]
        cursor[LOGGED] = i + 1
    if kind == EVENT_ENDS:
        begin = R[ROW_TALLY + NOW_BEGIN]
        if R[ROW_TALLY + ANY_BEGIN] > 0.0:  # one that was going on at the start has no beginning of its own
            R[ROW_TALLY + RECURRENCE] = begin - R[ROW_TALLY + LAST_BEGIN]
        R[ROW_TALLY + ANY_BEGIN] = 1.0 if begin > 0.0 else 0.0
        R[ROW_TALLY + EVENTS] += 1.0
        R[ROW_TALLY + LAST_BEGIN] = begin
        R[ROW_TALLY + LAST_DURATION] = time - begin
        R[ROW_TALLY + LAST_SLIP] = place - R[ROW_TALLY + NOW_X]
        R[ROW_TALLY + LAST_DROP] = R[ROW_TALLY + NOW_STRESS] - out[4]
        R[ROW_TALLY + LAST_PEAK] = R[ROW_TALLY + NOW_PEAK]
    elif kind == ARREST:
        R[ROW_TALLY + ARRESTS] += 1.0
    elif kind == PEAK:
        if R[ROW_TALLY + PEAKS] > 0.0:
            R[ROW_TALLY + PEAK_PERIOD] = time - R[ROW_TALLY + PEAK_TIME]
            decide(R, out)
        R[ROW_TALLY + PEAK_SIZE] = math.log(abs(out[0] / out[5])) if out[5] != 0.0 else math.inf
        R[ROW_TALLY + PEAKS] += 1.0
        R[ROW_TALLY + PEAK_TIME] = time
        R[ROW_TALLY + V_MAX] = max(R[ROW_TALLY + V_MAX], out[0])
        R[ROW_TALLY + NOW_PEAK] = max(R[ROW_TALLY + NOW_PEAK], out[0])
        quicken(R, out, log, cursor)
    elif kind == TROUGH:
        R[ROW_TALLY + V_MIN] = min(R[ROW_TALLY + V_MIN], out[0])
        if not is_event and out[0] < R[ROW_TALLY + NOW_FROM] < math.inf:  # what came before was no event
            outrun(R, out[0], tau, y, out)


@njit(**PLAIN)
def decide(R, out):
    """Compare a peak with the last one; where asked for, end a run if both are small, or the same."""
    before = R[ROW_TALLY + PEAK_SIZE]
    now = math.log(abs(out[0] / out[5])) if out[5] != 0.0 else math.inf
    R[ROW_TALLY + PEAK_GROWTH] = abs(now) - abs(before)
    if abs(before) < R[ROW_SETTLED] and abs(now) < R[ROW_SETTLED]:
        R[ROW_TALLY + DECIDED] = SETTLED
    elif abs(now - before) < R[ROW_SAME] * (1e-3 + abs(now)):
        R[ROW_TALLY + DECIDED] = PERIODIC


@njit(**PLAIN)
def await_sample(R, times):
    """How far into the segment the next requested time is, for the kernel's flag."""
    k = int(R[ROW_TALLY + TAKEN])
    R[ROW_NEXT] = times[k] - R[ROW_START] if k < times.shape[0] else math.inf


@njit(**PLAIN)
def take_samples(R, row, times, samples, at_end, y):
    """Write the state at every requested time: before now, from the dense output; `at_end`, now, as it is.

    A breakpoint itself belongs to the segment that begins there, the end of the run to the last one.
    """
    arrived = R[ROW_TAU] >= R[ROW_END]
    k = int(R[ROW_TALLY + TAKEN])
    while k < times.shape[0]:
        tau = times[k] - R[ROW_START]
        if at_end:
            if times[k] > clock(R, R[ROW_TAU]):
                break
            for i in range(N):
                y[i] = R[ROW_Y + i]
        else:
            if times[k] >= R[ROW_STOP] or (tau >= R[ROW_TAU] and not arrived):
                break
            dense_at(R, min(max((tau - R[ROW_TAU_OLD]) / R[ROW_DONE], 0.0), 1.0), y)
        for i in range(N):
            samples[row, k, i] = y[i]
        k += 1
    R[ROW_TALLY + TAKEN] = k
    await_sample(R, times)


@njit(**PLAIN)
def record(R, cursor, recorded):
    """The solver's own step."""
    i = cursor[RECORDED]
    recorded[i, 0] = clock(R, R[ROW_TAU])
    recorded[i, 1] = R[ROW_SEGMENT]
    for c in range(N):
        recorded[i, 2 + c] = R[ROW_Y + c]
    cursor[RECORDED] = i + 1


@njit(**PLAIN)
def finish(R, row, status, results):
    """Write a job's results."""
    statuses, final, tally = results[0], results[1], results[2]
    statuses[row] = status
    final[row, 0] = clock(R, R[ROW_TAU])
    final[row, 1] = R[ROW_SEGMENT]
    final[row, 2] = R[ROW_ACCEPTED]
    final[row, 3] = R[ROW_REJECTED]
    for i in range(N):
        final[row, 4 + i] = R[ROW_Y + i]
    for i in range(14):
        tally[row, i] = R[ROW_TALLY + i]
    R[ROW_ACTIVE] = 0.0
    R[ROW_FLAG] = 0.0


@njit(**PLAIN)
def go_on(R, j, cursor, arrays, results, y, out, order):
    """Look after a job that has raised its flag. Returns its status."""
    j0 = cursor[FIRST_JOB]
    segments, times = arrays[3], arrays[4]
    samples, log, recorded = results[3], results[4], results[5]
    good = R[ROW_GOOD] > 0.0
    if MASSLESS and STATE_W >= 0:
        R[ROW_Z] = R[ROW_Y + STATE_W]  # a guess for after the next jump
    if DENSE and good:
        lost = R[ROW_WATCH] > 0.0 and follow(R, cursor, log, y, out, order)
        take_samples(R, j - j0, times, samples, False, y)
        if R[ROW_RECORD] > 0.0:
            record(R, cursor, recorded)
        if lost:
            return CONTACT_LOST
        if R[ROW_TALLY + DECIDED] > 0.0:
            return int(R[ROW_TALLY + DECIDED])
    if abs(R[ROW_OUT]) >= R[ROW_V_HIGH]:
        return BLOW_UP
    if R[ROW_OUT + 2] <= R[ROW_SIGMA_LOW]:
        return CONTACT_LOST
    if R[ROW_FAILURES] >= 40.0:
        return STUCK
    if R[ROW_ACCEPTED] + R[ROW_REJECTED] >= R[ROW_MOST]:
        return TOO_MANY_STEPS
    while R[ROW_TAU] >= R[ROW_END]:
        k = int(R[ROW_SEGMENT]) + 1
        s = j if segments.shape[0] > 1 else 0
        if k >= segments.shape[1] or segments[s, k, 1] <= segments[s, k, 0]:  # empty ones fill a lane up
            return DONE
        h, before = R[ROW_H], R[ROW_OUT]
        if not enter_segment(R, j, k, segments, y, out):
            return NO_VELOCITY
        await_sample(R, times)
        R[ROW_H] = h
        if R[ROW_RECORD] > 0.0:
            record(R, cursor, recorded)
        if R[ROW_WATCH] > 0.0:
            crossed(R, before, cursor, log, y, out)
    return RUNNING


@njit(**PLAIN)
def crossed(R, before, cursor, log, y, out):
    """A jump from the velocity `before` can begin or end a slip event at once."""
    for i in range(N):
        y[i] = R[ROW_Y + i]
    outputs_at(R, 0.0, y, out)
    slipping = 1.0 if R[ROW_GAP] > 0.0 else 0.0
    if slipping != R[ROW_SLIPPING]:
        note(R, EVENT_BEGINS if slipping > 0.0 else EVENT_ENDS, 0.0, y, out, log, cursor)
        R[ROW_SLIPPING] = slipping
    if slipping > 0.0 and R[ROW_TALLY + NOW_EVENT] == 0.0 and before < min(out[0], R[ROW_TALLY + NOW_FROM]):
        outrun(R, before, 0.0, y, out)
        quicken(R, out, log, cursor)
    R[ROW_RESTING] = 1.0 if abs(out[0]) < R[ROW_V_LOW] else 0.0
    R[ROW_TALLY + V_MAX] = max(R[ROW_TALLY + V_MAX], out[0])
    R[ROW_TALLY + V_MIN] = min(R[ROW_TALLY + V_MIN], out[0])


@njit(**PLAIN)
def attend(R, l, ids, cursor, arrays, results, y, out, order):
    """Whatever a flagged lane needs: go on with its job, or finish it and take the next one."""
    j = ids[l]
    status = DONE
    if j >= 0:
        status = go_on(R, j, cursor, arrays, results, y, out, order)
        R[ROW_FLAG] = 0.0
        if status == RUNNING:
            return
        if status != NO_VELOCITY:  # there is no state after that jump
            take_samples(R, j - cursor[FIRST_JOB], arrays[4], results[3], True, y)
        finish(R, j - cursor[FIRST_JOB], status, results)
    while cursor[NEXT_JOB] < cursor[LAST_JOB]:
        j = cursor[NEXT_JOB]
        cursor[NEXT_JOB] = j + 1
        ids[l] = j
        if start_job(R, j, cursor, results[4], arrays, y, out):
            if R[ROW_RECORD] > 0.0:
                record(R, cursor, results[5])
            return
        finish(R, j - cursor[FIRST_JOB], NO_VELOCITY, results)
    ids[l] = -1
    cursor[BUSY] -= 1
    for i in range(ROWS):
        R[i] = 0.0
    R[ROW_RTOL] = 1.0
    R[ROW_H] = 1e-3
    R[ROW_END] = 1e300


@njit(**ENTRY)
def advance(S, ids, cursor, constants, initial, settings, segments, times, statuses, final, tally, samples, log,
            recorded, quota):  # fmt: skip
    """Advance all jobs of `cursor` until they are done, a buffer is full, or `quota` steps are taken."""
    arrays = (constants, initial, settings, segments, times)
    results = (statuses, final, tally, samples, log, recorded)
    y, out, order = np.empty(N), np.empty(6), np.empty((5, 2))
    R = S if W == 1 else np.zeros(ROWS)
    steps = 0
    if cursor[PAUSED] < 0:
        for l in range(W):
            ids[l] = -1
            S[ROW_FLAG * W + l] = 1.0
        cursor[PAUSED] = 1
    while cursor[BUSY] > 0:
        if cursor[PAUSED] == 0:
            step_lanes(S)
            steps += 1
        cursor[PAUSED] = 0
        attention = 0
        for l in range(W):
            attention += 1 if S[ROW_FLAG * W + l] != 0.0 else 0
        if attention > 0:
            if (log.shape[0] > 0 and cursor[LOGGED] + 16 * W > log.shape[0]) or (
                recorded.shape[0] > 0 and cursor[RECORDED] + 4 * W > recorded.shape[0]
            ):
                cursor[PAUSED] = 1
                return 1
            for l in range(W):
                if S[ROW_FLAG * W + l] != 0.0:
                    if W > 1:
                        for i in range(ROWS):
                            R[i] = S[i * W + l]
                    attend(R, l, ids, cursor, arrays, results, y, out, order)
                    if W > 1:
                        for i in range(ROWS):
                            S[i * W + l] = R[i]
        if steps >= quota:
            return 2
    return 0


@njit(**PLAIN)
def placed(R, constants, settings, state, inputs, own, y):
    """Bring a given state into a record, balance solved where there is one left to solve."""
    for i in range(NC):
        R[ROW_CONSTANT + i] = constants[own if constants.shape[0] > 1 else 0, i]
    settings_row = settings[own if settings.shape[0] > 1 else 0]
    R[ROW_Z_SCALE] = settings_row[S_Z_SCALE]
    R[ROW_START] = inputs[6]
    for i in range(3):
        R[ROW_INPUT + i] = inputs[i]
        R[ROW_SLOPE + i] = inputs[3 + i]
    R[ROW_TAU] = 0.0
    for i in range(N):
        R[ROW_Y + i] = state[i]
        y[i] = state[i]
    if IMPLICIT:
        for i in range(NK):
            R[ROW_CONTINUOUS + i] = y[i]
        R[ROW_Z] = solve_balance(R, R[ROW_Z])


@njit(**ENTRY)
def observe(constants, settings, states, inputs, own, values):
    """Outputs and continuous variables at given states.

    `states` is (m, N); `inputs` (m, 7) holds v_lp, q, p, their slopes and the time; `own` the rig's row.
    `values` is (m, 5 + NK).
    """
    R, y, out = np.zeros(ROWS), np.empty(N), np.empty(6)
    rig = -1
    for m in range(states.shape[0]):
        if own[m] != rig:
            rig = own[m]
            R[ROW_Z] = settings[rig if settings.shape[0] > 1 else 0, S_GUESS]
        placed(R, constants, settings, states[m], inputs[m], rig, y)
        outputs_at(R, 0.0, y, out)
        restore_at(R)
        for i in range(5):
            values[m, i] = out[i]
        for i in range(NK):
            values[m, 5 + i] = R[ROW_CONTINUOUS + i]
