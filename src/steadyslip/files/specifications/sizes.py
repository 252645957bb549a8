"""Warnings of sizes that no machine has, with or without a unit: springs, masses, dampings, gains, gears.

Each compares a value with other values of the file, by a bound of physics or by what is built.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

from steadyslip.core.format import format_quantity
from steadyslip.core.roles import Placeholder
from steadyslip.files.specifications.contact_sizes import LIGHT, G, contact_warnings
from steadyslip.files.specifications.held_bodies import HeldBody, HoldingSpring, bodies_of, springs_of
from steadyslip.files.specifications.other_units import (
    Read,
    SizeWarning,
    between,
    hint,
    in_units,
    named,
    texts_in_units,
    times,
    written,
)
from steadyslip.machine.rig import Rig

SLOWEST = 0.05  # Hz, lowest plausible natural frequency: long drill strings have 0.2 Hz, base isolation 0.3 Hz
USUAL = 20.0  # Hz, usual natural frequency of a drive: units that lead nearest to it are suggested
LONG, TWIST, WAIT = 0.01, 0.3, 1000.0  # m, rad, s: largest plausible deflections of a drive, and time, before sliding
SAG = 0.5  # rad, largest plausible sag under a constant torque: arms on springs sag by 0.2 to 0.3 rad on purpose
STEEL = 10.0  # a real assembly of parts is softer than a block of steel by at least this factor
OVERDAMPED, DAMPED = 1.0, 0.2  # damping ratios: implausible above, usual below; shafts and guides have 0.01 to 0.2
FAST_GAINS = 3e3  # Hz, largest plausible frequency of a body on a position gain: ten times the bandwidth of drives
OVERDAMPED_GAIN = 50.0  # largest plausible damping ratio of gain kd: a load on a motor needs some 10 times the motor's
LATE = 0.5  # largest sample time or delay over the period of the body on gain kp (Nyquist)
UNLIKE = 500.0  # implausible ratio of a motor's inertia, seen through its gear, to its load's: light arms have 100
GEARED_UP = 10.0  # implausible number of turns of a heavier body per turn of its motor


def size_warnings(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warnings of implausible sizes of a rig, at most one for each parameter.

    A rig given in stresses without an area, or with values to be fitted, gets only the warning of a missing gain.

    Parameters
    ----------
    rig : Slider or Machine
    read : mapping of str to (object, str)
        Values by dotted name: as written in the file, and their SI unit.
    """
    yield from _gainless(rig, read)
    if not (rig.in_forces or rig.area is not None) or any(isinstance(raw, Placeholder) for raw, _ in read.values()):
        return
    bodies = bodies_of(rig)
    springs = springs_of(rig, bodies)
    if geared := list(_geared_up(rig, bodies)):
        yield from geared
        return  # with a reversed gear, springs and speeds are wrong as well
    held = [*_stiff(rig, springs, read), *_soft(rig, springs, bodies, read), *_unlike(read, springs)]
    yield from dict(held).items()
    if not held:
        yield from _damped(rig, read, springs)
    yield from contact_warnings(rig, read, bodies)
    yield from _controlled(rig, read, bodies)
    yield from _massless(rig, read)


