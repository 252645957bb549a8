"""From a file, or from arrays, to a clean Record; nothing is mended without a note."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.quantities import shown
from steadyslip.core.roles import Parameter, positive
from steadyslip.experiments.measured.columns import ROLES, Column, assigned, required
from steadyslip.experiments.measured.formats import read_columns
from steadyslip.experiments.measured.record import FEWEST_ROWS, Record, frozen, seconds

Array = np.ndarray
GAP = 10.0  # times the usual spacing
RESTART = 0.02  # of the rows: so many on end whose time goes back are a clock that begins anew
COARSE, EVEN = 0.6, 1.25  # share of rows with a time of their own; ticks by which even rows may miss their stamps
AROUND = 25  # rows before and behind, from which that is told
HUGEST = 1e60  # of a number in SI units
PLAUSIBLE = (1e-3, 10.0)  # friction coefficients


@checked()
def read_record(
    path: str | PathLike[str],
    *,
    area: Any = None,
    normal_stress: Any = None,
    table: str | None = None,
    between: tuple[Any, Any] | None = None,
    skip_bad_lines: bool = False,
    sampling: Any = None,
    rate: Any = None,
    **columns: Any,
) -> Record:
    """Read a record of an experiment.

    Columns are found by their names, units read from them: ``Normal_stress(MPa)``, ``lp_disp_um``, ``time [s]``.
    Where that does not do, say it: ``time="t"`` (a column), ``shear="MPa"`` (a unit), ``normal=("sn", "MPa")``, or
    ``friction=3`` (the third column). Friction is shear over normal stress unless it has a column of its own.

    Parameters
    ----------
    path : path
        Text with any of the usual separators, with or without header, times in numbers, as a clock (``12:30:01.5``) or
        with a date (ISO 8601); HDF5 (``.h5``, ``.hdf5``), MATLAB (``.mat``), Parquet (``.parquet``), Excel (``.xlsx``),
        TDMS (``.tdms``), netCDF (``.nc``, saved runs among them); binary files of XLOOK, whatever their name.
    area : float or str, optional
        Contact area, m^2, where shear and normal are forces; 1 m^2 unless given, so that forces stay forces.
    normal_stress : float or str, optional
        A constant normal stress, Pa, where there is no column of it.
    table : str, optional
        Group of an HDF5 or TDMS file, variable of a MATLAB file (``p1``, or ``p1.data`` in a structure), or sheet of a
        workbook.
    between : (start, end), optional
        Part to use, s.
    skip_bad_lines : bool, optional
        Leave damaged lines out, and note it, instead of refusing the file.
    sampling : float or str, optional
        Time between rows, s, of a file without a column of time.
    rate : float or str, optional
        Constant rate of the load point, m/s, of a file with its displacement and no time. With neither, and both
        displacement and velocity measured, time is counted from these.
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
    problems = [
        Problem(name, f"unknown column role; allowed: {', '.join(ROLES)}") for name in columns if name not in ROLES
    ]
    if problems:
        raise ParameterError(problems, title=str(path))
    raw = read_columns(Path(path), table, skip_bad_lines)
    found, faults, notes = assigned(raw.names, columns, raw.units)
    if normal_stress is not None and "normal" in found and "normal" not in columns:
        del found["normal"]
    asked = set(found) | ({"normal"} if normal_stress is not None else set())
    clock = None if "time" in found else _clock(sampling, rate, set(found))
    if clock is not None:
        asked.add("time")
    faults += required({role: found.get(role) for role in asked}, raw.names)  # type: ignore[misc]
    if faults:
        raise ParameterError(faults, title=str(path))
    size = 1.0 if area is None else _checked("area", "m^2", area)
    si: dict[str, Array] = {}
    for role, column in found.items():
        si[role] = raw.values[column.place] * (column.factor / (size if column.force else 1.0))
        notes.append(f"{role}: column {column.name!r}" + _said_unit(column, size, area is None))
    if normal_stress is not None:
        level = _checked("normal_stress", "Pa", normal_stress)
        si["normal"] = np.full(raw.values.shape[1], level)
        notes.append(f"normal: constant, {shown(level, 'Pa')}")
    if clock is not None:
        si["time"], how = clock(si, raw.values.shape[1])
        notes.append(how)
    lines = raw.lines
    if between is not None:
        si, lines = _cut(si, lines, between, notes)
    return _cleaned(si, str(path), [*raw.notes, *notes], lines)


def _clock(sampling: Any, rate: Any, roles: set[str]) -> Callable[[dict[str, Array], int], tuple[Array, str]] | None:
    """How to make the times of a file that has none, and what to say of it; None if that cannot be."""
    if sampling is not None:
        every = _checked("sampling", "s", sampling)
        return lambda si, rows: (every * np.arange(rows), f"time: counted, a row every {shown(every, 's')}")
    if rate is not None and "displacement" in roles:
        speed = _checked("rate", "m/s", rate)
        said = f"time: displacement over the given rate, {shown(speed, 'm/s')}"
        return lambda si, rows: ((si["displacement"] - si["displacement"][0]) / speed, said)
    if {"displacement", "velocity"} <= roles:
        return lambda si, rows: (_elapsed(si["displacement"], si["velocity"]), "time: displacement over its own rate")
    return None


