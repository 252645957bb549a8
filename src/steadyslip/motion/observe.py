"""Observables computed from states and times."""

from __future__ import annotations

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import InternalError
from steadyslip.core.expressions import ArrayFunction
from steadyslip.kernels.runner import Runner
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.model import Model
from steadyslip.model.equations import HELD
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reducing import FREE
from steadyslip.motion.jobs import Jobs
from steadyslip.motion.targets import Targets
from steadyslip.protocol import creep, protocol as channels
from steadyslip.protocol.inputs import inputs_at, rates_at

Tables = tuple[np.ndarray, ...]
OBSERVED = ("v", "acceleration", "normal_stress", "shear_stress", "spring_stress", "load_velocity",
            "load_displacement")  # fmt: skip
"""Outputs of the driver's `observe` for each contact, in this order."""
LOADING = "loading of the drive"  # key of an intermediate value, left out of results: imposed force on the drive
WAY, LOAD = "way of the drive", "velocity of the drive"  # more such keys: displacement and velocity of the drive
STRESSES = ("normal_stress", "shear_stress", "spring_stress")
UNSEEN = ("held", "past")  # kinds of variables that results do not contain
EXTRA_UNITS = {"slip": "m", "load_displacement": "m", "acceleration": "m/s^2", "load_velocity": "m/s"}


def observable_units(model: Model, acting: Targets) -> dict[str, str]:
    """SI units of all observables of a run, by name, for a model and the targets of its protocol."""
    if model.contacts[0].name:
        return _machine_units(model, acting)
    units = (
        {"x": "m", "v": "m/s"}
        | EXTRA_UNITS
        | {name: "1" if kind == "share" else "Pa" for name, (_, kind, _) in acting.named().items()}
    )
    units |= {name: unit for name, (_, unit) in model.observables.items()}
    return units | {m.name: m.unit for m in model.variables if m.kind not in UNSEEN}


def _machine_units(model: Model, acting: Targets) -> dict[str, str]:
    """SI units of the observables of a machine (forces, not stresses), by name, with the body or contact as prefix."""
    units: dict[str, str] = {}
    for one in model.coordinates:
        if one.inner:
            continue
        units |= {
            f"{one.name}.x": one.unit,
            f"{one.name}.v": f"{one.unit}/s",
            f"{one.name}.acceleration": f"{one.unit}/s^2",
        }
        if one.speed != 0:
            units[f"{one.name}.displacement"] = one.unit
    for contact in model.contacts:
        units |= {f"{contact.name}.slip": "m", f"{contact.name}.slip_rate": "m/s"}
    unit = model.roles["drive.velocity"].unit.removesuffix("/s")
    turning = "rad" if all(one.unit == "rad" for one in model.coordinates) else "m"  # if nothing is pushed
    ways = {LOAD_POINT: unit} | {one.name: one.unit for one in model.coordinates} | dict.fromkeys(model.points, "m")
    units |= {"load_displacement": unit, "load_velocity": f"{unit}/s"}
    for name, (_, kind, on) in acting.named().items():
        turns = kind == "push" and ways.get(on, turning) == "rad"
        units[name] = "1" if kind == "share" else "N m" if turns else "N"
    units |= {name: unit for name, (_, unit) in model.observables.items() if name not in units}
    inner = {symbol for one in model.coordinates if one.inner for symbol in (one.displacement, one.velocity)}
    own = (m for m in model.variables if m.kind not in UNSEEN and m.symbol not in inner)
    return units | {m.name: m.unit for m in own if m.name not in units}


def out_of_range(found: dict[str, Array]) -> Array:
    """True (points,) where any observable is infinite or NaN."""
    first, *others = found.values()
    good: Array = np.isfinite(first)
    for values in others:
        good &= np.isfinite(values)
    return ~good


def _arguments(model: Model) -> dict[sp.Symbol, str]:
    """Symbols from which observables are computed, with their names in results."""
    given: dict[sp.Symbol, str] = {}
    for one in model.coordinates:
        own = f"{one.name}." if model.contacts[0].name else ""
        given |= {one.displacement: f"{own}x", one.velocity: f"{own}v"}
    for contact in model.contacts:
        own = f"{contact.name}." if contact.name else ""
        stresses = (contact.normal, contact.friction, contact.spring)
        given |= {symbol: own + name for symbol, name in zip(stresses, STRESSES, strict=True)}
        if contact.velocity not in given:
            given[contact.velocity] = f"{own}slip_rate"
    if "loading" in model.inputs:
        given[model.inputs["loading"]] = LOADING
    given |= {item.symbol: item.name for item in (*model.memory, *model.states, *model.integrals)}
    if model.letting_go is not None:
        given |= {model.letting_go.free: FREE, model.letting_go.held: HELD}
    given[model.inputs["load_velocity"]] = "load_velocity"
    return given


@cached
def _function(model: Model) -> tuple[list[str], list[str], ArrayFunction]:
    """Names of the computed observables, names of the arguments, and the compiled function that computes them."""
    given = _arguments(model)
    known = set(given.values())
    names = [n for n in model.observables if n not in known]
    return names, list(given.values()), model.function((model.observables[n][0] for n in names), *given)


