"""Eigenvalues with error bounds from the characteristic matrix itself, without a characteristic polynomial.

M(s) x = 0, with M a polynomial in s whose entries are slopes of the Model's equations (`characteristic_rows`), is the
machine's matrix pencil; delays add factors exp(−s h). The error of an eigenvalue found by another route is the least
singular value of M(s) (rows and columns scaled to equal size, rounding of entries added) over the change of M(s) with
s. Completeness is checked by the determinant along the imaginary axis, whose argument must turn as that of Π(s − s_i)
does; with delays, by the argument principle. Eigenvalues that fail are computed with many digits, from the eigenvalues
of M(s); with delays by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.linear.argument import count_by_argument
from steadyslip.linear.high_precision_eigenvalues import matrix_entries, precise_eigenvalues, precise_root
from steadyslip.linear.neutral import can_vanish
from steadyslip.linear.quasipolynomial import nondimensional
from steadyslip.linear.roots import Array, ComplexArray
from steadyslip.linear.spectrum import counts, spectrum
from steadyslip.model import Model
from steadyslip.model.linearisation import characteristic_rows, is_written_out
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import characteristic, delays_in_terms, delays_of, quasipolynomial

GOOD = 1e-6
"""Largest accepted relative error of an eigenvalue; with a larger error it is computed again with many digits."""
_NOISE = np.finfo(float).eps
_LAST = 8 * _NOISE  # relative rounding error after a few operations on the machine's parameters
# factor on an eigenvalue before dM/ds is taken: exactly at a double eigenvalue its effect is zero
_BESIDE = 1 + 64 * _NOISE
_FIRST = 2.0  # safety factor on errors to first order, for the effect of nearby eigenvalues
_TRIALS = 4  # number of copies with perturbed last digits of parameters; exp(−(v/v_s)²), for example, amplifies these
_ALIKE = 100.0  # singular values up to this multiple of the least one count as zero too
_SWEEPS = 3  # number of times that rows, then columns, are scaled to equal size
_APART = 0.3  # largest error (rad) of the determinant's argument at a frequency; a lost eigenvalue makes more than 1
_PLACES = 3  # number of frequencies, for each eigenvalue, at which the determinant is evaluated


@dataclass(frozen=True, eq=False)
class CheckedSpectrum:
    """Eigenvalues of one operating point, each with its error.

    Attributes
    ----------
    values : ndarray (n,) of complex
        Eigenvalues in 1/s, by falling real part; with delays only the rightmost. Empty without steady sliding and where
        the numbers leave the range of floating point.
    errors : ndarray (n,)
        Bounds of the errors (1/s), rounding of the machine's parameters in their last digit included. A double
        eigenvalue has an error of about its size times 1e-8, a triple one of 1e-5. inf where nothing is known.
    growing : int
        Number of eigenvalues with positive real part, by the argument principle; −1 if it could not be determined.
    complete : bool
        True if `values` has `growing` eigenvalues with positive real part; those closer to the imaginary axis than
        their error may count on either side.
    refined : bool
        True if the eigenvalues were computed with many digits, because those of double precision failed the checks.
    """

    values: ComplexArray
    errors: Array
    growing: int
    complete: bool
    refined: bool

    @property
    def decided(self) -> bool:
        """True if no eigenvalue is missing and each has a relative error of at most `GOOD`, or coincides with others
        within its error."""
        return self.complete and bool(np.all(_is_good(self.values, self.errors)))


@cached
def checked_spectrum(point: OperatingPoint) -> CheckedSpectrum:
    """Eigenvalues (1/s) of a single rig with error bounds, checked for completeness by the argument principle.

    Parameters
    ----------
    point : OperatingPoint
        Operating point of a single rig: ``point.shape`` is ().

    Returns
    -------
    CheckedSpectrum
    """
    found = np.ravel(spectrum(point))
    found = found[np.isfinite(found)]
    matrix = _Matrix.of(point)
    if not matrix.finite or not (found.size or point.model.delays):
        return CheckedSpectrum(found, np.full(found.shape, np.inf), -1, False, False)
    first = _checked(point, matrix, found, matrix.errors(found), False)
    if first.decided:
        return first
    if point.model.delays:
        return _checked(point, matrix, *_by_newton(point, first), True)
    better = precise_eigenvalues(point, found)
    if better is None:
        return first
    errors = np.maximum(_coefficient_errors(point, better), _NOISE * np.abs(better))
    return _checked(point, matrix, better, errors, True)


def _by_newton(point: OperatingPoint, first: CheckedSpectrum) -> tuple[ComplexArray, Array]:
    """Eigenvalues under delays with their errors (1/s). Those with too large errors are computed with many digits."""
    values, errors = first.values.copy(), first.errors.copy()
    last = 1 + _LAST * np.random.default_rng(0).choice([-0.5, 0.5], (_TRIALS, len(point.arguments)))
    others = [point.with_arguments([a * own for a, own in zip(point.arguments, row, strict=True)]) for row in last]
    for i in np.flatnonzero(~_is_good(values, errors) & (values.imag >= 0)):
        near, pair = complex(values[i]), np.abs(values - values[i].conjugate()) <= errors[i]
        apart = np.min(np.abs(np.delete(values, i) - near), initial=np.inf)
        found = [precise_root(one, near) for one in (point, *others)]
        if all(one is not None and abs(one - near) < 0.5 * apart for one in found):
            right = complex(found[0] or 0)
            error = _FIRST * max(abs((one or 0) - right) for one in found) + _NOISE * abs(right)
            values[pair], errors[pair] = right.conjugate(), error
            values[i], errors[i] = right, error
    order = np.lexsort((-values.imag, -values.real))
    return values[order], errors[order]


def _checked(
    point: OperatingPoint, matrix: _Matrix, values: ComplexArray, errors: Array, refined: bool
) -> CheckedSpectrum:
    """Make the CheckedSpectrum: it is complete if as many eigenvalues grow as an independent method counts.

    With delays that method is the argument principle; without delays the determinant shows if an eigenvalue is missing.
    """
    surely, perhaps = (int(np.sum(values.real > edge * errors)) for edge in (1, -1))
    if point.model.delays:
        growing = _count(point)
        some = len(values) if growing > len(values) else growing  # `values` may be shorter than the number that grows
        return CheckedSpectrum(values, errors, growing, growing >= 0 and surely <= some <= perhaps, refined)
    complete = refined or matrix.has_all(values)
    return CheckedSpectrum(values, errors, int(np.sum(values.real > 0)) if complete else -1, complete, refined)


def _is_good(values: ComplexArray, errors: Array) -> NDArray[np.bool_]:
    """True where the relative error is at most `GOOD`, or an eigenvalue nearly coincides with others."""
    apart = np.abs(values[:, None] - values[None, :]) + np.where(np.eye(len(values)) > 0, np.inf, 0.0)
    near = np.min(apart, axis=1, initial=np.inf) <= 2 * errors
    size = np.abs(values)
    return np.asarray((errors <= GOOD * size) | (near & (errors <= np.sqrt(GOOD) * size)))


def _count(point: OperatingPoint) -> int:
    """Number of growing roots by the argument principle; −1 where counting takes too long."""
    if len(point.model.delays) > 1:  # `counts` uses the argument principle then
        return max(int(counts(point)), -1)
    (c, h), sets = quasipolynomial(point), delays_in_terms(point.model)
    with np.errstate(all="ignore"):
        scaled, own, _ = nondimensional(c[None], h[None])
        if can_vanish(scaled, sets)[0] or not np.all(np.isfinite(scaled)):
            return -1
        return max(int(count_by_argument(scaled, own, sets)[0]), -1)


def _coefficient_errors(point: OperatingPoint, s: ComplexArray) -> Array:
    """Change of eigenvalues `s` (1/s) by rounding of the polynomial's coefficients; 0 if there is no polynomial."""
    if not is_written_out(point.model):
        return np.zeros(len(s))
    c, moved = characteristic(point), characteristic(_retold(point))
    power = np.arange(c.shape[-1])
    s = s * _BESIDE
    with np.errstate(all="ignore"):
        logs = np.log(np.abs(c)) + power * np.log(np.abs(s))[:, None]  # powers may leave the range of floating point
        terms = np.exp(logs - np.max(logs, axis=1, keepdims=True)) * np.sign(c) * (s / np.abs(s))[:, None] ** power
        wrong = _LAST + np.max(np.abs(moved / np.where(c != 0, c, 1.0) - (c != 0)), axis=0)
        return _spread(s, np.abs(s) * (np.abs(terms) @ wrong) / np.abs(terms @ power))


