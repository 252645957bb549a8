"""Eigenvalues and stability of operating points, without delay (polynomial) and with delays (quasi-polynomial)."""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from steadyslip.core.caching import cached
from steadyslip.linear import crossing, quasipolynomial as with_delays, rightmost as late_roots
from steadyslip.linear.argument import UNKNOWN
from steadyslip.linear.high_precision_eigenvalues import precise_eigenvalues
from steadyslip.linear.polynomials import columns, damping_measures, is_hurwitz
from steadyslip.linear.roots import Array, ComplexArray, quietly, roots
from steadyslip.model.eigenvalues import digits_lost, eigenvalues_of
from steadyslip.model.linearisation import is_written_out
from steadyslip.model.point import OperatingPoint
from steadyslip.model.posed import late_on_springs, spare_powers
from steadyslip.model.range import characteristic, delays_in_terms, quasipolynomial

_ONE_CROSSING = 2  # number of roots right of the axis after a conjugate pair has crossed it


def spectrum(point: OperatingPoint) -> ComplexArray:
    """Eigenvalues (1/s), (..., n), by falling real part, padded with NaN; with delays only the n rightmost.

    n is the number of eigenvalues of the rig with all delays zero. If eigenvalues are lost to rounding (`digits_lost`),
    they are computed with many digits for a single rig, and are NaN for an array of rigs.
    """
    if not point.model.delays:
        return roots(characteristic(point)) if is_written_out(point.model) else _of_state_matrix(point)
    return _rightmost(point, quasipolynomial(point)[0].shape[-1] - 1)


@quietly
def growth(point: OperatingPoint) -> Array:
    """Largest real part (1/s) of the eigenvalues, (...); NaN where no eigenvalue is known.

    With a delayed highest derivative there may be no rightmost eigenvalue: infinitely many come arbitrarily near to a
    vertical line in the complex plane, whose real part is returned then.
    """
    found = (_rightmost(point, 1) if point.model.delays else spectrum(point)).real
    rate = np.max(np.where(np.isnan(found), -np.inf, found), axis=-1)
    if point.model.delays and np.any(none := np.isneginf(rate)):
        c, h = quasipolynomial(point)
        rate = np.array(rate)
        for at in np.argwhere(none & np.all(np.isfinite(c), axis=(-2, -1))):
            rate[*at] = late_roots.rate_of_many(c[*at], h[*at], delays_in_terms(point.model))
    return np.asarray(np.where(np.isneginf(rate), np.nan, rate))


@cached
def _rightmost(point: OperatingPoint, count: int) -> ComplexArray:
    c, h = quasipolynomial(point)
    c = np.where(late_on_springs(point)[..., None, None], np.nan, c)
    return late_roots.rightmost(c, h, delays_in_terms(point.model), count)


@cached
def _of_state_matrix(point: OperatingPoint) -> ComplexArray:
    found, lost = eigenvalues_of(point), digits_lost(point)
    if not np.any(lost):
        return found
    better = precise_eigenvalues(point, found[np.isfinite(found)]) if not point.shape else None
    if better is None:
        return np.where(lost[..., None], np.nan, found)
    return np.append(better, np.full(max(found.shape[-1] - len(better), 0), np.nan + 0j))


def is_stable(point: OperatingPoint, unless_long: bool = False) -> NDArray[np.bool_]:
    """True where all roots lie left of the imaginary axis and the equations are well posed.

    Where roots cannot be counted (`can_be_counted`): False with `unless_long`, else NotAvailable is raised.
    """
    if point.model.delays:
        right = counts(point) if unless_long else unstable_roots(point)
        return np.asarray((right == 0) & (static_sum(point) != 0) & ~is_ill_posed(point))
    if is_written_out(point.model):
        return is_hurwitz(characteristic(point), spare_powers(point))
    s = spectrum(point)
    return np.asarray(np.all((s.real < 0) | np.isnan(s), axis=-1) & ~is_ill_posed(point))


