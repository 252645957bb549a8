"""What was commanded in an experiment: rates of the load point, normal stress, and when they changed.

A sensor's noise must not drive a model: it makes errors in variables, which pull the stiffness and the direct effect
down. What drives it is a course found in the measured column: levels, with steps or straight ramps between them, and
a smooth curve where there is no such thing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.results import ReadOnly, read_only

LoadCurve = Callable[[Array], Array]
FELT = 1e-6  # of the highest level: uncertainty that could matter


@dataclass(frozen=True)
class Change:
    """One change of a level.

    Attributes
    ----------
    time : float
        When it begins, s.
    duration : float
        How long it takes, s: a straight ramp; zero if at once.
    before, after : float
        Levels.
    earliest, latest : float
        Between which times it begins, s; equal where the column itself tells exactly.
    shortest, longest : float
        How long it may take, s. Of a step: zero, and the longest ramp that cannot be told from it.
    """

    time: float
    duration: float
    before: float
    after: float
    earliest: float
    latest: float
    shortest: float = 0.0
    longest: float = 0.0

    @property
    def free(self) -> bool:
        """Whether the column leaves open when it begins."""
        return self.latest > self.earliest

    @property
    def stretches(self) -> bool:
        """Whether it is a ramp whose duration the column leaves open."""
        return self.free and self.duration > 0


@dataclass(frozen=True, eq=False)
class Course(ReadOnly):
    """What one channel does: levels, changes between them, and a smooth curve on top.

    Attributes
    ----------
    first : float
        Level before the first change: load-point rate, m/s, or normal stress, Pa.
    changes : tuple of Change
        In order of time.
    errors : ndarray (changes + 1,)
        Standard deviations of the levels, of which all are independent.
    curve : callable or None
        What is added to the levels, at times in s.
    strays : float
        How far the measured column strays from it, m or Pa.
    slips : int
        Sudden changes of the level of a displacement sensor that were left out.
    glitches : int
        Stretches of the column that were left out besides.
    early, late : int
        Samples at the beginning and at the end of the record that do not lie on it: whether the sensor or the loading
        was another there, so few do not tell.
    """

    first: float
    changes: tuple[Change, ...] = ()
    errors: Array = field(default_factory=lambda: np.zeros(1), repr=False)
    curve: LoadCurve | None = field(default=None, repr=False)
    strays: float = 0.0
    slips: int = 0
    glitches: int = 0
    early: int = 0
    late: int = 0

    @property
    def levels(self) -> Array:
        return np.asarray(read_only(np.array([self.first, *(change.after for change in self.changes)])))

    def at(self, time: Array) -> Array:
        """Values at given times, s."""
        knots, values = [-np.inf], [self.first]
        for change in self.changes:
            end = change.time + max(change.duration, 1e-12 * (1 + abs(change.time)))
            knots += [change.time, end]
            values += [change.before, change.after]
        knots[0] = (knots[1] if len(knots) > 1 else 0.0) - 1.0
        found = np.interp(time, knots, values)
        return np.asarray(found if self.curve is None else found + self.curve(time))

    def integral(self, time: Array) -> Array:
        """Its integral from the first of given times."""
        knots = [c.time for c in self.changes] + [c.time + c.duration for c in self.changes]
        inner = [k for k in knots if time[0] < k < time[-1]]
        grid = np.unique(np.concatenate([time, inner]))
        middle = 0.5 * (grid[1:] + grid[:-1])  # each interval lies within one level or ramp, on which this is exact
        gone = np.concatenate([[0.0], np.cumsum(self.at(middle) * np.diff(grid))])
        return np.asarray(gone[np.searchsorted(grid, time)])


@dataclass(frozen=True, eq=False)
class Loading:
    """What was commanded in an experiment.

    Attributes
    ----------
    load : Course or None
        Of the load-point rate; None where it was not measured.
    stress : Course or None
        Of the normal stress; None where it was not measured.
    """

    load: Course | None
    stress: Course | None

    @cached_property
    def changes(self) -> tuple[tuple[str, int, Change], ...]:
        """Channel (``load`` or ``stress``), place in its course, and change itself, in order of time."""
        found = [
            (channel, i, change)
            for channel, course in (("load", self.load), ("stress", self.stress))
            if course is not None
            for i, change in enumerate(course.changes)
        ]
        return tuple(sorted(found, key=lambda one: (one[2].time, one[0])))


def resting_rate(loading: Loading) -> float | None:
    """The rate at which a load point that rests at first moves later, m/s; None where it moves from the start."""
    course = loading.load
    if course is None or course.curve is not None or course.first != 0.0:
        return None
    return next((float(level) for level in course.levels if level > 0), None)


def shifted(loading: Loading, pressed: bool) -> Iterator[Loading]:
    """The loading with each of its levels in turn off by its standard deviation, where that is more than rounding."""
    for channel in ("load", "stress") if pressed else ("load",):
        course = getattr(loading, channel)
        if course is None:
            continue
        levels = course.levels
        for k, error in enumerate(course.errors):
            if not error > FELT * np.max(np.abs(levels)):
                continue
            moved = levels.copy()
            moved[k] += error
            changes = tuple(
                replace(change, before=float(moved[i]), after=float(moved[i + 1]))
                for i, change in enumerate(course.changes)
            )
            yield replace(loading, **{channel: replace(course, first=float(moved[0]), changes=changes)})
