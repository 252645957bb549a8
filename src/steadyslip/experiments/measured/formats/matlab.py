"""Reader of MATLAB files: vectors, matrices, structures, structure arrays and cells; version 7.3 is HDF5.

In every version a structure becomes a dict, and a structure array or cell array becomes a list. ``p(2)`` is the second
structure of an array, as in MATLAB. Structures of an array that hold a name and one vector are taken for channels.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, whosmat

from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.formats.table import (
    MOST_VALUES,
    Table,
    check_ambiguous_names,
    check_size,
    chosen_part,
    from_vectors,
)
from steadyslip.files.inputs import read_bytes

DEEPEST = 8  # structures and cells within each other are read down to this level; chosen by trial
MOST_MEMBERS = 100_000  # largest number of members of structures and cells, far above that of any record; by trial
HEAD, TAG, PACKED = 128, 8, 15  # bytes of the file's header and of an element's tag; type of a compressed element
BYTES, ONE_PIECE = 8, 2**20  # bytes of a number; bytes decompressed at a time
CLASS = "MATLAB_class"
NAMES, UNITS = ("name", "label", "channel", "title"), ("unit", "units", "dimension")
Numbers = dict[str, tuple[Any, str | None]]


def read(path: Path, table: str | None) -> Table:
    """Numeric vectors of a file or, if `table` is given, of a variable such as ``p1``, ``p1.data`` or ``p(2)``."""
    try:
        check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path)))
        _check_unpacked(path)
        found = loadmat(path, squeeze_me=True, struct_as_record=True)
        variables = {name: _from_scipy(value, DEEPEST) for name, value in found.items() if not name.startswith("__")}
    except NotImplementedError:  # SciPy does not read version 7.3
        variables = _of_version_73(path)
        if not variables:  # an HDF5 file that another program wrote
            from steadyslip.experiments.measured.formats import hdf5

            return hdf5.read(path, table)
    parts: dict[str, Any] = {}
    for name, value in variables.items():
        parts |= dict(_parts(name, value))
    part = chosen_part(path, "variable", None if table is None else table.replace("/", "."), list(parts))
    inside = {name: value for name, value in parts.items() if part is None or _is_inside(name, part)}
    numeric: Numbers = {name: (one, None) for name, one in inside.items() if _is_numbers(one)}
    if channels := next((own for one in inside.values() if (own := _channels(one))), None):
        return from_vectors(path, channels)
    check_ambiguous_names(path, list(numeric), "structure")
    return from_vectors(path, _shortened(_with_header(numeric, inside)))


def _is_inside(name: str, part: str) -> bool:
    return name == part or name.startswith((f"{part}.", f"{part}("))


# -- content of a file as Python objects


class ReadCount:
    """Count of the members and numbers read from a file of version 7.3, in which links may repeat objects."""

    def __init__(self, path: Path) -> None:
        self.path, self.members, self.numbers = path, 0, 0

    def take(self, members: int, numbers: int = 0) -> None:
        """Add members and numbers to the counts.

        Raises
        ------
        NotAvailable
            If the counts exceed the limits.
        """
        self.members += members
        self.numbers += numbers
        if self.members > MOST_MEMBERS:
            raise NotAvailable(f"{str(self.path)!r} has more members of structures and cells than {MOST_MEMBERS}")
        check_size(self.path, self.numbers)


def _check_unpacked(path: Path) -> None:
    """Raise an error if a file of version 5 to 7 holds more numbers, once decompressed, than a record may have."""
    size, place = 0, HEAD
    content = read_bytes(path, BYTES * MOST_VALUES)
    order = "<" if content[HEAD - 2 : HEAD] == b"IM" else ">"
    while place + TAG <= len(content):
        kind, length = struct.unpack_from(f"{order}II", content, place)
        packed: bytes | memoryview = memoryview(content)[place + TAG : place + TAG + length]
        place += TAG + length
        if kind != PACKED:
            continue
        unpacking = zlib.decompressobj()
        while packed and not unpacking.eof:
            part = unpacking.decompress(packed, ONE_PIECE)
            packed = unpacking.unconsumed_tail
            check_size(path, (size := size + len(part)) // BYTES)


def _from_scipy(value: Any, deep: int) -> Any:
    """Value that SciPy has read, converted to dicts, lists, strings and arrays."""
    array = np.asarray(value)
    if not deep or array.dtype.kind not in "OV":
        return str(value) if array.dtype.kind == "U" and array.size == 1 else array
    if not array.dtype.names:
        own = array.ravel().tolist()
        return _from_scipy(own[0], deep - 1) if array.ndim == 0 else [_from_scipy(one, deep - 1) for one in own]
    members = [{field: _from_scipy(one[field], deep - 1) for field in array.dtype.names} for one in array.ravel()]
    return members[0] if array.size == 1 else members


def _of_version_73(path: Path) -> dict[str, Any]:
    """Variables of a file of version 7.3; empty if another program wrote it."""
    import h5py

    from steadyslip.experiments.measured.formats.hdf5 import member

    with h5py.File(path, "r") as file:
        own = {name: item for name in file if not name.startswith("#") and (item := member(file, name)) is not None}
        if not any(CLASS in item.attrs for item in own.values()):
            return {}
        left = ReadCount(path)
        return {name: _from_hdf5(item, DEEPEST, left) for name, item in own.items()}


def _from_hdf5(item: Any, deep: int, left: ReadCount) -> Any:
    """Value of an HDF5 object as dicts, lists, strings and arrays; HDF5 holds matrices of MATLAB transposed."""
    import h5py

    from steadyslip.experiments.measured.formats.hdf5 import member, numbers_in

    if isinstance(item, h5py.Group):
        left.take(len(item))
        own = {name: one for name in item if deep and (one := member(item, name)) is not None}
        fields = {name: _from_hdf5(one, deep - 1, left) for name, one in own.items()}
        folded = [name for name, one in own.items() if isinstance(one, h5py.Dataset) and CLASS not in one.attrs]
        sizes = {len(fields[name]) for name in folded if isinstance(fields.get(name), list)}
        if not folded or len(sizes) != 1 or len(folded) != len(fields):
            return fields
        members = [dict(zip(fields, values, strict=True)) for values in zip(*fields.values(), strict=True)]
        return members[0] if len(members) == 1 else members
    numbers_in(left.path, [item])
    if h5py.check_ref_dtype(item.dtype) is not None:
        left.take(item.size)
        return [_from_hdf5(item.file[one], deep - 1, left) for one in item[()].ravel()] if deep else []
    left.take(1, item.size * -(-item.dtype.itemsize // BYTES))
    numbers = np.squeeze(np.asarray(item[()]).T)
    kind = item.attrs.get(CLASS, b"")
    if "MATLAB_empty" in item.attrs:
        return "" if kind == b"char" else np.empty(0)
    return "".join(map(chr, numbers.T.ravel())) if kind == b"char" else numbers


# -- columns


def _parts(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Pairs (name, value) for a variable and for every member of it that a name such as ``p1.data`` selects."""
    yield name, value
    if isinstance(value, Mapping):
        for field, one in value.items():
            yield from _parts(f"{name}.{field}", one)
    if not isinstance(value, list) or not value:
        return
    if all(isinstance(one, Mapping) for one in value):
        for field in value[0]:
            cells = [one.get(field) for one in value]
            if all(_is_numbers(one) and one.size == 1 for one in cells):  # each structure is a row of a table
                yield f"{name}.{field}", np.array([one.item() for one in cells])
        if any(isinstance(one, dict | list) or one.size > 1 for member in value for one in member.values()
               if not isinstance(one, str)):  # fmt: skip
            for k, one in enumerate(value, start=1):
                yield from _parts(f"{name}({k})", one)
    elif all(_is_numbers(one) and one.ndim == 1 for one in value) and len({len(one) for one in value}) == 1:
        yield f"{name}.columns", np.column_stack(value)


