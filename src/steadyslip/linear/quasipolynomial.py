"""Quasi-polynomials Σ p_j(s) exp(−s h_j), and the number of their roots right of a line (theory 11).

Coefficients are (..., m, n+1), lowest power first, delays (..., m) with h_0 = 0; the leading axes are rigs. `sets` (m,
d) is True for the delays of the rig whose sum is h_j. Nothing is approximated by rational functions. With one delay the
count starts from the roots without delay: as the delay grows, roots cross the imaginary axis only at the few ω with
|p(iω)| = |q(iω)|, at delays (φ + 2πk)/ω, to the right at the highest of these ω and then alternately to the left and
right (Cooke & van den Driessche 1986; Walton & Marshall 1987). With several delays the argument principle is applied
along the axis (`argument`).

The count is `INFINITE` where the highest power of s can vanish (`neutral`): infinitely many roots lie to the right,
with growth rates that are larger the shorter the delay. It is `UNKNOWN` where counting takes too long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steadyslip.core.errors import NotAvailable
from steadyslip.linear.argument import UNKNOWN, count_by_argument
from steadyslip.linear.neutral import Sets, bound_on_axis, can_vanish
from steadyslip.linear.polynomials import even_odd, product
from steadyslip.linear.roots import Array, evaluate, quietly, roots

INFINITE = 2**62  # stands for infinitely many roots: larger than any number of roots
_BATCH = 40  # number of rigs with several delays whose roots are counted together; by trial: memory against speed
# delays at which roots cross are listed up to this many periods of the highest frequency; by trial
_MOST_PERIODS = 5000


def value(c: Array, h: Array, s: Any) -> Any:
    """Value of Σ p_j(s) exp(−s h_j); for one rig `s` has any shape, for rigs (rows, m, n+1) the shape (rows, k)."""
    s = np.asarray(s, dtype=complex)
    return sum(evaluate(p, s) * np.exp(-s * delay) for p, delay in _terms(c, h))


def slope(c: Array, h: Array, s: Any) -> Any:
    """Derivative with respect to s of Σ p_j(s) exp(−s h_j), shapes as in `value`."""
    powers = np.arange(1, c.shape[-1])
    return sum((evaluate(p[..., 1:] * powers, s) - d * evaluate(p, s)) * np.exp(-s * d) for p, d in _terms(c, h))


def size_of_terms(c: Array, h: Array, s: Any) -> Any:
    """Sum of the absolute values of all terms at s, never zero; shapes as in `value`."""
    return sum(evaluate(np.abs(p), np.abs(s)) * np.exp(-s.real * d) for p, d in _terms(c, h)) + 1e-300


def _terms(c: Array, h: Array) -> Iterator[tuple[Array, Array]]:
    """Yield the coefficients and the delay of each term. For several rigs they broadcast with values (rigs, k)."""
    for j in range(c.shape[-2]):
        yield (c[j], h[j]) if c.ndim == 2 else (c[:, j, None], h[:, j, None])


@quietly
def shifted(c: Array, h: Array, shift: Array) -> Array:
    """Coefficients of the quasi-polynomial whose value at s equals that of `c` at s + `shift`.

    `shift` has shape (...).
    """
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
    """Dimensionless coefficients and delays of quasi-polynomials, and the rate (1/s) that is the unit of s.

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
        raise too_long(float(np.nanmax(fast) * np.max(own)) / (2 * np.pi))
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
    """Frequencies ω with |p(iω)| = |q(iω)|, falling, padded with NaN; directions; phases; (rigs, n) each.

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
    """Number of roots of p + q exp(−sh) right of the axis: the number at h = 0, plus crossings as h grows."""
    start = np.sum(roots(p + q).real > 0, axis=-1)
    omega, direction, phase = crossings(p, q)
    times = np.maximum(np.ceil((omega * h[:, None] - phase) / (2 * np.pi)), 0.0)
    crossed = np.nansum(np.where(np.isnan(omega), 0.0, 2 * direction * times), axis=-1)
    return np.asarray(start + crossed, dtype=np.int64)


def too_long(turns: float) -> NotAvailable:
    """Error for delays that last up to `turns` periods of the rig's oscillations."""
    return NotAvailable(
        f"the delays are so long beside the oscillations of this rig, up to {turns:.2g} turns, that its growing roots "
        "cannot be counted; shorten them"
    )


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
    rig stays unstable, and the list ends. Where two frequencies nearly agree that delay is very long; then the
    list ends after `_MOST_PERIODS` periods of the fastest crossing.
    """
    (scaled,), _, (rate,) = nondimensional(np.stack([p, q])[None], np.zeros((1, 2)))
    omega, direction, phase = (one[0] for one in crossings(scaled[:1], scaled[1:]))
    known = np.isfinite(omega)
    omega, direction, phase = omega[known], direction[known], phase[known]
    delays, frequencies, ways = list_crossing_delays(omega, direction, phase)
    return delays / rate, frequencies * rate, ways


def list_crossing_delays(omega: Array, direction: Array, phase: Array) -> tuple[Array, Array, Array]:
    """Delays (φ + 2πk)/ω, k = 0, 1, ..., in rising order, with the ω and direction of each; `omega` is falling.

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
