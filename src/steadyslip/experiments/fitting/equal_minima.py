"""Minima other than the best that fit the records as well: what differs between them is not determined."""

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

AS_GOOD = 3.84  # rise of -2 log likelihood up to which a fit is as good: 95 %
FAR = 4.0  # errors by which a minimum moves what is then not determined: its error is less than half of what it must be
NEAR = 1.0  # errors from which it widens an interval; less makes one wider by less than an eighth
APART = 2.5  # errors beyond which an end of the search is not within the errors of the best minimum, with some margin


@dataclass(frozen=True, eq=False)
class EqualMinimum:
    """Another minimum that fits the records as well, of the same model or of one with more unknowns.

    Attributes
    ----------
    space : Space
        Its unknowns.
    moved : ndarray (p,)
        Its coordinates less those of the best minimum.
    """

    space: Space
    moved: Array

    def shift(self, space: Space) -> Array:
        """Change (p,) of the coordinates of a space from the best minimum to this one; 0 for times."""
        moved = {u.name: x for u, x in zip(self.space.unknowns, self.moved, strict=True) if not is_time(u)}
        return np.array([moved.get(u.name, 0.0) for u in space.unknowns])

    def far(self, space: Space, deviations: Array, errors: float = FAR) -> Array:
        """Mask (p,) of the unknowns of a space that differ by more than so many errors, or have no finite error."""
        own = np.abs(self.shift(space))
        return np.asarray((own > LEAST_CHANGE) & ((own > errors * deviations) | ~np.isfinite(deviations)))


def ends_beside(
    comparison: DataComparison, z: Array, ends: Array, bounds: tuple[Array, Array], covariance: Array, most: float
) -> Minima:  # fmt: skip
    """Minima beyond the errors of the best, from where starts of the search ended; those up to `most`, best first.

    Parameters
    ----------
    comparison : DataComparison
    z : ndarray (p,)
        Coordinates of the best minimum.
    ends : ndarray (m, p)
    bounds : tuple of two ndarray (p,)
        Of the search.
    covariance : ndarray (p, p)
        Of the coordinates at the best minimum.
    most : float
        Sum of squares up to which a minimum fits as well.
    """
    begin = ends[_apart(comparison.space, ends - z, covariance)]
    if not len(begin):
        return Minima.none(len(z))
    found = minimise(lambda x, _: comparison.residuals(x), begin, *bounds, most=ROUGH_ITERATIONS, known=most).sorted()
    as_good = (found.ssq <= most) & _apart(comparison.space, found.coordinates - z, covariance)
    return Minima(*(one[as_good] for one in (found.coordinates, found.ssq, found.converged, found.iterations)))


def _apart(space: Space, moved: Array, covariance: Array) -> Array:
    """Mask (m,) of changes (m, p) of which one is beyond the errors of its coordinate."""
    deviations = np.sqrt(np.diag(covariance))
    known = np.isfinite(deviations)
    far = [EqualMinimum(space, one).far(space, deviations, APART) & known for one in moved]
    return np.array([bool(np.any(one)) for one in far], dtype=bool)


def opened(
    space: Space, covariance: Array, minima: Sequence[EqualMinimum]
) -> tuple[Array, tuple[Combination, ...]]:  # fmt: skip
    """Covariance (p, p) that allows for equal minima, and the combination of parameters that they leave open.

    The 95 % interval of what the furthest moves reaches as far as it does; what it moves far beyond has no error.

    Parameters
    ----------
    space : Space
        Unknowns of the best minimum.
    covariance : ndarray (p, p)
        Of their coordinates.
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
        reach = (-len(one.space), float(np.linalg.norm(one.moved[inside])))  # of the fewest unknowns, the furthest
        if names and reach > best:
            direction = np.where(inside | ~added, one.moved, 0.0)
            best, found = reach, (combination(direction, float(np.linalg.norm(direction)), one.space, direction != 0),)
    shifts = [np.where(lost | ~np.isfinite(deviations), 0.0, one.shift(space)) for one in minima]
    furthest = max(shifts, key=lambda s: float(np.max(np.abs(s) / deviations)), default=np.zeros(len(space)))
    wider = covariance + np.outer(furthest, furthest) / AS_GOOD
    wider[lost, :] = wider[:, lost] = 0.0
    wider[lost, lost] = np.inf
    return wider, found
