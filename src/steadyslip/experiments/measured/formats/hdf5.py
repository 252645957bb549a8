"""HDF5: datasets below a group, also columns of compound tables; nothing outside the file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.table import Table, check_size, chosen_part, from_vectors

MOST_DATASETS = 10_000


def read(path: Path, table: str | None) -> Table:
    """Numeric datasets of a file, or below one of its groups."""
    with h5py.File(path, "r") as file:
        if table is None:
            return from_vectors(path, dict(_datasets(path, file)))
        if table not in file:
            chosen_part(path, "group", table, _groups(file))
        return from_vectors(path, dict(_datasets(path, file[table])))


def _groups(file: Any) -> list[str]:
    found: list[str] = []
    file.visit(found.append)
    return found


def _datasets(path: Path, group: Any) -> Iterator[tuple[str, tuple[Any, str | None]]]:
    items: dict[str, Any] = {}
    if isinstance(group, h5py.Dataset):
        items[group.name.rpartition("/")[2]] = group
    else:  # each object once, however links go round; none behind a link to another file
        group.visititems(items.__setitem__)
    chosen = {name: item for name, item in items.items() if isinstance(item, h5py.Dataset)}
    if len(chosen) > MOST_DATASETS:
        raise NotAvailable(f"the file has {len(chosen)} datasets; allowed: up to {MOST_DATASETS}")
    check_size(path, sum(item.size or 0 for item in chosen.values()), "; name a group with table=")
    for name, item in chosen.items():
        if item.is_virtual or item.external:
            raise NotAvailable(f"dataset {name!r} takes its numbers from another file; copy them into this one")
        raw = item.attrs.get("units", item.attrs.get("unit"))
        unit = raw.decode() if isinstance(raw, bytes) else None if raw is None else str(raw)
        if item.dtype.names:
            for column in item.dtype.names:
                yield column, (np.asarray(item[column]), None)
        elif item.dtype.kind in "iuf":
            yield name.rpartition("/")[2], (np.asarray(item[()]), unit)
