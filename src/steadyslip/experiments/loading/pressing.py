"""Course of the normal stress (constant or smooth, with steps and ramps), and list of all changes of a loading."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.experiments.loading.loading import Change, Course, Loading
from steadyslip.experiments.numerics.smoothing import Smooth, smoothing_curve
from steadyslip.experiments.numerics.splitting import FEWEST, level_noise, split

LEAST_STRESS = 2e-3  # smallest relative change of normal stress that counts as a commanded change; chosen by trial
OFF_LEVEL = 6.0  # a sample is off a level if it deviates by more than this number of standard deviations
SUDDEN, NEAR = 0.7, 3
"""A change is sudden if the means of this number of samples (second) just before and after it differ by at least this
share (first) of the change; chosen by trial."""
CLIMB = 0.2  # samples climb if the means of their halves differ by more than this share of the rise; a ramp: 0.4 to 0.5
BINS = 40  # number of means into which a span is divided to test whether it is constant; chosen by trial
UNEVEN = 3.0  # a span is not constant if the variance of its means exceeds that of noise by this factor; by trial
EARLIEST_STEP = 1e-6  # least time between a sample and a step after it, as a share of the sampling interval
SLOW = 400  # number of knots of a curve between two changes: faster variation counts as noise; chosen by trial
PER_PERIOD = 60  # number of knots of such a curve in a period of an oscillation; chosen by trial
OSCILLATION = 8  # a stress oscillates if it crosses its mean at least this often; chosen by trial


@dataclass(frozen=True)
class StressWave:
    """Oscillation of the normal stress: start (s), period (s), mean and amplitude (Pa)."""

    time: float
    period: float
    mean: float
    amplitude: float


def stress_course(time: Array, normal: Array) -> Course:
    """Course of the commanded normal stress; a single deviating sample at an end of the record is left out."""
    early, late = (_deviates_alone(column) for column in (normal, normal[::-1]))
    if early or late:
        inner = slice(early, len(time) - late)
        return replace(stress_course(time[inner], normal[inner]), early=early, late=late)
    noise = level_noise(normal)
    if (wave := oscillation(time, normal)) is not None:
        level, knots = float(np.mean(normal)), int(PER_PERIOD * (time[-1] - time[0]) / wave.period)
        return Course(level, curve=JoinedCurves([_curve_on_span(time, normal, level, noise, knots)]))
    if len(time) < 2 * FEWEST:
        return Course(float(np.mean(normal)), strays=noise)
    places = _transitions(time, normal, split(time, normal, noise, linear=False))
    for _ in range(2):  # the second pass adds the ends of slow ramps, which noise hides until the ramp is known
        ends = [0, *(place for pair in places for place in pair), len(time)]
        spans = [slice(i, j) for i, j in zip(ends[::2], ends[1::2], strict=True)]
        levels = [float(np.mean(normal[span])) for span in spans]
        changes = tuple(
            _change(time, normal, last - 1, first, levels[k : k + 2], noise) for k, (last, first) in enumerate(places)
        )
        ramps = [_whole_ramp(time, pair, change) for pair, change in zip(places, changes, strict=True)]
        places = ramps if all(one[1] < other[0] for one, other in pairwise(ramps)) else places
    curves = []
    for span, level in zip(spans, levels, strict=True):
        if _is_not_constant(normal[span], noise):
            curves.append(_curve_on_span(time[span], normal[span], level, noise, SLOW))
    errors = np.array([noise / np.sqrt(span.stop - span.start) for span in spans])
    errors[noise <= 2e-7 * abs(levels[0])] = 0.0  # levels with rounding errors only are exact
    return Course(levels[0], changes, errors, JoinedCurves(curves) if curves else None, noise)


def _deviates_alone(normal: Array) -> int:
    """1 if the first sample is far from the following samples, and these agree with each other; else 0."""
    if len(normal) < 4 * FEWEST:
        return 0
    following = normal[1 : 1 + FEWEST]
    least = max(LEAST_STRESS * float(np.max(np.abs(following))), OFF_LEVEL * level_noise(normal))
    return int(abs(normal[0] - np.mean(following)) > least and float(np.ptp(following)) < least)


def _transitions(time: Array, normal: Array, ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Index one past the last sample before a change, and index of the first sample after it, for every change."""
    levels = np.array([float(np.median(normal[i:j])) for i, j in ranges])
    for k, edge in ((0, slice(0, 2)), (-1, slice(-2, None))):  # the shortest range at an end may contain a change
        if ranges[k][1] - ranges[k][0] < 2 * FEWEST:
            levels[k] = float(np.mean(normal[edge]))
    lengths = np.array([time[j - 1] - time[i] for i, j in ranges])
    noise = level_noise(normal)
    found: list[tuple[int, int]] = []
    first = 0
    while first < len(ranges) - 1:
        last = first + 1
        while last < len(ranges) - 1 and _is_passing(levels, lengths, first, last):
            last += 1
        between = slice(ranges[first + 1][0], ranges[last][0])
        if last > first + 1 and not _climbs(normal[between], levels[last] - levels[first]):
            last = first + 1  # a short level between two steps, not a ramp
        apart = abs(levels[first] - levels[last])
        if apart > LEAST_STRESS * max(abs(levels[first]), abs(levels[last])) and apart > OFF_LEVEL * noise:
            pair = _between(normal, ranges[first], ranges[last], levels[first], levels[last], noise)
            if (
                _sudden(normal, pair, apart)
                and _straight(time, normal, pair, noise)
                and (not found or pair[0] > found[-1][1])
            ):
                found.append(pair)
        first = last
    return found


