"""Rightmost roots of quasi-polynomials Σ p_j(s) exp(−s h_j), shapes as in `quasipolynomial`.

Padé approximants of the delays give starting values, Newton's method the roots themselves, and a count of all roots
right of a line shows that none is missing. If a root is missing, real parts are found by bisection with such counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.argument import UNKNOWN, SumsOnAxis
from steadyslip.linear.neutral import Sets, bound_on_axis, highest, leads, least_size
from steadyslip.linear.polynomials import product
from steadyslip.linear.quasipolynomial import (
    INFINITE,
    count_right_if_feasible,
    crossings,
    nondimensional,
    shifted,
    size_of_terms,
    slope,
    too_long,
    value,
)
from steadyslip.linear.roots import Array, ComplexArray, companion_eigenvalues, quietly, roots

_ORDER = 6  # order of the Padé approximants for starting values: exp(−iωh) to 1e-3 up to ωh = 7.5
_MOST_POWERS = 60  # largest degree of the polynomial with Padé approximants; above it bisection is faster (by trial)
_CHUNK = 500  # number of rigs treated together: distances between their roots then take some 20 MB
_NEWTON = 12  # steps of Newton's method from starting values; four or five are enough near a root
_REAL = 1e-12  # relative imaginary part of a root below which the imaginary part is rounding error
_MET = 1e-9  # tolerance of a root: relative size of the last step, and value relative to its terms
_APART = 1e-6  # relative distance above which two roots found are distinct
_FARTHEST = 700.0  # largest exponent of a delayed term: exp(709) leaves the range of floating point
_HALVINGS = 60  # largest number of bisections of a real part: more than the 53 bits of a double
_LOST = 1e10  # limit on frequency times delay (rad): beyond it the phase has fewer than six correct digits
_CLOSE = (1e-4, 1e-3, 1e-2, 0.1)  # relative distances from `_line_of_many` up to which roots are sought
_QUICK = 1e5  # total phase (rad) of all delay terms up to the highest frequency, for which a count takes under a second
_RATE_TOLERANCE = 1e-3  # relative error up to which `_line_of_many` is returned as the rate of slowest decay
_SAME_ROOT = 1e-9  # relative distance below which two results of Newton's method count as the same root
_ON_THE_LINE = 1e-3  # relative distance of a root's real part from a line, up to which the root is on the line
_BISECTED = 1e-7  # like `_ON_THE_LINE` for the axis, in dimensionless units: rounding moves a double root by as much
_BESIDE_CROSSING = np.array([0.0, -0.375, -0.25, -0.125, 0.125, 0.25, 0.375, 0.5])  # turns, for Newton's method


@quietly
def rightmost(c: Array, h: Array, sets: Sets, count: int) -> ComplexArray:
    """Rightmost roots, (..., count), by falling real part.

    NaN where infinitely many roots lie right of the axis, or roots cannot be counted. NaN also for roots left of
    `_line_of_many`, or too close to this line to be distinguished from the infinitely many roots near it. If Newton's
    method does not find a root, this root and all further ones are NaN.
    """
    flat = c.reshape(-1, *c.shape[-2:])
    delays = np.broadcast_to(h, (*c.shape[:-2], h.shape[-1])).reshape(-1, h.shape[-1])
    found = np.full((len(flat), count), np.nan + 0j, dtype=complex)
    scaled, own, rate = nondimensional(flat, delays)
    usable = np.all(np.isfinite(scaled), axis=(-2, -1)) & np.all(np.isfinite(own), axis=-1)
    rows = np.flatnonzero(usable & np.any(scaled[:, 1:], axis=(-2, -1)))
    for some in np.array_split(rows, -(-len(rows) // _CHUNK)) if rows.size else ():
        found[some] = rate[some, None] * _by_ratios(scaled[some], own[some], sets, count)
    rows = np.flatnonzero(usable & np.isnan(found[:, -1]))
    right = count_right_if_feasible(scaled[rows], own[rows], sets)
    for row in rows[(right < INFINITE) & (right != UNKNOWN)]:
        found[row] = rate[row] * _rightmost_of_one(scaled[row], own[row], sets, count)
    return found.reshape(*c.shape[:-2], count)


def _by_ratios(c: Array, h: Array, sets: Sets, count: int) -> ComplexArray:
    """First `count` roots, (rows, count); NaN where a count of all roots shows that some are missing.

    Only for rigs whose highest power of s is not delayed; coefficients are (rows, m, n+1). Other rigs get NaN.
    """
    found = np.full((len(c), count), np.nan + 0j, dtype=complex)
    longest = np.max(h, axis=-1)
    rows = np.flatnonzero(~np.any(highest(c)[0][:, 1:], axis=-1) & (bound_on_axis(c, sets) * longest < _LOST))
    if not rows.size or c.shape[-1] + _ORDER * sets.shape[-1] > _MOST_POWERS:
        return found
    c, h = c[rows], h[rows]
    s = _distinct(*_refined(c, h, _starting_values(c, h, sets)))
    total = np.cumsum(np.where(np.isnan(s), 0, np.where(s.imag > 0, 2, 1)), axis=-1)
    # index of the last root that is needed, among those with s.imag >= 0
    last = np.argmax(total >= count, axis=-1)[:, None]
    asked, beyond = (np.take_along_axis(s, one, axis=-1)[:, 0] for one in (last, np.minimum(last + 1, s.shape[-1] - 1)))
    gap = np.where(beyond.real < asked.real, asked.real - beyond.real, np.abs(asked))
    line = asked.real - 0.5 * np.minimum(gap, np.abs(asked))
    usable = (gap > _APART * np.abs(asked)) & (-line * longest[rows] < _FARTHEST)
    found_all = np.flatnonzero(usable & (total[:, -1] >= count))
    right = count_right_if_feasible(c[found_all], h[found_all], sets, line[found_all])
    found_all = found_all[right == np.take_along_axis(total, last, axis=-1)[found_all, 0]]
    own = s[found_all]
    both = np.stack([own, np.where(own.imag > 0, own.conj(), np.nan)], axis=-1).reshape(len(own), 2 * own.shape[-1])
    order = np.argsort(np.isnan(both), axis=-1, kind="stable")[:, :count]
    found[rows[found_all]] = np.take_along_axis(both, order, axis=-1)
    return found


def _starting_values(c: Array, h: Array, sets: Sets) -> ComplexArray:
    """Roots (rows, k) of the polynomial with a Padé approximant in place of exp(−sτ) for every delay τ."""
    k = np.arange(_ORDER + 1)
    below = np.array([math.comb(_ORDER, i) / math.perm(2 * _ORDER, i) for i in k])  # numerator for exp(x)
    late = np.maximum(h @ np.linalg.pinv(sets.astype(float)).T, 0.0)  # (rows, delays)
    total = np.zeros((len(c), c.shape[-1] + _ORDER * sets.shape[-1]))
    for j, acting in enumerate(sets):
        term = c[:, j]
        for i, delayed in enumerate(acting):
            term = product(term, below * (-late[:, i, None] if delayed else late[:, i, None]) ** k)
        total += term
    scaled, _, rate = nondimensional(total[:, None], np.zeros((len(c), 1)))
    return rate[:, None] * companion_eigenvalues(scaled[:, 0])


def _refined(c: Array, h: Array, s: ComplexArray) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Roots (rows, k) by Newton's method, with imaginary part zero or positive, and True where it converged."""
    for _ in range(_NEWTON):
        step = value(c, h, s) / slope(c, h, s)
        s = np.where(np.isfinite(step), s - step, s)
    s = np.where(np.abs(s.imag) < _REAL * np.abs(s), s.real, s.real + 1j * np.abs(s.imag))
    met = (np.abs(step) <= _MET * np.abs(s)) & (np.abs(value(c, h, s)) <= _MET * size_of_terms(c, h, s))
    return s, met


