"""Log and statistics of events per contact, and the distinction of slip events from slow slip."""

from __future__ import annotations

import math

from steadyslip.kernels.driver.places import events_per_contact, outputs_at, tally_at
from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import SLIP_EVENT, Array, Cursor, Kind, Layout, Out, Row


def track_slowest(R: Array, layout: Layout, contact: int, slowest: float, tau: float, y: Array) -> None:
    """Store the state at the lowest velocity of a block ahead of the load point: a slip event counts from there."""
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    R[own + Row.NOW_FROM] = slowest
    R[own + Row.NOW_EVENT] = 0.0
    R[own + Row.NOW_BEGIN] = R[Row.START] + tau
    R[own + Row.NOW_PEAK] = y[n + Out.V]
    R[own + Row.NOW_V] = y[n + Out.V]
    R[own + Row.NOW_SIGMA] = y[n + Out.SIGMA]
    R[own + Row.NOW_TAU] = y[n + Out.TAU]
    R[own + Row.NOW_STRESS] = y[n + Out.T]
    R[own + Row.NOW_X] = y[n + Out.PLACE]
    R[own + Row.NOW_SEGMENT] = R[Row.SEGMENT]


def begin_slip_event(R: Array, layout: Layout, contact: int, y: Array, log: Array, cursor: Array) -> None:
    """Mark slip as a slip event if its velocity reaches SLIP_EVENT times both that of the load point and its lowest.

    While the load point rests, the velocity of the drive replaces its own.
    """
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    v, v_lp, share = y[n + Out.V], y[n + Out.V_LP], y[n + Out.SHARE]
    asked = v_lp if v_lp > R[Row.V_LOW] * share else R[Row.V_DRIVE] * share
    if R[own + Row.NOW_EVENT] > 0.0 or not v >= SLIP_EVENT * max(asked, R[own + Row.NOW_FROM]):
        return
    R[own + Row.NOW_EVENT] = 1.0
    if log.shape[0] > 0:
        i = cursor[Cursor.LOGGED]
        log[i, 0] = Kind.SLIP_BEGINS + 2 * events_per_contact(layout) * contact
        log[i, 1], log[i, 2] = R[own + Row.NOW_BEGIN], R[own + Row.NOW_V]
        log[i, 3], log[i, 4], log[i, 5] = R[own + Row.NOW_SIGMA], R[own + Row.NOW_TAU], R[own + Row.NOW_STRESS]
        log[i, 6], log[i, 7] = R[own + Row.NOW_X], R[own + Row.NOW_SEGMENT]
        cursor[Cursor.LOGGED] = i + 1


def record_event(R: Array, layout: Layout, number: int, tau: float, y: Array, log: Array, cursor: Array) -> None:
    """Add an event to statistics and log (if kept); `number` is its `Kind`, plus an offset for further contacts."""
    contact = (number - 1) // (2 * events_per_contact(layout))
    kind = number - 2 * events_per_contact(layout) * contact
    n, own = outputs_at(layout, contact), tally_at(layout, contact)
    time = clock(R, tau)
    place = y[n + Out.PLACE]
    v, stress = y[n + Out.V], y[n + Out.T]
    if kind == Kind.SLIP_BEGINS:  # logged once it is fast enough for a slip event: see begin_slip_event
        track_slowest(R, layout, contact, v, tau, y)
        return
    is_event = R[own + Row.NOW_EVENT] > 0.0
    if kind == Kind.SLIP_ENDS:
        R[own + Row.NOW_FROM] = math.inf
        R[own + Row.NOW_EVENT] = 0.0
        if not is_event:
            return
    if log.shape[0] > 0:
        i = cursor[Cursor.LOGGED]
        log[i, 0], log[i, 1], log[i, 2], log[i, 3] = number, time, v, y[n + Out.SIGMA]
        log[i, 4], log[i, 5], log[i, 6], log[i, 7] = y[n + Out.TAU], stress, place, R[Row.SEGMENT]
        cursor[Cursor.LOGGED] = i + 1
    if kind == Kind.SLIP_ENDS:
        begin = R[own + Row.NOW_BEGIN]
        if R[own + Row.ANY_BEGIN] > 0.0:  # slip that went on at the start of the run has no known begin
            R[own + Row.RECURRENCE] = begin - R[own + Row.EVENT_BEGIN]
        R[own + Row.ANY_BEGIN] = 1.0 if begin > 0.0 else 0.0
        R[own + Row.EVENTS] += 1.0
        R[own + Row.EVENT_BEGIN] = begin
        R[own + Row.EVENT_DURATION] = time - begin
        R[own + Row.EVENT_SLIP] = place - R[own + Row.NOW_X]
        R[own + Row.EVENT_STRESS_DROP] = R[own + Row.NOW_STRESS] - stress
        R[own + Row.EVENT_PEAK_VELOCITY] = R[own + Row.NOW_PEAK]
    elif kind == Kind.PEAK:
        size = math.log(abs(v / y[n + Out.V_LP])) if y[n + Out.V_LP] != 0.0 else math.inf
        if R[own + Row.LAST_PEAK_TIME] >= 0.0:
            R[own + Row.PEAK_PERIOD] = time - R[own + Row.LAST_PEAK_TIME]
            R[own + Row.PEAK_GROWTH] = abs(size) - abs(R[own + Row.PEAK_SIZE])
        R[own + Row.PEAK_SIZE] = size
        R[own + Row.LAST_PEAK_TIME] = time
        R[own + Row.PEAK_VELOCITY] = max(R[own + Row.PEAK_VELOCITY], v)
        R[own + Row.NOW_PEAK] = max(R[own + Row.NOW_PEAK], v)
        begin_slip_event(R, layout, contact, y, log, cursor)
    elif kind == Kind.TROUGH:
        R[own + Row.LOWEST_VELOCITY] = min(R[own + Row.LOWEST_VELOCITY], v)
        if not is_event and v < R[own + Row.NOW_FROM] < math.inf:  # slip before this trough was too slow for an event
            track_slowest(R, layout, contact, v, tau, y)
