"""An operating point: numbers for a Model's parameters, some of them varied as arrays, and steady sliding there.

This is the one place where arrays of a rig's numbers are broadcast and checked.
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
from steadyslip.core.errors import ParameterError, Problem, UnknownNameError
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.questions import Keeper, question
from steadyslip.machine.rig import Rig
from steadyslip.model.build import model_of
from steadyslip.model.equations import MOVED, Model
from steadyslip.model.steady import carried_forces, steady_roots, steady_stresses

Vary = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class OperatingPoint(Keeper):
    """A model, the values of its parameters, and what follows for steady sliding.

    Attributes
    ----------
    model : Model
    arguments : tuple of float or ndarray
        In the order of ``model.parameters``; mutually broadcastable.
    shape : tuple of int
        Broadcast shape.
    wrap : callable
        Turns a result array with leading axes `shape` into what the user passed in (ndarray or
        xarray.DataArray): ``wrap(array, name, unit, extra_dims)``.
    branch : int
        Which steady sliding is meant where there are several, by rising normal stress.
    valid : bool or ndarray of bool
        Where the values obey the conditions that several obey together; false somewhere only for a scan.
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
        """Values by dotted name."""
        return dict(zip(self.model.parameters, self.arguments, strict=True))

    @cached_property
    def drive(self) -> Any:
        """Velocity of the load point in steady sliding, m/s."""
        return self.named()["drive.velocity"]

    @cached_property
    def sigmas(self) -> tuple[Any, ...]:
        """σss (Pa) of every contact over the varied parameters, NaN where steady sliding does not exist.

        Where there are several solutions, the one of `branch`.
        """
        return steady_stresses(self.model, self.arguments, self.branch)

    @cached_property
    def steady(self) -> tuple[Any, ...]:
        """What steady sliding makes of the parameters: `sigmas`, and what links carry where that is no formula."""
        return (*self.sigmas, *carried_forces(self.model, self.arguments, self.sigmas))

    @property
    def exists(self) -> Any:
        """Whether steady sliding does, over the varied parameters."""
        found = np.isfinite(self.sigmas[0])
        for sigma in self.sigmas[1:]:
            found = found & np.isfinite(sigma)
        return found

    @property
    def sigma(self) -> Any:
        """That of the contact of a model that has one; see `Model.contact`."""
        return self.sigmas[self.model.contacts.index(self.model.contact)]

    @property
    def axial_share(self) -> Any:
        """k over the axial stiffness, where that is given."""
        return _axial_share(self.model)(self.named())

    @property
    def gain(self) -> Any:
        """Stiffness that a controller adds, Pa/m."""
        return _gain(self.model)(*self.arguments)[0]

    @property
    def stresses(self) -> np.ndarray:
        """`sigma` as a flat array, with one entry at least."""
        return np.atleast_1d(np.asarray(self.sigma, dtype=float))

    def all_stresses(self) -> list[float]:
        """All positive σss of a single rig, rising."""
        return steady_roots(self.model, self.arguments)

    @cached_property
    def single(self) -> bool:
        """Whether all values are numbers: one rig."""
        return not any(map(np.ndim, self.arguments))

    @cached_property
    def _numbers(self) -> tuple[Any, ...]:
        """`arguments` and `steady` as NumPy's numbers and arrays."""
        return tuple(np.asarray(value, dtype=float)[()] for value in (*self.arguments, *self.steady))

    def evaluate(self, function: ArrayFunction, *further: Any) -> list[Any]:
        """Numbers of a ``model.function`` at this point; what leaves the range of floating point is inf or NaN."""
        return function(*self._numbers, *further)

    def rows(self, function: ArrayFunction, *further: Any) -> np.ndarray:
        """The same as an array (rigs, expressions): of a single rig one row."""
        values = (*self._numbers, *further)
        table = np.empty((max(self.size, 1), len(values)))
        for i, value in enumerate(values):
            table[:, i] = value
        return function.rows(table)

    def pieces(self, most: int) -> Iterator[OperatingPoint]:
        """The same rigs, flattened, at most `most` at a time; itself if it is no larger."""
        if self.size <= most:
            yield self
            return
        flat = [np.broadcast_to(a, self.shape).reshape(-1) if np.ndim(a) else a for a in self.arguments]
        for start in range(0, self.size, most):
            part = tuple(a[start : start + most] if np.ndim(a) else a for a in flat)
            yield OperatingPoint(self.model, part, (min(most, self.size - start),), self.wrap, self.branch)

    def part(self, rows: slice | np.ndarray) -> OperatingPoint:
        """Some rigs of a flat point; single numbers are for all of them."""
        if self.single:
            return self
        cut = [a[rows] if np.ndim(a) and len(a) > 1 else a for a in (*self.arguments, *self.steady)]
        count, many = len(self.arguments), len(self.sigmas)
        found = self.with_arguments(cut[:count], np.broadcast_shapes(*map(np.shape, cut)))
        found.__dict__["sigmas"], found.__dict__["steady"] = tuple(cut[count : count + many]), tuple(cut[count:])
        return found

    def with_arguments(self, arguments: Iterable[Any], shape: tuple[int, ...] | None = None) -> OperatingPoint:
        """The same model with other numbers, which are not checked."""
        return replace(self, arguments=tuple(arguments), shape=self.shape if shape is None else shape)


