"""Motion of a rig that holds a place, as long as its `HeldMode` (sticking contacts, active limits) does not change.

The state is that of `steadyslip.nonlinear.hunting.plant`. The motion of a linear system over a fixed time is a product
with one matrix (a *passage*), also between two samples of a controller, as its force is constant there. With bristles
the motion is integrated by steps of `bristles`. Before a step in which the mode may change, control returns to the
caller.
"""

from __future__ import annotations

import math

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.bristles import Bristles, Space, take_step
from steadyslip.kernels.layout import Control, Held, Layout, Routines, Turn

NODES = 33  # number of evenly spaced points of a step or passage at which its values are evaluated
SAME = 1e-9  # two lengths of time are equal if they differ by less than this share of a sample time (rounding)
RESTED = 0.002  # shortest time between stored rows at rest, over the duration of the rest; the force then grows evenly
WHOLE = 6755399441055744.0  # 1.5 * 2**52: adding and then subtracting it rounds a float to an integer, halves to even


def rounded_to(value: float, step: float) -> float:
    """Multiple of `step` that is nearest to a value."""
    count = value / step
    return float(step * (count + WHOLE - WHOLE)) if abs(count) < 2.0**51 else value


def beyond_band(error: float, band: float) -> float:
    """Error minus the nearer end of the dead band; 0 within the band."""
    return error - band if error > band else error + band if error < -band else 0.0


def wanted_force(Y: Array, control: Array, loops: Array) -> float:
    """Force that the controller requests after a sample; updates integral and remembered places.

    A row of `loops` is gain, damping, place at the last sample, then the shares of the coordinates in the place. The
    integral grows by the error times the sample time; derivatives are differences of the last two samples.
    """
    size = loops.shape[1] - 3
    target, aim, band = Y[2 * size + 1], control[Control.AIM], control[Control.BAND]
    period, gain = control[Control.PERIOD], control[Control.INTEGRAL]
    integral, wanted = Y[2 * size], 0.0
    for loop in range(loops.shape[0]):
        place, before = 0.0, loops[loop, 2]
        for i in range(size):
            place += loops[loop, 3 + i] * Y[i]
        if control[Control.RESOLUTION] > 0.0 and loop < control[Control.ROUNDED]:
            place = rounded_to(place, control[Control.RESOLUTION])
        moved = before - place
        error = target - place
        if control[Control.ON_MEASUREMENT] == 0.0:
            moved += target - aim
        elif loop > 0:
            error = -place
        rate = moved / period
        if loop == 0:
            banded = beyond_band(error, band)
            if control[Control.BANDS_RATE] > 0.0:
                rate = (banded - beyond_band(aim - before, band)) / period
            if gain > 0.0 or gain < 0.0:
                most = control[Control.MOST_INTEGRAL] / gain
                integral = min(most, max(-most, integral + period * banded))
            if control[Control.OF_INTEGRAL] == 0.0:
                error = banded
        wanted += loops[loop, 0] * error + loops[loop, 1] * rate
        loops[loop, 2] = place
    wanted += gain * integral
    wanted = min(control[Control.MOST_FORCE], max(-control[Control.MOST_FORCE], wanted))
    same = integral == Y[2 * size] and wanted == Y[2 * size + 3] and control[Control.LATE] == 0.0
    control[Control.CONSTANT] = 1.0 if same else 0.0
    control[Control.AIM] = target
    Y[2 * size] = integral
    return float(wanted)


def sample_if_due(Y: Array, clock: Array, control: Array, loops: Array, late: Array) -> None:
    """Take a sample, and apply a delayed force, if one of these is due.

    A row of `late` is the time of action (s) and the force.
    """
    held, now = 2 * (loops.shape[1] - 3) + 3, clock[Held.TIME]
    was = Y[held]
    if now >= control[Control.COUNT] * control[Control.PERIOD]:
        wanted = wanted_force(Y, control, loops)
        waiting = int(control[Control.LATE])
        late[waiting, 0], late[waiting, 1] = now + control[Control.DELAY], wanted
        control[Control.LATE] += 1.0
        control[Control.COUNT] += 1.0
    while control[Control.LATE] > 0.0 and late[0, 0] <= now:
        Y[held] = late[0, 1]
        control[Control.LATE] -= 1.0
        for i in range(int(control[Control.LATE])):
            late[i, 0], late[i, 1] = late[i + 1, 0], late[i + 1, 1]
    if Y[held] != was:
        clock[Held.CHANGED] = 1.0


def next_instant(control: Array, late: Array) -> float:
    """Time (s) of the next sample or of the next change of force, whichever is earlier."""
    sample = control[Control.COUNT] * control[Control.PERIOD]
    return float(min(sample, late[0, 0])) if control[Control.LATE] > 0.0 else float(sample)


