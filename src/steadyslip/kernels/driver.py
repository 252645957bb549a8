"""What happens between steps: jobs, breakpoints, jumps, events, samples, the end. The same code for every model.

Everything particular to a model is called through `Routines`; sizes and places are in `Layout`. The module runs as it
stands, slowly, with plain Python routines; `steadyslip.kernels.build` compiles it once for all models.

A lane that needs attention is copied to a record R and back. Arrays of the caller have one row per job (or a single row
shared by all): constants, initial continuous variables, settings, segments; results are written to the job's own row,
whatever the lane. A row of `segments` is start, end, jump of the load point, values and slopes of the inputs, then
amplitudes, angular frequencies and phases of their harmonics.
"""

from __future__ import annotations

import math

import numpy as np

from steadyslip.kernels.layout import (
    INPUTS,
    MOST_FAILURES,
    SLIP_EVENT,
    Array,
    Cursor,
    Event,
    Final,
    Kind,
    Layout,
    Out,
    Routines,
    Row,
    Setting,
    Status,
    call,
)

BETWEEN = 3  # points that are recorded between the ends of a step whose dense output has stages of its own
Arrays = tuple[Array, Array, Array, Array, Array]
Results = tuple[Array, Array, Array, Array, Array, Array]


def clock(R: Array, tau: float) -> float:
    """Time since the start of the run, at tau into the segment: at its end that of the breakpoint, to the last bit."""
    return float(min(R[Row.START] + tau, R[Row.STOP]) if tau < R[Row.END] else R[Row.STOP])


def solve_balance(R: Array, routines: Routines, guess: float, y: Array) -> float:
    """The w that balances forces, nearest to the guess: bracketed outwards, then safeguarded Newton."""
    w = guess
    call(routines.balance, R, w, y)
    value = y[0]
    if value == 0.0:
        return w
    if not math.isfinite(value):
        return math.nan
    step = 0.5 if value < 0.0 else -0.5
    low = high = w
    found = False
    for _ in range(200):
        trial = w + step
        call(routines.balance, R, trial, y)
        other = y[0]
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
        call(routines.balance, R, w, y)
        value, slope = y[0], y[1]
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


def enter_segment(R: Array, layout: Layout, routines: Routines, j: int, k: int, segments: Array, y: Array) -> bool:
    """Start segment k: jump of the load point, new inputs, velocity from the balance. False if there is none."""
    s = j if segments.shape[0] > 1 else 0
    if k > 0:
        call(routines.restore, R, 0.0, y)
    row = segments[s, k]
    R[Row.SEGMENT] = k
    R[Row.TAU] = 0.0
    R[Row.START] = row[0]
    R[Row.STOP] = row[1]
    R[Row.END] = row[1] - row[0]
    R[layout.continuous] -= row[2]
    R[Row.LOAD_MOVED] += row[2]
    for i in range(INPUTS):
        R[Row.INPUT + i] = row[3 + i]
        R[Row.SLOPE + i] = row[6 + i]
    waves = INPUTS * layout.harmonics
    for i in range(waves):
        R[layout.amplitude + i] = row[9 + i]
        R[layout.omega + i] = row[9 + waves + i]
        R[layout.phase + i] = row[9 + 2 * waves + i]
    w = R[Row.Z]  # the velocity variable before the jump, as a guess
    if layout.massless:
        w = solve_balance(R, routines, w, y)
        R[Row.Z] = w
    call(routines.place, R, w, y)
    call(routines.rates, R, 0.0, y)
    good = math.isfinite(R[Row.V])
    for i in range(layout.size):
        good = good and math.isfinite(R[layout.rate + i])
    return good


def first_step(R: Array, layout: Layout) -> float:
    """A cautious first step: a hundredth of the time in which the fastest variable changes by its scale."""
    rtol = R[Row.RTOL]
    fastest = 0.0
    for i in range(layout.size):
        scale = R[layout.atol + i] / rtol + abs(R[layout.state + i])
        fastest = max(fastest, abs(R[layout.rate + i]) / scale)
    most = R[Row.H]
    return float(min(most, 0.01 * rtol**0.2 / fastest)) if fastest > 0.0 else float(most)


