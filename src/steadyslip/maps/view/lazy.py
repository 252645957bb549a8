"""xarray variables that are read from a store on use, with its checks for damage."""

from __future__ import annotations

from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

from steadyslip.maps.store.arrays import Store


class StoredValues(BackendArray):
    """Array of a store, read by `Store.read`."""

    def __init__(self, store: Store, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self.store, self.name, self.shape, self.dtype = store, name, shape, dtype

    def __getitem__(self, key: Any) -> np.ndarray:
        return np.asarray(
            indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._part)
        )

    def _part(self, region: tuple[Any, ...]) -> np.ndarray:
        return self.store.read(self.name, region)


def lazily(data: Any, store: Store) -> Any:
    """Dataset with its variables read through the store."""
    import xarray as xr

    found = {}
    for name, one in data.data_vars.items():
        values = indexing.LazilyIndexedArray(StoredValues(store, str(name), one.shape, one.dtype))
        found[name] = xr.Variable(one.dims, values, one.attrs)
    return data.assign(found)