def least_of(row: Array, way: int) -> float:
    """Minimum of values at evenly spaced nodes, refined by a parabola.

    Of −values if `way` is 1, of −|values| if it is 2.
    """
    best, least = 0, math.inf
    for i in range(NODES):
        value = row[i] if way == 0 else -row[i] if way == 1 else -abs(row[i])
        if value < least:
            best, least = i, value
    if best == 0 or best == NODES - 1:
        return least
    sense = 1.0 if way == 0 else -1.0
    before, after = sense * row[best - 1], sense * row[best + 1]
    if way == 2:
        before, after = -abs(before), -abs(after)
    bend = before + after - 2.0 * least
    return least - (after - before) ** 2.0 / (8.0 * bend) if bend > 0.0 else least


def keep_values(values: Array, clock: Array, rows: Array, length: float) -> None:
    """Append values (error, speed, force, ...) at the nodes of a step to `rows`; update the extremes of the stroke.

    The step begins at `Held.TIME`. At rest only some steps are stored (`RESTED`).
    """
    now, row = clock[Held.TIME], int(clock[Held.ROWS])
    clock[Held.STEPS] += 1.0
    if clock[Held.RESTS] == 0.0 or now - clock[Held.LAST_ROW] >= RESTED * (now - clock[Held.SINCE]):
        clock[Held.LAST_ROW] = now
        for i in range(0, NODES, int(clock[Held.EVERY])):
            rows[row, 0] = now + length * i / (NODES - 1.0)
            for k in range(values.shape[0]):
                rows[row, 1 + k] = values[k, i]
            row += 1
        clock[Held.ROWS] = row
    clock[Held.LOWEST] = min(float(clock[Held.LOWEST]), least_of(values[0], 0))
    clock[Held.HIGHEST] = max(float(clock[Held.HIGHEST]), -least_of(values[0], 1))
    clock[Held.FASTEST] = max(float(clock[Held.FASTEST]), -least_of(values[1], 2))


def may_fail(coefficients: Array, first: int, count: int) -> bool:
    """True if a polynomial may have a value <= 0 on 0..1; its coefficients start at index `first`.

    Between two nodes the polynomial is below their values by at most its second derivative times an eighth of the
    squared spacing.
    """
    rest, bend, least = 0.0, 0.0, math.inf
    for k in range(1, count):
        rest += abs(coefficients[first + k])
        bend += k * (k - 1.0) * abs(coefficients[first + k])
    if coefficients[first] > rest:
        return False
    for i in range(NODES):
        share, value = i / (NODES - 1.0), 0.0
        for k in range(count):
            value = value * share + coefficients[first + count - 1 - k]
        least = min(least, value)
    return not least > bend / (8.0 * (NODES - 1.0) ** 2.0)


def wants_look(Y: Array, clock: Array, control: Array, size: int, exact: bool) -> bool:
    """True if the caller must decide whether to go on: all speeds are small, or the error is beyond `Held.FAR`."""
    if max(float(clock[Held.HIGHEST]), -float(clock[Held.LOWEST])) > clock[Held.FAR]:
        return True
    if (control[Control.PERIOD] > 0.0 and control[Control.CONSTANT] == 0.0) or Y[2 * size + 2] != 0.0:
        return False
    slow = True
    if exact and control[Control.PERIOD] > 0.0:
        slow = clock[Held.RESTS] > 0.0
    else:
        pace = clock[Held.STILL] * max(float(clock[Held.PACE]), float(clock[Held.FASTEST]))
        for i in range(size):
            slow = slow and abs(Y[size + i]) <= pace
    return slow


def pass_span(
    passage: Array, count: int, guards: int, degrees: int, Y: Array, clock: Array, rows: Array, out: Array,
    values: Array,
) -> int:  # fmt: skip
    """Advance to `Held.STOP` by `count` equal passages; returns a `Turn`.

    The product of `passage` and the state gives the new state, the guards' polynomials, and the values at the nodes.
    """
    size, start = Y.shape[0], clock[Held.TIME]
    length = (clock[Held.STOP] - start) / count
    for part in range(count):
        for i in range(passage.shape[0]):
            total = 0.0
            for j in range(size):
                total += passage[i, j] * Y[j]
            out[i] = total
        for g in range(guards):
            if may_fail(out, size + degrees * g, degrees):
                return Turn.STEP
        for k in range(values.shape[0]):
            for i in range(NODES):
                values[k, i] = out[size + degrees * guards + NODES * k + i]
        keep_values(values, clock, rows, length)
        for i in range(size):
            Y[i] = out[i]
        clock[Held.TIME] = start + length * (part + 1)
    clock[Held.TIME] = clock[Held.STOP]
    return Turn.LOOK


