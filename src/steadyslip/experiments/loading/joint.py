"""Joint fit of all changes of rate of a displacement: lines, times, and the servo that follows the command.

The displacement is c + v₀ t + Σ Δvᵢ S(t − tᵢ) + levels of the sensor, where S is the travel after a unit step of the
rate: at once, along a straight ramp, or late (`steadyslip.experiments.loading.servo`). Lines that are fitted to the
samples between changes alone take parts of a slow response for rates and levels; a joint fit does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.loading import Pieces
from steadyslip.experiments.loading.servo import DAMPINGS, late_response

OUTLIER = 3.0  # standard deviations from which a sample weighs less
ROUNDS = 3  # of weights for one linear fit, which is but a start
EVALUATIONS = 40  # most of one nonlinear fit; 10 to 20 are usual
LAGS = 12  # lags from which a search starts, in geometric progression
MOST = 0.9  # share of the deviations from steps that the first, coarse fit of a servo takes for noise
REFINED = 10.0  # factor by which the noise is made smaller from fit to fit
OUTSIDE = 1e9  # deviation of all samples, in standard deviations, where a change leaves the record: no step goes there
CHANGED = 1e-4  # relative step of lag and damping in numerical derivatives: errors of 1e-8, rounding of 1e-12


_Responses = Callable[[Array, Array], tuple[Array, Array]]
"""From times and nonlinear parameters to travel (s) and rate share after unit steps, each (n, changes)."""
_Found = tuple[Array, Array, Array, float, Array]
"""Nonlinear and linear parameters, deviations, misfit, covariance of the response's parameters."""


Shape = tuple[Array, list[Array]]
"""Rates (changes + 1,), m/s, and shares of each change in its pieces."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Joint fit of a displacement.

    Attributes
    ----------
    rates : ndarray (changes + 1,)
        m/s.
    times : ndarray (changes,)
        Of the commands, s.
    lag, damping : float
        Of the servo (s, 1); 0 without one.
    levels : sequence of float
        Times at which the level of the sensor changes, s.
    predicted : callable
        Displacement (m) at given times (s).
    deviations : ndarray (n,)
        Measured less fitted displacement, in standard deviations of the noise.
    misfit : float
        Sum of squared deviations, in which large ones count less.
    covariance : ndarray (2, 2)
        Of the logarithms of lag and damping, for white noise unless `widened`; empty without a servo.
    pieces : tuple
        Straight ramps of each change, if they were fitted: begin after its time (s), duration (s), share of the change.
    shapes : sequence of Shape
        Rates and shares one standard deviation from those of the pieces, in independent directions.
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
        """The same fit, in noise of so many samples per independent sample."""
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
        """Lag and damping one standard deviation away along each axis of their covariance, a factor of 2 at most."""
        variances, axes = np.linalg.eigh(self.covariance)
        steps = (axes * np.sqrt(np.maximum(variances, 0.0))).T
        steps *= np.minimum(1.0, np.log(2) / np.maximum(np.max(np.abs(steps), axis=1, keepdims=True), 1e-300))
        return tuple((self.lag * float(np.exp(a)), self.damping * float(np.exp(b))) for a, b in steps)


@dataclass(frozen=True, eq=False)
class SensorSamples:
    """Displacement to be fitted: times from the first (s), values (m), samples that each stands for; noise (m).

    `levels` (s) are times at which the level of the sensor changes.
    """

    time: Array
    values: Array
    worth: Array
    noise: float
    levels: Sequence[float] = ()

    @property
    def scale(self) -> Array:
        """Standard deviation of each value."""
        return np.asarray(self.noise / np.sqrt(self.worth))


def fit_at_once(samples: SensorSamples, times: Array, durations: Array) -> JointFit:
    """Fit steps, or straight ramps of given durations (s), with free times."""
    spread = np.maximum(durations, 1e-12 * (1 + np.abs(times)))

    def responses(t: Array, x: Array) -> tuple[Array, Array]:
        return ramp_responses(t, x - 0.5 * spread, spread)

    return _joint_fit(samples, _fitted(samples, times, responses), responses, len(times), 0.0, 0.0, 0.5 * spread)


def fit_servo(samples: SensorSamples, step: JointFit, shortest: float, longest: float, gain: float) -> JointFit | None:
    """Fit steps that one servo follows late; None where that cannot be better than steps by `gain`.

    Parameters
    ----------
    samples : SensorSamples
    step : JointFit
        Of steps at once to the same samples.
    shortest, longest : float
        Range of lags from which the search starts, s; it may end at a fifth of the shortest.
    gain : float
        Decrease of the misfit below which no servo is looked for.
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
    """Fit of `count` changes, whose commands are `earlier` (s) than the times that were fitted."""
    x, linear, deviations, size, covariance = found

    def predicted(time: Array) -> Array:
        return np.asarray(joint_columns(replace(samples, time=time), responses(time, x)[0]) @ linear)

    rates = linear[1] + np.concatenate([[0.0], np.cumsum(linear[2 : 2 + count])])
    return JointFit(rates, x[:count] - earlier, samples.levels, lag, damping, predicted, deviations, size, covariance)


def _coarser(samples: SensorSamples, deviations: Array) -> SensorSamples:
    """The same with so much noise that nearly all deviations from steps are within it: a misfit without far minima."""
    size = float(np.quantile(np.abs(deviations), MOST)) / OUTLIER
    return replace(samples, noise=samples.noise * max(size, 1.0))


def _refined(noisy: SensorSamples, samples: SensorSamples) -> Iterator[SensorSamples]:
    """SensorSamples with less and less noise, by powers of ten, down to their own."""
    noise = noisy.noise
    while noise > samples.noise * REFINED:
        yield replace(samples, noise=noise)
        noise /= REFINED
    yield samples


def _starts(
    samples: SensorSamples, step: JointFit, shortest: float, longest: float
) -> list[tuple[float, float, float]]:
    """Gain over steps, lag and damping of servos, from the share of each that fits what steps leave best."""
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
    """Travel (s) and rate share after unit steps at once, each (n, changes)."""
    since = np.maximum(t[:, None] - times, 0.0)
    return since, (since > 0) * 1.0


def ramp_responses(t: Array, begins: Array, durations: Array) -> tuple[Array, Array]:
    """Travel (s) and rate share after unit ramps, each (n, ramps)."""
    since = t[:, None] - begins
    share = np.clip(since / durations, 0.0, 1.0)
    return np.where(share < 1, 0.5 * share * since, since - 0.5 * durations), share


def joint_columns(samples: SensorSamples, moved: Array) -> Array:
    """Columns (n, p) of the linear fit: level, time, travel after each change, levels of the sensor."""
    t = samples.time
    levels = t[:, None] >= np.asarray(samples.levels, dtype=float)[None, :]
    return np.asarray(np.column_stack([np.ones(len(t)), t, moved, levels]))


def _linear(samples: SensorSamples, moved: Array) -> tuple[Array, Array, float]:
    """Robust linear fit: coefficients, deviations in standard deviations, misfit."""
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
    """Sum of squared deviations, in which large ones count less."""
    return float(OUTLIER**2 * np.sum(np.log1p((deviations / OUTLIER) ** 2)))


def _fitted(samples: SensorSamples, start: Array, responses: _Responses, extra: int = 0) -> _Found:
    """Robust nonlinear fit of times and, the last `extra` of `start`, of the response."""
    count, inside = len(start) - extra, samples.time[[1, -2]]  # beyond, a change would have no effect
    start = np.append(np.clip(start[:count], *inside), start[count:])
    known: list[tuple[Array, Array, Array, Array]] = []  # slopes are asked for where residuals were

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
