"""Colours, display units, new Axes and reproducible files for all figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steadyslip.core.areas import outside
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity, typeset

# Okabe & Ito (2008): palette for all common kinds of colour vision
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
CURVES = (BLUE, SKY, BLACK, ORANGE, VERMILION, GREEN, PURPLE)
LINES = ("-", "--", "-.", ":")
GREY = "#BBBBBB"
OWN_RIG: dict[str, Any] = {
    "color": VERMILION,
    "markeredgecolor": BLACK,
    "markersize": 9,
    "linestyle": "none",
    "label": "this rig",
    "clip_on": False,
}  # fmt: skip -- style of the marker at the values of the rig itself


def axes_or_new(ax: Axes | None, height: float = 4.8) -> Axes:
    """The given Axes, or Axes of a new pyplot figure of the given height (inches)."""
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(6.4, height), layout="constrained")[1]


def new_panels(rows: int, columns: int, size: tuple[float, float], **options: Any) -> np.ndarray:
    """Axes of a new pyplot figure, shape (rows, columns); size in inches, further options of `pyplot.subplots`."""
    from matplotlib import pyplot as plt

    axes: Any = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **options)[1]
    return np.asarray(axes, dtype=object)


def given_panels(ax: Any, shape: tuple[int, ...], allowed: str) -> np.ndarray:
    """Axes given by the user as an array; ParameterError, with `allowed`, if they do not have the given shape."""
    given = np.asarray(ax, dtype=object)
    if given.shape != shape:
        raise ParameterError([Problem("ax", f"got Axes of shape {given.shape}; allowed: {allowed}")])
    return given


def unmanaged_axes(width: float = 6.4, height: float = 4.8) -> Axes:
    """Axes of a new figure that is not registered with pyplot, so that nobody has to close it; size in inches."""
    axes: Axes = Figure(figsize=(width, height), layout="constrained").subplots()
    return axes


def save_figure(ax: Axes, stem: Path, kinds: tuple[str, ...] = ("png", "svg")) -> list[Path]:
    """Save the figure of `ax` as ``stem.png``, ...; return the paths. Equal figures give equal SVG bytes."""
    paths = [stem.with_name(f"{stem.name}.{kind}") for kind in kinds]
    figure = ax.get_figure(root=True)
    if figure is None:
        raise ValueError("the Axes have been removed from their figure")
    with rc_context({"svg.hashsalt": "steadyslip", "svg.fonttype": "path"}):
        for path, kind in zip(paths, kinds, strict=True):
            figure.savefig(path, dpi=200, facecolor="white", metadata={"Date": None} if kind == "svg" else None)
    return paths


def display_unit(si_unit: str, typical: float, area: float | None = None) -> tuple[float, str]:
    """Display unit for values of a typical size: its size in SI units, and its name.

    With an `area` (m²), quantities per unit area are shown as totals: a stress (Pa) divided by the size is a force (N).

    >>> display_unit("Pa/m", 9e9), display_unit("rad", 0.1)[1]
    ((1000000000.0, 'GPa/m'), 'deg')
    """
    name = format_quantity(typical, si_unit, area=area).partition(" ")[2]
    factor = (unit(name)[0] if name else 1.0) / outside(si_unit, area)[0]
    return factor, typeset(name)


def add_legend_above(ax: Axes, columns: int = 2, height: float = 1.04, **options: Any) -> None:
    """Add a legend above the axes, where it covers no data; `height` leaves room for the power of ten of the y axis."""
    ax.legend(loc="lower left", bbox_to_anchor=(0, height), ncols=columns, frameon=False, borderaxespad=0.2, **options)


def add_arrowheads(ax: Axes, x: Any, y: Any, color: str) -> None:
    """Draw three arrowheads along a curve, at equal distances in the figure."""
    finite = np.isfinite(x)
    x, y = x[finite], y[finite]
    if len(x) < 3:
        return
    across = np.log(x) if ax.get_xscale() == "log" else x
    width, height = np.ptp(across) or 1.0, np.ptp(y) or 1.0
    length = np.concatenate([[0], np.cumsum(np.hypot(np.diff(across) / width, np.diff(y) / height))])
    for share in (0.12, 0.37, 0.62):
        i = int(np.searchsorted(length, share * length[-1]))
        i = min(max(i, 1), len(x) - 1)
        ax.annotate(
            "", (x[i], y[i]), (x[i - 1], y[i - 1]), arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1}
        )


def axis_label(name: str, unit_name: str) -> str:
    """Axis label: name and unit, 1 for plain numbers."""
    return f"{name} ({unit_name or '1'})"
