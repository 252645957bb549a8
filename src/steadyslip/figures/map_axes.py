"""What pictures of maps share: axes in units for people, the result that is shown, the legend."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from steadyslip.core.areas import stress_name
from steadyslip.core.format import format_percent
from steadyslip.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    YELLOW,
    display_unit,
    labelled,
)
from steadyslip.maps.view.cut import FAILING, View
from steadyslip.maps.view.result import MapResult

Array = np.ndarray
MANY = 100.0  # ratio from which on an axis or colour scale is logarithmic
OUT_OF_RANGE = "numbers out of the range of floating point"
KIND_COLOURS = (GREY, SKY, ORANGE, BLACK, BLUE, VERMILION, GREEN, PURPLE, YELLOW)


def short(name: str) -> str:
    """The last part of a dotted name, in words; behind the name of the body, link or contact that it is of."""
    *before, last = name.split(".")
    if before[:1] and before[0] in ("bodies", "links", "contacts"):
        before = before[1:2]
    elif len(before) != 1 or before[0] in ("slider", "contact", "friction", "drive"):
        before = []
    return " ".join((*before, last)).replace("_", " ")


def in_words(found: MapResult, name: str) -> str:
    """A result in words: of which contact it is, or along which parameter."""
    words, along = short(name), found.along(name)
    return words if along is None else f"{words} of {short(along)}"


def shown_name(found: MapResult, view: View, show: str | None) -> str | None:
    """The result that is drawn besides the regions."""
    if show is not None:
        return None if show == "status" else show
    if "status" not in view.values:
        return found.results[0]
    return next((name for name in ("safety_factor", "growth_rate") if name in view.values), None)


def spaced_by_ratio(values: Array) -> bool:
    """Whether three or more positive values, as of a grid, are spaced by equal ratios rather than equal steps."""
    values = np.sort(values)
    if values[0] == values[-1]:
        return False
    ratios, steps = np.diff(np.log(values)), np.diff(values)
    return bool(np.ptp(ratios) / ratios.mean() < 0.5 * np.ptp(steps) / steps.mean())


def missing_note(view: View, name: str) -> str:
    """What became of samples that have no value of a result, for its label; empty where all have one."""
    share = float(np.max(view.missing.get(name, np.zeros(1)), initial=0.0))
    if share == 0:
        return ""
    up_to = "" if np.min(view.missing[name]) == share else "up to "
    return f"; {up_to}{format_percent(share)} without one {'count as failures' if name in FAILING else 'left out'}"


class Scale:
    """How a column of SI values is put on an axis."""

    def __init__(self, name: str, unit: str, values: Array, spaced: bool = True, area: float | None = None) -> None:
        finite = np.abs(values[np.isfinite(values) & (values != 0)])
        typical = float(np.median(finite)) if len(finite) else 1.0
        self.factor, self.unit = display_unit(unit, typical, area)
        self.label = labelled(stress_name(short(name), area), self.unit)
        good = values[np.isfinite(values)]
        positive = bool(len(good)) and bool(good.min() > 0)
        self.log = positive and (spaced_by_ratio(good) if spaced and len(good) > 2 else good.max() / good.min() >= MANY)

    def __call__(self, values: Any) -> Any:
        return np.asarray(values) / self.factor


def place_axes(ax: Axes, found: MapResult, view: View) -> list[Scale]:
    """Label and scale the axes for the parameters of a view."""
    scales = [
        Scale(n, found.unit(n), p, not view.scattered, found.area(n))
        for n, p in zip(view.names, view.places, strict=True)
    ]
    ax.set_xlabel(scales[0].label)
    ax.set_xscale("log" if scales[0].log else "linear")
    if len(scales) == 2:
        ax.set_ylabel(scales[1].label)
        ax.set_yscale("log" if scales[1].log else "linear")
    return scales


def legend(ax: Axes) -> None:
    """A legend above the axes, if there is anything to name."""
    if ax.get_legend_handles_labels()[0]:
        # above the axes, where it hides no region, with room for a power of ten on the axis
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.04), ncols=2, frameon=False, borderaxespad=0.2,
                  fontsize="small")  # fmt: skip


def entry(ax: Axes, handle: Any) -> None:
    """An entry of the legend without anything drawn in the Axes."""
    if isinstance(handle, Patch):
        ax.fill_between([], [], facecolor=handle.get_facecolor(), edgecolor=handle.get_edgecolor(),
                        hatch=handle.get_hatch(), label=handle.get_label())  # fmt: skip
    else:
        ax.add_line(handle)
