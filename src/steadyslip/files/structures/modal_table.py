"""Modes of a structure from a table: frequencies, damping ratios, and shapes at named points."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.names import unfit_name
from steadyslip.files.inputs import MOST_TEXT, UnreadableFile
from steadyslip.files.structures.table_text import hertz_of, table_text
from steadyslip.machine.structure_data import StructureData

FREQUENCY, DAMPING, MASS = "frequency", "damping", "mass"
"""Names of the columns with frequency (Hz), damping ratio, and modal mass (kg; 1 if there is no such column)."""
_COLUMNS = (
    "frequency (Hz; else as in frequency [rad/s]), damping (ratio), perhaps mass (kg), and of each point, as of tip, "
    "tip.x and tip.y"
)
_AXES = ("x", "y")


def read_modes(path: str, folder: Path) -> StructureData:
    """Modes of a structure as matrices of modal coordinates.

    Parameters
    ----------
    path : str
        Text file relative to `folder` (`table_text`), with a header: ``frequency`` (Hz, or ``frequency [rad/s]``),
        ``damping`` (ratio), perhaps ``mass`` (kg), and for each point and direction a column such as ``pad.x`` and
        ``pad.y`` with the mode shapes.
    folder : Path

    Raises
    ------
    UnreadableFile
        If the file cannot be read, or a column or number is not as described.
    """
    text = table_text(path, folder, MOST_TEXT)
    table = [row for row in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in row)]
    header = [cell.strip() for cell in table[0]] if table else []
    units = {i: found for i, name in enumerate(header) if (found := hertz_of(path, name)) is not None}
    header = [FREQUENCY if i in units else name for i, name in enumerate(header)]
    columns = _numbers(path, header, table[1:])
    if lost := [name for name in (FREQUENCY, DAMPING) if name not in columns]:
        raise UnreadableFile(
            path,
            f"it has no column {' and '.join(lost)}; its first line is {','.join(header)[:80]!r}; allowed: {_COLUMNS}",
        )
    frequency, damping = columns.pop(FREQUENCY), columns.pop(DAMPING)
    mass = columns.pop(MASS, np.ones(len(frequency)))
    for name, values, least in ((FREQUENCY, frequency, 0.0), (DAMPING, damping, -math.inf), (MASS, mass, None)):
        if (least is None and not np.all(values > 0)) or (least is not None and not np.all(values >= least)):
            raise UnreadableFile(
                path, f"its column {name} has {np.min(values):g}; allowed: {'> 0' if least is None else '>= 0'}"
            )
    omega = 2 * math.pi * frequency * next(iter(units.values()))
    stiffness, dashpots = np.diag(mass * omega**2), np.diag(2 * damping * mass * omega)
    return StructureData(np.diag(mass), dashpots, stiffness, 0 * stiffness, _points(path, columns), path)


def _numbers(path: str, header: list[str], rows: list[list[str]]) -> dict[str, Array]:
    if not rows:
        raise UnreadableFile(path, "it has no modes; allowed: a line for each below the names of the columns")
    if twice := [name for name in header if header.count(name) > 1]:
        raise UnreadableFile(path, f"it has two columns {twice[0]!r}")
    found = np.empty((len(rows), len(header)))
    for i, row in enumerate(rows):
        if len(row) != len(header):
            raise UnreadableFile(
                path, f"line {i + 2} has {len(row)} numbers; allowed: {len(header)}, as the first line"
            )
        for j, cell in enumerate(row):
            try:
                found[i, j] = float(cell)
            except ValueError:
                found[i, j] = math.nan
            if not math.isfinite(found[i, j]):
                raise UnreadableFile(
                    path, f"line {i + 2}, column {header[j]!r}: got {cell.strip()!r}; allowed: a number"
                )
    return dict(zip(header, found.T, strict=True))


def _points(path: str, columns: dict[str, Array]) -> dict[str, tuple[Array | None, Array | None]]:
    """Displacements of each point along x and y in the mode shapes, by name of the point; None where missing."""
    found: dict[str, list[Array | None]] = {}
    for name, shape in columns.items():
        point, _, axis = name.rpartition(".")
        if axis not in _AXES or unfit_name(point):
            raise UnreadableFile(path, f"its column {name!r} is not allowed: {_COLUMNS}")
        found.setdefault(point, [None, None])[_AXES.index(axis)] = shape
    return {name: (x, y) for name, (x, y) in found.items()}
