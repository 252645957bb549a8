"""Template of a rig file: positions and units of its numbers, so that other values can be filled in.

The parameter of each number is found by reading the file again with each number changed by a different small share,
so that all syntax of the reader is covered without being repeated here.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from steadyslip.core.areas import is_per_area, total_unit
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import ParameterError, QuantityError, UnitWarning
from steadyslip.core.records import Address, with_values
from steadyslip.files.specifications.read import rig_from_text
from steadyslip.files.specifications.write import rig_to_text
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider

_NUMBER = r"[-+]?(?:\d[\d_]*\.?[\d_]*|\.\d+)(?:[eE][-+]?\d+)?"
_KEY = r"[\w-]+|\"[^\"\n]*\"|'[^'\n]*'"
_VALUE = re.compile(
    rf"#[^\n]*|(?P<key>{_KEY})\s*=\s*(?P<value>\"[^\"\n]*\"|'[^'\n]*'|{_NUMBER}(?=[\s,#}}]|$))|\"[^\"\n]*\""
)
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*")
_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")
_STEP = 1e-6  # relative change of the first number; other numbers change by multiples; small, yet above rounding
_ZERO_STEP = 1e-9  # change of the first number that is 0, in its unit; other zeros change by multiples
_SENTINEL = 1.2345678901e-211  # first of the placeholder values of omitted parameters; no rig has such numbers


@dataclass(frozen=True)
class Slot:
    """Place of a number in the text of a file, which can be replaced.

    Attributes
    ----------
    start, end : int
        Position of its value, quotes included.
    key : str
    number : str
        Number as text.
    unit : str
        Unit as text; empty for a bare number.
    """

    start: int
    end: int
    key: str
    number: str
    unit: str

    @property
    def size(self) -> float:
        """Value of the unit in SI units."""
        return unit(self.unit)[0] if self.unit else 1.0

    def changed(self, number: float) -> str:
        """TOML value of another `number`, in the unit of the number in this slot."""
        return f'"{number!r} {self.unit}"' if self.unit else repr(number)


@dataclass(frozen=True)
class ParameterSource:
    """Value of a parameter as written in a file.

    Attributes
    ----------
    text : str
        Text of the value in the file.
    value : float
        Value in SI units, per unit area if the rig has an area.
    unit : str
        Unit as text; empty for a bare number.
    size : float
        Value of the unit in SI units.
    total : bool
        True if the file gives the total over the area; the value is the total divided by the area.
    """

    text: str
    value: float
    unit: str
    size: float
    total: bool


@dataclass(frozen=True)
class RigTemplate:
    """Text of a rig file with slots for its numbers.

    Attributes
    ----------
    pieces : tuple of (str, str)
        Kind and content of consecutive pieces: ``text`` and the text itself; ``value`` and the name of the parameter
        whose value belongs there; ``lines`` or ``table`` and the name of the table whose omitted keys belong there,
        ``table`` with a header. Empty if the reader would not find filled-in values (such as with omitted keys of
        an inline table).
    sources : mapping of str to ParameterSource
        Sources of the parameters that the file gives.
    omitted : mapping of str to (str, str)
        Table and key of the parameters that the file omits.
    """

    pieces: tuple[tuple[str, str], ...]
    sources: Mapping[str, ParameterSource]
    omitted: Mapping[str, tuple[str, str]]

    def keys(self, table: str) -> dict[str, str]:
        """Keys of a table that the file omits, by parameter name."""
        return {name: key for name, (own, key) in self.omitted.items() if own == table}

    def filled(self, values: Mapping[str, str]) -> str:
        """Text of the file with other values (TOML text) for some parameters."""
        text = ""
        for kind, words in self.pieces:
            if kind in ("lines", "table"):
                lines = [f"{key} = {values[name]}\n" for name, key in self.keys(words).items() if name in values]
                text += f"\n[{words}]\n" * (kind == "table" and bool(lines)) + "".join(lines)
            else:
                text += words if kind == "text" else values.get(words, self.sources[words].text)
        return text


def rig_template(text: str, rig: Slider | Machine, names: Sequence[str]) -> RigTemplate | None:
    """Template of a file for some parameters of its rig.

    Parameters
    ----------
    text : str
        Text of the file.
    rig : Slider or Machine
        Rig read from the file; its values may differ.
    names : sequence of str
        Dotted names of parameters.

    Returns
    -------
    RigTemplate or None
        None if the text is not a rig file, or has other parameters.
    """
    try:
        own = rig_from_text(text)
    except ParameterError:
        return None
    if set(own.parameters()) != set(rig.parameters()):
        return None
    slots = _slots(text)
    found = _slots_by_name(text, own, [one for one in slots if one.key != "area"], names)
    found |= _slots_by_name(text, own, [one for one in slots if one.key == "area"], names)
    addresses = own.parameters()
    sources = {name: _source_of(text, own, addresses[name], slot) for name, slot in found.items()}
    omitted = _omitted(own, [name for name in names if name not in found])
    template = RigTemplate(_pieces(text, found, {table for table, _ in omitted.values()}), sources, omitted)
    return template if _is_read_back(template, own, names) else RigTemplate((), sources, {})


def _slots(text: str) -> list[Slot]:
    """Slots of all numbers in the text that are values of keys, without a unit or quoted with a unit."""
    found = []
    for match in _VALUE.finditer(text):
        if match["value"] is None:
            continue
        raw, quoted = match["value"], match["value"][0] in "\"'"
        quantity = _QUANTITY.fullmatch(raw[1:-1] if quoted else raw)
        if quantity is None or (quoted and not quantity[2]):
            continue
        try:
            if quantity[2]:
                unit(quantity[2])
        except QuantityError:
            continue
        found.append(Slot(match.start("value"), match.end("value"), match["key"].strip("\"'"), *quantity.groups()))
    return found


def _slots_by_name(text: str, rig: Slider | Machine, slots: list[Slot], names: Iterable[str]) -> dict[str, Slot]:
    """Slot of each parameter, by name.

    All numbers are changed by different shares; a parameter belongs to the number with the share by which it changes.
    """
    other = _read(text, [(one, _changed_number(one, n)) for n, one in enumerate(slots)])
    if other is None:  # a changed number is invalid: keep the numbers that may be changed
        kept = [n for n, one in enumerate(slots) if _read(text, [(one, _changed_number(one, n))]) is not None]
        other = _read(text, [(slots[n], _changed_number(slots[n], n)) for n in kept])
    if other is None:
        return {}
    before, after = rig.parameters(), other.parameters()
    found: dict[str, Slot] = {}
    for name in names:
        if name not in after:
            continue
        old, new = before[name].value, after[name].value
        if old is None or new is None or old == new:
            continue
        steps = [n for n, one in enumerate(slots) if _matches(one, n, float(old), float(new), rig.area_of(name))]
        if len(steps) == 1 and not any(slots[steps[0]] is one for one in found.values()):
            found[name] = slots[steps[0]]
    return found


def _changed_number(slot: Slot, n: int) -> float:
    number = float(slot.number.replace("_", ""))
    return number * (1 - _STEP * (n + 1)) if number else _ZERO_STEP * (n + 1)


def _matches(slot: Slot, n: int, old: float, new: float, area: float | None) -> bool:
    if old:
        return abs((1 - new / old) / _STEP - (n + 1)) < 1e-3
    sizes = [slot.size, slot.size / area if area else slot.size]
    return not float(slot.number.replace("_", "")) and any(
        abs(new / (_ZERO_STEP * size) - (n + 1)) < 1e-3 for size in sizes
    )


def _read(text: str, changes: list[tuple[Slot, float]]) -> Slider | Machine | None:
    for slot, number in sorted(changes, key=lambda item: -item[0].start):
        text = text[: slot.start] + slot.changed(number) + text[slot.end :]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)  # changed numbers need no warnings
        try:
            return rig_from_text(text)
        except (ParameterError, OverflowError):
            return None


def _source_of(text: str, rig: Slider | Machine, address: Address, slot: Slot) -> ParameterSource:
    own = text[slot.start : slot.end]
    si, area = address.role.unit, rig.area_of(address.name)
    per_area = area is not None and is_per_area(si)
    total = per_area and (not slot.unit or unit(slot.unit)[1] == unit(total_unit(si))[1])
    return ParameterSource(own, float(address.value or 0.0), slot.unit, slot.size, total)


def _omitted(rig: Slider | Machine, names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Table and key of each parameter in `names`, found by writing the rig with placeholder values."""
    marks = {name: _SENTINEL * (1 + i) for i, name in enumerate(names)}
    found: dict[str, tuple[str, str]] = {}
    if not names:
        return found
    header = ""
    counts: dict[str, int] = {}
    for line in rig_to_text(with_values(rig, marks)).splitlines():
        if heading := _HEADER.match(line):
            header, counts = _numbered(heading, counts)
            continue
        key, _, value = line.partition(" = ")
        for name, mark in marks.items():
            factors = (1.0, rig.area_of(name) or 1.0)
            if any(str(mark * factor) in value for factor in factors):
                found[name] = (header, key)
    return found


