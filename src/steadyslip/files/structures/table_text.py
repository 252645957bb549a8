"""Text of tables of modes and responses, whichever separator stands between their columns."""

from __future__ import annotations

import math
import re
from pathlib import Path

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import QuantityError
from steadyslip.files.inputs import UnreadableFile, read_bytes

_FREQUENCY = re.compile(r"frequency(?: *[\[(](?P<unit>[^\])]+)[\])])?")


def table_text(path: str, folder: Path, most: int) -> str:
    """Text of a table, converted to commas between columns and decimal points.

    Some spreadsheets write semicolons and decimal commas, others tabs; the first line shows which.

    Parameters
    ----------
    path : str
        File relative to `folder`.
    folder : Path
    most : int
        Largest size, bytes.

    Raises
    ------
    UnreadableFile
        If the file cannot be read, or is not UTF-8 text.
    """
    try:
        text = read_bytes(folder / path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableFile(path, "it is not UTF-8 text") from error
    head = text.partition("\n")[0]
    between = next((one for one in ";\t" if one in head and "," not in head), None)
    return text if between is None else text.replace(",", ".").replace(between, ",")


def hertz_of(path: str, name: str) -> float | None:
    """Factor to Hz of a column of frequencies, such as ``frequency`` or ``frequency [rad/s]``; None for others.

    Raises
    ------
    UnreadableFile
        If its unit is not a unit of frequency.
    """
    if (match := _FREQUENCY.fullmatch(name)) is None:
        return None
    try:
        factor, dimension = unit(match["unit"] or "Hz")
    except QuantityError as error:
        raise UnreadableFile(path, f"its column {name!r} has no unit of a frequency ({error})") from error
    if dimension == unit("Hz")[1]:
        return factor
    if dimension == unit("rad/s")[1]:
        return factor / (2 * math.pi)
    raise UnreadableFile(path, f"its column {name!r} has no unit of a frequency; allowed: Hz, kHz, rad/s")
