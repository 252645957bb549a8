"""Reading of any declared record from TOML tables; all problems are collected."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import Field, fields, replace
from difflib import get_close_matches
from typing import Any

from steadyslip.core.areas import is_per_area, total_unit
from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem, legible, repr_short, unknown_name
from steadyslip.core.format import enumerated
from steadyslip.core.names import Members, unfit_name
from steadyslip.core.records import Declared, FrozenRecord, Named, Part, Settings, is_required, key_of, role_of
from steadyslip.core.roles import Entry, Parameter
from steadyslip.files.specifications.layout import (
    Section,
    find_law,
    has_choice,
    nested_keys,
    own_fields,
    selector,
)
from steadyslip.files.specifications.toml import Table
from steadyslip.machine.input_units import TURNING
from steadyslip.machine.rig import Rig
from steadyslip.protocol.protocol import DISTURBANCE, Piece

ONE_NAME = 0.8  # least similarity of a misspelt name to the name that is meant, as of azimut and azimuth


class TableReader:
    """Reader of tables that collects problems; with an `area`, quantities per unit area are read as totals."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.area: float | None = None
        self.feed = 1.0, False
        """Motion of the load point as given in the file over that of the drive; True if it turns (given as angles)."""
        self.in_totals = False
        self.acted_on: Rig | None = None
        self.sections: tuple[Section, ...] = ()
        """Declarations of the file's tables, used for hints on keys in the wrong table."""
        self.values_read: dict[str, tuple[Any, str]] = {}
        """Parameters read so far, by dotted name: the value as written, and the SI unit."""
        self.twisted = False
        """True while a torque is read instead of a force."""

    def problem(self, name: str, message: str) -> None:
        self.problems.append(Problem(name, message))

    def record(self, family: type[FrozenRecord], table: Table, prefix: str) -> FrozenRecord | None:
        """Record described by a table; None if there were problems, which are added to the reader's list."""
        if not has_choice(family):
            law, rest = family, table
        else:
            key, default = selector(family)
            if key not in table and default is None:
                self.problem(prefix + key, f"missing; allowed: {', '.join(family.registry)}")
                return None
            meant = "" if key in table or default is None else self._left_unnamed(family, default, table, prefix)
            chosen = self._law(family, table.get(key, meant or default), prefix + key)
            if chosen is None:
                return None
            law, rest = chosen, {name: value for name, value in table.items() if name != key}
        return self._complete(law, rest, prefix)

    def _left_unnamed(
        self, family: type[FrozenRecord], default: str, table: Table, prefix: str, able: Iterable[str] | None = None
    ) -> str:
        """Report a table that names no law and has keys that the default law lacks; returns the first law with all.

        Returns an empty text if no law has all keys. If `able` is given, only the laws in it are considered.
        """
        keys = {name: {key_of(item) for item, _ in own_fields(law)} for name, law in family.registry.items()}
        foreign = [name for name in table if name not in keys[default]]
        known = [name for name in (keys if able is None else able) if keys[name].issuperset(table)]
        if len(foreign) < 2 or not known:
            return ""
        key, _ = selector(family)
        words = " or ".join(f"{key} = {name!r}" for name in known)
        self.problem(
            prefix + key,
            f"missing; {enumerated(foreign)} are keys of {words}: write one"
            if known[1:]
            else f"missing; {enumerated(foreign)} are keys of {words}: write that",
        )
        return known[0]

    def _complete(self, law: type[FrozenRecord], table: Table, prefix: str) -> FrozenRecord | None:
        """Record of a known law; if some values are invalid, contradictions between the others are reported too."""
        before = len(self.problems)
        outer, self.twisted = self.twisted, self._twists(law, table)
        with self._own_area(law, table):
            arguments = self._arguments(law, table, prefix)
        self.twisted = outer
        if len(self.problems) == before:
            return self._built(law, arguments, prefix)
        if issubclass(law, Settings):
            return _stand_in(law, arguments, {})
        self.problems += [p.under(prefix.rstrip(".")) for p in _contradictions(law, arguments, set(table))]
        return None

    @contextmanager
    def _own_area(self, law: type[FrozenRecord], table: Table) -> Iterator[None]:
        """Context in which a record declared in totals is read: with its own area, or in forces without one."""
        outer = self.area, self.in_totals
        if law.in_totals:
            self.area, self.in_totals = 1.0 if "area" in table else None, True
            with suppress(ParameterError):  # a wrong area is reported with the other keys; totals are valid
                self.area = None if "area" not in table else Parameter("m^2", positive, "area").checked(table["area"])
        yield
        self.area, self.in_totals = outer

    @contextmanager
    def of_rig(self, rig: Rig | None) -> Iterator[None]:
        """Context for protocols that act on a rig: for a machine in forces, and in angles if its load point turns."""
        outer = self.in_totals, self.feed, self.acted_on
        if rig is not None:
            self.in_totals, self.feed, self.acted_on = rig.in_forces, rig.feed(), rig
        yield
        self.in_totals, self.feed, self.acted_on = outer

    def _twists(self, law: type[FrozenRecord], table: Table) -> bool:
        """True if a piece of a protocol acts on something that turns."""
        if self.acted_on is None or not issubclass(law, Piece):
            return False
        if law.frees_load_point:
            return bool(self.acted_on.drive.turns)
        if law.channel != DISTURBANCE:
            return False
        on = table.get("on")
        return self.acted_on.turns_on(on if isinstance(on, str) else None)

    def members(self, role: Part, raw: Any, name: str) -> Members | None:
        """Records from tables with names chosen by the user; None if there were problems."""
        if not isinstance(raw, dict):
            self.problem(name, f"got {repr_short(raw)}; allowed: a table for each, [{name}.NAME]")
            return None
        before, found = len(self.problems), {}
        for key, member in self._of_one_spelling(raw, name).items():
            if wrong := unfit_name(key):
                self.problem(f"{name}.{legible(key)}", wrong)
            elif not isinstance(member, dict):
                message = (
                    f"got {repr_short(member)}; allowed: a table [{name}.{key}];"
                    f" what stands in [{name}] is a table for each"
                )
                self.problem(f"{name}.{key}", message)
            elif (one := self.record(role.family, member, f"{name}.{key}.")) is not None:
                found[key] = one
        return Members(found) if len(self.problems) == before else None

    def _of_one_spelling(self, raw: Table, name: str) -> Table:
        """Tables by name; parts of a table that are under a misspelt name are reported and merged into that table."""
        tables = {key: one for key, one in raw.items() if isinstance(one, dict)}
        for key, part in tables.items():
            if not all(isinstance(one, dict) for one in part.values()):
                continue  # a table with values of its own is no part of another table
            larger = [one for one, rest in tables.items() if len(rest) > len(part) and not set(rest) & set(part)]
            if meant := next(iter(get_close_matches(key, larger, n=1, cutoff=ONE_NAME)), None):
                keys = enumerated(list(part))
                self.problem(f"{name}.{key}", f"has only {keys}, which {name}.{meant} lacks; did you mean {meant!r}?")
                raw = {one: rest | part if one == meant else rest for one, rest in raw.items() if one != key}
        return raw

    def _law(self, family: type[FrozenRecord], name: object, where: str) -> type[FrozenRecord] | None:
        try:
            return find_law(family, name)
        except ParameterError as error:
            self.problem(where, error.problems[0].message + _part_of_another(family, name))
            return None

    def _built(self, law: type[FrozenRecord], arguments: Table, prefix: str) -> FrozenRecord | None:
        try:
            return law(**arguments)
        except ParameterError as error:
            self.problems += [p.under(prefix.rstrip(".")) for p in error.problems]
            return _stand_in(law, arguments, {}) if issubclass(law, Settings) else None

    def _arguments(self, law: type[FrozenRecord], table: Table, prefix: str) -> Table:
        """Constructor arguments from a table; unknown, missing and invalid keys are reported."""
        rest = dict(table)
        arguments: Table = {}
        missing: dict[str, Problem] = {}
        keys: list[str] = []
        for item, role in own_fields(law):
            key = key_of(item)
            if isinstance(role, Part) and role.by_name:
                members = self._by_name(role, rest, prefix)
                keys += role.family.registry
                if members:
                    arguments[item.name] = members
                continue
            keys.append(key)
            if isinstance(role, Part) and role.inline:
                inner = self._inline(item, role, rest, prefix, keys)
                if inner is not None:
                    arguments[item.name] = inner
            elif key in rest:
                value = self._value(role, rest.pop(key), prefix + key)
                if value is not None:
                    arguments[item.name] = value
            elif is_required(item):
                missing[key] = Problem(prefix + key, _missing(self.worded(role)))
        for name, value in rest.items():
            another = _key_of_another(law, name, value)
            elsewhere = "" if another else _tables_with(name, self.sections)
            meanings = {key_of(item): role.doc for item, role in own_fields(law)}
            message = unknown_name("key", name, keys, guess=not another, meanings=meanings, taken=table)
            if elsewhere:
                message = f"unknown key {repr_short(name)} here; it is a key of {elsewhere}"
            self.problem(prefix + legible(name), message + another)
            for item, role in own_fields(law):
                if f"did you mean {key_of(item)!r}?" in message and item.name not in arguments:
                    missing.pop(key_of(item), None)  # the key is misspelt and not missing
                    if (meant := self._value(role, value, prefix + name)) is not None:
                        arguments[item.name] = meant
        self.problems += missing.values()
        return arguments

    def _by_name(self, role: Part, rest: Table, prefix: str) -> tuple[FrozenRecord, ...]:
        """Records from tables named after laws of a family; these tables are removed from `rest`."""
        found = []
        key = selector(role.family)[0]
        for name in [name for name, value in rest.items() if isinstance(value, dict)]:
            try:
                find_law(role.family, name)
            except ParameterError:
                continue  # the key is unknown
            table = rest.pop(name)
            if key in table:
                self.problem(f"{prefix}{name}.{key}", "is not an option; the table is named after the result")
            elif (one := self.record(role.family, {key: name, **table}, f"{prefix}{name}.")) is not None:
                found.append(one)
        return tuple(found)

    def _inline(self, item: Field[Any], role: Part, rest: Table, prefix: str, keys: list[str]) -> FrozenRecord | None:
        """Record of a part whose law is a value of the table, with its parameters beside it (evolution, c_nagata)."""
        raw = rest.pop(item.name, item.default.name if isinstance(item.default, FrozenRecord) else None)
        law = self._law(role.family, raw, prefix + item.name)
        if law is None:
            return None
        names = [inner.name for inner, _ in own_fields(law)]
        keys += names
        mine = {name: rest.pop(name) for name in names if name in rest}
        return self._complete(law, mine, prefix)

    def _value(self, role: Declared, raw: Any, name: str) -> Any:
        """Checked value; None after reporting a problem."""
        if isinstance(role, Part):
            return self._part(role, raw, name)
        if isinstance(role, Named):
            return self._named(role, raw, name)
        ratio = self.feed[0] if getattr(role, "unit", "") in TURNING else 1.0
        if isinstance(role, Parameter):
            role = self.in_file_unit(role)
        try:
            value = role.read(raw, self.area)
        except ParameterError as error:
            self.problems += [problem.under(name) for problem in error.problems[:1]]
            return None
        if isinstance(role, Parameter):
            self.values_read.setdefault(name, (raw, role.unit))
        if ratio == 1.0 or value is None:
            return value
        return tuple(one / ratio for one in value) if isinstance(value, tuple) else value / ratio

    def in_file_unit(self, role: Parameter) -> Parameter:
        """Declaration of a parameter with the unit that this file uses for it."""
        if self.in_totals and self.area is None and is_per_area(role.unit):
            unit = "N m" if self.twisted else total_unit(role.unit)  # without area: forces
            return replace(role, unit=unit)
        return replace(role, unit=TURNING[role.unit]) if self.feed[1] and role.unit in TURNING else role

    def worded(self, role: Declared) -> Declared:
        """Declaration of a parameter as messages name it: as a total if there is an area, and as a force or torque."""
        if not isinstance(role, Parameter):
            return role
        here = self.in_file_unit(role)
        if self.area is not None and is_per_area(here.unit):
            here = replace(here, unit=total_unit(here.unit))
        forces = here.unit.startswith("N") or (self.in_totals and self.area is None)
        word = "torque" if here.unit == "N m" else "force" if forces else "stress"
        return replace(here, doc=here.doc.replace("stress", word))

    def _part(self, role: Part, raw: Any, name: str) -> Any:
        if role.keyed:
            return self.members(role, raw, name)
        if role.many:
            if not isinstance(raw, list) or not all(isinstance(member, dict) for member in raw):
                self.problem(name, f"got {repr_short(raw)}; allowed: a list of tables, [[{name}]]")
                return None
            members = [self.record(role.family, member, f"{name}.{i}.") for i, member in enumerate(raw, start=1)]
            return None if None in members else tuple(members)
        table = _from_short(role.family, raw)
        if table is None:
            self.problem(name, f"got {repr_short(raw)}; allowed: {_wanted(role.family, name)}")
            return None
        return self.record(role.family, table, f"{name}.")

    def _named(self, role: Named, raw: Any, name: str) -> dict[str, Any] | None:
        if not isinstance(raw, dict):
            self.problem(name, f"got {repr_short(raw)}; allowed: parameters and their values")
            return None
        keys = [key_of(item) for item, _ in own_fields(role.family)]
        found: dict[str, Any] = {}
        for path, value in nested_keys(raw, keys):
            inner = ".".join(path)
            if inner in found:
                self.problem(f"{name}.{inner}", "is named twice; name it once")
            elif isinstance(value, dict):
                one = self.record(role.family, value, f"{name}.{inner}.")
                if one is not None:
                    found[inner] = one
            elif role.listed and isinstance(value, list):
                found[inner] = value
            else:
                listed = "a list of values, or " if role.listed else ""
                self.problem(
                    f"{name}.{inner}", f"got {repr_short(value)}; allowed: {listed}{{{' = ..., '.join(keys)} = ...}}"
                )
        return found


