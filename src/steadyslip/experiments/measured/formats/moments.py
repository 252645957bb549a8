"""Conversion of times of day and dates to seconds."""

from __future__ import annotations

import re
from datetime import UTC, datetime

import numpy as np

from steadyslip.core.arrays import Array

DAY = 86_400.0
_CLOCK = re.compile(r"^(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)(?: ?([AaPp])\.?[Mm]\.?)?$")
_STOPWATCH = re.compile(r"^(\d{1,3}):([0-5]\d[.,]\d+)$")  # 1:30.5, with a fraction: not hours and minutes
_DAYS = (
    (re.compile(r"^(\d{1,2})\.(\d{1,2})\.(\d{4})$"), (3, 2, 1)),  # 31.12.2024
    (re.compile(r"^(\d{1,2})/(\d{1,2})/(\d{4})$"), (3, 1, 2)),  # 12/31/2024, or 31/12/2024 where no month is 31
    (re.compile(r"^(\d{4})[-/](\d{1,2})[-/](\d{1,2})$"), (1, 2, 3)),
)
_DATE = re.compile(r"^(\d{4})-(\d\d)-(\d\d)[T ](\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(Z|[+-]\d\d:?\d\d)?$")


def moment(text: str) -> float | None:
    """Seconds since midnight, or since 1970 if there is a date; None if the text is neither.

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
    """Seconds since 1970 at the beginning of a date; None if the text is no date."""
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
