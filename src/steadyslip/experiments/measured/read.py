"""Reading of a record from a file or from arrays; every change to the data is noted."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem, keywords_of, refuse_unknown
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked
from steadyslip.core.roles import Parameter
from steadyslip.experiments.measured.clean import ASSUMED, cleaned, without_placeholders
from steadyslip.experiments.measured.columns import ROLES, Column, assign_columns, listed, missing_roles
from steadyslip.experiments.measured.formats import read_columns
from steadyslip.experiments.measured.record import FEWEST_ROWS, Record, seconds

ACROSS = re.compile(r"slip|fault", re.IGNORECASE)  # in names of displacements across the fault, not of the load point


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

    Columns are found by their names, units are read from them: ``Normal_stress(MPa)``, ``lp_disp_um``, ``time [s]``.
    Otherwise give them: ``time="t"`` (a column), ``shear="MPa"`` (a unit), ``normal=("sn", "MPa")``, or ``friction=3``
    (the third column). Friction is shear over normal stress unless the file has a column of friction. If it has a
    column of pore pressure, its normal stress is the total one, and friction is shear over effective normal stress.

    Parameters
    ----------
    path : path
        Text with any of the usual separators, with or without header; times are numbers, times of day (``12:30:01.5``)
        or dates (ISO 8601). Also HDF5 (``.h5``, ``.hdf5``), MATLAB (``.mat``), Parquet (``.parquet``), Excel
        (``.xlsx``), TDMS (``.tdms``), netCDF (``.nc``, such as saved runs), and binary files of XLOOK with any name.
    area : float or str, optional
        Contact area, m^2, if shear and normal are forces; by default 1 m^2, so that forces stay forces.
    normal_stress : float or str, optional
        Constant normal stress, Pa, if the file has no column for it.
    table : str, optional
        Group of an HDF5 or TDMS file, variable of a MATLAB file (``p1``, ``p1.data`` in a structure, ``p(2)`` in an
        array of them), or sheet of a workbook.
    between : (start, end), optional
        Part to use, s.
    skip_bad_lines : bool, optional
        True to omit damaged lines with a note, instead of refusing the file.
    sampling : float or str, optional
        Time between rows, s, for a file without a column of time.
    rate : float or str, optional
        Constant rate of the load point, m/s, for a file with its displacement but no time. Without `sampling` and
        `rate`, time is computed from displacement and velocity if both were measured.
    **columns
        Columns by role: ``time``, ``displacement`` and ``velocity`` (of the load point), ``friction``, ``shear``,
        ``normal``, ``pore_pressure``. A column without a role is left out, with a note.

    Returns
    -------
    Record
        Its `notes` list everything that was changed.

    Raises
    ------
    ParameterError
        If columns are missing, ambiguous or without unit, or lines damaged; lists every problem.
    NotAvailable
        If the file cannot be read.

    Examples
    --------
    >>> print(ss.read_record("examples/data/made_velocity_step.csv"))
    examples/data/made_velocity_step.csv: 401 samples over 80 s, one every 200 ms
    friction        0.5959 to 0.61
    normal stress   5 MPa to 5 MPa
    load point      200 um, at first 1 um/s
    step            velocity step at 20 s: 1 um/s to 3 um/s
    note            time: column 'time (s)', s
    note            displacement: column 'displacement (um)', um
    note            friction: column 'friction'
    note            normal: column 'normal stress (MPa)', MPa
    """
    refuse_unknown("read_record", columns, [*ROLES, *keywords_of(read_record, ["path"])], "column role or option")
    raw = read_columns(Path(path), table, skip_bad_lines)
    found, faults, notes = assign_columns(raw.names, columns, raw.units)
    if normal_stress is not None and "normal" in found and "normal" not in columns:
        del found["normal"]
    asked = set(found) | ({"normal"} if normal_stress is not None else set())
    clock = None if "time" in found else _clock(sampling, rate, set(found))
    if clock is not None:
        asked.add("time")
    faults += missing_roles({role: found.get(role) for role in asked}, raw.names)  # type: ignore[misc]
    if faults:
        raise ParameterError(faults, title=str(path))
    size = 1.0 if area is None else checked_option("area", "m^2", area)
    si: dict[str, Array] = {}
    for role, column in found.items():
        own = without_placeholders(raw.values[column.place], column.name, notes)
        si[role] = own * (column.factor / (size if column.force else 1.0))
        notes.append(f"{role}: column {column.name!r}" + _format_unit(column, size, area is None))
        if role == "displacement" and ACROSS.search(column.name):
            notes.append(
                "this displacement is measured across the fault, by its name, and cannot show how a servo follows"
            )
    taken = {column.place for column in found.values()}
    if unread := [repr(name) for i, name in enumerate(raw.names) if i not in taken]:
        notes.append(f"left out: {listed(unread)}; to use a column give its role, such as pore_pressure=NAME")
    if normal_stress is not None:
        level = checked_option("normal_stress", "Pa", normal_stress)
        si["normal"] = np.full(raw.values.shape[1], level)
        notes.append(f"normal: constant, {format_quantity(level, 'Pa')}")
    if clock is not None:
        si["time"], how = clock(si, raw.values.shape[1])
        notes.append(how)
    lines = raw.lines
    if between is not None:
        si, lines = cut_between(si, lines, between, notes)
    return cleaned(si, str(path), [*raw.notes, *notes], lines, any_sign=True)


