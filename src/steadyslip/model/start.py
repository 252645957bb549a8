"""Where a motion starts: steady sliding, or what is given in its place, in the variables that jumps leave alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import brief
from steadyslip.core.errors import InternalError, ParameterError, Problem, unknown_name
from steadyslip.core.expressions import derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import TIME, V_LP, P, Q, Reduction, W


@question
def _steady_memory(model: Model) -> Callable[..., list[Any]]:
    return model.function(model.steady[item.symbol] for item in model.memory)


@question
def _continuous_names(reduction: Reduction) -> tuple[str, ...]:
    """Names of what a jump leaves alone; ``w`` is the velocity variable."""
    by_symbol = {item.symbol: item.name for item in reduction.model.variables} | {W: "w"}
    return tuple(by_symbol[symbol] for symbol in reduction.continuous)


@question
def _own_memory(point: OperatingPoint) -> list[Any]:
    """The memory in steady sliding."""
    return point.evaluate(_steady_memory(point.model))


def _number(value: Any) -> Any:
    """A float or an array of them; NumPy is quicker with the former than with arrays without axes."""
    return np.asarray(value, dtype=float)[()]


@question
def _velocity_variable(reduction: Reduction) -> Callable[..., list[Any]]:
    model = reduction.model
    return model.function([reduction.w_of_v], model.contact.velocity, *(item.symbol for item in model.memory))


@question
def _balance(reduction: Reduction, index: int) -> tuple[Callable[..., list[Any]], bool]:
    """The balance of a massless model before the protocol begins, its slope in one memory variable; whether that
    is the same wherever that variable is.
    """
    model = reduction.model
    memory = [item.symbol for item in model.memory]
    if reduction.restart is None:
        raise InternalError("reduction.restart is not None")
    at_rest = {V_LP: model.parameters["drive.velocity"], Q: sp.Integer(0), P: sp.Integer(0), TIME: sp.Integer(0)}
    at_rest |= {item.symbol: sp.Integer(0) for item in model.integrals}
    expression = reduction.restart.xreplace({W: reduction.w_of_v}).xreplace(at_rest)
    slope = derivative(expression, memory[index])
    function = model.function([expression, slope], model.contact.slip, model.contact.velocity, *memory)
    return function, not slope.has(memory[index])


def initial_values(
    reduction: Reduction, point: OperatingPoint, given: Mapping[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Continuous variables at the start and the velocity there.

    Steady sliding, unless a variable is given. Without mass, a given velocity needs a memory that goes with
    it: the first memory variable that is not given itself follows from the balance of forces.

    Raises
    ------
    ParameterError
        Listing what is given and cannot be.
    """
    model = reduction.model
    names = [item.name for item in model.memory]
    start = _checked_initial(given, model)
    memory = [_number(start.get(name, value)) for name, value in zip(names, _own_memory(point), strict=True)]
    x, v = _number(start.get("x", 0.0)), _number(start.get("v", point.drive))
    if reduction.velocity == "logarithm" and not np.all(v > 0):
        raise ParameterError([Problem("initial.v", f"got {given.get('v')!r}; allowed: > 0 m/s with this law")])
    if not model.inertial and "v" in start:
        free = [i for i, name in enumerate(names) if name not in start]
        if not free:
            message = "cannot be given: without mass it follows from the memory; give the memory or the velocity"
            raise ParameterError([Problem("initial.v", message)])
        memory[free[0]] = _matching_memory(reduction, point, x, v, memory, free[0])
    order = _continuous_names(reduction)
    values = {"x": x, **dict(zip(names, memory, strict=True))}
    values |= {item.name: start.get(item.name, 0.0) for item in model.integrals}
    if "w" in order:
        values["w"] = point.evaluate(_velocity_variable(reduction), v, *memory)[0]
    columns = [values[name] for name in order]
    if not any(map(np.ndim, columns)):
        return np.array([columns], dtype=float), np.atleast_1d(v)
    return np.ascontiguousarray(np.column_stack(np.broadcast_arrays(*map(np.atleast_1d, columns)))), np.atleast_1d(v)


def _checked_initial(given: Mapping[str, Any], model: Model) -> dict[str, np.ndarray]:
    known = ["x", "v", *(item.name for item in (*model.memory, *model.integrals))]
    problems, found = [], {}
    for name, value in given.items():
        if name not in known:
            problems.append(Problem(f"initial.{name}", unknown_name("variable", name, known)))
            continue
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError, OverflowError):
            array = np.array(np.nan)
        if not array.size or not np.all(np.isfinite(array)) or np.asarray(value).dtype == bool:
            problems.append(Problem(f"initial.{name}", f"got {brief(value)}; allowed: finite numbers in SI units"))
        found[name] = array
    if problems:
        raise ParameterError(problems)
    return found


def _matching_memory(reduction: Reduction, point: OperatingPoint, x: Any, v: Any, memory: list[Any], index: int) -> Any:
    """The memory variable that balances forces at a given velocity, by Newton's method (one step where linear)."""
    function, linear = _balance(reduction, index)
    current = list(memory)
    for _ in range(1 if linear else 60):
        with np.errstate(all="ignore"):
            residual, slope = point.evaluate(function, x, v, *current)
            change = residual / slope
        current[index] = current[index] - change
        if not np.any(np.abs(change) > 1e-15 * (1 + np.abs(current[index]))):
            break
    return current[index]


def guess(reduction: Reduction, point: OperatingPoint, initial: np.ndarray, velocity: Any) -> Any:
    """Where Newton's method starts for the unknown that is left to solve for."""
    model = reduction.model
    if model.inertial:
        return 0.0
    memory = [initial[:, reduction.continuous.index(item.symbol)] for item in model.memory]
    return point.evaluate(_velocity_variable(reduction), velocity, *memory)[0]


@question
def _velocity(reduction: Reduction) -> Callable[..., list[Any]]:
    return reduction.model.function([reduction.outputs["v"]], *reduction.state, W)


def velocity_at(reduction: Reduction, point: OperatingPoint, state: np.ndarray, unknown: Any) -> Any:
    """Velocity of a massless block, m/s, from its state (k, n) and the unknown of the balance, if there is one."""
    return point.evaluate(_velocity(reduction), *state.T, unknown)[0]


@question
def restored_of(reduction: Reduction) -> Callable[..., list[Any]]:
    """What a jump leaves unchanged, from the state: for starting a kernel anywhere."""
    return reduction.model.function(reduction.restored, *reduction.state, V_LP, Q, P, TIME)
