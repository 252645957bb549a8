"""Values in other units that may be meant, for warnings such as ``is "4.5 N m/arcsec" meant?``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from steadyslip.core.dimensions import unit
from steadyslip.core.quantities import parse, units_in

SizeWarning = tuple[str, str]
"""Name of a parameter, and the text of a warning about its value."""
Read = Mapping[str, tuple[Any, str]]
"""Values of a file by dotted name: the value as written, and the SI unit of the parameter."""
UNITS = {
    "N/m": ("N/um", "N/mm", "N/m"),
    "N m/rad": ("N m/rad", "N m/arcmin", "N m/arcsec", "kN m/rad"),
    "N s/m": ("N s/m", "N s/mm"),
    "kg": ("kg", "g", "t"),
    "kg m^2": ("kg m^2", "kg cm^2", "g cm^2"),
    "N": ("N", "kN"),
    "N m": ("N m", "kN m"),
    "N m s/rad": ("N m s/rad", "mN m s/rad"),
    "m": ("mm", "m"),
    "m/s": ("mm/min", "mm/s", "m/min", "m/s"),
    "s": ("ms", "us"),
}
"""Units used in data sheets, by SI unit."""


def number_of(text: str, si: str) -> float | None:
    """SI value of a quantity; None if the text is not a quantity of this unit's dimension."""
    try:
        return parse(text, si)
    except ValueError:
        return None


def between(low: float, high: float) -> Callable[[float], bool]:
    """Function that is True for values between `low` and `high`."""
    return lambda value: low < value < high


def in_units(written: Any, si: str, fits: Callable[[float], bool]) -> list[tuple[float, str]]:
    """SI values and texts of a written number in other units: those of `UNITS` in which `fits` accepts its value."""
    typed = next(iter(units_in([written])), "") if isinstance(written, str) else si
    value = number_of(written, si) if isinstance(written, str) else written
    if not typed or not isinstance(value, (int, float)) or isinstance(value, bool):
        return []
    number = value / unit(typed)[0]
    others = [(number * unit(one)[0], f"{number:.6g} {one}") for one in UNITS[si] if unit(one)[0] != unit(typed)[0]]
    return [one for one in others if fits(one[0])]


def texts_in_units(read: Read, name: str, si: str, fits: Callable[[float], bool]) -> list[str]:
    """Texts of the number of parameter `name` in those other units in which `fits` accepts its value."""
    return [text for _, text in in_units(read.get(name, (None, ""))[0], si, fits)]


def named(name: str, texts: Iterable[str]) -> list[str]:
    """The texts with the parameter's key before each, for warnings that suggest values of several parameters."""
    return [f"{name.rpartition('.')[2]} = {text}" for text in texts]


def hint(texts: Iterable[str]) -> str:
    """End of a warning: values that may be meant or, without any, the advice to write the unit."""
    quoted = " or ".join(f'"{one}"' for one in texts)
    return f"is {quoted} meant?" if quoted else "write the unit that is meant"


def written(read: Read, name: str) -> str:
    """Text of a parameter and its value as written in the file."""
    raw = read.get(name, ("", ""))[0]
    return f"{name} = {raw:g}" if isinstance(raw, (int, float)) else f"{name} = {raw}"


def times(ratio: float) -> str:
    """Text of a ratio to two digits, such as ``250 times``."""
    return f"{float(f'{ratio:.2g}'):.7g} times"
