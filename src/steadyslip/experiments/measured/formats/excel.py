"""Excel workbooks: the numbers of one sheet below its names; formulas count as the value that was saved with them."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from openpyxl import load_workbook

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.moments import moment
from steadyslip.experiments.measured.formats.table import (
    MISSING,
    Table,
    check_size,
    chosen_part,
    count_moments,
    names_and_units,
)

MOST_COLUMNS = 1000
Cells = list[Any]


def read(path: Path, table: str | None) -> Table:
    """The sheet of that name, else the only one that has numbers."""
    book = load_workbook(path, read_only=True, data_only=True)
    try:
        part = chosen_part(path, "sheet", table, book.sheetnames)
        sheets = [book[name] for name in (book.sheetnames if part is None else [part])]
        found = {sheet.title: one for sheet in sheets if (one := _sheet(path, sheet)) is not None}
    finally:
        book.close()
    if not found:
        raise NotAvailable(f"{str(path)!r} has no columns of numbers in it")
    if len(found) > 1:
        raise NotAvailable(f"{str(path)!r} has numbers on several sheets; say which with table=: {', '.join(found)}")
    return next(iter(found.values()))


def _sheet(path: Path, sheet: Any) -> Table | None:
    rows = list(_rows(path, sheet))
    first = next((k for k, (_, cells) in enumerate(rows) if _is_numbers(cells)), None)
    if first is None:
        return None
    count = max(k for k, cell in enumerate(rows[first][1]) if cell is not None) + 1
    body = rows[first:]
    above = [[_word(cell) for cell in [*cells, *[None] * count][:count]] for _, cells in rows[:first]]
    fullest = max((sum(map(bool, cells)) for cells in above), default=0)
    names, units = names_and_units([cells for cells in above if sum(map(bool, cells)) == fullest], count)
    names = [name or str(k) for k, name in enumerate(names, start=1)]
    values = np.full((count, len(body)), np.nan)
    faults = 0
    for i, (_, cells) in enumerate(body):
        for k, cell in enumerate(cells[:count]):
            number = _number(cell)
            faults += number is None
            values[k, i] = np.nan if number is None else number
    notes = [f"{faults} cells that are no numbers were left empty"] if faults else []
    found = Table(names, values, np.array([line for line, _ in body]), units, notes)
    for k, cell in enumerate(body[0][1][:count]):
        if isinstance(cell, datetime.datetime | datetime.time) or (isinstance(cell, str) and moment(cell) is not None):
            count_moments(found, k)
    return found


def _rows(path: Path, sheet: Any) -> Iterator[tuple[int, Cells]]:
    """Rows that are not empty, with their numbers on the sheet; the size that a file declares is not believed."""
    size = 0
    for line, cells in enumerate(sheet.iter_rows(values_only=True, max_col=MOST_COLUMNS), start=1):
        size += len(cells)
        check_size(path, size)
        if any(cell is not None and cell != "" for cell in cells):
            yield line, list(cells)


def _word(cell: Any) -> str:
    return "" if cell is None else str(cell).strip()


def _is_numbers(cells: Cells) -> bool:
    """Whether a row holds numbers and nothing else, two of them at least."""
    numbers = [_number(cell) for cell in cells if cell is not None]
    return len(numbers) > 1 and all(n is not None for n in numbers) and any(n == n for n in numbers if n is not None)


def _number(cell: Any) -> float | None:
    """The number in a cell; NaN for an empty one, None for anything else."""
    match cell:
        case None:
            return float("nan")
        case bool():
            return None
        case int() | float():
            return float(cell)
        case datetime.datetime():
            return cell.replace(tzinfo=datetime.UTC).timestamp()
        case datetime.time():
            return 3600.0 * cell.hour + 60.0 * cell.minute + cell.second + 1e-6 * cell.microsecond
        case datetime.timedelta():
            return cell.total_seconds()
    text = str(cell).strip()
    if text.lower() in MISSING:
        return float("nan")
    try:
        return float(text)
    except ValueError:
        return moment(text)
