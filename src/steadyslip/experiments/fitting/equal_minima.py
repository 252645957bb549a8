"""Minima that fit the records as well as the best minimum: parameters that differ between them are not determined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.comparison import DataComparison
from steadyslip.experiments.fitting.estimates import LEAST_CHANGE, Combination, combination, is_time
from steadyslip.experiments.fitting.search import ROUGH_ITERATIONS
from steadyslip.experiments.fitting.unknowns import Space
from steadyslip.experiments.numerics.least_squares import Minima, minimise

AS_GOOD = 3.84  # a minimum fits as well if -2 log likelihood exceeds the least by no more than this (95 %)
FAR = 4.0  # a parameter that differs by more standard errors is undetermined: its error is far too small
NEAR = 1.0  # differences of fewer standard errors are ignored: they would widen an interval by less than an eighth
APART = 2.5  # an end of the search is near another minimum if a coordinate differs by more standard errors than this


@dataclass(frozen=True, eq=False)
class EqualMinimum:
    """Another minimum that fits the records as well, of the same model or of one with more unknowns.

    Attributes
    ----------
    space : Space
        Unknowns of the model that has this minimum.
    moved : ndarray (p,)
        Coordinates of this minimum minus those of the best minimum; both have the unknowns of `space`.
    """

    space: Space
    moved: Array

    def shift(self, space: Space) -> Array:
        """Differences (p,) from the best minimum in the coordinates of `space`; 0 for times."""
        moved = {u.name: x for u, x in zip(self.space.unknowns, self.moved, strict=True) if not is_time(u)}
        return np.array([moved.get(u.name, 0.0) for u in space.unknowns])

    def far(self, space: Space, deviations: Array, errors: float = FAR) -> Array:
        """Mask (p,) of unknowns in `space` that differ by more than `errors` deviations or have no finite deviation."""
        own = np.abs(self.shift(space))
        return np.asarray((own > LEAST_CHANGE) & ((own > errors * deviations) | ~np.isfinite(deviations)))


def ends_beside(
    comparison: DataComparison, z: Array, ends: Array, bounds: tuple[Array, Array], covariance: Array, most: float
) -> Minima:  # fmt: skip
    """Minima outside the errors of the best minimum, with a sum of squares up to `most`, sorted by it.

    Parameters
    ----------
    comparison : DataComparison
    z : ndarray (p,)
        Coordinates of the best minimum.
    ends : ndarray (m, p)
        Coordinates where starts of the search ended, from which the minima are searched.
    bounds : tuple of two ndarray (p,)
        Bounds of the search.
    covariance : ndarray (p, p)
        Covariance of the coordinates at the best minimum.
    most : float
        Largest sum of squares of a minimum that fits as well.
    """
    begin = ends[_apart(comparison.space, ends - z, covariance)]
    if not len(begin):
        return Minima.none(len(z))
    found = minimise(lambda x, _: comparison.residuals(x), begin, *bounds, most=ROUGH_ITERATIONS, known=most).sorted()
    as_good = (found.ssq <= most) & _apart(comparison.space, found.coordinates - z, covariance)
    return Minima(*(one[as_good] for one in (found.coordinates, found.ssq, found.converged, found.iterations)))


def _apart(space: Space, moved: Array, covariance: Array) -> Array:
    """Mask (m,) of differences (m, p) with at least one coordinate beyond `APART` standard deviations."""
    deviations = np.sqrt(np.diag(covariance))
    known = np.isfinite(deviations)
    far = [EqualMinimum(space, one).far(space, deviations, APART) & known for one in moved]
    return np.array([bool(np.any(one)) for one in far], dtype=bool)


def opened(
    space: Space, covariance: Array, minima: Sequence[EqualMinimum]
) -> tuple[Array, tuple[Combination, ...]]:  # fmt: skip
    """Covariance (p, p) widened to include minima that fit as well, and the combination that they leave undetermined.

    The 95 % interval of each parameter includes its value at the minimum that differs most; parameters that differ much
    more have an infinite variance.

    Parameters
    ----------
    space : Space
        Unknowns of the best minimum.
    covariance : ndarray (p, p)
        Covariance of the coordinates at the best minimum.
    minima : sequence of EqualMinimum
    """
    deviations = np.sqrt(np.diag(covariance))
    lost, best = np.zeros(len(space), dtype=bool), (-np.inf, 0.0)
    found: tuple[Combination, ...] = ()
    own = [u.name for u in space.unknowns]
    for one in minima:
        far = one.far(space, deviations)
        lost |= far
        names = {name for name, is_far in zip(own, far, strict=True) if is_far}
        inside, added = (np.array([u.name in some for u in one.space.unknowns]) for some in (names, own))
        reach = (-len(one.space), float(np.linalg.norm(one.moved[inside])))  # fewest unknowns, then largest difference
        if names and reach > best:
            direction = np.where(inside | ~added, one.moved, 0.0)
            best, found = reach, (combination(direction, float(np.linalg.norm(direction)), one.space, direction != 0),)
    shifts = [np.where(lost | ~np.isfinite(deviations), 0.0, one.shift(space)) for one in minima]
    furthest = max(shifts, key=lambda s: float(np.max(np.abs(s) / deviations)), default=np.zeros(len(space)))
    wider = covariance + np.outer(furthest, furthest) / AS_GOOD
    wider[lost, :] = wider[:, lost] = 0.0
    wider[lost, lost] = np.inf
    return wider, found
