"""No loop at all: outputs and rates at states that are given."""

from __future__ import annotations

import numpy as np

from steadyslip.kernels.driver.balance import solve_balance
from steadyslip.kernels.driver.segments import set_inputs
from steadyslip.kernels.layout import Array, Layout, Out, Routines, Row, Setting, call


def placed(
    R: Array, layout: Layout, routines: Routines, constants: Array, settings: Array, state: Array, inputs: Array,
    own: int, y: Array,
) -> None:  # fmt: skip
    """Bring a given state into a record, balance solved where there is one left to solve."""
    for i in range(layout.constants):
        R[layout.constant + i] = constants[own if constants.shape[0] > 1 else 0, i]
    R[Row.Z_SCALE] = settings[own if settings.shape[0] > 1 else 0, Setting.Z_SCALE]
    R[Row.START] = inputs[6]
    set_inputs(R, 1, 0, inputs, 0)
    R[Row.TAU] = 0.0
    for i in range(layout.size):
        R[layout.state + i] = state[i]
    if layout.solved:
        for i in range(layout.kept):
            R[layout.continuous + i] = state[i]
        R[Row.Z] = solve_balance(R, routines, R[Row.Z], y)
    for i in range(layout.size):
        y[i] = state[i]


def observe(
    layout: Layout, routines: Routines, constants: Array, settings: Array, states: Array, inputs: Array, own: Array,
    values: Array,
) -> None:  # fmt: skip
    """Outputs and continuous variables at given states.

    `states` is (m, size); `inputs` (m, 7) holds v_lp, q, p, their slopes and the time; `own` the rig's row.
    `values` is (m, 5 + kept).
    """
    R, y = np.zeros(layout.rows), np.empty(layout.size + Out.COUNT + layout.events)
    rig = -1
    for m in range(states.shape[0]):
        if own[m] != rig:
            rig = own[m]
            R[Row.Z] = settings[rig if settings.shape[0] > 1 else 0, Setting.GUESS]
        placed(R, layout, routines, constants, settings, states[m], inputs[m], rig, y)
        call(routines.outputs, R, 0.0, y)
        for i in range(5):
            values[m, i] = y[layout.size + i]
        call(routines.restore, R, 0.0, y)
        for i in range(layout.kept):
            values[m, 5 + i] = R[layout.continuous + i]


def field(
    layout: Layout, routines: Routines, constants: Array, settings: Array, states: Array, inputs: Array, own: Array,
    values: Array,
) -> None:  # fmt: skip
    """Rates at given states, (m, size); arguments as for `observe`."""
    R, y = np.zeros(layout.rows), np.empty(layout.size + Out.COUNT + layout.events)
    for m in range(states.shape[0]):
        R[Row.Z] = settings[own[m] if settings.shape[0] > 1 else 0, Setting.GUESS]
        placed(R, layout, routines, constants, settings, states[m], inputs[m], own[m], y)
        call(routines.rates, R, 0.0, y)
        for i in range(layout.size):
            values[m, i] = R[layout.rate + i]
