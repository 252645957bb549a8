"""Nonlinear least squares for many problems at once: Levenberg–Marquardt within bounds.

Problems differ in their starting points, data (bootstrap) or fixed values (profiles). Constants without a stated reason
were chosen by trial: they balance the number of iterations against the risk of an early end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array

Residuals = Callable[[Array, Array], tuple[Array, Array]]
"""Function of coordinates (m, p) and problem indices (m,) that returns residuals (m, n), data minus model, and the
derivatives (m, p, n) of the model."""

CONVERGED = 1e-10  # predicted relative decrease of the sum of squares at which a problem has converged
STALLED = 1e-7  # limit in place of `CONVERGED` once all steps fail: rounding in the model hides smaller decreases
KINK = 1e-9  # a failed step with a smaller predicted relative decrease ends a problem: the sum of squares has a kink
MAX_DAMPING_FACTOR = 64.0  # largest factor by which the damping grows after a failed step; it doubles with each failure
PARALLEL = 0.95  # cosine of the angle between successive steps above which they count as parallel
MAX_STEP_RATIO = 0.95  # largest ratio of successive steps in the geometric series: stretches a step at most 20 times
HOPE = 2.0  # final points of a rough search with more than this multiple of the best sum of squares are dropped
MERGE_DISTANCE = 0.02  # two minima are the same up to this difference in every coordinate (2 % of a positive parameter)
SAME_SSQ = 1e-2  # up to this relative difference of sums of squares, final points may be at the same minimum
PROGRESS_ITERATIONS = 10  # iterations over which the progress of a problem is averaged
LEAST_PROGRESS = 3e-7
"""A problem in a flat valley ends if its sum of squares has a smaller relative decrease in `PROGRESS_ITERATIONS`."""
LEAST_PROMISE = 0.1
"""A start stops if its predicted decrease is a smaller share of its excess over a known sum of squares; in successful
starts the share was 0.4 or more."""
LOST = 4.0  # a start stops if it exceeds this multiple of a known sum of squares after `PROGRESS_ITERATIONS`
MAX_SSQ = 1e100  # larger sums of squares count as infinite, as their products would overflow
DAMPING_FAR, DAMPING_NEAR = 1e-2, 1e-6  # initial damping, relative to the curvature: far from a minimum, and near one
MAX_STEP = 2.0  # largest step in any coordinate: a factor exp(2) of a logarithmic parameter


@dataclass
class Minima:
    """Final points of m minimisations in p coordinates.

    Attributes
    ----------
    coordinates : ndarray (m, p)
    ssq : ndarray (m,)
        Sums of squares; inf where none could be computed.
    converged : ndarray of bool (m,)
    iterations : ndarray of int (m,)
    """

    coordinates: Array
    ssq: Array
    converged: Array
    iterations: Array

    def __add__(self, other: Minima) -> Minima:
        """Concatenate two sets of minima."""
        return Minima(
            np.concatenate([self.coordinates, other.coordinates]),
            np.concatenate([self.ssq, other.ssq]),
            np.concatenate([self.converged, other.converged]),
            np.concatenate([self.iterations, other.iterations]),
        )

    def sorted(self) -> Minima:
        """Copy sorted by sum of squares, the least first."""
        order = np.argsort(self.ssq, kind="stable")
        return Minima(self.coordinates[order], self.ssq[order], self.converged[order], self.iterations[order])

    @classmethod
    def none(cls, size: int) -> Minima:
        """Empty set of minima in `size` coordinates."""
        return cls.at(np.empty((0, size)))

    @classmethod
    def at(cls, coordinates: Array) -> Minima:
        """Minima with infinite sums of squares at the starting points `coordinates` (m, p)."""
        count = len(coordinates)
        return cls(coordinates, np.full(count, np.inf), np.zeros(count, dtype=bool), np.zeros(count, dtype=int))

    def distinct(self, most: int, hope: float = HOPE) -> tuple[Array, Array]:
        """Coordinates of up to `most` different minima, the best first, and number of problems that ended at each.

        Minima whose sum of squares is more than `hope` times the least are left out.
        """
        ranked = self.sorted()
        chosen: list[Array] = []
        counts: list[int] = []
        for z, ssq in zip(ranked.coordinates, ranked.ssq, strict=True):
            if not np.isfinite(ssq) or ssq > hope * ranked.ssq[0]:
                break
            near = [i for i, other in enumerate(chosen) if np.max(np.abs(z - other)) < MERGE_DISTANCE]
            if near:
                counts[near[0]] += 1
            elif len(chosen) < most:
                chosen.append(z)
                counts.append(1)
        return np.array(chosen).reshape(-1, self.coordinates.shape[1]), np.array(counts, dtype=int)


def minimise(
    residuals: Residuals, start: Array, low: Array, high: Array, most: int = 100, held: Array | None = None,
    tolerance: float = CONVERGED, race: int = 0, known: float = np.inf,
    callback: Callable[[Minima], None] | None = None, stop: Callable[[], bool] | None = None,
    damping: float = DAMPING_FAR,
) -> Minima:  # fmt: skip
    """Minimise the sum of squares of every problem.

    Parameters
    ----------
    residuals : callable
        See `Residuals`.
    start : ndarray (m, p)
        Starting points.
    low, high : ndarray (p,) or (m, p)
        Bounds of the coordinates.
    most : int
        Largest number of iterations.
    held : ndarray of bool (m, p), optional
        True for coordinates that keep their starting values.
    tolerance : float
        Predicted relative decrease of the sum of squares at which a problem has converged.
    race : int
        If positive, the problems are the same and differ only in their starts. Once a start has converged, starts that
        are too slow to reach its sum of squares stop. Once `race` starts have converged to the best minimum, or are
        one step away from it, starts that predict no better minimum stop.
    known : float
        Sum of squares that the problem is known to reach from another start. Starts that are too slow to reach this sum
        stop; without a race, starts whose predicted decrease is small compared with their excess over it stop as well.
    callback : callable, optional
        Called after every iteration with the `Minima` so far.
    stop : callable, optional
        Called before every iteration; the minimisation ends if it returns True.
    damping : float
        Initial damping relative to the curvature in each coordinate; small values suit starts near a minimum.

    Returns
    -------
    Minima
    """
    count, size = start.shape
    if not count:
        return Minima.at(start)
    low, high = np.broadcast_to(low, start.shape), np.broadcast_to(high, start.shape)
    z = np.clip(start, low, high)
    held = np.zeros((count, size), dtype=bool) if held is None else held
    everyone = np.arange(count)
    found = Minima(z.copy(), np.full(count, np.inf), np.zeros(count, dtype=bool), np.zeros(count, dtype=int))
    ssq, normal, gradient = _normal(*residuals(z, everyone))
    found.ssq[:] = ssq
    damped, raised, scale = np.full(count, damping), np.full(count, 2.0), np.zeros((count, size))
    stuck = np.zeros(count, dtype=bool)
    last, plain = np.zeros((count, size)), np.zeros(count, dtype=bool)  # previous step; True if it was not stretched
    earlier = ssq.copy()
    active = everyone[np.isfinite(ssq)]
    keep = np.isfinite(ssq)
    normal, gradient = normal[keep], gradient[keep]
    for iteration in range(1, most + 1):
        if not len(active) or (stop is not None and stop()):
            break
        z, before = found.coordinates[active], found.ssq[active]
        scale[active] = curvature = np.maximum(scale[active] * 0.5, np.einsum("mii->mi", normal))
        bottom, top = low[active], high[active]
        free = ~(held[active] | ((z <= bottom) & (gradient < 0)) | ((z >= top) & (gradient > 0)))
        promise, step = _steps(normal, gradient, free, damped[active], curvature)
        over = done = (promise <= tolerance * np.maximum(before, 1e-300)) | stuck[active]
        best = min(known, float(np.min(np.append(found.ssq[found.converged], before[done]), initial=np.inf)))
        if iteration % PROGRESS_ITERATIONS == 0:
            gone = (earlier[active] - before) / PROGRESS_ITERATIONS
            over = over | (gone * PROGRESS_ITERATIONS <= LEAST_PROGRESS * before)
            if race or known < np.inf:
                over = over | (before - gone * (most - iteration) > best)
            over = over | (not race and before > LOST * known)
            earlier = found.ssq.copy()
        if not race and known < np.inf:
            over = over | (promise < LEAST_PROMISE * (before - known))
        if race and best < np.inf:
            there, ends = found.converged & (found.ssq <= best * (1 + SAME_SSQ)), before - promise
            there[active[done]] |= before[done] <= best * (1 + SAME_SSQ)
            coming = ~done & (np.abs(ends - best) <= SAME_SSQ * best) & _near(z + step, found.coordinates[there])
            if np.sum(there) + np.sum(coming) >= race:
                worse = ends > (1 - max(tolerance, 1e-9)) * best
                over, arrived = over | worse, coming & worse
                found.coordinates[active[arrived]] = np.clip(z + step, bottom, top)[arrived]
                found.ssq[active[arrived]] = np.maximum(ends[arrived], best)
                done = done | arrived
        if np.any(over):
            ended = active[over]
            small = promise[over] <= max(STALLED, tolerance) * np.maximum(before[over], 1e-300)
            found.converged[ended] = small | done[over]
            rest = ~over
            active, normal, gradient, z, before = active[rest], normal[rest], gradient[rest], z[rest], before[rest]
            step, curvature, bottom, top = step[rest], curvature[rest], bottom[rest], top[rest]
            if not len(active):
                break
        stretch = _stretch(step, last[active], curvature) * plain[active]
        step *= np.maximum(stretch, 1.0)[:, None]
        step *= np.minimum(1.0, MAX_STEP / np.maximum(np.max(np.abs(step), axis=1), 1e-300))[:, None]
        trial = np.clip(z + step, bottom, top)
        hoped, expected = _expected(normal, gradient, np.stack([step, trial - z]))
        after, new_normal, new_gradient = _normal(*residuals(trial, active))
        good = after < before
        with np.errstate(all="ignore"):
            ratio = np.where(expected > 0, (before - after) / expected, 0.0)
        tried = ~good & (stretch > 1)  # a stretched step failed: the step itself may succeed, so keep the damping
        stuck[active] = ~good & ~tried & (hoped <= KINK * before)
        factor = np.where(good, np.where(ratio > 0.25, 0.2, 1.0), np.where(tried, 1.0, raised[active]))
        damped[active] = np.clip(damped[active] * factor, 1e-12, None)
        raised[active] = np.where(good | tried, 2.0, np.minimum(2 * raised[active], MAX_DAMPING_FACTOR))
        last[active], plain[active] = trial - z, good & (stretch <= 1)
        better = active[good]
        found.coordinates[better], found.ssq[better] = trial[good], after[good]
        found.iterations[active] = iteration
        normal[good], gradient[good] = new_normal[good], new_gradient[good]
        if callback is not None:
            callback(found)
    return found


def _near(coordinates: Array, places: Array) -> Array:
    """Mask (m,) of the points `coordinates` (m, p) within `MERGE_DISTANCE` of any of the points `places` (k, p)."""
    apart = np.max(np.abs(coordinates[:, None] - places), axis=2, initial=0.0)
    return np.asarray(np.any(apart < MERGE_DISTANCE, axis=1))


def _stretch(step: Array, last: Array, scale: Array) -> Array:
    """Factors (m,) by which to lengthen steps that are parallel to the `last` ones; 1 for other steps.

    If residuals are large, steps shrink by a constant factor q; the sum of this geometric series is step / (1 - q).
    """
    both, own, other = (np.einsum("mi,mi,mi->m", a, b, scale) for a, b in ((step, last), (step, step), (last, last)))
    with np.errstate(all="ignore"):
        share, straight = both / other, both / np.sqrt(own * other)
    return np.where((straight > PARALLEL) & (share < 1), 1 / (1 - np.clip(share, 0.0, MAX_STEP_RATIO)), 1.0)


def _normal(r: Array, jacobian: Array) -> tuple[Array, Array, Array]:
    """Sums of squares (m,), JᵀJ (m, p, p) and Jᵀr (m, p); r is data minus model, J the derivatives of the model.

    The sum of squares is inf if the model could not be computed, or if products would overflow.
    """
    with np.errstate(all="ignore"):
        normal, gradient = np.matmul(jacobian, jacobian.transpose(0, 2, 1)), np.matmul(jacobian, r[:, :, None])[:, :, 0]
        ssq, largest = np.einsum("mn,mn->m", r, r), np.max(np.einsum("mii->mi", normal), axis=1, initial=0.0)
        return np.where((ssq < MAX_SSQ) & (largest < MAX_SSQ), ssq, np.inf), normal, gradient


def _steps(normal: Array, gradient: Array, free: Array, damping: Array, scale: Array) -> tuple[Array, Array]:
    """Decrease (m,) of the sum of squares that the linearised problem predicts undamped; damped steps (m, p)."""
    diagonal = np.einsum("mii->mi", normal)
    extra = np.stack([
        np.broadcast_to(1e-12 * np.max(diagonal, axis=1, keepdims=True), diagonal.shape),
        damping[:, None] * np.maximum(scale, 1e-12 * np.max(scale, axis=1, keepdims=True)),
    ])  # fmt: skip
    # the equations are solved in the free coordinates, scaled so that the matrix has a unit diagonal
    total = diagonal + extra
    size_of = np.sqrt(np.maximum(total, 1e-300))
    matrix = normal / (size_of[..., :, None] * size_of[..., None, :])
    matrix = np.where(free[:, :, None] & free[:, None, :], matrix, 0.0)
    each = np.arange(normal.shape[1])
    matrix[..., each, each] = np.where(free, total / size_of**2, 1.0) + 1e-14
    pull = np.where(free, gradient, 0.0)
    best, step = np.linalg.solve(matrix, (pull / size_of)[..., None])[..., 0] / size_of
    return np.einsum("mi,mi->m", best, pull), step


def _expected(normal: Array, gradient: Array, steps: Array) -> Array:
    """Decrease (k, m) of the sum of squares that the linearised problem predicts for steps (k, m, p)."""
    fall = gradient - 0.5 * np.matmul(normal, steps[..., None])[..., 0]
    return np.asarray(2 * np.einsum("kmi,kmi->km", fall, steps))
