"""Detection of a spring between displacement sensor and load point, by which the displacement varies with friction.

A sensor across the fault, or behind a part of the machine that yields, measures the displacement of the load point
minus friction times the compliance of a spring. A few steps of the load-point rate plus a term proportional to friction
then fit the measured displacement as well as a course with many more changes. On a soft machine, a course fitted
without this term contains changes and servo responses that friction causes; therefore the times of the steps are
searched with the term from the start.
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
"""Displacement moves with friction if their correlation is below this. In 50 records of the load point it was above
-.05; in 18 records measured across the fault it was below in 12 (others had much noise, or changes in its place)."""
REPEATS = 3  # number of times that the course is found again after the spring's stretch was added to the displacement
MARGIN = 5.0  # over the number of samples: relative excess of the scatter about steps that is allowed over the course's
BESIDE = 2.0  # a course follows a displacement if deviations are at most this multiple of the sample-to-sample noise
SLOW = 2.0  # largest assumed ratio of the noise of friction, slow noise included, to its sample-to-sample noise
CERTAIN = 8.0  # standard errors by which a compliance must exceed 0; in 270 records of the load point two did
MOST_MEMORY = 0.9  # largest correlation of neighbouring residuals by which the error of a compliance is increased
ROUGHLY = 2.0  # limits for means of neighbouring samples are weaker by this factor than limits for single samples
KEPT = 0.5  # least share of the first compliance that must remain after the course was found again
MEANS = 200  # steps are first searched on this number of averages of neighbouring samples, to save time
MOST_STEPS = 6  # largest number of steps tried in the search
EXCHANGES = 4  # largest number of rounds in which every step is replaced by a better step; one or two suffice
STEPS_OF_TIMES = 6  # iterations of Newton's method for the times of steps; two or three suffice from close starts
FEWEST = 5  # samples between two changes are used in the correlation if there are at least this many
APART = 2  # friction is averaged over the neighbours this many samples before and after a sample; chosen by trial
SINGULAR = 1e-6  # a regressor is left out if a smaller share of its square is independent of the other regressors


@dataclass(frozen=True)
class Yielding:
    """Spring between a displacement sensor and the load point.

    Attributes
    ----------
    lost : float
        Stretch of the spring per unit of friction coefficient, m.
    course : Course
        Course of the load point, from the displacement plus the stretch.
    """

    lost: float
    course: Course


def yielding(time: Array, displacement: Array, friction: Array, course: Course) -> Yielding | None:
    """Spring between sensor and load point, and the course of the load point; None if there is no such spring.

    There is a spring if deviations of the displacement from straight lines correlate with friction, or if fewer steps
    of the rate plus a term proportional to friction fit as well as `course`. The course of the load point is then found
    again, several times, from the displacement plus the stretch of the spring.
    """
    if not course.strays > EXACTLY * float(np.ptp(displacement)):
        return None
    slips = np.empty((0, len(time)))
    keep = np.ones(len(time), dtype=bool)
    if course.slips or course.glitches or _is_late(course):
        slips, keep = slips_and_glitches(time, displacement)
    data = _SensorData(time[keep], displacement[keep], friction[keep], slips[:, keep])
    found, lost = course, data.stretch(course)
    least = KEPT * lost
    for _ in range(REPEATS if lost > 0 else 0):
        found = load_course(time, displacement + lost * friction)
        if not _is_late(found):
            break
        lost, _ = data.slope(found)
    doubtful = _is_late(found) and len(found.changes) > len(course.changes)
    return Yielding(lost, found) if lost > least and not doubtful else None


def _is_late(course: Course) -> bool:
    """True if a servo response, a series of ramps, a smooth curve or a second course is part of the course."""
    late = any(change.lag or change.pieces for change in course.changes)
    return late or course.otherwise is not None or course.curve is not None


@dataclass(frozen=True)
class _SensorData:
    """Measured displacement and friction without glitches of the displacement sensor.

    Attributes
    ----------
    time, displacement, friction : ndarray (n,)
    slips : ndarray (k, n)
        1 after each sudden change of the sensor's level, 0 before it.
    apart : int
        Distance, in samples, of the two neighbours whose mean friction replaces that of a sample; 0 for none.
    """

    time: Array
    displacement: Array
    friction: Array
    slips: Array
    apart: int = APART

    def stretch(self, course: Course) -> float:
        """Stretch of the spring per unit of friction (m), from steps or else from a correlation; 0 without a spring."""
        lost, together = self.slope(course)
        return self.stretch_by_steps(course) or (lost if together <= WITH_FRICTION else 0.0)

    def stretch_by_steps(self, course: Course) -> float:
        """Stretch per unit of friction (m) from the fewest steps of the rate that fit as well as a course; else 0."""
        off = self.displacement - (course.otherwise or course).integral(self.time)
        astray = np.std(off) > BESIDE * displacement_noise(self.time, self.displacement)
        smooth = course.otherwise is not None or course.curve is not None
        means, off_means = self._means(off)
        for times in means.steps(MOST_STEPS if astray or smooth else len(course.changes)):
            if means.stretch_near(times, off_means, smooth, ROUGHLY) > 0:
                found = self.stretch_near(times, off, smooth)
                if found > 0:
                    return found
        return 0.0

    def stretch_near(self, times: Array, off: Array, smooth: bool, leeway: float = 1.0) -> float:
        """Stretch per unit of friction (m) from a fit of steps and friction; 0 if it fits worse than a course.

        Parameters
        ----------
        times : ndarray (k,)
            Approximate times of the steps, s.
        off : ndarray (n,)
            Displacement minus the course, m.
        smooth : bool
            True for a course with so many parameters that it fits part of the noise.
        leeway : float, optional
            Factor by which the deviations from the steps may exceed their limit.
        """
        lost, error, strays = self.steps_and_friction(times)
        noise = displacement_noise(self.time, self.displacement)
        own = min(float(np.std(_residuals_of(off, self.slips))), BESIDE * noise)
        own = max(own, noise) if smooth else own
        own *= 1 + MARGIN / len(off)
        most = leeway * float(np.hypot(own, SLOW * lost * level_noise(self.friction)))
        return lost if lost > CERTAIN / leeway * error and strays <= most else 0.0

    def _means(self, off: Array) -> tuple[_SensorData, Array]:
        """Data and values `off` (n,) averaged over neighbouring samples; the stretch per unit of friction is kept."""
        starts = np.arange(0, len(self.time), -(-len(self.time) // MEANS))
        counts = np.diff(starts, append=len(self.time))
        columns = np.vstack([self.time, self.displacement, self.friction, off, self.slips])
        time, displacement, friction, off, *slips = np.add.reduceat(columns, starts, axis=1) / counts
        return _SensorData(time, displacement, friction, np.array(slips).reshape(-1, len(time)), 0), off

    def steps(self, most: int) -> Iterator[Array]:
        """Times (s) of the step of the rate that fits best with a friction term, then of the best two, and so on."""
        t = self.time - self.time[0]
        base, _ = np.linalg.qr(np.column_stack([np.ones_like(t), t / t[-1], self.friction, *self.slips]))
        at = t[2:-2]
        since = np.maximum(t[:, None] - at, 0.0)
        left, off = (one - base @ (base.T @ one) for one in (since, self.displacement))
        products, shared = left.T @ left, left.T @ off
        able = np.diag(products) > SINGULAR * np.sum(since**2, axis=0)
        chosen: list[int] = []
        for _ in range(min(most, len(at) // FEWEST)):
            chosen.append(_best_addition(chosen, products, shared, able))
            for _ in range(EXCHANGES if len(chosen) > 1 else 0):
                before = sorted(chosen)
                for one in before:
                    chosen.remove(one)
                    chosen.append(_best_addition(chosen, products, shared, able))
                if sorted(chosen) == before:
                    break
            yield self.time[2:-2][sorted(chosen)]

    @cached_property
    def near(self) -> Array:
        """Friction (n,) of each sample, as the mean of two neighbours so that it has not the noise of the sample.

        If `apart` is 0, as for averaged samples with little noise, the friction of the sample itself is returned.
        """
        if not self.apart:
            return self.friction
        wide = np.pad(self.friction, self.apart, mode="edge")
        return np.asarray(0.5 * (wide[2 * self.apart :] + wide[: -2 * self.apart]))

    def steps_and_friction(self, times: Array) -> tuple[float, float, float]:
        """Stretch per unit of friction (m), its error (m), and scatter (m), from steps near `times` and friction.

        Friction of neighbours is an instrumental variable: noise of a regressor would bias its coefficient to 0.
        """
        t, times = self.time - self.time[0], times - self.time[0]
        rates = np.array([])
        for last in [False] * STEPS_OF_TIMES + [True]:
            since = np.maximum(t - times[:, None], 0.0)
            jumps = [] if last else list((since > 0) * 1.0)  # a fitted jump shows how far the time of a step is off
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
        """Stretch per unit of friction (m), and correlation of displacement and friction after removal of lines."""
        if course.curve is not None:
            return 0.0, 0.0
        both = np.stack([self.displacement - course.integral(self.time), self.friction, self.near])
        edges = np.searchsorted(self.time, [-np.inf, *(change.time for change in course.changes), np.inf])
        parts = [
            np.stack([_residuals_of(one, np.stack([self.time[own] - self.time[own][0], *self.slips[:, own]]))
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


def _residuals_of(values: Array, rows: Array) -> Array:
    """Residuals (n,) of the regression of `values` on a constant and `rows` (k, n)."""
    columns = np.column_stack([np.ones_like(values), *rows])
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _best_addition(chosen: list[int], products: Array, shared: Array, able: Array) -> int:
    """Index of the regressor that explains most of the values when it is added to the regressors `chosen`.

    Parameters
    ----------
    chosen : list of int
    products : ndarray (p, p)
        Scalar products of all regressors.
    shared : ndarray (p,)
        Scalar products of the regressors with the values.
    able : ndarray of bool (p,)
        True for regressors that may be chosen.
    """
    if chosen:
        ways = np.linalg.lstsq(products[np.ix_(chosen, chosen)], products[chosen], rcond=None)[0]
        left = np.diag(products) - np.sum(ways * products[chosen], axis=0)
        shared = shared - shared[chosen] @ ways
    else:
        left = np.diag(products)
    able = able & (left > SINGULAR * np.diag(products))
    return int(np.argmax(np.where(able, shared**2 / np.where(able, left, 1.0), -1.0)))
