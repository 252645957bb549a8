"""Removal of faulty friction samples: cut off at a limit of the channel, far off their neighbours, or far off a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.splitting import level_noise, spread

SHORTEST = 3  # least number of successive equal samples that may show a limit of the channel
CHANCE = 1e-6  # largest probability that a run of equal samples occurs in the record by chance
GAP = 5  # runs at most this many samples apart are one peak: noise brings the channel below its limit for a moment
PLATEAU, QUIET = 10, 0.3
"""Least number of samples of a plateau, and largest noise on it as a share of the record's noise. A random walk, or
white noise about a peak, has a plateau that long and that quiet once in 1e7 cases."""
STILL = 1e-3  # a channel stands still if it changes by less than this share of its median change between samples
CLIPPED = "at a limit of the channel"
BESIDE = 2  # number of neighbours on each side with which a sample is compared
WILD_SIZE, WILD_RANGE = 20.0, 4.0
"""A sample is faulty if it is further from the median of its neighbours than both limits: the first in standard
deviations of the noise (as `OUTLIER_SIZE`), the second in ranges of the neighbours, as these differ at a true peak."""
AFTER = 4  # number of samples after a change of the loading in which a single high sample may be a peak of friction
LARGEST_DIRECT = 0.05  # largest height of a true peak after a rate change by a factor e: twice the largest a of rocks
WILD = "far off the samples beside"
OFF_FIT = "so far off the fit that half of its misfit and more was there"
OUTLIER_SIZE = 20.0  # smallest residual of an outlier, in root mean squares of the other residuals
MAX_OUTLIERS = 2e-3  # largest share of samples that may be outliers; more of them have a common cause


def without_clipped(record: Record) -> Record:
    """Record without the samples at which friction or shear stress is at a limit of its channel, with a note."""
    full = np.zeros(len(record), dtype=bool)
    for values in (record.friction, record.shear):
        if values is not None:
            for own in (values, -values):
                full |= clipped(own) | flattened(own)
    return _without(record, full, CLIPPED)


def without_wild(record: Record) -> Record:
    """Record without single samples of friction that are far off their neighbours, with a note.

    Samples that may be a peak of friction after a change of the loading are kept. If the displacement was not measured,
    the times of these changes are unknown and all samples are kept.
    """
    if record.loading.load is None or len(record) < 10 * BESIDE:
        return record
    away, out = _off_neighbours(record.friction)
    for channel, _, change in record.loading.changes:
        first, last = np.searchsorted(record.time, [change.earliest, change.latest + change.duration])
        near = slice(max(first - BESIDE, 0), last + AFTER)
        if channel == "load" and min(change.before, change.after) > 0:  # a peak rises with the rate, or falls with it
            share = away[near] / np.log(change.after / change.before)
            out[near] &= (share < 0) | (share > LARGEST_DIRECT)
        else:
            out[near] = False
    return _without(record, out, WILD)


def without_outliers(record: Record, residuals: Array) -> Record:
    """Record without outliers: few samples with half of the sum of squares of `residuals` (n,), if there are such."""
    squares = residuals**2
    order = np.argsort(-squares)
    gone = np.cumsum(squares[order])
    half = int(np.searchsorted(gone, 0.5 * gone[-1])) + 1
    rest = (gone[-1] - gone[half - 1]) / len(squares)
    out = np.zeros(len(record), dtype=bool)
    if half <= max(MAX_OUTLIERS * len(squares), 1) and squares[order[half - 1]] > OUTLIER_SIZE**2 * rest:
        out[order[:half]] = True
    return _without(record, out, OFF_FIT)


def _without(record: Record, out: Array, why: str) -> Record:
    """Record without the samples for which the mask `out` (n,) is true, with a note; its loading remains the same."""
    if not np.any(out):
        return record
    first, last = record.time[out][[0, -1]]
    where = f"from {first:.7g} to {last:.7g} s" if last > first else f"at {first:.7g} s"
    note = f"{np.sum(out)} of the samples {where} left out, friction is {why}"
    return replace(record.taken(~out, note), commanded=record.loading)


def _off_neighbours(values: Array) -> tuple[Array, Array]:
    """Deviation (n,) of each value from the median of its neighbours, and mask (n,) of values that are far off."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, BESIDE, mode="reflect"), 2 * BESIDE + 1)
    beside = np.delete(windows, BESIDE, axis=1)
    away = values - np.median(beside, axis=1)
    least = np.maximum(WILD_SIZE * level_noise(values), WILD_RANGE * np.ptp(beside, axis=1))
    return away, np.abs(away) > least


def clipped(values: Array) -> Array:
    """Mask (n,) of samples at an upper limit of the channel: the largest value repeated more often than by chance."""
    found = np.zeros(len(values), dtype=bool)
    top = np.flatnonzero(values == np.max(values))
    if len(top) < SHORTEST:
        return found
    equal = np.diff(values) == 0
    others = equal[(values[1:] != values[top[0]]) & (values[:-1] != values[top[0]])]
    if np.all(others):
        return found
    share = float(np.mean(others))
    longest = 1 + np.log(CHANCE / len(values)) / np.log(share) if share else 0.0
    for peak in np.split(top, np.flatnonzero(np.diff(top) > GAP) + 1):
        runs = np.split(peak, np.flatnonzero(np.diff(peak) > 1) + 1)
        if max(map(len, runs)) >= max(longest, SHORTEST) and _is_cut_off(values, peak):
            found[peak[0] : peak[-1] + 1] = True
    return found


def flattened(values: Array) -> Array:
    """Mask (n,) of samples at an upper limit of the channel: plateaus at the largest values, quieter than the noise.

    The channel cuts off peaks with the noise on them; later stages of the amplifier add noise to the flat top.
    """
    found = np.zeros(len(values), dtype=bool)
    noise = spread(np.diff(values, 2)) / np.sqrt(6.0)
    near = np.flatnonzero(values >= np.max(values) - noise)
    for peak in np.split(near, np.flatnonzero(np.diff(near) > GAP) + 1):
        first, last = int(peak[0]), int(peak[-1]) + 1
        beside = np.concatenate([values[max(first - PLATEAU, 0) : first], values[last : last + PLATEAU]])
        inside = first > 0 and last < len(values) and len(peak) >= PLATEAU
        if inside and np.std(values[first:last]) < QUIET * noise and np.mean(beside) < np.min(values[peak]) - noise:
            found[first:last] = True
    return found


def _is_cut_off(values: Array, peak: Array) -> bool:
    """True if values (n,) reach and leave a peak abruptly, unlike friction that approaches steady sliding."""
    if peak[0] == 0 or peak[-1] == len(values) - 1:
        return False
    moved = np.abs(np.diff(values))
    least = STILL * np.median(moved[moved > 0])
    return bool(min(moved[peak[0] - 1], moved[peak[-1]]) > least)
