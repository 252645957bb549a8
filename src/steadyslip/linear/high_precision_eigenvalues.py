"""Eigenvalues with many digits, from the characteristic matrix evaluated by mpmath.

If stiffnesses or velocities are twenty decades apart, double precision has no correct digit of some eigenvalues. Here
the number of digits is doubled until all eigenvalues agree with those computed before, or by another method.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.expressions import PreciseFunction
from steadyslip.linear.roots import ComplexArray
from steadyslip.model import Model
from steadyslip.model.linearisation import characteristic_rows
from steadyslip.model.point import OperatingPoint

_DIGITS = (50, 100, 200, 400, 800, 1100)  # numbers of digits tried; 1100 suffice, as `_SHARE` of them exceeds 308
_SHARE = 0.3  # an eigenvalue more decades above the typical rate than this share of the digits counts as infinite
_PLACE = 1.2345678  # shift at which the matrix is inverted, in units of the typical rate: not an eigenvalue
_SAME = 1e-13  # relative tolerance between an eigenvalue at a number of digits and at half of it
_NEARLY = 1e-9  # relative tolerance between the eigenvalues here and those of another method
_NEWTON_DIGITS, _MOST_STEPS = (
    60,
    30,
)  # digits: three times those of `_ARRIVED`; from a start of 16 digits Newton's method needs only a few steps
_ARRIVED = 1e-20  # relative size of the last step of Newton's method; the next would change no digit of a float


def precise_eigenvalues(point: OperatingPoint, rough: ComplexArray) -> ComplexArray | None:
    """All eigenvalues (1/s) of a single rig without delay, by falling real part; None if they do not converge.

    Parameters
    ----------
    point : OperatingPoint
        Operating point of a single rig.
    rough : ndarray (n,) of complex
        Eigenvalues of another method, which give the number: with few digits some may look infinite here.
    """
    rate = float(np.median(np.abs(rough))) or 1.0
    least = (np.log10(np.max(np.abs(rough))) - np.log10(rate)) / _SHARE
    before = rough
    for digits in (one for one in _DIGITS if one > least):
        found = _with_digits(point, digits, rate)
        if found is None:
            return None
        if len(found) >= len(rough) and _alike(before, found, _SAME if before is not rough else _NEARLY):
            return found
        before = found
    return None


def precise_root(point: OperatingPoint, near: complex) -> complex | None:
    """Eigenvalue (1/s) of a single rig, with delays or without, by Newton's method; None if it does not converge.

    Parameters
    ----------
    point : OperatingPoint
        Operating point of a single rig.
    near : complex
        Start, 1/s.
    """
    import mpmath  # slow to import

    powers, entries, delays = _precise_matrix(point.model)
    with mpmath.workdps(_NEWTON_DIGITS):
        numbers = [mpmath.mpf(float(np.asarray(a))) for a in (*point.arguments, *point.steady)]
        table, late = entries(*numbers), delays(*numbers)
        lags = [sum(h * many for h, many in zip(late, own[1:], strict=True)) for own in powers]
        size = len(characteristic_rows(point.model))
        s = mpmath.mpc(near)
        for _ in range(_MOST_STEPS):
            terms = [s ** own[0] * mpmath.exp(-s * lag) for own, lag in zip(powers, lags, strict=True)]
            slopes = [
                (own[0] * s ** (own[0] - 1) if own[0] else 0) * mpmath.exp(-s * lag) - lag * term
                for own, lag, term in zip(powers, lags, terms, strict=True)
            ]
            whole, slope = (_summed(table, of, size) for of in (terms, slopes))
            try:
                inner = mpmath.inverse(whole) * slope
            except ZeroDivisionError:
                return complex(s)
            step = 1 / sum(inner[i, i] for i in range(size))
            s -= step
            if abs(step) <= _ARRIVED * abs(s):
                return complex(s)
    return None


def _summed(table: list[Any], terms: list[Any], size: int) -> Any:
    """Square matrix (size, size) whose entries, row by row, are sums of `terms` with coefficients from `table`."""
    import mpmath

    many = len(terms)
    rows = [table[i : i + many] for i in range(0, len(table), many)]
    entries = [mpmath.fdot(row, terms) for row in rows]
    return mpmath.matrix([entries[i : i + size] for i in range(0, len(entries), size)])


@cached
def _precise_matrix(model: Model) -> tuple[list[tuple[int, ...]], PreciseFunction, PreciseFunction]:
    """Powers of s and of exp(−s delay) in the characteristic matrix; mpmath functions of coefficients and delays."""
    powers, entries = matrix_entries(model)
    arguments = list(model.arguments)
    return powers, PreciseFunction(arguments, entries), PreciseFunction(arguments, list(model.delays))


def _alike(some: ComplexArray, others: ComplexArray, share: float) -> bool:
    return len(some) == len(others) and bool(np.allclose(some, others, share, 0.0))


def _with_digits(point: OperatingPoint, digits: int, rate: float) -> ComplexArray | None:
    """Finite eigenvalues (1/s) computed with `digits` digits; None where the matrix is singular or undefined."""
    import mpmath  # slow to import

    with mpmath.workdps(digits):
        parts = _parts(point, mpmath.mpf(rate))
        if parts is None:
            return None
        a, e = _pencil(*parts)
        place = mpmath.mpf(_PLACE)
        try:
            inner = mpmath.inverse(a - place * e) * e
        except ZeroDivisionError:
            return None
        found = mpmath.eig(inner, left=False, right=False) if inner.rows > 1 else [inner[0]]
        least = mpmath.mpf(10) ** (-_SHARE * digits)
        finite = np.array([complex(rate * (place + 1 / one)) for one in found if abs(one) > least])
    real = np.abs(finite.imag) <= _SAME * np.abs(finite)
    finite = np.where(real, finite.real + 0j, finite)
    return np.asarray(finite[np.lexsort((-finite.imag, -finite.real))])


def _parts(point: OperatingPoint, rate: Any) -> list[Any] | None:
    """Coefficients of s^0, s^1 and s² in the characteristic matrix, time in units of 1/rate; None if undefined."""
    import mpmath

    powers, entries, _ = _precise_matrix(point.model)
    size = len(characteristic_rows(point.model))
    try:
        numbers = entries(*(mpmath.mpf(float(np.asarray(a))) for a in (*point.arguments, *point.steady)))
        terms = [[rate ** own[0] * (own[0] == power) for own in powers] for power in range(3)]
        return [_summed(numbers, of, size) for of in terms]
    except (ZeroDivisionError, TypeError, ValueError):
        return None


def _pencil(p0: Any, p1: Any, p2: Any) -> tuple[Any, Any]:
    """A and E with (A − s E) z = 0 where (P0 + s P1 + s² P2) y = 0; z is y, then s y for columns with nonzero P2."""
    import mpmath

    n = p0.rows
    moved = [j for j in range(n) if any(p2[i, j] != 0 for i in range(n))]
    a, e = mpmath.eye(n + len(moved)), mpmath.zeros(n + len(moved))
    for i in range(n):
        for j in range(n):
            a[i, j], e[i, j] = p0[i, j], -p1[i, j]
        for k, j in enumerate(moved):
            e[i, n + k] = -p2[i, j]
    for k, j in enumerate(moved):
        e[n + k, j] = 1
    return a, e


@cached
def matrix_entries(model: Model) -> tuple[list[tuple[int, ...]], list[sp.Expr]]:
    """Powers of s and of exp(−s delay) in the characteristic matrix, and the coefficients of each of its entries.

    Entries are taken row by row; each has one coefficient per power.
    """
    entries = [entry for row in characteristic_rows(model).values() for entry in row]
    powers = sorted({own for entry in entries for own in entry})
    return powers, [entry.get(own, sp.Integer(0)) for entry in entries for own in powers]
