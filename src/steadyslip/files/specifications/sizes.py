"""Questions about sizes that no machine has, in whatever unit they were typed: of springs, masses, bristles, speeds.

Each compares a value with what else stands in the file, by a bound of physics or by what is built.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

from steadyslip.core.format import format_quantity
from steadyslip.files.specifications.held_bodies import (
    Body,
    Spring,
    bodies_of,
    friction_at_rest,
    is_of_forces,
    mass_at,
    mass_on,
    springs_of,
)
from steadyslip.files.specifications.other_units import (
    Read,
    asked,
    between,
    in_units,
    named,
    number_of,
    texts_in_units,
    times,
    written,
)
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig

Question = tuple[str, str]
"""Name of a parameter, and the question about it."""
G = 9.81  # m/s^2
SLOWEST = 0.05  # Hz: long drill strings turn to and fro at 0.2 Hz, base isolation at 0.3 Hz
USUAL = 20.0  # Hz, of a drive
LONG, TWIST, WAIT = 0.01, 0.3, 1000.0  # m, rad, s: further than drives give way, and longer than any takes to do so
SAG = 0.5  # rad: arms on springs by intent sag by 0.2 to 0.3 rad
STEEL = 10.0  # times softer than a block of steel is what is made of several parts
LIGHT = 0.01  # share of its weight by which a body is hardly ever pressed: hanging and floating ones are by some 1 %
OVERDAMPED, DAMPED = 1.0, 0.2  # of critical damping; of shafts, screws and guides 0.01 to 0.2 are measured
OTHER_LOAD = 100.0  # times the load of which bristles are told to the contact's own
THIN, THICK = 1e-8, 1e-3  # m: bends of bristles at which they slip; measured are 0.1 um to 0.1 mm, and of rubber more
TURNED = 1.0  # rad: the most bristles of what turns bend by, at a motor in front of its gear
UNCHANGED = 1e3  # times the speed of sliding, where friction is that at rest
SLOW_LAW = 1e-6  # m/s: measured Stribeck velocities are 0.1 mm/s to 1 m/s
FAST_GAINS = 3e3  # Hz: ten times the bandwidth of drives of machines
LATE = 0.5  # of the period of a controller: samples tell no faster oscillation (Nyquist)
GEARED_UP = 10.0  # turns of a body for one of its motor


def questions_of_size(rig: Rig, read: Read) -> Iterator[Question]:
    """Questions about the sizes of a rig, at most one for each parameter; none for rigs in stresses.

    Parameters
    ----------
    rig : Slider or Machine
    read : mapping of str to (object, str)
        Names of the values read, each as it was written and with its SI unit.
    """
    if not (rig.in_forces or rig.area is not None):
        return
    bodies = bodies_of(rig)
    springs = springs_of(rig, bodies)
    if geared := list(_geared_up(rig, bodies)):
        yield from geared
        return  # springs are at the wrong ends as well, and speeds are wrong
    held, light = [*_stiff(springs, read), *_soft(rig, springs, bodies, read)], list(_light(rig, read))
    yield from dict(held).items()
    yield from light
    if not held:
        yield from _damped(rig, read, bodies)
    if not light:
        yield from _bristles(rig, read)
    yield from _unchanged(rig, read)
    yield from _controlled(rig, read, bodies)
    yield from _massless(rig, read)


def _stiff(springs: Mapping[str, Spring], read: Read) -> Iterator[Question]:
    """Questions about springs that are stiffer than a block of steel of the heavier body's mass."""
    for name, spring in springs.items():
        body, stiffness = spring.heavier
        if body.inertia and stiffness > body.block:
            made = "cylinder of steel as thick as long, of the inertia" if body.turns else "cube of steel of the mass"
            text = f"{written(read, name)} is {times(stiffness / body.block)} the stiffness of a {made} of "
            yield name, f"{text}{body.name}, {body.told}: {asked(_springs_meant(read, name, spring))}"


def _soft(rig: Rig, springs: Mapping[str, Spring], bodies: Mapping[str, Body], read: Read) -> Iterator[Question]:
    """Questions about the stiffest spring of a body, if the body hangs on it too softly."""
    for body in bodies.values():
        name = max(body.springs, key=lambda one: body.springs[one], default="")
        if name not in read:
            continue
        spring, stiffness = springs[name], sum(body.springs.values())
        if why := _why_soft(spring, body, stiffness):
            meant = _springs_meant(read, name, spring) or _loads_meant(rig, read, spring, body)
            yield name, f"{written(read, name)}, {why}: {asked(meant)}"


