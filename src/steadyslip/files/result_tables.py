"""Results as files: named columns and a few attributes in one sealed netCDF file (`steadyslip.files.sealed`).

The module that writes a kind of file declares its attributes and columns. Reading compares names, types, dimensions,
sizes and units with the declaration before it allocates arrays. The seal detects damage; these checks detect crafted
files.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.files.netcdf import File, FileVariable, FormatError, read
from steadyslip.files.output import check_output
from steadyslip.files.sealed import FileKind, read_sealed, write_sealed

_SIZES = "sizes"  # attribute with the lengths of all dimensions, because the format cannot store variables of length 0
_PART = re.compile(r"part([1-9][0-9]{0,4})\.(.+)", re.DOTALL)  # name of a variable or attribute of a part


@dataclass(frozen=True)
class ColumnRule:
    """Declaration of a column of a result file.

    Attributes
    ----------
    dims : tuple of str
    unit : str
        SI unit; empty for text and indices.
    text : bool
        True for words, False for numbers.
    """

    dims: tuple[str, ...]
    unit: str = ""
    text: bool = False


def write_table(path: str | PathLike[str], kind: FileKind, dataset: Any, parts: Sequence[Any] = ()) -> None:
    """Write an xarray.Dataset of floats and text; an existing file is replaced only when the new one is complete.

    Parameters
    ----------
    path : str or path
    kind : FileKind
    dataset : xarray.Dataset
    parts : sequence of xarray.Dataset
        Results that this one contains, as they would be written alone; their names get the prefix ``part1.``, ...

    Raises
    ------
    NotAvailable
        If the name does not end in ``.nc``, the file cannot be written, or the dataset is too large.
    """
    check_output([Path(path)], [".nc"])
    if (size := sum(one.nbytes for one in (dataset, *parts))) > kind.most:
        too_large = f"it has {size / 2**20:.0f} MiB, more than the {kind.most // 2**20} MiB that a {kind.name}"
        raise NotAvailable(f"cannot write {str(path)!r}: {too_large} may have; keep fewer samples")
    kept = _whole(dataset)
    for i, part in enumerate(map(_whole, parts), start=1):
        part = part.rename({name: f"part{i}.{name}" for name in {*part.variables, *part.sizes}})
        attributes = {f"part{i}.{name}": value for name, value in part.attrs.items()}
        kept = kept.merge(part).assign_attrs(kept.attrs | attributes)
    encoding = {name: {"_FillValue": None} for name, variable in kept.variables.items() if variable.dtype.kind == "f"}
    content = kept.to_netcdf(None, engine="scipy", format="NETCDF3_64BIT", encoding=encoding)
    write_sealed(path, bytes(content), kind)


def _whole(dataset: Any) -> Any:
    """Dataset with the lengths of its dimensions as an attribute, without empty columns, which netCDF cannot store."""
    kept = dataset.drop_vars([name for name, variable in dataset.variables.items() if not variable.size])
    return kept.assign_attrs({_SIZES: json.dumps(dict(dataset.sizes))})


def _apart(file: File) -> list[File]:
    """Contents of a file: first those of the result itself, then those of its parts in order."""
    found: dict[int, File] = {0: File({}, {}, {})}
    for what in ("attributes", "variables"):
        for name, value in getattr(file, what).items():
            match = _PART.fullmatch(name)
            part, own = (int(match[1]), match[2]) if match else (0, name)
            if part and what == "variables":
                value = replace(value, dims=tuple(dim.removeprefix(f"part{part}.") for dim in value.dims))
            getattr(found.setdefault(part, File({}, {}, {})), what)[own] = value
    if sorted(found) != list(range(len(found))):
        raise FormatError("its parts are not numbered one by one")
    return [found[i] for i in range(len(found))]


class ExpectedTable:
    """Result file whose attributes are checked when it is opened, and its columns when they are read.

    Parameters
    ----------
    path : str or path
    kind : FileKind
    attributes : mapping of str to type
        Attributes that the file must have, and their types.
    of_parts : mapping of str to type, optional
        Attributes that each part must have, for a result that contains others.

    Attributes
    ----------
    attributes : dict
    parts : list of ExpectedTable
    """

    def __init__(
        self, path: str | PathLike[str], kind: FileKind, attributes: Mapping[str, type],
        of_parts: Mapping[str, type] | None = None,
    ) -> None:  # fmt: skip
        self.path, self.kind = path, kind
        try:
            file = read(read_sealed(path, kind))
            files = [file] if of_parts is None else _apart(file)
        except FormatError as error:
            raise self.fault(str(error)) from error
        self._open(files[0], attributes)
        self.parts = [self._part(one, of_parts) for one in files[1:] if of_parts is not None]

    def _part(self, file: File, attributes: Mapping[str, type]) -> ExpectedTable:
        part = ExpectedTable.__new__(ExpectedTable)
        part.path, part.kind, part.parts = self.path, self.kind, []
        part._open(file, attributes)
        return part

    def _open(self, file: File, attributes: Mapping[str, type]) -> None:
        self._file = file
        self.attributes: dict[str, Any] = dict(file.attributes)
        sizes = self.json(self.attributes.pop(_SIZES, None), {str: int})
        self._compare("attributes", self.attributes, attributes)
        for name, type_ in attributes.items():
            if type(self.attributes[name]) is not type_:
                raise self.fault(f"{name} is {self.attributes[name]!r:.60}, not {_TYPES[type_]}")
        self.sizes: dict[str, int] = sizes

    def fault(self, what: str) -> NotAvailable:
        """Error, which the caller raises, for a file whose content is not as declared."""
        return NotAvailable(f"cannot read {str(self.path)!r}: as a {self.kind.name}, {what}; {self.kind.remedy}")

    def json(self, text: Any, form: Any) -> Any:
        """Data from JSON text, checked against a form (see `fits_form`).

        Raises
        ------
        NotAvailable
        """
        try:
            found = json.loads(text)
        except (TypeError, ValueError, RecursionError) as error:
            raise self.fault("an attribute is missing or not JSON") from error
        if not fits_form(found, form):
            raise self.fault(f"an attribute is {found!r:.60}, which is not of the expected form")
        return found

    def columns(self, expected: Mapping[str, ColumnRule]) -> dict[str, Any]:
        """All columns by name: arrays of float64, or lists of text.

        Raises
        ------
        NotAvailable
            If a column is missing, unexpected or not as declared.
        """
        dims = {dim for column in expected.values() for dim in column.dims}
        self._compare("dimensions", self.sizes, dims)
        present = {n: c for n, c in expected.items() if all(self.sizes[dim] for dim in c.dims)}
        self._compare("columns", self._file.variables, present)
        for name, column in present.items():
            self._check(name, self._file.variables[name], column)
        return {name: self._values(name, column) for name, column in expected.items()}

    def _compare(self, what: str, found: Mapping[str, Any], expected: Any) -> None:
        if missing := [name for name in expected if name not in found]:
            raise self.fault(f"of its {what}, {missing[0]!r} is missing")
        if more := [name for name in found if name not in expected]:
            raise self.fault(f"it has unknown {what}, {more[0]!r}")

    def _check(self, name: str, variable: FileVariable, column: ColumnRule) -> None:
        rank = len(column.dims)
        shape = tuple(self.sizes[dim] for dim in column.dims)
        texts = variable.dtype == "S1" and len(variable.shape) == rank + 1 == 2
        if not (texts if column.text else variable.dtype == ">f8" and len(variable.shape) == rank):
            raise self.fault(f"{name} does not hold {'words' if column.text else 'numbers'} over {column.dims}")
        if variable.dims[:rank] != column.dims or variable.shape[:rank] != shape:
            raise self.fault(f"{name} has shape {variable.shape} over {variable.dims}, not {shape} over {column.dims}")
        if variable.attributes.get("units", "") != column.unit:
            raise self.fault(f"{name} is in {variable.attributes.get('units', '')!r:.40}, not in {column.unit!r}")

    def _values(self, name: str, column: ColumnRule) -> Any:
        if name not in self._file.variables:
            return [] if column.text else np.empty([self.sizes[dim] for dim in column.dims])
        try:
            variable = self._file.variables[name]
            return variable.texts() if column.text else variable.numbers()
        except FormatError as error:
            raise self.fault(f"{name} {error}") from error


_TYPES = {str: "text", int: "a whole number", float: "a number"}


def fits_form(value: Any, form: Any) -> bool:
    """True if JSON data have a declared form.

    A form is a type, ``[form]`` for a list, ``(form, form)`` for a list of that length, ``{name: form}`` for a dict
    with exactly these names, ``{str: form}`` for any names, or ``{form, None}`` for an optional value. Integers pass as
    floats.
    """
    if isinstance(value, int) and abs(value) >= 2**63:
        return False
    if form is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(form, type):
        return type(value) is form
    if isinstance(form, list):
        return isinstance(value, list) and all(fits_form(item, form[0]) for item in value)
    if isinstance(form, tuple):
        same = isinstance(value, list) and len(value) == len(form)
        return same and all(fits_form(v, f) for v, f in zip(value, form, strict=True))
    if isinstance(form, set):
        return value is None or any(fits_form(value, one) for one in form if one is not None)
    if not isinstance(value, dict):
        return False
    if str in form:
        return all(fits_form(item, form[str]) for item in value.values())
    return value.keys() == form.keys() and all(fits_form(value[name], form[name]) for name in form)
