"""Conversion between quantities per unit area (used inside) and totals of a contact with an area (N, N/m, kg, ...)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from steadyslip.core.dimensions import Dimension, unit

AREA = Dimension(length=2)
TOTALS = ("N", "N/m", "N s/m", "N/m/s", "kg", "N s")
"""Units of totals that have a common name; others are written as the per-area unit times m^2."""


def is_per_area(unit_name: str) -> bool:
    """True if a unit has mass to the first power (Pa, Pa/m, kg/m^2, ...), so that an area turns it into a total."""
    return unit(unit_name)[1].mass == 1


def total_unit(unit_name: str) -> str:
    """Unit of a per-area quantity times an area, such as N for Pa."""
    _, dimension = unit(unit_name)
    wanted = dimension.times(AREA)
    for candidate in TOTALS:
        if unit(candidate)[1] == wanted:
            return candidate
    return f"{unit_name} m^2"


def outside(unit_name: str, area: float | None) -> tuple[float, str]:
    """Factor and unit that turn an inside value into one for users: the total of the contact if there is an area (m²).

    Reading, printing, drawing and tables all use this function.

    >>> outside("Pa/m", 0.01), outside("Pa/m", None), outside("m/s", 0.01)
    ((0.01, 'N/m'), (1.0, 'Pa/m'), (1.0, 'm/s'))
    """
    return (area, total_unit(unit_name)) if area is not None and is_per_area(unit_name) else (1.0, unit_name)


def totals(values: Mapping[str, float | None], units: Mapping[str, str], area: float | None) -> dict[str, Any]:
    """Totals of per-area values as a dict for JSON: area, values and units; empty if there is no area.

    >>> totals({"k": 9e9, "v": 1e-6}, {"k": "Pa/m", "v": "m/s"}, 0.01)
    {'area': 0.01, 'values': {'k': 90000000.0}, 'units': {'k': 'N/m'}}
    """
    found = {name: outside(units[name], area) for name in values if outside(units[name], area)[1] != units[name]}
    if not found:
        return {}
    scaled = {name: _times(values[name], factor) for name, (factor, _) in found.items()}
    return {"area": area, "values": scaled, "units": {name: unit_name for name, (_, unit_name) in found.items()}}


def total(value: float | None, unit_name: str, area: float | None) -> dict[str, Any]:
    """Total of one per-area value as a dict for JSON, ``total`` and ``total_unit``; empty if there is no total."""
    factor, name = outside(unit_name, area)
    return {} if name == unit_name else {"total": _times(value, factor), "total_unit": name}


def _times(value: float | None, factor: float) -> float | None:
    """Product for JSON; None if the value is missing or the product is not finite."""
    return value * factor if value is not None and math.isfinite(value * factor) else None


def stress_name(name: str, area: float | None) -> str:
    """A name with "stress" replaced by "force" if the rig has an area, since its totals are forces."""
    return name if area is None else name.replace("stress", "force")
