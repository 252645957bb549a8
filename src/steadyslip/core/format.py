"""Formatting of quantities as text: suitable SI prefixes or the units of the user's file, few digits."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache

from steadyslip.core.areas import display_area, outside
from steadyslip.core.dimensions import PLAIN_WORDS, PREFIXABLE, Dimension, factors, unit
from steadyslip.core.written import display_as, display_names
from steadyslip.units import day, hour, year

_PER_LOAD = {unit(name)[1]: force for name, force in (("1/m", "N/um"), ("s/m", "N s/mm"))}
"""Customary units of bristle stiffness and viscous friction as forces, by the dimension of the parameter per load."""


_SPEED, _ANGLE, _TURNING = (unit(name)[1] for name in ("m/s", "rad", "rad/s"))
_PLAIN_FORCE = re.compile(r"(?:N|Pa)(?![A-Za-z])")
"""Matches units that begin with N or Pa without a prefix, such as N/m."""
_EXPONENT = re.compile(r"(?<![\w./=-])(−?-?\d(?:\.\d+)?)e([+-]\d+)(?![\w/-]|\.\w)")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FINE = ("arcsec", "arcmin")
"""Parts of a degree: a file that uses one for angles gets angular speeds in it too, and the reverse."""


@lru_cache(maxsize=256)
def own_units(names: frozenset[str]) -> Mapping[Dimension, tuple[str, ...]]:
    """Display units among `names` by dimension, where a unit differs from the default by more than a leading prefix.

    Units of speeds and angular quantities are included with any prefix; units of forces and stresses if all of them are
    plain N or Pa. If angular speeds have arcsec or arcmin, angles get this unit too, and the reverse.
    """
    found = {kind: set(several) for kind, several in _by_dimension(names).items()}
    loads = {name.partition(" at ")[2] for name in names if " at " in name}
    for kind, si in _PER_LOAD.items():  # if one parameter is printed at a load, all parameters per load are
        if loads and not any(" at " in name for name in found.get(kind, ())):
            of_forces = found.get(unit(si)[1]) or {si}
            found[kind] = {f"{one} at {load}" for load in loads for one in of_forces}
    for kind, other, add in ((_ANGLE, _TURNING, ""), (_TURNING, _ANGLE, "/s")):
        fine = {name.removesuffix("/s") for name in found.get(other, ())}.intersection(_FINE)
        if fine and kind not in found:
            found[kind] = {f"{name}{add}" for name in fine}
    for several in found.values():
        if named := {name for name in several if " at " in name}:
            several &= named
    return {
        kind: tuple(sorted(several))
        for kind, several in found.items()
        if kind == _SPEED or kind.angle or any(map(_is_own, several)) or all(map(_PLAIN_FORCE.match, several))
    }


def _by_dimension(names: frozenset[str]) -> dict[Dimension, set[str]]:
    found: dict[Dimension, set[str]] = {}
    for name in names:
        found.setdefault(unit(name)[1], set()).add(name)
    return found


def units_for(si_unit: str, names: frozenset[str]) -> tuple[str, ...]:
    """Display units among `names` for a quantity in an SI unit; frequencies do not get units of gains, such as 1/min.

    >>> units_for("1/s", frozenset({"1/min"})), units_for("Hz", frozenset({"1/min"}))
    (('1/min',), ())
    """
    found = own_units(names).get(unit(si_unit)[1], ())
    return tuple(name for name in found if "Hz" in name) if si_unit == "Hz" else found


def _is_own(name: str) -> bool:
    """True if a unit differs from the default unit by more than a leading prefix."""
    return any(
        word not in PREFIXABLE or (word not in PLAIN_WORDS and (power < 0 or power > 1))
        for word, power in factors(name)
    )


def _at_one_load(names: tuple[str, ...], load: float | None) -> tuple[str, ...]:
    """Units at one `load` (N), taken from units such as ``N/um at 3 kN``; all `names` if they are not at a load.

    A unit for the load is made if it is missing. None stands for the largest load; 0 gives an empty tuple.
    """
    if not names or " at " not in names[0]:
        return names
    sizes = {name: 1 / unit(f"1 at {name.partition(' at ')[2]}")[0] for name in names}
    wanted = max(sizes.values()) if load is None else load
    if found := tuple(name for name in names if math.isclose(sizes[name], wanted, rel_tol=SAME_LOAD)):
        return found
    forces = dict.fromkeys(name.partition(" at ")[0] for name in names)
    return tuple(f"{one} at {format_quantity(wanted, 'N')}" for one in forces) if wanted else ()


def _named_unit(value: float, si_unit: str) -> str:
    """Unit of the context's parameter in its file; empty if unknown, or if the number would be too long in it.

    Units that take no prefix, such as 1/m, are never too long. Friction per load needs a unit at a load.
    """
    name, kind = display_as().unit, unit(si_unit)[1]
    if not name or unit(name)[1] != kind or (kind in _PER_LOAD and " at " not in name):
        return ""
    longest = _LONGEST if _is_own(name) else _LONG
    fits = value == 0 or _SCALED.match(si_unit) is None or _SHORTEST <= abs(value / unit(name)[0]) < longest
    return name if fits else ""


def _best(value: float, names: tuple[str, ...]) -> str | None:
    """Unit among `names` in which an SI value is closest to 10 on a log scale; None for the value 0 or no names."""
    return min(names, key=lambda name: abs(math.log10(abs(value) / unit(name)[0]) - 1), default=None) if value else None


# units that take a prefix; not m^2 (the prefix would apply to m), nor s/m (ms/m misleads)
_SCALED = re.compile(r"(?:Pa|N|m|s(?!/))(?!\^)")
_SHOWN_PREFIXES = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))
HIDDEN = 1e-3  # a value smaller than this share of its error is printed as 0, as none of its digits is known
MOST_DIGITS = 12  # largest number of digits with which the ends of a narrow range are printed; more are rounding errors
SAME_LOAD = 1e-9  # relative difference up to which two loads are equal, apart from rounding in the conversion of units
_SHORTEST, _LONGEST = 1e-3, 1e5  # numbers in this range need no exponent; others are in the SI unit without prefix
_LONG = 1e4  # from this number on, a suitable prefix is chosen in place of the prefix in the file


def _turned(value: float, name: str) -> str:
    """Unit of an angle or angular speed: `name`, with deg changed to arcsec for small SI values, and back for large."""
    part, _, rest = name.partition("/")
    size = abs(value) / unit(name)[0]
    if part == "deg" and 0 < size < _SHORTEST:
        part = "arcsec"
    elif part == "arcsec" and 3600 <= size < math.inf:
        part = "deg"
    return f"{part}/{rest}" if rest else part


def _few(value: float, digits: int) -> str:
    """Format a number with a few digits, without an exponent below 1e5."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(float(text)) < _LONGEST else text


