"""Sketch of a slider as SVG with parts that a page can move.

Moving parts have classes: ``ground`` (hatching that moves past the load point, with period ``data-period``), ``body``
(block and its load) and ``link`` (spring or dashpot between the ends in ``data-ends``, drawn from 0 to 1 along its
axis). Colours are those of the surrounding text; letters are those of the manual. Lengths are SVG units.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable

from steadyslip.machine.slider import Slider

WIDTH, HEIGHT = 340, 174  # size of the whole sketch
GROUND_Y = 132.0  # y of the surface
PERIOD = 10.0  # distance between lines of the ground's hatching
BLOCK_LENGTH, TOP_Y = 80.0, 86.0  # length of the block, height of its top
SPRING_Y = 108.0  # y at which the spring is attached to the block
SPRING_LENGTH = 130.0  # length of the spring
MAX_SPRING_ANGLE, MAX_SURFACE_ANGLE = 33.0, 7.0  # degrees: largest drawn angles of spring and surface
_SPRING_TURNS = 7  # turns of a spring as drawn


def sketch(rig: Slider) -> str:
    """SVG sketch of a slider.

    Parameters
    ----------
    rig : Slider
        Rig with any contact; a contact law without a shape is drawn as a block on a plane.

    Returns
    -------
    str
        Self-contained ``<svg>`` element.
    """
    shape = rig.contact.shape()
    tilt = max(-MAX_SURFACE_ANGLE, min(MAX_SURFACE_ANGLE, math.degrees(shape.tilt)))
    extra = "".join(_EXTRAS[one](rig) for one in (shape.between, shape.part) if one)
    inside = _ground() + extra + _block(rig) + _links(rig) + _load(rig)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="sketch" viewBox="0 0 {WIDTH} {HEIGHT}" data-period="{PERIOD}" '
        'role="img" aria-label="sketch of the mechanism" fill="none" stroke="currentColor" stroke-width="1.6" '
        'font-family="inherit" font-size="13">'
        f'<g transform="rotate({-tilt:.4g} {WIDTH / 2} {GROUND_Y})">{inside}</g></svg>'
    )


# -- parts


def _path(*points: tuple[float, float], style: str = "") -> str:
    return f'<path d="M{"L".join(f"{x:.5g} {y:.5g}" for x, y in points)}" {style}/>'


def _text(x: float, y: float, letters: str, style: str = "") -> str:
    return (
        f'<text x="{x:.5g}" y="{y:.5g}" fill="currentColor" stroke="none" text-anchor="middle" {style}>{letters}</text>'
    )


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    along = math.atan2(end[1] - start[1], end[0] - start[0])
    heads = [(end[0] - 7 * math.cos(along + s), end[1] - 7 * math.sin(along + s)) for s in (0.4, -0.4)]
    return f'<g class="arrow">{_path(start, end)}{_path(heads[0], end, heads[1])}</g>'


def _ground() -> str:
    marks = "".join(_path((x, GROUND_Y), (x - 8, GROUND_Y + 11)) for x in range(0, WIDTH + 30, int(PERIOD)))
    # a nested <svg> clips its contents; a clip path would need an id that is unique in the document
    place = f'x="10" y="{GROUND_Y}" width="{WIDTH - 20}" height="12" viewBox="10 {GROUND_Y} {WIDTH - 20} 12"'
    surface = _path((10, GROUND_Y), (WIDTH - 10, GROUND_Y))
    return f'<svg {place} stroke-width="1"><g class="ground">{marks}</g></svg>{surface}'


def _gap(rig: Slider) -> float:
    """Gap between block and surface (SVG units) for a film or a layer; else 0."""
    return {"film": 5.0, "layer": 8.0}.get(rig.contact.shape().between, 0.0)


def _block(rig: Slider) -> str:
    foot, (left, right) = GROUND_Y - _gap(rig), _block_sides(rig)
    wedge, load = rig.contact.shape().part == "wedge", rig.contact.shape().load
    shape = (
        f'<path d="M{left} {foot}V{TOP_Y}L{right} {TOP_Y + 16 * wedge}V{foot}Z" '
        'fill="currentColor" fill-opacity=".12"/>'
    )
    middle = (left + right) / 2
    mass = _text(middle, 114, "m") if rig.mass else ""
    pressed = _arrow((middle, 46), (middle, TOP_Y - 2)) + _text(middle + 15, 60, html.escape(load)) if load else ""
    rubbed = _arrow((right - 14, GROUND_Y + 22), (left + 20, GROUND_Y + 22)) + _text(left + 8, GROUND_Y + 27, "τ")
    held = ""
    if rig.radiation_damping:
        way, end = (44, left - 44) if not _is_pushed(rig) else (-44, right + 44)
        held = _text(end + way / 2, 104, "η") + f'<g transform="translate({end} 118) scale({way} 1)">{_dashpot()}</g>'
    return f'<g class="body">{shape}{mass}{pressed}{rubbed}{held}</g>'


def _zigzag() -> str:
    """SVG of a spring along x from 0 to 1."""
    points = [(0.0, 0.0), (0.12, 0.0)]
    points += [(0.12 + 0.76 * (i + 0.5) / (2 * _SPRING_TURNS), 5.0 * (-1) ** i) for i in range(2 * _SPRING_TURNS)]
    return _path(*points, (0.88, 0.0), (1.0, 0.0), style='vector-effect="non-scaling-stroke" stroke-linejoin="round"')


def _link(inside: str, start: tuple[float, float], end: tuple[float, float]) -> str:
    (x1, y1), (x2, y2) = start, end
    angle, length = math.degrees(math.atan2(y2 - y1, x2 - x1)), math.hypot(x2 - x1, y2 - y1)
    place = f'transform="translate({x1:.5g} {y1:.5g}) rotate({angle:.5g}) scale({length:.5g} 1)"'
    return f'<g class="link" data-ends="{x1:.5g} {y1:.5g} {x2:.5g} {y2:.5g}" {place}>{inside}</g>'


def _dashpot() -> str:
    """SVG of a dashpot along x from 0 to 1."""
    lines = ("M0 0H.4", "M.6 -6H.4V6H.6", "M.52 -4V4M.52 0H1")
    return "".join(f'<path d="{d}" vector-effect="non-scaling-stroke"/>' for d in lines)


def _rise(rig: Slider) -> float:
    """Angle of the spring to the surface in degrees: positive if it lifts the block, negative if it presses."""
    return math.degrees(rig.contact.shape().rise)


def _is_pushed(rig: Slider) -> bool:
    """True if the load point is behind the block and pushes it from above."""
    return _rise(rig) < 0


def _block_sides(rig: Slider) -> tuple[float, float]:
    """x of the left and right side of the block."""
    left = 206.0 if _is_pushed(rig) else 62.0
    return left, left + BLOCK_LENGTH


def _spring_end(rig: Slider) -> tuple[float, float]:
    left, right = _block_sides(rig)
    return (left if _is_pushed(rig) else right), SPRING_Y


def _load_point(rig: Slider) -> tuple[float, float]:
    """Position of the load point."""
    (x, y), angle = _spring_end(rig), math.radians(min(abs(_rise(rig)), MAX_SPRING_ANGLE))
    return x + (-1 if _is_pushed(rig) else 1) * SPRING_LENGTH * math.cos(angle), y - SPRING_LENGTH * math.sin(angle)


def _links(rig: Slider) -> str:
    (x1, y1), (x2, y2), apart = _spring_end(rig), _load_point(rig), 8.0 if rig.damping else 0.0
    middle, lines = ((x1 + x2) / 2, (y1 + y2) / 2), ""
    if rig.stiffness or rig.axial_stiffness:
        lines += _link(_zigzag(), (x1, y1 - apart), (x2, y2 - apart)) + _text(middle[0], middle[1] - apart - 10, "k")
    else:  # there is no spring, only a controller
        lines += _path((x1, y1), (x2, y2), style='stroke-dasharray="2 5"')
    if rig.damping:
        lines += _link(_dashpot(), (x1, y1 + apart), (x2, y2 + apart)) + _text(middle[0], middle[1] + apart + 21, "c")
    return lines


def _load(rig: Slider) -> str:
    x, y = _load_point(rig)
    bar = _path((x, y - 14), (x, y + 14)) if rig.damping else ""
    point = f'<circle cx="{x:.5g}" cy="{y:.5g}" r="4" fill="currentColor"/>'
    if rig.drive.proportional():
        name = "PID" if rig.drive.integral() else "PD"
        point = f'<rect x="{x - 2:.5g}" y="{y - 12:.5g}" width="34" height="24"/>' + _text(x + 15, y + 4, name)
        x += 28
    start = (x - 10, y - 16) if _is_pushed(rig) or rig.contact.shape().part == "crank" else (x + 8, y)
    arrow = _arrow(start, (start[0] + 26, start[1])) + _text(start[0] + 12, start[1] - 8, "v₀")
    return f'<g class="load">{bar}{point}{arrow}</g>'


# -- additional parts for some contact laws


def _wedge(rig: Slider) -> str:
    def roof(x: float) -> float:
        return TOP_Y - 3 + 0.2 * (x - _block_sides(rig)[0])

    ends = [_block_sides(rig)[0] - 30, _block_sides(rig)[1] + 16]
    marks = "".join(_path((x, roof(x)), (x + 8, roof(x) - 10)) for x in range(int(ends[0]), int(ends[1]), 10))
    return _path(*((x, roof(x)) for x in ends)) + f'<g stroke-width="1">{marks}</g>'


def _film(rig: Slider) -> str:
    left, right = _block_sides(rig)
    shape = f"M{left} {GROUND_Y}V{GROUND_Y - 5}H{right}V{GROUND_Y}Z"
    return f'<g class="body"><path d="{shape}" fill="currentColor" fill-opacity=".3" stroke="none"/></g>'


def _layer(rig: Slider) -> str:
    left, right = _block_sides(rig)
    grains = "".join(f'<circle cx="{x}" cy="{GROUND_Y - 4}" r="3.4"/>' for x in range(int(left) + 5, int(right), 8))
    return f'<g class="body" stroke-width="1">{grains}</g>'


def _crank(rig: Slider) -> str:
    (x, y), centre = _load_point(rig), (_load_point(rig)[0] + 14, SPRING_Y + 6)
    radius = math.hypot(centre[0] - x, centre[1] - y)
    circle = f'<circle cx="{centre[0]:.5g}" cy="{centre[1]}" r="{radius:.4g}" stroke-width="1" stroke-dasharray="3 3"/>'
    return circle + _path((x, y), centre, style='stroke-width="3"')


_EXTRAS: dict[str, Callable[[Slider], str]] = {"wedge": _wedge, "film": _film, "layer": _layer, "crank": _crank}
