"""Reading of tables of friction at constant speeds, and of loops of force over displacement before sliding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem, QuantityError, repr_short
from steadyslip.core.format import format_count
from steadyslip.core.roles import Parameter
from steadyslip.experiments.measured.columns import known_unit, listed
from steadyslip.experiments.measured.formats import FORMATS, read_columns
from steadyslip.experiments.measured.formats.table import Table
from steadyslip.experiments.measured.formats.text import read_text
from steadyslip.experiments.measured.speed_headers import (
    SCATTER,
    SPELLED,
    UNITS_OF_ROLES,
    direction_of,
    misfit,
    role_of,
    roles_named,
    split_bracket,
    split_head,
)
from steadyslip.experiments.measured.table_questions import questions_of_table
from steadyslip.experiments.measured.words_in_tables import without_words

WEIGHT = 9.80665  # m/s², standard gravity, for loads in kg
FEWEST_ROWS = 3  # least number of speeds: a straight line fits any two


@dataclass(frozen=True)
class SpeedTable:
    """Table of friction at constant speeds, one row for each speed.

    Attributes
    ----------
    source : str
    speed : ndarray (n,)
        m/s, or rad/s if `turns`; negative for backward motion.
    friction : ndarray (n,)
        Positive: a force (N), a torque (N m) if `turns`, or a coefficient if `is_coefficient`.
    load : ndarray (n,) or None
        Normal load, N, or the torque that the joint transmits, N m, if `load_turns`; None if it is unknown.
    turns, is_coefficient : bool
    speed_unit : str
        Unit of the speeds in the file.
    notes : tuple of str
    load_turns : bool
    radius : float or None
        Radius of the contact of a turning body, m; None if it is not known.
    questions : tuple of str
        Notes that ask the user whether a number is right.
    """

    source: str
    speed: Array
    friction: Array
    load: Array | None
    turns: bool
    is_coefficient: bool
    speed_unit: str
    notes: tuple[str, ...] = ()
    load_turns: bool = False
    radius: float | None = None
    questions: tuple[str, ...] = ()


@dataclass(frozen=True)
class PreslidingLoop:
    """Loop of force over displacement before sliding, in the order of measurement.

    Attributes
    ----------
    source : str
    displacement : ndarray (n,)
        m, or rad if `turns`.
    force : ndarray (n,)
        N, or N m if `turns`.
    turns : bool
    """

    source: str
    displacement: Array
    force: Array
    turns: bool
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Role:
    """Column with a known role: its values in SI units, its unit, and the direction that its name states (0: none).

    `is_bare` is true if the file gives no unit, so that the unit was assumed.
    """

    values: Array
    unit: str
    side: int = 0
    is_bare: bool = False


def read_speed_table(path: str | PathLike[str], *, load: Any = None, **columns: Any) -> SpeedTable:
    """Read a table of friction at constant speeds.

    Columns are found by their names and units: ``speed [mm/min]``, ``F (N)``, ``torque_Nm``, ``mu``, ``load [kN]``,
    ``direction`` (words or signs; without this column, negative speeds are backward). If friction has two columns, such
    as ``forward [N]`` and ``backward [N]``, each row of the file becomes two rows of the table.

    Parameters
    ----------
    path : path
    load : float or str, optional
        Constant load, N, if the file has no column for it.
    **columns
        Column or unit by role: ``speed="mm/min"``, ``force="F2"``, ``torque=("M", "N m")``.

    Raises
    ------
    ParameterError
        If columns are missing or contradict each other.
    NotAvailable
        If the file cannot be read.
    """
    source = str(path)
    found, notes = _roles(Path(path), columns, () if load is None else ("load",))
    kinds = [role for role in ("force", "torque", "friction") if role in found]
    if "speed" not in found or len(kinds) != 1:
        lacking = "speed" if "speed" not in found else "force"
        _refuse_misfits(Path(path))
        both = f"has columns of {' and of '.join(kinds)}; leave one out" if len(kinds) > 1 else "has no column for it"
        names = _table(Path(path)).names
        if names == [str(place) for place in range(1, len(names) + 1)]:
            raise _fault(source, lacking, "the file has no header to name its columns; write one as its "
                         "first line, such as: speed [mm/min], force [N]")  # fmt: skip
        raise _fault(source, lacking, f"{both}; a table of speeds has speed, force or torque or friction, and if known "
                     f"load and direction; its columns are {listed(map(repr, names))}")  # fmt: skip
    kind, speed = kinds[0], found["speed"][0]
    turns = unit(speed.unit)[1].angle == 1
    if kind != "friction" and turns != (kind == "torque"):
        says = f"got speeds in {speed.unit} and a {kind}"
        fix = ""
        if speed.is_bare:
            fix = "; the speeds have no unit: write it in the header, such as speed [rpm]"
        elif turns:
            fix = "; multiply rpm by the lead of the screw, in mm/rev, or the force by the radius at which it acts"
        raise _fault(source, kind, f"{says}; allowed: a force with m/s, or a torque with rad/s or rpm{fix}")
    rows = [_stacked(speed.values, one, found.get("direction")) for one in found[kind]]
    v, f = (np.concatenate([row[i] for row in rows]) for i in range(2))
    pressed = np.tile(found["load"][0].values, len(rows)) if "load" in found else None
    twisted = pressed is not None and unit(found["load"][0].unit)[1] == unit("N m")[1]
    if twisted and not turns:
        raise _fault(source, "load", f"got {found['load'][0].unit} beside a {kind}; allowed: a normal load in N")
    if load is not None:
        pressed, twisted = np.full(len(v), checked_option("load", load, "N", source)), False
    elif pressed is None:
        _refuse_misfits(Path(path), "load")
    clean = np.isfinite(v) & np.isfinite(f) & (np.isfinite(pressed) if pressed is not None else True)
    if not np.all(clean):
        notes.append(f"{format_count(int(np.sum(~clean)), 'row')} without a number left out")
    if np.any(still := clean & (v == 0)):
        notes.append(
            f"{format_count(int(np.sum(still)), 'row')} at rest left out: friction at rest is not that of sliding"
        )
    keep = clean & (v != 0)
    v, f, pressed = v[keep], f[keep], None if pressed is None else pressed[keep]
    if len(v) < FEWEST_ROWS:
        raise _fault(
            source,
            "speed",
            f"got {format_count(len(v), 'row')} of sliding; a table of speeds has {FEWEST_ROWS} at least",
        )
    unloaded: list[str] = []
    if twisted and pressed is not None:  # friction grows with the size of the torque, which may be zero
        pressed = np.abs(pressed)
        v, f, pressed, unloaded = _without_load(v, f, pressed)
        twisted = pressed is not None
    elif pressed is not None and not np.all(pressed > 0):
        raise _fault(source, "load", f"got {pressed.min():g} N; allowed: loads above 0")
    friction = _unsigned(source, v, f, kind)
    units = {role: None if columns[0].is_bare else columns[0].unit for role, columns in found.items()}
    asked = (*unloaded, *questions_of_table(v, f, None if twisted else pressed, kind, {"load": "N", **units}))
    notes += _signs(v, f, kind, "direction" in found)
    return SpeedTable(
        source, v, friction, pressed, turns, kind == "friction", speed.unit, (*notes, *asked), twisted, questions=asked,
    )  # fmt: skip


def _without_load(speed: Array, torque: Array, load: Array) -> tuple[Array, Array, Array | None, list[str]]:
    """Speed, torque and load of the rows, without a direction of motion in which the load is zero, and questions.

    A question asks about the direction that is left out. The load is None if it is zero in both directions.
    """
    if not np.any(load > 0):
        return speed, torque, None, []
    for side, way in ((1.0, "forward"), (-1.0, "backward")):
        rows = np.sign(speed) == side
        if np.any(rows) and not np.any(load[rows] > 0):
            question = (
                f"{way}: {format_count(int(np.sum(rows)), 'row')} left out, as no coefficient follows from a load of "
                "0 N m throughout: give the loads, or write these rows as a table without the column load"
            )
            return speed[~rows], torque[~rows], load[~rows], [question]
    return speed, torque, load, []


def checked_option(name: str, value: Any, si_unit: str, source: str) -> float:
    """Positive load or radius in SI units, from a number or text with a unit.

    Raises
    ------
    ParameterError
        If the value is not positive or has another dimension; the message names the option.
    """
    try:
        return float(Parameter(si_unit, positive, name).checked(value))
    except ParameterError as error:
        usual = {"N": "3.2 kN", "m": "40 mm"}[si_unit]
        more = "; multiply a pressure by the area that it acts on" if si_unit == "N" else ""
        message = f"got {repr_short(value)}; allowed: a {name} in {si_unit} above 0, such as '{usual}'{more}"
        raise _fault(source, name, message) from error


def _signs(speed: Array, friction: Array, kind: str, direction: bool) -> list[str]:
    """Notes on signs of speed or friction that do not give the direction of motion."""
    notes = []
    if np.all(speed < 0) and not direction:
        notes.append("all speeds are negative: the friction is that of backward motion")
    if np.any(wrong := (friction < 0) & (speed > 0)) and not np.any((friction > 0) & (speed > 0)):
        notes.append(
            f"{kind} is negative at {format_count(int(np.sum(wrong)), 'forward speed')}: its sign is left out, "
            "as friction opposes motion; where the motion was backward, write those speeds negative"
        )
    return notes


def table_from_arrays(arrays: Mapping[str, Any]) -> SpeedTable:
    """Table from arrays in SI units: speed (m/s, or rad/s with torque), load, and one of force, torque or friction.

    Raises
    ------
    ParameterError
        If arrays are missing, or differ in length.
    """
    kinds = [role for role in ("force", "torque", "friction") if role in arrays]
    if "speed" not in arrays or len(kinds) != 1 or set(arrays) - {"speed", "load", *kinds}:
        raise _fault(
            "arrays", "table", f"got {listed(arrays)}; allowed: speed, load, and one of force, torque and friction"
        )
    try:
        found = {role: np.atleast_1d(np.asarray(values, dtype=float)) for role, values in arrays.items()}
        v, f, *pressed = np.broadcast_arrays(*(found[role] for role in ("speed", kinds[0], "load") if role in found))
    except (TypeError, ValueError) as error:
        raise _fault("arrays", "table", "allowed: arrays of numbers that are equally long") from error
    turns = kinds[0] == "torque"
    every = np.stack([v, f, *pressed])
    if not np.all(np.isfinite(every)) or np.any(v == 0) or not all(np.all(one > 0) for one in pressed):
        raise _fault("arrays", "table", "allowed: finite numbers, speeds that are not 0, loads above 0")
    speed_unit = "rad/s" if turns else "m/s"
    return SpeedTable(
        "arrays", v, _unsigned("arrays", v, f, kinds[0]), pressed[0] if pressed else None, turns,
        kinds[0] == "friction", speed_unit,
    )  # fmt: skip


def read_loop(path: str | PathLike[str], **columns: Any) -> PreslidingLoop:
    """Read a table of displacement and force (or angle and torque) before sliding.

    Raises
    ------
    ParameterError
        If columns are missing.
    """
    found, notes = _roles(Path(path), columns)
    kind = "torque" if "torque" in found else "force"
    if "displacement" not in found or kind not in found:
        _refuse_misfits(Path(path))
        raise _fault(str(path), "displacement", "a loop before sliding has columns of displacement and force")
    x, f = found["displacement"][0], found[kind][0].values
    keep = np.isfinite(x.values) & np.isfinite(f)
    return PreslidingLoop(str(path), x.values[keep], f[keep], unit(x.unit)[1].angle == 1, tuple(notes))


def is_loop(path: str | PathLike[str]) -> bool:
    """True if a table has a column of displacement and none of speed."""
    table = _table(Path(path))
    found = {role_of(*split_head(name, apart)) for name, apart in zip(table.names, table.units, strict=True)}
    return "displacement" in found and "speed" not in found


def _fault(source: str, name: str, message: str) -> ParameterError:
    return ParameterError([Problem(name, message)], title=source)


def _table(path: Path) -> Table:
    if path.suffix.lower() in FORMATS:
        return read_columns(path)
    notes: list[str] = []

    def plain(raw: bytes) -> bytes:
        text, said = without_words(raw, lambda name: _needed(*split_head(name, None)))
        notes.extend(said)
        return text

    try:
        table = read_text(path, False, plain)
    except ParameterError as error:
        raise ParameterError(error.problems, title=str(path)) from error
    table.notes += notes
    return table


def _needed(head: str, own: str | None) -> str | None:
    """Role of a column in a table of speeds or a loop; None if the column is not needed and may hold anything."""
    role = role_of(head, own)
    return None if role == "displacement" and own is None else role


def _refuse_misfits(path: Path, role: str = "") -> None:
    """Raise an error if a unit contradicts its column's name: a speed, force, torque or load, or only a `role`."""
    table = _table(path)
    heads = [split_head(name, apart) for name, apart in zip(table.names, table.units, strict=True)]
    heads = [head if not role or role in roles_named(split_bracket(*head)[0]) else ("", None) for head in heads]
    problems = [Problem(name, why) for name, head in zip(table.names, heads, strict=True) if (why := misfit(*head))]
    if problems:
        raise ParameterError(problems, title=str(path))


