"""Autocorrelation of residuals, its effect on the errors of a fit, and a test of residuals for structure.

Residuals of real records are correlated from sample to sample (machine, drift, filters). Errors computed for
independent residuals would be several times too small. The autocovariance is described by an autoregressive process.
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

SIGNIFICANT = 4.0  # a larger lag-1 autocorrelation, in standard errors for white noise, is not due to chance
NOTICED, NOTICED_CHANCE = 1.0, 0.05
"""Noise counts as correlated if its lag-1 autocorrelation exceeds the first number (standard errors of white noise), or
if white noise would have its correlation over all lags with a smaller probability than the second number. With these
limits, the root mean square of deviation over error in 150 linear fits of 600 samples was 0.98 to 1.05 for white noise,
and 1.12 if slow noise of a quarter of its size was added; with limits of 2 and 0.01 it was 1.28."""
MAX_ORDER = 40  # largest order of the autoregression; above about a tenth of the samples it is not determined
LAGS = 20  # largest number of lags in tests for correlation; in short records, a tenth of the number of samples
MIN_CHANCE = 1e-3  # if a test for correlation gives a smaller probability, the simple noise model is not sufficient
STRUCTURE = 1e-3  # residuals have structure if the whiteness test gives a smaller probability
JUMP = 10.0
"""A larger innovation, in robust standard deviations of the innovations, is no noise. In 30 fits to noisy records no
innovation was beyond 4.6; in a fit whose model missed a slip event the largest was 657."""
JUMPED = 5  # a jump has at least this many residuals above the limit: a single one is a faulty sample
JUMP_SHARE = 0.02  # smallest such limit, as a share of the range of the data: residuals of exact data are rounding
FIRST_GUESSES = ((0.5, 0.0), (0.9, 0.7), (0.98, 0.7), (0.0, 0.3))  # candidates for the starting decay and average
LONGEST = 0.05  # largest correlation of noise between the ends of a record: slower noise looks like a constant
CURVATURE_STEP = 0.05  # step of finite differences of the likelihood, in artanh of decay and average
LEAST_CURVATURE = 0.25  # least curvature of the likelihood: limits standard deviations to 2, beyond which tanh is flat
MEDIAN_DEVIATION = 0.6745  # median of absolute deviations of Gaussian noise, in standard deviations
FITTED_RANK = 1e-6  # derivatives count as linearly dependent below this ratio of singular values to the largest
VANISHED = 1e-30  # smaller powers are set to 0: they have no effect, and denormal numbers are a hundred times slower
TAIL = 1e-4  # the autocovariance is continued until it is below this share of the variance

_RECENT: deque[tuple[bytes, Array]] = deque(maxlen=8)
"""Digests of the arguments of recent calls of `first_order`, and their optima: a fit describes most residuals twice."""


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
        Autocovariance at lags 0, 1, ... samples, averaged over all likely parameters of the noise.
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
        """Product rows · C · rowsᵀ (p, p) for rows (p, n), with the covariance matrix C (n, n) of the samples."""
        if not len(self.coefficients):
            return np.asarray(self.covariance[0] * rows @ rows.T)
        column = np.zeros(rows.shape[1])
        count = min(len(self.covariance), len(column))
        column[:count] = self.covariance[:count]
        return np.asarray(rows @ matmul_toeplitz(column, rows.T))

    def log_density(self, rows: Array) -> Array:
        """Logarithm (m, n) of the probability density of each value in rows (m, n), given the values before it."""
        after = np.array(rows, dtype=float)
        variance = np.full(rows.shape[1], self.innovation)
        order = len(self.coefficients)
        for k, share in enumerate(self.coefficients, start=1):
            after[:, order:] -= share * rows[:, order - k : -k]
        variance[:order] = self.covariance[0]
        return np.asarray(-0.5 * (after**2 / variance + np.log(2 * np.pi * variance)))

    def drawn(self, many: int, count: int, generator: np.random.Generator) -> Array:
        """Simulated noise (many, count): `many` independent series of `count` samples."""
        from scipy.signal import lfilter

        first = len(self.covariance) if len(self.coefficients) else 0  # discarded: the filter starts from zero
        pushes = np.sqrt(self.innovation) * generator.standard_normal((many, first + count))
        return np.asarray(lfilter([1.0], np.concatenate([[1.0], -self.coefficients]), pushes)[:, first:])


def white(residuals: Array, free: int = 0) -> Noise:
    """Noise model of independent residuals (n,), after a fit of `free` parameters."""
    variance = float(np.sum(residuals**2) / max(len(residuals) - free, 1))
    return Noise(lag_one(residuals), False, np.empty(0), variance, np.array([variance]))


def lasting(values: Array) -> float:
    """Lag-1 autocorrelation (0 to 0.99) of the noise in values (n,) that also vary slowly.

    It is computed from differences over one and over two samples, which have the variances 2σ²(1 - ρ) and 2σ²(1 - ρ²)
    for noise with correlation ρ**lag.
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
    """Ljung and Box's statistic of values (n,): n (n + 2) Σ r²/(n - lag), with the autocorrelation r at each lag."""
    n, lag = len(values), np.arange(1, lags + 1)
    return float(n * (n + 2) * np.sum(autocorrelation(values, lags)[1:] ** 2 / (n - lag)))


