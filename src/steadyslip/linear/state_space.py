"""The linearised rig as a state-space system, for SciPy and python-control."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable, UnknownNameError
from steadyslip.core.options import checked
from steadyslip.core.questions import question
from steadyslip.linear.polynomials import Array
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.linearisation import linearise
from steadyslip.model.point import operating_point
from steadyslip.model.range import beyond_range, require_range
from steadyslip.model.sliding import explain_absence

if TYPE_CHECKING:
    from scipy.signal import StateSpace

INPUTS = ("load_velocity", "disturbance", "normal_disturbance")


def jacobian(rig: Slider) -> Array:
    """Jacobian (1/s and mixed units) of the Model's own variables at steady sliding.

    Order as in ``build_model(rig).variables``; the algebraic unknown is eliminated. Its eigenvalues are the
    route to stability that is independent of the closed form.
    """
    return state_matrices(rig, ())[0]


def state_matrices(rig: Slider, outputs: Sequence[str]) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D for the given outputs (names of ``Model.observables``); inputs are `INPUTS`.

    Raises
    ------
    NoSteadySliding
        If there is nothing to linearise about.
    UnknownNameError
        If an output is unknown.
    NotAvailable
        If the problem is ill-posed: the balance cannot be solved for its unknown; or if numbers leave the range of
        floating point.
    """
    point = operating_point(rig)
    model = point.model
    for name in outputs:
        if name not in model.observables:
            raise UnknownNameError("output", name, model.observables)
    if model.delays:
        raise NotAvailable(
            "a delay has no state space of finitely many variables; eigenvalues gives the rightmost ones"
        )
    require_range(point)
    stresses = point.all_stresses()
    if not stresses:
        raise explain_absence(rig, point)
    names = tuple(outputs)
    with np.errstate(all="ignore"):
        blocks = _matrix_function(model, names)(*point.arguments, stresses[0])
        found = _solved(blocks, len(model.variables), len(names))
    if not all(np.all(np.isfinite(block)) for block in found):
        raise beyond_range(point)
    return found


def _solved(blocks: Sequence[Array], n: int, p: int) -> tuple[Array, Array, Array, Array]:
    """The matrices, with the unknown in terms of variables and inputs."""
    width = n + len(INPUTS) + 1
    table = np.array([float(b) for b in blocks]).reshape(n + p + 1, width)
    balance = table[-1]
    if balance[-1] == 0:
        raise NotAvailable("ill-posed: the friction law does not determine the motion (its direct effect is zero)")
    solved = -balance[:-1] / balance[-1]
    full = table[:-1, :-1] + table[:-1, -1:] * solved
    return full[:n, :n], full[:n, n:], full[n:, :n], full[n:, n:]


@question
def _matrix_function(model: Model, outputs: tuple[str, ...]) -> Callable[..., list[Array]]:
    """Rows: rates, outputs, balance. Columns: variables, inputs, unknown."""
    linear = linearise(model)
    contact = model.contact
    columns = [item.symbol for item in model.variables] + [model.inputs[name] for name in INPUTS]
    columns.append(contact.unknown)
    rows = [
        {contact.unknown: sp.Integer(1)} if item.symbol is contact.velocity else linear.rows[item.symbol]
        for item in model.variables
    ]
    rows += [linear.outputs[name] for name in outputs]
    rows.append(linear.rows[contact.velocity])
    entries = [row.get(column, sp.Integer(0)) for row in rows for column in columns]
    return model.function(entries)


@checked()
def state_space(rig: Slider, outputs: Sequence[str] = ("x", "v", "shear_stress", "normal_stress")) -> StateSpace:
    """The linearised rig as `scipy.signal.StateSpace`.

    Parameters
    ----------
    rig : Slider
    outputs : sequence of str
        Names of ``Model.observables``; perturbations from steady sliding, SI units.

    Returns
    -------
    scipy.signal.StateSpace
        Inputs, in order: perturbation of the load-point velocity (m/s), disturbance stress on the block q
        (Pa), disturbance of the normal stress (Pa; the B4 of eq. 12). States as in ``Model.variables``.
    """
    from scipy.signal import StateSpace

    return StateSpace(*state_matrices(rig, outputs))


@checked()
def to_control(rig: Slider, outputs: Sequence[str] = ("x", "v", "shear_stress", "normal_stress")) -> Any:
    """The same as `state_space` for the ``control`` package, with named signals.

    Raises
    ------
    NotAvailable
        If ``control`` is not installed.
    """
    try:
        import control
    except ImportError as error:
        raise NotAvailable("the package 'control' is not installed; install it or use state_space") from error
    names = [item.name for item in operating_point(rig).model.variables]
    return control.ss(*state_matrices(rig, outputs), states=names, inputs=list(INPUTS), outputs=list(outputs))
