"""Course of the load-point rate from a measured displacement: rates, and times and durations of their changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.ends import REST_SHARE, reversed_column, samples_off_line
from steadyslip.experiments.loading.following import Kinks, followed
from steadyslip.experiments.loading.joint import JointFit
from steadyslip.experiments.loading.loading import Change, Course, Pieces
from steadyslip.experiments.loading.runs import Run, straight_runs
from steadyslip.experiments.numerics.noise import Noise, describe
from steadyslip.experiments.numerics.smoothing import smoothing_curve
from steadyslip.experiments.numerics.splitting import MAD_TO_SIGMA, displacement_noise

RAMP_GAIN = 40.0  # decrease of chi squared by which a ramp must fit better than a step; chosen by trial
OUTLIER = 9.0  # samples whose squared deviation over the variance is larger get less weight: three standard deviations
BRIEF = 0.1  # a sensor level with a smaller share of a run's samples may be the bottom of a glitch; chosen by trial
AT_REST, STILL = 1e-3, 7e-4
"""A run is a hold if its rate is below the first share of the highest rate and its travel below the second share of the
whole travel, as sensors drift in a hold; chosen by trial. A run at 1 um/s in a record with 1 mm/s is no hold."""
SLOW = 0.02  # a run up to this share of the highest rate is a hold if 0 is within the error; chosen by trial
MOST_CHANGES = 40  # largest number of changes in a piecewise linear loading; with more, a curve is used; by trial
MOST_BETWEEN = 0.35  # a loading is piecewise linear if at most this share of its time is between runs; chosen by trial
ENOUGH_SAMPLES = 30  # least number of samples from which their noise is estimated; chosen by trial
BRIEF_RUN = 0.3  # a run shorter than this share of a neighbour may be part of a servo's response; chosen by trial
MOST_BRIEF = 4  # largest number of brief runs that are left out, the shortest first: a record hardly has more
LAG_ERROR = 0.1  # error in the time of a command that a servo follows, as a share of the lag
SUDDEN = 5  # largest number of samples in a glitch; number of samples on each side of a slip that give its size
LASTING = 2.0  # from this number of samples per independent sample, noise counts as correlated: runs are found again
EXACTLY = 1e-9  # deviations below this share of a column's range are rounding errors
EXACT = 1e-2  # the time of a change is not fitted if its error is below this number of sampling intervals


def load_course(time: Array, displacement: Array, blurred: bool = False) -> Course:
    """Course of the load-point rate from a displacement: straight runs or, if these do not fit, a smooth curve.

    `blurred` is true for a displacement that was integrated from a rate: the time of a change is then uncertain by a
    sampling interval. If the displacement around changes deviates from the course, its attribute `otherwise` is a
    second course, in which each change is a series of straight ramps.
    """
    if not np.ptp(displacement) > 0:
        return Course(0.0)
    runs = straight_runs(time, displacement)
    if not _piecewise_linear(runs, time):
        return smooth_load(time, displacement)
    lines = _Lines(time, displacement, runs)
    if max(lines.inflation) > LASTING:  # correlated noise, which looks like slips and glitches of the sensor
        others = straight_runs(time, displacement, lines.lasting)
        same = [one.members for one in others] == [one.members for one in lines.runs]
        if not same and _piecewise_linear(others, time):
            lines = _Lines(time, displacement, others)
    if not any(one.tells for one in lines.kinks):
        return lines.course(None, blurred)
    durations = np.array([one.ramp[0] if one.tells else 0.0 for one in lines.kinks])
    noise = max(float(np.median(lines.strays)), EXACTLY * float(np.ptp(displacement)))
    some = {len(fewer) - 1: fewer for fewer in _without_brief(lines.runs, time)}
    ways = [replace(_as_lines(time, fewer), durations=durations[:n]) for n, fewer in some.items()]
    found = []
    for joint in followed(time - time[0], displacement, noise, ways, min(lines.inflation)):
        count = len(joint.times)
        own = lines if count == len(lines.kinks) else _Lines(time, displacement, some[count])
        found.append(own.course(joint if joint.lag or joint.pieces else None, blurred))
    return replace(found[0], otherwise=found[1]) if len(found) > 1 else found[0]


class _Lines:
    """Straight runs of a displacement, their scatter (see `_errors`), and the changes between them."""

    def __init__(self, time: Array, displacement: Array, runs: list[Run]) -> None:
        self.time, self.displacement, self.runs = time, displacement, runs
        self.strays, self.errors, self.inflation = _errors(runs, time, displacement)
        beside = (pairwise(column) for column in (runs, self.errors, self.strays, self.inflation))
        self.kinks = [
            _ChangeFit(time, displacement, before, after, pair, max(scales), max(worths))
            for (before, after), pair, scales, worths in zip(*beside, strict=True)
        ]

    @property
    def lasting(self) -> Array:
        """Standard deviation (n,), m, of white noise equivalent to the correlated noise around each sample.

        The largest value of the run of a sample and its two neighbouring runs is used, because the samples of a single
        run may not show the correlation.
        """
        own = np.array(self.strays) * np.sqrt(self.inflation)
        around = np.max([np.pad(own, 1)[k : k + len(own)] for k in range(3)], axis=0)
        middles = [0.5 * (self.time[a.last - 1] + self.time[b.first]) for a, b in pairwise(self.runs)]
        return np.asarray(around[np.searchsorted(middles, self.time)])

    def course(self, joint: JointFit | None, blurred: bool) -> Course:
        """Course of steps and ramps or, if `joint` is given, of the servo responses or series of ramps in that fit."""
        time, displacement, runs, kinks = self.time, self.displacement, self.runs, self.kinks
        rates = np.array([run.rate for run in runs]) if joint is None else joint.rates
        rest = _at_rest(rates, runs, self.errors, time, displacement)
        rates = np.where(rest, 0.0, rates)
        levels = pairwise(rates.tolist())
        if joint is None:
            changes = [kink.change(*own, blurred) for kink, own in zip(kinks, levels, strict=True)]
        else:
            pieces = joint.pieces or ((),) * len(kinks)
            changes = [kink.late_change(time[0] + at, *own, joint.lag, joint.damping, ways)
                       for kink, at, own, ways in zip(kinks, joint.times, levels, pieces, strict=True)]  # fmt: skip
        found = tuple(_within_record(one, time) for one in _without_overlap(changes))
        back = reversed_column(time), reversed_column(displacement)
        return Course(
            float(rates[0]), found, np.where(rest, 0.0, self.errors), None, float(np.median(self.strays)),
            sum(max(run.groups) for run in runs) if joint is None else len(joint.levels),
            sum(sum(b[0] > a[1] for a, b in pairwise(run.members)) for run in runs) if joint is None else 0,
            samples_off_line(time, displacement, runs[0], max(self.strays)),
            samples_off_line(*back, runs[-1].reversed(time), max(self.strays)),
            joint.others() if joint is not None and joint.lag else (),
            () if joint is None else tuple((np.where(rest, 0.0, own), shares) for own, shares in joint.shapes),
        )  # fmt: skip


def _at_rest(rates: Array, runs: list[Run], errors: list[float], time: Array, displacement: Array) -> Array:
    """Mask (runs,) of runs in which the load point is held."""
    top = float(np.max(np.abs(rates)))
    slow = np.array([SLOW if len(run.rows) >= ENOUGH_SAMPLES else REST_SHARE for run in runs]) * top
    travel = np.abs(rates) * [time[run.last - 1] - time[run.first] for run in runs]
    still = (np.abs(rates) <= AT_REST * top) & (travel <= STILL * np.ptp(displacement))
    known = np.where(rates < 0, np.inf, 4 * np.array(errors))  # a slow backward motion is drift of the sensor in a hold
    rest = still | (np.abs(rates) <= np.minimum(known, slow))
    return np.asarray(rest & (len(runs) > 1))


def _without_brief(runs: list[Run], time: Array) -> Iterator[list[Run]]:
    """First all runs, then fewer: each time, the shortest run is left out if it is much shorter than a neighbour."""
    for _ in range(MOST_BRIEF + 1):
        yield runs
        lasts = [float(time[one.last - 1] - time[one.first]) for one in runs]
        brief = [k for k in range(1, len(runs) - 1) if lasts[k] < BRIEF_RUN * max(lasts[k - 1], lasts[k + 1])]
        if not brief:
            return
        shortest = min(brief, key=lasts.__getitem__)
        runs = runs[:shortest] + runs[shortest + 1 :]


def _as_lines(time: Array, runs: list[Run]) -> Kinks:
    """Changes between runs as steps at the times where their lines meet; also sensor levels and glitches in runs."""
    pairs = list(pairwise(runs))
    meets = [
        np.clip((one.levels[-1] - other.levels[0]) / (other.rate - one.rate),
                *(time[[one.first + 1, other.last - 2]] - time[0]))
        for one, other in pairs
    ]  # fmt: skip
    levels = [
        0.5 * (time[one[1] - 1] + time[other[0]]) - time[0]
        for run in runs
        for (one, other), (group, after) in zip(pairwise(run.members), pairwise(run.groups), strict=True)
        if group != after
    ]
    lasts = [time[run.last - 1] - time[run.first] for run in runs]
    reach = min(2 * min(pair) + time[after.first] - time[before.last - 1]
                for pair, (before, after) in zip(pairwise(lasts), pairs, strict=True))  # fmt: skip
    glitches = [
        (time[one[1] - 1] - time[0], time[other[0]] - time[0])
        for run in runs
        for one, other in pairwise(run.members)
        if 1 < other[0] - one[1] < min(one[1] - one[0], other[1] - other[0])  # a late response begins or ends a run
    ]
    return Kinks(np.array(meets), np.zeros(len(meets)), np.array(levels), float(reach), glitches)


def slips_and_glitches(time: Array, displacement: Array) -> tuple[Array, Array]:
    """Regressors (k, n) that are 1 after each sudden change of a sensor's level, and mask (n,) of samples to keep.

    Samples in a brief glitch are not kept. A change of level that takes many samples is no slip of the sensor but a
    deformation of the machine at a peak of friction.
    """
    runs = straight_runs(time, displacement)
    slips, keep = [], np.ones(len(time), dtype=bool)
    for run in runs:
        off = displacement - run.rate * time
        for (one, other), (group, after) in zip(pairwise(run.members), pairwise(run.groups), strict=True):
            at_once = np.median(off[other[0] : other[0] + SUDDEN]) - np.median(off[one[1] - SUDDEN : one[1]])
            if group != after and at_once / (run.levels[after] - run.levels[group]) > 0.5:
                slips.append(np.arange(len(time)) >= other[0])
            if other[0] - one[1] <= SUDDEN:
                keep[one[1] : other[0]] = False
    return np.array(slips, dtype=float).reshape(-1, len(time)), keep


def _piecewise_linear(runs: list[Run], time: Array) -> bool:
    between = sum(time[b.first] - time[a.last - 1] for a, b in pairwise(runs))
    return bool(len(runs) - 1 <= MOST_CHANGES and between <= MOST_BETWEEN * (time[-1] - time[0]))


def smooth_load(time: Array, displacement: Array) -> Course:
    """Course of the load-point rate from a smoothing curve through its displacement."""
    spline = smoothing_curve(time, displacement, displacement_noise(time, displacement))
    strays = displacement - spline(time)
    return Course(0.0, curve=spline.derivative(), strays=MAD_TO_SIGMA * float(np.median(np.abs(strays))))


def _errors(runs: list[Run], time: Array, displacement: Array) -> tuple[list[float], list[float], list[float]]:
    """Standard deviation from the line, error of the rate and samples per independent sample, for each run.

    A run of few samples does not determine its noise and gets the noise of the longest run. A run whose noise seems
    white gets the correlation of the longest run, if the noise of the longest run is correlated.
    """
    found = [_Scatter.of(run, time, displacement) for run in runs]
    longest = found[max(range(len(runs)), key=lambda k: len(runs[k].rows))]
    noisy = longest.scale > 1e-9 * max(float(np.ptp(displacement)), 1e-300)
    for k, own in enumerate(found):
        few = len(own.share) < ENOUGH_SAMPLES and len(own.share) < len(longest.share) and own.scale < longest.scale
        if few:
            found[k] = own = replace(own, scale=longest.scale, noise=longest.noise if noisy else None)
        elif own.noise and longest.noise and longest.noise.correlated and not own.noise.correlated:
            like = longest.noise.covariance * (own.scale / longest.scale) ** 2
            found[k] = replace(own, noise=replace(longest.noise, covariance=like))
    return [one.scale for one in found], [one.error for one in found], [one.inflation for one in found]


@dataclass(frozen=True, eq=False)
class _Scatter:
    """Scatter of a run about its line: standard deviation, noise model, and derivatives (n,) of its rate by samples."""

    scale: float
    noise: Noise | None
    share: Array

    @property
    def error(self) -> float:
        """Standard deviation of the rate, m/s."""
        variance = float(self.noise.spread(self.share[None])[0, 0]) if self.noise else 0.0
        return float(np.sqrt(max(variance, 0.0)))

    @property
    def inflation(self) -> float:
        """Number of samples per independent sample."""
        return max(self.noise.inflation, 1.0) if self.noise else 1.0

    @classmethod
    def of(cls, run: Run, time: Array, displacement: Array) -> _Scatter:
        rows = run.rows
        own = np.repeat(run.groups, [j - i for i, j in run.members])
        t = time[rows] - time[0]
        r = displacement[rows] - run.levels[own] - run.rate * t
        scale = MAD_TO_SIGMA * float(np.median(np.abs(r)))
        count = np.bincount(own)
        u = t - (np.bincount(own, t) / count)[own]
        size = float(np.sum(u * u))
        share = u / max(size, 1e-300)
        if not (scale > 1e-9 * max(float(np.ptp(displacement)), 1e-300) and size > 0):
            return cls(scale, None, share)
        levels = (own == np.arange(len(count))[:, None]).astype(float)  # the fit of levels and rate removed slow noise
        return cls(scale, describe(np.clip(r, -4 * scale, 4 * scale), rows=np.vstack([levels, u])), share)


class _ChangeFit:
    """Change between two runs: the time at which their lines meet, and the step or ramp around this time."""

    def __init__(
        self, time: Array, displacement: Array, before: Run, after: Run, errors: tuple[float, float],
        strays: float, inflation: float,
    ) -> None:  # fmt: skip
        self.strays, self.inflation = strays, inflation
        self.origin = float(time[0])
        self.zone = float(time[before.last - 1]), float(time[after.first])
        self.spacing = float(np.median(np.diff(time[max(before.last - 3, 0) : after.first + 3])))
        self.adjacent = before.last == after.first
        self.rates = before.rate, after.rate
        which = -1 if strays <= EXACTLY * float(np.ptp(displacement)) else 0  # exact ramp ends look like levels
        self.levels = _levels(before, -1)[which], _levels(after, 0)[which]
        difference = after.rate - before.rate
        self.meet = self.origin + (self.levels[0] - self.levels[1]) / difference
        self.meets = [
            self.origin + (one - other) / difference for one in _levels(before, -1) for other in _levels(after, 0)
        ]
        near = [[m for m, g in zip(run.members, run.groups, strict=True) if g == edge]
                for run, edge in ((before, before.groups[-1]), (after, 0))]  # fmt: skip
        variance = 0.0
        for members, error in zip(near, errors, strict=True):
            count = sum(j - i for i, j in members) / inflation
            middle = 0.5 * (time[members[0][0]] + time[members[-1][1] - 1])
            variance += strays**2 / max(count, 1.0) + (error * (self.meet - middle)) ** 2
        self.deviation = float(np.sqrt(variance)) / abs(difference)
        self.reach = 2 * min(self.zone[0] - float(time[before.first]), float(time[after.last - 1]) - self.zone[1])
        self.reach += self.zone[1] - self.zone[0]
        rows = slice(*np.searchsorted(time, [self.meet - self.reach, self.meet + self.reach]))
        self.time, self.displacement = time[rows], displacement[rows]

    def change(self, before: float, after: float, blurred: bool) -> Change:
        """Step or ramp that fits the displacement best, between the levels `before` and `after` (m/s)."""
        slack = 6 * self.deviation + 2 * self.spacing
        own = 6 * self.deviation + 3 * self.strays / abs(self.rates[1] - self.rates[0])
        if not self.zone[0] - slack <= self.meet <= self.zone[1] + slack:
            return self._uncertain_change(before, after, own + slack)
        at_once = self.adjacent and self.zone[0] <= self.meet <= self.zone[1]
        if not blurred and own < EXACT * self.spacing and (at_once or self.ramp[0]):
            duration, _, _ = self.ramp
            start = self.meet - 0.5 * duration
            return Change(start, duration, before, after, start, start, duration, duration)
        duration, shortest, longest = self.ramp
        half = own + self.spacing + 0.5 * max(longest - shortest, 0.0) * (duration > 0)
        half = max(half, 0.5 * (self.zone[1] - self.zone[0]) - 0.5 * duration)
        start = self.meet - 0.5 * duration
        low, high = (start - half + end - self.meet for end in (min(self.meets), max(self.meets)))
        return Change(start, duration, before, after, low, high + 2 * half, shortest, longest)

    @property
    def tells(self) -> bool:
        """True if there are enough samples around the change to fit the response of the load point to it."""
        return len(self.time) >= ENOUGH_SAMPLES and self.reach > 0

    def late_change(
        self, at: float, before: float, after: float, lag: float, damping: float, pieces: Pieces = ()
    ) -> Change:
        """Step commanded at the time `at` (s) with a late response; its error is that of the lines' meeting point."""
        half = 6 * self.deviation + self.spacing + LAG_ERROR * lag
        return Change(at, 0.0, before, after, at - half, at + half, lag=lag, damping=damping, pieces=pieces)

    def _uncertain_change(self, before: float, after: float, slack: float) -> Change:
        """Step of uncertain time, for runs whose lines do not meet between them: the sensor had a glitch or slip."""
        first, last = self.zone
        length = last - first
        hidden = first - 2 * length - slack <= self.meet <= last + 2 * length + slack
        middle = self.meet if hidden else 0.5 * (first + last)
        slack += 0.25 * length
        near = [m for m in self.meets[1:] if first - 2 * length - slack <= m <= last + 2 * length + slack]
        low, high = min(first, middle, *near) - slack, max(last, middle, *near) + slack
        return Change(middle, 0.0, before, after, low, high, 0.0, length)

    @cached_property
    def ramp(self) -> tuple[float, float, float]:
        """Best duration of a ramp (0 for a step), and shortest and longest duration that fit nearly as well, s."""
        if len(self.time) < 8 or not self.reach > 0:
            return 0.0, 0.0, 0.0
        grid = np.concatenate(
            [[0.0], np.geomspace(0.2 * self.spacing, self.reach, 60)]
        )  # 60 durations suffice to bracket the best
        misfits = np.array([self._misfit(d) for d in grid]) / self.inflation
        best = max(int(np.argmin(misfits)), 1)
        low, high = float(grid[best - 1]), float(grid[min(best + 1, len(grid) - 1)])
        fine = minimize_scalar(self._misfit, bounds=(low, high), method="bounded", options={"xatol": 1e-9 * high})
        duration, least = float(fine.x), float(fine.fun) / self.inflation
        inside = np.abs(self.time - self.meet) <= 0.5 * duration
        unlike = self._misfit(duration, outside=False) > 0.5 * OUTLIER * max(int(np.sum(inside)), 1)
        if misfits[0] - least <= RAMP_GAIN or unlike:
            beyond = int(np.argmax(misfits > misfits[0] + OUTLIER))
            return 0.0, 0.0, float(grid[beyond - 1]) if beyond else float(grid[-1])
        near = np.flatnonzero(misfits <= least + OUTLIER)
        ends = (grid[near[0]], grid[near[-1]]) if len(near) else (low, high)
        return duration, 0.5 * min(float(ends[0]), duration), 1.5 * max(float(ends[1]), duration)  # for safety

    def _misfit(self, duration: float, outside: bool = True) -> float:
        """Robust chi squared of a ramp between the two lines, of all samples or only of samples within the ramp."""
        begin = self.meet - 0.5 * duration
        first, last = np.searchsorted(self.time, begin, "right"), np.searchsorted(self.time, begin + duration)
        own = slice(first, max(first, last))
        since = self.time[own] - begin
        bend = self._lines[0][own] + 0.5 * (self.rates[1] - self.rates[0]) * since**2 / max(duration, 1e-300)
        inside = float(np.sum(self._costs(self.displacement[own] - bend)))
        if not outside:
            return inside
        before, after = self._costs_of_lines
        return inside + float(before[own.start] + after[-1] - after[own.stop])

    @cached_property
    def _lines(self) -> list[Array]:
        """Displacements (n,) of the lines before and after the change."""
        t = self.time - self.origin
        return [level + rate * t for level, rate in zip(self.levels, self.rates, strict=True)]

    @cached_property
    def _costs_of_lines(self) -> list[Array]:
        """Cumulative chi squared (n + 1,) of the first k samples, k = 0 to n, about each of the two lines."""
        return [np.append(0.0, np.cumsum(self._costs(self.displacement - line))) for line in self._lines]

    def _costs(self, deviations: Array) -> Array:
        """Robust squares (n,) of deviations (n,) in units of the scatter; large deviations have less weight."""
        scale = max(self.strays, 1e-9 * float(np.ptp(self.displacement)))
        return np.asarray(OUTLIER * np.log1p((deviations / scale) ** 2 / OUTLIER))