def _from_short(family: type[FrozenRecord], raw: Any) -> Table | None:
    """Table that means the same as a value in short form (law name, number or list); None for other values."""
    if isinstance(raw, Mapping):
        return dict(raw)
    if has_choice(family):
        return {"law": raw} if isinstance(raw, str) else None
    if not family.short:
        return None
    values = raw if isinstance(raw, list) and len(raw) == len(family.short) else [raw]
    return dict(zip(family.short, values, strict=False))


def _wanted(family: type[FrozenRecord], name: str) -> str:
    if has_choice(family):
        return f"a table [{name}] with law = one of {', '.join(family.registry)}"
    return f"a table [{name}] with {', '.join(key_of(item) for item, _ in own_fields(family))}"


def _missing(role: Declared) -> str:
    return f"missing ({role.doc})" + (f"; allowed: {role.allowed()}" if isinstance(role, Entry) else "")


def _stand_in(law: type[FrozenRecord], valid: Mapping[str, Any], others: Mapping[str, Any]) -> FrozenRecord:
    """Record made without checks from the `valid` values; other fields get values from `others`, or defaults."""
    found = object.__new__(law)
    for item in fields(law):  # type: ignore[arg-type]
        default = None if is_required(item) else item.default
        object.__setattr__(found, item.name, valid.get(item.name, others.get(item.name, default)))
    return found