def _distinct(s: ComplexArray, met: NDArray[np.bool_]) -> ComplexArray:
    """Converged roots without duplicates, by falling real part; padded with NaN."""
    s = np.where(met, s, np.nan + 0j)
    s = np.take_along_axis(s, np.argsort(-s.real, axis=-1, kind="stable"), axis=-1)
    same = np.abs(s[:, :, None] - s[:, None, :]) <= _APART * np.abs(s)[:, :, None]
    s = np.where(np.any(np.tril(same, -1), axis=-1), np.nan + 0j, s)
    return np.take_along_axis(s, np.argsort(np.isnan(s), axis=-1, kind="stable"), axis=-1)


def _rightmost_of_one(c: Array, h: Array, sets: Sets, count: int) -> ComplexArray:
    if not np.any(c[1:]):  # all delayed coefficients are zero
        exact = roots(np.sum(c, axis=0))
        return np.append(exact, np.full(count, np.nan + 0j))[:count]
    if len(c) == 2:
        turns = float(np.nanmax(crossings(c[:1], c[1:])[0], initial=0.0)) * float(np.max(h)) / (2 * np.pi)
        if turns > _LOST:
            raise too_long(turns)
    _, left, many = _left_end(c, h, sets)
    numbers = np.arange(1, min(count, many) + 1)
    high = np.full(len(numbers), 1.01 * bound_on_axis(c[None], sets)[0])
    low = -np.ones(len(numbers)) / (1.0 + float(np.max(h)))  # further left, delayed terms leave floating point
    low = np.maximum(low, left)
    for _ in range(60):
        right = count_right_if_feasible(c, h, sets, low)
        if np.any(right == UNKNOWN):
            return np.full(count, np.nan + 0j)
        short = right < numbers
        if not np.any(short):
            break
        high = np.where(short, low, high)
        low = np.where(short, np.maximum(2 * low, left), low)
    for _ in range(_HALVINGS):
        if np.all(high - low < 1e-9 * (np.abs(low) + np.abs(high)) + 1e-12):
            break
        middle = 0.5 * (low + high)
        right = count_right_if_feasible(c, h, sets, middle)
        if np.any(right == UNKNOWN):
            return np.full(count, np.nan + 0j)
        enough = right >= numbers
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    found: list[complex] = []
    for real in 0.5 * (low + high):
        if found and abs(found[-1].real - real) < 1e-6 * (abs(real) + 1e-3) and found[-1].imag > 0:
            found.append(found[-1].conjugate())
        else:
            root = _root_on(c, h, sets, float(real), found)
            if not abs(root.real - real) <= _ON_THE_LINE * abs(real) + _BISECTED:
                break
            found.append(root)
    return np.append(np.array(found, dtype=complex), np.full(count - len(found), np.nan + 0j))