def format_quantity(value: float, si_unit: str, digits: int = 4, area: float | None = None) -> str:
    """Text of an SI value with a prefixed unit; angles in degrees, screw leads per turn, totals if `area` (m²) is set.

    >>> format_quantity(8.72093e9, "Pa/m"), format_quantity(-0.7853981633974483, "rad"), format_quantity(0.0145, "1")
    ('8.721 GPa/m', '-45 deg', '0.0145')
    >>> format_quantity(0.01 / 6.283185307179586, "m/rad")
    '10 mm/rev'
    >>> format_quantity(8.72093e9, "Pa/m", area=0.01)
    '87.21 MN/m'
    """
    factor, si_unit = outside(si_unit, display_area(si_unit, area))
    value = value * factor
    if si_unit == "1":
        return _few(value, digits)
    names = _at_one_load(units_for(si_unit, display_names()), display_as().load)
    own = _named_unit(value, si_unit) or (_best(value, names) if math.isfinite(value) else None)
    own = own or next(iter(names), None)
    scaled = _SCALED.match(si_unit)
    longest = _LONGEST if own is not None and _is_own(own) else _LONG
    if si_unit == "rad" and own is None:
        own = "deg"
    if own is not None and (value == 0 or scaled is None or _SHORTEST <= abs(value / unit(own)[0]) < longest):
        own = _turned(value, own)
        return f"{_few(value / unit(own)[0], digits)} {own}"
    if si_unit == "m/rad":
        value, si_unit = value * 2 * math.pi, "m/rev"
    if si_unit == "s" and math.isfinite(value) and abs(value) >= 600:  # times below 10 min stay in s
        for size, name in ((year, "yr"), (day, "days"), (hour, "h"), (60.0, "min")):
            if abs(value) >= 2 * size:
                return f"{_few(value / size, digits)} {name}"
    if scaled is None or value == 0 or not math.isfinite(value):
        return f"{_few(value, digits)} {si_unit}"
    size = abs(value)
    for factor, prefix in _SHOWN_PREFIXES:
        long = prefix == "T" and size < 1e14  # G is kept up to 1e14: faults are customarily given in GN, GN/m
        # 0.9999: values that four digits round up to the next prefix take it; lengths and times have no large prefixes
        if size >= 0.9999 * factor and not long and (prefix not in ("T", "G", "M", "k") or scaled[0] in ("Pa", "N")):
            break
    if not _SHORTEST <= size / factor < _LONGEST:
        return f"{_few(value, digits)} {si_unit}"
    return f"{_few(value / factor, digits)} {prefix}{si_unit}"


