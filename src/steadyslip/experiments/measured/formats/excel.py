"""Excel workbooks: the numbers of one sheet below its names; formulas count as the value that was saved with them."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from openpyxl import load_workbook

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.experiments.measured.formats.moments import day, moment
from steadyslip.experiments.measured.formats.numerals import either, marks_of, number
from steadyslip.experiments.measured.formats.table import (
    Table,
    check_size,
    chosen_part,
    count_moments,
    names_and_units,
)

MOST_COLUMNS = 1000
SPARSE = 0.05  # of the numbers of the fullest column: one of fewer belongs to something beside the record
SHORT = 20  # rows: a sheet of fewer is none of a record
Cells = list[Any]


def read(path: Path, table: str | None) -> Table:
    """The sheet of that name, else the only one that has a record in it, or else any numbers."""
    book = load_workbook(path, read_only=True, data_only=True)
    try:
        part = chosen_part(path, "sheet", table, book.sheetnames)
        sheets = [sheet for sheet in book.worksheets if part is None or sheet.title == part]
        found = {sheet.title: one for sheet in sheets if (one := _sheet(path, sheet)) is not None}
    finally:
        book.close()
    if not found:
        raise NotAvailable(f"{str(path)!r} has no columns of numbers in it")
    long = {name: one for name, one in found.items() if len(one.lines) >= SHORT}
    found = long or found
    if len(found) > 1:
        raise NotAvailable(f"{str(path)!r} has numbers on several sheets; say which with table=: {', '.join(found)}")
    ((name, sheet),) = found.items()
    _check_formulas(path, name, sheet)
    return sheet


def _check_formulas(path: Path, sheet: str, found: Table) -> None:
    """Refuse columns of formulas that were never computed: a program wrote them, and no spreadsheet has opened them."""
    empty = [k for k, column in enumerate(found.values) if np.all(np.isnan(column))]
    if not empty or not len(found.lines):
        return
    book = load_workbook(path, read_only=True)
    try:
        line = int(found.lines[0])
        (cells,) = book[sheet].iter_rows(min_row=line, max_row=line, values_only=True, max_col=MOST_COLUMNS)
    finally:
        book.close()
    names = [found.names[k] for k in empty if k < len(cells) and str(cells[k]).startswith("=")]
    if names:
        raise NotAvailable(
            f"{str(path)!r}: {', '.join(map(repr, names))} holds formulas without their values; open the workbook in a "
            "spreadsheet program and save it"
        )


def _sheet(path: Path, sheet: Any) -> Table | None:
    rows, dropped = _without_side_tables(list(_rows(path, sheet)))
    first = next((k for k, (_, cells) in enumerate(rows) if _is_numbers(cells)), None)
    if first is None:
        return None
    above = [[_word(cell) for cell in cells] for _, cells in rows[:first]]
    fullest = max((sum(map(bool, cells)) for cells in above), default=0)
    heads = [cells for cells in above if sum(map(bool, cells)) == fullest]
    written = [[k for k, cell in enumerate(cells) if cell not in (None, "")] for cells in (*heads, rows[first][1])]
    count = max(max(places, default=0) for places in written) + 1
    body = [(line, [*cells, *[None] * count][:count]) for line, cells in rows[first:]]
    above, heads = ([[*cells, *[""] * count][:count] for cells in lines] for lines in (above, heads))
    names, units = names_and_units(heads, count)
    names = [name or _higher(above, k) or str(k + 1) for k, name in enumerate(names)]
    texts = [
        [cell for _, cells in body if isinstance(cell := cells[k], str) and _moment(cell) is None] for k in range(count)
    ]
    marks, notes, fault = marks_of(names, texts)
    if fault is not None:
        raise ParameterError([Problem("file", fault)], title=str(path))
    values = np.full((count, len(body)), np.nan)
    faults = 0
    for i, (_, cells) in enumerate(body):
        for k, cell in enumerate(cells):
            value = _number(cell, marks[k])
            faults += value is None
            values[k, i] = np.nan if value is None else value
    notes += [f"{faults} cells that are no numbers were left empty"] if faults else []
    if dropped:
        notes.append(f"columns of hardly any numbers were left out: {', '.join(dropped)}")
    found = Table(names, values, np.array([line for line, _ in body]), units, notes)
    _count_all_moments(found, [cells for _, cells in body])
    return found


def _without_side_tables(rows: list[tuple[int, Cells]]) -> tuple[list[tuple[int, Cells]], list[str]]:
    """The same rows without columns that have but a few numbers, beside those of a record; which these are."""
    width = max((len(cells) for _, cells in rows), default=0)
    counts = [0] * width
    for _, cells in rows:
        for k, cell in enumerate(cells):
            counts[k] += cell not in (None, "") and (_number(cell, None) is not None or str(cell).startswith("="))
    few = {k for k, count in enumerate(counts) if count < SPARSE * max(counts)}
    sparse = [k for k in sorted(few) if any(k < len(cells) and _number(cells[k], None) == _number(cells[k], None)
              and _number(cells[k], None) is not None for _, cells in rows)]  # fmt: skip
    if not sparse or max(counts) < SHORT:
        return rows, []
    kept = [(line, [None if k in few else cell for k, cell in enumerate(cells)]) for line, cells in rows]
    return [row for row in kept if any(cell not in (None, "") for cell in row[1])], [_letter(k) for k in sparse]


def _letter(place: int) -> str:
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(place + 1))


def _higher(above: list[list[str]], place: int) -> str:
    """What stands above an empty cell of a header, which was merged with it."""
    return next((cells[place] for cells in reversed(above) if cells[place]), "")


def _count_all_moments(found: Table, body: list[Cells]) -> None:
    """Make seconds of columns of times; dates in a column of their own belong to the clock beside them."""
    columns = [[cell for cells in body if (cell := cells[k]) not in (None, "")] for k in range(len(found.names))]
    moments = [k for k, cells in enumerate(columns) if cells and all(_is_moment(cell) for cell in cells[:2])]
    days = [k for k in moments if all(_is_day(cell) for cell in columns[k])]
    clocks = [k for k in moments if all(isinstance(cell, datetime.time) for cell in columns[k])]
    if len(days) == 1 and len(clocks) == 1:
        found.values[clocks[0]] += found.values[days[0]]
        found.notes.append(
            f"the times in {found.names[clocks[0]]!r} are those of the dates in {found.names[days[0]]!r}"
        )
        moments.remove(days[0])
    for k in moments:
        count_moments(found, k)
    if len(days) == 1 and len(clocks) == 1:
        found.drop(days)


def _is_moment(cell: Any) -> bool:
    return isinstance(cell, datetime.datetime | datetime.time) or (isinstance(cell, str) and _moment(cell) is not None)


def _is_day(cell: Any) -> bool:
    """Whether a cell is a date without a time of day."""
    if isinstance(cell, str):
        return day(cell.strip()) is not None
    return isinstance(cell, datetime.datetime) and cell.time() == datetime.time()


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
    numbers = [_number(cell, None) for cell in cells if cell is not None]
    return len(numbers) > 1 and all(n is not None for n in numbers) and any(n == n for n in numbers if n is not None)


def _number(cell: Any, mark: str | None) -> float | None:
    """The number in a cell, text with this decimal mark or any; NaN for an empty one, None for anything else."""
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
    found = either(text) if mark is None else number(text, mark)
    return _moment(text) if found is None else found


def _moment(text: str) -> float | None:
    plain = text.strip()
    return moment(plain) if (date := day(plain)) is None else date
