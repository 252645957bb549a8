"""Log and statistics of events per contact, and the distinction of slip events from slow slip and ringing."""

from __future__ import annotations

import math

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.places import events_per_contact, outputs_at, tally_at
from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import ALIKE, EVENT_SHARE, NUMBER, RESTED, SLIP_EVENT, Cursor, Kind, Layout, Out, Row


def track_slowest(R: Array, layout: Layout, contact: int, slowest: float, tau: float, y: Array) -> None:
    """Store the state at the lowest speed of the slip in progress, from which a slip event is measured."""
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    R[own + Row.NOW_FROM] = slowest
    R[own + Row.NOW_EVENT] = 0.0
    R[own + Row.NOW_BEGIN] = R[Row.START] + tau
    R[own + Row.NOW_PEAK] = R[own + Row.NOW_SIGN] * y[n + Out.V]
    R[own + Row.NOW_V] = y[n + Out.V]
    R[own + Row.NOW_SIGMA] = y[n + Out.SIGMA]
    R[own + Row.NOW_TAU] = y[n + Out.TAU]
    R[own + Row.NOW_STRESS] = y[n + Out.T]
    R[own + Row.NOW_X] = y[n + Out.PLACE]
    R[own + Row.NOW_SEGMENT] = R[Row.SEGMENT]


def mark_fast(R: Array, layout: Layout, contact: int, y: Array) -> None:
    """Mark the slip in progress as fast if its speed is SLIP_EVENT times its lowest, and the load point's.

    While the load point rests, the velocity of the drive is used in place of the load point's.
    """
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    speed, v_lp, share = R[own + Row.NOW_SIGN] * y[n + Out.V], abs(y[n + Out.V_LP]), y[n + Out.SHARE]
    least = v_lp if v_lp > R[Row.V_LOW] * share else R[Row.V_DRIVE] * share
    if speed >= SLIP_EVENT * max(least, R[own + Row.NOW_FROM]):
        R[own + Row.NOW_EVENT] = 1.0


def log_begin(R: Array, layout: Layout, contact: int, kind: int, number: float, log: Array, cursor: Array) -> None:
    """Add the begin of the slip in progress to the log, if a log is kept."""
    if log.shape[0] > 0:
        own, i = tally_at(layout, contact), cursor[Cursor.LOGGED]
        log[i, 0] = kind + 2 * events_per_contact(layout) * contact
        log[i, 1], log[i, 2] = R[own + Row.NOW_BEGIN], R[own + Row.NOW_V]
        log[i, 3], log[i, 4], log[i, 5] = R[own + Row.NOW_SIGMA], R[own + Row.NOW_TAU], R[own + Row.NOW_STRESS]
        log[i, 6], log[i, 7], log[i, NUMBER] = R[own + Row.NOW_X], R[own + Row.NOW_SEGMENT], number
        cursor[Cursor.LOGGED] = i + 1


