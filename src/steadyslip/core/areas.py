"""Conversion between quantities per unit area (used inside) and totals of a contact with an area (N, N/m, kg, ...)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from steadyslip.core.dimensions import Dimension, unit
from steadyslip.core.written import display_names

AREA = Dimension(length=2)
TOTALS = ("N", "N/m", "N s/m", "N/m/s", "kg", "N s")
"""Units of totals with a common name; any other total has the per-area unit times m^2, such as ``Pa s m^2``."""


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
    """Factor and unit that convert a stored per-area value to the total of an area (m²).

    1 and the unit itself without area.

    Readers and tables pass the rig's area; text and figures pass the area that `display_area` returns.

    >>> outside("Pa/m", 0.01), outside("Pa/m", None), outside("m/s", 0.01)
    ((0.01, 'N/m'), (1.0, 'Pa/m'), (1.0, 'm/s'))
    """
    return (area, total_unit(unit_name)) if area is not None and is_per_area(unit_name) else (1.0, unit_name)


def display_area(unit_name: str, area: float | None) -> float | None:
    """Area (m²) for `outside` when results are displayed; None to display stresses, as the rig's file does.

    Stresses are displayed if the display units (`steadyslip.core.written`) contain the per-area unit and not the unit
    of the total, such as MPa and no N. If they contain neither, the file's other quantities decide. If they contain no
    unit of area, the area was given to the rig later, and totals are displayed. Readers and exports do not call this
    function.

    >>> from steadyslip.core.written import display_units
    >>> with display_units(["MPa", "N/um", "cm^2"]):
    ...     display_area("Pa", 0.01), display_area("Pa/m", 0.01)
    (None, 0.01)
    """
    if area is None or not is_per_area(unit_name):
        return area
    own = unit(unit_name)[1]
    stresses, forces = _families(display_names())
    if AREA not in stresses:
        return area
    if (own in stresses) != (own.times(AREA) in forces):
        return area if own not in stresses else None
    return area if forces or stresses == {AREA} else None


@lru_cache(maxsize=256)
def _families(names: frozenset[str]) -> tuple[frozenset[Dimension], frozenset[Dimension]]:
    """Dimensions of the named units as two sets: areas and quantities per area; totals."""
    found = {unit(name)[1] for name in names}
    forces = {unit(name)[1] for name in TOTALS}
    return frozenset(one for one in found if one == AREA or one.times(AREA) in forces), frozenset(found & forces)


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
    """Product of value and factor for JSON; None if the value is missing or the product is not finite."""
    return value * factor if value is not None and math.isfinite(value * factor) else None


def stress_name(name: str, area: float | None) -> str:
    """Name of a quantity; "stress" is replaced by "force" if it is displayed as a total of the area (m²)."""
    return name if display_area("Pa", area) is None else name.replace("stress", "force")
