"""Reader of Parquet files: one table of named columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow
from pyarrow import parquet, types

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.table import Table, check_size, from_vectors


def read(path: Path, table: str | None) -> Table:
    """Numeric columns of a file."""
    if table is not None:
        raise NotAvailable(f"{str(path)!r}: a Parquet file has one table; leave table= away")
    with parquet.ParquetFile(path, memory_map=False) as file:
        own = [field for field in file.schema_arrow if _is_numeric(field.type)]
        twice = len({field.name for field in file.schema_arrow}) < len(file.schema_arrow)
        if not own or twice:
            raise NotAvailable(f"{str(path)!r} has {'columns of one name' if twice else 'no columns of numbers in it'}")
        check_size(path, file.metadata.num_rows * len(own), rows=file.metadata.num_rows)
        content = file.read([field.name for field in own], use_threads=False)
    return from_vectors(path, {name: _numbers(content.column(name).to_numpy()) for name in content.column_names})


def _is_numeric(kind: pyarrow.DataType) -> bool:
    """True for a type of numbers, dates or durations, or for a dictionary type whose values have such a type."""
    own = kind.value_type if types.is_dictionary(kind) else kind
    is_moment = types.is_timestamp(own) or types.is_date(own) or types.is_duration(own)
    return bool(types.is_integer(own) or types.is_floating(own) or is_moment)


def _numbers(column: np.ndarray) -> tuple[np.ndarray, str | None]:
    """Values and unit of a column: numbers unchanged, times as seconds since the first time, durations in seconds."""
    if column.dtype.kind not in "mM":
        return column, None
    spans = column - column[0] if column.dtype.kind == "M" and len(column) else column
    return np.where(np.isnat(spans), np.nan, spans / np.timedelta64(1, "s")), "s"
