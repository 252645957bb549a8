"""Bounded least squares for a few parameters, with confidence intervals from the profile of the sum of squares.

The model of a friction curve is far from linear in some parameters, so that intervals from standard errors would be too
short. The profile of a parameter is the least sum of squares at each of its values. A confidence interval contains the
values at which the profile exceeds its minimum by no more than chance explains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array

Residuals = Callable[[Array], tuple[Array, Array]]
"""Function of the parameters (p,) that returns residuals (n,) and their Jacobian (n, p)."""

TOLERANCE = 1e-10  # relative tolerance of the sum of squares and of the step, far below noise
MOST_EVALUATIONS = 200  # largest number of evaluations in one search; dozens suffice
FIRST_DAMPING, EASED, MOST_DAMPING = 1e-4, 10.0, 1e10
"""Damping of Levenberg's method relative to the squared slopes: initial value, factor by which it changes after each
step, largest value."""
MOST_STEPS, FURTHER = 40, 1.5  # most steps outwards to an end of an interval, and ratio of successive steps
CLOSE = 0.01  # at an end, searches from all starts may find a rise that is lower by this relative amount
PRECISION = 1e-3  # tolerance for the ends of intervals, as a share of their width: three digits are enough
BETTER = 1e-6  # a point whose sum of squares is smaller by more than this relative amount is near another minimum
EXACT = 1e-20  # a smaller mean square residual is rounding, not noise


@dataclass(frozen=True)
class ProfiledMinimum:
    """Minimum of a sum of squares within bounds.

    Attributes
    ----------
    residuals : callable
        See `Residuals`.
    at : ndarray (p,)
        Parameters at the minimum.
    ssq : float
        Sum of squares at the minimum.
    low, high : ndarray (p,)
        Bounds of the parameters.
    starts : list of ndarray (p,)
        Starting points for searches of other minima.
    """

    residuals: Residuals
    at: Array
    ssq: float
    low: Array
    high: Array
    starts: list[Array]

    @property
    def freedom(self) -> int:
        """Degrees of freedom: number of residuals minus number of parameters."""
        return len(self.residuals(self.at)[0]) - len(self.at)

    @property
    def variance(self) -> float:
        """Variance of the noise, estimated from the residuals."""
        return self.ssq / self.freedom

    def covariance(self) -> Array:
        """Covariance (p, p) of the parameters for residuals linearised at the minimum; inf if it is singular."""
        jacobian = self.residuals(self.at)[1]
        size = np.linalg.norm(jacobian, axis=0)
        if not np.all(size > 0):
            return np.full((len(self.at),) * 2, np.inf)
        scaled = jacobian / size
        values, vectors = np.linalg.eigh(scaled.T @ scaled)
        if values[0] <= len(values) * np.finfo(float).eps * values[-1]:
            return np.full((len(self.at),) * 2, np.inf)
        return np.asarray((vectors / values) @ vectors.T * self.variance / np.outer(size, size))


def least(residuals: Residuals, starts: list[Array], low: Array, high: Array) -> ProfiledMinimum:
    """Minimum of the sum of squares within bounds: the best of searches from several starts."""
    from scipy.optimize import least_squares

    every = np.ones(len(low), dtype=bool)
    start, _ = min((_descended(residuals, one, low, high, every) for one in starts), key=lambda one: one[1])
    found = least_squares(
        lambda at: residuals(at)[0], np.clip(start, low, high), lambda at: residuals(at)[1], bounds=(low, high),
        x_scale="jac", ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, max_nfev=MOST_EVALUATIONS,
    )  # fmt: skip
    reach = TOLERANCE * (high - low)  # SciPy stops short of bounds, such as at a viscosity of 1e-24 instead of 0
    at = np.where(found.x - low < reach, low, np.where(high - found.x < reach, high, found.x))
    own = residuals(at)[0]
    return ProfiledMinimum(residuals, at, float(own @ own), low, high, starts)


def _descended(residuals: Residuals, start: Array, low: Array, high: Array, free: Array) -> tuple[Array, float]:
    """Parameters and sum of squares after Levenberg's method in the `free` parameters; it is quick from near starts."""
    at = np.where(free, np.clip(start, low, high), start)
    own, jacobian = residuals(at)
    ssq, damping = float(own @ own), FIRST_DAMPING
    for _ in range(MOST_EVALUATIONS):
        slope = jacobian.T @ own
        moving = free & ~((at <= low) & (slope > 0)) & ~((at >= high) & (slope < 0))
        if not np.any(moving):
            break
        part = jacobian[:, moving]
        normal = part.T @ part
        size = np.diag(normal) + np.finfo(float).tiny
        step = np.zeros(len(at))
        step[moving] = np.linalg.lstsq(normal + damping * np.diag(size), -slope[moving], rcond=None)[0]
        trial = np.where(moving, np.clip(at + step, low, high), at)
        new, new_jacobian = residuals(trial)
        reached = float(new @ new)
        if reached < ssq:
            done = ssq - reached < TOLERANCE * ssq
            at, own, jacobian, ssq, damping = trial, new, new_jacobian, reached, damping / EASED
            if done:
                break
        elif damping > MOST_DAMPING:
            break
        else:
            damping *= EASED
    return at, ssq


