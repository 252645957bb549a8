"""Questions about numbers without a unit and values that a law doubts, asked once where a rig file is read."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import UnitWarning
from steadyslip.core.format import format_quantity
from steadyslip.core.quantities import parse, units_in
from steadyslip.machine.rig import Rig

SPEEDS = ("m/s", "rad/s")
STIFFNESSES = ("N/m", "Pa/m")
STRETCHED = 1.0  # m: what friction stretches the softest of real axes and presses by is some 10 mm
FAST = 1.0  # m/s: the speed of seismic slip; faster contacts exist, but whoever types 20 may mean um/s or mm/min
FASTEST = 3e8  # m/s, of light: beyond, a number is refused in other words than those on its unit
LARGEST = {"slip distance": 0.1, "stress share": 0.6}
"""Largest measured values of friction parameters, by kind, SI units; a and b may be of forces, without a load."""
ABOVE = (5.0, 1e4)  # factors above these between which another unit or per cent may be meant
BEYOND_LAW = 1e5  # speed over a law's own beyond which it is questioned: laboratories span some five decades


def question_values(rig: Rig, read: Mapping[str, tuple[Any, str]], written: Iterable[str]) -> None:
    """Warn of speeds without a unit where the others have one, or far beyond the speeds of the friction.

    Also of stiffnesses without a unit that friction would stretch far, of friction parameters far above all measured,
    and of values that a friction law doubts.

    Parameters
    ----------
    rig : Slider or Machine
    read : mapping of str to (object, str)
        Names of the values read, each as it was written and with its SI unit.
    written : iterable of str
        Units that stand in the file. Where all are SI's own, as programs write them, only speeds are asked about.
    """
    by_programs = all(unit(name)[0] == 1.0 for name in written)
    typed = () if by_programs else (*_soft(rig, read), *_large(rig, read))
    for text in (*_questions(rig, read), *typed, *_doubts(rig)):
        warnings.warn(text, UnitWarning, stacklevel=2)


def _questions(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
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


def _doubts(rig: Rig) -> Iterator[str]:
    """What friction laws doubt, once for all contacts of which it is the same."""
    found: dict[str, list[str]] = {}
    for one in rig.laws_by_contact().values():
        for text in one.friction.doubts():
            found.setdefault(text, []).append(one.prefix)
    for text, (first, *others) in found.items():
        names = " and ".join(prefix.removesuffix(".") for prefix in (first, *others))
        yield f"{names}: {text}" if others else f"{first}{text}"


def _soft(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    """Questions about stiffnesses without a unit that the load of a contact would stretch by `STRETCHED` or more."""
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


def _large(rig: Rig, read: Mapping[str, tuple[Any, str]]) -> Iterator[str]:
    """Questions about friction parameters without a unit that are far above `LARGEST`."""
    for name, one in rig.parameters().items():
        raw, si = read.get(name, (None, ""))
        most = LARGEST.get(one.role.kind, math.inf)
        if isinstance(raw, (int, float)) and ABOVE[0] * most < raw < ABOVE[1] * most:
            was, largest = (format_quantity(value, si) for value in (float(raw), most))
            remedy = "a number in per cent is written as a share" if si == "1" else "write the unit that is meant"
            yield f"{name} = {raw:g} is read as {was}; the largest measured are some {largest}: {remedy}"


def _fits_better(number: float, texts: Sequence[str], si: str) -> bool:
    """True if a number is nearer to the speeds of texts in the unit of one of them than in the SI unit."""
    speeds = [(abs(parse(text, si)), unit(name)[0]) for text in texts for name in units_in([text])]
    away = [(abs(math.log(number / v)), abs(math.log(number * factor / v))) for v, factor in speeds if v]
    return bool(away) and min(one for _, one in away) < min(one for one, _ in away)


def _outrun(rig: Rig, speed: float) -> str:
    """How far a speed is beyond those of the friction; empty if it is not."""
    kinds = ("reference rate", "velocity scale")
    own = {name: float(rig.value(name) or 0.0) for kind in kinds for name in rig.of_kind(kind)}
    if not any(own.values()) or speed < FAST or speed < BEYOND_LAW * max(own.values()):
        return ""
    name, scale = max(own.items(), key=lambda item: item[1])
    return f"{speed / scale:.2g} times {name}, {format_quantity(scale, 'm/s')}"
