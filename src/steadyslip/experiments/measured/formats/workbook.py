"""Reader of Excel workbooks (Office Open XML, ECMA-376): cells are read row by row within limits on their number.

openpyxl only interprets number formats; reading cells with it takes ten times as long.
"""

from __future__ import annotations

import posixpath
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, iterparse
from zipfile import ZipFile

import numpy as np
from openpyxl.styles.numbers import builtin_format_code, is_date_format, is_timedelta_format
from openpyxl.utils import column_index_from_string, get_column_letter

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.experiments.measured.columns import listed
from steadyslip.experiments.measured.formats.cells import (
    DAY,
    day,
    decimal_marks,
    number,
    time_of,
    value_of,
)
from steadyslip.experiments.measured.formats.table import Table, check_size, chosen_part, count_moments, names_and_units
from steadyslip.files.apart import more_time

MOST_PACKED, FEW_BYTES = 60, 2**23
"""A part of the archive may unpack to the first number times its packed size plus the second number of bytes; sheets of
numbers reach 20 times."""
SOME = 2**16  # number of cells for which one more second of CPU time is allowed; reading them takes half of it
MOST_PARTS, MOST_SHEET, MOST_OTHER = 10_000, 2**31, 2**28  # most parts; most bytes of a sheet, and of another part
MOST_COLUMNS = 1000  # largest number of columns that are read from a sheet; chosen by trial
FORMULA = "="
"""Text that this module puts in place of a formula without a saved value."""
MOMENT, DATE, CLOCK, SPAN = 1, 2, 3, 4
"""Kinds of times that a number may stand for: date with time of day, date alone, time of day, duration."""
EPOCHS = {False: 25_569, True: 24_107}  # day number of 1970-01-01: counted from 1900 or, on old Macintoshes, 1904
TICKS = 5  # dates are rounded to this many decimals of a second: days in double precision are not more precise


@dataclass
class SheetCells:
    """Non-empty cells of a sheet: numbers and texts.

    Attributes
    ----------
    lines : ndarray of int (rows)
        Number on the sheet (from 1) of each non-empty row.
    rows, columns, numbers, kinds : ndarray (cells)
        For each number: index in `lines`, column (from 0), value (s for a time) and kind of time (0 for no time).
    text_rows, text_columns : ndarray of int (texts)
    texts : list of str
    """

    lines: Array
    rows: Array
    columns: Array
    numbers: Array
    kinds: Array
    text_rows: Array
    text_columns: Array
    texts: list[str]

    def counts(self, more: Array) -> Array:
        """Count of numbers in each column; every occurrence of a column's index in `more` is counted as a number."""
        width = 1 + max((int(np.max(one)) for one in (self.columns, self.text_columns) if len(one)), default=-1)
        return np.bincount(self.columns, minlength=width) + np.bincount(more, minlength=width)

    def places(self, row: int) -> list[int]:
        """Indices of the columns that have content in a row."""
        own = (self.columns[self.rows == row], self.text_columns[self.text_rows == row])
        return [int(k) for one in own for k in one]

    def words_above(self, row: int) -> list[dict[int, str]]:
        """For each row before `row`, texts of its cells by column; numbers are converted to text."""
        found: list[dict[int, str]] = [{} for _ in range(row)]
        for k in np.flatnonzero(self.rows < row):
            found[self.rows[k]][int(self.columns[k])] = f"{self.numbers[k]:.15g}"
        for k in np.flatnonzero(self.text_rows < row):
            found[self.text_rows[k]][int(self.text_columns[k])] = self.texts[k].strip()
        return [{place: word for place, word in cells.items() if word} for cells in found]

    def dense(self, first: int, count: int) -> tuple[Array, Array]:
        """Values (count, rows), NaN where there is no number, and kinds (count, rows), from row `first` on."""
        shape = (count, len(self.lines) - first)
        own = (self.rows >= first) & (self.columns < count)
        places = (self.columns[own], self.rows[own] - first)
        values, kinds = np.full(shape, np.nan), np.zeros(shape, dtype=np.int8)
        values[places], kinds[places] = self.numbers[own], self.kinds[own]
        return values, kinds

    def without(self, columns: Array) -> tuple[SheetCells, Array]:
        """Sheet without the columns with the given indices, and mask of the texts that remain."""
        own, texts = (~np.isin(places, columns) for places in (self.columns, self.text_columns))
        rows, text_rows = self.rows[own], self.text_rows[texts]
        left = np.unique(np.concatenate([rows, text_rows]))
        rows, text_rows = np.searchsorted(left, rows), np.searchsorted(left, text_rows)
        words = [text for text, is_left in zip(self.texts, texts, strict=True) if is_left]
        sheet = SheetCells(self.lines[left], rows, self.columns[own], self.numbers[own], self.kinds[own],
                      text_rows, self.text_columns[texts], words)  # fmt: skip
        return sheet, texts


