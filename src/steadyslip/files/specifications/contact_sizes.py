"""Warnings of implausible sizes at contacts: loads, bristles, Stribeck velocities, viscosity, radii.

Each warning compares a value with other values of the file, by a bound of physics or by measured ranges.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from steadyslip.core.dimensions import unit
from steadyslip.core.format import format_quantity
from steadyslip.files.specifications.held_bodies import HeldBody, friction_at_rest, is_of_forces, mass_at, mass_on
from steadyslip.files.specifications.other_units import (
    UNITS,
    Read,
    SizeWarning,
    between,
    hint,
    in_units,
    named,
    number_of,
    texts_in_units,
    times,
    written,
)
from steadyslip.machine.rig import Rig

G = 9.81  # m/s^2
LIGHT = 0.01  # least plausible load as share of the body's weight: hanging and floating bodies have some 1 %
OTHER_LOAD = 100.0  # largest ratio, either way, of the load given with a bristle stiffness to the contact's load
THIN, THICK = 1e-8, 1e-3  # m: plausible bends of bristles at slip; measured bends are 0.1 um to 0.1 mm, more for rubber
TURNED = 1.0  # rad: largest plausible bend of bristles on a turning body, such as a motor in front of its gear
OVERDAMPED = 3.0  # largest plausible damping over the critical damping of a mass on its bristles; published: 0.1 to 1
UNCHANGED = 1e3  # ratio of Stribeck velocity to sliding speed above which friction is nearly static friction
SLOW_LAW = 1e-6  # m/s: least plausible Stribeck velocity; measured Stribeck velocities are 0.1 mm/s to 1 m/s
FASTEST = 300.0  # m/s: largest plausible speed of a contact that slides for long
WIDE = 100.0  # largest plausible radius of a contact over that of a steel ball of equal inertia; light rims: some 10


def contact_warnings(rig: Rig, read: Read, bodies: Mapping[str, HeldBody]) -> Iterator[SizeWarning]:
    """Warnings of sizes at the contacts of a rig whose loads are known as forces, at most one for each parameter.

    The loads are known if the rig is given in forces, or in stresses with an area.
    """
    light = list(_light(rig, read))
    yield from light
    if not light:
        yield from _bristles(rig, read)
    yield from _bristle_damping(rig, read, bodies)
    if fast := list(_too_fast(rig, read)):
        yield from fast
    else:
        yield from _unchanged(rig, read)
    yield from _viscous(rig, read)
    yield from _radii(rig, read, bodies)


def _light(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warnings of loads that are written with a unit and are far less than the weight of the sliding body."""
    for name in rig.of_kind("normal stress"):
        load, weight = rig.load_of(name), G * mass_on(rig, name)
        if not isinstance(read.get(name, (None, ""))[0], str) or is_of_forces(rig, name):
            continue
        if load and load < LIGHT * weight:
            mass = texts_in_units(read, mass_at(rig, name), "kg", between(load / (100 * G), load / (0.1 * G)))
            meant = named(name, texts_in_units(read, name, "N", between(0.1 * weight, 100 * weight)))
            meant += named("mass", mass)
            text = f"{written(read, name)} is {times(load / weight)} the weight of what slides there, "
            yield name, f"{text}{format_quantity(weight, 'N')}: {hint(meant)}"


