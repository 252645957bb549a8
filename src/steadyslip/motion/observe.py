"""From states and times to everything that can be observed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from steadyslip.core.questions import question
from steadyslip.kernels.program import Program
from steadyslip.model import Model
from steadyslip.motion.jobs import Jobs
from steadyslip.protocol import Segments

Array = np.ndarray
EXTRA_UNITS = {"slip": "m", "load_displacement": "m", "acceleration": "m/s^2", "load_velocity": "m/s",
               "disturbance": "Pa"}  # fmt: skip


def observable_units(model: Model) -> dict[str, str]:
    """Names and SI units of everything that a run can show."""
    units = {"x": "m", "v": "m/s"} | EXTRA_UNITS
    units |= {name: unit for name, (_, unit) in model.observables.items()}
    return units | {m.name: m.unit for m in model.variables}


def segment_of(segments: Segments, lane: Array, time: Array) -> Array:
    """Index of the segment at each time, the later one at a breakpoint."""
    if len(segments.start) == 1:
        index = np.searchsorted(segments.start[0], time, side="right") - 1
    else:
        index = np.sum(segments.start[lane] <= time[:, None], axis=1) - 1
    real = np.sum(segments.start < segments.end, axis=1)
    last = real[lane if len(real) > 1 else np.zeros_like(lane)] - 1
    return np.clip(index, 0, last)


def inputs_at(segments: Segments, lane: Array, segment: Array, time: Array) -> Array:
    """v_lp, q, p, their slopes, and the time, as kernels read them: (points, 7)."""
    where = (lane if len(segments.start) > 1 else np.zeros_like(lane), segment)
    since = (time - segments.start[where])[:, None]
    angle = segments.angular_frequency[where] * since[..., None] + segments.phase[where]
    amplitude = segments.amplitude[where]
    value = segments.value[where] + segments.slope[where] * since + (amplitude * np.sin(angle)).sum(axis=-1)
    rate = segments.angular_frequency[where] * amplitude
    slope = segments.slope[where] + (rate * np.cos(angle)).sum(axis=-1)
    return np.column_stack([value, slope, time])


def load_displacement(segments: Segments, lane: Array, segment: Array, time: Array) -> Array:
    """Distance that the load point has moved since the start, jumps included."""
    where = (lane if len(segments.start) > 1 else np.zeros_like(lane), segment)
    whole = _advance(segments, (slice(None), slice(None)), segments.end)
    before = np.cumsum(segments.jump, axis=1) + np.cumsum(whole, axis=1) - whole
    moved: Array = before[where] + _advance(segments, where, time)
    return moved


def _advance(segments: Segments, where: Any, until: Array) -> Array:
    since = until - segments.start[where]
    moved: Array = segments.value[where][..., 0] * since + 0.5 * segments.slope[where][..., 0] * since**2
    omega, phase = segments.angular_frequency[where][..., 0, :], segments.phase[where][..., 0, :]
    with np.errstate(all="ignore"):
        wave = segments.amplitude[where][..., 0, :] / omega * (np.cos(phase) - np.cos(omega * since[..., None] + phase))
    moved = moved + np.where(omega != 0, wave, 0.0).sum(axis=-1)
    return moved


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
    inputs = inputs_at(jobs.segments, first + lane, segment, time)
    values = np.empty((len(time), 5 + len(reduction.continuous)))
    machine.code.observe(constants, settings, np.ascontiguousarray(states), inputs, lane.astype(np.int64), values)
    found = dict(zip(("v", "acceleration", "normal_stress", "shear_stress", "spring_stress"), values.T, strict=False))
    found["x"] = states[:, 0]
    continuous = {str(s): values[:, 5 + i] for i, s in enumerate(reduction.continuous)}
    found |= {item.name: continuous[str(item.symbol)] for item in (*model.memory, *model.integrals)}
    found["load_velocity"], found["disturbance"] = inputs[:, 0], inputs[:, 1]
    found["load_displacement"] = load_displacement(jobs.segments, first + lane, segment, time)
    found["slip"] = found["x"] + found["load_displacement"]
    names, function = _function(model)
    point = jobs.point.part(slice(first, last)).part(lane)
    stresses = [found["x"], found["v"], found["normal_stress"], found["shear_stress"], found["spring_stress"]]
    own = [found[item.name] for item in model.memory]
    with np.errstate(all="ignore"):
        for name, value in zip(names, point.evaluate(function, *stresses, *own), strict=True):
            found[name] = np.broadcast_to(value, time.shape).astype(float)
    return found
