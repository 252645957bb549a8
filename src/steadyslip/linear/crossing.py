"""Routh array of polynomials, and the k at which p + k q has a root iβ on the imaginary axis (theory 3).

Plain arithmetic: a polynomial is a list of coefficients, lowest power first, that are numbers, arrays or nodes of a
generated program. Arrays of rigs (`polynomials`) and pages (`steadyslip.explorer`) use the same functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from steadyslip.core.expressions import Choose

ROUNDING = 8 * float(np.finfo(float).eps)  # a difference smaller than this share of its terms counts as 0
APART = 1e6  # factor between neighbouring parameter values at which `linear_split` evaluates the polynomial
_LEFT = 1e-13  # difference of coefficients, relative to the larger, up to which the difference is rounding error
_LINEAR = 1e-10  # relative deviation from linearity that rounding alone can cause
Polynomial = Sequence[Any]


def routh(c: Polynomial) -> list[Any]:
    """First column of the Routh array of a polynomial of full degree: all roots are on the left if all are positive."""
    upper, lower = list(c[::-1][0::2]), list(c[::-1][1::2])
    column = [upper[0]]
    for _ in range(len(c) - 1):
        column.append(lower[0])
        ratio = upper[0] / lower[0]
        following = [one - ratio * lower[i] if i < len(lower) else one for i, one in enumerate(upper[1:], start=1)]
        upper, lower = lower, following
    return column


def is_ill_posed(c: Polynomial, spare: Any) -> Any:
    """True where the first coefficient from the top that is not 0 is negative, or lies below more than `spare` zeros.

    `spare` is the number of highest coefficients that may be 0 because, for example, a mass is 0; see
    `model.posed.spare_powers`.
    """
    found: Any = (c[-1] < 0) | ((c[-1] <= 0) & (spare < 1))
    gone: Any = abs(c[-1]) <= 0
    for place, one in enumerate(c[-2::-1], start=1):
        found = found | (gone & ((one < 0) | ((one <= 0) & (spare <= place))))
        gone = gone & (abs(one) <= 0)
    return found


def even_odd(c: Polynomial) -> tuple[list[Any], list[Any]]:
    """Polynomials E and O in β² with c(iβ) = E(β²) + iβ O(β²)."""
    signed = [-one if i % 4 > 1 else one for i, one in enumerate(c)]
    return signed[0::2], signed[1::2] or [0.0 * signed[0]]


def product(a: Polynomial, b: Polynomial) -> list[Any]:
    """Coefficients of the product of two polynomials."""
    out: list[Any] = [0.0] * (len(a) + len(b) - 1)
    for i, one in enumerate(a):
        for j, other in enumerate(b):
            out[i + j] = one * other + out[i + j]
    return out


def axis_polynomial(p: Polynomial, q: Polynomial, choose: Choose = np.where) -> list[Any]:
    """Im[p(iβ) conj q(iβ)]/β as a polynomial in β²: at its positive roots some real k puts a root of p + k q at iβ.

    Parameters
    ----------
    choose : callable
        Function ``choose(condition, value, other)``; for nodes of a generated program, the program's own.
    """
    (pe, po), (qe, qo) = even_odd(p), even_odd(q)
    first, second = product(po, qe), product(pe, qo)
    found = []
    for i in range(max(len(first), len(second))):
        one, other = (part[i] if i < len(part) else 0.0 for part in (first, second))
        left = one - other
        # rounding error of an exact cancellation is not a coefficient
        found.append(choose(abs(left) < ROUNDING * (abs(one) + abs(other)), 0.0, left))
    return found


def stiffness_on_axis(p: Polynomial, q: Polynomial, square: Any) -> Any:
    """Real k that puts a root of p + k q at iβ, given β² = `square`."""
    e1, o1, e2, o2 = (_at(part, square) for part in (*even_odd(p), *even_odd(q)))
    return -(e1 * e2 + square * o1 * o2) / (e2 * e2 + square * o2 * o2)


def real_edges(p: Polynomial, q: Polynomial, choose: Choose = np.where) -> tuple[Any, Any]:
    """Value of k at which a root of p + k q is zero, and value at which the highest coefficient is zero.

    The highest coefficient belongs to the highest power of s in p or q; where it is zero, a root is infinite.
    """
    top = -p[0] / q[0]
    for one, other in zip(p[1:], q[1:], strict=True):
        top = choose((abs(one) <= 0) & (abs(other) <= 0), top, -one / other)
    return -p[0] / q[0], top


def linear_split(
    low: Polynomial, own: Polynomial, high: Polynomial, choose: Choose = np.where
) -> tuple[list[Any], list[Any], Any]:
    """Polynomials p and q of p + f q, from its values at f = 1/`APART`, 1 and `APART`.

    The third result is True where the values are linear in f.
    """
    p: list[Any] = []
    q: list[Any] = []
    straight: Any = True

    def beyond(difference: Any, of: Any) -> Any:
        """The difference, or 0 if it is rounding error, which would cause a spurious edge near 1e-20."""
        return choose(abs(difference) <= _LEFT * abs(of), 0.0, difference)

    for first, middle, last in zip(low, own, high, strict=True):
        slope = beyond(last - first, last) / (APART - 1 / APART)
        rest = beyond(first - slope / APART, first)
        good = abs(middle - (rest + slope)) <= _LINEAR * (abs(rest) + abs(slope))
        straight = straight & good if p else good
        p.append(rest)
        q.append(slope)
    return p, q, straight


def is_hurwitz(c: Polynomial, choose: Choose, spare: int) -> Any:
    """True if all roots of a polynomial lie left of the axis and its highest coefficient that is not 0 is positive.

    The `spare` highest coefficients may be 0. For one rig; for arrays see `polynomials.is_hurwitz`, which also handles
    coefficients a hundred decades apart.
    """
    return judged(c, choose, spare, spare)[0]


def judged(c: Polynomial, choose: Choose, spare: Any, most: int) -> tuple[Any, list[Any]]:
    """Result of `is_hurwitz`, and factors of three functions.

    Wherever the result changes, one of the functions changes sign.

    The `spare` highest coefficients may be 0; `most` is an upper limit of `spare`.

    The three functions are the lowest coefficient (zero: a root is zero), the highest (zero: a root is infinite), and
    the last but one Hurwitz determinant (zero: two roots are ±iβ). By Orlando this determinant is proportional to the
    product of all sums of two roots; its factors are entries of the Routh array. If highest coefficients are 0, the
    next coefficient takes their place.
    """
    largest: Any = 0.0
    for one in c:
        largest = choose(abs(one) > largest, abs(one), largest)
    scaled = [one / largest for one in c]
    stable: Any = False
    gone: Any = True
    highest, determinant = scaled[-1], routh(scaled)[1:-1]
    for lost in range(min(most, len(c) - 2) + 1):
        column = routh(scaled[: len(c) - lost])
        if lost:
            gone = (abs(c[-lost]) <= 0) & gone
            highest = choose(gone, scaled[-1 - lost], highest)
            factors = [*column[1:-1], *[1.0] * lost][: len(c) - 2]
            determinant = [choose(gone, few, one) for one, few in zip(determinant, factors, strict=True)]
        stable = (_all_positive(column) & (spare >= lost) & gone) | stable
    return stable, [scaled[0], highest, *determinant]


def _all_positive(values: Polynomial) -> Any:
    good = values[0] > 0
    for one in values[1:]:
        good = good & (one > 0)
    return good


def share_left(terms: Sequence[Any], choose: Choose = np.where) -> Any:
    """Absolute value of the sum of terms over the sum of their absolute values; 0 without terms."""
    total, sizes = 0.0, 0.0
    for term in terms:
        total, sizes = total + term, sizes + abs(term)
    return choose(sizes <= 0, 0.0, abs(total) / sizes)


def _at(c: Polynomial, x: Any) -> Any:
    value = c[-1]
    for one in c[-2::-1]:
        value = value * x + one
    return value
