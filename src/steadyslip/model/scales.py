"""The sizes that matter at an operating point, and what they decide: scales of variables, what to eliminate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.expressions import derivative
from steadyslip.core.questions import question
from steadyslip.core.results import ReadOnly
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import Reduction, reduce_model

Choose = Callable[[Any, Any, Any], Any]
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


def weighed(model: Model) -> list[sp.Expr]:
    """What `Weights` holds: direct, by slip, by unknown, then of each memory its weight, its decay, itself."""
    contact = model.contact
    v, memory = contact.velocity, [item.symbol for item in model.memory]
    inlined = model.inlined(contact.balance)
    wanted = [
        v * derivative(contact.balance, v),
        derivative(inlined, contact.slip),
        derivative(inlined, contact.unknown),
    ]
    wanted += [derivative(contact.balance, m) for m in memory]
    wanted += [derivative(model.rate_of[m], m) for m in memory]
    return [e.doit().xreplace(model.steady) for e in (*wanted, *memory)]


@question
def _weights_function(model: Model) -> Callable[..., list[Any]]:
    return model.function(weighed(model))


@question
def weights(point: OperatingPoint) -> Weights:
    """Derivatives in steady sliding of all rigs of a point."""
    found = _weights_function(point.model)(*map(np.asarray, point.arguments), point.stresses)
    return Weights.of([np.asarray(x, dtype=float) for x in found])


@question
def posed(point: OperatingPoint) -> np.ndarray:
    """Whether the balance of forces rises with its unknown (velocity, or acceleration) in steady sliding.

    If not, the least lag or mass that was left out decides the motion.
    """
    return np.atleast_1d(weights(point).by_unknown > 0)


@question
def _force_function(model: Model) -> Callable[..., list[Any]]:
    """Forces that keep each other in balance in steady sliding.

    The force of a dashpot per change of ln v; what pull and friction do to the normal stress; then what adds up to
    nothing: pull and friction, and the shares of normal stress and memory in it.
    """
    contact = model.contact
    inner = [contact.normal, *(item.symbol for item in model.memory)]
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
    found = weights(point)
    dashpot, pull, friction, *forces = point.evaluate(_force_function(point.model))
    with np.errstate(all="ignore"):
        held = np.abs(np.asarray(point.drive, dtype=float) * found.by_unknown)
        if point.model.inertial:
            rates = [found.by_slip * point.drive / found.direct, *found.decay]
            held = np.abs(found.direct) + held * np.maximum.reduce(np.broadcast_arrays(*map(np.abs, rates)))
        largest = np.maximum.reduce(np.broadcast_arrays(*map(np.abs, forces)))
        least = MOST_NOISE / np.finfo(float).eps
        hidden = (largest > least * held) | (np.abs(dashpot) > least * largest)
        hidden |= np.maximum(np.abs(pull), np.abs(friction)) > least * point.stresses
        return np.asarray(~hidden | ~posed(point))


@question
def eliminable(point: OperatingPoint) -> int | None:
    """The memory variable to leave out: of those that allow it, the one with most weight in friction.

    None where there is none, or where in some rig it has no weight to speak of.
    """
    model = point.model
    if model.inertial or not model.memory:
        return None
    found = weights(point)
    with np.errstate(all="ignore"):
        steepest = np.maximum(np.abs(found.direct), np.abs(point.drive * found.by_unknown))  # with dashpots
        shares = [float(np.nanmin(np.abs(one) / steepest, initial=np.inf)) for one in found.by_memory]
    for i in np.argsort(shares)[::-1]:
        if shares[i] >= LEAST_WEIGHT and reduce_model(model, int(i)).form == "eliminated":
            return int(i)
    return None


@question
def natural_scales(point: OperatingPoint, reduction: Reduction) -> tuple[Mapping[str, Any], Any]:
    """The size of each state variable that matters: one e-fold of velocity's worth, or a slip distance.

    By name; and the size of the unknown that is left to solve for, which has no name among them.
    """
    with np.errstate(all="ignore"):
        return sizes(weights(point), np.asarray(point.drive, dtype=float), reduction, np.where)


def sizes(found: Weights, drive: Any, reduction: Reduction, choose: Choose) -> tuple[dict[str, Any], Any]:
    """`natural_scales` in plain arithmetic, of arrays or of the nodes of a program.

    An acceleration matters where its force is worth an e-fold of velocity: of a light block smaller ones are lost in
    the rounding of the forces.

    Parameters
    ----------
    choose : callable
        ``choose(condition, value, other)``: `numpy.where` for arrays.
    """
    direct, by_slip = abs(found.direct), abs(found.by_slip)
    x: Any = np.inf
    for distance in (*(drive / abs(n) for n in found.decay), direct / by_slip):
        x = choose((distance > 0) & (distance < x), distance, x)
    x = choose(x < np.inf, x, abs(drive))
    scales: dict[str, Any] = {"x": x, "w": drive if reduction.velocity == "linear" else 1.0}
    for item, weight, value in zip(reduction.model.memory, found.by_memory, found.memory, strict=True):
        own, scale = abs(value), direct / abs(weight)
        scale = choose((scale > 0) & (scale < np.inf), scale, choose(own > 0, own, 1.0))
        most = choose(own > 1e-3 * scale, own, 1e-3 * scale)
        scales[item.name] = choose((own > 0) & (most < scale), most, scale)
    scales |= {item.name: x * x / drive for item in reduction.model.integrals}
    if not reduction.model.inertial:
        return scales, scales["w"]
    force = choose(direct > by_slip * x, direct, by_slip * x) / found.by_unknown
    return scales, choose(force > drive * drive / x, force, drive * drive / x)
