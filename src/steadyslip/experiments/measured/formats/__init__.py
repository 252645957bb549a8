"""Readers of files with measured columns, chosen by the ending of the file name; columns are not interpreted.

Each format has a module with a function ``read(path, table)`` that returns a `Table`, and a line in `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, SteadyslipError
from steadyslip.experiments.measured.formats.table import Table
from steadyslip.experiments.measured.formats.text import read_text
from steadyslip.files.apart import Ended, call
from steadyslip.files.inputs import check_file

__all__ = ["FORMATS", "Table", "read_columns"]

MOST_BINARY = 2**31  # largest size of a file, bytes: over six times what `MOST_VALUES` double-precision numbers take
SHORT_TEXT = 2**20  # largest size, bytes, of a text read in this process: it needs little time and memory
SECONDS, BYTES_A_SECOND, MOST_SECONDS = 10.0, 2**20, 85.0
"""CPU time (s) allowed to read a file, bytes of the file for which a further second is allowed, and largest time (s) in
all. Workbooks, the slowest format, take half of this time."""
MOST_SAID = 300  # largest number of characters quoted from another library's message
FORMATS = {
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), ("HDF5", "hdf5")),
    ".nc": ("netCDF", "netcdf"),
    ".mat": ("MATLAB file", "matlab"),
    **dict.fromkeys((".parquet", ".pq"), ("Parquet", "parquet")),
    **dict.fromkeys((".xlsx", ".xlsm"), ("Excel workbook", "workbook")),
    ".tdms": ("TDMS", "tdms"),
}
"""Name and module of each format by ending; other files are text or XLOOK files, which are told apart by content."""


def read_columns(path: Path, table: str | None = None, skip_bad_lines: bool = False) -> Table:
    """Columns of a file, read in the format that its ending stands for; as text if the ending is unknown.

    Formats that need another library, and long texts, are read in a separate process with limits on time and memory.

    Raises
    ------
    NotAvailable
        If the file cannot be read, or its format needs a package that is not installed.
    ParameterError
        If lines are damaged.
    """
    ending = path.suffix.lower()
    size = check_file(path, MOST_BINARY)
    if ending not in FORMATS and size <= SHORT_TEXT:
        return read_text(path, skip_bad_lines)
    seconds = min(SECONDS + size / BYTES_A_SECOND, MOST_SECONDS)
    try:
        about, (values, lines) = call(__name__, "read_here", (str(path), table, skip_bad_lines), seconds)
    except Ended as error:
        raise NotAvailable(f"cannot read {str(path)!r}: {error}") from error
    except MemoryError as error:
        raise NotAvailable(f"cannot read {str(path)!r}: it does not fit into memory") from error
    return Table(about["names"], values, lines, about["units"], about["notes"])


def read_here(name: str, table: str | None, skip_bad_lines: bool) -> tuple[dict[str, Any], list[Array]]:
    """Columns of a file, read in this process: names, units and notes as dict, values and line numbers as arrays."""
    path = Path(name)
    ending = path.suffix.lower()
    found = _by_library(path, table, *FORMATS[ending]) if ending in FORMATS else read_text(path, skip_bad_lines)
    return {"names": found.names, "units": found.units, "notes": found.notes}, [found.values, found.lines]


def _by_library(path: Path, table: str | None, kind: str, module: str) -> Table:
    try:
        reader: Callable[[Path, str | None], Table] = import_module(f"{__name__}.{module}").read
        return reader(path, table)
    except (SteadyslipError, MemoryError):
        raise
    except ImportError as error:
        package = error.name or "another package"
        raise NotAvailable(
            f"{str(path)!r}: this format needs the package {package}; install steadyslip[lab]"
        ) from error
    except Exception as error:  # other libraries raise exceptions of any type for a damaged file
        why = " ".join(str(error).split())[:MOST_SAID]
        raise NotAvailable(f"cannot read {str(path)!r} as {kind}: {type(error).__name__}: {why}") from error
