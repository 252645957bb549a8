"""Reading of the tables of a slider or machine, the protocol and additional tables; problems are collected."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, cast

from steadyslip.core.domains import positive, speed
from steadyslip.core.errors import (
    NotAvailable,
    ParameterError,
    QuantityError,
    repr_short,
    unknown_name,
)
from steadyslip.core.format import enumerated
from steadyslip.core.quantities import parse
from steadyslip.core.records import FrozenRecord, Part
from steadyslip.core.roles import Parameter
from steadyslip.files.specifications.deviations import SCHEMA as TOLERANCES
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    READ_ELSEWHERE,
    UNKNOWN,
    Section,
    is_machine,
    machine_sections,
    own_fields,
    sections,
    selector,
)
from steadyslip.files.specifications.tables import TableReader
from steadyslip.files.specifications.toml import Table
from steadyslip.machine.ends import unknown_ends
from steadyslip.machine.holding import AS_MEASURED, as_measured
from steadyslip.machine.joining import joined
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.servo import MachineDrive, wrong_control
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

RIGID = 1e300  # N/m: placeholder for "rigid", above all real stiffnesses; the link is then eliminated
LIKE = 0.6  # least similarity of a misspelt table name to the name that is meant, as of body and bodies


def _rigid(links: Any) -> tuple[Any, list[str]]:
    """Tables of links with `RIGID` where the stiffness is ``rigid``, and the names of the rigid links."""
    if not isinstance(links, dict):
        return links, []
    names = [name for name, one in links.items() if isinstance(one, dict) and one.get("stiffness") == "rigid"]
    return links | {name: links[name] | {"stiffness": RIGID} for name in names}, names


def _joined(first: Table, second: Table) -> Table:
    """Two tables merged recursively; where both have a value, that of the first is taken."""
    both = {key: _joined(first[key], one) for key, one in second.items() if isinstance(first.get(key), dict)}
    return {**second, **first, **both}


def _is_quantity(value: Any, unit: str) -> bool:
    """True if the value is a text with a number and a unit that has the dimension of `unit`."""
    try:
        return isinstance(value, str) and math.isfinite(parse(value, unit))
    except QuantityError:
        return False


class RigTableReader(TableReader):
    """Reader of one file's tables."""

    def __init__(self, tables: Table) -> None:
        super().__init__()
        self.tables = tables

    def rig(self, further: Mapping[str, Section]) -> Slider | Machine | None:
        others = {PROTOCOL.name, *READ_ELSEWHERE, UNKNOWN, *TOLERANCES, *further}
        for name in list(self.tables):
            self._misspelt(name, others)
        if self._is_of_both():
            return None
        self.sections = (*self._own_sections(), *further.values())
        known = others.union(section.name for section in self.sections)
        for name in self.tables:
            if name not in known:
                self.problem(name, unknown_name("table", name, sorted(known), taken=self.tables))
        return self._machine() if is_machine(self.tables) else self._slider()

    def _is_of_both(self) -> bool:
        """True if tables of a rig of one body are mixed with those of a machine, which is reported as a problem."""
        single = {section.name for section in sections()} - {section.name for section in machine_sections()}
        both = [name for name in self.tables if name in single]
        if not (both and is_machine(self.tables)):
            return False
        machine = next(one.name for one in machine_sections() if one.keyed and one.name in self.tables)
        self.problem(
            both[0],
            f"got the tables {enumerated(both)} of a rig of one body and contact beside [{machine}] of a machine; in a "
            "machine write each body in [bodies.NAME], each contact with its friction and contact in [contacts.NAME], "
            "[contacts.NAME.friction], [contacts.NAME.contact]",
        )
        return True

    def _own_sections(self) -> tuple[Section, ...]:
        return machine_sections() if is_machine(self.tables) else sections()

    def _misspelt(self, name: str, others: set[str]) -> None:
        """Report a table with a misspelt name, and read it under the right name, which avoids further problems."""
        table, own = self.tables[name], {section.name for section in self._own_sections()}
        if not isinstance(table, dict):
            return
        keyed = {section.name for section in machine_sections() if section.keyed}
        if name in keyed and "friction" in self.tables and not any(isinstance(one, dict) for one in table.values()):
            own, keyed = {section.name for section in sections()}, set()  # a slider's table with its name in the plural
        meant = next(iter(get_close_matches(name, own | keyed, n=1, cutoff=LIKE)), None)
        if name in own | others or meant is None:
            return
        if meant in self.tables and meant not in keyed:
            return
        self.problem(name, unknown_name("table", name, sorted(own | others | {meant})))
        rest = {key: one for key, one in self.tables.items() if key != name}
        self.tables = _joined(rest, {meant: table})

    def _machine(self) -> Machine | None:
        """Read a machine; references to missing bodies and links are reported even if other tables are invalid."""
        before = len(self.problems)
        found: dict[str, Any] = {}
        rigid: list[str] = []
        for section in machine_sections():
            if section.name not in self.tables and section.name != "links":
                name = f"{section.name}.NAME" if section.keyed else section.name
                self.problem(section.name, f"missing table; write [{name}] with its parameters")
            elif section.keyed:
                raw = self.tables.get(section.name, {})
                if section.name == "links":
                    raw, rigid = _rigid(raw)
                found[section.name] = self.members(Part(section.family, "", keyed=True), raw, section.name)
            else:
                found[section.name] = self._drive(self._table(section.name), found.get("bodies"))
        if len(self.problems) == before:
            machine = cast("Machine | None", self._built(Machine, found, ""))
            try:
                return None if machine is None else joined(machine, *rigid)
            except NotAvailable as error:
                self.problem("links", str(error))
                return None
        self.problems += list(unknown_ends(self.tables))
        return None

    def _drive(self, table: Table, bodies: Mapping[str, Any] | None) -> FrozenRecord | None:
        """Read the drive of a machine, its velocity in the unit of the body named by ``velocity_of``."""
        key, default = MachineDrive.chosen_by
        named = (table.get(key) for key in ("body", "velocity_of"))
        driven, feed = (bodies.get(name) if bodies and isinstance(name, str) else None for name in named)
        kinds: Mapping[str, Any] = MachineDrive.registry
        if key not in table and default is not None:
            able = [name for name, law in kinds.items() if driven is None or law.turns == driven.turns]
            if meant := self._left_unnamed(MachineDrive, default, table, "drive.", able):
                table = table | {key: meant}
        control = str(table.get(key, default))
        law = kinds.get(control)
        if driven is not None and law is not None and driven.turns != law.turns:
            self.problems.append(wrong_control(control, table["body"], driven.turns))
            return None
        table = self._as_measured(table, law, bodies or {})
        given = table.get("velocity")
        if feed is not None and given is not None:
            role = Parameter("rad/s" if feed.turns else "m/s", speed, f"velocity of {table['velocity_of']!r}")
            value = self._value(role, given, "drive.velocity")
            table = table | {"velocity": 1.0 if value is None else value}
        elif law is not None and _is_quantity(given, "m/s" if law.turns else "rad/s"):
            table = table | {"velocity": 1.0}
            if "velocity_of" in table:  # the body is unknown, which `record` reports
                return self.record(MachineDrive, table, "drive.")
            where = table.get("body", "the load point")
            does = "turns" if law.turns else "slides"
            others = [name for name, one in (bodies or {}).items() if one.turns != law.turns]
            hint = f"; for that of another body write velocity_of = {json.dumps(others[0])}" if others else ""
            self.problem("drive.velocity", f"got {given!r}, but {where!r} {does}{hint}")
        return self.record(MachineDrive, table, "drive.")

    def _as_measured(self, table: Table, law: Any, bodies: Mapping[str, Any]) -> Table:
        """Copy of the drive's table in which quantities of the measured body are numbers, read in that body's unit.

        If both drive and measured body turn, or neither, their units agree and the table itself is returned.
        """
        measured = bodies.get(named) if isinstance(named := table.get("measured"), str) else None
        if law is None or measured is None or measured.turns == law.turns:
            return table
        read = {}
        for item, role in own_fields(law):
            if f"drive.{item.name}" in AS_MEASURED and table.get(item.name) is not None and isinstance(role, Parameter):
                value = self._value(as_measured(role, measured.turns), table[item.name], f"drive.{item.name}")
                read[item.name] = 1.0 if value is None else value
        return table | read

    def _slider(self) -> Slider | None:
        before = len(self.problems)
        own = self._table("slider")
        self._read_area(own)
        parts = {s.name: self._section(s) for s in sections() if s.family is not Slider}
        arguments = self._arguments(Slider, own, "slider.")
        if len(self.problems) > before or any(part is None for part in parts.values()):
            return None
        return self._built(Slider, {**arguments, **parts}, "slider.")  # type: ignore[return-value]

    def protocol(self, rig: Rig | None = None) -> Protocol | None:
        """Read the protocol (None if there is none); to be called after `rig`, as the rig's area is needed."""
        if PROTOCOL.name not in self.tables:
            return None
        before = len(self.problems)
        table = self._table(PROTOCOL.name)
        if len(self.problems) > before:
            return None
        with self.of_rig(rig):
            return self._complete(Protocol, table, f"{PROTOCOL.name}.")  # type: ignore[return-value]

    def settings(self, section: Section) -> FrozenRecord | None:
        """Read an additional table; its quantities keep their declared units, whatever the rig's area."""
        table = self.tables.get(section.name)
        if not isinstance(table, dict):
            wanted = f"[{section.name}] {section.hint}" if section.hint else f"a table [{section.name}]"
            if table is not None:
                self.problem(section.name, f"got {repr_short(table)}; allowed: {wanted}")
            elif section.required:
                self.problem(section.name, f"missing table; write {wanted}")
            return None
        area, self.area = self.area, None
        found = self._complete(section.family, table, f"{section.name}.")
        self.area = area
        return found

    def _table(self, name: str) -> Table:
        table = self.tables.get(name, {})
        if isinstance(table, dict):
            return table
        self.problem(name, f"got {repr_short(table)}; allowed: a table [{name}]")
        return {}

    def _read_area(self, own: Table) -> None:
        raw = own.get("area")
        if raw is not None:
            try:
                self.area = Parameter("m^2", positive, "contact area").checked(raw)
            except ParameterError:
                self.area = 1.0  # a wrong area is reported later; until then any area allows totals

    def _section(self, section: Section) -> FrozenRecord | None:
        key, default = selector(section.family)
        if section.name not in self.tables:
            example = f"{key} = {next(iter(section.family.registry))!r}" if default is None else "velocity = '1 um/s'"
            self.problem(section.name, f"missing table; write [{section.name}] with {example} and its parameters")
            return None
        return self.record(section.family, self._table(section.name), f"{section.name}.")
