"""Warnings about implausible values of a rig file, mainly numbers without a unit, given once when it is read."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import UnitWarning
from steadyslip.core.format import format_quantity
from steadyslip.core.quantities import parse, units_in
from steadyslip.files.specifications.contact_sizes import G
from steadyslip.files.specifications.held_bodies import friction_at_rest, is_of_forces, mass_on
from steadyslip.files.specifications.other_units import number_of
from steadyslip.files.specifications.sizes import size_warnings
from steadyslip.machine.rig import Rig
from steadyslip.machine.structures import StructureBody

SPEEDS = ("m/s", "rad/s")
STIFFNESSES = ("N/m", "Pa/m")
STRETCHED = 1.0  # m: stretch of a spring by friction that is implausible; the softest real axes and presses have 10 mm
FAST = 1.0  # m/s, speed of seismic slip: faster contacts exist, but a number without unit may be meant in um/s
FASTEST = 3e8  # m/s, speed of light: faster speeds get an error elsewhere


class Largest(NamedTuple):
    """Largest known value of a kind of parameter, and limit above which a bare number gets a warning; SI units.

    For a number between `limit` and `ABSURD` times `limit`, another unit, per cent or the reciprocal may be meant. `of`
    says whether the largest known value is in use or was measured.
    """

    value: float
    limit: float
    of: str = "in use"


ABSURD = 1e4  # multiple of the limit: 1e3 if mm are meant, times ten; larger numbers belong to dimensionless rigs
LARGEST = {
    ("slip distance", "m"): Largest(0.1, 0.5, "measured"),
    ("stress share", "1"): Largest(0.6, 3.0, "measured"),  # a and b may be forces, if no load is given
    ("mu_coulomb", "1"): Largest(1.5, 7.5, "measured"),  # rubber; joints, per load of a bearing, up to 5
    ("mu_static", "1"): Largest(1.5, 7.5, "measured"),
    ("mu_ref", "1"): Largest(1.5, 7.5, "measured"),
    ("resolution", "m"): Largest(1e-4, 5e-4),  # magnetic scales
    ("resolution", "rad"): Largest(2 * math.pi / 400, 0.02),  # 100 lines, four steps each
    ("sample_time", "s"): Largest(0.02, 0.2),
    ("delay", "s"): Largest(0.1, 1.0),
    ("tn", "s"): Largest(1.0, 10.0),
    ("radius", "m"): Largest(2.0, 10.0),  # turntables, turbine rings
    ("lead", "m/rad"): Largest(0.1 / (2 * math.pi), 0.1),  # screws of 100 mm/rev
    ("gear", "1"): Largest(10.0, 10.0),
    ("exponent", "1"): Largest(2.0, 5.0, "measured"),
    ("transmitted", "1"): Largest(2.0, 10.0),
    ("area", "m^2"): Largest(5.0, 50.0),
}
"""Largest known values and limits, by (kind of parameter or last part of its name, SI unit)."""
WITH_UNIT = 10.0  # factor on the limit for values with a unit, as rings of telescopes are 30 m wide
REMEDIES = {
    "gear": 'its second body turns faster than the first; a reduction is written "1/{raw:g}", this one "{raw:g}/1"',
    "stribeck_exponent": "write that of exp(-(v/v_stribeck)^exponent)",
    "1": "a number in per cent is written as a share, {share:g}",
    "": "write the unit that is meant",
}
"""Advice by last part of a parameter's name, or by SI unit; that of the key "" is for all other parameters."""
UNDAMPED = 1e-4  # least plausible damping ratio of a dashpot: steel alone has 1e-4 to 1e-3
SLOWEST_MOTOR = 1e-4  # rad/s, a turn in 17 h: for a slower motor, the speed behind its gear may be meant
LEAST_REDUCTION = 5.0  # least gear reduction for the warning of slow motors: direct drives do turn as slowly
BENT = 2e-4  # m: largest plausible bend of bristles before sliding; measured bends are some um to 0.1 mm
LIGHTEST = 1000.0  # Pa, least plausible normal stress, 10 cm of water: faults and laboratories have ten times as much
LIGHT = 0.05  # least plausible load on a contact, as share of the body's weight
BEYOND_LAW = 1e5  # largest plausible ratio of a speed to those of the law: laboratories span some five decades


def warn_of_values(rig: Rig, read: Mapping[str, tuple[Any, str]], written: Iterable[str]) -> None:
    """Warn (UnitWarning) of implausible values of a rig file.

    They are: speeds without a unit where others have one, or far beyond the speeds of the friction law; stiffnesses
    without a unit that friction would stretch far; numbers far above or below all in use; an encoder that is not where
    its step counts; values that a friction law warns of; and, without other warnings, sizes that no machine has.

    Parameters
    ----------
    rig : Slider or Machine
    read : mapping of str to (object, str)
        Values by dotted name: as written in the file, and their SI unit.
    written : iterable of str
        Units in the file. If all are SI units, as in files by programs, only speeds are checked.
    """
    by_programs = all(unit(name)[0] == 1.0 for name in written)
    large = {} if by_programs else dict(_large(rig, read))
    found = [*_speeds(rig, read)]
    if not by_programs:
        found += [*_soft(rig, read), *large.values(), *_light(rig, read), *_pliable(rig, read)]
        found += [*_undamped(rig, read), *_idle(rig)]
        found += [] if found else [text for _, text in size_warnings(rig, read)]
    for text in (*found, *_doubts(rig, large)):
        warnings.warn(text, UnitWarning, stacklevel=2)


