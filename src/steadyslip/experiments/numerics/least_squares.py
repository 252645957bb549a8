"""Nonlinear least squares for many problems of one kind at once: Levenberg–Marquardt within bounds.

Every lane is a problem of its own: other starts, other data (bootstrap), or other fixed values (profiles).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array

Residuals = Callable[[Array, Array], tuple[Array, Array]]
"""From coordinates (m, p) and the lanes they belong to (m,): residuals (m, n) and their derivatives (m, p, n)."""

CONVERGED = 1e-10  # reduction of the sum of squares that is still to be had, as a share of it
STALLED = 1e-7  # the same, where no step succeeds any more: below this the sum is at its rounding
STILL = 1e-9  # the same, of a step however short that failed: at a kink, no direction leads down
MOST_RAISED = 64.0  # times the damping rises from one step that fails to the next
ALONG = 0.95  # cosine of the angle between two steps along one line
MOST_SHARE = 0.95  # of the step before that a step may be: it is stretched up to twenty times
HOPE = 2.0  # times the best sum of squares: rough minima beyond have no chance
NEAR = 0.02  # of a coordinate: the same place
SAME = 1e-2  # difference of sums of squares, as a share, between ends at one rough minimum
PACE = 10  # iterations over which the progress of a problem is judged
CRAWL = 3e-7  # of its sum of squares in as many: along a valley that data do not tell from its bottom; it ends there
LARGEST = 1e100  # sum of squares, of residuals and of derivatives
DAMPED, CLOSE = 1e-2, 1e-6  # damping to begin with, far from a minimum and close to one
LONGEST = 2.0  # step in any coordinate: an e-fold or so of a logarithmic parameter


@dataclass
class Minima:
    """Where each problem ended.

    Attributes
    ----------
    coordinates : ndarray (m, p)
    ssq : ndarray (m,)
        Sum of squares; inf where none could be computed.
    converged : ndarray of bool (m,)
    iterations : ndarray of int (m,)
    """

    coordinates: Array
    ssq: Array
    converged: Array
    iterations: Array

    def __add__(self, other: Minima) -> Minima:
        """Those of both."""
        return Minima(
            np.concatenate([self.coordinates, other.coordinates]),
            np.concatenate([self.ssq, other.ssq]),
            np.concatenate([self.converged, other.converged]),
            np.concatenate([self.iterations, other.iterations]),
        )

    def sorted(self) -> Minima:
        """The same, the best first."""
        order = np.argsort(self.ssq, kind="stable")
        return Minima(self.coordinates[order], self.ssq[order], self.converged[order], self.iterations[order])

    @classmethod
    def none(cls, size: int) -> Minima:
        """No problems, of so many coordinates."""
        return cls.at(np.empty((0, size)))

    @classmethod
    def at(cls, coordinates: Array) -> Minima:
        """Problems that have not begun."""
        count = len(coordinates)
        return cls(coordinates, np.full(count, np.inf), np.zeros(count, dtype=bool), np.zeros(count, dtype=int))

    def distinct(self, most: int, hope: float = HOPE) -> tuple[Array, Array]:
        """Coordinates of the best, each place once, as far as there is hope for them; how many ended at each."""
        ranked = self.sorted()
        chosen: list[Array] = []
        counts: list[int] = []
        for z, ssq in zip(ranked.coordinates, ranked.ssq, strict=True):
            if not np.isfinite(ssq) or ssq > hope * ranked.ssq[0]:
                break
            near = [i for i, other in enumerate(chosen) if np.max(np.abs(z - other)) < NEAR]
            if near:
                counts[near[0]] += 1
            elif len(chosen) < most:
                chosen.append(z)
                counts.append(1)
        return np.array(chosen).reshape(-1, self.coordinates.shape[1]), np.array(counts, dtype=int)


def minimise(
    residuals: Residuals, start: Array, low: Array, high: Array, most: int = 100, held: Array | None = None,
    tolerance: float = CONVERGED, race: int = 0, known: float = np.inf, told: Callable[[Minima], None] | None = None,
    enough: Callable[[], bool] | None = None, damping: float = DAMPED,
) -> Minima:  # fmt: skip
    """Minimise the sum of squares of every problem.

    Parameters
    ----------
    residuals : callable
    start : ndarray (m, p)
    low, high : ndarray (p,) or (m, p)
        Bounds.
    most : int
        Iterations.
    held : ndarray of bool (m, p), optional
        Coordinates that stay where they are.
    tolerance : float
        Reduction still to be had, as a share of the sum, at which a problem is done.
    race : int
        All problems are one, from several starts: once so many are done at the best place, or a step away from it,
        those that promise no better stop too; once one is, those that at their pace will not get there. Zero: they are
        not.
    known : float
        Sum of squares that this one problem is known to reach from elsewhere.
    told : callable, optional
        Called after every iteration with what is known by then.
    enough : callable, optional
        Asked before every iteration whether to end where the problems are.
    damping : float
        To begin with, as a share of the curvature in each coordinate: the less, the closer a minimum is.
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
    last, plain = np.zeros((count, size)), np.zeros(count, dtype=bool)  # the step before, if it was not stretched
    earlier = ssq.copy()
    active = everyone[np.isfinite(ssq)]
    keep = np.isfinite(ssq)
    normal, gradient = normal[keep], gradient[keep]
    for iteration in range(1, most + 1):
        if not len(active) or (enough is not None and enough()):
            break
        z, before = found.coordinates[active], found.ssq[active]
        scale[active] = curvature = np.maximum(scale[active] * 0.5, np.einsum("mii->mi", normal))
        bottom, top = low[active], high[active]
        free = ~(held[active] | ((z <= bottom) & (gradient < 0)) | ((z >= top) & (gradient > 0)))
        promise, step = _steps(normal, gradient, free, damped[active], curvature)
        over = done = (promise <= tolerance * np.maximum(before, 1e-300)) | stuck[active]
        best = min(known, float(np.min(np.append(found.ssq[found.converged], before[done]), initial=np.inf)))
        if iteration % PACE == 0:
            gone = (earlier[active] - before) / PACE
            over = over | (gone * PACE <= CRAWL * before)
            if race:
                over |= before - gone * (most - iteration) > best
            earlier = found.ssq.copy()
        if race and best < np.inf:
            there, ends = found.converged & (found.ssq <= best * (1 + SAME)), before - promise
            there[active[done]] |= before[done] <= best * (1 + SAME)
            coming = ~done & (np.abs(ends - best) <= SAME * best) & _near(z + step, found.coordinates[there])
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
        step *= np.minimum(1.0, LONGEST / np.maximum(np.max(np.abs(step), axis=1), 1e-300))[:, None]
        trial = np.clip(z + step, bottom, top)
        hoped, expected = _expected(normal, gradient, np.stack([step, trial - z]))
        after, new_normal, new_gradient = _normal(*residuals(trial, active))
        good = after < before
        with np.errstate(all="ignore"):
            ratio = np.where(expected > 0, (before - after) / expected, 0.0)
        tried = ~good & (stretch > 1)  # in vain, which says nothing of the step itself
        stuck[active] = ~good & ~tried & (hoped <= STILL * before)
        factor = np.where(good, np.where(ratio > 0.25, 0.2, 1.0), np.where(tried, 1.0, raised[active]))
        damped[active] = np.clip(damped[active] * factor, 1e-12, None)
        raised[active] = np.where(good | tried, 2.0, np.minimum(2 * raised[active], MOST_RAISED))
        last[active], plain[active] = trial - z, good & (stretch <= 1)
        better = active[good]
        found.coordinates[better], found.ssq[better] = trial[good], after[good]
        found.iterations[active] = iteration
        normal[good], gradient[good] = new_normal[good], new_gradient[good]
        if told is not None:
            told(found)
    return found


