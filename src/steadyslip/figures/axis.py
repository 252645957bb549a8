"""Axis of a stability chart: parameter, range, linear or logarithmic scale, display unit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import checked_array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.roles import Parameter
from steadyslip.figures.style import axis_label, display_unit, parameter_label
from steadyslip.linear.boundary import boundary
from steadyslip.linear.nearness import ends_about
from steadyslip.machine.slider import Slider

_RANGE_FACTOR = 20.0  # default range of a positive parameter: value / 20 to value x 20 (by trial)
_BESIDE_EDGE = 2.0  # factor by which the default range extends beyond the nearest edge (by trial)
_MAX_EDGE_RATIO = 1e3  # edges further from the value than this factor do not widen the default range (by trial)
_EXCLUDED_END_MARGIN = 1 / 18  # share of a domain left out at an end that is not part of it: 10 deg of 180 for an angle


@dataclass(frozen=True)
class ChartAxis:
    """Axis of a stability chart for one parameter; values in SI units unless converted by `displayed`.

    Attributes
    ----------
    name : str
        Full dotted name.
    low, high : float
    log : bool
        True if logarithmic.
    factor : float
        Size of the display unit, in SI units.
    label : str
        Axis label: name and unit.
    """

    name: str
    low: float
    high: float
    log: bool
    factor: float
    label: str

    def at(self, share: Any) -> Any:
        """SI values at fractions (0 to 1, any shape) of the length of the axis as drawn."""
        share = np.asarray(share, float)
        inner = self.low * (self.high / self.low) ** share if self.log else self.low + (self.high - self.low) * share
        return np.clip(inner, self.low, self.high)

    def displayed(self, value: Any) -> Any:
        """SI values converted to the display unit of the axis."""
        return value / self.factor


def chart_axis(rig: Slider, name: str, limits: Sequence[Any] | None) -> ChartAxis:
    """Chart axis for a parameter of a rig, over the given range (SI numbers or text with units) or a default one.

    Raises
    ------
    UnknownNameError, ParameterError
        If the name is unknown, the rig does not have the parameter, or the range is not allowed.
    NotAvailable
        If no default range exists: the parameter is zero and has no edge.
    """
    full = rig.resolve(name)
    address = rig.parameters()[full]
    value = 0.0 if full == "slider.stiffness" and address.value is None else address.value
    if value is None:
        raise ParameterError([Problem(full, "cannot be drawn: the rig does not have it; give it a value first")])
    role = address.role
    low, high = _default_range(rig, full, role, value) if limits is None else _checked_range(full, role, limits)
    log = low > 0 and high / low > 100
    typical = value if low <= value <= high and value else math.sqrt(low * high) if log else max(abs(low), abs(high))
    factor, unit_name = display_unit(role.unit, typical, rig.area)
    return ChartAxis(full, low, high, log, factor, axis_label(parameter_label(rig, full), unit_name))


def _checked_range(name: str, role: Parameter, limits: Sequence[Any]) -> tuple[float, float]:
    if isinstance(limits, str) or len(limits) != 2:
        raise ParameterError([Problem(name, f"range {limits!r}; allowed: two values, low and high")])
    low, high = (float(checked_array(name, role, end)) for end in limits)
    if not low < high:
        raise ParameterError([Problem(name, f"range {limits!r}; allowed: low < high")])
    return low, high


def _default_range(rig: Slider, name: str, role: Parameter, value: float) -> tuple[float, float]:
    """Default range (SI): a bounded domain as a whole, otherwise a range around the rig's value and nearest edge."""
    domain = role.domain
    if np.isfinite(domain.high):
        margin = _EXCLUDED_END_MARGIN * (domain.high - domain.low)
        return (
            domain.low if domain.low_allowed else domain.low + margin,
            domain.high if domain.high_allowed else domain.high - margin,
        )
    known = rig if rig.parameters()[name].value is not None else rig.with_values({name: value})
    edges = [edge.value for edge in boundary(known, name)]
    nearest = next(iter(ends_about(value, edges)), value)
    if value and not 1 / _MAX_EDGE_RATIO < abs(nearest / value) < _MAX_EDGE_RATIO:
        nearest = value
    if nearest == value == 0:
        raise NotAvailable(f"{name} is zero and has no edge of stability, so it has no default range; give one")
    if domain.low < 0:
        ends = (value, nearest, 0.0)
        margin = 0.5 * (max(ends) - min(ends))
        return min(ends) - margin, max(ends) + margin
    if value == 0 or nearest == 0:
        return 0.0, 3 * max(value, nearest)
    return (
        min(value / _RANGE_FACTOR, nearest / _BESIDE_EDGE),
        max(value * _RANGE_FACTOR, nearest * _BESIDE_EDGE),
    )
