"""Straight runs of a measured displacement, found in spite of noise, glitches and slips of the sensor.

The displacement is cut wherever a line no longer fits, also at glitches. Pieces are then joined to runs of one rate:
across excursions that return to the line (glitches), and across sudden changes of level (slips of the sensor). Samples
between two runs are the transition from one rate to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.ends import reversed_column, run_at_start
from steadyslip.experiments.numerics.splitting import MAD_TO_SIGMA, displacement_noise, ranges_of_means, split, typical

RATE_SIGMAS = 4.0  # two rates are different if they differ by more than this number of standard errors
LIKE = 0.02  # two rates are equal if their relative difference is smaller; chosen by trial
LEAST_CHANGE = 0.05  # smallest relative change of rate that counts as a change; chosen by trial
BACK = 5.0  # a displacement is back on a line if it deviates by at most this number of standard errors
LONGEST_GLITCH = 0.2  # longest glitch, as a share of the record's time and of its travel; chosen by trial
CHANGE = 3.0  # cost of a change of rate; a rate that is off by `RATE_SIGMAS` standard errors costs as much; by trial
FRAGMENT = 0.1  # cost of leaving out a piece, in addition to a cost that grows with its length; chosen by trial
SHORTEST = 0.05  # to leave out this share of the record (time or travel) costs as much as a change; chosen by trial
SLIP = 0.01  # longest slip of the sensor, as a share of the record's time; chosen by trial
MAIN = 0.6  # of the samples left out between two pieces, at least this share must be in a separate run; by trial
LEAD = 8.0  # two runs differ if their rates make this difference of travel, in standard deviations of noise; by trial
STRAIGHT = 20  # a short part with this number of samples on a line is no slip of the sensor, which is sudden
PLAIN = 100.0  # a difference of travel, in the same unit, with which a piece of any length is a separate run; by trial
RELIABLE, FEWEST = 8, 5  # least number of samples of a separate run: within a run, at an end of the record; by trial
HELD, FLAT = 20.0, 4
"""Least distance between the lines before and after a brief hold, in standard deviations of the noise; least number of
samples at rest in the hold."""
COARSE = 20_000  # of longer records, means of neighbouring samples are segmented, to limit the time; chosen by trial


@dataclass
class Run:
    """Samples of a displacement with one common rate.

    Attributes
    ----------
    members : list of (int, int)
        Ranges of samples (first, one past the last), in order; gaps between them are glitches.
    rate : float
        m/s.
    groups : list of int
        Index in `levels` of each member; the index grows by 1 at each slip of the sensor.
    levels : ndarray (groups,)
        For each level of the sensor, displacement (m) at which its line meets the first time of the record.
    """

    members: list[tuple[int, int]]
    rate: float = 0.0
    groups: list[int] = field(default_factory=list)
    levels: Array = field(default_factory=lambda: np.zeros(1))

    @property
    def first(self) -> int:
        return self.members[0][0]

    @property
    def last(self) -> int:
        """Index one past the last sample of the run."""
        return self.members[-1][1]

    @property
    def rows(self) -> Array:
        return np.concatenate([np.arange(i, j) for i, j in self.members])

    def reversed(self, time: Array) -> Run:
        """This run, described in the record reversed in time and sign (see `ends.reversed_column`)."""
        count, span = len(time), float(time[-1] - time[0])
        members = [(count - j, count - i) for i, j in reversed(self.members)]
        groups = [self.groups[-1] - group for group in reversed(self.groups)]
        return Run(members, self.rate, groups, -self.levels[::-1] - self.rate * span)


class _Pieces:
    """Straight lines through ranges of samples, with their errors; each attribute has one value for each line."""

    def __init__(self, time: Array, values: Array, ends: list[tuple[int, int]], noise: Array) -> None:
        self.ends = ends
        count = len(ends)
        self.begin = np.array([time[i] for i, _ in ends])
        self.end = np.array([time[j - 1] for _, j in ends])
        self.size = np.array([j - i for i, j in ends])
        self.middle, self.level, self.slope = np.zeros(count), np.zeros(count), np.zeros(count)
        spreads, strays = np.zeros(count), np.zeros(count)
        for k, (i, j) in enumerate(ends):
            t, x = time[i:j], values[i:j]
            self.middle[k], self.level[k] = t.mean(), x.mean()
            spreads[k] = max(float(np.sum((t - t.mean()) ** 2)), 1e-300)
            self.slope[k] = float(np.sum((t - t.mean()) * (x - x.mean()))) / spreads[k]
            strays[k] = float(np.std(x - x.mean() - self.slope[k] * (t - t.mean())))
        usual = float(np.average(strays, weights=self.size))
        self.usual = np.maximum([typical(noise[i:j]) for i, j in ends], usual)
        self.slope_error = self.usual / np.sqrt(spreads)
        self.level_error = self.usual / np.sqrt(self.size)
        self.duration = self.end - self.begin
        self.span = float(time[-1] - time[0])
        self.extent = max(float(np.ptp(values)), 1e-300)
        self.lengths = np.maximum(self.duration / self.span, np.abs(self.slope) * self.duration / self.extent)


def straight_runs(time: Array, displacement: Array, lasting: Array | None = None) -> list[Run]:
    """Straight runs of a displacement, in order of time; neighbouring runs have different rates.

    Parameters
    ----------
    time, displacement : ndarray (n,)
        s, m.
    lasting : ndarray (n,), optional
        Standard deviation (m), at each sample, of white noise equivalent to the correlated noise of the sensor. It is
        needed because differences of neighbouring samples show correlated noise only in part.
    """
    lasting = np.zeros(len(time)) if lasting is None else lasting
    step = -(-len(time) // COARSE)
    if step > 1:
        starts, brief = ranges_of_means(displacement, step, COARSE)
        counts = np.diff(starts, append=len(time))
        own = displacement_noise(time, displacement) if brief else 0.0
        rough, means, hidden = (np.add.reduceat(values, starts) / counts for values in (time, displacement, lasting))
        runs = _runs_of(rough, means, np.maximum(hidden / np.sqrt(step), own))
        ends = np.append(starts, len(time)).tolist()
        for run in runs:
            run.members = [(ends[i], ends[j]) for i, j in run.members]
        return _with_exact_boundaries(runs, step, time, displacement, lasting)
    return _runs_of(time, displacement, lasting)


def _runs_of(time: Array, displacement: Array, lasting: Array) -> list[Run]:
    """Straight runs of a displacement, by segmentation of all its samples."""
    noise = np.maximum(displacement_noise(time, displacement), lasting)
    pieces = _Pieces(time, displacement, split(time, displacement, noise, linear=True), noise)
    groups = _with_holds(_segmented(pieces), pieces)
    count = len(groups) + 1
    while len(groups) < count:
        count = len(groups)
        groups = _joined_across_wander(_without_glitches(_joined_by_rate(groups, pieces), pieces), pieces)
    runs = [fitted_run(Run([pieces.ends[k] for k in members]), time, displacement, lasting) for members in groups]
    noise = np.maximum(noise, np.min(pieces.usual))
    runs = [part for run in runs for part in _parted_by_holds(run, time, displacement, noise, lasting)]
    runs = _joined_across_flanks(runs, time, displacement, noise, lasting)
    return _with_ends(runs, time, displacement, noise, lasting)


def _with_ends(runs: list[Run], time: Array, displacement: Array, noise: Array, lasting: Array) -> list[Run]:
    """Runs, with a further run before the first and after the last if a few samples there determine another rate.

    A very short first or last run is removed and its samples examined again, as they may contain a change of rate.
    """
    found, count = list(runs), len(time)
    if len(found) > 1 and found[0].last <= RELIABLE:
        found = found[1:]
    if len(found) > 1 and count - found[-1].first <= RELIABLE:
        found = found[:-1]
    sides = (
        (found[0], time, displacement),
        (found[-1].reversed(time), reversed_column(time), reversed_column(displacement)),
    )
    noises = typical(noise[found[0].rows]), typical(noise[found[-1].rows])
    own = [run_at_start(t, x, run, size) for (run, t, x), size in zip(sides, noises, strict=True)]
    if own[0]:
        found.insert(0, fitted_run(Run([(0, own[0])]), time, displacement, lasting))
    if own[1]:
        found.append(fitted_run(Run([(count - own[1], count)]), time, displacement, lasting))
    return found


def _with_exact_boundaries(runs: list[Run], step: int, time: Array, displacement: Array, lasting: Array) -> list[Run]:
    """Runs that were found on means of `step` samples, with each boundary moved to the sample where the lines meet."""
    runs = [fitted_run(run, time, displacement, lasting) for run in runs]
    for before, after in pairwise(runs):
        if before.last != after.first or before.rate == after.rate:
            continue
        meet = time[0] + (before.levels[-1] - after.levels[0]) / (after.rate - before.rate)
        sample = int(np.searchsorted(time, meet))
        first, last = before.members[-1][0], after.members[0][1]
        if abs(sample - before.last) <= 2 * step and first + 1 < sample < last - 1:
            before.members[-1], after.members[0] = (first, sample), (sample, last)
    return [fitted_run(run, time, displacement, lasting) for run in runs]


def _parted_by_holds(run: Run, time: Array, displacement: Array, noise: Array, lasting: Array) -> list[Run]:
    """Runs before, within and after each hold that is so brief that it was taken for a slip of the sensor."""
    parts, own = [], [run.members[0]]
    for k, other in enumerate(run.members[1:]):
        lines = [run.levels[group] + run.rate * (time - time[0]) for group in run.groups[k : k + 2]]
        rows = slice(own[-1][1] - 2, other[0] + 2)
        held = _brief_hold(lines, run.rate, rows, displacement, typical(noise[rows]))
        if held is None:
            own.append(other)
            continue
        first, last = held
        parts += [[*own[:-1], (own[-1][0], min(own[-1][1], first))], [held]]
        own = [(max(other[0], last), other[1])]
    return [run] if not parts else [fitted_run(Run(m), time, displacement, lasting) for m in [*parts, own]]


def _brief_hold(
    lines: list[Array], rate: float, rows: slice, displacement: Array, noise: float
) -> tuple[int, int] | None:
    """Range of samples at rest between two lines of the same rate; None if the samples show a slip of the sensor."""
    x, before, after = (column[rows] for column in (displacement, *lines))
    drop = float(before[0] - after[0])
    if drop * rate <= 0 or abs(drop) < HELD * noise:
        return None
    level, sign = float(np.median(x)), np.sign(rate)
    for _ in range(3):  # the level depends on which samples are at rest, and these depend on the level
        flat = (sign * (before - level) > 0) & (sign * (after - level) < 0)
        if np.sum(flat) < FLAT:
            return None
        level = float(np.mean(x[flat]))
    model = np.where(flat, level, np.where(sign * (before - level) <= 0, before, after))
    first = rows.start + int(np.argmax(flat))
    return (first, first + int(np.sum(flat))) if np.max(np.abs(x - model)) <= BACK * noise else None


def _joined_across_flanks(
    runs: list[Run], time: Array, displacement: Array, noise: Array, lasting: Array | None = None
) -> list[Run]:
    """Runs joined across the flanks of glitches: short runs after which the displacement continues as before.

    The bottom of a glitch may look like a new level of the sensor; its flank then looks like a run of another rate.
    """
    runs, i = list(runs), 0
    while i < len(runs) - 2:
        before, middle, after = runs[i : i + 3]
        if _is_continued(before, middle, after, time, noise):
            runs[i : i + 3] = [fitted_run(Run(before.members + after.members), time, displacement, lasting)]
            i = max(i - 1, 0)
        else:
            i += 1
    return runs


def _is_continued(before: Run, middle: Run, after: Run, time: Array, noise: Array) -> bool:
    """True if the runs `before` and `after` are on one line and the run `middle` between them is short."""
    if time[middle.last - 1] - time[middle.first] > LONGEST_GLITCH * (time[-1] - time[0]):
        return False
    at, errors, lines = 0.5 * (time[middle.first] + time[middle.last - 1]), [], []
    for run in (before, after):
        t = time[run.rows]
        size = typical(noise[run.rows])
        slope = size / np.sqrt(max(float(np.sum((t - t.mean()) ** 2)), 1e-300))
        errors.append((slope, float(np.hypot(size / np.sqrt(len(t)), slope * (at - t.mean())))))
        lines.append(run.levels + run.rate * (at - time[0]))
    if not _rates_agree((before.rate, errors[0][0]), (after.rate, errors[1][0])):
        return False
    known = BACK * float(np.hypot(errors[0][1], errors[1][1]))
    return bool(np.min(np.abs(lines[0] - lines[1][0])) <= known)


def _segmented(pieces: _Pieces) -> list[list[int]]:
    """Indices of the pieces that form each run, in the segmentation of least cost.

    A piece either has the rate of its run within its error, or is left out at a cost that grows with its length; each
    change of rate also has a cost. The rate of a run is that of one of the pieces; dynamic programming finds the best.
    """
    count = len(pieces.ends)
    error = np.hypot(pieces.slope_error, LIKE / RATE_SIGMAS * np.abs(pieces.slope))
    with np.errstate(all="ignore"):
        misfit = ((pieces.slope[:, None] - pieces.slope[None, :]) / np.maximum(error, 1e-300)[:, None]) ** 2
    misfit[np.arange(count), np.arange(count)] = 0.0
    price = FRAGMENT + CHANGE * pieces.lengths / SHORTEST
    cost = np.minimum(misfit * (CHANGE / RATE_SIGMAS**2), price[:, None])
    total, origin = np.zeros((count, count)), np.zeros((count, count), dtype=int)
    total[0] = cost[0]
    everyone = np.arange(count)
    for k in range(1, count):
        best = int(np.argmin(total[k - 1]))
        moves = total[k - 1] > total[k - 1, best] + CHANGE
        origin[k] = np.where(moves, best, everyone)
        total[k] = np.where(moves, total[k - 1, best] + CHANGE, total[k - 1]) + cost[k]
    own = np.empty(count, dtype=int)
    own[-1] = int(np.argmin(total[-1]))
    for k in range(count - 1, 0, -1):
        own[k - 1] = origin[k, own[k]]
    inside = cost[everyone, own] < price * (1 - 1e-9)  # lower by more than rounding errors
    inside |= everyone == own
    found: list[list[int]] = []
    for k in range(count):
        if k == 0 or own[k] != own[k - 1]:
            found.append([])
        if inside[k]:
            found[-1].append(k)
    return [members for members in found if members]


def _with_holds(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Indices of the pieces of each run; pieces that leave a run's line for good (short holds) become runs."""
    found = []
    for members in groups:
        rate, _ = _mean_slope(members, pieces)
        own = [members[0]]
        for one, other in pairwise(members):
            if main := _separate_run(np.arange(one + 1, other), rate, pieces.begin[other] - pieces.end[one], pieces):
                found += [own, main]
                own = []
            own.append(other)
        found.append(own)
    (first, early), (last, late) = ((m, _mean_slope(m, pieces)[0]) for m in (groups[0], groups[-1]))
    before = _separate_run(np.arange(first[0]), early, None, pieces)
    after = _separate_run(np.arange(last[-1] + 1, len(pieces.ends)), late, None, pieces)
    return [members for members in (before, *found, after) if members]