def _contradictions(law: type[FrozenRecord], valid: Mapping[str, Any], came_with: set[str]) -> list[Problem]:
    """Contradictions between the valid fields of a record whose other fields are invalid.

    Invalid or missing numbers are set to NaN, which violates no condition.
    """
    bad = [i for i in fields(law) if i.name not in valid and (key_of(i) in came_with or is_required(i))]  # type: ignore[arg-type]
    if not all(isinstance(role_of(item), Parameter) for item in bad):
        return []
    partial = _stand_in(law, valid, {item.name: math.nan for item in bad})
    found = list(partial.inconsistencies())
    for condition in partial.conditions():
        problem = condition.problem()
        if problem is not None and not any(math.isnan(number) for number in condition.numbers):
            found.append(problem)
    return found


def _key_of_another(law: type[FrozenRecord], name: str, value: Any) -> str:
    """Hint on an unknown key: other laws of the family that have this key, or the law named by its value."""
    bases = (base for base in law.__mro__ if issubclass(base, FrozenRecord) and base is not FrozenRecord)
    family = next((base for base in bases if has_choice(base) and law in base.registry.values()), None)
    if family is None:
        return ""
    key, _ = selector(family)
    if isinstance(value, str) and value in family.registry:
        return f'; did you mean {key} = "{value}"?'
    known = [word for word, other in family.registry.items() if name in (key_of(item) for item, _ in own_fields(other))]
    words = " or ".join(f'"{word}"' for word in known)
    return f"; it is a key of {key} = {words}" if words else ""


