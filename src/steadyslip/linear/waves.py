"""All zeros of functions f(ω) = Σ_d a_d(ω) cos ωd + b_d(ω) sin ωd, with polynomials a and b.

For rigs with delays the conditions "P(iω)/Q(iω) is real" and "|A(iω)| = |B(iω)|" have this form. Terms that cancel are
removed from the coefficients, so that bounds of the derivatives are tight. Zeros are enclosed by bisection: with
|f''| ≤ K on an interval of half width r about m there is no zero if |f(m)| > |f'(m)| r + K r²/2, and at most one if
|f'(m)| > K r; all other intervals are halved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.linear.allowance import may_take
from steadyslip.linear.roots import Array, ComplexArray, evaluate

_EPS = float(np.finfo(float).eps)
_ROUNDING = 64 * _EPS  # rounding of a value f(ω), relative to the sum of the sizes of its terms
_CANCELLED = 8 * _EPS  # coefficients below this, relative to the sizes of the products added, are set to zero
_NARROW = 1e-13  # relative width at which halving of an interval ends: it has one zero, or two that nearly coincide
_MOST = 400_000  # largest number of intervals that are examined at a time; by trial: memory against long delays
_OCTAVES = 60  # zeros are searched down to 2**-60 of the highest frequency, which is beyond the digits of a double


@dataclass(frozen=True, eq=False)
class Waves:
    """The function f(ω) of this module: delays d in `shift` (k,), coefficients a in `cosine` and b in `sine`, (k, r)
    each.

    Coefficients are in powers of ω, lowest first.
    """

    shift: Array
    cosine: Array
    sine: Array

    def __call__(self, x: Array) -> Array:
        """Values at frequencies `x` of any shape."""
        return np.asarray(sum(
            evaluate(a, x) * np.cos(d * x) + evaluate(b, x) * np.sin(d * x)
            for d, a, b in zip(self.shift, self.cosine, self.sine, strict=True)
        ))  # fmt: skip

    def derivative(self) -> Waves:
        """Derivative with respect to ω."""
        powers = np.arange(1, self.cosine.shape[1])
        a, b = (np.pad(one[:, 1:] * powers, ((0, 0), (0, 1))) for one in (self.cosine, self.sine))
        d = self.shift[:, None]
        return Waves(self.shift, a + d * self.sine, b - d * self.cosine)

    def largest(self, x: Array) -> Array:
        """Upper bound of |f| on [0, x], for each x."""
        return np.asarray(evaluate(np.sum(np.abs(self.cosine) + np.abs(self.sine), axis=0), x))

    def stretched(self, unit: float) -> Waves:
        """The function with ω/`unit` as its variable, multiplied so that its largest coefficient is one."""
        powers = float(unit) ** np.arange(self.cosine.shape[1])
        a, b = self.cosine * powers, self.sine * powers
        size = max(float(np.max(np.abs(a))), float(np.max(np.abs(b)))) or 1.0
        return Waves(self.shift * unit, a / size, b / size)

    def zeros(self, highest: float) -> tuple[Array, Array] | None:
        """All zeros in (0, `highest`], rising, and the sign of the slope at each zero.

        None if zeros are too many to separate.

        The sign is 0 where the function touches zero within rounding.
        """
        f = self.stretched(highest)
        with np.errstate(all="ignore"):
            found = _enclosed(f) if np.all(np.isfinite(f.cosine)) and np.all(np.isfinite(f.sine)) else None
            if found is None:
                return None
            left, right, way = found
            for _ in range(60):
                middle = 0.5 * (left + right)
                before = np.where(f(middle) < 0, -1, 1) != way
                left, right = np.where(before, middle, left), np.where(before, right, middle)
        at = 0.5 * (left + right)
        order = np.argsort(at)
        return at[order] * highest, way[order]


def _enclosed(f: Waves) -> tuple[Array, Array, Array] | None:
    """Ends of intervals in (0, 1] that contain one zero each, and the sign of the slope there.

    None if intervals are too many.
    """
    slope = f.derivative()
    bend = slope.derivative()
    begin = _first(f, slope, bend)
    count = max(int(np.ceil(np.max(f.shift) / np.pi)), 8)
    ends = np.unique(np.concatenate([[begin], begin + (1 - begin) * np.linspace(0, 1, count + 1),
                                     np.geomspace(begin, 1.0, 4 * _OCTAVES)]))  # fmt: skip
    left, right = ends[:-1], ends[1:]
    kept: list[tuple[Array, Array, Array]] = []
    while len(left):
        if len(left) > _MOST or not may_take(3 * len(left) * len(f.shift)):
            return None
        m, r = 0.5 * (left + right), 0.5 * (right - left)
        value, steep, most = f(m), slope(m), bend.largest(right)
        blur, blurred = _ROUNDING * f.largest(right), _ROUNDING * slope.largest(right)
        free = np.abs(value) > np.abs(steep) * r + 0.5 * most * r**2 + blur
        single = ~free & (np.abs(steep) > most * r + blurred)
        narrow = ~free & ~single & (r <= _NARROW * right)
        done = single | narrow
        low, high = (np.where(f(end[done]) < 0, -1, 1) for end in (left, right))
        way = (high - low) // 2
        keep = (way != 0) | narrow[done]
        kept.append((left[done][keep], right[done][keep], way[keep]))
        going = ~free & ~done
        left, right = np.concatenate([left[going], m[going]]), np.concatenate([m[going], right[going]])
    first, last, ways = (np.concatenate([one[i] for one in kept]) for i in range(3)) if kept else (np.empty(0),) * 3
    return first, last, ways.astype(int)


def _first(f: Waves, slope: Waves, bend: Waves) -> float:
    """Frequency below which the only possible zero is 0 itself."""
    zero = np.zeros(1)
    start, rate = abs(float(f(zero)[0])), abs(float(slope(zero)[0]))
    for x in 0.5 ** np.arange(1, _OCTAVES + 1):
        at = np.array([x])
        if start > _ROUNDING * float(f.largest(zero)[0]):
            free = start > float(slope.largest(at)[0]) * x
        else:  # f(0) = 0, as for every odd function
            free = rate > float(bend.largest(at)[0]) * x
        if free:
            return float(x)
    return float(0.5**_OCTAVES)


def _products(p: Array, hp: Array, q: Array, hq: Array) -> list[tuple[float, ComplexArray, Array]]:
    """Terms of P(iω) Q(iω)*: delay, coefficients in powers of ω, and the sizes of coefficients before terms cancel."""
    turn = 1j ** np.arange(max(p.shape[1], q.shape[1]))
    found = []
    for own, late in zip(p, hp, strict=True):
        for other, later in zip(q, hq, strict=True):
            z = np.convolve(own * turn[: len(own)], other * np.conj(turn[: len(other)]))
            found.append((float(late - later), z, np.convolve(np.abs(own), np.abs(other))))
    return found


def _sum_of_terms(terms: list[tuple[float, Array, Array, Array]]) -> Waves:
    """Sum of terms (delay, cosine, sine, size): terms of equal delay are added, cancelled coefficients set to zero."""
    width = max(len(cosine) for _, cosine, _, _ in terms)
    shifts = np.array([abs(delay) for delay, *_ in terms])
    unique: list[float] = []
    for d in np.sort(shifts):
        if not unique or d - unique[-1] > 4 * _EPS * d:
            unique.append(float(d))
    sums = np.zeros((3, len(unique), width))
    for delay, *parts in terms:
        place = int(np.argmin(np.abs(np.array(unique) - abs(delay))))
        for k, (own, sign) in enumerate(zip(parts, (1.0, np.sign(delay), 1.0), strict=True)):
            sums[k, place, : len(own)] += sign * own
    cosine, sine, size = sums
    cosine[np.abs(cosine) <= _CANCELLED * size] = 0.0
    sine[np.abs(sine) <= _CANCELLED * size] = 0.0
    return Waves(np.array(unique), cosine, sine)


def im_of_product(p: Array, q: Array, h: Array) -> Waves:
    """The function Im P(iω) Q(iω)*, which is zero where P/Q is real; P and Q are (m, n+1) with delays h (m,)."""
    return _sum_of_terms([(d, z.imag, -z.real, size) for d, z, size in _products(p, h, q, h)])


def difference_of_squares(a: Array, ha: Array, b: Array, hb: Array) -> Waves:
    """The function |A(iω)|² − |B(iω)|², which is zero where A and B are equal in size.

    A, b (m, n+1) with delays ha, hb (m,).
    """
    return _sum_of_terms(
        [(d, z.real, z.imag, size) for d, z, size in _products(a, ha, a, ha)]
        + [(d, -z.real, -z.imag, size) for d, z, size in _products(b, hb, b, hb)]
    )
