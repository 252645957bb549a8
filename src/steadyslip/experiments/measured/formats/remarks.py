"""Lines of a text that are not part of its table: repeated headers, remarks below the table."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

Line = tuple[int, str]
MOST_BELOW = 200  # largest number of lines of remarks below a table; chosen by trial
SHOWN = 40  # largest number of characters of a remark that a note quotes
_WORD = re.compile(r"[^\W\d_]{2,}|[*=#~-]{2,}|\x1a|\x00")


def harmless_lines(body: Sequence[Line], header: Sequence[Line], bad: set[int]) -> tuple[set[int], list[str]]:
    """Numbers of bad lines that may be left out (repeated headers, remarks at the end), and notes on these lines.

    Parameters
    ----------
    body : sequence of (int, str)
        Non-empty lines with their numbers.
    header : sequence of (int, str)
        Lines above the body.
    bad : set of int
        Numbers of the lines of the body that do not have the table's columns.
    """
    above = {line.strip() for _, line in header}
    fine, notes, repeated = set[int](), list[str](), list[int]()
    for run in _runs(body, bad):
        if any(line.strip() in above for _, line in run):
            fine |= {number for number, _ in run}
            repeated.append(run[0][0])
        elif run[-1] == body[-1] and len(run) <= min(MOST_BELOW, len(body) / 2) and _are_words(run):
            notes.append(f"left out below the table, from line {run[0][0]}: {run[0][1].strip()[:SHOWN]!r}")
            fine |= {number for number, _ in run}
    if repeated:
        where = ", ".join(map(str, repeated[:5])) + (", ..." if len(repeated) > 5 else "")
        notes.append(f"the header is repeated within the table (line {where}); left out there")
    return fine, notes


def _are_words(run: Sequence[Line]) -> bool:
    return all(_WORD.search(line) for _, line in run)


def _runs(body: Sequence[Line], bad: set[int]) -> Iterator[list[Line]]:
    """Runs of consecutive bad lines."""
    run: list[Line] = []
    for one in body:
        if one[0] in bad:
            run.append(one)
        elif run:
            yield run
            run = []
    if run:
        yield run