def start_job(
    R: Array, layout: Layout, routines: Routines, j: int, cursor: Array, log: Array, arrays: Arrays, y: Array
) -> bool:
    """Load a job into a lane. False if there is no velocity to start with."""
    constants, initial, settings, segments, times = arrays
    for i in range(layout.rows):
        R[i] = 0.0
    for i in range(layout.constants):
        R[layout.constant + i] = constants[j if constants.shape[0] > 1 else 0, i]
    for i in range(layout.kept):
        R[layout.continuous + i] = initial[j if initial.shape[0] > 1 else 0, i]
    own = settings[j if settings.shape[0] > 1 else 0]
    R[Row.RTOL] = own[Setting.RTOL]
    R[Row.MOST] = own[Setting.MOST_STEPS]
    R[Row.V_HIGH] = own[Setting.V_HIGH]
    R[Row.V_LOW] = own[Setting.V_LOW]
    R[Row.SIGMA_LOW] = own[Setting.SIGMA_LOW]
    R[Row.WATCH] = own[Setting.WATCH]
    R[Row.RECORD] = own[Setting.RECORD]
    R[Row.Z] = own[Setting.GUESS]
    R[Row.Z_SCALE] = own[Setting.Z_SCALE]
    R[Row.V_DRIVE] = own[Setting.V_DRIVE]
    R[Row.H] = own[Setting.FIRST_STEP]
    for i in range(layout.size):
        R[layout.atol + i] = own[Setting.ATOL + i]
    R[Row.ACTIVE] = 1.0
    if not enter_segment(R, layout, routines, j, 0, segments, y):
        return False
    await_sample(R, times)
    R[Row.H] = first_step(R, layout)
    v = R[Row.V]
    R[Row.PEAK_VELOCITY] = v
    R[Row.LOWEST_VELOCITY] = v
    for i in (Row.EVENT_BEGIN, Row.EVENT_PEAK_VELOCITY, Row.RECURRENCE, Row.LAST_PEAK_TIME):  # there is none so far
        R[i] = math.nan
    R[Row.PEAK_PERIOD] = math.nan
    R[Row.PEAK_GROWTH] = math.nan
    R[Row.NOW_BEGIN] = math.nan
    R[Row.LOG] = 1.0 if log.shape[0] > 0 else 0.0
    R[Row.NOW_FROM] = math.inf
    if R[Row.WATCH] > 0.0 and R[layout.mark + Event.SLIP] > 0.0:
        look_now(R, layout, routines, 0.0, y)
        note(R, layout, Kind.SLIP_BEGINS, 0.0, y, log, cursor)
    return True


def look_now(R: Array, layout: Layout, routines: Routines, tau: float, y: Array) -> None:
    """The record's state and outputs, at tau into the segment, in y."""
    for i in range(layout.size):
        y[i] = R[layout.state + i]
    call(routines.outputs, R, tau, y)


def between(R: Array, layout: Layout, routines: Routines, theta: float, y: Array) -> None:
    """The state at the fraction theta of the last step, in y."""
    if layout.extra > 0 and R[Row.EXTENDED] == 0.0:
        call(routines.extend, R, 0.0, y)
    call(routines.dense, R, theta, y)


def look_back(R: Array, layout: Layout, routines: Routines, theta: float, y: Array) -> None:
    """State and outputs at the fraction theta of the last step, in y."""
    between(R, layout, routines, theta, y)
    call(routines.outputs, R, R[Row.TAU_OLD] + theta * R[Row.DONE], y)


