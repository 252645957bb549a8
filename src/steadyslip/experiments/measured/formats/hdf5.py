"""Reader of HDF5 files: datasets in a group, and fields of compound datasets; links to other files are not followed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.table import (
    Table,
    check_ambiguous_names,
    check_size,
    chosen_part,
    from_vectors,
)

MOST_DATASETS = 10_000  # largest number of datasets that are read, far above that of any record; chosen by trial
MOST_LINKS = 16  # largest number of soft links followed one after another, as links may form a cycle
COLUMN_NAMES = ("columns", "column_names", "names", "header", "channels")


def read(path: Path, table: str | None) -> Table:
    """Numeric datasets of a file or, if `table` is given, of that group or dataset."""
    with h5py.File(path, "r") as file:
        group = file if table is None else member(file, table)
        if group is None:
            chosen_part(path, "group", table, _groups(file))
        return from_vectors(path, _named(path, _datasets(path, group)))


def member(group: Any, name: str, links: int = MOST_LINKS) -> Any:
    """Object in a group, at a path of names joined with ``/``; None if there is none or it is in another file."""
    for part in name.strip("/").split("/"):
        link = group.get(part, getlink=True) if isinstance(group, h5py.Group) else None
        if isinstance(link, h5py.SoftLink) and links:
            group = member(group.file if link.path.startswith("/") else group, link.path, links - 1)
        elif isinstance(link, h5py.HardLink):
            group = group[part]
        else:
            return None
    return group


def numbers_in(path: Path, items: Iterable[Any]) -> None:
    """Raise an error for datasets with more numbers than a record may have, or with numbers in another file."""
    size = 0
    for item in items:
        if item.is_virtual or item.external:
            raise NotAvailable(f"dataset {item.name!r} takes its numbers from another file; copy them into this one")
        size += (item.size or 0) * -(-item.dtype.itemsize // 8)  # counted in units of 8 bytes, for rows of any type
        check_size(path, size, "; name a group with table=")


def _named(path: Path, found: Iterable[tuple[str, tuple[Any, str | None]]]) -> dict[str, tuple[Any, str | None]]:
    """Columns by the last part of their names, or by the full name if several columns have the same last part."""
    pairs = list(found)
    check_ambiguous_names(path, [name for name, _ in pairs], "group")
    short = [name.rpartition("/")[2] for name, _ in pairs]
    return {(last if short.count(last) == 1 else name): one for last, (name, one) in zip(short, pairs, strict=True)}


def _groups(file: Any) -> list[str]:
    found: list[str] = []
    file.visit(found.append)
    return found


def _datasets(path: Path, group: Any) -> Iterator[tuple[str, tuple[Any, str | None]]]:
    items: dict[str, Any] = {}
    if isinstance(group, h5py.Dataset):
        items[group.name.rpartition("/")[2]] = group
    else:  # visititems visits each object once, so that cycles of links end, and follows no external links
        group.visititems(items.__setitem__)
    chosen = {name: item for name, item in items.items() if isinstance(item, h5py.Dataset)}
    if len(chosen) > MOST_DATASETS:
        raise NotAvailable(f"the file has {len(chosen)} datasets; allowed: up to {MOST_DATASETS}")
    chosen = {name: item for name, item in chosen.items() if item.dtype.kind in "iufV"}
    numbers_in(path, chosen.values())
    for name, item in chosen.items():
        raw = item.attrs.get("units", item.attrs.get("unit"))
        unit = raw.decode() if isinstance(raw, bytes) else None if raw is None else str(raw)
        if item.dtype.names:
            rows = item[()]
            for column in item.dtype.names:
                if rows.dtype[column].base.kind in "iuf":
                    yield f"{name}/{column}", (rows[column], None)
        else:
            numbers = np.asarray(item[()])
            if names := _names_of_columns(item):
                columns = numbers.T if numbers.shape[1] == len(names) else numbers
                yield from ((f"{name}/{own}", (one, None)) for own, one in zip(names, columns, strict=True))
            else:
                yield name, (numbers, unit)


def _names_of_columns(item: h5py.Dataset) -> list[str]:
    """Names of a matrix's columns from one of its attributes; empty if no attribute holds them."""
    for attribute in COLUMN_NAMES:
        raw = np.atleast_1d(item.attrs.get(attribute, ()))
        names = [one.decode() if isinstance(one, bytes) else str(one) for one in raw]
        if item.ndim == 2 and len(names) > 1 and len(names) in item.shape:
            return names
    return []
