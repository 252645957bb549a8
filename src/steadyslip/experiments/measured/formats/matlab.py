"""MATLAB files: vectors, matrices and structures of them, however deep; version 7.3 is HDF5."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, whosmat

from steadyslip.experiments.measured.formats.table import Table, check_apart, check_size, chosen_part, from_vectors

DEEPEST = 8
Numbers = dict[str, tuple[Any, None]]


def read(path: Path, table: str | None) -> Table:
    """Numeric vectors of a file, or of one of its variables: ``p1``, or ``p1.data`` within a structure."""
    try:
        check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path)))
        found = loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:  # version 7.3
        from steadyslip.experiments.measured.formats import hdf5

        return hdf5.read(path, table)
    parts: dict[str, Any] = {}
    for name, value in found.items():
        if not name.startswith("__"):
            parts |= dict(_parts(name, value, DEEPEST))
    part = chosen_part(path, "variable", table, list(parts))
    inside = {
        name: np.asarray(value) for name, value in parts.items() if part is None or f"{name}.".startswith(f"{part}.")
    }
    numeric = {name: (value, None) for name, value in inside.items() if value.dtype.kind in "iuf"}
    check_apart(path, list(numeric), "structure")
    named: dict[str, tuple[Any, str | None]] = {**_shortened(_with_header(numeric, inside))}
    return from_vectors(path, named)


def _with_header(numeric: Numbers, inside: dict[str, Any]) -> Numbers:
    """Columns of the only matrix by the names in the only list of as many words, as `importdata` leaves them."""
    matrices = [name for name, (value, _) in numeric.items() if value.ndim == 2]
    if len(matrices) != 1:
        return numeric
    matrix = numeric[matrices[0]][0]
    headers = [
        words for value in inside.values() if value.dtype.kind in "OU" and value.size in matrix.shape
        and len(words := [one.strip() for one in value.ravel().tolist() if isinstance(one, str)]) == value.size > 1
    ]  # fmt: skip
    if not headers or any(words != headers[0] for words in headers):
        return numeric
    columns = matrix.T if matrix.shape[1] == len(headers[0]) else matrix
    return {name: (column, None) for name, column in zip(headers[0], columns, strict=True)}


def _parts(name: str, value: Any, deep: int) -> Iterator[tuple[str, Any]]:
    """A variable and, of a structure, its fields: everything that can be named."""
    array = np.asarray(value)
    yield name, array
    if array.dtype.names and array.size == 1 and deep:
        for field in array.dtype.names:
            yield from _parts(f"{name}.{field}", array[field].item(), deep - 1)


def _shortened(found: Numbers) -> Numbers:
    """Names without the structures around them, where they remain different."""
    short = [name.rpartition(".")[2] for name in found]
    return dict(zip(short, found.values(), strict=True)) if len(set(short)) == len(short) else found
