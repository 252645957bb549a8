"""Test of residuals for structure: are they white noise plus noise that decays exponentially, the same throughout?"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.numerics.noise import autocorrelation

LAGS = 20  # of the autocorrelation, in samples; a tenth of the samples, if that is less
STARTS = ((0.5, 0.0), (0.9, 0.7))  # coefficients of autoregression and moving average from which the noise is sought


@dataclass(frozen=True)
class Whiteness:
    """Result of the test of one record or several.

    Attributes
    ----------
    statistic : float
        Ljung and Box's (1978) Q of the residuals, less what white noise plus a first-order autoregression explains,
        and McLeod and Li's (1983) of their squares, added up: the latter sees misfit that gathers at some times.
    degrees : int
        Of freedom of its chi-squared distribution, which is also its mean if there is no structure.
    """

    statistic: float
    degrees: int

    @property
    def p(self) -> float:
        """Probability that noise alone makes the statistic as large."""
        from scipy.stats import chi2

        return float(chi2.sf(self.statistic, self.degrees)) if self.degrees else 1.0


def whiteness(residuals: Iterable[Array]) -> Whiteness:
    """Test the residuals (n,) of each record."""
    statistic, degrees = 0.0, 0
    for own in residuals:
        lags, left = min(LAGS, len(own) // 10), _innovations(own)
        if lags > 1 and np.ptp(left) > 0:
            statistic += _portmanteau(left, lags) + _portmanteau(left**2, lags)
            degrees += 2 * lags - 2  # two coefficients were fitted
    return Whiteness(statistic, degrees)


def _portmanteau(values: Array, lags: int) -> float:
    """Ljung and Box's statistic of values (n,): n (n + 2) Σ r²/(n - lag), with the autocorrelation r."""
    n, lag = len(values), np.arange(1, lags + 1)
    return float(n * (n + 2) * np.sum(autocorrelation(values, lags)[1:] ** 2 / (n - lag)))


def _innovations(residuals: Array) -> Array:
    """Residuals (n,) less their prediction by white noise plus a first-order autoregression.

    The sum of the two is an ARMA(1, 1) process, whose coefficients make the innovations least.
    """
    from scipy.optimize import minimize
    from scipy.signal import lfilter

    r: Array = residuals - residuals.mean()
    size = float(r @ r)
    if not size > 0:
        return r

    def left(x: Array) -> Array:
        decay, average = np.tanh(x)
        return np.asarray(lfilter([1.0, -decay], [1.0, -average], r))

    ends = (
        minimize(lambda x: float(left(x) @ left(x)) / size, np.arctanh(start), method="Nelder-Mead",
                 options={"xatol": 1e-3, "fatol": 1e-6})
        for start in STARTS
    )  # fmt: skip
    best: Array = min(ends, key=lambda end: float(end.fun)).x
    return left(best)
