"""Operating points: a Model with values of its parameters, some varied as arrays, and the steady state there.

Arrays of a rig's numbers are checked and broadcast here only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import BroadcastArrays, broadcast, check_together, checked_array, valid_together
from steadyslip.core.caching import HasCache, cached
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, UnknownNameError
from steadyslip.core.expressions import ArrayFunction
from steadyslip.machine.rig import Rig
from steadyslip.model.build import in_matrices, model_of
from steadyslip.model.equations import MOVED, Model
from steadyslip.model.steady import carried_forces, steady_roots, steady_stresses

Vary = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class OperatingPoint(HasCache):
    """A Model with values of its parameters, and its steady state.

    Attributes
    ----------
    model : Model
    arguments : tuple of float or ndarray
        Values in the order of ``model.parameters``, in SI units; mutually broadcastable.
    shape : tuple of int
        Broadcast shape.
    wrap : callable
        Function ``wrap(array, name, unit, extra_dims)`` that converts a result with leading axes `shape` to the
        user's type of array (ndarray or xarray.DataArray).
    branch : int
        Index of the steady state, by rising normal stress, if there are several.
    valid : bool or ndarray of bool
        True where conditions between several parameters are met; False occurs only with `scan` of `operating_point`.
    """

    model: Model
    arguments: tuple[Any, ...]
    shape: tuple[int, ...]
    wrap: Callable[..., Any]
    branch: int = 0
    valid: Any = True

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    def named(self) -> dict[str, Any]:
        """Values of the parameters by dotted name."""
        return dict(zip(self.model.parameters, self.arguments, strict=True))

    @cached_property
    def drive(self) -> Any:
        """Velocity of the drive in steady sliding (m/s or rad/s)."""
        return self.named()["drive.velocity"]

    @cached_property
    def sigmas(self) -> tuple[Any, ...]:
        """Steady normal stress σss (Pa) of every contact over the varied parameters; NaN without steady sliding.

        If there are several solutions, the one with index `branch` is used.
        """
        return steady_stresses(self.model, self.arguments, self.branch)

    @cached_property
    def steady(self) -> tuple[Any, ...]:
        """Values of `sigmas` and of `Model.carried`, in the order of `Model.arguments`."""
        return (*self.sigmas, *carried_forces(self.model, self.arguments, self.sigmas))

    @property
    def exists(self) -> Any:
        """True where steady sliding exists, over the varied parameters."""
        found = np.isfinite(self.sigmas[0])
        for sigma in self.sigmas[1:]:
            found = found & np.isfinite(sigma)
        return found

    @property
    def sigma(self) -> Any:
        """Steady normal stress σss (Pa) of a slider."""
        return self.sigmas[self.model.contacts.index(self.model.contact)]

    @property
    def axial_share(self) -> Any:
        """Ratio of k to the axial stiffness, if the axial stiffness is given."""
        return _axial_share(self.model)(self.named())

    @property
    def gain(self) -> Any:
        """Stiffness (Pa/m) that a controller adds."""
        return _gain(self.model)(*self.arguments)[0]

    @property
    def stresses(self) -> np.ndarray:
        """Steady normal stress of a slider (Pa) as an array with at least one axis."""
        return np.atleast_1d(np.asarray(self.sigma, dtype=float))

    def all_stresses(self) -> list[float]:
        """All positive σss (Pa) of a single slider, rising."""
        return steady_roots(self.model, self.arguments)

    @cached_property
    def single(self) -> bool:
        """True if all values are numbers (one rig)."""
        return not any(map(np.ndim, self.arguments))

    @cached_property
    def _numbers(self) -> tuple[Any, ...]:
        """Values of `arguments` and `steady` as NumPy floats and arrays."""
        return tuple(np.asarray(value, dtype=float)[()] for value in (*self.arguments, *self.steady))

    def evaluate(self, function: ArrayFunction, *further: Any) -> list[Any]:
        """Values of a ``model.function`` at this point; overflow and invalid operations give inf and NaN."""
        return function(*self._numbers, *further)

    def rows(self, function: ArrayFunction, *further: Any) -> np.ndarray:
        """Values of a ``model.function`` as an array (rigs, expressions); one row for a single rig."""
        values = (*self._numbers, *further)
        table = np.empty((max(self.size, 1), len(values)))
        for i, value in enumerate(values):
            table[:, i] = value
        return function.rows(table)

    def pieces(self, most: int) -> Iterator[OperatingPoint]:
        """Yield points with one axis and at most `most` rigs each; the point itself if it has no more rigs."""
        if self.size <= most:
            yield self
            return
        flat = [np.broadcast_to(a, self.shape).reshape(-1) if np.ndim(a) else a for a in self.arguments]
        for start in range(0, self.size, most):
            part = tuple(a[start : start + most] if np.ndim(a) else a for a in flat)
            yield OperatingPoint(self.model, part, (min(most, self.size - start),), self.wrap, self.branch)

    def part(self, rows: slice | np.ndarray) -> OperatingPoint:
        """Point with the selected rigs of a point that has one axis; steady states are not computed again."""
        if self.single:
            return self
        whole = (*self.arguments, *self.steady, self.valid)
        *cut, valid = [a[rows] if np.ndim(a) and len(a) > 1 else a for a in whole]
        count, many = len(self.arguments), len(self.sigmas)
        found = replace(self.with_arguments(cut[:count], np.broadcast_shapes(*map(np.shape, cut))), valid=valid)
        found.__dict__["sigmas"], found.__dict__["steady"] = tuple(cut[count : count + many]), tuple(cut[count:])
        return found

    def with_arguments(self, arguments: Iterable[Any], shape: tuple[int, ...] | None = None) -> OperatingPoint:
        """Copy with other values of the parameters, which are not checked."""
        return replace(self, arguments=tuple(arguments), shape=self.shape if shape is None else shape)


def stacked(parts: list[Any], point: OperatingPoint) -> np.ndarray:
    """Values stacked along a new last axis, (..., parts), with the shape of the point; NaN without steady sliding."""
    out = np.empty((*point.shape, len(parts)))
    for i, part in enumerate(parts):
        out[..., i] = part
    if not np.all(exists := point.exists):
        out[np.broadcast_to(~exists, point.shape)] = np.nan
    return out


def operating_point(
    rig: Rig, vary: Vary | None = None, present: Iterable[str] = (), branch: int = 0, scan: bool = False,
    drive: str = MOVED,
) -> OperatingPoint:  # fmt: skip
    """Make the operating point of a rig, with some parameters varied.

    Parameters
    ----------
    rig : Slider or Machine
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary by dotted name, in SI units; arrays broadcast against each other as NumPy
        arrays do, DataArrays by dimension name.
    present : iterable of str, optional
        Parameters that are zero but kept in the equations, as for `build_model`.
    branch : int, optional
        Index of the steady state, by rising normal stress, if there are several.
    scan : bool, optional
        True for the values of a search: those that violate conditions between several parameters (a rod shorter than
        its crank) are marked in `OperatingPoint.valid` instead of refused.
    drive : str, optional
        Mode of the drive: `steadyslip.model.equations.MOVED`, ``PULLED`` or ``EITHER``.

    Raises
    ------
    ParameterError
        If names are unknown, values are outside their domain or break a condition with others, or shapes do not
        broadcast; all problems are listed.
    """
    if not (vary or present or scan or drive != MOVED):
        return _cached_point(rig, branch)
    arrays = checked_arrays(rig, vary or {})
    varied = arrays.values
    for name in in_matrices(rig):
        if name in varied:
            raise NotAvailable(
                f"{name} is in the matrices of the structure, so that equations for several values at once are not "
                f"offered; make a rig for each value: rig.with_values({{{name!r}: ...}})"
            )
    structural = [name for name in varied if rig.parameters()[name].role.structural and rig.value(name) == 0]
    return _make_point(model_of(rig, [*structural, *present], drive), rig, arrays, branch, scan)


@lru_cache(maxsize=256)
def _cached_point(rig: Rig, branch: int) -> OperatingPoint:
    """Operating point of a rig without varied parameters; cached, so that results derived from it are reused."""
    return _make_point(model_of(rig), rig, checked_arrays(rig, {}), branch, False)


def _make_point(model: Model, rig: Rig, arrays: BroadcastArrays, branch: int, scan: bool) -> OperatingPoint:
    """Check the conditions between parameters, and order the values as in ``model.parameters``."""
    varied, valid = arrays.values, True
    if varied and scan:
        valid = valid_together(rig, "", varied)
    elif varied:
        check_together(rig, "", varied)
    values = {name: address.value for name, address in rig.parameters().items()} | varied
    if model.axial_share is not None:
        for name, other in rig.replaces.items():
            values[other] = values[name] * _axial_share(model)(values)
    values |= {name: 0.0 for name in rig.always_symbols if values[name] is None}  # a controller without a spring
    arguments = tuple(values[name] for name in model.parameters)
    return OperatingPoint(model, arguments, arrays.shape, arrays.wrap, branch, valid)


@cached
def _gain(model: Model) -> ArrayFunction:
    return ArrayFunction([*model.parameters.values()], [model.gain])


@cached
def _axial_share(model: Model) -> Callable[[Mapping[str, Any]], Any]:
    """Function of values by dotted name that returns the ratio of k to the axial stiffness."""
    share = sp.sympify(model.axial_share)
    names = [name for name, symbol in model.parameters.items() if share.has(symbol)]
    function = ArrayFunction([model.parameters[name] for name in names], [share])
    return lambda values: function(*(values[name] for name in names))[0]


def checked_arrays(rig: Rig, vary: Vary) -> BroadcastArrays:
    """Checked and broadcast arrays (SI units) of the varied parameters, by full dotted name."""
    known, problems = rig.parameters(), []
    checked: dict[str, Any] = {}
    for name, value in vary.items():
        try:
            full = rig.resolve(name)
            checked[full] = checked_array(full, known[full].role, rig.read(full, value))
            if known[full].role.adds_state and np.any(np.asarray(checked[full]) == 0):
                message = (
                    "got 0, at which the rig has fewer states; leave 0 out and compute that case in a separate call"
                )
                raise ParameterError([Problem(full, message)])
            if known[full].value is None and full not in rig.always_symbols:
                raise ParameterError([Problem(full, "cannot be varied: the rig does not have it")])
            for name, other in rig.replaces.items():
                if full == other and known[name].value is not None:
                    given = name.rpartition(".")[2]
                    raise ParameterError([Problem(full, f"cannot be varied: the rig has {given}")])
        except UnknownNameError as error:
            problems.append(Problem(name, str(error)))
        except ParameterError as error:
            problems += error.problems
    if problems:
        raise ParameterError(problems)
    return broadcast(checked)
