"""Cells of a workbook (Office Open XML, ECMA-376), read row by row with limits against decompression bombs.

openpyxl is used for the meaning of number formats only; it takes ten times as long per cell.
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
from openpyxl.utils import column_index_from_string

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.moments import DAY
from steadyslip.experiments.measured.formats.table import check_size
from steadyslip.files.apart import more_time

MOST_PACKED, FEW_BYTES = 60, 2**23  # allowed compression of a part, beyond a harmless size; numbers reach 20
SOME = 2**16  # numbers per second of CPU time allowed; reading takes half of it
MOST_PARTS, MOST_SHEET, MOST_OTHER = 10_000, 2**31, 2**28  # parts of an archive; bytes of a sheet; of any other part
MOST_COLUMNS = 1000  # of a sheet that are read; chosen by trial
FORMULA = "="
"""Text that stands for a formula without saved value."""
MOMENT, DATE, CLOCK, SPAN = 1, 2, 3, 4
"""Kinds of numbers that are times: date and time of day, date alone, time of day, duration."""
EPOCHS = {False: 25_569, True: 24_107}  # day number of 1970-01-01: counted from 1900 or, on old Macintoshes, 1904
TICKS = 5  # decimals of a second that a date keeps as a number of days in double precision


@dataclass
class SheetCells:
    """Non-empty cells of a sheet: numbers and texts.

    Attributes
    ----------
    lines : ndarray of int (rows)
        Row number on the sheet of each non-empty row.
    rows, columns, numbers, kinds : ndarray (cells)
        Index in `lines`, column (from 0), value and kind of time (0: none) of each number; times in seconds.
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
        """Count of numbers per column, plus the count of each column in `more`."""
        width = 1 + max((int(np.max(one)) for one in (self.columns, self.text_columns) if len(one)), default=-1)
        return np.bincount(self.columns, minlength=width) + np.bincount(more, minlength=width)

    def places(self, row: int) -> list[int]:
        """Columns with content in a row."""
        own = (self.columns[self.rows == row], self.text_columns[self.text_rows == row])
        return [int(k) for one in own for k in one]

    def words_above(self, row: int) -> list[dict[int, str]]:
        """Texts of cells (numbers as text) in each row before a given one, by column."""
        found: list[dict[int, str]] = [{} for _ in range(row)]
        for k in np.flatnonzero(self.rows < row):
            found[self.rows[k]][int(self.columns[k])] = f"{self.numbers[k]:.15g}"
        for k in np.flatnonzero(self.text_rows < row):
            found[self.text_rows[k]][int(self.text_columns[k])] = self.texts[k].strip()
        return [{place: word for place, word in cells.items() if word} for cells in found]

    def dense(self, first: int, count: int) -> tuple[Array, Array]:
        """Values (NaN without a number) and kinds from row `first` on, shape (count, rows) each."""
        shape = (count, len(self.lines) - first)
        own = (self.rows >= first) & (self.columns < count)
        places = (self.columns[own], self.rows[own] - first)
        values, kinds = np.full(shape, np.nan), np.zeros(shape, dtype=np.int8)
        values[places], kinds[places] = self.numbers[own], self.kinds[own]
        return values, kinds

    def without(self, columns: Array) -> tuple[SheetCells, Array]:
        """Sheet without some columns, and a mask of the texts that remain."""
        own, texts = (~np.isin(places, columns) for places in (self.columns, self.text_columns))
        rows, text_rows = self.rows[own], self.text_rows[texts]
        left = np.unique(np.concatenate([rows, text_rows]))
        rows, text_rows = np.searchsorted(left, rows), np.searchsorted(left, text_rows)
        words = [text for text, is_left in zip(self.texts, texts, strict=True) if is_left]
        sheet = SheetCells(self.lines[left], rows, self.columns[own], self.numbers[own], self.kinds[own],
                      text_rows, self.text_columns[texts], words)  # fmt: skip
        return sheet, texts


class Workbook:
    """Open workbook.

    Attributes
    ----------
    sheets : dict of str to str
        Part of the archive by name of the sheet.
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
        """Number in a cell with its kind of time, or its text (empty if there is nothing)."""
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
        """Indices of cell styles that show numbers as times, with the kind of time."""
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
        """Relations of a part, by reference: kind and target part."""
        folder, name = posixpath.split(part)
        found = {}
        for one in self._elements(posixpath.join(folder, "_rels", f"{name}.rels"), ("Relationship",)):
            target = posixpath.normpath(posixpath.join("/", folder, one.get("Target", ""))).lstrip("/")
            found[one.get("Id", "")] = (one.get("Type", "").rpartition("/")[2], target)
        return found

    def _elements(self, part: str, names: tuple[str, ...], most: int = MOST_OTHER) -> Iterator[Element]:
        """Elements with some names in a part, each cleared after use; none if the part is absent."""
        if part not in self._parts:
            return
        about = self._archive.getinfo(part)
        if about.file_size > min(most, FEW_BYTES + MOST_PACKED * about.compress_size):
            size = f"{about.file_size} bytes from {about.compress_size}"
            raise NotAvailable(f"{str(self._path)!r}: {part} unpacks to {size}, which no table of measurements does")
        ends = tuple(f"}}{name}" for name in names)
        with self._archive.open(part) as stream:
            for _, element in iterparse(stream):
                if element.tag.endswith(ends):
                    yield element
                    element.clear()


def _name(element: Element) -> str:
    return element.tag.rpartition("}")[2]


def _text_of(element: Element) -> str:
    """Text of an element, of its runs joined, without phonetic hints."""
    runs = [part for run in element for part in ([run] if _name(run) == "t" else run if _name(run) == "r" else [])]
    return "".join(part.text or "" for part in runs if _name(part) == "t")
