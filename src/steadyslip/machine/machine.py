"""Machines of named bodies, links, contacts and a drive."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any, ClassVar, Self

import numpy as np

from steadyslip.core.areas import is_per_area, stress_name, total_unit
from steadyslip.core.domains import Condition
from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.core.names import Members
from steadyslip.core.records import Address, members, part
from steadyslip.machine.bodies import Body
from steadyslip.machine.ends import body_of, floating_body, unknown_body, unreferenced_bodies
from steadyslip.machine.holding import AS_MEASURED, as_measured
from steadyslip.machine.input_units import TURNING
from steadyslip.machine.links import Link
from steadyslip.machine.mechanism import (
    GROUND,
    LOAD_POINT,
    NORMAL,
    ContactPort,
    DegreeOfFreedom,
    Element,
    Integral,
    Mechanism,
    StructurePart,
)
from steadyslip.machine.rig import LawsOfContact, Rig
from steadyslip.machine.servo import MachineDrive, control_for, wrong_control
from steadyslip.machine.speeds import Tie, is_zero, rigid_motion, structure_ties
from steadyslip.machine.structures import StructureBody
from steadyslip.machine.surfaces import Surface
from steadyslip.protocol import protocol
from steadyslip.protocol.protocol import Piece

_SPEED_TOLERANCE = 1e-9  # relative difference of an end's speeds by two routes that counts as rounding; chosen by trial


class Machine(Rig):
    """Bodies that slide or turn, tied to each other by links, with one contact or several (theory 11).

    Quantities are forces, not stresses: masses in kg, stiffnesses in N/m. In steady sliding all bodies move at constant
    speeds in fixed ratios to the drive's velocity. Parameters have dotted names such as ``bodies.table.mass``,
    ``links.screw.stiffness``, ``contacts.guide.friction.a``; the last part is enough if it is unique.
    """

    area: ClassVar[None] = None
    """None: an area (m²) converts a slider's stresses to forces; results of a machine are forces already."""
    in_forces: ClassVar[bool] = True

    fed: ClassVar[str | None] = None
    """Body in `velocity_of`, if the user gave its speed: drive.velocity is printed as its speed; not compared by ==."""

    words: ClassVar[Mapping[str, str]] = {
        "rig": "machine", "block": "body", "place": "bodies.{}", "damping": "a dashpot to the ground",
        "mass": "the body that slips there a mass (or a damped link to the ground)",
    }  # fmt: skip

    bodies: Any = members(Body, "bodies, by name")
    links: Any = members(Link, "links, by name", default=Members())
    contacts: Any = members(Surface, "contacts, by name")
    drive: MachineDrive = part(MachineDrive, "drive")

    # -- checks

    def _settled(self) -> Iterator[Problem]:
        """Convert the velocity of another body (`velocity_of`) to that of the drive; yield Problems if impossible."""
        yield from super()._settled()
        name = self.drive.velocity_of
        if name is None or not all(len(link.between) == 2 for link in self.links.values()):
            return
        where, unknown = "drive.velocity_of", list(self._end("drive.velocity_of", name, ()))
        yield from unknown
        speed = self._speeds()[0].get(name)
        if unknown or speed is None:
            return  # `inconsistencies` reports bodies whose speed is undetermined
        if not speed > 0:
            does = "stands still" if speed == 0 else "moves backwards"
            yield Problem(where, f"{name!r} {does} in steady sliding; name a body that moves forwards")
            return
        given = self.drive.velocity
        own = 0.0 if self.holds else given * (given / speed)
        object.__setattr__(self, "drive", replace(self.drive, velocity=own, velocity_of=None))
        object.__setattr__(self, "fed", name)

    def with_values(self, changes: Mapping[str, Any]) -> Self:
        made = super().with_values(changes)
        object.__setattr__(made, "fed", self.fed)
        return made

    def feed(self) -> tuple[float, bool]:
        if self.fed is None:
            return super().feed()
        pace = 1.0 if self.holds else float(self.drive.velocity)
        return float(self._speeds()[0][self.fed]) / pace, bool(self._turns(self.fed))

    def ratios(self) -> dict[str, float]:
        """Steady speed of each body divided by that of the drive, by name (1, or m or rad per m or rad)."""
        speeds, pace = self._speeds()[0], 1.0 if self.holds else float(self.drive.velocity)
        return {name: float(speeds[name]) / pace for name in self.bodies if name in speeds}

    def seen(self) -> tuple[float, bool]:
        driven = self.drive.driven()
        if driven is None:
            return super().seen()
        measured, speeds = self.drive.watched()[0], self._speeds()[0]
        return abs(float(speeds[measured] / speeds[driven])), bool(self._turns(measured))

    def display_value(self, name: str, value: float) -> tuple[float, str]:
        if name != "drive.velocity" or self.fed is None:
            return super().display_value(name, value)
        ratio, turns = self.feed()
        return value * ratio, "rad/s" if turns else "m/s"

    def inconsistencies(self) -> Iterator[Problem]:
        faults = [*self._name_problems(), *self._end_problems()]
        if self.holds and any(body.is_structure for body in self.bodies.values()):
            yield Problem("drive.velocity", "got 0; a machine with a structure cannot hold a place; allowed: > 0")
        yield from faults
        if not faults:
            yield from self._contact_problems()
            yield from self._floating()
        else:
            ends = [end for link in self.links.values() for end in link.between]
            ends += [end for surface in self.contacts.values() for end in (surface.body, surface.against)]
            yield from unreferenced_bodies(self.bodies, [*map(body_of, ends), self.drive.driven()])

    def _name_problems(self) -> Iterator[Problem]:
        for name in (GROUND, LOAD_POINT):
            if name in self.bodies:
                yield Problem(f"bodies.{name}", "is a reserved name in links and contacts; give the body another name")
        for kind, what in (("bodies", self.bodies), ("contacts", self.contacts)):
            if not what:
                yield Problem(kind, f"missing; a machine needs at least one, in a table [{kind}.NAME]")

    def _end(self, where: str, name: str, allowed: tuple[str, ...] = (GROUND, LOAD_POINT)) -> Iterator[Problem]:
        return unknown_body(where, name, [*self.ends(), *allowed])

    def ends(self) -> tuple[str, ...]:
        """Names to which links and contacts can refer: bodies, and points of structures such as ``caliper.pad``."""
        return tuple(
            end for name, body in self.bodies.items()
            for end in ([f"{name}.{one}" for one in body.point_names()] if body.is_structure else [name])
        )  # fmt: skip

    def _structure_at(self, end: str) -> tuple[str, StructureBody, str] | None:
        """Name, body and point of an end that is a point of a structure; None for other ends."""
        name, _, point = end.partition(".")
        return (name, self.bodies[name], point) if point and name in self.bodies else None

    def _end_problems(self) -> Iterator[Problem]:
        """Yield Problems for ends of links, contacts and drive: unknown bodies, or the wrong kind of motion."""
        for name, link in self.links.items():
            problems = [wrong for end in link.between for wrong in self._end(f"links.{name}.between", end)]
            yield from problems
            if not problems and not self._fits(type(link), link.between):
                yield self._wrong_ends(name, link)
            kept = [end for end in link.between if end not in (GROUND, LOAD_POINT) and not self._lifts(end)]
            if "y" in link.directions() and kept:
                message = (
                    f"pulls at an angle, but {kept[0]!r} cannot move away from the surface, so that its support is not "
                    "defined; write motion = 'plane' for it, or give its contact the law inclined-spring"
                )
                yield Problem(f"links.{name}", message)
            if set(link.between) == {GROUND, LOAD_POINT}:
                yield Problem(f"links.{name}.between", "has no body at either end; name a body at one end at least")
        for name, surface in self.contacts.items():
            yield from self._end(f"contacts.{name}.body", surface.body, (LOAD_POINT,))
            yield from self._end(f"contacts.{name}.against", surface.against)
            if surface.body == surface.against:
                yield Problem(f"contacts.{name}.against", f"{surface.body!r} cannot slide on itself")
            if {surface.body, surface.against} == {GROUND, LOAD_POINT}:
                yield Problem(f"contacts.{name}.against", "no body slides there; name one as body or against")
            if surface.loaded_by is not None and surface.loaded_by not in self.links:
                yield Problem(f"contacts.{name}.loaded_by", unknown_name("link", surface.loaded_by, self.links))
        if self.drive.driven() is not None:
            for key in ("body", "measured", "speed_measured"):
                end = getattr(self.drive, key, None)
                if end is not None:
                    yield from self._end(f"drive.{key}", end, ())
            body = self.bodies.get(self.drive.driven())
            if body is not None and body.turns != self.drive.turns:
                yield wrong_control(self.drive.name, str(self.drive.driven()), body.turns)

    def _fits(self, kind: type[Link], ends: Sequence[str]) -> bool:
        """True if each end turns or slides as a kind of link requires."""
        return all(self._turns(end) in (turning, None) for end, turning in zip(ends, kind.turning, strict=True))

    def _wrong_ends(self, name: str, link: Link) -> Problem:
        """Problem for a link with an end that turns but should slide, or the reverse; the message proposes a remedy."""
        first, second = link.between
        wrong = next(end for end, turning in zip(link.between, link.turning, strict=True)
                     if self._turns(end) not in (turning, None))  # fmt: skip
        message = f"{wrong!r} {'turns' if self._turns(wrong) else 'slides'}, but this end of a {link.name} does not; "
        if self._fits(type(link), (second, first)):
            message += f"exchange the two: between = {json.dumps([second, first])}"
        elif wrong == LOAD_POINT and self.drive.driven() is None:
            message += f"write control = {control_for(self.drive.name, not self.drive.turns)!r} in [drive]"
        else:
            fits = [repr(kind) for kind, one in Link.registry.items() if self._fits(one, link.between)]  # type: ignore[arg-type]
            message += f"kinds of link for these ends: {' or '.join(fits)}" if fits else "see the kinds of link"
        return Problem(f"links.{name}.between", message)

    def _turns(self, end: str) -> bool | None:
        if end == GROUND:
            return None
        if self._structure_at(end) is not None:
            return False
        return self.drive.turns if end == LOAD_POINT else bool(self.bodies[end].turns)

    def _lifts(self, end: str) -> bool:
        if (found := self._structure_at(end)) is not None:
            return bool(found[1].moves_away(found[2]))
        return end in self.bodies and bool(self.bodies[end].lifts)

    def _contact_problems(self) -> Iterator[Problem]:
        for name, surface in self.contacts.items():
            where, ends = f"contacts.{name}", (surface.body, surface.against)
            turning = [bool(self._turns(end)) for end in ends]
            if turning[0] and surface.radius is None:
                yield Problem(f"{where}.radius", f"missing; {surface.body!r} turns, and its slip is radius times angle")
            if surface.radius is not None and not turning[0]:
                yield Problem(f"{where}.radius", f"given, but {surface.body!r} does not turn")
            if turning[1]:
                yield Problem(f"{where}.against", f"{surface.against!r} turns; exchange body and against")
            lifting = any(map(self._lifts, ends))
            if surface.contact.is_compliant() and not lifting:
                yield Problem(
                    f"{where}.contact", "a compliant contact needs a body that moves away from the surface; write "
                    f"motion = 'plane' for {surface.body!r}",
                )  # fmt: skip
            link = self.links.get(surface.loaded_by)
            if link is not None and surface.held not in link.between:
                yield Problem(f"{where}.loaded_by", f"the link {surface.loaded_by!r} does not end at {surface.held!r}")
            elif link is not None and "x" not in link.directions():
                message = (
                    f"the link {surface.loaded_by!r} pulls only away from the surface; allowed: a link along the slide"
                )
                yield Problem(f"{where}.loaded_by", message)
        for name, body in self.bodies.items():
            carried = any(name in (c.body, c.against) and c.contact.is_compliant() for c in self.contacts.values())
            held = any(name in link.between and "y" in link.directions() for link in self.links.values())
            if body.lifts and not carried and not held:
                yield Problem(
                    f"bodies.{name}", "has no support: give it a compliant contact, or a link away from the surface"
                )

    def _floating(self) -> Iterator[Problem]:
        speeds, _ = self._speeds()
        for name, body in self.bodies.items():
            if body.is_structure:
                yield from self._held(name, body, speeds)
            elif name not in speeds:
                yield floating_body(name)

        for body in () if self.drive.driven() is None else dict.fromkeys(self.drive.watched()):
            if body in speeds and not speeds[body]:
                yield Problem("drive.measured", f"{body!r} stands still in steady sliding; measure a body that moves")

    def _held(self, name: str, body: StructureBody, speeds: Mapping[str, Any]) -> Iterator[Problem]:
        """Yield a Problem for a structure whose motion in steady sliding is undetermined."""
        free = body.data.rigid_motions.shape[1]
        if free > 1:
            yield Problem(
                f"bodies.{name}.matrices", f"leave the structure {free} rigid motions; allowed: none, or one along the "
                "slide; add supports to the stiffness matrix",
            )  # fmt: skip
        elif not any(f"{name}.{one}" in speeds for one in body.point_names()):
            yield floating_body(name)

    def conditions(self) -> Iterator[Condition]:
        """Yield the conditions that links of a loop agree on speeds, and that all contacts slide forwards."""
        speeds, closing = self._speeds()
        for tie, speed, other in closing:
            message = f"the links contradict each other: {tie.second} would move at {{}} and also at {{}} m/s or rad/s"
            same = np.abs(np.asarray(speed - other)) <= _SPEED_TOLERANCE * np.abs(np.asarray(speed))
            yield Condition("drive" if tie.name == "drive" else "links", same, message, (speed, other))
        for name, surface in self.contacts.items():
            slip = self._slip_rate(surface, speeds)
            message = (
                "its slip rate in steady sliding is {} m/s; allowed: > 0; bodies that move together "
                "do not slide, and where it is negative exchange body and against"
            )
            yield Condition(f"contacts.{name}", np.asarray(slip) > 0, message, (slip,))

    # -- steady motion

    def _ties(self) -> list[Tie]:
        ties = [
            Tie(name, link.between[0], link.between[1], link.ratio())
            for name, link in self.links.items()
            if link.keeps_pace()
        ]
        driven = self.drive.driven()
        ties = ties if driven is None else [Tie("drive", LOAD_POINT, driven, 1), *ties]
        return [*ties, *(tie for name, body in self.bodies.items() if body.is_structure
                         for tie in structure_ties(name, body))]  # fmt: skip

    def _speeds(self) -> tuple[dict[str, Any], list[tuple[Tie, Any, Any]]]:
        still = {
            end: 0 for end in self.ends()
            if (at := self._structure_at(end)) is not None and not at[1].data.rigid_motions.size
        }  # fmt: skip
        # if the drive holds a place, only the ratios of the speeds are used
        pace = 1.0 if self.holds else self.drive.velocity
        speeds, closing = rigid_motion({LOAD_POINT: pace, GROUND: 0, **still}, self._ties())
        return {name: 0 if is_zero(speed) else speed for name, speed in speeds.items()}, closing

    def speeds(self) -> dict[str, Any]:
        """Speeds (m/s or rad/s) of bodies and of points of structures in steady sliding, by name."""
        speeds, _ = self._speeds()
        return {name: 0 if self.holds else speeds[name] for name in self.ends()}

    def _slip_rate(self, surface: Surface, speeds: dict[str, Any]) -> Any:
        lever = 1 if surface.radius is None else surface.radius
        return lever * speeds[surface.body] - speeds[surface.against]

    @property
    def contact_names(self) -> tuple[str, ...]:
        return tuple(self.contacts)

    def result_name(self, name: str) -> str:
        return name.replace("stress", "force")

    def result_unit(self, unit: str) -> str:
        return unit.replace("Pa", "N")

    def protocol_unit(self, piece: Piece, unit: str) -> str:
        if unit in TURNING:
            return TURNING[unit] if self.piece_turns(piece) else unit
        if unit != "Pa":
            return unit
        return "N m" if self.piece_turns(piece) else "N"

    @property
    def protocol_area(self) -> float | None:
        return 1.0  # loads of a machine are forces, though they are declared as stresses

    def piece_turns(self, piece: Piece) -> bool:
        """True if the body or load point that a piece of a protocol acts on rotates."""
        if piece.channel == protocol.LOAD_POINT or piece.frees_load_point:
            return self.drive.turns
        return piece.channel == protocol.DISTURBANCE and self.turns_on(getattr(piece, "on", None))

    def turns_on(self, body: str | None) -> bool:
        name = body or (next(iter(self.bodies)) if len(self.bodies) == 1 else "")
        # a misspelt name is reported later, by motion/targets.py
        meant = [name] if name in self.bodies else get_close_matches(name, self.bodies, 1)
        return any(self.bodies[one].turns for one in meant)

    def kept_zeros(self, name: str | None = None) -> tuple[str, ...]:
        return () if name is None or self.value(name) else (name,)

    def check_branch(self, branch: int) -> None:
        if branch:
            raise ParameterError([Problem("branch", f"got {branch}; allowed: 0, the one steady sliding of a machine")])

    def laws_by_contact(self) -> dict[str, LawsOfContact]:
        return {
            name: LawsOfContact(f"contacts.{name}.", one.friction, one.contact, one.area)
            for name, one in self.contacts.items()
        }

    def pulls_at(self, contact: str) -> tuple[str, ...]:
        mechanism = self.mechanism()
        port = next(one for one in mechanism.contacts if one.name == contact)
        sliding = set(port.slip) - {LOAD_POINT}
        names = [one.name for one in mechanism.pulling(port) if sliding & set(one.acts)]
        return tuple(dict.fromkeys(name.removeprefix("links.") or "the controller" for name in names))

    def lever_at(self, contact: str) -> float | None:
        surface = self.contacts[contact]
        pulled = surface.loaded_by is None or surface.body in self.links[surface.loaded_by].between
        radius: float | None = surface.radius
        return radius if pulled and surface.body in self.bodies else None

    def area_of(self, name: str) -> float | None:
        kind, _, rest = name.partition(".")
        if kind != "contacts":
            return None
        area: float | None = self.contacts[rest.partition(".")[0]].area
        return area

    def printed_area(self, name: str) -> float | None:
        return None

    def declared(self) -> dict[str, Address]:
        """Parameters by dotted name, collected anew; laws of contacts without an area have units of force."""
        return {name: self._as_measured(self._in_forces(one)) for name, one in super().declared().items()}

    def _as_measured(self, one: Address) -> Address:
        """Parameter with the unit of the measured body if it is a controller's dead band or encoder step."""
        if one.name not in AS_MEASURED or self.drive.driven() is None:
            return one
        return replace(one, role=as_measured(one.role, bool(self._turns(self.drive.watched()[0]))))

    def _in_forces(self, one: Address) -> Address:
        if not one.name.startswith("contacts.") or self.area_of(one.name) or not is_per_area(one.role.unit):
            return one
        doc = stress_name(one.role.doc, 1.0)
        return replace(one, role=replace(one.role, unit=total_unit(one.role.unit), doc=doc))

    # -- assembly

    def mechanism(self) -> Mechanism:
        """Mechanism with one coordinate for each body, and a second one for bodies that move away from the surface."""
        speeds, _ = self._speeds()
        coordinates = []
        for name, body in self.bodies.items():
            if body.is_structure:
                continue
            unit = "rad" if body.turns else "m"
            pace = 0 if self.holds else speeds[name]
            coordinates.append(DegreeOfFreedom(name, body.inertia_of(), pace, body.along(), unit))
            if body.lifts:
                coordinates.append(DegreeOfFreedom(name + NORMAL, body.inertia_of(), 0, body.away()))
        elements = [self._element(name, link) for name, link in self.links.items()]
        controls, integral = self._control(speeds)
        contacts = tuple(
            ContactPort(
                name, surface.friction, surface.contact,
                self._slip_row((surface.body, surface.against), surface.radius), self._separation_row(surface),
                1 if surface.area is None else surface.area,
                "" if surface.loaded_by is None else f"links.{surface.loaded_by}",
            )
            for name, surface in self.contacts.items()
        )  # fmt: skip
        structures = tuple(_structure_part(n, b, speeds) for n, b in self.bodies.items() if b.is_structure)
        points = {
            end + suffix: row
            for end in self.ends()
            if self._structure_at(end) is not None
            for axis, suffix in (("x", ""), ("y", NORMAL))
            if (row := self.row(end, axis))
        }
        velocity, limits = self.drive.velocity, self.drive.limits()
        if limits is not None and (limits.resolution or limits.dead_band):
            limits = limits.over(self.seen()[0])
        return Mechanism(
            tuple(coordinates),
            (*elements, *controls),
            integral,
            contacts,
            velocity,
            structures=structures,
            points=points,
            limits=limits,
        )

    def row(self, end: str, axis: str) -> dict[str, Any]:
        """Row (coefficients by coordinate) of an end's motion along the slide (``x``) or off the surface (``y``)."""
        if (found := self._structure_at(end)) is not None:
            name, body, point = found
            shares = body.rows(point)[axis == "y"]
            return {coordinate(name, int(i)): float(shares[i]) for i in np.flatnonzero(shares)}
        return {} if end == GROUND else {end: 1} if axis == "x" else {end + NORMAL: 1} if self._lifts(end) else {}

    def _slip_row(self, ends: tuple[str, str], lever: Any = None) -> dict[str, Any]:
        """Row (coefficients by coordinate) of the slip of the first end relative to the second."""
        return _combined((1 if lever is None else lever, self.row(ends[0], "x")), (-1, self.row(ends[1], "x")))

    def _separation_row(self, surface: Surface) -> dict[str, Any]:
        return _combined((1, self.row(surface.held, "y")), (-1, self.row(surface.base, "y")))

    def _element(self, name: str, link: Link) -> Element:
        shares = link.directions()
        row = _combined(*(
            (share * cosine, self.row(end, axis))
            for end, share in zip(link.between, (-link.ratio(), 1), strict=True)
            for axis, cosine in shares.items()
        ))  # fmt: skip
        stiffness = 0 if link.rigidity() is None else link.rigidity()
        return Element(f"links.{name}", row, row, stiffness, link.dashpot(), GROUND in link.between)

    def _control(self, speeds: dict[str, Any]) -> tuple[tuple[Element, ...], Integral | None]:
        """Elements and integral action of the controller, which may measure other bodies than the driven one."""
        driven = self.drive.driven()
        if driven is None:
            return (), None
        place, speed = ({body: speeds[driven] / speeds[body], LOAD_POINT: -1} for body in self.drive.watched())
        kp, kd, held, ki = self.drive.gains()
        acts, late = {driven: 1}, self.drive.lateness()
        elements = [Element("", acts, place, kp, kd if place == speed else 0, delay=late, active=True)]
        if place != speed or held != 0:
            elements.append(Element("", acts, speed, held, 0 if place == speed else kd, delay=late, active=True))
        sensed = {name: share for name, share in place.items() if name != LOAD_POINT}
        return tuple(elements), None if ki is None else Integral(acts, sensed, ki, late)