def _is_passing(levels: Array, lengths: Array, first: int, middle: int) -> bool:
    """True if a range is part of a change: short, with a level between those of its neighbours."""
    low, high = sorted((levels[first], levels[middle + 1]))
    between = low < levels[middle] < high
    return bool(between and lengths[middle] < 0.2 * max(lengths[first], lengths[middle + 1]))


def _climbs(values: Array, rise: float) -> bool:
    """True if the means of the two halves of values (n,) differ by more than `CLIMB` times `rise`."""
    half = len(values) // 2
    return bool((np.mean(values[-half:]) - np.mean(values[:half])) / rise > CLIMB)


def _between(
    normal: Array, one: tuple[int, int], other: tuple[int, int], before: float, after: float, noise: float
) -> tuple[int, int]:
    """Range of samples, between the ranges `one` and `other`, that have the level of neither range."""
    i, j = max(one[1] - FEWEST, one[0] + 1), min(other[0] + FEWEST, other[1] - 1)
    part = normal[i:j]
    away, there = np.abs(part - before) > OFF_LEVEL * noise, np.abs(part - after) <= OFF_LEVEL * noise
    last = i + (int(np.argmax(away)) if np.any(away) else 0)
    late = np.flatnonzero(~there)
    first = max(i + (int(late[-1]) + 1 if len(late) else 0), last)
    return last, first


def _sudden(normal: Array, pair: tuple[int, int], apart: float) -> bool:
    """True if most of the change `apart` happens between the samples `pair`, and not gradually before and after."""
    last, first = pair
    before, after = normal[max(last - NEAR, 0) : last], normal[first : first + NEAR]
    return bool(len(before) and len(after) and abs(np.mean(after) - np.mean(before)) > SUDDEN * apart)


def _straight(time: Array, normal: Array, pair: tuple[int, int], noise: float) -> bool:
    """True if the samples between two levels are a straight ramp within noise, or too few to decide."""
    inner = slice(*pair)
    t, s = time[inner], normal[inner]
    if len(t) < FEWEST:
        return True
    slope, level = np.polyfit(t - t[0], s, 1)
    return bool(np.std(s - level - slope * (t - t[0])) < UNEVEN * noise)


def _whole_ramp(time: Array, pair: tuple[int, int], change: Change) -> tuple[int, int]:
    """Range of all samples of a change; a long ramp is extended to the times at which its line meets the levels."""
    last, first = pair
    if first - last < FEWEST:
        return pair
    begin, end = np.searchsorted(time, [change.time, change.time + change.duration])
    return max(min(last, int(begin)), 1), min(max(first, int(end)), len(time) - 1)


def _change(time: Array, normal: Array, last: int, first: int, levels: list[float], noise: float) -> Change:
    """Change between two samples: a step if they are neighbours, or the ramp through the samples between them."""
    before, after = levels
    early, late = float(time[last]), float(time[first])
    if first == last + 1:  # a step begins after the earlier sample, because friction jumps with the stress
        return Change(0.5 * (early + late), 0.0, before, after, early + EARLIEST_STEP * (late - early), late, 0.0, 0.0)
    t, s = time[last + 1 : first], normal[last + 1 : first]
    if len(t) == 1:
        share = float(np.clip((s[0] - before) / (after - before), 0.05, 0.95))
        begin = 0.5 * (early + float(t[0]))
        length = min((float(t[0]) - begin) / share, late - begin)
        return Change(begin, length, before, after, early, float(t[0]), 0.2 * length, late - early)
    slope, at_zero = np.polyfit(t - early, s, 1)
    begin, end = early + (before - at_zero) / slope, early + (after - at_zero) / slope
    if len(t) < FEWEST:
        begin, end = float(np.clip(begin, early, t[0])), float(np.clip(end, t[-1], late))
    unsure = OFF_LEVEL * noise / abs(slope)
    if unsure < 1e-2 * float(np.median(np.diff(time))):  # the time is known to a hundredth of a sampling interval
        return Change(begin, end - begin, before, after, begin, begin, end - begin, end - begin)
    low, high = begin - unsure, begin + unsure
    return Change(begin, end - begin, before, after, low, high, 0.5 * (end - begin), end - begin + 2 * unsure)


