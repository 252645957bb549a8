"""The exact stable set of any parameter that enters the characteristic polynomial linearly: p(s) + θ q(s) (theory 11).

Stiffnesses, dampings, masses and gains do, and much of friction as well. Whether a parameter does is read off the
polynomial itself, at three values that are decades apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.linear.crossing import APART, linear_split
from steadyslip.linear.polynomials import Array, StableSet, columns, most_intervals, quietly, stable_set
from steadyslip.linear.stiffness import in_chunks
from steadyslip.linear.windows import delay_set, linear_windows
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.linearisation import characteristic_terms
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.model.range import quasi, require_range

_WINDOWS = 8  # of a rig with delay that arrays of them have room for


@checked()
def stable_values(rig: Slider | Machine, name: str, vary: Vary | None = None) -> Any:
    """All values of a parameter at which steady sliding is stable, exactly.

    Parameters
    ----------
    rig : Slider or Machine
    name : str
        Dotted name, or a unique last part, of a positive parameter that the rig has: a link's stiffness or damping, a
        gain, a mass, a preload, ...; or a delay, whether it is there yet or not.
    vary : mapping of str to array_like or xarray.DataArray, optional
        Other parameters to vary, by dotted name, in SI units; they broadcast.

    Returns
    -------
    ndarray, shape (m, 2), or (..., m, 2), also xarray.DataArray, where parameters vary
        Open intervals (low, high) in SI units, rising; high is inf where there is no upper limit. None: no value > 0.
        Rigs with fewer than m intervals are padded with NaN; of rigs with delay the lowest eight are given.

    Raises
    ------
    NotAvailable
        If the parameter does not enter linearly; `boundary` scans for its edges.

    Notes
    -----
    With a delay, roots are counted, no rational function stands for it. All delays are found; of other parameters of a
    rig with delay, which may have windows without end, those up to a factor of a million from its own value in which no
    oscillation turns more than a hundred times during the delay; the last interval ends there.
    """
    full = rig.resolve(name)
    value = rig.value(full)
    late = rig.parameters()[full].role.kind == "delay"
    if not late and (not value or value < 0):
        message = "has no positive value to start from; give it one first"
        raise ParameterError([Problem(full, message)])
    point = operating_point(rig, vary, (full,) if late else ())
    if point.shape or vary:
        found = stable_intervals(point, full)
        used = np.flatnonzero(np.any(np.isfinite(found[..., 0]), axis=tuple(range(found.ndim - 2))))
        found = found[..., : max(used[-1] + 1 if used.size else 1, 1), :]
        return point.wrap(found, "stable_values", rig.parameters()[full].role.unit, ("interval", "end"))
    require_range(point)
    own = linear_set(point, full)
    if own is None:
        raise _not_linear(full)
    return np.asarray(own.intervals[np.isfinite(own.intervals[:, 0])])


def _not_linear(name: str) -> NotAvailable:
    return NotAvailable(
        f"the equations do not depend on {name} linearly, so that its stable set has no exact form; boundary(rig, "
        f"{name!r}) scans for its edges"
    )


def most_values(point: OperatingPoint) -> int:
    """How many intervals `stable_intervals` has room for."""
    return (
        _WINDOWS if point.model.delays else most_intervals(len(characteristic_terms(point.model)[0].coefficients) - 1)
    )


def stable_intervals(point: OperatingPoint, name: str) -> Array:
    """Stable intervals of one parameter for arrays of rigs, whatever value of it these have, (..., m, 2), NaN padded.

    Raises
    ------
    NotAvailable
        If it does not enter linearly.
    """
    most = most_values(point)

    def kernel(part: OperatingPoint) -> Array:
        found = np.full((*part.shape, most, 2), np.nan)
        if not part.model.delays:
            inner = linear_sets(part, name).intervals
            found[..., : inner.shape[-2], :] = inner
            return found
        flat = found.reshape(-1, most, 2)
        for i, one in enumerate(part.pieces(1)):
            if not np.all(np.isfinite(quasi(one)[0])):
                continue
            own = linear_set(one.with_arguments([np.reshape(a, -1)[0] for a in one.arguments], ()), name)
            if own is None:
                raise _not_linear(name)
            count = min(len(own.intervals), most)
            flat[i, :count] = own.intervals[:count]
        return found

    return np.asarray(in_chunks(point, kernel))


def nearest_value(intervals: Array, own: Any) -> Array:
    """The end of a stable interval nearest to a rig's own value, (...); NaN where there is none above zero."""
    ends = intervals.reshape(*intervals.shape[:-2], -1)
    ends = np.where((ends > 0) & np.isfinite(ends), ends, np.nan)
    distance = np.where(np.isnan(ends), np.inf, np.abs(ends - np.asarray(own, dtype=float)[..., None]))
    return np.take_along_axis(ends, np.argmin(distance, axis=-1)[..., None], axis=-1)[..., 0]


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
    factors = np.array([1 / APART, 1.0, APART])
    arguments = list(point.arguments)
    arguments[place] = factors.reshape(3, *(1,) * size.ndim) * size
    c = quasi(point.with_arguments(arguments, (3, *point.shape)))[0][..., 0, :]
    known = np.all(np.isfinite(c), axis=(0, -1))
    p, q, bent = _split(c)
    if np.any(known & (bent | ~np.any(q, axis=-1))):
        raise _not_linear(name)
    found, unit = stable_set(p, q), size[..., None]
    intervals = np.where(known[..., None, None], found.intervals * unit[..., None], np.nan)
    return StableSet(intervals, found.edges * unit, found.frequencies, found.changes & known[..., None])


def _split(c: Array) -> tuple[Array, Array, Array]:
    """p and q of p + f q from values at three factors f, first axis; and where these do not lie on a line."""
    low, own, high = (columns(one) for one in c)
    p, q, straight = linear_split(low, own, high)
    return np.stack(p, axis=-1), np.stack(q, axis=-1), ~np.asarray(straight)


@quietly
def linear_set(point: OperatingPoint, name: str) -> StableSet | None:
    """The stable set of one parameter of a single rig; None where it does not enter linearly, or is not positive."""
    value = float(point.named()[name])
    symbol = point.model.parameters[name]
    if any(delay.has(symbol) for delay in point.model.delays):
        return _delay_set(point, symbol)
    if not value > 0:
        return None
    place = list(point.model.parameters).index(name)
    factors = np.array([1 / APART, 1.0, APART])
    arguments = [a if i != place else value * factors for i, a in enumerate(point.arguments)]
    c, h = quasi(point.with_arguments(arguments, (3,)))
    if not np.all(np.isfinite(c)):
        return None
    p, q, bent = _split(c)
    if np.any(bent) or not np.any(q):
        return None
    late = bool(point.model.delays)
    found = linear_windows(p, q, h[1], factors[0], factors[2]) if late else stable_set(p[0], q[0])
    return (
        None
        if found is None
        else StableSet(found.intervals * value, found.edges * value, found.frequencies, found.changes)
    )


def _delay_set(point: OperatingPoint, symbol: sp.Symbol) -> StableSet | None:
    """That of a delay, where it is the only one."""
    terms = characteristic_terms(point.model)
    if [term.delay for term in terms] != [0, symbol]:
        return None
    c, _ = quasi(point)
    return delay_set(c[0], c[1]) if np.all(np.isfinite(c)) else None
