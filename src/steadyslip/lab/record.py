"""A record of an experiment: clean columns in SI units, with a note of everything that was done to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.errors import NotAvailable, ParameterError, Problem
from steadyslip.lab.columns import ROLES, Column, assigned, required
from steadyslip.lab.files import Columns, read_columns
from steadyslip.lab.steps import Step, initial_rate, normal_steps, velocity_steps
from steadyslip.quantities import QuantityError, parse, shown
from steadyslip.records import Parameter, checked_number, real

Array = np.ndarray
GAP = 10.0  # times the usual spacing
PLAUSIBLE = (1e-3, 10.0)  # friction coefficients
FEWEST_ROWS = 20


@dataclass(frozen=True, eq=False)
class Record:
    """A record of an experiment; build one with `read_record` or `record_from_arrays`.

    Attributes
    ----------
    time : ndarray (n,)
        s, rising.
    friction : ndarray (n,)
        Shear over normal stress.
    normal, shear : ndarray (n,) or None
        Pa.
    displacement : ndarray (n,) or None
        Of the load point, m; integrated where only its rate was measured.
    velocity : ndarray (n,) or None
        Rate of the load point, m/s, where it was measured.
    source : str
    notes : tuple of str
        Everything that was noticed or changed.
    integrated : bool
        Whether the displacement comes from the velocity.
    """

    time: Array = field(repr=False)
    friction: Array = field(repr=False)
    normal: Array | None = field(repr=False)
    shear: Array | None = field(repr=False)
    displacement: Array | None = field(repr=False)
    velocity: Array | None = field(repr=False)
    source: str
    notes: tuple[str, ...] = ()
    integrated: bool = False

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """What was done to the sample, in the order of time."""
        found: list[Step] = []
        if self.displacement is not None:
            found += velocity_steps(self.time, self.displacement)
        if self.normal is not None:
            found += normal_steps(self.time, self.normal)
        return tuple(sorted(found, key=lambda step: step.time))

    @cached_property
    def initial_rate(self) -> float | None:
        """Load-point rate before the first change of it, m/s; None if it was not measured."""
        return None if self.displacement is None else initial_rate(self.time, self.displacement)

    @cached_property
    def rate(self) -> Array | None:
        """Load-point rate at the samples, m/s: as measured, or slopes over seven samples."""
        if self.velocity is not None or self.displacement is None:
            return self.velocity
        half = 3
        n = len(self.time)
        low, high = np.clip(np.arange(n) - half, 0, n - 1), np.clip(np.arange(n) + half, 0, n - 1)
        rate: Array = (self.displacement[high] - self.displacement[low]) / (self.time[high] - self.time[low])
        return rate

    def _taken(self, rows: Any, note: str) -> Record:
        def of(values: Array | None) -> Array | None:
            return None if values is None else _frozen(values[rows])

        columns = {name: of(getattr(self, name)) for name in ("time", "friction", *_OPTIONAL)}
        return replace(self, **columns, notes=(*self.notes, note))

    def between(self, start: Any, end: Any) -> Record:
        """The part between two times (s, or text such as ``"11.6e3 s"``).

        Raises
        ------
        ParameterError
            If fewer than twenty samples are left.
        """
        first, last = _seconds("start", start), _seconds("end", end)
        rows = (self.time >= first) & (self.time <= last)
        if np.sum(rows) < FEWEST_ROWS:
            span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s"
            message = f"got {first!r} to {last!r} s, which leaves {np.sum(rows)} samples; the record is from {span}"
            raise ParameterError([Problem("between", message)])
        return self._taken(rows, f"cut to {first:.6g} to {last:.6g} s, {np.sum(rows)} of {len(self)} samples")

    def decimated(self, count: int) -> Record:
        """At most about `count` samples, dense after every step and thin where nothing happens.

        The samples kept are as measured; nothing is averaged.
        """
        if count >= len(self):
            return self
        rows = transient_rows(self, count)
        return self._taken(rows, f"decimated to {len(rows)} of {len(self)} samples, dense after steps")

    def detrended(self, order: int = 1) -> Record:
        """Friction without a polynomial in the load point's displacement (in time where that is unknown).

        The polynomial is that of the last parts before every step and of the end, where friction is steady, levels
        of their own allowed. A fit's own ``trend`` does the same with errors accounted for, and is to be preferred.
        """
        if not (isinstance(order, int) and 1 <= order <= 5):
            raise ParameterError([Problem("order", f"got {order!r}; allowed: a whole number from 1 to 5")])
        axis = self.time if self.displacement is None else self.displacement
        s = (axis - axis[0]) / (axis[-1] - axis[0])
        edges = np.searchsorted(self.time, [self.time[0], *(step.time for step in self.steps), np.inf])
        columns, rows = [], []
        for first, last in zip(edges[:-1], edges[1:], strict=True):
            if last - first >= FEWEST_ROWS:
                part = np.arange(first + (last - first) * (0 if first == 0 else 2) // 3, last)
                rows.append(part)
        level = np.zeros((sum(map(len, rows)), len(rows)))
        place = 0
        for i, part in enumerate(rows):
            level[place : place + len(part), i] = 1.0
            place += len(part)
        chosen = np.concatenate(rows)
        columns = [s**k for k in range(1, order + 1)]
        matrix = np.hstack([level, np.column_stack([c[chosen] for c in columns])])
        solution = np.linalg.lstsq(matrix, self.friction[chosen], rcond=None)[0][len(rows) :]
        trend = sum(c * x for c, x in zip(columns, solution, strict=True))
        note = f"a polynomial of order {order} was taken out of friction; it changes by {trend[-1] - trend[0]:.3g} over it"
        return replace(self, friction=_frozen(self.friction - trend), shear=None, notes=(*self.notes, note))

    def windows(self, before: Any = None, after: Any = None) -> tuple[Record, ...]:
        """One part around each velocity step, hold with its reslide, or step of normal stress.

        Parameters
        ----------
        before, after : float or str, optional
            Time to keep on both sides, s; halfway to the neighbouring steps unless given.
        """
        steps = [s for s in self.steps if s.kind != "reslide"]
        if not steps:
            raise NotAvailable(f"{self.source}: no steps were found in this record")
        times = [s.time for s in steps]
        ends = [self.time[0], *times, self.time[-1]]
        found = []
        for i, moment in enumerate(times):
            low = 0.5 * (ends[i] + moment) if before is None and i else ends[0]
            high = ends[i + 2] if i + 2 == len(ends) - 1 else 0.5 * (moment + ends[i + 2])
            low = low if before is None else max(moment - _seconds("before", before), self.time[0])
            high = high if after is None else min(moment + _seconds("after", after), self.time[-1])
            found.append(self.between(low, high))
        return tuple(found)

    def summary(self) -> str:
        """What is in it, in a few lines."""
        span = self.time[-1] - self.time[0]
        spacing = np.diff(self.time)
        low, high = float(np.min(self.friction)), float(np.max(self.friction))
        lines = [
            f"{self.source}: {len(self)} samples over {shown(float(span), 's')}, "
            f"one every {shown(float(np.median(spacing)), 's')}",
            f"friction        {low:.4g} to {high:.4g}",
        ]
        if self.normal is not None:
            stress = self.normal
            lines.append(f"normal stress   {shown(float(stress.min()), 'Pa')} to {shown(float(stress.max()), 'Pa')}")
        if self.displacement is not None:
            moved = float(self.displacement[-1] - self.displacement[0])
            lines.append(f"load point      {shown(moved, 'm')}, at first {shown(self.initial_rate or 0.0, 'm/s')}")
        lines += [f"step            {step}" for step in self.steps] or ["step            none found"]
        lines += [f"note            {note}" for note in self.notes]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()

    def plot(self, ax: Any = None) -> Any:
        """Draw friction, load-point rate and normal stress in time, with the steps found.

        Returns
        -------
        array of matplotlib.axes.Axes
        """
        from steadyslip import figures

        return figures.record(self, ax=ax)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the columns as text, units in the header, in the form that `read_record` understands.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        names = {"time": "Time (s)", "displacement": "Load displacement (m)", "velocity": "Load velocity (m/s)",
                 "friction": "Friction", "shear": "Shear stress (Pa)", "normal": "Normal stress (Pa)"}  # fmt: skip
        if self.integrated:
            del names["displacement"]
        present = {title: getattr(self, n) for n, title in names.items() if getattr(self, n) is not None}
        try:
            np.savetxt(path, np.column_stack(list(present.values())), "%.12g", ",", header=",".join(present), comments="")
        except OSError as error:
            raise NotAvailable(f"cannot write {str(path)!r}: {error.strerror or error}") from error


_OPTIONAL = ("normal", "shear", "displacement", "velocity")


def _frozen(values: Any) -> Array:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def _seconds(name: str, value: Any) -> float:
    try:
        return checked_number(Parameter("s", real, name), value)
    except ParameterError as error:
        raise ParameterError([p.under(name) for p in error.problems]) from error


def read_record(
    path: str | PathLike[str],
    *,
    area: Any = None,
    normal_stress: Any = None,
    table: str | None = None,
    between: tuple[Any, Any] | None = None,
    skip_bad_lines: bool = False,
    **columns: Any,
) -> Record:
    """Read a record of an experiment.

    Columns are found by their names, units read from them: ``Normal_stress(MPa)``, ``lp_disp_um``, ``time [s]``.
    Where that does not do, say it: ``time="t"`` (a column), ``shear="MPa"`` (a unit), ``normal=("sn", "MPa")``, or
    ``friction=3`` (the third column). Friction is shear over normal stress unless it has a column of its own.

    Parameters
    ----------
    path : path
        Text with any of the usual separators, with or without header; HDF5 (``.h5``, ``.hdf5``), MATLAB (``.mat``) or
        Parquet (``.parquet``).
    area : float or str, optional
        Contact area, m^2, where shear and normal are forces; 1 m^2 unless given, so that forces stay forces.
    normal_stress : float or str, optional
        A constant normal stress, Pa, where there is no column of it.
    table : str, optional
        Group of an HDF5 file, or variable of a MATLAB file.
    between : (start, end), optional
        Part to use, s.
    skip_bad_lines : bool, optional
        Leave damaged lines out, and note it, instead of refusing the file.
    **columns
        ``time``, ``displacement`` and ``velocity`` (of the load point), ``friction``, ``shear``, ``normal``.

    Returns
    -------
    Record
        Its `notes` say everything that was done.

    Raises
    ------
    ParameterError
        If columns are missing, ambiguous or without unit, or lines damaged; everything is listed.
    NotAvailable
        If the file cannot be read.
    """
    problems = [Problem(name, f"unknown column role; allowed: {', '.join(ROLES)}") for name in columns if name not in ROLES]
    if problems:
        raise ParameterError(problems, title=str(path))
    raw = read_columns(Path(path), table, skip_bad_lines)
    found, faults, notes = assigned(raw.names, columns, raw.units)
    if normal_stress is not None and "normal" in found and "normal" not in columns:
        del found["normal"]
    asked = set(found) | ({"normal"} if normal_stress is not None else set())
    faults += required({role: found.get(role) for role in asked}, raw.names)  # type: ignore[misc]
    if faults:
        raise ParameterError(faults, title=str(path))
    size = _area(area)
    si: dict[str, Array] = {}
    for role, column in found.items():
        si[role] = raw.values[raw.names.index(column.name)] * (column.factor / (size if column.force else 1.0))
        notes.append(f"{role}: column {column.name!r}" + _said_unit(column, size, area is None))
    if normal_stress is not None:
        level = _stress(normal_stress)
        si["normal"] = np.full(raw.values.shape[1], level)
        notes.append(f"normal: constant, {shown(level, 'Pa')}")
    lines = raw.lines
    if between is not None:
        si, lines = _cut(si, lines, between, notes)
    return _cleaned(si, str(path), [*raw.notes, *notes], lines)


def _cut(si: dict[str, Array], lines: Array, between: tuple[Any, Any], notes: list[str]) -> tuple[dict[str, Array], Array]:
    """Rows between two times; what lies outside need not even be sound."""
    first, last = _seconds("start", between[0]), _seconds("end", between[1])
    with np.errstate(invalid="ignore"):
        rows = (si["time"] >= first) & (si["time"] <= last)
    if np.sum(rows) < FEWEST_ROWS:
        span = f"{np.nanmin(si['time']):.6g} to {np.nanmax(si['time']):.6g} s"
        message = f"got {first:.6g} to {last:.6g} s, which leaves {np.sum(rows)} samples; the record is from {span}"
        raise ParameterError([Problem("between", message)])
    notes.append(f"cut to {first:.6g} to {last:.6g} s, {np.sum(rows)} of {len(lines)} rows")
    return {role: values[rows] for role, values in si.items()}, lines[rows]


def _area(area: Any) -> float:
    if area is None:
        return 1.0
    try:
        number = parse(area, "m^2") if isinstance(area, str) else float(area)
    except (QuantityError, TypeError, ValueError) as error:
        raise ParameterError([Problem("area", str(error))]) from error
    if not (number > 0 and np.isfinite(number)):
        raise ParameterError([Problem("area", f"got {area!r}; allowed: a number > 0 in m^2")])
    return number


def _stress(value: Any) -> float:
    try:
        number = parse(value, "Pa") if isinstance(value, str) else float(value)
    except (QuantityError, TypeError, ValueError) as error:
        raise ParameterError([Problem("normal_stress", str(error))]) from error
    if not (number > 0 and np.isfinite(number)):
        raise ParameterError([Problem("normal_stress", f"got {value!r}; allowed: a number > 0 in Pa")])
    return number


def _said_unit(column: Column, area: float, assumed: bool) -> str:
    text = f", {column.unit}" if column.unit != "1" else ""
    if column.force:
        text += f", a force over {area:g} m^2" + (" (assumed; give area)" if assumed else "")
    return text


def record_from_arrays(
    time: Any, *, friction: Any = None, shear: Any = None, normal: Any = None, displacement: Any = None,
    velocity: Any = None, source: str = "arrays",
) -> Record:  # fmt: skip
    """A record from arrays in SI units, cleaned like one that is read from a file.

    Parameters
    ----------
    time : array_like
        s.
    friction : array_like, optional
        Shear over normal stress unless given.
    shear, normal : array_like or float, optional
        Pa.
    displacement, velocity : array_like, optional
        Of the load point, m and m/s.
    source : str, optional

    Raises
    ------
    ParameterError
        If columns are missing, or of different lengths.
    """
    given: Mapping[str, Any] = {"time": time, "friction": friction, "shear": shear, "normal": normal,
                                "displacement": displacement, "velocity": velocity}  # fmt: skip
    si, problems = {}, []
    count = np.size(time)
    for role, values in given.items():
        if values is None:
            continue
        try:
            array = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            problems.append(Problem(role, f"got {values!r}; allowed: numbers in {ROLES[role]}"))
            continue
        if array.ndim == 0 and role == "normal":
            array = np.full(count, float(array))
        if array.shape != (count,):
            problems.append(Problem(role, f"got an array of shape {array.shape}; allowed: as many as times, {count}"))
        si[role] = array
    if "friction" not in si and not {"shear", "normal"} <= set(si):
        problems.append(Problem("friction", "missing; give friction, or shear and normal"))
    if problems:
        raise ParameterError(problems, title=source)
    return _cleaned(si, source, [], np.arange(1, count + 1))


# -- cleaning


def _cleaned(si: dict[str, Array], source: str, notes: list[str], lines: Array) -> Record:
    """Rows in order of time, each whole, with a note of every one that is not."""
    si, lines = _without_gaps_in_rows(si, lines, notes)
    if len(lines) >= FEWEST_ROWS:
        si, lines = _in_order(si, lines, notes)
    if len(lines) < FEWEST_ROWS:
        message = f"{len(lines)} usable rows are left; a record needs {FEWEST_ROWS} or more"
        raise ParameterError([Problem("file", message)], title=source)
    _check_stress(si, source, lines)
    if "friction" not in si:
        si["friction"] = si["shear"] / si["normal"]
        notes.append("friction computed as shear over normal stress")
    _check_friction(si["friction"], source)
    spacing = np.diff(si["time"])
    usual = float(np.median(spacing))
    wide = np.flatnonzero(spacing > GAP * np.maximum(_local_median(spacing), 1e-300))
    if len(wide):
        shown_gaps = ", ".join(f"{si['time'][i]:.6g} s ({spacing[i]:.3g} s long)" for i in wide[:3])
        notes.append(f"{len(wide)} gaps in time, the first at {shown_gaps}; inputs are taken as linear across")
    if spacing.max() > 1.5 * spacing.min():
        notes.append(f"sampling is not uniform: every {spacing.min():.3g} to {spacing.max():.3g} s, usually {usual:.3g} s")
    if "displacement" in si:
        back = np.diff(si["displacement"]) < 0
        if np.any(back):
            most = float(-np.min(np.diff(si["displacement"])))
            notes.append(
                f"the load point steps back {int(back.sum())} times, by up to {shown(most, 'm')}; kept as measured"
            )
        if "velocity" in si:
            notes.append("the load point's displacement drives the model; its velocity column is only shown")
    integrated = "displacement" not in si and "velocity" in si
    if integrated:
        steps = 0.5 * (si["velocity"][1:] + si["velocity"][:-1]) * spacing
        si["displacement"] = np.concatenate([[0.0], np.cumsum(steps)])
        notes.append("displacement of the load point integrated from its velocity")
    columns = {name: None if name not in si else _frozen(si[name]) for name in ("normal", "shear", "displacement", "velocity")}
    return Record(_frozen(si["time"]), _frozen(si["friction"]), source=source, notes=tuple(notes), integrated=integrated, **columns)  # type: ignore[arg-type]


def _without_gaps_in_rows(si: dict[str, Array], lines: Array, notes: list[str]) -> tuple[dict[str, Array], Array]:
    bad = ~np.all([np.isfinite(values) for values in si.values()], axis=0)
    if not np.any(bad):
        return si, lines
    which = [role for role, values in si.items() if not np.all(np.isfinite(values))]
    where = ", ".join(map(str, lines[bad][:5]))
    more = ", ..." if bad.sum() > 5 else ""
    notes.append(f"{int(bad.sum())} rows without a number in {', '.join(which)} left out (lines {where}{more})")
    return {role: values[~bad] for role, values in si.items()}, lines[~bad]


def _in_order(si: dict[str, Array], lines: Array, notes: list[str]) -> tuple[dict[str, Array], Array]:
    """Rows whose time goes back are left out; rows at the same time become their mean."""
    time = si["time"]
    high = np.maximum.accumulate(time)
    back = time < high
    if np.any(back):
        where = ", ".join(map(str, lines[back][:5]))
        notes.append(f"{int(back.sum())} rows whose time goes back left out (lines {where}{', ...' if back.sum() > 5 else ''})")
        si, lines, time = {role: values[~back] for role, values in si.items()}, lines[~back], time[~back]
    unique, first, counts = np.unique(time, return_index=True, return_counts=True)
    if len(unique) < len(time):
        notes.append(f"{len(time) - len(unique)} rows repeat the time of the row before; each such group became its mean")
        si = {role: np.add.reduceat(values, first) / counts for role, values in si.items()}
        si["time"], lines = unique, lines[first]
    return si, lines


def _local_median(spacing: Array) -> Array:
    """Usual spacing in blocks, so that a change of sampling rate is no row of gaps."""
    block = 51
    if len(spacing) < 2 * block:
        return np.full(len(spacing), np.median(spacing))
    count = len(spacing) // block
    medians = np.median(spacing[: count * block].reshape(count, block), axis=1)
    return np.asarray(medians[np.minimum(np.arange(len(spacing)) // block, count - 1)])


def _check_stress(si: dict[str, Array], source: str, lines: Array) -> None:
    if "normal" in si and not np.all(si["normal"] > 0):
        i = int(np.argmin(si["normal"] > 0))
        message = (
            f"line {lines[i]}: normal stress is {si['normal'][i]:.4g} Pa; it must be > 0 (compression) wherever the record "
            "is used; cut it with between=(start, end)"
        )
        raise ParameterError([Problem("normal", message)], title=source)


def _check_friction(friction: Array, source: str) -> None:
    usual = float(np.median(np.abs(friction)))
    if not PLAUSIBLE[0] <= usual <= PLAUSIBLE[1]:
        message = (
            f"the friction coefficient is about {usual:.3g}, which no contact has; are shear and normal in the units that "
            "their names say, or is the friction column a stress?"
        )
        raise ParameterError([Problem("friction", message)], title=source)


# -- thinning


def transient_rows(record: Record, count: int) -> Array:
    """Rows to keep of a record: as many after every step as before the next, evenly in the logarithm of time."""
    time, n = record.time, len(record)
    usual = float(np.median(np.diff(time)))
    weight = np.full(n, 1.0 / (time[-1] - time[0]))  # samples wanted per second
    moments = [time[0], *(step.time for step in record.steps if step.kind != "normal-stress oscillation")]
    for i, moment in enumerate(moments):
        after = time >= moment - 2 * usual
        share = 0.3 if i == 0 and len(moments) > 1 else 1.0
        weight += share * np.where(after, 1.0 / (np.maximum(time - moment, 0.0) + 5 * usual), 0.0) / 8.0
    spacing = np.gradient(time)
    low, high = 0.0, 1e6 * count
    for _ in range(60):
        scale = 0.5 * (low + high)
        if np.sum(np.minimum(weight * spacing * scale, 1.0)) < count:
            low = scale
        else:
            high = scale
    cumulated = np.cumsum(np.minimum(weight * spacing * high, 1.0))
    chosen = np.searchsorted(cumulated, np.arange(0.5, cumulated[-1], 1.0))
    return np.unique(np.concatenate([[0], np.minimum(chosen, n - 1), [n - 1]]))
