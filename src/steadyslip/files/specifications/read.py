"""Reading of rigs, protocols and further tables from TOML text; all problems are reported together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import cast

from steadyslip.core.errors import (
    InternalError,
    NotAvailable,
    Problem,
    RigFileError,
    repr_short,
)
from steadyslip.core.options import checked
from steadyslip.core.quantities import result_units, units_in, units_named
from steadyslip.core.records import FrozenRecord
from steadyslip.core.tolerances import Tolerance
from steadyslip.files.inputs import MOST_TEXT, UnreadableFile, read_bytes
from steadyslip.files.specifications.bare_numbers import warn_of_values
from steadyslip.files.specifications.changes import apply, full_name, split
from steadyslip.files.specifications.deviations import taken_out, wrong_ends
from steadyslip.files.specifications.layout import (
    PROTOCOL,
    READ_ELSEWHERE,
    UNITS_LINE,
    Section,
    machine_sections,
    sections,
)
from steadyslip.files.specifications.rig_tables import RigTableReader
from steadyslip.files.specifications.toml import NotToml, Table, key_lines, line_of, tables_of
from steadyslip.files.structures.named_files import with_structures
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

CHANGES = "changes (--set)"  # title of the list of errors in changes, in place of a file's name


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
        A machine if the file has tables of bodies, links or contacts.

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
    """Contents of a rig file, with the problems found; raises RigFileError only if the file cannot be read as TOML."""
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
    """Read a slider from TOML text; raises NotAvailable if the text describes a machine."""
    return read_contents(_not_empty(text, source), source, changes).checked_slider()


def protocol_of(text: str, source: str, changes: Iterable[str]) -> Protocol | None:
    """Protocol of a TOML text, which may omit the tables of a rig; None if the text has no protocol."""
    found = read_contents(_not_empty(text, source), source, changes, rig_needed=False)
    found.refuse()
    return found.protocol


@dataclass(frozen=True)
class RigFileContents:
    """Valid contents of a rig file, and the problems found in the rest.

    Attributes
    ----------
    rig : Slider, Machine or None
        None if absent or invalid.
    protocol : Protocol or None
    further : dict of str to FrozenRecord
        Records of the additional tables requested; of an invalid table, its valid part.
    problems : list of Problem
    changed : set of str
        Names of the values replaced by changes, as given and in full.
    tables : dict
        Parsed tables, with the changes.
    tolerances : dict of str to Tolerance
        Tolerances written in values, by dotted name.
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
        """Line number (from 1) of a key, or of the table around it; None if not found."""
        return line_of(name, self.lines)

    def refuse(self, *others: Problem) -> None:
        """Raise RigFileError, with all problems and their lines, if there are any in the file or in `others`."""
        if self.problems or others:
            every = list(dict.fromkeys([*self.problems, *others]))
            if all(map(self._is_of_change, every)):
                raise RigFileError(every, title=CHANGES)
            found = [Problem(p.name, f"{p.message} (of the {CHANGES})") if self._is_of_change(p) else
                     Problem(p.name, p.message, p.line or self.line(p.name)) for p in every]  # fmt: skip
            raise RigFileError(sorted(found, key=lambda p: (p.line is None, p.line or 0)), title=self.source)

    def _is_of_change(self, problem: Problem) -> bool:
        """True if a change caused the problem: by its value, or by a name that is not in the file."""
        name, line = problem.name, problem.line or self.line(problem.name)
        below = any(f"{name}.".startswith(f"{one.removesuffix('.law')}.") for one in self.changed)
        missing = line is None and any(one.startswith(f"{name}.") for one in self.changed)
        return problem.line is None and (missing or (below and name not in self.lines))

    def refuse_machine(self) -> None:
        """Raise NotAvailable if the file describes a machine."""
        if isinstance(self.rig, Machine):
            raise NotAvailable("the file describes a machine; allowed: a slider, one block on one surface")

    def checked_rig(self, *others: Problem) -> Slider | Machine:
        """Rig of the file, if it has no problems.

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
        """Slider of the file, if it has no problems; raises NotAvailable if the file describes a machine."""
        self.refuse_machine()
        return cast(Slider, self.checked_rig(*others))


def read_contents(
    text: str, source: str, changes: Iterable[str] = (), further: Sequence[Section] = (),
    complete: Callable[[Table], None] | None = None, rig_needed: bool = True,
) -> RigFileContents:  # fmt: skip
    """Read a TOML text with changes applied; problems are collected, except text that is not TOML.

    Parameters
    ----------
    text, source : str
    changes : iterable of str
        ``NAME=VALUE``.
    further : sequence of Section
        Tables to read besides those of rig and protocol.
    complete : callable, optional
        Function that fills in values which tables may omit; called before the changes of the rig, which may name
        these values, and again after them.
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
    if found.rig is not None and rest and first.startswith(UNITS_LINE):
        names = [one.split(" = ") for one in first.removeprefix(UNITS_LINE).split("; ") if one]
        found.rig.set_display_units(sorted(units_in([f"1 {own}" for own, *of in names if not of])))
        own = {name: f"1 {one[0]}" for name, *one in names if one}
        known = found.rig.parameters()
        found.rig.set_parameter_units(units_named({name: one for name, one in own.items() if name in known}))
    return found


def read_tables(
    tables: Table, lines: dict[str, int], source: str, changes: Iterable[str] = (), further: Sequence[Section] = (),
    complete: Callable[[Table], None] | None = None, rig_needed: bool = True,
) -> RigFileContents:  # fmt: skip
    """Read parsed tables; `lines` are the line numbers of their keys. See `read_contents`."""
    reader = RigTableReader(tables)
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
    if complete is not None and changed:  # a changed law may need other values
        complete(tables)
    tolerances, faults = taken_out(tables)
    reader.tables = with_structures(tables, source)
    rig = None if not rig_needed and set(tables) == {PROTOCOL.name} else reader.rig(names)
    protocol = reader.protocol(rig)
    found = {section.name: reader.settings(section) for section in further}
    valid = {name: one for name, one in found.items() if one is not None}
    if rig is not None:
        rig.set_display_units(sorted(result_units(tables))).named(Path(source).name if source.endswith(".toml") else "")
        rig.set_parameter_units(units_named({name: raw for name, (raw, _) in reader.values_read.items()}))
        faults += wrong_ends(rig, tolerances)
        if rig.written_in:  # files without any unit are written by programs, in SI units
            warn_of_values(rig, reader.values_read, units_in(tables))
    wrong = {one.name for one in faults}  # these are reported once, as problems of tolerances
    problems = [*faults, *(one for one in reader.problems if one.name not in wrong)]
    return RigFileContents(source, rig, protocol, valid, problems, changed, lines, tables, tolerances)


def _not_empty(text: str, source: str) -> str:
    text = text.removeprefix("\ufeff")
    if not text.strip():
        names = ", ".join(f"[{section.name}]" for section in sections())
        others = ", ".join(f"[{one.name}.NAME]" if one.keyed else f"[{one.name}]" for one in machine_sections())
        raise _failed(source, f"is empty; a rig file has the tables {names}, one of a machine {others}")
    return text


def _failed(name: str, message: str) -> RigFileError:
    return RigFileError([Problem(name, message)])
