"""Quantities per unit area inside, and the totals (N, N/m, kg, ...) that they are in a rig with an area."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from steadyslip.core.dimensions import Dimension, unit

AREA = Dimension(length=2)
TOTALS = ("N", "N/m", "N s/m", "N/m/s", "kg", "N s")
"""Units of the totals that people have names for."""


def is_per_area(unit_name: str) -> bool:
    """Whether a quantity is per unit area inside and a total (N, N/m, kg, ...) of a rig with an area."""
    return unit(unit_name)[1].mass == 1


def total_unit(unit_name: str) -> str:
    """Name of the unit of the total that belongs to a per-area unit."""
    _, dimension = unit(unit_name)
    wanted = dimension.times(AREA)
    for candidate in TOTALS:
        if unit(candidate)[1] == wanted:
            return candidate
    return f"{unit_name} m^2"


def outside(unit_name: str, area: float | None) -> tuple[float, str]:
    """Factor and unit in which people give and get a quantity: of the whole contact where the rig has an area.

    Everything that is read, printed, drawn or written as a table goes through this one place.

    >>> outside("Pa/m", 0.01), outside("Pa/m", None), outside("m/s", 0.01)
    ((0.01, 'N/m'), (1.0, 'Pa/m'), (1.0, 'm/s'))
    """
    return (area, total_unit(unit_name)) if area is not None and is_per_area(unit_name) else (1.0, unit_name)


def totals(values: Mapping[str, float | None], units: Mapping[str, str], area: float | None) -> dict[str, Any]:
    """What JSON has beside values per unit area: those of the whole contact, with their units; nothing without area.

    >>> totals({"k": 9e9, "v": 1e-6}, {"k": "Pa/m", "v": "m/s"}, 0.01)
    {'area': 0.01, 'values': {'k': 90000000.0}, 'units': {'k': 'N/m'}}
    """
    found = {name: outside(units[name], area) for name in values if outside(units[name], area)[1] != units[name]}
    if not found:
        return {}
    scaled = {name: _times(values[name], factor) for name, (factor, _) in found.items()}
    return {"area": area, "values": scaled, "units": {name: unit_name for name, (_, unit_name) in found.items()}}


def total(value: float | None, unit_name: str, area: float | None) -> dict[str, Any]:
    """The same beside a single value: ``total`` and ``total_unit``; nothing where it is not per unit area."""
    factor, name = outside(unit_name, area)
    return {} if name == unit_name else {"total": _times(value, factor), "total_unit": name}


def _times(value: float | None, factor: float) -> float | None:
    """A number for JSON; what does not exist and infinity are None."""
    return value * factor if value is not None and math.isfinite(value * factor) else None


def stress_name(name: str, area: float | None) -> str:
    """Name of a stress for people: the force that it is in a rig with an area."""
    return name if area is None else name.replace("stress", "force")