def _elapsed(displacement: Array, velocity: Array) -> Array:
    """The time that each stretch takes at the mean of its rates; where nothing moves there is no telling."""
    with np.errstate(divide="ignore", invalid="ignore"):
        spent = np.diff(displacement) / (0.5 * (velocity[1:] + velocity[:-1]))
    return np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(spent), np.maximum(spent, 0.0), 0.0))])


def _cut(
    si: dict[str, Array], lines: Array, between: tuple[Any, Any], notes: list[str]
) -> tuple[dict[str, Array], Array]:
    """Rows between two times; what lies outside need not even be sound."""
    first, last = seconds("start", between[0]), seconds("end", between[1])
    with np.errstate(invalid="ignore"):
        rows = (si["time"] >= first) & (si["time"] <= last)
    if np.sum(rows) < FEWEST_ROWS:
        span = f"{np.nanmin(si['time']):.6g} to {np.nanmax(si['time']):.6g} s"
        message = f"got {first:.6g} to {last:.6g} s, which leaves {np.sum(rows)} samples; the record is from {span}"
        raise ParameterError([Problem("between", message)])
    notes.append(f"cut to {first:.6g} to {last:.6g} s, {np.sum(rows)} of {len(lines)} rows")
    return {role: values[rows] for role, values in si.items()}, lines[rows]


def _checked(name: str, unit: str, value: Any) -> float:
    try:
        return Parameter(unit, positive, name).checked(value)
    except ParameterError as error:
        raise ParameterError([p.under(name) for p in error.problems]) from error


def _said_unit(column: Column, area: float, assumed: bool) -> str:
    text = f", {column.unit}" if column.unit != "1" else ""
    if column.force:
        text += f", a force over {area:g} m^2" + (" (assumed; give area)" if assumed else "")
    return text


@checked()
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
    _check_sizes(si, source, lines)
    if len(lines) >= FEWEST_ROWS:
        si, lines = _in_order(si, lines, notes, source)
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
        notes.append(
            f"sampling is not uniform: every {spacing.min():.3g} to {spacing.max():.3g} s, usually {usual:.3g} s"
        )
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
    normal, shear, displacement, velocity = (
        None if name not in si else frozen(si[name]) for name in ("normal", "shear", "displacement", "velocity")
    )
    time, friction = frozen(si["time"]), frozen(si["friction"])
    return Record(time, friction, normal, shear, displacement, velocity, source, tuple(notes), integrated)


def _without_gaps_in_rows(si: dict[str, Array], lines: Array, notes: list[str]) -> tuple[dict[str, Array], Array]:
    bad = ~np.all([np.isfinite(values) for values in si.values()], axis=0)
    if not np.any(bad):
        return si, lines
    which = [role for role, values in si.items() if not np.all(np.isfinite(values))]
    where = ", ".join(map(str, lines[bad][:5]))
    more = ", ..." if bad.sum() > 5 else ""
    notes.append(f"{int(bad.sum())} rows without a number in {', '.join(which)} left out (lines {where}{more})")
    return {role: values[~bad] for role, values in si.items()}, lines[~bad]


def _in_order(si: dict[str, Array], lines: Array, notes: list[str], source: str) -> tuple[dict[str, Array], Array]:
    """Rows whose time goes back are left out, rows of one time told apart: see `_stamped`."""
    time = si["time"]
    high = np.maximum.accumulate(time)
    back = time < high
    if np.any(back):
        _check_clock(time, high, back, lines, source)
        where = ", ".join(map(str, lines[back][:5]))
        notes.append(
            f"{int(back.sum())} rows whose time goes back left out (lines {where}{', ...' if back.sum() > 5 else ''})"
        )
        si, lines, time = {role: values[~back] for role, values in si.items()}, lines[~back], time[~back]
    return _stamped(si, lines, notes)


