"""How steep friction and its balance are in steady sliding, and which memory variable may be left out for that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.questions import question
from steadyslip.core.results import ReadOnly
from steadyslip.model.equations import Model
from steadyslip.model.kinematics import kinematics
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import can_eliminate

LEAST_WEIGHT = 1e-5  # in that of ln v, below which a memory variable is not eliminated: its inverse amplifies rounding


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
    stress : ndarray
        The normal stress itself, Pa.
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
        """From the values of what `weighed` lists."""
        direct, by_slip, by_unknown, stress, *rest = values
        count = len(rest) // 3
        by_memory, decay, memory = (tuple(rest[i : i + count]) for i in (0, count, 2 * count))
        return cls(direct, by_slip, by_memory, decay, memory, by_unknown, stress)


def weighed(model: Model, index: int = 0) -> list[sp.Expr]:
    """What `Weights` holds: direct, by slip, by unknown, stress, then of each memory its weight, its decay, itself."""
    contact = model.contacts[index]
    v, memory = contact.velocity, [item.symbol for item in contact.memory]
    wanted = [v * derivative(contact.balance, v), *_held(model, index), contact.sigma_ss]
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
    found = _weights_function(point.model, index)(*arrays_of(point))
    return Weights.of([np.asarray(x, dtype=float) for x in found])


def arrays_of(point: OperatingPoint) -> list[np.ndarray]:
    """Parameters and normal stresses of a point, as arrays."""
    return [*map(np.asarray, point.arguments), *map(np.atleast_1d, point.steady)]


@question
def slip_rates(point: OperatingPoint) -> tuple[Any, ...]:
    """Velocity of every contact in steady sliding, m/s."""
    model = point.model
    return tuple(point.evaluate(_slip_rates(model)))


@question
def _slip_rates(model: Model) -> ArrayFunction:
    return model.function(model.steady[contact.velocity] for contact in model.contacts)


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
