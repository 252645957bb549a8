"""The sizes that matter at an operating point: scales of variables and of what is solved for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.expressions import FEW, ArrayFunction, Choose, derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import SPEED, Reduction
from steadyslip.model.weights import Weights, slip_rates, weighed, weights

_FELT = 1e-7  # least share of the normal stress of a direct effect that sets sizes


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
    directs = [direct_effect_scale(weights(point, i), np.where) for i in range(len(point.model.contacts))]
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
        scales |= {item.name: found[item.name] for item in contact.memory} | {f"{contact.name}.{SPEED}": found[SPEED]}
    scales |= {item.name: force for item in model.variables if item.kind == "held"}
    for item, rate in zip(model.variables, model.rates, strict=True):
        if item.kind == "integral":
            sensed = [scales[f"{one.name}.x"] for one in model.coordinates if rate.has(one.displacement)]
            scales[item.name] = time * least(sensed)

    def searched(symbol: sp.Symbol) -> Any:
        """The size of an unknown: of a velocity variable, a friction or an acceleration."""
        for i, (one, (found, _)) in enumerate(zip(reduction.slidings, each, strict=True)):
            if one.variable is not None and symbol is one.variable.w:
                return found[SPEED]
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


def direct_effect_scale(found: Weights, choose: Choose) -> Any:
    """The size of the direct effect as far as it sets scales, Pa; zero where there is none."""
    direct, least = abs(found.direct), _FELT * abs(found.stress)
    return choose(direct > 0, choose(direct > least, direct, least), 0.0)


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
    direct, by_slip = direct_effect_scale(found, choose), abs(found.by_slip)
    x: Any = np.inf
    for distance in (*(drive / abs(n) for n in found.decay), direct / by_slip):
        x = choose((distance > 0) & (distance < x), distance, x)
    x = choose(x < np.inf, x, abs(drive))
    variable, contact = reduction.slidings[index].variable, reduction.model.contacts[index]
    linear = variable is not None and variable.kind == "linear"
    scales: dict[str, Any] = {"x": x, SPEED: drive if linear else 1.0}
    for item, weight, value in zip(contact.memory, found.by_memory, found.memory, strict=True):
        own, scale = abs(value), direct / abs(weight)
        scale = choose((scale > 0) & (scale < np.inf), scale, choose(own > 0, own, 1.0))
        most = choose(own > 1e-3 * scale, own, 1e-3 * scale)
        scales[item.name] = choose((own > 0) & (most < scale), most, scale)
    scales |= {item.name: choose(direct > 0, direct, by_slip * x) for item in contact.own_states}
    scales |= {item.name: x * x / drive for item in reduction.model.integrals}
    scales |= {
        item.name: choose(direct > 0, direct, by_slip * x) for item in reduction.model.variables if item.kind == "held"
    }
    if reduction.model.is_single and reduction.restarts:
        return scales, scales[SPEED]
    force = choose(direct > by_slip * x, direct, by_slip * x) / found.by_unknown
    return scales, choose(force > drive * drive / x, force, drive * drive / x)