def format_like(value: float, like: float, si_unit: str, digits: int = 4, area: float | None = None) -> str:
    """Text of an SI value in the unit in which `like` is printed, unless the number would be too long.

    >>> format_like(800.0, 28e3, "N"), format_like(2.0, 28e3, "N"), format_like(0.0, 28e3, "N")
    ('0.8 kN', '0.002 kN', '0 kN')
    """
    factor, si_unit = outside(si_unit, display_area(si_unit, area))
    name = written_unit(like * factor, si_unit) or format_quantity(like * factor, si_unit).partition(" ")[2]
    size = unit(name)[0] if name and like and math.isfinite(like) else 0.0
    if size and (value == 0 or 0.1 * _SHORTEST <= abs(value * factor / size) < _LONGEST):
        return f"{_few(value * factor / size, digits)} {name}"
    return format_quantity(value * factor, si_unit, digits)


def written_unit(value: float, si_unit: str) -> str:
    """Display unit of the value's dimension in which the number is closest to 10, as the rig's file probably has it.

    Empty if the context has no unit of the dimension, or the number would be too long in it.

    >>> from steadyslip.core.written import display_units
    >>> with display_units(["kN", "N m/rad", "N m/arcsec"]):
    ...     [written_unit(*one) for one in ((3200.0, "N"), (0.8, "N m/rad"), (9.3e5, "N m/rad"), (1.0, "m"))]
    ['kN', 'N m/rad', 'N m/arcsec', '']
    """
    if named := _named_unit(value, si_unit):
        return named
    if not _SCALED.match(si_unit) or not math.isfinite(value):
        return ""
    name = _best(value, tuple(sorted(_by_dimension(display_names()).get(unit(si_unit)[1], ()))))
    longest = _LONGEST if name and _is_own(name) else _LONG
    return name if name and " at " not in name and _SHORTEST <= abs(value / unit(name)[0]) < longest else ""


def format_as_written(value: float, own: float, si_unit: str, digits: int = 4, area: float | None = None) -> str:
    """Text of an SI value of a parameter in the unit in which the file has its present value `own` (SI).

    If that unit is not known, or the number would be too long in it, the text is that of `format_quantity`.

    >>> from steadyslip.core.written import display_units
    >>> with display_units(["kN"]):
    ...     format_as_written(800.0, 3200.0, "N"), format_as_written(0.8, 3200.0, "N"), format_quantity(800.0, "N")
    ('0.8 kN', '800 mN', '800 N')
    """
    factor, si_unit = outside(si_unit, display_area(si_unit, area))
    name = written_unit(own * factor, si_unit)
    longest = _LONGEST if name and _is_own(name) else _LONG
    number = value * factor / unit(name)[0] if name else math.inf
    if number == 0 or _SHORTEST <= abs(number) < longest:
        name = _turned(value * factor, name)
        return f"{_few(value * factor / unit(name)[0], digits)} {name}"
    return format_quantity(value * factor, si_unit, digits)


def format_own(value: float, si_unit: str, area: float | None = None) -> str:
    """Text of a parameter's present SI value in the unit of the file, with four digits, or six if four would round it.

    >>> format_own(2e5, "1/m"), format_own(316.228, "s/m")
    ('2e+05 1/m', '316.228 s/m')
    """
    digits = 4 if math.isclose(float(f"{value:.4g}"), value, rel_tol=1e-12) else 6
    return format_as_written(value, value, si_unit, digits, area)


def digits_apart(value: float, other: float) -> int:
    """Number of digits with which the texts of two values differ: four, or more for close values, up to twelve.

    >>> digits_apart(1.0, 1.5), digits_apart(1.0, 1.00002)
    (4, 6)
    """
    gap = abs(other - value) / max(abs(value), abs(other), sys.float_info.min)
    return min(12, max(4, 1 - math.floor(math.log10(gap)))) if 1e-12 < gap < math.inf else 4


