"""Questions about sizes that no machine has, in whatever unit they were typed: of springs, masses, bristles, speeds.

Each compares a value with what else stands in the file, by a bound of physics or by what is built.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

from steadyslip.core.format import format_quantity
from steadyslip.core.roles import Placeholder
from steadyslip.files.specifications.contact_sizes import LIGHT, G, questions_of_contacts
from steadyslip.files.specifications.held_bodies import HeldBody, HoldingSpring, bodies_of, springs_of
from steadyslip.files.specifications.other_units import (
    Question,
    Read,
    asked,
    between,
    in_units,
    named,
    texts_in_units,
    times,
    written,
)
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig

SLOWEST = 0.05  # Hz: long drill strings turn to and fro at 0.2 Hz, base isolation at 0.3 Hz
USUAL = 20.0  # Hz, of a drive
LONG, TWIST, WAIT = 0.01, 0.3, 1000.0  # m, rad, s: further than drives give way, and longer than any takes to do so
SAG = 0.5  # rad: arms on springs by intent sag by 0.2 to 0.3 rad
STEEL = 10.0  # times softer than a block of steel is what is made of several parts
OVERDAMPED, DAMPED = 1.0, 0.2  # of critical damping; of shafts, screws and guides 0.01 to 0.2 are measured
FAST_GAINS = 3e3  # Hz: ten times the bandwidth of drives of machines
OVERDAMPED_GAIN = 50.0  # of critical damping: a load in front of the motor asks for some 10 times that of the motor
LATE = 0.5  # of the period of a controller: samples tell no faster oscillation (Nyquist)
UNLIKE = 500.0  # times the inertia that it turns is that of a motor through its gear: of light arms up to 100
GEARED_UP = 10.0  # turns of a body for one of its motor


def questions_of_size(rig: Rig, read: Read) -> Iterator[Question]:
    """Questions about the sizes of a rig, at most one for each parameter; none in stresses, or of one to be fitted.

    Parameters
    ----------
    rig : Slider or Machine
    read : mapping of str to (object, str)
        Names of the values read, each as it was written and with its SI unit.
    """
    yield from _gainless(rig, read)
    if not (rig.in_forces or rig.area is not None) or any(isinstance(raw, Placeholder) for raw, _ in read.values()):
        return
    bodies = bodies_of(rig)
    springs = springs_of(rig, bodies)
    if geared := list(_geared_up(rig, bodies)):
        yield from geared
        return  # springs are at the wrong ends as well, and speeds are wrong
    held = [*_stiff(rig, springs, read), *_soft(rig, springs, bodies, read), *_unlike(read, springs)]
    yield from dict(held).items()
    if not held:
        yield from _damped(rig, read, springs)
    yield from questions_of_contacts(rig, read, bodies)
    yield from _controlled(rig, read, bodies)
    yield from _massless(rig, read)


def _gainless(rig: Rig, read: Read) -> Iterator[Question]:
    """Question about a controller of a slider that has no gain."""
    gains = [name for name in ("drive.kp", "drive.kd", "drive.ki") if name in rig.parameters()]
    if gains and not any(name in read for name in gains):
        *keys, last = (name.partition(".")[2] for name in gains)
        text = f"give {', '.join(keys)} or {last}, or write control = 'steady'"
        yield "drive.control", f"the controller has no gain and does nothing: {text}"


def _stiff(rig: Rig, springs: Mapping[str, HoldingSpring], read: Read) -> Iterator[Question]:
    """Questions about springs that are stiffer than a block of steel of the heavier body's mass."""
    for name, spring in springs.items():
        body, stiffness = spring.heavier
        if body.inertia and stiffness > body.block:
            made = "cylinder of steel as thick as long, of the inertia" if body.turns else "cube of steel of the mass"
            text = f"{written(read, name)} is {times(stiffness / body.block)} the stiffness of a {made} of "
            meant = asked(_springs_meant(read, name, spring))
            rigid = ', or stiffness = "rigid"' if isinstance(rig, Machine) and "is " not in meant else ""
            yield name, f"{text}{body.name}, {body.told}: {meant}{rigid}"


