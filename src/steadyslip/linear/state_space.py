"""The linearised rig as a state-space system, for SciPy and python-control.

Beside the rates of the Model's variables stand the balances: equations without rates, for accelerations, frictions, and
velocities of what has no mass. Where these cannot be solved for them, as for a body without mass between two springs,
places follow from each other: one of them is no state then, and what the balance says of places it says of velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.errors import NotAvailable, UnknownNameError
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.options import checked
from steadyslip.core.questions import question
from steadyslip.linear.polynomials import Array
from steadyslip.linear.spectrum import is_ill_posed
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.linearisation import linearise
from steadyslip.model.point import operating_point
from steadyslip.model.range import beyond_range, require_range
from steadyslip.model.sliding import explain_absence, steady_state

if TYPE_CHECKING:
    from scipy.signal import StateSpace

NOTHING = 1e-11  # of the largest: what is left of numbers of size one that cancel
PIVOT = 1e-6  # of the largest: what may be divided by
UNDETERMINED = "ill-posed: the balances of forces do not determine the motion"


@dataclass(frozen=True, eq=False)
class Matrices:
    """A, B, C, D, and the names of states, inputs and outputs."""

    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def blocks(self) -> tuple[Array, Array, Array, Array]:
        """The matrices alone."""
        return self.a, self.b, self.c, self.d


def jacobian(rig: Slider | Machine) -> Array:
    """Jacobian (1/s and mixed units) at steady sliding of the Model's own variables that are states.

    The algebraic unknowns are eliminated. Its eigenvalues are the route to stability that is independent of the closed
    form and of the characteristic polynomial.
    """
    return state_matrices(rig, ()).a


def state_matrices(
    rig: Slider | Machine, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None
) -> Matrices:
    """A, B, C, D for outputs and inputs by name; see `state_space`.

    Raises
    ------
    NoSteadySliding
        If there is nothing to linearise about.
    UnknownNameError
        If an output or input is unknown.
    NotAvailable
        If the problem is ill-posed: the balances cannot be solved for their unknowns; if an input would have to be
        differentiated; or if numbers leave the range of floating point.
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
    if isinstance(rig, Machine):
        steady_state(rig)  # raises, and says which contact locks or lifts
    elif not point.all_stresses():
        raise explain_absence(rig, point)
    if is_ill_posed(point):
        raise NotAvailable("ill-posed: the friction law does not determine the motion (its direct effect is zero)")
    function, shapes = _parts_function(model, outputs)
    with np.errstate(all="ignore"):
        numbers = [float(entry) for entry in point.evaluate(function)]
    if not np.all(np.isfinite(numbers)):
        raise beyond_range(point)
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    blocks = [part.reshape(shape) for part, shape in zip(np.split(np.array(numbers), ends[:-1]), shapes, strict=True)]
    massless = {one.displacement for one in model.coordinates if not one.inertial}
    first = np.array([item.symbol in massless for item in model.variables])
    system = _Descriptor(tuple(item.name for item in model.variables), known, first, *blocks)
    return system.solved(outputs, inputs)


def _usual_outputs(model: Model) -> tuple[str, ...]:
    """Of a slider those of the paper, of a machine places and velocities, and friction and normal forces."""
    if model.is_slider:
        return ("x", "v", "shear_stress", "normal_stress")
    ends = (".x", ".v", ".friction_force", ".normal_force")
    return tuple(name for name in model.observables if name.endswith(ends))


