"""Text such as ``"9 GPa/m"`` to SI numbers and back; the table of units.

Numbers inside the package are plain SI floats. Text is read only at the edges (files, command line,
constructors), and nothing in it is evaluated. Everyday units stand in the table below; other words go to pint.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from functools import lru_cache
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from steadyslip import units
from steadyslip.core.errors import QuantityError, came


class Dimension(NamedTuple):
    """Exponents of kilogram, metre, second and radian."""

    mass: float = 0
    length: float = 0
    time: float = 0
    angle: float = 0

    def times(self, other: Dimension, power: float = 1) -> Dimension:
        return Dimension(*(a + power * b for a, b in zip(self, other, strict=True)))


_PREFIX = {"G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}
_MICRO = str.maketrans({"µ": "u", "μ": "u", "·": " ", "×": " ", "−": "-"})
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
    "rev": (2 * math.pi, Dimension(0, 0, 0, 1)),
    "turn": (2 * math.pi, Dimension(0, 0, 0, 1)),
    "rpm": (2 * math.pi / units.minute, Dimension(0, 0, -1, 1)),
    "%": (1e-2, Dimension()),
    "1": (1.0, Dimension()),
}
for _base, _dimension in _PREFIXED.items():
    _TABLE[_base] = (1.0, _dimension)
    for _letter, _factor in _PREFIX.items():
        _TABLE.setdefault(_letter + _base, (_factor, _dimension))
_PLAIN_WORDS = {"1", "kg", "rad", *_PREFIXED}
_PREFIXABLE = _PLAIN_WORDS | {prefix + base for base in _PREFIXED for prefix in _PREFIX}

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf(?:inity)?)", re.I | re.A)
_TOKEN = re.compile(r"\s*(?:([/()]|\*(?!\*))|([^\W\d_]+|[%°])(?:\s*(?:\^|\*\*)\s*([-+]?[0-9]+)|([0-9]+))?)\s*")
_NONZERO = re.compile(r"[^eE]*[1-9]")
_ONE = re.compile(r"1\s*(?=/|$)")
_SUPERSCRIPT = re.compile("[⁻⁺]?[⁰¹²³⁴-⁹]+")
_PLAIN = str.maketrans("⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹", "-+0123456789")
_AREA = Dimension(length=2)
MOST_TEXT = 200
"""Characters of a quantity: longer texts are refused unread."""
MOST_POWER = 9
"""Largest power of a word in a unit."""


@lru_cache(maxsize=256)
def unit(text: str) -> tuple[float, Dimension]:
    """SI factor and dimension of a unit such as ``"Pa s/m"``.

    A unit is words with small whole powers, multiplied or divided: ``kg/m^2``, ``N s/m``, ``1/(m s)``. As in
    arithmetic, a stroke divides by the one factor behind it. Words that the table does not have go to pint.

    Raises
    ------
    QuantityError
        If the text is none, or a word is not that of a unit.
    """
    if len(text) > MOST_TEXT:
        raise QuantityError(f"{came(text)} is not a unit: too long")
    factor, dimension = 1.0, Dimension()
    for word, power in _factors(text):
        value, base = _TABLE.get(word) or _from_pint(word)
        factor *= float(np.float64(value) ** power)  # inf where a float would raise
        dimension = dimension.times(base, power)
    if not 0 < factor < math.inf:
        raise QuantityError(f"{text!r} leaves the range of floating point")
    return factor, dimension


def _factors(text: str) -> Iterator[tuple[str, int]]:
    """The words of a unit with their powers, negative where divided by."""
    fault = QuantityError(f"{text!r} is not a unit")
    plain = _SUPERSCRIPT.sub(lambda run: "^" + run[0].translate(_PLAIN), text.translate(_MICRO)).strip()
    start = _ONE.match(plain)
    position = start.end() if start else 0
    wanted, sign, group = start is None, 1, 1
    outer: list[int] = []  # signs in front of open brackets
    while position < len(plain):
        match = _TOKEN.match(plain, position)
        if match is None:
            raise fault
        position = match.end()
        mark, word, power = match[1], match[2], match[3] or match[4] or "1"
        if word:
            if len(power) > 3 or abs(int(power)) > MOST_POWER:
                raise QuantityError(f"{text!r} is not a unit: powers are whole numbers up to {MOST_POWER}")
            yield word, int(power) * sign * group
        elif mark == ")":
            if wanted or not outer:
                raise fault
            group = outer.pop()
        elif mark == "(":
            outer.append(group)
            group *= sign
        elif wanted:
            raise fault
        wanted = mark in ("(", "/", "*")
        sign = -1 if mark == "/" else 1
    if wanted or outer:
        raise fault


@lru_cache(maxsize=256)
def _from_pint(word: str) -> tuple[float, Dimension]:
    """SI factor and dimension of one word that the table does not have."""
    registry = _pint_registry()
    fault = QuantityError(f"{word!r} is not a unit")
    try:
        bases = [registry.Quantity(size, word).to_base_units() for size in (1.0, 2.0)]
        exponents = dict(bases[0].dimensionality)
        one, two = (float(base.magnitude) for base in bases)
    except Exception as error:  # pint raises its own kinds, and others, for words that are none
        raise fault from error
    if not (math.isfinite(one) and one > 0 and math.isclose(two, 2 * one)):  # decibels, degrees Celsius
        raise fault
    known = {"[mass]": "mass", "[length]": "length", "[time]": "time"}
    if not set(exponents) <= set(known):
        raise QuantityError(f"{word!r} has a dimension that no parameter has")
    return one, Dimension(**{known[key]: float(power) for key, power in exponents.items()})


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
    match = _NUMBER.match(cleaned) if len(text) <= MOST_TEXT else None
    if match is None:
        raise QuantityError(f"{came(text)} is not {described(expected)}; write for example {example(expected)}")
    digits, name = match.group(), cleaned[match.end() :].strip()
    _, wanted = unit(expected)
    if not name:
        if wanted != Dimension():
            raise QuantityError(f"{text!r} has no unit; write for example {example(expected)}")
        return _scaled(digits, 1.0)
    try:
        if name == "1":
            raise QuantityError("it holds two numbers")
        factor, found = unit(name)
    except QuantityError as error:
        raise QuantityError(f"{text!r} is not a quantity: {error}; write for example {example(expected)}") from error
    if found != wanted:
        message = f"{text!r} has the wrong dimension; expected {described(expected)}, for example {example(expected)}"
        per_area = total_unit(expected) in _TOTALS
        if per_area and found == wanted.times(_AREA):
            message += (
                "; it is the total of a contact, and this is per unit area: add the contact's area to the rig file, "
                "[slider] area = '0.01 m^2', or divide by it"
            )
        elif per_area:
            message += (
                f", or with the contact's area in the rig file, [slider] area = '0.01 m^2', {total_unit(expected)}"
            )
        raise QuantityError(message)
    return _scaled(digits, factor)


def _scaled(digits: str, factor: float) -> float:
    """Number times factor, rounded once: ``10 um`` is 1e-05, not the next float below."""
    plain = float(digits)
    if plain == 0 and _NONZERO.match(digits):
        raise QuantityError(f"{digits!r} is too small for floating point")
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
        raise QuantityError(f"got {came(values)}; allowed: a list of numbers in {expected}, or of texts with units")
    found = []
    for place, value in enumerate(values, start=1):
        try:
            number = read(value, expected) if isinstance(value, str) else _plain(value)
        except QuantityError as error:
            raise QuantityError(f"value {place}: {error}") from error
        if not math.isfinite(number):
            raise QuantityError(f"value {place}: got {came(value)}; allowed: a finite number")
        found.append(number)
    return tuple(found)


def _plain(value: Any) -> float:
    """A number as a float; truth values, complex numbers and whatever else are none."""
    if type(value) is float:  # long columns are of these
        return value
    if isinstance(value, (bool, np.bool_)) or not hasattr(value, "__float__") or np.ndim(value) != 0:
        raise QuantityError(f"got {came(value)}; allowed: a finite number or text with a unit")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise QuantityError(f"got {came(value)}; allowed: a finite number or text with a unit") from error


_EXAMPLES = {
    "Pa": "5 MPa",
    "Pa/m": "9 GPa/m",
    "m": "1 um",
    "m/s": "1 um/s",
    "s": "10 s",
    "rad": "-45 deg",
    "m/rad": "10 mm/rev",
    "rad/s": "5 rpm",
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
        return "0.5"
    return repr(_EXAMPLES.get(expected, f"1 {expected}"))


def described(expected: str) -> str:
    """The unit in words for messages."""
    return "a number without unit" if expected == "1" else f"a quantity in {expected}"


_TOTALS = ("N", "N/m", "N s/m", "N/m/s", "kg", "N s")
"""Units of the totals that people have names for."""


def is_per_area(unit_name: str) -> bool:
    """Whether a quantity is per unit area inside and a total (N, N/m, kg, ...) of a rig with an area."""
    return unit(unit_name)[1].mass == 1


def total_unit(unit_name: str) -> str:
    """Name of the unit of the total that belongs to a per-area unit."""
    _, dimension = unit(unit_name)
    wanted = dimension.times(_AREA)
    for candidate in _TOTALS:
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


_own: ContextVar[Mapping[Dimension, str]] = ContextVar("own units", default=MappingProxyType({}))


@contextmanager
def told_in(names: Iterable[str]) -> Iterator[None]:
    """Tell people quantities in units of their own, such as rpm, bar or N/um, where these are one for a dimension.

    Units with a prefix in front alone, such as kN or um/s, are no reason: they are told as reads best in any case.

    >>> with told_in(["rpm", "kN", "MPa", "bar", "N/um"]):
    ...     shown(10.0, "rad/s"), shown(2e4, "N"), shown(2e5, "Pa"), shown(12e6, "N/m")
    ('95.49 rpm', '20 kN', '200 kPa', '12 N/um')
    """
    found: dict[Dimension, set[str]] = {}
    for name in names:
        found.setdefault(unit(name)[1], set()).add(name)
    alone = {dimension: own for dimension, several in found.items() for own in several if len(several) == 1}
    own = {
        dimension: name for dimension, name in alone.items()
        if any(word not in _PREFIXABLE or (word not in _PLAIN_WORDS and power < 0) for word, power in _factors(name))
    }  # fmt: skip
    before = _own.set(own)
    try:
        yield
    finally:
        _own.reset(before)


_SHOWN_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))


def stress_name(name: str, area: float | None) -> str:
    """Name of a stress for people: the force that it is in a rig with an area."""
    return name if area is None else name.replace("stress", "force")


def _few(value: float, digits: int) -> str:
    """A number with a few digits, without a power of ten up to five places."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(float(text)) < 1e5 else text


