"""The exact stable set of any parameter that enters the characteristic polynomial linearly: p(s) + θ q(s) (theory 11).

Stiffnesses, dampings, masses and gains do, and much of friction as well. Whether a parameter does is read off the
polynomial itself, at three values that are decades apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.linear.linear_sets import linear_set, not_linear, sets_of
from steadyslip.linear.polynomials import Array
from steadyslip.linear.stiffness import in_chunks
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, Vary, operating_point
from steadyslip.model.range import require_range


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
        raise not_linear(full)
    return np.asarray(own.intervals[np.isfinite(own.intervals[:, 0])])


def stable_intervals(point: OperatingPoint, name: str) -> Array:
    """Stable intervals of one parameter for arrays of rigs, whatever value of it these have, (..., m, 2), NaN padded.

    Raises
    ------
    NotAvailable
        If it does not enter linearly.
    """
    return np.asarray(in_chunks(point, lambda part: sets_of(part, name)))


def nearest_value(intervals: Array, own: Any) -> Array:
    """The end of a stable interval nearest to a rig's own value, (...); NaN where there is none above zero."""
    ends = intervals.reshape(*intervals.shape[:-2], -1)
    ends = np.where((ends > 0) & np.isfinite(ends), ends, np.nan)
    distance = np.where(np.isnan(ends), np.inf, np.abs(ends - np.asarray(own, dtype=float)[..., None]))
    return np.take_along_axis(ends, np.argmin(distance, axis=-1)[..., None], axis=-1)[..., 0]
