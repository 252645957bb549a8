"""Reader of Excel workbooks: the numbers of one sheet below its names; formulas have their saved values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from openpyxl.utils import get_column_letter

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.experiments.measured.columns import listed
from steadyslip.experiments.measured.formats.moments import day, moment
from steadyslip.experiments.measured.formats.numerals import decimal_marks, number, number_with_any_mark
from steadyslip.experiments.measured.formats.table import Table, check_size, chosen_part, count_moments, names_and_units
from steadyslip.experiments.measured.formats.workbook import CLOCK, DATE, FORMULA, MOMENT, SheetCells, Workbook

SPARSE = 0.05  # share of the fullest column's numbers below which a column does not belong to the record; by trial
SHORT = 20  # rows below which a sheet has no record (`FEWEST_ROWS`)
Stated = list[float | None]


def read(path: Path, table: str | None) -> Table:
    """Table of the named sheet; by default of the only one with a record, or with any numbers."""
    with Workbook(path) as book:
        part = chosen_part(path, "sheet", table, list(book.sheets))
        names = list(book.sheets) if part is None else [part]
        found = {name: one for name in names if (one := _table(path, book.sheet(name))) is not None}
    if not found:
        raise NotAvailable(f"{str(path)!r} has no columns of numbers in it")
    long = {name: one for name, one in found.items() if len(one.lines) >= SHORT}
    found = long or found
    if len(found) > 1:
        raise NotAvailable(f"{str(path)!r} has numbers on several sheets; say which with table=: {listed(found)}")
    return next(iter(found.values()))


def _table(path: Path, sheet: SheetCells) -> Table | None:
    """Record on a sheet; None if there is none."""
    known = {text: _parsed(text) for text in set(sheet.texts)}
    stated = [known[text] for text in sheet.texts]
    sheet, stated, dropped = _without_side_tables(sheet, stated)
    first = _first_row(sheet, stated)
    if first is None:
        return None
    above = sheet.words_above(first)
    fullest = max(map(len, above), default=0)
    count = 1 + max([*sheet.places(first), *(k for cells in above if len(cells) == fullest for k in cells)])
    lines = [[cells.get(k, "") for k in range(count)] for cells in above]
    names, units = names_and_units([line for line in lines if sum(map(bool, line)) == fullest], count)
    names = [name or _text_above(lines, k) or str(k + 1) for k, name in enumerate(names)]
    check_size(path, count * (len(sheet.lines) - first), rows=len(sheet.lines) - first)
    values, kinds = sheet.dense(first, count)
    texts: list[list[tuple[int, str]]] = [[] for _ in range(count)]
    for row, k, text in zip(sheet.text_rows.tolist(), sheet.text_columns.tolist(), sheet.texts, strict=True):
        if row >= first and k < count:
            texts[k].append((row - first, text))
    _check_formulas(path, names, values, texts)
    marks, notes, fault = decimal_marks(names, ([text for _, text in own if _moment(text) is None] for own in texts))
    if fault is not None:
        raise ParameterError([Problem("file", fault)], title=str(path))
    faults = 0
    for k, own in enumerate(texts):
        for row, text in own:
            if (value := number(text, marks[k])) is None and (value := _moment(text)) is not None:
                kinds[k, row] = MOMENT if day(text.strip()) is None else DATE
            faults += value is None and text != FORMULA
            values[k, row] = np.nan if value is None else value
    notes += [f"{faults} cells that are no numbers were left empty"] if faults else []
    if dropped:
        letters = ", ".join(get_column_letter(k + 1) for k in dropped)
        notes.append(f"columns of hardly any numbers were left out: {letters}")
    found = Table(names, values, sheet.lines[first:], units, notes)
    _count_all_moments(found, kinds)
    return found


def _check_formulas(path: Path, names: list[str], values: Array, texts: list[list[tuple[int, str]]]) -> None:
    """Raise an error for columns of formulas without values, written by a program that did not compute them."""
    empty = [
        name
        for name, own, column in zip(names, texts, values, strict=True)
        if own and own[0][1] == FORMULA and np.all(np.isnan(column)) and all(text == FORMULA for _, text in own)
    ]
    if empty:
        raise NotAvailable(
            f"{str(path)!r}: {', '.join(map(repr, empty))} holds formulas without their values; open the workbook in a "
            "spreadsheet program and save it"
        )


def _without_side_tables(sheet: SheetCells, stated: Stated) -> tuple[SheetCells, Stated, list[int]]:
    """Sheet without columns that have few numbers beside a record, their parsed texts, and the removed columns."""
    is_number = [value is not None or text == FORMULA for value, text in zip(stated, sheet.texts, strict=True)]
    counts = sheet.counts(sheet.text_columns[np.array(is_number, dtype=bool)])
    few = np.flatnonzero(counts < SPARSE * max(counts, default=0))
    numbers = sheet.counts(sheet.text_columns[_finite(stated)])
    dropped = [int(k) for k in few if numbers[k]]
    if not dropped or max(counts) < SHORT:
        return sheet, stated, []
    sheet, left = sheet.without(few)
    return sheet, [value for value, is_left in zip(stated, left, strict=True) if is_left], dropped


def _first_row(sheet: SheetCells, stated: Stated) -> int | None:
    """First row with at least two numbers and no other text; None if there is none."""
    is_number = np.array([value is not None for value in stated], dtype=bool)
    is_other = ~is_number & np.array([text != FORMULA for text in sheet.texts], dtype=bool)
    own, numbers, reals, others = (
        np.bincount(rows, minlength=len(sheet.lines))
        for rows in (sheet.rows, *(sheet.text_rows[which] for which in (is_number, _finite(stated), is_other)))
    )
    fitting = np.flatnonzero((own + numbers > 1) & (own + reals > 0) & (others == 0))
    return int(fitting[0]) if len(fitting) else None


def _finite(stated: Stated) -> Array:
    return np.array([value is not None and value == value for value in stated], dtype=bool)


def _text_above(above: list[list[str]], place: int) -> str:
    """Text above an empty header cell, which was merged with it."""
    return next((cells[place] for cells in reversed(above) if cells[place]), "")


def _count_all_moments(found: Table, kinds: Array) -> None:
    """Convert time columns to seconds; a column of dates is added to a single column of times of day and removed."""
    own = [kind[np.isfinite(column)] for kind, column in zip(kinds, found.values, strict=True)]
    moments = [k for k, kind in enumerate(own) if len(kind) and np.all(kind[:2] > 0)]
    days = [k for k in moments if np.all(own[k] == DATE)]
    clocks = [k for k in moments if np.all(own[k] == CLOCK)]
    if len(days) == 1 and len(clocks) == 1:
        date, clock = found.names[days[0]], found.names[clocks[0]]
        found.values[clocks[0]] += found.values[days[0]]
        found.notes.append(f"the times in {clock!r} are those of the dates in {date!r}")
        moments.remove(days[0])
    for k in moments:
        count_moments(found, k)
    if len(days) == 1 and len(clocks) == 1:
        found.drop(days)


def _parsed(text: str) -> float | None:
    """Number or time in a text, with either decimal mark; NaN for an empty one, None for other text."""
    found = number_with_any_mark(text)
    return _moment(text) if found is None else found


def _moment(text: str) -> float | None:
    plain = text.strip()
    return moment(plain) if (date := day(plain)) is None else date
