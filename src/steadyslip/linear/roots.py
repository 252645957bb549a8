"""Roots of arrays of real polynomials, also where roots are many orders of magnitude apart.

Coefficients run along the last axis, lowest power first; the other axes are rigs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import wraps
from itertools import pairwise
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

P = ParamSpec("P")
R = TypeVar("R")
# value at a root over the sum of its terms, above which roots are computed again in groups of similar size
_UNMET = 1e-9
_APART = 1e4  # ratio of sizes above which roots are in different groups, each solved in its own time unit
_GONE = 1e-12  # relative size below which a coefficient, in the time unit of a group of roots, hardly affects the group
_CLOSE = 1e-3  # relative distance of two roots below which they are computed as a quadratic factor
_ROUNDING = 16 * np.finfo(float).eps  # discriminant over (half sum)² below which it is rounding error of zero


def quietly(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function so that overflow gives inf or NaN without a NumPy warning.

    Every call makes a new `numpy.errstate`: before NumPy 2, a shared instance leaves the error state changed if
    decorated functions call each other or run in several threads.
    """

    @wraps(function)
    def inner(*args: P.args, **kwargs: P.kwargs) -> R:
        with np.errstate(all="ignore"):
            return function(*args, **kwargs)

    return inner


def degrees(c: Array) -> NDArray[np.int64]:
    """Degree of each polynomial; −1 for the polynomial 0 and for coefficients that are not finite."""
    present = (c != 0) & np.all(np.isfinite(c), axis=-1, keepdims=True)
    top = c.shape[-1] - 1 - np.argmax(present[..., ::-1], axis=-1)
    return np.asarray(np.where(np.any(present, axis=-1), top, -1))


def evaluate(c: Any, s: Any) -> Any:
    """Values at `s` (...) of polynomials with coefficients `c` (..., n+1)."""
    value = np.zeros_like(s) + c[..., -1]
    for i in range(c.shape[-1] - 2, -1, -1):
        value = value * s + c[..., i]
    return value


@quietly
def roots(c: Array) -> ComplexArray:
    """All roots, (..., n) complex, sorted by falling real part; NaN where the degree is lower.

    Eigenvalues of the balanced companion matrix are improved by Newton's method on the polynomial, so that slow
    roots keep their digits although others are very fast. Two roots that lie close together are
    found again as one quadratic factor, whose coefficients keep their digits where the roots do not: whether such a
    pair is real or complex is right unless it is double to within rounding of the polynomial, which is called real.
    """
    n = c.shape[-1] - 1
    flat = np.ascontiguousarray(c.reshape(-1, n + 1))
    found: ComplexArray = np.full((len(flat), n), np.nan + 0j, dtype=complex)
    degree = degrees(flat)
    for d in np.flatnonzero(np.bincount(degree[degree > 0])):
        rows = np.flatnonzero(degree == d)
        own = flat[rows, : d + 1]
        found[rows, :d] = _roots_of_degree(own)
        missed = np.flatnonzero(_are_missed(own, found[rows, :d]))
        if missed.size:
            found[rows[missed], :d] = _roots_by_size(own[missed])
    order = np.argsort(-found.real, axis=-1, kind="stable")
    return np.take_along_axis(found, order, axis=-1).reshape(*c.shape[:-1], n)


def _roots_of_degree(c: Array) -> ComplexArray:
    d = c.shape[-1] - 1
    if d == 1:
        return (-c[:, :1] / c[:, 1:]).astype(complex)
    if d == 2:
        return _quadratic(c)
    return _polished(c, companion_eigenvalues(c))


def companion_eigenvalues(c: Array) -> ComplexArray:
    """Eigenvalues (rows, n) of the companion matrices; eigenvalues far below the largest are rounding error."""
    d = c.shape[-1] - 1
    companion = np.zeros((len(c), d, d))
    companion[:, np.arange(1, d), np.arange(d - 1)] = 1.0
    with np.errstate(over="ignore"):
        companion[:, :, -1] = -c[:, :-1] / c[:, -1:]
    found = np.full((len(c), d), np.nan + 0j, dtype=complex)
    usable = np.all(np.isfinite(companion[:, :, -1]), axis=-1)
    found[usable] = np.linalg.eigvals(companion[usable])
    return found


