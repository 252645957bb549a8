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
from steadyslip.model.reduction import SLOPES, TIME, V_LP, P, Q, Reduction, W
from steadyslip.model.scales import natural_scales
from steadyslip.motion.jobs import Jobs

Array = np.ndarray
S = sp.Symbol("s", positive=True)
"""The normal stress sought, apart from the rig's own steady one."""
NEUTRAL = 1e-8  # growth per radian below which small motions neither grow nor decay
STEPS = 8  # from the rig's own inputs to the new ones, where the normal stress has no closed form
ROUNDS = 40  # of Newton's method at most
ROUNDING = 1e-14  # of stresses, in the normal stress
BALANCED = 12  # rounds of Newton's method for the balance of forces
SETTLED = 1e-9  # change of the state, in natural sizes, at the end of the search for steady sliding of a machine,
ROUNDED = 1e-5  # or less than this, where rounding keeps it from falling any further


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
    """Rates and slip rates, then the residual of the balance and its slope where there is an unknown left.

    A function of the parameters, σss, v_lp, q, p, the state and the unknown if there is one.
    """
    left = [] if reduction.unknown is None else [reduction.residual, sp.diff(reduction.residual, reduction.unknown)]
    return _at_constant_inputs(reduction, [*reduction.rates, *(one.outputs["v"] for one in reduction.slidings), *left])


@question
def _jacobian_of(reduction: Reduction) -> Callable[..., list[Any]]:
    return _at_constant_inputs(reduction, [entry for row in reduction.jacobian() for entry in row])


def _at_constant_inputs(reduction: Reduction, expressions: list[sp.Expr]) -> Callable[..., list[Any]]:
    unknown = () if reduction.unknown is None else (reduction.unknown,)
    still = {TIME: sp.Integer(0)}
    still |= {s: sp.Integer(0) for s in sp.symbols("v_lp_dot q_dot p_dot", real=True)}
    at_rest = (sp.sympify(e).xreplace(still) for e in expressions)
    return reduction.model.function(at_rest, V_LP, Q, P, *reduction.state, *unknown)


@dataclass(frozen=True, eq=False)
class Rest:
    """Steady sliding of m rigs at their inputs, in the n state variables of the kernels.

    Attributes
    ----------
    reduction : Reduction
    point : OperatingPoint
        The rigs; numbers or (m,).
    velocity, force, pressure : ndarray (m,)
        Of the load point, m/s; force on a body, N, and added normal stress, Pa, of machines N.
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
    force: Array
    pressure: Array
    state: Array
    unknown: Array
    scales: Array
    matrix: Array
    roots: Array

    @property
    def sigmas(self) -> tuple[Array, ...]:
        """The rigs' own steady normal stresses, which the equations refer to, (m,) for each contact."""
        own = (np.asarray(sigma, dtype=float) for sigma in self.point.sigmas)
        return tuple(np.broadcast_to(sigma, self.velocity.shape) for sigma in own)

    def given(self) -> tuple[Any, ...]:
        """What functions of `field_of` take before the state."""
        return (*self.point.arguments, *self.sigmas, self.velocity, self.force, self.pressure)

    @property
    def is_machine(self) -> bool:
        """Whether bodies and contacts have names."""
        return bool(self.reduction.model.contacts[0].name)

    @property
    def places(self) -> tuple[int, ...]:
        """Where displacements stand in the state."""
        own = {one.displacement for one in self.reduction.model.coordinates}
        return tuple(i for i, symbol in enumerate(self.reduction.state) if symbol in own)

    @property
    def speeds(self) -> Array:
        """Natural velocities of these, (m, places)."""
        if not self.is_machine:
            return np.asarray(np.abs(self.velocity)[:, None])
        own, _ = natural_scales(self.point, self.reduction)
        names = [self.reduction.names[i].removesuffix("x") + "v" for i in self.places]
        faster = np.abs(self.velocity / np.asarray(self.point.drive, dtype=float))
        return np.asarray(faster[:, None] * _columns([own[name] for name in names], len(self.velocity)))

    @property
    def way(self) -> Array:
        """Natural length of a step of the load point, (m,)."""
        shifts = np.abs(_columns(self.point.evaluate(_shifts(self.reduction)), len(self.velocity)))
        with np.errstate(divide="ignore"):
            return np.asarray(np.min(self.scales[:, list(self.places)] / shifts, axis=1))

    @property
    def time(self) -> Array:
        """Natural time, s, (m,)."""
        return np.asarray(self.way / np.abs(self.velocity))

    @property
    def contact(self) -> int:
        """The contact that moves most in the leading mode of the first rig, by whose slip motions are watched."""
        slidings = self.reduction.slidings
        if len(slidings) == 1 or not np.all(np.isfinite(self.matrix[0])):
            return 0
        roots, vectors = np.linalg.eig(self.matrix[0])
        mode = vectors[:, np.argmax(roots.real)] * self.scales[0]
        first = self.point.part(np.array([0]))
        rows = _columns(first.evaluate(_slip_gradients(self.reduction)), 1).reshape(len(slidings), -1)
        ratios = _columns(first.evaluate(_ratios(self.reduction)), 1)[0]
        return int(np.argmax(np.abs(rows @ mode) / np.abs(ratios)))

    def slip_rate(self, contact: int) -> Array:
        """At a contact as fast as the load point, m/s, (m,)."""
        ratios = _columns(self.point.evaluate(_ratios(self.reduction)), len(self.velocity))
        return np.asarray(self.velocity * ratios[:, contact])

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
            "velocity", "force", "pressure", "state", "unknown", "scales", "matrix", "roots"))  # fmt: skip
        return Rest(self.reduction, self.point.part(which), *own)

    def column(self, number: Any) -> Any:
        """A parameter as it broadcasts against (m, ...) arrays with one more axis."""
        return number[:, None] if np.ndim(number) and len(number) != 1 else number


