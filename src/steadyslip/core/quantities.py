"""Parsing of text such as ``"9 GPa/m"`` to SI numbers.

Numbers inside the package are plain SI floats. Only files, the command line and constructors take text, and none
of it is evaluated as code.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from steadyslip.core.areas import AREA, TOTALS, total_unit
from steadyslip.core.dimensions import MICRO, MOST_TEXT, Dimension, unit
from steadyslip.core.errors import QuantityError, repr_short

_MASS, _WEIGHT = Dimension(1), Dimension(1, 1, -2)
_BY_RADIUS = {
    Dimension(length=-1, angle=1): "multiply by the radius",  # rad/s for m/s
    Dimension(length=1, angle=-1): "divide by the radius",  # 1/rad for 1/m, s/rad for s/m
    Dimension(length=2, angle=-1): "divide by its square",  # N m/rad for N/m
}
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf(?:inity)?)(?![a-z])", re.I | re.A)
PER_LOAD = ("1", "1/m", "s/m")
"""SI units of friction per load (coefficient, bristle stiffness, viscous friction); data sheets give them as forces."""
_OF_FORCES = {"1": "N", "1/m": "N/um", "s/m": "N s/mm"}
"""Customary unit of the force, stiffness or damping by the unit of the parameter per load."""
_COMMA = re.compile(r",(\d+)", re.A)
_QUOTIENT = re.compile(r"/\s*(\d+\.?\d*)", re.A)
_RATIO = re.compile(r":\s*(\d+\.?\d*)", re.A)
_EXAMPLE = re.compile(r"(?<=['\"])[\d.eE+-]+(?= )")
"""Matches the number in a quoted example such as ``'5 MPa'``."""
_BETWEEN_DIGITS = re.compile(r"(?<=\d),(?=\d)", re.A)
_NONZERO = re.compile(r"[^eE]*[1-9]")


def decimal_comma(text: str) -> QuantityError:
    """QuantityError for a text with decimal commas; its message has the text with points instead."""
    return QuantityError(f"{text!r} has a decimal comma: write {_BETWEEN_DIGITS.sub('.', text)}")


def parse(text: str, expected: str, instance: str = "") -> float:
    """Parse text with a number and a unit to an SI value.

    Parameters
    ----------
    text : str
        A number and a unit, such as ``"5 MPa"``; a number alone if `expected` is ``"1"``.
    expected : str
        SI unit of the parameter; only its dimension matters.
    instance : str, optional
        Typical value with its unit, for messages; by default an example for the SI unit.

    Returns
    -------
    float
        The value in SI units.

    Raises
    ------
    QuantityError
        If the text is not a quantity, has no unit where one is needed, or another dimension.
    """
    shown = repr(instance) if instance else example(expected)
    cleaned = text.translate(MICRO).strip()
    match = _NUMBER.match(cleaned) if len(text) <= MOST_TEXT else None
    if match is None:
        raise QuantityError(f"{repr_short(text)} is not {described(expected)}; write for example {shown}")
    digits, name = match.group(), cleaned[match.end() :].strip()
    if _COMMA.match(name):
        raise decimal_comma(text)
    _, wanted = unit(expected)
    divisor = _QUOTIENT.fullmatch(name)
    if divisor and wanted == Dimension() and float(divisor[1]) > 0:  # a gear ratio, 1/360
        return _scaled(digits, 1 / float(divisor[1]))
    if ratio := _RATIO.fullmatch(name) if wanted == Dimension() else None:
        message = f'{text!r} is a ratio of unknown direction; write "{digits}/{ratio[1]}" or "{ratio[1]}/{digits}"'
        raise QuantityError(message)
    if not name:
        if wanted != Dimension():
            own = f"0{digits}" if digits.startswith(".") else digits
            raise QuantityError(f"{text!r} has no unit; write for example {_EXAMPLE.sub(own, shown, 1)}")
        return _scaled(digits, 1.0)
    try:
        if name == "1":
            raise QuantityError("it holds two numbers")
        factor, found = unit(name)
    except QuantityError as error:
        raise QuantityError(f"{text!r} is not a quantity: {error}; write for example {shown}") from error
    if found != wanted:
        message = f"{text!r} has the wrong dimension; expected {described(expected)}, for example {shown}"
        per_area = total_unit(expected) in TOTALS
        if per_area and found == wanted.times(AREA):
            message += (
                "; it is the total of a contact, and this is per unit area: add the contact's area to the rig file, "
                "[slider] area = '0.01 m^2', or divide by it; if it is unknown, any will do: answers in N, N/m and kg "
                "are the same"
            )
        elif per_area:
            message += (
                f", or with the contact's area in the rig file, [slider] area = '0.01 m^2', {total_unit(expected)}"
            )
        elif wanted == found.times(AREA) and expected in TOTALS:
            message += (
                "; it is per unit area: laws of a contact take that where it has an area, [contacts.NAME] "
                "area = '0.01 m^2', all else is of the whole"
            )
        elif found == (loaded := wanted.times(_WEIGHT)) and expected in PER_LOAD:
            message += f"; name the load that it is of: '{text} at 3.2 kN'"
        elif expected in PER_LOAD and (turned := _of_what_turns(found, loaded)):
            message += f"{turned} and name the load that presses there, as in '20 {_OF_FORCES[expected]} at 125 N'"
        elif turned := _of_what_turns(found, wanted):
            message += turned
        elif (found, wanted) == (_MASS, _WEIGHT):
            message += "; a mass presses with its weight, mass times 9.81 m/s^2"
        elif (found, wanted) == (_WEIGHT, _MASS):
            message += f"; it is the weight of {float(digits) * factor / 9.81:.4g} kg"
        raise QuantityError(message)
    return _scaled(digits, factor)


def _of_what_turns(found: Dimension, wanted: Dimension) -> str:
    """Hint for a torque, angle or angular speed in place of a force, length or speed; empty for other dimensions."""
    torque = (found, wanted) == (_WEIGHT.times(AREA, 0.5), _WEIGHT)
    step = "divide by the radius" if torque else _BY_RADIUS.get(found.times(wanted, -1), "")
    return f"; that is of something that turns: at a radius, {step}" if step else ""


def _scaled(digits: str, factor: float) -> float:
    """Product of a decimal number and a unit factor, rounded once: ``10 um`` is 1e-05, not the next float below."""
    plain = float(digits)
    if plain == 0 and _NONZERO.match(digits):
        raise QuantityError(f"{digits!r} is too small for floating point")
    if not math.isfinite(plain) or abs(plain) < 1e-290:  # close to underflow: exact rounding is not needed
        return plain * factor
    try:
        return float(Fraction(digits) * Fraction(repr(factor)))
    except OverflowError:
        return math.copysign(math.inf, plain)


def in_si(value: Any, expected: str) -> Any:
    """Convert text with a unit, or a list that contains text, to SI numbers; other values are returned unchanged.

    Raises
    ------
    QuantityError
        If a text is not a quantity with the dimension of the SI unit `expected`.
    """
    if isinstance(value, str):
        return parse(value, expected)
    items = column_with_text(value)
    return value if items is None else np.array(numbers(items, expected))


def column_with_text(value: Any) -> Sequence[Any] | None:
    """Items of a list, tuple or array that contains text; None for anything else."""
    items = value.tolist() if isinstance(value, np.ndarray) and value.dtype.kind in "UO" else value
    has_text = isinstance(items, (list, tuple)) and any(isinstance(item, str) for item in items)
    return items if has_text else None


def numbers(values: Any, expected: str, read: Callable[[str, str], float] = parse) -> tuple[float, ...]:
    """Convert a column of quantities to SI values.

    Parameters
    ----------
    values : list, tuple or 1-D array
        SI numbers, or texts with units.
    expected : str
        SI unit of the column.
    read : callable, optional
        Function of a text and `expected` that returns its value.

    Returns
    -------
    tuple of float
        The values in SI units, all finite.

    Raises
    ------
    QuantityError
        If `values` is not a list of finite quantities; the message has position (from 1) and value of the first fault.
    """
    if isinstance(values, np.ndarray) and values.ndim == 1:
        values = values.tolist()
    if not isinstance(values, (list, tuple)):
        raise QuantityError(
            f"got {repr_short(values)}; allowed: a list of numbers in {expected}, or of texts with units"
        )
    found = []
    for place, value in enumerate(values, start=1):
        try:
            number = read(value, expected) if isinstance(value, str) else _plain(value)
        except QuantityError as error:
            raise QuantityError(f"value {place}: {error}") from error
        if not math.isfinite(number):
            raise QuantityError(f"value {place}: got {repr_short(value)}; allowed: a finite number")
        found.append(number)
    return tuple(found)


def _plain(value: Any) -> float:
    """Convert a real number to float; bools, complex numbers and arrays are refused."""
    if type(value) is float:  # fast path for long columns
        return value
    if isinstance(value, (bool, np.bool_)) or not hasattr(value, "__float__") or np.ndim(value) != 0:
        raise QuantityError(f"got {repr_short(value)}; allowed: a finite number or text with a unit")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise QuantityError(f"got {repr_short(value)}; allowed: a finite number or text with a unit") from error


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
    "N/m": "12 N/um",
    "N s/m": "5 N s/mm",
    "N m/rad": "12 kN m/rad",
    "1/m": "400 N/um at 3.2 kN",
    "s/m": "50 N s/mm at 3.2 kN",
    "kg": "2 kg",
    "m^2": "0.01 m^2",
}


def units_in(values: Any) -> set[str]:
    """Units in the texts of a value, also inside lists and dicts; ``m^2`` too for an ``area`` that is a number."""
    found, areas, left = set(), set(), [values]
    while left:
        one = left.pop()
        if isinstance(one, (dict, list, tuple, set)):
            left += one.values() if isinstance(one, dict) else one
            if isinstance(one, dict) and isinstance(one.get("area"), (int, float)):
                areas.add("m^2")  # areas.display_area looks for a unit of area to see that the file itself has one
        elif isinstance(one, str) and len(one) <= MOST_TEXT and (match := _NUMBER.match(one.strip())):
            found.add(one.strip()[match.end() :].strip())
    found = {name for name in found if name and _is_unit(name)}
    return found | areas if found else found


def result_units(tables: Mapping[str, Any]) -> set[str]:
    """Units in which a rig's results are printed: all units of its file, but for speeds only the unit of the drive.

    >>> drive, friction = {"velocity": "0.8 mm/s"}, {"v_stribeck": "60 mm/min", "d_c": "2 um"}
    >>> sorted(result_units({"drive": drive, "friction": friction}))
    ['mm/s', 'um']
    """
    found, drive = units_in(tables), tables.get("drive")
    speeds = units_in([drive.get("velocity")]) if isinstance(drive, Mapping) else set()
    kinds = {unit(name)[1] for name in speeds}
    return {name for name in found if name in speeds or unit(name)[1] not in kinds}


def units_named(values: Mapping[str, Any]) -> dict[str, str]:
    """Unit of each value that is text with a unit, by its key; other values are left out.

    >>> units_named({"bristles": "800 N/um at 6 kN", "viscous": 0.5})
    {'bristles': 'N/um at 6 kN'}
    """
    found = {key: units_in([one]) for key, one in values.items() if isinstance(one, str)}
    return {key: name for key, own in found.items() for name in own}


def _is_unit(name: str) -> bool:
    try:
        return bool(unit(name))
    except QuantityError:
        return False


def example(expected: str) -> str:
    """Quoted example of a quantity with this SI unit, for messages."""
    if expected == "1":
        return "0.5"
    return repr(_EXAMPLES.get(expected, f"1 {expected}"))


def described(expected: str) -> str:
    """Description of a quantity with this SI unit, for messages, such as "a quantity in Pa"."""
    return "a number without unit" if expected == "1" else f"a quantity in {expected}"
