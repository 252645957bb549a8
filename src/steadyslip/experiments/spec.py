"""Fit files: rig files in which fitted values may be missing, with further tables on records, fit and population."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from itertools import product
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError, keywords_of, refuse_unknown
from steadyslip.core.names import resolve
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.records import FrozenRecord, Part, given, role_of
from steadyslip.core.roles import Parameter, Placeholder
from steadyslip.experiments.answers.laws import LawComparison, compare_laws
from steadyslip.experiments.fitting.fit import fit
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.settings import MOST_STATES, FitSettings, PopulationSettings
from steadyslip.experiments.machine_spec import MachineSpec, machine_spec
from steadyslip.experiments.measured.read import checked_option, read_record
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.measured.settings import RecordSettings
from steadyslip.files.specifications.layout import Section
from steadyslip.files.specifications.read import RigFileContents, read_contents, read_tables, text_of
from steadyslip.files.specifications.toml import Table
from steadyslip.laws import contact as contact_laws, friction as friction_laws
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.drive import Drive
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.sliding import steady_state
from steadyslip.protocol import Protocol

TABLES = (
    Section("record", RecordSettings), Section("fit", FitSettings), Section("population", PopulationSettings)
)  # fmt: skip
"""Tables of a fit file in addition to those of a rig file."""


@dataclass(frozen=True)
class Spec(Displayed):
    """Contents of a fit file: how to read records, and what to fit to them.

    Attributes
    ----------
    rig : Slider
    protocol : Protocol or None
    record : RecordSettings
        Format of the records.
    options : dict
        Arguments of `fit`.
    laws : tuple of str
        Labels of laws to compare; empty unless the file lists some.
    undecided : tuple of str
        Labels of laws to compare if the normal stress changes in a record and the file names no memory of normal
        stress: every memory, with the evolution law that the file names, or else with both slip and aging law.
    windows : bool
        True if every step of a record is fitted as a separate record.
    v_ref_given : bool
        True if the file gives the velocity at which mu_ref holds; otherwise it is the velocity at the start of the
        first record.
    contact_given : bool
        True if the file has a table ``[contact]`` with a value.
    population : PopulationSettings or None
        Settings of a population, if every record is a separate experiment.
    """

    rig: Slider
    protocol: Protocol | None = None
    record: RecordSettings = field(default_factory=RecordSettings)
    options: dict[str, Any] = field(default_factory=dict)
    laws: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    windows: bool = False
    v_ref_given: bool = False
    contact_given: bool = True
    population: PopulationSettings | None = None

    def read(self, path: str | PathLike[str], skip_bad_lines: bool = False) -> Record:
        """Record of an experiment, read from a file with the settings of the fit file."""
        options = self.record.arguments()
        decimate = options.pop("decimate", None)
        options["skip_bad_lines"] = skip_bad_lines or options.get("skip_bad_lines", False)
        record = read_record(path, **options)
        return record if decimate is None else record.decimated(decimate)

    def fit(self, records: Sequence[Record], **changes: Any) -> Fit:
        """Fit to records with the settings of the file; `changes`, as for `steadyslip.fit`, replace some of them."""
        rig, parts = self._rig_and_records(records)
        refuse_unknown("Spec.fit", changes, keywords_of(fit, ["rig", "records"]))
        found: Fit = fit(rig, parts, **(self._options(rig) | {"protocol": self.protocol} | changes))
        return found

    def compared(self, records: Sequence[Record]) -> tuple[str, ...]:
        """Labels of the laws to compare: `laws` or, if it is empty and the normal stress changes, `undecided`."""
        imposed = self.rig.contact.is_imposed() or self.rig.contact.has_pores()
        decides = imposed and any(record.stress_changes for record in records)
        return self.laws or (self.undecided if decides else ())

    def compare(self, records: Sequence[Record], **changes: Any) -> LawComparison:
        """Comparison of fits of all laws in `compared`; `changes`, as for `steadyslip.fit`, replace settings."""
        refuse_unknown("Spec.compare", changes, keywords_of(fit, ["rig", "records"]))
        rig, parts = self._rig_and_records(records)
        options = self._options(rig) | {"protocol": self.protocol} | changes
        return compare_laws(rig, parts, self.compared(records), **options)

    def _options(self, rig: Slider) -> dict[str, Any]:
        """Arguments of `fit`; if the contact was given pores because of the records, the drainage rate is free too."""
        further = [name for name in rig.of_kind("drainage") if name not in self.rig.parameters()]
        if "free" not in self.options or not further:
            return self.options
        return self.options | {"free": [*self.options["free"], *further]}

    def _rig_and_records(self, records: Sequence[Record]) -> tuple[Slider, tuple[Record, ...]]:
        parts = tuple(w for r in records for w in (r.windows() if self.windows else (r,)))
        pressed = [record.normal is not None for record in parts]
        if not (self.contact_given or all(pressed)):
            message = (
                f"{parts[pressed.index(False)].source} has no column for it; name a column, or write "
                "normal_stress = '20 MPa' in [record], or a table [contact]"
            )
            raise ParameterError([Problem("normal", message)])
        rig = self.referred_to(parts[0]).rig
        if any(record.pressure_changes for record in parts) and not self.contact_given:
            rig = with_pores(rig)
        return rig, parts

    def referred_to(self, record: Record) -> Spec:
        """Copy whose reference velocity of mu_ref is a record's initial velocity, unless the file gives a velocity."""
        references = [name for name in self.rig.of_kind("reference rate") if name.startswith("friction.")]
        if self.v_ref_given or not references:
            return self
        rate = record.initial_rate
        slow = self.rig.drive.velocity if rate is None or not rate > 0 else rate
        return replace(self, rig=self.rig.with_values(dict.fromkeys(references, slow)), v_ref_given=True)