def picked(array: Any, which: Array) -> Any:
    """Entries of an array with one for each rig; single ones are for all of them."""
    return array[which] if np.ndim(array) and len(array) > 1 else array


@question
def _shifts(reduction: Reduction) -> Callable[..., list[Any]]:
    return reduction.model.function(reduction.shifts)


@question
def _ratios(reduction: Reduction) -> Callable[..., list[Any]]:
    return reduction.model.function(one.ratio for one in reduction.slidings)


@question
def _slip_gradients(reduction: Reduction) -> Callable[..., list[Any]]:
    return reduction.model.function(sp.diff(one.slip, s) for one in reduction.slidings for s in reduction.state)


def rest_of(jobs: Jobs, velocity: Array, pressure: Array, force: Array | None = None) -> Rest:
    """Steady sliding of the rigs of `jobs` at load-point velocities, added normal stresses and forces (m,).

    Where there are several it is the one that the rig's own leads to as the inputs change.
    """
    force = np.zeros(len(velocity)) if force is None else force
    if jobs.point.model.contacts[0].name:
        return _machine_rest(jobs, velocity, force, pressure)
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
    return _linearised(reduction, point, velocity, force, pressure, state, unknown, scales)


def _linearised(
    reduction: Reduction, point: OperatingPoint, velocity: Array, force: Array, pressure: Array, state: Array,
    unknown: Array, scales: Array,
) -> Rest:  # fmt: skip
    """Steady sliding that is known, with the matrix there."""
    count, n = state.shape
    with np.errstate(all="ignore"):
        matrix = _slopes(reduction, point, (velocity, force, pressure), state, unknown, scales)
    good = np.all(np.isfinite(matrix), axis=(1, 2))
    roots = np.full((count, n), np.nan + 0j)
    if good.any():
        roots[good] = np.linalg.eigvals(matrix[good])
    return Rest(reduction, point, velocity, force, pressure, state, unknown, scales, matrix, roots)


def _slopes(
    reduction: Reduction, point: OperatingPoint, inputs: tuple[Array, ...], state: Array, unknown: Array, scales: Array
) -> Array:
    """Jacobian of the rates in natural sizes, (m, n, n)."""
    count, n = state.shape
    left = () if reduction.unknown is None else (unknown,)
    entries = point.evaluate(_jacobian_of(reduction), *inputs, *state.T, *left)
    return np.asarray(_columns(entries, count).reshape(count, n, n) * scales[:, None, :] / scales[:, :, None])


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


