"""Commanded loading of an experiment: rates of the load point, normal stress, and their changes.

Noise of a sensor must not drive a model: errors in variables bias the stiffness and the direct effect to low values. A
model is driven by a `Course` fitted to the measured column: levels joined by steps or straight ramps, and a smooth
curve where these do not fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.results import ReadOnly, read_only
from steadyslip.experiments.loading.servo import ramps

LoadCurve = Callable[[Array], Array]
Pieces = tuple[tuple[float, float, float], ...]
SLIGHT = 1.5  # ratio of rates up to which a change may be waviness of a sensor: commanded ones are larger
FELT = 1e-6  # error of a level, relative to the highest, below which it has no effect on a fit


def is_slight(before: float, after: float) -> bool:
    """True for two rates so close that they may be one."""
    return bool(before > 0 < after and max(before, after) < SLIGHT * min(before, after))


@dataclass(frozen=True)
class Change:
    """One change of a level.

    Attributes
    ----------
    time : float
        Time at which it begins, s.
    duration : float
        Duration of a straight ramp, s; zero for a step.
    before, after : float
        Levels.
    earliest, latest : float
        Range of the time at which it may begin, s; equal if the column determines it.
    shortest, longest : float
        Range of the duration, s. For a step: zero, and the longest ramp that fits as well.
    lag, damping : float
        Of a servo that follows a step late (see `steadyslip.experiments.loading.servo`), s and 1; `time` is then that
        of the command. Zero where the level changes at once or along a ramp.
    pieces : tuple of (float, float, float)
        Straight ramps of a level that follows in a way of its own: begin after `time` (s), duration (s), share of the
        change; empty otherwise.
    """

    time: float
    duration: float
    before: float
    after: float
    earliest: float
    latest: float
    shortest: float = 0.0
    longest: float = 0.0
    lag: float = 0.0
    damping: float = 0.0
    pieces: Pieces = ()

    @property
    def ramps(self) -> tuple[tuple[float, float, float], ...]:
        """Straight ramps of which it consists: begin after `time` (s), duration (s) and share of the change."""
        if self.pieces:
            return self.pieces
        return ramps(self.lag, self.damping) if self.lag else ((0.0, self.duration, 1.0),)

    @property
    def free(self) -> bool:
        """True if the column does not determine when it begins."""
        return self.latest > self.earliest

    @property
    def slight(self) -> bool:
        """True for a change of rate so small that it may be none but waviness of the sensor."""
        return is_slight(self.before, self.after)

    @property
    def stretches(self) -> bool:
        """True for a ramp whose duration the column does not determine."""
        return self.free and self.duration > 0


@dataclass(frozen=True, eq=False)
class Course(ReadOnly):
    """Commanded course of one channel: levels, changes between them, and a smooth curve added to them.

    Attributes
    ----------
    first : float
        Level before the first change: load-point rate (m/s) or normal stress (Pa).
    changes : tuple of Change
        In order of time.
    errors : ndarray (changes + 1,)
        Standard deviations of the levels, which are independent.
    curve : callable or None
        Function of time (s) added to the levels.
    strays : float
        Standard deviation of the measured column from the course, m or Pa.
    slips : int
        Number of sudden changes of a displacement sensor's level that were left out.
    glitches : int
        Number of other parts of the column that were left out.
    early, late : int
        Number of samples at the beginning and at the end of the record that are not on the course; too few to tell if
        the sensor or the loading differed.
    servos : tuple of (float, float)
        Lag (s) and damping ratio of servos one standard deviation from that of the changes, in independent directions.
    shapes : tuple of (ndarray (changes + 1,), sequence of ndarray)
        Levels, and shares of each change in its pieces, one standard deviation from those of the course in independent
        directions; where there are some, they stand for the errors of the levels too.
    otherwise : Course or None
        One with changes made of pieces that follow the column, if that is beside this course by more than its noise: a
        load point that follows in a way of its own, or glitches of the sensor.
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
    servos: tuple[tuple[float, float], ...] = ()
    shapes: tuple[tuple[Array, Sequence[Array]], ...] = field(default=(), repr=False)
    otherwise: Course | None = field(default=None, repr=False)

    @property
    def levels(self) -> Array:
        return np.asarray(read_only(np.array([self.first, *(change.after for change in self.changes)])))

    def at(self, time: Array) -> Array:
        """Values at given times (s)."""
        knots, values = [-np.inf], [self.first]
        for change in self.changes:
            level = change.before
            for since, duration, share in change.ramps:
                begin = change.time + since
                knots += [begin, begin + max(duration, 1e-12 * (1 + abs(begin)))]
                values += [level, level := level + share * (change.after - change.before)]
        knots[0] = (knots[1] if len(knots) > 1 else 0.0) - 1.0
        found = np.interp(time, knots, values)
        return np.asarray(found if self.curve is None else found + self.curve(time))

    def within(self, start: float, end: float) -> Course:
        """Part of the course between two times (s), in which no change is under way: levels, errors and changes."""
        met = [change.time + change.lag for change in self.changes]
        first, last = (int(np.searchsorted(met, moment)) for moment in (start, end))
        own = slice(first, last + 1)
        shapes = tuple((levels[own], shares[first:last]) for levels, shares in self.shapes)
        further = None if self.otherwise is None else self.otherwise.within(start, end)
        return replace(
            self, first=float(self.levels[first]), changes=self.changes[first:last], errors=self.errors[own],
            shapes=shapes, otherwise=further, slips=0, glitches=0, early=0, late=0,
        )  # fmt: skip

    def lowered(self, by: float) -> Course:
        """The same course with all levels less `by`."""
        changes = tuple(replace(one, before=one.before - by, after=one.after - by) for one in self.changes)
        return replace(self, first=self.first - by, changes=changes)

    def integral(self, time: Array) -> Array:
        """Integral from the first of given times."""
        knots = [c.time + t for c in self.changes for since, length, _ in c.ramps for t in (since, since + length)]
        inner = [k for k in knots if time[0] < k < time[-1]]
        grid = np.unique(np.concatenate([time, inner]))
        middle = 0.5 * (grid[1:] + grid[:-1])  # the midpoint rule is exact: each interval is in one level or ramp
        gone = np.concatenate([[0.0], np.cumsum(self.at(middle) * np.diff(grid))])
        return np.asarray(gone[np.searchsorted(grid, time)])


