"""TOML text to a Slider; every problem of a file is found and reported at once."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import Field
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.config.layout import Section, find_law, is_per_area, own_fields, sections, selector, total_unit
from steadyslip.config.lines import key_lines, line_of
from steadyslip.errors import ParameterError, Problem, QuantityError, RigFileError, UnknownNameError, unknown_name
from steadyslip.quantities import parse
from steadyslip.records import (
    Option,
    Parameter,
    Part,
    Record,
    allowed,
    checked,
    checked_number,
    contradictions,
    is_required,
    positive,
    resolve,
)
from steadyslip.slider import Slider

Table = dict[str, Any]


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
    name = str(path)
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise _failed(name, "no such file") from error
    except IsADirectoryError as error:
        raise _failed(name, "is a folder; give a rig file in TOML") from error
    except UnicodeDecodeError as error:
        raise _failed(name, "is not UTF-8 text; a rig file is plain text in TOML") from error
    except OSError as error:
        raise _failed(name, f"cannot be read ({error.strerror or error})") from error
    return rig_from_text(text, name, changes)


def rig_from_text(text: str, source: str = "rig", changes: Iterable[str] = ()) -> Slider:
    """Read a rig from TOML text; see `read_rig`."""
    if not text.strip():
        names = ", ".join(f"[{section.name}]" for section in sections())
        raise _failed(source, f"is empty; a rig file has the tables {names}")
    try:
        tables = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise _failed(source, f"is not TOML: {error}") from error
    reader = _Reader(tables)
    lines = key_lines(text)
    for change in [changes] if isinstance(changes, str) else changes:
        reader.change(change, lines)
    rig = reader.rig()
    if rig is None or reader.problems:
        found = [Problem(p.name, p.message, line_of(p.name, lines)) for p in reader.problems]
        raise RigFileError(sorted(found, key=lambda p: p.line or 0), title=source)
    return rig


def _failed(name: str, message: str) -> RigFileError:
    return RigFileError([Problem(name, message)])


class _Reader:
    """One pass over a file's tables, collecting problems."""

    def __init__(self, tables: Table) -> None:
        self.tables = tables
        self.problems: list[Problem] = []
        self.area: float | None = None

    def problem(self, name: str, message: str) -> None:
        self.problems.append(Problem(name, message))

    # -- changes from the command line

    def change(self, text: str, lines: dict[str, int]) -> None:
        """Apply ``name=value`` to the tables."""
        name, equals, raw = (part.strip() for part in text.partition("="))
        if not equals or not name or not raw:
            self.problem(text, "is not a change; write NAME=VALUE, such as contact.angle='10 deg'")
            return
        try:
            value = tomllib.loads(f"value = {raw}")["value"]
        except tomllib.TOMLDecodeError:
            value = raw
        full = self._full_name(name)
        *path, last = full.split(".")
        table: Any = self.tables
        for step in path:
            if isinstance(table, list):
                index = int(step) - 1 if step.isdigit() else -1
                table = table[index] if 0 <= index < len(table) else None
            elif isinstance(table, dict):
                table = table.setdefault(step, {})
            if not isinstance(table, (dict, list)):
                self.problem(name, "cannot be set: there is no such table in the file")
                return
        if isinstance(table, list):
            self.problem(name, "cannot be set: name one value of one member, such as friction.states.1.b")
            return
        table[last] = value
        for key in [key for key in lines if key == full]:  # the fault is no longer on that line
            del lines[key]

    def _full_name(self, name: str) -> str:
        """A shortened name stands for the one key of that name that the chosen laws have."""
        known = dict.fromkeys(self.known_names())
        try:
            return resolve(name, known)
        except UnknownNameError as error:
            if "." not in name:
                self.problem(name, str(error))
            return name

    def known_names(self) -> list[str]:
        """Every dotted name that the laws chosen in the file know."""
        names: list[str] = []
        for section in sections():
            table = self.tables.get(section.name)
            if section.family is None:
                names += self._names_of(Slider, {}, section.name + ".")
            elif isinstance(table, dict):
                key, default = selector(section.family)
                names.append(f"{section.name}.{key}")
                law = section.family.registry.get(table.get(key, default))  # type: ignore[arg-type]
                names += self._names_of(law, table, section.name + ".") if law else []
        return names

    def _names_of(self, law: type[Record], table: Table, prefix: str) -> list[str]:
        names: list[str] = []
        for item, role in own_fields(law):
            inner = table.get(item.name)
            if not isinstance(role, Part):
                names.append(prefix + item.name)
            elif role.many and isinstance(inner, list):
                for index, member in enumerate(inner, start=1):
                    names += self._names_of(role.family, member, f"{prefix}{item.name}.{index}.")
            elif not role.many:
                chosen = inner.get("law") if isinstance(inner, dict) else inner
                found = role.family.registry.get(chosen) if isinstance(chosen, str) else None
                part_prefix = prefix if role.inline else f"{prefix}{item.name}."
                names += [prefix + item.name] if role.inline else []
                names += self._names_of(found, {}, part_prefix) if found else []
        return names

    # -- tables to records

    def rig(self) -> Slider | None:
        known = {section.name for section in sections()}
        for name in self.tables:
            if name not in known:
                self.problem(name, unknown_name("table", name, sorted(known)))
        own = self._table("slider")
        self._read_area(own)
        parts = {s.name: self._section(s) for s in sections() if s.family is not None}
        arguments = self._arguments(Slider, own, "slider.")
        if self.problems or any(part is None for part in parts.values()):
            return None
        return self._built(Slider, {**arguments, **parts}, "slider.")  # type: ignore[return-value]

    def _table(self, name: str) -> Table:
        table = self.tables.get(name, {})
        if isinstance(table, dict):
            return table
        self.problem(name, f"got {table!r}; allowed: a table [{name}]")
        return {}

    def _read_area(self, own: Table) -> None:
        raw = own.get("area")
        if raw is not None:
            try:
                self.area = checked_number(Parameter("m^2", positive, "contact area"), raw)
            except ParameterError:
                self.area = None  # reported when the slider's own keys are read

    def _section(self, section: Section) -> Record | None:
        assert section.family is not None
        key, default = selector(section.family)
        if section.name not in self.tables:
            example = f"{key} = {next(iter(section.family.registry))!r}" if default is None else "velocity = '1 um/s'"
            self.problem(section.name, f"missing table; write [{section.name}] with {example} and its parameters")
            return None
        return self._record(section.family, self._table(section.name), f"{section.name}.")

    def _record(self, family: type[Record], table: Table, prefix: str) -> Record | None:
        """The record that a table describes, or None after noting its problems."""
        if not family.registry or family.name:
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

    def _complete(self, law: type[Record], table: Table, prefix: str) -> Record | None:
        """Build a record; with bad values, still find what the others contradict."""
        before = len(self.problems)
        arguments = self._arguments(law, table, prefix)
        if len(self.problems) == before:
            return self._built(law, arguments, prefix)
        self.problems += [p.under(prefix.rstrip(".")) for p in contradictions(law, arguments, set(table))]
        return None

    def _law(self, family: type[Record], name: object, where: str) -> type[Record] | None:
        try:
            return find_law(family, name)
        except ParameterError as error:
            self.problem(where, error.problems[0].message)
            return None

    def _built(self, law: type[Record], arguments: Table, prefix: str) -> Record | None:
        try:
            return law(**arguments)
        except ParameterError as error:
            self.problems += [p.under(prefix.rstrip(".")) for p in error.problems]
            return None

    def _arguments(self, law: type[Record], table: Table, prefix: str) -> Table:
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

    def _inline(self, item: Field[Any], role: Part, rest: Table, prefix: str, keys: list[str]) -> Record | None:
        """A part named by a word whose own parameters stand beside it (evolution, c_nagata)."""
        raw = rest.pop(item.name, item.default.name if isinstance(item.default, Record) else None)
        law = self._law(role.family, raw, prefix + item.name)
        if law is None:
            return None
        names = [inner.name for inner, _ in own_fields(law)]
        keys += names
        mine = {name: rest.pop(name) for name in names if name in rest}
        return self._complete(law, mine, prefix)

    def _value(self, item: Field[Any], role: Parameter | Option | Part, raw: Any, name: str) -> Any:
        """One checked value, None after noting a problem."""
        if isinstance(role, Part):
            return self._part(role, raw, name)
        try:
            if isinstance(role, Parameter) and self.area is not None and is_per_area(role.unit):
                return self._total(role, raw)
            return checked(item, raw)
        except ParameterError as error:
            self.problem(name, error.problems[0].message)
            return None

    def _part(self, role: Part, raw: Any, name: str) -> Any:
        if role.many:
            if not isinstance(raw, list) or not all(isinstance(member, dict) for member in raw):
                self.problem(name, f"got {raw!r}; allowed: a list of tables, [[{name}]]")
                return None
            members = [self._record(role.family, member, f"{name}.{i}.") for i, member in enumerate(raw, start=1)]
            return None if None in members else tuple(members)
        table = {"law": raw} if isinstance(raw, str) else raw
        if not isinstance(table, Mapping):
            self.problem(
                name, f"got {raw!r}; allowed: a table [{name}] with law = one of {', '.join(role.family.registry)}"
            )
            return None
        return self._record(role.family, dict(table), f"{name}.")

    def _total(self, role: Parameter, raw: Any) -> float:
        """A value for the whole area (N, N/m, kg, ...) as one per unit area; text may give either."""
        assert self.area is not None
        if isinstance(raw, str):
            try:
                return checked_number(role, parse(raw, total_unit(role.unit)) / self.area)
            except QuantityError as error:
                try:
                    return checked_number(role, parse(raw, role.unit))
                except QuantityError:
                    raise ParameterError([Problem("", f"{error} (the rig has an area)")]) from error
        whole = Parameter(total_unit(role.unit), role.domain, role.doc)
        return checked_number(role, checked_number(whole, raw) / self.area)


def _missing(role: Parameter | Option | Part) -> str:
    if isinstance(role, Parameter):
        return f"missing ({role.doc}); allowed: {allowed(role)}"
    return f"missing ({role.doc})"