def _left_end(c: Array, h: Array, sets: Sets) -> tuple[float, float, int]:
    """Result of `_line_of_many`, a real part right of it up to which roots are sought, and the number of roots further
    right.

    The result is (−inf, −inf, `INFINITE`) if no highest derivative is delayed.
    """
    line = _line_of_many(c, h, sets)
    if not np.isfinite(line):
        return line, line, INFINITE
    slowest = float(np.max(h))
    for share in _CLOSE:
        left = line + share * abs(line)
        moved = shifted(c, h, np.asarray(left))[None]
        if leads(moved)[0] or bound_on_axis(moved, sets)[0] * slowest * len(c) < _QUICK:
            many = int(count_right_if_feasible(c, h, sets, left))
            if many != UNKNOWN:
                return line, left, many
    return line, 0.0, int(count_right_if_feasible(c, h, sets))


def _line_of_many(c: Array, h: Array, sets: Sets) -> float:
    """Real part right of which a rig has finitely many roots, for coefficients c (m, n+1) and delays h (m,).

    Left of this line the highest power of s can vanish: infinitely many roots come arbitrarily close to the line, for
    the given delays or delays arbitrarily near them. −inf if no highest derivative is delayed.
    """
    top = highest(c[None])[0]
    if not np.any(top[:, 1:] * h[1:]):
        return -np.inf

    def vanishes(real: float) -> bool:
        return bool(least_size(top * np.exp(-h * real), sets)[0] <= 0)

    step = 1.0 / float(np.max(h))
    low, high = (-step, 0.0) if not vanishes(0.0) else (0.0, step)
    while not vanishes(low):
        low, high = 2 * low, low
    while vanishes(high):
        low, high = high, 2 * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if vanishes(middle) else (low, middle)
    return high


