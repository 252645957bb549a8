"""Outputs and rates at given points, without integration."""

from __future__ import annotations

import math

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.balance import solve_balances
from steadyslip.kernels.driver.places import (
    earlier_at,
    further_at,
    guess_at,
    guess_count,
    output_size,
    outputs_at,
    point_at,
    scale_at,
    unknown_at,
)
from steadyslip.kernels.driver.segments import begin_segment, set_inputs
from steadyslip.kernels.layout import Layout, Out, Routines, Row, Sampled, Setting, call


def set_rig(R: Array, layout: Layout, constants: Array, settings: Array, own: int) -> None:
    """Copy constants, guesses and scales of a rig (row `own` of the tables) to a record."""
    for i in range(layout.constants):
        R[layout.constant + i] = constants[own if constants.shape[0] > 1 else 0, i]
    row, count = own if settings.shape[0] > 1 else 0, guess_count(layout)
    R[Row.Z] = settings[row, Setting.GUESS]
    R[Row.Z_SCALE] = settings[row, Setting.Z_SCALE]
    for k in range(1, count):
        R[guess_at(layout, k)] = settings[row, Setting.ATOL + layout.size + k - 1]
        R[scale_at(layout, k)] = settings[row, Setting.ATOL + layout.size + count + k - 2]


def set_point(R: Array, layout: Layout, routines: Routines, points: Array, m: int, y: Array) -> None:
    """Copy point m to a record and to `y`, and solve the balances if the state does not determine the velocity.

    Unknowns that are NaN in the point keep the guesses of the record.
    """
    for k in range(max(layout.unknowns, 1)):
        if math.isfinite(points[m, point_at(layout, k)]):
            R[guess_at(layout, k)] = points[m, point_at(layout, k)]
    for i in range(layout.size):
        R[layout.state + i] = points[m, Sampled.STATE + i]
        y[i] = points[m, Sampled.STATE + i]
    if layout.solved:
        for i in range(layout.kept):
            R[layout.continuous + i] = points[m, Sampled.STATE + i]
        for k in range(layout.unknowns):
            R[earlier_at(layout, k)] = R[guess_at(layout, k)]
        if not solve_balances(R, layout, routines, y):
            for k in range(layout.unknowns):
                R[guess_at(layout, k)] = R[earlier_at(layout, k)]
        for i in range(layout.size):  # `solve_balances` uses y as work space
            y[i] = points[m, Sampled.STATE + i]
    for k in range(max(layout.unknowns, 1)):
        y[unknown_at(layout, k)] = R[guess_at(layout, k)]


def advance_to_segment(R: Array, layout: Layout, routines: Routines, segments: Array, s: int, k: int, y: Array) -> None:
    """Advance the record from its segment (-1: before the first) to segment k, and sum the load point's motion."""
    while R[Row.SEGMENT] < k:
        if R[Row.SEGMENT] >= 0.0:
            R[Row.TAU] = R[Row.LENGTH]
            call(routines.restore, R, 0.0, y)  # adds the motion of the load point
        R[Row.SEGMENT] += 1.0
        row = segments[s, int(R[Row.SEGMENT])]
        begin_segment(R, layout, 1, 0, row)
        R[Row.LOAD_MOVED] += row[2]


def observe(
    layout: Layout, routines: Routines, constants: Array, settings: Array, segments: Array, points: Array, own: Array,
    segment: Array, times: Array, values: Array,
) -> None:  # fmt: skip
    """Compute outputs and continuous variables at given points, and write them to `values`.

    `points` is (m, 1 + size + further unknowns); `own` (m,) has the row of the rig; `segment` and `times` (m,) have the
    segment and the time since the start of the run (s). `values` is (7 contacts + kept + further, m): for each contact
    `Out` up to ADVANCE, which is here the load point's displacement since the start of the run; then the variables that
    are continuous in jumps; then additional observables.
    """
    R, y = np.zeros(layout.rows), np.empty(output_size(layout))
    rig = -1
    for m in range(points.shape[0]):
        if own[m] != rig:
            rig = own[m]
            set_rig(R, layout, constants, settings, rig)
            R[Row.SEGMENT] = -1.0
            R[Row.LOAD_MOVED] = 0.0
        for i in range(layout.size):
            R[layout.state + i] = points[m, Sampled.STATE + i]
        if R[Row.SEGMENT] > segment[m]:
            R[Row.SEGMENT] = -1.0
            R[Row.LOAD_MOVED] = 0.0
        advance_to_segment(R, layout, routines, segments, rig if segments.shape[0] > 1 else 0, segment[m], y)
        R[Row.TAU] = times[m] - R[Row.START]
        set_point(R, layout, routines, points, m, y)
        call(routines.outputs, R, R[Row.TAU], y)
        moved = R[Row.LOAD_MOVED]
        for c in range(layout.contacts):
            for i in range(Out.W_SLOPE):
                values[Out.W_SLOPE * c + i, m] = y[outputs_at(layout, c) + i]
            values[Out.W_SLOPE * c + Out.ADVANCE, m] += moved
        place = Out.W_SLOPE * layout.contacts + layout.kept
        for i in range(layout.further):
            values[place + i, m] = y[further_at(layout) + i]
        call(routines.restore, R, 0.0, y)
        R[Row.LOAD_MOVED] = moved
        for i in range(layout.kept):
            values[Out.W_SLOPE * layout.contacts + i, m] = R[layout.continuous + i]


def field(
    layout: Layout, routines: Routines, constants: Array, settings: Array, points: Array, inputs: Array, own: Array,
    values: Array,
) -> None:  # fmt: skip
    """Compute rates at given points (m, 1 + size + further unknowns), and write them to `values` (m, size).

    `inputs` (m, 2 inputs + 1) has v_lp, q, p, ..., their slopes and the time; `own` (m,) has the row of the rig.
    """
    R, y = np.zeros(layout.rows), np.empty(output_size(layout))
    for m in range(points.shape[0]):
        set_rig(R, layout, constants, settings, own[m])
        set_inputs(R, layout, 1, 0, inputs[m], 0)
        R[Row.START] = inputs[m, 2 * layout.inputs]
        set_point(R, layout, routines, points, m, y)
        call(routines.rates, R, 0.0, y)
        for i in range(layout.size):
            values[m, i] = R[layout.rate + i]
