"""What residuals say of a fit: whether they add up to what the search ended with, and are as its errors take them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.checks import Check, check
from steadyslip.experiments.fitting.comparison import lost
from steadyslip.experiments.fitting.numbers import FitNumbers
from steadyslip.experiments.numerics.noise import Noise

ADDED_UP = 1e-6  # share of the sum of squares: ten times what the search may be from its end
PIECES, SHORTEST = 16, 4  # of a record, whose means are compared, and samples in each
TWICE = 1.0  # share by which a scatter may be larger than expected: chance alone does so once in twenty million


def residual_checks(fit: FitNumbers) -> tuple[Check, ...]:
    """Of the sum of squares, the minimum, and the errors."""
    r = fit.residuals * fit.comparison.weights
    if fit.plan.loss != "linear":
        r, _ = lost(fit.plan.loss, r, fit.comparison.width)
    missed = abs(float(r @ r) - fit.ssq) / fit.ssq if fit.ssq else float(np.any(r))
    ended = fit.search.converged and not fit.search.cut
    scatters = [one for i, noise in enumerate(fit.noise) for one in _beyond(fit.part(r, i), noise)]
    found = [
        check("sum of squares", "residuals of the model at the estimates, added up", missed, ADDED_UP),
        check("minimum", "what further steps of the search would gain", float(not ended), 0.0),
    ]
    how = "scatter of the residuals' means over sixteenths of a record"
    return tuple(found + ([check("errors", how, max(scatters), TWICE)] if scatters else []))


def _beyond(r: Array, noise: Noise) -> Iterator[float]:
    """By which share means over pieces of a record scatter more than its noise lets them."""
    length = len(r) // PIECES
    if length < SHORTEST:
        return
    means = r[: length * PIECES].reshape(PIECES, length).mean(axis=1)
    own = noise.covariance[:length]
    worth = 2.0 * (1.0 - np.arange(len(own)) / length)
    worth[0] = 1.0
    expected = float(own @ worth) / length
    scatter = float(np.var(means))
    yield max(float(np.sqrt(scatter / expected)) - 1.0, 0.0) if expected > 0 else (np.inf if scatter else 0.0)