@dataclass(frozen=True, eq=False)
class _Descriptor:
    """x' = A x + B u + C z, y = D x + E u + F z, 0 = P x + Q u + R z, in this order.

    `first` says which x go first where one of several has to.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    first: Array
    rate_x: Array
    rate_u: Array
    rate_z: Array
    out_x: Array
    out_u: Array
    out_z: Array
    balance_x: Array
    balance_u: Array
    balance_z: Array

    def solved(self, outputs: tuple[str, ...], wanted: Sequence[str] | None) -> Matrices:
        """The matrices; without what would have to be differentiated, unless it is wanted."""
        here, kept = self, list(self.inputs if wanted is None else wanted)
        for _ in range(len(self.states) + 1):
            bound = here._bound()
            if bound is None:
                break
            rows, left = bound
            felt = np.abs(left @ here.balance_u) > NOTHING * np.max(np.abs(left), axis=1)[:, None] * np.max(
                np.abs(np.concatenate([here.balance_u, here.balance_x], axis=1))
            )
            lost = [name for i, name in enumerate(here.inputs) if name in kept and np.any(felt[:, i])]
            if lost and wanted is not None:
                raise NotAvailable(
                    f"{lost[0]} moves a body without mass at once, so that velocities follow from its rate and there "
                    "is no state space; give the body a mass or a dashpot, or name other inputs"
                )
            kept = [name for name in kept if name not in lost]
            here = here._without(rows, left)
        else:
            raise NotAvailable(UNDETERMINED)
        of = [here.inputs.index(name) for name in kept]
        solved = -np.linalg.solve(here.balance_z, np.hstack([here.balance_x, here.balance_u]))
        by_x, by_u = solved[:, : len(here.states)], solved[:, len(here.states) :]
        return Matrices(
            here.rate_x + here.rate_z @ by_x, (here.rate_u + here.rate_z @ by_u)[:, of],
            here.out_x + here.out_z @ by_x, (here.out_u + here.out_z @ by_u)[:, of],
            here.states, tuple(kept), outputs,
        )  # fmt: skip

    def _bound(self) -> tuple[NDArray[np.int64], Array] | None:
        """Balances that z does not enter: which rows may go for them, and their combinations; None where z is fixed."""
        matrix = self.balance_z
        rows = np.max(np.abs(np.hstack([matrix, self.balance_x])), axis=1)
        even = matrix / np.where(rows > 0, rows, 1.0)[:, None]
        columns = np.max(np.abs(even), axis=0)
        even = even / np.where(columns > 0, columns, 1.0)
        left, sizes, _ = np.linalg.svd(even)
        free = np.flatnonzero(sizes <= NOTHING * max(float(np.max(sizes, initial=0.0)), 1.0))
        if not len(free):
            return None
        from scipy.linalg import qr  # slow to import

        combined = left[:, free].T
        gone = qr(combined, pivoting=True, mode="r")[-1][: len(free)]
        return np.asarray(gone, dtype=np.int64), combined / np.where(rows > 0, rows, 1.0)

    def _without(self, rows: NDArray[np.int64], left: Array) -> _Descriptor:
        """Those balances differentiated, in place of `rows`, and as many states fewer."""
        constraint = left @ self.balance_x
        count, n = constraint.shape
        gone: list[int] = []
        work = constraint.copy()
        for i in range(count):  # elimination, what is to go first as pivots
            others = np.setdiff1d(np.arange(n), gone)
            best = np.max(np.abs(work[i:, others]), axis=0)
            if not np.any(best > 0):
                raise NotAvailable(UNDETERMINED)
            usable = best > PIVOT * np.max(best)
            j = int(others[np.argmax(np.where(usable & self.first[others], np.inf, best))])
            row = i + int(np.argmax(np.abs(work[i:, j])))
            work[[i, row]] = work[[row, i]]
            work[i] /= work[i, j]
            below = np.arange(count) != i
            work[below] -= np.outer(work[below, j], work[i])
            gone.append(j)
        kept = [j for j in range(n) if j not in gone]
        whole = np.zeros((n, len(kept)))  # all x from those that stay
        whole[kept, range(len(kept))] = 1.0
        whole[gone] = -work[:, kept]
        others = np.delete(np.arange(len(self.balance_z)), rows)
        x, u, z = (
            np.vstack([old[others], constraint @ rate])
            for old, rate in (
                (self.balance_x, self.rate_x),
                (self.balance_u, self.rate_u),
                (self.balance_z, self.rate_z),
            )
        )
        return replace(
            self, rate_x=(self.rate_x @ whole)[kept], rate_u=self.rate_u[kept], rate_z=self.rate_z[kept],
            out_x=self.out_x @ whole, balance_x=x @ whole, balance_u=u, balance_z=z,
            states=tuple(self.states[j] for j in kept), first=self.first[kept],
        )  # fmt: skip


@question
def _parts_function(model: Model, outputs: tuple[str, ...]) -> tuple[ArrayFunction, list[tuple[int, int]]]:
    """Entries of the nine blocks of a `_Descriptor`, and their shapes."""
    linear = linearise(model)
    variables = [item.symbol for item in model.variables]
    inputs = [symbol for name, symbol in model.inputs.items() if name != "time"]
    accelerations = {one.velocity: one.acceleration for one in model.coordinates if one.velocity in variables}
    frictions = [contact.friction for contact in model.contacts if contact.unknown is contact.friction]
    speeds = [one.velocity for one in model.coordinates if one.velocity not in variables]
    unknowns = [*accelerations.values(), *speeds, *frictions]
    rates = [{accelerations[s]: sp.Integer(1)} if s in accelerations else linear.rows[s] for s in variables]
    forces = [linear.rows[one.velocity] for one in model.coordinates]
    laws = [linear.rows[friction] for friction in frictions]
    groups = (rates, [linear.outputs[name] for name in outputs], [*forces, *laws])
    columns: tuple[Sequence[sp.Symbol], ...] = (variables, inputs, unknowns)
    entries = [row.get(c, sp.Integer(0)) for group in groups for part in columns for row in group for c in part]
    shapes = [(len(group), len(part)) for group in groups for part in columns]
    return model.function(entries), shapes


@checked()
def state_space(
    rig: Slider | Machine, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None
) -> StateSpace:
    """The linearised rig as `scipy.signal.StateSpace`.

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
        ``load_velocity`` (m/s or rad/s), ``BODY.push`` (N or N m) and ``CONTACT.press`` (N), but for those that move a
        body without mass at once.

    Returns
    -------
    scipy.signal.StateSpace
        States as in ``Model.variables``, without places of bodies without mass that follow from other places;
        its attributes ``state_names``, ``input_names`` and ``output_names`` list them all.

    Raises
    ------
    NoSteadySliding
        If there is nothing to linearise about.
    UnknownNameError
        If an output or input is unknown.
    NotAvailable
        If the rig has a delay, the problem is ill-posed, or numbers leave the range of floating point.
    """
    from scipy.signal import StateSpace

    found = state_matrices(rig, outputs, inputs)
    system = StateSpace(*found.blocks())
    system.state_names, system.input_names, system.output_names = found.states, found.inputs, found.outputs
    return system


@checked()
def to_control(rig: Slider | Machine, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None) -> Any:
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
    found = state_matrices(rig, outputs, inputs)
    names = {"states": found.states, "inputs": found.inputs, "outputs": found.outputs}
    return control.ss(*found.blocks(), **{kind: [one.replace(".", "_") for one in own] for kind, own in names.items()})
