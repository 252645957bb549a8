"""What a record cannot tell: directions in parameter space along which the fit hardly changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.unknowns import Space

UNDETERMINED = 0.5  # standard deviation along a direction, in e-folds or natural sizes
MENTIONED = 0.15  # weight in a direction from which on a parameter is named
FELT = 0.1  # the same, of its change along one standard deviation
NOTHING = 1e-13  # share of the largest information that is rounding
UNFELT = 1e-10  # share of the largest derivatives that is the rounding of a motion of many steps


@dataclass(frozen=True)
class Combination:
    """A change of parameters that the records do not notice.

    Attributes
    ----------
    weights : dict of str to float
        Parameters that change and by how much relative to each other, in e-folds (positive parameters) or natural
        sizes (0.01 of b, 0.2 of α); the largest is 1.
    deviation : float
        Standard deviation along it, in the same units; inf if nothing at all is known.
    """

    weights: dict[str, float]
    deviation: float

    def __str__(self) -> str:
        if len(self.weights) == 1:
            return f"{next(iter(self.weights))} is not determined by these data"
        signs = ", ".join(f"{name} {'up' if w > 0 else 'down'}" for name, w in self.weights.items())
        return f"only together: {signs} leaves the fit as good as it is; fix one of them"


def combinations(information: Array, spread: Array, space: Space) -> tuple[Array, tuple[Combination, ...]]:
    """Covariance of the coordinates, and the directions that have none.

    Parameters
    ----------
    information : ndarray (p, p)
        JᵀJ in coordinates.
    spread : ndarray (p, p)
        Jᵀ C J with the covariance of the data.
    space : Space

    Returns
    -------
    covariance : ndarray (p, p)
        Infinite where a parameter is not determined.
    found : tuple of Combination
    """
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    blind = size <= UNFELT * max(float(size.max(initial=0.0)), 1e-300)
    scale = np.where(blind, 1.0, size)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    known = values > NOTHING * max(float(values.max(initial=0.0)), 1e-300)
    inverse = vectors[:, known] / values[known] @ vectors[:, known].T / np.outer(scale, scale)
    covariance = inverse @ spread @ inverse
    found, lost = [], np.zeros(len(space), dtype=bool)
    for i in np.flatnonzero(~known):
        direction = vectors[:, i] / scale
        found.append(_named(direction, np.inf, space))
        lost |= np.abs(direction) > 1e-3 * np.max(np.abs(direction))
    usable = np.flatnonzero(~lost)
    if len(usable):
        deviations, axes = np.linalg.eigh(covariance[np.ix_(usable, usable)])
        for variance, axis in sorted(zip(deviations, axes.T, strict=True), key=lambda pair: -pair[0]):
            if variance > UNDETERMINED**2:
                full = np.zeros(len(space))
                full[usable] = axis
                found.append(_named(full, float(np.sqrt(variance)), space))
    lost |= np.diag(covariance) > UNDETERMINED**2
    covariance[lost, :] = covariance[:, lost] = 0.0
    covariance[lost, lost] = np.inf
    return covariance, tuple(found)


def _named(direction: Array, deviation: float, space: Space) -> Combination:
    weights = direction / direction[np.argmax(np.abs(direction))]
    least = min(MENTIONED, max(FELT / deviation, 0.01))
    order = [i for i in np.argsort(-np.abs(weights)) if abs(weights[i]) >= least]
    return Combination({space.unknowns[i].name: float(weights[i]) for i in order}, deviation)


def prior_information(space: Space) -> Array:
    """What is known of times between two samples beforehand: they lie between them, evenly likely."""
    known = np.zeros((len(space), len(space)))
    for i, one in enumerate(space.unknowns):
        if one.parameter.startswith(("jump.", "step.")):
            known[i, i] = 12.0  # one over the variance of a number between 0 and 1, which is the coordinate's unit
    return known
