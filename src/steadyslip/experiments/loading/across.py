"""Displacement that moves with friction: one measured across the fault, or behind a part of the press that yields."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.kinks import EXACTLY, load_course, slips_and_glitches
from steadyslip.experiments.loading.loading import Course
from steadyslip.experiments.numerics.splitting import level_noise

WITH_FRICTION = -0.5
"""Correlation of displacement and friction from which the one moves with the other. Of 50 records of the load point
none was beyond -.05; of 18 measured across the fault 12 were, the others lost in noise or in changes found instead."""
REPEATS = 3  # times that the course is found again
AS_WELL = 1.2  # ratio of scatters up to which one course follows a displacement as well as another
CERTAIN = 10.0  # standard errors by which a compliance must exceed 0: more than 3, as noise may be correlated
STEPS_OF_TIMES = 6  # of Newton's method for the times of steps; two or three suffice near them
FEWEST = 5  # samples between two changes that show how both move


@dataclass(frozen=True)
class Yielding:
    """Spring between a displacement sensor and the load point.

    Attributes
    ----------
    lost : float
        Displacement that it takes per friction, m.
    course : Course
        Of the load point itself, without that displacement.
    """

    lost: float
    course: Course


def yielding(time: Array, displacement: Array, friction: Array, course: Course) -> Yielding | None:
    """What a spring between sensor and load point takes; None if there is none.

    Displacement moves with friction on the lines of its course, or with fewer changes and friction it is followed as
    well as by a course of more, or late ones. The course is found again without that, until both agree.
    """
    if course.curve is not None or not course.strays > EXACTLY * float(np.ptp(displacement)):
        return None
    slips = np.empty((0, len(time)))
    keep = np.ones(len(time), dtype=bool)
    if course.slips or course.glitches or _is_late(course):
        slips, keep = slips_and_glitches(time, displacement)
    shown = _Shown(time[keep], displacement[keep], friction[keep], slips[:, keep])
    lost, together = shown.slope(course)
    apart = together > WITH_FRICTION
    if apart:
        lost = shown.with_fewer_changes(course)
    if not lost > 0:
        return None
    found = course
    for _ in range(REPEATS):
        found = load_course(time, displacement + lost * friction)
        if found.curve is not None:
            break
        lost, _ = shown.slope(found)
    simple = found.curve is None and not _is_late(found) and len(found.changes) <= len(course.changes)
    return Yielding(lost, found) if lost > 0 and (simple or not apart) else None


def _is_late(course: Course) -> bool:
    """True if the load point follows changes late, or may."""
    return course.otherwise is not None or any(change.lag or change.pieces for change in course.changes)


@dataclass(frozen=True)
class _Shown:
    """What a sensor shows beside friction, where it has no glitch.

    Attributes
    ----------
    time, displacement, friction : ndarray (n,)
    slips : ndarray (k, n)
        1 after each sudden change of the sensor's level, 0 before it.
    """

    time: Array
    displacement: Array
    friction: Array
    slips: Array

    def with_fewer_changes(self, course: Course) -> float:
        """Displacement lost per friction (m) by which steps, as many as a course has or fewer, follow as well; or 0.

        Two changes beside each other may be one at which friction has its peak.
        """
        times = np.array([change.time + change.lag for change in course.changes])
        if not len(times) or (len(times) == 1 and not _is_late(course)):
            return 0.0
        off = self.displacement - (course.otherwise or course).integral(self.time)
        own, noise = float(np.std(_beside(off, self.slips))), level_noise(self.friction)
        while len(times):
            lost, error, strays = self.steps_and_friction(times)
            if strays <= AS_WELL * np.hypot(own, lost * noise) and lost > CERTAIN * error:
                return lost
            if len(times) == 1:
                break
            first = int(np.argmin(np.diff(times)))
            times = np.concatenate([times[:first], [np.mean(times[first : first + 2])], times[first + 2 :]])
        return 0.0

    def steps_and_friction(self, times: Array) -> tuple[float, float, float]:
        """Displacement lost per friction (m), its error, and scatter about steps of rate near some times, and it."""
        t, times = self.time - self.time[0], times - self.time[0]
        rates = np.array([])
        for last in [False] * STEPS_OF_TIMES + [True]:
            since = np.maximum(t - times[:, None], 0.0)
            jumps = [] if last else list(since > 0)  # a jump stands for a change that was earlier or later
            rows = np.column_stack([np.ones_like(t), t, *since, -self.friction, *self.slips, *jumps])
            found, *_ = np.linalg.lstsq(rows, self.displacement)
            if not last:
                rates, levels = found[2 : 2 + len(times)], found[len(found) - len(times) :]
                with np.errstate(all="ignore"):
                    times = np.clip(np.nan_to_num(times - levels / rates), t[1], t[-2])
        off = self.displacement - rows @ found
        scatter = float(np.std(off))
        inverse = np.linalg.pinv(rows.T @ rows)
        return float(found[2 + len(times)]), scatter * float(np.sqrt(inverse[2 + len(times), 2 + len(times)])), scatter

    def slope(self, course: Course) -> tuple[float, float]:
        """Displacement lost per friction (m) and correlation of both, less straight lines between changes of rate."""
        both = np.stack([self.displacement - course.integral(self.time), self.friction])
        edges = np.searchsorted(self.time, [-np.inf, *(change.time for change in course.changes), np.inf])
        parts = [
            np.stack([_beside(one, np.stack([self.time[own] - self.time[own][0], *self.slips[:, own]]))
                      for one in both[:, own]])
            for own in (slice(*pair) for pair in pairwise(edges))
            if own.stop - own.start >= FEWEST
        ]  # fmt: skip
        moved, rose = np.hstack(parts) if parts else np.zeros((2, 1))
        size = float(np.sqrt(np.sum(moved**2) * np.sum(rose**2)))
        together = float(np.sum(moved * rose))
        return (-together / float(np.sum(rose**2)), together / size) if size > 0 else (0.0, 0.0)


def _beside(values: Array, rows: Array) -> Array:
    """What of values (n,) a constant and rows (k, n) leave."""
    columns = np.column_stack([np.ones_like(values), *rows])
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])
