"""Hurwitz test of arrays of real polynomials, and the k for which p(s) + k q(s) is stable.

Coefficients run along the last axis, lowest power first; the other axes are rigs. Highest coefficients
may be zero (a rig without mass), rig by rig.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steadyslip.linear import crossing
from steadyslip.linear.roots import Array, ComplexArray, degrees, quietly, roots

_NEARLY_REAL = 1e-6  # relative imaginary part up to which a root in β² counts as real
_FAR = 1e75  # size of a coefficient beyond which products of four may leave the range of floating point
_SAME = 1e-9  # relative distance below which two boundaries in k count as the same


@quietly
def damping_measures(s: ComplexArray) -> Array:
    """Scale-free distance of eigenvalues (..., n) from the imaginary axis, (2, ...).

    First, −(s_i + s_j)/√(s_i s_j) of the least damped pair, conjugate or real of one sign: it vanishes where an
    oscillation sets in, and is smooth where the pair turns from real to complex. Second, −s over the
    geometric mean of all |s| for the least damped real eigenvalue: it vanishes where one crosses zero.
    NaN where there is no such pair or eigenvalue.
    """
    n = s.shape[-1]
    real = s.imag == 0
    with np.errstate(all="ignore"):
        i, j = np.triu_indices(n, 1)
        first, second = s[..., i], s[..., j]
        product = first * second
        paired = (first == np.conj(second)) | (real[..., i] & real[..., j] & (product.real > 0))
        pairs = np.where(paired, -(first + second).real / np.sqrt(np.abs(product)), np.inf)
        sizes = np.log(np.abs(s))
        present = np.isfinite(sizes)
        total = np.sum(np.where(present, sizes, 0.0), axis=-1, keepdims=True)
        mean = np.exp(total / np.maximum(present.sum(axis=-1, keepdims=True), 1))
        single = np.where(real, -s.real / mean, np.inf)
    least = np.stack([pairs.min(axis=-1, initial=np.inf), single.min(axis=-1, initial=np.inf)])
    return np.where(np.isfinite(least), least, np.nan)


@quietly
def is_hurwitz(c: Array, spare: ArrayLike) -> NDArray[np.bool_]:
    """True where all roots have negative real parts (Routh) and the equations are well posed, (...).

    `c` (..., n + 1) has the lowest power first. Equations are ill-posed if the highest nonzero coefficient is negative,
    or if more coefficients of the highest powers are 0 than `spare` (...) allows.
    """
    n = c.shape[-1] - 1
    flat = c.reshape(-1, n + 1)
    result = np.zeros(len(flat), dtype=bool)
    degree = degrees(flat)
    posed = degree >= np.maximum(n - np.broadcast_to(spare, c.shape[:-1]).reshape(-1), 0)
    for d in np.flatnonzero(np.bincount(degree[posed])):
        rows = np.flatnonzero(posed & (degree == d))
        result[rows] = np.all(routh_column(_in_own_time(flat[rows, : d + 1])) > 0, axis=-1)
    return result.reshape(c.shape[:-1])


def _in_own_time(c: Array) -> Array:
    """Polynomials with time rescaled so that the lowest and highest coefficient are alike, where coefficients lie far
    apart.

    Without rescaling, the Routh array would lose the smallest coefficients.
    """
    size = np.abs(c)
    apart = np.min(size, axis=-1) < 1e-100 * np.max(size, axis=-1)
    rows = np.flatnonzero(apart & np.all(c != 0, axis=-1))
    if not rows.size:
        return c
    mantissa, exponent = np.frexp(c[rows])
    steps = np.arange(c.shape[-1])
    slope = np.rint((exponent[:, :1] - exponent[:, -1:]) / steps[-1]).astype(int)
    exponent = exponent + slope * steps
    out = c.copy()
    out[rows] = np.ldexp(mantissa, exponent - np.max(exponent, axis=-1, keepdims=True))
    return out


@quietly
def routh_column(c: Array) -> Array:
    """First column of the Routh array of polynomials of full degree.

    A polynomial is stable if all entries are positive.

    The entries have different units; only their signs matter.
    """
    scale = np.abs(c).max(axis=-1, keepdims=True)
    column = crossing.routh(columns(c / scale))
    return np.asarray(np.nan_to_num(np.stack(column, axis=-1) * scale, nan=-1.0))


def most_intervals(degree: int) -> int:
    """The largest number of intervals that `stable_set` can find for polynomials of a degree.

    Stability may change at the static edge, where the highest coefficient vanishes, and at degree − 1 frequencies.
    """
    return (degree + 3) // 2


@dataclass(frozen=True)
class StableSet:
    """Values of k at which p + k q is stable, as intervals with their edges, for arrays of rigs.

    Attributes
    ----------
    intervals : ndarray (..., m, 2)
        Stable intervals of k > 0 in rising order, NaN where a rig has fewer; upper end may be inf.
    edges : ndarray (..., e)
        Positive k at which stability may change, rising, NaN padded.
    frequencies : ndarray (..., e)
        Angular frequency (1/s) at each edge: 0 divergence, inf ill-posed.
    changes : ndarray (..., e) of bool
        True if stability changes at the edge.
    searched : tuple of float
        Values of k between which the set is known; narrower under delays whose windows are too many.
    """

    intervals: Array
    edges: Array
    frequencies: Array
    changes: NDArray[np.bool_]
    searched: tuple[float, float] = (0.0, np.inf)


@quietly
def stable_set(p: Array, q: Array, spare: ArrayLike) -> StableSet:
    """Set of k > 0 for which p(s) + k q(s) has all roots in the left half plane.

    Boundaries are k = −p(iβ)/q(iβ) at real roots β >= 0 of Im[p(iβ) conj q(iβ)] = 0, and the k where the
    highest coefficient vanishes; the intervals between them are tested (theory 3). Up to `spare` (...) of the highest
    coefficients may be 0 (`model.posed.spare_powers`).
    """
    p, q = np.broadcast_arrays(p, q)
    shape, n = p.shape[:-1], p.shape[-1] - 1
    p, q = p.reshape(-1, n + 1), q.reshape(-1, n + 1)
    (p, of_p), (q, of_q) = _near_one(p), _near_one(q)  # products of scaled coefficients do not overflow
    k, beta = _candidates(p, q)
    order = np.argsort(np.where(np.isnan(k), np.inf, k), axis=-1)
    k, beta = np.take_along_axis(k, order, -1), np.take_along_axis(beta, order, -1)
    with np.errstate(invalid="ignore"):
        twice = np.zeros(k.shape, dtype=bool)
        twice[:, 1:] = k[:, 1:] <= k[:, :-1] * (1 + _SAME)
    k = np.where(twice, np.nan, k)
    order = np.argsort(np.where(np.isnan(k), np.inf, k), axis=-1)
    k, beta = np.take_along_axis(k, order, -1), np.take_along_axis(beta, order, -1)

    probes = _between(k, p, q)
    spare = np.broadcast_to(spare, shape).reshape(-1, 1)
    stable = is_hurwitz(p[:, None, :] + probes[..., None] * q[:, None, :], np.broadcast_to(spare, probes.shape))
    changes = (stable[:, 1:] != stable[:, :-1]) & np.isfinite(k)
    k = np.ldexp(k, of_p - of_q)
    intervals = _intervals(np.where(np.isnan(k), np.inf, k), stable)
    return StableSet(
        intervals.reshape(*shape, *intervals.shape[1:]),
        k.reshape(*shape, -1),
        np.where(np.isnan(k), np.nan, beta).reshape(*shape, -1),
        changes.reshape(*shape, -1),
    )


def _near_one(c: Array) -> tuple[Array, NDArray[np.intp]]:
    """Polynomials divided by a power of two where all coefficients are tiny or huge, and the exponents (..., 1)."""
    sizes = np.abs(c)
    largest = np.max(sizes, axis=-1, keepdims=True)
    least = np.min(np.where(sizes > 0, sizes, np.inf), axis=-1, keepdims=True)
    off = np.where(largest < 1 / _FAR, largest, np.where(least > _FAR, least, 1.0))
    exponents = np.where(np.isfinite(off) & (off > 0), np.frexp(off)[1], 0)
    return np.ldexp(c, -exponents), exponents


def _candidates(p: Array, q: Array) -> tuple[Array, Array]:
    """Positive k at which a root may cross the imaginary axis, and its frequency β; padded with NaN."""
    with np.errstate(all="ignore"):
        static, top = crossing.real_edges(columns(p), columns(q))
    w = crossing_squares(p, q)
    with np.errstate(all="ignore"):
        oscillatory = crossing.stiffness_on_axis(columns(p[:, None, :]), columns(q[:, None, :]), w)
    k = np.concatenate([static[:, None], top[:, None], oscillatory], axis=-1)
    zero = np.zeros_like(static)[:, None]
    beta = np.concatenate([zero, zero + np.inf, np.sqrt(w)], axis=-1)
    with np.errstate(invalid="ignore"):
        k = np.where((k > 0) & np.isfinite(k), k, np.nan)
    return k, beta


def columns(c: Array) -> list[Array]:
    """List of the coefficients, lowest power first, each an array (...), as the functions of `crossing` take them."""
    return [c[..., i] for i in range(c.shape[-1])]


def even_odd(c: Array) -> tuple[Array, Array]:
    """Polynomials E and O in β² with c(iβ) = E(β²) + iβ O(β²)."""
    even, odd = crossing.even_odd(columns(c))
    return np.stack(even, axis=-1), np.stack(odd, axis=-1)


def product(a: Array, b: Array) -> Array:
    """Coefficients of products of polynomials."""
    return np.stack(crossing.product(columns(a), columns(b)), axis=-1)


def squared_size(c: Array) -> Array:
    """Coefficients of |c(iω)|² in powers of ω², for polynomials c (..., n+1)."""
    even, odd = even_odd(c)
    found = np.zeros_like(c)
    for part, first in ((product(even, even), 0), (product(odd, odd), 1)):
        width = min(part.shape[-1], c.shape[-1] - first)
        found[..., first : first + width] += part[..., :width]
    return found


@quietly
def crossing_squares(p: Array, q: Array) -> Array:
    """Positive β² at which p(iβ)/q(iβ) is real, padded with NaN: the roots of Im[p conj q]/β."""
    difference = np.stack(np.broadcast_arrays(*crossing.axis_polynomial(columns(p), columns(q))), axis=-1)
    keep = np.any(difference != 0, axis=0)
    if not np.any(keep[1:]):
        return np.full((len(p), 1), np.nan)
    w = roots(difference[:, : np.flatnonzero(keep)[-1] + 1])
    with np.errstate(invalid="ignore"):
        usable = (w.real > 0) & (np.abs(w.imag) <= _NEARLY_REAL * np.abs(w))
    return np.where(usable, w.real, np.nan)


def _between(k: Array, p: Array, q: Array) -> Array:
    """One k inside each of the intervals into which the candidates `k` cut (0, inf)."""
    with np.errstate(all="ignore"):
        ratio = np.abs(p / q)
        natural = np.nanmax(np.where(np.isfinite(ratio) & (ratio > 0), ratio, np.nan), axis=-1, initial=0.0)
    natural = np.where(natural > 0, natural, 1.0)[:, None]
    low = np.concatenate([np.zeros_like(natural), k], axis=-1)
    high = np.concatenate([k, np.full_like(natural, np.nan)], axis=-1)
    last = np.where(low > 0, 2 * low, natural)
    inner = np.where(low > 0, np.sqrt(low) * np.sqrt(high), high / 2)
    return np.where(np.isnan(low), 1.0, np.where(np.isnan(high), last, inner))


def _intervals(k: Array, stable: NDArray[np.bool_]) -> Array:
    """Intervals of k, made of neighbouring stable cells; padded with NaN."""
    rows = len(stable)
    low = np.concatenate([np.zeros((rows, 1)), k], axis=-1)
    high = np.concatenate([k, np.full((rows, 1), np.inf)], axis=-1)
    real_cell = np.isfinite(low)
    stable = stable & real_cell
    before = np.concatenate([np.zeros((rows, 1), bool), stable[:, :-1]], axis=-1)
    after = np.concatenate([stable[:, 1:], np.zeros((rows, 1), bool)], axis=-1)
    starts, ends = stable & ~before, stable & ~after
    most = max(int(starts.sum(axis=-1).max(initial=0)), 1)
    out = np.full((rows, most, 2), np.nan)
    for side, (mask, values) in enumerate(((starts, low), (ends, high))):
        row, cell = np.nonzero(mask)
        out[row, np.cumsum(mask, axis=-1)[row, cell] - 1, side] = values[row, cell]
    return out