def _polished(c: Array, found: ComplexArray) -> ComplexArray:
    """Roots (rows, m) improved by Newton's method; two close roots are improved as one quadratic factor."""
    d = c.shape[-1] - 1
    slope = c[:, None, 1:] * np.arange(1, d + 1)
    value = evaluate(c[:, None, :], found)
    for _ in range(3):
        with np.errstate(all="ignore"):
            step = found - value / evaluate(slope, found)
            better_value = evaluate(c[:, None, :], step)
            better = np.abs(better_value) < np.abs(value)
        found = np.where(better, step, found)
        value = np.where(better, better_value, value)
    for i, j in zip(*np.triu_indices(found.shape[-1], 1), strict=True):
        one, other = found[:, i], found[:, j]
        partners = (one == np.conj(other)) | ((one.imag == 0) & (other.imag == 0))
        rows = np.flatnonzero(partners & (np.abs(one - other) < _CLOSE * np.abs(one)))
        if rows.size:
            found[rows[:, None], [i, j]] = _close_pair(c[rows], one[rows], other[rows])
    return found


def _are_missed(c: Array, s: ComplexArray) -> NDArray[np.bool_]:
    """True (rows,) for polynomials of full degree if some of their computed roots `s` (rows, n) are wrong or missing.

    At each root the polynomial must vanish relative to its terms, and the product of all roots must be c0/cn in size.
    """
    size = np.abs(s)
    left = np.abs(evaluate(c[:, None, :], s)) <= _UNMET * evaluate(np.abs(c)[:, None, :], size)
    product = np.sum(np.log(size), axis=-1) - np.log(np.abs(c[:, 0])) + np.log(np.abs(c[:, -1]))
    alike = (np.abs(product) <= _CLOSE) | (c[:, 0] == 0)
    return np.asarray(~(np.all(left, axis=-1) & alike))


def _roots_by_size(c: Array) -> ComplexArray:
    """Roots (rows, n) of polynomials of full degree that have roots of very different size.

    Each group of roots of similar size is computed with a unit of time in which these roots are about one: the effect
    of the other roots on the coefficients is then negligible. Polynomials with equal groups are solved together.
    """
    n = c.shape[-1] - 1
    mantissa, exponent = np.frexp(c)
    alike: dict[tuple[int, int, int, int], list[tuple[int, int, Array]]] = {}
    for row, (own_mantissa, own_exponent) in enumerate(zip(mantissa, exponent, strict=True)):
        for first, last, unit in _groups_of_size(own_mantissa, own_exponent):
            shifted = own_exponent + unit * np.arange(n + 1)
            own = np.ldexp(own_mantissa, shifted - np.max(shifted[own_mantissa != 0]))
            present = np.flatnonzero(np.abs(own) > _GONE)
            ends = min(int(present[0]), n - last), max(int(present[-1]), n - first)
            alike.setdefault((first, last, *ends), []).append((row, unit, own))
    found = np.zeros((len(c), n), dtype=complex)
    for (first, last, bottom, top), members in alike.items():
        own = np.array([one for _, _, one in members])
        inner = companion_eigenvalues(own[:, bottom : top + 1])
        inner = np.take_along_axis(inner, np.argsort(-np.abs(inner), axis=-1, kind="stable"), axis=-1)
        skip = first - (n - top)  # number of roots in `inner` that belong to groups of larger roots
        rows, units = [row for row, _, _ in members], np.array([unit for _, unit, _ in members])
        found[rows, first:last] = _scaled(_polished(own, inner[:, skip : skip + last - first]), units[:, None])
    return found