@checked()
def read_spec(path: str | PathLike[str], changes: Iterable[str] = ()) -> Spec | MachineSpec:
    """Read a fit file.

    A fit file is a rig file in which fitted values may be missing (a, b, d_c, α, mu_ref, stiffness), and also values
    that the records give (contact, drive, v_ref). The table ``[record]`` describes the records, ``[fit]`` the fit. The
    fit file of a machine must have all values, and ``[fit] free`` names the fitted parameters.

    Parameters
    ----------
    path : path
    changes : iterable of str
        Values that replace or complete those of the file, such as ``"fit.trend=2"``.

    Raises
    ------
    RigFileError
        If the file has faults; lists all of them.

    Examples
    --------
    >>> ss.experiments.read_spec("examples/fits/basalt.toml").rig.stiffness
    10000000000.0
    """
    return spec_from_text(text_of(path), str(path), changes)


def spec_from_text(text: str, source: str = "spec", changes: Iterable[str] = ()) -> Spec | MachineSpec:
    """Read the text of a fit file; see `read_spec`."""
    filled = _Placeholders()
    found = read_contents(text, source, changes, TABLES, filled.complete)
    return machine_spec(found) if filled.of_machine else _spec(found, filled)


def _spec(found: RigFileContents, filled: _Placeholders) -> Spec:
    record, settings = found.further.get("record"), found.further.get("fit")
    settings = settings if isinstance(settings, FitSettings) else FitSettings()
    missing = filled.missing - found.changed
    left = [] if found.problems or found.rig is None else _values_missing(missing, settings, found.rig)
    if isinstance(record, RecordSettings):
        left += [Problem(f"record.{name}", "is for records of machines only; leave it out for a slider")
                 for name in ("columns", "averages") if name in given(record)]  # fmt: skip
    members = found.further.get("population")
    members = members if isinstance(members, PopulationSettings) else None
    if members is not None:
        left += members.faults()
        if settings.compare:
            left.append(Problem("fit.compare", "cannot be combined with [population]; fit one law"))
    rig = found.checked_slider(*filled.problems, *left)
    own = ("states", "compare", "windows")
    options = {n: list(v) if isinstance(v, tuple) else v for n, v in given(settings).items() if n not in own}
    if settings.free is None and missing:
        options["free"] = sorted(name for name in missing if name in rig.parameters())
        if known := [name for name in rig.of_kind("friction level") if name not in missing]:
            options["fixed"] = [*settings.fixed, *known]
    v_ref, contact = (filled.given(kind, found.changed) for kind in _Placeholders.FROM_RECORDS)
    undecided = _undecided(rig.friction, filled.friction)
    return Spec(
        rig, found.protocol, record if isinstance(record, RecordSettings) else RecordSettings(), options,
        settings.compare, undecided, settings.windows, v_ref, contact, members,
    )  # fmt: skip


def _undecided(law: FrictionLaw, said: set[str]) -> tuple[str, ...]:
    """Labels of laws to compare if the normal stress changes, for a file whose table `[friction]` has the keys `said`.

    The memory of normal stress cannot be found with the wrong evolution law; therefore both evolution laws are
    compared.
    """
    memories, others = (
        [words for name, words in choices.items() if name not in said]
        for choices in (law.decided_by_stress, law.decided_besides)
    )
    return tuple(map(", ".join, product(*others, *memories))) if memories else ()


