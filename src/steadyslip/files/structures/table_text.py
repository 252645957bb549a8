"""Text of tables of modes and responses, whatever stands between their columns."""

from __future__ import annotations

from pathlib import Path

from steadyslip.files.inputs import UnreadableFile, read_bytes


def table_text(path: str, folder: Path, most: int) -> str:
    """Text of a table as if commas stood between its columns, with decimal points.

    Spreadsheets of countries with decimal commas write semicolons, others tabs: the first line tells.

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
