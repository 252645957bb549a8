"""Stable sets of parameters that enter the characteristic equation linearly, p(s) + θ q(s), with delays or without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.linear.crossing import APART, linear_split
from steadyslip.linear.delay_stable_sets import delay_set, delay_set_among, empty_set, linear_windows
from steadyslip.linear.polynomials import StableSet, columns, most_intervals, stable_set
from steadyslip.linear.roots import Array, quietly
from steadyslip.model.point import OperatingPoint
from steadyslip.model.posed import late_on_springs, spare_powers
from steadyslip.model.range import characteristic, delays_in_terms, quasipolynomial

_FAR = 1e12  # edges more than this factor from the parameter's size are at infinity or zero, apart from rounding
_FACTORS = np.array([1 / APART, 1.0, APART])  # multiples of the parameter's size at which the polynomial is evaluated
_SIZES = 3  # most corrections of the parameter's size until p and q have coefficients of similar size; by trial
_WINDOWS = 8  # stable intervals kept per rig with delay in arrays; by trial: memory against completeness


def not_linear_error(name: str) -> NotAvailable:
    """Error for a parameter on which the characteristic equation does not depend linearly."""
    return NotAvailable(
        f"the equations do not depend on {name} linearly, so that its stable set has no exact form; boundary(rig, "
        f"{name!r}) scans for its edges"
    )


def too_many_windows_error(name: str) -> NotAvailable:
    """Error for a rig whose delay spans too many periods to list its stable windows."""
    return NotAvailable(
        f"the delay is so long for this rig that the windows of {name} are too many to be listed; boundary(rig, "
        f"{name!r}) finds those next to its own value"
    )


def most_values(point: OperatingPoint) -> int:
    """Largest number of intervals per rig that `sets_of` returns."""
    return _WINDOWS if point.model.delays else most_intervals(characteristic(point).shape[-1] - 1)


def sets_of(point: OperatingPoint, name: str, size: Array | None = None, *, edges: bool = False) -> Array:
    """Stable intervals of one parameter for arrays of rigs, (..., m, 2), in SI units, padded with NaN.

    `size` (...) are positive values to search around for rigs with delay; by default the rigs' own values. With `edges`
    an end of an interval that is only the end of the searched range (with delay) is NaN.

    Raises
    ------
    NotAvailable
        If the parameter does not enter linearly.
    """
    most = most_values(point)
    found = np.full((*point.shape, most, 2), np.nan)
    if not point.model.delays:
        inner = linear_sets(point, name).intervals
        found[..., : inner.shape[-2], :] = inner
        return found
    flat = found.reshape(-1, most, 2)
    sizes = None if size is None else np.broadcast_to(size, point.shape).ravel()
    for i, one in enumerate(point.pieces(1)):
        if not np.all(np.isfinite(quasipolynomial(one)[0])):
            continue
        alone = one.with_arguments([np.reshape(a, -1)[0] for a in one.arguments], ())
        own = linear_set(alone, name, None if sizes is None else float(sizes[i]))
        if own is None:
            raise not_linear_error(name) if size is None else too_many_windows_error(name)
        count = min(len(own.intervals), most)
        flat[i, :count] = own.intervals[:count]
        if edges:
            flat[i][np.isin(flat[i], [one for one in own.searched if 0 < one < np.inf])] = np.nan
    return found


def linear_sets(point: OperatingPoint, name: str) -> StableSet:
    """Stable sets of one parameter for arrays of rigs without delay.

    They do not depend on the parameter's values in the rigs.

    Raises
    ------
    NotAvailable
        If the parameter does not enter linearly.
    """
    place = list(point.model.parameters).index(name)
    own = np.broadcast_to(np.asarray(point.arguments[place], dtype=float), point.shape)
    size = np.where(own > 0, own, 1.0)
    for _ in range(_SIZES):
        arguments = list(point.arguments)
        arguments[place] = _FACTORS.reshape(3, *(1,) * size.ndim) * size
        c = quasipolynomial(point.with_arguments(arguments, (3, *point.shape)))[0][..., 0, :]
        known = np.all(np.isfinite(c), axis=(0, -1))
        p, q, bent = _split(c)
        if np.any(known & (bent | ~np.any(q, axis=-1))):
            raise not_linear_error(name)
        factor = np.where(known, _balancing_factor(p, q), 1.0)
        far = (factor < 1 / APART) | (factor > APART)
        if not np.any(far):
            break
        size = np.where(far, size * factor, size)
    found, unit = _with_far_edges_removed(stable_set(p, q, spare_powers(point))), size[..., None]
    intervals = np.where(known[..., None, None], found.intervals * unit[..., None], np.nan)
    return StableSet(intervals, found.edges * unit, found.frequencies, found.changes & known[..., None])


def _split(c: Array) -> tuple[Array, Array, Array]:
    """p and q of p + f q, from coefficients `c` (3, ...) at the factors f in `_FACTORS`.

    The third result is True where `c` is not linear in f.
    """
    low, own, high = (columns(one) for one in c)
    p, q, straight = linear_split(low, own, high)
    return np.stack(p, axis=-1), np.stack(q, axis=-1), ~np.asarray(straight)


def _with_far_edges_removed(found: StableSet) -> StableSet:
    """Stable set in which edges beyond the factor `_FAR` are moved to 0 or infinity.

    Edges are multiples of a size near 1.
    """
    ends = np.where(found.intervals < 1 / _FAR, 0.0, np.where(found.intervals > _FAR, np.inf, found.intervals))
    ends = np.where((ends[..., :1] < ends[..., 1:]), ends, np.nan)
    order = np.argsort(np.isnan(ends[..., 0]), axis=-1, kind="stable")  # empty intervals last
    size = np.abs(found.edges)
    inside = found.changes & (size >= 1 / _FAR) & (size <= _FAR)
    return StableSet(np.take_along_axis(ends, order[..., None], axis=-2), found.edges, found.frequencies, inside)


@quietly
def linear_set(
    point: OperatingPoint, name: str, size: float | None = None, reach: tuple[float, float] | None = None
) -> StableSet | None:
    """Stable set of one parameter of a single rig, SI units.

    None if the parameter does not enter linearly or is not positive.

    `size` is the value to start from, by default that in the rig. Windows of rigs with delay are searched up to a
    factor of a million from it, or in the range `reach` if that is wider.
    """
    place = list(point.model.parameters).index(name)
    value = float(point.named()[name]) if size is None else size
    own = point.with_arguments([value if i == place else one for i, one in enumerate(point.arguments)], ())
    if point.model.delays and late_on_springs(own):
        return empty_set()
    symbol = point.model.parameters[name]
    if any(delay.has(symbol) for delay in point.model.delays):
        return _delay_set(point, symbol)
    if not value > 0:
        return None
    late = bool(point.model.delays)
    found = _split_around(point, name, value, not late)
    if found is None:
        return None
    p, q, h, value = found
    if late:
        low, high = (1 / APART, APART) if reach is None else (reach[0] / value, reach[1] / value)
        windows = linear_windows(
            p, q, h, min(low, 1 / APART), max(high, APART), delays_in_terms(point.model), int(spare_powers(point))
        )
    else:
        windows = _with_far_edges_removed(stable_set(p[0], q[0], spare_powers(point)))
    if windows is None:
        return None
    low, high = windows.searched
    return replace(
        windows, intervals=windows.intervals * value, edges=windows.edges * value, searched=(low * value, high * value)
    )


def _split_around(
    point: OperatingPoint, name: str, size: float, again: bool
) -> tuple[Array, Array, Array, float] | None:
    """P, Q, delays and size for a single rig whose characteristic function is P + f Q. The parameter is f times size.

    With `again` the size is changed until P and Q have coefficients of similar size, so that the result does not depend
    on the value of the parameter. None if the parameter does not enter linearly.
    """
    place, found = list(point.model.parameters).index(name), None
    for _ in range(_SIZES if again else 1):
        arguments = [a if i != place else size * _FACTORS for i, a in enumerate(point.arguments)]
        c, h = quasipolynomial(point.with_arguments(arguments, (3,)))
        if not np.all(np.isfinite(c)):
            break
        p, q, bent = _split(c)
        if np.any(bent) or not np.any(q):
            break
        found = p, q, h[1], size
        factor = float(_balancing_factor(p[0], q[0]))
        if 1 / APART <= factor <= APART:
            break
        size = size * factor
    return found


def _balancing_factor(p: Array, q: Array) -> Array:
    """Factor f with which p and f q (..., n+1) have coefficients of similar size.

    It is a geometric mean; 1 if no power is in both.
    """
    both = (p != 0) & (q != 0)
    ratios = np.sum(np.where(both, np.log(np.abs(p)) - np.log(np.abs(q)), 0.0), axis=-1)
    return np.asarray(np.exp(ratios / np.maximum(np.sum(both, axis=-1), 1)))


def _delay_set(point: OperatingPoint, symbol: sp.Symbol) -> StableSet | None:
    """Stable set of a delay; None if it is part of another delay, or coefficients are not finite."""
    sets, delays = delays_in_terms(point.model), point.model.delays
    c, h = quasipolynomial(point)
    if not np.all(np.isfinite(c)):
        return None
    if delays == (symbol,):
        return delay_set(c[0], c[1], int(spare_powers(point)))
    if symbol not in delays or sum(sp.sympify(delay).has(symbol) for delay in delays) > 1:
        return None
    late = sets[:, delays.index(symbol)]
    others = h - late * float(point.named()[name_of(point, symbol)])
    others = np.where(np.abs(others) < 1e-12 * np.max(h), 0.0, others)
    return delay_set_among(c, others, sets, late, int(spare_powers(point)))


def name_of(point: OperatingPoint, symbol: sp.Symbol) -> str:
    """Dotted name of the parameter with a symbol."""
    return next(name for name, own in point.model.parameters.items() if own == symbol)