def shown(value: float, si_unit: str, digits: int = 4, area: float | None = None) -> str:
    """A value for people: prefixed unit, a few digits, angles in degrees, leads in turns, totals if there is an `area`.

    >>> shown(8.72093e9, "Pa/m"), shown(-0.7853981633974483, "rad"), shown(0.0145, "1")
    ('8.721 GPa/m', '-45 deg', '0.0145')
    >>> shown(0.01 / 6.283185307179586, "m/rad")
    '10 mm/rev'
    >>> shown(8.72093e9, "Pa/m", area=0.01)
    '87.21 MN/m'
    """
    factor, si_unit = outside(si_unit, area)
    value = value * factor
    if si_unit == "1":
        return _few(value, digits)
    own = _own.get().get(unit(si_unit)[1])
    scaled = re.match(r"(?:Pa|N|m|s)(?!\^)", si_unit)  # of a power, a prefix would be one of the base
    if own is not None and (value == 0 or scaled is None or 1e-3 <= abs(value / unit(own)[0]) < 1e5):
        return f"{_few(value / unit(own)[0], digits)} {own}"
    if si_unit == "rad":
        return f"{_few(value / units.deg, digits)} deg"
    if si_unit == "m/rad":
        value, si_unit = value * 2 * math.pi, "m/rev"
    if si_unit == "s" and math.isfinite(value) and abs(value) >= 600:
        for size, name in ((units.year, "yr"), (units.day, "days"), (units.hour, "h"), (60.0, "min")):
            if abs(value) >= 2 * size:
                return f"{_few(value / size, digits)} {name}"
    first = re.match(r"(?:Pa|N|m|s)(?!\^)", si_unit)
    if first is None or value == 0 or not math.isfinite(value):
        return f"{_few(value, digits)} {si_unit}"
    size = abs(value)
    for factor, prefix in _SHOWN_PREFIXES:
        if size >= 0.9999 * factor and (prefix not in ("G", "M", "k") or first[0] in ("Pa", "N")):
            break
    if not 1e-3 <= size / factor < 1e5:
        return f"{_few(value, digits)} {si_unit}"
    return f"{_few(value / factor, digits)} {prefix}{si_unit}"


