"""Bounded least squares of a few parameters, with intervals from the profile of the sum of squares.

Friction curves of a handful of speeds are far from linear in some parameters, and straight-line errors would cover
too little there: an interval holds the values at which the best sum of squares is not larger than chance makes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array

Residuals = Callable[[Array], tuple[Array, Array]]
"""Function of the parameters (p,) that gives residuals (n,) and their Jacobian (n, p)."""

TOLERANCE = 1e-10  # relative, of a search's sum of squares and step: far below noise
MOST_EVALUATIONS = 200  # of one search; dozens suffice
FIRST_DAMPING, EASED, MOST_DAMPING = 1e-4, 10.0, 1e10  # of the descent, relative to the squared slopes
MOST_STEPS, FURTHER = 40, 1.5  # outward steps of an end of an interval, each half as long again: over all bounds
CLOSE = 0.01  # by how much of its limit the rise at an end may fall short after a search from all starts
PRECISION = 1e-3  # of the ends of intervals, as a share of their width: three digits of an error are enough
BETTER = 1e-6  # relative fall of the sum of squares that counts as another minimum
EXACT = 1e-20  # mean square residual below which there is no noise to estimate, only rounding


@dataclass(frozen=True)
class ProfiledMinimum:
    """Least squares within bounds.

    Attributes
    ----------
    at : ndarray (p,)
    ssq : float
    low, high : ndarray (p,)
        Bounds.
    starts : list of ndarray (p,)
        From which other valleys are searched for.
    """

    residuals: Residuals
    at: Array
    ssq: float
    low: Array
    high: Array
    starts: list[Array]

    @property
    def freedom(self) -> int:
        """Residuals less parameters."""
        return len(self.residuals(self.at)[0]) - len(self.at)

    @property
    def variance(self) -> float:
        """Mean square of the noise, estimated from the residuals."""
        return self.ssq / self.freedom

    def covariance(self) -> Array:
        """Covariance of the parameters (p, p) near the minimum, as if residuals were linear; inf where singular."""
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
    """Least sum of squares within bounds, the best of searches from several starts."""
    from scipy.optimize import least_squares

    every = np.ones(len(low), dtype=bool)
    start, _ = min((_descended(residuals, one, low, high, every) for one in starts), key=lambda one: one[1])
    found = least_squares(
        lambda at: residuals(at)[0], np.clip(start, low, high), lambda at: residuals(at)[1], bounds=(low, high),
        x_scale="jac", ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, max_nfev=MOST_EVALUATIONS,
    )  # fmt: skip
    reach = TOLERANCE * (high - low)  # SciPy stays within bounds, by 1e-24 of a viscosity that is 0
    at = np.where(found.x - low < reach, low, np.where(high - found.x < reach, high, found.x))
    own = residuals(at)[0]
    return ProfiledMinimum(residuals, at, float(own @ own), low, high, starts)


def _descended(residuals: Residuals, start: Array, low: Array, high: Array, free: Array) -> tuple[Array, float]:
    """Parameters and sum of squares after Levenberg's descent in the free ones, quick from a start that is near."""
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
    """A search for an end of an interval found a smaller sum of squares than the minimum."""

    def __init__(self, at: Array) -> None:
        super().__init__()
        self.at = at


def intervals(minimum: ProfiledMinimum, levels: tuple[float, ...]) -> tuple[ProfiledMinimum, Array]:
    """Intervals of every parameter from its profile and Student's t, the noise estimated.

    Parameters
    ----------
    minimum : ProfiledMinimum
    levels : tuple of float
        Probabilities, such as 0.6827 and 0.95.

    Returns
    -------
    minimum : ProfiledMinimum
        That given, or a better one that was found on the way.
    ends : ndarray (p, levels, 2)
        Infinite where a bound is reached before the sum of squares tells against the value.
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
    """Ends of the intervals of one parameter (levels, 2) at rising limits of t."""
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
        sides.append(own + side * np.maximum.accumulate(lengths))  # ends of one steep rise may differ by rounding
    return np.array(sides).T


class _Profile:
    """Rise of the least sum of squares over one parameter, as t: the root of its ratio to the variance.

    A value is searched for from the nearest known ones of both sides, so that no search that went astray leads the
    next ones; `check` also searches it from everywhere.
    """

    def __init__(self, minimum: ProfiledMinimum, i: int) -> None:
        self.minimum, self.place, self.own = minimum, i, float(minimum.at[i])
        self._at = {self.own: minimum.at}
        self.known = {self.own: 0.0}  # rise by value

    def rise(self, value: float) -> float:
        if value not in self.known:
            near = (
                max((x for x in self.known if x < value), default=None),
                min((x for x in self.known if x > value), default=None),
            )
            self._search(value, [self._at[x] for x in near if x is not None])
        return self.known[value]

    def check(self, value: float) -> float:
        """Rise at a known value from all starts; where it is another, values beyond it are forgotten."""
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
    """Farthest value at which a profile rises to a limit; infinite where it does not within bounds."""
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