def format_with_error(value: float, error: float, si_unit: str, area: float | None = None) -> str:
    """Text of an SI value ± its error, both in the unit chosen for the value; 0 ± error for a negligible value.

    >>> format_with_error(1.009e-5, 8.7e-7, "m"), format_with_error(0.00696, 0.00043, "1")
    ('10.09 ± 0.87 um', '0.00696 ± 0.00043')
    >>> format_with_error(7e-17, 350.0, "s/m"), format_with_error(1.2e-9, 3.5e-5, "m")
    ('0 ± 350 s/m', '0 ± 35 um')
    """
    scale, si_unit = outside(si_unit, display_area(si_unit, area))
    value, error = value * scale, error * scale
    if abs(value) < HIDDEN * error < math.inf:
        return f"0 ± {format_quantity(error, si_unit, 2)}"
    number, _, name = format_quantity(value, si_unit).partition(" ")
    factor = value / float(number) if float(number) else 1.0
    return f"{number} ± {_few(error / factor, 2)} {name}".rstrip()


def format_range(low: float, high: float, si_unit: str, area: float | None = None, digits: int = 4) -> str:
    """Text of a range of SI values, both in the unit chosen for `high`, with at least two digits of the width.

    >>> format_range(8.52e-6, 1.195e-5, "m"), format_range(0.599974, 0.600023, "1")
    ('8.52 to 11.95 um', '0.599974 to 0.600023')
    """
    factor, si_unit = outside(si_unit, display_area(si_unit, area))
    low, high = low * factor, high * factor
    if math.isfinite(low) and math.isfinite(high) and low != high:
        digits = max(digits, min(2 + math.floor(math.log10(max(abs(low), abs(high)) / abs(high - low))), MOST_DIGITS))
    number, _, name = format_quantity(high, si_unit, digits).partition(" ")
    if not (math.isfinite(low) and math.isfinite(high)) or not float(number):
        return f"{format_quantity(low, si_unit, digits)} to {format_quantity(high, si_unit, digits)}"
    return f"{_few(low * float(number) / high, digits)} to {number} {name}".rstrip()


def enumerated(words: Sequence[str]) -> str:
    """Words joined by commas, the last two by "and".

    >>> enumerated(["a", "b", "k"])
    'a, b and k'
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def format_growth(low: float, high: float | None = None) -> str:
    """Format a growth rate or a range of them in 1/s, also where gains such as Kv have a unit of that dimension.

    >>> format_growth(112.43), format_growth(-3.2, 0.5)
    ('112.4 1/s', '-3.2 to 0.5 1/s')
    """
    return " to ".join(_few(one, 4) for one in (low, high) if one is not None) + " 1/s"


def format_count(number: int, word: str) -> str:
    """Number and noun, with the noun in the plural except for 1.

    >>> format_count(1, "row"), format_count(3, "row")
    ('1 row', '3 rows')
    """
    return f"{number} {word}{'' if number == 1 else 's'}"


def format_percent(share: float) -> str:
    """Format a fraction as percent with three digits, or more if it would otherwise read as 0 or 100 %.

    >>> format_percent(0.123456), format_percent(0.99981), format_percent(1.0)
    ('12.3 %', '99.981 %', '100 %')
    """
    text = f"{100 * share:.3g}"
    return f"{100 * share:.8g} %" if 0 < share < 1 and float(text) in (0, 100) else f"{text} %"


def typeset_powers(text: str) -> str:
    """Text with numbers such as 2e+05 replaced by 2 × 10⁵."""
    return _EXPONENT.sub(lambda found: f"{found[1]} × 10{str(int(found[2])).translate(_SUPERSCRIPTS)}", text)


def typeset(text: str) -> str:
    """Text with ASCII units and powers of ten replaced by typographic ones: µm, m², kg/m³, 2 × 10⁵.

    >>> typeset("9.2 us, 3 um/s, 2 uN m at 5 m^2, 2e+05 1/m: ours")
    '9.2 µs, 3 µm/s, 2 µN m at 5 m², 2 × 10⁵ 1/m: ours'
    """
    text = typeset_powers(text).replace("^2", "²").replace("^3", "³")
    return re.sub(r"(?<![A-Za-z])u(?=(?:m|s|N|Pa)(?![A-Za-z]))", "µ", text)
