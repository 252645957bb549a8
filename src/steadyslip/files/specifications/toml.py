"""Parsing of TOML text within bounds, since crafted input could take the parser hours or cause overflow later.

Also finds the line numbers of keys, for messages.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

Table = dict[str, Any]
MOST_PARTS = 32
"""Most parts of a dotted key; the time of tomllib grows with their cube."""
MOST_INTEGER = 2**63
"""Largest allowed size of integers, which have 64 bits in TOML."""

_PART = r"(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')"
_LONG_KEY = re.compile(rf"(?<![\w\"'-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MOST_PARTS}}}")

_COMMA = re.compile(r"^[^#\"'\n=]+=[ \t]*+([-+]?\d++),(\d++)[ \t]*+(?:#.*)?$", re.MULTILINE)
"""A line with one number with a decimal comma; groups are the digits before and after it."""

_SLIPS = (
    (re.compile(r"\s*(?://|;|--|%)"), "a comment begins with #"),
    (re.compile(r"\s*[\w.-]+\s*:"), "write KEY = VALUE"),
    (re.compile(r"[^\"'#]*=\s*[-+]?\.\d"), "a number begins with a digit, as in 0.8"),
    (
        re.compile(r"[^\"'#]*=\s*[-+]?[.\d]+\s*[^\W\d_°%]"),
        "a number with a unit stands in quotes, as in velocity = '20 um/s'",
    ),
    (re.compile(r"[^\"'#]*=\s*[^\W\d_]"), "a word stands in quotes, as in law = 'lugre'"),
    (re.compile(r"[^\"#]*\"[^\"]*$|[^'#]*'[^']*$"), "a text ends on its line with the quote with which it begins"),
)
"""Patterns of common mistakes in TOML lines, with advice; the advice of the first pattern that matches is given."""
_PLACE = re.compile(r" \(at line (\d+), column \d+\)$")
_TWICE = re.compile(r"Cannot declare \((.*?),?\) twice")

_TOO_LARGE = "it has an integer that does not fit into 64 bits; write such a number with a decimal point or exponent"


class NotToml(ValueError):
    """Error: a text is not TOML, or exceeds the bounds."""


def tables_of(text: str) -> Table:
    """Tables of a TOML text.

    Raises
    ------
    NotToml
        If it is not TOML, or has keys of too many parts or integers of more than 64 bits.
    """
    if long := _LONG_KEY.search(text):
        raise NotToml(f"a key has more than {MOST_PARTS} parts: {long[0][:40]}...")
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise NotToml("lists or tables lie too deep in each other") from None
    except ValueError as error:  # integers of thousands of digits raise no TOMLDecodeError
        why = str(error) if isinstance(error, tomllib.TOMLDecodeError) else _TOO_LARGE
        comma = _COMMA.search(text)
        hint = f"; {comma[1]},{comma[2]} has a decimal comma: write {comma[1]}.{comma[2]}" if comma else ""
        raise NotToml(_explained(why, text) + hint) from error
    _check(tables)
    return tables


def _explained(why: str, text: str) -> str:
    """Message of the parser with the line at which it stopped, and advice if the mistake is a common one."""
    place, lines = _PLACE.search(why), text.splitlines()
    if place is None or not 0 < int(place[1]) <= len(lines):
        return why
    line = lines[int(place[1]) - 1]
    advice = next((advice for slip, advice in _SLIPS if slip.match(line)), "")
    if twice := _TWICE.match(why):
        name = ".".join(part.strip(" '\"") for part in twice[1].split(","))
        advice = f"the table [{name}] is there before; write its keys in one place"
    return f"{why}: {line.strip()[:60]!r}" + (f"; {advice}" if advice else "")


def _check(tables: Any) -> None:
    """Raise NotToml for integers beyond 64 bits; without recursion, since the file determines the depth."""
    left = [tables]
    while left:
        value = left.pop()
        if isinstance(value, dict):
            left += value.values()
        elif isinstance(value, list):
            left += value
        elif isinstance(value, int) and not -MOST_INTEGER <= value < MOST_INTEGER:
            raise NotToml(_TOO_LARGE)


_KEY = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")


def key_lines(text: str) -> dict[str, int]:
    """Line number (from 1) of every table header and key by dotted name; members of lists are numbered from 1."""
    lines: dict[str, int] = {}
    counts: dict[str, int] = {}
    prefix = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _header(line):
            prefix, listed = header
            if listed:
                counts[prefix] = counts.get(prefix, 0) + 1
                lines.setdefault(prefix, number)
                prefix = f"{prefix}.{counts[prefix]}"
            lines.setdefault(prefix, number)
        elif key := _KEY.match(line):
            name = _plain(key[1])
            lines.setdefault(f"{prefix}.{name}" if prefix else name, number)
    return lines


def line_of(name: str, lines: dict[str, int]) -> int | None:
    """Line number of a key or table.

    For a table without a line of its own, the line of its first key, or of the table around it; None if there is none.
    """
    inside = [line for key, line in lines.items() if key.startswith(f"{name}.")]
    if name not in lines and inside:
        return min(inside)
    while name:
        if name in lines:
            return lines[name]
        name = name.rpartition(".")[0]
    return None


def _header(line: str) -> tuple[str, bool] | None:
    """Dotted name in a table header, and True if the header begins a member of a list; None for other lines."""
    text = line.strip()
    listed = text.startswith("[[")
    opened, closed = ("[[", "]]") if listed else ("[", "]")
    name, end, rest = text.removeprefix(opened).partition(closed)
    rest = rest.lstrip()
    if not text.startswith("[") or not end or not name.strip() or (rest and not rest.startswith("#")):
        return None
    return _plain(name), listed


def _plain(dotted: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in dotted.split("."))
