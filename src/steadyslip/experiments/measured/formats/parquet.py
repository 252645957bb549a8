"""Parquet: one table of named columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pyarrow import parquet

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.table import Table, check_size, from_vectors


def read(path: Path, table: str | None) -> Table:
    """Numeric columns of a file."""
    if table is not None:
        raise NotAvailable(f"{str(path)!r}: a Parquet file has one table; leave table= away")
    about = parquet.ParquetFile(path).metadata
    check_size(path, about.num_rows * about.num_columns)
    content = parquet.read_table(path)
    columns = {name: content.column(name).to_numpy() for name in content.column_names}
    return from_vectors(
        path, {name: _numbers(column) for name, column in columns.items() if column.dtype.kind in "iufmM"}
    )


def _numbers(column: np.ndarray) -> tuple[np.ndarray, str | None]:
    """Numbers as they are; moments as seconds since the first, durations in seconds."""
    if column.dtype.kind not in "mM":
        return column, None
    spans = column - column[0] if column.dtype.kind == "M" and len(column) else column
    return np.where(np.isnat(spans), np.nan, spans / np.timedelta64(1, "s")), "s"
