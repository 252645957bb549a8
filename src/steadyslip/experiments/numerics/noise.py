"""Autocorrelation of residuals, its effect on the errors of a fit, and a test of residuals for structure.

Residuals of real records are correlated from sample to sample (machine, drift, filters), which makes errors that
take them for independent several times too small. Their autocovariance is described by an autoregressive process.
"""

from __future__ import annotations

import hashlib
import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np
from scipy.linalg import matmul_toeplitz, solve_toeplitz

from steadyslip.core.arrays import Array
from steadyslip.core.results import ReadOnly

SIGNIFICANT = 4.0  # lag-1 autocorrelation, in standard errors of that of white noise, that is not by chance
NOTICED, NOTICED_CHANCE = 1.0, 0.05
"""The same (only above 0: slow noise adds up), and probability of correlation over all lags, from which noise is
described as correlated. Rms z of 150 linear fits of 600 samples: .98 to 1.05 for white noise, 1.12 with slow noise of a
quarter of its size, 1.28 at 2 and .01."""
MAX_ORDER = 40  # largest order of the autoregression; above about a tenth of the samples it is not determined
LAGS = 20  # of tests for correlation, in samples; a tenth of the samples, if that is less
MIN_CHANCE = 1e-3  # probability of such a test below which innovations of the simple noise model are not white
STRUCTURE = 1e-3  # probability of the whiteness test below which residuals have structure
FIRST_GUESSES = ((0.5, 0.0), (0.9, 0.7), (0.98, 0.7), (0.0, 0.3))  # decay and average from which they are sought
LONGEST = 0.05  # correlation over a record that is sought at most: noise cannot be told from a level beyond
CURVATURE_STEP = 0.05  # of differences of the likelihood, in inverse hyperbolic tangents of decay and average
LEAST_CURVATURE = 0.25  # of their log-likelihood: where it is flatter they vary by 2, to where tanh hardly changes
FITTED_RANK = 1e-6  # singular values of derivatives, scaled, below which they are combinations of each other
VANISHED = 1e-30  # powers below it are taken as 0: they do not count, and denormal numbers are a hundred times slower
TAIL = 1e-4  # the autocovariance is continued until it is below this share of the variance

_RECENT: deque[tuple[bytes, Array]] = deque(maxlen=8)
"""Residuals and rows (a digest) that `first_order` was asked of last, and places found: a fit asks of many twice."""


@dataclass(frozen=True, eq=False)
class Noise(ReadOnly):
    """Autoregressive model of residuals.

    Attributes
    ----------
    lag1 : float
        Autocorrelation at lag 1 (one sample).
    correlated : bool
        True if the residuals are taken as correlated.
    coefficients : ndarray
        Coefficients of the autoregression, empty for white noise.
    innovation : float
        Variance of the white noise that drives the autoregression.
    covariance : ndarray
        Autocovariance at lags 0, 1, ... samples; its mean over all noise that is likely, not that of the likeliest.
    """

    lag1: float
    correlated: bool
    coefficients: Array
    innovation: float
    covariance: Array

    @property
    def inflation(self) -> float:
        """Number of correlated samples that carry as much information on slow changes as one independent sample."""
        slow = self.innovation / (1.0 - float(np.sum(self.coefficients))) ** 2  # spectral density at frequency 0
        return max(slow / float(self.covariance[0]), 1e-3)

    def variance_of_mean(self, count: int) -> float:
        """Variance of the mean over `count` samples in a row."""
        own = self.covariance[:count]
        worth = 2.0 * (1.0 - np.arange(len(own)) / count)
        worth[0] = 1.0
        return float(own @ worth) / count

    def spread(self, rows: Array) -> Array:
        """Product rows · C · rowsᵀ, (p, p), for rows (p, n); C is the covariance matrix (n, n) of the samples."""
        if not len(self.coefficients):
            return np.asarray(self.covariance[0] * rows @ rows.T)
        column = np.zeros(rows.shape[1])
        count = min(len(self.covariance), len(column))
        column[:count] = self.covariance[:count]
        return np.asarray(rows @ matmul_toeplitz(column, rows.T))

    def log_density(self, rows: Array) -> Array:
        """Logarithm of the probability density of each value of rows (m, n), given those before it in its row."""
        after = np.array(rows, dtype=float)
        variance = np.full(rows.shape[1], self.innovation)
        order = len(self.coefficients)
        for k, share in enumerate(self.coefficients, start=1):
            after[:, order:] -= share * rows[:, order - k : -k]
        variance[:order] = self.covariance[0]
        return np.asarray(-0.5 * (after**2 / variance + np.log(2 * np.pi * variance)))

    def drawn(self, many: int, count: int, generator: np.random.Generator) -> Array:
        """Random rows of this noise, (many, count)."""
        from scipy.signal import lfilter

        first = len(self.covariance) if len(self.coefficients) else 0  # by then the beginning is forgotten
        pushes = np.sqrt(self.innovation) * generator.standard_normal((many, first + count))
        return np.asarray(lfilter([1.0], np.concatenate([[1.0], -self.coefficients]), pushes)[:, first:])


