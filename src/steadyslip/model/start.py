"""Initial values of a motion: steady sliding or given values, in the variables that jumps leave unchanged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import InternalError, ParameterError, Problem, QuantityError, repr_short, unknown_name
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.quantities import in_si
from steadyslip.model.equations import HELD, Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import V_LP, Reduction
from steadyslip.model.weights import slip_rates


@cached
def _steady_memory(model: Model) -> ArrayFunction:
    return model.function(model.steady[item.symbol] for item in model.memory)


@cached
def _continuous_names(reduction: Reduction) -> tuple[str, ...]:
    """Names of `Reduction.continuous`; velocity variables are ``w`` and the index of the contact."""
    by_symbol = {item.symbol: item.name for item in reduction.model.variables}
    by_symbol |= {one.variable.w: f"w {i}" for i, one in enumerate(reduction.slidings) if one.variable is not None}
    return tuple(by_symbol[symbol] for symbol in reduction.continuous)


@cached
def _steady_memory_values(point: OperatingPoint) -> list[Any]:
    """Steady values of the memory variables, cached per point."""
    return point.evaluate(_steady_memory(point.model))


def _number(value: Any) -> Any:
    """Convert to a NumPy float or array; NumPy is faster with floats than with 0-d arrays."""
    return np.asarray(value, dtype=float)[()]


@cached
def _velocity_variable(reduction: Reduction, index: int) -> ArrayFunction:
    """Array function that returns a contact's velocity variable for its slip rate and all memory variables."""
    model, variable = reduction.model, reduction.slidings[index].variable
    if variable is None:
        raise InternalError("the contact to have a velocity variable")
    memory = (item.symbol for item in model.memory)
    return model.function([variable.w_of_v], model.contacts[index].velocity, *memory)


@cached
def slip_rates_at(model: Model) -> ArrayFunction:
    """Array function that returns slip rates for velocities of the coordinates.

    The load point has its steady velocity.
    """
    steady = {model.inputs["load_velocity"]: model.steady[model.inputs["load_velocity"]]}
    slips = (model.definitions.get(contact.velocity, contact.velocity) for contact in model.contacts)
    return model.function([e.xreplace(steady) for e in slips], *(one.velocity for one in model.coordinates))


@cached
def _steady_states(model: Model) -> ArrayFunction:
    """Array function of the steady states of contact laws."""
    return model.function(model.steady[item.symbol] for item in model.states)


@cached
def coordinate_speeds(model: Model) -> ArrayFunction:
    """Array function of the velocities of the coordinates in steady sliding."""
    return model.function(one.speed for one in model.coordinates)


@cached
def _drive_force(model: Model) -> ArrayFunction:
    """Array function of the drive's force due to its motion, minus its steady value, when the protocol starts."""
    own, moves = model.letting_go, model.inputs["load_velocity"]
    force = sp.Integer(0) if own is None else own.driven.xreplace({moves: model.steady[moves]})
    given = (*(one.displacement for one in model.coordinates), *(one.velocity for one in model.coordinates))
    return model.function([force], *given, *(item.symbol for item in model.integrals))


@cached
def _balance(reduction: Reduction, index: int) -> tuple[ArrayFunction, bool]:
    """Array function of a massless slider's balance and its derivative by one memory variable.

    True if the balance is linear in it.
    """
    model = reduction.model
    memory = [item.symbol for item in model.memory]
    ((w, balance),) = reduction.restarts
    at_rest = dict.fromkeys(reduction.inputs, sp.Integer(0)) | {V_LP: model.parameters["drive.velocity"]}
    at_rest |= {item.symbol: sp.Integer(0) for item in (*model.integrals, *model.past)}
    at_rest |= {item.symbol: sp.sympify(model.steady[item.symbol]) for item in model.states}
    expression = balance.xreplace({w: reduction.w_of_v}).xreplace(at_rest)
    slope = derivative(expression, memory[index])
    function = model.function([expression, slope], model.contact.slip, model.contact.velocity, *memory)
    return function, not slope.has(memory[index])


