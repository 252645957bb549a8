"""Count of roots right of a line, and the rightmost roots, of quasi-polynomials Σ p_j(s) exp(−s h_j) (theory 11).

Coefficients are (..., m, n+1), lowest power first, delays (..., m) with h_0 = 0; the leading axes are rigs. `sets` (m,
d) tells which delays of the rig make up each h_j. Nothing is
approximated by rational functions. With one delay roots are counted from where they are without it: they cross the
imaginary axis only at the few ω with |p(iω)| = |q(iω)|, at delays (φ + 2πk)/ω, to the right at the highest of these ω
and then by turns (Cooke & van den Driessche 1986; Walton & Marshall 1987). With several delays the argument principle
is applied along the axis (`argument`).

`INFINITE` is the count where the highest power of s can vanish (`neutral`): infinitely many roots lie to the right, the
faster growing the shorter the delay; `UNKNOWN` where counting takes too long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steadyslip.core.errors import NotAvailable
from steadyslip.linear.argument import UNKNOWN, SumsOnAxis, count_by_argument
from steadyslip.linear.neutral import Sets, bound_on_axis, can_vanish, highest, leads, least_size
from steadyslip.linear.polynomials import even_odd, product
from steadyslip.linear.roots import Array, ComplexArray, evaluate, quietly, roots

INFINITE = 2**62  # a count of roots, larger than any other
_HALVINGS = 60  # largest number of bisections of a real part: more than the 53 bits of a double
_BATCH = 40  # rigs with several delays counted at a time; chosen by trial: memory against speed
_MOST_PERIODS = 5000  # crossing delays are listed up to so many periods of the fastest; by trial: length of the list
_LOST = 1e10  # periods within one delay beyond which rounding leaves fewer than six digits of the phase
_CLOSE = (1e-4, 1e-3, 1e-2, 0.1)  # distances from `_line_of_many`, relative to it, up to which roots are sought
_QUICK = (
    1e5  # radians in all terms, up to the bound of frequencies, that are followed in less than a second if none leads
)
_TOLD = 1e-3  # relative error up to which that line is told as the rate of the slowest decay
_SAME_ROOT = 1e-9  # relative distance within which Newton's method has found one root again
_ON_THE_LINE = 1e-3  # relative distance from a line of the real part of a root that is one of those on it
_BISECTED = 1e-7  # the same where the line is the axis, in units of `nondimensional`: rounding of a double root
_BESIDE_CROSSING = np.array([0.0, -0.375, -0.25, -0.125, 0.125, 0.25, 0.375, 0.5])  # turns, for Newton's method


def value(c: Array, h: Array, s: Any) -> Any:
    """Value Σ p_j(s) exp(−s h_j) of the quasi-polynomial of one rig, for `s` of any shape."""
    s = np.asarray(s, dtype=complex)
    return sum(evaluate(p, s) * np.exp(-s * delay) for p, delay in zip(c, h, strict=True))


def slope(c: Array, h: Array, s: Any) -> Any:
    """Derivative with respect to s of Σ p_j(s) exp(−s h_j) of one rig, for `s` of any shape."""
    powers = np.arange(1, c.shape[-1])
    inner = ((evaluate(p[1:] * powers, s) - d * evaluate(p, s)) * np.exp(-s * d) for p, d in zip(c, h, strict=True))
    return sum(inner)


@quietly
def shifted(c: Array, h: Array, shift: Array) -> Array:
    """Coefficients of the quasi-polynomial in s of which `c` gives the value at s + shift; `shift` (...)."""
    out = np.array(np.broadcast_to(c, np.broadcast_shapes(c.shape, (*np.shape(shift), 1, 1))), dtype=float)
    step = np.asarray(shift, dtype=float)[..., None]
    n = c.shape[-1] - 1
    for low in range(n):
        for k in range(n - 1, low - 1, -1):
            out[..., k] += step * out[..., k + 1]
    moved: Array = out * np.exp(np.minimum(-h * step, 700.0))[..., None]
    return moved


@quietly
def nondimensional(c: Array, h: Array) -> tuple[Array, Array, Array]:
    """Coefficients, delays and rate (1/s) of quasi-polynomials made dimensionless: s = rate times the new s.

    The rate makes lowest and highest coefficients equal in size; then the largest coefficient is made one.
    """
    size = np.max(np.abs(c), axis=-2)
    present = size > 0
    low, high = np.argmax(present, axis=-1), size.shape[-1] - 1 - np.argmax(present[..., ::-1], axis=-1)
    ends = [np.take_along_axis(size, place[..., None], axis=-1)[..., 0] for place in (low, high)]
    rate = np.exp((np.log(ends[0]) - np.log(ends[1])) / np.maximum(high - low, 1))
    rate = np.where(np.isfinite(rate) & (rate > 0), rate, 1.0)
    logs = np.log(np.abs(c)) + np.log(rate)[..., None, None] * np.arange(c.shape[-1])
    logs -= np.max(logs, axis=(-2, -1), keepdims=True)
    return np.where(c == 0, 0.0, np.sign(c) * np.exp(logs)), h * rate[..., None], rate


def count_right(c: Array, h: Array, sets: Sets, shift: ArrayLike = 0.0) -> NDArray[np.int64]:
    """Number of roots with real part above `shift`, (...); −1 where coefficients are not finite.

    Raises
    ------
    NotAvailable
        If there are several delays, so long that roots cannot be counted.
    """
    found = count_right_if_feasible(c, h, sets, shift, alone=True)
    if np.any(found == UNKNOWN):
        with np.errstate(all="ignore"):
            scaled, own, _ = nondimensional(c, h)
        fast = bound_on_axis(scaled.reshape(-1, *scaled.shape[-2:]), sets)
        raise _too_long(float(np.nanmax(fast) * np.max(own)) / (2 * np.pi))
    return found


@quietly
def count_right_if_feasible(
    c: Array, h: Array, sets: Sets, shift: ArrayLike = 0.0, *, alone: bool = False
) -> NDArray[np.int64]:
    """Number of roots with real part above `shift`, (...); −1 where coefficients are not finite, or `UNKNOWN`.

    `UNKNOWN` marks rigs whose count takes too long; with `alone` these are tried again one by one.
    """
    lead = np.broadcast_shapes(c.shape[:-2], np.shape(shift))
    c, h, rate = nondimensional(c, h)
    if np.any(shift):
        c = shifted(c, h, np.asarray(shift) / rate)
    c = np.broadcast_to(c, (*lead, *c.shape[-2:])).reshape(-1, *c.shape[-2:])
    h = np.broadcast_to(h, (*lead, h.shape[-1])).reshape(-1, h.shape[-1])
    found = np.full(len(c), -1, dtype=np.int64)
    good = np.all(np.isfinite(c), axis=(-2, -1)) & np.all(np.isfinite(h), axis=-1)
    ahead = good & can_vanish(c, sets) & np.any(h[:, 1:] > 0, axis=-1)
    found[ahead] = INFINITE
    rows = np.flatnonzero(good & ~ahead)
    if c.shape[-2] <= 2 and rows.size:
        q = c[rows, 1] if c.shape[-2] == 2 else np.zeros_like(c[rows, 0])
        found[rows] = _count_by_crossings(c[rows, 0], q, h[rows, -1])
    elif rows.size:
        for some in np.array_split(rows, -(-len(rows) // _BATCH)):
            found[some] = count_by_argument(c[some], h[some], sets)
        for one in rows[found[rows] == UNKNOWN] if alone else ():
            found[one] = count_by_argument(c[[one]], h[[one]], sets)[0]
            if found[one] == UNKNOWN:
                break
    return found.reshape(lead)


def crossings(p: Array, q: Array) -> tuple[Array, Array, Array]:
    """Frequencies ω with |p(iω)| = |q(iω)|, falling, NaN padded; directions; and phases, each (rigs, n).

    As the delay h grows, a pair of roots of p + q exp(−sh) crosses the axis at ±iω whenever ω h = φ + 2πk, with the
    phase φ in (0, 2π]; the direction is +1 if it crosses to the right, −1 if to the left.
    """
    squares = np.zeros((len(p), p.shape[-1]))
    size = np.zeros_like(squares)
    for polynomial, sign in ((p, 1.0), (q, -1.0)):
        even, odd = even_odd(polynomial)
        for part, first in ((product(even, even), 0), (product(odd, odd), 1)):
            width = min(part.shape[-1], squares.shape[-1] - first)
            squares[:, first : first + width] += sign * part[:, :width]
            size[:, first : first + width] += np.abs(part[:, :width])
    squares[np.abs(squares) < 8 * np.finfo(float).eps * size] = 0.0
    w = roots(squares)
    usable = (w.imag == 0) & (w.real > 0)
    w = -np.sort(np.where(usable, -w.real, np.nan), axis=-1)  # falling, NaN last
    omega = np.sqrt(w)
    above, below = evaluate(q[:, None, :], 1j * omega), evaluate(p[:, None, :], 1j * omega)
    phase = np.mod(np.angle(-above / below), 2 * np.pi)
    direction = np.where(np.arange(w.shape[-1]) % 2 == 0, 1.0, -1.0) * np.ones(w.shape)
    return np.asarray(omega), direction, np.asarray(np.where(phase == 0, 2 * np.pi, phase))


def _count_by_crossings(p: Array, q: Array, h: Array) -> NDArray[np.int64]:
    """Number of roots of p + q exp(−sh) right of the axis: those at h = 0 plus those that cross as h grows."""
    start = np.sum(roots(p + q).real > 0, axis=-1)
    omega, direction, phase = crossings(p, q)
    times = np.maximum(np.ceil((omega * h[:, None] - phase) / (2 * np.pi)), 0.0)
    crossed = np.nansum(np.where(np.isnan(omega), 0.0, 2 * direction * times), axis=-1)
    return np.asarray(start + crossed, dtype=np.int64)


def _too_long(turns: float) -> NotAvailable:
    return NotAvailable(
        f"the delays are so long beside the oscillations of this rig, up to {turns:.2g} turns, that its growing roots "
        "cannot be counted; shorten them"
    )


@quietly
def rightmost(c: Array, h: Array, sets: Sets, count: int) -> ComplexArray:
    """Rightmost roots, (..., count), by falling real part.

    NaN where infinitely many lie right of the axis, or where those right of a line cannot be counted; beyond those
    that lie right of `_line_of_many`, or so close to it that they are not told from the infinitely many there. Real
    parts are bisected on the number of roots right of a line; Newton's method then refines each root. The list ends
    before a line on which it finds none.
    """
    flat = c.reshape(-1, *c.shape[-2:])
    delays = np.broadcast_to(h, (*c.shape[:-2], h.shape[-1])).reshape(-1, h.shape[-1])
    found = np.full((len(flat), count), np.nan + 0j, dtype=complex)
    scaled, own, rate = nondimensional(flat, delays)
    right = count_right_if_feasible(scaled, own, sets)
    for row in np.flatnonzero((right < INFINITE) & (right != UNKNOWN) & np.all(np.isfinite(scaled), axis=(-2, -1))):
        found[row] = rate[row] * _rightmost_of_one(scaled[row], own[row], sets, count)
    return found.reshape(*c.shape[:-2], count)


def _rightmost_of_one(c: Array, h: Array, sets: Sets, count: int) -> ComplexArray:
    if not np.any(c[1:]):  # all delayed coefficients are zero
        exact = roots(np.sum(c, axis=0))
        return np.append(exact, np.full(count, np.nan + 0j))[:count]
    if len(c) == 2:
        turns = float(np.nanmax(crossings(c[:1], c[1:])[0], initial=0.0)) * float(np.max(h)) / (2 * np.pi)
        if turns > _LOST:
            raise _too_long(turns)
    _, left, many = _left_end(c, h, sets)
    numbers = np.arange(1, min(count, many) + 1)
    high = np.full(len(numbers), 1.01 * bound_on_axis(c[None], sets)[0])
    low = -np.ones(len(numbers)) / (1.0 + float(np.max(h)))  # far to the left delayed terms leave floating point
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
    """`_line_of_many` of one rig, the real part beside it right of which roots are looked for, and how many there are.

    −inf twice and `INFINITE` if no highest derivative is delayed.
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

    Left of it the highest power of s can vanish: infinitely many roots come as close to it as one likes, for the given
    delays or others as near as one likes to them. −inf if no highest derivative is delayed.
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
    """Real part (1/s) to which the rightmost roots of one rig, infinitely many, tend.

    NaN where others lie further right, or where that is not known to a thousandth.
    """
    (scaled,), (own,), (rate,) = nondimensional(c[None], h[None])
    line, left, many = _left_end(scaled, own, sets)
    return float(rate * line) if many == 0 and left - line <= _TOLD * abs(line) else math.nan


