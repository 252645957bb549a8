"""Eigenvalues and stability of operating points, whether their equation is a polynomial or, with delays, a sum."""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from steadyslip.core.questions import question
from steadyslip.linear import crossing, quasi as sums
from steadyslip.linear.argument import UNKNOWN
from steadyslip.linear.polynomials import damping_measures, is_hurwitz
from steadyslip.linear.roots import Array, ComplexArray, roots
from steadyslip.model.eigenvalues import eigenvalues_of
from steadyslip.model.linearisation import delays_of_terms, is_written_out
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import characteristic, quasipolynomial

_ONE_CROSSING = 2  # roots that lie right of the axis just beyond an edge, at most


def spectrum(point: OperatingPoint) -> ComplexArray:
    """Eigenvalues (1/s), (..., n), by falling real part, NaN padded; with delays the n rightmost, n that without."""
    if not point.model.delays:
        return roots(characteristic(point)) if is_written_out(point.model) else eigenvalues_of(point)
    c, h = quasipolynomial(point)
    return sums.rightmost(c, h, c.shape[-1] - 1)


def is_stable(point: OperatingPoint) -> NDArray[np.bool_]:
    """Whether all roots lie left of the axis and the equations are well posed."""
    if not point.model.delays:
        return is_hurwitz(characteristic(point))
    return np.asarray((unstable_roots(point) == 0) & (static_sum(point) != 0) & ~is_ill_posed(point))


def can_be_counted(point: OperatingPoint) -> NDArray[np.bool_]:
    """Where roots to the right can be counted: everywhere but under several delays of absurd length."""
    return np.asarray(_counts(point) != UNKNOWN) if point.model.delays else np.ones(point.shape, dtype=bool)


@question
def _counts(point: OperatingPoint) -> NDArray[np.int64]:
    return sums.counted_right(*quasipolynomial(point))


@question
def unstable_roots(point: OperatingPoint) -> NDArray[np.int64]:
    """How many roots lie right of the axis, of points with delays; `quasi.INFINITE` of them, or −1 where unknown."""
    return _counts(point) if np.all(can_be_counted(point)) else sums.count_right(*quasipolynomial(point))


def is_ill_posed(point: OperatingPoint) -> NDArray[np.bool_]:
    """Whether the equations cannot be solved for their unknown: a3 < 0, or a3 = 0 and a2 <= 0 (theory 3).

    With delays also where what is delayed outweighs what acts at once, in the highest derivative: then disturbances
    grow the faster, the shorter the delay.
    """
    if not point.model.delays:
        return ill_posed(characteristic(point))
    c, _ = quasipolynomial(point)
    return np.asarray(ill_posed(c[..., 0, :]) | (_counts(point) == sums.INFINITE))


def outweighing_delays(point: OperatingPoint) -> tuple[str, ...]:
    """Names of the delays by which a single rig is ill-posed; none where it is not, or would be without them.

    Of the highest derivative, that of bodies without mass, what is delayed outweighs what acts at once.
    """
    c, _ = quasipolynomial(point)
    if not point.model.delays or ill_posed(c[0]) or _counts(point) != sums.INFINITE:
        return ()
    top = int(np.flatnonzero(np.any(c != 0, axis=0))[-1])
    late = [delay for delay, own in zip(delays_of_terms(point.model), c[:, top], strict=True) if own != 0]
    return tuple(
        name for name, symbol in point.model.parameters.items() if any(sp.sympify(d).has(symbol) for d in late)
    )


def ill_posed(c: Array) -> NDArray[np.bool_]:
    """The same of polynomials (..., n+1)."""
    return np.asarray(crossing.is_ill_posed((c[..., -2], c[..., -1])))


def static_sum(point: OperatingPoint) -> Array:
    """The static stiffness: the value of the characteristic function at s = 0."""
    return (
        characteristic(point)[..., 0] if not point.model.delays else np.sum(quasipolynomial(point)[0][..., 0], axis=-1)
    )


@question
def nearness(point: OperatingPoint) -> Array:
    """Two functions of rigs, (2, ...), that pass through zero where a root crosses the axis, in pairs or alone."""
    if not point.model.delays:
        return damping_measures(spectrum(point))
    return sums.nearness(*quasipolynomial(point))


def crossing_frequency(point: OperatingPoint) -> float:
    """Imaginary part (rad/s) of the root nearest to the axis, of a single rig on an edge; 0 without oscillation."""
    if point.model.delays:
        c, h = quasipolynomial(point)
        return sums.nearest_to_axis(c.reshape(-1, *c.shape[-2:])[0], h.reshape(-1, h.shape[-1])[0]).imag
    found = spectrum(point).ravel()
    found = found[np.isfinite(found) & (np.abs(found.imag) > 0)]
    return float(np.abs(found[np.argmax(found.real)].imag)) if found.size else 0.0


def is_near_edge(point: OperatingPoint, share: float) -> NDArray[np.bool_]:
    """Whether an oscillation is undamped to within a share, of the leading roots."""
    if not point.model.delays:
        return np.asarray(np.abs(0.5 * nearness(point)[0]) <= share)
    return np.asarray((np.abs(nearness(point)[0]) <= share) & (unstable_roots(point) <= _ONE_CROSSING))


def outgrown(point: OperatingPoint, neutral: ArrayLike, share: float) -> NDArray[np.bool_]:
    """Whether a disturbance grows by more than a share, whatever a root on the axis does; or at once.

    Parameters
    ----------
    neutral : bool or ndarray of bool
        Where one root is zero to within rounding: it does not count.
    """
    s = spectrum(point)
    with np.errstate(all="ignore"):
        size = np.abs(s)
        grows = s.real > share * size
        least = np.min(size, axis=-1, keepdims=True, where=~np.isnan(size), initial=np.inf)
        grows &= ~(np.asarray(neutral)[..., None] & (size <= least))
        return np.asarray(np.any(grows, axis=-1) | is_ill_posed(point))
