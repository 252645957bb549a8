"""Folds of the force balance: states beyond which a massless block has no continuous motion.

The velocity of a massless block solves the balance of forces. Where friction falls with velocity, two solutions may
merge and vanish as the state changes; beyond, velocity would have to jump to a solution far away.
"""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.nonlinear.kicks.field import field_of
from steadyslip.nonlinear.kicks.rest import Rest

REACH = 60.0  # range of ln(velocity/drive), to both sides of 0, in which a fold is searched for
COUNT = 2401  # number of velocities in the first scan of that range
BISECTIONS = 60  # number of bisections that reduce 2 REACH/COUNT to rounding
NEAR = 1e-7  # largest residual force at a fold, as a share of the normal stress
CLOSE = 1e-3  # largest difference of ln(velocity/drive) between the state and a fold


def at_fold(rest: Rest, states: Array, unknowns: Array | None = None) -> Array:
    """True (m,) for states (m, n), one for each rig, at which two velocities that balance the forces merge.

    `unknowns` (m, 1) are the velocity variables at the states, NaN where unknown: near a fold forces may also balance
    at another velocity.
    """
    if not rest.reduction.unknowns or rest.reduction.model.inertial or not rest.reduction.model.is_single:
        return np.zeros(len(states), dtype=bool)
    turns = np.linspace(-REACH, REACH, COUNT)
    with np.errstate(all="ignore"):
        slope = _balance(rest, states, np.broadcast_to(turns, (len(states), COUNT)))[1]
        which, at = np.nonzero(slope[:, 1:] * slope[:, :-1] <= 0)
        low, high, rising = turns[at], turns[at + 1], slope[which, at] < 0
        part, where = rest.part(which), states[which]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            falls = _balance(part, where, middle[:, None])[1][:, 0] < 0
            low, high = np.where(falls == rising, middle, low), np.where(falls == rising, high, middle)
        missing = np.abs(_balance(part, where, low[:, None])[0][:, 0])
        own = np.full(len(states), np.nan) if unknowns is None else unknowns[:, 0]
        own = np.arcsinh(own / rest.velocity) if rest.reduction.velocity == "linear" else own
    found = np.zeros(len(states), dtype=bool)
    found[which[(missing < NEAR * part.sigmas[0]) & ~(np.abs(own[which] - low) > CLOSE)]] = True
    return found


def _balance(rest: Rest, states: Array, turns: Array) -> tuple[Array, Array]:
    """Residual force (m, k) and its derivative at `turns` (m, k), which are asinh or ln of velocity over drive."""
    given = [rest.column(np.asarray(number)) for number in rest.arguments()]
    unknown = turns
    if rest.reduction.velocity == "linear":
        unknown = rest.velocity[:, None] * np.sinh(turns)
    *_, missing, slope = field_of(rest.reduction)(*given, *states.T[:, :, None], unknown)
    return np.broadcast_to(missing, turns.shape), np.broadcast_to(slope, turns.shape)
