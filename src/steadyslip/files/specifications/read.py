"""Reading of rigs, protocols and further tables from TOML text; all problems are reported together."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any, cast

from steadyslip.core.domains import positive, speed
from steadyslip.core.errors import (
    InternalError,
    NotAvailable,
    ParameterError,
    Problem,
    QuantityError,
    RigFileError,
    repr_short,
    unknown_name,
)
from steadyslip.core.format import enumerated
from steadyslip.core.options import checked
from steadyslip.core.quantities import parse, units_in, units_named, units_told
from steadyslip.core.records import FrozenRecord, Part
from steadyslip.core.roles import Parameter
from steadyslip.core.tolerances import Tolerance
from steadyslip.files.inputs import MOST_TEXT, UnreadableFile, read_bytes
from steadyslip.files.specifications.bare_numbers import question_values
from steadyslip.files.specifications.changes import apply, full_name, split
from steadyslip.files.specifications.deviations import SCHEMA as TOLERANCES, taken_out, wrong_ends
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    READ_ELSEWHERE,
    TOLD_IN,
    UNKNOWN,
    Section,
    is_machine,
    machine_sections,
    own_fields,
    sections,
    selector,
)
from steadyslip.files.specifications.tables import TableReader
from steadyslip.files.specifications.toml import NotToml, Table, key_lines, line_of, tables_of
from steadyslip.files.structures.named_files import with_structures
from steadyslip.machine.ends import unknown_ends
from steadyslip.machine.holding import AS_MEASURED, as_measured
from steadyslip.machine.joining import joined
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.servo import MachineDrive, wrong_control
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

CHANGES = "changes (--set)"  # where faults of what they give are, in place of a file
RIGID = 1e300  # N/m: read in place of "rigid", larger than any that is typed; the link is taken out of the machine
LIKE = 0.6  # likeness of a misspelt table's name to the one that is meant: body and bodies


@checked()
def read_rig(path: str | PathLike[str], changes: Iterable[str] = ()) -> Slider | Machine:
    """Read a rig file.

    Parameters
    ----------
    path : path
        TOML file, UTF-8.
    changes : iterable of str
        Values that replace or add to those of the file, as ``"contact.angle=10 deg"``.

    Returns
    -------
    Slider or Machine
        A machine where the file has tables of bodies, links or contacts.

    Raises
    ------
    RigFileError
        If the file cannot be read or anything in it is wrong; ``problems`` lists everything.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=20 GPa/m"])
    >>> rig.stiffness
    20000000000.0
    """
    return rig_from_text(text_of(path), str(path), changes)


def read_whole(path: str | PathLike[str], changes: Iterable[str] = ()) -> RigFileContents:
    """Contents of a rig file, with its problems."""
    return read_contents(_not_empty(text_of(path), str(path)), str(path), changes)


@checked()
def read_slider(path: str | PathLike[str], changes: Iterable[str] = ()) -> Slider:
    """Read a rig file that must describe a slider; see `read_rig`.

    Raises
    ------
    NotAvailable
        If the file describes a machine.
    """
    return slider_from_text(text_of(path), str(path), changes)


def text_of(path: str | PathLike[str]) -> str:
    """Text of a rig file."""
    name = str(path)
    try:
        return read_bytes(path, MOST_TEXT).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _failed(name, "is not UTF-8 text; a rig file is plain text in TOML") from error
    except UnreadableFile as error:
        raise _failed(name, error.reason) from error


@checked()
def rig_from_text(text: str, source: str = "rig", changes: Iterable[str] = ()) -> Slider | Machine:
    """Read a rig from TOML text; see `read_rig`.

    Examples
    --------
    >>> from pathlib import Path
    >>> rig = ss.rig_from_text(Path("examples/inclined-spring.toml").read_text())
    >>> rig.stiffness
    9000000000.0
    """
    found = read_contents(_not_empty(text, source), source, changes)
    found.refuse()
    return found.checked_rig()


def slider_from_text(text: str, source: str = "rig", changes: Iterable[str] = ()) -> Slider:
    """Read a slider from TOML text; NotAvailable for a machine."""
    return read_contents(_not_empty(text, source), source, changes).checked_slider()


def protocol_of(text: str, source: str, changes: Iterable[str]) -> Protocol | None:
    """Read the protocol of a TOML text, which may omit the tables of a rig."""
    found = read_contents(_not_empty(text, source), source, changes, rig_needed=False)
    found.refuse()
    return found.protocol


@dataclass(frozen=True)
class RigFileContents:
    """Contents of a rig file as far as valid, with the problems found in the others.

    Attributes
    ----------
    rig : Slider, Machine or None
        None if absent or faulty.
    protocol : Protocol or None
    further : dict of str to FrozenRecord
        Records of the declared further tables; of a faulty table, its valid part.
    problems : list of Problem
    changed : set of str
        Names of the values that changes replaced, as given and in full.
    tables : dict
        As parsed, with the changes.
    tolerances : dict of str to Tolerance
        Those written beside values, by the keys that lead to them.
    """

    source: str
    rig: Slider | Machine | None
    protocol: Protocol | None
    further: dict[str, FrozenRecord]
    problems: list[Problem]
    changed: set[str]
    lines: dict[str, int] = field(repr=False)
    tables: Table = field(repr=False)
    tolerances: dict[str, Tolerance] = field(repr=False)

    def line(self, name: str) -> int | None:
        """Line of a key, or of the table around it."""
        return line_of(name, self.lines)

    def refuse(self, *others: Problem) -> None:
        """Raise an error with all problems of the file and `others`, each with its line, or the change that made it;
        does nothing without problems.
        """
        if self.problems or others:
            every = list(dict.fromkeys([*self.problems, *others]))
            if all(map(self._is_of_change, every)):
                raise RigFileError(every, title=CHANGES)
            found = [Problem(p.name, f"{p.message} (of the {CHANGES})") if self._is_of_change(p) else
                     Problem(p.name, p.message, p.line or self.line(p.name)) for p in every]  # fmt: skip
            raise RigFileError(sorted(found, key=lambda p: (p.line is None, p.line or 0)), title=self.source)

    def _is_of_change(self, problem: Problem) -> bool:
        """True for a problem with what a change gives, or with what it names, which is not in the file."""
        name, line = problem.name, problem.line or self.line(problem.name)
        below = any(f"{name}.".startswith(f"{one.removesuffix('.law')}.") for one in self.changed)
        missing = line is None and any(one.startswith(f"{name}.") for one in self.changed)
        return problem.line is None and (missing or (below and name not in self.lines))

    def refuse_machine(self) -> None:
        """Raise an error if the file describes a machine."""
        if isinstance(self.rig, Machine):
            raise NotAvailable("the file describes a machine; allowed: a slider, one block on one surface")

    def checked_rig(self, *others: Problem) -> Slider | Machine:
        """The rig of a file without problems.

        Raises
        ------
        RigFileError
            With all problems of the file.
        """
        self.refuse(*others)
        if self.rig is None:
            raise InternalError("a rig in a file without problems")
        return self.rig

    def checked_slider(self, *others: Problem) -> Slider:
        """The slider of a file without problems; also NotAvailable if the file describes a machine."""
        self.refuse_machine()
        return cast(Slider, self.checked_rig(*others))


def read_contents(
    text: str, source: str, changes: Iterable[str] = (), further: Sequence[Section] = (),
    complete: Callable[[Table], None] | None = None, rig_needed: bool = True,
) -> RigFileContents:  # fmt: skip
    """Read a TOML text after making changes; problems are collected, except that it is not TOML.

    Parameters
    ----------
    text, source : str
    changes : iterable of str
        ``NAME=VALUE``.
    further : sequence of Section
        Tables besides those of rig and protocol, with the records that declare them.
    complete : callable, optional
        Function that fills in values which tables may omit; called before changes of the rig, which may name what it
        filled in, and again after them.
    rig_needed : bool
        False if a text with only the protocol's table is valid.

    Raises
    ------
    RigFileError
        If the text is not TOML.
    """
    try:
        tables = tables_of(text)
    except NotToml as error:
        raise _failed(source, f"is not TOML: {error}") from error
    found = read_tables(tables, key_lines(text), source, changes, further, complete, rig_needed)
    first, _, rest = text.partition("\n")
    if found.rig is not None and rest and first.startswith(TOLD_IN):
        names = [one.split(" = ") for one in first.removeprefix(TOLD_IN).split("; ") if one]
        found.rig.told_in(sorted(units_in([f"1 {own}" for own, *of in names if not of])))
        own = {name: f"1 {one[0]}" for name, *one in names if one}
        found.rig.told_by(units_named({name: one for name, one in own.items() if name in found.rig.parameters()}))
    return found


def read_tables(
    tables: Table, lines: dict[str, int], source: str, changes: Iterable[str] = (), further: Sequence[Section] = (),
    complete: Callable[[Table], None] | None = None, rig_needed: bool = True,
) -> RigFileContents:  # fmt: skip
    """Read parsed tables; `lines` are the line numbers of their keys. See `read_contents`."""
    reader = _ContentsReader(tables)
    names = {section.name: section for section in further}
    every = [changes] if isinstance(changes, str) else list(changes)
    apart = {*names, *READ_ELSEWHERE}
    own = {change: first for change in every if (first := split(change)[0].partition(".")[0]) in apart}
    changed = {name for change in every for name in (split(change)[0], repr_short(change))}
    for change, first in own.items():
        if first in names:
            reader.problems += apply(change, tables, lines, names[first])
        else:
            reads = READ_ELSEWHERE[first]
            reader.problem(split(change)[0], f"has no effect here: the table [{first}] is read by what {reads}")
    if complete is not None:
        complete(tables)
    for change in [change for change in every if change not in own]:
        changed.add(full_name(split(change)[0], tables)[0])
        reader.problems += apply(change, tables, lines)
    if complete is not None and changed:  # laws that were changed have parameters of their own
        complete(tables)
    tolerances, faults = taken_out(tables)
    reader.tables = with_structures(tables, source)
    rig = None if not rig_needed and set(tables) == {PROTOCOL.name} else reader.rig(names)
    protocol = reader.protocol(rig)
    found = {section.name: reader.settings(section) for section in further}
    said = {name: one for name, one in found.items() if one is not None}
    if rig is not None:
        rig.told_in(sorted(units_told(tables))).named(Path(source).name if source.endswith(".toml") else "")
        rig.told_by(units_named({name: raw for name, (raw, _) in reader.questioned.items()}))
        faults += wrong_ends(rig, tolerances)
        if rig.written_in:  # numbers alone are SI units, as programs write them
            question_values(rig, reader.questioned, units_in(tables))
    wrong = {one.name for one in faults}  # told once, as a tolerance
    problems = [*faults, *(one for one in reader.problems if one.name not in wrong)]
    return RigFileContents(source, rig, protocol, said, problems, changed, lines, tables, tolerances)


def _not_empty(text: str, source: str) -> str:
    text = text.removeprefix("\ufeff")
    if not text.strip():
        names = ", ".join(f"[{section.name}]" for section in sections())
        others = ", ".join(f"[{one.name}.NAME]" if one.keyed else f"[{one.name}]" for one in machine_sections())
        raise _failed(source, f"is empty; a rig file has the tables {names}, one of a machine {others}")
    return text


def _failed(name: str, message: str) -> RigFileError:
    return RigFileError([Problem(name, message)])


def _rigid(links: Any) -> tuple[Any, list[str]]:
    """Tables of links with a placeholder number where the stiffness is ``rigid``, and the names of those links."""
    if not isinstance(links, dict):
        return links, []
    names = [name for name, one in links.items() if isinstance(one, dict) and one.get("stiffness") == "rigid"]
    return links | {name: links[name] | {"stiffness": RIGID} for name in names}, names


def _joined(first: Table, second: Table) -> Table:
    """Both tables in one, and of the values that both have the first's."""
    both = {key: _joined(first[key], one) for key, one in second.items() if isinstance(first.get(key), dict)}
    return {**second, **first, **both}