def _is_not_constant(values: Array, noise: float) -> bool:
    """True if the values (n,) of a stress between two changes vary by more than noise."""
    if len(values) < 2 * FEWEST:
        return False
    size = max(len(values) // BINS, 1)
    means = values[: len(values) // size * size].reshape(-1, size).mean(axis=1)
    return bool(np.var(means) > UNEVEN * noise**2 / size)


def _curve_on_span(time: Array, normal: Array, level: float, noise: float, knots: int) -> tuple[float, float, Smooth]:
    curve = smoothing_curve(time, normal - level, noise, knots)
    return float(time[0]), float(time[-1]), curve


class JoinedCurves:
    """Function of time that joins curves on separate spans: linear between spans, constant outside them."""

    def __init__(self, spans: list[tuple[float, float, Smooth]]) -> None:
        self.spans = spans

    def __call__(self, time: Array) -> Array:
        ends = np.array([t for first, last, _ in self.spans for t in (first, last)])
        values = np.concatenate([curve(np.array([first, last])) for first, last, curve in self.spans])
        found: Array = np.interp(time, ends, values)
        for first, last, curve in self.spans:
            inside = (time >= first) & (time <= last)
            found[inside] = curve(np.asarray(time)[inside])
        return found


def oscillation(time: Array, normal: Array) -> StressWave | None:
    """Oscillation of a normal stress that crosses its mean at regular intervals; None if it does not."""
    mean, noise = float(np.mean(normal)), level_noise(normal)
    if len(normal) < 2 * FEWEST or float(np.std(normal)) < LEAST_STRESS / 4 * abs(mean):
        return None
    smooth = np.convolve(normal - mean, np.ones(3) / 3, mode="same")
    band = max(4 * noise, 0.3 * float(np.std(normal)))
    signs = np.where(smooth > band, 1, np.where(smooth < -band, -1, 0))
    places = np.flatnonzero(signs)
    turns = places[1:][np.diff(signs[places]) != 0]
    if len(turns) < OSCILLATION:
        return None
    gaps = np.diff(time[turns])
    typical = float(np.median(gaps))
    like = np.abs(gaps - typical) < 0.35 * typical  # half periods of regular length; chosen by trial
    if np.mean(like) < 0.8:
        return None
    first = max(int(np.flatnonzero(np.abs(normal - mean) > band)[0]) - 1, 0)
    inside = normal[turns[0] : turns[-1]]
    return StressWave(float(time[first]), 2 * float(np.mean(gaps[like])), mean, float(np.sqrt(2) * np.std(inside)))


@dataclass(frozen=True)
class LoadStep:
    """Change of the load-point rate, normal stress or pore pressure of an experiment.

    Attributes
    ----------
    kind : str
        ``velocity step``, ``hold``, ``reslide``, ``normal-stress step``, ``normal-stress oscillation`` or
        ``pore-pressure step``.
    time : float
        Time at which the change begins, s.
    duration : float
        Duration, s; zero for a sudden change. For an oscillation: its period.
    before, after : float
        Load-point rate (m/s) or pressure (Pa) before and after; for an oscillation, its mean and amplitude.
    """

    kind: str
    time: float
    duration: float
    before: float
    after: float

    @property
    def unit(self) -> str:
        return "Pa" if self.kind.startswith(("normal", "pore")) else "m/s"

    def __str__(self) -> str:
        if self.kind == "normal-stress oscillation":
            return (
                f"{self.kind} from {self.time:.6g} s: {format_quantity(self.before, 'Pa')} ± "
                f"{format_quantity(self.after, 'Pa')}, "
                f"period {format_quantity(self.duration, 's')}"
            )
        lasting = f", in {format_quantity(self.duration, 's')}" if self.duration else ""
        values = f"{format_quantity(self.before, self.unit)} to {format_quantity(self.after, self.unit)}"
        return f"{self.kind} at {self.time:.6g} s: {values}{lasting}"


def steps_of(loading: Loading, wave: StressWave | None) -> tuple[LoadStep, ...]:
    """Changes of a loading, and its oscillation of normal stress if there is one, in order of time."""
    found = [_step(channel, change) for channel, _, change in loading.changes]
    if wave is not None:
        found.append(LoadStep("normal-stress oscillation", wave.time, wave.period, wave.mean, wave.amplitude))
    return tuple(sorted(found, key=lambda step: step.time))


def _step(channel: str, change: Change) -> LoadStep:
    if channel in ("stress", "pore"):
        kind = "normal-stress step" if channel == "stress" else "pore-pressure step"
    else:
        kind = "hold" if change.after == 0.0 else "reslide" if change.before == 0.0 else "velocity step"
    return LoadStep(kind, change.time, change.duration, change.before, change.after)
