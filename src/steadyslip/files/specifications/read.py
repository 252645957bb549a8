"""TOML text to a Slider; every problem of a file is found and reported at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import Field, fields
from os import PathLike
from typing import Any

from steadyslip.core.errors import (
    InternalError,
    ParameterError,
    Problem,
    QuantityError,
    RigFileError,
    came,
    unknown_name,
)
from steadyslip.core.quantities import is_per_area, numbers, parse, total_unit
from steadyslip.core.records import (
    FrozenRecord,
    Parameter,
    Part,
    Role,
    Series,
    allowed,
    checked,
    checked_number,
    is_required,
    positive,
    role_of,
)
from steadyslip.files.inputs import MOST_TEXT, UnreadableFile, read_bytes
from steadyslip.files.specifications.changes import apply
from steadyslip.files.specifications.layout import (
    MAP,
    PROTOCOL,
    Section,
    find_law,
    has_choice,
    own_fields,
    sections,
    selector,
)
from steadyslip.files.specifications.lines import key_lines, line_of
from steadyslip.files.specifications.toml import NotToml, Table, tables_of
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol


def read_rig(path: str | PathLike[str], changes: Iterable[str] = ()) -> Slider:
    """Read a rig file.

    Parameters
    ----------
    path : path
        TOML file, UTF-8.
    changes : iterable of str
        Values that replace or complete those of the file, as ``"contact.angle=10 deg"``.

    Returns
    -------
    Slider

    Raises
    ------
    RigFileError
        If the file cannot be read or anything in it is wrong; ``problems`` lists everything.
    """
    return rig_from_text(text_of(path), str(path), changes)


def text_of(path: str | PathLike[str]) -> str:
    """The text of a rig file."""
    name = str(path)
    try:
        return read_bytes(path, MOST_TEXT).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _failed(name, "is not UTF-8 text; a rig file is plain text in TOML") from error
    except UnreadableFile as error:
        raise _failed(name, error.reason) from error


def rig_from_text(text: str, source: str = "rig", changes: Iterable[str] = ()) -> Slider:
    """Read a rig from TOML text; see `read_rig`."""
    rig, _ = read_text(text, source, changes)
    if rig is None:
        raise InternalError("rig is not None")
    return rig


def read_text(
    text: str, source: str, changes: Iterable[str], rig_needed: bool = True
) -> tuple[Slider | None, Protocol | None]:
    """The rig and the protocol of a TOML text; all problems of both are reported at once.

    Unless `rig_needed`, a text that has no table but the protocol's is complete without a rig.
    """
    if not text.strip():
        names = ", ".join(f"[{section.name}]" for section in sections())
        raise _failed(source, f"is empty; a rig file has the tables {names}")
    tables, lines, problems = parsed(text, source, changes)
    return from_tables(tables, lines, source, problems, rig_needed)


def parsed(text: str, source: str, changes: Iterable[str]) -> tuple[Table, dict[str, int], list[Problem]]:
    """The tables of a text with changes made, the lines of their keys, and what is wrong with the changes."""
    try:
        tables = tables_of(text)
    except NotToml as error:
        raise _failed(source, f"is not TOML: {error}") from error
    lines, problems = key_lines(text), []
    for change in [changes] if isinstance(changes, str) else changes:
        problems += apply(change, tables, lines)
    return tables, lines, problems


def from_tables(
    tables: Table, lines: dict[str, int], source: str, problems: list[Problem], rig_needed: bool = True
) -> tuple[Slider | None, Protocol | None]:
    """The rig and the protocol that tables describe, as `read_text`; `problems` are reported with theirs."""
    reader = Reader(tables)
    reader.problems += problems
    alone = not rig_needed and set(tables) == {PROTOCOL.name}
    rig = None if alone else reader.rig()
    protocol = reader.protocol()
    if reader.problems or (rig is None and not alone):
        found = [Problem(p.name, p.message, line_of(p.name, lines)) for p in reader.problems]
        raise RigFileError(sorted(found, key=lambda p: p.line or 0), title=source)
    return rig, protocol


def _failed(name: str, message: str) -> RigFileError:
    return RigFileError([Problem(name, message)])


class Reader:
    """One pass over a file's tables, collecting problems."""

    def __init__(self, tables: Table) -> None:
        self.tables = tables
        self.problems: list[Problem] = []
        self.area: float | None = None

    def problem(self, name: str, message: str) -> None:
        self.problems.append(Problem(name, message))

    def rig(self) -> Slider | None:
        known = {section.name for section in (*sections(), PROTOCOL)}
        for name in self.tables:
            if name not in {*known, MAP}:
                self.problem(name, unknown_name("table", name, sorted({*known, MAP})))
        own = self._table("slider")
        self._read_area(own)
        parts = {s.name: self._section(s) for s in sections() if s.family is not None}
        arguments = self._arguments(Slider, own, "slider.")
        if self.problems or any(part is None for part in parts.values()):
            return None
        return self._built(Slider, {**arguments, **parts}, "slider.")  # type: ignore[return-value]

    def protocol(self) -> Protocol | None:
        """The protocol, None if the file has none; comes after the rig, whose area it needs."""
        if PROTOCOL.name not in self.tables:
            return None
        before = len(self.problems)
        table = self._table(PROTOCOL.name)
        if len(self.problems) > before:
            return None
        return self._complete(Protocol, table, f"{PROTOCOL.name}.")  # type: ignore[return-value]

    def _table(self, name: str) -> Table:
        table = self.tables.get(name, {})
        if isinstance(table, dict):
            return table
        self.problem(name, f"got {came(table)}; allowed: a table [{name}]")
        return {}

    def _read_area(self, own: Table) -> None:
        raw = own.get("area")
        if raw is not None:
            try:
                self.area = checked_number(Parameter("m^2", positive, "contact area"), raw)
            except ParameterError:
                self.area = None  # reported when the slider's own keys are read

    def _section(self, section: Section) -> FrozenRecord | None:
        if section.family is None:
            raise InternalError("section.family is not None")
        key, default = selector(section.family)
        if section.name not in self.tables:
            example = f"{key} = {next(iter(section.family.registry))!r}" if default is None else "velocity = '1 um/s'"
            self.problem(section.name, f"missing table; write [{section.name}] with {example} and its parameters")
            return None
        return self.record(section.family, self._table(section.name), f"{section.name}.")

    def record(self, family: type[FrozenRecord], table: Table, prefix: str) -> FrozenRecord | None:
        """The record that a table describes, or None after noting its problems."""
        if not has_choice(family):
            law, rest = family, table
        else:
            key, default = selector(family)
            if key not in table and default is None:
                self.problem(prefix + key, f"missing; allowed: {', '.join(family.registry)}")
                return None
            chosen = self._law(family, table.get(key, default), prefix + key)
            if chosen is None:
                return None
            law, rest = chosen, {name: value for name, value in table.items() if name != key}
        return self._complete(law, rest, prefix)

    def _complete(self, law: type[FrozenRecord], table: Table, prefix: str) -> FrozenRecord | None:
        """Build a record; with bad values, still find what the others contradict."""
        before = len(self.problems)
        arguments = self._arguments(law, table, prefix)
        if len(self.problems) == before:
            return self._built(law, arguments, prefix)
        self.problems += [p.under(prefix.rstrip(".")) for p in _contradictions(law, arguments, set(table))]
        return None

    def _law(self, family: type[FrozenRecord], name: object, where: str) -> type[FrozenRecord] | None:
        try:
            return find_law(family, name)
        except ParameterError as error:
            self.problem(where, error.problems[0].message)
            return None

    def _built(self, law: type[FrozenRecord], arguments: Table, prefix: str) -> FrozenRecord | None:
        try:
            return law(**arguments)
        except ParameterError as error:
            self.problems += [p.under(prefix.rstrip(".")) for p in error.problems]
            return None

    def _arguments(self, law: type[FrozenRecord], table: Table, prefix: str) -> Table:
        """Constructor arguments from a table; unknown, missing and bad keys are noted."""
        rest = dict(table)
        arguments: Table = {}
        keys: list[str] = []
        for item, role in own_fields(law):
            keys.append(item.name)
            if isinstance(role, Part) and role.inline:
                inner = self._inline(item, role, rest, prefix, keys)
                if inner is not None:
                    arguments[item.name] = inner
            elif item.name in rest:
                value = self._value(item, role, rest.pop(item.name), prefix + item.name)
                if value is not None:
                    arguments[item.name] = value
            elif is_required(item):
                self.problem(prefix + item.name, _missing(role))
        for name in rest:
            self.problem(prefix + name, unknown_name("key", name, keys))
        return arguments

    def _inline(self, item: Field[Any], role: Part, rest: Table, prefix: str, keys: list[str]) -> FrozenRecord | None:
        """A part named by a word whose own parameters stand beside it (evolution, c_nagata)."""
        raw = rest.pop(item.name, item.default.name if isinstance(item.default, FrozenRecord) else None)
        law = self._law(role.family, raw, prefix + item.name)
        if law is None:
            return None
        names = [inner.name for inner, _ in own_fields(law)]
        keys += names
        mine = {name: rest.pop(name) for name in names if name in rest}
        return self._complete(law, mine, prefix)

    def _value(self, item: Field[Any], role: Role, raw: Any, name: str) -> Any:
        """One checked value, None after noting a problem."""
        if isinstance(role, Part):
            return self._part(role, raw, name)
        try:
            if isinstance(role, (Parameter, Series)) and self.area is not None and is_per_area(role.unit):
                return (
                    number(role, raw, self.area) if isinstance(role, Parameter) else self._totals(role, raw, self.area)
                )
            return checked(item, raw)
        except ParameterError as error:
            self.problem(name, error.problems[0].message)
            return None

    def _part(self, role: Part, raw: Any, name: str) -> Any:
        if role.many:
            if not isinstance(raw, list) or not all(isinstance(member, dict) for member in raw):
                self.problem(name, f"got {came(raw)}; allowed: a list of tables, [[{name}]]")
                return None
            members = [self.record(role.family, member, f"{name}.{i}.") for i, member in enumerate(raw, start=1)]
            return None if None in members else tuple(members)
        table = {"law": raw} if isinstance(raw, str) else raw
        if not isinstance(table, Mapping):
            self.problem(
                name, f"got {came(raw)}; allowed: a table [{name}] with law = one of {', '.join(role.family.registry)}"
            )
            return None
        return self.record(role.family, dict(table), f"{name}.")

    def _totals(self, role: Series, raw: Any, area: float) -> tuple[float, ...]:
        """A column for the whole area as one per unit area; its texts may give either."""

        def read(text: str, total: str) -> float:
            try:
                return parse(text, total) / area
            except QuantityError as error:
                try:
                    return parse(text, role.unit)
                except QuantityError:
                    raise QuantityError(f"{error} (the rig has an area)") from error

        try:
            found = numbers(raw, total_unit(role.unit), read)
            return tuple(v if isinstance(given, str) else v / area for given, v in zip(raw, found, strict=True))
        except QuantityError as error:
            raise ParameterError([Problem("", str(error))]) from error