class Workbook:
    """Workbook that is open for reading.

    Attributes
    ----------
    sheets : dict of str to str
        Name of each sheet, and name of the file in the archive that holds it.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._archive = path, ZipFile(path)
        self._parts = set(self._archive.namelist())
        if len(self._parts) > MOST_PARTS:
            raise NotAvailable(f"{str(path)!r} is an archive of {len(self._parts)} parts; allowed: up to {MOST_PARTS}")
        book = next((part for kind, part in self._links("").values() if kind == "officeDocument"), "xl/workbook.xml")
        links = self._links(book)
        self.sheets: dict[str, str] = {}
        self._origin = EPOCHS[False]
        for one in self._elements(book, ("workbookPr", "sheet")):
            if _name(one) == "workbookPr":
                self._origin = EPOCHS[one.get("date1904") in ("1", "true")]
                continue
            kind, part = links.get(next((value for key, value in one.items() if key.endswith("}id")), ""), ("", ""))
            if kind == "worksheet" and part in self._parts:
                self.sheets[one.get("name", "")] = part
        others = dict(links.values())
        self._styles = dict(self._styles_of_times(others.get("styles", "")))
        self._strings = [_text_of(one) for one in self._elements(others.get("sharedStrings", ""), ("si",))]

    def __enter__(self) -> Workbook:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def sheet(self, name: str) -> SheetCells:
        """Cells of a sheet."""
        lines, line, passed, timed = array("q"), 0, 0, 0
        rows, columns, numbers, kinds = array("q"), array("q"), array("d"), array("b")
        text_rows, text_columns, texts = array("q"), array("q"), list[str]()
        places: dict[str, int] = {}
        for row in self._elements(self.sheets[name], ("row",), MOST_SHEET):
            line = int(row.get("r") or line + 1)
            place, before = -1, len(numbers) + len(texts)
            for cell in row:
                if letters := cell.get("r", "").rstrip("0123456789"):
                    if (place := places.get(letters, -1)) < 0:
                        place = places[letters] = column_index_from_string(letters) - 1
                else:
                    place += 1
                content = self._content(cell) if place < MOST_COLUMNS else ""
                if isinstance(content, tuple):
                    rows.append(len(lines))
                    columns.append(place)
                    numbers.append(content[0])
                    kinds.append(content[1])
                elif content:
                    text_rows.append(len(lines))
                    text_columns.append(place)
                    texts.append(content)
            if len(numbers) + len(texts) > before:
                lines.append(line)
            if len(numbers) + len(texts) > passed + SOME:
                more_time((len(numbers) - timed) // SOME)
                passed, timed = len(numbers) + len(texts), len(numbers)
                check_size(self._path, passed, rows=len(lines))
        return SheetCells(
            np.array(lines), np.array(rows), np.array(columns), np.array(numbers), np.array(kinds),
            np.array(text_rows), np.array(text_columns), texts,
        )  # fmt: skip

    def _content(self, cell: Element) -> tuple[float, int] | str:
        """Number in a cell and kind of time that it stands for, or text in the cell (empty for an empty cell)."""
        kind, said, of_formula = cell.get("t", "n"), "", False
        for part in cell:
            if part.tag.endswith("v"):
                said = part.text or ""
            elif part.tag.endswith("}f"):
                of_formula = True
            elif part.tag.endswith("}is"):
                said = _text_of(part)
        if not said:
            return FORMULA if of_formula else ""
        if kind == "s":
            return self._strings[int(said)]
        if kind == "b":
            return "FALSE" if said == "0" else "TRUE"
        if kind != "n":
            return said
        value = float(said)
        style = self._styles.get(cell.get("s", ""))
        if style is None:
            return value, 0
        if style == SPAN or 0.0 <= value < 1.0:
            return DAY * value, 0 if style == SPAN else CLOCK
        return round(DAY * (value - self._origin), TICKS), DATE if value == int(value) else MOMENT

    def _styles_of_times(self, part: str) -> Iterator[tuple[str, int]]:
        """Pairs of the index of a cell style that shows numbers as times, and the kind of time."""
        own: dict[int, str] = {}
        for one in self._elements(part, ("numFmt", "cellXfs")):
            if _name(one) == "numFmt":
                own[int(one.get("numFmtId", 0))] = one.get("formatCode", "")
                continue
            for place, style in enumerate(one):
                number = int(style.get("numFmtId", 0))
                form = own.get(number) or builtin_format_code(number) or ""
                if is_timedelta_format(form) or is_date_format(form):
                    yield str(place), SPAN if is_timedelta_format(form) else MOMENT

    def _links(self, part: str) -> dict[str, tuple[str, str]]:
        """Kind and target of each relation from a file of the archive to another, by the relation's identifier."""
        folder, name = posixpath.split(part)
        found = {}
        for one in self._elements(posixpath.join(folder, "_rels", f"{name}.rels"), ("Relationship",)):
            target = posixpath.normpath(posixpath.join("/", folder, one.get("Target", ""))).lstrip("/")
            found[one.get("Id", "")] = (one.get("Type", "").rpartition("/")[2], target)
        return found

    def _elements(self, part: str, names: tuple[str, ...], most: int = MOST_OTHER) -> Iterator[Element]:
        """Elements with the given names in a file of the archive, cleared after use; none if the file is absent."""
        if part not in self._parts:
            return
        about = self._archive.getinfo(part)
        if about.file_size > min(most, FEW_BYTES + MOST_PACKED * about.compress_size):
            size = f"{about.file_size} bytes from {about.compress_size}"
            raise NotAvailable(f"{str(self._path)!r}: {part} unpacks to {size}, too much for a table of measurements")
        ends = tuple(f"}}{name}" for name in names)
        with self._archive.open(part) as stream:
            for _, element in iterparse(stream):
                if element.tag.endswith(ends):
                    yield element
                    element.clear()


