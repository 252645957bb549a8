"""Reader of LabVIEW text files (``.lvm``): a header of the file, then segments that begin with a header of channels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.columns import known_unit
from steadyslip.experiments.measured.formats.cells import COMMA, POINT, number
from steadyslip.experiments.measured.formats.table import Table, check_size

BEGIN, END = "LabVIEW Measurement", "***End_of_Header***"
TIME, COMMENT = "X_Value", "Comment"
Header = dict[str, list[str]]


def read_labview(text: str, path: Path) -> Table:
    """Table of channels with their time column, or with times counted from the sampling interval.

    Raises
    ------
    NotAvailable
        If channels have different times, or segments have different channels.
    """
    lines = text.splitlines()
    mark = COMMA if any(line.strip().lower() == "separator,comma" for line in lines[:30]) else "\t"
    rows = [[cell.strip() for cell in line.split(mark)] for line in lines]
    ends = [i for i, cells in enumerate(rows) if cells[0] == END]
    if len(ends) < 2:
        raise NotAvailable(f"{str(path)!r} is a LabVIEW file without channels: it has no second {END}")
    about = {cells[0]: cells[1:] for cells in rows[: ends[0]]}
    decimal = (about.get("Decimal_Separator") or [POINT])[0] or POINT
    each = (about.get("X_Columns") or ["One"])[0]
    names: list[str] = []
    values, kept, passed = list[list[float]](), list[int](), 0
    header: Header = {}
    for start, after in zip(ends[1:], [*ends[2:], None], strict=True):
        header = _header_before(rows, start)
        own = [*rows[start + 1]]
        while own and own[-1] in ("", COMMENT):
            own.pop()
        if names and own != names:
            raise NotAvailable(f"{str(path)!r}: line {start + 2} names other channels ({', '.join(own)}) than before")
        names = own
        stop = len(rows) if after is None else _begin_of_header(rows, after)
        for i in range(start + 2, stop):
            if not any(rows[i]):
                continue
            cells = [number(cell, decimal) for cell in [*rows[i], *[""] * len(names)][: len(names)]]
            check_size(path, passed := passed + len(cells))
            values.append([np.nan if cell is None else cell for cell in cells])
            kept.append(i + 1)
    if not values:
        raise NotAvailable(f"{str(path)!r} is a LabVIEW file without numbers")
    return _table(names, np.array(values).T, np.array(kept), header, each, len(ends) - 1, path)


def _header_before(rows: list[list[str]], end: int) -> Header:
    return {cells[0]: cells[1:] for cells in rows[_begin_of_header(rows, end) : end]}


def _begin_of_header(rows: list[list[str]], end: int) -> int:
    """Index of the first line of a segment's header, the line with the number of channels."""
    return next(i for i in range(end, -1, -1) if rows[i][0] in ("Channels", END) and i < end)


def _table(
    names: list[str], values: np.ndarray, lines: np.ndarray, header: Header, each: str, segments: int, path: Path
) -> Table:
    """Table of all channels with their units and a single time column."""
    notes = ["a LabVIEW file" + (f" of {segments} segments, joined" if segments > 1 else "")]
    places = [k for k, name in enumerate(names) if name not in (TIME, "")]
    times = [k for k, name in enumerate(names) if name == TIME]
    if any(not np.array_equal(values[k], values[times[0]], equal_nan=True) for k in times[1:]):
        raise NotAvailable(
            f"{str(path)!r}: its channels were sampled at different times; export them with one time column"
        )
    labels = dict(enumerate(header.get("Y_Unit_Label", []), start=1))  # column 0 is the time, without a label
    units = [known_unit(labels.get(k, "")) for k in places]
    if each != "No" and times:
        clock = values[times[0]]
    else:
        every = number((header.get("Delta_X") or ["1"])[0].replace(COMMA, POINT), POINT) or 1.0
        clock = every * np.arange(values.shape[1])
        notes.append(f"time counted from the interval between samples, {every:g} s")
    found = np.vstack([clock, values[places]])
    return Table(["Time", *(names[k] for k in places)], found, lines, ["s", *units], notes)