def _is_numbers(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "iuf"


def _channels(value: Any) -> Numbers | None:
    """Channels from a structure array whose structures hold a name, one vector and perhaps a unit; None otherwise."""
    if not isinstance(value, list) or len(value) < 2 or not all(isinstance(one, Mapping) for one in value):
        return None
    found: Numbers = {}
    for one in value:
        words = {field.lower(): text.strip() for field, text in one.items() if isinstance(text, str)}
        name = next((words[key] for key in NAMES if words.get(key)), None)
        vectors = [values for values in one.values() if _is_numbers(values) and values.size > 1]
        if name is None or name in found or len(vectors) != 1:
            return None
        found[name] = (vectors[0], next((words[key] for key in UNITS if words.get(key)), None))
    return found


def _with_header(numeric: Numbers, inside: dict[str, Any]) -> Numbers:
    """Columns of the only matrix, with names from the only list of as many words (written by MATLAB's `importdata`)."""
    matrices = [name for name, (value, _) in numeric.items() if value.ndim == 2]
    if len(matrices) != 1:
        return numeric
    matrix = numeric[matrices[0]][0]
    headers = [words for one in inside.values() if len(words := _words(one)) > 1 and len(words) in matrix.shape]
    if not headers or any(words != headers[0] for words in headers):
        return numeric
    columns = matrix.T if matrix.shape[1] == len(headers[0]) else matrix
    return {name: (column, None) for name, column in zip(headers[0], columns, strict=True)}


def _words(value: Any) -> list[str]:
    own = value.ravel().tolist() if isinstance(value, np.ndarray) and value.dtype.kind == "U" else value
    is_list = isinstance(own, list) and all(isinstance(one, str) for one in own)
    return [one.strip() for one in own] if is_list else []


def _shortened(found: Numbers) -> Numbers:
    """Columns by the last part of their names, without the structures, if these parts differ; else unchanged."""
    short = [name.rpartition(".")[2] for name in found]
    return dict(zip(short, found.values(), strict=True)) if len(set(short)) == len(short) else found