def _clock(sampling: Any, rate: Any, roles: set[str]) -> Callable[[dict[str, Array], int], tuple[Array, str]] | None:
    """Function that computes times, and a note, for a file without a time column; None if they are unknown."""
    if sampling is not None:
        every = checked_option("sampling", "s", sampling)
        return lambda si, rows: (every * np.arange(rows), f"time: counted, a row every {format_quantity(every, 's')}")
    if rate is not None and "displacement" in roles:
        speed = checked_option("rate", "m/s", rate)
        said = f"time: displacement over the given rate, {format_quantity(speed, 'm/s')}"
        return lambda si, rows: ((si["displacement"] - si["displacement"][0]) / speed, said)
    if {"displacement", "velocity"} <= roles:
        return lambda si, rows: (
            _integrated_time(si["displacement"], si["velocity"]),
            "time: displacement over its own rate",
        )
    return None


def _integrated_time(displacement: Array, velocity: Array) -> Array:
    """Elapsed time (s) at each row from displacement and velocity; rows without motion add no time."""
    with np.errstate(divide="ignore", invalid="ignore"):
        spent = np.diff(displacement) / (0.5 * (velocity[1:] + velocity[:-1]))
    return np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(spent), np.maximum(spent, 0.0), 0.0))])


def cut_between(
    si: dict[str, Array], lines: Array, between: tuple[Any, Any], notes: list[str]
) -> tuple[dict[str, Array], Array]:
    """Columns and line numbers of the rows between two times; times of other rows may be missing."""
    first, last = seconds("start", between[0]), seconds("end", between[1])
    with np.errstate(invalid="ignore"):
        rows = (si["time"] >= first) & (si["time"] <= last)
    if np.sum(rows) < FEWEST_ROWS:
        span = f"{np.nanmin(si['time']):.6g} to {np.nanmax(si['time']):.6g} s"
        message = f"got {first:.6g} to {last:.6g} s, which leaves {np.sum(rows)} samples; the record is from {span}"
        raise ParameterError([Problem("between", message)])
    notes.append(f"cut to {first:.6g} to {last:.6g} s, {np.sum(rows)} of {len(lines)} rows")
    return {role: values[rows] for role, values in si.items()}, lines[rows]


def checked_option(name: str, unit: str, value: Any) -> float:
    """Positive value of the option `name` in the SI unit `unit`, from a number or a text with a unit."""
    try:
        return Parameter(unit, positive, name).checked(value)
    except ParameterError as error:
        raise ParameterError([p.under(name) for p in error.problems]) from error


def _format_unit(column: Column, area: float, assumed: bool) -> str:
    text = f", {column.unit}" if column.unit != "1" else ""
    if column.force:
        text += f", a force over {area:g} m^2" + (f" {ASSUMED}" if assumed else "")
    return text


@checked()
def record_from_arrays(
    time: Any, *, friction: Any = None, shear: Any = None, normal: Any = None, displacement: Any = None,
    velocity: Any = None, pore_pressure: Any = None, source: str = "arrays",
) -> Record:  # fmt: skip
    """Make a record from arrays in SI units, which are cleaned like columns of a file.

    Parameters
    ----------
    time : array_like
        s.
    friction : array_like, optional
        By default shear over normal stress.
    pore_pressure : array_like or float, optional
        Pa; `normal` is then the total normal stress.
    shear, normal : array_like or float, optional
        Pa.
    displacement, velocity : array_like, optional
        Displacement (m) and velocity (m/s) of the load point.
    source : str, optional

    Raises
    ------
    ParameterError
        If columns are missing, or differ in length.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.linspace(0, 100, 1001)
    >>> velocity = np.where(time < 50, 1e-6, 1e-5)
    >>> friction = 0.6 + np.where(time < 50, 0, 0.01 * np.exp((50 - time) / 5))
    >>> print(ss.record_from_arrays(time, friction=friction, normal=5e6, velocity=velocity))
    arrays: 1001 samples over 100 s, one every 100 ms
    friction        0.6 to 0.61
    normal stress   5 MPa to 5 MPa
    load point      550.5 um, at first 1 um/s
    step            velocity step at 49.95 s: 1 um/s to 10 um/s
    note            displacement of the load point integrated from its velocity
    """
    given: Mapping[str, Any] = {"time": time, "friction": friction, "shear": shear, "normal": normal,
                                "displacement": displacement, "velocity": velocity,
                                "pore_pressure": pore_pressure}  # fmt: skip
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
        if array.ndim == 0 and role in ("normal", "pore_pressure"):
            array = np.full(count, float(array))
        if array.shape != (count,):
            problems.append(Problem(role, f"got an array of shape {array.shape}; allowed: as many as times, {count}"))
        si[role] = array
    if "friction" not in si and not {"shear", "normal"} <= set(si):
        problems.append(Problem("friction", "missing; give friction, or shear and normal"))
    if problems:
        raise ParameterError(problems, title=source)
    return cleaned(si, source, [], np.arange(1, count + 1))