@quietly
def nearest_to_axis(c: Array, h: Array, sets: Sets) -> complex:
    """Root of one rig nearest to the imaginary axis (1/s), with imaginary part zero or positive."""
    (scaled,), (own,), (rate,) = nondimensional(c[None], h[None])
    return complex(rate * _root_on(scaled, own, sets, 0.0))


def _root_on(c: Array, h: Array, sets: Sets, real: float, known: Sequence[complex] = ()) -> complex:
    """Root nearest to the line Re s = `real`, with imaginary part zero or positive, by Newton's method.

    Not one of the `known` roots, if another is found: many may lie on one line.
    """
    moved = shifted(c, h, np.asarray(real))
    starts = real + 1j * np.array([0.0, *_near_axis(moved, h, sets)])
    s = starts.astype(complex)
    for _ in range(30):
        step = value(c, h, s) / slope(c, h, s)
        s = np.where(np.isfinite(step), s - step, s)
    s = np.where(np.abs(s.imag) < 1e-12 * np.abs(s), s.real + 0j, s)
    far = np.abs(s.real - real) + np.abs(value(c, h, s)) / _size(c, h, s)
    far = np.where(np.isfinite(far), far, np.inf)
    for one in known:
        same = np.abs(s.real + 1j * np.abs(s.imag) - one) <= _SAME_ROOT * abs(one)
        others = ~same & (np.abs(s.real - real) <= _ON_THE_LINE * abs(real)) & np.isfinite(far)
        far = np.where(same & np.any(others), np.inf, far)
    best = complex(s[int(np.argmin(far))])
    return complex(best.real, abs(best.imag))


