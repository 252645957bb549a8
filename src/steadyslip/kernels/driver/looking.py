"""What can be observed now, or was at some moment of the last step."""

from __future__ import annotations

from steadyslip.kernels.driver.places import guess_at, unknown_at
from steadyslip.kernels.layout import Array, Layout, Routines, Row, call


def hold(R: Array, layout: Layout, y: Array) -> None:
    """The record's state and unknowns, in y."""
    for i in range(layout.size):
        y[i] = R[layout.state + i]
    for k in range(max(layout.unknowns, 1)):
        y[unknown_at(layout, k)] = R[guess_at(layout, k)]


def look_now(R: Array, layout: Layout, routines: Routines, tau: float, y: Array) -> None:
    """The record's state and outputs, at tau into the segment, in y."""
    hold(R, layout, y)
    call(routines.outputs, R, tau, y)


def between(R: Array, layout: Layout, routines: Routines, theta: float, y: Array) -> None:
    """The state at the fraction theta of the last step, in y, and near which the unknowns of the balances are."""
    if R[Row.EXTENDED] == 0.0:
        call(routines.extend, R, 0.0, y)
    call(routines.dense, R, theta, y)


def look_back(R: Array, layout: Layout, routines: Routines, theta: float, y: Array) -> None:
    """State and outputs at the fraction theta of the last step, in y."""
    between(R, layout, routines, theta, y)
    call(routines.outputs, R, R[Row.TAU_OLD] + theta * R[Row.DONE], y)