def _roles(
    path: Path, given: Mapping[str, Any], without: Sequence[str] = ()
) -> tuple[dict[str, list[_Role]], list[str]]:
    """Columns of a file by role, except the roles `without`, and notes.

    Force, torque or friction may have two columns: forward and backward.
    """
    table = _table(path)
    heads = [split_head(name, apart) for name, apart in zip(table.names, table.units, strict=True)]
    chosen = {role: _asked(str(path), role, value, table.names, heads) for role, value in given.items()}
    taken = {place for place, _ in chosen.values() if place is not None}
    notes = list(table.notes)
    found: dict[str, list[_Role]] = {}
    unused: list[str] = []
    for i, (name, (head, own)) in enumerate(zip(table.names, heads, strict=True)):
        asked = next((role for role, (place, _) in chosen.items() if place == i), None)
        role = asked or (None if i in taken else role_of(head, own))
        role = None if role in without else role
        if role is None and not SCATTER.search(head) and np.any(np.isfinite(table.values[i])):
            unused.append(name)
        if role is None or (asked is None and chosen.get(role, (None, None))[0] is not None):
            continue
        stated = chosen.get(role, (None, None))[1] or own
        is_bare = stated is None
        if stated is None:
            if wrong := misfit(head, None):
                raise _fault(str(path), name, wrong)
            stated = UNITS_OF_ROLES[role][0]
            if role not in ("friction", "direction"):
                notes.append(f"{role}: column {name!r} has no unit; read as {stated}")
        factor, dimension = unit(stated)
        if dimension not in [unit(one)[1] for one in UNITS_OF_ROLES[role]]:
            wanted = " or ".join(UNITS_OF_ROLES[role])
            raise _fault(str(path), role, f"column {name!r} is in {stated}; expected a unit such as {wanted}")
        if dimension == unit("kg")[1]:
            factor *= WEIGHT
            notes.append(f"load: a mass; each kg presses with {WEIGHT} N")
        found.setdefault(role, []).append(_Role(table.values[i] * factor, stated, direction_of(head), is_bare))
    notes += [f"not used: column {name!r}" for name in unused]
    for role, several in found.items():
        if len(several) > 1 and not (role in ("force", "torque", "friction") and all(one.side for one in several)):
            alike = [name for name, head in zip(table.names, heads, strict=True) if role_of(*head) == role]
            message = f"several columns could be it: {listed(map(repr, alike))}; say which with {role}=NAME"
            raise _fault(str(path), role, message)
    return found, notes


