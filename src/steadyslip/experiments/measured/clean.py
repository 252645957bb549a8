"""Conversion of columns in SI units to a Record of complete rows in order of time, with a note of every change."""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_count, format_quantity
from steadyslip.experiments.measured.record import FEWEST_ROWS, Record, frozen

GAP = 10.0  # an interval is noted as a gap if it exceeds this multiple of the usual spacing; chosen by trial
RESTART = 0.02  # a clock restarted if more than this share of the rows, successive ones, is before the latest time
COARSE, EVEN = 0.6, 1.25
"""A clock may be coarser than the sampling if a smaller share of the rows (first number) has distinct times, and if the
range of times minus evenly spaced times is smaller than the second number, in ticks of the clock."""
AROUND = 25  # the usual spacing is the mean over this many rows on each side; chosen by trial
LARGEST_NUMBER = 1e60  # largest number allowed in SI units: squares and ratios then stay within double precision
ASSUMED = "(assumed; give area)"  # in the note on a force without an area: its stress is then meaningless
PLAUSIBLE = (1e-3, 10.0)  # plausible friction coefficients: outside this range, the unit of a stress is wrong
USUAL = {
    "the load point moves at": ("m/s", (5e-9, 1e-3), "displacement and time in the units stated (um, s)"),
    "the load point moves": ("m", (0.0, 0.1), "displacements in the unit stated (um, not mm)"),
    "samples come every": ("s", (5e-5, 10.0), "times in the unit stated (s, not ms)"),
    "the normal stress is": ("Pa", (2e5, 2e9), "stresses in the unit stated (MPa, not kPa)"),
}
"""Unit, usual range of the mean in a laboratory, and advice, for each quantity; most errors by 1000 are noticed."""
PLACEHOLDERS = (999.0, 999.25, 9999.0, 9999.25, 99999.0, 999999.0, 1e20, 1e30, 9.9e37, 9.91e37, 9.969209968386869e36)
"""Placeholders, of either sign, that instruments and programs write for missing values."""
PLACEHOLDER_RATIO = 4.0
"""Least ratio of a placeholder to the largest other number of its column; chosen by trial. A placeholder whose sign no
other number has may be smaller."""
PLACEHOLDER_TOLERANCE = 1e-6  # relative difference from a placeholder: single precision, and rounding when printed
MOST_PLACEHOLDERS = 0.2  # a number that makes up a larger share of its column was measured; chosen by trial


def without_placeholders(values: Array, name: str, notes: list[str]) -> Array:
    """Column with NaN in place of placeholders for missing values; adds a note for each.

    A placeholder is rare and far from all other numbers of its column: measured values that pass 999 are kept.
    """
    found = values
    while (number := _placeholder(found)) is not None:
        same = np.abs(found - number) <= PLACEHOLDER_TOLERANCE * abs(number)
        found = np.where(same, np.nan, found)
        notes.append(f"{number:.6g} marks a missing value {int(np.sum(same))} times in column {name!r}")
    return found


def _placeholder(values: Array) -> float | None:
    """Smallest or largest number of a column, if it is a placeholder for missing values; else None."""
    usual = values[np.isfinite(values)]
    for number in (float(np.min(usual)), float(np.max(usual))) if len(usual) else ():
        size = abs(number)
        if not any(abs(size - one) <= PLACEHOLDER_TOLERANCE * one for one in PLACEHOLDERS):
            continue
        rest = usual[np.abs(usual - number) > PLACEHOLDER_TOLERANCE * size]
        if len(usual) - len(rest) > MOST_PLACEHOLDERS * len(rest):
            continue
        low, high = float(np.min(rest)), float(np.max(rest))
        if size > PLACEHOLDER_RATIO * max(-low, high) or number < 0.0 <= low or high <= 0.0 < number:
            return number
    return None


def cleaned(si: dict[str, Array], source: str, notes: list[str], lines: Array, any_sign: bool = False) -> Record:
    """Record from columns in SI units: complete rows in order of time, with a note of every change.

    If `any_sign` is true, the signs of columns that count compression or displacement as negative, as some files do,
    are changed.
    """
    si, lines = rows_in_order(si, source, notes, lines)
    si = _in_compression(si, notes) if any_sign else si
    si = _effective(si, notes)
    _check_stress(si, source, lines)
    if "friction" not in si:
        si["friction"] = si["shear"] / si["normal"]
        notes.append("friction computed as shear over normal stress")
    si = _turned_forwards(si, notes) if any_sign else si
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
                f"the load point steps back {int(back.sum())} times, by up to "
                f"{format_quantity(most, 'm')}; kept as measured"
            )
        if "velocity" in si:
            notes.append("the load point's displacement drives the model; its velocity column is only plotted")
    integrated = "displacement" not in si and "velocity" in si
    if integrated:
        steps = 0.5 * (si["velocity"][1:] + si["velocity"][:-1]) * spacing
        si["displacement"] = np.concatenate([[0.0], np.cumsum(steps)])
        notes.append("displacement of the load point integrated from its velocity")
    notes += _unusual(si, any(ASSUMED in note for note in notes))
    normal, shear, displacement, velocity = (
        None if name not in si else frozen(si[name]) for name in ("normal", "shear", "displacement", "velocity")
    )
    time, friction = frozen(si["time"]), frozen(si["friction"])
    pores = None if "pore_pressure" not in si else frozen(si["pore_pressure"])
    columns = (time, friction, normal, shear, displacement, velocity)
    return Record(*columns, source, tuple(notes), integrated, pore_pressure=pores)


