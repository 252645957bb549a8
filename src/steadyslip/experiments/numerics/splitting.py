"""Division of a measured column into ranges in which a straight line, or a constant, fits to within its noise."""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array

EVIDENCE = 60.0  # a split must reduce the squared misfit by this many noise variances; by chance it is far less
MAD_TO_SIGMA = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
FEWEST = 4  # least number of samples in a range
RESOLUTION = 1e-7  # smallest assumed noise of a column, as a share of its range or largest value
MAX_RANGES = 500  # largest number of ranges into which a column is divided
MAX_SWEEPS = 4  # largest number of passes that adjust the ends of the ranges
BRIEFLY = 33  # number of means whose median motion is the usual one; brief motions last less than half as many means
FAST = 10.0  # a motion is fast if it exceeds the usual motion plus its scatter, both times this factor
BESIDE = 4  # samples are also kept in this many means on each side of a fast motion
STAIRCASE_SHARE = 0.2
"""A column that starts or stops changing at a smaller share of its samples is not a staircase due to its resolution."""


def spread(values: Array) -> float:
    """Standard deviation of values, computed from their median absolute deviation; 0 if there are no values."""
    return float(MAD_TO_SIGMA * np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def line(time: Array, values: Array) -> tuple[float, float]:
    """Value at the first time, and slope, of the least-squares line through samples (n,)."""
    t = time - time[0]
    mean = t.mean()
    size = float(np.sum((t - mean) ** 2))
    slope = float(np.sum((t - mean) * (values - values.mean())) / size) if size > 0 else 0.0
    return float(values.mean() - slope * mean), slope


def displacement_noise(time: Array, displacement: Array) -> float:
    """Noise of a displacement column, m, from the deviation of samples from the line through their neighbours."""
    share = (time[2:] - time[1:-1]) / (time[2:] - time[:-2])
    deviations = displacement[1:-1] - share * displacement[:-2] - (1 - share) * displacement[2:]
    white = spread(deviations / np.sqrt(1 + share**2 + (1 - share) ** 2))
    return float(max(white, RESOLUTION * float(np.ptp(displacement)), 0.3 * _stair_height(displacement)))


def level_noise(values: Array) -> float:
    """Noise of a column that is constant between steps, in its unit, from differences between successive samples."""
    white = spread(np.diff(values)) / np.sqrt(2.0)
    return float(max(white, RESOLUTION * float(np.max(np.abs(values))), 0.3 * _stair_height(values)))


def _stair_height(values: Array) -> float:
    """Height of the stairs of a column that is a staircase due to its resolution; 0 for other columns."""
    moved = np.abs(np.diff(values)) > 0
    if np.mean(moved[1:] != moved[:-1]) < STAIRCASE_SHARE:
        return 0.0
    return float(np.quantile(np.abs(np.diff(values))[moved], 0.1))


def ranges_of_means(displacement: Array, step: int, most: int) -> tuple[Array, bool]:
    """Indices of the first samples of ranges that are to be averaged, and True if some ranges are single samples.

    A range has `step` samples. During a motion so brief and fast that averages would hide it, every sample is a range,
    unless more than `most` samples would be.
    """
    from scipy.ndimage import median_filter, uniform_filter1d

    starts = np.arange(0, len(displacement), step)
    moved = np.abs(np.diff(np.add.reduceat(displacement, starts) / np.diff(starts, append=len(displacement))))
    usual = median_filter(moved, BRIEFLY)
    fast = moved > FAST * usual + FAST * spread(moved - usual)
    kept = uniform_filter1d(np.append(fast, False).astype(float), 2 * BESIDE) > 1e-9
    if not np.any(kept) or np.sum(kept) * step > most:
        return starts, False
    single = np.repeat(kept, step)[: len(displacement)]
    return np.flatnonzero(single | (np.arange(len(displacement)) % step == 0)), True


def typical(noise: Array) -> float:
    """Root mean square of standard deviations (n,)."""
    return float(np.sqrt(np.mean(noise * noise)))


def split(time: Array, values: Array, noise: Array | float, linear: bool) -> list[tuple[int, int]]:
    """Ranges of samples (first, one past the last) in which a line, or a constant, fits to within the noise.

    A range is split at the sample at which this reduces the misfit most, as long as the reduction is larger than noise
    explains. `noise` is the standard deviation of the noise, one number or one for each sample (n,).
    """
    noise = np.broadcast_to(noise, len(time))
    waiting = [(0, len(time))]
    done: list[tuple[int, int]] = []
    while waiting:
        i, j = waiting.pop()
        cut, gain = _best_cut(time[i:j], values[i:j], linear)
        if cut and gain > EVIDENCE * typical(noise[i:j]) ** 2 and len(done) + len(waiting) < MAX_RANGES:
            waiting += [(i, i + cut), (i + cut, j)]
        else:
            done.append((i, j))
    return _with_ends_adjusted(sorted(done), time, values, noise, linear)


def _with_ends_adjusted(
    ends: list[tuple[int, int]], time: Array, values: Array, noise: Array, linear: bool
) -> list[tuple[int, int]]:
    """Ranges with each common end moved to the best place, as ranges were split further after it was set."""
    for _ in range(MAX_SWEEPS):
        found = [ends[0]]
        for _, j in ends[1:]:
            i = found.pop()[0]
            cut, gain = _best_cut(time[i:j], values[i:j], linear)
            likely = cut and gain > EVIDENCE * typical(noise[i:j]) ** 2
            found += [(i, i + cut), (i + cut, j)] if likely else [(i, j)]
        if found == ends:
            break
        ends = found
    return ends


def _best_cut(time: Array, values: Array, linear: bool) -> tuple[int, float]:
    """Best index at which to split a range in two (0 for a range too short), and decrease of the squared misfit."""
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
    """Squared misfit (n,) of a line, or of a constant, through the first k points, for k = 1 to n."""
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