def _groups_of_size(mantissa: Array, exponent: NDArray[np.int64]) -> Iterator[tuple[int, int, int]]:
    """Yield groups of roots of similar size, largest first: first index, end index, and log2 of their typical size.

    The upper hull of the logarithms of a polynomial's coefficients gives the sizes (Newton's polygon).
    """
    n, low = len(mantissa) - 1, int(np.argmax(mantissa != 0))
    height = np.where(mantissa != 0, np.log2(np.abs(mantissa)) + exponent, -np.inf)
    corners = [n]
    while corners[-1] > low:  # by rising slope, that is, from the largest roots to the smallest
        at = corners[-1]
        steps = np.arange(low, at)
        corners.append(int(steps[np.argmax((height[steps] - height[at]) / (at - steps))]))
    spans = list(pairwise(corners))
    logs = np.repeat([(height[b] - height[a]) / (a - b) for a, b in spans], [a - b for a, b in spans])
    ends = [0, *(np.flatnonzero(-np.diff(logs) > np.log2(_APART)) + 1), len(logs)]
    for first, last in pairwise(ends):
        yield int(first), int(last), int(np.rint(np.mean(logs[first:last])))


def _scaled(s: ComplexArray, exponent: NDArray[np.int64]) -> ComplexArray:
    """Complex numbers s times 2**exponent, exactly."""
    return np.asarray(np.ldexp(s.real, exponent) + 1j * np.ldexp(s.imag, exponent))


def _close_pair(c: Array, one: ComplexArray, other: ComplexArray) -> ComplexArray:
    """Two roots that are close to each other, from their common factor s² + u s + w by Bairstow's iteration."""
    size = np.abs(one).astype(np.longdouble)
    scaled = c.astype(np.longdouble) * size[:, None] ** np.arange(c.shape[-1])
    start = one / size.astype(float), other / size.astype(float)
    u, w = -(start[0] + start[1]).real.astype(np.longdouble), (start[0] * start[1]).real.astype(np.longdouble)
    nothing = np.zeros_like(u)
    for _ in range(5):
        b, slope = [nothing, nothing], [nothing, nothing]  # coefficients after one and two divisions by the factor
        for column in scaled.T[::-1]:
            b.append(column - u * b[-1] - w * b[-2])
            slope.append(b[-1] - u * slope[-1] - w * slope[-2])
        c1, c2, c3 = slope[-2], slope[-3], slope[-4]
        determinant = c2 * c2 - c1 * c3
        du, dw = (b[-2] * c2 - b[-1] * c3) / determinant, (b[-1] * c2 - b[-2] * c1) / determinant
        good = np.isfinite(du) & np.isfinite(dw) & (np.abs(du) + np.abs(dw) < 0.1)
        u, w = np.where(good, u + du, u), np.where(good, w + dw, w)
    ones = np.ones_like(u)
    pair: ComplexArray = _quadratic(np.stack([w, u, ones], axis=-1)) * size.astype(float)[:, None]
    return pair


def _quadratic(c: Array) -> ComplexArray:
    """Roots (rows, 2) of c0 + c1 s + c2 s² without cancellation; a pair that is double to within rounding is real."""
    c0, c1, c2 = (part.astype(np.longdouble) for part in c.T)
    discriminant = c1 * c1 - 4 * c0 * c2
    discriminant = np.where(np.abs(discriminant) <= _ROUNDING * c1 * c1, 0, discriminant)
    root = np.sqrt(np.abs(discriminant))
    large = -0.5 * (c1 + np.where(c1 < 0, -1.0, 1.0) * root)
    with np.errstate(all="ignore"):
        first, second = large / c2, np.where(large != 0, c0 / large, 0)
        real, imaginary = -0.5 * c1 / c2, 0.5 * root / c2
    is_complex = discriminant < 0
    out: ComplexArray = np.empty((len(c), 2), dtype=complex)
    out.real = np.where(is_complex[:, None], real[:, None], np.stack([first, second], axis=-1))
    out.imag = np.where(is_complex, imaginary, 0.0)[:, None] * np.array([1.0, -1.0]) + 0.0  # no negative zeros
    return out
