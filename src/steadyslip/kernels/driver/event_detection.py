"""Detection of events: sign changes of event functions within a step or in a jump."""

from __future__ import annotations

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.interpolate import state_at_fraction, state_now
from steadyslip.kernels.driver.places import (
    event_functions_at,
    events_per_contact,
    guess_at,
    outputs_at,
    slip_sense,
    tally_at,
    unknown_at,
    velocity_at,
)
from steadyslip.kernels.driver.slip import mark_fast, record_event, track_slowest
from steadyslip.kernels.layout import SLIP_EVENT, EventPlace, Kind, Layout, Out, Routines, Row

MOST_BISECTIONS = 100  # most iterations of regula falsi, which needs about ten; bisection alone would need 44
LOCATED = 1e-13  # share of a step within which an event is located: some hundred rounding errors


def event_function(R: Array, layout: Layout, routines: Routines, kind: int, theta: float, y: Array) -> float:
    """Value of the event function of a `Kind` at the fraction theta of the last step; positive before the event."""
    state_at_fraction(R, layout, routines, theta, y)
    value = y[event_functions_at(layout) + (kind - 1) // 2]
    return float(value if kind % 2 == 1 else -value)


def located(R: Array, layout: Layout, routines: Routines, kind: int, y: Array) -> float:
    """Fraction of the last step at which an event of a `Kind` happens, by regula falsi (Illinois) on dense output."""
    low, high = 0.0, 1.0
    at_low = event_function(R, layout, routines, kind, low, y)
    at_high = event_function(R, layout, routines, kind, high, y)
    if not at_low > 0.0:
        return 0.0
    if not at_high <= 0.0:
        return 1.0
    side = 0
    for _ in range(MOST_BISECTIONS):
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
        if high - low < LOCATED or value == 0.0:
            break
    return high


def process_events(
    R: Array, layout: Layout, routines: Routines, cursor: Array, log: Array, y: Array, order: Array
) -> bool:  # fmt: skip
    """Record the events of the last step in order of time.

    If contact is lost, the step ends there, and True is returned.
    """
    tau_old, h = R[Row.TAU_OLD], R[Row.STEP_SIZE]
    each, count = events_per_contact(layout), 0
    for e in range(layout.events if R[Row.EVENT_COUNT] > 0.0 else 0):
        change = R[layout.sign_change + e]
        if change != 0.0 and (e % each <= EventPlace.BACKWARD or log.shape[0] > 0):
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
        state_at_fraction(R, layout, routines, theta, y)
        tau = tau_old + theta * h
        record_event(R, layout, kind, tau, y, log, cursor)
        if kind % (2 * each) == Kind.LOST:
            R[Row.TAU] = tau
            for k in range(max(layout.unknowns, 1)):
                R[guess_at(layout, k)] = y[unknown_at(layout, k)]
            for i in range(layout.size):
                R[layout.state + i] = y[i]
            for i in range(count):  # the step has counted later events, which no longer happen
                if order[i, 0] < 2.0:
                    R[layout.event_count + int(order[i, 1]) - 1] -= 1.0
            return True
    R[Row.EVENT_COUNT] = 0.0
    for c in range(layout.contacts):
        own, v = tally_at(layout, c), velocity_at(R, layout, c)
        R[own + Row.PEAK_VELOCITY] = max(R[own + Row.PEAK_VELOCITY], v)
        R[own + Row.LOWEST_VELOCITY] = min(R[own + Row.LOWEST_VELOCITY], v)
        speed = R[own + Row.NOW_SIGN] * v
        R[own + Row.NOW_PEAK] = max(R[own + Row.NOW_PEAK], speed)
        if R[Row.TAU] >= R[Row.LENGTH] and speed >= SLIP_EVENT * R[own + Row.NOW_FROM]:
            state_now(R, layout, routines, R[Row.TAU], y)
            mark_fast(R, layout, c, y)
    return False


def save_before_jump(R: Array, layout: Layout) -> None:
    """Store velocity and slip state of each contact before a jump, for `events_of_jump`."""
    for c in range(layout.contacts if layout.events > 0 else 0):
        R[layout.before_jump + 2 * c] = velocity_at(R, layout, c)
        R[layout.before_jump + 2 * c + 1] = slip_sense(R, layout, c)


def events_of_jump(R: Array, layout: Layout, routines: Routines, cursor: Array, log: Array, y: Array) -> None:
    """Record the events that a jump causes: begin and end of slip and of slip events."""
    state_now(R, layout, routines, 0.0, y)
    for c in range(layout.contacts):
        own, each, v = tally_at(layout, c), events_per_contact(layout), y[outputs_at(layout, c) + Out.V]
        before, sense = R[layout.before_jump + 2 * c + 1], slip_sense(R, layout, c)
        if sense != before and before != 0.0:
            kind = Kind.SLIP_ENDS if before > 0.0 else Kind.BACKWARD_ENDS
            record_event(R, layout, kind + 2 * each * c, 0.0, y, log, cursor)
        if sense != before and sense != 0.0:
            kind = Kind.SLIP_BEGINS if sense > 0.0 else Kind.BACKWARD_BEGINS
            record_event(R, layout, kind + 2 * each * c, 0.0, y, log, cursor)
        speed = sense * R[layout.before_jump + 2 * c]
        if sense != 0.0 and R[own + Row.NOW_EVENT] == 0.0 and speed < min(sense * v, R[own + Row.NOW_FROM]):
            track_slowest(R, layout, c, speed, 0.0, y)
            mark_fast(R, layout, c, y)
        R[own + Row.PEAK_VELOCITY] = max(R[own + Row.PEAK_VELOCITY], v)
        R[own + Row.LOWEST_VELOCITY] = min(R[own + Row.LOWEST_VELOCITY], v)