def initial_values(
    reduction: Reduction, point: OperatingPoint, given: Mapping[str, Any], free: Any = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Initial values of the continuous variables, (rigs, variables), and of the first contact's slip rate, (rigs,).

    Variables that are not given have their steady values. Without mass, a velocity can be given only if at least one
    memory variable is not given: the first of these follows from the balance of forces.

    Parameters
    ----------
    free : float or ndarray, optional
        1 where the motion begins with a released drive (its force stays continuous), else 0.

    Raises
    ------
    ParameterError
        Listing the given values that are not allowed.
    """
    if given:
        return _initial_values(reduction, point, given, free)
    columns, velocity = _steady_start(point, reduction)
    return columns.copy(), velocity.copy()


@cached
def _steady_start(point: OperatingPoint, reduction: Reduction) -> tuple[np.ndarray, np.ndarray]:
    """Initial values for steady sliding, cached per point."""
    return _initial_values(reduction, point, {})


def _initial_values(
    reduction: Reduction, point: OperatingPoint, given: Mapping[str, Any], free: Any = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    model = reduction.model
    names = [item.name for item in model.memory]
    start = _checked_initial(given, model)
    memory = [_number(start.get(name, value)) for name, value in zip(names, _steady_memory_values(point), strict=True)]
    own = [(item.name.removesuffix("x"), item) for item in model.variables if item.kind == "slip"]
    places = [_number(start.get(item.name, 0.0)) for _, item in own]
    alone = f"{own[0][0]}v"
    steady = point.evaluate(coordinate_speeds(model))
    speeds = [_number(start.get(f"{name}v", speed)) for (name, _), speed in zip(own, steady, strict=True)]
    slips = point.evaluate(slip_rates_at(model), *speeds)
    for i, (slip, sliding) in enumerate(zip(slips, reduction.slidings, strict=True)):
        if sliding.one_way and not np.all(slip > 0):
            if model.is_single:
                message = f"got {given.get(alone)!r}; allowed: > 0 m/s with this law"
                raise ParameterError([Problem(f"initial.{alone}", message)])
            where = model.contacts[i].name
            message = f"the velocities make {where} slip at {np.min(slip):.4g} m/s; allowed: > 0 with its law"
            raise ParameterError([Problem("initial", message)])
    if model.is_single and not model.inertial and alone in start:
        free = [i for i, name in enumerate(names) if name not in start]
        if not free:
            message = "cannot be given: without mass it follows from the memory; give the memory or the velocity"
            raise ParameterError([Problem(f"initial.{alone}", message)])
        memory[free[0]] = _matching_memory(reduction, point, places[0], speeds[0], memory, free[0])
    values = dict(zip((item.name for _, item in own), places, strict=True)) | dict(zip(names, memory, strict=True))
    values |= {f"{name}v": speed for (name, _), speed in zip(own, speeds, strict=True)}
    values |= {item.name: start.get(item.name, 0.0) for item in model.integrals} | {
        item.name: 0.0 for item in model.past
    }
    for item, value in zip(model.states, point.evaluate(_steady_states(model)), strict=True):
        values[item.name] = _number(start.get(item.name, value))
    if model.letting_go is not None:
        integrals = (values[item.name] for item in model.integrals)
        values[HELD] = free * point.evaluate(_drive_force(model), *places, *speeds, *integrals)[0]
    order = _continuous_names(reduction)
    for i in range(len(slips)):
        if f"w {i}" in order:
            values[f"w {i}"] = point.evaluate(_velocity_variable(reduction, i), slips[i], *memory)[0]
    columns = [values[name] for name in order]
    if not any(map(np.ndim, columns)):
        return np.array([columns], dtype=float), np.atleast_1d(slips[0])
    return np.ascontiguousarray(np.column_stack(np.broadcast_arrays(*map(np.atleast_1d, columns)))), np.atleast_1d(
        slips[0]
    )


def _checked_initial(given: Mapping[str, Any], model: Model) -> dict[str, np.ndarray]:
    moving = {item.name: item.unit for item in model.variables if item.kind in ("slip", "velocity")}
    if model.is_single:  # without inertia a memory variable is adjusted to a given velocity
        slip, unit = next(iter(moving.items()))
        moving = {slip: unit, f"{slip.removesuffix('x')}v": f"{unit}/s"}
    known = moving | {item.name: item.unit for item in (*model.memory, *model.states, *model.integrals)}
    problems, found = [], {}
    for name, value in given.items():
        if name not in known:
            problems.append(Problem(f"initial.{name}", unknown_name("variable", name, known)))
            continue
        try:
            array = np.asarray(in_si(value, known[name]), dtype=float)
        except QuantityError as error:
            problems.append(Problem(f"initial.{name}", str(error)))
            continue
        except (TypeError, ValueError, OverflowError):
            array = np.array(np.nan)
        if not array.size or not np.all(np.isfinite(array)) or np.asarray(value).dtype == bool:
            problems.append(Problem(f"initial.{name}", f"got {repr_short(value)}; allowed: finite numbers in SI units"))
        found[name] = array
    if problems:
        raise ParameterError(problems)
    return found


def _matching_memory(reduction: Reduction, point: OperatingPoint, x: Any, v: Any, memory: list[Any], index: int) -> Any:
    """Value of a memory variable that balances the forces at a given velocity, by Newton's method."""
    function, linear = _balance(reduction, index)
    current = list(memory)
    for _ in range(1 if linear else 60):  # bound on Newton steps, far more than needed; chosen by trial
        with np.errstate(all="ignore"):
            residual, slope = point.evaluate(function, x, v, *current)
            change = residual / slope
        current[index] = current[index] - change
        if not np.any(np.abs(change) > 1e-15 * (1 + np.abs(current[index]))):  # about four rounding errors
            break
    return current[index]


def guesses(reduction: Reduction, point: OperatingPoint, initial: np.ndarray, velocity: Any) -> list[Any]:
    """Initial guesses of `Reduction.searched`: unknowns, and velocity variables determined by balances."""
    model, found = reduction.model, []
    memory = [initial[:, reduction.continuous.index(item.symbol)] for item in model.memory]
    own = {one.variable.w: i for i, one in enumerate(reduction.slidings) if one.variable is not None}
    steady = point.evaluate(_steady_unknowns(reduction))
    for symbol, value in zip(reduction.searched, steady, strict=True):
        if symbol in own:
            slip = velocity if model.is_single else slip_rates(point)[own[symbol]]
            value = point.evaluate(_velocity_variable(reduction, own[symbol]), slip, *memory)[0]
        found.append(value)
    return found or [0.0]


@cached
def _steady_unknowns(reduction: Reduction) -> ArrayFunction:
    """Array function of steady values of `Reduction.searched`; zero for velocity variables."""
    return reduction.model.function(reduction.model.steady.get(s, sp.Integer(0)) for s in reduction.searched)


@cached
def restored_of(reduction: Reduction) -> ArrayFunction:
    """Array function that returns the continuous variables for a state and inputs, so that a run can start at any
    state."""
    return reduction.model.function(reduction.restored, *reduction.state, *reduction.inputs)
