"""Export of a map to one netCDF or Parquet file, chunk by chunk to save memory; xarray variables read on demand."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from os import PathLike
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

from steadyslip.core.errors import NotAvailable
from steadyslip.files.output import whole_file
from steadyslip.maps.store.map_store import Store

Read = Callable[..., np.ndarray]
"""Function that reads an array of a store, or a region of it, by name."""

FROM_STORE = ("title", "rig", "definition", "steadyslip", "versions")


def to_netcdf(store: Store, read: Read, path: str | PathLike[str]) -> None:
    """Write a netCDF-4 file with the map's results, dimensions, coordinates, units, rig and versions."""
    import netCDF4

    with whole_file(path) as temporary, netCDF4.Dataset(temporary, "w") as file:
        for name in FROM_STORE:
            file.setncattr(name, str(store.group.attrs[name]))
        file.setncattr("finished_chunks", f"{store.marked()} of {store.count}")
        for dim, size in zip(store.dims, store.shape, strict=True):
            file.createDimension(dim, size)
        for name in store.coordinates:
            variable = _variable(file, store, name)
            variable[:] = read(name)
        for name in store.results:
            _variable(file, store, name)
        for number in range(store.count):
            region = store.region(number)
            for name in store.results:
                file[name][region] = read(name, region)


def _variable(file: Any, store: Store, name: str) -> Any:
    array = store.array(name)
    dims = tuple(array.metadata.dimension_names)
    for dim, size in zip(dims, array.shape, strict=True):
        if dim not in file.dimensions:
            file.createDimension(dim, size)
    options = {"zlib": True, "complevel": 1} if array.ndim == len(array.chunks) and array.size > 1 else {}
    variable = file.createVariable(
        name,
        np.dtype(array.dtype).newbyteorder("="),
        dims,
        fill_value=array.fill_value,
        chunksizes=_within(array.chunks),
        **options,
    )
    for key, value in array.attrs.items():
        variable.setncattr(key, np.array(value, dtype=np.int8) if key == "flag_values" else value)
    return variable


def _within(chunks: tuple[int, ...], most: int = 2**17) -> tuple[int, ...]:
    """Chunk sizes whose product is at most `most` values, which netCDF readers handle well."""
    found: list[int] = []
    for size in reversed(chunks):
        found.append(max(1, min(size, most)))
        most //= found[-1]
    return tuple(reversed(found))


def to_parquet(store: Store, read: Read, path: str | PathLike[str]) -> None:
    """Write a Parquet file with one row per point, parameters first; results with kinds are written as words.

    Raises
    ------
    NotAvailable
        If pyarrow is not installed, or the file cannot be written.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise NotAvailable("Parquet files need pyarrow; install it with pip install 'steadyslip[lab]'") from error
    notes = {name: str(store.group.attrs[name]) for name in FROM_STORE}
    writer = None
    with whole_file(path) as temporary:
        try:
            for number in range(store.count):
                table = _rows(store, read, number, pa, notes)
                writer = writer or pq.ParquetWriter(temporary, table.schema, compression="zstd")
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()


def _rows(store: Store, read: Read, number: int, pa: Any, notes: dict[str, str]) -> Any:
    region = store.region(number)
    shape = tuple(part.stop - part.start for part in region)
    names, columns, units = [], [], []

    def add(name: str, column: Any, unit: str) -> None:
        names.append(name)
        columns.append(column)
        units.append(unit)

    for name, column in store.parameters(region, generated=True).items():
        add(name, pa.array(np.broadcast_to(column, shape).reshape(-1)), str(store.array(name).attrs["units"]))
    for name in store.results:
        array: Any = store.array(name)
        values: Any = read(name, region).reshape(*[int(np.prod(shape))], *array.shape[len(shape) :])
        unit = str(array.attrs["units"])
        if "flag_meanings" in array.attrs:
            words = [word.replace("_", " ") for word in str(array.attrs["flag_meanings"]).split()]
            indices = pa.array(values.astype(np.int8) + 1)
            add(name, pa.DictionaryArray.from_arrays(indices, pa.array(words)), unit)
            continue
        for place in itertools.product(*(range(n) for n in array.shape[len(shape) :])):
            add("_".join([name, *(str(i + 1) for i in place)]), pa.array(values[(slice(None), *place)]), unit)
    fields = [
        pa.field(name, column.type, metadata={"units": unit})
        for name, column, unit in zip(names, columns, units, strict=True)
    ]
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=notes))


class StoredValues(BackendArray):
    """Array of a store for xarray, which reads it on demand by `Store.read`."""

    def __init__(self, store: Store, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self.store, self.name, self.shape, self.dtype = store, name, shape, dtype

    def __getitem__(self, key: Any) -> np.ndarray:
        return np.asarray(
            indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._part)
        )

    def _part(self, region: tuple[Any, ...]) -> np.ndarray:
        return self.store.read(self.name, region)


def lazily(data: Any, store: Store) -> Any:
    """Copy of an xarray Dataset whose variables are read on demand through the store, which verifies checksums."""
    import xarray as xr

    found = {}
    for name, one in data.data_vars.items():
        values = indexing.LazilyIndexedArray(StoredValues(store, str(name), one.shape, one.dtype))
        found[name] = xr.Variable(one.dims, values, one.attrs)
    return data.assign(found)
