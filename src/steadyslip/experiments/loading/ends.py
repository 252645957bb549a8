"""Runs of a few samples before the first straight run of a displacement, and after the last.

The segmentation of the whole record (`runs.py`) finds no change of rate so close to an end. A few samples there are
taken as a run if they lie on a straight line of well-determined forward rate that meets the line of the neighbouring
run. If they do not, like the flank of a glitch, they are left out and reported.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.numerics.splitting import RESOLUTION

OFF_LINE = 6.0  # a sample is off a line if it deviates by more than this number of standard deviations
ON_LINE = 3.0  # a sample is on a line if it deviates by at most this number of standard deviations
RATE_SIGMAS = 4.0  # two rates are different if they differ by more than this number of standard errors
UNKNOWN_RATE = 0.1  # a rate with a larger relative error counts as unknown; chosen by trial
REST_SHARE = 0.1  # few samples count as at rest below this share of the next rate, if 0 is within the error; by trial
CHI_SIGMAS = 4.0  # standard deviations by which the chi squared of samples on a line may exceed its expected value
LONGEST_END = 0.05  # largest number of samples in such a run, as a share of the record's samples; chosen by trial


class Line(Protocol):
    """Straight run of samples with its rate (m/s) and the index of its first sample.

    `levels` holds the displacement (m) at which the line of the run meets the first time of the record, with one more
    value for each slip of the sensor within the run.
    """

    rate: float
    levels: Array

    @property
    def first(self) -> int: ...


def run_at_start(time: Array, displacement: Array, run: Line, noise: float) -> int:
    """Number of samples that form a separate run before the first run; 0 if they form none.

    Parameters
    ----------
    time, displacement : ndarray (n,)
    run : Line
        First run.
    noise : float
        Standard deviation of a sample, m.
    """
    t = time - time[0]
    off = displacement - run.levels[0] - run.rate * t
    rate, first = run.rate, run.first
    while first > 0 and abs(off[first - 1]) <= ON_LINE * noise:  # earlier samples on the line belong to the run
        first -= 1
    if first < 2 or np.any(np.abs(off[:2]) <= OFF_LINE * noise):  # a single sample does not determine a rate
        return 0
    for count in range(first, 1, -1):
        own, x = t[:count], off[:count]
        u = own - own.mean()
        size = float(np.sum(u * u))
        slope, error = float(np.sum(u * x)) / size, noise / np.sqrt(size)
        strays = x - x.mean() - slope * u
        spare = count - 2
        if np.sum(strays**2) > noise**2 * (spare + CHI_SIGMAS * np.sqrt(1 + 2.0 * spare)):
            continue
        before = rate + slope
        rests = abs(before) <= RATE_SIGMAS * error and RATE_SIGMAS * error <= REST_SHARE * abs(rate)
        known = rests or error <= UNKNOWN_RATE * abs(before)
        if not (known and abs(slope) > RATE_SIGMAS * error and before > -RATE_SIGMAS * error):
            return 0
        meet = own.mean() - float(x.mean()) / slope
        unsure = OFF_LINE * float(np.hypot(noise / np.sqrt(count), error * (meet - own.mean()))) / abs(slope)
        latest = t[first] + ON_LINE * noise / abs(slope)
        told = t[count - 1] - unsure <= meet <= latest + unsure and first - count <= count
        return count if told else 0
    return 0


def samples_off_line(time: Array, displacement: Array, run: Line, noise: float) -> int:
    """Number of samples at the start of a record that are off the line of its first run."""
    few = max(int(LONGEST_END * len(time)), 2)
    line = run.levels[0] + run.rate * (time[:few] - time[0])
    off = np.abs(displacement[:few] - line) > OFF_LINE * max(noise, RESOLUTION * float(np.ptp(displacement)))
    if not off[0]:
        return 0
    back = np.flatnonzero(~off)
    return int(back[0]) if len(back) else few


def reversed_column(values: Array) -> Array:
    """Column reversed in time and sign, so that lines keep their slopes."""
    return -np.asarray(values)[::-1]