def _separate_run(inner: Array, rate: float, gap: float | None, pieces: _Pieces) -> list[int]:
    """Indices of the pieces, among the pieces `inner` left out of a run, that form a separate run; empty if none do.

    If the `gap` (s) that these pieces leave in a run is short, they are taken for a slip of the sensor. At an end of
    the record, the gap is None.
    """
    if not len(inner):
        return []
    away = (pieces.slope[inner] - rate) * pieces.duration[inner]
    longest = int(inner[np.argmax(pieces.duration[inner])])
    slope, error = float(pieces.slope[longest]), float(pieces.slope_error[longest])
    like = RATE_SIGMAS * np.hypot(pieces.slope_error[inner], error) + LIKE * np.maximum(abs(slope), abs(rate))
    main = inner[np.abs(pieces.slope[inner] - slope) <= like]
    usual = typical(pieces.usual[inner])
    lasting = abs(np.sum(away)) > max(LEAD * usual, 0.7 * float(np.sum(np.abs(away))))  # does not return to the line
    whole = np.sum(pieces.size[main]) > MAIN * np.sum(pieces.size[inner]) and np.sum(pieces.size[main]) >= (
        RELIABLE if gap is not None else FEWEST
    )
    # at rest within its error, which must be small compared with the rate
    still = abs(slope) < 0.02 * abs(rate) + RATE_SIGMAS * error and RATE_SIGMAS * error < 0.05 * abs(rate)
    far = np.sum(pieces.lengths[main]) > SHORTEST or abs(np.sum(away)) > PLAIN * usual
    long = (gap is None or gap > SLIP * pieces.span or pieces.size[longest] >= STRAIGHT) and far
    return [int(k) for k in main] if lasting and whole and (still or long) else []


