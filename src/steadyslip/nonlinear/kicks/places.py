"""Body or contact of a kick, and its units: the amount of a kick of size 1 at a body, contact or drive."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable, Problem
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.scales import natural_scales
from steadyslip.model.start import coordinate_speeds, slip_rates_at
from steadyslip.model.weights import slip_rates
from steadyslip.motion.jobs import Jobs
from steadyslip.motion.single import areas as areas_of
from steadyslip.motion.status import THROUGH_DASHPOT
from steadyslip.nonlinear.kicks.rest import Rest


def place_problems(rig: Slider | Machine, kick: str, at: str | None) -> list[Problem]:
    """Problems with the body or contact `at` of a kick, as a list for error messages."""
    known = list(rig.contacts) if kick == "normal-force" else list(rig.ends())
    what = "contact" if kick == "normal-force" else "body"
    if at is None:
        if kick in ("velocity", "displacement") or not known:
            return []
        return [Problem("at", f"missing; name the {what} that a {kick} kick acts at: {', '.join(known)}")]
    if problems := rig.place_problems("at", at, known, what):
        return problems
    if at not in rig.bodies:  # a contact, or a point of a structure
        if kick != "displacement":
            return []
        message = f"{at!r} is a point of a structure, which can be displaced in many ways; allowed: another kick there"
        return [Problem("at", message)]
    if kick == "impulse" and not rig.bodies[at].inertia_of():
        return [Problem("at", f"an impulse needs a mass, and {at!r} has none; allowed: a displacement or force kick")]
    if kick == "velocity" and not rig.bodies[at].inertia_of():
        return [Problem("at", f"{at!r} has no mass, and its velocity follows from the forces; give it another kick")]
    return []


def refuse_jump(rig: Slider | Machine) -> None:
    """Raise NotAvailable if a step of the load point would need an infinite force (dashpot) or would move nothing."""
    if rig.bodies and not any(LOAD_POINT in e.senses for e in rig.mechanism().elements):
        raise NotAvailable(
            "a displacement step of the drive moves nothing where no link is between the drive and a body, only the "
            "surface beneath one; kick a body instead, with at='NAME' (--at NAME; --kick 'displacement at NAME' of "
            "analyze), or by another kick"
        )
    if rig.bodies and any(e.damping and LOAD_POINT in e.senses for e in rig.mechanism().elements):
        raise NotAvailable(
            f"a displacement step of the drive {THROUGH_DASHPOT}; kick a body instead, with at='NAME' (--at NAME; "
            "--kick 'displacement at NAME' of analyze), or by another kick"
        )


def size_units(jobs: Jobs, rest: Rest, kick: str, at: str) -> tuple[str, Array, Array]:
    """SI unit of a kick, amount of a kick of size 1, and change of velocity by a blow of size 1 (0 for other kicks)."""
    model, point, none = jobs.point.model, jobs.point, np.zeros(1)
    if not rest.is_machine:
        drive = np.abs(np.asarray(point.drive, dtype=float))
        found = {
            "velocity": ("m/s", drive), "displacement": ("m", rest.natural_slip),
            "normal-stress": ("Pa", point.stresses),
            "impulse": ("Pa s", np.asarray(point.named().get("slider.mass", 0.0)) * drive),
        }  # fmt: skip
        return *found[kick], drive
    if kick == "normal-force":
        index = [one.name for one in model.contacts].index(at)
        area = np.asarray(point.evaluate(areas_of(model))[index], dtype=float)
        return "N", area * np.asarray(point.sigmas[index], dtype=float), none
    if not at:
        unit = model.roles["drive.velocity"].unit
        if kick == "velocity":
            return unit, np.abs(np.asarray(point.drive, dtype=float)), none
        return unit.removesuffix("/s"), rest.natural_slip, none
    if at in model.points:
        speed = np.abs(np.asarray(slip_rates(point)[0], dtype=float))
        if kick == "force":
            return "N", _largest_force(point, model), none
        return ("m/s", speed, speed) if kick == "velocity" else ("N s", _point_mass(point, model, at) * speed, speed)
    body = next(one for one in model.coordinates if one.name == at)
    scales, _ = natural_scales(point, jobs.reduction)
    turns = body.unit == "rad"
    speed = np.abs(np.asarray(scales[f"{at}.v"], dtype=float))
    if kick == "displacement":
        return body.unit, np.asarray(scales[f"{at}.x"], dtype=float), none
    if kick == "velocity":
        return f"{body.unit}/s", speed, speed
    if kick == "impulse":
        return (
            "N m s" if turns else "N s",
            np.asarray(point.evaluate(_inertias(model))[_place(model, at)]) * speed,
            speed,
        )
    return "N m" if turns else "N", _force(point, model, at), none


def _normal_forces(point: OperatingPoint, model: Model) -> list[Array]:
    """Steady normal force (N) of each contact."""
    areas = point.evaluate(areas_of(model))
    return [area * np.asarray(sigma, dtype=float) for area, sigma in zip(areas, point.sigmas, strict=True)]


def _largest_force(point: OperatingPoint, model: Model) -> Array:
    found: Array = np.maximum.reduce(np.broadcast_arrays(*_normal_forces(point, model)))
    return found


def _force(point: OperatingPoint, model: Model, at: str) -> Array:
    """Largest steady normal force times lever of the contacts of a body (N, for rotations N m)."""
    numbers = [np.asarray(one, dtype=float) for one in point.evaluate(_levers(model, at))]
    forces = [np.abs(lever) * force for lever, force in zip(numbers, _normal_forces(point, model), strict=True)]
    largest: Array = np.maximum.reduce(np.broadcast_arrays(*forces))
    return np.asarray(np.where(largest > 0, largest, _largest_force(point, model)))


def steady_speeds(point: OperatingPoint, at: str) -> Any:
    """Velocity of a body in steady sliding, m/s (rad/s for a rotation)."""
    return point.evaluate(coordinate_speeds(point.model))[_place(point.model, at)]


def struck(point: OperatingPoint, at: str, change: Any) -> dict[str, Any]:
    """Velocities after a blow (m/s, rad/s) by names of variables; `change` is that of the velocity at `at`.

    A blow at a point of a structure changes all of the structure's coordinates.
    """
    model = point.model
    moved = _share_of_blow(model, at) if at in model.points else {at: 1.0}
    speeds = point.evaluate(coordinate_speeds(model))
    return {
        f"{one.name}.v": np.asarray(speed, dtype=float) + moved[one.name] * change
        for one, speed in zip(model.coordinates, speeds, strict=True)
        if one.name in moved
    }


def largest_blow(jobs: Jobs, at: str, change: Array) -> float:
    """Size of a blow that stops a contact whose law is for forward slip only; `change`: velocity change at size 1.

    Infinite where the blow stops no contact with such a law, because it accelerates contacts, or because their laws
    allow slip both ways.
    """
    model, point, found = jobs.point.model, jobs.point, math.inf
    if not at:  # the block of a slider
        return 1.0 if np.any(change < 0) and jobs.reduction.slidings[0].one_way else found
    steady = [np.asarray(one, dtype=float) for one in point.evaluate(coordinate_speeds(model))]
    names = [one.name for one in model.coordinates]
    after = struck(point, at, change)
    speeds = [after.get(f"{name}.v", speed) for name, speed in zip(names, steady, strict=True)]
    before, later = point.evaluate(slip_rates_at(model), *steady), point.evaluate(slip_rates_at(model), *speeds)
    for sliding, slip, then in zip(jobs.reduction.slidings, before, later, strict=True):
        if sliding.one_way:
            lost = np.maximum(np.asarray(slip, dtype=float) - then, 0.0)
            with np.errstate(divide="ignore"):
                found = min(found, float(np.nanmin(np.append(slip / lost, math.inf))))  # rigs that do not slide: NaN
    return found


def _share_of_blow(model: Model, at: str) -> dict[str, float]:
    """Change of velocity of each coordinate by a blow that changes the velocity of point `at` by 1.

    The coordinates of a structure have equal inertias.
    """
    row = {name: float(share) for name, share in model.points[at].items()}
    size = sum(share**2 for share in row.values())
    return {name: share / size for name, share in row.items()}


def _point_mass(point: OperatingPoint, model: Model, at: str) -> Array:
    """Effective mass (kg) of a point of a structure: impulse of a blow over the change of the point's velocity."""
    size = sum(float(share) ** 2 for share in model.points[at].values())
    inertia = point.evaluate(_inertias(model))[_place(model, next(iter(model.points[at])))]
    return np.asarray(inertia, dtype=float) / size


def _place(model: Model, at: str) -> int:
    return [one.name for one in model.coordinates].index(at)


@cached
def _inertias(model: Model) -> ArrayFunction:
    return model.function(one.inertia for one in model.coordinates)


@cached
def _levers(model: Model, at: str) -> ArrayFunction:
    """Compiled function that returns the slip rate of each contact per velocity of a body that moves alone.

    If it slips at no contact when it moves alone, all bodies move.
    """
    body = model.coordinates[_place(model, at)]
    found = []
    for contact in model.contacts:
        slip = sp.sympify(model.definitions.get(contact.velocity, contact.velocity))
        alone = derivative(slip, body.velocity)
        together = sp.sympify(model.steady[contact.velocity]) / body.speed if body.speed != 0 else sp.Integer(0)
        found.append(alone if alone != 0 else together)
    return model.function(found)