def can_be_counted(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where roots right of the axis can be counted: always, except with several very long delays."""
    return np.asarray(counts(point) != UNKNOWN) if point.model.delays else np.ones(point.shape, dtype=bool)


@cached
def counts(point: OperatingPoint) -> NDArray[np.int64]:
    """Number of roots right of the axis, as `unstable_roots`, but `UNKNOWN` where roots cannot be counted."""
    found = with_delays.count_right_if_feasible(*quasipolynomial(point), delays_in_terms(point.model))
    return np.where(late_on_springs(point) & point.exists, with_delays.INFINITE, found)


@cached
def unstable_roots(point: OperatingPoint) -> NDArray[np.int64]:
    """Number of roots right of the axis, for points with delays; `quasipolynomial.INFINITE`, or −1 if not finite."""
    if np.all(can_be_counted(point)):
        return counts(point)
    return with_delays.count_right(*quasipolynomial(point), delays_in_terms(point.model))


def is_ill_posed(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where the equations are ill-posed: a3 < 0, or a3 = 0 and a2 <= 0 (theory 3).

    For zero coefficients see `spare_powers`. With delays also if delayed terms outweigh the undelayed one (`neutral`):
    oscillations of arbitrarily high frequency grow then.
    """
    if not point.model.delays:
        return _ill_posed(point, characteristic(point))
    c, _ = quasipolynomial(point)
    return np.asarray(_ill_posed(point, c[..., 0, :]) | (counts(point) == with_delays.INFINITE))


def among_many(point: OperatingPoint, found: ComplexArray) -> NDArray[np.bool_]:
    """True (...) where eigenvalues in `found` (..., n) are NaN because infinitely many lie close together.

    This happens if a highest derivative is delayed (a body without mass under a controller with dead time). False for
    ill-posed rigs.
    """
    if not point.model.delays:
        return np.zeros(point.shape, dtype=bool)
    c, _ = quasipolynomial(point)
    powers = np.arange(c.shape[-1])
    top = np.max(np.where(np.any(c != 0, axis=-2), powers, 0), axis=-1)
    late = np.any(np.take_along_axis(c, top[..., None, None], axis=-1)[..., 1:, 0] != 0, axis=-1)
    return np.asarray(late & np.any(np.isnan(found), axis=-1) & point.exists & ~is_ill_posed(point))


def outweighing_delays(point: OperatingPoint) -> tuple[str, ...]:
    """Dotted names of the delays that make a single rig ill-posed.

    Empty if it is well posed, or ill-posed without delays too.

    A delay makes a rig ill-posed if, on a body without mass, delayed terms outweigh undelayed ones.
    """
    c, _ = quasipolynomial(point)
    if not point.model.delays or _ill_posed(point, c[0]) or counts(point) != with_delays.INFINITE:
        return ()
    top = int(np.flatnonzero(np.any(c != 0, axis=0))[-1])
    acting = np.any(delays_in_terms(point.model)[c[:, top] != 0], axis=0)
    late = [delay for delay, own in zip(point.model.delays, acting, strict=True) if own]
    return tuple(
        name for name, symbol in point.model.parameters.items() if any(sp.sympify(d).has(symbol) for d in late)
    )


def _ill_posed(point: OperatingPoint, c: Array) -> NDArray[np.bool_]:
    return np.asarray(crossing.is_ill_posed(columns(c), spare_powers(point)))


def static_sum(point: OperatingPoint) -> Array:
    """Static stiffness: value of the characteristic function at s = 0, (...)."""
    return (
        characteristic(point)[..., 0] if not point.model.delays else np.sum(quasipolynomial(point)[0][..., 0], axis=-1)
    )


@cached
def nearness(point: OperatingPoint) -> Array:
    """Two measures, (2, ...), that change sign where a pair of roots, or a single root, crosses the imaginary axis."""
    if not point.model.delays:
        return damping_measures(spectrum(point))
    return with_delays.nearness(*quasipolynomial(point))


def crossing_frequency(point: OperatingPoint) -> float:
    """Imaginary part (rad/s) of the root nearest to the axis, of a single rig on an edge; 0 without oscillation."""
    if point.model.delays:
        c, h = quasipolynomial(point)
        return late_roots.nearest_to_axis(
            c.reshape(-1, *c.shape[-2:])[0], h.reshape(-1, h.shape[-1])[0], delays_in_terms(point.model)
        ).imag
    found = spectrum(point).ravel()
    found = found[np.isfinite(found) & (np.abs(found.imag) > 0)]
    return float(np.abs(found[np.argmax(found.real)].imag)) if found.size else 0.0


def is_near_edge(point: OperatingPoint, share: float) -> NDArray[np.bool_]:
    """True where an oscillation neither grows nor decays: its real part is negligible (`_negligible`).

    With delays only the leading oscillation is tested: the phase to its crossing is at most `share` (rad).
    """
    if not point.model.delays:
        s = spectrum(point)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.any((s.imag != 0) & (np.abs(s.real) <= _negligible(s, share)), axis=-1))
    return np.asarray((np.abs(nearness(point)[0]) <= share) & (counts(point) <= _ONE_CROSSING))


