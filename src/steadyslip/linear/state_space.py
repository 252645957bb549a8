"""The linearised rig as a state-space system, for SciPy and python-control.

The equations are those of `steadyslip.model.eigenvalues`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.errors import NotAvailable, UnknownNameError
from steadyslip.core.options import checked
from steadyslip.linear.pencil import GOOD, checked_spectrum
from steadyslip.linear.roots import Array
from steadyslip.linear.spectrum import is_ill_posed
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.eigenvalues import Matrices, blocks_of, descriptor
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import hidden_by_stiffest, out_of_range_error, require_range
from steadyslip.model.sliding import steady_state

if TYPE_CHECKING:
    from scipy.signal import StateSpace


def jacobian(rig: Slider | Machine) -> Array:
    """Jacobian (n, n) of the rates of the states at steady sliding, SI units of the Model's variables.

    The algebraic unknowns are eliminated. The eigenvalues of the Jacobian give stability independently of the closed
    form and of the characteristic polynomial.
    """
    return state_matrices(rig, ()).a


def state_matrices(
    rig: Slider | Machine, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None
) -> Matrices:
    """State-space matrices A, B, C, D for outputs and inputs given by name; see `state_space`.

    Raises
    ------
    NoSteadySliding
        If steady sliding does not exist.
    UnknownNameError
        If an output or input is unknown.
    NotAvailable
        If the problem is ill-posed: the balances cannot be solved for their unknowns; if an input would have to be
        differentiated; if numbers leave the range of floating point, or if rounding would take some of the rig's
        eigenvalues from A.
    """
    point = operating_point(rig)
    model = point.model
    known = tuple(name for name in model.inputs if name != "time")
    outputs = _usual_outputs(model) if outputs is None else tuple(outputs)
    for what, names, allowed in (("output", outputs, model.observables), ("input", inputs or (), known)):
        for name in names:
            if name not in allowed:
                raise UnknownNameError(what, name, allowed)
    if model.delays:
        raise NotAvailable(
            "a delay has no state space of finitely many variables; eigenvalues gives the rightmost ones"
        )
    require_range(point)
    steady_state(rig)  # raises NoSteadySliding with the contact that locks up or lifts off
    if is_ill_posed(point):
        raise NotAvailable("ill-posed: the friction law does not determine the motion (its direct effect is zero)")
    blocks = blocks_of(point, outputs, known)
    if not all(np.all(np.isfinite(block)) for block in blocks):
        raise out_of_range_error(point)
    found = descriptor(model, known, blocks).solved(outputs, inputs)
    _require_eigenvalues(point, found.a)
    shares = [_pressure_of(rig, name) for name in found.inputs]
    return replace(found, b=found.b * shares, d=found.d * shares)


def _pressure_of(rig: Slider | Machine, name: str) -> float:
    """Factor that converts an input to the Model's unit: 1/area for a force on a contact with an area, else 1."""
    contact, _, kind = name.rpartition(".")
    if kind not in ("press", "pores"):
        return 1.0
    return 1 / (rig.laws_by_contact()[contact].area or 1.0)


def _require_eigenvalues(point: OperatingPoint, a: Array) -> None:
    """Raise NotAvailable if the state matrix lacks eigenvalues of the rig because of rounding.

    Raises
    ------
    NotAvailable
        If eigenvalues are lost; the message names the largest stiffness.
    """
    right = checked_spectrum(point)
    own = np.linalg.eigvals(a)
    apart = np.abs(own[:, None] - right.values[None, :])
    allowed = GOOD * np.abs(right.values) + right.errors
    if right.values.size == own.size and (not own.size or np.all(np.min(apart, axis=0) <= allowed)):
        return
    rates = np.abs(right.values)
    raise NotAvailable(
        "no state matrix in double precision has the eigenvalues of this rig, which lie between "
        f"{np.min(rates, initial=np.inf):.3g} and {np.max(rates, initial=0.0):.3g} 1/s: {hidden_by_stiffest(point)}, "
        "raise masses and dampings that are as good as none, or take eigenvalues, which has them all"
    )


def _usual_outputs(model: Model) -> tuple[str, ...]:
    """Names of the default outputs: for a slider those of the paper, for a machine x, v and contact forces."""
    usual = {"x", "v", "shear_stress", "friction_force", "normal_stress", "normal_force"}
    return tuple(name for name in model.observables if name.rpartition(".")[2] in usual)


@checked()
def state_space(
    rig: Slider | Machine, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None
) -> StateSpace:
    """Linearised rig as `scipy.signal.StateSpace`.

    Parameters
    ----------
    rig : Slider or Machine
    outputs : sequence of str, optional
        Names of ``Model.observables``; perturbations from steady sliding, SI units. Unless given, of a slider ``x``,
        ``v``, ``shear_stress`` and ``normal_stress``, of a machine ``BODY.x``, ``BODY.v``, ``CONTACT.friction_force``
        and ``CONTACT.normal_force`` of all.
    inputs : sequence of str, optional
        Names of ``Model.inputs``. Unless given all: of a slider perturbation of the load-point velocity (m/s),
        disturbance stress on the block q (Pa), disturbance of the normal stress (Pa; the B4 of eq. 12); of a machine
        ``load_velocity`` (m/s or rad/s), ``BODY.push`` (N or N m) and ``CONTACT.press`` (N), except those that move a
        body without mass at once. ``CONTACT.pores`` (N, of a slider ``.pores``, Pa) is the pressure around pore fluid.

    Returns
    -------
    scipy.signal.StateSpace
        States as in ``Model.variables``, without places of bodies without mass that follow from other places;
        its attributes ``state_names``, ``input_names`` and ``output_names`` list them all.

    Raises
    ------
    NoSteadySliding
        If steady sliding does not exist.
    UnknownNameError
        If an output or input is unknown.
    NotAvailable
        If the rig has a delay, the problem is ill-posed, numbers leave the range of floating point, or lie so far
        apart that rounding would take some of the rig's eigenvalues from the state matrix.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.state_space(rig, outputs=["v"], inputs=["load_velocity"]).A.shape
    (2, 2)
    """
    from scipy.signal import StateSpace

    found = state_matrices(rig, outputs, inputs)
    system = StateSpace(*found.blocks())
    system.state_names, system.input_names, system.output_names = found.states, found.inputs, found.outputs
    return system


@checked()
def to_control(rig: Slider | Machine, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None) -> Any:
    """Linearised rig as state space of the ``control`` package, with named signals; arguments as for `state_space`.

    Raises
    ------
    NotAvailable
        If ``control`` is not installed.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> ss.linear.to_control(rig, outputs=["v"], inputs=["load_velocity"]).poles().round(6)
    array([0.03571+0.099485j, 0.03571-0.099485j])
    """
    try:
        import control
    except ImportError as error:
        raise NotAvailable("the package 'control' is not installed; install it or use state_space") from error
    found = state_matrices(rig, outputs, inputs)
    names = {"states": found.states, "inputs": found.inputs, "outputs": found.outputs}
    return control.ss(*found.blocks(), **{kind: [one.replace(".", "_") for one in own] for kind, own in names.items()})
