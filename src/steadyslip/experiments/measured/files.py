"""Files of measured columns: text, HDF5, MATLAB, Parquet. Columns come back as they are; nothing is interpreted."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem, SteadyslipError
from steadyslip.experiments.measured.moments import from_the_first, moment
from steadyslip.experiments.measured.xlook import is_xlook, read_xlook
from steadyslip.files.inputs import check_file, read_bytes

Array = np.ndarray
MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "-inf", "+inf", "nat", "#n/a", "-nan"}
SHOWN = 8  # bad lines that a message lists
MOST_TEXT, MOST_BINARY = 2**26, 2**31  # bytes of a file
MOST_LINES, MOST_LINE = 2_000_000, 100_000  # lines of a text, characters of one
MOST_VALUES = 2**26  # numbers of a file
MOST_DATASETS = 10_000
_BREAKS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"


@dataclass
class Columns:
    """Numbers of a file.

    Attributes
    ----------
    names : list of str
    values : ndarray (columns, rows)
        NaN where a cell is empty.
    lines : ndarray of int (rows)
        Line of the file, from 1, or row of the table.
    units : list of str or None
        Units stated apart from the names.
    notes : list of str
    """

    names: list[str]
    values: Array
    lines: Array
    units: list[str | None] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.units = self.units or [None] * len(self.names)


def read_columns(path: Path, table: str | None = None, skip_bad_lines: bool = False) -> Columns:
    """Read a file by its ending; text unless that is known.

    Raises
    ------
    NotAvailable
        If the file cannot be read, or its format needs a package that is not installed.
    ParameterError
        If lines are damaged.
    """
    kind, reader = FORMATS.get(path.suffix.lower(), ("text", None))
    if reader is None:
        return _text(path, skip_bad_lines)
    check_file(path, MOST_BINARY)
    try:
        return reader(path, table)
    except SteadyslipError:
        raise
    except MemoryError as error:
        raise NotAvailable(f"cannot read {str(path)!r}: it does not fit into memory") from error
    except Exception as error:  # the readers of foreign formats raise whatever a damaged file brings about
        raise NotAvailable(f"cannot read {str(path)!r} as {kind}: {type(error).__name__}: {error}") from error


# -- text


def _text(path: Path, skip_bad_lines: bool) -> Columns:
    from steadyslip.experiments.measured.columns import _known_unit

    raw, notes = read_bytes(path, MOST_TEXT), []
    if is_xlook(raw):
        found_names, found_units, numbers = read_xlook(raw, str(path))
        known = [None if unit is None else _known_unit(unit) for unit in found_units]
        return Columns(found_names, numbers, np.arange(1, numbers.shape[1] + 1), known, ["read as XLOOK file"])
    if b"\0" in raw[:4096]:
        message = f"{str(path)!r} is not text; allowed endings of other formats: .h5, .hdf5, .mat, .parquet"
        raise NotAvailable(message)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
        notes.append("the file is not UTF-8; read as Latin-1")
    longest = max(map(len, text.splitlines()), default=0) if sum(map(text.count, _BREAKS)) <= MOST_LINES else None
    if longest is None or longest > MOST_LINE:
        which = f"lines of more than {MOST_LINE} characters" if longest else f"more than {MOST_LINES} lines"
        raise NotAvailable(f"{str(path)!r} has {which}; give so large a record as HDF5 or Parquet, or thin it out")
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    comments = [(i, line.lstrip("#%; \t")) for i, line in numbered if line.lstrip()[:1] in ("#", "%")]
    rows = [(i, line) for i, line in numbered if line.lstrip()[:1] not in ("#", "%")]
    if not rows:
        raise NotAvailable(f"{str(path)!r} has no lines of numbers in it")
    delimiter, comma = _format(rows)
    header, body = _header(rows, delimiter, comma)
    if not body:
        raise NotAvailable(f"{str(path)!r} has no lines of numbers in it; it begins with {rows[0][1][:60]!r}")
    count = _usual_count(body, delimiter)
    names, units = _names(header, comments, body[0][0], delimiter, count)
    if comma:
        notes.append("numbers are written with a decimal comma")
    values, lines, faults = _numbers(body, delimiter, comma, names)
    for k, cell in enumerate(_cells(body[0][1], delimiter)[: len(names)]):
        if moment(cell.strip('"')) is not None and values.shape[1]:
            values[k], units[k] = from_the_first(values[k]), "s"
            notes.append(f"column {names[k]!r} holds times of day or dates; counted in seconds from the first")
    if faults and not skip_bad_lines:
        more = [Problem("file", f"... and {len(faults) - SHOWN} more such lines")] if len(faults) > SHOWN else []
        advice = Problem("file", "mend these lines, or leave them out with skip_bad_lines (--skip-bad-lines)")
        raise ParameterError([*faults[:SHOWN], *more, advice], title=str(path))
    if faults:
        shown = ", ".join(str(f.line) for f in faults[:SHOWN])
        notes.append(f"{len(faults)} damaged lines left out: {shown}{', ...' if len(faults) > SHOWN else ''}")
    return Columns(names, values, lines, units, notes)


def _format(rows: list[tuple[int, str]]) -> tuple[str | None, bool]:
    """Delimiter (None: blanks) and whether numbers have a decimal comma."""
    sample = [line for _, line in rows[len(rows) // 2 : len(rows) // 2 + 20]]
    for mark in ("\t", ";"):
        if all(mark in line for line in sample):
            return mark, any(re.search(r"\d,\d", line) for line in sample)
    if all("," in line for line in sample):
        cells = [line.split(",") for line in sample]
        if all(_number(c, False) is not None or c.strip().lower() in MISSING for row in cells for c in row):
            return ",", False
        if all(
            re.fullmatch(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?(\s+[-+]?\d+(,\d+)?([eE][-+]?\d+)?)+\s*", x) for x in sample
        ):
            return None, True
        return ",", False
    return None, False


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    cells = [cell.strip() for cell in line.rstrip("\r\n").split(delimiter)]
    if delimiter == "\t" or (len(cells) > 1 and cells[-1] == ""):
        while len(cells) > 1 and cells[-1] == "":
            cells.pop()  # trailing delimiters
    return cells


def _number(cell: str, comma: bool) -> float | None:
    """The number in a cell; NaN for an empty one, None for anything else."""
    plain = cell.strip().strip('"')
    if plain.lower() in MISSING:
        return float("nan")
    try:
        return float(plain.replace(",", ".") if comma else plain)
    except ValueError:
        return moment(plain)


def _header(
    rows: list[tuple[int, str]], delimiter: str | None, comma: bool
) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Lines before the first that holds numbers only, and the rest."""
    for place, (_, line) in enumerate(rows):
        cells = _cells(line, delimiter)
        numbers = [_number(cell, comma) for cell in cells]
        if all(n is not None for n in numbers) and any(n == n for n in numbers):
            return rows[:place], rows[place:]
    return rows, []