def _tables_with(name: str, sections: Iterable[Section]) -> str:
    """Text that lists the tables of a file in which a key is allowed; empty if there are none."""
    found = [
        f"[{path}]"
        for path, laws in _nested_tables(sections)
        if any(name == key_of(item) for law in laws for item, _ in own_fields(law))
    ]
    return " or ".join(found)


def _nested_tables(every: Iterable[Section]) -> Iterator[tuple[str, list[type[FrozenRecord]]]]:
    """Paths of all tables of a kind of file, such as ``contacts.NAME.friction``, each with its possible records."""
    left = [(f"{one.name}.NAME" if one.keyed else one.name, one.family) for one in every]
    for path, family in left:
        laws = list(family.registry.values()) if has_choice(family) else [family]
        yield path, laws
        parts = {
            item.name: role.family
            for law in laws
            for item, role in own_fields(law)
            if isinstance(role, Part) and not role.inline
        }
        left += [(f"{path}.{inner}", one) for inner, one in parts.items()]


def _part_of_another(family: type[FrozenRecord], name: object) -> str:
    """Hint on an unknown law name: the law of the family that has a part with this name."""
    for word, law in family.registry.items():
        for item, role in own_fields(law):
            if isinstance(role, Part) and role.inline and isinstance(name, str) and name in role.family.registry:
                return f'; write {selector(family)[0]} = "{word}" and {item.name} = "{name}"'
    return ""