def stacked(parts: list[Any], point: OperatingPoint) -> np.ndarray:
    """Numbers of each rig along a last axis; NaN without steady sliding."""
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
    """The model of a rig and its parameters' values.

    Parameters
    ----------
    rig : Slider or Machine
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary by dotted name, in SI units; arrays broadcast against each other as NumPy
        arrays do, DataArrays by dimension name.
    present : iterable of str, optional
        Parameters that are zero but kept in the equations, as for `build_model`.
    branch : int, optional
        Which steady sliding is meant where there are several, by rising normal stress.
    scan : bool, optional
        Whether values are steps of a search, which goes beyond the conditions that numbers obey together (a rod
        shorter than its crank): these are marked in `OperatingPoint.valid` instead of refused.
    drive : str, optional
        What it does: `steadyslip.model.equations.MOVED`, ``PULLED`` or ``EITHER``.

    Raises
    ------
    ParameterError
        If names are unknown, values are outside their domain or break a condition with others, or shapes do not
        broadcast; all problems are listed.
    """
    if not (vary or present or scan or drive != MOVED):
        return _own_point(rig, branch)
    together = _varied(rig, vary or {})
    varied = together.values
    structural = [name for name in varied if rig.parameters()[name].role.structural and rig.value(name) == 0]
    return _placed(model_of(rig, [*structural, *present], drive), rig, together, branch, scan)


@lru_cache(maxsize=256)
def _own_point(rig: Rig, branch: int) -> OperatingPoint:
    """Of a rig as it is, with the answers that were asked of it before."""
    return _placed(model_of(rig), rig, _varied(rig, {}), branch, False)


def _placed(model: Model, rig: Rig, together: BroadcastArrays, branch: int, scan: bool) -> OperatingPoint:
    varied, valid = together.values, True
    if varied and scan:
        valid = valid_together(rig, "", varied)
    elif varied:
        check_together(rig, "", varied)
    values = {name: address.value for name, address in rig.parameters().items()} | varied
    if model.axial_share is not None:
        for name, other in rig.replaces.items():
            values[other] = values[name] * _axial_share(model)(values)
    values |= {name: 0.0 for name in rig.always_symbols if values[name] is None}  # a controller alone
    arguments = tuple(values[name] for name in model.parameters)
    return OperatingPoint(model, arguments, together.shape, together.wrap, branch, valid)


@question
def _gain(model: Model) -> ArrayFunction:
    return ArrayFunction([*model.parameters.values()], [model.gain])


@question
def _axial_share(model: Model) -> Callable[[Mapping[str, Any]], Any]:
    """k over the axial stiffness, as a function of numbers by dotted name."""
    share = sp.sympify(model.axial_share)
    names = [name for name, symbol in model.parameters.items() if share.has(symbol)]
    function = ArrayFunction([model.parameters[name] for name in names], [share])
    return lambda values: function(*(values[name] for name in names))[0]


def _varied(rig: Rig, vary: Vary) -> BroadcastArrays:
    """Checked values by full name."""
    known, problems = rig.parameters(), []
    checked: dict[str, Any] = {}
    for name, value in vary.items():
        try:
            full = rig.resolve(name)
            checked[full] = checked_array(full, known[full].role, rig.read(full, value))
            if known[full].role.adds_state and np.any(np.asarray(checked[full]) == 0):
                raise ParameterError(
                    [Problem(full, "got 0; without this term the rig has fewer states, ask for it apart")]
                )
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
