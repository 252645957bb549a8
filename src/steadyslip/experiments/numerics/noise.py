"""Residuals that remember each other: how much, and what that does to the errors of a fit.

Residuals of real records are correlated from sample to sample (machine, drift, filters), which makes errors that
take them for independent several times too small. Their autocovariance is described by an autoregressive process.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import matmul_toeplitz, solve_toeplitz

from steadyslip.core.arrays import Array
from steadyslip.core.results import ReadOnly

DETECTED = 4.0  # lag-1 autocorrelation, in standard errors of that of white noise
MOST_LAGS = 40
TAIL = 1e-4  # of the variance: autocovariance is followed until it has fallen below


@dataclass(frozen=True, eq=False)
class Noise(ReadOnly):
    """Autoregressive description of residuals.

    Attributes
    ----------
    lag1 : float
        Autocorrelation from one sample to the next.
    correlated : bool
        Whether that is more than chance.
    coefficients : ndarray
        Of the autoregression, empty for white noise.
    innovation : float
        Variance of what is new in each sample.
    covariance : ndarray
        Autocovariance at lags 0, 1, ...
    """

    lag1: float
    correlated: bool
    coefficients: Array
    innovation: float
    covariance: Array

    @property
    def inflation(self) -> float:
        """How many correlated samples are worth one independent one, for slow changes."""
        total = self.covariance[0] + 2 * float(np.sum(self.covariance[1:]))
        return max(float(total / self.covariance[0]), 1e-3)

    def spread(self, rows: Array) -> Array:
        """rows · C · rowsᵀ with C the covariance of all samples, for rows (p, n)."""
        if not len(self.coefficients):
            return np.asarray(self.covariance[0] * rows @ rows.T)
        column = np.zeros(rows.shape[1])
        count = min(len(self.covariance), len(column))
        column[:count] = self.covariance[:count]
        return np.asarray(rows @ matmul_toeplitz(column, rows.T))


def white(residuals: Array, free: int = 0) -> Noise:
    """Residuals taken as independent."""
    variance = float(np.sum(residuals**2) / max(len(residuals) - free, 1))
    return Noise(lag_one(residuals), False, np.empty(0), variance, np.array([variance]))


def lasting(values: Array) -> float:
    """Correlation of the noise of neighbouring samples on top of anything slow, 0 to .99.

    Told from differences over one and over two samples: noise whose correlation falls as ρ**lag has
    differences of variance 2σ²(1 - ρ) and 2σ²(1 - ρ²).
    """
    one, two = (float(np.median(np.abs(values[k:] - values[:-k]))) for k in (1, 2))
    return float(np.clip((two / one) ** 2 - 1.0, 0.0, 0.99)) if one > 0 else 0.0


def lag_one(residuals: Array) -> float:
    """Autocorrelation from one sample to the next."""
    return float(autocorrelation(residuals, 1)[1])


def autocorrelation(residuals: Array, most: int) -> Array:
    """Autocorrelation at lags 0, 1, ... `most`; zero of residuals that are all the same."""
    found = _products(residuals, most)
    return found / found[0] if found[0] > 0 else np.zeros(most + 1)


def _products(residuals: Array, most: int) -> Array:
    """Sums of the products of deviations from the mean, at lags 0, 1, ... `most`."""
    r = residuals - residuals.mean()
    return np.array([float(np.sum(r[h:] * r[: len(r) - h])) for h in range(most + 1)])


def describe(residuals: Array, free: int = 0, always: bool = False) -> Noise:
    """Autoregression of residuals, its order by Akaike's criterion; white noise unless correlation stands out.

    Parameters
    ----------
    residuals : ndarray (n,)
    free : int
        Parameters that were fitted to them.
    always : bool
        Take them as correlated whether that stands out or not.
    """
    n = len(residuals)
    lag1 = lag_one(residuals)
    if not always and abs(lag1) < DETECTED / np.sqrt(n):
        return white(residuals, free)
    most = min(MOST_LAGS, n // 10)
    gamma = _products(residuals, most) / max(n - free, 1)
    if not gamma[0] > 0:
        return white(residuals, free)
    best = (np.inf, np.empty(0), gamma[0])
    for order in range(1, most + 1):
        phi = solve_toeplitz(gamma[:order], gamma[1 : order + 1])
        variance = float(gamma[0] - phi @ gamma[1 : order + 1])
        if variance <= 0:
            break
        criterion = n * np.log(variance) + 2 * order
        if criterion < best[0]:
            best = (criterion, phi, variance)
    _, phi, variance = best
    return Noise(lag1, True, phi, variance, _covariance(gamma, phi, n))


def _covariance(gamma: Array, phi: Array, n: int) -> Array:
    """Autocovariance of an autoregression, continued until it has died away."""
    found = list(gamma[: len(phi) + 1])
    limit = TAIL * gamma[0]
    while len(found) < n and np.max(np.abs(found[-len(phi) :])) > limit:
        found.append(float(phi @ np.array(found[-1 : -len(phi) - 1 : -1])))
    return np.array(found)
