"""Finds the straight runs of a measured displacement, through noise, glitches and slips of the sensor.

The displacement is cut wherever a line no longer fits, which cuts at glitches too. Pieces then join into runs of one
rate: across what comes back to the same line (a glitch), and across a sudden change of level (a slip of the sensor).
What lies between two runs and belongs to neither is the way from one rate to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.ends import run_at_start, turned
from steadyslip.experiments.numerics.splitting import displacement_noise, split

SURE = 4.0  # standard errors by which rates must differ, and
LIKE = 0.02  # share of the rate
LEAST_CHANGE = 0.05  # share of the rate that counts as a change of it
BACK = 5.0  # standard errors within which a displacement has come back to a line
LONGEST_GLITCH = 0.2  # share of the time of a record
CHANGE = 3.0  # price of a change of rate
FRAGMENT = 0.1  # price of a piece that is left out, besides that of its length:
SHORTEST = 0.05  # share of the record, in time or displacement, that is worth a change of rate
SLIP = 0.01  # share of the time of a record that a slip of the sensor may take
MAIN = 0.6  # share of what is left out between two pieces that one of them makes up: a run of its own
LEAD = 8.0  # how far a change of rate must lead, in units of how far a displacement strays from straight lines
PLAIN = 100.0  # how far a piece must lead, in the same units, to be a run of its own however short
RELIABLE, FEWEST = 8, 5  # samples of such a piece, within a run and at an end of the record
COARSE = 20_000  # samples on which runs are looked for


@dataclass
class Run:
    """Samples that share one rate.

    Attributes
    ----------
    members : list of (int, int)
        Ranges of samples, in order; what lies between them are glitches.
    rate : float
        m/s.
    groups : list of int
        For each member: which level of the sensor it lies on.
    levels : ndarray (groups,)
        Displacement that the line of each level has at the first time of the record, m.
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
        """The sample behind the last."""
        return self.members[-1][1]

    @property
    def rows(self) -> Array:
        return np.concatenate([np.arange(i, j) for i, j in self.members])

    def turned(self, time: Array) -> Run:
        """The run as it is in turned columns."""
        count, span = len(time), float(time[-1] - time[0])
        members = [(count - j, count - i) for i, j in reversed(self.members)]
        groups = [self.groups[-1] - group for group in reversed(self.groups)]
        return Run(members, self.rate, groups, -self.levels[::-1] - self.rate * span)


class _Pieces:
    """Lines through ranges of samples, and how well they are known."""

    def __init__(self, time: Array, values: Array, ends: list[tuple[int, int]], noise: float) -> None:
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
        self.usual = max(noise, float(np.average(strays, weights=self.size)))
        self.slope_error = self.usual / np.sqrt(spreads)
        self.level_error = self.usual / np.sqrt(self.size)
        self.duration = self.end - self.begin
        self.span = float(time[-1] - time[0])
        self.extent = max(float(np.ptp(values)), 1e-300)
        self.lengths = np.maximum(self.duration / self.span, np.abs(self.slope) * self.duration / self.extent)