def _bristles(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warnings of bristle stiffnesses given at a load far from the contact's, or with bends far from measured ones."""
    for name in rig.of_kind("bristle stiffness"):
        raw, load, value = read.get(name, (None, ""))[0], rig.load_of(name), rig.value(name)
        if not isinstance(raw, str) or is_of_forces(rig, name) or not (load and value):
            continue
        force, _, of = raw.partition(" at ")
        of_load, at_rest = number_of(of, "N"), friction_at_rest(rig, name)
        if of_load and not 1 / OTHER_LOAD < of_load / load < OTHER_LOAD:
            own = next(one for one in rig.of_kind("normal stress") if one.startswith(name.split("friction")[0]))
            meant = named(own, texts_in_units(read, own, "N", between(0.1 * of_load, 10 * of_load)))
            meant += [f"{force} at {text}" for _, text in in_units(of, "N", between(0.1 * load, 10 * load))]
            text = f"{name} = {raw} is of a load {times(of_load / load)} that of its contact, "
            yield name, f"{text}{format_quantity(load, 'N')}: {hint(meant)}"
        elif at_rest and not _bends_well(rig, name, at_rest / value):
            meant = []
            if of_load:
                found = in_units(force, "N/m", between(at_rest * load / (THICK / 5), at_rest * load / (10 * THIN)))
                meant = [f"{text} at {of}" for _, text in found]
            bend = format_quantity(at_rest / value, "m")
            text = f"{name} = {raw}: friction bends such bristles by {bend} before they slip; measured are 0.1 um to "
            yield name, f"{text}0.1 mm: {hint(meant)}"


def _bends_well(rig: Rig, name: str, bend: float) -> bool:
    """True if the bend (m) that bristles reach before they slip is within the plausible range."""
    radius = rig.contacts[name.split(".")[1]].radius if rig.contacts else None
    return THIN <= bend <= (TURNED * radius if radius else THICK)


def _unchanged(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warnings of Stribeck velocities that are far above the sliding speed, or below all measured velocities."""
    for prefix, *_ in rig.laws_by_contact().values():
        kinds = _kinds(rig, prefix)
        name = kinds.get("velocity scale", "")
        if "exponent" not in kinds or name not in read or not (scale := rig.value(name)):
            continue
        speed = _slip_speed(rig, prefix)
        near = speed or math.sqrt(SLOW_LAW)  # m/s: middle of the measured range
        meant = texts_in_units(read, name, "m/s", between(max(10 * SLOW_LAW, near / 10), UNCHANGED * near))
        if scale < SLOW_LAW:
            yield name, f"{written(read, name)} is far below all that were measured, 0.1 mm/s to 1 m/s: {hint(meant)}"
        elif speed and scale > UNCHANGED * speed:
            text = f"{written(read, name)} is {times(scale / speed)} the speed of sliding, "
            text += f"{format_quantity(speed, 'm/s')}, at which friction is still that at rest: "
            if not meant and not rig.contacts:
                slow = texts_in_units(read, "drive.velocity", "m/s", between(scale / UNCHANGED, 10 * scale))
                meant = named("velocity", slow)
            yield name, text + hint(meant)


def _kinds(rig: Rig, prefix: str) -> dict[str, str]:
    """Names of the parameters of the friction law at a contact, by kind."""
    law = f"{prefix}friction."
    return {one.role.kind: name for name, one in rig.parameters().items() if name.startswith(law)}


def _viscous(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warnings of viscous friction so large that it hides the Stribeck curve."""
    for prefix, *_ in rig.laws_by_contact().values():
        kinds = _kinds(rig, prefix)
        name, scale = kinds.get("viscosity", ""), kinds.get("velocity scale", "")
        if "exponent" not in kinds or name not in read or is_of_forces(rig, name):
            continue
        at_rest, viscosity, speed = friction_at_rest(rig, name), rig.value(name) or 0.0, rig.value(scale) or 0.0
        if viscosity * speed > at_rest > 0:
            text = f"{written(read, name)} makes {viscosity * speed:.2g} of viscous friction at the Stribeck velocity, "
            text += f"more than friction at rest, {at_rest:.2g}, so that friction hardly falls: "
            load = rig.load_of(name) or 1.0
            meant = _per_load(read, name, "N s/m", load, between(0.0, 0.1 * at_rest / speed))
            yield name, text + hint(meant)


def _per_load(read: Read, name: str, si: str, load: float, fits: Callable[[float], bool]) -> list[str]:
    """Texts of other values that may be meant by a value per load, which `fits` accepts.

    A value written with a unit gets other units; a number without a unit is taken as the total at the load (N).
    """
    raw = read[name][0]
    if isinstance(raw, str):
        total, at, of = raw.partition(" at ")
        at_load = number_of(of, "N") or load
        return [f"{text}{at}{of}" for _, text in in_units(total, si, lambda c: fits(c / at_load))] if at else []
    totals = [(raw * unit(one)[0], one) for one in UNITS[si]]
    return [f"{raw:g} {one} at {format_quantity(load, 'N')}" for value, one in totals if fits(value / load)]


def _bristle_damping(rig: Rig, read: Read, bodies: Mapping[str, HeldBody]) -> Iterator[SizeWarning]:
    """Warnings of bristles damped so strongly that a mass cannot oscillate on them."""
    body, kinds = bodies.get("slider"), _kinds(rig, "")
    name, bristles = kinds.get("bristle damping", ""), kinds.get("bristle stiffness", "")
    load = rig.load_of(name) if name else None
    if body is None or name not in read or not (load and body.inertia) or is_of_forces(rig, name):
        return
    critical = 2 * math.sqrt((rig.value(bristles) or 0.0) / load * body.inertia)  # s/m
    if (rig.value(name) or 0.0) > OVERDAMPED * critical:
        text = f"{written(read, name)} is {times((rig.value(name) or 0.0) / critical)} the critical damping of "
        text += f"{body.text} on its bristles; published are 0.1 to 1: "
        yield name, text + hint(_per_load(read, name, "N s/m", load, between(0.0, critical)))


def _too_fast(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warning of a drive speed at which a contact slides faster than `FASTEST`."""
    for prefix, *_ in rig.laws_by_contact().values():
        if (speed := _slip_speed(rig, prefix)) > FASTEST:
            text = f"{written(read, 'drive.velocity')} makes {prefix.rstrip('.') or 'the slider'} slide at "
            meant = texts_in_units(read, "drive.velocity", "m/s", lambda v: v < FASTEST / 3)
            yield "drive.velocity", f"{text}{format_quantity(speed, 'm/s')}: {hint(meant)}"
            return


def _radii(rig: Rig, read: Read, bodies: Mapping[str, HeldBody]) -> Iterator[SizeWarning]:
    """Warnings of contact radii far larger than the turning body; a radius of 1 m counts as unknown and is skipped."""
    for name, surface in rig.contacts.items():
        body, radius, key = bodies.get(surface.held), surface.radius, f"contacts.{name}.radius"
        if body is None or not radius or not body.inertia or radius == 1.0 or key not in read:
            continue
        if radius > WIDE * body.ball:
            meant = texts_in_units(read, key, "m", between(0.1 * body.ball, 5 * body.ball))
            text = f"{written(read, key)} is {times(radius / body.ball)} the radius of a steel ball with the inertia "
            yield key, text + f"of {body.name}, {body.text}: {hint(meant)}"


def _slip_speed(rig: Rig, prefix: str) -> float:
    """Speed (m/s) of steady sliding at a contact; 0 if the drive holds a position or the speed is not known."""
    if rig.holds:
        return 0.0
    if not rig.contacts:
        return abs(float(rig.drive.velocity))
    surface = rig.contacts[prefix.split(".")[1]]
    return abs(float(rig.speeds().get(surface.held, 0.0))) * (surface.radius or 1.0)