def _numbered(heading: re.Match[str], counts: dict[str, int]) -> tuple[str, dict[str, int]]:
    """Name of a table from its header, with members of lists numbered from 1; and the updated counts."""
    name = heading[2].replace('"', "").replace("'", "")
    if heading[1] == "[[":
        counts[name] = counts.get(name, 0) + 1
        return f"{name}.{counts[name]}", counts
    return name, counts


def _pieces(text: str, found: Mapping[str, Slot], tables: set[str]) -> tuple[tuple[str, str], ...]:
    """Pieces of a template: text, values, and places for omitted keys after their table or at the end."""
    text += "" if text.endswith("\n") else "\n"
    marks = [(one.start, one.end, "value", name) for name, one in found.items()]
    at, table, ends = 0, "", dict[str, int]()
    counts: dict[str, int] = {}
    for line in text.splitlines(keepends=True):
        at += len(line)
        if heading := _HEADER.match(line):
            table, counts = _numbered(heading, counts)
        if line.strip() and not line.lstrip().startswith("#"):
            ends[table] = at
    marks += [(ends[one], ends[one], "lines", one) for one in tables if one in ends]
    marks += [(len(text), len(text), "table", one) for one in sorted(tables) if one not in ends]
    pieces, at = [], 0
    for start, end, kind, name in sorted(marks, key=lambda mark: mark[:2]):
        pieces += [("text", text[at:start]), (kind, name)]
        at = end
    return tuple(one for one in [*pieces, ("text", text[at:])] if one[1])