def coordinate(name: str, place: int) -> str:
    """Name of degree of freedom `place` (from 0) of a structure; has a space, which no name of a body can contain."""
    return f"{name} {place + 1}"


def _combined(*parts: tuple[Any, Mapping[str, Any]]) -> dict[str, Any]:
    """Sum of rows (coefficients by coordinate), each multiplied by a factor."""
    found: dict[str, Any] = {}
    for factor, row in parts:
        for name, share in row.items():
            own = factor if isinstance(share, int) and share == 1 else factor * share
            found[name] = found[name] + own if name in found else own
    return found


def _structure_part(name: str, body: StructureBody, speeds: Mapping[str, Any]) -> StructurePart:
    """StructurePart of a structure: its matrices, and the rigid motion that fits the steady `speeds` of its points."""
    data = body.data
    motion, pace = np.zeros(data.size), 0
    if data.rigid_motions.shape[1] == 1:
        motion = data.rigid_motions[:, 0]
        points = [(float(body.rows(one)[0] @ motion), speeds[f"{name}.{one}"]) for one in body.point_names()]
        share, speed = max(points, key=lambda pair: abs(pair[0]))
        pace = speed / share
    places = tuple(coordinate(name, i) for i in range(data.size))
    return StructurePart(name, places, data.mass, body.damping_matrix(), data.stiffness, body.forces(), motion, pace)