def log_event(
    R: Array, layout: Layout, number: int, tau: float, y: Array, log: Array, cursor: Array, count: float
) -> None:  # fmt: skip
    """Add an event to the log, if a log is kept."""
    if log.shape[0] > 0:
        n, i = outputs_at(layout, (number - 1) // (2 * events_per_contact(layout))), cursor[Cursor.LOGGED]
        log[i, 0], log[i, 1], log[i, 2], log[i, 3] = number, clock(R, tau), y[n + Out.V], y[n + Out.SIGMA]
        log[i, 4], log[i, 5], log[i, 6] = y[n + Out.TAU], y[n + Out.T], y[n + Out.PLACE]
        log[i, 7], log[i, NUMBER] = R[Row.SEGMENT], count
        cursor[Cursor.LOGGED] = i + 1


def count_ring(R: Array, layout: Layout, contact: int, log: Array, cursor: Array) -> None:
    """Count forward slip with a small stress drop as ringing after the last slip event."""
    own = tally_at(layout, contact)
    if R[own + Row.EVENT_RINGS] > 0.0:
        R[own + Row.EVENT_RING_FREQUENCY] = 1.0 / (R[own + Row.NOW_BEGIN] - R[own + Row.LAST_RING])
    R[own + Row.EVENT_RINGS] += 1.0
    R[own + Row.LAST_RING] = R[own + Row.NOW_BEGIN]
    log_begin(R, layout, contact, Kind.SLIP_BEGINS, 0.0, log, cursor)


def begin_event(R: Array, layout: Layout, contact: int, log: Array, cursor: Array) -> None:
    """Count the slip in progress as a new slip event."""
    own = tally_at(layout, contact)
    sign, begin = R[own + Row.NOW_SIGN], R[own + Row.NOW_BEGIN]
    last = Row.FORWARD_BEGIN if sign > 0.0 else Row.BACKWARD_BEGIN
    R[own + Row.RECURRENCE] = begin - R[own + last]
    R[own + last] = begin if begin > 0.0 else math.nan  # the begin of slip already in progress at t = 0 is unknown
    R[own + Row.EVENTS] += 1.0
    R[own + Row.EVENT_BEGIN] = begin
    R[own + Row.EVENT_STRESS] = R[own + Row.NOW_STRESS]
    R[own + Row.EVENT_X] = R[own + Row.NOW_X]
    R[own + Row.EVENT_PEAK_VELOCITY] = sign * R[own + Row.NOW_PEAK]
    kind = Kind.SLIP_BEGINS if sign > 0.0 else Kind.BACKWARD_BEGINS
    log_begin(R, layout, contact, kind, R[own + Row.EVENTS], log, cursor)


def goes_on_after_knock(R: Array, layout: Layout, contact: int, tau: float, drop: float) -> bool:
    """True if small forward slips count as stick-slip: `ALIKE` similar stress drops in a row, each after a rest.

    After a knock, or a fast stroke of the drive, the drops of ordinary stick-slip may be below EVENT_SHARE of the first
    drop. Ringing has no rests, and its drops decrease. If True, `drop` is stored as the largest stress drop.
    """
    own = tally_at(layout, contact)
    begin, before = R[own + Row.NOW_BEGIN], R[own + Row.SMALL_DROP]
    if not begin - R[own + Row.FAST_END] > RESTED * (clock(R, tau) - begin):
        return False
    alike = R[own + Row.SMALL_COUNT] > 0.0 and EVENT_SHARE * before < drop < before / EVENT_SHARE
    R[own + Row.SMALL_COUNT] = R[own + Row.SMALL_COUNT] + 1.0 if alike else 1.0
    R[own + Row.SMALL_DROP] = drop
    if R[own + Row.SMALL_COUNT] < ALIKE:
        return False
    R[own + Row.FORWARD_BEGIN] = math.nan
    R[own + Row.LARGEST_DROP] = drop
    return True


def end_slip(R: Array, layout: Layout, contact: int, tau: float, y: Array, log: Array, cursor: Array) -> None:
    """Classify slip at its end: a slip event, a continuation of the last event, ringing, or too slow to count.

    A slip event has a stress drop of at least EVENT_SHARE of the largest drop so far. It continues the last event (in
    the same direction) if the stress rose by less than that share in between. If all earlier drops are smaller than
    EVENT_SHARE of its drop, they were ringing too, and the count begins anew. Slip with a smaller drop is an event if
    `goes_on_after_knock` is true.
    """
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    sign, fast = R[own + Row.NOW_SIGN], R[own + Row.NOW_EVENT]
    R[own + Row.NOW_FROM] = math.inf
    R[own + Row.NOW_EVENT] = 0.0
    stress, largest = y[n + Out.T], R[own + Row.LARGEST_DROP]
    drop = sign * (R[own + Row.NOW_STRESS] - stress)
    if not (fast > 0.0 and drop > 0.0):
        return
    small = drop < EVENT_SHARE * largest
    known = small and sign > 0.0 and goes_on_after_knock(R, layout, contact, tau, drop)
    if sign > 0.0:
        R[own + Row.FAST_END] = clock(R, tau)
    if small and not known:
        if sign > 0.0:
            count_ring(R, layout, contact, log, cursor)
        return
    R[own + Row.SMALL_COUNT] = 0.0
    largest = R[own + Row.LARGEST_DROP]
    if largest < EVENT_SHARE * drop:
        R[own + Row.EVENTS] = 0.0
        R[own + Row.FORWARD_BEGIN] = math.nan
        R[own + Row.BACKWARD_BEGIN] = math.nan
    lowest = R[own + Row.EVENT_STRESS] - sign * R[own + Row.EVENT_STRESS_DROP]
    reload = sign * (R[own + Row.NOW_STRESS] - lowest)
    again = R[own + Row.EVENTS] > 0.0 and sign * R[own + Row.EVENT_SLIP] > 0.0
    if known or not (again and reload < EVENT_SHARE * max(drop, largest)):
        begin_event(R, layout, contact, log, cursor)
    if R[own + Row.NOW_PEAK] > sign * R[own + Row.EVENT_PEAK_VELOCITY]:
        R[own + Row.EVENT_PEAK_VELOCITY] = sign * R[own + Row.NOW_PEAK]
    R[own + Row.EVENT_DURATION] = clock(R, tau) - R[own + Row.EVENT_BEGIN]
    R[own + Row.EVENT_SLIP] = y[n + Out.PLACE] - R[own + Row.EVENT_X]
    R[own + Row.EVENT_STRESS_DROP] = sign * (R[own + Row.EVENT_STRESS] - stress)
    R[own + Row.LARGEST_DROP] = max(largest, R[own + Row.EVENT_STRESS_DROP])
    R[own + Row.EVENT_RINGS] = 0.0
    R[own + Row.EVENT_RING_FREQUENCY] = math.nan
    kind = Kind.SLIP_ENDS if sign > 0.0 else Kind.BACKWARD_ENDS
    place = kind + 2 * events_per_contact(layout) * contact
    log_event(R, layout, place, tau, y, log, cursor, R[own + Row.EVENTS])


def record_event(R: Array, layout: Layout, number: int, tau: float, y: Array, log: Array, cursor: Array) -> None:
    """Add an event to the statistics, and to the log if kept; `number` is its `Kind`, plus an offset per contact."""
    contact = (number - 1) // (2 * events_per_contact(layout))
    kind = number - 2 * events_per_contact(layout) * contact
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    v, sign = y[n + Out.V], R[own + Row.NOW_SIGN]
    # not logged here: at the end of the slip, and only if it counts as a slip event
    if kind == Kind.SLIP_BEGINS or kind == Kind.BACKWARD_BEGINS:
        R[own + Row.NOW_SIGN] = 1.0 if kind == Kind.SLIP_BEGINS else -1.0
        track_slowest(R, layout, contact, abs(v), tau, y)
    elif kind == Kind.SLIP_ENDS or kind == Kind.BACKWARD_ENDS:
        if sign == (1.0 if kind == Kind.SLIP_ENDS else -1.0):
            end_slip(R, layout, contact, tau, y, log, cursor)
    else:
        log_event(R, layout, number, tau, y, log, cursor, 0.0)
    if kind == Kind.PEAK:
        record_peak(R, layout, contact, clock(R, tau), y)
    elif kind == Kind.TROUGH:
        R[own + Row.LOWEST_VELOCITY] = min(R[own + Row.LOWEST_VELOCITY], v)
    if kind == Kind.PEAK or kind == Kind.TROUGH:
        speed = sign * v
        R[own + Row.NOW_PEAK] = max(R[own + Row.NOW_PEAK], speed)
        fastest = Kind.PEAK if sign > 0.0 else Kind.TROUGH
        if kind == fastest:
            mark_fast(R, layout, contact, y)
        elif R[own + Row.NOW_EVENT] == 0.0 and speed < R[own + Row.NOW_FROM] < math.inf:
            track_slowest(R, layout, contact, speed, tau, y)  # the slip was too slow for an event so far


def record_peak(R: Array, layout: Layout, contact: int, time: float, y: Array) -> None:
    """Update the statistics of a contact's velocity peaks by a peak at the given time (s)."""
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    v, v_lp = y[n + Out.V], y[n + Out.V_LP]
    size = math.log(abs(v / v_lp)) if v_lp != 0.0 else math.inf
    if R[own + Row.LAST_PEAK_TIME] >= 0.0:
        R[own + Row.PEAK_PERIOD] = time - R[own + Row.LAST_PEAK_TIME]
        R[own + Row.PEAK_GROWTH] = abs(size) - abs(R[own + Row.PEAK_SIZE])
    R[own + Row.PEAK_SIZE] = size
    R[own + Row.LAST_PEAK_TIME] = time
    R[own + Row.PEAK_VELOCITY] = max(R[own + Row.PEAK_VELOCITY], v)
