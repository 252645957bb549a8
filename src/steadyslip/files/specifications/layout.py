"""Correspondence of records to the tables and keys of a rig file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import Field, dataclass, fields
from difflib import get_close_matches
from typing import Any

from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.core.records import Declared, FrozenRecord, Part, role_of
from steadyslip.files.specifications.toml import Table
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

ENTRY_POINTS = "steadyslip.laws"


@dataclass(frozen=True)
class Section:
    """Declaration of a table of a file.

    Attributes
    ----------
    name : str
    family : type of FrozenRecord
        Class (or base class) of the records that fill it.
    required : bool
        True if the table must not be missing.
    hint : str
        Content suggested in messages on a missing table.
    keyed : bool
        True if it contains a table for each of some names chosen by the user.
    """

    name: str
    family: type[FrozenRecord]
    required: bool = False
    hint: str = ""
    keyed: bool = False


PROTOCOL = Section("protocol", Protocol)
"""Table of the protocol, which a rig file may have in addition to the tables of the rig."""

UNKNOWN = "unknown"
"""Name of the table of intervals of unknown parameters; ignored when a rig is read."""
UNKNOWN_SCHEMA = {
    "type": "object",
    "description": "intervals of parameters that are not known, by dotted name: two numbers, or texts with units",
}

UNITS_LINE = "# told in: "
"""Beginning of the first line of a stored rig, before the units in which the rig and its results are printed."""
MAP = "map"
READ_ELSEWHERE = {MAP: "computes maps"} | dict.fromkeys(("record", "fit", "population"), "fits records")
"""Names of tables that are ignored when a rig is read, and the kind of command that reads each."""
_OF_FAMILIES = ("law", "kind")  # keys that messages replace by the family's name; others, such as motion, are clear


def sections() -> tuple[Section, ...]:
    """Tables of a slider, in the order in which they are written."""
    found = [Section(item.name, role.family) for item in fields(Slider) if isinstance(role := role_of(item), Part)]
    found.insert(2, Section(Slider.section.rstrip("."), Slider))
    return tuple(found)


def machine_sections() -> tuple[Section, ...]:
    """Tables of a machine, in the order in which they are written."""
    found = [(item.name, role) for item in fields(Machine) if isinstance(role := role_of(item), Part)]
    return tuple(Section(name, role.family, keyed=role.keyed) for name, role in found)


def is_machine(tables: Table) -> bool:
    """True if a file has a table that only machines have."""
    return any(section.name in tables for section in machine_sections() if section.keyed)


def selector(family: type[FrozenRecord]) -> tuple[str, str | None]:
    """Key that names the law in a table, and the default law if the key is absent (None: required)."""
    return family.chosen_by


def has_choice(family: type[FrozenRecord]) -> bool:
    """True if tables of this family choose one of several laws."""
    return bool(family.registry) and not family.name


def find_law(family: type[FrozenRecord], name: object) -> type[FrozenRecord]:
    """Law of a family by registered name, or by entry point of an installed package.

    Raises
    ------
    ParameterError
        If there is none; lists the most similar name and all others.
    """
    if isinstance(name, str):
        if name in family.registry:
            return family.registry[name]
        from importlib.metadata import entry_points  # slow to import

        for entry in entry_points(group=ENTRY_POINTS, name=name):
            try:
                law = entry.load()
            except Exception as error:  # imports of other packages may raise anything
                message = f"{name!r} is offered by {entry.value!r}, which cannot be loaded: {error!r}"
                raise ParameterError([Problem("", message)]) from error
            if isinstance(law, type) and issubclass(law, family):
                return law
    key, _ = selector(family)
    what = family.family if key in _OF_FAMILIES else key
    message = unknown_name(what, name, family.registry)
    if key == "law" and isinstance(name, str) and not get_close_matches(name, family.registry, cutoff=0.75):
        message += f"; to add your own: import it in Python, or list it in a package's entry points {ENTRY_POINTS!r}"
    raise ParameterError([Problem("", message)])


def own_fields(law: type[FrozenRecord]) -> Iterator[tuple[Field[Any], Declared]]:
    """Fields of a record that are keys in its own TOML table (nested laws have tables of their own)."""
    for item in fields(law):  # type: ignore[arg-type]
        role = role_of(item)
        if law is Slider and isinstance(role, Part):
            continue
        yield item, role


def nested_keys(table: Table, keys: Sequence[str]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Pairs (keys, value) of a table of dotted names; TOML turns unquoted dots in names into nested tables.

    A table with a plain value under one of `keys` counts as a value.
    """
    for key, value in table.items():
        if (
            isinstance(value, dict)
            and value
            and not any(k in keys and not isinstance(v, (dict, list)) for k, v in value.items())
        ):
            yield from (((key, *path), one) for path, one in nested_keys(value, keys))
        else:
            yield (key,), value
