"""Steady sliding under constant inputs: where a rig would come to rest relative to its load point after a kick.

A step of the load-point velocity or of the normal stress leads to another steady sliding than the rig's own: other
stress, memory and spring length. It is found from the Model's own equations, and with it the linearisation there,
in the variables that the kernels integrate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.questions import question
from steadyslip.model import OperatingPoint
from steadyslip.model.reduction import TIME, V_LP, P, Q, Reduction, W
from steadyslip.model.scales import natural_scales
from steadyslip.motion.jobs import Jobs

Array = np.ndarray
S = sp.Symbol("s", positive=True)
"""The normal stress sought, apart from the rig's own steady one."""
NEUTRAL = 1e-8  # growth per radian below which small motions neither grow nor decay
STEPS = 8  # from the rig's own inputs to the new ones, where the normal stress has no closed form
ROUNDS = 40  # of Newton's method at most


@dataclass(frozen=True, eq=False)
class _Balance:
    """Steady sliding at other inputs; functions of parameters, own σss, v_lp, p and the stress s."""

    affine: bool
    stress: Callable[..., list[Any]]
    state: Callable[..., list[Any]]


@question
def _balance(reduction: Reduction) -> _Balance:
    """The equation for the normal stress in steady sliding at v_lp and p, its slope, and the state there."""
    model = reduction.model
    contact, zero = model.contact, sp.Integer(0)
    velocity = model.parameters["drive.velocity"]
    moved = {velocity: V_LP, contact.sigma_ss: S}
    place: dict[sp.Symbol, sp.Expr] = {
        symbol: sp.sympify(model.steady[symbol]).xreplace(moved)
        for symbol in (*(item.symbol for item in (*model.memory, *model.states)), contact.friction)
    }
    place |= {contact.velocity: V_LP, contact.acceleration: zero}
    inputs = {model.inputs["load_velocity"]: V_LP, model.inputs["disturbance"]: zero, model.inputs["time"]: zero}
    inputs[model.inputs["normal_disturbance"]] = P
    place |= inputs

    def solved(stress: sp.Symbol, unknown: sp.Symbol, target: sp.Expr) -> sp.Expr:
        """What the definition of a stress, linear in `unknown`, needs to be `target`."""
        definition = model.definitions[stress].xreplace({s: e for s, e in place.items() if s is not unknown})
        return (target - definition.xreplace({unknown: zero})) / sp.diff(definition, unknown)

    place[contact.spring] = solved(contact.friction, contact.spring, place[contact.friction])
    follows = model.integrals[0].symbol if model.integrals else contact.slip
    if follows is not contact.slip:
        place[contact.slip] = zero
    place[follows] = solved(contact.spring, follows, place[contact.spring])
    residual = model.definitions[contact.normal].xreplace(place) - S
    slope = sp.diff(residual, S)
    w = reduction.w_of_v.xreplace(place)
    state = [w if symbol is W else place[symbol] for symbol in reduction.state]
    if reduction.unknown is not None:
        state.append(w if reduction.unknown is W else zero)
    further = (V_LP, P, S)
    return _Balance(not slope.has(S), model.function([residual, slope], *further), model.function(state, *further))


@question
def field_of(reduction: Reduction) -> Callable[..., list[Any]]:
    """Rates and the block's velocity, then the residual of the balance and its slope where there is an unknown left.

    A function of the parameters, σss, v_lp, p, the state and the unknown if there is one.
    """
    left = [] if reduction.unknown is None else [reduction.residual, sp.diff(reduction.residual, reduction.unknown)]
    return _at_constant_inputs(reduction, [*reduction.rates, reduction.outputs["v"], *left])


@question
def _jacobian_of(reduction: Reduction) -> Callable[..., list[Any]]:
    return _at_constant_inputs(reduction, [entry for row in reduction.jacobian() for entry in row])


def _at_constant_inputs(reduction: Reduction, expressions: list[sp.Expr]) -> Callable[..., list[Any]]:
    unknown = () if reduction.unknown is None else (reduction.unknown,)
    still = {Q: sp.Integer(0), TIME: sp.Integer(0)}
    still |= {s: sp.Integer(0) for s in sp.symbols("v_lp_dot q_dot p_dot", real=True)}
    at_rest = (sp.sympify(e).xreplace(still) for e in expressions)
    return reduction.model.function(at_rest, V_LP, P, *reduction.state, *unknown)


