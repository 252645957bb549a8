"""Stable sets of parameters that enter the characteristic equation linearly, p(s) + θ q(s), with delays or without."""

from __future__ import annotations

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.linear.crossing import APART, linear_split
from steadyslip.linear.polynomials import StableSet, columns, most_intervals, stable_set
from steadyslip.linear.roots import Array, quietly
from steadyslip.linear.windows import delay_set, delay_set_among, linear_windows
from steadyslip.model.linearisation import delays_of_terms
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import characteristic, quasipolynomial

_FAR = 1e12  # times such a size, and its inverse, beyond which rounding decides where a parameter has an edge
_FACTORS = np.array([1 / APART, 1.0, APART])  # of a size of the parameter, at which its polynomial is asked for
_SIZES = 3  # tried of a parameter, until one is near that at which its part of the polynomial is like the rest
_WINDOWS = 8  # of a rig with delay that arrays of them have room for


def not_linear(name: str) -> NotAvailable:
    """The error that says so."""
    return NotAvailable(
        f"the equations do not depend on {name} linearly, so that its stable set has no exact form; boundary(rig, "
        f"{name!r}) scans for its edges"
    )


def too_late(name: str) -> NotAvailable:
    """The error of a rig whose own oscillations turn thousands of times during the delay."""
    return NotAvailable(
        f"the delay is so long for this rig that the windows of {name} are too many to be listed; boundary(rig, "
        f"{name!r}) finds those next to its own value"
    )


def most_values(point: OperatingPoint) -> int:
    """How many intervals `sets_of` has room for."""
    return _WINDOWS if point.model.delays else most_intervals(characteristic(point).shape[-1] - 1)


def sets_of(point: OperatingPoint, name: str, size: Array | None = None) -> Array:
    """Stable intervals of one parameter for arrays of rigs, (..., m, 2), NaN padded.

    `size` (...) takes the place of the values of rigs with delay, where these need not be positive.

    Raises
    ------
    NotAvailable
        If it does not enter linearly.
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
            raise not_linear(name) if size is None else too_late(name)
        count = min(len(own.intervals), most)
        flat[i, :count] = own.intervals[:count]
    return found


def linear_sets(point: OperatingPoint, name: str) -> StableSet:
    """The stable sets of one parameter for arrays of rigs without delay, whatever value of it these have.

    Raises
    ------
    NotAvailable
        If it does not enter linearly.
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
            raise not_linear(name)
        factor = np.where(known, _alike(p, q), 1.0)
        far = (factor < 1 / APART) | (factor > APART)
        if not np.any(far):
            break
        size = np.where(far, size * factor, size)
    found, unit = _resolved(stable_set(p, q)), size[..., None]
    intervals = np.where(known[..., None, None], found.intervals * unit[..., None], np.nan)
    return StableSet(intervals, found.edges * unit, found.frequencies, found.changes & known[..., None])


def _split(c: Array) -> tuple[Array, Array, Array]:
    """p and q of p + f q from values at three factors f, first axis; and where these do not lie on a line."""
    low, own, high = (columns(one) for one in c)
    p, q, straight = linear_split(low, own, high)
    return np.stack(p, axis=-1), np.stack(q, axis=-1), ~np.asarray(straight)


def _resolved(found: StableSet) -> StableSet:
    """A set in units of the parameter's own value, with edges that are rounding of zero or infinity as these."""
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
    """The stable set of one parameter of a single rig; None where it does not enter linearly, or is not positive.

    With a `size` of the parameter its own value does not matter. Windows of rigs with delay are looked for up to a
    factor of a million from there, or as far as `reach`.
    """
    value = float(point.named()[name]) if size is None else size
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
        windows = linear_windows(p, q, h, min(low, 1 / APART), max(high, APART))
    else:
        windows = _resolved(stable_set(p[0], q[0]))
    return (
        None
        if windows is None
        else StableSet(windows.intervals * value, windows.edges * value, windows.frequencies, windows.changes)
    )


def _split_around(
    point: OperatingPoint, name: str, size: float, again: bool
) -> tuple[Array, Array, Array, float] | None:
    """P, Q and delays of P + f Q for a single rig, f times a size being the parameter, and that size.

    `again` the size is changed to one at which both are alike, which does not depend on the value of the parameter.
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
        factor = float(_alike(p[0], q[0]))
        if 1 / APART <= factor <= APART:
            break
        size = size * factor
    return found


def _alike(p: Array, q: Array) -> Array:
    """The factor f at which p and f q are alike in size, of polynomials (..., n+1); 1 where they share no power."""
    both = (p != 0) & (q != 0)
    ratios = np.sum(np.where(both, np.log(np.abs(p)) - np.log(np.abs(q)), 0.0), axis=-1)
    return np.asarray(np.exp(ratios / np.maximum(np.sum(both, axis=-1), 1)))


def _delay_set(point: OperatingPoint, symbol: sp.Symbol) -> StableSet | None:
    """That of a delay that no term has twice; None elsewhere."""
    delays = delays_of_terms(point.model)
    c, h = quasipolynomial(point)
    if not np.all(np.isfinite(c)):
        return None
    if list(delays) == [0, symbol]:
        return delay_set(c[0], c[1])
    late = np.array([sp.sympify(delay).has(symbol) for delay in delays])
    if any(sp.diff(delay, symbol) != 1 for delay, own in zip(delays, late, strict=True) if own):
        return None
    others = h - late * float(point.named()[name_of(point, symbol)])
    return delay_set_among(c, np.where(np.abs(others) < 1e-12 * np.max(h), 0.0, others), late)


def name_of(point: OperatingPoint, symbol: sp.Symbol) -> str:
    """The dotted name of a parameter."""
    return next(name for name, own in point.model.parameters.items() if own == symbol)
