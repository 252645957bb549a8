"""Changes such as ``contact.angle=10 deg`` to the tables of a rig file, and the parameter names allowed in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError, repr_short
from steadyslip.core.names import resolve
from steadyslip.core.records import FrozenRecord, Named, Part, key_of
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    Section,
    has_choice,
    is_machine,
    machine_sections,
    nested_keys,
    own_fields,
    sections,
    selector,
)
from steadyslip.files.specifications.toml import NotToml, Table, tables_of
from steadyslip.machine.slider import Slider


def apply(text: str, tables: Table, lines: dict[str, int], section: Section | None = None) -> list[Problem]:
    """Write ``name=value`` into the tables, and delete the line numbers of the old value; returns the problems.

    `section` is the additional table (map, fit) that has the name; None for tables of the rig and protocol.
    """
    name, equals, raw = split(text)
    if not equals or not name or not raw:
        return [Problem(repr_short(text), "is not a change; write NAME=VALUE, such as contact.angle='10 deg'")]
    full, problems = full_name(name, tables)
    if problems:  # in the tables, the name would be reported again
        return problems
    *path, last = full.split(".") if section is None else _keys_to(full, section, tables)
    table: Any = tables
    for step in path:
        if isinstance(table, list):
            index = int(step) - 1 if step.isdigit() else -1
            table = table[index] if 0 <= index < len(table) else None
        elif isinstance(table, dict):
            inner = table.setdefault(step, {})
            if isinstance(inner, str) and full in _known_names(tables):  # a law given by its name alone
                inner = table[step] = {"law": inner}
            table = inner
        if not isinstance(table, (dict, list)):
            return [Problem(name, "cannot be set: there is no such table in the file")]
    if isinstance(table, list):
        message = "cannot be set: name one value of one member, such as friction.states.1.b"
        return [Problem(name, message)]
    try:
        table[last] = value_of(raw, name)
    except ParameterError as error:
        return list(error.problems)
    place = ".".join([*path, last])
    for key in [key for key in lines if f"{key}.".startswith(f"{place}.")]:  # the new value is not on these lines
        del lines[key]
    return []


def _keys_to(full: str, section: Section, tables: Table) -> list[str]:
    """Keys on the path to a value of an additional table.

    In tables of parameters by dotted name, the keys that the file already has for a parameter are used, even if the
    change or the file shortens its name.
    """
    keys = full.split(".")
    family: type[FrozenRecord] | None = section.family
    inner = tables.get(section.name)
    for count, key in enumerate(keys[1:], start=2):
        roles = {key_of(item): role for item, role in own_fields(family)} if family else {}
        role, inner = roles.get(key), inner.get(key) if isinstance(inner, dict) else None
        if isinstance(role, Named) and isinstance(inner, dict):
            own = [key_of(item) for item, _ in own_fields(role.family)]
            known = dict.fromkeys(_known_names(tables))
            is_whole = keys[-1] not in own or _resolved(".".join(keys[count:]), known) in known
            last = [] if is_whole else keys[-1:]
            name = ".".join(keys[count : len(keys) - len(last)])
            paths = (path for path, _ in nested_keys(inner, own))
            same = (path for path in paths if _resolved(".".join(path), known) == _resolved(name, known))
            return [*keys[:count], *next(same, (name,)), *last]
        family = role.family if isinstance(role, Part) and not role.many else None
    return keys


def _resolved(name: str, known: Mapping[str, Any]) -> str:
    """Full name of a parameter; the given name if it is unknown."""
    try:
        return resolve(name, known)
    except UnknownNameError:
        return name


def split(text: str) -> tuple[str, str, str]:
    """Name, equals sign and value of a change as texts; missing parts are empty."""
    name, equals, raw = (part.strip() for part in text.partition("="))
    return name, equals, raw


def named_value(text: str) -> tuple[str, Any]:
    """Name and value of ``name=value``.

    Raises
    ------
    ParameterError
        If the text has another form.
    """
    name, equals, raw = split(text)
    if not equals or not name or not raw:
        raise ParameterError([Problem(repr_short(text), "is not NAME=VALUE, such as contact.angle='10 deg'")])
    return name, value_of(raw, name)


def value_of(raw: str, name: str) -> Any:
    """Value from text that may omit the quotes that TOML requires.

    Raises
    ------
    ParameterError
        If the text has more than one value.
    """
    try:
        tables = tables_of(f"value = {raw}")
    except NotToml:
        return raw
    if len(tables) > 1:
        raise ParameterError(
            [Problem(name, f"got {repr_short(raw)}; allowed: one value; repeat the option for others")]
        )
    return tables["value"]


def full_name(name: str, tables: Table) -> tuple[str, list[Problem]]:
    """Full name of a parameter whose name may be shortened to its unique last part, and the problems found."""
    known = dict.fromkeys(_known_names(tables))
    try:
        return resolve(name, known), []
    except UnknownNameError as error:
        keyed = is_machine(tables) and any(name.startswith(f"{s.name}.") for s in machine_sections() if s.keyed)
        return name, [] if "." in name and not keyed else [Problem(name, str(error))]


def _known_names(tables: Table) -> list[str]:
    """Dotted names of all parameters of the laws that the file chooses, and of its protocol."""
    names: list[str] = []
    machine = is_machine(tables)
    for section in machine_sections() if machine else sections():
        table = tables.get(section.name)
        if section.family is Slider:
            names += _names_of(Slider, {}, section.name + ".")
        elif section.keyed and isinstance(table, dict):
            below = _names_chosen if has_choice(section.family) else _names_of
            for key, member in table.items():
                if isinstance(member, dict):
                    names += below(section.family, member, f"{section.name}.{key}.")
        elif isinstance(table, dict):
            names.append(f"{section.name}.{selector(section.family)[0]}")
            names += _names_chosen(section.family, table, section.name + ".")
    if isinstance(table := tables.get(PROTOCOL.name, {}), dict):
        names += _names_of(PROTOCOL.family, table, PROTOCOL.name + ".")
    return names


def _names_chosen(family: type[FrozenRecord], table: Table, prefix: str) -> list[str]:
    """Dotted names of the parameters of the law that is named in a table."""
    key, default = selector(family)
    chosen = table.get(key, default)
    law = family.registry.get(chosen) if isinstance(chosen, str) else None
    return _names_of(law, table, prefix) if law else []


def _names_of(law: type[FrozenRecord], table: Table, prefix: str) -> list[str]:
    names: list[str] = []
    for item, role in own_fields(law):
        inner = table.get(item.name)
        if not isinstance(role, Part):
            names.append(prefix + item.name)
        elif role.many and isinstance(inner, list):
            below = _names_chosen if has_choice(role.family) else _names_of
            for index, member in enumerate(inner, start=1):
                if isinstance(member, dict):
                    names += below(role.family, member, f"{prefix}{item.name}.{index}.")
        elif not role.many:
            chosen = inner.get("law") if isinstance(inner, dict) else inner
            found = role.family.registry.get(chosen) if isinstance(chosen, str) else None
            part_prefix = prefix if role.inline else f"{prefix}{item.name}."
            names += [prefix + item.name] if role.inline else []
            names += _names_of(found, {}, part_prefix) if found else []
    return names
