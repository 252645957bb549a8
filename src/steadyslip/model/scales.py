"""Natural scales of state variables and unknowns at an operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.expressions import FEW, ArrayFunction, Choose, derivative
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import SPEED, Reduction
from steadyslip.model.variables import Variable
from steadyslip.model.weights import Weights, slip_rates, weight_expressions, weights

_LEAST_DIRECT_SHARE = 1e-7  # lower bound of the direct effect in scales, relative to normal stress; chosen by trial


@cached
def natural_scales(point: OperatingPoint, reduction: Reduction) -> tuple[Mapping[str, Any], tuple[Any, ...]]:
    """Typical size of each state variable, by name, and of each unknown of `Reduction.searched` (or one value if there
    is none).

    Sizes are in SI units, arrays of the point's shape: the change for one e-fold of velocity, or a natural slip
    distance.
    """
    speeds = [np.asarray(speed, dtype=float) for speed in slip_rates(point)]
    with np.errstate(all="ignore"):
        each = [
            contact_scales(weights(point, i), speed, reduction, np.where, i) for i, speed in enumerate(speeds)
        ]  # fmt: skip
        if point.model.contacts[0].name:
            return _machine_scales_of(point, reduction, speeds, each)
        scales, unknown = each[0]
        return scales, (unknown,)


def memory_scales(point: OperatingPoint) -> dict[str, float]:
    """Change of each memory variable of a slider for one e-fold of velocity, by name.

    1 if friction does not depend on it.

    Unlike `natural_scales`, the result does not depend on the steady value of the variable.
    """
    found = weights(point, 0)
    direct = direct_effect_scale(found, np.where)
    with np.errstate(all="ignore"):
        sizes = [float(np.max(direct / np.abs(weight))) for weight in found.by_memory]
    memory = point.model.contacts[0].memory
    return {one.name: x if 0 < x < np.inf else 1.0 for one, x in zip(memory, sizes, strict=True)}


@cached
def _single_function(model: Model) -> ArrayFunction:
    """Array function of a slider's slip rate and weights."""
    return model.function([model.steady[model.contact.velocity], *weight_expressions(model)])


def scale_rows(point: OperatingPoint, reduction: Reduction) -> tuple[np.ndarray, np.ndarray]:
    """Natural scales of state variables, shape (rigs, len(`Reduction.names`)), and of the first unknown, (rigs,)."""
    names = reduction.names
    if point.size <= FEW and not point.model.contacts[0].name:
        try:
            each = [
                contact_scales(Weights.of(own), drive, reduction, _choose)
                for drive, *own in point.rows(_single_function(point.model)).tolist()
            ]
            return np.array([[own[name] for name in names] for own, _ in each]), np.array([one for _, one in each])
        except ArithmeticError:  # division by a weight of zero
            pass
    scales, (unknown, *_) = natural_scales(point, reduction)
    size = max(point.size, 1)
    table = np.stack([np.broadcast_to(scales[name], size) for name in names], axis=1)
    return table, np.array(np.broadcast_to(unknown, size))


def _choose(condition: Any, value: Any, other: Any) -> Any:
    return value if condition else other


def scale_expressions(model: Model) -> list[sp.Expr]:
    """Expressions that determine the scales of a machine, in the order used by `machine_scales`.

    Steady speeds of coordinates; slip of each contact per displacement of each coordinate; stiffnesses; contact areas.
    """
    wanted = [one.speed for one in model.coordinates]
    for contact in model.contacts:
        slip = sp.sympify(model.definitions.get(contact.velocity, contact.velocity))
        wanted += [derivative(slip, one.velocity) for one in model.coordinates]
    balances = [model.inlined(sp.Integer(0) if one.balance is None else one.balance) for one in model.coordinates]
    wanted += [derivative(e, one.displacement) for e, one in zip(balances, model.coordinates, strict=True)]
    return [model.at_steady(e) for e in (*wanted, *(contact.area for contact in model.contacts))]


@cached
def _moving_function(model: Model) -> ArrayFunction:
    return model.function(scale_expressions(model))


