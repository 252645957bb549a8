"""Numbers for a Model's parameters: those of a rig, some of them varied as arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, QuantityError, UnknownNameError
from steadyslip.core.expressions import array_function
from steadyslip.core.quantities import parse
from steadyslip.core.records import FrozenRecord, Parameter, conditions, twin
from steadyslip.machine.slider import Slider
from steadyslip.model import Model, build_model

Vary = Mapping[str, Any]


@dataclass(frozen=True)
class Values:
    """A model and the values of its parameters, in the order of ``model.parameters``.

    Attributes
    ----------
    model : Model
    arguments : tuple of float or ndarray
        Mutually broadcastable.
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

    def pieces(self, most: int) -> Iterator[Values]:
        """The same rigs, flattened, at most `most` at a time; itself if it is no larger."""
        if self.size <= most:
            yield self
            return
        flat = [np.broadcast_to(a, self.shape).reshape(-1) if np.ndim(a) else a for a in self.arguments]
        for start in range(0, self.size, most):
            part = tuple(a[start : start + most] if np.ndim(a) else a for a in flat)
            yield Values(self.model, part, (min(most, self.size - start),), self.wrap, self.branch)

    def named(self) -> dict[str, Any]:
        """Values by dotted name."""
        return dict(zip(self.model.parameters, self.arguments, strict=True))


def model_values(
    rig: Slider, vary: Vary | None = None, present: Iterable[str] = (), branch: int = 0, scan: bool = False
) -> Values:
    """The model of a rig and its parameters' values.

    Parameters
    ----------
    rig : Slider
    vary : mapping of str to array_like or xarray.DataArray, optional
        Parameters to vary by dotted name, in SI units; arrays broadcast against each other as NumPy
        arrays do, DataArrays by dimension name.
    present : iterable of str, optional
        Parameters that are zero but kept in the equations, as for `build_model`.
    branch : int, optional
        Which steady sliding is meant where there are several, by rising normal stress.
    scan : bool, optional
        Whether values are steps of a search, which goes beyond the conditions that numbers obey together (a rod
        shorter than its crank): these are marked in `Values.valid` instead of refused.

    Raises
    ------
    ParameterError
        If names are unknown, values are outside their domain or break a condition with others, or shapes do not
        broadcast; all problems are listed.
    """
    varied, wrap, shape = _varied(rig, vary or {})
    valid = _checked_together(rig, varied, "", scan) if varied else True
    structural = [name for name in varied if rig.parameters()[name].role.structural and rig.value(name) == 0]
    model = build_model(rig, present=[*structural, *present])
    values = {name: address.value for name, address in rig.parameters().items()} | varied
    if "slider.stiffness" not in varied:
        values["slider.stiffness"] = _sliding_stiffness(rig, values)
    return Values(model, tuple(values[name] for name in model.parameters), shape, wrap, branch, valid)


def check_together(record: FrozenRecord, prefix: str, varied: Mapping[str, Any]) -> None:
    """Refuse arrays of a record's numbers that break a condition which they obey together.

    Raises
    ------
    ParameterError
        Naming the parameter, the first bad value and its position.
    """
    _checked_together(record, varied, prefix, scan=False)


def _checked_together(record: FrozenRecord, varied: Mapping[str, Any], prefix: str, scan: bool) -> Any:
    """Where all conditions hold."""
    found = list(conditions(twin(record, varied, prefix), prefix))
    problems = [] if scan else [p for name, condition in found if (p := condition.problem(name)) is not None]
    if problems:
        raise ParameterError(problems)
    valid: Any = True
    for _, condition in found:
        valid = valid & np.asarray(condition.holds)
    return valid


def _sliding_stiffness(rig: Slider, values: Mapping[str, Any]) -> Any:
    """k along the sliding direction: given, or from the axial stiffness, or zero under a controller."""
    if rig.axial_stiffness is None:
        return 0.0 if rig.stiffness is None else rig.stiffness
    names = tuple(name for name in values if name.startswith("contact.") and values[name] is not None)
    axial = values["slider.axial_stiffness"]
    return axial * axial_projection(rig)(*(values[name] for name in names))


