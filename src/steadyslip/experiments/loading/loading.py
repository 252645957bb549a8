"""Commanded loading of an experiment: rates of the load point, normal stress, pore pressure, and their changes.

Noise of a sensor must not drive a model: it would bias the stiffness and the direct effect to low values (errors in
variables). Instead, a model is driven by a `Course` fitted to the measured column: levels joined by steps or straight
ramps, or a smooth curve if these do not fit.
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
SLIGHT = 1.5  # changes of rate by a smaller factor may be waviness of a sensor: commanded changes are larger
FELT = 1e-6  # an error of a level that is smaller, relative to the highest level, has no effect on a fit


def is_slight(before: float, after: float) -> bool:
    """True if two rates (m/s) are positive and so close that their difference may be an error of the sensor."""
    return bool(before > 0 < after and max(before, after) < SLIGHT * min(before, after))


@dataclass(frozen=True)
class Change:
    """Change of a rate or pressure: a step, a straight ramp, a step with the late response of a servo, or many ramps.

    Attributes
    ----------
    time : float
        Time at which the change begins, s.
    duration : float
        Duration of a straight ramp, s; zero for a step.
    before, after : float
        Levels before and after the change: load-point rate (m/s) or pressure (Pa).
    earliest, latest : float
        Range of possible times at which the change begins, s; equal if the column determines the time.
    shortest, longest : float
        Range of the duration, s. For a step: zero, and the duration of the longest ramp that fits as well.
    lag, damping : float
        Lag (s) and damping ratio of a servo that responds late to a step (see
        `steadyslip.experiments.loading.servo`); `time` is then the time of the command. Zero for a step or ramp.
    pieces : tuple of (float, float, float)
        Straight ramps of a change that is neither a step, a ramp nor the response of a servo: begin after `time` (s),
        duration (s), share of the change; empty for other changes.
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
        """Straight ramps that make up the change: begin after `time` (s), duration (s) and share of the change."""
        if self.pieces:
            return self.pieces
        return ramps(self.lag, self.damping) if self.lag else ((0.0, self.duration, 1.0),)

    @property
    def free(self) -> bool:
        """True if the measured column does not determine the time at which the change begins."""
        return self.latest > self.earliest

    @property
    def slight(self) -> bool:
        """True for a change of rate so small that it may be waviness of the sensor."""
        return is_slight(self.before, self.after)

    @property
    def stretches(self) -> bool:
        """True for a ramp whose duration the measured column does not determine."""
        return self.free and self.duration > 0


