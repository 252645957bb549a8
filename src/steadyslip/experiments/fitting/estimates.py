"""Estimates of parameters with their errors, and combinations of parameters that the records do not determine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity, format_range, format_with_error
from steadyslip.core.pages import Displayed
from steadyslip.experiments.fitting.unknowns import Space, Unknown


@dataclass(frozen=True)
class Estimate(Displayed):
    """Fitted parameter with its error and 95 % interval.

    Attributes
    ----------
    name : str
        Dotted name, followed by ``@2`` if it belongs to the second record only.
    value, error : float
        Estimate and standard deviation in SI units; the error is inf if the records do not determine the parameter.
    unit : str
    low, high : float
        Ends of the 95 % interval.
    area : float or None
        Contact area of the rig, m²; if given, text shows totals for the whole contact.
    along : tuple of str
        If the parameter is not determined, other parameters that change together with it.
    ended : bool
        False if the search was stopped before it ended, so that the error is unknown.
    """

    name: str
    value: float
    error: float
    unit: str
    low: float
    high: float
    area: float | None = None
    along: tuple[str, ...] = ()
    ended: bool = True

    @property
    def determined(self) -> bool:
        return bool(np.isfinite(self.error))

    def __str__(self) -> str:
        return f"{self.name} = {self.shown()}"

    def shown(self) -> str:
        """Value and error with units, as text."""
        if not self.determined:
            time = self.unit == "s"  # times on the record's clock need many digits
            value = f"{self.value:.7g} s" if time else format_quantity(self.value, self.unit, area=self.area)
            return f"{value} ({self.undetermined})"
        if self.unit == "s":
            return f"{self.value:.7g} ± {self.error:.2g} s"
        return format_with_error(self.value, self.error, self.unit, self.area)

    @property
    def undetermined(self) -> str:
        """Text that is shown in place of an infinite error."""
        if not self.ended:
            return "no error: the search was stopped before it ended"
        together = f" (with {', '.join(self.along)})" if self.along else ""
        return f"not determined by these data{together}"

    def range(self) -> str:
        """95 % interval with units, as text."""
        if self.unit == "s":
            return f"{self.low:.7g} to {self.high:.7g} s"
        return format_range(self.low, self.high, self.unit, self.area)


# coordinates are logarithms of positive parameters, and other parameters over a typical size (0.01 of b, 0.2 of α)
UNDETERMINED = 0.5  # data leave a direction open (undetermined) if its standard deviation in coordinates is larger
MIN_WEIGHT = 0.15  # a combination names parameters of at least this weight: more names would only lengthen the message
MIN_CHANGE = 0.1  # a parameter is also named if one standard deviation along the direction changes it by this much
LEAST_CHANGE = 0.01  # a parameter may be undetermined if an open direction changes its coordinate by more than this
MOST_REACH = 2.0  # largest change of a coordinate along an open direction: more is not plausible
OPEN_SHARE = 0.1  # a parameter is undetermined if more than this share of its variance is along an open direction
EIGENVALUE_ROUNDING = 1e-13  # eigenvalues of the scaled JᵀJ below this share of the largest are rounding errors
DERIVATIVE_ROUNDING = 1e-10  # derivatives below this share of the largest are rounding errors of the integration


@dataclass(frozen=True)
class Combination:
    """Combined change of parameters that the records do not determine.

    Attributes
    ----------
    weights : dict of str to float
        Change of each parameter relative to the largest change, which is 1: of the logarithm of a positive parameter,
        or of another parameter over its typical size (0.01 of b, 0.2 of α).
    deviation : float
        Standard deviation along the direction, as the length of the vector of these changes; inf without a bound.
    """

    weights: dict[str, float]
    deviation: float

    def __str__(self) -> str:
        if len(self.weights) == 1:
            return f"{next(iter(self.weights))} is not determined by these data"
        sides = [[name for name, w in self.weights.items() if (w > 0) is up] for up in (True, False)]
        moved = " with ".join(f"{', '.join(names)} {way}" for names, way in zip(sides, ("up", "down"), strict=True)
                              if names)  # fmt: skip
        return f"{moved} fits as well: these data determine them only in combination; fix one of them"


def whole_covariance(information: Array, spread: Array) -> Array:
    """Covariance (p, p) of the coordinates, finite also for coordinates that `combinations` leaves without an error.

    Along directions that the data hardly determine, the deviation is limited to `MOST_REACH`: the rounding errors of
    larger numbers would hide the other deviations.
    """
    values, directions, known = _directions(information)
    largest = np.max(np.abs(directions), axis=0)
    with np.errstate(all="ignore"):
        reach = np.sqrt(np.einsum("ij,ik,kj->j", directions, spread, directions)) / values * largest
    told = known & (reach <= MOST_REACH)
    inverse = directions[:, told] / values[told] @ directions[:, told].T
    beyond = MOST_REACH * directions[:, ~told] / largest[~told]
    return np.asarray(inverse @ spread @ inverse + beyond @ beyond.T)


def _directions(information: Array) -> tuple[Array, Array, Array]:
    """Information (p,) on independent directions, the directions (p, p) as columns, and mask of usable directions."""
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    insensitive = size <= DERIVATIVE_ROUNDING * max(float(size.max(initial=0.0)), 1e-300)
    scale = np.where(insensitive, 1.0, size)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    known = values > EIGENVALUE_ROUNDING * max(float(values.max(initial=0.0)), 1e-300)
    return values, vectors / scale[:, None], known


def combinations(information: Array, spread: Array, space: Space) -> tuple[Array, tuple[Combination, ...]]:
    """Covariance of the coordinates, and the combinations of parameters that are not determined.

    Parameters
    ----------
    information : ndarray (p, p)
        JᵀJ, with the derivatives J in coordinates.
    spread : ndarray (p, p)
        JᵀCJ, with the covariance C of the data.
    space : Space

    Returns
    -------
    covariance : ndarray (p, p)
        inf on the diagonal for parameters that are not determined.
    found : tuple of Combination
    """
    values, directions, known = _directions(information)
    inverse = directions[:, known] / values[known] @ directions[:, known].T
    covariance = inverse @ spread @ inverse
    found, undetermined = [], np.zeros(len(space), dtype=bool)
    for direction in directions[:, ~known].T:
        lost = np.abs(direction) > 1e-3 * np.max(np.abs(direction))
        found.append(combination(direction, np.inf, space, lost))
        undetermined |= lost
    usable, times = np.flatnonzero(~undetermined), np.array([is_time(one) for one in space.unknowns])
    if len(usable):
        deviations, axes = np.linalg.eigh(covariance[np.ix_(usable, usable)])
        for variance, axis in sorted(zip(deviations, axes.T, strict=True), key=lambda pair: -pair[0]):
            if variance > UNDETERMINED**2:
                full = np.zeros(len(space))
                full[usable] = axis
                part = min(variance, MOST_REACH**2) * full**2
                rest = np.maximum(np.diag(covariance) - variance * full**2, 0.0)
                lost = (part > OPEN_SHARE * (part + rest)) & (part > LEAST_CHANGE**2)
                lost &= ~times
                undetermined |= lost
                found.append(combination(full, float(np.sqrt(variance)), space, lost))
    undetermined |= (np.diag(covariance) > UNDETERMINED**2) & ~times
    covariance[undetermined, :] = covariance[:, undetermined] = 0.0
    covariance[undetermined, undetermined] = np.inf
    return covariance, tuple(found)


def is_time(one: Unknown) -> bool:
    """True for the time of a change, which samples on both sides bound whatever the other parameters are."""
    return one.parameter.startswith(("jump.", "step."))


def combination(direction: Array, deviation: float, space: Space, lost: Array) -> Combination:
    """Combination of parameters along a direction (p,): those in the mask `lost` (p,), and others that change much."""
    weights = direction / direction[np.argmax(np.abs(direction))]
    least = min(MIN_WEIGHT, max(MIN_CHANGE / deviation, 0.01))
    order = [i for i in np.argsort(-np.abs(weights)) if lost[i] or abs(weights[i]) >= least]
    return Combination({space.unknowns[i].name: float(weights[i]) for i in order}, deviation)


def prior_information(space: Space) -> Array:
    """Prior information (p, p) on times of changes, as inverse variances from the windows in which they are searched.

    The search leaves a time that the data do not determine at an end of its window, half a width of the window (1/2 in
    coordinates) from the middle; this distance is taken as the standard deviation. A uniform distribution over the
    window has a third of this variance, but errors would be too small with it, as the search does not use a prior.
    """
    known = np.zeros((len(space), len(space)))
    for i, one in enumerate(space.unknowns):
        if is_time(one):
            known[i, i] = 4.0
    return known