class _Improved(Exception):
    """Raised if the search for an end of an interval finds a smaller sum of squares than that of the minimum."""

    def __init__(self, at: Array) -> None:
        super().__init__()
        self.at = at


def intervals(minimum: ProfiledMinimum, levels: tuple[float, ...]) -> tuple[ProfiledMinimum, Array]:
    """Confidence intervals of every parameter from its profile and Student's t, for noise estimated from residuals.

    Parameters
    ----------
    minimum : ProfiledMinimum
    levels : tuple of float
        Probabilities, such as 0.6827 and 0.95.

    Returns
    -------
    minimum : ProfiledMinimum
        The given minimum, or a better minimum that was found during the search.
    ends : ndarray (p, levels, 2)
        Ends of the intervals; infinite where the interval reaches a bound of the parameter.
    """
    from scipy.special import stdtrit

    for _ in range(len(minimum.at) + 1):
        limits = [float(stdtrit(minimum.freedom, 0.5 + level / 2)) for level in levels]
        try:
            ends = [_ends(minimum, i, limits) for i in range(len(minimum.at))]
            return minimum, np.array(ends)
        except _Improved as better:
            starts = [better.at, *minimum.starts]
            minimum = least(minimum.residuals, starts, minimum.low, minimum.high)
    return minimum, np.full((len(minimum.at), len(levels), 2), (-np.inf, np.inf))


def _ends(minimum: ProfiledMinimum, i: int, limits: list[float]) -> Array:
    """Ends (levels, 2) of the intervals of parameter i at rising limits of t."""
    error = float(np.sqrt(minimum.covariance()[i, i]))
    own = float(minimum.at[i])
    if minimum.variance < EXACT and np.isfinite(error):
        return np.array([[own - t * error, own + t * error] for t in limits])
    width = float(minimum.high[i] - minimum.low[i])
    step = error if 0 < error < width else 0.01 * width
    sides = []
    for side in (-1.0, 1.0):
        profile = _Profile(minimum, i)
        lengths = [abs(_end(profile, t, side * t * step) - own) for t in limits]
        sides.append(own + side * np.maximum.accumulate(lengths))  # on a steep rise, rounding may disorder the ends
    return np.array(sides).T


class _Profile:
    """Profile of one parameter as t = √(rise of the least sum of squares / variance), called the rise in this class.

    The search at a value of the parameter starts from the solutions at the nearest known values on both sides, so that
    a failed search does not mislead the next search; `check` repeats the search from all starts.
    """

    def __init__(self, minimum: ProfiledMinimum, i: int) -> None:
        self.minimum, self.place, self.own = minimum, i, float(minimum.at[i])
        self._at = {self.own: minimum.at}
        self.known = {self.own: 0.0}  # rise at each value of the parameter at which it is known

    def rise(self, value: float) -> float:
        if value not in self.known:
            near = (
                max((x for x in self.known if x < value), default=None),
                min((x for x in self.known if x > value), default=None),
            )
            self._search(value, [self._at[x] for x in near if x is not None])
        return self.known[value]

    def check(self, value: float) -> float:
        """Rise at a known value after searches from all starts; if it falls, results further out are discarded."""
        before, at = self.known[value], self._at[value]
        self._search(value, [at, self.minimum.at, *self.minimum.starts])
        if self.known[value] < before * (1 - PRECISION):
            self.known = {x: r for x, r in self.known.items() if abs(x - self.own) <= abs(value - self.own)}
        return self.known[value]

    def _search(self, value: float, starts: list[Array]) -> None:
        own, free = self.minimum, np.arange(len(self.minimum.at)) != self.place
        searches = [_descended(own.residuals, np.where(free, one, value), own.low, own.high, free) for one in starts]
        at, ssq = min(searches, key=lambda one: one[1])
        if ssq < own.ssq * (1 - BETTER):
            raise _Improved(at)
        self._at[value], self.known[value] = at, float(np.sqrt(max(ssq - own.ssq, 0.0) / own.variance))


def _end(profile: _Profile, limit: float, step: float) -> float:
    """Value, farthest from the minimum, at which a profile rises to a limit; infinite if it does not within the bounds.

    The first step of the search is `step` long; its sign is the side of the minimum.
    """
    from scipy.optimize import brentq

    own, minimum = profile.own, profile.minimum
    bound, far = float((minimum.low if step < 0 else minimum.high)[profile.place]), float(np.copysign(np.inf, step))
    size = step
    for _ in range(MOST_STEPS):
        outer = max(own + size, bound) if step < 0 else min(own + size, bound)
        size *= FURTHER
        if profile.rise(outer) < limit:
            if outer == bound:
                break
            continue
        inner = max((x for x, rise in profile.known.items() if rise < limit), key=lambda x: abs(x - own))
        beyond = [x for x in profile.known if abs(x - own) > abs(inner - own)]
        if not beyond:
            break
        outer = min(beyond, key=lambda x: abs(x - own))
        end = float(brentq(lambda x: profile.rise(x) - limit, inner, outer, xtol=PRECISION * abs(outer - own)))
        if profile.check(end) > limit * (1 - CLOSE):
            return end
        size = FURTHER * (end - own)
    return far
