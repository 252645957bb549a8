"""The sizes that matter at an operating point, and what they decide: scales of variables, what to eliminate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.expressions import FEW, ArrayFunction, Choose, derivative
from steadyslip.core.questions import question
from steadyslip.core.results import ReadOnly
from steadyslip.model.equations import Model
from steadyslip.model.kinematics import kinematics
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import can_eliminate
from steadyslip.model.reduction import Reduction

LEAST_WEIGHT = 1e-5  # in that of ln v, below which a memory variable is not eliminated: its inverse amplifies rounding
MOST_NOISE = 1e-2  # in ln v, from which on rounding decides how a block moves


@dataclass(frozen=True)
class Weights(ReadOnly):
    """Derivatives in steady sliding, as arrays or as nodes of a program.

    Attributes
    ----------
    direct : ndarray
        Of friction in ln v, Pa.
    by_slip : ndarray
        Of the balance in x, Pa/m.
    by_memory : tuple of ndarray
        Of friction in each memory variable.
    decay : tuple of ndarray
        Of each memory variable's rate in itself, 1/s.
    memory : tuple of ndarray
        The memory variables themselves.
    by_unknown : ndarray
        Of the balance in its unknown.
    """

    direct: Any
    by_slip: Any
    by_memory: tuple[Any, ...]
    decay: tuple[Any, ...]
    memory: tuple[Any, ...]
    by_unknown: Any

    @classmethod
    def of(cls, values: Sequence[Any]) -> Weights:
        """From the values of what `weighed` lists."""
        direct, by_slip, by_unknown, *rest = values
        count = len(rest) // 3
        by_memory, decay, memory = (tuple(rest[i : i + count]) for i in (0, count, 2 * count))
        return cls(direct, by_slip, by_memory, decay, memory, by_unknown)


def weighed(model: Model, index: int = 0) -> list[sp.Expr]:
    """What `Weights` holds: direct, by slip, by unknown, then of each memory its weight, its decay, itself."""
    contact = model.contacts[index]
    v, memory = contact.velocity, [item.symbol for item in contact.memory]
    wanted = [v * derivative(contact.balance, v), *_held(model, index)]
    wanted += [derivative(contact.balance, m) for m in memory]
    wanted += [derivative(model.rate_of[m], m) for m in memory]
    return [model.at_steady(e.doit()) for e in (*wanted, *memory)]


def _held(model: Model, index: int) -> list[sp.Expr]:
    """Derivatives of a contact's balance of forces in slip and in what it fixes; per area of that contact."""
    contact, place = model.contacts[index], kinematics(model).coordinates[index]
    inlined = model.inlined(contact.balance)
    if contact.friction in model.definitions:
        return [derivative(inlined, contact.slip), derivative(inlined, contact.unknown)]
    slip = sp.sympify(model.definitions.get(contact.velocity, contact.velocity))
    place = place or next(one for one in model.coordinates if slip.has(one.velocity))
    share = contact.area * derivative(slip, place.velocity) ** 2
    balance = model.inlined(sp.Integer(0) if place.balance is None else place.balance)
    fixed = derivative(balance, place.acceleration if place.inertial else place.velocity) / share
    friction = sp.Integer(0) if place.inertial else derivative(contact.balance, contact.velocity)
    return [derivative(balance, place.displacement) / share, fixed + friction]


@question
def _weights_function(model: Model, index: int) -> ArrayFunction:
    return model.function(weighed(model, index))


@question
def weights(point: OperatingPoint, index: int = 0) -> Weights:
    """Derivatives in steady sliding of all rigs of a point, at one of their contacts."""
    found = _weights_function(point.model, index)(*_arrays(point))
    return Weights.of([np.asarray(x, dtype=float) for x in found])


def _arrays(point: OperatingPoint) -> list[np.ndarray]:
    return [*map(np.asarray, point.arguments), *map(np.atleast_1d, point.sigmas)]


@question
def slip_rates(point: OperatingPoint) -> tuple[Any, ...]:
    """Velocity of every contact in steady sliding, m/s."""
    model = point.model
    return tuple(point.evaluate(_slip_rates(model)))


@question
def _slip_rates(model: Model) -> ArrayFunction:
    return model.function(model.steady[contact.velocity] for contact in model.contacts)