def _soft(
    rig: Rig, springs: Mapping[str, HoldingSpring], bodies: Mapping[str, HeldBody], read: Read
) -> Iterator[Question]:
    """Questions about the stiffest spring of a body, if the body hangs on it too softly."""
    for body in bodies.values():
        name = max(body.springs, key=lambda one: body.springs[one], default="")
        if name not in read:
            continue
        spring, stiffness = springs[name], sum(body.springs.values())
        if why := _why_soft(spring, body, stiffness):
            meant = _springs_meant(read, name, spring)
            meant += _loads_meant(rig, read, spring, body) if body.load or not meant else []
            yield name, f"{written(read, name)}, {why}: {asked(meant)}"


def _loads_meant(rig: Rig, read: Read, spring: HoldingSpring, body: HeldBody) -> list[str]:
    """Loads of contacts and of the body in units in which friction does not stretch a spring far."""
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
    """What a stiffness at a body makes of it that no machine does; empty if nothing."""
    stretch = (body.pull + body.load) / stiffness
    if body.turns and body.load / stiffness > SAG:
        return f"which the constant torque on {body.name} alone twists by {format_quantity(stretch, 'rad')}"
    far, si, does = (TWIST, "rad", "twisted") if body.turns else (LONG, "m", "stretched")
    if body.speed and stretch > far and stretch / body.speed > WAIT:
        wait, way = format_quantity(stretch / body.speed, "s"), format_quantity(stretch, si)
        return f"which is {does} by {way} before {body.name} slides, and that takes {wait}"
    if spring.frequency < SLOWEST:
        return f"on which {body.name}, {body.told}, swings once in {format_quantity(1 / spring.frequency, 's')}"
    return ""


def _springs_meant(read: Read, name: str, spring: HoldingSpring) -> list[str]:
    """The number of a stiffness in the two units in which it is most that of a drive."""

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


def _geared_up(rig: Rig, bodies: Mapping[str, HeldBody]) -> Iterator[Question]:
    """Question about a body that turns much faster than its motor, though it is the heavier."""
    motor = bodies.get(rig.drive.driven() or "") if isinstance(rig, Machine) else None
    if motor is None or not motor.turns or not isinstance(rig, Machine):
        return
    for name, link in rig.links.items():
        (first, second), ratio = link.between, float(link.ratio())
        one = bodies.get(first)
        if second != motor.name or one is None or not one.turns or ratio * GEARED_UP >= 1:
            continue
        if one.inertia > motor.inertia:
            text = f'links.{name}.between = ["{first}", "{second}"]: {first}, {one.told}, turns {times(1 / ratio)} as '
            text += f"fast as {second}, {motor.told}, which the drive turns; a reduction is "
            yield f"links.{name}.between", f'{text}between = ["{second}", "{first}"]'


def _unlike(read: Read, springs: Mapping[str, HoldingSpring]) -> Iterator[Question]:
    """Questions about what turns so easily that its motor, seen through the gear, is far heavier."""
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
            text = f"{written(read, name)} is turned by {first.name}, {first.told}, which through {key.split('.')[1]} "
            yield name, f"{text}has {times(seen / second.inertia)} that inertia: {asked(meant)}"


def _damped(rig: Rig, read: Read, springs: Mapping[str, HoldingSpring]) -> Iterator[Question]:
    """Questions about links that are damped so that what they hold does not swing."""
    for key, spring in springs.items():
        name, stiffness, (body, at_body) = f"{key.rpartition('.')[0]}.damping", spring.stiffness, spring.heavier
        if name not in read or not 0 < body.inertia < math.inf:
            continue
        damping = (rig.value(name) or 0.0) * (1.0 if isinstance(rig, Machine) else rig.area or 1.0)
        inertia = body.inertia * stiffness / at_body  # as at the end of which the stiffness is
        critical = 2 * math.sqrt(inertia * stiffness)
        if damping > OVERDAMPED * critical:
            si, of = ("N m/rad", "N m s/rad") if body.turns else ("N/m", "N s/m")
            least = (damping / (2 * DAMPED)) ** 2  # stiffness times inertia from which it swings well
            meant = named(key, texts_in_units(read, key, si, between(least / inertia, body.block / STEEL)))
            if not isinstance(rig, Machine):
                heaviest = (rig.load_of("friction.any") or math.inf) / (G * LIGHT)
                masses = texts_in_units(read, "slider.mass", "kg", between(least / stiffness, heaviest))
                meant += named("mass", masses)
            meant += named(name, texts_in_units(read, name, of, between(0.0, DAMPED * critical)))
            text = f"{written(read, name)} is {times(damping / critical)} the critical damping of {body.told} on "
            text += f"{format_quantity(stiffness, si)}, so that nothing swings; of drives 0.01 to 0.2 are measured: "
            yield name, text + asked(meant)


