"""Replacement of words in a table of speeds: directions become 1 and -1; columns of remarks or dates are left out."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from steadyslip.core.errors import ParameterError, Problem, repr_short
from steadyslip.experiments.measured.formats.cells import MISSING, value_of
from steadyslip.experiments.measured.formats.text import LARGE, cells_of, decoded, delimiter_of, header_cells

FORWARD = r"forward|forwards|fwd|fw|vor|vorwärts|hin|positive|pos|cw|\+"
BACKWARD = r"backward|backwards|bwd|back|bw|reverse|rück|rückwärts|zurück|negative|neg|ccw|[-−–]"
_DIRECTION = re.compile(rf"(?i)(?<![^\s,;|\t\"])(?:{FORWARD}|{BACKWARD})(?![^\s,;|\t\"])")
_DASHES = ("-", "−", "–")
"""Cells that mean backward in a column of directions, and a missing value in other columns."""
_DIRECTIONS = "forward and backward, vor and zurück, + and -, 1 and -1"


def without_words(raw: bytes, role_of: Callable[[str], str | None]) -> tuple[bytes, list[str]]:
    """Text of a table with words replaced by numbers or empty cells, and notes on columns that are left out.

    Parameters
    ----------
    raw : bytes
    role_of : callable
        Function from the name of a column to its role; None if the column is not needed.

    Raises
    ------
    ParameterError
        If a needed column holds words other than directions.
    """
    if len(raw) > LARGE:  # tables of speeds have few rows, so this is none
        return raw, []
    lines = decoded(raw)[0].splitlines()
    rows = [(i, line) for i, line in enumerate(lines) if line.strip() and line.lstrip()[:1] not in ("#", "%")]
    if not rows:
        return raw, []
    delimiter = delimiter_of([(i, _DIRECTION.sub("1", line)) for i, line in rows])
    split = {i: cells_of(line, delimiter) for i, line in rows[1:]}
    of_numbers = [i for i, cells in split.items() if any(_is_number(cell) for cell in cells)]
    counts = [len(split[i]) for i in of_numbers]
    count = max(counts, key=counts.count, default=0)
    body = {i: cells for i in of_numbers if len(cells := cells_of(lines[i], delimiter, count)) == count}
    if count < 2 or not body:
        return raw, []
    heads = [line for i, line in rows if i < min(body)]
    names = next((cells for head in heads if (cells := header_cells(head, delimiter, count))), [""] * count)
    left, problems = [], []
    for k, name in enumerate(names):
        column, role = [cells[k] for cells in body.values()], role_of(name)
        new = _plain(column, role)
        if new is None and role is not None:
            problems.append(_holds_words(name, role, column))
        elif new is None:
            left.append(name or str(k + 1))
        for cells, cell in zip(body.values(), new or ["nan"] * len(column), strict=True):
            cells[k] = cell
    if problems:
        raise ParameterError(problems)
    for i, cells in body.items():
        if cells != cells_of(lines[i], delimiter, count):
            lines[i] = _joined(cells, delimiter)
    notes = [f"left out, as it holds words: column {name!r}" for name in left]
    return ("\n".join(lines) + "\n").encode("utf-8"), notes


def _plain(column: Sequence[str], role: str | None) -> list[str] | None:
    """Cells of a column, with directions as 1 and -1 and dashes as nan; None if it holds other words."""
    words = [cell for cell in column if not _is_number(cell) and (cell.lower() not in MISSING or cell in _DASHES)]
    said = [cell for cell in words if cell not in _DASHES]
    if (said or role == "direction") and all(_DIRECTION.fullmatch(cell) for cell in words):
        return [("1" if re.fullmatch(FORWARD, cell, re.I) else "-1") if cell in words else cell for cell in column]
    if len(said) > sum(map(_is_number, column)):
        return None
    return ["nan" if cell in _DASHES else cell for cell in column]


def _holds_words(name: str, role: str, column: Sequence[str]) -> Problem:
    words = [cell for cell in column if not _is_number(cell) and cell.lower() not in MISSING]
    example = next(cell for cell in words if role != "direction" or not _DIRECTION.fullmatch(cell))
    allowed = _DIRECTIONS if role == "direction" else "numbers, with their unit in the name of the column"
    return Problem(name, f"holds words, such as {repr_short(example)}; allowed: {allowed}")


def _is_number(cell: str) -> bool:
    """True if a cell holds a number, date or time of day."""
    found = value_of(cell)
    return found is not None and found == found


def _joined(cells: Sequence[str], delimiter: str | None) -> str:
    if delimiter is None:
        return " ".join(cell or "nan" for cell in cells)
    return delimiter.join(f'"{cell}"' if delimiter in cell else cell for cell in cells)
