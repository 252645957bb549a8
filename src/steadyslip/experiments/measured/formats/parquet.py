"""Parquet: one table of named columns."""

from __future__ import annotations

from pathlib import Path

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
    return from_vectors(path, {name: (column, None) for name, column in columns.items() if column.dtype.kind in "iuf"})