@dataclass(frozen=True, eq=False)
class Course(ReadOnly):
    """Commanded load-point rate or pressure over time: levels, changes between them, and a smooth curve added to them.

    Attributes
    ----------
    first : float
        Level before the first change: load-point rate (m/s) or normal stress (Pa).
    changes : tuple of Change
        In order of time.
    errors : ndarray (changes + 1,)
        Standard deviations of the levels, whose errors are independent.
    curve : callable or None
        Function of time (s) added to the levels.
    strays : float
        Standard deviation of the measured column from the course, m or Pa.
    slips : int
        Number of sudden changes of a displacement sensor's level that were left out.
    glitches : int
        Number of faulty parts of the column, other than slips, that were left out.
    early, late : int
        Number of samples at the beginning and at the end of the record that are off the course; they are too few to
        decide whether the sensor or the loading is the cause.
    servos : tuple of (float, float)
        Lag (s) and damping ratio one standard deviation from those of the changes, in independent directions.
    shapes : tuple of (ndarray (changes + 1,), sequence of ndarray)
        Levels, and shares of each change in its pieces, one standard deviation from those of the course in independent
        directions; if there are any, they include the errors of the levels.
    otherwise : Course or None
        Second course whose changes consist of `pieces`, if the column around changes deviates from this course by more
        than its noise: the load point may respond neither at once nor as a servo, or the sensor may have glitches.
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
        """Values (n,) at given times (s)."""
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
        """Part of the course between two times (s); no change may be under way at these times."""
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
        """Course with `by` subtracted from all levels."""
        changes = tuple(replace(one, before=one.before - by, after=one.after - by) for one in self.changes)
        return replace(self, first=self.first - by, changes=changes)

    def integral(self, time: Array) -> Array:
        """Integral (n,) of the course from the first of given times (s) to each of them."""
        knots = [c.time + t for c in self.changes for since, length, _ in c.ramps for t in (since, since + length)]
        inner = [k for k in knots if time[0] < k < time[-1]]
        grid = np.unique(np.concatenate([time, inner]))
        middle = 0.5 * (grid[1:] + grid[:-1])  # the midpoint rule is exact within a level or ramp
        gone = np.concatenate([[0.0], np.cumsum(self.at(middle) * np.diff(grid))])
        return np.asarray(gone[np.searchsorted(grid, time)])


@dataclass(frozen=True, eq=False)
class Loading:
    """Commanded loading of an experiment: courses of load-point rate, normal stress and pore pressure.

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
        """Part of the loading between two times (s), as found in the whole record."""
        parts = (None if one is None else one.within(start, end) for one in (self.load, self.stress, self.pore))
        return Loading(*parts)

    @cached_property
    def changes(self) -> tuple[tuple[str, int, Change], ...]:
        """Changes of all channels in order of time, as (channel, index in its course, change).

        The channel is ``load``, ``stress`` or ``pore``.
        """
        found = [
            (channel, i, change)
            for channel, course in (("load", self.load), ("stress", self.stress), ("pore", self.pore))
            if course is not None
            for i, change in enumerate(course.changes)
        ]
        return tuple(sorted(found, key=lambda one: (one[2].time, one[0])))


def as_followed(loading: Loading, pieces: bool) -> Loading:
    """Loading with one course of the load point: `otherwise` if `pieces` is true and it exists, else the first."""
    load = loading.load
    if load is None or load.otherwise is None:
        return loading
    return replace(loading, load=load.otherwise if pieces else replace(load, otherwise=None))


def with_reference(loading: Loading) -> Loading:
    """Loading in which at least one change has a known time; if none has, the time of the first step is fixed.

    If all times were free, a lag of friction would have no effect, as all times could shift together.
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
    """First rate (m/s) of a load point that rests initially; None if it moves from the start."""
    course = loading.load
    if course is None or course.curve is not None or course.first != 0.0:
        return None
    return next((float(level) for level in course.levels if level > 0), None)


def _with_shares(change: Change, shares: Array) -> Change:
    """Copy of a change in which the ramps `pieces` make new shares (pieces,) of the change."""
    pieces = zip(change.pieces, shares.tolist(), strict=True)
    return replace(change, pieces=tuple((since, lasts, share) for (since, lasts, _), share in pieces))


def _with_levels(course: Course, levels: Array, changes: Sequence[Change]) -> Course:
    """Course with new levels and changes between them."""
    ends = pairwise(levels.tolist())
    own = tuple(replace(one, before=low, after=high) for one, (low, high) in zip(changes, ends, strict=True))
    return replace(course, first=float(levels[0]), changes=own)


def raised(course: Course) -> Iterator[Course]:
    """Copies of a course, each with one of its shapes or levels changed by one standard deviation."""
    levels = course.levels
    for others, shares in course.shapes:
        yield _with_levels(course, others, [_with_shares(*pair) for pair in zip(course.changes, shares, strict=True)])
    for k, error in enumerate(() if course.shapes else course.errors):
        if error > FELT * np.max(np.abs(levels)):
            moved = levels.copy()
            moved[k] += error
            yield _with_levels(course, moved, course.changes)


def shifted(loading: Loading, pressed: bool) -> Iterator[Loading]:
    """Copies of a loading, each with one level, shape or servo response changed by one standard deviation.

    If `pressed` is true, levels of normal stress and pore pressure are also changed.
    """
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