def _levels(run: Run, edge: int) -> list[float]:
    """Level of the sensor at the first (0) or last (-1) sample of a run, and the next level if the former is brief."""
    counts = np.bincount(np.repeat(run.groups, [j - i for i, j in run.members]))
    found = [float(run.levels[edge])]
    if len(counts) > 1 and counts[edge] < BRIEF * np.sum(counts):
        found.append(float(run.levels[1 if edge == 0 else -2]))
    return found


def _within_record(change: Change, time: Array) -> Change:
    """Change with its times moved so that at least two samples of the record are on each side."""
    low, high = float(time[1]), float(time[-2])
    begin, earliest, latest = (min(max(at, low), high) for at in (change.time, change.earliest, change.latest))
    return replace(change, time=begin, earliest=earliest, latest=latest)


def _without_overlap(changes: list[Change]) -> list[Change]:
    """Changes with the ranges of their times limited so that neighbours cannot overlap."""
    for i in range(len(changes) - 1):
        one, other = changes[i : i + 2]
        middle = 0.5 * (one.time + one.duration + other.time)
        taken = one.longest if one.stretches else one.duration
        if one.free and one.latest + taken > middle:
            longest = min(one.longest, max(middle - one.time, one.duration))
            latest = max(middle - (longest if one.stretches else one.duration), one.time)
            changes[i] = replace(one, latest=latest, longest=longest)
        if other.free and other.earliest < middle:
            changes[i + 1] = replace(other, earliest=min(middle, other.time))
    return changes
