"""Solve for steady sliding under constant inputs, and linearise the motion there.

A step of the load-point velocity or of the normal stress changes steady sliding: stress, memory and spring length. For
a slider the new one is in closed form, except in some cases the normal stress; for a machine it is solved for by
Newton's method on the rates. States are in the variables that the kernels integrate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import SPEED, V_LP, P, Reduction, W
from steadyslip.model.scales import natural_scales
from steadyslip.motion.jobs import Jobs
from steadyslip.nonlinear.kicks.field import normal_stresses, slopes_at, solved_at
from steadyslip.nonlinear.kicks.rest import Rest, in_columns

S = inner_symbol("s", positive=True)
"""Normal stress in steady sliding at the new inputs, the unknown; the rig's own is σss."""
STEPS = 8  # number of steps from the rig's own inputs to the new inputs, where there is no closed form
ROUNDS = 40  # limit of Newton iterations
SETTLED = 1e-9  # size of the Newton step at convergence, in natural sizes
ROUNDED = 1e-5  # used instead of SETTLED if rounding keeps the Newton step from shrinking further


@dataclass(frozen=True, eq=False)
class _Balance:
    """Compiled functions for steady sliding at other inputs than the rig's own.

    Their arguments are the parameters, the rig's own σss, v_lp, p and the normal stress s. `stress` returns the
    residual of the equation for s and its derivative, `state` the steady state. `affine`: the equation is linear in s.
    """

    affine: bool
    stress: ArrayFunction
    state: ArrayFunction


@cached
def _balance(reduction: Reduction) -> _Balance:
    """Compiled equation for the normal stress in steady sliding at v_lp and p, and compiled steady state (cached)."""
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

    past = {symbol: e for one in model.late_signals for symbol, e in one.settled.items()}

    def solved(stress: sp.Symbol, unknown: sp.Symbol, target: sp.Expr) -> sp.Expr:
        """Value of `unknown` at which a stress, defined linearly in it, equals `target`."""
        definition = model.definitions[stress].xreplace(past)
        definition = definition.xreplace({s: e for s, e in place.items() if s is not unknown})
        return (target - definition.xreplace({unknown: zero})) / sp.diff(definition, unknown)

    place[contact.spring] = solved(contact.friction, contact.spring, place[contact.friction])
    follows = model.integrals[0].symbol if model.integrals else contact.slip
    if follows is not contact.slip:
        place[contact.slip] = zero
    place[follows] = solved(contact.spring, follows, place[contact.spring])
    place |= {symbol: e.xreplace(place) for symbol, e in past.items()}
    residual = model.definitions[contact.normal].xreplace(place) - S
    slope = sp.diff(residual, S)
    w = reduction.w_of_v.xreplace(place)
    state = [w if symbol is W else place[symbol] for symbol in reduction.state]
    state += [w if symbol is W else place.get(symbol, zero) for symbol in reduction.unknowns]
    further = (V_LP, P, S)
    return _Balance(not slope.has(S), model.function([residual, slope], *further), model.function(state, *further))


def rest_of(jobs: Jobs, velocity: Array, pressure: Array, force: Array | None = None) -> Rest:
    """Steady sliding of the rigs of `jobs` at load-point velocities, added normal stresses and forces (m,).

    Where several steady states exist, the one that continues the rig's own steady sliding as inputs change is taken.
    """
    force = np.zeros(len(velocity)) if force is None else force
    if jobs.point.model.contacts[0].name:
        return _machine_rest(jobs, velocity, force, pressure)
    reduction, point, count = jobs.reduction, jobs.point, len(velocity)
    with np.errstate(all="ignore"):
        stress = _stress(reduction, point, velocity, pressure)
        stress = np.where(stress > 0, stress, np.nan)
        found = in_columns(point.evaluate(_balance(reduction).state, velocity, pressure, stress), count)
        n = len(reduction.state)
        state, unknowns = found[:, :n], found[:, n:]
        state = np.where(np.all(np.isfinite(found), axis=1)[:, None], state, np.nan)
        own, _ = natural_scales(point, reduction)
        if reduction.velocity == "linear":
            own = {**own, SPEED: velocity}
        scales = in_columns([own[name] for name in reduction.names], count)
    return _linearised(reduction, point, velocity, force, pressure, state, unknowns, scales)


def _linearised(
    reduction: Reduction, point: OperatingPoint, velocity: Array, force: Array, pressure: Array, state: Array,
    unknowns: Array, scales: Array,
) -> Rest:  # fmt: skip
    """The `Rest` of a known state, with the matrix of the linearised motion."""
    count, n = state.shape
    with np.errstate(all="ignore"):
        matrix = slopes_at(reduction, point, (velocity, force, pressure), state, unknowns, scales)
    good = np.all(np.isfinite(matrix), axis=(1, 2))
    roots = np.full((count, n), np.nan + 0j)
    if good.any():
        roots[good] = np.linalg.eigvals(matrix[good])
    return Rest(reduction, point, velocity, force, pressure, state, unknowns, scales, matrix, roots)


def _stress(reduction: Reduction, point: OperatingPoint, velocity: Array, pressure: Array) -> Array:
    """Normal stress (m,) in steady sliding at the inputs: in closed form, or in steps from the rig's own inputs."""
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