def _is_quantity(value: Any, unit: str) -> bool:
    """True for text with a number and a unit of the dimension of `unit`."""
    try:
        return isinstance(value, str) and math.isfinite(parse(value, unit))
    except QuantityError:
        return False


class _ContentsReader(TableReader):
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
        """Report tables of a rig of one body beside those of a machine, as nothing else follows from them."""
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
        """Report a table nearly named as one of a rig's, and read it as that one, as nothing else follows from it."""
        table, own = self.tables[name], {section.name for section in self._own_sections()}
        if not isinstance(table, dict):
            return
        keyed = {section.name for section in machine_sections() if section.keyed}
        if name in keyed and "friction" in self.tables and not any(isinstance(one, dict) for one in table.values()):
            own, keyed = {section.name for section in sections()}, set()  # of a slider, in the plural
        meant = next(iter(get_close_matches(name, own | keyed, n=1, cutoff=LIKE)), None)
        if name in own | others or meant is None:
            return
        if meant in self.tables and meant not in keyed:
            return
        self.problem(name, unknown_name("table", name, sorted(own | others | {meant})))
        rest = {key: one for key, one in self.tables.items() if key != name}
        self.tables = _joined(rest, {meant: table})

    def _machine(self) -> Machine | None:
        """Read a machine; if tables are faulty, references of the others to absent bodies and links are still
        reported.
        """
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
            if "velocity_of" in table:  # a name of no body, which is reported as such
                return self.record(MachineDrive, table, "drive.")
            where = table.get("body", "the load point")
            does = "turns" if law.turns else "slides"
            others = [name for name, one in (bodies or {}).items() if one.turns != law.turns]
            hint = f"; for that of another body write velocity_of = {json.dumps(others[0])}" if others else ""
            self.problem("drive.velocity", f"got {given!r}, but {where!r} {does}{hint}")
        return self.record(MachineDrive, table, "drive.")

    def _as_measured(self, table: Table, law: Any, bodies: Mapping[str, Any]) -> Table:
        """Table of a drive in which what is of the measured body is read in its unit, if that is not the drive's."""
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
        """Read the protocol, None if absent; after the rig, whose area it needs."""
        if PROTOCOL.name not in self.tables:
            return None
        before = len(self.problems)
        table = self._table(PROTOCOL.name)
        if len(self.problems) > before:
            return None
        with self.of_rig(rig):
            return self._complete(Protocol, table, f"{PROTOCOL.name}.")  # type: ignore[return-value]

    def settings(self, section: Section) -> FrozenRecord | None:
        """Read a further table; its quantities keep their declared units, whatever the rig's area."""
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
                self.area = 1.0  # the area itself is reported with the slider's other keys; totals beside it are valid

    def _section(self, section: Section) -> FrozenRecord | None:
        key, default = selector(section.family)
        if section.name not in self.tables:
            example = f"{key} = {next(iter(section.family.registry))!r}" if default is None else "velocity = '1 um/s'"
            self.problem(section.name, f"missing table; write [{section.name}] with {example} and its parameters")
            return None
        return self.record(section.family, self._table(section.name), f"{section.name}.")