def _without_glitches(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Runs without glitches: excursions that return to the line, or that are off the lines of both neighbours."""
    groups = list(groups)
    i = 0
    while i < len(groups) - 2:
        for j in range(min(i + 5, len(groups) - 1), i + 1, -1):
            if _is_glitch(groups[i], groups[i + 1 : j], groups[j], pieces):
                one, other = (_mean_slope(groups[k], pieces) for k in (i, j))
                if _rates_agree(one, other):
                    groups[i : j + 1] = [groups[i] + groups[j]]
                else:
                    groups[i : j + 1] = [groups[i], groups[j]]
                i = max(i - 2, -1)
                break
        i += 1
    return groups


def _is_glitch(before: list[int], between: list[list[int]], after: list[int], pieces: _Pieces) -> bool:
    one, other = before[-1], after[0]
    zone = pieces.begin[other] - pieces.end[one]
    ends = [pieces.level[k] + pieces.slope[k] * (t[k] - pieces.middle[k])
            for k, t in ((one, pieces.end), (other, pieces.begin))]  # fmt: skip
    if zone > LONGEST_GLITCH * pieces.span or abs(ends[1] - ends[0]) > LONGEST_GLITCH * pieces.extent:
        return False
    rates = _mean_slope(before, pieces), _mean_slope(after, pieces)
    inner = np.arange(one + 1, other)
    if _rates_agree(*rates):
        away = (pieces.slope[inner] - rates[0][0]) * pieces.duration[inner]
        return bool(abs(np.sum(away)) < 0.5 * np.sum(np.abs(away)))
    low, high = sorted((rates[0][0], rates[1][0]))
    off = [_mean_slope(members, pieces)[0] for members in between]
    if all(low - LIKE * abs(high) <= rate <= high + LIKE * abs(high) for rate in off):
        return False
    first, last = ((pieces.level[k], pieces.middle[k], rate) for k, (rate, _) in zip((one, other), rates, strict=True))
    meet = (last[0] - last[2] * last[1] - first[0] + first[2] * first[1]) / (rates[0][0] - rates[1][0])
    return bool(pieces.end[one] <= meet <= pieces.begin[other])


def _rates_agree(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """True if two rates, each given with its error, agree."""
    like = LEAST_CHANGE * max(abs(one[0]), abs(other[0]))
    return abs(one[0] - other[0]) <= RATE_SIGMAS * float(np.hypot(one[1], other[1])) + like


def _mean_slope(members: list[int], pieces: _Pieces) -> tuple[float, float]:
    weight = 1.0 / np.maximum(pieces.slope_error[members], 1e-300) ** 2
    return float(np.sum(weight * pieces.slope[members]) / np.sum(weight)), float(1 / np.sqrt(np.sum(weight)))


def _joined_by_rate(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Runs after joining neighbours whose rates agree."""
    found: list[list[int]] = []
    for members in groups:
        if found and _rates_agree(_mean_slope(found[-1], pieces), _mean_slope(members, pieces)):
            found[-1] = found[-1] + members
        else:
            found.append(list(members))
    return found


def _joined_across_wander(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Runs after joining neighbours that differ no more than slow drift of the sensor would make them differ."""
    groups = list(groups)
    while len(groups) > 1:
        slopes = np.array([_mean_slope(members, pieces)[0] for members in groups])
        lengths = np.array([pieces.end[m[-1]] - pieces.begin[m[0]] for m in groups])
        usual = np.array([typical(pieces.usual[m]) for m in groups])
        shorter = np.where(lengths[1:] < lengths[:-1], usual[1:], usual[:-1])
        leads = np.abs(np.diff(slopes)) * np.minimum(lengths[1:], lengths[:-1]) / shorter
        weakest = int(np.argmin(leads))
        if leads[weakest] >= LEAD:
            break
        groups[weakest : weakest + 2] = [groups[weakest] + groups[weakest + 1]]
    return groups


def fitted_run(run: Run, time: Array, displacement: Array, lasting: Array | None = None) -> Run:
    """Run with its rate and sensor levels from a robust line fit; members whose levels agree get the same level.

    Levels are different if their difference exceeds its error. The error is computed from the scatter of the samples,
    or from `lasting` (see `straight_runs`) if that is larger.
    """
    lasting = np.zeros(1) if lasting is None else lasting[run.rows]
    groups = list(range(len(run.members)))
    rate, levels, centres, errors, own = _robust_line(run, groups, time, displacement, lasting)
    for _ in range(3):
        merged = [0]
        for k in range(1, len(run.members)):
            one, other = groups[k - 1], groups[k]
            known = np.sqrt(errors[one] ** 2 + errors[other] ** 2 + (own * (centres[one] - centres[other])) ** 2)
            same = abs(levels[one] - levels[other]) <= BACK * known
            merged.append(merged[-1] + (0 if same else 1))
        if merged == groups:
            break
        groups = merged
        rate, levels, centres, errors, own = _robust_line(run, groups, time, displacement, lasting)
    return Run(run.members, rate, groups, levels)


def _robust_line(
    run: Run, groups: list[int], time: Array, displacement: Array, lasting: Array
) -> tuple[float, Array, Array, Array, float]:
    """Rate, levels, mean time and error of each level, and error of the rate, from a line robust against outliers."""
    rows = run.rows
    own = np.repeat(groups, [j - i for i, j in run.members])
    t, x = time[rows] - time[0], displacement[rows]
    count = max(groups) + 1
    weight = np.ones(len(rows))
    for _ in range(12):
        total = np.bincount(own, weight, count)
        mean_t, mean_x = np.bincount(own, weight * t, count) / total, np.bincount(own, weight * x, count) / total
        u = t - mean_t[own]
        size = max(float(np.sum(weight * u * u)), 1e-300)
        rate = float(np.sum(weight * u * (x - mean_x[own]))) / size
        levels = mean_x - rate * mean_t
        r = x - levels[own] - rate * t
        scale = MAD_TO_SIGMA * float(np.median(np.abs(r)))
        if not scale > 0:
            break
        weight = 1.0 / (1.0 + (r / (2 * scale)) ** 2)
    inside, scale = np.bincount(own, minlength=count), max(scale, typical(lasting))
    return rate, levels, mean_t, scale / np.sqrt(inside), scale / np.sqrt(size)