def _loads_meant(rig: Rig, read: Read, spring: Spring, body: Body) -> list[str]:
    """Loads of contacts in units in which friction does not stretch a spring far."""
    found, stiffness = [], sum(body.springs.values())

    def fits(load: float, of: float) -> bool:
        return not _why_soft(spring, body._replace(pull=body.pull * load / of), stiffness)

    for name in rig.of_kind("normal stress"):
        if load := rig.load_of(name):
            found += named(name, texts_in_units(read, name, "N", partial(fits, of=load)))
    return found


def _why_soft(spring: Spring, body: Body, stiffness: float) -> str:
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


def _springs_meant(read: Read, name: str, spring: Spring) -> list[str]:
    """The number of a stiffness in the two units in which it is most that of a drive."""

    def fits(stiffness: float) -> bool:
        one = spring._replace(stiffness=stiffness)
        body, at_it = one.heavier
        soft = any(_why_soft(one, end, at_end) for end, at_end in one.ends)
        return at_it < body.block / STEEL and one.frequency > 10 * SLOWEST and not soft

    def away(one: tuple[float, str]) -> float:
        return abs(math.log(spring._replace(stiffness=one[0]).frequency / USUAL))

    si = "N m/rad" if spring.heavier[0].turns else "N/m"
    found = in_units(read.get(name, (None, ""))[0], si, fits)
    return [text for _, text in sorted(found, key=away)[:2]]


def _geared_up(rig: Rig, bodies: Mapping[str, Body]) -> Iterator[Question]:
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


def _damped(rig: Rig, read: Read, bodies: Mapping[str, Body]) -> Iterator[Question]:
    """Question about a drive that is damped so that a mass does not swing."""
    name, body = "slider.damping", bodies.get("slider")
    if body is None or name not in read or not (body.inertia and body.springs):
        return
    spring, stiffness = next(iter(body.springs.items()))
    damping = (rig.value(name) or 0.0) * (rig.area or 1.0)

    def ratio(c: float = damping, m: float = body.inertia, k: float = stiffness) -> float:
        return c / (2 * math.sqrt(m * k))

    if ratio() > OVERDAMPED:
        heaviest = (rig.load_of("friction.any") or math.inf) / (G * LIGHT)
        meant = [
            *named(spring, texts_in_units(read, spring, "N/m", lambda k: ratio(k=k) < DAMPED)),
            *named("mass", texts_in_units(read, "slider.mass", "kg", lambda m: ratio(m=m) < DAMPED and m < heaviest)),
            *named(name, texts_in_units(read, name, "N s/m", lambda c: ratio(c=c) < DAMPED)),
        ]
        text = f"{written(read, name)} is {times(ratio())} the critical damping of {body.told} on "
        text += f"{format_quantity(stiffness, 'N/m')}, so that nothing swings; of drives 0.01 to 0.2 are measured: "
        yield name, text + asked(meant)


def _light(rig: Rig, read: Read) -> Iterator[Question]:
    """Questions about typed loads that hardly press: far less than a body weighs."""
    for name in rig.of_kind("normal stress"):
        load, weight = rig.load_of(name), G * mass_on(rig, name)
        if not isinstance(read.get(name, (None, ""))[0], str) or is_of_forces(rig, name):
            continue
        if load and load < LIGHT * weight:
            mass = texts_in_units(read, mass_at(rig, name), "kg", between(load / (100 * G), load / (0.1 * G)))
            meant = named(name, texts_in_units(read, name, "N", between(0.1 * weight, 100 * weight)))
            meant += named("mass", mass)
            text = f"{written(read, name)} is {times(load / weight)} the weight of what slides there, "
            yield name, f"{text}{format_quantity(weight, 'N')}: {asked(meant)}"


def _bristles(rig: Rig, read: Read) -> Iterator[Question]:
    """Questions about bristles of another load than the contact's, or that bend unlike any that were measured."""
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
            yield name, f"{text}{format_quantity(load, 'N')}: {asked(meant)}"
        elif at_rest and not _bends_well(rig, name, at_rest / value):
            meant = []
            if of_load:
                found = in_units(force, "N/m", between(at_rest * load / (THICK / 5), at_rest * load / (10 * THIN)))
                meant = [f"{text} at {of}" for _, text in found]
            bend = format_quantity(at_rest / value, "m")
            text = f"{name} = {raw}: friction bends such bristles by {bend} before they slip; measured are 0.1 um to "
            yield name, f"{text}0.1 mm: {asked(meant)}"