@checked()
def lab_rig(
    evolution: str = "slip",
    *,
    states: int = 1,
    normal_memory: str = "none",
    pores: bool = False,
    stiffness: Any = None,
    v_ref: Any = "1 um/s",
    velocity: Any = None,
) -> Slider:
    """Rig for fits, with rate-and-state friction and constant normal stress; values to be fitted are placeholders.

    Parameters
    ----------
    evolution : str
        ``slip``, ``aging`` or ``prz``.
    states : int
    normal_memory : str
        ``none``, ``linker-dieterich`` or ``prakash-clifton``.
    pores : bool
        True for a contact with pores: a change of the pore pressure reaches them by drainage, whose rate is fitted. If
        false, a change acts at once.
    stiffness : float or str, optional
        Stiffness of the machine, Pa/m, if it is known; name it also in ``fixed`` of `fit`.
    v_ref : float or str
        Reference velocity, at which friction is mu_ref.
    velocity : float or str, optional
        Velocity of the load point before the first change of a protocol; by default the initial velocity of the
        records. `fit` needs it if the records have no displacement.

    Examples
    --------
    >>> rig = ss.lab_rig("aging", stiffness="50 GPa/m")
    >>> rig.friction.evolution, rig.stiffness
    (Aging(), 50000000000.0)
    """
    rate = checked_option("v_ref", "m/s", v_ref)
    friction = {"evolution": evolution, "v_ref": rate, "normal_memory": {"law": normal_memory}}
    filled = _Placeholders()
    count = int(states) if isinstance(states, np.integer) else states
    drive = {} if velocity is None else {"velocity": checked_option("velocity", "m/s", velocity)}
    tables = {"friction": friction, "fit": {"states": count}, "drive": drive}
    rig = _spec(read_tables(tables, {}, "lab_rig", further=TABLES, complete=filled.complete), filled).rig
    rig = with_pores(rig) if pores else rig
    return rig if stiffness is None else replace(rig, stiffness=checked_option("stiffness", "Pa/m", stiffness))


def with_pores(rig: Slider) -> Slider:
    """Rig with draining pores in its contact, without dilatancy; the drainage rate is a placeholder."""
    return replace(rig, contact=contact_laws.porous(steady_state(rig).normal_stress))


