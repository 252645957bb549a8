"""Valleys of the sum of squares that are longer than its curvature at the minimum says.

Where derivatives of the model are nearly dependent, parameters can be exchanged for each other over a range in which
the model is not linear. The covariance then tells an error along the valley that may be several times too small. So
the parameter that is most nearly a combination of the others is held away from the minimum, on both sides, and the
others are fitted again: how far the sum of squares lets it go is its error.
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

DEPENDENT = 1e-3  # least eigenvalue of JᵀJ, scaled to a diagonal of 1, of a usual step: .004, of open directions 3e-4
LEAST_DEVIATION = 0.05  # e-folds or natural sizes: models are linear over less
OPEN_DISTANCES = (1.0, 2.0, 4.0)  # the same along a direction that is open, in e-folds or natural sizes
REACH = 1.96  # standard deviations: 95 %
DISTANCES = (2.0, 4.0, 8.0)  # standard deviations at which the others are fitted again, on both sides
LEAST_STRETCH = 1.1  # of an error: shorter ones are within what these fits are good for
MOST_ITERATIONS, TOLERANCE = 30, 1e-4  # of these fits; a rise of the sum of squares is needed to two digits


@dataclass(frozen=True, eq=False)
class _Valley:
    """Coordinate that is held, standard deviations (p,) of all along the valley, and shares (p,) of their variance.

    Shares of times are -1: samples bound them on both sides, whatever the other parameters are.
    """

    held: int
    axis: Array
    share: Array


def along_valleys(
    plan: Any, comparison: DataComparison, z: Array, bounds: tuple[Array, Array], information: Array, covariance: Array
) -> tuple[Array, tuple[Combination, ...], Array]:
    """Covariance (p, p), widened or infinite along a valley, the combination that it leaves open, and places in it.

    The places (m, p) fit as well as the minimum does.

    Parameters
    ----------
    plan, comparison
    z : ndarray (p,)
        The minimum.
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
    part = np.where(known, reached**2 / np.maximum(np.diag(covariance), 1e-300), 0.0)  # of its variance
    stretch = np.where(known, np.sqrt(np.maximum(1 - valley.share + part, 1.0)), 1.0)
    stretch[stretch < LEAST_STRETCH] = 1.0
    deviation = float(np.linalg.norm(reached[known]))
    wider = np.where(np.isfinite(covariance), covariance * np.outer(stretch, stretch), covariance)
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
    """Covariance (p, p) without errors of what changes along an open direction, in which the model is not linear.

    And places (m, p) along it that fit as well as the minimum does.

    Parameters
    ----------
    plan, comparison, z, bounds, covariance
        As of `along_valleys`.
    held : int
        The parameter that changes most along the direction.
    variance : float
        Of the noise, by which the sum of squares rises one standard deviation from the minimum.
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
    """The nearly dependent parameter among those that have an error; None if there is none."""
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
    """Rise of the sum of squares one standard deviation from the minimum, with correlation of the residuals."""
    naive = float(np.linalg.pinv(information, rcond=1e-13, hermitian=True)[i, i])
    return float(covariance[i, i]) / max(naive, 1e-300)


def _reached(
    plan: Any, comparison: DataComparison, z: Array, bounds: tuple[Array, Array], valley: _Valley, unit: float,
    distances: tuple[float, ...] = DISTANCES,
) -> tuple[Array, Array]:  # fmt: skip
    """Standard deviations (p,) that the ends of the valley stand for, on the side where each parameter goes further.

    And places (m, p) on the way where the sum of squares is not above what 95 % need.
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
    """Distances (p,) where the sum of squares has risen by what 95 % need, from distances (m, p) and roots of the rise.

    Where it does not rise so far, the valley is taken to be twice as long as was tried.
    """
    moved, roots = np.vstack([np.zeros(moved.shape[1]), moved]), np.append(0.0, roots)
    beyond = np.flatnonzero(roots >= REACH)
    if not len(beyond):
        return np.asarray(2 * moved[-1])
    j = int(beyond[0])
    part = (REACH - roots[j - 1]) / (roots[j] - roots[j - 1]) if np.isfinite(roots[j]) else 1.0
    return np.asarray(moved[j - 1] + part * (moved[j] - moved[j - 1]))