# --- machines: numerically, from the rig's own steady sliding ---------------------------------------------


def _machine_rest(jobs: Jobs, velocity: Array, force: Array, pressure: Array) -> Rest:
    """Solve for a machine's steady sliding by Newton's method; if this fails, in several steps of the inputs."""
    reduction, point, count = jobs.reduction, jobs.point, len(velocity)
    own, _ = natural_scales(point, reduction)
    drive = np.broadcast_to(np.asarray(point.drive, dtype=float), (count,))
    faster = velocity / drive
    columns = dict(own)
    for one, contact in zip(reduction.slidings, reduction.model.contacts, strict=True):
        if one.variable is not None and one.variable.kind == "linear":
            columns[f"{contact.name}.{SPEED}"] = columns[f"{contact.name}.{SPEED}"] * faster
    scales = in_columns([columns[name] for name in reduction.names], count)
    with np.errstate(all="ignore"):
        guess = in_columns(_as_fast(reduction, point, faster), count)
        state, unknowns = _settled(reduction, point, (velocity, force, pressure), guess, scales)
        lost = np.flatnonzero(~np.all(np.isfinite(state), axis=1))
        if len(lost) and np.any((faster != 1) | (force != 0) | (pressure != 0)):
            part, here = point.part(lost), in_columns(_as_fast(reduction, point, np.ones(count)), count)[lost]
            for share in np.linspace(0, 1, STEPS + 1)[1:]:
                inputs = drive[lost] * faster[lost] ** share, share * force[lost], share * pressure[lost]
                here = np.hstack(_settled(reduction, part, inputs, here, scales[lost]))
            n = len(reduction.state)
            state[lost], unknowns[lost] = here[:, :n], here[:, n:]
    return _linearised(reduction, point, velocity, force, pressure, state, unknowns, scales)


def _as_fast(reduction: Reduction, point: OperatingPoint, faster: Array) -> list[Any]:
    """State and unknowns in steady sliding at `faster` times the velocity; displacements and integrals are zero."""
    return point.evaluate(_steady_state_of(reduction), faster)


FASTER = inner_symbol("faster", positive=True)


@cached
def _steady_state_of(reduction: Reduction) -> ArrayFunction:
    """Compiled function of parameters, normal stresses and factor of velocity: the steady state (cached)."""
    model = reduction.model
    drive = model.parameters["drive.velocity"]

    def moved(expression: Any) -> sp.Expr:
        return sp.sympify(expression).xreplace({drive: drive * FASTER})

    steady = {item.symbol: moved(model.steady[item.symbol]) for item in (*model.memory, *model.states)}
    for one in model.coordinates:
        steady |= {one.displacement: sp.Integer(0), one.velocity: moved(one.speed), one.acceleration: sp.Integer(0)}
    steady |= {item.symbol: sp.Integer(0) for item in (*model.integrals, *model.past)}
    speeds = {contact.velocity: moved(model.steady[contact.velocity]) for contact in model.contacts}
    steady |= {contact.friction: moved(model.steady[contact.friction]) for contact in model.contacts}
    for sliding in reduction.slidings:
        if sliding.variable is not None:  # scaled by the rig's own velocity, whatever the velocity of the load point
            steady[sliding.variable.w] = sliding.variable.w_of_v.xreplace(steady | speeds)
    return model.function((steady[symbol] for symbol in (*reduction.state, *reduction.unknowns)), FASTER)


def _settled(
    reduction: Reduction, point: OperatingPoint, inputs: tuple[Array, ...], guess: Array, scales: Array
) -> tuple[Array, Array]:
    """Steady state (m, n) and unknowns (m, u), by Newton's method from a guess of both; NaN where there is none."""
    count, n = scales.shape
    state, unknowns = guess[:, :n].copy(), guess[:, n:].copy()
    nothing = np.full((count, n, n), np.nan)
    size, settled = np.full(count, np.inf), np.zeros(count, dtype=bool)
    for _ in range(ROUNDS):
        velocity, force, pressure = inputs
        here = Rest(reduction, point, velocity, force, pressure, state, unknowns, scales, nothing, nothing[:, 0])
        rates, slowest, solved = solved_at(here, state[:, None, :])
        unknowns = np.where(np.isfinite(solved[:, 0]) & ~settled[:, None], solved[:, 0], unknowns)
        matrix = slopes_at(reduction, point, inputs, state, unknowns, scales)
        good = np.all(np.isfinite(matrix), axis=(1, 2)) & np.all(np.isfinite(rates[:, 0]), axis=1)
        change = np.full((count, n), np.nan)
        for i in np.flatnonzero(good & ~settled):
            try:
                change[i] = -np.linalg.solve(matrix[i], rates[i, 0] / scales[i])
            except np.linalg.LinAlgError:
                continue
        state = state + np.where(np.isfinite(change), change, 0.0) * scales
        before, size = size, np.max(np.abs(change) / (1 + np.abs(state / scales)), axis=1)
        settled |= (size <= SETTLED) | ((size <= ROUNDED) & (size > 0.5 * before))
        if not np.any(~settled & np.isfinite(size)):
            break
    slides = good & settled & (slowest[:, 0] > 0)
    pressed = np.all(normal_stresses(here, state, unknowns) > 0, axis=1)
    return np.where((slides & pressed)[:, None], state, np.nan), unknowns
