"""Sketch of a machine: layout of bodies, links, contacts and drive with their names and values.

Bodies are placed in columns, ordered by the number of links from the drive; a body in sliding contact with one of these
is placed above or below it. A `Pencil` is a drawing back end: `steadyslip.figures` has one for Matplotlib,
`steadyslip.explorer` one for SVG. Lengths are in units of the drawing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from steadyslip.core.format import format_own, format_quantity
from steadyslip.machine.links import Link
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import GROUND, LOAD_POINT
from steadyslip.machine.servo import kind_of_control
from steadyslip.machine.surfaces import Surface

Point = tuple[float, float]
INK, PALE, DRIVEN, FORCED = "ink", "pale", "driven", "forced"
"""Colours of bodies and links, of the ground, of the drive, and of constant forces."""
# sizes chosen by trial, so that labels and links do not overlap
_WIDE, _HIGH = 1.7, 1.15  # width and height of a body
LONG = 9  # largest number of letters of a name in normal type; longer names are written in small type
_ACROSS, _UP = 3.7, 1.85  # distance between columns, and between rows of bodies that slide on each other
_HOLD = 1.5  # length of links to a wall


@dataclass
class _Place:
    """Centre of a body in the sketch, and number of links attached on its left and right side."""

    x: float
    y: float
    taken: dict[str, int] = field(default_factory=dict)

    def side(self, way: str) -> tuple[float, float]:
        """Point at which the next link is attached on the side ``"left"`` or ``"right"``; links differ in height."""
        count = self.taken.get(way, 0)
        self.taken[way] = count + 1
        step = (0.0, 0.3, -0.3, 0.45, -0.45)[min(count, 4)]
        return self.x + (_WIDE / 2 if way == "right" else -_WIDE / 2), self.y + step


class Pencil:
    """Base of drawing back ends; subclasses draw lines, text and shapes."""

    def line(self, *points: Point, color: str = INK, linewidth: float = 1.2, dashed: bool = False) -> None:
        """Draw a line through points."""
        raise NotImplementedError

    def words(
        self, x: float, y: float, text: str, *, ha: str = "center", va: str = "center", color: str = INK,
        large: bool = False, paper: bool = False,
    ) -> None:  # fmt: skip
        """Write text, small unless `large`; with `paper` on an opaque background."""
        raise NotImplementedError

    def arrow(self, start: Point, end: Point, *, color: str = DRIVEN, dashed: bool = False) -> None:
        """Draw an arrow."""
        raise NotImplementedError

    def block(self, name: str, x: float, y: float, wide: float, high: float, text: str) -> None:
        """Draw a sliding body with its text; x, y is the lower left corner."""
        raise NotImplementedError

    def wheel(self, name: str, x: float, y: float, radius: float, text: str) -> None:
        """Draw a rotating body with its text; x, y is the centre."""
        raise NotImplementedError

    def rough(self, corners: list[Point]) -> None:
        """Draw a hatched piece of ground."""
        raise NotImplementedError

    def gouge(self, x: float, y: float, wide: float, high: float) -> None:
        """Draw the interface between two bodies that slide on each other."""
        raise NotImplementedError

    def frame(self, x: float, y: float, wide: float, high: float) -> None:
        """Draw the box of a controller."""
        raise NotImplementedError

    def hatched(self, x: float, y: float, wide: float, high: float) -> None:
        """Draw a horizontal piece of ground."""
        self.rough([(x, y), (x + wide, y), (x + wide, y + high), (x, y + high)])

    def link(self, start: Point, end: Point, sprung: bool, damped: bool, ends: tuple[str, str]) -> None:
        """Draw a spring, a dashpot, or both in parallel; `ends` are the names of the bodies, empty for a wall."""
        both = sprung and damped
        (x, y), (far, high) = start, end
        long = math.hypot(far - x, high - y)
        aside = 0.17 if both else 0.0
        dx, dy = -aside * (high - y) / long, aside * (far - x) / long
        if sprung:
            self.spring((x + dx, y + dy), (far + dx, high + dy))
        if damped:
            self.dashpot((x - dx, y - dy), (far - dx, high - dy))
        if both:
            for end_x, end_y in (start, end):
                self.line((end_x + dx, end_y + dy), (end_x - dx, end_y - dy))

    def spring(self, start: Point, end: Point) -> None:
        """Draw a zigzag line."""
        zigzag = [(0.2 + 0.06 * (i + 0.5), 0.11 * (-1) ** i) for i in range(10)]
        self._along(start, end, [(0, 0), (0.2, 0), *zigzag, (0.8, 0), (1, 0)])

    def dashpot(self, start: Point, end: Point) -> None:
        """Draw a piston in a cylinder."""
        cylinder: list[Point] = [(0.62, 0.1), (0.42, 0.1), (0.42, -0.1), (0.62, -0.1)]
        parts: list[list[Point]] = [[(0, 0), (0.42, 0)], cylinder, [(0.54, 0.075), (0.54, -0.075)], [(0.54, 0), (1, 0)]]
        for part in parts:
            self._along(start, end, part)

    def _along(self, start: Point, end: Point, points: list[Point]) -> None:
        """Draw a line in coordinates of start and end: fractions of the distance, and units across it."""
        (x, y), (far, high) = start, end
        dx, dy = far - x, high - y
        long = math.hypot(dx, dy)
        self.line(*((x + t * dx - u * dy / long, y + t * dy + u * dx / long) for t, u in points))


class Drawing:
    """Sketch of one machine: the slide points to the right, away from the surface is up.

    Without `values` only names are written, for pages on which the numbers change.
    """

    def __init__(self, machine: Machine, pencil: Pencil, values: bool = True) -> None:
        self.machine, self.pencil, self.values = machine, pencil, values
        self.places = _places(machine)
        self.drive_drawn, self.detours, self.levels = False, 0, 0

    def draw(self) -> None:
        """Draw bodies, links, contacts and drive."""
        for name in self.machine.bodies:
            self._body(name)
        for name, link in self.machine.links.items():
            self._link(name, link)
        for name in self.machine.bodies:
            self._contacts(name)
        self._drive()

    def _label(self, name: str, value: str, between: str = "\n") -> str:
        """Name, followed by the value if values are written."""
        return f"{name}{between}{value}" if self.values else name

    # -- bodies and contacts

    def _body(self, name: str) -> None:
        body, place = self.machine.bodies[name], self.places[name]
        inertia = body.inertia_of()
        weighs = format_quantity(inertia, "kg m^2" if body.turns else "kg") if inertia else "no mass"
        text = self._label(name, weighs)
        if body.turns:
            for side in (-1, 1):
                near, far = place.x + side * _HIGH / 1.7, place.x + side * _WIDE / 2
                self.pencil.line((far, place.y), (near, place.y), linewidth=3)
            self.pencil.wheel(name, place.x, place.y, _HIGH / 1.7, text)
        else:
            self.pencil.block(name, place.x - _WIDE / 2, place.y - _HIGH / 2, _WIDE, _HIGH, text)
        self._forces(name)

    def _forces(self, name: str) -> None:
        body, place = self.machine.bodies[name], self.places[name]
        along, away = float(body.along()), float(body.away())
        if along:
            y, way = place.y + _HIGH / 2 + 0.22, math.copysign(0.7, along)
            x = place.x + (0.95 if self.machine.drive.driven() == name else 0.0)  # beside the controller's arrow
            self.pencil.arrow((x - way / 2, y), (x + way / 2, y), color=FORCED)
            size = format_quantity(abs(along), "N m" if body.turns else "N") if self.values else "force"
            self.pencil.words(x, y + 0.2, size, color=FORCED, va="bottom")
        if away:
            x, y = place.x + 0.6, place.y + _HIGH / 2
            start, end = ((x, y + 0.75), (x, y + 0.04)) if away < 0 else ((x, y + 0.04), (x, y + 0.75))
            self.pencil.arrow(start, end, color=FORCED)
            size = format_quantity(abs(away), "N") if self.values else "force"
            self.pencil.words(x + 0.12, y + 0.6, size, color=FORCED, ha="left")

    def _contacts(self, name: str) -> None:
        """Draw the contacts of a body: pads on ground or drive side by side, and interfaces with other bodies."""
        place = self.places[name]
        own = [(n, one) for n, one in self.machine.contacts.items() if one.held == name]
        beside = [(n, one) for n, one in own if one.base in (GROUND, LOAD_POINT)]
        wide = max(_WIDE, 1.25 * len(beside)) / max(len(beside), 1)
        for i, (contact, one) in enumerate(beside):
            x = place.x + (i - (len(beside) - 1) / 2) * wide
            self._pad(x, place, wide, contact, one)
        for contact, one in own:
            if one.base in self.machine.bodies:
                self._interface(place, self.places[one.base], contact, one)

    def _pad(self, x: float, place: _Place, wide: float, name: str, one: Surface) -> None:
        top = place.y - _HIGH / 2
        gap = 0.38 if one.contact.is_compliant() else 0.1
        foot, half = top - gap, wide / 2 - 0.06
        if one.contact.is_compliant():
            for shift in (-0.5, 0.5):
                self.pencil.spring((x + shift, top), (x + shift, foot))
        else:
            self.pencil.line((x - 0.8 * half, foot + 0.04), (x + 0.8 * half, foot + 0.04), linewidth=4, color=PALE)
        self.pencil.line((x - half, foot), (x + half, foot), linewidth=1.6)
        if abs(x - place.x) + half > _WIDE / 2 + 0.2:  # the pad reaches beyond the body: draw a bracket
            self.pencil.line((x, top), (x, foot))
            self.pencil.line((place.x, top), (x, top))
        self.pencil.hatched(x - half, foot - 0.2, 2 * half, 0.2)
        if one.base == LOAD_POINT:
            self.pencil.arrow((x - 0.3, foot - 0.1), (x + 0.3, foot - 0.1))
        self.pencil.words(x, foot - 0.28, self._label(name, self._load(name, one)), va="top")

    def _interface(self, place: _Place, other: _Place, name: str, one: Surface) -> None:
        if abs(place.x - other.x) < 0.1 and abs(abs(place.y - other.y) - _UP) < 0.1:
            y = (place.y + other.y) / 2
            for edge in (place.y, other.y):
                near = edge + math.copysign(_HIGH / 2, y - edge)
                self.pencil.line((place.x - _WIDE / 2, near), (place.x + _WIDE / 2, near), linewidth=2.4)
            self.pencil.gouge(place.x - _WIDE / 2, y - (_UP - _HIGH) / 2, _WIDE, _UP - _HIGH)
            self.pencil.words(place.x, y, self._label(name, self._load(name, one)), paper=True)
            return
        self.detours += 1
        y = min(p.y for p in self.places.values()) - _HIGH / 2 - 0.85 - 0.35 * self.detours
        ends = [(p.x - 0.6, p.y - _HIGH / 2) for p in (place, other)]
        self.pencil.line(ends[0], (ends[0][0], y), (ends[1][0], y), ends[1], dashed=True, color=PALE)
        self.pencil.words((ends[0][0] + ends[1][0]) / 2, y, self._label(name, self._load(name, one), ", "), paper=True)

    def _load(self, name: str, one: Surface) -> str:
        """Text with a contact's load and radius."""
        return self._pressed(name, one) + (f" at {format_own(one.radius, 'm')}" if one.radius is not None else "")

    def _pressed(self, name: str, one: Surface) -> str:
        if one.loaded_by is not None:
            return f"pressed by {one.loaded_by}"
        for full, known in self.machine.parameters().items():
            labelled = known.role.kind in ("normal stress", "stiffness") and known.value is not None
            if labelled and full.startswith(f"contacts.{name}.contact."):
                return format_own(float(known.value or 0.0), known.role.unit, self.machine.printed_area(full))
        return one.contact.name

    # -- links

    def _link(self, name: str, link: Link) -> None:
        bodies = [end for end in link.between if end in self.places]
        if len(bodies) == 1:
            self._to_wall(name, link, bodies[0])
        elif self.places[bodies[0]].x == self.places[bodies[1]].x:
            low, up = sorted(bodies, key=lambda n: self.places[n].y)
            one, two = self.places[low], self.places[up]
            x = one.x + _WIDE / 2 + 0.4
            start, end = (x, one.y + 0.35), (x, two.y - 0.35)
            for at in (start, end):
                self.pencil.line((one.x + _WIDE / 2, at[1]), at)
            self.pencil.link(start, end, link.rigidity() is not None, link.is_damped(), (low, up))
            self._named(name, link, (start[0] + 0.25, (start[1] + end[1]) / 2), ha="left", va="center")
        else:
            left, right = sorted(bodies, key=lambda n: self.places[n].x)
            one, two = self.places[left], self.places[right]
            if two.x - one.x > _ACROSS + 0.1 or one.y != two.y or one.taken.get("right") or two.taken.get("left"):
                self._over(name, link, left, right)
                return
            start, end = one.side("right"), two.side("left")
            if abs(start[1] - end[1]) < 0.5:
                end = end[0], start[1]
            self.pencil.link(start, end, link.rigidity() is not None, link.is_damped(), (left, right))
            self._named(name, link, ((start[0] + end[0]) / 2, max(start[1], end[1]) + 0.32), va="bottom")

    def _over(self, name: str, link: Link, left: str, right: str) -> None:
        """Draw a link above all bodies, if there is no room for it between its ends."""
        one, two = self.places[left], self.places[right]
        y = self._next_level()
        shift = 0.6 - 0.12 * self.levels
        start, end = (one.x + shift, y), (two.x - 0.3 - shift, y)
        self.pencil.line((start[0], one.y + _HIGH / 2), start)
        self.pencil.line((end[0], two.y + _HIGH / 2), end)
        self.pencil.link(start, end, link.rigidity() is not None, link.is_damped(), (left, right))
        self._named(name, link, ((start[0] + end[0]) / 2, y + 0.32), va="bottom")

    def _to_wall(self, name: str, link: Link, body: str) -> None:
        """Draw a link to the ground or the load point."""
        place, other = self.places[body], next(end for end in link.between if end != body)
        shares = link.directions()
        if "x" not in shares:
            x = place.x - 0.35
            start, end = (x, place.y + _HIGH / 2), (x, place.y + _HIGH / 2 + _HOLD)
            self.pencil.link(start, end, link.rigidity() is not None, link.is_damped(), (body, ""))
            self._wall(end, (0, 1), other)
            self._named(name, link, (x - 0.28, end[1] - 0.6), ha="right", va="center")
            return
        way = 1.0 if link.between[0] == body else -1.0
        if "y" in shares:
            angle = math.atan2(float(shares["y"]), float(shares["x"]))
            direction = (way * math.cos(angle), way * math.sin(angle))
            start = (place.x + math.copysign(_WIDE / 2, direction[0]), place.y + math.copysign(_HIGH / 2, direction[1]))
            end = (start[0] + _HOLD * direction[0], start[1] + _HOLD * direction[1])
            self.pencil.link(start, end, link.rigidity() is not None, link.is_damped(), (body, ""))
            self._wall(end, direction, other)
            beside = -1 if direction[0] < 0 else 1
            self._named(name, link, (end[0] + 0.5 * beside, end[1]), ha="right" if beside < 0 else "left", va="center")
            return
        side = self._free_side(place, other)
        if side == "over":
            x, y = place.x + 0.6 - 0.12 * self.levels, self._next_level()
            start, end = (x, y), (x + 1.45, y)
            self.pencil.line((x, place.y + _HIGH / 2), start)
        else:
            start = place.side(side)
            end = (start[0] + (_HOLD if side == "right" else -_HOLD), start[1])
        self.pencil.link(start, end, link.rigidity() is not None, link.is_damped(), (body, ""))
        self._wall(end, (1, 0) if end[0] > start[0] else (-1, 0), other)
        self._named(name, link, ((start[0] + end[0]) / 2, start[1] + 0.32), va="bottom")

    def _next_level(self) -> float:
        """Height above the bodies at which the next link is drawn."""
        self.levels += 1
        return max(p.y for p in self.places.values()) + _HIGH / 2 + 0.75 + 0.95 * (self.levels - 1)

    def _free_side(self, place: _Place, other: str) -> str:
        """Side with room for a link to a wall, or ``"over"`` if both are taken; left first for the load point."""
        row = [p for p in self.places.values() if abs(p.y - place.y) < 1]
        left = place.taken.get("left", 0) > 0 or any(p.x < place.x - 0.1 for p in row)
        right = place.taken.get("right", 0) > 0 or any(p.x > place.x + 0.1 for p in row)
        if other == LOAD_POINT:
            return "left" if not left else "right" if not right else "over"
        return "right" if not right else "left" if not left else "over"

    def _wall(self, at: tuple[float, float], direction: tuple[float, float], other: str) -> None:
        (x, y), (along, up) = at, direction
        across, ends = (-up, along), []
        for far in (0.0, 0.16):
            ends += [(x + far * along + s * across[0], y + far * up + s * across[1]) for s in (-0.4, 0.4)]
        if other == GROUND:
            self.pencil.rough([ends[i] for i in (0, 1, 3, 2)])
            self.pencil.line(*ends[:2])
            return
        self.pencil.line(*ends[:2], color=DRIVEN, linewidth=3)
        if not self.drive_drawn:  # only one arrow, even if several links end at the load point
            self.drive_drawn = True
            begin = (x - 0.55, y + 0.58) if abs(along) > abs(up) else (x - 0.4, y + 0.2)
            self.pencil.arrow(begin, (begin[0] + 0.9, begin[1]))
            words = self._speed() if self.values else "drive"
            self.pencil.words(begin[0] + 0.45, begin[1] + 0.12, words, color=DRIVEN, va="bottom")

    def _named(self, name: str, link: Link, at: tuple[float, float], **style: Any) -> None:
        if not self.values:
            self.pencil.words(*at, name, **style)
            return
        known = self.machine.parameters()
        key = "stiffness" if link.rigidity() is not None else "damping"
        one = known[f"links.{name}.{key}"]
        words = [name, format_own(float(one.value or 0.0), one.role.unit)]
        if link.turning[0] and link.ratio() != 1:
            ratio = next(known[f"links.{name}.{key}"] for key in ("lead", "gear") if f"links.{name}.{key}" in known)
            words[0] += ", " + (
                format_own(float(ratio.value or 0), ratio.role.unit)
                if ratio.role.unit == "m/rad"
                else f"gear {float(ratio.value or 0):.3g}"
            )
        self.pencil.words(*at, "\n".join(words), **style)

    # -- the drive

    def _speed(self) -> str:
        """Text of the speed of the drive, or of the body whose speed the user gave."""
        text = format_quantity(*self.machine.display_value("drive.velocity", float(self.machine.drive.velocity)))
        return text if self.machine.fed is None else f"{text} of {self.machine.fed}"

    def _drive(self) -> None:
        drive = self.machine.drive
        body = drive.driven()
        if body is None:
            return
        place = self.places[body]
        speed = self._speed()
        late = f"\n{format_quantity(float(drive.lateness()), 's')} late" if drive.lateness() else ""
        top = max(p.y for p in self.places.values()) + _HIGH / 2 + 0.9 + 0.95 * self.levels
        self.pencil.frame(place.x - 1.0, top, 2.0, 0.75)
        self.pencil.words(
            place.x, top + 0.375, self._label(kind_of_control(drive.name), speed + late, ", "), color=DRIVEN
        )
        roof = place.y + (_HIGH / 1.7 if self.machine.bodies[body].turns else _HIGH / 2)
        self.pencil.arrow((place.x - 0.2, top), (place.x - 0.2, roof + 0.02))
        for i, seen in enumerate(dict.fromkeys(drive.watched())):
            self._measured(seen, seen == body, place, top, i, drive)

    def _measured(self, seen: str, own: bool, place: _Place, top: float, i: int, drive: Any) -> None:
        other = self.places[seen]
        roof = other.y + (_HIGH / 1.7 if self.machine.bodies[seen].turns else _HIGH / 2)
        first, second = drive.watched()
        what = "measured" if first == second else "place" if seen == first else "speed"
        style: dict[str, Any] = {"color": DRIVEN, "dashed": True}
        if own:
            self.pencil.arrow(
                (place.x - 0.55, roof - (0.14 if self.machine.bodies[seen].turns else 0)),
                (place.x - 0.55, top),
                **style,
            )
            self.pencil.words(place.x - 0.65, (roof + top) / 2, what, color=DRIVEN, ha="right")
            return
        x, y = other.x - 0.75, top + 0.2 + 0.25 * i
        self.pencil.line((x, roof), (x, y), **style)
        self.pencil.arrow((x, y), (place.x + math.copysign(1.05, x - place.x), y), **style)
        self.pencil.words((x + place.x) / 2 + 0.5, y + 0.06, what, color=DRIVEN, va="bottom")


def _places(machine: Machine) -> dict[str, _Place]:
    """Places of all bodies by name: a row, ordered by the number of links from the drive.

    Other bodies that are in contact with a body of the row are placed alternately below and above it.
    """
    ties = [link.between for link in machine.links.values() if GROUND not in link.between]
    order = [machine.drive.driven() or LOAD_POINT]
    for one in order:  # grows during the loop
        for tie in ties:
            order += [end for end in tie if one in tie and end not in order]
    row = [name for name in order if name in machine.bodies]
    partner: dict[str, str] = {}
    for surface in machine.contacts.values():
        for end, other in ((surface.against, surface.body), (surface.body, surface.against)):
            if end in machine.bodies and end not in row and other in row:
                partner.setdefault(end, other)
    row += [name for name in machine.bodies if name not in row and name not in partner]
    found = {name: _Place(i * _ACROSS, 0.0) for i, name in enumerate(row)}
    count: dict[str, int] = {}
    for name, other in partner.items():
        i = count[other] = count.get(other, 0) + 1
        found[name] = _Place(found[other].x, _UP * ((i + 1) // 2) * (-1 if i % 2 else 1))
    return {name: found[name] for name in machine.bodies}
