"""Displacement that moves with friction: one measured across the fault, or behind a part of the press that yields."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.kinks import load_course
from steadyslip.experiments.loading.loading import Course

WITH_FRICTION = -0.5
"""Correlation of displacement and friction from which the one moves with the other. Of 50 records of the load point
none was beyond -.05; of 18 measured across the fault 12 were, the others lost in noise or in changes found instead."""
REPEATS = 3  # times that the course is found again
FEWEST = 5  # samples between two changes that show how both move


def yielding(time: Array, displacement: Array, friction: Array, course: Course) -> float | None:
    """Displacement lost per friction (m): what a spring between sensor and load point takes; None if there is none.

    The changes of rate are found again in the displacement without that, until both agree.
    """
    if course.curve is not None or not course.strays > 0:
        return None
    lost, together = _slope(time, displacement - course.integral(time), friction, course)
    if together > WITH_FRICTION:
        return None
    for _ in range(REPEATS):
        course = load_course(time, displacement + lost * friction)
        if course.curve is not None:
            break
        lost, _ = _slope(time, displacement - course.integral(time), friction, course)
    return lost if lost > 0 else None


def _slope(time: Array, strays: Array, friction: Array, course: Course) -> tuple[float, float]:
    """Displacement lost per friction (m) and correlation of both, less a straight line between two changes of rate."""
    both = np.stack([strays, friction])
    edges = np.searchsorted(time, [-np.inf, *(change.time for change in course.changes), np.inf])
    parts = []
    for first, last in pairwise(edges):
        if last - first >= FEWEST:
            line = np.column_stack([np.ones(last - first), time[first:last] - time[first]])
            own = both[:, first:last]
            parts.append(own - (line @ np.linalg.lstsq(line, own.T, rcond=None)[0]).T)
    moved, rose = np.hstack(parts) if parts else np.zeros((2, 1))
    size = float(np.sqrt(np.sum(moved**2) * np.sum(rose**2)))
    together = float(np.sum(moved * rose))
    return (-together / float(np.sum(rose**2)), together / size) if size > 0 else (0.0, 0.0)