def shown_error(value: float, error: float, si_unit: str, area: float | None = None) -> str:
    """A value and its error for people, both in the unit in which the value reads best.

    >>> shown_error(1.009e-5, 8.7e-7, "m"), shown_error(0.00696, 0.00043, "1")
    ('10.09 ± 0.87 um', '0.00696 ± 0.00043')
    """
    scale, si_unit = outside(si_unit, area)
    value, error = value * scale, error * scale
    number, _, name = shown(value, si_unit).partition(" ")
    factor = value / float(number) if float(number) else 1.0
    return f"{number} ± {error / factor:.2g} {name}".rstrip()


def shown_range(low: float, high: float, si_unit: str, area: float | None = None) -> str:
    """Two values for people, in the unit in which the second reads best.

    >>> shown_range(8.52e-6, 1.195e-5, "m")
    '8.52 to 11.95 um'
    """
    factor, si_unit = outside(si_unit, area)
    low, high = low * factor, high * factor
    number, _, name = shown(high, si_unit).partition(" ")
    if not (math.isfinite(low) and math.isfinite(high)) or not float(number):
        return f"{shown(low, si_unit)} to {shown(high, si_unit)}"
    return f"{low * float(number) / high:.4g} to {number} {name}".rstrip()


def percent(share: float) -> str:
    """A share in percent with three digits, or as many as it takes to tell it from 0 and 100.

    >>> percent(0.123456), percent(0.99981), percent(1.0)
    ('12.3 %', '99.981 %', '100 %')
    """
    text = f"{100 * share:.3g}"
    return f"{100 * share:.8g} %" if 0 < share < 1 and float(text) in (0, 100) else f"{text} %"


def printed(text: str) -> str:
    """Words with units as they are set in print: µm, m², kg/m³.

    >>> printed("9.2 us, 3 um/s, 2 uN m at 5 m^2: ours")
    '9.2 µs, 3 µm/s, 2 µN m at 5 m²: ours'
    """
    text = text.replace("^2", "²").replace("^3", "³")
    return re.sub(r"(?<![A-Za-z])u(?=(?:m|s|N|Pa)(?![A-Za-z]))", "µ", text)
