"""Joint fit of all changes of rate of a displacement: rates, times, and the response of the servo to its command.

The displacement is c + v₀ t + Σ Δvᵢ S(t − tᵢ) + levels of the sensor. S is the travel after a unit change of the rate:
a step, a straight ramp, or the late response of a servo (`steadyslip.experiments.loading.servo`). If lines were fitted
only to the samples between changes, parts of a slow response would be taken for rates and levels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.loading import Pieces
from steadyslip.experiments.loading.servo import DAMPINGS, late_response

OUTLIER = 3.0  # samples that deviate by more than this number of standard deviations get less weight
ROUNDS = 3  # times that a linear fit is repeated with new weights; few suffice, as it only gives a starting point
EVALUATIONS = 40  # largest number of evaluations of one nonlinear fit; 10 to 20 are usual
LAGS = 12  # number of lags from which a search starts, in geometric progression
MOST = 0.9  # share of the deviations from steps that the first, coarse fit of a servo treats as noise
REFINED = 10.0  # factor by which the assumed noise decreases from one fit to the next
OUTSIDE = 1e9  # deviation (standard deviations) given to all samples if a change leaves the record: the fit avoids it
CHANGED = 1e-4  # relative step of lag and damping in numerical derivatives: its error is 1e-8, that of rounding 1e-12


_Responses = Callable[[Array, Array], tuple[Array, Array]]
"""Function of times and nonlinear parameters that returns travel (s) and rate after unit steps, each (n, changes)."""
_Found = tuple[Array, Array, Array, float, Array]
"""Nonlinear and linear parameters, deviations, misfit, and covariance of lag and damping (empty without a servo)."""


Shape = tuple[Array, list[Array]]
"""Rates (changes + 1,) in m/s, and for each change the shares of it that its straight ramps make."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Joint fit of lines and changes of rate to a displacement.

    Attributes
    ----------
    rates : ndarray (changes + 1,)
        m/s.
    times : ndarray (changes,)
        Times of the commands, s.
    lag, damping : float
        Lag (s) and damping ratio of the servo; 0 without a servo.
    levels : sequence of float
        Times at which the level of the sensor changes, s.
    predicted : callable
        Displacement (m) at given times (s).
    deviations : ndarray (n,)
        Measured minus fitted displacement, in standard deviations of the noise.
    misfit : float
        Robust sum of squared deviations, see `misfit`.
    covariance : ndarray (2, 2)
        Covariance of the logarithms of lag and damping, for white noise unless `widened`; empty without a servo.
    pieces : tuple
        For each change its straight ramps, if they were fitted: begin after the time of the change (s), duration (s),
        share of the change.
    shapes : sequence of Shape
        Rates and shares of the ramps one standard deviation from the fit, in independent directions.
    """

    rates: Array
    times: Array
    levels: Sequence[float]
    lag: float
    damping: float
    predicted: Callable[[Array], Array]
    deviations: Array
    misfit: float
    covariance: Array
    pieces: tuple[Pieces, ...] = ()
    shapes: Sequence[Shape] = ()

    def widened(self, inflation: float) -> JointFit:
        """Copy with larger errors, for correlated noise that has `inflation` samples per independent sample."""
        wide = float(np.sqrt(inflation))
        own = [np.array([share for _, _, share in change]) for change in self.pieces]
        shapes = [
            (
                self.rates + wide * (rates - self.rates),
                [one + wide * (a - one) for one, a in zip(own, shares, strict=True)],
            )
            for rates, shares in self.shapes
        ]
        return replace(self, covariance=inflation * self.covariance, shapes=shapes)

    def others(self) -> tuple[tuple[float, float], ...]:
        """Lag and damping one standard deviation from the fit along each axis of their covariance.

        They differ from those of the fit by a factor of 2 at most.
        """
        variances, axes = np.linalg.eigh(self.covariance)
        steps = (axes * np.sqrt(np.maximum(variances, 0.0))).T
        steps *= np.minimum(1.0, np.log(2) / np.maximum(np.max(np.abs(steps), axis=1, keepdims=True), 1e-300))
        return tuple((self.lag * float(np.exp(a)), self.damping * float(np.exp(b))) for a, b in steps)


@dataclass(frozen=True, eq=False)
class SensorSamples:
    """Displacement to be fitted: measured samples, or means of neighbouring samples.

    Attributes
    ----------
    time : ndarray (n,)
        Time since the first sample, s.
    values : ndarray (n,)
        Displacement, m.
    worth : ndarray (n,)
        Number of samples of which each value is the mean.
    noise : float
        Standard deviation of a sample, m.
    levels : sequence of float
        Times at which the level of the sensor changes, s.
    """

    time: Array
    values: Array
    worth: Array
    noise: float
    levels: Sequence[float] = ()

    @property
    def scale(self) -> Array:
        """Standard deviation (n,) of each value, m."""
        return np.asarray(self.noise / np.sqrt(self.worth))


def fit_at_once(samples: SensorSamples, times: Array, durations: Array) -> JointFit:
    """Fit of steps, or straight ramps of given durations (s), with free times."""
    spread = np.maximum(durations, 1e-12 * (1 + np.abs(times)))

    def responses(t: Array, x: Array) -> tuple[Array, Array]:
        return ramp_responses(t, x - 0.5 * spread, spread)

    return _joint_fit(samples, _fitted(samples, times, responses), responses, len(times), 0.0, 0.0, 0.5 * spread)


def fit_servo(samples: SensorSamples, step: JointFit, shortest: float, longest: float, gain: float) -> JointFit | None:
    """Fit of steps to which one servo responds late; None if it cannot reduce the misfit of sudden steps by `gain`.

    Parameters
    ----------
    samples : SensorSamples
    step : JointFit
        Fit of sudden steps to the same samples.
    shortest, longest : float
        Range of lags from which the search starts, s; the fitted lag may be down to a fifth of the shortest.
    gain : float
        Decrease of the misfit below which a possible servo is not fitted.
    """
    noisy = _coarser(samples, step.deviations)
    starts = [one for one in _starts(noisy, step, shortest, longest) if one[0] > gain]
    low, high = np.log([0.2 * shortest, 0.1]), np.log([longest, 50.0])

    def responses(t: Array, x: Array) -> tuple[Array, Array]:
        lag, damping = np.exp(np.clip(x[-2:], low, high))
        return late_response(t[:, None] - (x[:-2] - lag), lag, damping)

    best: _Found | None = None
    for rings in (True, False):
        own = [one for one in starts if (one[2] < 1) == rings]
        if not own:
            continue
        _, lag, damping = max(own)
        x = np.append(step.times, np.log([lag, damping]))
        for one in _refined(noisy, samples):
            found = _fitted(one, x, responses, extra=2)
            x = found[0]
        best = found if best is None or found[3] < best[3] else best
    if best is None:
        return None
    lag, damping = np.exp(np.clip(best[0][-2:], low, high)).tolist()
    return _joint_fit(samples, best, responses, len(step.times), lag, damping, lag)


def _joint_fit(
    samples: SensorSamples, found: _Found, responses: _Responses, count: int, lag: float, damping: float,
    earlier: Array | float,
) -> JointFit:  # fmt: skip
    """JointFit of `count` changes, made from a result `found`; commands precede the fitted times by `earlier` (s)."""
    x, linear, deviations, size, covariance = found

    def predicted(time: Array) -> Array:
        return np.asarray(joint_columns(replace(samples, time=time), responses(time, x)[0]) @ linear)

    rates = linear[1] + np.concatenate([[0.0], np.cumsum(linear[2 : 2 + count])])
    return JointFit(rates, x[:count] - earlier, samples.levels, lag, damping, predicted, deviations, size, covariance)


def _coarser(samples: SensorSamples, deviations: Array) -> SensorSamples:
    """Samples with an assumed noise so large that it explains nearly all deviations from steps.

    With this noise, the misfit has no local minima far from the best minimum.
    """
    size = float(np.quantile(np.abs(deviations), MOST)) / OUTLIER
    return replace(samples, noise=samples.noise * max(size, 1.0))


def _refined(noisy: SensorSamples, samples: SensorSamples) -> Iterator[SensorSamples]:
    """Samples with the noise of `noisy`, then with ten times less and so on, last with the noise of `samples`."""
    noise = noisy.noise
    while noise > samples.noise * REFINED:
        yield replace(samples, noise=noise)
        noise /= REFINED
    yield samples


def _starts(
    samples: SensorSamples, step: JointFit, shortest: float, longest: float
) -> list[tuple[float, float, float]]:
    """Decrease of the misfit of steps, lag and damping of possible servos, each from a linear fit to the residuals."""
    t, jumps = samples.time, np.diff(step.rates)
    moved, share = _at_once(t, step.times)
    base = np.linalg.qr(np.hstack([joint_columns(samples, moved), share]) / samples.scale[:, None])[0]
    left = (samples.values - samples.values.mean()) / samples.scale
    left -= base @ (base.T @ left)
    found = []
    for lag in np.geomspace(shortest, longest, LAGS):
        for damping in DAMPINGS:
            late, _ = late_response(t[:, None] - (step.times - lag), lag, damping)
            beyond = (late - moved) @ jumps / samples.scale
            beyond -= base @ (base.T @ beyond)
            amount, size = float(beyond @ left), float(beyond @ beyond)
            if amount > 0 and size > 0:
                found.append((amount**2 / size, float(lag), damping))
    return found


def _at_once(t: Array, times: Array) -> tuple[Array, Array]:
    """Travel (s) and rate after sudden unit steps of the rate, each (n, changes)."""
    since = np.maximum(t[:, None] - times, 0.0)
    return since, (since > 0) * 1.0


def ramp_responses(t: Array, begins: Array, durations: Array) -> tuple[Array, Array]:
    """Travel (s) and rate after straight ramps of the rate from 0 to 1, each (n, ramps)."""
    since = t[:, None] - begins
    share = np.clip(since / durations, 0.0, 1.0)
    return np.where(share < 1, 0.5 * share * since, since - 0.5 * durations), share


def joint_columns(samples: SensorSamples, moved: Array) -> Array:
    """Regressors (n, p) of the linear fit: constant, time, travel `moved` after each change, levels of the sensor."""
    t = samples.time
    levels = t[:, None] >= np.asarray(samples.levels, dtype=float)[None, :]
    return np.asarray(np.column_stack([np.ones(len(t)), t, moved, levels]))


def _linear(samples: SensorSamples, moved: Array) -> tuple[Array, Array, float]:
    """Coefficients (p,), residuals (n,) in standard deviations, and misfit of a robust linear fit."""
    columns = joint_columns(samples, moved) / samples.scale[:, None]
    values, weight = samples.values / samples.scale, np.ones(len(samples.time))
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    columns /= size
    for _ in range(ROUNDS):
        heavy = columns * weight[:, None]
        found = np.linalg.lstsq(heavy.T @ columns, heavy.T @ values, rcond=1e-14)[0]
        off = values - columns @ found
        weight = 1 / (1 + (off / OUTLIER) ** 2)
    return found / size, off, misfit(off)


def misfit(deviations: Array) -> float:
    """Robust sum of squares of deviations (n,) in standard deviations; large ones count less (Cauchy loss)."""
    return float(OUTLIER**2 * np.sum(np.log1p((deviations / OUTLIER) ** 2)))


def _fitted(samples: SensorSamples, start: Array, responses: _Responses, extra: int = 0) -> _Found:
    """Robust nonlinear fit of the times and of the `extra` parameters of the response, which are last in `start`."""
    count, inside = len(start) - extra, samples.time[[1, -2]]  # outside these times, a change would have no effect
    start = np.append(np.clip(start[:count], *inside), start[count:])
    known: list[tuple[Array, Array, Array, Array]] = []  # last response, reused for derivatives at the same point

    def response(own: Array) -> tuple[Array, Array, Array]:
        if not known or not np.array_equal(own, known[0][0]):
            moved, share = responses(samples.time, own)
            known[:] = [(own.copy(), moved, share, joint_columns(samples, moved))]
        return known[0][1:]

    linear, _, _ = _linear(samples, response(start)[0])
    whole, fine = np.concatenate([start, linear]), samples.scale[:, None]

    def residuals(x: Array) -> Array:
        if np.any((x[:count] < inside[0]) | (x[:count] > inside[1])):
            return np.full(len(samples.time), OUTSIDE)
        return np.asarray((response(x[: len(start)])[2] @ x[len(start) :] - samples.values) / samples.scale)

    def slopes(x: Array) -> Array:
        own, coefficients = x[: len(start)], x[len(start) :]
        jumps = coefficients[2 : 2 + count]
        moved, share, columns = response(own)
        found = [-jumps * share]
        for k in range(count, count + extra):
            other = own.copy()
            other[k] += CHANGED
            ahead, _ = responses(samples.time, other)
            found.append(((ahead - moved) @ jumps / CHANGED)[:, None])
        return np.asarray(np.hstack([*found, columns]) / fine)

    done = least_squares(residuals, whole, slopes, x_scale="jac", loss="cauchy", f_scale=OUTLIER, max_nfev=EVALUATIONS)
    slope = slopes(done.x) / np.sqrt(1 + (done.fun / OUTLIER) ** 2)[:, None]
    size = np.maximum(np.linalg.norm(slope, axis=0), 1e-100)
    own = slice(count, count + extra)
    covariance = (np.linalg.pinv((slope / size).T @ (slope / size), hermitian=True) / np.outer(size, size))[own, own]
    return done.x[: len(start)], done.x[len(start) :], -done.fun, misfit(done.fun), covariance
