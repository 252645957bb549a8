"""Displacement that moves with friction: one measured across the fault, or behind a part of the press that yields.

It is that of the load point less what a spring takes: few steps of the rate with friction beside them then follow it as
well as a course of its own does. On a soft press such a course has changes and servos that are friction's doing, so
that the times of steps are sought with friction beside them from the start.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.kinks import EXACTLY, load_course, slips_and_glitches
from steadyslip.experiments.loading.loading import Course
from steadyslip.experiments.numerics.noise import lag_one
from steadyslip.experiments.numerics.splitting import displacement_noise, level_noise

WITH_FRICTION = -0.5
"""Correlation of displacement and friction from which the one moves with the other. Of 50 records of the load point
none was beyond -.05; of 18 measured across the fault 12 were, the others lost in noise or in changes found instead."""
REPEATS = 3  # times that the course is found again
MARGIN = 5.0  # samples' worth of squared noise that steps with friction may leave more than a course
BESIDE = 2.0  # times its noise from sample to sample that a displacement strays from its course, if that follows it
SLOW = 2.0  # times its noise from sample to sample that friction's is at most
CERTAIN = 8.0  # standard errors by which a compliance must exceed 0; of 270 records of the load point two were beyond
MOST_MEMORY = 0.9  # correlation of neighbouring samples that these errors count, at most
ROUGHLY = 2.0  # factor by which means of samples may stray more than these
KEPT = 0.5  # share of a compliance that a course found without it leaves of it
MEANS = 200  # of samples, between which steps are sought
MOST_STEPS = 6  # that are sought
EXCHANGES = 4  # of all steps for better ones; one or two suffice
STEPS_OF_TIMES = 6  # of Newton's method for the times of steps; two or three suffice near them
FEWEST = 5  # samples between two changes that show how both move
APART = 2  # samples beside one; chosen by trial
SINGULAR = 1e-6  # share of a column that the others leave, below which it is one of them


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
    if not course.strays > EXACTLY * float(np.ptp(displacement)):
        return None
    slips = np.empty((0, len(time)))
    keep = np.ones(len(time), dtype=bool)
    if course.slips or course.glitches or _is_late(course):
        slips, keep = slips_and_glitches(time, displacement)
    shown = _Shown(time[keep], displacement[keep], friction[keep], slips[:, keep])
    found, lost = course, shown.with_friction(course)
    least = KEPT * lost
    for _ in range(REPEATS if lost > 0 else 0):
        found = load_course(time, displacement + lost * friction)
        if not _is_late(found):
            break
        lost, _ = shown.slope(found)
    doubtful = _is_late(found) and len(found.changes) > len(course.changes)
    return Yielding(lost, found) if lost > least and not doubtful else None


def _is_late(course: Course) -> bool:
    """True if the load point follows changes late, in a way of its own, or may."""
    late = any(change.lag or change.pieces for change in course.changes)
    return late or course.otherwise is not None or course.curve is not None


@dataclass(frozen=True)
class _Shown:
    """What a sensor shows beside friction, where it has no glitch.

    Attributes
    ----------
    time, displacement, friction : ndarray (n,)
    slips : ndarray (k, n)
        1 after each sudden change of the sensor's level, 0 before it.
    apart : int
        Samples to those whose friction stands for that of one, without the noise of its own.
    """

    time: Array
    displacement: Array
    friction: Array
    slips: Array
    apart: int = APART

    def with_friction(self, course: Course) -> float:
        """Displacement lost per friction (m): by steps of the rate, or by what a course leaves; 0 where it is none."""
        lost, together = self.slope(course)
        return self.with_steps(course) or (lost if together <= WITH_FRICTION else 0.0)

    def with_steps(self, course: Course) -> float:
        """Displacement lost per friction (m) by which the fewest steps of the rate follow as well as a course; or 0."""
        off = self.displacement - (course.otherwise or course).integral(self.time)
        astray = np.std(off) > BESIDE * displacement_noise(self.time, self.displacement)
        smooth = course.otherwise is not None or course.curve is not None
        means, off_means = self._means(off)
        for times in means.steps(MOST_STEPS if astray or smooth else len(course.changes)):
            if means.lost_beside(times, off_means, smooth, ROUGHLY) > 0:
                found = self.lost_beside(times, off, smooth)
                if found > 0:
                    return found
        return 0.0

    def lost_beside(self, times: Array, off: Array, smooth: bool, leeway: float = 1.0) -> float:
        """Displacement lost per friction (m) if steps near some times and friction leave no more than a course does.

        Parameters
        ----------
        times : ndarray (k,)
            s.
        off : ndarray (n,)
            Displacement less a course, m.
        smooth : bool
            True for a course with so many parameters that some of the noise is in it.
        leeway : float, optional
            Factor by which they may leave more.
        """
        lost, error, strays = self.steps_and_friction(times)
        noise = displacement_noise(self.time, self.displacement)
        own = min(float(np.std(_beside(off, self.slips))), BESIDE * noise)
        own = max(own, noise) if smooth else own
        own *= 1 + MARGIN / len(off)
        most = leeway * float(np.hypot(own, SLOW * lost * level_noise(self.friction)))
        return lost if lost > CERTAIN / leeway * error and strays <= most else 0.0

    def _means(self, off: Array) -> tuple[_Shown, Array]:
        """The same of means of neighbouring samples, and means of `off` (n,): they move with friction alike."""
        starts = np.arange(0, len(self.time), -(-len(self.time) // MEANS))
        counts = np.diff(starts, append=len(self.time))
        columns = np.vstack([self.time, self.displacement, self.friction, off, self.slips])
        time, displacement, friction, off, *slips = np.add.reduceat(columns, starts, axis=1) / counts
        return _Shown(time, displacement, friction, np.array(slips).reshape(-1, len(time)), 0), off

    def steps(self, most: int) -> Iterator[Array]:
        """Times (s) of the one step of the rate, then of two and more, that follow best with friction beside them."""
        t = self.time - self.time[0]
        base, _ = np.linalg.qr(np.column_stack([np.ones_like(t), t / t[-1], self.friction, *self.slips]))
        at = t[2:-2]
        since = np.maximum(t[:, None] - at, 0.0)
        left, off = (one - base @ (base.T @ one) for one in (since, self.displacement))
        products, shared = left.T @ left, left.T @ off
        able = np.diag(products) > SINGULAR * np.sum(since**2, axis=0)
        chosen: list[int] = []
        for _ in range(min(most, len(at) // FEWEST)):
            chosen.append(_best_beside(chosen, products, shared, able))
            for _ in range(EXCHANGES if len(chosen) > 1 else 0):
                before = sorted(chosen)
                for one in before:
                    chosen.remove(one)
                    chosen.append(_best_beside(chosen, products, shared, able))
                if sorted(chosen) == before:
                    break
            yield self.time[2:-2][sorted(chosen)]

    @cached_property
    def near(self) -> Array:
        """Friction (n,) of samples near each, whose noise is not its own; of means, which have less, their own."""
        if not self.apart:
            return self.friction
        wide = np.pad(self.friction, self.apart, mode="edge")
        return np.asarray(0.5 * (wide[2 * self.apart :] + wide[: -2 * self.apart]))

    def steps_and_friction(self, times: Array) -> tuple[float, float, float]:
        """Displacement lost per friction (m), its error, and scatter about steps of rate near some times, and it.

        Friction of samples nearby stands for that of each: its own noise would make what it explains too small.
        """
        t, times = self.time - self.time[0], times - self.time[0]
        rates = np.array([])
        for last in [False] * STEPS_OF_TIMES + [True]:
            since = np.maximum(t - times[:, None], 0.0)
            jumps = [] if last else list((since > 0) * 1.0)  # a jump stands for a change that was earlier or later
            plain = [np.ones_like(t), t, *since, *self.slips, *jumps]
            rows, instead = (np.column_stack([-one, *plain]) for one in (self.friction, self.near))
            size = np.maximum(np.linalg.norm(instead, axis=0), 1e-300)
            rows, instead = rows / size, instead / size
            inverse = np.linalg.pinv(instead.T @ rows, rcond=1e-12)
            found = inverse @ (instead.T @ self.displacement) / size
            if not last:
                rates, levels = found[3 : 3 + len(times)], found[len(found) - len(times) :]
                with np.errstate(all="ignore"):
                    times = np.clip(np.nan_to_num(times - levels / rates), t[1], t[-2])
        off = self.displacement - rows @ (found * size)
        scatter, memory = float(np.std(off)), float(np.clip(lag_one(off), 0.0, MOST_MEMORY))
        error = scatter * float(np.linalg.norm(inverse[0] @ instead.T)) / float(size[0])
        return float(found[0]), error * float(np.sqrt((1 + memory) / (1 - memory))), scatter

    def slope(self, course: Course) -> tuple[float, float]:
        """Displacement lost per friction (m) and correlation of both, less straight lines between changes of rate."""
        if course.curve is not None:
            return 0.0, 0.0
        both = np.stack([self.displacement - course.integral(self.time), self.friction, self.near])
        edges = np.searchsorted(self.time, [-np.inf, *(change.time for change in course.changes), np.inf])
        parts = [
            np.stack([_beside(one, np.stack([self.time[own] - self.time[own][0], *self.slips[:, own]]))
                      for one in both[:, own]])
            for own in (slice(*pair) for pair in pairwise(edges))
            if own.stop - own.start >= FEWEST
        ]  # fmt: skip
        moved, rose, near = np.hstack(parts) if parts else np.zeros((3, 1))
        size = float(np.sqrt(np.sum(moved**2) * np.sum(rose**2)))
        worth = float(np.sum(rose * near))
        if not worth > 0 < size:
            return 0.0, 0.0
        return -float(np.sum(moved * near)) / worth, float(np.sum(moved * rose)) / size


def _beside(values: Array, rows: Array) -> Array:
    """What of values (n,) a constant and rows (k, n) leave."""
    columns = np.column_stack([np.ones_like(values), *rows])
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _best_beside(chosen: list[int], products: Array, shared: Array, able: Array) -> int:
    """Place of the column that explains most beside chosen ones, by products (p, p) of all and (p,) with the values."""
    if chosen:
        ways = np.linalg.lstsq(products[np.ix_(chosen, chosen)], products[chosen], rcond=None)[0]
        left = np.diag(products) - np.sum(ways * products[chosen], axis=0)
        shared = shared - shared[chosen] @ ways
    else:
        left = np.diag(products)
    able = able & (left > SINGULAR * np.diag(products))
    return int(np.argmax(np.where(able, shared**2 / np.where(able, left, 1.0), -1.0)))
