"""Units and their dimensions, such as ``kg/m^2``: words with small integer powers, multiplied or divided.

Common units are in the table below; all others are looked up in pint.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from steadyslip.core.errors import QuantityError, repr_short
from steadyslip.units import day, deg, hour, minute, year


class Dimension(NamedTuple):
    """Exponents of kilogram, metre, second and radian."""

    mass: float = 0
    length: float = 0
    time: float = 0
    angle: float = 0

    def times(self, other: Dimension, power: float = 1) -> Dimension:
        """Dimension of a product with `other` to a power."""
        return Dimension(*(a + power * b for a, b in zip(self, other, strict=True)))


_PREFIX = {"T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}
MICRO = str.maketrans({"µ": "u", "μ": "u", "·": " ", "×": " ", "−": "-"})
"""Translation of Unicode signs in units (µ, ·, ×, −) to ASCII."""
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
    "min": (minute, Dimension(0, 0, 1)),
    "h": (hour, Dimension(0, 0, 1)),
    "hour": (hour, Dimension(0, 0, 1)),
    "day": (day, Dimension(0, 0, 1)),
    "yr": (year, Dimension(0, 0, 1)),
    "year": (year, Dimension(0, 0, 1)),
    "bar": (1e5, Dimension(1, -1, -2)),
    "rad": (1.0, Dimension(0, 0, 0, 1)),
    "deg": (deg, Dimension(0, 0, 0, 1)),
    "degree": (deg, Dimension(0, 0, 0, 1)),
    "degrees": (deg, Dimension(0, 0, 0, 1)),
    "°": (deg, Dimension(0, 0, 0, 1)),
    "arcmin": (deg / 60, Dimension(0, 0, 0, 1)),
    "arcsec": (deg / 3600, Dimension(0, 0, 0, 1)),
    "rev": (2 * math.pi, Dimension(0, 0, 0, 1)),
    "turn": (2 * math.pi, Dimension(0, 0, 0, 1)),
    "rpm": (2 * math.pi / minute, Dimension(0, 0, -1, 1)),
    "%": (1e-2, Dimension()),
    "1": (1.0, Dimension()),
}
for _base, _dimension in _PREFIXED.items():
    _TABLE[_base] = (1.0, _dimension)
    for _letter, _factor in _PREFIX.items():
        _TABLE.setdefault(_letter + _base, (_factor, _dimension))
PLAIN_WORDS = {"1", "kg", "rad", *_PREFIXED}
"""SI unit words without a prefix."""
PREFIXABLE = PLAIN_WORDS | {prefix + base for base in _PREFIXED for prefix in _PREFIX}
"""SI unit words without a prefix and with each prefix."""

_TOKEN = re.compile(r"\s*(?:([/()]|\*(?!\*))|([^\W\d_]+|[%°])(?:\s*(?:\^|\*\*)\s*([-+]?[0-9]+)|([0-9]+))?)\s*")
_RUN_TOGETHER = re.compile(r"([TGMkmun]?N|[TGMk]?Pa|kg(?=m|cm)|g(?=[cm]m))(m|mm|cm)?(s)?")
"""Matches products of units without a space, as in data sheets: Nm, kNmm, Nms, Ns, Pas, kgm (of kgm^2), gcm."""
_AT = re.compile(r"(.+?)\s+at\s+((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)", re.A)
_ONE = re.compile(r"1\s*(?=/|$)")
_SUPERSCRIPT = re.compile("[⁻⁺]?[⁰¹²³⁴-⁹]+")
_PLAIN = str.maketrans("⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹", "-+0123456789")
MOST_TEXT = 200
"""Largest number of characters in the text of a quantity; longer texts are refused without parsing. By trial."""
MOST_POWER = 9
"""Largest power of a word in a unit, such as 2 in m^2; prefixes of up to 1e12 then stay inside floating point."""


@lru_cache(maxsize=256)
def unit(text: str) -> tuple[float, Dimension]:
    """SI factor and dimension of a unit such as ``"Pa s/m"``.

    A unit is words with small integer powers, multiplied or divided: ``kg/m^2``, ``N s/m``, ``1/(m s)``. As in
    arithmetic, a slash divides by the one factor after it. Words missing from the table are looked up in pint.

    Products without a space, as in data sheets, are split: ``Nm``, ``Nms/rad``, ``kgcm^2``.

    A quantity after ``at`` divides the unit: ``"N/um at 3.2 kN"`` is a multiple of 1/m, the stiffness of bristles
    per load.

    >>> factor, dimension = unit("N/um at 4 kN")
    >>> factor, dimension == unit("1/m")[1]
    (250.0, True)

    Raises
    ------
    QuantityError
        If the text is not a unit, or a word in it is not the name of one.
    """
    if len(text) > MOST_TEXT:
        raise QuantityError(f"{repr_short(text)} is not a unit: too long")
    if whole := _AT.fullmatch(text.translate(MICRO)):
        factor, dimension = unit(whole[1])
        size, per = unit(whole[3])
        if not 0 < float(whole[2]) * size < math.inf:
            raise QuantityError(f"{text!r} is not a unit: the load after 'at' must be finite and > 0")
        return factor / (float(whole[2]) * size), dimension.times(per, -1)
    factor, dimension = 1.0, Dimension()
    for word, power in factors(text):
        value, base = _TABLE.get(word) or _from_pint(word)
        factor *= float(np.float64(value) ** power)  # inf where a float would raise
        dimension = dimension.times(base, power)
    if not 0 < factor < math.inf:
        raise QuantityError(f"{text!r} is not a unit: its SI factor overflows or underflows")
    return factor, dimension


def factors(text: str) -> Iterator[tuple[str, int]]:
    """Yield the words of a unit with their powers, negative in the denominator."""
    fault = QuantityError(f"{text!r} is not a unit")
    plain = _SUPERSCRIPT.sub(lambda run: "^" + run[0].translate(_PLAIN), text.translate(MICRO)).strip()
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
            *others, last = _parted(word)
            yield from ((other, sign * group) for other in others)
            yield last, int(power) * sign * group
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


def _parted(word: str) -> tuple[str, ...]:
    """Unit words in a product without a space, such as N and m in Nm; the word itself if it is a single unit."""
    whole = None if word in _TABLE else _RUN_TOGETHER.fullmatch(word)
    return tuple(filter(None, whole.groups())) if whole else (word,)


@lru_cache(maxsize=256)
def _from_pint(word: str) -> tuple[float, Dimension]:
    """SI factor and dimension of one word, looked up in pint."""
    registry = _pint_registry()
    alike = sorted(one for one in _TABLE if one.casefold() == word.casefold())
    fault = QuantityError(f"{word!r} is not a unit" + (f" (did you mean {' or '.join(alike)}?)" if alike else ""))
    try:
        bases = [registry.Quantity(size, word).to_base_units() for size in (1.0, 2.0)]
        exponents = dict(bases[0].dimensionality)
        angle = float(dict(bases[0].to_root_units().unit_items()).get("radian", 0))  # arcsec, mrad, gon
        one, two = (float(base.magnitude) for base in bases)
    except Exception as error:  # pint raises exceptions of many types for words that are not units
        raise fault from error
    # units that are not a factor times the SI unit: decibels, Celsius
    if not (math.isfinite(one) and one > 0 and math.isclose(two, 2 * one)):
        raise fault
    known = {"[mass]": "mass", "[length]": "length", "[time]": "time"}
    if not set(exponents) <= set(known):
        raise QuantityError(f"{word!r} has a dimension other than mass, length, time and angle, which all units are of")
    return one, Dimension(angle=angle, **{known[key]: float(power) for key, power in exponents.items()})


@lru_cache(maxsize=1)
def _pint_registry():  # type: ignore[no-untyped-def]  # pint is imported lazily
    import pint

    return pint.UnitRegistry()