def straight_runs(time: Array, displacement: Array) -> list[Run]:
    """The runs of a displacement, in order of time; neighbours differ in rate.

    Parameters
    ----------
    time, displacement : ndarray (n,)
        s, m.
    """
    step = -(-len(time) // COARSE)
    if step > 1:
        runs = straight_runs(*(_means(values, step) for values in (time, displacement)))
        for run in runs:
            run.members = [(i * step, min(j * step, len(time))) for i, j in run.members]
        return _parted(runs, step, time, displacement)
    noise = displacement_noise(time, displacement)
    pieces = _Pieces(time, displacement, split(time, displacement, noise, linear=True), noise)
    groups = _with_holds(_chosen(pieces), pieces)
    count = len(groups) + 1
    while len(groups) < count:
        count = len(groups)
        groups = _without_wander(_without_excursions(_of_one_rate(groups, pieces), pieces), pieces)
    runs = [levelled(Run([pieces.ends[k] for k in members]), time, displacement) for members in groups]
    return _with_ends(_without_returns(runs, time, displacement, pieces.usual), time, displacement, pieces.usual)


def _with_ends(runs: list[Run], time: Array, displacement: Array, noise: float) -> list[Run]:
    """Runs of their own of the few samples before the first run and behind the last, where they tell a rate.

    A run so short at an end is asked again, as the ranges that it is made of may have a kink within.
    """
    found, count = list(runs), len(time)
    if len(found) > 1 and found[0].last <= RELIABLE:
        found = found[1:]
    if len(found) > 1 and count - found[-1].first <= RELIABLE:
        found = found[:-1]
    sides = ((found[0], time, displacement), (found[-1].turned(time), turned(time), turned(displacement)))
    own = [run_at_start(t, x, run, noise) for run, t, x in sides]
    if own[0]:
        found.insert(0, levelled(Run([(0, own[0])]), time, displacement))
    if own[1]:
        found.append(levelled(Run([(count - own[1], count)]), time, displacement))
    return found


def _parted(runs: list[Run], step: int, time: Array, displacement: Array) -> list[Run]:
    """Runs that were found on means of so many samples, neighbours parted at the very sample where their lines meet."""
    runs = [levelled(run, time, displacement) for run in runs]
    for before, after in pairwise(runs):
        if before.last != after.first or before.rate == after.rate:
            continue
        meet = time[0] + (before.levels[-1] - after.levels[0]) / (after.rate - before.rate)
        sample = int(np.searchsorted(time, meet))
        first, last = before.members[-1][0], after.members[0][1]
        if abs(sample - before.last) <= 2 * step and first + 1 < sample < last - 1:
            before.members[-1], after.members[0] = (first, sample), (sample, last)
    return [levelled(run, time, displacement) for run in runs]


def _without_returns(runs: list[Run], time: Array, displacement: Array, noise: float) -> list[Run]:
    """Runs joined across a short one after which the displacement goes on as if it had not been: a flank of a glitch.

    Its bottom may have passed for a level of the sensor, so that the flank alone looked like a change of rate.
    """
    runs, i = list(runs), 0
    while i < len(runs) - 2:
        before, middle, after = runs[i : i + 3]
        if _goes_on(before, middle, after, time, noise):
            runs[i : i + 3] = [levelled(Run(before.members + after.members), time, displacement)]
            i = max(i - 1, 0)
        else:
            i += 1
    return runs


def _goes_on(before: Run, middle: Run, after: Run, time: Array, noise: float) -> bool:
    """Whether one run goes on along a line of the other, beyond a short one in between."""
    if time[middle.last - 1] - time[middle.first] > LONGEST_GLITCH * (time[-1] - time[0]):
        return False
    at, errors, lines = 0.5 * (time[middle.first] + time[middle.last - 1]), [], []
    for run in (before, after):
        t = time[run.rows]
        slope = noise / np.sqrt(max(float(np.sum((t - t.mean()) ** 2)), 1e-300))
        errors.append((slope, float(np.hypot(noise / np.sqrt(len(t)), slope * (at - t.mean())))))
        lines.append(run.levels + run.rate * (at - time[0]))
    if not _alike((before.rate, errors[0][0]), (after.rate, errors[1][0])):
        return False
    known = BACK * float(np.hypot(errors[0][1], errors[1][1]))
    return bool(np.min(np.abs(lines[0] - lines[1][0])) <= known)


def _means(values: Array, step: int) -> Array:
    whole = len(values) // step * step
    return np.asarray(values[:whole].reshape(-1, step).mean(axis=1))


def _chosen(pieces: _Pieces) -> list[list[int]]:
    """Pieces that make up each run: the cheapest story, in which a change of rate and what is left out have a price.

    Every piece either has the rate of the run that it lies in, within its error, or is left out, at a price that grows
    with its length. The best of all such stories is found by dynamic programming over the rates of all pieces.
    """
    count = len(pieces.ends)
    error = np.hypot(pieces.slope_error, LIKE / SURE * np.abs(pieces.slope))
    with np.errstate(all="ignore"):
        misfit = ((pieces.slope[:, None] - pieces.slope[None, :]) / np.maximum(error, 1e-300)[:, None]) ** 2
    misfit[np.arange(count), np.arange(count)] = 0.0
    price = FRAGMENT + CHANGE * pieces.lengths / SHORTEST
    cost = np.minimum(misfit * (CHANGE / SURE**2), price[:, None])
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
    inside = cost[everyone, own] < price * (1 - 1e-9)
    inside |= everyone == own
    found: list[list[int]] = []
    for k in range(count):
        if k == 0 or own[k] != own[k - 1]:
            found.append([])
        if inside[k]:
            found[-1].append(k)
    return [members for members in found if members]


def _with_holds(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Runs of their own of long pieces that lead away from a run's line for good, such as short holds."""
    found = []
    for members in groups:
        rate, _ = _mean_slope(members, pieces)
        own = [members[0]]
        for one, other in pairwise(members):
            if main := _leading_away(np.arange(one + 1, other), rate, pieces.begin[other] - pieces.end[one], pieces):
                found += [own, main]
                own = []
            own.append(other)
        found.append(own)
    (first, early), (last, late) = ((m, _mean_slope(m, pieces)[0]) for m in (groups[0], groups[-1]))
    before = _leading_away(np.arange(first[0]), early, None, pieces)
    after = _leading_away(np.arange(last[-1] + 1, len(pieces.ends)), late, None, pieces)
    return [members for members in (before, *found, after) if members]


def _leading_away(inner: Array, rate: float, gap: float | None, pieces: _Pieces) -> list[int]:
    """Those of some pieces, left out of a run, that are a run of their own.

    Within a run, what is over soon (`gap`, s) is a slip of the sensor. At an end of the record there is no `gap`.
    """
    if not len(inner):
        return []
    away = (pieces.slope[inner] - rate) * pieces.duration[inner]
    longest = int(inner[np.argmax(pieces.duration[inner])])
    slope, error = float(pieces.slope[longest]), float(pieces.slope_error[longest])
    like = SURE * np.hypot(pieces.slope_error[inner], error) + LIKE * np.maximum(abs(slope), abs(rate))
    main = inner[np.abs(pieces.slope[inner] - slope) <= like]
    lasting = abs(np.sum(away)) > max(LEAD * pieces.usual, 0.7 * float(np.sum(np.abs(away))))
    whole = np.sum(pieces.size[main]) > MAIN * np.sum(pieces.size[inner]) and np.sum(pieces.size[main]) >= (
        RELIABLE if gap is not None else FEWEST
    )
    still = abs(slope) < 0.02 * abs(rate) + SURE * error and SURE * error < 0.05 * abs(rate)
    far = np.sum(pieces.lengths[main]) > SHORTEST or abs(np.sum(away)) > PLAIN * pieces.usual
    long = (gap is None or gap > SLIP * pieces.span) and far
    return [int(k) for k in main] if lasting and whole and (still or long) else []


def _without_excursions(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Leave out runs that are parts of a glitch: what moves up and down again between two runs, or off their lines."""
    groups = list(groups)
    i = 0
    while i < len(groups) - 2:
        for j in range(min(i + 5, len(groups) - 1), i + 1, -1):
            if _is_glitch(groups[i], groups[i + 1 : j], groups[j], pieces):
                one, other = (_mean_slope(groups[k], pieces) for k in (i, j))
                if _alike(one, other):
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
    if zone > LONGEST_GLITCH * pieces.span:
        return False
    rates = _mean_slope(before, pieces), _mean_slope(after, pieces)
    inner = np.arange(one + 1, other)
    if _alike(*rates):
        away = (pieces.slope[inner] - rates[0][0]) * pieces.duration[inner]
        return bool(abs(np.sum(away)) < 0.5 * np.sum(np.abs(away)))
    low, high = sorted((rates[0][0], rates[1][0]))
    off = [_mean_slope(members, pieces)[0] for members in between]
    if all(low - LIKE * abs(high) <= rate <= high + LIKE * abs(high) for rate in off):
        return False
    first, last = ((pieces.level[k], pieces.middle[k], rate) for k, (rate, _) in zip((one, other), rates, strict=True))
    meet = (last[0] - last[2] * last[1] - first[0] + first[2] * first[1]) / (rates[0][0] - rates[1][0])
    return bool(pieces.end[one] <= meet <= pieces.begin[other])


def _alike(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two rates, each with its error, agree."""
    like = LEAST_CHANGE * max(abs(one[0]), abs(other[0]))
    return abs(one[0] - other[0]) <= SURE * float(np.hypot(one[1], other[1])) + like


def _mean_slope(members: list[int], pieces: _Pieces) -> tuple[float, float]:
    weight = 1.0 / np.maximum(pieces.slope_error[members], 1e-300) ** 2
    return float(np.sum(weight * pieces.slope[members]) / np.sum(weight)), float(1 / np.sqrt(np.sum(weight)))


def _of_one_rate(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Join neighbours whose rates agree."""
    found: list[list[int]] = []
    for members in groups:
        if found and _alike(_mean_slope(found[-1], pieces), _mean_slope(members, pieces)):
            found[-1] = found[-1] + members
        else:
            found.append(list(members))
    return found


def _without_wander(groups: list[list[int]], pieces: _Pieces) -> list[list[int]]:
    """Join runs that a slowly wandering displacement, not a change of rate, has set apart; the weakest first."""
    groups = list(groups)
    while len(groups) > 1:
        slopes = np.array([_mean_slope(members, pieces)[0] for members in groups])
        lengths = np.array([pieces.end[m[-1]] - pieces.begin[m[0]] for m in groups])
        leads = np.abs(np.diff(slopes)) * np.minimum(lengths[1:], lengths[:-1])
        weakest = int(np.argmin(leads))
        if leads[weakest] >= LEAD * pieces.usual:
            break
        groups[weakest : weakest + 2] = [groups[weakest] + groups[weakest + 1]]
    return groups


def levelled(run: Run, time: Array, displacement: Array) -> Run:
    """The run with its rate and the levels of the sensor, by a robust line; neighbours on one level share it."""
    groups = list(range(len(run.members)))
    for _ in range(3):
        rate, levels, centres, errors, own = _robust_line(run, groups, time, displacement)
        merged = [0]
        for k in range(1, len(run.members)):
            one, other = groups[k - 1], groups[k]
            known = np.sqrt(errors[one] ** 2 + errors[other] ** 2 + (own * (centres[one] - centres[other])) ** 2)
            same = abs(levels[one] - levels[other]) <= BACK * known
            merged.append(merged[-1] + (0 if same else 1))
        if merged == groups:
            break
        groups = merged
    rate, levels, *_ = _robust_line(run, groups, time, displacement)
    return Run(run.members, rate, groups, levels)


def _robust_line(
    run: Run, groups: list[int], time: Array, displacement: Array
) -> tuple[float, Array, Array, Array, float]:
    """Rate, levels, their mean times and errors, error of the rate; samples far off weigh less."""
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
        scale = 1.4826 * float(np.median(np.abs(r)))
        if not scale > 0:
            break
        weight = 1.0 / (1.0 + (r / (2 * scale)) ** 2)
    inside = np.bincount(own, minlength=count)
    return rate, levels, mean_t, scale / np.sqrt(inside), scale / np.sqrt(size)
