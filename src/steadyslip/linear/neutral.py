"""Coefficient of the highest power of s under delays: does it vanish right of the imaginary axis, and its lower bounds.

In Σ p_j(s) exp(−s h_j) the highest power has the coefficient Σ c_j exp(−s h_j). Each h_j is the sum of a set of delays
τ_i, so that the coefficient is P(x) = Σ c_j Π x_i with x_i = exp(−s τ_i), in which no x_i occurs twice in a term. If P
vanishes for some |x_i| <= 1, then for delays arbitrarily near the given ones infinitely many roots lie right of the
axis or arbitrarily close to it: the equations are ill-posed (strong stability of neutral equations, Hale & Verduyn
Lunel 1993, section 9.6). P does not vanish if the delayed terms together are smaller than the term without delay. The
converse is true unless terms are products: for two equal bodies P = (1 + b x)(1 + b y) vanishes for |b| >= 1 only,
although the delayed terms together exceed the term without delay for |b| > 0.41.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.roots import Array, ComplexArray, quietly

Sets = NDArray[np.bool_]
"""Table (m, d): True where term j is delayed by delay i."""
_SWEEPS = 30  # rounds over all delays; by trial: the smallest value found changes by less than 1e-6 in the last
_STARTS = 24  # number of random starts of the minimisation of |P|; further starts are all phases of 0 and π (P real)
_SETTLED = 1e-9  # relative change of the minimum in one round below which it has converged
_SURE = 0.5  # the lower bound is this share of the smallest value found, as further starts might find a smaller value
_STEPS = 257  # points between 0 and x at which the argument of P is followed


def highest(c: Array) -> tuple[Array, NDArray[np.int64]]:
    """Coefficients (rows, m) of the highest power of s, and that power (rows,), for coefficients c (rows, m, n+1)."""
    present = np.any(c != 0, axis=-2)
    top = c.shape[-1] - 1 - np.argmax(present[..., ::-1], axis=-1)
    return np.take_along_axis(c, top[..., None, None], axis=-1)[..., 0], top


def leads(c: Array) -> NDArray[np.bool_]:
    """True (rows,) where, at the highest power of s, the term without delay exceeds all other terms together.

    For coefficients c (rows, m, n+1).
    """
    sizes = np.abs(highest(c)[0])
    return np.asarray(2 * sizes[:, 0] > np.sum(sizes, axis=-1))


@quietly
def least_size(c: Array, sets: Sets) -> Array:
    """Lower bound (rows,) of |P| for all |x_i| <= 1, with coefficients c (rows, m) of P; not positive if P may vanish.

    The bound is exact for two terms. If the delayed terms exceed the undelayed term and some are products, |P| is
    minimised in one x_i after the other, from many starts: P = A + B x_i is linear in every x_i, so that it vanishes if
    |B| >= |A| anywhere, and otherwise is smallest on |x_i| = 1. For two delays a zero is found with certainty: |A|² −
    |B|² is linear in the cosine of the other phase, so that its signs at ±1 decide.
    """
    found = np.asarray(np.abs(c[:, 0]) - np.sum(np.abs(c[:, 1:]), axis=-1))
    several = np.any(c[:, np.sum(sets, axis=1) > 1] != 0, axis=-1)
    rows = np.flatnonzero((found <= 0) & several & (c[:, 0] != 0))
    if rows.size:
        size = np.abs(c[rows, 0])
        # many rigs of a scan have the same coefficients
        shapes, same = np.unique(c[rows] / size[:, None], axis=0, return_inverse=True)
        found[rows] = _SURE * size * _smallest(shapes, sets)[same.ravel()]
    return found


def _smallest(c: Array, sets: Sets) -> Array:
    """Smallest |P| found (rows,), for coefficients c (rows, m); 0 where P vanishes."""
    count = sets.shape[1]
    phases = 2 * np.pi * np.random.default_rng(0).random((_STARTS, count))
    starts = np.vstack([_signs(count), np.exp(1j * phases)])
    found = np.full(len(c), np.inf)
    rows = np.arange(len(c))
    x = np.repeat(starts[None], len(c), axis=0)  # (rows, starts, delays)
    for _ in range(_SWEEPS):
        before = found[rows]
        for i in range(count):
            others = np.where(sets & (np.arange(count) != i), x[:, :, None, :], 1.0)
            terms = c[rows, None, :] * np.prod(others, axis=-1)
            with_it, without = np.sum(terms[..., sets[:, i]], axis=-1), np.sum(terms[..., ~sets[:, i]], axis=-1)
            left = np.min(np.abs(without) - np.abs(with_it), axis=1)
            found[rows] = np.maximum(np.minimum(found[rows], left), 0.0)
            opposite = -without * np.conj(with_it)
            x[..., i] = np.where(opposite != 0, opposite / np.abs(opposite), x[..., i])
        going = (found[rows] > 0) & (before - found[rows] > _SETTLED * found[rows])
        rows, x = rows[going], x[going]
        if not rows.size:
            break
    return found


def _signs(count: int) -> Array:
    return np.array(list(product((1.0, -1.0), repeat=count))).reshape(-1, count)


def corners(sets: Sets) -> Array:
    """Products of the x_i in each term, for all combinations of x_i = ±1, (m, 2^d).

    If dampings are reciprocal, P first vanishes at one of these combinations as delayed terms grow.
    """
    return np.asarray(np.prod(np.where(sets[:, None, :], _signs(sets.shape[1]), 1.0), axis=-1))


def can_vanish(c: Array, sets: Sets) -> NDArray[np.bool_]:
    """True (...) where the highest power of s can vanish right of the axis or on it; coefficients c (..., m, n+1)."""
    top, _ = highest(c.reshape(-1, *c.shape[-2:]))
    return np.asarray(least_size(top, sets) <= 0).reshape(c.shape[:-2])


@quietly
def bound_on_axis(c: Array, sets: Sets) -> Array:
    """Upper bound (rows,) of |s| for roots on the axis or right of it (Fujiwara), for coefficients c (rows, m, n+1).

    NaN where no bound exists, because the highest power can vanish.
    """
    coefficients, top = highest(c)
    left = least_size(coefficients, sets)
    left = np.where(left > 0, left, np.nan)
    total = np.sum(np.abs(c), axis=-2)
    below = top[:, None] - np.arange(c.shape[-1])
    ratios = np.where(below > 0, (total / left[:, None]) ** (1.0 / np.maximum(below, 1)), 0.0)
    bound = 2.0 * np.max(ratios, axis=-1)
    return np.asarray(np.where((top == 0) | (bound == 0), 1.0, bound))


def argument_at(c: Array, h: Array, sets: Sets, omega: Array) -> tuple[ComplexArray, Array]:
    """P at x_i = exp(−iω τ_i), (rows,), and the change of its argument (rad) along the path from x = 0, (rows,).

    For coefficients c (rows, m) of P, which must not vanish for |x_i| <= 1, delays h (rows, m) of its terms and ω
    (rows,). Where terms are products, the argument may be larger than π.
    """
    size = np.linspace(0.0, 1.0, _STEPS)[:, None] ** np.sum(sets, axis=1)
    values = (c * np.exp(-1j * h * omega[:, None]))[:, None, :] * size
    along = np.sum(values, axis=-1)
    return along[:, -1], np.unwrap(np.angle(along / c[:, :1]), axis=-1)[:, -1]
