"""What a displacement does in the few samples before its first run and after its last.

So few samples price no change of rate in the story of all (see `runs.py`). They are a run of their own where they tell
it by themselves: they lie on one straight line, forward, whose rate is sure, and which leads up to the line of all that
follows. What does not, as a flank of a glitch, is left out, and told.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.numerics.splitting import RESOLUTION

OFF = 6.0  # standard deviations from a line: not on it
ON = 3.0  # the same: most likely on it
SURE = 4.0  # standard errors by which rates must differ
VAGUE = 0.1  # error of a rate, as a share of it, beyond which it is not known
STILL = 0.1  # of the rate of what follows: below, what so few samples do is rest, where the error allows it
SCATTER = 4.0  # deviations of a chi squared by which samples of one line may scatter
LONGEST = 0.05  # share of the samples of a record that an end is


class Line(Protocol):
    """What is asked of a run: its rate, its levels at the first time of the record, the sample with which it begins."""

    rate: float
    levels: Array

    @property
    def first(self) -> int: ...


def run_at_start(time: Array, displacement: Array, run: Line, noise: float) -> int:
    """How many samples of a record make up a run of their own before the first run; zero for none.

    Parameters
    ----------
    time, displacement : ndarray (n,)
    run : Line
        The first.
    noise : float
        Standard deviation of a sample, m.
    """
    t = time - time[0]
    off = displacement - run.levels[0] - run.rate * t
    rate, first = run.rate, run.first
    while first > 0 and abs(off[first - 1]) <= ON * noise:  # on the line of the run, which cuts put a little late
        first -= 1
    if first < 2 or np.any(np.abs(off[:2]) <= OFF * noise):  # one sample alone has no rate
        return 0
    for count in range(first, 1, -1):
        own, x = t[:count], off[:count]
        u = own - own.mean()
        size = float(np.sum(u * u))
        slope, error = float(np.sum(u * x)) / size, noise / np.sqrt(size)
        strays = x - x.mean() - slope * u
        spare = count - 2
        if np.sum(strays**2) > noise**2 * (spare + SCATTER * np.sqrt(1 + 2.0 * spare)):
            continue
        before = rate + slope
        rests = abs(before) <= SURE * error and SURE * error <= STILL * abs(rate)
        known = rests or error <= VAGUE * abs(before)
        if not (known and abs(slope) > SURE * error and before > -SURE * error):
            return 0
        meet = own.mean() - float(x.mean()) / slope
        unsure = OFF * float(np.hypot(noise / np.sqrt(count), error * (meet - own.mean()))) / abs(slope)
        latest = t[first] + ON * noise / abs(slope)
        told = t[count - 1] - unsure <= meet <= latest + unsure and first - count <= count
        return count if told else 0
    return 0


def off_the_line(time: Array, displacement: Array, run: Line, noise: float) -> int:
    """How many samples at the start of a record are not on the line of its first run."""
    few = max(int(LONGEST * len(time)), 2)
    line = run.levels[0] + run.rate * (time[:few] - time[0])
    off = np.abs(displacement[:few] - line) > OFF * max(noise, RESOLUTION * float(np.ptp(displacement)))
    if not off[0]:
        return 0
    back = np.flatnonzero(~off)
    return int(back[0]) if len(back) else few


def turned(values: Array) -> Array:
    """A column as it is seen from its other end: lines keep their slopes."""
    return -np.asarray(values)[::-1]