def event_function(R: Array, layout: Layout, routines: Routines, kind: int, theta: float, y: Array) -> float:
    """Positive before the event of a kind, not after."""
    look_back(R, layout, routines, theta, y)
    value = y[layout.size + Out.COUNT + (kind - 1) // 2]
    return float(value if kind % 2 == 1 else -value)


def located(R: Array, layout: Layout, routines: Routines, kind: int, y: Array) -> float:
    """Fraction of the last step at which an event happens: regula falsi (Illinois) on the dense output."""
    low, high = 0.0, 1.0
    at_low = event_function(R, layout, routines, kind, low, y)
    at_high = event_function(R, layout, routines, kind, high, y)
    if not at_low > 0.0:
        return 0.0
    if not at_high <= 0.0:
        return 1.0
    side = 0
    for _ in range(100):
        theta = high - at_high * (high - low) / (at_high - at_low)
        if not (low < theta < high):
            theta = 0.5 * (low + high)
        value = event_function(R, layout, routines, kind, theta, y)
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


def follow(
    R: Array, layout: Layout, routines: Routines, cursor: Array, log: Array, y: Array, order: Array
) -> bool:  # fmt: skip
    """Events within the step just taken, in the order of time. True if the contact is lost in it."""
    tau_old, h, v = R[Row.TAU_OLD], R[Row.DONE], R[Row.V]
    count = 0
    for e in range(layout.events if R[Row.HAPPENED] > 0.0 else 0):
        change = R[layout.happened + e]
        if change != 0.0 and (e <= Event.CONTACT or log.shape[0] > 0):
            kind = 2 * e + (2 if change > 0.0 else 1)
            order[count, 0], order[count, 1] = located(R, layout, routines, kind, y), kind
            count += 1
    for _ in range(count):
        first = 0
        for i in range(count):
            if order[i, 0] < order[first, 0]:
                first = i
        theta, kind = order[first, 0], int(order[first, 1])
        order[first, 0] = 2.0
        look_back(R, layout, routines, theta, y)
        tau = tau_old + theta * h
        note(R, layout, kind, tau, y, log, cursor)
        if kind == Kind.LOST:
            R[Row.TAU] = tau
            for i in range(layout.size):
                R[layout.state + i] = y[i]
            for i in range(count):  # what would have come later was counted by the step
                if order[i, 0] < 2.0:
                    R[layout.counted + int(order[i, 1]) - 1] -= 1.0
            return True
    R[Row.HAPPENED] = 0.0
    R[Row.PEAK_VELOCITY] = max(R[Row.PEAK_VELOCITY], v)
    R[Row.LOWEST_VELOCITY] = min(R[Row.LOWEST_VELOCITY], v)
    R[Row.NOW_PEAK] = max(R[Row.NOW_PEAK], v)
    if R[Row.NOW_EVENT] == 0.0 and R[Row.TAU] >= R[Row.END] and v >= SLIP_EVENT * R[Row.NOW_FROM]:
        look_now(R, layout, routines, R[Row.TAU], y)
        quicken(R, layout, y, log, cursor)
    return False


def outrun(R: Array, layout: Layout, slowest: float, tau: float, y: Array) -> None:
    """Keep where a block ahead of the load point was slowest: there its slip begins, if it becomes a slip event."""
    n = layout.size
    R[Row.NOW_FROM] = slowest
    R[Row.NOW_EVENT] = 0.0
    R[Row.NOW_BEGIN] = R[Row.START] + tau
    R[Row.NOW_PEAK] = y[n + Out.V]
    R[Row.NOW_V] = y[n + Out.V]
    R[Row.NOW_SIGMA] = y[n + Out.SIGMA]
    R[Row.NOW_TAU] = y[n + Out.TAU]
    R[Row.NOW_STRESS] = y[n + Out.T]
    R[Row.NOW_X] = y[layout.x] + R[Row.LOAD_MOVED] + y[n + Out.ADVANCE]
    R[Row.NOW_SEGMENT] = R[Row.SEGMENT]


def quicken(R: Array, layout: Layout, y: Array, log: Array, cursor: Array) -> None:
    """Slip becomes a slip event when the block is SLIP_EVENT times as fast as asked and as at its slowest.

    Asked is the velocity of the load point, or of the drive while the load point rests.
    """
    v, v_lp = y[layout.size + Out.V], y[layout.size + Out.V_LP]
    asked = v_lp if v_lp > R[Row.V_LOW] else R[Row.V_DRIVE]
    if R[Row.NOW_EVENT] > 0.0 or not v >= SLIP_EVENT * max(asked, R[Row.NOW_FROM]):
        return
    R[Row.NOW_EVENT] = 1.0
    if log.shape[0] > 0:
        i = cursor[Cursor.LOGGED]
        log[i, 0], log[i, 1], log[i, 2] = Kind.SLIP_BEGINS, R[Row.NOW_BEGIN], R[Row.NOW_V]
        log[i, 3], log[i, 4], log[i, 5] = R[Row.NOW_SIGMA], R[Row.NOW_TAU], R[Row.NOW_STRESS]
        log[i, 6], log[i, 7] = R[Row.NOW_X], R[Row.NOW_SEGMENT]
        cursor[Cursor.LOGGED] = i + 1


def note(R: Array, layout: Layout, kind: int, tau: float, y: Array, log: Array, cursor: Array) -> None:
    """Keep the tally of events, and the log where there is one."""
    n = layout.size
    time = clock(R, tau)
    place = y[layout.x] + R[Row.LOAD_MOVED] + y[n + Out.ADVANCE]
    v, stress = y[n + Out.V], y[n + Out.T]
    if kind == Kind.SLIP_BEGINS:  # logged once it is fast, if ever: see quicken
        outrun(R, layout, v, tau, y)
        return
    is_event = R[Row.NOW_EVENT] > 0.0
    if kind == Kind.SLIP_ENDS:
        R[Row.NOW_FROM] = math.inf
        R[Row.NOW_EVENT] = 0.0
        if not is_event:
            return
    if log.shape[0] > 0:
        i = cursor[Cursor.LOGGED]
        log[i, 0], log[i, 1], log[i, 2], log[i, 3] = kind, time, v, y[n + Out.SIGMA]
        log[i, 4], log[i, 5], log[i, 6], log[i, 7] = y[n + Out.TAU], stress, place, R[Row.SEGMENT]
        cursor[Cursor.LOGGED] = i + 1
    if kind == Kind.SLIP_ENDS:
        begin = R[Row.NOW_BEGIN]
        if R[Row.ANY_BEGIN] > 0.0:  # one that was going on at the start has no beginning of its own
            R[Row.RECURRENCE] = begin - R[Row.EVENT_BEGIN]
        R[Row.ANY_BEGIN] = 1.0 if begin > 0.0 else 0.0
        R[Row.EVENTS] += 1.0
        R[Row.EVENT_BEGIN] = begin
        R[Row.EVENT_DURATION] = time - begin
        R[Row.EVENT_SLIP] = place - R[Row.NOW_X]
        R[Row.EVENT_STRESS_DROP] = R[Row.NOW_STRESS] - stress
        R[Row.EVENT_PEAK_VELOCITY] = R[Row.NOW_PEAK]
    elif kind == Kind.PEAK:
        size = math.log(abs(v / y[n + Out.V_LP])) if y[n + Out.V_LP] != 0.0 else math.inf
        if R[Row.LAST_PEAK_TIME] >= 0.0:
            R[Row.PEAK_PERIOD] = time - R[Row.LAST_PEAK_TIME]
            R[Row.PEAK_GROWTH] = abs(size) - abs(R[Row.PEAK_SIZE])
        R[Row.PEAK_SIZE] = size
        R[Row.LAST_PEAK_TIME] = time
        R[Row.PEAK_VELOCITY] = max(R[Row.PEAK_VELOCITY], v)
        R[Row.NOW_PEAK] = max(R[Row.NOW_PEAK], v)
        quicken(R, layout, y, log, cursor)
    elif kind == Kind.TROUGH:
        R[Row.LOWEST_VELOCITY] = min(R[Row.LOWEST_VELOCITY], v)
        if not is_event and v < R[Row.NOW_FROM] < math.inf:  # what came before was no event
            outrun(R, layout, v, tau, y)


def await_sample(R: Array, times: Array) -> None:
    """How far into the segment the next requested time is, for the kernel's flag."""
    k = int(R[Row.TAKEN])
    R[Row.NEXT] = times[k] - R[Row.START] if k < times.shape[0] else math.inf


def take_samples(
    R: Array, layout: Layout, routines: Routines, row: int, times: Array, samples: Array, at_end: bool, y: Array
) -> None:
    """Write the state at every requested time: before now, from the dense output; `at_end`, now, as it is.

    A breakpoint itself belongs to the segment that begins there, the end of the run to the last one.
    """
    arrived = R[Row.TAU] >= R[Row.END]
    k = int(R[Row.TAKEN])
    while k < times.shape[0]:
        tau = times[k] - R[Row.START]
        if at_end:
            if times[k] > clock(R, R[Row.TAU]):
                break
            for i in range(layout.size):
                y[i] = R[layout.state + i]
        else:
            if times[k] >= R[Row.STOP] or (tau >= R[Row.TAU] and not arrived):
                break
            between(R, layout, routines, min(max((tau - R[Row.TAU_OLD]) / R[Row.DONE], 0.0), 1.0), y)
        for i in range(layout.size):
            samples[row, k, i] = y[i]
        k += 1
    R[Row.TAKEN] = k
    await_sample(R, times)


def record(R: Array, layout: Layout, tau: float, state: Array, first: int, cursor: Array, recorded: Array) -> None:
    """Write down a state, numbers from `first` of an array, at tau into the segment."""
    i = cursor[Cursor.RECORDED]
    recorded[i, 0] = clock(R, tau)
    recorded[i, 1] = R[Row.SEGMENT]
    for c in range(layout.size):
        recorded[i, 2 + c] = state[first + c]
    cursor[Cursor.RECORDED] = i + 1


def record_step(R: Array, layout: Layout, routines: Routines, cursor: Array, recorded: Array, y: Array) -> None:
    """The solver's own step; steps of high order are long, and get points between."""
    for i in range(1, BETWEEN + 1 if layout.extra > 0 else 1):
        theta = i / (BETWEEN + 1)
        between(R, layout, routines, theta, y)
        record(R, layout, R[Row.TAU_OLD] + theta * R[Row.DONE], y, 0, cursor, recorded)
    record(R, layout, R[Row.TAU], R, layout.state, cursor, recorded)


def finish(R: Array, layout: Layout, row: int, status: int, results: Results) -> None:
    """Write a job's results."""
    statuses, final, tally = results[0], results[1], results[2]
    statuses[row] = status
    final[row, Final.TIME] = clock(R, R[Row.TAU])
    final[row, Final.SEGMENT] = R[Row.SEGMENT]
    final[row, Final.ACCEPTED] = R[Row.ACCEPTED]
    final[row, Final.REJECTED] = R[Row.REJECTED]
    for i in range(layout.size):
        final[row, Final.STATE + i] = R[layout.state + i]
    first = Row.PEAK_SIZE - Row.EVENTS
    for i in range(first):
        tally[row, i] = R[Row.EVENTS + i]
    for i in range(2 * layout.events):
        tally[row, first + i] = R[layout.counted + i]
    R[Row.ACTIVE] = 0.0
    R[Row.FLAG] = 0.0


def go_on(
    R: Array, layout: Layout, routines: Routines, j: int, cursor: Array, arrays: Arrays, results: Results, y: Array,
    order: Array,
) -> int:  # fmt: skip
    """Look after a job that has raised its flag. Returns its status."""
    j0 = cursor[Cursor.FIRST_JOB]
    segments, times = arrays[3], arrays[4]
    samples, log, recorded = results[3], results[4], results[5]
    good = R[Row.GOOD] > 0.0
    if layout.massless and layout.w >= 0:
        R[Row.Z] = R[layout.state + layout.w]  # a guess for after the next jump
    if layout.stages > 0 and good:
        lost = R[Row.WATCH] > 0.0 and follow(R, layout, routines, cursor, log, y, order)
        take_samples(R, layout, routines, j - j0, times, samples, False, y)
        if R[Row.RECORD] > 0.0 and lost:
            record(R, layout, R[Row.TAU], R, layout.state, cursor, recorded)
        elif R[Row.RECORD] > 0.0:
            record_step(R, layout, routines, cursor, recorded, y)
        if lost:
            return Status.CONTACT_LOST
    if abs(R[Row.V]) >= R[Row.V_HIGH]:
        return Status.BLOW_UP
    if R[Row.SIGMA] <= R[Row.SIGMA_LOW]:
        return Status.CONTACT_LOST
    if R[Row.FAILURES] >= MOST_FAILURES:
        return Status.STUCK
    if R[Row.ACCEPTED] + R[Row.REJECTED] >= R[Row.MOST]:
        return Status.TOO_MANY_STEPS
    while R[Row.TAU] >= R[Row.END]:
        k = int(R[Row.SEGMENT]) + 1
        s = j if segments.shape[0] > 1 else 0
        if k >= segments.shape[1] or segments[s, k, 1] <= segments[s, k, 0]:  # empty ones fill a lane up
            return Status.DONE
        h, before, slipping = R[Row.H], R[Row.V], R[layout.mark + Event.SLIP]
        if not enter_segment(R, layout, routines, j, k, segments, y):
            return Status.NO_VELOCITY
        await_sample(R, times)
        R[Row.H] = h
        if R[Row.RECORD] > 0.0:
            record(R, layout, R[Row.TAU], R, layout.state, cursor, recorded)
        if R[Row.WATCH] > 0.0:
            crossed(R, layout, routines, before, slipping > 0.0, cursor, log, y)
    return Status.RUNNING


def crossed(
    R: Array, layout: Layout, routines: Routines, before: float, was_slipping: bool, cursor: Array, log: Array,
    y: Array,
) -> None:  # fmt: skip
    """A jump from the velocity `before` can begin or end a slip event at once."""
    look_now(R, layout, routines, 0.0, y)
    v = y[layout.size + Out.V]
    slipping = R[layout.mark + Event.SLIP] > 0.0
    if slipping != was_slipping:
        note(R, layout, Kind.SLIP_BEGINS if slipping else Kind.SLIP_ENDS, 0.0, y, log, cursor)
    if slipping and R[Row.NOW_EVENT] == 0.0 and before < min(v, R[Row.NOW_FROM]):
        outrun(R, layout, before, 0.0, y)
        quicken(R, layout, y, log, cursor)
    R[Row.PEAK_VELOCITY] = max(R[Row.PEAK_VELOCITY], v)
    R[Row.LOWEST_VELOCITY] = min(R[Row.LOWEST_VELOCITY], v)


def attend(
    R: Array, layout: Layout, routines: Routines, lane: int, ids: Array, cursor: Array, arrays: Arrays,
    results: Results, y: Array, order: Array,
) -> None:  # fmt: skip
    """Whatever a flagged lane needs: go on with its job, or finish it and take the next one."""
    j = ids[lane]
    if j >= 0:
        status = go_on(R, layout, routines, j, cursor, arrays, results, y, order)
        R[Row.FLAG] = 0.0
        if status == Status.RUNNING:
            return
        if status != Status.NO_VELOCITY:  # there is no state after that jump
            take_samples(R, layout, routines, j - cursor[Cursor.FIRST_JOB], arrays[4], results[3], True, y)
        finish(R, layout, j - cursor[Cursor.FIRST_JOB], status, results)
    while cursor[Cursor.NEXT_JOB] < cursor[Cursor.LAST_JOB]:
        j = cursor[Cursor.NEXT_JOB]
        cursor[Cursor.NEXT_JOB] = j + 1
        ids[lane] = j
        if start_job(R, layout, routines, j, cursor, results[4], arrays, y):
            if R[Row.RECORD] > 0.0:
                record(R, layout, R[Row.TAU], R, layout.state, cursor, results[5])
            return
        finish(R, layout, j - cursor[Cursor.FIRST_JOB], Status.NO_VELOCITY, results)
    ids[lane] = -1
    cursor[Cursor.BUSY] -= 1
    for i in range(layout.rows):
        R[i] = 0.0
    R[Row.RTOL] = 1.0
    R[Row.H] = 1e-3
    R[Row.END] = 1e300


def flagged(S: Array, lanes: int) -> int:
    """How many lanes need attention."""
    count = 0
    for lane in range(lanes):
        count += 1 if S[Row.FLAG * lanes + lane] != 0.0 else 0
    return count


def advance(
    layout: Layout, routines: Routines, S: Array, ids: Array, cursor: Array, constants: Array, initial: Array,
    settings: Array, segments: Array, times: Array, statuses: Array, final: Array, tally: Array, samples: Array,
    log: Array, recorded: Array, quota: int,
) -> int:  # fmt: skip
    """Advance all jobs of `cursor`.

    Returns
    -------
    int
        0 when they are done, 1 if a buffer is full, 2 if `quota` steps are taken.
    """
    arrays = (constants, initial, settings, segments, times)
    results = (statuses, final, tally, samples, log, recorded)
    lanes = layout.lanes
    y, order = np.empty(layout.size + Out.COUNT + layout.events), np.empty((layout.events, 2))
    R = S if lanes == 1 else np.zeros(layout.rows)
    together = layout.watched > 0 and log.shape[0] == 0 and settings[0, Setting.WATCH] > 0.0
    steps = 0
    if cursor[Cursor.PAUSED] < 0:
        for lane in range(lanes):
            ids[lane] = -1
            S[Row.FLAG * lanes + lane] = 1.0
        cursor[Cursor.PAUSED] = 1
    while cursor[Cursor.BUSY] > 0:
        if cursor[Cursor.PAUSED] == 0:
            call(routines.step, S, 0.0, y)
            steps += 1
        cursor[Cursor.PAUSED] = 0
        attention = flagged(S, lanes)
        if attention > 0 and together:
            call(routines.watch_lanes, S, 0.0, y)
            attention = flagged(S, lanes)
        if attention > 0:
            if (log.shape[0] > 0 and cursor[Cursor.LOGGED] + 16 * lanes > log.shape[0]) or (
                recorded.shape[0] > 0 and cursor[Cursor.RECORDED] + (4 + BETWEEN) * lanes > recorded.shape[0]
            ):
                cursor[Cursor.PAUSED] = 1
                return 1
            for lane in range(lanes):
                if S[Row.FLAG * lanes + lane] != 0.0:
                    if lanes > 1:
                        for i in range(layout.rows):
                            R[i] = S[i * lanes + lane]
                    attend(R, layout, routines, lane, ids, cursor, arrays, results, y, order)
                    if lanes > 1:
                        for i in range(layout.rows):
                            S[i * lanes + lane] = R[i]
        if steps >= quota:
            return 2
    return 0


def placed(
    R: Array, layout: Layout, routines: Routines, constants: Array, settings: Array, state: Array, inputs: Array,
    own: int, y: Array,
) -> None:  # fmt: skip
    """Bring a given state into a record, balance solved where there is one left to solve."""
    for i in range(layout.constants):
        R[layout.constant + i] = constants[own if constants.shape[0] > 1 else 0, i]
    R[Row.Z_SCALE] = settings[own if settings.shape[0] > 1 else 0, Setting.Z_SCALE]
    R[Row.START] = inputs[6]
    for i in range(INPUTS):
        R[Row.INPUT + i] = inputs[i]
        R[Row.SLOPE + i] = inputs[3 + i]
    R[Row.TAU] = 0.0
    for i in range(layout.size):
        R[layout.state + i] = state[i]
    if layout.solved:
        for i in range(layout.kept):
            R[layout.continuous + i] = state[i]
        R[Row.Z] = solve_balance(R, routines, R[Row.Z], y)
    for i in range(layout.size):
        y[i] = state[i]


def observe(
    layout: Layout, routines: Routines, constants: Array, settings: Array, states: Array, inputs: Array, own: Array,
    values: Array,
) -> None:  # fmt: skip
    """Outputs and continuous variables at given states.

    `states` is (m, size); `inputs` (m, 7) holds v_lp, q, p, their slopes and the time; `own` the rig's row.
    `values` is (m, 5 + kept).
    """
    R, y = np.zeros(layout.rows), np.empty(layout.size + Out.COUNT + layout.events)
    rig = -1
    for m in range(states.shape[0]):
        if own[m] != rig:
            rig = own[m]
            R[Row.Z] = settings[rig if settings.shape[0] > 1 else 0, Setting.GUESS]
        placed(R, layout, routines, constants, settings, states[m], inputs[m], rig, y)
        call(routines.outputs, R, 0.0, y)
        for i in range(5):
            values[m, i] = y[layout.size + i]
        call(routines.restore, R, 0.0, y)
        for i in range(layout.kept):
            values[m, 5 + i] = R[layout.continuous + i]


def field(
    layout: Layout, routines: Routines, constants: Array, settings: Array, states: Array, inputs: Array, own: Array,
    values: Array,
) -> None:  # fmt: skip
    """Rates at given states, (m, size); arguments as for `observe`."""
    R, y = np.zeros(layout.rows), np.empty(layout.size + Out.COUNT + layout.events)
    for m in range(states.shape[0]):
        R[Row.Z] = settings[own[m] if settings.shape[0] > 1 else 0, Setting.GUESS]
        placed(R, layout, routines, constants, settings, states[m], inputs[m], own[m], y)
        call(routines.rates, R, 0.0, y)
        for i in range(layout.size):
            values[m, i] = R[layout.rate + i]