# --- of machines: numerically, from where the rig itself slides ---------------------------------------------


def _machine_rest(jobs: Jobs, velocity: Array, force: Array, pressure: Array) -> Rest:
    """Newton's method on the rates: from velocities and memory as they are there, else step by step."""
    reduction, point, count = jobs.reduction, jobs.point, len(velocity)
    own, _ = natural_scales(point, reduction)
    drive = np.broadcast_to(np.asarray(point.drive, dtype=float), (count,))
    faster = velocity / drive
    columns = dict(own)
    for one, contact in zip(reduction.slidings, reduction.model.contacts, strict=True):
        if one.variable is not None and one.variable.kind == "linear":
            columns[f"{contact.name}.w"] = columns[f"{contact.name}.w"] * faster
    scales = _columns([columns[name] for name in reduction.names], count)
    with np.errstate(all="ignore"):
        guess = _columns(_as_fast(reduction, point, faster), count)
        state, unknown = _settled(reduction, point, (velocity, force, pressure), guess, scales)
        lost = np.flatnonzero(~np.all(np.isfinite(state), axis=1))
        if len(lost) and np.any((faster != 1) | (force != 0) | (pressure != 0)):
            part, here = point.part(lost), _columns(_as_fast(reduction, point, np.ones(count)), count)[lost]
            for share in np.linspace(0, 1, STEPS + 1)[1:]:
                inputs = drive[lost] * faster[lost] ** share, share * force[lost], share * pressure[lost]
                here = np.column_stack(_settled(reduction, part, inputs, here, scales[lost]))
            state[lost], unknown[lost] = here[:, :-1], here[:, -1]
    return _linearised(reduction, point, velocity, force, pressure, state, unknown, scales)


def _as_fast(reduction: Reduction, point: OperatingPoint, faster: Array) -> list[Any]:
    """The state in steady sliding so many times as fast, and the unknown; displacements and integrals are the rig's."""
    return point.evaluate(_steady_state_of(reduction), faster)


FASTER = sp.Symbol("faster", positive=True)


@question
def _steady_state_of(reduction: Reduction) -> Callable[..., list[Any]]:
    """That of a rig's parameters and normal stresses, and of how many times as fast it slides."""
    model = reduction.model
    drive = model.parameters["drive.velocity"]

    def moved(expression: Any) -> sp.Expr:
        return sp.sympify(expression).xreplace({drive: drive * FASTER})

    steady = {item.symbol: moved(model.steady[item.symbol]) for item in (*model.memory, *model.states)}
    for one in model.coordinates:
        steady |= {one.displacement: sp.Integer(0), one.velocity: moved(one.speed), one.acceleration: sp.Integer(0)}
    steady |= {item.symbol: sp.Integer(0) for item in model.integrals}
    speeds = {contact.velocity: moved(model.steady[contact.velocity]) for contact in model.contacts}
    steady |= {contact.friction: moved(model.steady[contact.friction]) for contact in model.contacts}
    for sliding in reduction.slidings:
        if sliding.variable is not None:  # whose scale is the rig's own velocity, whatever the load point's is
            steady[sliding.variable.w] = sliding.variable.w_of_v.xreplace(steady | speeds)
    left = sp.Integer(0) if reduction.unknown is None else steady[reduction.unknown]
    return model.function([*(steady[symbol] for symbol in reduction.state), left], FASTER)