@dataclass(frozen=True, eq=False)
class Rest:
    """Steady sliding of m rigs at their inputs, in the n state variables of the kernels.

    Attributes
    ----------
    reduction : Reduction
    point : OperatingPoint
        The rigs; numbers or (m,).
    velocity, pressure : ndarray (m,)
        Of the load point, m/s; added normal stress, Pa.
    state : ndarray (m, n)
        NaN where there is none.
    unknown : ndarray (m,)
        What Newton's method finds there, where there is such an unknown.
    scales : ndarray (m, n)
        Natural sizes of the state variables.
    matrix : ndarray (m, n, n)
        Jacobian of the rates there, in natural sizes, 1/s.
    roots : ndarray (m, n)
        Its eigenvalues, 1/s.
    """

    reduction: Reduction
    point: OperatingPoint
    velocity: Array
    pressure: Array
    state: Array
    unknown: Array
    scales: Array
    matrix: Array
    roots: Array

    @property
    def sigma(self) -> Array:
        """The rigs' own steady normal stress, which the equations refer to, (m,)."""
        return np.broadcast_to(self.point.stresses, self.velocity.shape)

    @property
    def exists(self) -> Array:
        """Whether there is steady sliding (m,)."""
        return np.asarray(np.all(np.isfinite(self.roots), axis=1))

    @property
    def leading(self) -> Array:
        """The eigenvalue with the largest real part (m,); NaN where there is no steady sliding."""
        real = np.where(np.isnan(self.roots.real), -np.inf, self.roots.real)
        return np.take_along_axis(self.roots, np.argmax(real, axis=1)[:, None], axis=1)[:, 0]

    @property
    def neutral(self) -> Array:
        """Whether small motions neither grow nor decay, within rounding (m,)."""
        leading, largest = self.leading, np.max(np.abs(self.roots), axis=1)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(leading.real) <= NEUTRAL * np.abs(leading) + 1e-15 * largest)

    @property
    def stable(self) -> Array:
        """Whether small motions decay (m,); not where they are neutral."""
        with np.errstate(invalid="ignore"):
            return np.asarray((self.leading.real < 0) & ~self.neutral)

    def part(self, which: Array) -> Rest:
        """Some of the rigs."""
        own = (getattr(self, name)[which] for name in (
            "velocity", "pressure", "state", "unknown", "scales", "matrix", "roots"))  # fmt: skip
        return Rest(self.reduction, self.point.part(which), *own)

    def column(self, number: Any) -> Any:
        """A parameter as it broadcasts against (m, ...) arrays with one more axis."""
        return number[:, None] if np.ndim(number) and len(number) != 1 else number


def picked(array: Any, which: Array) -> Any:
    """Entries of an array with one for each rig; single ones are for all of them."""
    return array[which] if np.ndim(array) and len(array) > 1 else array


def rest_of(jobs: Jobs, velocity: Array, pressure: Array) -> Rest:
    """Steady sliding of the rigs of `jobs` at load-point velocities and added normal stresses (m,).

    Where there are several it is the one that the rig's own leads to as the inputs change.
    """
    reduction, point, count = jobs.reduction, jobs.point, len(velocity)
    with np.errstate(all="ignore"):
        stress = _stress(reduction, point, velocity, pressure)
        stress = np.where(stress > 0, stress, np.nan)
        found = _columns(point.evaluate(_balance(reduction).state, velocity, pressure, stress), count)
        n = len(reduction.state)
        state, unknown = found[:, :n], found[:, -1]
        state = np.where(np.all(np.isfinite(found), axis=1)[:, None], state, np.nan)
        own, _ = natural_scales(point, reduction)
        if reduction.velocity == "linear":
            own = {**own, "w": velocity}
        scales = _columns([own[name] for name in reduction.names], count)
        left = () if reduction.unknown is None else (unknown,)
        entries = point.evaluate(_jacobian_of(reduction), velocity, pressure, *state.T, *left)
        matrix = _columns(entries, count).reshape(count, n, n) * scales[:, None, :] / scales[:, :, None]
    good = np.all(np.isfinite(matrix), axis=(1, 2))
    roots = np.full((count, n), np.nan + 0j)
    if good.any():
        roots[good] = np.linalg.eigvals(matrix[good])
    return Rest(reduction, point, velocity, pressure, state, unknown, scales, matrix, roots)


def _columns(numbers: Any, count: int) -> Array:
    return np.column_stack([np.broadcast_to(np.asarray(x, dtype=float), (count,)) for x in numbers])


def _stress(reduction: Reduction, point: OperatingPoint, velocity: Array, pressure: Array) -> Array:
    """Normal stress in steady sliding at the inputs: in closed form, or followed there from the rig's own."""
    balance, sigma = _balance(reduction), np.broadcast_to(point.stresses, velocity.shape)
    if balance.affine:
        at_zero, slope = point.evaluate(balance.stress, velocity, pressure, np.zeros(len(sigma)))
        return np.broadcast_to(-np.asarray(at_zero) / slope, sigma.shape)
    drive = np.asarray(point.drive, dtype=float)
    stress = np.array(sigma)
    for share in np.linspace(0, 1, STEPS + 1)[1:]:
        inputs = drive * (velocity / drive) ** share, share * pressure
        for _ in range(ROUNDS):
            residual, slope = point.evaluate(balance.stress, *inputs, stress)
            change = -residual / slope
            stress = stress * np.exp(np.clip(change / stress, -1, 1))  # stays positive
            if not np.any(np.abs(change) > 1e-14 * stress):
                break
    lost = np.abs(change) > 1e-9 * stress
    return np.where(lost, np.nan, stress)
