"""Events: where their functions change sign, within a step or in a jump."""

from __future__ import annotations

from steadyslip.kernels.driver.looking import look_back, look_now
from steadyslip.kernels.driver.places import guess_at, kinds, marks_at, outputs_at, tally_at, unknown_at, velocity_at
from steadyslip.kernels.driver.slip import note, outrun, quicken
from steadyslip.kernels.layout import SLIP_EVENT, Array, EventPlace, Kind, Layout, Out, Routines, Row


def event_function(R: Array, layout: Layout, routines: Routines, kind: int, theta: float, y: Array) -> float:
    """Positive before the event of a kind, not after."""
    look_back(R, layout, routines, theta, y)
    value = y[marks_at(layout) + (kind - 1) // 2]
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
    tau_old, h = R[Row.TAU_OLD], R[Row.DONE]
    each, count = kinds(layout), 0
    for e in range(layout.events if R[Row.HAPPENED] > 0.0 else 0):
        change = R[layout.happened + e]
        if change != 0.0 and (e % each <= EventPlace.CONTACT or log.shape[0] > 0):
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
        if kind % (2 * each) == Kind.LOST:
            R[Row.TAU] = tau
            for k in range(max(layout.unknowns, 1)):
                R[guess_at(layout, k)] = y[unknown_at(layout, k)]
            for i in range(layout.size):
                R[layout.state + i] = y[i]
            for i in range(count):  # what would have come later was counted by the step
                if order[i, 0] < 2.0:
                    R[layout.counted + int(order[i, 1]) - 1] -= 1.0
            return True
    R[Row.HAPPENED] = 0.0
    for c in range(layout.contacts):
        own, v = tally_at(layout, c), velocity_at(R, layout, c)
        R[own + Row.PEAK_VELOCITY] = max(R[own + Row.PEAK_VELOCITY], v)
        R[own + Row.LOWEST_VELOCITY] = min(R[own + Row.LOWEST_VELOCITY], v)
        R[own + Row.NOW_PEAK] = max(R[own + Row.NOW_PEAK], v)
        if R[own + Row.NOW_EVENT] == 0.0 and R[Row.TAU] >= R[Row.END] and v >= SLIP_EVENT * R[own + Row.NOW_FROM]:
            look_now(R, layout, routines, R[Row.TAU], y)
            quicken(R, layout, c, y, log, cursor)
    return False


def before_jump(R: Array, layout: Layout) -> None:
    """Keep velocities and which contacts slip, for `crossed`."""
    for c in range(layout.contacts if layout.events > 0 else 0):
        R[layout.jumped + 2 * c] = velocity_at(R, layout, c)
        R[layout.jumped + 2 * c + 1] = R[layout.mark + kinds(layout) * c + EventPlace.SLIP]


def crossed(R: Array, layout: Layout, routines: Routines, cursor: Array, log: Array, y: Array) -> None:
    """A jump can begin or end a slip event at once."""
    look_now(R, layout, routines, 0.0, y)
    for c in range(layout.contacts):
        own, each, v = tally_at(layout, c), kinds(layout), y[outputs_at(layout, c) + Out.V]
        before, was_slipping = R[layout.jumped + 2 * c], R[layout.jumped + 2 * c + 1] > 0.0
        slipping = R[layout.mark + each * c + EventPlace.SLIP] > 0.0
        if slipping != was_slipping:
            kind = Kind.SLIP_BEGINS if slipping else Kind.SLIP_ENDS
            note(R, layout, kind + 2 * each * c, 0.0, y, log, cursor)
        if slipping and R[own + Row.NOW_EVENT] == 0.0 and before < min(v, R[own + Row.NOW_FROM]):
            outrun(R, layout, c, before, 0.0, y)
            quicken(R, layout, c, y, log, cursor)
        R[own + Row.PEAK_VELOCITY] = max(R[own + Row.PEAK_VELOCITY], v)
        R[own + Row.LOWEST_VELOCITY] = min(R[own + Row.LOWEST_VELOCITY], v)
