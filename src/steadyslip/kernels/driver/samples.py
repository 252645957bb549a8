"""What is written down on the way: states at requested times, and the solver's own steps."""

from __future__ import annotations

import math

from steadyslip.kernels.driver.looking import between
from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import Array, Cursor, Layout, Out, Recorded, Routines, Row, Sampled

BETWEEN = 3  # points that are recorded between the ends of a step whose dense output has stages of its own


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
            y[layout.size + Out.UNKNOWN] = R[Row.Z]
        else:
            if times[k] >= R[Row.STOP] or (tau >= R[Row.TAU] and not arrived):
                break
            between(R, layout, routines, min(max((tau - R[Row.TAU_OLD]) / R[Row.DONE], 0.0), 1.0), y)
        samples[row, k, Sampled.UNKNOWN] = y[layout.size + Out.UNKNOWN]
        for i in range(layout.size):
            samples[row, k, Sampled.STATE + i] = y[i]
        k += 1
    R[Row.TAKEN] = k
    await_sample(R, times)


def record(
    R: Array, layout: Layout, tau: float, unknown: float, state: Array, first: int, cursor: Array, recorded: Array
) -> None:
    """Write down a point, its state the numbers from `first` of an array, at tau into the segment."""
    i = cursor[Cursor.RECORDED]
    recorded[i, Recorded.TIME] = clock(R, tau)
    recorded[i, Recorded.SEGMENT] = R[Row.SEGMENT]
    recorded[i, Recorded.POINT] = unknown
    for c in range(layout.size):
        recorded[i, Recorded.STATE + c] = state[first + c]
    cursor[Cursor.RECORDED] = i + 1


def record_step(R: Array, layout: Layout, routines: Routines, cursor: Array, recorded: Array, y: Array) -> None:
    """The solver's own step; steps of high order are long, and get points between."""
    for i in range(1, BETWEEN + 1 if layout.extra > 0 else 1):
        theta = i / (BETWEEN + 1)
        between(R, layout, routines, theta, y)
        unknown = y[layout.size + Out.UNKNOWN]
        record(R, layout, R[Row.TAU_OLD] + theta * R[Row.DONE], unknown, y, 0, cursor, recorded)
    record_now(R, layout, cursor, recorded)


def record_now(R: Array, layout: Layout, cursor: Array, recorded: Array) -> None:
    """Write down where the record is."""
    record(R, layout, R[Row.TAU], R[Row.Z], R, layout.state, cursor, recorded)