def _controlled(rig: Rig, read: Read, bodies: Mapping[str, HeldBody]) -> Iterator[Question]:
    """Questions about a position gain on which a body swings faster than drives do, and times too long for it."""
    known, name = rig.parameters(), "drive.kp"
    body = bodies.get((rig.drive.driven() or "") if isinstance(rig, Machine) else "slider")
    gain = (known[name].value or 0.0) * (rig.area or 1.0) if name in known else 0.0
    if body is None or not gain or not body.inertia or read.get(name, (None, ""))[1] not in ("N/m", "N m/rad", "Pa/m"):
        return

    def frequency(stiffness: float) -> float:
        return math.sqrt(stiffness / body.inertia) / (2 * math.pi)

    swings, si = frequency(gain), "N m/rad" if body.turns else "N/m"
    if swings < SLOWEST:
        meant = texts_in_units(read, name, si, lambda k: 10 * SLOWEST < frequency(k) < FAST_GAINS / 10)
        text = f"{written(read, name)} swings {body.name}, {body.told}, once in {format_quantity(1 / swings, 's')}, "
        yield name, f"{text}if it is of that body: {asked(meant)}"
        return
    if swings > FAST_GAINS:
        meant = texts_in_units(read, name, si, lambda k: 10 * SLOWEST < frequency(k) < FAST_GAINS / 10)
        text = f"{written(read, name)} swings {body.name}, {body.told}, at {format_quantity(swings, 'Hz')}, "
        yield name, f"{text}faster than drives do: {asked(meant)}"
        return
    yield from _overdamped_gain(rig, read, body, gain)
    for late in ("drive.sample_time", "drive.delay"):
        lag = known[late].value if isinstance(read.get(late, (None, ""))[0], str) else None
        if lag and lag * swings > LATE:
            meant = named(late, texts_in_units(read, late, "s", between(0.0, LATE / 5 / swings)))
            slowest, fastest = (body.inertia * (2 * math.pi * one) ** 2 for one in (10 * SLOWEST, LATE / 5 / lag))
            meant += named(name, texts_in_units(read, name, si, between(slowest, fastest)))
            text = f"{written(read, late)} is {times(lag * swings)} the period of {body.name} on the gain kp, "
            yield late, f"{text}{format_quantity(1 / swings, 's')}: {asked(meant)}"


def _overdamped_gain(rig: Rig, read: Read, body: HeldBody, gain: float) -> Iterator[Question]:
    """Question about a gain kd that damps a body far beyond what lets it follow the gain kp."""
    name, of = "drive.kd", "N m s/rad" if body.turns else "N s/m"
    critical = 2 * math.sqrt(gain * body.inertia)
    damping = (rig.value(name) or 0.0) * (rig.area or 1.0) if name in read else 0.0
    if damping > OVERDAMPED_GAIN * critical:
        meant = texts_in_units(read, name, of, between(0.05 * critical, 10 * critical))
        text = f"{written(read, name)} is {times(damping / critical)} the critical damping of {body.name}, "
        yield name, f"{text}{body.told}, on the gain kp: {asked(meant)}"


def _massless(rig: Rig, read: Read) -> Iterator[Question]:
    """Question about the mass of a slide that was not given, of one with a Stribeck curve."""
    if isinstance(rig, Machine) or "slider.mass" in read:
        return
    if any(one.role.kind == "exponent" for one in rig.parameters().values()):
        text = "slider.mass is not given, so nothing swings; write the mass, or mass = 0 if it is left out on purpose"
        yield "slider.mass", text
