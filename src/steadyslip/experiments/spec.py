"""The file that says how to fit: a rig file in which what is to be fitted may be missing, and two more tables."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

from steadyslip.core.errors import (
    InternalError,
    NotAvailable,
    ParameterError,
    Problem,
    RigFileError,
    UnknownNameError,
    unknown_name,
)
from steadyslip.core.progress import progress_text
from steadyslip.core.records import Parameter, checked_number, positive, resolve
from steadyslip.experiments.answers.laws import LawComparison, compare_laws
from steadyslip.experiments.fitting.fit import fit
from steadyslip.experiments.fitting.plan import AXES, DRIVES
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.starts import STARTS
from steadyslip.experiments.measured.columns import ROLES
from steadyslip.experiments.measured.read import read_record
from steadyslip.experiments.measured.record import Record
from steadyslip.files.specifications.lines import line_of
from steadyslip.files.specifications.read import from_tables, parsed, text_of
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Protocol

RECORD_KEYS = (*ROLES, "area", "normal_stress", "table", "between", "skip_bad_lines", "decimate")
FIT_KEYS = ("free", "fixed", "separate", "states", "trend", "trend_axis", "offset", "drive", "loss", "width", "errors",
            "starts", "windows", "compare")  # fmt: skip
_STANDING = {
    "friction.a": 0.01,
    "friction.b": 0.01,
    "friction.d_c": 1e-5,
    "friction.mu_ref": 0.6,
    "slider.stiffness": 1e10,
}
"""Values that stand for parameters that a file leaves to the fit; they have no influence."""
_SETTINGS = {"friction.v_ref": 1e-6, "drive.velocity": 1e-6, "contact.steady_normal_stress": 1e6}
"""The same for what each record determines."""


@dataclass(frozen=True)
class Spec:
    """How to read records and what to fit to them.

    Attributes
    ----------
    rig : Slider
    protocol : Protocol or None
    record : dict
        Arguments of `read_record`, and ``decimate``.
    options : dict
        Arguments of `fit`.
    laws : tuple of str
        Laws to compare; none unless asked for.
    windows : bool
        Whether every step of a record is a record of its own.
    v_ref_given : bool
        Whether the file says at which rate mu_ref holds; the rate at the start of the first record unless given.
    contact_given : bool
        Whether it says what presses the surfaces together.
    drive_given : bool
        Whether it says how fast the load point moves before a protocol changes that; as in the records unless given.
    """

    rig: Slider
    protocol: Protocol | None = None
    record: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    laws: tuple[str, ...] = ()
    windows: bool = False
    v_ref_given: bool = False
    contact_given: bool = True
    drive_given: bool = True

    def read(self, path: str | PathLike[str], skip_bad_lines: bool = False) -> Record:
        """Read a record as the file says."""
        options = dict(self.record)
        decimate = options.pop("decimate", None)
        options["skip_bad_lines"] = skip_bad_lines or options.get("skip_bad_lines", False)
        record = read_record(path, **options)
        return record if decimate is None else record.decimated(decimate)

    def fit(self, records: Sequence[Record], **changes: Any) -> Fit:
        """Fit the records as the file says."""
        rig, parts = self._for(records)
        return fit(rig, parts, **self.options, protocol=self.protocol, **changes)

    def compare(self, records: Sequence[Record], **changes: Any) -> LawComparison:
        """Fit all laws that the file lists."""
        rig, parts = self._for(records)
        options = {k: v for k, v in self.options.items() if k not in ("free", "separate")}
        return compare_laws(rig, parts, self.laws, **options, protocol=self.protocol, **changes)

    def _for(self, records: Sequence[Record]) -> tuple[Slider, tuple[Record, ...]]:
        parts = tuple(w for r in records for w in (r.windows() if self.windows else (r,)))
        pressed = [record.normal is not None for record in parts]
        if not (self.contact_given or all(pressed)):
            message = (
                f"{parts[pressed.index(False)].source} has no column for it; name one, or write "
                "normal_stress = '20 MPa' in [record], or a table [contact]"
            )
            raise ParameterError([Problem("normal", message)])
        rate = parts[0].initial_rate
        rig = self.rig
        if self.protocol is not None and not self.drive_given:
            if rate is None or not rate > 0:
                message = (
                    f"missing, and {parts[0].source} does not show it; write the rate before the first step, as "
                    "velocity = '1 um/s' in [drive]"
                )
                raise ParameterError([Problem("drive.velocity", message)])
            rig = rig.with_values({"drive.velocity": rate})
        if self.v_ref_given or "friction.v_ref" not in rig.parameters():
            return rig, parts
        slow = rig.drive.velocity if rate is None or not rate > 0 else rate
        return rig.with_values({"friction.v_ref": slow}), parts


def read_spec(path: str | PathLike[str], changes: Iterable[str] = ()) -> Spec:
    """Read the file of a fit.

    It is a rig file. What is to be fitted may be missing: a, b, d_c, α, mu_ref, the stiffness; so may what records
    determine: contact, drive, v_ref. The table ``[record]`` says how to read records, ``[fit]`` what to fit.

    Parameters
    ----------
    path : path
    changes : iterable of str
        Values that replace or complete those of the file, as ``"fit.trend=2"``.

    Raises
    ------
    RigFileError
        Listing everything that is wrong.
    """
    return spec_from_text(text_of(path), str(path), changes)


def spec_from_text(text: str, source: str = "spec", changes: Iterable[str] = ()) -> Spec:
    """Read the text of such a file; see `read_spec`."""
    tables, lines, problems = parsed(text, source, ())
    own, others = _sorted_changes(changes)
    record = _table(tables, "record", RECORD_KEYS, problems)
    options = _table(tables, "fit", FIT_KEYS, problems)
    for target, name, raw in own:
        (record if target == "record" else options)[name] = raw
    for target, found, keys in (("record", record, RECORD_KEYS), ("fit", options, FIT_KEYS)):
        problems += [Problem(f"{target}.{k}", unknown_name("key", k, keys)) for k in found if k not in keys]
    problems += _checked_record(record) + _checked_fit(options)
    v_ref_given = isinstance(tables.get("friction"), dict) and "v_ref" in tables["friction"]
    contact_given = "contact" in tables
    drive_given = isinstance(tables.get("drive"), dict) and "velocity" in tables["drive"]
    missing = _completed(tables, options.pop("states", None), problems)
    from steadyslip.files.specifications.changes import apply, full_name

    for change in others:
        problems += apply(change, tables, lines)
        named = full_name(change.partition("=")[0].strip(), tables)[0]
        missing.discard(named)
        drive_given |= named == "drive.velocity"
    try:
        rig, protocol = from_tables(tables, lines, source, [])
    except RigFileError as error:
        raise RigFileError([*_placed(problems, lines), *error.problems], title=source) from None
    if rig is None:
        raise InternalError("rig is not None")
    problems = problems or _left_open(missing, options, rig)
    if problems:
        raise RigFileError(_placed(problems, lines), title=source)
    laws = options.pop("compare", ())
    windows = options.pop("windows", False)
    if "free" not in options and missing:
        options["free"] = sorted(name for name in missing if name in rig.parameters())
        if "friction.mu_ref" not in missing and "friction.mu_ref" in rig.parameters():
            options["fixed"] = [*options.get("fixed", []), "friction.mu_ref"]
    return Spec(rig, protocol, record, options, tuple(laws), windows, v_ref_given, contact_given, drive_given)


def default_spec(evolution: str = "slip") -> Spec:
    """One-state rate-and-state friction at the measured normal stress, everything free."""
    return spec_from_text(f"[friction]\nevolution = {evolution!r}\n", "default")


def lab_rig(
    evolution: str = "slip",
    *,
    states: int = 1,
    normal_memory: str = "none",
    stiffness: Any = None,
    v_ref: Any = "1 um/s",
) -> Slider:
    """A rig for fits: rate-and-state friction in a press, whose numbers stand for what is to be fitted.

    Parameters
    ----------
    evolution : str
        ``slip``, ``aging`` or ``prz``.
    states : int
    normal_memory : str
        ``none``, ``linker-dieterich`` or ``prakash-clifton``.
    stiffness : float or str, optional
        Of the machine, Pa/m, where it is known; name it in ``fixed`` of `fit`.
    v_ref : float or str
        Rate at which mu_ref holds.
    """
    rate = _checked("v_ref", "m/s", v_ref)
    words = f"evolution = {json.dumps(str(evolution))}\nv_ref = {rate!r}\n"
    memory = f"[friction.normal_memory]\nlaw = {json.dumps(str(normal_memory))}\n"
    count = json.dumps(states, default=int) if not isinstance(states, str) else json.dumps(states)
    spec = spec_from_text(f"[friction]\n{words}{memory}[fit]\nstates = {count}\n", "lab_rig")
    if stiffness is None:
        return spec.rig
    return replace(spec.rig, stiffness=_checked("stiffness", "Pa/m", stiffness))


def _checked(name: str, unit: str, value: Any) -> float:
    try:
        return checked_number(Parameter(unit, positive, name), value)
    except ParameterError as error:
        raise ParameterError([problem.under(name) for problem in error.problems]) from error


def _sorted_changes(changes: Iterable[str]) -> tuple[list[tuple[str, str, Any]], list[str]]:
    """Changes of the tables of a fit, and those of the rig."""
    from steadyslip.files.specifications.changes import value_of

    own, others = [], []
    for change in [changes] if isinstance(changes, str) else changes:
        name, equals, raw = (part.strip() for part in change.partition("="))
        target, _, key = name.partition(".")
        if target in ("record", "fit") and equals and key:
            own.append((target, key, value_of(raw, name)))
        else:
            others.append(change)
    return own, others


def _table(tables: dict[str, Any], name: str, keys: Sequence[str], problems: list[Problem]) -> dict[str, Any]:
    raw = tables.pop(name, {})
    if not isinstance(raw, dict):
        problems.append(Problem(name, f"got {raw!r}; allowed: a table [{name}]"))
        return {}
    return dict(raw)


def _checked_record(record: dict[str, Any]) -> list[Problem]:
    problems = []
    between = record.get("between")
    if between is not None and not (isinstance(between, list) and len(between) == 2):
        problems.append(Problem("record.between", f"got {between!r}; allowed: [start, end] in s"))
    count = record.get("decimate")
    if count is not None and not (isinstance(count, int) and count >= 50):
        problems.append(Problem("record.decimate", f"got {count!r}; allowed: a whole number >= 50"))
    skip = record.get("skip_bad_lines", False)
    if not isinstance(skip, bool):
        problems.append(Problem("record.skip_bad_lines", f"got {skip!r}; allowed: true or false"))
    return problems


def _checked_fit(options: dict[str, Any]) -> list[Problem]:
    """Kinds of values; what they mean is checked by the fit itself."""
    problems = []
    for name in ("free", "fixed", "separate", "compare"):
        value = options.get(name)
        if isinstance(value, str):
            options[name] = [value]
        elif value is not None and not (isinstance(value, list) and all(isinstance(x, str) for x in value)):
            problems.append(Problem(f"fit.{name}", f"got {value!r}; allowed: a list of names"))
    for name, allowed in (("trend_axis", AXES), ("drive", DRIVES[:3])):
        if options.get(name, allowed[0]) not in allowed:
            problems.append(Problem(f"fit.{name}", unknown_name("choice", options[name], allowed)))
    for name, least, default in (("trend", 0, 0), ("starts", 1, STARTS), ("states", 1, 1)):
        value = options.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            problems.append(Problem(f"fit.{name}", f"got {value!r}; allowed: a whole number >= {least}"))
    for name in ("offset", "windows"):
        if not isinstance(options.get(name, False), bool):
            problems.append(Problem(f"fit.{name}", f"got {options[name]!r}; allowed: true or false"))
    return problems


def _completed(tables: dict[str, Any], states: Any, problems: list[Problem]) -> set[str]:
    """Put values where the file has none, and say which of them are to be fitted."""
    friction = tables.setdefault("friction", {})
    if not isinstance(friction, dict):
        return set()
    friction.setdefault("law", "rate-state")
    tables.setdefault("contact", {"law": "constant"})
    tables.setdefault("drive", {})
    tables.setdefault("slider", {})
    missing: set[str] = set()
    if any(not isinstance(tables[name], dict) for name in ("contact", "drive", "slider")):
        return missing
    if friction["law"] == "rate-state":
        missing |= _completed_friction(friction, states, problems)
    elif isinstance(states, int) and states > 1:
        problems.append(Problem("fit.states", f"got {states!r}; the law {friction['law']!r} has no number of states"))
    slider, drive, contact = tables["slider"], tables["drive"], tables["contact"]
    if not {"stiffness", "axial_stiffness"} & set(slider) and not drive.get("kp"):
        slider["stiffness"] = _STANDING["slider.stiffness"]
        missing.add("slider.stiffness")
    drive.setdefault("velocity", _SETTINGS["drive.velocity"])
    if contact.get("law") == "constant" and not {"preload", "steady_normal_stress"} & set(contact):
        contact["steady_normal_stress"] = _SETTINGS["contact.steady_normal_stress"]
    return missing


def _completed_friction(friction: dict[str, Any], states: Any, problems: list[Problem]) -> set[str]:
    missing: set[str] = set()

    def complete(table: dict[str, Any], key: str, name: str, value: float) -> None:
        if key not in table:
            table[key] = value
            missing.add(name)

    friction.setdefault("v_ref", _SETTINGS["friction.v_ref"])
    complete(friction, "a", "friction.a", _STANDING["friction.a"])
    complete(friction, "mu_ref", "friction.mu_ref", _STANDING["friction.mu_ref"])
    members = friction.get("states")
    if members is None and isinstance(states, int) and states > 1:
        if {"b", "d_c"} & set(friction):
            problems.append(Problem("fit.states", "friction has b or d_c of a single state; leave them away"))
            return missing
        members = friction["states"] = [{} for _ in range(states)]
    if isinstance(members, list) and all(isinstance(member, dict) for member in members):
        for i, member in enumerate(members, start=1):
            complete(member, "b", f"friction.states.{i}.b", _STANDING["friction.b"] / i)
            complete(member, "d_c", f"friction.states.{i}.d_c", _STANDING["friction.d_c"] * 10.0 ** (i - 1))
    else:
        complete(friction, "b", "friction.b", _STANDING["friction.b"])
        complete(friction, "d_c", "friction.d_c", _STANDING["friction.d_c"])
    memory = friction.get("normal_memory")
    if memory == "linker-dieterich":
        memory = friction["normal_memory"] = {"law": "linker-dieterich"}
    if isinstance(memory, dict) and memory.get("law") == "linker-dieterich":
        given = isinstance(members, list) and any("alpha" in m for m in members if isinstance(m, Mapping))
        if not given:
            complete(memory, "alpha", "friction.normal_memory.alpha", 0.3)
    return missing


def _left_open(missing: set[str], options: Mapping[str, Any], rig: Slider) -> list[Problem]:
    """Parameters that have no value and are not fitted either; what stands in for them must not be taken for one."""

    problems: list[Problem] = []

    def named(key: str) -> set[str]:
        found = set()
        for name in options.get(key, ()):
            if name.startswith("protocol."):
                continue
            try:
                found.add(resolve(name, rig.parameters()))
            except UnknownNameError as error:
                problems.append(Problem(f"fit.{key}", str(error)))
        return found

    absent = missing & named("fixed")
    if "free" in options:
        absent |= missing - named("free") - {"friction.mu_ref"}
    if problems:  # a misspelt name is not a missing one
        return problems
    message = "has no value and is not fitted; give it one, or name it in [fit] free"
    return [Problem(name, message) for name in sorted(absent)]


def _placed(problems: Iterable[Problem], lines: dict[str, int]) -> list[Problem]:
    return [Problem(p.name, p.message, p.line or line_of(p.name, lines)) for p in problems]


def fit_files(
    paths: Sequence[str | PathLike[str]], spec: str | PathLike[str] | None = None, changes: Iterable[str] = (),
    *, skip_bad_lines: bool = False,
) -> tuple[Fit, LawComparison | None]:  # fmt: skip
    """Read records and fit them, as the command line does; shows progress on a terminal.

    Parameters
    ----------
    paths : sequence of path
        Records, fitted together.
    spec : path, optional
        The file of the fit; one-state slip law at the measured normal stress unless given.
    changes : iterable of str
        As for `read_spec`.
    skip_bad_lines : bool

    Returns
    -------
    fit : Fit
        The best, where laws are compared.
    comparison : LawComparison or None

    Raises
    ------
    ParameterError
        Listing everything that is wrong with the files: of all records, and of the file of the fit.
    """
    text = "[friction]\n" if spec is None else text_of(spec)
    plan = spec_from_text(text, "default" if spec is None else str(spec), changes)
    records, faults = [], []
    for path in paths:
        try:
            records.append(plan.read(path, skip_bad_lines))
        except (ParameterError, NotAvailable) as error:
            faults.append(error)
    if len(faults) == 1:
        raise faults[0]
    if faults:
        raise NotAvailable("\n".join(map(str, faults)))
    with progress_text("searching") as said:

        def told(what: str, starts: int, rms: float) -> None:
            reached = f", residuals {rms:.3g} of friction" if math.isfinite(rms) else ""
            said(f"{what}: {starts} starts tried{reached}; Ctrl-C ends it")

        if plan.laws:
            found = plan.compare(records, progress=told)
            return found.fits[found.best], found
        return plan.fit(records, progress=told), None