def _usual_count(body: list[tuple[int, str]], delimiter: str | None) -> int:
    counts = [len(_cells(line, delimiter)) for _, line in body[:200]]
    return max(set(counts), key=counts.count)


def _names(
    header: list[tuple[int, str]], comments: list[tuple[int, str]], first: int, delimiter: str | None, count: int
) -> tuple[list[str], list[str | None]]:
    """Names of the columns, and units from a line of their own; numbers as names without a header."""
    from steadyslip.experiments.measured.columns import _known_unit

    lines = [line for _, line in header] or [line for i, line in comments if i < first]
    split = [cells for line in lines if len(cells := _header_cells(line, delimiter, count)) == count]
    if not split:
        return [str(i) for i in range(1, count + 1)], [None] * count
    *above, last = split
    as_units = [_known_unit(cell.strip("()[] ") or "1") for cell in last]
    if above and all(unit is not None for unit in as_units):
        return above[-1], as_units
    return last, [None] * count


def _header_cells(line: str, delimiter: str | None, count: int) -> list[str]:
    """Cells of a header, which may be separated otherwise than the numbers."""
    marks = [re.escape(delimiter)] if delimiter else []
    for pattern in [*marks, r"\t", r"\s{2,}", ",", ";", r"\s+(?![\[\(])", r"\s+"]:
        cells = [cell.strip() for cell in re.split(pattern, line.strip())]
        while len(cells) > count and cells[-1] == "":
            cells.pop()
        if len(cells) == count:
            return cells
    return []