class _Placeholders:
    """Placeholders with which the tables of a fit file are completed, and names of the values that were missing.

    The laws declare which values may be missing, with their placeholders (`Parameter.standing`).

    Attributes
    ----------
    problems : list of Problem
    missing : set of str
        Names of missing parameters that are to be fitted.
    standing : dict of str to str
        Names of missing parameters whose values follow from the records, by kind (`FROM_RECORDS`).
    friction : set of str
        Keys that the file has in its table ``[friction]``.
    of_machine : bool
        True if the file describes a machine.
    """

    FROM_RECORDS = ("reference rate", "normal stress")

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.missing: set[str] = set()
        self.standing: dict[str, str] = {}
        self.friction: set[str] = set()
        self.of_machine = False

    def given(self, kind: str, changed: set[str]) -> bool:
        """True if the file, or a change to it, gives the parameter of this kind, which records would give otherwise."""
        return kind not in self.standing or self.standing[kind] in changed

    def complete(self, tables: Table) -> None:
        """Add placeholders to the tables of a slider; those of a machine must be complete."""
        self.of_machine = any(name in tables for name in ("bodies", "links", "contacts"))
        if self.of_machine:
            return
        wanted = tables.get("fit", {})
        states = wanted.get("states") if isinstance(wanted, dict) else None
        friction = tables.setdefault("friction", {})
        pressed = "contact" in tables
        contact, drive, slider = (tables.setdefault(n, {}) for n in ("contact", "drive", "slider"))
        if any(not isinstance(table, dict) for table in (friction, contact, drive, slider)):
            return
        self.friction = set(friction)
        law = FrictionLaw.registry.get(str(friction.setdefault("law", friction_laws.USUAL)))
        if law is not None:
            self._fill_law(friction, law, "friction.", states)
        stiff = [item for item in fields(Slider) if _kind(item) == "stiffness"]
        gains = {item.name for one in Drive.registry.values() for item in fields(one) if _kind(item) == "stiffness"}  # type: ignore[arg-type]
        if not {item.name for item in stiff} & set(slider) and not any(drive.get(name) for name in gains):
            self._fill(slider, stiff[0], "slider.")
        if "velocity" not in drive:
            drive["velocity"] = Placeholder(1e-6)
        if not pressed:
            contact["law"] = contact_laws.USUAL
        if contact.get("law") == contact_laws.USUAL:
            loads = [item for item in fields(ContactLaw.registry[contact_laws.USUAL]) if _kind(item) == "normal stress"]  # type: ignore[arg-type]
            if not {item.name for item in loads} & set(contact):
                for item in loads:
                    self._fill(contact, item, "contact.")

    def _fill(self, table: Table, item: Field[Any], prefix: str, factor: float = 1.0) -> None:
        """Add the declared placeholder of a parameter, times `factor`, to its table if its value is missing."""
        role = role_of(item)
        if item.name in table or not isinstance(role, Parameter) or role.standing is None:
            return
        table[item.name] = role.standing * factor
        if role.kind in self.FROM_RECORDS:
            self.standing[role.kind] = f"{prefix}{item.name}"
        else:
            self.missing.add(f"{prefix}{item.name}")

    def _fill_law(self, table: Table, law: type[FrozenRecord], prefix: str, states: Any = None) -> None:
        """Add placeholders for the missing parameters of a law, of its parts, and of the states in its lists."""
        items = {item.name: item for item in fields(law)}  # type: ignore[arg-type]  # every law is a dataclass
        roles = {name: role for name, item in items.items() if isinstance(role := role_of(item), Part)}
        lists = [name for name, role in roles.items() if role.many]
        if not lists and isinstance(states, int) and states > 1:
            self.problems.append(Problem("fit.states", f"got {states!r}; the law {law.name!r} has no number of states"))
        elsewhere: set[str] = set()
        for name in lists:
            elsewhere |= self._fill_members(table, name, roles[name].family, prefix, states)
        for name, item in items.items():
            if name not in elsewhere:
                self._fill(table, item, prefix)
        for name, role in roles.items():
            if not role.many:
                self._fill_part(table, name, role, prefix, elsewhere)

    def _fill_members(self, table: Table, name: str, family: type[FrozenRecord], prefix: str, states: Any) -> set[str]:
        """Add placeholders to the members of a list; return the names of parameters not needed in the law itself."""
        items = [item for item in fields(family) if getattr(role_of(item), "standing", None) is not None]  # type: ignore[arg-type]
        single = {item.name for item in items} & set(table)
        if name not in table and isinstance(states, int) and 1 < states <= MOST_STATES:
            if single:
                words = " or ".join(item.name for item in items)
                self.problems.append(Problem("fit.states", f"friction has {words} of a single state; leave them out"))
                return {item.name for item in items}
            table[name] = [{} for _ in range(states)]
        members = table.get(name)
        if not (isinstance(members, list) and all(isinstance(member, dict) for member in members)):
            return set()
        for i, member in enumerate(members, start=1):
            for item in items:
                apart = 10.0 ** (i - 1) if _kind(item) == "slip distance" else 1.0 / i
                self._fill(member, item, f"{prefix}{name}.{i}.", apart)
        return {item.name for item in items} | {key for member in members for key in member}

    def _fill_part(self, table: Table, name: str, role: Part, prefix: str, elsewhere: set[str]) -> None:
        """Add placeholders for the missing parameters of a part of a law, in the table of the law or of the part."""
        chosen = table.get(name)
        own = chosen.get("law") if isinstance(chosen, dict) else chosen
        law = role.family.registry.get(own) if isinstance(own, str) else None
        if law is None:
            return
        items = [item for item in fields(law) if getattr(role_of(item), "standing", None) is not None]  # type: ignore[arg-type]
        items = [item for item in items if item.name not in elsewhere]
        if items and not role.inline and not isinstance(chosen, dict):
            chosen = table[name] = {"law": own}
        for item in items:
            target = table if role.inline or not isinstance(chosen, dict) else chosen
            self._fill(target, item, prefix if role.inline else f"{prefix}{name}.")


def _kind(item: Field[Any]) -> str:
    """Kind (see `steadyslip.core.roles.PARAMETER_KINDS`) of a field that is a parameter; empty for other fields."""
    role = role_of(item)
    return role.kind if isinstance(role, Parameter) else ""


def _values_missing(missing: set[str], settings: FitSettings, rig: Slider | Machine) -> list[Problem]:
    """Problems with parameters that have no value and are not fitted, for which placeholders must not be used."""

    problems: list[Problem] = []

    def named(key: str) -> set[str]:
        found = set()
        for name in getattr(settings, key) or ():
            if name.startswith("protocol."):
                continue
            try:
                found.add(resolve(name, rig.parameters()))
            except UnknownNameError as error:
                problems.append(Problem(f"fit.{key}", str(error)))
        return found

    absent = missing & named("fixed")
    if settings.free is not None:
        absent |= missing - named("free") - set(rig.of_kind("friction level"))
    if problems:  # names may be misspelt, so do not report missing values
        return problems
    message = "has no value and is not fitted; give it one, or name it in [fit] free"
    return [Problem(name, message) for name in sorted(absent)]