def _settled(
    reduction: Reduction, point: OperatingPoint, inputs: tuple[Array, ...], guess: Array, scales: Array
) -> tuple[Array, Array]:
    """State (m, n) and unknown (m,) at which nothing changes, near a guess (m, n + 1); NaN where there is none."""
    count, n = scales.shape
    state, unknown = guess[:, :n].copy(), guess[:, n].copy()
    nothing = np.full((count, n, n), np.nan)
    change, size = np.full((count, n), np.inf), np.full(count, np.inf)
    for _ in range(ROUNDS):
        velocity, force, pressure = inputs
        here = Rest(reduction, point, velocity, force, pressure, state, unknown, scales, nothing, nothing[:, 0])
        rates, slowest, solved = solved_at(here, state[:, None, :])
        unknown = np.where(np.isfinite(solved[:, 0]), solved[:, 0], unknown)
        matrix = _slopes(reduction, point, inputs, state, unknown, scales)
        good = np.all(np.isfinite(matrix), axis=(1, 2)) & np.all(np.isfinite(rates[:, 0]), axis=1)
        change = np.full((count, n), np.nan)
        for i in np.flatnonzero(good):
            try:
                change[i] = -np.linalg.solve(matrix[i], rates[i, 0] / scales[i])
            except np.linalg.LinAlgError:
                continue
        state = state + np.where(np.isfinite(change), change, 0.0) * scales
        before, size = size, np.max(np.abs(change) / (1 + np.abs(state / scales)), axis=1)
        settled = (size <= SETTLED) | ((size <= ROUNDED) & (size > 0.5 * before))
        if not np.any(~settled & np.isfinite(size)):
            break
    slides = good & settled & (slowest[:, 0] > 0)
    pressed = np.all(normal_stresses(here, state, unknown) > 0, axis=1)
    return np.where((slides & pressed)[:, None], state, np.nan), unknown


def normal_stresses(rest: Rest, state: Array, unknown: Array) -> Array:
    """Of every contact, at states (m, n), one for each rig: (m, contacts)."""
    inputs = rest.velocity, rest.force, rest.pressure
    found = rest.point.evaluate(_normal_of(rest.reduction), *inputs, *state.T, unknown)
    return _columns(found, len(state))


@question
def _normal_of(reduction: Reduction) -> Callable[..., list[Any]]:
    """Normal stresses."""
    still = {TIME: sp.Integer(0)} | dict.fromkeys(SLOPES[:3], sp.Integer(0))
    unknown = sp.Dummy() if reduction.unknown is None else reduction.unknown
    wanted = (one.outputs["sigma"].xreplace(still) for one in reduction.slidings)
    return reduction.model.function(wanted, V_LP, Q, P, *reduction.state, unknown)


# --- motion at constant inputs ------------------------------------------------------------------------------


def rates_at(rest: Rest, states: Array) -> Array:
    """Rates (m, d, n) at states (m, d, n), d of them for each rig; NaN where the balance of forces has no solution."""
    return motion_at(rest, states)[0]


def motion_at(rest: Rest, states: Array) -> tuple[Array, Array]:
    """Rates (m, d, n) and the slowest slip rate (m, d) at states (m, d, n); NaN where forces cannot balance."""
    rates, velocity, _ = solved_at(rest, states)
    return rates, velocity


def solved_at(rest: Rest, states: Array) -> tuple[Array, Array, Array]:
    """The same, and the unknown of the balance (m, d)."""
    given = [rest.column(np.asarray(a)) for a in rest.given()]
    function, split = field_of(rest.reduction), np.moveaxis(states, 2, 0)
    shape, unknown = states.shape[:2], np.zeros(states.shape[:2])
    with np.errstate(all="ignore"):
        if rest.reduction.unknown is None:
            found = function(*given, *split)
        else:
            unknown = np.broadcast_to(rest.unknown[:, None], shape).copy()
            for _ in range(BALANCED):
                *found, residual, slope = function(*given, *split, unknown)
                change = residual / slope
                unknown = unknown - change
            rounding = ROUNDING * rest.sigmas[0][:, None] / np.abs(slope)  # much where mass is small
            settled = np.abs(change) <= 1e-10 * (np.abs(unknown) + _size(rest)[:, None]) + rounding
            found = [np.where(settled, rate, np.nan) for rate in found]
    numbers = [np.broadcast_to(np.asarray(number, dtype=float), shape) for number in found]
    n = states.shape[2]
    return np.stack(numbers[:n], axis=2), np.minimum.reduce(numbers[n:]), unknown


def _size(rest: Rest) -> Array:
    """Natural size of the unknown: of the velocity variable, an acceleration, or a friction."""
    if rest.is_machine:
        return np.broadcast_to(natural_scales(rest.point, rest.reduction)[1][0], rest.velocity.shape)
    if not rest.reduction.model.inertial:
        return np.ones(len(rest.velocity)) if rest.reduction.velocity != "linear" else rest.velocity
    return np.asarray(rest.velocity**2 / rest.scales[:, rest.places[0]])