def white(residuals: Array, free: int = 0) -> Noise:
    """Noise model that takes the residuals (n,) as independent, after `free` parameters were fitted to them."""
    variance = float(np.sum(residuals**2) / max(len(residuals) - free, 1))
    return Noise(lag_one(residuals), False, np.empty(0), variance, np.array([variance]))


def lasting(values: Array) -> float:
    """Lag-1 autocorrelation (0 to 0.99) of the noise in values (n,) that also vary slowly.

    It follows from differences over one and over two samples: noise whose correlation falls as ρ**lag has
    differences of variance 2σ²(1 - ρ) and 2σ²(1 - ρ²).
    """
    one, two = (float(np.median(np.abs(values[k:] - values[:-k]))) for k in (1, 2))
    return float(np.clip((two / one) ** 2 - 1.0, 0.0, 0.99)) if one > 0 else 0.0


def lag_one(residuals: Array) -> float:
    """Autocorrelation of the residuals (n,) at lag 1."""
    return float(autocorrelation(residuals, 1)[1])


def autocorrelation(residuals: Array, most: int) -> Array:
    """Autocorrelation at lags 0, 1, ... `most`; zeros if all residuals are equal."""
    found = _products(residuals, most)
    return found / found[0] if found[0] > 0 else np.zeros(most + 1)


def _products(residuals: Array, most: int) -> Array:
    """Sums of the products of deviations from the mean, at lags 0, 1, ... `most`."""
    r = residuals - residuals.mean()
    return np.array([float(np.sum(r[h:] * r[: len(r) - h])) for h in range(most + 1)])


def portmanteau(values: Array, lags: int) -> float:
    """Ljung and Box's statistic of values (n,): n (n + 2) Σ r²/(n - lag), with the autocorrelation r."""
    n, lag = len(values), np.arange(1, lags + 1)
    return float(n * (n + 2) * np.sum(autocorrelation(values, lags)[1:] ** 2 / (n - lag)))


@dataclass(frozen=True)
class FirstOrder:
    """White noise plus a first-order autoregression, as ARMA(1, 1): r(t) - decay r(t-1) = e(t) - average e(t-1).

    Attributes
    ----------
    decay, average : float
    variance : float
        Of the innovations e.
    innovations : ndarray (n,)
    alternatives : tuple of (decay, average, variance)
        Other noise that may have made the residuals, whose mean is that over what is likely.
    """

    decay: float
    average: float
    variance: float
    innovations: Array
    alternatives: tuple[tuple[float, float, float], ...] = ()

    @property
    def coefficients(self) -> Array:
        """Coefficients of the autoregression that is the same noise, until they are below `TAIL`."""
        first, theta = self.decay - self.average, self.average
        count = np.log(TAIL / abs(first)) / np.log(abs(theta)) if abs(first) > TAIL and theta else 0.0
        return np.asarray(first * theta ** np.arange(min(int(count) + 1, len(self.innovations) - 1)))

    def mean_covariance(self, n: int) -> Array:
        """Mean autocovariance of the alternatives; with the likeliest alone errors come out too small.

        Variances computed from few correlation times scatter, and the mean square of deviations over standard errors
        is the larger the more they do.
        """
        each = [replace(self, decay=d, average=a, variance=v).covariance(n) for d, a, v in self.alternatives]
        found = np.zeros(max(map(len, each)))
        for own in each:
            found[: len(own)] += own / len(each)
        return found

    def covariance(self, n: int) -> Array:
        """Autocovariance at lags 0, 1, ..., until it is below `TAIL`."""
        phi, theta = self.decay, self.average
        first = np.array([1 + theta**2 - 2 * phi * theta, (1 - phi * theta) * (phi - theta)]) / (1 - phi**2)
        size = abs(first[1] / first[0])
        least = np.log(TAIL / size) / np.log(abs(phi)) if size > TAIL and phi else 0.0
        lags = np.arange(min(n, int(least) + 2) - 1)
        return np.asarray(self.variance * np.concatenate([first[:1], first[1] * phi**lags]))


