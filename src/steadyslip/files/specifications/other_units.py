"""Values as they would be in another unit, for questions: ``is "4.5 N m/arcsec" meant?``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from steadyslip.core.dimensions import unit
from steadyslip.core.quantities import parse, units_in

Question = tuple[str, str]
"""Name of a parameter, and the question about it."""
Read = Mapping[str, tuple[Any, str]]
"""Values that were read by dotted name: each as it was written, and its SI unit."""
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
"""Units in which data sheets give what is asked about, by SI unit."""


def number_of(text: str, si: str) -> float | None:
    """SI value of a quantity; None if the text is none."""
    try:
        return parse(text, si)
    except ValueError:
        return None


def between(low: float, high: float) -> Callable[[float], bool]:
    """Function that tells whether an SI value is between two others."""
    return lambda value: low < value < high


def in_units(written: Any, si: str, fits: Callable[[float], bool]) -> list[tuple[float, str]]:
    """SI values and texts of a number in those of `UNITS` in which it fits, without the one in which it is written."""
    typed = next(iter(units_in([written])), "") if isinstance(written, str) else si
    value = number_of(written, si) if isinstance(written, str) else written
    if not typed or not isinstance(value, (int, float)) or isinstance(value, bool):
        return []
    number = value / unit(typed)[0]
    others = [(number * unit(one)[0], f"{number:.6g} {one}") for one in UNITS[si] if unit(one)[0] != unit(typed)[0]]
    return [one for one in others if fits(one[0])]


def texts_in_units(read: Read, name: str, si: str, fits: Callable[[float], bool]) -> list[str]:
    """The number of a value that was read in units in which it fits."""
    return [text for _, text in in_units(read.get(name, (None, ""))[0], si, fits)]


def named(name: str, texts: Iterable[str]) -> list[str]:
    """Texts with the key before them, where a question is about another parameter as well."""
    return [f"{name.rpartition('.')[2]} = {text}" for text in texts]


def asked(texts: Iterable[str]) -> str:
    """End of a question: the values that may be meant, or that the unit is to be written."""
    quoted = " or ".join(f'"{one}"' for one in texts)
    return f"is {quoted} meant?" if quoted else "write the unit that is meant"


def written(read: Read, name: str) -> str:
    """A parameter as it stands in the file."""
    raw = read.get(name, ("", ""))[0]
    return f"{name} = {raw:g}" if isinstance(raw, (int, float)) else f"{name} = {raw}"


def times(ratio: float) -> str:
    """A ratio in words, to two digits."""
    return f"{float(f'{ratio:.2g}'):.7g} times"
