"""Derivatives of friction and its balance in steady sliding, and the choice of the eliminated memory variable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.results import ReadOnly
from steadyslip.model.equations import Model
from steadyslip.model.kinematics import kinematics
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import can_eliminate

LEAST_WEIGHT = 1e-5  # least effect of an eliminated memory variable on friction, relative to the effect of ln v;
# elimination amplifies rounding by the inverse, here 1e5; chosen by trial


@dataclass(frozen=True)
class Weights(ReadOnly):
    """Derivatives at a contact in steady sliding, as arrays or nodes of a generated program.

    Attributes
    ----------
    direct : ndarray
        Derivative of friction with respect to ln v, Pa.
    by_slip : ndarray
        Derivative of the balance with respect to x, Pa/m.
    by_memory : tuple of ndarray
        Derivative of friction with respect to each memory variable.
    decay : tuple of ndarray
        Derivative of each memory variable's rate with respect to itself, 1/s.
    memory : tuple of ndarray
        Steady values of the memory variables.
    by_unknown : ndarray
        Derivative of the balance with respect to its unknown.
    stress : ndarray
        Normal stress, Pa.
    """

    direct: Any
    by_slip: Any
    by_memory: tuple[Any, ...]
    decay: tuple[Any, ...]
    memory: tuple[Any, ...]
    by_unknown: Any
    stress: Any

    @classmethod
    def of(cls, values: Sequence[Any]) -> Weights:
        """Make `Weights` from the values of `weight_expressions`."""
        direct, by_slip, by_unknown, stress, *rest = values
        count = len(rest) // 3
        by_memory, decay, memory = (tuple(rest[i : i + count]) for i in (0, count, 2 * count))
        return cls(direct, by_slip, by_memory, decay, memory, by_unknown, stress)


def weight_expressions(model: Model, index: int = 0) -> list[sp.Expr]:
    """Expressions in the order of `Weights.of`: direct, by_slip, by_unknown, stress, by_memory, decay, memory."""
    contact = model.contacts[index]
    v, memory = contact.velocity, [item.symbol for item in contact.memory]
    wanted = [v * derivative(contact.balance, v), *_balance_slopes(model, index), contact.sigma_ss]
    wanted += [derivative(contact.balance, m) for m in memory]
    wanted += [derivative(model.rate_of[m], m) for m in memory]
    return [model.at_steady(e.doit()) for e in (*wanted, *memory)]


def _balance_slopes(model: Model, index: int) -> list[sp.Expr]:
    """Derivatives of a contact's balance of forces (per area) with respect to slip and to its unknown."""
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


@cached
def _weights_function(model: Model, index: int) -> ArrayFunction:
    return model.function(weight_expressions(model, index))


@cached
def weights(point: OperatingPoint, index: int = 0) -> Weights:
    """Derivatives in steady sliding at contact `index`, for all rigs of a point."""
    found = _weights_function(point.model, index)(*arrays_of(point))
    return Weights.of([np.asarray(x, dtype=float) for x in found])


def arrays_of(point: OperatingPoint) -> list[np.ndarray]:
    """Parameters and steady values of a point, as arrays."""
    return [*map(np.asarray, point.arguments), *map(np.atleast_1d, point.steady)]


@cached
def slip_rates(point: OperatingPoint) -> tuple[Any, ...]:
    """Slip rate of every contact in steady sliding (m/s)."""
    model = point.model
    return tuple(point.evaluate(_slip_rates(model)))


@cached
def _slip_rates(model: Model) -> ArrayFunction:
    return model.function(model.steady[contact.velocity] for contact in model.contacts)


@cached
def eliminable(point: OperatingPoint) -> int | tuple[int | None, ...] | None:
    """Index of the memory variable to be eliminated: of those that can be, the variable with the largest effect on
    friction.

    None if no variable can be eliminated, or if its effect is too small in some rig. For a machine, a tuple with one
    index or None for each contact.
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
