"""Errors along valleys of the sum of squares that are longer than its curvature at the minimum suggests.

If derivatives of the model are nearly dependent, parameters can replace each other over a range in which the model is
not linear. Errors from the covariance may then be several times too small. Therefore the parameter that is most nearly
a combination of other parameters is fixed at distances on both sides of the minimum, and all other parameters are
fitted again: errors follow from the rise of the sum of squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.comparison import DataComparison
from steadyslip.experiments.fitting.condensed import condensed
from steadyslip.experiments.fitting.estimates import (
    LEAST_CHANGE,
    OPEN_SHARE,
    UNDETERMINED,
    Combination,
    combination,
    is_time,
)
from steadyslip.experiments.numerics.least_squares import minimise

DEPENDENT = 1e-3
"""Derivatives are nearly dependent if an eigenvalue of JᵀJ, scaled to a unit diagonal, is smaller. The eigenvalue is
0.004 for usual steps and 3e-4 along directions that the data leave undetermined."""
LEAST_DEVIATION = 0.05  # least standard deviation (in a coordinate) of a valley: over less, models are nearly linear
OPEN_DISTANCES = (1.0, 2.0, 4.0)  # distances, in the coordinate of a parameter that the data leave undetermined
REACH = 1.96  # half the width of a 95 % interval, in standard deviations
DISTANCES = (2.0, 4.0, 8.0)  # distances (standard deviations) on both sides at which other parameters are fitted again
LEAST_STRETCH = 1.1  # errors are widened only if the factor is larger: the fits are not more accurate
MOST_ITERATIONS, TOLERANCE = 30, 1e-4  # limits of these fits: the rise of the sum of squares is needed to two digits


@dataclass(frozen=True, eq=False)
class _Valley:
    """Valley of the sum of squares.

    Attributes
    ----------
    held : int
        Index of the coordinate that is fixed at distances from the minimum.
    axis : ndarray (p,)
        Changes of all coordinates by one standard deviation along the valley.
    share : ndarray (p,)
        Share of each coordinate's variance that is due to the valley; -1 for times, which samples bound on both sides.
    """

    held: int
    axis: Array
    share: Array


def along_valleys(
    plan: Any, comparison: DataComparison, z: Array, bounds: tuple[Array, Array], information: Array, covariance: Array
) -> tuple[Array, tuple[Combination, ...], Array]:
    """Covariance (p, p) widened along a valley, combinations of parameters that are undetermined, and points in it.

    The points (m, p) fit as well as the minimum.

    Parameters
    ----------
    plan, comparison
    z : ndarray (p,)
        Coordinates of the minimum.
    bounds : tuple of two ndarray (p,)
    information, covariance : ndarray (p, p)
        JᵀJ and the covariance from it.
    """
    valley = _valley(comparison, information, covariance)
    if valley is None:
        return covariance, (), np.empty((0, len(z)))
    unit = _unit_of_rise(information, covariance, valley.held)
    reached, near = _reached(plan, comparison, z, bounds, valley, unit)
    known = np.isfinite(np.diag(covariance)) & (valley.share >= 0)
    part = np.where(known, reached**2 / np.maximum(np.diag(covariance), 1e-300), 0.0)  # share of the variance
    deviation = float(np.linalg.norm(reached[known]))
    stretch = deviation / float(np.linalg.norm(valley.axis))
    wider = covariance.copy()
    if stretch >= LEAST_STRETCH:  # the same factor for all parameters: different factors would falsify errors of a - b
        wider += (stretch**2 - 1) * np.outer(valley.axis, valley.axis)
    if deviation <= UNDETERMINED:
        return wider, (), near
    lost = (part > OPEN_SHARE) & (reached > LEAST_CHANGE)
    wider[lost, :] = wider[:, lost] = 0.0
    wider[lost, lost] = np.inf
    return wider, (combination(np.copysign(reached, valley.axis), deviation, comparison.space, lost),), near


def along_open(
    plan: Any, comparison: DataComparison, z: Array, bounds: tuple[Array, Array], covariance: Array, held: int,
    variance: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Covariance (p, p), infinite for parameters that change along an open direction, and points (m, p) on it.

    The data do not determine an open direction, and the model is not linear along it. The points fit as well as the
    minimum.

    Parameters
    ----------
    plan, comparison, z, bounds, covariance
        As for `along_valleys`.
    held : int
        Index of the parameter that changes most along the direction.
    variance : float
        Variance of the noise: rise of the sum of squares at one standard deviation from the minimum.
    """
    axis = np.zeros(len(z))
    axis[held] = 1.0
    valley = _Valley(held, axis, np.zeros(len(z)))
    reached, near = _reached(plan, comparison, z, bounds, valley, variance, OPEN_DISTANCES)
    own = np.diag(covariance)
    times = np.array([is_time(one) for one in comparison.space.unknowns])
    lost = np.isfinite(own) & ~times & (reached**2 > OPEN_SHARE * own) & (reached > LEAST_CHANGE)
    found = covariance.copy()
    found[lost, :] = found[:, lost] = 0.0
    found[lost, lost] = np.inf
    return found, near


