"""Text such as ``"9 GPa/m"`` to SI numbers and back; the table of units.

Numbers inside the package are plain SI floats. Text is read only at the edges (files, command line,
constructors). Everyday units are read from the table below; any other goes to pint.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from steadyslip import units
from steadyslip.errors import QuantityError


class Dimension(NamedTuple):
    """Exponents of kilogram, metre, second and radian."""

    mass: float = 0
    length: float = 0
    time: float = 0
    angle: float = 0

    def times(self, other: Dimension, power: float = 1) -> Dimension:
        return Dimension(*(a + power * b for a, b in zip(self, other, strict=True)))


_PREFIX = {"G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}
_MICRO = str.maketrans({"µ": "u", "μ": "u", "·": " ", "×": " ", "²": "^2", "³": "^3", "−": "-"})
_PREFIXED = {
    "Pa": Dimension(1, -1, -2),
    "N": Dimension(1, 1, -2),
    "m": Dimension(0, 1),
    "s": Dimension(0, 0, 1),
    "Hz": Dimension(0, 0, -1),
}
_TABLE: dict[str, tuple[float, Dimension]] = {
    "g": (1e-3, Dimension(1)),
    "kg": (1.0, Dimension(1)),
    "t": (1e3, Dimension(1)),
    "min": (units.minute, Dimension(0, 0, 1)),
    "h": (units.hour, Dimension(0, 0, 1)),
    "hour": (units.hour, Dimension(0, 0, 1)),
    "day": (units.day, Dimension(0, 0, 1)),
    "yr": (units.year, Dimension(0, 0, 1)),
    "year": (units.year, Dimension(0, 0, 1)),
    "bar": (1e5, Dimension(1, -1, -2)),
    "rad": (1.0, Dimension(0, 0, 0, 1)),
    "deg": (units.deg, Dimension(0, 0, 0, 1)),
    "degree": (units.deg, Dimension(0, 0, 0, 1)),
    "degrees": (units.deg, Dimension(0, 0, 0, 1)),
    "°": (units.deg, Dimension(0, 0, 0, 1)),
    "%": (1e-2, Dimension()),
    "1": (1.0, Dimension()),
}
for _base, _dimension in _PREFIXED.items():
    _TABLE[_base] = (1.0, _dimension)
    for _letter, _factor in _PREFIX.items():
        _TABLE.setdefault(_letter + _base, (_factor, _dimension))

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf(?:inity)?)", re.I)
_FACTOR = re.compile(r"\s*(/|\*(?!\*))?\s*([A-Za-z%°1]+)\s*(?:(?:\^|\*\*)\s*(-?\d+)|(\d+))?")


class _NotInTable(Exception):
    """The unit has to be looked up elsewhere."""


@lru_cache(maxsize=256)
def unit(text: str) -> tuple[float, Dimension]:
    """SI factor and dimension of a unit such as ``"Pa s/m"``.

    Raises
    ------
    QuantityError
        If neither the table nor pint knows the unit.
    """
    try:
        return _unit_from_table(text)
    except _NotInTable:
        return _unit_from_pint(text)


def _unit_from_table(text: str) -> tuple[float, Dimension]:
    factor, dimension, position = 1.0, Dimension(), 0
    text = text.translate(_MICRO).strip()
    while position < len(text):
        match = _FACTOR.match(text, position)
        if match is None or match[2] not in _TABLE:
            raise _NotInTable
        power = int(match[3] or match[4] or 1) * (-1 if match[1] == "/" else 1)
        value, base = _TABLE[match[2]]
        factor *= value**power
        dimension = dimension.times(base, power)
        position = match.end()
    return factor, dimension


def _unit_from_pint(text: str) -> tuple[float, Dimension]:
    import pint

    registry = _pint_registry()
    try:
        quantity = registry.Quantity(1.0, text)
        exponents = dict(quantity.dimensionality)
        base = quantity.to_base_units()
    except (pint.PintError, ValueError, TypeError, AttributeError, AssertionError) as error:
        raise QuantityError(f"{text!r} is not a unit") from error
    except Exception as error:  # pint's tokenizer raises its own kinds for broken text
        raise QuantityError(f"{text!r} is not a unit") from error
    known = {"[mass]": "mass", "[length]": "length", "[time]": "time"}
    if not set(exponents) <= set(known):
        raise QuantityError(f"{text!r} has a dimension that no parameter has")
    dimension = Dimension(**{known[key]: float(power) for key, power in exponents.items()})
    return float(base.magnitude), dimension


@lru_cache(maxsize=1)
def _pint_registry():  # type: ignore[no-untyped-def]  # pint is imported lazily
    import pint

    return pint.UnitRegistry()


def parse(text: str, expected: str) -> float:
    """Read a quantity.

    Parameters
    ----------
    text : str
        A number and a unit, such as ``"5 MPa"``; a bare number where `expected` is ``"1"``.
    expected : str
        SI unit of the parameter; only its dimension matters.

    Returns
    -------
    float
        The value in SI units.

    Raises
    ------
    QuantityError
        If the text is not a quantity, has no unit where one is needed, or another dimension.
    """
    cleaned = text.translate(_MICRO).strip()
    match = _NUMBER.match(cleaned)
    if match is None:
        raise QuantityError(f"{text!r} is not a number with a unit; write for example {example(expected)}")
    digits, name = match.group(), cleaned[match.end() :].strip()
    _, wanted = unit(expected)
    if not name:
        if wanted != Dimension():
            raise QuantityError(f"{text!r} has no unit; write for example {example(expected)}")
        return float(digits)
    try:
        factor, found = unit(name)
    except QuantityError as error:
        raise QuantityError(f"{error}; write for example {example(expected)}") from error
    if found != wanted:
        raise QuantityError(
            f"{text!r} has the wrong dimension; expected {described(expected)}, for example {example(expected)}"
        )
    return _scaled(digits, factor)


def _scaled(digits: str, factor: float) -> float:
    """Number times factor, rounded once: ``10 um`` is 1e-05, not the next float below."""
    plain = float(digits)
    if not math.isfinite(plain) or abs(plain) < 1e-290:
        return plain * factor
    try:
        return float(Fraction(digits) * Fraction(repr(factor)))
    except OverflowError:
        return math.copysign(math.inf, plain)


def numbers(values: Any, expected: str, read: Callable[[str, str], float] = parse) -> tuple[float, ...]:
    """Read a column of quantities.

    Parameters
    ----------
    values : list, tuple or 1-D array
        Numbers in SI units, or texts.
    expected : str
        SI unit of the column.
    read : callable, optional
        What reads a text, given `expected`.

    Returns
    -------
    tuple of float
        The values in SI units, all finite.

    Raises
    ------
    QuantityError
        If this is no such column; names the place, from 1, and the value of the first fault.
    """
    if isinstance(values, np.ndarray) and values.ndim == 1:
        values = values.tolist()
    if not isinstance(values, (list, tuple)):
        raise QuantityError(f"got {values!r}; allowed: a list of numbers in {expected}, or of texts with units")
    found = []
    for place, value in enumerate(values, start=1):
        try:
            number = read(value, expected) if isinstance(value, str) else _plain(value)
        except QuantityError as error:
            raise QuantityError(f"value {place}: {error}") from error
        if not math.isfinite(number):
            raise QuantityError(f"value {place}: got {value!r}; allowed: a finite number")
        found.append(number)
    return tuple(found)


def _plain(value: Any) -> float:
    """A number as a float; truth values, complex numbers and whatever else are none."""
    if type(value) is float:  # long columns are of these
        return value
    if isinstance(value, (bool, np.bool_)) or not hasattr(value, "__float__") or np.ndim(value) != 0:
        raise QuantityError(f"got {value!r}; allowed: a finite number or text with a unit")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise QuantityError(f"got {value!r}; allowed: a finite number or text with a unit") from error


_EXAMPLES = {
    "Pa": "5 MPa",
    "Pa/m": "9 GPa/m",
    "m": "1 um",
    "m/s": "1 um/s",
    "s": "10 s",
    "rad": "-45 deg",
    "kg/m^2": "200 kg/m^2",
    "Pa s/m": "1e6 Pa s/m",
    "N": "50 N",
    "N/m": "1e6 N/m",
    "kg": "2 kg",
    "m^2": "0.01 m^2",
}


def example(expected: str) -> str:
    """A quoted example of a quantity of this unit."""
    if expected == "1":
        return "0.5 (a number without unit)"
    return repr(_EXAMPLES.get(expected, f"1 {expected}"))


def described(expected: str) -> str:
    """The unit in words for messages."""
    return "a number without unit" if expected == "1" else f"a quantity in {expected}"


_SHOWN_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))


def shown(value: float, si_unit: str, digits: int = 4) -> str:
    """A value for people: prefixed unit and a few digits, angles in degrees.

    >>> shown(8.72093e9, "Pa/m"), shown(-0.7853981633974483, "rad"), shown(0.0145, "1")
    ('8.721 GPa/m', '-45 deg', '0.0145')
    """
    if si_unit == "1":
        return f"{value:.{digits}g}"
    if si_unit == "rad":
        return f"{value / units.deg:.{digits}g} deg"
    if si_unit == "s" and math.isfinite(value) and abs(value) >= 600:
        for size, name in ((units.year, "yr"), (units.day, "days"), (units.hour, "h"), (60.0, "min")):
            if abs(value) >= 2 * size:
                return f"{value / size:.{digits}g} {name}"
    first = re.match(r"Pa|N|m|s", si_unit)
    if first is None or value == 0 or not math.isfinite(value):
        return f"{value:.{digits}g} {si_unit}"
    size = abs(value)
    for factor, prefix in _SHOWN_PREFIXES:
        if size >= 0.9999 * factor and (prefix not in ("G", "M", "k") or first[0] in ("Pa", "N")):
            break
    if not 1e-3 <= size / factor < 1e5:
        return f"{value:.{digits}g} {si_unit}"
    return f"{value / factor:.{digits}g} {prefix}{si_unit}"


def shown_error(value: float, error: float, si_unit: str) -> str:
    """A value and its error for people, both in the unit in which the value reads best.

    >>> shown_error(1.009e-5, 8.7e-7, "m"), shown_error(0.00696, 0.00043, "1")
    ('10.09 ± 0.87 um', '0.00696 ± 0.00043')
    """
    number, _, name = shown(value, si_unit).partition(" ")
    factor = value / float(number) if float(number) else 1.0
    return f"{number} ± {error / factor:.2g} {name}".rstrip()


def shown_range(low: float, high: float, si_unit: str) -> str:
    """Two values for people, in the unit in which the second reads best.

    >>> shown_range(8.52e-6, 1.195e-5, "m")
    '8.52 to 11.95 um'
    """
    number, _, name = shown(high, si_unit).partition(" ")
    if not (math.isfinite(low) and math.isfinite(high)) or not float(number):
        return f"{shown(low, si_unit)} to {shown(high, si_unit)}"
    return f"{low * float(number) / high:.4g} to {number} {name}".rstrip()