def _name(element: Element) -> str:
    return element.tag.rpartition("}")[2]


def _text_of(element: Element) -> str:
    """Text of an element, joined from its parts of different format, without phonetic hints."""
    runs = [part for run in element for part in ([run] if _name(run) == "t" else run if _name(run) == "r" else [])]
    return "".join(part.text or "" for part in runs if _name(part) == "t")


SPARSE = 0.05  # a column with fewer numbers than this share of the fullest column's is no part of the record; by trial
SHORT = 20  # a sheet with fewer rows holds no record (`FEWEST_ROWS`)
Stated = list[float | None]


def read(path: Path, table: str | None) -> Table:
    """Table of the sheet `table`; by default, of the only sheet with a record, or else of the only one with numbers."""
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
    """Table of the columns on a sheet; None if it has no row with two numbers."""
    known = {text: value_of(text) for text in set(sheet.texts)}
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
    marks, notes, fault = decimal_marks(names, ([text for _, text in own if time_of(text) is None] for own in texts))
    if fault is not None:
        raise ParameterError([Problem("file", fault)], title=str(path))
    faults = 0
    for k, own in enumerate(texts):
        for row, text in own:
            if (value := number(text, marks[k])) is None and (value := time_of(text)) is not None:
                kinds[k, row] = MOMENT if day(text.strip().strip('"')) is None else DATE
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
    """Raise an error for columns of formulas without saved values, which the writing program did not compute."""
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
    """Sheet without sparse columns, numbers that its remaining texts stand for, and removed columns with numbers."""
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
    """Index of the first row with at least two numbers and no other text; None if there is no such row."""
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
    """Nearest text above an empty header cell, as the cell may have been merged with it; empty if there is none."""
    return next((cells[place] for cells in reversed(above) if cells[place]), "")


def _count_all_moments(found: Table, kinds: Array) -> None:
    """Convert time columns to seconds; dates are added to the times of day, if one column holds these, and removed."""
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