def _valley(comparison: DataComparison, information: Array, covariance: Array) -> _Valley | None:
    """Valley along which other parameters nearly compensate a change of a parameter; None if there is no valley."""
    known = np.flatnonzero(np.isfinite(np.diag(covariance)) & (np.diag(information) > 0))
    times = np.array([is_time(one) for one in comparison.space.unknowns])
    if len(known) < 2 or np.all(times[known]):
        return None
    size = np.sqrt(np.diag(information)[known])
    values, vectors = np.linalg.eigh(information[np.ix_(known, known)] / np.outer(size, size))
    held = int(known[np.argmax(np.abs(vectors[:, 0]) * ~times[known])])
    deviation = float(np.sqrt(covariance[held, held]))
    axis = np.zeros(len(covariance))
    axis[known] = covariance[known, held] / max(deviation, 1e-300)
    axis[times] = 0.0
    if values[0] > DEPENDENT or float(np.linalg.norm(axis)) < LEAST_DEVIATION:
        return None
    share = np.zeros(len(axis))
    share[known] = axis[known] ** 2 / np.maximum(np.diag(covariance)[known], 1e-300)
    share[times] = -1.0
    return _Valley(held, axis, share)


def _unit_of_rise(information: Array, covariance: Array, i: int) -> float:
    """Rise of the sum of squares one standard deviation of parameter i from the minimum, for correlated residuals."""
    naive = float(np.linalg.pinv(information, rcond=1e-13, hermitian=True)[i, i])
    return float(covariance[i, i]) / max(naive, 1e-300)


def _reached(
    plan: Any, comparison: DataComparison, z: Array, bounds: tuple[Array, Array], valley: _Valley, unit: float,
    distances: tuple[float, ...] = DISTANCES,
) -> tuple[Array, Array]:  # fmt: skip
    """Standard deviations (p,) along the valley, on the longer side for each parameter, and points (m, p) in it.

    At the points, the sum of squares has risen by no more than corresponds to a 95 % interval.
    """
    away = np.array([side * own for side in (-1.0, 1.0) for own in distances])
    begin = np.clip(z + away[:, None] * valley.axis, *bounds)
    held = np.zeros_like(begin, dtype=bool)
    held[:, valley.held] = True
    count = len(distances)
    few = condensed(plan, comparison, np.stack([z, begin[0], begin[count]]))
    least = float(np.sum(few.residuals(z[None])[0] ** 2))
    ends = minimise(lambda x, _: few.residuals(x), begin, *bounds, held=held, most=MOST_ITERATIONS, tolerance=TOLERANCE)
    rise = np.where(np.isfinite(ends.ssq), np.maximum(ends.ssq - least, 0.0), np.inf) / unit
    moved = np.abs(ends.coordinates - z)
    sides = (slice(0, count), slice(count, 2 * count))
    reached = np.max([_end(moved[side], np.sqrt(rise[side])) for side in sides], axis=0) / REACH
    return np.asarray(reached), ends.coordinates[rise <= REACH**2]


def _end(moved: Array, roots: Array) -> Array:
    """Distances (p,) at which the sum of squares has risen by as much as at the end of a 95 % interval.

    They are interpolated between the distances `moved` (m, p), at which `roots` (m,) are the square roots of the rise.
    If the rise is too small even at the largest distance, twice this distance is returned.
    """
    moved, roots = np.vstack([np.zeros(moved.shape[1]), moved]), np.append(0.0, roots)
    beyond = np.flatnonzero(roots >= REACH)
    if not len(beyond):
        return np.asarray(2 * moved[-1])
    j = int(beyond[0])
    part = (REACH - roots[j - 1]) / (roots[j] - roots[j - 1]) if np.isfinite(roots[j]) else 1.0
    return np.asarray(moved[j - 1] + part * (moved[j] - moved[j - 1]))