def _numbers(
    body: list[tuple[int, str]], delimiter: str | None, comma: bool, names: list[str]
) -> tuple[Array, Array, list[Problem]]:
    """All numbers, their lines, and the lines that are damaged."""
    count = len(names)
    lines, table, faults = [], [], []
    for number, line in body:
        cells = _cells(line, delimiter)
        if len(cells) != count:
            faults.append(Problem("file", f"{_counted(len(cells))} where {count} are expected: {_cut(line)}", number))
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
            for name, cell in zip(names, cells, strict=True):
                value = _number(cell, comma)
                if value is None:
                    fault = f"{cell!r} in column {name!r} is not a plain number" + _hint(cell)
                    faults.append(Problem("file", fault, number))
                    break
                row.append(value)
            if len(row) < count:
                continue
        lines.append(number)
        table.append(row)
    return np.array(table, dtype=float).reshape(-1, count).T.copy(), np.array(lines, dtype=int), faults


def _counted(count: int) -> str:
    return "1 column" if count == 1 else f"{count} columns"


def _cut(line: str) -> str:
    return repr(line.strip()[:50] + ("..." if len(line.strip()) > 50 else ""))


def _hint(cell: str) -> str:
    if re.match(r"^[-+]?[\d.]+(e[-+]?\d+)?\s*[a-zµ%/]+", cell, re.I):
        return "; a unit belongs into the column's name, and is the same for the whole column"
    return ""


# -- other formats


def _needs(package: str, path: Path) -> NotAvailable:
    return NotAvailable(f"{str(path)!r}: this format needs the package {package}; install steadyslip[lab]")


def _hdf5(path: Path, table: str | None) -> Columns:
    try:
        import h5py
    except ImportError as error:
        raise _needs("h5py", path) from error
    with h5py.File(path, "r") as file:
        group = file
        if table is not None:
            if table not in file:
                raise NotAvailable(f"{str(path)!r} has no group {table!r}; it has {', '.join(_groups(file))}")
            group = file[table]
        return _from_datasets(path, dict(_datasets(group, h5py)))


def _groups(file: Any) -> list[str]:
    found: list[str] = []
    file.visit(found.append)
    return found or ["nothing"]


def _datasets(group: Any, h5py: Any) -> Iterator[tuple[str, tuple[Array, str | None]]]:
    """Numeric arrays below a group, with their units; columns of compound tables too. Nothing outside the file."""
    items: dict[str, Any] = {}
    if isinstance(group, h5py.Dataset):
        items[group.name.rpartition("/")[2]] = group
    else:  # each object once, however links go round; none behind a link to another file
        group.visititems(items.__setitem__)
    chosen = {name: item for name, item in items.items() if isinstance(item, h5py.Dataset)}
    if len(chosen) > MOST_DATASETS:
        raise NotAvailable(f"the file has {len(chosen)} datasets; allowed: up to {MOST_DATASETS}")
    size = sum(item.size or 0 for item in chosen.values())
    if size > MOST_VALUES:
        raise NotAvailable(f"the file has {size} numbers; allowed: up to {MOST_VALUES}; name a group with table=")
    for name, item in chosen.items():
        if item.is_virtual or item.external:
            raise NotAvailable(f"dataset {name!r} takes its numbers from another file; copy them into this one")
        raw = item.attrs.get("units", item.attrs.get("unit"))
        unit = raw.decode() if isinstance(raw, bytes) else None if raw is None else str(raw)
        if item.dtype.names:
            for column in item.dtype.names:
                yield column, (np.asarray(item[column]), None)
        elif item.dtype.kind in "iuf":
            yield name.rpartition("/")[2], (np.asarray(item[()]), unit)