@quietly
def rate_of_many(c: Array, h: Array, sets: Sets) -> float:
    """Real part (1/s) to which the infinitely many rightmost roots of one rig converge.

    NaN if other roots lie further right, or if the result has a relative error of more than `_RATE_TOLERANCE`.
    """
    (scaled,), (own,), (rate,) = nondimensional(c[None], h[None])
    line, left, many = _left_end(scaled, own, sets)
    return float(rate * line) if many == 0 and left - line <= _RATE_TOLERANCE * abs(line) else math.nan


@quietly
def nearest_to_axis(c: Array, h: Array, sets: Sets) -> complex:
    """Root (1/s) of one rig that is nearest to the imaginary axis; its imaginary part is zero or positive."""
    (scaled,), (own,), (rate,) = nondimensional(c[None], h[None])
    return complex(rate * _root_on(scaled, own, sets, 0.0))


def _root_on(c: Array, h: Array, sets: Sets, real: float, known: Sequence[complex] = ()) -> complex:
    """Root nearest to the line Re s = `real`, by Newton's method; its imaginary part is zero or positive.

    Roots that are not in `known` are preferred, as many roots may lie on one line.
    """
    moved = shifted(c, h, np.asarray(real))
    starts = real + 1j * np.array([0.0, *_near_axis(moved, h, sets)])
    s = starts.astype(complex)
    for _ in range(30):
        step = value(c, h, s) / slope(c, h, s)
        s = np.where(np.isfinite(step), s - step, s)
    s = np.where(np.abs(s.imag) < 1e-12 * np.abs(s), s.real + 0j, s)
    far = np.abs(s.real - real) + np.abs(value(c, h, s)) / size_of_terms(c, h, s)
    far = np.where(np.isfinite(far), far, np.inf)
    for one in known:
        same = np.abs(s.real + 1j * np.abs(s.imag) - one) <= _SAME_ROOT * abs(one)
        others = ~same & (np.abs(s.real - real) <= _ON_THE_LINE * abs(real)) & np.isfinite(far)
        far = np.where(same & np.any(others), np.inf, far)
    best = complex(s[int(np.argmin(far))])
    return complex(best.real, abs(best.imag))


def _near_axis(c: Array, h: Array, sets: Sets) -> Iterator[float]:
    """Frequencies near which a root may lie on the imaginary axis; they are starting values for Newton's method."""
    common = roots(c[:1])[0]  # roots of motions without delay are common zeros of all terms
    yield from np.abs(common.imag[np.isfinite(common)]).tolist()
    if len(c) == 2:  # both terms have equal size at these frequencies, and a root is within half a turn of the phase
        found = np.array([one for one in crossings(c[:1], c[1:])[0][0] if np.isfinite(one)])
        turn = 2 * np.pi / float(np.max(h)) if np.max(h) > 0 else 0.0
        yield from np.abs(found[:, None] + turn * _BESIDE_CROSSING).ravel().tolist()
        return
    own = [pieces.omega[0][leader < 0] for pieces, leader in SumsOnAxis(c[None], h[None], sets).resolved_pieces()]
    omega = np.sort(np.concatenate(own))
    size = np.abs(value(c, h, 1j * omega)) / size_of_terms(c, h, 1j * omega)
    around = np.concatenate([[np.inf], size, [np.inf]])
    dips = np.flatnonzero((size <= around[:-2]) & (size <= around[2:]))
    yield from (float(one) for one in omega[dips[np.argsort(size[dips])[:20]]])