def _speeds(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    for si in SPEEDS:
        own = {name: raw for name, (raw, its) in read.items() if its == si}
        bare = {name: raw for name, raw in own.items() if isinstance(raw, (int, float)) and 0 < abs(raw) <= FASTEST}
        texts = [raw for raw in own.values() if isinstance(raw, str) and units_in([raw])]
        written = sorted(units_in(texts))
        for name, raw in bare.items():
            was = f"{name} = {raw:g} has no unit and is read as {raw:g} {si}"
            if written and si not in written and _fits_better(abs(raw), texts, si):
                yield f"{was}; other speeds of the file are in {', '.join(written)}: write the unit that is meant"
            elif name == "drive.velocity" and si == "m/s" and (law := _outrun(rig, abs(raw))):
                yield f"{was}, {law}: write the unit that is meant"


def _doubts(rig: Rig, questioned: Collection[str]) -> Iterator[str]:
    """Warnings of friction laws about their values; contacts with equal warnings get one warning together.

    A contact is skipped if one of its values is in `questioned`, because a warning on that value was given already.
    """
    found: dict[str, list[str]] = {}
    for one in rig.laws_by_contact().values():
        if any(name.startswith(f"{one.prefix}friction.mu_") for name in questioned):
            continue  # the law's warnings compare values that are doubtful already
        for text in one.friction.doubts():
            found.setdefault(text, []).append(one.prefix)
    yield from _structure_doubts(rig)
    for text, (first, *others) in found.items():
        names = " and ".join(prefix.removesuffix(".") for prefix in (first, *others))
        yield f"{names}: {text}" if others else f"{first}{text}"


def _structure_doubts(rig: Rig) -> Iterator[str]:
    """Warnings about structures, and about contacts at points that cannot move along or across the slide."""
    structures = {name: body for name, body in rig.bodies.items() if isinstance(body, StructureBody)}
    own_doubts = {name: list(body.doubts()) for name, body in structures.items()}
    for name, texts in own_doubts.items():
        yield from (f"bodies.{name}.{text}" for text in texts)
    ends = [(name, end) for name, own in rig.contacts.items() for end in (own.body, own.against) if end]
    for contact, end in ends:
        name, _, point = end.partition(".")
        if name in structures and not np.any(structures[name].rows(point)[0]):
            yield (
                f"contacts.{contact}: {end} has no displacement along the slide, so that friction moves nothing there: "
                f"is there a column or degree of freedom x of it? Points: {', '.join(structures[name].point_names())}"
            )
        elif (
            not own_doubts.get(name, ["no structure"])
            and any(one.startswith(f"contacts.{contact}.contact.") for one in rig.of_kind("stiffness"))
            and not structures[name].moves_across(point)
        ):
            yield (
                f"contacts.{contact}: its normal stiffness is pressed by motion across, and {end} has none: "
                "is there a column or degree of freedom y of it?"
            )
        elif not own_doubts.get(name, ["no structure"]):
            force = rig.load_of(f"contacts.{contact}.friction") or 0.0
            if asked := structures[name].overloaded(point, force):
                yield f"bodies.{name}: at {end} {asked}"


def _soft(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    """Warnings of stiffnesses without a unit so soft that a contact's load would stretch them by `STRETCHED`."""
    presses = max(
        (rig.load_of(f"{prefix}friction") or 0.0 for prefix, *_ in rig.laws_by_contact().values()), default=0.0
    )
    for name, (raw, si) in read.items():
        if si not in STIFFNESSES or not isinstance(raw, (int, float)) or not 0 < raw < presses / STRETCHED:
            continue
        unit_name = "N/m" if rig.in_forces or rig.area is not None else si
        stretch = format_quantity(presses / raw, "m")
        yield (
            f"{name} = {raw:g} has no unit and is read as {raw:g} {unit_name}, which the load of the contact alone, "
            f"{format_quantity(presses, 'N')}, would stretch by {stretch}: write the unit that is meant"
        )


def _large(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[tuple[str, str]]:
    """Names and warnings of numbers far above `LARGEST`, whose unit is missing or seems wrong."""
    parameters = rig.parameters()
    for name, (raw, si) in read.items():
        last, one = name.rpartition(".")[2], parameters.get(name)
        known = LARGEST.get((one.role.kind if one else "", si)) or LARGEST.get((last, si))
        if known is None or (last.startswith("mu_") and is_of_forces(rig, name)):
            continue
        largest = f"the largest {known.of} are some {format_quantity(known.value, si)}"
        if _is_between(raw, known.limit, ABSURD * known.limit):
            remedy = (REMEDIES.get(last) or REMEDIES.get(si) or REMEDIES[""]).format(raw=raw, share=raw / 100)
            yield name, f"{name} = {raw:g} is read as {format_quantity(float(raw), si)}; {largest}: {remedy}"
        elif isinstance(raw, str):
            number, further = number_of(raw, si) or 0.0, 1.0 if si == "1" else WITH_UNIT
            if number > further * known.limit:
                remedy = (REMEDIES.get(last) or REMEDIES[""]).format(raw=number)
                yield name, f"{name} = {raw}; {largest}: {remedy}"


def _undamped(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    """Warning of a damping below 1 that has no unit and hardly damps, so that a damping ratio may be meant."""
    name, raw, area = "slider.damping", read.get("slider.damping", (None, ""))[0], rig.area or 1.0
    own = (float(rig.parameters()[one].value or 0.0) * area if one in rig.parameters() else 0.0
           for one in ("slider.mass", "slider.stiffness"))  # fmt: skip
    critical = 2 * math.sqrt(math.prod(own))
    if _is_between(raw, 0.0, min(1.0, UNDAMPED * critical)):
        si, c = "N s/m" if rig.area else "Pa s/m", format_quantity(raw * critical, "N s/m" if rig.area else "Pa s/m")
        yield (
            f"{name} = {raw:g} has no unit and is read as {raw:g} {si}, {raw / critical:.1g} of critical damping; if "
            f"it is a damping ratio write {c}"
        )


def _idle(rig: Rig) -> Iterator[str]:
    """Warning of a motor that turns so slowly that the speed behind its gear may be meant."""
    if not rig.drive.turns or rig.fed is not None or not 0 < rig.drive.velocity < SLOWEST_MOTOR:
        return
    behind = {name: float(speed) for name, speed in rig.speeds().items() if rig.turns_on(name)}
    name = min(behind, key=lambda one: abs(behind[one]), default="")
    if name and 0 < behind[name] <= rig.drive.velocity / LEAST_REDUCTION:
        motor, axis = (format_quantity(speed, "rad/s") for speed in (rig.drive.velocity, behind[name]))
        at = rig.drive.driven() or "the drive"
        yield (
            f"drive.velocity = {motor} is that of {at}, with which {name} turns at {axis}; "
            f'if it is that of {name} write velocity_of = "{name}"'
        )


def _pliable(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    """Warnings of bristle stiffnesses that have no unit and are far below all measured stiffnesses."""
    for name in rig.of_kind("bristle stiffness"):
        raw, si = read.get(name, (None, ""))
        friction = friction_at_rest(rig, name)
        if si == "1/m" and _is_between(raw, 0.0, friction / BENT) and not is_of_forces(rig, name):
            bend, load = format_quantity(friction / raw, "m"), format_quantity(rig.load_of(name) or 0.0, "N")
            yield (
                f"{name} = {raw:g} is read as {raw:g} 1/m, so that friction would bend the bristles by {bend}; "
                f'a stiffness is written with its load, "{raw:g} N/um at {load}"'
            )


def _light(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    """Warnings of loads that have no unit and are far less than a body's weight, or less than `LIGHTEST`."""
    for name in rig.of_kind("normal stress"):
        raw, si = read.get(name, (None, ""))
        load, weight = rig.load_of(name), G * mass_on(rig, name)
        if not _is_between(raw, 0.0, math.inf):
            continue
        if load is not None and load < LIGHT * weight:
            yield (
                f"{name} = {raw:g} has no unit and is read as {format_quantity(load, 'N')}; what slides there weighs "
                f"{format_quantity(weight, 'N')}: write the unit that is meant"
            )
        elif load is None and raw < LIGHTEST:
            yield (
                f"{name} = {raw:g} has no unit and is read as {raw:g} {si}, less than 10 cm of water press with: write "
                "the unit that is meant"
            )


def _is_between(raw: Any, low: float, high: float) -> bool:
    return isinstance(raw, (int, float)) and not isinstance(raw, bool) and low < raw < high


def _fits_better(number: float, texts: Sequence[str], si: str) -> bool:
    """True if a number in the unit of one of `texts` is nearer to the speeds in `texts` than in the SI unit."""
    speeds = [(abs(parse(text, si)), unit(name)[0]) for text in texts for name in units_in([text])]
    away = [(abs(math.log(number / v)), abs(math.log(number * factor / v))) for v, factor in speeds if v]
    return bool(away) and min(one for _, one in away) < min(one for one, _ in away)


def _outrun(rig: Rig, speed: float) -> str:
    """Text on how far a speed (m/s) exceeds the speeds of the friction law; empty if the speed is plausible."""
    kinds = ("reference rate", "velocity scale")
    own = {name: float(rig.value(name) or 0.0) for kind in kinds for name in rig.of_kind(kind)}
    if not any(own.values()) or speed < FAST or speed < BEYOND_LAW * max(own.values()):
        return ""
    name, scale = max(own.items(), key=lambda item: item[1])
    return f"{speed / scale:.2g} times {name}, {format_quantity(scale, 'm/s')}"
