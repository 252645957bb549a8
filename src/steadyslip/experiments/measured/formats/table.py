"""Table of named columns that was read from a file, and limits on its size."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.columns import known_unit, listed
from steadyslip.experiments.measured.formats.cells import seconds_since_first

LENGTH_TOLERANCE = 0.03
"""Columns whose lengths differ by a smaller share belong together: the acquisition was interrupted; chosen by trial."""
MOST_VALUES, MOST_ROWS = 40_000_000, 10_000_000
"""Largest number of values in a file and in a column: with the copies made by cleaning, they fit into a gigabyte."""
FEW_VALUES, VALUES_A_BYTE = 2**20, 16
"""A file may hold the first number of values, plus the second for each of its bytes. Measured noise takes about a byte
per value even if it is compressed, so that files with more values are not measured."""


@dataclass
class Table:
    """Named columns of a file.

    Attributes
    ----------
    names : list of str
    values : ndarray (columns, rows)
        NaN for empty cells.
    lines : ndarray of int (rows)
        For each row, its line in the file or its number in the table, from 1.
    units : list of str or None
        For each column, the unit that the file gives apart from the name; None if it gives none.
    notes : list of str
    """

    names: list[str]
    values: Array
    lines: Array
    units: list[str | None] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.units = self.units or [None] * len(self.names)

    def drop(self, places: Sequence[int]) -> None:
        """Remove the columns with the indices `places`."""
        keep = [k for k in range(len(self.names)) if k not in places]
        self.names, self.units = [self.names[k] for k in keep], [self.units[k] for k in keep]
        self.values = self.values[keep]


def check_size(path: Path, size: int, remedy: str = "", rows: int = 0) -> None:
    """Raise an error, before reading, for more numbers than a record may have or than a file of this size can hold."""
    if size > MOST_VALUES or rows > MOST_ROWS:
        most = f"{MOST_VALUES} in all, {MOST_ROWS} in a column"
        raise NotAvailable(f"{str(path)!r} has {max(size, rows)} numbers; allowed: up to {most}{remedy}")
    held = path.stat().st_size
    if size > FEW_VALUES + VALUES_A_BYTE * held:
        raise NotAvailable(
            f"{str(path)!r} claims to hold {size} numbers in {held} bytes, too few bytes for measured numbers{remedy}"
        )


def check_ambiguous_names(path: Path, found: Sequence[str], kind: str) -> None:
    """Raise an error if several parts of a file have columns of the same names, so that the user must choose a part.

    Parameters
    ----------
    found : sequence of str
        Full names of columns, with parts separated by ``/`` or ``.``.
    kind : str
        What the parts are called in the message, such as group.
    """
    homes: dict[str, list[str]] = {}
    for name in found:
        home, mark, last = name.rpartition("/" if "/" in name else ".")
        homes.setdefault(last, []).append(home if mark else "")
    shared = [parts for parts in homes.values() if len(parts) > 1]
    if shared and len(shared) == len(homes) and all(parts == shared[0] for parts in shared):
        several = listed(part or "the top" for part in shared[0])
        raise NotAvailable(
            f"{str(path)!r} has columns of the same names in several {kind}s; say which with table=: {several}"
        )


def chosen_part(path: Path, kind: str, table: str | None, parts: Sequence[str]) -> str | None:
    """Name of the part of a file that the option `table` selects; None for the whole file.

    Raises
    ------
    NotAvailable
        If the file has no part of that name.
    """
    if table is not None and table not in parts:
        raise NotAvailable(f"{str(path)!r} has no {kind} {table!r}; it has {listed(parts) or 'none'}")
    return table


def from_vectors(path: Path, found: Mapping[str, tuple[Any, str | None]], notes: Sequence[str] = ()) -> Table:
    """Table of all vectors that have the most common length; the columns of a matrix are named by numbers."""
    vectors: dict[str, tuple[Array, str | None]] = {}
    for name, (values, unit) in found.items():
        array = np.squeeze(np.asarray(values, dtype=float))
        if array.ndim == 1 and array.size > 1:
            vectors[name] = (array, unit)
        elif array.ndim == 2:
            matrix = array if array.shape[0] > array.shape[1] else array.T
            for i, column in enumerate(matrix.T, start=1):
                vectors[f"{name}.{i}" if len(found) > 1 else str(i)] = (column, None)
    if not vectors:
        raise NotAvailable(f"{str(path)!r} has no columns of numbers in it")
    lengths = [len(values) for values, _ in vectors.values()]
    usual = max(set(lengths), key=lambda n: (lengths.count(n), n))
    ended = [n for n in lengths if n != usual and abs(n - usual) <= max(LENGTH_TOLERANCE * usual, 1)]
    if ended:  # the acquisition was interrupted within a row
        notes = [
            *notes,
            f"columns are {min([*ended, usual])} to {max([*ended, usual])} values long; cut to the shortest",
        ]
        usual = min([*ended, usual])
        vectors = {
            name: (one[:usual] if usual < len(one) <= usual * (1 + 2 * LENGTH_TOLERANCE) + 2 else one, unit)
            for name, (one, unit) in vectors.items()
        }
    left = [name for name, (values, _) in vectors.items() if len(values) != usual]
    said = [*notes, f"left out, not {usual} values long: {listed(left)}"] if left else list(notes)
    kept = {name: pair for name, pair in vectors.items() if name not in left}
    check_size(path, usual * len(kept), rows=usual)
    return Table(
        list(kept), np.array([values for values, _ in kept.values()]), np.arange(1, usual + 1),
        [None if unit is None else known_unit(unit) for _, unit in kept.values()], said,
    )  # fmt: skip


def names_and_units(lines: Sequence[Sequence[str]], count: int) -> tuple[list[str], list[str | None]]:
    """Names and units of columns from the lines above the numbers; without lines, the names are 1, 2, 3 …"""
    if not lines:
        return [str(i) for i in range(1, count + 1)], [None] * count
    rows = [([*cells], _as_units(cells)) for cells in lines]
    named = [cells for cells, units in rows if units is None] or [rows[-1][0]]
    names = named[-1]
    if len(set(names)) <= count / 2:  # a line of repeated words (raw, raw, computed) is not the names
        names = max(named, key=lambda cells: len(set(cells) - {""}))
    stated = [units for cells, units in rows if units is not None and cells is not names]
    return names, stated[-1] if stated else [None] * count


def _as_units(cells: Sequence[str]) -> list[str | None] | None:
    """Units in the cells of a line, if all its cells are units; else None."""
    plain = [cell.strip("()[] ") for cell in cells]
    units = [known_unit(cell or "1") for cell in plain]
    are_words = any(re.search(r"[^\W\d_]|%|°", cell) for cell in plain)
    return units if are_words and all(unit is not None for unit in units) else None


def count_moments(table: Table, place: int) -> None:
    """Convert the times of day or dates in a column to seconds since the first of them."""
    table.values[place] = seconds_since_first(table.values[place])
    table.units[place] = "s"
    table.notes.append(f"column {table.names[place]!r} holds times of day or dates; counted in seconds from the first")
