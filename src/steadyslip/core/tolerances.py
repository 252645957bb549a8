"""Parsing of values with tolerances: ``"12 ± 20 % N/um"``, ``"12 +5 % -1 % N/um"``, ``"10..14 N/um"``.

A half-width in percent is a share of the value; other half-widths are quantities like the value. The value is
uniformly distributed between the ends unless ``(normal)`` is written: then the half-width is one standard deviation.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from fractions import Fraction

from steadyslip.core.errors import QuantityError, repr_short
from steadyslip.core.quantities import decimal_comma

NORMAL = "(normal)"
EXAMPLES = "'12 ± 20 % N/um', '12 +5 % -1 % N/um', '12 ± 2 N/um (normal)' or '10..14 N/um'"
_NUMBER = r"(?:\d+(?:\.(?!\.)\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_SIGNED = rf"[-+]?{_NUMBER}"
_UNIT = r"[^\d\s±+.%()-][^±+%]*?"
_SAME = re.compile(
    rf"(?P<value>{_SIGNED})\s*(?P<first>{_UNIT})?\s*±\s*(?P<width>{_NUMBER})\s*(?P<share>%)?(?P<last>.*)"
)
_APART = re.compile(
    rf"(?P<value>{_SIGNED})\s*(?P<first>{_UNIT})?\s*\+\s*(?P<above>{_NUMBER})\s*(?P<above_share>%)?\s*"
    rf"-\s*(?P<below>{_NUMBER})\s*(?P<below_share>%)?(?P<last>.*)"
)
_RANGE = re.compile(rf"(?P<low>{_SIGNED})\s*\.\.\s*(?P<high>{_SIGNED})(?P<last>.*)")
_MARK = re.compile(r"±|\d\s*\.\.|\(\w+\)|\d\s*(?:to|-|–)\s*\d|[-+]\s*[\d.]+\s*%")


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of a value, as text.

    Attributes
    ----------
    below, above : str
        Largest deviation to either side: a share such as ``"20 %"``, or a quantity such as ``"2 N/um"``.
    normal : bool
        True if the deviations are standard deviations of a normal distribution.
    """

    below: str
    above: str
    normal: bool = False


def split_tolerance(text: str) -> tuple[str, Tolerance] | None:
    """Value (as text) and tolerance in a text such as "12 ± 2 N/um"; None for a text without a tolerance.

    >>> split_tolerance("12 ± 20 % N/um")
    ('12 N/um', Tolerance(below='20 %', above='20 %', normal=False))
    >>> split_tolerance("10..14 N/um")
    ('12.0 N/um', Tolerance(below='2.0 N/um', above='2.0 N/um', normal=False))
    >>> split_tolerance("9 GPa/m")

    Raises
    ------
    QuantityError
        If the text has a sign of a tolerance, such as ±, but cannot be read.
    """
    plain = re.sub(r"\+/?-", "±", text).strip()
    normal = NORMAL in plain
    plain = " ".join(plain.replace(NORMAL, " ", 1).split())
    if re.search(r"\d,\d", plain) and (_MARK.search(plain) or normal):
        raise decimal_comma(text)
    if found := _RANGE.fullmatch(plain):
        return _range(found, text, normal)
    if (found := _SAME.fullmatch(plain) or _APART.fullmatch(plain)) and "%" in found["last"]:
        raise QuantityError(
            f"{repr_short(text)}: the per cent sign must follow its number; write for example {EXAMPLES}"
        )
    same = _SAME.fullmatch(plain)
    if (found := same) and "(" not in found["last"]:
        width, unit = _width(found["width"], found["share"], found)
        return f"{found['value']} {unit}".strip(), Tolerance(width, width, normal)
    if found := _APART.fullmatch(plain):
        above, unit = _width(found["above"], found["above_share"], found)
        below, _ = _width(found["below"], found["below_share"], found)
        return f"{found['value']} {unit}".strip(), Tolerance(below, above, normal)
    if re.match(_SIGNED, plain) and (_MARK.search(plain) or normal):
        raise QuantityError(f"{repr_short(text)} is no value with a tolerance; write for example {EXAMPLES}")
    return None


def read_tolerance(text: str) -> Tolerance:
    """Tolerance in a text without the value: ``"20 %"``, ``"± 2 N/um"``, ``"+5 % -1 %"``.

    Raises
    ------
    QuantityError
        If the text is not a tolerance.
    """
    plain = re.sub(r"\+/?-", "±", text).strip()
    signed = f"0 {plain}" if re.match(r"[±+]", plain) else f"0 ± {plain}"
    try:
        found = split_tolerance(signed)
    except QuantityError:
        found = None
    if found is None:
        examples = "'20 %', '± 2 N/um' or '+5 % -1 %'"
        raise QuantityError(f"{repr_short(text)} is no tolerance; write for example {examples}")
    return found[1]


def _width(number: str, share: str | None, found: re.Match[str]) -> tuple[str, str]:
    """Half-width with its unit or %, and the unit of the value.

    If only one of the two has a unit, it is the unit of both.
    """
    first, last = (found["first"] or "").strip(), found["last"].strip()
    return f"{number} {'%' if share else last or first}".strip(), first or last


def _range(found: re.Match[str], text: str, normal: bool) -> tuple[str, Tolerance]:
    low, high, unit = Fraction(found["low"]), Fraction(found["high"]), found["last"].strip()
    if max(abs(low), abs(high)) > sys.float_info.max:
        raise QuantityError(f"{repr_short(text)} is no range: its ends must be finite; write for example '10..14 N/um'")
    if normal or not low < high:
        why = "a range has no standard deviation" if normal else "its first end must be the lower one"
        raise QuantityError(f"{repr_short(text)} is no range: {why}; write for example '10..14 N/um'")
    value, half = (f"{float(part)!r} {unit}".strip() for part in ((low + high) / 2, (high - low) / 2))
    return value, Tolerance(half, half)
