"""Segments of a protocol: local time, inputs, and the jump at the start of each."""

from __future__ import annotations

import math

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.balance import solve_balances
from steadyslip.kernels.layout import Layout, Routines, Row, call


def clock(R: Array, tau: float) -> float:
    """Time (s) since the start of the run at time tau in the segment; exact at the segment's end."""
    return float(min(R[Row.START] + tau, R[Row.STOP]) if tau < R[Row.LENGTH] else R[Row.STOP])


def set_inputs(S: Array, layout: Layout, lanes: int, lane: int, row: Array, first: int) -> None:
    """Copy values and slopes of the inputs to a lane, from column `first` of a row on."""
    for i in range(layout.inputs):
        S[(layout.level + i) * lanes + lane] = row[first + i]
        S[(layout.slope + i) * lanes + lane] = row[first + layout.inputs + i]


def begin_segment(S: Array, layout: Layout, lanes: int, lane: int, row: Array) -> None:
    """Copy times and inputs of a segment to a lane."""
    S[Row.TAU * lanes + lane] = 0.0
    S[Row.START * lanes + lane] = row[0]
    S[Row.STOP * lanes + lane] = row[1]
    S[Row.LENGTH * lanes + lane] = row[1] - row[0]
    set_inputs(S, layout, lanes, lane, row, 3)
    waves, first = layout.inputs * layout.harmonics, 3 + 2 * layout.inputs
    for i in range(waves):
        S[(layout.amplitude + i) * lanes + lane] = row[first + i]
        S[(layout.omega + i) * lanes + lane] = row[first + waves + i]
        S[(layout.phase + i) * lanes + lane] = row[first + 2 * waves + i]


def enter_segment(R: Array, layout: Layout, routines: Routines, j: int, k: int, segments: Array, y: Array) -> bool:
    """Enter segment k: jump of the load point, new inputs, velocity from the balances; False if that fails."""
    s = j if segments.shape[0] > 1 else 0
    if k > 0:
        call(routines.restore, R, 0.0, y)
    row = segments[s, k]
    R[Row.SEGMENT] = k
    begin_segment(R, layout, 1, 0, row)
    call(routines.shift, R, row[2], y)
    R[Row.LOAD_MOVED] += row[2]
    good = True
    if layout.massless > 0:  # velocity variables before the jump serve as guesses
        good = solve_balances(R, layout, routines, y)
    call(routines.place, R, 0.0, y)
    call(routines.rates, R, 0.0, y)
    good = good and math.isfinite(R[Row.V])
    for i in range(layout.size):
        good = good and math.isfinite(R[layout.rate + i])
    return good
