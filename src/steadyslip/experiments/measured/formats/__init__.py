"""Files of measured columns, by the ending of their names. Columns come back as they are; nothing is interpreted.

Each format is one module with one function from a path to a `Table`; a further format is one more line below.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from steadyslip.core.errors import NotAvailable, SteadyslipError
from steadyslip.experiments.measured.formats.table import Table
from steadyslip.experiments.measured.formats.text import read_text
from steadyslip.files.inputs import check_file

__all__ = ["FORMATS", "Table", "read_columns"]

MOST_BINARY = 2**31  # bytes of a file
FORMATS = {
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), ("HDF5", "hdf5")),
    ".nc": ("netCDF", "netcdf"),
    ".mat": ("MATLAB file", "matlab"),
    **dict.fromkeys((".parquet", ".pq"), ("Parquet", "parquet")),
    **dict.fromkeys((".xlsx", ".xlsm"), ("Excel workbook", "excel")),
    ".tdms": ("TDMS", "tdms"),
}
"""Name and module of each format; everything else is text, or XLOOK's, which is known by its content."""


def read_columns(path: Path, table: str | None = None, skip_bad_lines: bool = False) -> Table:
    """Read a file by its ending; text unless that is known.

    Raises
    ------
    NotAvailable
        If the file cannot be read, or its format needs a package that is not installed.
    ParameterError
        If lines are damaged.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        return read_text(path, skip_bad_lines)
    kind, module = FORMATS[ending]
    reader: Callable[[Path, str | None], Table] = import_module(f"{__name__}.{module}").read
    check_file(path, MOST_BINARY)
    try:
        return reader(path, table)
    except SteadyslipError:
        raise
    except ImportError as error:
        package = error.name or "another package"
        raise NotAvailable(
            f"{str(path)!r}: this format needs the package {package}; install steadyslip[lab]"
        ) from error
    except MemoryError as error:
        raise NotAvailable(f"cannot read {str(path)!r}: it does not fit into memory") from error
    except Exception as error:  # the readers of foreign formats raise whatever a damaged file brings about
        raise NotAvailable(f"cannot read {str(path)!r} as {kind}: {type(error).__name__}: {error}") from error