def rows_in_order(si: dict[str, Array], source: str, notes: list[str], lines: Array) -> tuple[dict[str, Array], Array]:
    """Complete rows in order of time, and their lines in the file.

    Raises
    ------
    ParameterError
        If fewer than `FEWEST_ROWS` are left, numbers are impossibly large, or the clock stands still or restarts.
    """
    si, lines = _without_gaps_in_rows(si, lines, notes)
    _check_sizes(si, source, lines)
    if len(lines) >= FEWEST_ROWS:
        si, lines = _in_order(si, lines, notes, source)
    if len(lines) < FEWEST_ROWS:
        message = f"{len(lines)} usable rows are left; a record needs {FEWEST_ROWS} or more"
        raise ParameterError([Problem("file", message)], title=source)
    return si, lines


def _without_gaps_in_rows(si: dict[str, Array], lines: Array, notes: list[str]) -> tuple[dict[str, Array], Array]:
    bad = ~np.all([np.isfinite(values) for values in si.values()], axis=0)
    if not np.any(bad):
        return si, lines
    which = [role for role, values in si.items() if not np.all(np.isfinite(values))]
    where = ", ".join(map(str, lines[bad][:5]))
    more = ", ..." if bad.sum() > 5 else ""
    notes.append(
        f"{format_count(int(bad.sum()), 'row')} without a number in {', '.join(which)} left out (lines {where}{more})"
    )
    return {role: values[~bad] for role, values in si.items()}, lines[~bad]


def _in_order(si: dict[str, Array], lines: Array, notes: list[str], source: str) -> tuple[dict[str, Array], Array]:
    """Rows in order of time, without rows earlier than a row before them; equal times are separated."""
    time = si["time"]
    high = np.maximum.accumulate(time)
    back = time < high
    if np.any(back):
        _check_clock(time, high, back, lines, source)
        where = ", ".join(map(str, lines[back][:5]))
        notes.append(
            f"{format_count(int(back.sum()), 'row')} whose time goes back left out "
            f"(lines {where}{', ...' if back.sum() > 5 else ''})"
        )
        si, lines, time = {role: values[~back] for role, values in si.items()}, lines[~back], time[~back]
    return _separated_times(si, lines, notes)


