"""Exact stable sets of parameters θ that enter the characteristic polynomial linearly, p(s) + θ q(s) (theory 11).

Stiffnesses, dampings, masses and gains enter linearly, and many friction parameters too. Linearity is tested on the
polynomial itself, at three values that are decades apart.
"""

from __future__ import annotations

from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.linear.linear_sets import linear_set, not_linear_error, sets_of
from steadyslip.linear.nearness import nearest_end
from steadyslip.linear.roots import Array
from steadyslip.linear.stiffness import STIFFNESS, critical_stiffness, in_chunks, own_safety_factor, stable_stiffness
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.model.range import require_range


@checked()
def stable_values(rig: Slider | Machine, name: str, vary: Vary | None = None) -> Any:
    """All values of a parameter at which steady sliding is stable, as exact intervals.

    Parameters
    ----------
    rig : Slider or Machine
    name : str
        Dotted name, or a unique last part, of a positive parameter that the rig has: a link's stiffness or damping, a
        gain, a mass, a preload, ...; or a delay, which may be 0 in the rig.
    vary : mapping of str to array_like or xarray.DataArray, optional
        Other parameters to vary, by dotted name, in SI units; they broadcast.

    Returns
    -------
    ndarray, shape (m, 2), or (..., m, 2), also xarray.DataArray, where parameters vary
        Open intervals (low, high) in SI units, rising; high is inf where there is no upper limit. m may be 0.
        Rigs with fewer than m intervals are padded with NaN; of rigs with delay the lowest eight are given.

    Raises
    ------
    NotAvailable
        If the parameter does not enter linearly; `boundary` scans for its edges.

    Notes
    -----
    With a delay, roots are counted; no rational function replaces it. Stable values of a delay itself are all found.
    Other parameters of a rig with delay may have infinitely many intervals; these are searched up to a factor of a
    million from the value in the rig, if no oscillation has more than a hundred periods during the delay. The last
    interval ends there, and `boundary` issues a warning.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["radiation_damping=1 GPa s/m"])
    >>> ss.stable_values(rig, "radiation_damping")
    array([[1.73467337e+10,            inf]])
    """
    full = rig.resolve(name)
    late = rig.parameters()[full].role.kind == "delay"
    if not late:
        _require_positive(rig, full)
    point = operating_point(rig, vary, (full,) if late else ())
    if point.shape or vary:
        found = stable_intervals(point, full)
        used = np.flatnonzero(np.any(np.isfinite(found[..., 0]), axis=tuple(range(found.ndim - 2))))
        found = found[..., : max(used[-1] + 1 if used.size else 1, 1), :]
        return point.wrap(found, "stable_values", rig.parameters()[full].role.unit, ("interval", "end"))
    require_range(point)
    own = linear_set(point, full)
    if own is None:
        raise not_linear_error(full)
    return np.asarray(own.intervals[np.isfinite(own.intervals[:, 0])])


@checked()
def safety_factor(rig: Slider | Machine, vary: Vary | None = None, *, along: str | None = None) -> Any:
    """Stiffness over critical stiffness k/k_cr, a controller's gain kp added to both; or a parameter over its edge.

    Parameters
    ----------
    rig : Slider or Machine
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary, by dotted name, in SI units; they broadcast.
    along : str, optional
        Dotted name, or a unique last part, of a positive parameter that enters the equations linearly: a link's
        stiffness, a gain, a mass, ...; the stiffness of a slider unless given.

    Returns
    -------
    float, ndarray or xarray.DataArray
        Value over the nearest end of an interval of stable values. Sliding is stable above 1 if the edge is a lower
        limit, as for most stiffnesses, and below 1 if it is an upper limit; see `stable_values`. NaN without an edge.
        Without a spring it is the gain over the critical gain.

    Raises
    ------
    ParameterError
        If no parameter is named for a machine.
    NotAvailable
        If the parameter does not enter linearly.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> round(ss.safety_factor(rig), 4)
    0.3096
    """
    full = name_along(rig, along)
    point = operating_point(rig, vary)
    if is_own_stiffness(rig, full):
        return point.wrap(own_safety_factor(point), "safety_factor", "1")
    _require_positive(rig, full)
    edge, own = edge_along(rig, full, vary)
    with np.errstate(all="ignore"):
        return point.wrap(np.asarray(own / edge), "safety_factor", "1")


def name_along(rig: Slider | Machine, along: str | None) -> str:
    """Dotted name of the parameter `along`; by default the stiffness of a slider.

    Raises
    ------
    ParameterError
        If there is no such parameter, or no parameter is named for a machine.
    """
    if along is None and rig.default_along is None:
        known = {name: one for name, one in rig.parameters().items() if one.value and one.role.kind != "delay"}
        example = next((name for name, one in known.items() if one.role.kind == "stiffness"), next(iter(known)))
        raise ParameterError([Problem("along", f"missing; name a parameter that the machine has, such as {example!r}")])
    return rig.resolve(along or STIFFNESS)


def is_own_stiffness(rig: Slider | Machine, name: str) -> TypeGuard[Slider]:
    """True if the parameter is a slider's stiffness, for which there are closed forms."""
    return name == STIFFNESS


def _require_positive(rig: Slider | Machine, name: str) -> None:
    value = rig.value(name)
    if not value or value < 0:
        raise ParameterError([Problem(name, "has no positive value to start from; give it one first")])


def edge_along(rig: Slider | Machine, name: str, vary: Vary | None) -> tuple[Array, Array]:
    """Nearest edge of a parameter's stable intervals, and the parameter's value in the rig; SI units, (...) each.

    Raises
    ------
    NotAvailable
        If it does not enter linearly.
    """
    point = operating_point(rig, vary)
    own = np.broadcast_to(np.asarray(point.named()[name], dtype=float), point.shape)
    if is_own_stiffness(rig, name):
        return np.asarray(critical_stiffness(rig, vary)), own
    return nearest_value(in_chunks(point, lambda part: sets_of(part, name, edges=True)), own), own


def intervals_along(rig: Slider | Machine, name: str, vary: Vary | None) -> Array:
    """Stable intervals of a parameter, SI units, (..., m, 2)."""
    if is_own_stiffness(rig, name):
        return np.asarray(stable_stiffness(rig, vary))
    return stable_intervals(operating_point(rig, vary), name)


def stable_intervals(point: OperatingPoint, name: str) -> Array:
    """Stable intervals of one parameter for arrays of rigs, SI units, (..., m, 2), padded with NaN.

    Raises
    ------
    NotAvailable
        If it does not enter linearly.
    """
    return np.asarray(in_chunks(point, lambda part: sets_of(part, name)))


def nearest_value(intervals: Array, own: ArrayLike) -> Array:
    """Positive finite end of a stable interval that is nearest to the value `own` in the rig, (...).

    NaN if there is none.
    """
    ends = intervals.reshape(*intervals.shape[:-2], -1)
    ends = np.where((ends > 0) & np.isfinite(ends), ends, np.nan)
    return np.take_along_axis(ends, nearest_end(ends, own)[..., None], axis=-1)[..., 0]
