"""How a rig file writes its numbers: where each stands and in which unit, so that others can take its place there.

What a number belongs to is found by reading the file once more with every number changed a little, each by a share of
its own: so whatever the reader understands is found, and nothing of it is said a second time.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from steadyslip.core.areas import is_per_area, total_unit
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import ParameterError, QuantityError
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
_STEP = 1e-6  # share by which the first number is changed; the second by twice as much
_SENTINEL = 1.2345678901e-211  # first of the numbers that stand for values of what a file leaves out


@dataclass(frozen=True)
class Place:
    """A number of a file.

    Attributes
    ----------
    start, end : int
        Where its value stands, quotes included.
    key : str
    number : str
        Its digits.
    unit : str
        As it is written; empty of a bare number.
    """

    start: int
    end: int
    key: str
    number: str
    unit: str

    @property
    def size(self) -> float:
        """SI units to one of its own."""
        return unit(self.unit)[0] if self.unit else 1.0

    def changed(self, number: float) -> str:
        """Another number in the same unit, as TOML."""
        return f'"{number!r} {self.unit}"' if self.unit else repr(number)


@dataclass(frozen=True)
class Given:
    """How a file gives a parameter.

    Attributes
    ----------
    text : str
        Its value as it stands there.
    value : float
        What that is in SI units, per unit area where the rig has an area.
    unit : str
        As it is written; of a bare number, and of what the file leaves out, empty.
    size : float
        SI units to one of that unit.
    total : bool
        Whether it is for the whole area, by which it is divided.
    """

    text: str
    value: float
    unit: str
    size: float
    total: bool


@dataclass(frozen=True)
class Written:
    """A rig file with places for its numbers.

    Attributes
    ----------
    pieces : tuple of (str, str)
        Its text in order, or nothing where values cannot be put back so that the reader finds them, as where a file
        leaves out a key of a table within a line: kind and words. Of kind ``text`` they are the text itself, of
        ``value`` the name of the parameter whose value stands there, of ``lines`` and ``table`` the name of the table
        whose further keys stand there, with its heading in the latter case.
    given : mapping of str to Given
        Of the parameters whose places were found.
    further : mapping of str to (str, str)
        Of those that the file leaves out, table and key.
    """

    pieces: tuple[tuple[str, str], ...]
    given: Mapping[str, Given]
    further: Mapping[str, tuple[str, str]]

    def keys(self, table: str) -> dict[str, str]:
        """Keys of a table that the file leaves out, by the names of their parameters."""
        return {name: key for name, (own, key) in self.further.items() if own == table}

    def filled(self, values: Mapping[str, str]) -> str:
        """The file with other values, as TOML has them, for some parameters."""
        text = ""
        for kind, words in self.pieces:
            if kind in ("lines", "table"):
                lines = [f"{key} = {values[name]}\n" for name, key in self.keys(words).items() if name in values]
                text += f"\n[{words}]\n" * (kind == "table" and bool(lines)) + "".join(lines)
            else:
                text += words if kind == "text" else values.get(words, self.given[words].text)
        return text


def written(text: str, rig: Slider | Machine, names: Sequence[str]) -> Written | None:
    """How a file writes some parameters of the rig that it describes.

    Parameters
    ----------
    text : str
        Of the file.
    rig : Slider or Machine
        As it was read, other values apart.
    names : sequence of str
        Dotted names of parameters.

    Returns
    -------
    Written or None
        None where the text is that of another rig, or of none.
    """
    try:
        own = rig_from_text(text)
    except ParameterError:
        return None
    if set(own.parameters()) != set(rig.parameters()):
        return None
    places = _places(text)
    found = _belonging(text, own, [one for one in places if one.key != "area"], names)
    found |= _belonging(text, own, [one for one in places if one.key == "area"], names)
    addresses = own.parameters()
    given = {name: _given(text, own, addresses[name], place) for name, place in found.items()}
    further = _left_out(own, [name for name in names if name not in found])
    whole = Written(_pieces(text, found, {table for table, _ in further.values()}), given, further)
    return whole if _comes_back(whole, own, names) else Written((), given, {})


def units_of(text: str) -> set[str]:
    """All units that a file writes behind numbers."""
    return {place.unit for place in _places(text) if place.unit}


def _places(text: str) -> list[Place]:
    """Every number of a text that a key is given, bare or with a unit in quotes."""
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
        found.append(Place(match.start("value"), match.end("value"), match["key"].strip("\"'"), *quantity.groups()))
    return found


def _belonging(text: str, rig: Slider | Machine, places: list[Place], names: Iterable[str]) -> dict[str, Place]:
    """Which parameter each place is of: that which changes by the share of the place when all are changed."""
    other = _read(text, [(one, _moved(one, n)) for n, one in enumerate(places)])
    if other is None:  # a number that may not be changed so: one by one
        kept = [n for n, one in enumerate(places) if _read(text, [(one, _moved(one, n))]) is not None]
        other = _read(text, [(places[n], _moved(places[n], n)) for n in kept])
    if other is None:
        return {}
    before, after = rig.parameters(), other.parameters()
    found: dict[str, Place] = {}
    for name in names:
        if name not in after:
            continue
        old, new = before[name].value, after[name].value
        if old is None or new is None or old == new:
            continue
        steps = [n for n, one in enumerate(places) if _matches(one, n, float(old), float(new), rig.area_of(name))]
        if len(steps) == 1 and not any(places[steps[0]] is one for one in found.values()):
            found[name] = places[steps[0]]
    return found


def _moved(place: Place, n: int) -> float:
    number = float(place.number.replace("_", ""))
    return number * (1 - _STEP * (n + 1)) if number else 1e-9 * (n + 1)


def _matches(place: Place, n: int, old: float, new: float, area: float | None) -> bool:
    if old:
        return abs((1 - new / old) / _STEP - (n + 1)) < 1e-3
    sizes = [place.size, place.size / area if area else place.size]
    return not float(place.number.replace("_", "")) and any(abs(new / (1e-9 * size) - (n + 1)) < 1e-3 for size in sizes)


def _read(text: str, changes: list[tuple[Place, float]]) -> Slider | Machine | None:
    for place, number in sorted(changes, key=lambda item: -item[0].start):
        text = text[: place.start] + place.changed(number) + text[place.end :]
    try:
        return rig_from_text(text)
    except (ParameterError, OverflowError):
        return None


def _given(text: str, rig: Slider | Machine, address: Address, place: Place) -> Given:
    own = text[place.start : place.end]
    si, area = address.role.unit, rig.area_of(address.name)
    per_area = area is not None and is_per_area(si)
    total = per_area and (not place.unit or unit(place.unit)[1] == unit(total_unit(si))[1])
    return Given(own, float(address.value or 0.0), place.unit, place.size, total)


def _left_out(rig: Slider | Machine, names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Heading and key of parameters that a file leaves out, from how they are written."""
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
    """The name of a table; members of lists count from 1."""
    name = heading[2].replace('"', "").replace("'", "")
    if heading[1] == "[[":
        counts[name] = counts.get(name, 0) + 1
        return f"{name}.{counts[name]}", counts
    return name, counts