def _size(c: Array, h: Array, s: Any) -> Any:
    """Sum of the absolute values of all terms at s, never zero."""
    return sum(evaluate(np.abs(p), np.abs(s)) * np.exp(-s.real * d) for p, d in zip(c, h, strict=True)) + 1e-300


def _near_axis(c: Array, h: Array, sets: Sets) -> Iterator[float]:
    """Frequencies near which a root may lie on the imaginary axis, starting values for Newton's method."""
    common = roots(c[:1])[0]  # zeros of all terms, of what nothing late acts on: there each term may lead
    yield from np.abs(common.imag[np.isfinite(common)]).tolist()
    if len(c) == 2:  # sizes of both terms agree there; the next root is within half a turn
        found = np.array([one for one in crossings(c[:1], c[1:])[0][0] if np.isfinite(one)])
        turn = 2 * np.pi / float(np.max(h)) if np.max(h) > 0 else 0.0
        yield from np.abs(found[:, None] + turn * _BESIDE_CROSSING).ravel().tolist()
        return
    own = [pieces.omega[0][leader < 0] for pieces, leader in SumsOnAxis(c[None], h[None], sets).resolved_pieces()]
    omega = np.sort(np.concatenate(own))
    size = np.abs(value(c, h, 1j * omega)) / _size(c, h, 1j * omega)
    around = np.concatenate([[np.inf], size, [np.inf]])
    dips = np.flatnonzero((size <= around[:-2]) & (size <= around[2:]))
    yield from (float(one) for one in omega[dips[np.argsort(size[dips])[:20]]])