def step_span(
    layout: Layout, routines: Routines, bristles: Bristles, space: Space, guards: Array, watched: Array, Y: Array,
    clock: Array, control: Array, coordinates: int, rows: Array, found: Array, out: Array, values: Array,
) -> int:  # fmt: skip
    """Advance by steps with bristles to `Held.STOP`, or until the caller must act (`Turn`, which is returned)."""
    size, orders = Y.shape[0], found.shape[0]
    while clock[Held.TIME] < clock[Held.STOP]:
        if clock[Held.STEPS] >= clock[Held.MOST_STEPS]:
            return Turn.LOOK
        wished = clock[Held.LENGTH]
        most = clock[Held.STOP] - clock[Held.TIME]
        length = take_step(layout, routines, bristles, space, Y, clock, most, found)
        if length == 0.0:
            return Turn.STUCK
        for g in range(guards.shape[0]):
            for k in range(orders):
                total = 0.0
                for i in range(size):
                    total += guards[g, i] * found[k, i]
                out[k] = total
            if may_fail(out, 0, orders):
                clock[Held.LENGTH] = wished
                return Turn.STEP
        for k in range(watched.shape[0]):
            for m in range(orders):
                total = 0.0
                for i in range(size):
                    total += watched[k, i] * found[m, i]
                out[m] = total
            for i in range(NODES):
                share, total = i / (NODES - 1.0), 0.0
                for m in range(orders):
                    total = total * share + out[orders - 1 - m]
                values[k, i] = total
        keep_values(values, clock, rows, length)
        for i in range(size):
            total = 0.0
            for m in range(orders):
                total += found[m, i]
            Y[i] = total
        now = clock[Held.TIME] + length
        clock[Held.TIME] = clock[Held.STOP] if now + 1e-15 * abs(clock[Held.STOP]) >= clock[Held.STOP] else now
        if wants_look(Y, clock, control, coordinates, False):
            return Turn.LOOK
    return Turn.LOOK


def passage_of(lengths: Array, span: float, period: float) -> int:
    """Index of the passage whose length is `span` (s); -1 if there is none."""
    for p in range(lengths.shape[0]):
        if abs(lengths[p, 0] - span) <= SAME * period:
            return p
    return -1


def follow_held(
    layout: Layout, routines: Routines, R: Array, tableau: Array, A: Array, G: Array, H: Array, scale: Array,
    guards: Array, watched: Array, lengths: Array, passages: Array, loops: Array, late: Array, Y: Array, clock: Array,
    control: Array, rows: Array, fresh: int,
) -> int:  # fmt: skip
    """Advance up to `Held.END`, from sample to sample if the controller samples.

    Returns what the caller must do (`Turn`).

    Each passage has a row of `lengths`: time (s) and number of equal parts; without samples there is one passage. If
    `fresh`, only the sample that is due is taken, and the step after it is left to the caller. `rows` must have room
    for the steps up to `Held.MOST_STEPS` and one more span.
    """
    size, count, outputs, number = Y.shape[0], G.shape[0], H.shape[1], guards.shape[0]
    coordinates = loops.shape[1] - 3
    bristles = (R, tableau, A, G, H, scale)
    space = (
        np.zeros((size, size)), np.zeros((size, size)), np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size),
        np.zeros(count + outputs + count * outputs), np.zeros((tableau.shape[1], size)),
    )  # fmt: skip
    found, values, out = np.zeros((5, size)), np.zeros((watched.shape[0], NODES)), np.zeros(passages.shape[1] + 5)
    degrees = (passages.shape[1] - size - watched.shape[0] * NODES) // number if number > 0 else 0
    while clock[Held.TIME] < clock[Held.END] and clock[Held.STEPS] < clock[Held.MOST_STEPS]:
        clock[Held.STOP] = clock[Held.END]
        if control[Control.PERIOD] > 0.0:
            sample_if_due(Y, clock, control, loops, late)
            clock[Held.STOP] = min(float(clock[Held.END]), next_instant(control, late))
        if fresh:
            return Turn.STEP
        if count > 0:
            turn = step_span(
                layout, routines, bristles, space, guards, watched, Y, clock, control, coordinates, rows, found, out,
                values,
            )  # fmt: skip
        else:
            p = 0
            if control[Control.PERIOD] > 0.0:
                p = passage_of(lengths, clock[Held.STOP] - clock[Held.TIME], control[Control.PERIOD])
            elif clock[Held.END] - clock[Held.TIME] < lengths[0, 0]:
                return Turn.STEP
            else:
                clock[Held.STOP] = clock[Held.TIME] + lengths[0, 0]
            if p < 0:
                return Turn.LENGTH
            turn = pass_span(passages[p], int(lengths[p, 1]), number, degrees, Y, clock, rows, out, values)
        if turn != Turn.LOOK or clock[Held.TIME] < clock[Held.STOP]:
            return turn
        clock[Held.CHANGED] = 0.0
        if wants_look(Y, clock, control, coordinates, count == 0):
            return Turn.LOOK
    return Turn.LOOK
