"""Checks of a fit by its residuals: their sum of squares, and their scatter against the noise model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.checks import Check, check
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.numerics.noise import Noise

SSQ_TOLERANCE = 1e-6  # relative tolerance for sums of squares: ten times the tolerance of the search
PIECES, MIN_SAMPLES = 16, 4  # pieces of a record whose means are compared, and least number of samples in each
MAX_EXCESS = 1.0  # largest relative excess of scatter over the noise model; exceeded by chance once in 2e7 fits


def residual_checks(fit: Fitted) -> tuple[Check, ...]:
    """Checks of the sum of squares, the convergence, and the noise model from which errors are computed."""
    r = fit.scaled_residuals
    missed = abs(float(r @ r) - fit.ssq) / fit.ssq if fit.ssq else float(np.any(r))
    ended = fit.search.converged and not fit.search.cut
    parts = zip(fit.noise, fit.comparison.slices, strict=True)
    scatters = [one for noise, where in parts for one in _excess_scatter(r[where], noise)]
    found = [
        check("sum of squares", "residuals of the model at the estimates, added up", missed, SSQ_TOLERANCE),
        check("minimum", "what further steps of the search would gain", float(not ended), 0.0),
    ]
    how = "scatter of the residuals' means over sixteenths of a record"
    return tuple(found + ([check("errors", how, max(scatters), MAX_EXCESS)] if scatters else []))


def _excess_scatter(r: Array, noise: Noise) -> Iterator[float]:
    """Relative excess of the scatter of means over pieces of a record over the scatter that the noise model predicts.

    Nothing is returned for short records.
    """
    length = len(r) // PIECES
    if length < MIN_SAMPLES:
        return
    means = r[: length * PIECES].reshape(PIECES, length).mean(axis=1)
    expected = noise.variance_of_mean(length)
    scatter = float(np.var(means))
    yield max(float(np.sqrt(scatter / expected)) - 1.0, 0.0) if expected > 0 else (np.inf if scatter else 0.0)