def observe(
    jobs: Jobs, machine: Runner, first: int, lane: Array, segment: Array, time: Array, points: Array,
    tables: Tables | None = None,
) -> dict[str, Array]:  # fmt: skip
    """All observables (points,), by name, at points of runs.

    Parameters
    ----------
    first : int
        Index of the job of lane 0.
    lane, segment : ndarray of int (points,)
    time : ndarray (points,)
        Time since the start of the run, s.
    points : ndarray (points, 1 + state + further unknowns)
        The first unknown of the algebraic equations, the state, and the further unknowns, as in `Sampled`; unknowns
        are NaN where they are not known.
    tables : tuple of ndarray, optional
        Tables of the jobs from `first` on, if they are already computed.
    """
    reduction = machine.reduction
    model = reduction.model
    last = first + (int(lane.max()) if len(lane) else 0) + 1
    constants, _, settings, segments = tables or jobs.tables(machine, first, last, False, False)
    count = len(model.contacts)
    values = np.empty((len(OBSERVED) * count + len(reduction.continuous) + len(reduction.further), len(time)))
    machine.code.observe(
        constants, settings, segments, np.ascontiguousarray(points), np.ascontiguousarray(lane, dtype=np.int64),
        np.ascontiguousarray(segment, dtype=np.int64), np.ascontiguousarray(time), values,
    )  # fmt: skip
    found = _at_contacts(model, values)
    kept = values[len(OBSERVED) * count :]
    continuous = dict(zip(reduction.continuous, kept, strict=False))
    own = [item for item in model.variables if item.symbol in continuous and item.kind != "velocity"]
    found |= {item.name: continuous[item.symbol] for item in own}
    found |= dict(zip(reduction.further, kept[len(reduction.continuous) :], strict=True))
    inputs = inputs_at(jobs.segments, first + lane, segment, time)
    for name, (channel, _, _) in jobs.targets.named().items():
        found[name] = inputs[:, channel]
    if LOAD_POINT in jobs.targets.pushes:
        found[LOADING] = inputs[:, channels.DISTURBANCE]
    point = jobs.point.part(slice(first, last)).part(lane)
    if reduction.further:
        _add_displacements(model, found, point)
    else:
        found["slip"] = found["x"] + found["load_displacement"]
    if model.letting_go is not None:
        found[FREE] = inputs[:, creep.FREE]
        rate = rates_at(jobs.segments, first + lane, segment, time)[:, creep.LOADING]
        ahead = point.evaluate(_load_point_lead(model), *(found[name] for name in _function(model)[1]), rate)
    names, given, function = _function(model)
    for name, value in zip(names, point.evaluate(function, *(found[n] for n in given)), strict=True):
        found[name] = value if np.shape(value) == time.shape else np.full(time.shape, value, dtype=float)
    if model.letting_go is not None:
        _shift_to_load_point(model, found, point, *ahead)
    return found


@cached
def _load_point_lead(model: Model) -> ArrayFunction:
    """Compiled function: lead of a released drive's load point over steady motion, and its rate (cached)."""
    own = model.letting_go
    if own is None:
        raise InternalError("the drive of this model is never let go; this is a bug, please report it")
    given = _function(model)[1]
    names = {name: symbol for symbol, name in _arguments(model).items()}
    return model.function([own.ahead, own.speed], *(names[name] for name in given), own.loading_rate)


def _shift_to_load_point(
    model: Model, found: dict[str, Array], point: OperatingPoint, ahead: Array, speed: Array
) -> None:
    """Refer displacements to the actual load point, which is ahead of steady motion by `ahead` after a release."""
    found["load_displacement"] = found["load_displacement"] + ahead
    found["load_velocity"] = found["load_velocity"] + speed
    shares = point.evaluate(_shares(model))[len(model.contacts) :]
    for one, share in zip(model.coordinates, shares, strict=True):
        name = f"{one.name}.x" if model.contacts[0].name else "x"
        found[name] = found[name] - share * ahead


def _at_contacts(model: Model, values: Array) -> dict[str, Array]:
    """Outputs of the kernel driver's function `observe`, by name."""
    found: dict[str, Array] = {}
    for i, contact in enumerate(model.contacts):
        seen = dict(zip(OBSERVED, values[len(OBSERVED) * i :], strict=False))
        if not contact.name:
            return seen
        found |= {f"{contact.name}.{name}": seen[name] for name in STRESSES}
        found |= {f"{contact.name}.slip_rate": seen["v"], f"{contact.name}.{WAY}": seen["load_displacement"]}
        found[f"{contact.name}.{LOAD}"] = seen["load_velocity"]
    return found


@cached
def _shares(model: Model) -> ArrayFunction:
    """Compiled function: steady slip rates of contacts, then speeds of coordinates, over drive velocity (cached)."""
    drive = model.steady[model.inputs["load_velocity"]]
    speeds = [model.steady[contact.velocity] for contact in model.contacts]
    return model.function(speed / drive for speed in (*speeds, *(one.speed for one in model.coordinates)))


@cached
def _slips(model: Model) -> ArrayFunction:
    return model.function([c.slip for c in model.contacts], *(one.displacement for one in model.coordinates))


def _add_displacements(model: Model, found: dict[str, Array], point: OperatingPoint) -> None:
    """Add displacements of bodies and contacts since the start: steady motion with the drive plus the deviation."""
    shares = point.evaluate(_shares(model))
    slips, speeds = shares[: len(model.contacts)], shares[len(model.contacts) :]
    places = [found[f"{one.name}.x"] for one in model.coordinates]
    ahead = point.evaluate(_slips(model), *places)
    for contact, x in zip(model.contacts, ahead, strict=True):
        found[f"{contact.name}.slip"] = x + found[f"{contact.name}.{WAY}"]
    found["load_velocity"] = found[f"{model.contacts[0].name}.{LOAD}"] / slips[0]
    found["load_displacement"] = found[f"{model.contacts[0].name}.{WAY}"] / slips[0]
    for one, x, speed in zip(model.coordinates, places, speeds, strict=True):
        if one.speed != 0:
            found[f"{one.name}.displacement"] = x + speed * found["load_displacement"]