def _retold(point: OperatingPoint) -> OperatingPoint:
    """Copies of a single rig, (`_TRIALS`,), with the last digits of all parameters perturbed."""
    chance = np.random.default_rng(0)
    last = 1 + _LAST * chance.choice([-0.5, 0.5], (len(point.arguments), _TRIALS))
    return point.with_arguments([a * own for a, own in zip(point.arguments, last, strict=True)], (_TRIALS,))


@dataclass(frozen=True, eq=False)
class _Matrix:
    """M(s) of one rig: powers of s and delays (k,), coefficients `entries` (n, n, k) of the products s^power
    exp(−s delay), and errors `wrong` (n, n, k) of the coefficients by the last digits of the parameters."""

    powers: Array
    late: Array
    entries: Array
    wrong: Array

    @classmethod
    def of(cls, point: OperatingPoint) -> _Matrix:
        powers, function = matrix_function(point.model)
        table = np.array(powers, dtype=float).reshape(len(powers), -1)
        size = len(characteristic_rows(point.model))
        shape = size, size, len(powers)
        entries = np.array([float(np.asarray(e)) for e in point.evaluate(function)])
        values = np.array([float(np.asarray(a)) for a in (*point.arguments, *point.steady)])
        last = np.random.default_rng(0).choice([-_LAST / 2, _LAST / 2], (len(values), _TRIALS))
        others = function.rows((values[:, None] * (1 + last)).T)
        with np.errstate(invalid="ignore"):
            wrong = _LAST * np.abs(entries) + np.max(np.abs(others - entries), axis=0)
        return cls(table[:, 0], table[:, 1:] @ delays_of(point), entries.reshape(shape), wrong.reshape(shape))

    @property
    def finite(self) -> bool:
        return bool(np.all(np.isfinite(self.entries)))

    def even(self, s: ComplexArray) -> tuple[ComplexArray, Array, ComplexArray]:
        """M at s (p,), errors of its entries, and dM/ds, each (p, n, n). Rows and columns are scaled to equal size."""
        place, top = s[:, None], np.max(self.powers)
        size = np.maximum(np.abs(place), 1.0)  # entries are divided by size^top, which may leave floating point
        unit, late = place / size, np.exp(-place * self.late)
        factor = unit**self.powers * size ** (self.powers - top) * late
        lower = np.maximum(self.powers - 1, 0)
        steeper = self.powers * unit**lower * size ** (lower - top) * late - self.late * factor
        sizes = np.einsum("ijk,pk->pij", np.abs(self.entries), np.abs(factor))
        rows, columns = np.ones((2, *sizes.shape[:2]))
        for _ in range(_SWEEPS):
            even = sizes * rows[:, :, None] * columns[:, None, :]
            rows = rows / np.max(even, axis=2)
            columns = columns / np.max(sizes * rows[:, :, None] * columns[:, None, :], axis=1)
        units = rows[:, :, None] * columns[:, None, :]
        whole, slope = (np.einsum("ijk,pk->pij", self.entries, f) * units for f in (factor, steeper))
        return whole, np.einsum("ijk,pk->pij", self.wrong, np.abs(factor)) * units, slope

    def errors(self, s: ComplexArray) -> Array:
        """Distance (1/s) of each `s` from the nearest eigenvalue of the matrix; inf where it cannot be computed."""
        with np.errstate(all="ignore"):
            whole, wrong, slope = self.even(s * _BESIDE)
            good = np.all(np.isfinite(whole) & np.isfinite(wrong) & np.isfinite(slope), axis=(1, 2))
            found = np.full(len(s), np.inf)
            for i in np.flatnonzero(good):
                found[i] = _distance(whole[i], wrong[i], slope[i])
        return _spread(s, found)

    def has_all(self, s: ComplexArray) -> bool:
        """True if the argument of the determinant follows that of Π(iω − s_i) along the imaginary axis."""
        size = np.abs(s[s != 0])
        if not size.size:
            return True
        logs = np.log(size)
        omega = np.exp(np.linspace(np.min(logs) - 2, np.max(logs) + 2, _PLACES * len(s) + 3))
        with np.errstate(all="ignore"):
            whole, wrong, _ = self.even(1j * omega)
            if not (np.all(np.isfinite(whole)) and np.all(np.isfinite(wrong))):
                return False
            left, singular, right = np.linalg.svd(whole)
            rounding = np.abs(left[:, :, -1])[:, None, :] @ wrong @ np.abs(right[:, -1, :])[:, :, None]
            clear = rounding[:, 0, 0] < _APART * singular[:, -1]
            sign, _ = np.linalg.slogdet(whole)
            apart = 1j * omega[:, None] - s
            turned = sign * np.conj(np.prod(apart / np.abs(apart), axis=1))
        turned = turned[clear]
        off = np.abs(np.angle(turned * np.conj(turned[:1])))
        return len(turned) > len(s) and bool(np.all(off < _APART))


