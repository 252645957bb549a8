"""Cross-validation: prediction of samples that were left out of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked, whole
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.answers.uncertainty import block_length
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.numerics.least_squares import minimise

APART = 3.0  # length of the blocks left out, as a multiple of the number of samples per independent sample


@dataclass(frozen=True, eq=False)
class CrossValidation(ReadOnly):
    """Errors in the prediction of samples that were left out of a fit.

    Attributes
    ----------
    residuals : ndarray (n,)
        Data minus prediction by a fit from which the sample was left out, weighted as in the fit.
    fold : ndarray of int (n,)
        Index of the fold of each sample; the samples of a fold are left out together.
    block : int
        Number of successive samples in a fold.
    seen : float
        Root mean square of the residuals of the fit to all samples.
    """

    residuals: Array = field(repr=False)
    fold: Array = field(repr=False)
    block: int
    seen: float

    @property
    def rms(self) -> float:
        """Root mean square of the prediction errors."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def by_fold(self) -> Array:
        """Root mean square of the prediction errors in each fold, (folds,)."""
        squares = np.bincount(self.fold, self.residuals**2) / np.bincount(self.fold)
        return np.asarray(np.sqrt(squares))

    def __str__(self) -> str:
        return (
            f"samples left out, {int(self.fold.max()) + 1} folds of blocks of {self.block}: predicted to "
            f"{self.rms:.4g}, against {self.seen:.4g} in the fit to all samples"
        )


@checked(folds=whole(2, 10**5), block=whole(1))
def cross_validate(
    fit: Fit, folds: int = 8, *, block: int | None = None, threads: int | None = None
) -> CrossValidation:
    """Prediction errors of samples that are left out of the fit, one fold of the samples after the other.

    With 8 folds, a fold consists of every 8th block of successive samples. Blocks are longer than the correlation of
    the noise, so that neighbouring samples do not reveal the samples left out, and short enough that every step of the
    loading remains in the fit.

    Parameters
    ----------
    fit : Fit
    folds : int
        Number of folds.
    block : int, optional
        Number of samples in a block; by default three times the number of samples per independent sample.
    threads : int, optional

    Raises
    ------
    ParameterError
        If there are fewer than two folds, or blocks so long that a fold is empty.
    NotAvailable
        If a fold cannot be fitted.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> ss.experiments.cross_validate(fit, 3).block
    8
    """
    if not (isinstance(folds, int) and not isinstance(folds, bool) and 2 <= folds <= 100):
        raise ParameterError([Problem("folds", f"got {folds!r}; allowed: a whole number from 2 to 100")])
    most = fit.samples // folds
    if block is not None and not (isinstance(block, int) and not isinstance(block, bool) and 1 <= block <= most):
        raise ParameterError([Problem("block", f"got {block!r}; allowed: a whole number from 1 to {most}")])
    comparison = fit.plan.comparison(Effort(threads))
    length = block or min(max(block_length(fit, i, APART) for i in range(len(comparison.parts))), most)
    fold = np.arange(fit.samples) // length % folds
    seen = (fold != np.arange(folds)[:, None]).astype(float)

    def without(z: Array, lanes: Array) -> tuple[Array, Array]:
        r, jacobian = comparison.residuals(z)
        return r * seen[lanes], jacobian * seen[lanes][:, None, :]

    found = minimise(without, np.tile(fit.coordinates, (folds, 1)), *fit.bounds)
    if not np.all(np.isfinite(found.ssq)):
        raise NotAvailable("the model cannot be fitted without some of the samples; are there enough of them?")
    residuals = comparison.residuals(found.coordinates)[0]
    own = residuals[fold, np.arange(fit.samples)]
    return CrossValidation(own, fold, length, float(np.sqrt(fit.ssq / fit.samples)))