def _asked(
    source: str, role: str, value: Any, names: Sequence[str], heads: Sequence[tuple[str, str | None]]
) -> tuple[int | None, str | None]:
    """Index of a column and its unit from an option, which is a column, a unit, or a pair of both."""
    stated = None
    if isinstance(value, (tuple, list)) and len(value) == 2:
        value, stated = value
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= len(names):
        return value - 1, stated
    text = str(value)
    for known in (list(names), [head for head, _ in heads]):
        if known.count(text) == 1:
            return known.index(text), stated
    try:
        spelled = SPELLED.get(text.strip().lower()) or known_unit(text)
        if spelled and unit(spelled)[1] in [unit(one)[1] for one in UNITS_OF_ROLES[role]]:
            return None, spelled
    except QuantityError:
        pass
    raise _fault(source, role, f"got {value!r}; allowed: a column ({listed(map(repr, names))}) or a unit")


def _stacked(speed: Array, one: _Role, direction: list[_Role] | None) -> tuple[Array, Array]:
    """Speeds (n,), negative for backward motion, and friction (n,) of one column of friction."""
    if direction is not None:
        return np.abs(speed) * np.where(direction[0].values > 0, 1.0, -1.0), one.values
    return (np.abs(speed) * one.side if one.side else speed), one.values


def _unsigned(source: str, speed: Array, friction: Array, kind: str) -> Array:
    """Absolute friction (n,), if it has one sign in each direction of motion; raises an error otherwise."""
    for side in (1.0, -1.0):
        own = friction[np.sign(speed) == side]
        if np.any(own == 0) or (len(own) and np.any(np.sign(own) != np.sign(own[0]))):
            way = "forward" if side > 0 else "backward"
            raise _fault(source, kind, f"got {own.min():g} to {own.max():g} (SI) at {way} speeds; allowed: friction of "
                         "one sign in each direction, none of it zero: give rows of the other direction a negative "
                         "speed or a column direction, and take a constant load off all")  # fmt: skip
    return np.asarray(np.abs(friction))