def _near(coordinates: Array, places: Array) -> Array:
    """Which of some points lie at one of some places."""
    apart = np.max(np.abs(coordinates[:, None] - places), axis=2, initial=0.0)
    return np.asarray(np.any(apart < NEAR, axis=1))


def _stretch(step: Array, last: Array, scale: Array) -> Array:
    """How much longer steps may be where they follow each other along one line, each the same share of the last.

    Far from a perfect fit steps shrink by a constant factor: their sum is one step, divided by one less that factor.
    """
    both, own, other = (np.einsum("mi,mi,mi->m", a, b, scale) for a, b in ((step, last), (step, step), (last, last)))
    with np.errstate(all="ignore"):
        share, straight = both / other, both / np.sqrt(own * other)
    return np.where((straight > ALONG) & (share < 1), 1 / (1 - np.clip(share, 0.0, MOST_SHARE)), 1.0)


def _normal(r: Array, jacobian: Array) -> tuple[Array, Array, Array]:
    """Sums of squares, JᵀJ and −Jᵀr, r being data minus model and J the model's derivative.

    The sum is inf where a motion gave no numbers, or some near the end of floating point.
    """
    with np.errstate(all="ignore"):
        normal, gradient = np.matmul(jacobian, jacobian.transpose(0, 2, 1)), np.matmul(jacobian, r[:, :, None])[:, :, 0]
        ssq, largest = np.einsum("mn,mn->m", r, r), np.max(np.einsum("mii->mi", normal), axis=1, initial=0.0)
        return np.where((ssq < LARGEST) & (largest < LARGEST), ssq, np.inf), normal, gradient


def _steps(normal: Array, gradient: Array, free: Array, damping: Array, scale: Array) -> tuple[Array, Array]:
    """How much the sum of squares would fall in the best step if the problem were linear; the step, damped."""
    diagonal = np.einsum("mii->mi", normal)
    extra = np.stack([
        np.broadcast_to(1e-12 * np.max(diagonal, axis=1, keepdims=True), diagonal.shape),
        damping[:, None] * np.maximum(scale, 1e-12 * np.max(scale, axis=1, keepdims=True)),
    ])  # fmt: skip
    # solved in the free coordinates, scaled to a unit diagonal
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
    """How much the sum of squares would fall in steps (k, m, p) if the problem were linear, (k, m)."""
    fall = gradient - 0.5 * np.matmul(normal, steps[..., None])[..., 0]
    return np.asarray(2 * np.einsum("kmi,kmi->km", fall, steps))