def axial_projection(rig: Slider) -> Callable[..., Any]:
    """k/k_axial as a function of the contact's given parameters, in order."""
    import sympy as sp

    names = [name for name, a in rig.parameters().items() if name.startswith("contact.") and a.value is not None]
    symbols = {name: sp.Symbol(f"c{i}", real=True) for i, name in enumerate(names)}
    expression = twin(rig, symbols).contact.sliding_stiffness(sp.Integer(1))
    function = _projection_function(tuple(symbols.values()), expression)
    return lambda *arguments: function(*arguments)[0]


@lru_cache(maxsize=32)
def _projection_function(symbols: tuple[Any, ...], expression: Any) -> Callable[..., Any]:
    return array_function(symbols, [expression])


def checked_array(name: str, role: Parameter, value: Any) -> Any:
    """A varied parameter as float array inside its domain.

    Raises
    ------
    ParameterError
        Naming the parameter, the first bad value and its position.
    """
    if isinstance(value, str):
        try:
            value = parse(value, role.unit)
        except QuantityError as error:
            raise ParameterError([Problem(name, str(error))]) from error
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ParameterError([Problem(name, f"got {value!r}; allowed: numbers in {role.unit}")]) from error
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


def _varied(rig: Slider, vary: Vary) -> tuple[dict[str, Any], Callable[..., Any], tuple[int, ...]]:
    """Checked values by full name, the wrapper of results, and the broadcast shape."""
    known, problems, labelled = rig.parameters(), [], {}
    plain: dict[str, Any] = {}
    for name, value in vary.items():
        try:
            full = rig.resolve(name)
            raw = value.values if hasattr(value, "dims") else value
            plain[full] = checked_array(full, known[full].role, raw)
            if hasattr(value, "dims"):
                labelled[full] = value
            if known[full].role.adds_state and np.any(np.asarray(plain[full]) == 0):
                raise ParameterError(
                    [Problem(full, "got 0; without this term the rig has fewer states, ask for it apart")]
                )
            if known[full].value is None and full != "slider.stiffness":
                raise ParameterError([Problem(full, "cannot be varied: the rig does not have it")])
            if full == "slider.stiffness" and rig.axial_stiffness is not None:
                raise ParameterError([Problem(full, "cannot be varied: the rig has axial_stiffness")])
        except UnknownNameError as error:
            problems.append(Problem(name, str(error)))
        except ParameterError as error:
            problems += error.problems
    if problems:
        raise ParameterError(problems)
    if labelled:
        return _labelled(plain, labelled)
    try:
        shape = np.broadcast_shapes(*(np.shape(v) for v in plain.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {np.shape(v)}" for name, v in plain.items())
        raise ParameterError([Problem("vary", f"shapes do not broadcast: {shapes}")]) from error
    return plain, _bare, shape


def _bare(array: Any, name: str, unit: str, extra_dims: tuple[str, ...] = ()) -> Any:
    return array if np.ndim(array) else np.asarray(array).item()


def _labelled(
    plain: dict[str, Any], labelled: dict[str, Any]
) -> tuple[dict[str, Any], Callable[..., Any], tuple[int, ...]]:
    """Broadcast by dimension name and return DataArrays."""
    import xarray as xr

    bare = [name for name in plain if name not in labelled and np.ndim(plain[name])]
    if bare:
        raise ParameterError([Problem(name, "is a bare array beside DataArrays; name its dimensions") for name in bare])
    together = dict(zip(labelled, xr.broadcast(*labelled.values()), strict=True))
    template = next(iter(together.values()))
    values = plain | {name: array.values.astype(float) for name, array in together.items()}

    def wrap(array: Any, name: str, unit: str, extra_dims: tuple[str, ...] = ()) -> Any:
        return xr.DataArray(
            array,
            dims=(*template.dims, *extra_dims),
            coords=template.coords,
            name=name,
            attrs={"units": unit},
        )

    return values, wrap, template.shape