@question
def posed(point: OperatingPoint) -> np.ndarray:
    """Whether the balances of forces rise with their unknowns (velocities, or accelerations) in steady sliding.

    If not, the least lag or mass that was left out decides the motion. Of several balances the eigenvalues must be
    positive.
    """
    if point.model.is_single:
        return np.atleast_1d(weights(point).by_unknown > 0)
    function, size = _rising(point.model)
    entries = [np.broadcast_to(np.asarray(e, dtype=float), point.shape or (1,)) for e in function(*_arrays(point))]
    matrix = np.moveaxis(np.array(entries).reshape(size, size, -1), -1, 0)
    good = np.isfinite(matrix).all(axis=(1, 2))
    rises = np.ones(len(matrix), dtype=bool)
    if size:
        rises = np.linalg.eigvals(np.where(good[:, None, None], matrix, 0.0)).real.min(axis=1) > 0
    return np.asarray(rises & good)


def rising(model: Model) -> list[list[sp.Expr]]:
    """Derivatives of the balances of coordinates in accelerations, or without inertia in velocities of contacts."""
    moving = kinematics(model)
    places = [one for one in model.coordinates if one.inertial or moving.contact_at(one) is not None]
    slopes = {}
    for contact in model.contacts:  # friction follows what moves
        balance = model.inlined(contact.balance)
        slopes[contact.friction] = {
            s: -derivative(balance, s) / derivative(balance, contact.friction)
            for one in places
            for s in (one.acceleration, one.velocity)
        }
    rows = []
    for one in places:
        balance = model.inlined(sp.Integer(0) if one.balance is None else one.balance)
        entries = []
        for other in places:
            symbol = other.acceleration if other.inertial else other.velocity
            total = derivative(balance, symbol)
            for friction, slope in slopes.items():
                total += derivative(balance, friction) * slope[symbol]
            entries.append(model.at_steady(total.doit()))
        rows.append(entries)
    return rows


@question
def _rising(model: Model) -> tuple[ArrayFunction, int]:
    rows = rising(model)
    return model.function(e for row in rows for e in row), len(rows)


@question
def _force_function(model: Model, index: int) -> ArrayFunction:
    """Forces that keep each other in balance in steady sliding, at a contact.

    The force of a dashpot per change of ln v; what pull and friction do to the normal stress; then what adds up to
    nothing: pull and friction, and the shares of normal stress and memory in it.
    """
    contact = model.contacts[index]
    inner = [contact.normal, *(item.symbol for item in contact.memory)]
    shares = [model.at_steady(symbol * derivative(contact.balance, symbol)) for symbol in inner]
    dashpot = model.at_steady(contact.velocity * derivative(model.definitions[contact.spring], contact.velocity))
    pressing = [
        model.at_steady(symbol * derivative(model.definitions[contact.normal], symbol))
        for symbol in (contact.spring, contact.friction)
    ]
    return model.function([dashpot, *pressing, model.steady[contact.spring], model.steady[contact.friction], *shares])


@question
def resolved(point: OperatingPoint) -> np.ndarray:
    """Whether rounding of the forces leaves the velocity of steady sliding its digits.

    What rounding adds to the balance changes ln v by that over the slope of the balance in ln v; with inertia over the
    direct effect and over what it takes to change velocity while the block slips a natural length. The rounding of
    velocity changes the force of a dashpot, and that of forces the normal stress, by little beside what there is. Where
    motion is ill-posed, that is the matter instead.
    """
    apart = np.ones(1, dtype=bool)
    for index in range(len(point.model.contacts)):
        apart = apart & _resolved(point, index)
    return np.asarray(apart | ~posed(point))


def _resolved(point: OperatingPoint, index: int) -> np.ndarray:
    found, drive = weights(point, index), slip_rates(point)[index]
    place = kinematics(point.model).coordinates[index]
    dashpot, pull, friction, *forces = point.evaluate(_force_function(point.model, index))
    with np.errstate(all="ignore"):
        held = np.abs(np.asarray(drive, dtype=float) * found.by_unknown)
        if place is None or place.inertial:
            rates = [found.by_slip * drive / found.direct, *found.decay]
            held = np.abs(found.direct) + held * np.maximum.reduce(np.broadcast_arrays(*map(np.abs, rates)))
        largest = np.maximum.reduce(np.broadcast_arrays(*map(np.abs, forces)))
        least = MOST_NOISE / np.finfo(float).eps
        hidden = (largest > least * held) | (np.abs(dashpot) > least * largest)
        hidden |= np.maximum(np.abs(pull), np.abs(friction)) > least * np.atleast_1d(point.sigmas[index])
        return np.asarray(~hidden)


@question
def eliminable(point: OperatingPoint) -> int | tuple[int | None, ...] | None:
    """The memory variable to leave out: of those that allow it, the one with most weight in friction.

    None where there is none, or where in some rig it has no weight to speak of. One for each contact of a machine.
    """
    model = point.model
    if model.is_single:
        return _eliminable(point, 0)
    return tuple(_eliminable(point, index) for index in range(len(model.contacts)))