def _distance(whole: ComplexArray, wrong: Array, slope: ComplexArray) -> float:
    """Change of s (1/s) that makes the matrix `whole` singular, given its slope dM/ds and errors `wrong`."""
    left, singular, right = np.linalg.svd(whole)
    u, v = np.abs(left[:, -1]), np.abs(right[-1])
    least = float(singular[-1] + u @ wrong @ v)
    alike = int(np.sum(singular <= _ALIKE * least))  # number of singular values that vanish
    steep = np.linalg.svd(left[:, -alike:].conj().T @ slope @ right[-alike:].conj().T, compute_uv=False)
    return _FIRST * least / float(steep[-1]) if steep[-1] > 0 else np.inf


def _spread(s: ComplexArray, errors: Array) -> Array:
    """Errors (1/s) of eigenvalues with near neighbours. If m coincide, they move with the m-th root of a perturbation.

    `errors` are those of each eigenvalue taken alone; they are the larger, the closer other eigenvalues are.
    """
    size = np.maximum(np.abs(s), np.finfo(float).tiny)
    best = np.array(errors)
    apart = np.sort(np.maximum(np.abs(s[:, None] - s[None, :]), (_BESIDE - 1) * size[:, None]), axis=1)
    with np.errstate(all="ignore"):
        for many in range(2, len(s) + 1):
            moved = (np.log(errors) + np.sum(np.log(apart[:, 1:many]), axis=1)) / many
            best = np.minimum(best, np.exp(moved))
    return np.asarray(np.where(np.isnan(best), np.inf, best))


@cached
def matrix_function(model: Model) -> tuple[list[tuple[int, ...]], ArrayFunction]:
    """Powers of s and exp(−s delay) in the characteristic matrix, and an array function of its coefficients."""
    powers, entries = matrix_entries(model)
    return powers, model.function(entries)