def _from_datasets(path: Path, found: dict[str, tuple[Array, str | None]]) -> Columns:
    """Vectors of the most common length, by name; a single matrix by number."""
    vectors = {}
    for name, (values, unit) in found.items():
        array = np.squeeze(np.asarray(values, dtype=float))
        if array.ndim == 1 and array.size > 1:
            vectors[name] = (array, unit)
        elif array.ndim == 2:
            matrix = array if array.shape[0] > array.shape[1] else array.T
            numbered = {
                f"{name}.{i}" if len(found) > 1 else str(i): matrix[:, i - 1] for i in range(1, matrix.shape[1] + 1)
            }
            vectors |= {key: (column, None) for key, column in numbered.items()}
    if not vectors:
        raise NotAvailable(f"{str(path)!r} has no columns of numbers in it")
    lengths = [len(values) for values, _ in vectors.values()]
    usual = max(set(lengths), key=lambda n: (lengths.count(n), n))
    left = [name for name, (values, _) in vectors.items() if len(values) != usual]
    notes = [f"left out, not {usual} values long: {', '.join(left)}"] if left else []
    kept = {name: pair for name, pair in vectors.items() if name not in left}
    return Columns(
        list(kept), np.array([values for values, _ in kept.values()]), np.arange(1, usual + 1),
        [unit for _, unit in kept.values()], notes,
    )  # fmt: skip


def _matlab(path: Path, table: str | None) -> Columns:
    from scipy.io import loadmat, whosmat

    try:
        size = sum(math.prod(shape) for _, shape, _ in whosmat(path))
        if size > MOST_VALUES:
            raise NotAvailable(f"{str(path)!r} has {size} numbers; allowed: up to {MOST_VALUES}")
        found = loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:  # version 7.3 is HDF5
        return _hdf5(path, table)
    content = {name: value for name, value in found.items() if not name.startswith("__")}
    if table is not None:
        if table not in content:
            raise NotAvailable(f"{str(path)!r} has no variable {table!r}; it has {', '.join(content)}")
        content = {table: content[table]}
    flat: dict[str, tuple[Array, str | None]] = {}
    for name, value in content.items():
        array = np.asarray(value)
        if array.dtype.names:
            flat |= {
                column: (np.asarray(array[column].item()), None) for column in array.dtype.names if array.size == 1
            }
        elif array.dtype.kind in "iuf":
            flat[name] = (array, None)
    return _from_datasets(path, {n: p for n, p in flat.items() if np.asarray(p[0]).dtype.kind in "iuf"})


def _parquet(path: Path, table: str | None) -> Columns:
    try:
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise _needs("pyarrow", path) from error
    if table is not None:
        raise NotAvailable(f"{str(path)!r}: a Parquet file has one table; leave table= away")
    about = parquet.ParquetFile(path).metadata
    if about.num_rows * about.num_columns > MOST_VALUES:
        size = about.num_rows * about.num_columns
        raise NotAvailable(f"{str(path)!r} has {size} numbers; allowed: up to {MOST_VALUES}")
    content = parquet.read_table(path)
    numeric: dict[str, tuple[Array, str | None]] = {}
    for name in content.column_names:
        column = content.column(name).to_numpy()
        if column.dtype.kind in "iuf":
            numeric[name] = (column, None)
    return _from_datasets(path, numeric)


FORMATS: dict[str, tuple[str, Callable[[Path, str | None], Columns]]] = {
    **dict.fromkeys((".h5", ".hdf5", ".hdf", ".nc"), ("HDF5", _hdf5)),
    ".mat": ("MATLAB file", _matlab),
    **dict.fromkeys((".parquet", ".pq"), ("Parquet", _parquet)),
}
"""Readers by the ending of a name; everything else is text."""