def _bends_well(rig: Rig, name: str, bend: float) -> bool:
    """True if bristles that bend by this length (m) are like those of some contact."""
    radius = rig.contacts[name.split(".")[1]].radius if isinstance(rig, Machine) else None
    return bool(bend <= TURNED * radius) if radius else THIN <= bend <= THICK


def _unchanged(rig: Rig, read: Read) -> Iterator[Question]:
    """Questions about Stribeck velocities far above the speed of sliding, or below all that were measured."""
    for prefix, *_ in rig.laws_by_contact().values():
        law = f"{prefix}friction."
        kinds = {one.role.kind: name for name, one in rig.parameters().items() if name.startswith(law)}
        name = kinds.get("velocity scale", "")
        if "exponent" not in kinds or name not in read or not (scale := rig.value(name)):
            continue
        speed = _slip_speed(rig, prefix)
        near = speed or math.sqrt(SLOW_LAW)  # m/s: the middle of those measured
        meant = texts_in_units(read, name, "m/s", between(max(10 * SLOW_LAW, near / 10), UNCHANGED * near))
        if scale < SLOW_LAW:
            yield name, f"{written(read, name)} is far below all that were measured, 0.1 mm/s to 1 m/s: {asked(meant)}"
        elif speed and scale > UNCHANGED * speed:
            text = f"{written(read, name)} is {times(scale / speed)} the speed of sliding, "
            text += f"{format_quantity(speed, 'm/s')}, at which friction is still that at rest: "
            yield name, text + asked(meant)


def _slip_speed(rig: Rig, prefix: str) -> float:
    """Speed (m/s) of steady sliding at a contact; 0 where a place is held or it is not known."""
    if rig.holds:
        return 0.0
    if not isinstance(rig, Machine):
        return abs(float(rig.drive.velocity))
    surface = rig.contacts[prefix.split(".")[1]]
    return abs(float(rig.speeds().get(surface.held, 0.0))) * (surface.radius or 1.0)


def _controlled(rig: Rig, read: Read, bodies: Mapping[str, Body]) -> Iterator[Question]:
    """Questions about a position gain on which a body swings faster than drives do, and times too long for it."""
    known, name = rig.parameters(), "drive.kp"
    body = bodies.get((rig.drive.driven() or "") if isinstance(rig, Machine) else "slider")
    gain = (known[name].value or 0.0) * (rig.area or 1.0) if name in known else 0.0
    if body is None or not gain or not body.inertia or read.get(name, (None, ""))[1] not in ("N/m", "N m/rad", "Pa/m"):
        return

    def frequency(stiffness: float) -> float:
        return math.sqrt(stiffness / body.inertia) / (2 * math.pi)

    swings = frequency(gain)
    if swings > FAST_GAINS:
        si = "N m/rad" if body.turns else "N/m"
        meant = texts_in_units(read, name, si, lambda k: 10 * SLOWEST < frequency(k) < FAST_GAINS / 10)
        text = f"{written(read, name)} swings {body.name}, {body.told}, at {format_quantity(swings, 'Hz')}, "
        yield name, f"{text}faster than drives do: {asked(meant)}"
        return
    for late in ("drive.sample_time", "drive.delay"):
        lag = known[late].value if isinstance(read.get(late, (None, ""))[0], str) else None
        if lag and lag * swings > LATE:
            meant = texts_in_units(read, late, "s", lambda t: t * swings < LATE / 5)
            text = f"{written(read, late)} is {times(lag * swings)} the period of {body.name} on the gain kp, "
            yield late, f"{text}{format_quantity(1 / swings, 's')}: {asked(meant)}"


def _massless(rig: Rig, read: Read) -> Iterator[Question]:
    """Question about the mass of a slide that was not given, of one with a damping or a Stribeck curve."""
    if isinstance(rig, Machine) or "slider.mass" in read:
        return
    if "slider.damping" in read or any(one.role.kind == "exponent" for one in rig.parameters().values()):
        text = "slider.mass is not given, so nothing swings; write the mass, or mass = 0 if it is left out on purpose"
        yield "slider.mass", text
