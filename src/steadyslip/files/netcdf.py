"""Reader of the classic netCDF format (CDF-1 and CDF-2), which checks every size before it allocates.

A file is a list of dimensions, attributes and variables, then the numbers of each variable in one piece, all
big-endian (NetCDF Users Guide, appendix B). Record dimensions, which this program does not write, raise FormatError.
Arrays never take more memory than the file has bytes.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from steadyslip.core.arrays import Array

T = TypeVar("T")
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12  # tags of lists in the header
_TYPES = {1: "i1", 2: "S1", 3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8"}  # NumPy types by type number in the header
_MOST = 100_000  # largest number of entries of all lists together; chosen by trial, far above files of this program
_LONGEST = 1000  # largest number of values of an attribute; this program writes one value
_DEEPEST = 32  # largest number of dimensions of a variable: NumPy's limit up to version 1


class FormatError(ValueError):
    """Error: the content is not valid in the format."""


@dataclass(frozen=True)
class FileVariable:
    """Variable (array) in a netCDF file.

    Attributes
    ----------
    dims : tuple of str
    shape : tuple of int
    dtype : str
        As in NumPy, big-endian; ``S1`` for text.
    attributes : dict
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    attributes: dict[str, Any]
    content: memoryview = field(repr=False)

    def numbers(self) -> Array:
        """Copy of the array in native byte order, of shape `shape`."""
        stored = np.frombuffer(self.content, self.dtype).reshape(self.shape)
        return stored.astype(stored.dtype.newbyteorder("="))

    def texts(self) -> list[str]:
        """Rows of a character array of two dimensions as text."""
        width = self.shape[1]
        rows = (self.content[i * width : (i + 1) * width] for i in range(self.shape[0]))
        return [_text(row) for row in rows]


@dataclass(frozen=True)
class File:
    """Content of a netCDF file.

    Attributes
    ----------
    dims : dict of str to int
    attributes : dict
        Text, numbers, or arrays of them.
    variables : dict of str to FileVariable
    """

    dims: dict[str, int]
    attributes: dict[str, Any]
    variables: dict[str, FileVariable]


def read(content: bytes | memoryview) -> File:
    """Parse a netCDF file.

    Raises
    ------
    FormatError
        If it is not a classic netCDF file without record dimensions.
    """
    return _Reader(memoryview(content)).file()


class _Reader:
    """Parser of a file's header, read from beginning to end."""

    def __init__(self, content: memoryview) -> None:
        self.content, self.place = content, 0
        self.filled, self.listed = 0, 0  # bytes of variables and entries of lists so far, both bounded

    def file(self) -> File:
        magic = bytes(self.take(4))
        if magic not in (b"CDF\1", b"CDF\2"):
            raise FormatError("is not a classic netCDF file")
        self.offset = ">i" if magic == b"CDF\1" else ">q"
        self.number()  # the number of records, which is not needed
        dims = self.entries(_DIMENSIONS, self.dimension)
        self.dims = list(dims.items())
        attributes = self.entries(_ATTRIBUTES, self.attribute)
        return File(dims, attributes, self.entries(_VARIABLES, self.variable))

    def take(self, count: int) -> memoryview:
        """Next `count` bytes; padding up to a multiple of four is skipped."""
        end = self.place + count
        if count < 0 or end > len(self.content):
            raise FormatError("ends too early")
        found = self.content[self.place : end]
        self.place = end + -count % 4
        return found

    def number(self, form: str = ">i") -> int:
        return int(struct.unpack(form, self.take(struct.calcsize(form)))[0])

    def name(self) -> str:
        return _text(self.take(self.number()))

    def entries(self, tag: int, entry: Callable[[], T]) -> dict[str, T]:
        """Named entries of the next list, each parsed by `entry`; raises FormatError unless it has the given tag."""
        found: dict[str, T] = {}
        kind, count = self.number(), self.number()
        self.listed += count
        if kind not in (tag, 0) or count < 0 or self.listed > _MOST or (kind == 0 and count):
            raise FormatError("has a damaged list")
        for _ in range(count):
            name = self.name()
            if name in found:
                raise FormatError(f"has {name!r} twice")
            found[name] = entry()
        return found

    def dimension(self) -> int:
        length = self.number()
        if length < 1:
            raise FormatError("has a record dimension or a negative length")
        return length

    def attribute(self) -> Any:
        kind, count = self.type(), self.number()
        if kind != "S1" and count > _LONGEST:
            raise FormatError(f"has an attribute of {count} numbers")
        values = self.take(count * np.dtype(kind).itemsize)
        if kind == "S1":
            return _text(values)
        numbers = np.frombuffer(values, kind)
        return numbers.item() if count == 1 else numbers.tolist()

    def type(self) -> str:
        kind = self.number()
        if kind not in _TYPES:
            raise FormatError(f"has numbers of an unknown type, {kind}")
        return _TYPES[kind]

    def variable(self) -> FileVariable:
        rank = self.number()
        if not 0 <= rank <= _DEEPEST:
            raise FormatError(f"has a variable of {rank} dimensions")
        places = [self.number() for _ in range(rank)]
        if any(not 0 <= place < len(self.dims) for place in places):
            raise FormatError("has a variable over an unknown dimension")
        own = [self.dims[place] for place in places]
        attributes = self.entries(_ATTRIBUTES, self.attribute)
        kind = self.type()
        self.number()  # size of the variable: not needed, and may overflow in this format
        begin = self.number(self.offset)
        shape = tuple(length for _, length in own)
        size = math.prod(shape) * np.dtype(kind).itemsize
        self.filled += size
        if begin < 0 or begin + size > len(self.content) or self.filled > len(self.content):
            raise FormatError(f"has too few bytes for a variable of shape {shape}")
        return FileVariable(tuple(n for n, _ in own), shape, kind, attributes, self.content[begin : begin + size])


def _text(content: memoryview) -> str:
    try:
        return bytes(content).rstrip(b"\0").decode("utf-8")
    except UnicodeDecodeError as error:
        raise FormatError("has text that is not UTF-8") from error
