"""Reader of XLOOK files, binary or text; many rock-friction laboratories process their records with XLOOK.

A binary file has a header of 36 bytes (name, numbers of records and columns, two settings), then 32 channel
descriptions of 84 bytes (name, unit, gain, comment, number of elements), or 16 until 2007, then the columns one after
another, as floats of four or eight bytes. Headers are usually big-endian; some versions of XLOOK wrote little-endian
ones. The byte order of the columns is the order that gives plausible numbers.

A text file has lines of column numbers, names, units and numbers of records above the numbers. The first column has no
name and counts rows.
"""

from __future__ import annotations

import re
import struct

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable

MOST_HEAD = 2**14  # bytes in which the lines above the numbers of a text file are searched; 32 columns need a tenth
HEAD, CHANNEL = 36, 84  # bytes of the header and of each channel's description
LAYOUTS = ((32, 4), (32, 8), (16, 4), (16, 8))  # numbers of channels, and bytes per number
UNUSED = "no_val"
TEXT_HEAD = re.compile(
    rb"\s*number of records[^\n]*\n(?:\s*col\b[^\n]*\n)?([^\n]*)\n([^\n]*)\n((?:\s*\d+ recs\b[^\n]*\n)?)", re.IGNORECASE
)
"""Lines above the numbers of a text file: names, units, and numbers of records."""
NUMBER_KINDS = (">f4", ">f8", "<f4", "<f8")


def with_plain_head(raw: bytes) -> bytes:
    """Text of an XLOOK file whose header is replaced by one line of names and one line of units of all columns.

    Blank lines keep the line numbers unchanged. Content of other files is returned unchanged.
    """
    found = TEXT_HEAD.match(raw[:MOST_HEAD])
    if found is None:
        return raw
    names, units = ([cell.strip() for cell in re.split(rb"\s{2,}|\t", own.strip())] for own in found.groups()[:2])
    first = raw[found.end() :].partition(b"\n")[0].split()
    more = len(first) - len(names)
    if more not in (0, 1) or len(units) > len(names):
        return raw
    units = [b"1" if unit in (b".", b"-", b"") else unit for unit in units]
    rows = [[b"record"] * more + names, [b"1"] * more + units + [b"1"] * (len(names) - len(units))]
    above = b"\n" * (found.group().count(b"\n") - 2)
    return above + b"".join(b"\t".join(row) + b"\n" for row in rows) + raw[found.end() :]


def is_xlook(raw: bytes) -> bool:
    """True if the header of a binary XLOOK file matches the size of the file or describes channels as XLOOK does."""
    return _size(raw) is not None or _described(raw) is not None


def _described(raw: bytes) -> tuple[int, int, int] | None:
    """Numbers of channels, rows and columns from an XLOOK header that need not match the file's size; else None."""
    for channels in dict.fromkeys(channels for channels, _ in LAYOUTS):
        heads = [raw[k : k + 26] for k in range(HEAD, HEAD + channels * CHANNEL, CHANNEL)]
        fields = [_text(part) for head in heads for part in (head[:13], head[13:])]
        if len(raw) <= HEAD + channels * CHANNEL or not all(field.isprintable() for field in fields):
            continue
        for order in (">", "<"):
            rows, columns = struct.unpack(f"{order}ii", raw[20:28])
            if 0 < columns <= channels and rows > 0 and all(fields[: 2 * columns : 2]):
                return channels, rows, columns
    return None


def _size(raw: bytes) -> tuple[int, int, int, int] | None:
    """Numbers of channels, rows and columns, and bytes per number; None if they do not match the size of the file."""
    if len(raw) <= HEAD:
        return None
    for order in (">", "<"):
        rows, columns = struct.unpack(f"{order}ii", raw[20:28])
        for channels, width in LAYOUTS:
            fits = len(raw) == HEAD + channels * CHANNEL + rows * columns * width
            if fits and rows > 0 and 0 < columns <= channels:
                return channels, rows, columns, width
    return None


def read_xlook(raw: bytes, source: str) -> tuple[list[str], list[str | None], Array]:
    """Names, units and values (columns, rows) from the bytes of an XLOOK file.

    Raises
    ------
    NotAvailable
        If the size of the file does not match its header, or its columns are not numbers.
    """
    size = _size(raw)
    if size is None:
        channels, rows, columns = _described(raw) or (0, 0, 0)
        here = len(raw) - HEAD - channels * CHANNEL
        raise NotAvailable(
            f"{source!r} is a damaged XLOOK file: its header says {rows} rows of {columns} columns, "
            f"{4 * rows * columns} or {8 * rows * columns} bytes, and it has {here}; copy it again, as a binary file"
        )
    channels, rows, columns, width = size
    body = HEAD + channels * CHANNEL
    names, units = [], []
    for k in range(channels):
        start = HEAD + k * CHANNEL
        name = _text(raw[start : start + 13])
        if name and not name.startswith(UNUSED):
            names.append(name)
            units.append(_text(raw[start + 13 : start + 26]) or None)
    names = [*names, *(f"column {k}" for k in range(len(names) + 1, columns + 1))][:columns]
    units = [*units, *([None] * columns)][:columns]
    for kind in (kind for kind in NUMBER_KINDS if int(kind[-1]) == width):
        values = np.frombuffer(raw, kind, rows * columns, body).reshape(columns, rows)
        with np.errstate(invalid="ignore"):  # bytes read in the wrong order may be no numbers
            found = values.astype(float)
        size_of = np.abs(found[found != 0.0])
        if np.all(np.isfinite(found)) and (not len(size_of) or (size_of.max() < 1e20 and np.median(size_of) > 1e-20)):
            return names, units, found
    raise NotAvailable(f"{source!r} looks like an XLOOK file, but its columns are no numbers in either order of bytes")


def _text(raw: bytes) -> str:
    return raw.partition(b"\0")[0].decode("latin-1").strip()