def _eliminable(point: OperatingPoint, index: int) -> int | None:
    model, contact = point.model, point.model.contacts[index]
    place = kinematics(model).coordinates[index]
    if place is None or place.inertial or not contact.memory:
        return None
    found, drive = weights(point, index), slip_rates(point)[index]
    with np.errstate(all="ignore"):
        steepest = np.maximum(np.abs(found.direct), np.abs(drive * found.by_unknown))  # with dashpots
        shares = [float(np.nanmin(np.abs(one) / steepest, initial=np.inf)) for one in found.by_memory]
    for i in np.argsort(shares)[::-1]:
        if shares[i] >= LEAST_WEIGHT and can_eliminate(model, index, int(i)):
            return int(i)
    return None


@question
def natural_scales(point: OperatingPoint, reduction: Reduction) -> tuple[Mapping[str, Any], tuple[Any, ...]]:
    """The size of each state variable that matters: one e-fold of velocity's worth, or a slip distance.

    By name; and the sizes of what is left to solve for, `Reduction.searched`, which has no name there; one at least.
    """
    speeds = [np.asarray(speed, dtype=float) for speed in slip_rates(point)]
    with np.errstate(all="ignore"):
        each = [
            sizes(weights(point, i), speed, reduction, np.where, i) for i, speed in enumerate(speeds)
        ]  # fmt: skip
        if point.model.contacts[0].name:
            return _together(point, reduction, speeds, each)
        scales, unknown = each[0]
        return scales, (unknown,)


@question
def _few(model: Model) -> ArrayFunction:
    """Slip rate and weights at the only contact."""
    return model.function([model.steady[model.contact.velocity], *weighed(model)])


def scale_rows(point: OperatingPoint, reduction: Reduction) -> tuple[np.ndarray, np.ndarray]:
    """`natural_scales` as arrays: (rigs, `Reduction.names`), and (rigs,) of the first unknown."""
    names = reduction.names
    if point.size <= FEW and not point.model.contacts[0].name:
        try:
            each = [
                sizes(Weights.of(own), drive, reduction, _either)
                for drive, *own in point.rows(_few(point.model)).tolist()
            ]
            return np.array([[own[name] for name in names] for own, _ in each]), np.array([one for _, one in each])
        except ArithmeticError:  # something is not felt at all
            pass
    scales, (unknown, *_) = natural_scales(point, reduction)
    size = max(point.size, 1)
    table = np.stack([np.broadcast_to(scales[name], size) for name in names], axis=1)
    return table, np.array(np.broadcast_to(unknown, size))


def _either(condition: Any, value: Any, other: Any) -> Any:
    return value if condition else other


def moving_parts(model: Model) -> list[sp.Expr]:
    """Speed of every coordinate in steady sliding, its share in the slip of every contact, stiffness; areas."""
    wanted = [one.speed for one in model.coordinates]
    for contact in model.contacts:
        slip = sp.sympify(model.definitions.get(contact.velocity, contact.velocity))
        wanted += [derivative(slip, one.velocity) for one in model.coordinates]
    balances = [model.inlined(sp.Integer(0) if one.balance is None else one.balance) for one in model.coordinates]
    wanted += [derivative(e, one.displacement) for e, one in zip(balances, model.coordinates, strict=True)]
    return [model.at_steady(e) for e in (*wanted, *(contact.area for contact in model.contacts))]


@question
def _moving_function(model: Model) -> ArrayFunction:
    return model.function(moving_parts(model))


