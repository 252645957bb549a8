"""Sketch of a machine in Matplotlib; the layout is that of `steadyslip.machine.drawing`."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Polygon, Rectangle

from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import typeset
from steadyslip.core.palette import BLACK, BLUE, VERMILION
from steadyslip.figures.style import axes_or_new
from steadyslip.machine.drawing import DRIVEN, FORCED, INK, LONG, PALE, Drawing, Pencil, Point
from steadyslip.machine.machine import Machine

COLORS = {INK: BLACK, PALE: "#777777", DRIVEN: BLUE, FORCED: VERMILION}
BODY_COLOUR = "#DDE3EA"
LARGE, SMALL = 9.0, 7.5  # font sizes in points
_INCHES_PER_UNIT = 0.66  # inches per length unit of the sketch: texts of 7.5 points just fit (by trial)


def machine_sketch(machine: Machine, ax: Axes | None = None) -> Axes:
    """Draw a sketch of a machine.

    Parameters
    ----------
    machine : Machine
    ax : matplotlib.axes.Axes, optional
        Its limits are set and its frame is removed.

    Returns
    -------
    matplotlib.axes.Axes
        Motion is to the right. Boxes slide, circles turn; zigzags are springs, pistons dashpots; hatched is the ground.
        Solid blue: action of the drive; dashed blue: its sensors; red: constant forces.

    Raises
    ------
    NotAvailable
        If a body is a structure given by matrices or modes.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/two-guides.toml")
    >>> axes = ss.figures.machine_sketch(machine)
    >>> axes.figure.savefig("machine-sketch.svg")
    """
    if any(body.is_structure for body in machine.bodies.values()):
        raise NotAvailable("a structure given by matrices has no shape to sketch; draw its modes instead")
    pencil = AxesPencil(axes_or_new(ax))
    Drawing(machine, pencil).draw()
    own = pencil.ax
    own.set_aspect("equal")
    own.axis("off")
    own.autoscale_view()
    own.margins(0.03)
    if ax is None:
        (left, right), (low, high) = own.get_xlim(), own.get_ylim()
        figure = own.get_figure(root=True)
        if figure is not None:
            figure.set_size_inches(_INCHES_PER_UNIT * (right - left), _INCHES_PER_UNIT * (high - low))
            figure.set_layout_engine(None)
            own.set_position((0, 0, 1, 1))
    return own


class AxesPencil(Pencil):
    """Pencil that draws on Axes and widens their data limits."""

    def __init__(self, ax: Axes) -> None:
        self.ax = ax

    def line(self, *points: Point, color: str = INK, linewidth: float = 1.2, dashed: bool = False) -> None:
        style = "--" if dashed else "-"
        x, y = np.transpose(points)
        self.ax.plot(x, y, color=COLORS[color], linewidth=linewidth, linestyle=style, solid_capstyle="butt")

    def words(
        self, x: float, y: float, text: str, *, ha: str = "center", va: str = "center", color: str = INK,
        large: bool = False, paper: bool = False,
    ) -> None:  # fmt: skip
        style: dict[str, Any] = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.2}} if paper else {}
        self.ax.text(x, y, typeset(text), ha=ha, va=va, color=COLORS[color], fontsize=LARGE if large else SMALL,
                     linespacing=1.25, **style)  # fmt: skip
        lines = text.count("\n") + 1
        wide = 0.105 * max(map(len, text.splitlines()))
        share = {"center": 0.5, "left": 0.0, "right": 1.0}[ha]
        rise = {"center": 0.5, "bottom": 0.0, "top": 1.0}[va]
        low, high = y - 0.19 * lines * rise, y + 0.19 * lines * (1 - rise)
        self.ax.update_datalim([(x - share * wide, low), (x + (1 - share) * wide, high)])

    def arrow(self, start: Point, end: Point, *, color: str = DRIVEN, dashed: bool = False) -> None:
        style: Any = (0, (3, 2)) if dashed else "-"
        self.ax.add_patch(FancyArrowPatch(
            start, end, color=COLORS[color], linewidth=1.2 if dashed else 1.6, linestyle=style,
            mutation_scale=9 if dashed else 11, arrowstyle="-|>", shrinkA=0, shrinkB=0,
        ))  # fmt: skip
        self.ax.update_datalim([start, end])

    def block(self, name: str, x: float, y: float, wide: float, high: float, text: str) -> None:
        self.ax.add_patch(Rectangle((x, y), wide, high, facecolor=BODY_COLOUR, edgecolor=BLACK, linewidth=1.4))
        self.words(x + wide / 2, y + high / 2, text, large=len(name) < LONG)

    def wheel(self, name: str, x: float, y: float, radius: float, text: str) -> None:
        self.ax.add_patch(Circle((x, y), radius, facecolor=BODY_COLOUR, edgecolor=BLACK, linewidth=1.4))
        self.words(x, y, text, large=len(name) < LONG)

    def rough(self, corners: list[Point]) -> None:
        self.ax.add_patch(Polygon(corners, facecolor="white", edgecolor=COLORS[PALE], hatch="/////", linewidth=0))

    def gouge(self, x: float, y: float, wide: float, high: float) -> None:
        self.ax.add_patch(
            Rectangle((x, y), wide, high, facecolor="white", edgecolor=COLORS[PALE], hatch="---", linewidth=0)
        )

    def frame(self, x: float, y: float, wide: float, high: float) -> None:
        style = "round,pad=0.02,rounding_size=0.08"
        self.ax.add_patch(FancyBboxPatch((x, y), wide, high, boxstyle=style, facecolor="white", edgecolor=BLUE))
