"""Numbers, times of day and dates in the cells of a table.

Numbers have a decimal point or comma, and may have thousands separators.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime

import numpy as np

from steadyslip.core.arrays import Array

MISSING = {
    "", "nan", "na", "n/a", "null", "none", "-", "--", "---", "inf", "-inf", "+inf", "nat", "#n/a", "-nan", "missing",
    "#div/0!", "#value!", "#ref!", "#num!", "#name?", "#null!", "*", "**", "***", "?", ".",
    "1.#qnan", "1.#inf", "-1.#ind",
}  # fmt: skip
"""Texts of cells (in lower case) that stand for a missing number."""

POINT, COMMA = ".", ","
_GROUPED = {
    mark: re.compile(
        rf"[-+]?\d{{1,3}}([{other}'’ \u00a0\u2009\u202f])\d{{3}}(\1\d{{3}})*({re.escape(mark)}\d*)?([eE][-+]?\d+)?"
    )
    for mark, other in ((POINT, COMMA), (COMMA, POINT))
}
_UNCLEAR = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
_FORTRAN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[dD][-+]?\d+")


def number(cell: str, mark: str) -> float | None:
    """Number in a cell, written with the decimal mark `mark`; NaN for an empty cell, None for other text.

    >>> number("1,234.5", "."), number("1.234,5", ","), number("1 234", "."), number("1.2.3", "."), number("1d3", ".")
    (1234.5, 1234.5, 1234.0, None, 1000.0)
    """
    plain = cell.strip().strip('"').strip()
    if plain.lower() in MISSING:
        return float("nan")
    other = COMMA if mark == POINT else POINT
    if other in plain or (found := _float(plain.replace(mark, POINT))) is None:
        if not (grouped := _GROUPED[mark].fullmatch(plain)):
            return None
        found = _float(plain.replace(grouped[1], "").replace(mark, POINT))
    return found


def _float(text: str) -> float | None:
    if "_" in text:  # float() would accept Python's own thousands separator
        return None
    try:
        return float(text)
    except ValueError:
        return float(re.sub("[dD]", "e", text)) if _FORTRAN.fullmatch(text) else None


def number_with_any_mark(cell: str) -> float | None:
    """Number in a cell, written with a decimal point or comma; NaN for an empty cell, None for other text."""
    found = number(cell, POINT)
    return number(cell, COMMA) if found is None else found


def decimal_mark(cell: str) -> str | None:
    """Decimal mark of the number in a cell; None if the number does not determine it, such as 12 or 1,234.

    >>> [decimal_mark(text) for text in ("0.61", "12,5", "1.234,5", "1,234,567", "1,234", "12")]
    ['.', ',', ',', '.', None, None]
    """
    points, commas = cell.count(POINT), cell.count(COMMA)
    if not points + commas or number_with_any_mark(cell) is None:
        return None
    if points and commas:
        return POINT if cell.rfind(POINT) > cell.rfind(COMMA) else COMMA
    if points + commas > 1:
        return COMMA if points else POINT
    if _UNCLEAR.fullmatch(cell.strip().strip('"')):
        return None
    return POINT if points else COMMA


def decimal_marks(names: Sequence[str], columns: Iterable[Iterable[str]]) -> tuple[list[str], list[str], str | None]:
    """Decimal mark of each column, from the numbers in the column or else from those in other columns.

    Returns
    -------
    marks : list of str
    notes : list of str
    fault : str or None
        Description of an ambiguity; None if there is none.
    """
    found: list[dict[str, str]] = []  # for each column, an example of a number with each mark
    unclear: list[tuple[int, str]] = []
    grouped: list[tuple[int, str]] = []
    for k, cells in enumerate(columns):
        marked = [cell for cell in cells if POINT in cell or COMMA in cell]
        found.append({mark: cell for cell in marked if (mark := decimal_mark(cell)) is not None})
        vague = next((cell for cell in marked if _UNCLEAR.fullmatch(cell.strip().strip('"'))), None)
        if vague is not None and not found[-1]:
            unclear.append((k, vague))
        split = next((c for c in marked if _GROUPED[POINT].fullmatch(c) or _GROUPED[COMMA].fullmatch(c)), None)
        if split is not None:
            grouped.append((k, split))
    everywhere = set().union(*found)
    usual = COMMA if COMMA in everywhere else POINT
    if not everywhere and unclear:  # all numbers are like 1,234: the mark is taken as decimal
        everywhere = {POINT if POINT in cell else COMMA for _, cell in unclear}
        usual = next(iter(everywhere))
    if unclear and len(everywhere) > 1:
        k, cell = unclear[0]
        return [], [], (
            f"{cell!r} in column {names[k]!r}: does the mark divide thousands, or is it decimal? Other numbers of the "
            "file have a decimal point, others a decimal comma; write all numbers alike"
        )  # fmt: skip
    for k, both in enumerate(found):
        if len(both) > 1:
            pair = f"{both[POINT]!r} has a decimal point and {both[COMMA]!r} a decimal comma"
            return [], [], f"column {names[k]!r}: {pair}; write all numbers alike"
    marks = [next(iter(both), usual) for both in found]
    notes = ["numbers are written with a decimal comma"] if COMMA in marks and COMMA in everywhere else []
    wide = [(k, cell) for k, cell in grouped if number(cell, marks[k]) != _float(cell.replace(marks[k], POINT))]
    if wide:
        k, cell = wide[0]
        notes.append(f"thousands are set off in column {names[k]!r}: {cell!r} is read as {number(cell, marks[k]):.15g}")
    return marks, notes, None


DAY = 86_400.0  # length of a day, s
_CLOCK = re.compile(r"^(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)(?: ?([AaPp])\.?[Mm]\.?)?$")
_STOPWATCH = re.compile(r"^(\d{1,3}):([0-5]\d[.,]\d+)$")  # minutes and seconds, 1:30.5; hours have no fraction
_DAYS = (
    (re.compile(r"^(\d{1,2})\.(\d{1,2})\.(\d{4})$"), (3, 2, 1)),  # 31.12.2024
    (re.compile(r"^(\d{1,2})/(\d{1,2})/(\d{4})$"), (3, 1, 2)),  # 12/31/2024, or 31/12/2024 where no month is 31
    (re.compile(r"^(\d{4})[-/](\d{1,2})[-/](\d{1,2})$"), (1, 2, 3)),
)
_DATE = re.compile(r"^(\d{4})-(\d\d)-(\d\d)[T ](\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(Z|[+-]\d\d:?\d\d)?$")


def moment(text: str) -> float | None:
    """Seconds from midnight to a time of day, or from 1970 to a date with time of day; None for other text.

    >>> moment("12:30:01.5"), moment("1970-01-02T00:00:00Z"), moment("02.01.1970 1:00:00"), moment("12.5")
    (45001.5, 86400.0, 90000.0, None)
    """
    if match := _CLOCK.match(text):
        hours, minutes, seconds, half = match.groups()
        hour = int(hours) if half is None else int(hours) % 12 + 12 * (half in "Pp")
        return 3600.0 * hour + 60.0 * int(minutes) + float(seconds.replace(",", "."))
    if match := _STOPWATCH.match(text):
        return 60.0 * int(match[1]) + float(match[2].replace(",", "."))
    first, _, rest = text.partition(" ")
    if (begin := day(first)) is not None and rest and (clock := moment(rest.strip())) is not None and clock < 2 * DAY:
        return begin + clock
    if match := _DATE.match(text):
        year, month, number, hours, minutes = (int(part) for part in match.groups()[:5])
        try:
            start = datetime(year, month, number, hours, minutes, tzinfo=UTC)
        except ValueError:
            return None
        return start.timestamp() + float(match[6].replace(",", ".")) - _offset(match[7])
    return None


def day(text: str) -> float | None:
    """Seconds from 1970 to the beginning of a date; None if the text is no date."""
    for pattern, order in _DAYS:
        if match := pattern.match(text):
            year, month, number = (int(match[k]) for k in order)
            if month > 12 and order == (3, 1, 2):
                month, number = number, month
            try:
                return datetime(year, month, number, tzinfo=UTC).timestamp()
            except ValueError:
                return None
    return None


def time_of(cell: str) -> float | None:
    """Seconds to the time of day or date in a cell, counted as by `moment` and `day`; None for other text."""
    plain = cell.strip().strip('"')
    return moment(plain) if (date := day(plain)) is None else date


def value_of(cell: str) -> float | None:
    """Time (s) or number in a cell, with decimal point or comma; NaN for an empty cell, None for other text."""
    return number_with_any_mark(cell) if (found := time_of(cell)) is None else found


def _offset(zone: str | None) -> float:
    if zone is None or zone == "Z":
        return 0.0
    digits = zone[1:].replace(":", "")
    size = 3600.0 * int(digits[:2]) + 60.0 * int(digits[2:])
    return size if zone[0] == "+" else -size


def seconds_since_first(times: Array) -> Array:
    """Seconds since the first time; a day is added whenever a clock passes midnight."""
    later = np.concatenate([[0.0], np.cumsum(np.diff(times) < -0.5 * DAY)])
    found = times + DAY * later
    return np.asarray(found - found[0])
