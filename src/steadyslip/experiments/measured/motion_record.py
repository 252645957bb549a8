"""Record of a machine: columns in SI units, with the names that a simulated run gives them, such as ``table.x``."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked
from steadyslip.core.results import ReadOnly
from steadyslip.experiments.measured.clean import rows_in_order, without_placeholders
from steadyslip.experiments.measured.columns import guess_role, known_unit, listed, split_name
from steadyslip.experiments.measured.formats import read_columns
from steadyslip.experiments.measured.read import checked_option, cut_between
from steadyslip.files.inputs import read_bytes
from steadyslip.files.structures.responses import MOST_RESPONSES, read_response
from steadyslip.machine.responses import ResponseData

TIME = "time"


@dataclass(frozen=True, eq=False)
class MotionRecord(ReadOnly):
    """Motions and forces of a machine over time; made by `read_motion` or `motion_from_arrays`.

    Attributes
    ----------
    time : ndarray (n,)
        Rising times, s.
    columns : dict of str to ndarray (n,)
        Values in SI units by the name that a simulated run of the machine uses: ``table.x``, ``motor.v``,
        ``guide.friction_force``, ``links.screw.force``.
    units : dict of str to str
        Unit that each column had in the file; empty text for columns that were already in SI units.
    source : str
    notes : tuple of str
        Notes on everything that was noticed or changed.
    """

    time: Array = field(repr=False)
    columns: dict[str, Array] = field(repr=False)
    units: dict[str, str]
    source: str
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    def __str__(self) -> str:
        span, every = float(np.ptp(self.time)), float(np.median(np.diff(self.time)))
        lines = [
            f"{self.source}: {len(self)} samples over {format_quantity(span, 's')}, "
            f"one every {format_quantity(every, 's')}"
        ]
        wide = max(map(len, self.columns))
        for name, values in self.columns.items():
            size = unit(self.units[name])[0] if self.units[name] else 1.0
            low, high = (f"{end / size:.4g}" for end in (values.min(), values.max()))
            lines.append(f"{name:<{wide}}  {low} to {high} {self.units[name]}".rstrip())
        return "\n".join([*lines, *(f"note  {note}" for note in self.notes)])


@checked()
def read_motion(
    path: str | PathLike[str],
    columns: Mapping[str, Any] | None = None,
    *,
    time: Any = None,
    table: str | None = None,
    between: tuple[Any, Any] | None = None,
    sampling: Any = None,
    skip_bad_lines: bool = False,
) -> MotionRecord:
    """Read a record of a machine's motions and forces.

    Parameters
    ----------
    path : path
        Any file that `read_record` reads.
    columns : mapping of str to str, int or (str or int, str), optional
        For each name that a simulated run of the machine uses, such as ``table.x``: heading or number (from 1) of a
        column, or a pair (heading or number, unit). By default, all columns whose heading is such a name are read:
        ``table.x (um)``.
    time : str, int or pair, optional
        Column of the time, if its heading does not say so.
    table, between, sampling, skip_bad_lines
        As in `read_record`.

    Raises
    ------
    ParameterError
        If columns are missing or have no unit; lists every problem.
    NotAvailable
        If the file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> rows = "".join(f"{0.01 * k},{20 * 0.9**k}\\n" for k in range(30))
    >>> _ = Path("ring.csv").write_text("time (s),encoder (um)\\n" + rows)
    >>> print(ss.experiments.read_motion("ring.csv", {"table.x": "encoder"}))
    ring.csv: 30 samples over 290 ms, one every 10 ms
    table.x  0.942 to 20 um
    """
    raw = read_columns(Path(path), table, skip_bad_lines)
    bare = [split_name(name) for name in raw.names]
    heads, stated = [head for head, _ in bare], [own or other for (_, own), other in zip(bare, raw.units, strict=True)]
    problems: list[Problem] = []
    notes: list[str] = []
    wanted: dict[str, Any] = {head: place + 1 for place, head in enumerate(heads) if "." in head and " " not in head}
    if columns is not None:
        wanted = dict(columns)
    clocks = [i for i, head in enumerate(heads) if guess_role(head, stated[i]) == TIME]
    if time is not None or (sampling is None and clocks):
        wanted = {TIME: clocks[0] + 1 if time is None else time} | wanted
    elif sampling is None:
        problems.append(
            Problem(TIME, f"no column for it; the file has {listed(map(repr, raw.names))}; name one with time=NAME")
        )
    if not set(wanted) - {TIME}:
        message = (
            f"no heading is a name such as 'table.x (um)'; the file has {listed(map(repr, raw.names))}; give the "
            "heading of each column: {'table.x': 'encoder'}"
        )
        problems.append(Problem("columns", message))
    si: dict[str, Array] = {}
    units: dict[str, str] = {}
    for name, asked in wanted.items():
        where = TIME if name == TIME else f"columns.{name}"
        place, written, fault = _found(asked, raw.names, heads, stated)
        if place is None or written is None:
            problems.append(Problem(where, fault))
            continue
        factor, dimension = unit(written)
        if name == TIME and dimension != unit("s")[1]:
            problems.append(Problem(where, f"column {raw.names[place]!r} is in {written}; expected a time, such as s"))
        si[name], units[name] = without_placeholders(raw.values[place], raw.names[place], notes) * factor, written
    if problems:
        raise ParameterError(problems, title=str(path))
    if sampling is not None and TIME not in si:
        si[TIME] = checked_option("sampling", "s", sampling) * np.arange(raw.values.shape[1])
    lines = raw.lines
    if between is not None:
        si, lines = cut_between(si, lines, between, notes)
    return _record(si, units, str(path), [*raw.notes, *notes], lines)


def _found(
    asked: Any, names: Sequence[str], heads: Sequence[str], units: Sequence[str | None]
) -> tuple[int | None, str | None, str]:
    """Index and unit of a column (None if unknown), and a message on a fault (empty if there is none)."""
    column, own = asked if isinstance(asked, (tuple, list)) and len(asked) == 2 else (asked, None)
    if isinstance(column, int) and not isinstance(column, bool) and 1 <= column <= len(names):
        place = column - 1
    else:
        places = [i for known in (names, heads) for i, name in enumerate(known) if name == column]
        if len(set(places)) > 1:
            return None, None, f"several columns are named {column!r}; give the number of the column"
        if not places:
            return None, None, unknown_name("column", column, names)
        place = places[0]
    found = known_unit(own) if isinstance(own, str) else units[place]
    if found is None:
        fault = f"got the unknown unit {own!r}" if own is not None else f"column {names[place]!r} has no unit"
        advice = f"write it in the heading, such as 'table.x (um)', or give ('{names[place]}', 'um')"
        return place, None, f"{fault}; {advice}"
    if own is not None and units[place] is not None and unit(found) != unit(str(units[place])):
        return place, None, f"column {names[place]!r} is in {units[place]} by its heading, but the option says {found}"
    return place, found, ""


@checked()
def motion_from_arrays(time: Any, columns: Mapping[str, Any], *, source: str = "arrays") -> MotionRecord:
    """Make a record of a machine's motions and forces from arrays in SI units.

    Parameters
    ----------
    time : array_like
        s.
    columns : mapping of str to array_like
        Values by the name that a simulated run of the machine uses: ``table.x``, ``guide.friction_force``.
    source : str, optional

    Raises
    ------
    ParameterError
        If columns are missing, or differ in length.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.linspace(0, 1, 101)
    >>> print(ss.experiments.motion_from_arrays(time, {"table.x": 1e-5 * np.exp(-3 * time) * np.cos(40 * time)}))
    arrays: 101 samples over 1 s, one every 10 ms
    table.x  -7.853e-06 to 1e-05
    """
    si, problems, count = {}, [], np.size(time)
    for name, values in {TIME: time, **columns}.items():
        try:
            si[name] = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            problems.append(Problem(name, f"got {values!r}; allowed: numbers in SI units"))
            continue
        if si[name].shape != (count,):
            problems.append(Problem(name, f"has shape {si[name].shape}; allowed: as many as times, {count}"))
    if not columns:
        problems.append(Problem("columns", "there are none; allowed: one or more, such as {'table.x': x}"))
    if problems:
        raise ParameterError(problems, title=source)
    return _record(si, dict.fromkeys(columns, ""), source, [], np.arange(1, count + 1))


def _record(
    si: dict[str, Array], units: Mapping[str, str], source: str, notes: list[str], lines: Array
) -> MotionRecord:
    si, _ = rows_in_order(si, source, notes, lines)
    time = si.pop(TIME)
    return MotionRecord(time, si, {name: units[name] for name in si}, source, tuple(notes))


@checked()
def read_frequency_response(path: str | PathLike[str], *, averages: int = 1) -> ResponseData:
    """Read measured frequency responses of a machine: displacement over force between its bodies.

    Parameters
    ----------
    path : path
        ``.csv`` with a column ``frequency`` (Hz) and columns such as ``table.x/motor.x real [m/s^2/N]`` and ``imag``,
        or ``magnitude`` and ``phase [deg]``, and perhaps ``coherence``; ``.uff``, ``.unv`` or ``.mat`` as for a body's
        `response`. ``table.x`` is the displacement of the body ``table``, or the force on it, along the surface;
        ``table.y`` away from the surface.
    averages : int, optional
        Number of averages from which the coherence was computed.

    Raises
    ------
    NotAvailable
        If the file cannot be read.
    ParameterError
        If its columns are not frequency responses.

    Examples
    --------
    >>> from pathlib import Path
    >>> rows = "".join(f"{f},{1 / (40 - f)},0\\n" for f in range(1, 10))
    >>> _ = Path("tap.csv").write_text("frequency,table.x/table.x real [um/N],table.x/table.x imag [um/N]\\n" + rows)
    >>> ss.experiments.read_frequency_response("tap.csv")
    ResponseData(tap.csv, table.x, up to 9 Hz)
    """
    place = Path(path)
    return read_response(place.name, place.parent, averages)


def is_response(path: str | PathLike[str]) -> bool:
    """True for a file of frequency responses: a universal file, or a table whose first column is the frequency."""
    place = Path(path)
    ending = place.suffix.lower()
    if ending in (".uff", ".unv"):
        return True
    if ending == ".mat":
        from scipy.io import whosmat

        try:
            return "frequency" in [name for name, _, _ in whosmat(io.BytesIO(read_bytes(place, MOST_RESPONSES)))]
        except Exception:  # SciPy raises errors of any type for a damaged file; `read_motion` reports the fault
            return False
    if ending != ".csv":
        return False
    return read_bytes(place, MOST_RESPONSES)[:20].decode("utf-8", "replace").lstrip("\ufeff").startswith("frequency")
