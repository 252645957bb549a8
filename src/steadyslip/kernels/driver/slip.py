"""What becomes of events: the log, the tally, and when slip becomes a slip event."""

from __future__ import annotations

import math

from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import SLIP_EVENT, Array, Cursor, Kind, Layout, Out, Row


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
