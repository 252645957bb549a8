"""Sketch of a machine as SVG with parts that a page can move.

Bodies have the class ``part`` and their name in ``data-body``, wheels also their centre in ``data-turns``; links have
the class ``link``, the positions of their ends in ``data-ends`` and the bodies there in ``data-bodies``.
"""

from __future__ import annotations

import html
import math

from steadyslip.core.format import typeset
from steadyslip.machine.drawing import DRIVEN, FORCED, INK, PALE, Drawing, Pencil, Point
from steadyslip.machine.machine import Machine

UNIT = 62.0  # SVG units per unit of the drawing: texts of size 11 fit (by trial)
FONT_SIZES = {False: 11, True: 13}  # SVG units; key: True for large text
_CLASSES = {PALE: "pale", DRIVEN: "load", FORCED: "forced"}
_THIN = 'vector-effect="non-scaling-stroke"'


def machine_sketch(machine: Machine) -> str:
    """Self-contained ``<svg>`` element with the sketch of a machine."""
    pencil = SvgPencil()
    Drawing(machine, pencil, values=False).draw()  # without values, as these change on the page
    return pencil.svg()


class SvgPencil(Pencil):
    """Pencil that produces SVG elements; y points up in the drawing, down in SVG."""

    def __init__(self) -> None:
        self.parts: list[str] = []
        self.low, self.high = [math.inf, math.inf], [-math.inf, -math.inf]

    def svg(self) -> str:
        """Complete ``<svg>`` element with everything drawn so far."""
        (x, y), (right, bottom) = [one - 6 for one in self.low], [one + 6 for one in self.high]
        wide, tall = right - x, bottom - y
        return (
            '<svg xmlns="http://www.w3.org/2000/svg" class="sketch machine" role="img" '
            f'aria-label="sketch of the machine" viewBox="{x:.0f} {y:.0f} {wide:.0f} {tall:.0f}" '
            f'style="max-width:{1.1 * wide:.0f}px" fill="none" stroke="currentColor" stroke-width="1.4" '
            f'font-family="inherit">{"".join(self.parts)}</svg>'
        )

    def _to_page(self, x: float, y: float) -> tuple[float, float]:
        found = UNIT * x, -UNIT * y
        for axis in (0, 1):
            self.low[axis] = min(self.low[axis], found[axis])
            self.high[axis] = max(self.high[axis], found[axis])
        return found

    def _path(self, *points: Point) -> str:
        return "M" + "L".join("{:.4g} {:.4g}".format(*self._to_page(x, y)) for x, y in points)

    def _add_path(self, path: str, color: str, style: str) -> None:
        kind = f' class="{_CLASSES[color]}"' if color != INK else ""
        self.parts.append(f'<path{kind} d="{path}"{style}/>')

    def line(self, *points: Point, color: str = INK, linewidth: float = 1.2, dashed: bool = False) -> None:
        style = f' stroke-width="{linewidth:g}"' if linewidth > 1.6 else ""
        self._add_path(self._path(*points), color, style + (' stroke-dasharray="4 3"' if dashed else ""))

    def words(
        self, x: float, y: float, text: str, *, ha: str = "center", va: str = "center", color: str = INK,
        large: bool = False, paper: bool = False,
    ) -> None:  # fmt: skip
        self.parts.append(self._text(x, y, text, ha, va, color, large, paper))

    def _text(
        self, x: float, y: float, text: str, ha: str, va: str, color: str, large: bool, paper: bool
    ) -> str:  # fmt: skip
        lines, size = typeset(text).split("\n"), FONT_SIZES[large]
        step = 1.2 * size / UNIT
        first = y + {"center": (len(lines) - 1) / 2, "bottom": len(lines) - 1, "top": 0}[va] * step
        first -= {"center": 0.36, "bottom": 0.1, "top": 0.8}[va] * size / UNIT
        anchor = {"center": "middle", "left": "start", "right": "end"}[ha]
        kind = " ".join(filter(None, (_CLASSES.get(color, ""), "paper" if paper else "")))
        found = []
        for n, line in enumerate(lines):
            left, base = self._to_page(x, first - n * step)
            wide = 0.58 * size * len(line) / UNIT
            for share in {"center": (-0.5, 0.5), "left": (0, 1), "right": (-1, 0)}[ha]:
                self._to_page(x + share * wide, first - n * step)
            self._to_page(x, first - n * step + size / UNIT)
            found.append(f'<tspan x="{left:.4g}" y="{base:.4g}">{html.escape(line)}</tspan>')
        marked = f' class="{kind}"' if kind else ""
        return (
            f'<text{marked} font-size="{size}" text-anchor="{anchor}" fill="currentColor" stroke="none">'
            f"{''.join(found)}</text>"
        )

    def arrow(self, start: Point, end: Point, *, color: str = DRIVEN, dashed: bool = False) -> None:
        self.line(start, end, color=color, dashed=dashed)
        along = math.atan2(end[1] - start[1], end[0] - start[0])
        heads = [(end[0] - 0.15 * math.cos(along + s), end[1] - 0.15 * math.sin(along + s)) for s in (0.4, -0.4)]
        self.line(heads[0], end, heads[1], color=color)

    def _body(self, name: str, shape: str, turns: str, text: str) -> None:
        moved = f'data-body="{html.escape(name)}"{turns}'
        self.parts.append(f'<g class="part" {moved}>{shape}</g>{text}')

    def block(self, name: str, x: float, y: float, wide: float, high: float, text: str) -> None:
        left, top = self._to_page(x, y + high)
        self._to_page(x + wide, y)
        shape = f'<rect x="{left:.4g}" y="{top:.4g}" width="{UNIT * wide:.4g}" height="{UNIT * high:.4g}"/>'
        words = self._text(x + wide / 2, y + high / 2, text, "center", "center", INK, len(name) < 9, False)
        self._body(name, shape + words, "", "")

    def wheel(self, name: str, x: float, y: float, radius: float, text: str) -> None:
        (cx, cy), r = self._to_page(x, y), UNIT * radius
        self._to_page(x, y + radius)
        self._to_page(x, y - radius)
        marks = "".join(
            f"M{cx + 0.86 * r * math.cos(a):.4g} {cy + 0.86 * r * math.sin(a):.4g}L{cx + r * math.cos(a):.4g} "
            f"{cy + r * math.sin(a):.4g}"
            for a in (0.5, 2.6, 4.7)
        )
        shape = f'<circle cx="{cx:.4g}" cy="{cy:.4g}" r="{r:.4g}"/><path d="{marks}"/>'
        words = self._text(x, y, text, "center", "center", INK, len(name) < 9, False)
        self._body(name, shape, f' data-turns="{cx:.4g} {cy:.4g}"', words)

    def rough(self, corners: list[Point]) -> None:
        (a, b, c, d), path = corners, self._path(corners[0], corners[1])
        many = max(3, round(math.dist(a, b) / 0.17))

        def between(one: Point, other: Point, share: float) -> Point:
            return one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1])

        for n in range(many):
            path += self._path(between(a, b, n / many), between(d, c, (n + 1) / many))
        self._add_path(path, PALE, ' stroke-width="1"')

    def gouge(self, x: float, y: float, wide: float, high: float) -> None:
        rows = [y + high * (n + 0.5) / 5 for n in range(5)]
        self._add_path("".join(self._path((x, row), (x + wide, row)) for row in rows), PALE, ' stroke-width="1"')

    def frame(self, x: float, y: float, wide: float, high: float) -> None:
        left, top = self._to_page(x, y + high)
        self._to_page(x + wide, y)
        size = f'width="{UNIT * wide:.4g}" height="{UNIT * high:.4g}"'
        self.parts.append(f'<rect class="load" x="{left:.4g}" y="{top:.4g}" {size} rx="5"/>')

    def link(self, start: Point, end: Point, sprung: bool, damped: bool, ends: tuple[str, str]) -> None:
        inner = SvgPencil()
        Pencil.link(inner, (0, 0), (1, 0), sprung, damped, ends)  # drawn from 0 to 1, then stretched along its axis
        (x1, y1), (x2, y2) = self._to_page(*start), self._to_page(*end)
        angle, long = math.degrees(math.atan2(y2 - y1, x2 - x1)), math.hypot(x2 - x1, y2 - y1)
        path = "".join(part.split(' d="')[1].split('"')[0] for part in inner.parts)
        place = f"translate({x1:.4g} {y1:.4g}) rotate({angle:.4g}) scale({long / UNIT:.4g} 1)"
        marks = f'data-ends="{x1:.4g} {y1:.4g} {x2:.4g} {y2:.4g}" data-bodies="{html.escape(" ".join(ends))}"'
        self.parts.append(f'<g class="link" {marks} transform="{place}"><path d="{path}" {_THIN}/></g>')