def number(role: Parameter, raw: Any, area: float | None) -> float:
    """A value of a file, SI, per unit area.

    Where the rig has an area, quantities per unit area are for the whole of it in a file (N, N/m, kg, ...); text may
    give either.

    Raises
    ------
    ParameterError
        Without a name.
    """
    if area is None or not is_per_area(role.unit):
        return checked_number(role, raw)
    if isinstance(raw, str):
        try:
            return checked_number(role, parse(raw, total_unit(role.unit)) / area)
        except QuantityError as error:
            try:
                return checked_number(role, parse(raw, role.unit))
            except QuantityError:
                raise ParameterError([Problem("", f"{error} (the rig has an area)")]) from error
    whole = Parameter(total_unit(role.unit), role.domain, role.doc)
    return checked_number(role, checked_number(whole, raw) / area)


def _missing(role: Role) -> str:
    if isinstance(role, Parameter):
        return f"missing ({role.doc}); allowed: {allowed(role)}"
    if isinstance(role, Series):
        return f"missing ({role.doc}); allowed: a list of numbers in {role.unit}, or of texts with units"
    return f"missing ({role.doc})"


def _contradictions(law: type[FrozenRecord], valid: Mapping[str, Any], given: set[str]) -> list[Problem]:
    """Problems between the fields of a record that cannot be built, because other fields are bad.

    Numbers that were given but are bad, or missing, stand as NaN, which contradicts nothing.
    """
    partial = object.__new__(law)
    for item in fields(law):  # type: ignore[arg-type]
        role = role_of(item)
        if item.name in valid:
            value = valid[item.name]
        elif item.name in given or is_required(item):
            if not isinstance(role, Parameter):
                return []
            value = math.nan
        else:
            value = item.default
        object.__setattr__(partial, item.name, value)
    found = list(partial.inconsistencies())
    for condition in partial.conditions():
        problem = condition.problem()
        if problem is not None and not any(math.isnan(number) for number in condition.numbers):
            found.append(problem)
    return found