@dataclass(frozen=True, eq=False)
class Loading:
    """Commanded loading of an experiment.

    Attributes
    ----------
    load : Course or None
        Course of the load-point rate; None if it was not measured.
    stress : Course or None
        Course of the (total) normal stress; None if it was not measured.
    pore : Course or None
        Course of the pore pressure around the contact; None if it was not measured.
    """

    load: Course | None
    stress: Course | None
    pore: Course | None = None

    def within(self, start: float, end: float) -> Loading:
        """Loading between two times (s), as found in the whole record."""
        parts = (None if one is None else one.within(start, end) for one in (self.load, self.stress, self.pore))
        return Loading(*parts)

    @cached_property
    def changes(self) -> tuple[tuple[str, int, Change], ...]:
        """(channel, index, change) in order of time; the channel is ``load``, ``stress`` or ``pore``."""
        found = [
            (channel, i, change)
            for channel, course in (("load", self.load), ("stress", self.stress), ("pore", self.pore))
            if course is not None
            for i, change in enumerate(course.changes)
        ]
        return tuple(sorted(found, key=lambda one: (one[2].time, one[0])))


def as_followed(loading: Loading, pieces: bool) -> Loading:
    """Loading with the load point as it moves in pieces, where there is such a course, or as it was commanded."""
    load = loading.load
    if load is None or load.otherwise is None:
        return loading
    return replace(loading, load=load.otherwise if pieces else replace(load, otherwise=None))


def with_reference(loading: Loading) -> Loading:
    """Loading in which one change at least has a known time: the first step, where its column shows it, if none has.

    A lag of friction has no effect beside times that are all free: all would move together.
    """
    if any(not change.free for _, _, change in loading.changes):
        return loading
    first = next((one for one in loading.changes if not one[2].duration), None)
    if first is None:
        return loading
    channel, i, change = first
    course = getattr(loading, channel)
    known = replace(change, earliest=change.time, latest=change.time)
    return replace(
        loading, **{channel: replace(course, changes=(*course.changes[:i], known, *course.changes[i + 1 :]))}
    )


def resting_rate(loading: Loading) -> float | None:
    """Rate (m/s) at which a load point moves after an initial rest; None if it moves from the start."""
    course = loading.load
    if course is None or course.curve is not None or course.first != 0.0:
        return None
    return next((float(level) for level in course.levels if level > 0), None)


def _with_shares(change: Change, shares: Array) -> Change:
    """Change with other shares of its pieces."""
    pieces = zip(change.pieces, shares.tolist(), strict=True)
    return replace(change, pieces=tuple((since, lasts, share) for (since, lasts, _), share in pieces))


def _with_levels(course: Course, levels: Array, changes: Sequence[Change]) -> Course:
    """Course with changes between other levels."""
    ends = pairwise(levels.tolist())
    own = tuple(replace(one, before=low, after=high) for one, (low, high) in zip(changes, ends, strict=True))
    return replace(course, first=float(levels[0]), changes=own)


def raised(course: Course) -> Iterator[Course]:
    """Courses one standard deviation from it in levels and shapes: each level where its error is above rounding."""
    levels = course.levels
    for others, shares in course.shapes:
        yield _with_levels(course, others, [_with_shares(*pair) for pair in zip(course.changes, shares, strict=True)])
    for k, error in enumerate(() if course.shapes else course.errors):
        if error > FELT * np.max(np.abs(levels)):
            moved = levels.copy()
            moved[k] += error
            yield _with_levels(course, moved, course.changes)


def shifted(loading: Loading, pressed: bool) -> Iterator[Loading]:
    """Loadings with one level of stress each raised by its standard deviation, and with other servos."""
    for channel in ("load", "stress", "pore") if pressed else ("load",):
        course = getattr(loading, channel)
        if course is None:
            continue
        for moved in () if channel == "load" else raised(course):
            yield replace(loading, **{channel: moved})
        for lag, damping in course.servos:
            changes = tuple(
                replace(one, time=one.time + one.lag - lag, lag=lag, damping=damping) if one.lag else one
                for one in course.changes
            )
            yield replace(loading, **{channel: replace(course, changes=changes)})
