"""Cuts a measured column into ranges on which a straight line, or a level, fits to within its noise."""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array

EVIDENCE = 60.0  # how much the squared misfit must fall, in units of the noise variance
MAD_TO_SIGMA = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
FEWEST = 4  # samples between changes
RESOLUTION = 1e-7  # of the whole range: noise of columns without any
MOST = 500  # ranges
SWEEPS = 4  # in which their ends are put right
STAIRS = 0.2  # share of samples between which a column starts or stops to change: a staircase of its resolution


def spread(values: Array) -> float:
    """Standard deviation from the median, which steps do not disturb."""
    return float(MAD_TO_SIGMA * np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def line(time: Array, values: Array) -> tuple[float, float]:
    """Value at the first time, and slope, by least squares."""
    t = time - time[0]
    mean = t.mean()
    size = float(np.sum((t - mean) ** 2))
    slope = float(np.sum((t - mean) * (values - values.mean())) / size) if size > 0 else 0.0
    return float(values.mean() - slope * mean), slope


def displacement_noise(time: Array, displacement: Array) -> float:
    """Standard deviation of what a sample strays from the line through its neighbours, steps left out."""
    share = (time[2:] - time[1:-1]) / (time[2:] - time[:-2])
    strays = displacement[1:-1] - share * displacement[:-2] - (1 - share) * displacement[2:]
    white = spread(strays / np.sqrt(1 + share**2 + (1 - share) ** 2))
    return float(max(white, RESOLUTION * float(np.ptp(displacement)), 0.3 * _stair(displacement)))


def level_noise(values: Array) -> float:
    """The same of a column that is constant between steps."""
    white = spread(np.diff(values)) / np.sqrt(2.0)
    return float(max(white, RESOLUTION * float(np.max(np.abs(values))), 0.3 * _stair(values)))


def _stair(values: Array) -> float:
    """Height of the stairs of a column that its resolution makes one; zero if it is none."""
    moved = np.abs(np.diff(values)) > 0
    if np.mean(moved[1:] != moved[:-1]) < STAIRS:
        return 0.0
    return float(np.quantile(np.abs(np.diff(values))[moved], 0.1))


def split(time: Array, values: Array, noise: float, linear: bool) -> list[tuple[int, int]]:
    """Ranges of samples on which a line (or a level) fits to within the noise: halved where that helps most."""
    waiting = [(0, len(time))]
    done: list[tuple[int, int]] = []
    while waiting:
        i, j = waiting.pop()
        cut, gain = _best_cut(time[i:j], values[i:j], linear)
        if cut and gain > EVIDENCE * noise**2 and len(done) + len(waiting) < MOST:
            waiting += [(i, i + cut), (i + cut, j)]
        else:
            done.append((i, j))
    return _settled(sorted(done), time, values, EVIDENCE * noise**2, linear)


def _settled(
    ends: list[tuple[int, int]], time: Array, values: Array, least: float, linear: bool
) -> list[tuple[int, int]]:
    """Ranges whose common ends lie where they fit best: halving put the first of them before it knew the others."""
    for _ in range(SWEEPS):
        found = [ends[0]]
        for _, j in ends[1:]:
            i = found.pop()[0]
            cut, gain = _best_cut(time[i:j], values[i:j], linear)
            found += [(i, i + cut), (i + cut, j)] if cut and gain > least else [(i, j)]
        if found == ends:
            break
        ends = found
    return ends


def _best_cut(time: Array, values: Array, linear: bool) -> tuple[int, float]:
    """Where to cut a range in two, and by how much the squared misfit falls."""
    n = len(time)
    if n < 2 * FEWEST:
        return 0, 0.0
    t = time - time.mean()
    y = values - values.mean()
    if linear:
        y = y - t * np.sum(t * y) / max(np.sum(t * t), 1e-300)
    total = float(np.sum(y * y))
    left = _misfits(t, y, linear)
    right = _misfits(-t[::-1], y[::-1], linear)[::-1]
    cuts = np.arange(FEWEST, n - FEWEST + 1)
    both = left[cuts - 1] + right[cuts]
    best = int(np.argmin(both))
    return int(cuts[best]), total - float(both[best])


def _misfits(t: Array, y: Array, linear: bool) -> Array:
    """Squared misfit of a line (or level) through the first 1, 2, ... points."""
    count = np.arange(1, len(t) + 1)
    sy, syy = np.cumsum(y), np.cumsum(y * y)
    result = syy - sy * sy / count
    if linear:
        st, stt, sty = np.cumsum(t), np.cumsum(t * t), np.cumsum(t * y)
        size = stt - st * st / count
        cross = sty - st * sy / count
        with np.errstate(all="ignore"):
            result = result - np.where(size > 0, cross * cross / size, 0.0)
    return np.asarray(np.maximum(result, 0.0))
