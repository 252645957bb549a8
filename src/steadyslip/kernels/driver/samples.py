"""Storage of states at requested times and of the solver's own steps."""

from __future__ import annotations

import math

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.interpolate import copy_state, interpolate_state
from steadyslip.kernels.driver.places import point_at, unknown_at
from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import Cursor, Layout, Recorded, Routines, Row, Sampled

BETWEEN = 3  # extra points recorded within each step of a method of high order, whose steps are long; chosen by trial


def schedule_sample(R: Array, times: Array) -> None:
    """Set `Row.NEXT_TIME`, the time in the segment of the next requested sample, at which the step sets the flag."""
    k = int(R[Row.NEXT_SAMPLE])
    R[Row.NEXT_TIME] = times[k] - R[Row.START] if k < times.shape[0] else math.inf


def take_samples(
    R: Array, layout: Layout, routines: Routines, row: int, times: Array, samples: Array, at_end: bool, y: Array
) -> None:
    """Store the state at each requested time that the step has passed, by dense output.

    With `at_end`, the end of the run, the current state is stored. A sample at a breakpoint belongs to the segment
    that begins there, a sample at the end of the run to the last segment.
    """
    arrived = R[Row.TAU] >= R[Row.LENGTH]
    k = int(R[Row.NEXT_SAMPLE])
    while k < times.shape[0]:
        tau = times[k] - R[Row.START]
        if at_end:
            if times[k] > clock(R, R[Row.TAU]):
                break
            copy_state(R, layout, y)
        else:
            if times[k] >= R[Row.STOP] or (tau >= R[Row.TAU] and not arrived):
                break
            interpolate_state(R, layout, routines, min(max((tau - R[Row.TAU_OLD]) / R[Row.STEP_SIZE], 0.0), 1.0), y)
        for i in range(layout.size):
            samples[row, k, Sampled.STATE + i] = y[i]
        for j in range(max(layout.unknowns, 1)):
            samples[row, k, point_at(layout, j)] = y[unknown_at(layout, j)]
        k += 1
    R[Row.NEXT_SAMPLE] = k
    schedule_sample(R, times)


def record(R: Array, layout: Layout, tau: float, y: Array, cursor: Array, recorded: Array) -> None:
    """Append the point in `y`, at time tau in the segment, to the recorded steps."""
    i = cursor[Cursor.RECORDED]
    recorded[i, Recorded.TIME] = clock(R, tau)
    recorded[i, Recorded.SEGMENT] = R[Row.SEGMENT]
    for c in range(layout.size):
        recorded[i, Recorded.STATE + c] = y[c]
    for j in range(max(layout.unknowns, 1)):
        recorded[i, Recorded.POINT + point_at(layout, j)] = y[unknown_at(layout, j)]
    cursor[Cursor.RECORDED] = i + 1


def record_step(R: Array, layout: Layout, routines: Routines, cursor: Array, recorded: Array, y: Array) -> None:
    """Record the end of the last step; before it, for methods of high order with long steps, points within the step."""
    for i in range(1, BETWEEN + 1 if layout.extra > 0 else 1):
        theta = i / (BETWEEN + 1)
        interpolate_state(R, layout, routines, theta, y)
        record(R, layout, R[Row.TAU_OLD] + theta * R[Row.STEP_SIZE], y, cursor, recorded)
    record_now(R, layout, cursor, recorded, y)


def record_now(R: Array, layout: Layout, cursor: Array, recorded: Array, y: Array) -> None:
    """Record the current state."""
    copy_state(R, layout, y)
    record(R, layout, R[Row.TAU], y, cursor, recorded)
