"""State and outputs at the current time or, by dense output, within the last step; results are written to `y`."""

from __future__ import annotations

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.places import guess_at, unknown_at
from steadyslip.kernels.layout import Layout, Routines, Row, call


def copy_state(R: Array, layout: Layout, y: Array) -> None:
    """Copy the state and unknowns of the record to `y`."""
    for i in range(layout.size):
        y[i] = R[layout.state + i]
    for k in range(max(layout.unknowns, 1)):
        y[unknown_at(layout, k)] = R[guess_at(layout, k)]


def state_now(R: Array, layout: Layout, routines: Routines, tau: float, y: Array) -> None:
    """Write state and outputs at local time tau to `y`, from the record's state."""
    copy_state(R, layout, y)
    call(routines.outputs, R, tau, y)


def interpolate_state(R: Array, layout: Layout, routines: Routines, theta: float, y: Array) -> None:
    """Write the state at the fraction theta of the last step, and guesses of the unknowns there, to `y`."""
    if R[Row.EXTENDED] == 0.0:
        call(routines.extend, R, 0.0, y)
    call(routines.dense, R, theta, y)


def state_at_fraction(R: Array, layout: Layout, routines: Routines, theta: float, y: Array) -> None:
    """Write state and outputs at the fraction theta of the last step to `y`."""
    interpolate_state(R, layout, routines, theta, y)
    call(routines.outputs, R, R[Row.TAU_OLD] + theta * R[Row.STEP_SIZE], y)
