"""From states and times to everything that can be observed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from steadyslip.core.questions import question
from steadyslip.kernels.layout import Sampled
from steadyslip.kernels.runner import Runner
from steadyslip.model import Model
from steadyslip.motion.jobs import Jobs

Array = np.ndarray
Tables = tuple[np.ndarray, ...]
OBSERVED = ("v", "acceleration", "normal_stress", "shear_stress", "spring_stress", "load_velocity", "disturbance",
            "load_displacement")  # fmt: skip
"""What the driver's `observe` gives, in this order."""
EXTRA_UNITS = {"slip": "m", "load_displacement": "m", "acceleration": "m/s^2", "load_velocity": "m/s",
               "disturbance": "Pa"}  # fmt: skip


def observable_units(model: Model) -> dict[str, str]:
    """Names and SI units of everything that a run can show."""
    units = {"x": "m", "v": "m/s"} | EXTRA_UNITS
    units |= {name: unit for name, (_, unit) in model.observables.items()}
    return units | {m.name: m.unit for m in model.variables}


def out_of_range(found: dict[str, Array]) -> Array:
    """Where any observable is infinite or no number."""
    first, *others = found.values()
    good: Array = np.isfinite(first)
    for values in others:
        good &= np.isfinite(values)
    return ~good


@question
def _function(model: Model) -> tuple[list[str], Callable[..., list[Any]]]:
    contact = model.contact
    arguments = [contact.slip, contact.velocity, contact.normal, contact.friction, contact.spring]
    arguments += [item.symbol for item in model.memory]
    names = [n for n in model.observables if n not in ("x", "v", "shear_stress", "normal_stress", "spring_stress")]
    function = model.function((model.observables[n][0] for n in names), *arguments)
    return names, function


def observe(
    jobs: Jobs, machine: Runner, first: int, lane: Array, segment: Array, time: Array, points: Array,
    tables: Tables | None = None,
) -> dict[str, Array]:  # fmt: skip
    """All observables at given points.

    Parameters
    ----------
    first : int
        Job that lane 0 belongs to.
    lane, segment : ndarray of int (points,)
    time : ndarray (points,)
        Since the start of the run.
    points : ndarray (points, 1 + state)
        The unknown of the balance (NaN where it is not known), then the state: see `Sampled`.
    tables : tuple of ndarray, optional
        Those of the jobs from `first` on, if they are at hand.
    """
    reduction = machine.reduction
    model = reduction.model
    last = first + (int(lane.max()) if len(lane) else 0) + 1
    constants, _, settings, segments = tables or jobs.tables(machine, first, last, False, False)
    values = np.empty((len(OBSERVED) + len(reduction.continuous), len(time)))
    machine.code.observe(
        constants, settings, segments, np.ascontiguousarray(points), np.ascontiguousarray(lane, dtype=np.int64),
        np.ascontiguousarray(segment, dtype=np.int64), np.ascontiguousarray(time), values,
    )  # fmt: skip
    found = dict(zip(OBSERVED, values, strict=False))
    found["x"] = points[:, Sampled.STATE]
    continuous = dict(zip(reduction.continuous, values[len(OBSERVED) :], strict=True))
    found |= {item.name: continuous[item.symbol] for item in (*model.memory, *model.integrals)}
    found["slip"] = found["x"] + found["load_displacement"]
    names, function = _function(model)
    point = jobs.point.part(slice(first, last)).part(lane)
    stresses = [found["x"], found["v"], found["normal_stress"], found["shear_stress"], found["spring_stress"]]
    own = [found[item.name] for item in model.memory]
    for name, value in zip(names, point.evaluate(function, *stresses, *own), strict=True):
        found[name] = value if np.shape(value) == time.shape else np.full(time.shape, value, dtype=float)
    return found