@dataclass(frozen=True)
class FirstOrder:
    """White noise plus a first-order autoregression, as ARMA(1, 1): r(t) - decay r(t-1) = e(t) - average e(t-1).

    Attributes
    ----------
    decay, average : float
    variance : float
        Variance of the innovations e.
    innovations : ndarray (n,)
    alternatives : tuple of (decay, average, variance)
        Other likely parameters; averages over them approximate averages over the likelihood.
    """

    decay: float
    average: float
    variance: float
    innovations: Array
    alternatives: tuple[tuple[float, float, float], ...] = ()

    @property
    def coefficients(self) -> Array:
        """Coefficients of the equivalent autoregression, of lag 1, 2, ... until they are below `TAIL`."""
        first, theta = self.decay - self.average, self.average
        count = np.log(TAIL / abs(first)) / np.log(abs(theta)) if abs(first) > TAIL and theta else 0.0
        return np.asarray(first * theta ** np.arange(min(int(count) + 1, len(self.innovations) - 1)))

    def mean_covariance(self, n: int) -> Array:
        """Autocovariance at lags 0, 1, ..., averaged over `alternatives`; up to `n` lags.

        If a record is only a few correlation times long, it determines the variance of the noise poorly, and errors
        computed with the best parameters would be too small.
        """
        each = [replace(self, decay=d, average=a, variance=v).covariance(n) for d, a, v in self.alternatives]
        found = np.zeros(max(map(len, each)))
        for own in each:
            found[: len(own)] += own / len(each)
        return found

    def covariance(self, n: int) -> Array:
        """Autocovariance at lags 0, 1, ..., up to `n` lags or until it is below `TAIL`."""
        phi, theta = self.decay, self.average
        first = np.array([1 + theta**2 - 2 * phi * theta, (1 - phi * theta) * (phi - theta)]) / (1 - phi**2)
        size = abs(first[1] / first[0])
        least = np.log(TAIL / size) / np.log(abs(phi)) if size > TAIL and phi else 0.0
        lags = np.arange(min(n, int(least) + 2) - 1)
        return np.asarray(self.variance * np.concatenate([first[:1], first[1] * phi**lags]))


def first_order(residuals: Array, rows: Array | None = None) -> FirstOrder:
    """White noise plus a first-order autoregression, fitted to residuals (n,) by restricted maximum likelihood.

    `rows` (p, n) are the derivatives of the model by the parameters that were fitted to the record. That fit removed
    slow noise from the residuals, which the restricted likelihood (Patterson & Thompson 1971) takes into account. The
    value of the autoregression before the first sample is a further parameter.
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
        """Decay, average, variance and innovations at `x` (artanh of decay and average); minus twice log-likelihood."""
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
    """Points of a cubature rule for a normal distribution: averages over them are averages over the distribution.

    Minus twice the log-density is `deviance`, approximated by a parabola at its minimum `best`. There are two points on
    each axis of the distribution, one on either side (rule of third degree, Stroud 1957).
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
    """Noise model of residuals: white, white plus a first-order autoregression, or an autoregression.

    A general autoregression, whose order minimises Akaike's criterion, is used only if the second model leaves
    correlation.

    Parameters
    ----------
    residuals : ndarray (n,)
    free : int
        Number of parameters that were fitted to the record.
    always : bool
        True to treat the residuals as correlated even if no test finds a correlation.
    rows : ndarray (p, n), optional
        Derivatives of the model by the fitted parameters.
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
    """Autocovariance of an autoregression: `gamma` at the first lags, then from coefficients `phi` down to `TAIL`."""
    found = list(gamma[: len(phi) + 1])
    limit = TAIL * gamma[0]
    while len(found) < n and np.max(np.abs(found[-len(phi) :])) > limit:
        found.append(float(phi @ np.array(found[-1 : -len(phi) - 1 : -1])))
    return np.array(found)


@dataclass(frozen=True)
class Whiteness:
    """Result of the test for structure in the residuals of one record or several.

    Attributes
    ----------
    statistic : float
        Ljung and Box's (1978) Q of the innovations of white noise plus a first-order autoregression, plus McLeod and
        Li's (1983) Q of the squared innovations, which shows misfit that is concentrated at some times.
    degrees : int
        Degrees of freedom of the chi-squared distribution that the statistic has if there is no structure.
    """

    statistic: float
    degrees: int

    @property
    def p(self) -> float:
        """Probability that noise alone makes the statistic at least as large."""
        from scipy.stats import chi2

        return float(chi2.sf(self.statistic, self.degrees)) if self.degrees else 1.0


def largest_jump(residuals: Array, data: Array) -> float:
    """Largest innovation of residuals (n,) in robust standard deviations of the innovations, if it is no noise; else 0.

    A portmanteau test misses a sudden slip that the model does not follow, because the few large innovations at the
    slip dominate the variance by which the test divides.
    """
    innovations = first_order(residuals).innovations if len(residuals) > JUMPED else np.zeros(1)
    noise = float(np.median(np.abs(innovations - np.median(innovations)))) / MEDIAN_DEVIATION
    furthest = float(np.max(np.abs(innovations)))
    limit = max(JUMP * noise, JUMP_SHARE * float(np.ptp(data)))
    if furthest <= JUMP * noise or np.sum(np.abs(residuals) > limit) < JUMPED:
        return 0.0
    return furthest / max(noise, 1e-300)


def whiteness(residuals: Iterable[Array]) -> Whiteness:
    """Test for structure in the residuals (n,) of all records: portmanteau statistic and its degrees of freedom."""
    statistic, degrees = 0.0, 0
    for own in residuals:
        lags = min(LAGS, len(own) // 10)
        if lags > 1 and np.ptp(own) > 0:
            left = min((own, first_order(own).innovations), key=lambda one: portmanteau(one, lags))
            statistic += portmanteau(left, lags) + portmanteau(left**2, lags)
            degrees += 2 * lags - 2  # two coefficients of the noise model were fitted
    return Whiteness(statistic, degrees)
