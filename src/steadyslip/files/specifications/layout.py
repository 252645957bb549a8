"""How records map to the tables and keys of a rig file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import Field, dataclass, fields
from importlib.metadata import entry_points
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
    """A table of a file.

    Attributes
    ----------
    name : str
    family : type of FrozenRecord or None
        Of the records that fill it; None for the slider itself.
    required : bool
        Whether a file that is read for it must have it.
    hint : str
        What to write in it, for messages.
    keyed : bool
        Whether it holds a table for each of some names that the user gives.
    """

    name: str
    family: type[FrozenRecord] | None
    required: bool = False
    hint: str = ""
    keyed: bool = False


PROTOCOL = Section("protocol", Protocol)
"""The table that a file may have besides those of the rig."""

MAP = "map"
"""A table that is read by what computes maps, and by nothing else."""


def sections() -> tuple[Section, ...]:
    """The tables of a rig, in order."""
    found = [Section(item.name, role.family) for item in fields(Slider) if isinstance(role := role_of(item), Part)]
    found.insert(2, Section(Slider.section.rstrip("."), None))
    return tuple(found)


def machine_sections() -> tuple[Section, ...]:
    """The tables of a machine, in order."""
    found = [(item.name, role) for item in fields(Machine) if isinstance(role := role_of(item), Part)]
    return tuple(Section(name, role.family, keyed=role.keyed) for name, role in found)


def is_machine(tables: Table) -> bool:
    """Whether a file describes a machine, not a slider: it has a table that only machines have."""
    return any(section.name in tables for section in machine_sections() if section.keyed)


def selector(family: type[FrozenRecord]) -> tuple[str, str | None]:
    """The key that names the law of a table, and the law meant when it is absent."""
    return family.chosen_by


def has_choice(family: type[FrozenRecord]) -> bool:
    """Whether a table of this family names one of several laws, rather than being the one record itself."""
    return bool(family.registry) and not family.name


def find_law(family: type[FrozenRecord], name: object) -> type[FrozenRecord]:
    """The law of a family with a registered name, or one that an installed package offers under it.

    Raises
    ------
    ParameterError
        If there is none; lists the nearest name and all others.
    """
    if isinstance(name, str):
        if name in family.registry:
            return family.registry[name]
        for entry in entry_points(group=ENTRY_POINTS, name=name):
            try:
                law = entry.load()
            except Exception as error:  # whatever a foreign package does when imported
                message = f"{name!r} is offered by {entry.value!r}, which cannot be loaded: {error!r}"
                raise ParameterError([Problem("", message)]) from error
            if isinstance(law, type) and issubclass(law, family):
                return law
    raise ParameterError([Problem("", unknown_name(family.family, name, family.registry))])


def own_fields(law: type[FrozenRecord]) -> Iterator[tuple[Field[Any], Declared]]:
    """The fields of a record that are keys of its own table."""
    for item in fields(law):  # type: ignore[arg-type]
        role = role_of(item)
        if law is Slider and isinstance(role, Part):
            continue
        yield item, role


def ways(table: Table, keys: Sequence[str]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The keys to every value of a table by dotted names, where dots without quotes have made tables of parts of names.

    A table that has one value under one of the `keys` is a value.
    """
    for key, value in table.items():
        if (
            isinstance(value, dict)
            and value
            and not any(k in keys and not isinstance(v, (dict, list)) for k, v in value.items())
        ):
            yield from (((key, *way), one) for way, one in ways(value, keys))
        else:
            yield (key,), value
