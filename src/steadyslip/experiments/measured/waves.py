"""Removal of periodic errors of a displacement sensor, such as those of a scale, a screw or an encoder.

The error is a sine wave of the position. Without correction, rates fitted to the displacement are wrong, and slips and
changes of the rate are found where there are none. The wave is fitted together with straight lines between the changes
of the rate, and subtracted.
"""

from __future__ import annotations

import operator
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.experiments.loading.kinks import load_course
from steadyslip.experiments.loading.loading import Course
from steadyslip.experiments.measured.record import Record, frozen
from steadyslip.experiments.numerics.splitting import MAD_TO_SIGMA, displacement_noise

GRID = 4096  # equally spaced positions on which a wave is searched: 10 for each period of the shortest wave
FEWEST_PERIODS, MOST_PERIODS = 3, GRID // 10
LEAST_SHARE = 0.2  # least share of the variance about the lines that is due to a wave; correlated noise reaches 0.01
WANDERS = 1.3  # a wave is looked for if deviations from the lines exceed this multiple of the sample-to-sample noise
MANY_SLIPS = 3  # a wave is also looked for if this many slips and glitches were found
ROUNDS = 2  # times that wave and lines are fitted in turn: without the wave, changes of the rate are located better
TURNS = 12  # fixed-point iterations for the position; each multiplies the error by up to 2 pi amplitude / period
STEPS = 20  # most evaluations of a nonlinear fit of a wave: a real wave takes 2 to 4, noise takes hundreds
OUTLIER = 4.0  # samples that deviate by more than this many standard deviations are ignored
AFTER, SETTLED = 0.05, 6.0
"""Part of a run that is ignored at its start, as the servo may still be settling: the share of the run in the first
number, and the second number times the lag of the servo."""
LEAST_GAIN = 0.8  # removal of a wave must reduce deviations, or the number of slips and glitches, to below this share
LEAST_SIZE = 10.0  # least amplitude of a wave, in its standard errors for white noise
WAVE = "was taken out of the displacement"


def without_wave(record: Record) -> Record:
    """Record without the periodic error of its displacement sensor, with a note; `record` itself if there is none."""
    load, moved = record.loading.load, record.displacement
    if load is None or moved is None or record.integrated or load.curve is not None or len(record) < 2 * FEWEST_PERIODS:
        return record
    noise = displacement_noise(record.time, moved)
    if load.strays < WANDERS * noise and load.slips + load.glitches < MANY_SLIPS:
        return record
    travel = float(np.ptp(moved))
    count = _periods(record.time, moved, load) if travel > 0 else None
    if count is None:
        return record
    course, parts = load, _first(record.time, moved, load, count)
    for _ in range(ROUNDS):
        fitted = _fitted(record.time, moved, course, parts)
        if fitted is None:
            return record
        parts, place, error = fitted
        course = load_course(record.time, place)
        if course.curve is not None:
            return record
    size, period = float(np.hypot(*parts[:2])), float(parts[2])
    halved = course.strays < 0.5 * load.strays
    better = course.strays < LEAST_GAIN * load.strays
    fewer = course.slips + course.glitches < LEAST_GAIN * (load.slips + load.glitches) - 1
    told = halved or ((better or fewer) and course.strays < WANDERS * noise)
    if not told or size < LEAST_SIZE * error:
        return record
    note = f"a wave of {format_quantity(size, 'm', 2)} every {format_quantity(period, 'm', 3)} of travel {WAVE}"
    return replace(record, displacement=frozen(place), commanded=replace(record.loading, load=course),
                   notes=(*record.notes, note))  # fmt: skip


def _lines(time: Array, course: Course) -> tuple[Array, Array]:
    """Regressors (n, k) of a straight line for each run between changes of the rate, and mask (n,) of samples to fit.

    Samples just after each change are left out: the load point's response is only known after the wave is removed.
    """
    ends = np.array([time[0], *(change.time for change in course.changes), time[-1]])
    keep = np.ones(len(time), dtype=bool)
    for change, lasts in zip(course.changes, np.diff(ends)[1:], strict=True):
        after = max(AFTER * lasts, SETTLED * change.lag, change.duration)
        keep &= (time < min(change.earliest, change.time)) | (time > change.time + after)
    run = np.searchsorted(ends[1:-1], time, side="right")
    own = run[:, None] == np.unique(run[keep])
    middles = [float(np.mean(time[one & keep])) for one in own.T]
    columns = np.hstack([own, own * (time[:, None] - middles)])
    size = np.linalg.norm(columns[keep], axis=0)
    return columns / np.where(size > 0, size, 1.0), keep


