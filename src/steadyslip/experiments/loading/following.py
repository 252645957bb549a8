"""Choice of the model for how a load point follows its command: at once, along ramps, as a servo, or in pieces.

The models are compared on the displacement around each change. Samples far from changes are averaged, as they only
determine the straight lines.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.joint import OUTLIER, JointFit, SensorSamples, fit_at_once, fit_servo
from steadyslip.experiments.loading.loading import is_slight
from steadyslip.experiments.loading.pieces import fit_pieces, is_off_at_changes
from steadyslip.experiments.loading.servo import GAIN, settling
from steadyslip.experiments.numerics.noise import describe

LONGEST_LAG = 0.2  # largest lag, as a share of the time around a change in which nothing else changes; by trial
SPARED = 14.0  # decrease of chi squared credited to a servo for each sensor level, or half a run, that it replaces
COARSE = 0.5  # the best start of a servo's search has at least this share of the decrease of chi squared at its end
AROUND = 3.0  # samples are near a change up to this many settling times of the servo before and after it
NEAR = 30.0  # number of samples on each side of a change that are not averaged
PER_EFOLD = 10.0  # further away, number of means per increase of the distance from the change by e; chosen by trial
LEFT = 4.0  # standard errors by which the mean misfit around a change may exceed 1 (for normal noise, 0.83 is expected)
MOST_DESCRIBED = 4000  # the correlation of the noise is estimated from at most this many samples, to limit the time


@dataclass(frozen=True, eq=False)
class Kinks:
    """Changes of rate, estimated from straight lines between them.

    Attributes
    ----------
    meets : ndarray (changes,)
        Times at which the lines before and after a change meet, s from the first sample.
    durations : ndarray (changes,)
        Durations of straight ramps (s), 0 for steps.
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
        """Mask (n,) of times that are in a glitch of the sensor."""
        first, last = np.array(self.glitches).reshape(-1, 2).T
        return np.asarray(np.any((time[:, None] > first) & (time[:, None] < last), axis=1))

    @property
    def longest(self) -> float:
        """Longest lag (s) in the search for a servo."""
        return LONGEST_LAG * self.reach

    def far_levels(self, spacing: float) -> Array:
        """Times at which the sensor's level changes, except those shortly after a change of rate.

        Within the longest lag after a change of rate, a servo's response may look like a change of the sensor's level.
        """
        since = self.levels[:, None] - self.meets
        near = np.any((since >= -2 * spacing) & (since <= self.longest), axis=1)
        return np.asarray(self.levels[~near])


def followed(
    time: Array, values: Array, noise: float, ways: Sequence[Kinks], lasting: float = 1.0
) -> Iterator[JointFit]:
    """Best fit of steps, ramps or a servo to a displacement; if it is poor around changes, also a fit of many ramps.

    Parameters
    ----------
    time : ndarray (n,)
        s from the first sample.
    values : ndarray (n,)
        Displacement, m.
    noise : float
        Standard deviation of the displacement, m.
    ways : sequence of Kinks
        First all changes, then fewer and fewer, as changes that may be part of a servo's response are left out.
    lasting : float
        Least number of samples per independent sample. The larger it is, the more must a servo reduce chi squared.
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
    if not is_off_at_changes(time, (values - best.predicted(time)) / noise, lines.meets):
        return
    slight = sum(map(is_slight, at_once.rates, at_once.rates[1:]))  # slight ones may belong to a neighbour's response
    for kinks in reversed([one for one in ways if len(lines.meets) - len(one.meets) <= slight]):
        samples = _thinned(time, values, noise, kinks, kinks.far_levels(spacing), spacing)
        best = fit_pieces(samples, fit_at_once(samples, kinks.meets, np.zeros(len(kinks.meets))), spacing)
        if not is_off_at_changes(time, (values - best.predicted(time)) / noise, lines.meets):
            break
    yield best.widened(_inflation(best, time, values))


def _off(found: JointFit, at: Array, time: Array, values: Array, noise: float, spacing: float) -> list[Array]:
    """Deviations of samples from the fit of a servo, around each of the times `at` (s), in standard deviations."""
    length = AROUND * (settling(found.lag, found.damping) + spacing)
    around = [slice(*np.searchsorted(time, [one - length, one + length])) for one in at]
    return [(values[rows] - found.predicted(time[rows])) / noise for rows in around]


def _is_noise(off: Array) -> bool:
    """True if deviations (n,), in standard deviations of the noise, are no larger than noise alone would make them."""
    count = max(len(off), 1)
    return bool(OUTLIER**2 * np.sum(np.log1p((off / OUTLIER) ** 2)) / count <= 1 + LEFT / np.sqrt(count))


def _inflation(found: JointFit, time: Array, values: Array) -> float:
    """Number of samples per independent sample in the residuals of a fit."""
    left = values[:MOST_DESCRIBED] - found.predicted(time[:MOST_DESCRIBED])
    size = OUTLIER * float(np.median(np.abs(left))) * 1.5 or 1.0
    return max(describe(np.clip(left, -size, size)).inflation, 1.0)


def _thinned(time: Array, values: Array, noise: float, kinks: Kinks, levels: Array, spacing: float) -> SensorSamples:
    """Samples to be fitted; far from changes, they are means over times that grow with the distance from the change."""
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