def _check_clock(time: Array, high: Array, back: Array, lines: Array, source: str) -> None:
    """Refuse a clock that begins anew: what follows would be left out, or be taken for a jump of everything."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], back, [False]]).astype(int)))
    begin, end = ends.reshape(-1, 2)[int(np.argmax(ends[1::2] - ends[::2]))]
    if end - begin > max(RESTART * len(time), FEWEST_ROWS):
        message = (
            f"line {lines[begin]}: the clock begins anew, {time[begin]:.6g} s after {high[begin]:.6g} s, for "
            f"{end - begin} rows; give each part as a file of its own, or mend the time"
        )
        raise ParameterError([Problem("time", message)], title=source)


def _even(time: Array) -> Array | None:
    """Times of rows that were taken evenly and stamped by a clock coarser than that; None if they were not."""
    rows = np.arange(len(time), dtype=float)
    tick = float(np.min(np.diff(np.unique(time))))
    slope, origin = np.polyfit(rows, time, 1)
    rest = time - (origin + slope * rows)
    if not (slope > 0 and float(np.ptp(rest)) < EVEN * tick):
        return None
    return np.asarray(time[0] + slope * rows)


def _stamped(si: dict[str, Array], lines: Array, notes: list[str]) -> tuple[dict[str, Array], Array]:
    """Rows of one time: a clock that is coarser than the sampling, or rows too many.

    Where a group takes the place of so many samples at the usual spacing around it, its rows are spread evenly over
    the time to the next stamp. Else it is one sample, its mean: another time for one of its rows would be an invention.
    """
    time = si["time"]
    unique, first, counts = np.unique(time, return_index=True, return_counts=True)
    if len(unique) == len(time):
        return si, lines
    uneven = len(unique) < COARSE * len(time) and np.ptp(counts[1:-1]) > 0  # groups of equal size are spread exactly
    if uneven and (even := _even(time)) is not None:
        notes.append(
            f"the clock is coarser than the sampling ({len(unique)} times for {len(time)} rows); rows taken as even, "
            f"every {even[1] - even[0]:.4g} s"
        )
        return si | {"time": even}, lines
    gaps = np.diff(unique, append=2 * unique[-1] - unique[-2])
    around = np.clip(first[:, None] + np.array([-AROUND, AROUND]), 0, len(time) - 1)
    usual = (time[around[:, 1]] - time[around[:, 0]]) / np.maximum(np.diff(around, axis=1)[:, 0], 1)
    with np.errstate(divide="ignore"):
        spread = (counts > 1) & (np.abs(np.log(gaps / (counts * usual))) < np.abs(np.log(gaps / usual)))
    own = np.repeat(np.arange(len(unique)), counts)
    place = np.arange(len(time)) - first[own]
    time = np.where(spread[own], unique[own] + place * gaps[own] / counts[own], time)
    starts = np.unique(time, return_index=True)[1]
    sizes = np.diff(starts, append=len(time))
    if np.any(spread):
        rows = int(np.sum(counts[spread]))
        notes.append(f"{rows} rows share a time with others; spread evenly to the next, as the usual spacing has it")
    if len(starts) < len(time):
        rows = len(time) - len(starts)
        notes.append(f"{rows} rows repeat the time of the row before; each such group became its mean")
    si = {role: np.add.reduceat(values, starts) / sizes for role, values in si.items()}
    si["time"] = time[starts]
    return si, lines[starts]


def _local_median(spacing: Array) -> Array:
    """Usual spacing in blocks, so that a change of sampling rate is no row of gaps."""
    block = 51
    if len(spacing) < 2 * block:
        return np.full(len(spacing), np.median(spacing))
    count = len(spacing) // block
    medians = np.median(spacing[: count * block].reshape(count, block), axis=1)
    return np.asarray(medians[np.minimum(np.arange(len(spacing)) // block, count - 1)])


def _check_sizes(si: dict[str, Array], source: str, lines: Array) -> None:
    """Refuse numbers that no experiment gives and whose squares or ratios are none, and a clock that stands still."""
    problems = []
    for role, values in si.items():
        if np.any(huge := np.abs(values) > HUGEST):
            i = int(np.argmax(huge))
            message = f"line {lines[i]}: {values[i]:.4g} in SI units; allowed: sizes up to {HUGEST:g}"
            problems.append(Problem(role, message))
    time = si["time"]
    if len(time) and not np.ptp(time) > 1 / HUGEST:
        message = f"all {len(time)} rows lie within {1 / HUGEST:g} s of {time[0]:.4g} s; was the clock running?"
        problems.append(Problem("time", message))
    if problems:
        raise ParameterError(problems, title=source)


def _check_stress(si: dict[str, Array], source: str, lines: Array) -> None:
    if "normal" in si and not np.all(si["normal"] > 0):
        i = int(np.argmin(si["normal"] > 0))
        message = (
            f"line {lines[i]}: normal stress is {si['normal'][i]:.4g} Pa; it must be > 0 (compression) in the part "
            "that is used; cut it with between = [start, end]"
        )
        raise ParameterError([Problem("normal", message)], title=source)


def _check_friction(friction: Array, source: str) -> None:
    usual = float(np.median(np.abs(friction)))
    if not PLAUSIBLE[0] <= usual <= PLAUSIBLE[1]:
        message = (
            f"the friction coefficient is about {usual:.3g}, which no contact has; are shear and normal in the units "
            "that their names say, or is the friction column a stress?"
        )
        raise ParameterError([Problem("friction", message)], title=source)
