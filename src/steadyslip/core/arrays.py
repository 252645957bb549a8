"""Checks and broadcasting of arrays that stand in place of a record's numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, QuantityError, repr_short
from steadyslip.core.quantities import parse
from steadyslip.core.records import FrozenRecord, conditions, with_values
from steadyslip.core.roles import Parameter

Array = np.ndarray
"""Array of numbers; the function that takes or returns it states shape and unit."""


def distinct(values: Array) -> tuple[Array, Array]:
    """Distinct values (n,) in rising order, and the index of the first occurrence of each.

    The result is that of `np.unique` with ``return_index``, which would also import masked arrays.
    """
    order = np.argsort(values, kind="stable")
    rising = values[order]
    first = np.append(True, rising[1:] != rising[:-1])[: len(values)]
    return rising[first], order[first]


def checked_array(name: str, role: Parameter, value: Any) -> Any:
    """Convert a varied parameter to a float array and check its domain; a DataArray keeps its dimensions.

    Raises
    ------
    ParameterError
        If a value is not allowed; the message has the parameter, the first such value and its position.
    """
    if hasattr(value, "dims"):
        return value.copy(data=np.asarray(checked_array(name, role, value.values)))
    if isinstance(value, str):
        try:
            value = parse(value, role.unit)
        except QuantityError as error:
            raise ParameterError([Problem(name, str(error))]) from error
    try:
        array = _numbers(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ParameterError([Problem(name, f"got {repr_short(value)}; allowed: numbers in {role.unit}")]) from error
    if not array.size:
        raise ParameterError([Problem(name, "got an empty array; give at least one value")])
    if not (role.domain.contains(array.min()) and role.domain.contains(array.max())):
        good = np.atleast_1d(role.domain.contains(array))
        where = tuple(int(i) for i in np.argwhere(~good)[0])
        bad = float(np.atleast_1d(array)[where])
        raise ParameterError(
            [Problem(name, f"got {bad!r} at position {where}; allowed: {role.domain.text} in {role.unit}")]
        )
    return array if array.ndim else float(array)


def _numbers(value: Any) -> np.ndarray:
    array = np.asarray(value)
    if array.dtype == bool:
        raise TypeError("True and False are no numbers")
    return np.asarray(value, dtype=float)


def check_together(record: FrozenRecord, prefix: str, varied: Mapping[str, Any]) -> None:
    """Check arrays that replace numbers of a record against the record's conditions between several parameters.

    Raises
    ------
    ParameterError
        If a condition fails; the message has the parameter, the first value that breaks it, and its position.
    """
    found = conditions(with_values(record, varied, prefix), prefix)
    problems = [p for name, condition in found if (p := condition.problem(name)) is not None]
    if problems:
        raise ParameterError(problems)


def valid_together(record: FrozenRecord, prefix: str, varied: Mapping[str, Any]) -> Any:
    """True where all conditions between several parameters hold; bool, or array of bool for arrays."""
    valid: Any = True
    for _, condition in conditions(with_values(record, varied, prefix), prefix):
        valid = valid & np.asarray(condition.holds)
    return valid


@dataclass(frozen=True)
class BroadcastArrays:
    """Named arrays that broadcast to one shape.

    Attributes
    ----------
    values : dict of str to ndarray or float
        Arrays by name, not broadcast yet; DataArrays as plain arrays with all of `dims`.
    shape : tuple of int
        Broadcast shape.
    dims, coords
        Dimensions and coordinates of the broadcast DataArrays; None if all arrays are plain.
    """

    values: dict[str, Any]
    shape: tuple[int, ...]
    dims: tuple[str, ...] | None = None
    coords: Any = None

    def flat(self) -> dict[str, Any]:
        """Arrays broadcast to the common shape and flattened to 1-D; single values unchanged."""
        return {n: np.broadcast_to(v, self.shape).reshape(-1) if np.ndim(v) else v for n, v in self.values.items()}

    @property
    def wrap(self) -> Callable[..., Any]:
        """Function ``wrap(array, name, unit, extra_dims)`` for results whose leading axes are `shape`.

        It returns a DataArray if the input had DataArrays, otherwise the array, or a float for a single value.
        """
        return _bare if self.dims is None else self._labelled

    def _labelled(self, array: Any, name: str, unit: str, extra_dims: tuple[str, ...] = ()) -> Any:
        import xarray as xr

        return xr.DataArray(
            array, dims=(*(self.dims or ()), *extra_dims), coords=self.coords, name=name, attrs={"units": unit}
        )


def _bare(array: Any, name: str, unit: str, extra_dims: tuple[str, ...] = ()) -> Any:
    return array if np.ndim(array) else np.asarray(array).item()


def broadcast(named: Mapping[str, Any]) -> BroadcastArrays:
    """Broadcast named arrays: plain arrays by NumPy's rules, DataArrays by the names of their dimensions.

    Raises
    ------
    ParameterError
        If the shapes do not broadcast, an array is empty, or plain arrays and DataArrays are mixed.
    """
    problems = [Problem(n, "got an empty array; give at least one value") for n, v in named.items() if not np.size(v)]
    labelled = {name: value for name, value in named.items() if hasattr(value, "dims")}
    values: dict[str, Any] = dict(named)
    dims, coords = None, None
    if labelled:
        import xarray as xr

        bare = [name for name, value in named.items() if name not in labelled and np.ndim(value)]
        problems += [Problem(name, "is a bare array beside DataArrays; make it a DataArray, too") for name in bare]
        together = xr.broadcast(*labelled.values())
        dims, coords = tuple(map(str, together[0].dims)), together[0].coords
        values |= {name: array.values for name, array in zip(labelled, together, strict=True)}
    shape: tuple[int, ...] = ()
    try:
        shape = np.broadcast_shapes(*(np.shape(value) for value in values.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {np.shape(value)}" for name, value in values.items())
        problems.append(Problem("vary", f"shapes do not broadcast: {shapes}"))
    if problems:
        raise ParameterError(problems)
    return BroadcastArrays(values, shape, dims, coords)