def _pieces(text: str, found: Mapping[str, Place], tables: set[str]) -> tuple[tuple[str, str], ...]:
    """The text around values, and room for further lines behind the last of their table, or at the end."""
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


def _comes_back(found: Written, rig: Slider | Machine, names: Sequence[str]) -> bool:
    """Whether the file, filled with other values, is read as the rig with these values; and with none as itself."""
    if set(names) - set(found.given) - set(found.further):
        return False
    addresses = rig.parameters()
    values = {name: float(addresses[name].value or 0.0) * (1 - 1e-5) for name in found.given}
    values = {name: round(value) if addresses[name].role.domain.whole else value for name, value in values.items()}
    texts = {name: in_si(addresses[name], value) for name, value in values.items()}
    if _read(found.filled({}), []) != rig or _read(found.filled(texts), []) != rig.with_values(values):
        return False
    for name in found.further:  # one by one: a rig need not have all of them together
        value = 0.5 * (addresses[name].value or 1.0)
        try:
            other = rig.with_values({name: value})
        except ParameterError:
            continue
        if _read(found.filled({name: in_si(addresses[name], value)}), []) != other:
            return False
    return True


def in_si(address: Address, value: float) -> str:
    """A value as TOML, in the unit of the package, per unit area."""
    if address.role.domain.whole:
        return f"{value:.0f}"
    return repr(float(value)) if address.role.unit == "1" else f'"{float(value)!r} {address.role.unit}"'
