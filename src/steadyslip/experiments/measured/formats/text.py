"""Reader of text with columns of numbers: any separator, decimal commas, times of day, headers and remarks."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.experiments.measured.columns import known_unit
from steadyslip.experiments.measured.formats.cells import (
    COMMA,
    POINT,
    day,
    decimal_marks,
    number,
    time_of,
    value_of,
)
from steadyslip.experiments.measured.formats.labview import BEGIN, read_labview
from steadyslip.experiments.measured.formats.remarks import Line, harmless_lines
from steadyslip.experiments.measured.formats.table import Table, check_size, count_moments, names_and_units
from steadyslip.experiments.measured.formats.xlook import is_xlook, read_xlook, with_plain_head
from steadyslip.files.inputs import read_bytes

SHOWN = 8  # largest number of damaged lines listed in a message
HEADER_LINES = 500  # within this many lines, the header ends where two lines of numbers follow each other; by trial
MOST_HEADER, NAMED = 20_000, 500
"""Largest number of lines above the first numbers; number of lines, just above the numbers, searched for names."""
MOST_TEXT = 2**30  # largest size of a text file, bytes; its text and cells need a multiple of this memory
MOST_LINES, MOST_LINE = 2_000_000, 100_000  # most lines parsed in Python (in a minute); most characters of a line
OTHER_FORMATS = {
    b"\xd0\xcf\x11\xe0": "it is of an old Office program; save it as .xlsx",
    b"PK\x03\x04": "it is a workbook or an archive; save a workbook as .xlsx, unpack an archive",
    b"\x1f\x8b": "it is packed; unpack it",
    b"ARROW1": "it is in Arrow's own format; save it as .parquet",
}
"""First bytes of files in other formats, and advice to the user for each format."""
UTF16 = (b"\xff\xfe", b"\xfe\xff")  # first bytes of UTF-16 text, such as Excel's "Unicode text"
LARGE, SAMPLE_BYTES = 2**20, 2**17  # larger texts (bytes) are first tried with NumPy; first bytes that give the layout
_BEGINS_WITH_NUMBER = re.compile(r"[\s|\"',;]*[-+\u2212]?[.,]?\d")
_QUOTED = re.compile(r'"[^"]*"')
_SPLIT_THOUSANDS = re.compile(r"(^|,)[-+]?\d{1,3},\d{3}(\.\d*)?(,|$)")
_BREAKS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"


def read_text(path: Path, skip_bad_lines: bool, mended: Callable[[bytes], bytes] = bytes) -> Table:
    """Columns of a text file, or of an XLOOK file, whose name may have any ending.

    The function `mended` may replace words in the raw text before it is parsed.

    Raises
    ------
    NotAvailable
        If the file is neither text nor of XLOOK.
    ParameterError
        If lines are damaged.
    """
    raw = with_plain_head(mended(read_bytes(path, MOST_TEXT)))
    if is_xlook(raw):
        names, units, values = read_xlook(raw, str(path))
        known = [None if unit is None else known_unit(unit) for unit in units]
        return Table(names, values, np.arange(1, values.shape[1] + 1), known, ["read as XLOOK file"])
    if raw[:2] in UTF16:
        raw = decoded(raw)[0].encode()
    if b"\0" in raw[:4096] or raw.startswith(tuple(OTHER_FORMATS)):
        remedy = next((said for begin, said in OTHER_FORMATS.items() if raw.startswith(begin)), "")
        endings = "endings of other formats: .h5, .hdf5, .nc, .mat, .parquet, .xlsx, .tdms"
        raise NotAvailable(f"{str(path)!r} is not text; {remedy or endings}")
    if len(raw) > LARGE and (table := _read_with_numpy(path, raw)) is not None:
        return table
    text, notes = decoded(raw)
    longest = max(map(len, text.splitlines()), default=0) if sum(map(text.count, _BREAKS)) <= MOST_LINES else None
    if longest is None or longest > MOST_LINE:
        which = f"lines of more than {MOST_LINE} characters" if longest else f"more than {MOST_LINES} lines"
        raise NotAvailable(
            f"{str(path)!r} has {which} and is not plain columns of numbers throughout; correct it, or give it as HDF5 "
            "or Parquet"
        )
    if text.startswith(BEGIN):
        return read_labview(text, path)
    layout = _layout(path, text)
    values, lines, faults, more = _numbers(path, layout)
    fine, said = harmless_lines(layout.body, layout.header, {fault.line or 0 for fault in faults})
    faults, more = [fault for fault in faults if fault.line not in fine], [*more, *said]
    table = Table(layout.names, values, lines, layout.units, [*notes, *more])
    if len(lines):
        _count_all_moments(table, layout)
    if faults and not skip_bad_lines:
        rest = [Problem("file", f"... and {len(faults) - SHOWN} more such lines")] if len(faults) > SHOWN else []
        advice = Problem("file", "correct these lines, or leave them out with skip_bad_lines (--skip-bad-lines)")
        raise ParameterError([*faults[:SHOWN], *rest, advice], title=str(path))
    if faults:
        shown = ", ".join(str(f.line) for f in faults[:SHOWN])
        table.notes.append(f"{len(faults)} damaged lines left out: {shown}{', ...' if len(faults) > SHOWN else ''}")
    return table


def _count_all_moments(table: Table, layout: _Layout) -> None:
    """Convert time columns to seconds; dates are added to the times of day, if one column holds these, and removed."""
    clocks = [k for k in layout.moments if k not in layout.days]
    if layout.days and len(clocks) == 1:
        date, clock = table.names[layout.days[0]], table.names[clocks[0]]
        table.values[clocks[0]] += table.values[layout.days[0]]
        table.notes.append(f"the times in {clock!r} are those of the dates in {date!r}")
    for k in clocks or layout.moments:
        count_moments(table, k)
    if clocks:
        table.drop(layout.days)


def decoded(raw: bytes) -> tuple[str, list[str]]:
    """Text of a file (UTF-8, UTF-16 or else Latin-1), and a note if it is Latin-1."""
    if raw[:2] in UTF16:
        return raw.decode("utf-16", errors="replace"), []
    try:
        return raw.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        return raw.decode("latin-1"), ["the file is not UTF-8; read as Latin-1"]


@dataclass(frozen=True)
class _Layout:
    """Layout of a text: names, units, separator, indices of columns of times and dates, lines of header and body."""

    names: list[str]
    units: list[str | None]
    delimiter: str | None
    moments: tuple[int, ...]
    days: tuple[int, ...]
    header: list[Line]
    body: list[Line]


def _layout(path: Path, text: str) -> _Layout:
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    comments = [(i, line.lstrip("#%; \t")) for i, line in numbered if line.lstrip()[:1] in ("#", "%")]
    rows = [(i, line) for i, line in numbered if line.lstrip()[:1] not in ("#", "%")]
    if not rows:
        raise NotAvailable(f"{str(path)!r} has no lines of numbers in it")
    delimiter = delimiter_of(rows)
    header, body = _header(rows, delimiter)
    if not body:
        hints = (_hint(cell) for _, line in rows[:50] for cell in cells_of(line, delimiter))
        advice = next((one for one in hints if one), "")
        where = "it" if len(rows) <= MOST_HEADER else f"its first {MOST_HEADER} lines"
        begins = f"it begins with {rows[0][1][:60]!r}{advice}"
        raise NotAvailable(f"{str(path)!r} has no lines of numbers in {where}; {begins}")
    count = _usual_count(header, body, delimiter)
    names, units = _names(header, comments, body[0][0], delimiter, count)
    _check_split(path, header, body, delimiter, count)
    cells = cells_of(body[0][1], delimiter)[: len(names)]
    moments = tuple(k for k, cell in enumerate(cells) if time_of(cell) is not None)
    days = tuple(k for k in moments if day(cells[k].strip('"')) is not None)
    return _Layout(names, units, delimiter, moments, days, header or comments, body)


def _check_split(path: Path, header: list[Line], body: list[Line], delimiter: str | None, count: int) -> None:
    """Raise an error if commas separate columns and thousands, so that numbers such as 1,234.5 are split."""
    named = max((len(cells_of(line, delimiter)) for _, line in header), default=count)
    if delimiter != "," or not 1 < named < count:
        return
    torn = next(((i, line) for i, line in body[:200] if _SPLIT_THOUSANDS.search(line)), None)
    if torn is not None:
        message = (
            f"{count} numbers below {named} names: {_format_line(torn[1])}; do commas divide thousands as well as "
            "columns? Set such numbers in quotes, or separate columns by semicolons or tabs"
        )  # fmt: skip
        raise ParameterError([Problem("file", message, torn[0])], title=str(path))


def _read_with_numpy(path: Path, raw: bytes) -> Table | None:
    """Table of a large text, parsed by NumPy; None if there is anything but numbers below its header."""
    head, notes = decoded(raw[: raw.rfind(b"\n", 0, SAMPLE_BYTES) + 1])
    if not head or head.count("\n") != len(head.splitlines()):
        return None
    try:
        layout = _layout(path, head)
    except NotAvailable:  # the first part of the text has no numbers
        return None
    first = layout.body[0][0]
    if layout.moments or layout.delimiter == "|":
        return None
    start = 0
    for _ in range(first - 1):
        start = raw.index(b"\n", start) + 1
    if layout.delimiter != "," and b"," in raw[start:]:
        if b"." in raw[start:]:
            return None
        raw = raw[:start] + raw[start:].replace(b",", b".")
        notes.append("numbers are written with a decimal comma")
    check_size(path, (raw.count(b"\n", start) + 1) * len(layout.names))
    try:
        values = np.loadtxt(
            io.BytesIO(raw[start:]), delimiter=layout.delimiter, comments=None, ndmin=2, encoding="latin-1"
        )
    except ValueError:
        return None
    if values.shape[1] != len(layout.names) or raw.rstrip().count(b"\n", start) + 1 != len(values):
        return None
    values[~np.isfinite(values)] = np.nan
    lines = np.arange(first, first + len(values))
    return Table(layout.names, np.ascontiguousarray(values.T), lines, layout.units, notes)


def delimiter_of(rows: list[Line]) -> str | None:
    """Character that separates the columns; None if blanks separate them."""
    middle = [line for _, line in rows[len(rows) // 2 : len(rows) // 2 + 20]]
    sample = [_QUOTED.sub("0", line) for line in middle if _BEGINS_WITH_NUMBER.match(line)]
    sample = sample or [_QUOTED.sub("0", line) for line in middle]
    for mark in ("\t", ";", "|"):
        if all(mark in line for line in sample):
            return mark
    if not all("," in line for line in sample):
        return None
    if all(_value(cell, POINT) is not None and " " not in cell.strip() for line in sample for cell in line.split(",")):
        return ","
    rows_of_blanks = [line.split() for line in sample]
    for decimal in (COMMA, POINT):
        if all(len(cells) > 1 and all(_is_number(cell, decimal) for cell in cells) for cells in rows_of_blanks):
            return None
    return ","


def _is_number(cell: str, mark: str) -> bool:
    """True if a cell holds a number with the decimal mark `mark` and does not end with a comma."""
    return number(cell, mark) is not None and not cell.endswith(COMMA)


def cells_of(line: str, delimiter: str | None, least: int = 1) -> list[str]:
    """Cells of a line; empty cells at its end are dropped while more than `least` cells remain."""
    if delimiter is None:
        return line.split()
    line = line.rstrip("\r\n")
    if delimiter == "|":
        line = line.strip().strip("|")
    found = line.split(delimiter)
    if '"' in line:
        found = next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True))
    cells = [cell.strip() for cell in found]
    if delimiter == "\t" or (len(cells) > 1 and cells[-1] == ""):
        while len(cells) > least and cells[-1] == "":
            cells.pop()  # empty cells after trailing delimiters
    return cells


def _value(cell: str, mark: str) -> float | None:
    """Number or time in a cell; NaN for an empty cell, None for other text."""
    found = number(cell, mark)
    return time_of(cell) if found is None else found


def _header(rows: list[Line], delimiter: str | None) -> tuple[list[Line], list[Line]]:
    """Lines of the header and of the body, which begins with the first two successive lines of numbers.

    Without two such lines, the body begins with the first line of numbers. It is empty if the first `MOST_HEADER` lines
    hold no numbers.
    """
    of_numbers = [_holds_numbers(line, delimiter) for _, line in rows[:HEADER_LINES]]
    alone = [k for k, own in enumerate(of_numbers) if own]
    for place in alone:
        if place + 1 >= len(of_numbers) or of_numbers[place + 1]:
            return rows[:place], rows[place:]
    if alone:
        return rows[: alone[0]], rows[alone[0] :]
    for place, (_, line) in enumerate(rows[HEADER_LINES:MOST_HEADER], start=HEADER_LINES):
        if _holds_numbers(line, delimiter):
            return rows[:place], rows[place:]
    return rows, []


def _holds_numbers(line: str, delimiter: str | None) -> bool:
    numbers = [value_of(cell) for cell in cells_of(line, delimiter)]
    return all(n is not None for n in numbers) and any(n == n for n in numbers)


def _usual_count(header: list[Line], body: list[Line], delimiter: str | None) -> int:
    """Number of columns: that of most lines, or the larger number in a header that names an often empty last column."""
    counts = [len(cells_of(line, delimiter)) for _, line in body[:200]]
    usual = max(set(counts), key=counts.count)
    if delimiter is not None:
        whole = [len(line.split(delimiter)) for _, line in body[:200] if _holds_numbers(line, delimiter)]
        named = [len(cells_of(line, delimiter)) for _, line in header]
        usual = max([count for count in named if usual < count and whole.count(count) > len(whole) / 2], default=usual)
    return usual


def _names(
    header: list[Line], comments: list[Line], first: int, delimiter: str | None, count: int
) -> tuple[list[str], list[str | None]]:
    """Names and units of the columns from the header or from comments; without both, the names are 1, 2, 3 …"""
    lines = [line for _, line in header] or [line for i, line in comments if i < first]
    split = [cells for line in lines[-NAMED:] if len(cells := header_cells(line, delimiter, count)) == count]
    return names_and_units(split, count)


def header_cells(line: str, delimiter: str | None, count: int) -> list[str]:
    """The `count` cells of a header line, which may be separated otherwise than the body; empty for another number."""
    if delimiter == "|":
        line = line.strip().strip("|")
    if not re.search(r"[^-=+|:\s]", line):
        return []
    marks = [re.escape(delimiter)] if delimiter else []
    for pattern in [*marks, r"\t", r"\s{2,}", ",", ";", r"\s+(?![\[\(])", r"\s+"]:
        cells = [cell.strip().strip('"').strip() for cell in re.split(pattern, line.strip())]
        while len(cells) > count and cells[-1] == "":
            cells.pop()
        if len(cells) == count:
            return cells
    return []


def _numbers(path: Path, layout: _Layout) -> tuple[Array, Array, list[Problem], list[str]]:
    """Numbers (columns, rows), line number of each row, problems in damaged lines, and notes."""
    count = len(layout.names)
    lines, table, faults = [], [], []
    for line_number, line in layout.body:
        cells = cells_of(line, layout.delimiter, count)
        if len(cells) == count:
            lines.append(line_number)
            table.append(cells)
            continue
        message = f"{_format_count(len(cells))} where {count} are expected: {_format_line(line)}"
        if layout.delimiter is None and "," in line:
            message += "; do blanks divide thousands as well as columns? Separate columns by semicolons or tabs"
        faults.append(Problem("file", message, line_number))
    marks, notes = [POINT] * count, list[str]()
    if (layout.delimiter != "," or any('"' in line for _, line in layout.body)) and any(
        COMMA in cell for cells in table for cell in cells
    ):
        plain = [[] if k in layout.moments else [cells[k] for cells in table] for k in range(count)]
        marks, notes, fault = decimal_marks(layout.names, plain)
        if fault is not None:
            raise ParameterError([Problem("file", fault)], title=str(path))
    values, kept = [], []
    for line_number, cells in zip(lines, table, strict=True):
        row, fault = _row(cells, marks, layout.names)
        if fault is None:
            values.append(row)
            kept.append(line_number)
        else:
            faults.append(Problem("file", fault, line_number))
    faults.sort(key=lambda problem: problem.line or 0)
    return np.array(values, dtype=float).reshape(-1, count).T.copy(), np.array(kept, dtype=int), faults, notes


def _row(cells: list[str], marks: list[str], names: list[str]) -> tuple[list[float], str | None]:
    """Numbers in the cells of a line, and a message on the first faulty cell (None if no cell is faulty)."""
    if COMMA not in marks:
        try:
            return [float(cell) for cell in cells], None
        except ValueError:
            pass
    row = []
    for name, cell, mark in zip(names, cells, marks, strict=True):
        value = _value(cell, mark)
        if value is None:
            return [], f"{cell!r} in column {name!r} is not a plain number" + _hint(cell)
        row.append(value)
    return row, None


def _format_count(count: int) -> str:
    return "1 column" if count == 1 else f"{count} columns"


def _format_line(line: str) -> str:
    return repr(line.strip()[:50] + ("..." if len(line.strip()) > 50 else ""))


def _hint(cell: str) -> str:
    if re.match(r"^[-+]?[\d.]+(e[-+]?\d+)?\s*[a-zµ%/]+", cell, re.I):
        return "; a unit belongs into the column's name, and is the same for the whole column"
    return ""
