"""Helpers for figures of maps: axes in display units, choice of the result to draw, legends."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from steadyslip.core.areas import stress_name
from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_percent
from steadyslip.core.palette import (
    BLACK,
    BLOW_UP,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    STABLE,
    UNSTABLE,
    VERMILION,
    YELLOW,
)
from steadyslip.figures.style import add_legend_above, axis_label, display_unit, parameter_label
from steadyslip.maps.view.cut import FAILING, View
from steadyslip.maps.view.map_result import MapResult

LOG_RATIO = 100.0  # ratio of highest to lowest value from which a scale is logarithmic: two decades
WORD_COLOURS = {
    "stable": STABLE, "settles": STABLE, "unstable": UNSTABLE, "hunts": UNSTABLE, "blow-up": BLOW_UP,
    "runs away": BLOW_UP,
}  # fmt: skip
"""Colours of kinds that have their own colour, by word."""
KIND_COLOURS = (GREY, SKY, ORANGE, BLACK, BLUE, VERMILION, GREEN, PURPLE, YELLOW)


def short_name(name: str) -> str:
    """Last part of a dotted name with spaces for underscores, after the name of its body, link or contact if any."""
    *before, last = name.split(".")
    if before[:1] and before[0] in ("bodies", "links", "contacts"):
        before = before[1:2]
    elif len(before) != 1 or before[0] in ("slider", "contact", "friction", "drive"):
        before = []
    return " ".join((*before, last)).replace("_", " ")


def parameter_words(found: MapResult, name: str) -> str:
    """Label of a parameter of a map: words and letter for the rig's parameters, `short_name` for a protocol's."""
    with suppress(NotAvailable):
        if name in found.rig.parameters():
            return stress_name(parameter_label(found.rig, name), found.area(name))
    return stress_name(short_name(name), found.area(name))


def result_label(found: MapResult, name: str) -> str:
    """Name of a result for an axis; results computed along a parameter end in "of" and that parameter."""
    words, along = short_name(name), found.along(name)
    return words if along is None else f"{words} of {parameter_words(found, along)}"


def drawn_result(found: MapResult, view: View, show: str | None) -> str | None:
    """Name of the result to draw over the regions of stability; None if only those are drawn."""
    if show is not None:
        return None if show == "status" else show
    if "status" not in view.values:
        return found.results[0]
    return next((name for name in ("safety_factor", "growth_rate") if name in view.values), None)


def is_geometric(values: Array) -> bool:
    """True if positive grid values (three or more) are closer to equal ratios than to equal steps."""
    values = np.sort(values)
    if values[0] == values[-1]:
        return False
    ratios, steps = np.diff(np.log(values)), np.diff(values)
    return bool(np.ptp(ratios) / ratios.mean() < 0.5 * np.ptp(steps) / steps.mean())


def missing_note(view: View, name: str) -> str:
    """Label text on the share of samples without a value of a result, and their treatment; empty if all have one."""
    share = float(np.max(view.missing.get(name, np.zeros(1)), initial=0.0))
    if share == 0:
        return ""
    up_to = "" if np.min(view.missing[name]) == share else "up to "
    return f"; {up_to}{format_percent(share)} without one {'count as failures' if name in FAILING else 'left out'}"


class Scale:
    """Display unit, label and kind (linear or logarithmic) of an axis for SI values; calling it converts SI values."""

    def __init__(self, name: str, unit: str, values: Array, spaced: bool = True, area: float | None = None) -> None:
        finite = np.abs(values[np.isfinite(values) & (values != 0)])
        typical = float(np.median(finite)) if len(finite) else 1.0
        self.factor, self.unit = display_unit(unit, typical, area)
        self.label = axis_label(stress_name(short_name(name), area), self.unit)
        good = values[np.isfinite(values)]
        positive = bool(len(good)) and bool(good.min() > 0)
        self.log = positive and (
            is_geometric(good) if spaced and len(good) > 2 else good.max() / good.min() >= LOG_RATIO
        )

    def __call__(self, values: Any) -> Any:
        return np.asarray(values) / self.factor


def label_axes(ax: Axes, found: MapResult, view: View) -> list[Scale]:
    """Set labels and scales of the x axis, and of the y axis for two parameters; return their `Scale` objects."""
    scales = [
        Scale(n, found.unit(n), p, not view.scattered, found.area(n))
        for n, p in zip(view.names, view.places, strict=True)
    ]
    for name, scale in zip(view.names, scales, strict=True):
        scale.label = axis_label(parameter_words(found, name), scale.unit)
    ax.set_xlabel(scales[0].label)
    ax.set_xscale("log" if scales[0].log else "linear")
    if len(scales) == 2:
        ax.set_ylabel(scales[1].label)
        ax.set_yscale("log" if scales[1].log else "linear")
    return scales


def add_legend(ax: Axes) -> None:
    """Add a legend above the axes if anything drawn has a label."""
    if ax.get_legend_handles_labels()[0]:
        add_legend_above(ax, fontsize="small")


def add_legend_entry(ax: Axes, handle: Any) -> None:
    """Add a legend entry for a patch or line without drawing it in the Axes."""
    if isinstance(handle, Patch):
        ax.fill_between([], [], facecolor=handle.get_facecolor(), edgecolor=handle.get_edgecolor(),
                        hatch=handle.get_hatch(), label=handle.get_label())  # fmt: skip
    else:
        ax.add_line(handle)