def _gainless(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warning of a slider's controller without any gain."""
    gains = [name for name in ("drive.kp", "drive.kd", "drive.ki") if name in rig.parameters()]
    if gains and not any(name in read for name in gains):
        *keys, last = (name.partition(".")[2] for name in gains)
        text = f"give {', '.join(keys)} or {last}, or write control = 'steady'"
        yield "drive.control", f"the controller has no gain and does nothing: {text}"


def _stiff(rig: Rig, springs: Mapping[str, HoldingSpring], read: Read) -> Iterator[SizeWarning]:
    """Warnings of springs stiffer than a block of steel with the heavier body's mass or inertia."""
    for name, spring in springs.items():
        body, stiffness = spring.heavier
        if body.inertia and stiffness > body.block:
            made = "cylinder of steel as thick as long, of the inertia" if body.turns else "cube of steel of the mass"
            text = f"{written(read, name)} is {times(stiffness / body.block)} the stiffness of a {made} of "
            meant = hint(_springs_meant(read, name, spring))
            rigid = ', or stiffness = "rigid"' if rig.links and "is " not in meant else ""
            yield name, f"{text}{body.name}, {body.text}: {meant}{rigid}"


def _soft(
    rig: Rig, springs: Mapping[str, HoldingSpring], bodies: Mapping[str, HeldBody], read: Read
) -> Iterator[SizeWarning]:
    """Warnings that name the stiffest spring of a body, if all its springs together are too soft for the body."""
    for body in bodies.values():
        name = max(body.springs, key=lambda one: body.springs[one], default="")
        if name not in read:
            continue
        spring, stiffness = springs[name], sum(body.springs.values())
        if why := _why_soft(spring, body, stiffness):
            meant = _springs_meant(read, name, spring)
            meant += _loads_meant(rig, read, spring, body) if body.load or not meant else []
            yield name, f"{written(read, name)}, {why}: {hint(meant)}"


def _loads_meant(rig: Rig, read: Read, spring: HoldingSpring, body: HeldBody) -> list[str]:
    """Texts of the loads on contacts and body in other units, in which they stretch the spring plausibly."""
    found, stiffness = [], sum(body.springs.values())

    def fits(load: float, of: float) -> bool:
        return not _why_soft(spring, body._replace(pull=body.pull * load / of), stiffness)

    for name in rig.of_kind("normal stress"):
        if load := rig.load_of(name):
            found += named(name, texts_in_units(read, name, "N", partial(fits, of=load)))
    name, si = f"bodies.{body.name}.{'torque' if body.turns else 'force'}", "N m" if body.turns else "N"
    smaller = between(0.0, 0.1 * SAG * stiffness if body.turns else LONG * stiffness)
    return found + named(name, texts_in_units(read, name, si, lambda load: smaller(abs(load))))


def _why_soft(spring: HoldingSpring, body: HeldBody, stiffness: float) -> str:
    """Clause on why a stiffness (N/m or N m/rad) is too small for a body; empty if it is plausible."""
    stretch = (body.pull + body.load) / stiffness
    if body.turns and body.load / stiffness > SAG:
        return f"which the constant torque on {body.name} alone twists by {format_quantity(stretch, 'rad')}"
    far, si, does = (TWIST, "rad", "twisted") if body.turns else (LONG, "m", "stretched")
    if body.speed and stretch > far and stretch / body.speed > WAIT:
        wait, way = format_quantity(stretch / body.speed, "s"), format_quantity(stretch, si)
        return f"which is {does} by {way} before {body.name} slides, and that takes {wait}"
    if spring.frequency < SLOWEST:
        return f"on which {body.name}, {body.text}, swings once in {format_quantity(1 / spring.frequency, 's')}"
    return ""


def _springs_meant(read: Read, name: str, spring: HoldingSpring) -> list[str]:
    """Texts of a stiffness in up to two other units whose frequency is nearest to `USUAL`, or at the other body."""

    def fits(stiffness: float) -> bool:
        one = spring._replace(stiffness=stiffness)
        body, at_it = one.heavier
        soft = any(_why_soft(one, end, at_end) for end, at_end in one.ends)
        return at_it < body.block / STEEL and one.frequency > 10 * SLOWEST and not soft

    def away(one: tuple[float, str]) -> float:
        return abs(math.log(spring._replace(stiffness=one[0]).frequency / USUAL))

    si = "N m/rad" if spring.heavier[0].turns else "N/m"
    found = sorted(in_units(read.get(name, (None, ""))[0], si, fits), key=away)[:2]
    at_second = spring.stiffness / spring.ratio**2
    if spring.first.turns and spring.ratio * GEARED_UP <= 1 and fits(at_second):
        found.append((at_second, f"{at_second:.4g} {si} at {spring.second.name}"))
    return [text for _, text in found]


def _geared_up(rig: Rig, bodies: Mapping[str, HeldBody]) -> Iterator[SizeWarning]:
    """Warning of a body that turns much faster than its motor, though it has more inertia."""
    motor = bodies.get(rig.drive.driven() or "") if rig.links else None
    if motor is None or not motor.turns:
        return
    for name, link in rig.links.items():
        (first, second), ratio = link.between, float(link.ratio())
        one = bodies.get(first)
        if second != motor.name or one is None or not one.turns or ratio * GEARED_UP >= 1:
            continue
        if one.inertia > motor.inertia:
            text = f'links.{name}.between = ["{first}", "{second}"]: {first}, {one.text}, turns {times(1 / ratio)} as '
            text += f"fast as {second}, {motor.text}, which the drive turns; a reduction is "
            yield f"links.{name}.between", f'{text}between = ["{second}", "{first}"]'


def _unlike(read: Read, springs: Mapping[str, HoldingSpring]) -> Iterator[SizeWarning]:
    """Warnings of turning bodies with far less inertia than their motor, seen through the gear."""
    for key, (_, ratio, first, second) in springs.items():
        if not (first.turns and second.turns and second.inertia > 0 and 0 < first.inertia < math.inf and ratio < 1):
            continue
        seen = first.inertia / ratio**2
        if seen > UNLIKE * second.inertia:
            name, other = f"bodies.{second.name}.inertia", f"bodies.{first.name}.inertia"
            light = between(1e-3 * second.inertia * ratio**2, 100 * second.inertia * ratio**2)
            heavier = texts_in_units(read, name, "kg m^2", between(seen / 100, 1e3 * seen))
            meant = [f"{second.name}: {text}" for text in heavier]
            meant += [f"{first.name}: {text}" for text in texts_in_units(read, other, "kg m^2", light)]
            text = f"{written(read, name)} is turned by {first.name}, {first.text}, which through {key.split('.')[1]} "
            yield name, f"{text}has {times(seen / second.inertia)} that inertia: {hint(meant)}"


def _damped(rig: Rig, read: Read, springs: Mapping[str, HoldingSpring]) -> Iterator[SizeWarning]:
    """Warnings of links damped beyond critical damping, so that bodies on them do not oscillate."""
    for key, spring in springs.items():
        name, stiffness, (body, at_body) = f"{key.rpartition('.')[0]}.damping", spring.stiffness, spring.heavier
        if name not in read or not 0 < body.inertia < math.inf:
            continue
        damping = (rig.value(name) or 0.0) * (rig.area or 1.0)
        inertia = body.inertia * stiffness / at_body  # inertia referred to the end at which the stiffness is given
        critical = 2 * math.sqrt(inertia * stiffness)
        if damping > OVERDAMPED * critical:
            si, of = ("N m/rad", "N m s/rad") if body.turns else ("N/m", "N s/m")
            least = (damping / (2 * DAMPED)) ** 2  # least stiffness times inertia for a plausible damping ratio
            meant = named(key, texts_in_units(read, key, si, between(least / inertia, body.block / STEEL)))
            if not rig.bodies:
                heaviest = (rig.load_of("friction.any") or math.inf) / (G * LIGHT)
                masses = texts_in_units(read, "slider.mass", "kg", between(least / stiffness, heaviest))
                meant += named("mass", masses)
            meant += named(name, texts_in_units(read, name, of, between(0.0, DAMPED * critical)))
            text = f"{written(read, name)} is {times(damping / critical)} the critical damping of {body.text} on "
            text += f"{format_quantity(stiffness, si)}, so that nothing swings; of drives 0.01 to 0.2 are measured: "
            yield name, text + hint(meant)


def _controlled(rig: Rig, read: Read, bodies: Mapping[str, HeldBody]) -> Iterator[SizeWarning]:
    """Warnings of an implausible position gain, and of a sample time or delay too long for it."""
    known, name = rig.parameters(), "drive.kp"
    body = bodies.get((rig.drive.driven() or "") if rig.bodies else "slider")
    gain = (known[name].value or 0.0) * (rig.area or 1.0) if name in known else 0.0
    if body is None or not gain or not body.inertia or read.get(name, (None, ""))[1] not in ("N/m", "N m/rad", "Pa/m"):
        return

    def frequency(stiffness: float) -> float:
        return math.sqrt(stiffness / body.inertia) / (2 * math.pi)

    swings, si = frequency(gain), "N m/rad" if body.turns else "N/m"
    if swings < SLOWEST:
        meant = texts_in_units(read, name, si, lambda k: 10 * SLOWEST < frequency(k) < FAST_GAINS / 10)
        text = f"{written(read, name)} swings {body.name}, {body.text}, once in {format_quantity(1 / swings, 's')}, "
        yield name, f"{text}if it is of that body: {hint(meant)}"
        return
    if swings > FAST_GAINS:
        meant = texts_in_units(read, name, si, lambda k: 10 * SLOWEST < frequency(k) < FAST_GAINS / 10)
        text = f"{written(read, name)} swings {body.name}, {body.text}, at {format_quantity(swings, 'Hz')}, "
        yield name, f"{text}faster than drives do: {hint(meant)}"
        return
    yield from _overdamped_gain(rig, read, body, gain)
    for late in ("drive.sample_time", "drive.delay"):
        lag = known[late].value if isinstance(read.get(late, (None, ""))[0], str) else None
        if lag and lag * swings > LATE:
            meant = named(late, texts_in_units(read, late, "s", between(0.0, LATE / 5 / swings)))
            slowest, fastest = (body.inertia * (2 * math.pi * one) ** 2 for one in (10 * SLOWEST, LATE / 5 / lag))
            meant += named(name, texts_in_units(read, name, si, between(slowest, fastest)))
            text = f"{written(read, late)} is {times(lag * swings)} the period of {body.name} on the gain kp, "
            yield late, f"{text}{format_quantity(1 / swings, 's')}: {hint(meant)}"


def _overdamped_gain(rig: Rig, read: Read, body: HeldBody, gain: float) -> Iterator[SizeWarning]:
    """Warning of a gain kd that damps a body too strongly to follow the gain kp."""
    name, of = "drive.kd", "N m s/rad" if body.turns else "N s/m"
    critical = 2 * math.sqrt(gain * body.inertia)
    damping = (rig.value(name) or 0.0) * (rig.area or 1.0) if name in read else 0.0
    if damping > OVERDAMPED_GAIN * critical:
        meant = texts_in_units(read, name, of, between(0.05 * critical, 10 * critical))
        text = f"{written(read, name)} is {times(damping / critical)} the critical damping of {body.name}, "
        yield name, f"{text}{body.text}, on the gain kp: {hint(meant)}"


def _massless(rig: Rig, read: Read) -> Iterator[SizeWarning]:
    """Warning of a missing mass, for a slider with a Stribeck curve."""
    if rig.bodies or "slider.mass" in read:
        return
    if any(one.role.kind == "exponent" for one in rig.parameters().values()):
        text = "slider.mass is not given, so nothing swings; write the mass, or mass = 0 if it is left out on purpose"
        yield "slider.mass", text
