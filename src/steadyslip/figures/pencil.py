"""Strokes that sketches are made of: lines, words, arrows, ground, springs and dashpots."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle

from steadyslip.figures.style import BLACK, BLUE, printed

Point = tuple[float, float]
PALE, SMALL = "#777777", 7.5


class Pencil:
    """Draws on Axes whose limits grow with what is drawn."""

    def __init__(self, ax: Axes) -> None:
        self.ax = ax

    def line(self, *points: Point, **style: Any) -> None:
        """A line through points."""
        plain: dict[str, Any] = {"color": BLACK, "linewidth": 1.2, "solid_capstyle": "butt"}
        self.ax.plot(*np.transpose(points), **(plain | style))

    def words(self, x: float, y: float, text: str, **style: Any) -> None:
        """Text, for which the axes make room."""
        plain: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontsize": SMALL,
            "color": BLACK,
            "linespacing": 1.25,
        }
        self.ax.text(x, y, printed(text), **(plain | style))
        lines = text.count("\n") + 1
        wide = 0.105 * max(map(len, text.splitlines()))
        share = {"center": 0.5, "left": 0.0, "right": 1.0}[style.get("ha", "center")]
        rise = {"center": 0.5, "bottom": 0.0, "top": 1.0}[style.get("va", "center")]
        low, high = y - 0.19 * lines * rise, y + 0.19 * lines * (1 - rise)
        self.ax.update_datalim([(x - share * wide, low), (x + (1 - share) * wide, high)])

    def arrow(self, start: Point, end: Point, **style: Any) -> None:
        """An arrow."""
        plain: dict[str, Any] = {
            "color": BLUE,
            "linewidth": 1.6,
            "mutation_scale": 11,
            "arrowstyle": "-|>",
            "shrinkA": 0,
            "shrinkB": 0,
        }
        self.ax.add_patch(FancyArrowPatch(start, end, **(plain | style)))
        self.ax.update_datalim([start, end])

    def hatched(self, x: float, y: float, wide: float, high: float) -> None:
        """A piece of ground."""
        self.ax.add_patch(Rectangle((x, y), wide, high, facecolor="white", edgecolor=PALE, hatch="/////", linewidth=0))

    def spring(self, start: Point, end: Point) -> None:
        """A zigzag."""
        self._along(start, end, [(0, 0), (0.2, 0), *((0.2 + 0.06 * (i + 0.5), 0.11 * (-1) ** i) for i in range(10)),
                                 (0.8, 0), (1, 0)])  # fmt: skip

    def pot(self, start: Point, end: Point) -> None:
        """A piston in its cylinder."""
        parts: list[list[Point]] = [
            [(0, 0), (0.42, 0)],
            [(0.62, 0.1), (0.42, 0.1), (0.42, -0.1), (0.62, -0.1)],
            [(0.54, 0.075), (0.54, -0.075)],
            [(0.54, 0), (1, 0)],
        ]
        for part in parts:
            self._along(start, end, part)

    def _along(self, start: Point, end: Point, points: list[Point]) -> None:
        """A line given as shares of the way and as units across it."""
        a, b = np.array(start), np.array(end)
        across = np.array([-(b - a)[1], (b - a)[0]]) / np.hypot(*(b - a))
        self.line(*(tuple(a + t * (b - a) + u * across) for t, u in points))

    def link(self, start: Point, end: Point, sprung: bool, damped: bool) -> None:
        """A spring, a dashpot, or both beside each other."""
        both = sprung and damped
        a, b = np.array(start), np.array(end)
        across = 0.17 * np.array([-(b - a)[1], (b - a)[0]]) / np.hypot(*(b - a))
        shift = across if both else 0 * across
        if sprung:
            self.spring(tuple(a + shift), tuple(b + shift))
        if damped:
            self.pot(tuple(a - shift), tuple(b - shift))
        if both:
            for end_ in (a, b):
                self.line(tuple(end_ + shift), tuple(end_ - shift))