def first_order(residuals: Array, rows: Array | None = None) -> FirstOrder:
    """Fit white noise plus a first-order autoregression to residuals (n,) by restricted maximum likelihood.

    `rows`, (p, n), are the derivatives in parameters that were fitted to the record: these took slow noise out of the
    residuals, which the restricted likelihood (Patterson & Thompson 1971) allows for. What the autoregression was
    before the first sample is one parameter more.
    """
    from scipy.linalg.lapack import dpotrf
    from scipy.optimize import minimize
    from scipy.signal import lfilter

    n = len(residuals)
    space = np.ones((1, n)) if rows is None else rows[np.any(rows != 0, axis=1)]
    _, sizes, space = np.linalg.svd(space / np.linalg.norm(space, axis=1, keepdims=True), full_matrices=False)
    stack = np.concatenate([space[sizes > FITTED_RANK * sizes[0]], np.zeros((1, n)), residuals[None]])
    freedom, limit = n - len(stack) + 1, LONGEST ** (1 / n)

    def left(x: Array) -> tuple[float, float, float, Array, float]:
        """Decay, average, variance and innovations at a place, and minus twice the log-likelihood."""
        decay, average = limit * math.tanh(x[0]), limit * math.tanh(x[1])
        through = lfilter([1.0, -decay], [1.0, -average], stack, axis=1)
        seen = n if abs(average) > VANISHED ** (1 / n) else max(math.ceil(math.log(VANISHED, abs(average) or 0.1)), 1)
        through[-2, 0], through[-2, 1:seen], through[-2, seen:] = 1.0, average, 0.0
        np.multiply.accumulate(through[-2, :seen], out=through[-2, :seen])
        root, singular = dpotrf(through @ through.T, lower=1)
        if singular:
            return decay, average, np.inf, through[-1], np.inf
        *fitted, size = root.diagonal().tolist()
        variance = max(size**2, 1e-300) / freedom
        return decay, average, variance, through[-1], freedom * math.log(variance) + 2 * sum(map(math.log, fitted))

    asked = hashlib.blake2b(residuals.tobytes() + (b"" if rows is None else rows.tobytes())).digest()
    best = next((place for key, place in tuple(_RECENT) if key == asked), None)
    if best is None:
        begin = min((np.arctanh(start) for start in FIRST_GUESSES), key=lambda x: left(x)[4])
        best = minimize(lambda x: left(x)[4], begin, method="Nelder-Mead", options={"xatol": 1e-2, "fatol": 1e-3}).x
        _RECENT.append((asked, best))
    decay, average, variance, innovations, _ = left(best)
    others = tuple(left(x)[:3] for x in _likely(lambda x: left(x)[4], best)) if rows is not None else ()
    return FirstOrder(decay, average, variance, innovations, others)


def _likely(deviance: Callable[[Array], float], best: Array) -> list[Array]:
    """Places whose mean is that over a normal distribution: minus twice its log-density is `deviance`, least at `best`.

    Two to each side along its axes, the rule of third degree (Stroud 1957).
    """
    count, steps, middle = len(best), CURVATURE_STEP * np.eye(len(best)), deviance(best)

    def mixed(i: int, j: int) -> float:
        ends = [best + a * (steps[i] + b * steps[j]) for b in (1, -1) for a in (1, -1)]
        one, other, *turned = [middle if np.array_equal(at, best) else deviance(at) for at in ends]
        return (one + other - sum(turned)) / (4 * CURVATURE_STEP**2)

    curvature = np.empty((count, count))
    for i, j in combinations_with_replacement(range(count), 2):
        curvature[i, j] = curvature[j, i] = 0.5 * mixed(i, j)
    sizes, axes = np.linalg.eigh(curvature)
    ways = axes * np.sqrt(count / np.maximum(sizes, LEAST_CURVATURE))
    return [best + sign * way for way in ways.T for sign in (1, -1)]


def describe(residuals: Array, free: int = 0, always: bool = False, rows: Array | None = None) -> Noise:
    """Describe the noise in residuals: white, white plus a first-order autoregression, or an autoregression.

    The last, whose order is Akaike's, is for residuals in which the second leaves correlation.

    Parameters
    ----------
    residuals : ndarray (n,)
    free : int
        Number of parameters that were fitted to the record.
    always : bool
        Take the residuals as correlated even if neither lag 1 nor all lags together show it.
    rows : ndarray (p, n), optional
        Derivatives in these parameters.
    """
    from scipy.stats import chi2

    n = len(residuals)
    lag1 = lag_one(residuals)
    lags = min(LAGS, n // 10) if np.ptp(residuals) > 0 else 0
    slow = lags > 2 and chi2.sf(portmanteau(residuals, lags), lags) < NOTICED_CHANCE
    if not (always or slow or lag1 > NOTICED / np.sqrt(n)):
        return white(residuals, free)
    if lags > 2:
        simple = first_order(residuals, rows)
        if chi2.sf(portmanteau(simple.innovations, lags), lags - 2) > MIN_CHANCE:
            covariance = simple.covariance(n) if rows is None else simple.mean_covariance(n)
            return Noise(lag1, True, simple.coefficients, simple.variance, covariance)
    most = min(MAX_ORDER, n // 10)
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
    """Autocovariance of an autoregression with coefficients `phi`, continued until it has fallen below `TAIL`."""
    found = list(gamma[: len(phi) + 1])
    limit = TAIL * gamma[0]
    while len(found) < n and np.max(np.abs(found[-len(phi) :])) > limit:
        found.append(float(phi @ np.array(found[-1 : -len(phi) - 1 : -1])))
    return np.array(found)


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
    """Whiteness of the residuals (n,) of all records: portmanteau statistic and its degrees of freedom."""
    statistic, degrees = 0.0, 0
    for own in residuals:
        lags = min(LAGS, len(own) // 10)
        if lags > 1 and np.ptp(own) > 0:
            left = min((own, first_order(own).innovations), key=lambda one: portmanteau(one, lags))
            statistic += portmanteau(left, lags) + portmanteau(left**2, lags)
            degrees += 2 * lags - 2  # two coefficients were fitted
    return Whiteness(statistic, degrees)