def _is_read_back(found: RigTemplate, rig: Slider | Machine, names: Sequence[str]) -> bool:
    """True if the unchanged template is read as `rig`, and the template filled with values as the rig with these."""
    if set(names) - set(found.sources) - set(found.omitted):
        return False
    addresses = rig.parameters()
    values = {name: float(addresses[name].value or 0.0) * (1 - 1e-5) for name in found.sources}
    values = {name: round(value) if addresses[name].role.domain.whole else value for name, value in values.items()}
    texts = {name: toml_in_si(addresses[name], value) for name, value in values.items()}
    if _read(found.filled({}), []) != rig or _read(found.filled(texts), []) != rig.with_values(values):
        return False
    for name in found.omitted:  # the omitted parameters one at a time: the rig may not allow all of them together
        value = 0.5 * (addresses[name].value or 1.0)
        try:
            other = rig.with_values({name: value})
        except ParameterError:
            continue
        if _read(found.filled({name: toml_in_si(addresses[name], value)}), []) != other:
            return False
    return True


def toml_in_si(address: Address, value: float) -> str:
    """TOML text of a value in SI units, per unit area."""
    if address.role.domain.whole:
        return f"{value:.0f}"
    return repr(float(value)) if address.role.unit == "1" else f'"{float(value)!r} {address.role.unit}"'