@quietly
def nearness(c: Array, h: Array) -> Array:
    """Two measures, (2, ...), that change sign where a root crosses the imaginary axis.

    First the phase (rad) between the delay and the nearest crossing of a pair; NaN without crossing and for several
    delays. Second the value at s = 0 over the sum of the sizes of its terms.
    """
    static = np.sum(c[..., 0], axis=-1) / np.sum(np.abs(c[..., 0]), axis=-1)
    if c.shape[-2] != 2:
        return np.stack([np.full(c.shape[:-2], np.nan), static])
    scaled, own, _ = nondimensional(c, h)
    p, q, late = scaled[..., 0, :].reshape(-1, c.shape[-1]), scaled[..., 1, :].reshape(-1, c.shape[-1]), own[..., 1]
    good = np.all(np.isfinite(p), axis=-1) & np.all(np.isfinite(q), axis=-1)
    phase = np.full(len(p), np.nan)
    if np.any(good):
        omega, _, at = crossings(p[good], q[good])
        missed = np.angle(np.exp(1j * (omega * np.ravel(late)[good][:, None] - at)))
        nearest = np.argmin(np.where(np.isnan(missed), np.inf, np.abs(missed)), axis=-1)
        phase[good] = np.take_along_axis(missed, nearest[:, None], axis=-1)[:, 0]
    return np.stack([phase.reshape(c.shape[:-2]), static])