def _periods(time: Array, moved: Array, course: Course) -> float | None:
    """Number of periods in the travel of the strongest wave about the lines; None if no wave is strong enough."""
    lines, keep = _lines(time, course)
    moved, lines = moved[keep], lines[keep]
    left = moved - lines @ np.linalg.lstsq(lines, moved)[0]
    order = np.argsort(moved, kind="stable")
    edges = np.linspace(moved[order[0]], moved[order[-1]], GRID + 1)
    bins = np.clip(np.searchsorted(edges, moved) - 1, 0, GRID - 1)
    number = np.bincount(bins, minlength=GRID)
    known = number > 0
    means = np.bincount(bins, left, minlength=GRID)[known] / number[known]
    even = np.interp(np.arange(GRID), np.flatnonzero(known), means)
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(GRID))) ** 2
    power[:FEWEST_PERIODS] = power[MOST_PERIODS:] = 0.0
    peak = int(np.argmax(power))
    near = power[max(peak - 2, 0) : peak + 3]  # the window spreads a sine over three lines, and one more beside them
    whole = float(np.sum((even - even.mean()) ** 2 * np.hanning(GRID) ** 2)) * GRID / 2
    return float(peak) if np.sum(near) > LEAST_SHARE * whole else None


def _fitted(time: Array, moved: Array, course: Course, start: Array) -> tuple[Array, Array, float] | None:
    """Fit of a wave: parameters (sine and cosine amplitude, period; m), position (n,), standard error of an amplitude.

    The result is None if the fit does not converge, as happens if there is no wave.
    """
    lines, keep = _lines(time, course)

    for _ in range(2):  # the second fit leaves out the outliers of the first fit
        base = np.linalg.qr(lines[keep])[0]

        def left(parts: Array, base: Array = base, own: Array = moved[keep]) -> Array:
            return _orthogonal(_place(own, parts), base)

        def slopes(parts: Array, base: Array = base, own: Array = moved[keep]) -> Array:
            return _orthogonal(_place_slopes(_place(own, parts), parts), base)

        scales = np.append(np.full(2, np.hypot(*start[:2])), start[2] ** 2 / np.ptp(moved))
        found = least_squares(left, start, slopes, x_scale=scales, method="lm", max_nfev=STEPS)
        if not found.success:
            return None
        start = found.x
        off = left(start)
        scale = MAD_TO_SIGMA * float(np.median(np.abs(off)))
        keep[keep] = np.abs(off) < OUTLIER * max(scale, 1e-300)
    return start, _place(moved, start), scale * float(np.sqrt(2 / np.sum(keep)))


def _place(moved: Array, parts: Array) -> Array:
    """Position (n,) of the load point: the measured displacement without the wave, by fixed-point iteration."""
    sine, cosine, period = parts
    place = moved
    for _ in range(TURNS):
        angle = 2 * np.pi / period * place
        place = moved - sine * np.sin(angle) - cosine * np.cos(angle)
    return place


def _place_slopes(place: Array, parts: Array) -> Array:
    """Derivatives (n, 3) of the position by the sine amplitude, the cosine amplitude and the period of the wave."""
    sine, cosine, period = parts
    angle = 2 * np.pi / period * place
    own, other = np.sin(angle), np.cos(angle)
    turned = 2 * np.pi / period * (sine * other - cosine * own)
    found: Array = np.column_stack([-own, -other, turned * place / period]) / (1 + turned)[:, None]
    return found


def _orthogonal(values: Array, base: Array) -> Array:
    """Part of `values` (n, ...) that is orthogonal to the orthonormal columns of `base` (n, k)."""
    return np.asarray(values - base @ (base.T @ values))


def _first(time: Array, moved: Array, course: Course, count: float) -> Array:
    """Amplitudes and period of a wave with about `count` periods in the travel, from a linear fit of wave and lines."""
    lines, keep = _lines(time, course)

    def fit(count: float) -> tuple[float, Array]:
        angle = 2 * np.pi * count / np.ptp(moved) * moved[keep]
        columns = np.column_stack([np.sin(angle), np.cos(angle), lines[keep]])
        found = np.linalg.lstsq(columns, moved[keep])[0]
        return float(np.sum((moved[keep] - columns @ found) ** 2)), found

    counts = count + np.linspace(-1, 1, 17)
    best = min(((*fit(one), one) for one in counts), key=operator.itemgetter(0))
    return np.append(best[1][:2], np.ptp(moved) / best[2])