@quietly
def distance_from_axis(point: OperatingPoint) -> Array:
    """Distance of the rightmost root from the imaginary axis over the size of the root, (...).

    NaN where no root is known.

    With one delay the result is the phase (rad) to the nearest crossing, which is at least as large, and inf where
    other roots grow.
    """
    if len(point.model.delays) == 1:
        return np.where(counts(point) <= _ONE_CROSSING, np.nanmin(np.abs(nearness(point)), axis=0), np.inf)
    s = _rightmost(point, 1) if point.model.delays else spectrum(point)
    first = np.argmax(np.where(np.isnan(s.real), -np.inf, s.real), axis=-1)[..., None]
    root = np.take_along_axis(s, first, axis=-1)[..., 0]
    return np.asarray(np.abs(root.real) / np.abs(root))


def _negligible(s: ComplexArray, share: float) -> Array:
    """Size (1/s) of a real part up to which an eigenvalue (..., n) counts as imaginary.

    It is `share` times the size of the eigenvalue, or times the geometric mean of all eigenvalues if that is less: the
    oscillation of a very stiff link may have a small damping ratio and still decay faster than all other motions.
    """
    size = np.abs(s)
    some = np.isfinite(size) & (size > 0)
    total = np.sum(np.log(np.where(some, size, 1.0)), axis=-1, keepdims=True)
    return np.asarray(share * np.minimum(size, np.exp(total / np.maximum(some.sum(axis=-1, keepdims=True), 1))))


def outgrown(point: OperatingPoint, neutral: ArrayLike, share: float) -> NDArray[np.bool_]:
    """True where a root grows, or the equations are ill-posed; roots on the axis do not count (see `_negligible`).

    Parameters
    ----------
    neutral : bool or ndarray of bool
        True where one root is zero to within rounding; the smallest root is then left out.
    """
    if point.model.delays:
        return _grows_late(point, neutral, share)
    s = spectrum(point)
    with np.errstate(all="ignore"):
        size = np.abs(s)
        grows = s.real > _negligible(s, share)
        least = np.min(size, axis=-1, keepdims=True, where=~np.isnan(size), initial=np.inf)
        grows &= ~(np.asarray(neutral)[..., None] & (size <= least))
        return np.asarray(np.any(grows, axis=-1) | is_ill_posed(point))


def _grows_late(point: OperatingPoint, neutral: ArrayLike, share: float) -> NDArray[np.bool_]:
    """Result of `outgrown` with delays, from a count of roots right of Re s = `share` times their mean size."""
    sets = delays_in_terms(point.model)
    with np.errstate(all="ignore"):
        c, h, _ = with_delays.nondimensional(*quasipolynomial(point))
        right = with_delays.count_right_if_feasible(c, h, sets, share)
        static, slope = np.sum(c[..., 0], axis=-1), np.sum(c[..., 1] - h * c[..., 0], axis=-1)
        least = np.asarray(neutral) & (-static / slope > share)
        return np.asarray((right > least) | is_ill_posed(point))