@quietly
def crossing_delays(p: Array, q: Array) -> tuple[Array, Array, Array]:
    """Delays (s), rising, at which roots of p + q exp(−sh) cross the axis; frequencies (rad/s); directions (±1).

    For one rig. Crossings to the right (+1) have the higher frequencies and so come more often: beyond some delay the
    rig is unstable for good, and the list ends. Where two frequencies nearly agree that delay is very long; then the
    list ends after `_MOST_PERIODS` periods of the fastest crossing.
    """
    (scaled,), _, (rate,) = nondimensional(np.stack([p, q])[None], np.zeros((1, 2)))
    omega, direction, phase = (one[0] for one in crossings(scaled[:1], scaled[1:]))
    known = np.isfinite(omega)
    omega, direction, phase = omega[known], direction[known], phase[known]
    delays, frequencies, ways = list_crossing_delays(omega, direction, phase)
    return delays / rate, frequencies * rate, ways


def list_crossing_delays(omega: Array, direction: Array, phase: Array) -> tuple[Array, Array, Array]:
    """Delays (φ + 2πk)/ω, k = 0, 1, ..., of crossings with falling ω; rising, with ω and direction of each.

    The list ends where the rig is unstable at all longer delays, or after `_MOST_PERIODS` periods.
    """
    if not omega.size:
        return np.empty(0), np.empty(0), np.empty(0, dtype=int)
    ahead = float(np.sum(direction * omega))  # > 0
    longest = min(
        2 * math.pi * (len(omega) + 1) / ahead if ahead > 0 else math.inf, _MOST_PERIODS * 2 * math.pi / omega[0]
    )
    delays, at, way = [], [], []
    for w, angle, sign in zip(omega, phase, direction, strict=True):
        times = np.arange(int(np.ceil(w * longest / (2 * math.pi))) + 1)
        delays.append((angle + 2 * math.pi * times) / w)
        at.append(np.full(len(times), w))
        way.append(np.full(len(times), int(sign)))
    every = np.concatenate(delays)
    order = np.argsort(every)
    return every[order], np.concatenate(at)[order], np.concatenate(way)[order]