def _check_clock(time: Array, high: Array, back: Array, lines: Array, source: str) -> None:
    """Raise an error for a clock that restarts: the rows after the restart would be lost, or look like a jump."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], back, [False]]).astype(int)))
    begin, end = ends.reshape(-1, 2)[int(np.argmax(ends[1::2] - ends[::2]))]
    if end - begin > max(RESTART * len(time), FEWEST_ROWS):
        message = (
            f"line {lines[begin]}: the clock starts again, at {time[begin]:.6g} s after {high[begin]:.6g} s, for "
            f"{end - begin} rows; give each part as a separate file, or correct the times"
        )
        raise ParameterError([Problem("time", message)], title=source)


def _even_times(time: Array) -> Array | None:
    """Evenly spaced times in place of times from a clock coarser than the sampling; None if the rows are not even."""
    rows = np.arange(len(time), dtype=float)
    tick = float(np.min(np.diff(np.unique(time))))
    slope, origin = np.polyfit(rows, time, 1)
    rest = time - (origin + slope * rows)
    if not (slope > 0 and float(np.ptp(rest)) < EVEN * tick):
        return None
    return np.asarray(time[0] + slope * rows)


def _separated_times(si: dict[str, Array], lines: Array, notes: list[str]) -> tuple[dict[str, Array], Array]:
    """Rows with distinct times; rows of equal time come from a clock coarser than the sampling, or are duplicates.

    Rows of equal time are spread evenly up to the next time, if their number fits there at the usual spacing. Otherwise
    they are replaced by their mean, because different times for them would be invented.
    """
    time = si["time"]
    unique, first, counts = np.unique(time, return_index=True, return_counts=True)
    if len(unique) == len(time):
        return si, lines
    uneven = len(unique) < COARSE * len(time) and np.ptp(counts[1:-1]) > 0  # groups of equal size are spread below
    if uneven and (even := _even_times(time)) is not None:
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
        notes.append(f"{rows} rows share a time with others; spread evenly up to the next time")
    if len(starts) < len(time):
        rows = len(time) - len(starts)
        said = "row repeats" if rows == 1 else "rows repeat"
        notes.append(f"{rows} {said} the time of the row before; each such group became its mean")
    si = {role: np.add.reduceat(values, starts) / sizes for role, values in si.items()}
    si["time"] = time[starts]
    return si, lines[starts]


def _local_median(spacing: Array) -> Array:
    """Median spacing in blocks of 51 intervals, so that a lower sampling rate is not taken for a series of gaps."""
    block = 51  # number of intervals in a block; chosen by trial
    if len(spacing) < 2 * block:
        return np.full(len(spacing), np.median(spacing))
    count = len(spacing) // block
    medians = np.median(spacing[: count * block].reshape(count, block), axis=1)
    return np.asarray(medians[np.minimum(np.arange(len(spacing)) // block, count - 1)])


def _check_sizes(si: dict[str, Array], source: str, lines: Array) -> None:
    """Raise an error for numbers far beyond any experiment, and for a clock that stands still."""
    problems = []
    for role, values in si.items():
        if np.any(huge := np.abs(values) > LARGEST_NUMBER):
            i = int(np.argmax(huge))
            message = f"line {lines[i]}: {values[i]:.4g} in SI units; allowed: sizes up to {LARGEST_NUMBER:g}"
            problems.append(Problem(role, message))
    time = si["time"]
    if len(time) and not np.ptp(time) > 1 / LARGEST_NUMBER:
        message = f"all {len(time)} rows lie within {1 / LARGEST_NUMBER:g} s of {time[0]:.4g} s; was the clock running?"
        problems.append(Problem("time", message))
    if problems:
        raise ParameterError(problems, title=source)


def _in_compression(si: dict[str, Array], notes: list[str]) -> dict[str, Array]:
    """Columns with the sign of the normal stress changed, if it is negative throughout (negative compression)."""
    if "normal" not in si or not np.all(si["normal"] < 0):
        return si
    notes.append("normal stress is negative throughout: taken as compression, its sign changed")
    return si | {"normal": -si["normal"]}


def _effective(si: dict[str, Array], notes: list[str]) -> dict[str, Array]:
    """Columns with the effective in place of the total normal stress, if the pore pressure was measured."""
    if "pore_pressure" not in si:
        return si
    if "normal" not in si:
        notes.append("pore pressure left out: there is no normal stress to take it from")
        return {role: values for role, values in si.items() if role != "pore_pressure"}
    notes.append("normal stress taken as total; the effective stress is the total minus the pore pressure")
    return si | {"normal": si["normal"] - si["pore_pressure"]}


def _turned_forwards(si: dict[str, Array], notes: list[str]) -> dict[str, Array]:
    """Columns with signs changed, if needed, so that the load point moves forwards and friction is positive."""
    moved = si.get("displacement")
    back = moved is not None and moved[0] - moved[-1] > 0.5 * float(np.ptp(moved))
    resists = float(np.median(si["friction"])) > 0
    changed = dict[str, Array]()
    if back:
        notes.append("the load point moves to smaller displacements; the sign of displacement was changed")
        changed |= {name: -si[name] for name in ("displacement", "velocity") if name in si}
    if not resists:
        notes.append("friction is negative; the signs of friction and shear were changed")
        changed |= {name: -si[name] for name in ("friction", "shear") if name in si}
    return si | changed


def _check_stress(si: dict[str, Array], source: str, lines: Array) -> None:
    if "normal" in si and not np.all(si["normal"] > 0):
        i = int(np.argmin(si["normal"] > 0))
        message = (
            f"line {lines[i]}: normal stress is {si['normal'][i]:.4g} Pa; it must be > 0 (compression) in the part "
            "that is used; cut it with between = [start, end]"
        )
        raise ParameterError([Problem("normal", message)], title=source)


def _unusual(si: dict[str, Array], forces: bool) -> list[str]:
    """Notes on columns whose mean is unusual, often because a unit is wrong."""
    time, travel = si["time"], float(np.ptp(si.get("displacement", 0.0)))
    normal = 0.0 if forces else float(np.mean(si.get("normal", 0.0)))
    means = (travel / float(np.ptp(time)), travel, float(np.median(np.diff(time))), normal)
    return [
        f"{what} {format_quantity(mean, unit)}, which is unusual in a laboratory; are {look}?"
        for (what, (unit, (low, high), look)), mean in zip(USUAL.items(), means, strict=True)
        if mean > 0 and not low <= mean <= high
    ]


def _check_friction(friction: Array, source: str) -> None:
    usual = float(np.median(np.abs(friction)))
    if not PLAUSIBLE[0] <= usual <= PLAUSIBLE[1]:
        message = (
            f"the friction coefficient is about {usual:.3g}, which no contact has; are shear and normal in the units "
            "that their names say, or is the friction column a stress?"
        )
        raise ParameterError([Problem("friction", message)], title=source)
