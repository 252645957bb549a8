"""How a load point follows its command: at once, along ramps, late by a servo, or in a way of its own.

Tested on the displacement around each change. SensorSamples far from changes are averaged, as they tell lines alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.joint import OUTLIER, JointFit, SensorSamples, fit_at_once, fit_servo
from steadyslip.experiments.loading.loading import is_slight
from steadyslip.experiments.loading.pieces import fit_pieces, is_beside
from steadyslip.experiments.loading.servo import GAIN, settling
from steadyslip.experiments.numerics.noise import describe

LONGEST_LAG = 0.2  # of a servo, as a share of the time around a change in which nothing else changes; chosen by trial
SPARED = 14.0  # decrease of chi squared by which a servo must fit better for each sensor level, or half a run, it saves
COARSE = 0.5  # share of the gain of a servo that the best of those where its search starts has, at least
AROUND = 3.0  # settling times of a servo that count as the neighbourhood of a change
NEAR = 30.0  # samples on each side of a change that are kept one by one
PER_EFOLD = 10.0  # means of the samples beyond, for each e-fold of their distance from the change; chosen by trial
LEFT = 4.0  # standard errors by which the mean misfit around a change may be above that of normal noise, which is 0.83
MOST_DESCRIBED = 4000  # samples from which correlation of the noise is found


@dataclass(frozen=True, eq=False)
class Kinks:
    """Changes of rate as lines between them show these.

    Attributes
    ----------
    meets : ndarray (changes,)
        Times at which lines before and after a change meet, s from the first sample.
    durations : ndarray (changes,)
        Of straight ramps (s), 0 for steps.
    levels : ndarray
        Times at which the level of the sensor seems to change, s from the first sample.
    reach : float
        Shortest time around a change in which nothing else changes, s.
    glitches : sequence of (float, float)
        Ends of glitches of the sensor within a line, s from the first sample.
    """

    meets: Array
    durations: Array
    levels: Array
    reach: float
    glitches: Sequence[tuple[float, float]] = ()

    def in_glitch(self, time: Array) -> Array:
        """True for times (n,) in a glitch of the sensor."""
        first, last = np.array(self.glitches).reshape(-1, 2).T
        return np.asarray(np.any((time[:, None] > first) & (time[:, None] < last), axis=1))

    @property
    def longest(self) -> float:
        """Longest lag of a servo that is looked for, s."""
        return LONGEST_LAG * self.reach

    def far_levels(self, spacing: float) -> Array:
        """Levels that are not within the longest lag after a change, where the response of a servo may seem one."""
        since = self.levels[:, None] - self.meets
        near = np.any((since >= -2 * spacing) & (since <= self.longest), axis=1)
        return np.asarray(self.levels[~near])


def followed(
    time: Array, values: Array, noise: float, ways: Sequence[Kinks], lasting: float = 1.0
) -> Iterator[JointFit]:
    """How a load point follows changes of its rate: at once or along ramps, or late by a servo if that fits better.

    Where its displacement is beside each of these, a fit in pieces that follow it comes second.

    Parameters
    ----------
    time, values : ndarray (n,)
        s from the first sample, m.
    noise : float
        Standard deviation, m.
    ways : sequence of Kinks
        All changes, then fewer and fewer: those that the response of a servo may have made are left out.
    lasting : float
        Samples per independent sample, at least: a servo must gain in proportion.
    """
    spacing = float(np.median(np.diff(time)))
    lines = ways[0]
    best = at_once = fit_at_once(
        _thinned(time, values, noise, lines, lines.levels, spacing), lines.meets, lines.durations
    )
    inflation, most = 0.0, GAIN
    for kinks in ways:
        levels = kinks.far_levels(spacing)
        samples = _thinned(time, values, noise, kinks, levels, spacing)
        steps = fit_at_once(samples, kinks.meets, np.zeros(len(kinks.meets)))
        spared = len(lines.levels) - len(levels) + 2 * (len(lines.meets) - len(kinks.meets))
        least = GAIN if spared else GAIN * max(COARSE * lasting, 1.0)
        servo = fit_servo(samples, steps, 0.1 * spacing, kinks.longest, least)
        if servo is None:
            break
        everywhere = np.append(servo.times, lines.meets)
        if not all(map(_is_noise, _off(servo, everywhere, time, values, noise, spacing))):
            continue
        inflation = inflation or _inflation(servo, time, values)
        gain = (at_once.misfit - servo.misfit) / inflation + spared * SPARED
        if gain > most:
            most, best = gain, servo.widened(inflation)
        if np.all(np.diff(servo.times) > settling(servo.lag, servo.damping)):
            break
    time, values = (column[~lines.in_glitch(time)] for column in (time, values))
    yield best
    if not is_beside(time, (values - best.predicted(time)) / noise, lines.meets):
        return
    slight = sum(map(is_slight, at_once.rates, at_once.rates[1:]))  # changes that the way of others may have made
    for kinks in reversed([one for one in ways if len(lines.meets) - len(one.meets) <= slight]):
        samples = _thinned(time, values, noise, kinks, kinks.far_levels(spacing), spacing)
        best = fit_pieces(samples, fit_at_once(samples, kinks.meets, np.zeros(len(kinks.meets))), spacing)
        if not is_beside(time, (values - best.predicted(time)) / noise, lines.meets):
            break
    yield best.widened(_inflation(best, time, values))


def _off(found: JointFit, at: Array, time: Array, values: Array, noise: float, spacing: float) -> list[Array]:
    """Deviations from a servo of the samples around each of the times `at` (s), in standard deviations of the noise."""
    length = AROUND * (settling(found.lag, found.damping) + spacing)
    around = [slice(*np.searchsorted(time, [one - length, one + length])) for one in at]
    return [(values[rows] - found.predicted(time[rows])) / noise for rows in around]


def _is_noise(off: Array) -> bool:
    """True for deviations whose mean misfit is that of noise."""
    count = max(len(off), 1)
    return bool(OUTLIER**2 * np.sum(np.log1p((off / OUTLIER) ** 2)) / count <= 1 + LEFT / np.sqrt(count))


def _inflation(found: JointFit, time: Array, values: Array) -> float:
    """SensorSamples per independent sample of what a fit leaves."""
    left = values[:MOST_DESCRIBED] - found.predicted(time[:MOST_DESCRIBED])
    size = OUTLIER * float(np.median(np.abs(left))) * 1.5 or 1.0
    return max(describe(np.clip(left, -size, size)).inflation, 1.0)


def _thinned(time: Array, values: Array, noise: float, kinks: Kinks, levels: Array, spacing: float) -> SensorSamples:
    """SensorSamples with means of those far from changes, over times that grow with the distance from the next."""
    middles = 0.5 * (kinks.meets[1:] + kinks.meets[:-1])
    own = np.searchsorted(middles, time)
    away = time - kinks.meets[own]
    far = np.abs(away) / (NEAR * spacing)
    bins = np.floor(NEAR * np.where(far < 1, far, 1 + PER_EFOLD * np.log(np.maximum(far, 1)) / NEAR))
    place = np.stack([own, np.where(away < 0, -1 - bins, bins), np.searchsorted(levels, time, side="right")])
    starts = np.flatnonzero(np.any(np.diff(place, axis=1, prepend=-np.inf) != 0, axis=0))
    count = np.diff(starts, append=len(time))
    times, means = (np.add.reduceat(column, starts) / count for column in (time, values))
    return SensorSamples(times, means, count.astype(float), noise, levels.tolist())