def _together(
    point: OperatingPoint, reduction: Reduction, speeds: list[Any], each: list[tuple[dict[str, Any], Any]]
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """Scales of a machine, from those at its contacts."""
    numbers = [np.asarray(e, dtype=float) for e in point.evaluate(_moving_function(point.model))]
    directs = [np.abs(weights(point, i).direct) for i in range(len(point.model.contacts))]
    scales, searched = joined_sizes(reduction, numbers, speeds, point.sigmas, directs, each, np.where)
    return scales, searched or (np.ones(1),)


def joined_sizes(
    reduction: Reduction,
    numbers: Sequence[Any],
    speeds: Sequence[Any],
    stresses: Sequence[Any],
    directs: Sequence[Any],
    each: Sequence[tuple[dict[str, Any], Any]],
    choose: Choose,
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """`natural_scales` of a machine in plain arithmetic, of arrays or of the nodes of a program.

    A coordinate matters by what it slips at its contacts, or else by how far it moves in the shortest time that matters
    at any of them; one that stands still by how far the largest friction stretches what holds it.

    Parameters
    ----------
    numbers : sequence
        What `moving_parts` lists.
    speeds, stresses, directs, each : sequence
        Of every contact: slip rate and normal stress in steady sliding, size of the direct effect, its own `sizes`.
    """

    def least(values: Sequence[Any]) -> Any:
        found = values[0]
        for one in values[1:]:
            found = choose(one < found, one, found)
        return found

    model, n, count = reduction.model, len(reduction.model.coordinates), len(speeds)
    own, rest = numbers[:n], numbers[n:]
    stiff, areas = rest[n * count : n * count + n], rest[n * count + n :]
    slips = [found["x"] for found, _ in each]
    time = least([slip / speed for slip, speed in zip(slips, speeds, strict=True)])
    force = -least([-(area * direct) for area, direct in zip(areas, directs, strict=True)])
    scales: dict[str, Any] = {}
    for k, one in enumerate(model.coordinates):
        x: Any = np.inf
        for i in range(count):
            share = abs(rest[n * i + k])
            way = choose(share > 0, slips[i] / choose(share > 0, share, 1.0), np.inf)
            x = choose(way < x, way, x)
        x = choose(x < np.inf, x, abs(own[k]) * time)
        held = force / abs(stiff[k])
        x = choose(x > 0, x, choose((held > 0) & (held < np.inf), held, least(slips)))
        scales[f"{one.name}.x"] = x
        scales[f"{one.name}.v"] = choose(abs(own[k]) > 0, abs(own[k]), x / time)
    for contact, stress, direct in zip(model.contacts, stresses, directs, strict=True):
        # a pressure matters where friction feels it
        scales |= {item.name: choose(direct > 0, direct, abs(stress)) for item in contact.own_states}
    for (found, _), contact in zip(each, model.contacts, strict=True):
        scales |= {item.name: found[item.name] for item in contact.memory} | {f"{contact.name}.w": found["w"]}
    for item, rate in zip(model.variables, model.rates, strict=True):
        if item.kind == "integral":
            sensed = [scales[f"{one.name}.x"] for one in model.coordinates if rate.has(one.displacement)]
            scales[item.name] = time * least(sensed)

    def searched(symbol: sp.Symbol) -> Any:
        """The size of an unknown: of a velocity variable, a friction or an acceleration."""
        for i, (one, (found, _)) in enumerate(zip(reduction.slidings, each, strict=True)):
            if one.variable is not None and symbol is one.variable.w:
                return found["w"]
            if symbol is model.contacts[i].friction:
                return directs[i]
        return least([unknown for _, unknown in each])

    return scales, tuple(searched(symbol) for symbol in reduction.searched)


def shortest_time(scales: Mapping[str, Any], choose: Choose = np.where) -> Any:
    """The shortest time that matters in a machine, s."""
    own = [name.removesuffix(".x") for name in scales if name.endswith(".x")]
    found: Any = np.inf
    for name in own:
        time = scales[f"{name}.x"] / scales[f"{name}.v"]
        found = choose(time < found, time, found)
    return found


def sizes(
    found: Weights, drive: Any, reduction: Reduction, choose: Choose, index: int = 0
) -> tuple[dict[str, Any], Any]:
    """`natural_scales` at one contact in plain arithmetic, of arrays or of the nodes of a program.

    An acceleration matters where its force is worth an e-fold of velocity: of a light block smaller ones are lost in
    the rounding of the forces.

    Parameters
    ----------
    choose : callable
        ``choose(condition, value, other)``: `numpy.where` for arrays.
    index : int, optional
        The contact.
    """
    direct, by_slip = abs(found.direct), abs(found.by_slip)
    x: Any = np.inf
    for distance in (*(drive / abs(n) for n in found.decay), direct / by_slip):
        x = choose((distance > 0) & (distance < x), distance, x)
    x = choose(x < np.inf, x, abs(drive))
    variable, contact = reduction.slidings[index].variable, reduction.model.contacts[index]
    linear = variable is not None and variable.kind == "linear"
    scales: dict[str, Any] = {"x": x, "w": drive if linear else 1.0}
    for item, weight, value in zip(contact.memory, found.by_memory, found.memory, strict=True):
        own, scale = abs(value), direct / abs(weight)
        scale = choose((scale > 0) & (scale < np.inf), scale, choose(own > 0, own, 1.0))
        most = choose(own > 1e-3 * scale, own, 1e-3 * scale)
        scales[item.name] = choose((own > 0) & (most < scale), most, scale)
    scales |= {item.name: choose(direct > 0, direct, by_slip * x) for item in contact.own_states}
    scales |= {item.name: x * x / drive for item in reduction.model.integrals}
    if reduction.model.is_single and reduction.restarts:
        return scales, scales["w"]
    force = choose(direct > by_slip * x, direct, by_slip * x) / found.by_unknown
    return scales, choose(force > drive * drive / x, force, drive * drive / x)
