"""No loop at all: outputs and rates at points that are given."""

from __future__ import annotations

import math

import numpy as np

from steadyslip.kernels.driver.balance import solve_balances
from steadyslip.kernels.driver.places import outputs_at, width
from steadyslip.kernels.driver.segments import begin_segment, set_inputs
from steadyslip.kernels.layout import Array, Layout, Out, Routines, Row, Sampled, Setting, call


def place_rig(R: Array, layout: Layout, constants: Array, settings: Array, own: int) -> None:
    """Constants of a rig, and its guess of the unknown."""
    for i in range(layout.constants):
        R[layout.constant + i] = constants[own if constants.shape[0] > 1 else 0, i]
    R[Row.Z] = settings[own if settings.shape[0] > 1 else 0, Setting.GUESS]
    R[Row.Z_SCALE] = settings[own if settings.shape[0] > 1 else 0, Setting.Z_SCALE]


def place_point(R: Array, layout: Layout, routines: Routines, points: Array, m: int, y: Array) -> None:
    """Bring point m into a record and into y, balance solved where there is one left to solve.

    Where the point does not tell its unknown (NaN), what the record has is the guess.
    """
    if math.isfinite(points[m, Sampled.UNKNOWN]):
        R[Row.Z] = points[m, Sampled.UNKNOWN]
    for i in range(layout.size):
        R[layout.state + i] = points[m, Sampled.STATE + i]
        y[i] = points[m, Sampled.STATE + i]
    if layout.solved:
        for i in range(layout.kept):
            R[layout.continuous + i] = points[m, Sampled.STATE + i]
        near = R[Row.Z]
        solve_balances(R, layout, routines, y)
        if not math.isfinite(R[Row.Z]):
            R[Row.Z] = near
        for i in range(layout.size):  # what `solve_balance` left there
            y[i] = points[m, Sampled.STATE + i]
    y[layout.size + Out.UNKNOWN] = R[Row.Z]


def go_to_segment(R: Array, layout: Layout, routines: Routines, segments: Array, s: int, k: int, y: Array) -> None:
    """From the segment that the record is in (-1 before the first) to a later one, with the way of the load point."""
    while R[Row.SEGMENT] < k:
        if R[Row.SEGMENT] >= 0.0:
            R[Row.TAU] = R[Row.END]
            call(routines.restore, R, 0.0, y)  # for the way of the load point
        R[Row.SEGMENT] += 1.0
        row = segments[s, int(R[Row.SEGMENT])]
        begin_segment(R, layout, 1, 0, row)
        R[Row.LOAD_MOVED] += row[2]


def observe(
    layout: Layout, routines: Routines, constants: Array, settings: Array, segments: Array, points: Array, own: Array,
    segment: Array, times: Array, values: Array,
) -> None:  # fmt: skip
    """Outputs and continuous variables at given points.

    `points` is (m, 1 + size); `own` (m,) the rig's row, `segment` and `times` where and when in its protocol, since the
    start of the run. `values` is (8 contacts + kept + further, m): `Out` up to ADVANCE of each contact, which is
    here the way of the load point since the start of the run, the variables that jumps leave alone, and what else is
    observed.
    """
    R, y = np.zeros(layout.rows), np.empty(width(layout))
    rig = -1
    for m in range(points.shape[0]):
        if own[m] != rig:
            rig = own[m]
            place_rig(R, layout, constants, settings, rig)
            R[Row.SEGMENT] = -1.0
            R[Row.LOAD_MOVED] = 0.0
        for i in range(layout.size):
            R[layout.state + i] = points[m, Sampled.STATE + i]
        if R[Row.SEGMENT] > segment[m]:
            R[Row.SEGMENT] = -1.0
            R[Row.LOAD_MOVED] = 0.0
        go_to_segment(R, layout, routines, segments, rig if segments.shape[0] > 1 else 0, segment[m], y)
        R[Row.TAU] = times[m] - R[Row.START]
        place_point(R, layout, routines, points, m, y)
        call(routines.outputs, R, R[Row.TAU], y)
        moved = R[Row.LOAD_MOVED]
        for c in range(layout.contacts):
            for i in range(Out.W_SLOPE):
                values[Out.W_SLOPE * c + i, m] = y[outputs_at(layout, c) + i]
            values[Out.W_SLOPE * c + Out.ADVANCE, m] += moved
        place = Out.W_SLOPE * layout.contacts + layout.kept
        for i in range(layout.further):
            values[place + i, m] = y[width(layout) - layout.further + i]
        call(routines.restore, R, 0.0, y)
        R[Row.LOAD_MOVED] = moved
        for i in range(layout.kept):
            values[Out.W_SLOPE * layout.contacts + i, m] = R[layout.continuous + i]


def field(
    layout: Layout, routines: Routines, constants: Array, settings: Array, points: Array, inputs: Array, own: Array,
    values: Array,
) -> None:  # fmt: skip
    """Rates (m, size) at given points, (m, 1 + size).

    `inputs` (m, 7) holds v_lp, q, p, their slopes and the time, `own` the rig.
    """
    R, y = np.zeros(layout.rows), np.empty(width(layout))
    for m in range(points.shape[0]):
        place_rig(R, layout, constants, settings, own[m])
        set_inputs(R, 1, 0, inputs[m], 0)
        R[Row.START] = inputs[m, 6]
        place_point(R, layout, routines, points, m, y)
        call(routines.rates, R, 0.0, y)
        for i in range(layout.size):
            values[m, i] = R[layout.rate + i]