def _machine_scales_of(
    point: OperatingPoint, reduction: Reduction, speeds: list[Any], each: list[tuple[dict[str, Any], Any]]
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """Natural scales of a machine from the scales `each` at its contacts."""
    numbers = [np.asarray(e, dtype=float) for e in point.evaluate(_moving_function(point.model))]
    directs = [direct_effect_scale(weights(point, i), np.where) for i in range(len(point.model.contacts))]
    scales, searched = machine_scales(reduction, numbers, speeds, point.sigmas, directs, each, np.where)
    return scales, searched or (np.ones(1),)


def machine_scales(
    reduction: Reduction,
    numbers: Sequence[Any],
    speeds: Sequence[Any],
    stresses: Sequence[Any],
    directs: Sequence[Any],
    each: Sequence[tuple[dict[str, Any], Any]],
    choose: Choose,
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """Natural scales of a machine in plain arithmetic, for arrays or nodes of a generated program.

    The scale of a displacement is the least displacement that makes a natural slip distance at a contact; for a
    coordinate without contact, the motion within the shortest natural time; for one at rest, the stretch of its springs
    by the largest friction force.

    Parameters
    ----------
    numbers : sequence
        Values of `scale_expressions`.
    speeds, stresses, directs, each : sequence
        For every contact: steady slip rate and normal stress, direct effect, results of `contact_scales`.
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
            displacement = choose(share > 0, slips[i] / choose(share > 0, share, 1.0), np.inf)
            x = choose(displacement < x, displacement, x)
        x = choose(x < np.inf, x, abs(own[k]) * time)
        held = force / abs(stiff[k])
        x = choose(x > 0, x, choose((held > 0) & (held < np.inf), held, least(slips)))
        scales[f"{one.name}.x"] = x
        scales[f"{one.name}.v"] = choose(abs(own[k]) > 0, abs(own[k]), x / time)
    for contact, stress, direct in zip(model.contacts, stresses, directs, strict=True):
        # states of contact laws are pressures: friction changes by about as much as they do
        scales |= {item.name: choose(direct > 0, direct, abs(stress)) for item in contact.own_states}
    for (found, _), contact in zip(each, model.contacts, strict=True):
        scales |= {item.name: found[item.name] for item in contact.memory} | {f"{contact.name}.{SPEED}": found[SPEED]}
    scales |= {item.name: force for item in model.variables if item.kind == "held"}
    largest = force
    for area, stress in zip(areas, stresses, strict=True):
        largest = choose(force > 0, largest, largest + area * abs(stress))
    scales |= {item.name: least([abs(one) for one in speeds]) if _is_speed(item) else largest for item in model.past}
    for item, rate in zip(model.variables, model.rates, strict=True):
        if item.kind == "integral":
            sensed = [scales[f"{one.name}.x"] for one in model.coordinates if rate.has(one.displacement)]
            scales[item.name] = time * least(sensed)

    def searched(symbol: sp.Symbol) -> Any:
        """Scale of an unknown: velocity variable, friction stress or acceleration."""
        for i, (one, (found, _)) in enumerate(zip(reduction.slidings, each, strict=True)):
            if one.variable is not None and symbol is one.variable.w:
                return found[SPEED]
            if symbol is model.contacts[i].friction:
                return directs[i]
        return least([unknown for _, unknown in each])

    return scales, tuple(searched(symbol) for symbol in reduction.searched)


def shortest_time(scales: Mapping[str, Any], choose: Choose = np.where) -> Any:
    """Smallest ratio (s) of displacement scale to velocity scale of a machine."""
    own = [name.removesuffix(".x") for name in scales if name.endswith(".x")]
    found: Any = np.inf
    for name in own:
        time = scales[f"{name}.x"] / scales[f"{name}.v"]
        found = choose(time < found, time, found)
    return found


def direct_effect_scale(found: Weights, choose: Choose) -> Any:
    """Direct effect (Pa) used for scaling, at least a share of the normal stress; 0 if there is no direct effect."""
    direct, least = abs(found.direct), _LEAST_DIRECT_SHARE * abs(found.stress)
    return choose(direct > 0, choose(direct > least, direct, least), 0.0)


def _is_speed(past: Variable) -> bool:
    """True for a variable of a delayed slip rate, False for a variable of a delayed force."""
    return past.unit == "m/s"


def contact_scales(
    found: Weights, drive: Any, reduction: Reduction, choose: Choose, index: int = 0
) -> tuple[dict[str, Any], Any]:
    """Natural scales of the variables of one contact, and of its unknown, in plain arithmetic.

    For arrays or nodes of a generated program. An acceleration of this scale has an inertial force of at least the
    effect of one e-fold of velocity: smaller accelerations of a light block are lost in the rounding of forces.

    Parameters
    ----------
    choose : callable
        Function ``choose(condition, value, other)``: `numpy.where` for arrays.
    index : int, optional
        Index of the contact.
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
        most = choose(own > 1e-3 * scale, own, 1e-3 * scale)  # steady value, at least 1e-3 of the scale; by trial
        scales[item.name] = choose((own > 0) & (most < scale), most, scale)
    scales |= {item.name: choose(direct > 0, direct, by_slip * x) for item in contact.own_states}
    scales |= {item.name: x * x / drive for item in reduction.model.integrals}
    scales |= {
        item.name: choose(direct > 0, direct, by_slip * x) for item in reduction.model.variables if item.kind == "held"
    }
    past = reduction.model.past if reduction.model.is_single else ()
    scales |= {item.name: abs(drive) if _is_speed(item) else choose(direct > 0, direct, by_slip * x) for item in past}
    if reduction.model.is_single and reduction.restarts:
        return scales, scales[SPEED]
    force = choose(direct > by_slip * x, direct, by_slip * x) / found.by_unknown
    return scales, choose(force > drive * drive / x, force, drive * drive / x)
