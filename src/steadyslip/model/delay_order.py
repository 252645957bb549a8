"""Number of variables that represent each delayed signal in a rig's motion, from its fastest vibration."""

from __future__ import annotations

from math import lgamma

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.model.dead_time import ORDERS
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint

HARMONICS = 4.0
"""Delayed signals are accurate up to this multiple of the rig's highest frequency, as velocity changes faster in a slip
event than in a vibration. Each motion is checked with `finer_order`."""
LATE_ACCURACY = 1e-6
"""Error allowed in a delayed signal at `HARMONICS` times the highest frequency, relative to the signal."""
_LEAST_WITHOUT_MASS = 1
"""Least index in `ORDERS` for rigs without mass, in which nothing limits how fast velocity changes in a slip event."""


def order_for(point: OperatingPoint) -> int:
    """Order of the Padé approximation of delayed signals, high enough for every rig in the arrays of `point`."""
    with np.errstate(all="ignore"):
        found = [np.asarray(one, dtype=float) for one in point.evaluate(_frequencies(point.model))]
    squares, delays = found[: -len(point.model.delays)], found[-len(point.model.delays) :]
    fastest, longest = (max((float(np.nanmax(one)) for one in part), default=0.0) for part in (squares, delays))
    turn = HARMONICS * np.sqrt(fastest) * longest
    least = 0 if point.model.inertial else _LEAST_WITHOUT_MASS
    fit = [i for i, order in enumerate(ORDERS) if pade_error(order, turn) <= LATE_ACCURACY]
    return ORDERS[max(min([*fit, len(ORDERS) - 2]), least)]


def finer_order(order: int) -> int:
    """The next larger number of variables of a late signal; a motion computed with it checks the number before."""
    return ORDERS[ORDERS.index(order) + 1]


def pade_error(order: int, turn: float) -> float:
    """Leading term of |exp(−i turn) − R|, with R the Padé approximant [n−1/n] of the exponential.

    n! (n−1)! turn^2n / ((2n−1)! (2n)!)
    """
    if turn == 0:
        return 0.0
    factorials = lgamma(order + 1) + lgamma(order) - lgamma(2 * order) - lgamma(2 * order + 1)
    return float(np.exp(min(factorials + 2 * order * np.log(turn), 700.0)))


@cached
def _frequencies(model: Model) -> ArrayFunction:
    """Array function of upper bounds of the squared angular frequencies of bodies (rad/s)², followed by the delays (s).

    The bound is Gershgorin's: the sum of all stiffnesses in the balance of a body, delayed or not, over its inertia.
    """
    places = [one.displacement for one in model.coordinates]
    places += [late for late, (base, _) in model.late.items() if base in places]
    found: list[sp.Expr] = []
    for one in model.coordinates:
        balance = model.inlined(model.contacts[0].balance if one.balance is None else one.balance)
        inertia = derivative(balance, one.acceleration)
        if inertia != 0:
            stiff = sp.Add(*(sp.Abs(model.at_steady(derivative(balance, place))) for place in places))
            found.append(stiff / sp.Abs(model.at_steady(inertia)))
    return model.function([*found, *model.delays])
