"""Line numbers of the keys of a TOML text, for error messages."""

from __future__ import annotations

import re

_KEY = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")


def key_lines(text: str) -> dict[str, int]:
    """Line (from 1) of every table header and key, by dotted name; members of lists are numbered from 1."""
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
    """Line of a key, or of the nearest table around it; None if there is none."""
    while name:
        if name in lines:
            return lines[name]
        name = name.rpartition(".")[0]
    return None


def _header(line: str) -> tuple[str, bool] | None:
    """Dotted name of a table's header, and True if it begins a member of a list; None for other lines."""
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
