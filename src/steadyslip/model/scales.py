"""The sizes that matter at an operating point, and what they decide: scales of variables, what to eliminate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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

LEAST_WEIGHT = 1e-5  # db/da below which a memory variable is not eliminated: rounding is amplified by its inverse


@dataclass(frozen=True)
class Weights(ReadOnly):
    """Derivatives in steady sliding.

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

    direct: np.ndarray
    by_slip: np.ndarray
    by_memory: tuple[np.ndarray, ...]
    decay: tuple[np.ndarray, ...]
    memory: tuple[np.ndarray, ...]
    by_unknown: np.ndarray


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
    direct, by_slip, by_unknown, *rest = (np.asarray(x, dtype=float) for x in found)
    count = len(point.model.memory)
    by_memory, decay, memory = (tuple(rest[i : i + count]) for i in (0, count, 2 * count))
    return Weights(direct, by_slip, by_memory, decay, memory, by_unknown)


@question
def posed(point: OperatingPoint) -> np.ndarray:
    """Whether the balance of forces rises with its unknown (velocity, or acceleration) in steady sliding.

    If not, the least lag or mass that was left out decides the motion.
    """
    return np.atleast_1d(weights(point).by_unknown > 0)


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
        shares = [float(np.nanmin(np.abs(one / found.direct), initial=np.inf)) for one in found.by_memory]
    for i in np.argsort(shares)[::-1]:
        if shares[i] >= LEAST_WEIGHT and reduce_model(model, int(i)).form == "eliminated":
            return int(i)
    return None


@question
def natural_scales(point: OperatingPoint, reduction: Reduction) -> tuple[Mapping[str, Any], Any]:
    """The size of each state variable that matters: one e-fold of velocity's worth, or a slip distance.

    By name; and the size of the unknown that is left to solve for, which has no name among them.
    """
    found = weights(point)
    drive = np.asarray(point.drive, dtype=float)
    with np.errstate(all="ignore"):
        direct = np.abs(found.direct)
        distances = [drive / np.abs(n) for n in found.decay]
        distances.append(direct / np.abs(found.by_slip))
        finite = [np.where(np.isfinite(d) & (d > 0), d, np.inf) for d in distances]
        x = np.minimum.reduce(np.broadcast_arrays(*finite))
        x = np.where(np.isfinite(x), x, np.abs(drive))
    scales: dict[str, Any] = {"x": x, "w": drive if reduction.velocity == "linear" else 1.0}
    for item, weight, value in zip(point.model.memory, found.by_memory, found.memory, strict=True):
        with np.errstate(all="ignore"):
            scale = direct / np.abs(weight)
        own = np.abs(value)
        scale = np.where(np.isfinite(scale) & (scale > 0), scale, np.where(own > 0, own, 1.0))
        scales[item.name] = np.minimum(scale, np.where(own > 0, np.maximum(own, scale * 1e-3), scale))
    with np.errstate(all="ignore"):
        scales |= {item.name: x * x / drive for item in point.model.integrals}
        return scales, drive**2 / x if point.model.inertial else scales["w"]
