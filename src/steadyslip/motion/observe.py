"""From states and times to everything that can be observed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from steadyslip.core.questions import question
from steadyslip.kernels.program import Program
from steadyslip.model import Model
from steadyslip.motion.jobs import Jobs
from steadyslip.protocol.inputs import input_slopes, inputs_at, load_displacement

Array = np.ndarray
EXTRA_UNITS = {"slip": "m", "load_displacement": "m", "acceleration": "m/s^2", "load_velocity": "m/s",
               "disturbance": "Pa"}  # fmt: skip


def observable_units(model: Model) -> dict[str, str]:
    """Names and SI units of everything that a run can show."""
    units = {"x": "m", "v": "m/s"} | EXTRA_UNITS
    units |= {name: unit for name, (_, unit) in model.observables.items()}
    return units | {m.name: m.unit for m in model.variables}


def out_of_range(found: dict[str, Array]) -> Array:
    """Where any observable is infinite or no number."""
    bad: Array = ~np.logical_and.reduce([np.isfinite(values) for values in found.values()])
    return bad


@question
def _function(model: Model) -> tuple[list[str], Callable[..., list[Any]]]:
    contact = model.contact
    arguments = [contact.slip, contact.velocity, contact.normal, contact.friction, contact.spring]
    arguments += [item.symbol for item in model.memory]
    names = [n for n in model.observables if n not in ("x", "v", "shear_stress", "normal_stress", "spring_stress")]
    function = model.function((model.observables[n][0] for n in names), *arguments)
    return names, function


def observe(
    jobs: Jobs, machine: Program, first: int, lane: Array, segment: Array, time: Array, states: Array
) -> dict[str, Array]:
    """All observables at given states.

    Parameters
    ----------
    first : int
        Job that lane 0 belongs to.
    lane, segment : ndarray of int (points,)
    time : ndarray (points,)
        Since the start of the run.
    states : ndarray (points, state)
    """
    reduction = machine.reduction
    model = reduction.model
    last = first + (int(lane.max()) if len(lane) else 0) + 1
    constants, _, settings, _ = jobs.tables(machine, first, last, False, False)
    where = jobs.segments, first + lane, segment, time
    inputs = np.column_stack([inputs_at(*where), input_slopes(*where), time])
    values = np.empty((len(time), 5 + len(reduction.continuous)))
    machine.code.observe(constants, settings, np.ascontiguousarray(states), inputs, lane.astype(np.int64), values)
    found = dict(zip(("v", "acceleration", "normal_stress", "shear_stress", "spring_stress"), values.T, strict=False))
    found["x"] = states[:, 0]
    continuous = dict(zip(reduction.continuous, values.T[5:], strict=True))
    found |= {item.name: continuous[item.symbol] for item in (*model.memory, *model.integrals)}
    found["load_velocity"], found["disturbance"] = inputs[:, 0], inputs[:, 1]
    found["load_displacement"] = load_displacement(*where)
    found["slip"] = found["x"] + found["load_displacement"]
    names, function = _function(model)
    point = jobs.point.part(slice(first, last)).part(lane)
    stresses = [found["x"], found["v"], found["normal_stress"], found["shear_stress"], found["spring_stress"]]
    own = [found[item.name] for item in model.memory]
    with np.errstate(all="ignore"):
        for name, value in zip(names, point.evaluate(function, *stresses, *own), strict=True):
            found[name] = np.broadcast_to(value, time.shape).astype(float)
    return found
