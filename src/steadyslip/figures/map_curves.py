"""Figures of maps over one parameter as curves, and of random samples as points."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from steadyslip.core.arrays import Array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.palette import BLACK, BLUE, CURVES, GREY, ORANGE, VERMILION
from steadyslip.figures.map_axes import (
    KIND_COLOURS,
    Scale,
    add_legend_entry,
    drawn_result,
    label_axes,
    missing_note,
    result_label,
)
from steadyslip.figures.style import AREAS, OUT_OF_RANGE, axis_label
from steadyslip.linear.status import ABSENT, STABLE, UNDAMPED, UNKNOWN, UNSTABLE
from steadyslip.maps.view.absence import without_number
from steadyslip.maps.view.cut import View, own_value
from steadyslip.maps.view.map_result import MapResult


def draw_curve(ax: Axes, found: MapResult, view: View, show: str | None) -> None:
    """Plot a result over one parameter, with stable and unstable intervals shaded."""
    (scale,) = label_axes(ax, found, view)
    x = scale(view.places[0])
    order = np.argsort(x)
    x = x[order]
    name = drawn_result(found, view, show) or "status"
    if "status" in view.values and name != "status":
        _bands_of_status(ax, x, np.asarray(view.values["status"])[order])
    if found.words(name):
        _curves_of_kinds(ax, found, view, x, order, name)
    else:
        _curve_of_numbers(ax, found, view, x, order, name)
    ax.set_xlim(x.min(), x.max())
    own = own_value(found, view.names[0])
    if own is not None and x.min() <= scale(own) <= x.max():
        ax.axvline(float(scale(own)), color=VERMILION, linewidth=1.2, linestyle="--", label="this rig")


def _bands_of_status(ax: Axes, x: Array, status: Array) -> None:
    """Shade the intervals of `x` by status; intervals end midway between points."""
    ends = np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]])
    for code, (words, style) in AREAS.items():
        inside = np.concatenate([[False], status == code, [False]])
        turns = np.flatnonzero(np.diff(inside.astype(int)))
        for number, (start, stop) in enumerate(zip(turns[::2], turns[1::2], strict=True)):
            ax.axvspan(ends[start], ends[stop], zorder=0, label="" if number else words, **style)


def _curve_of_numbers(ax: Axes, found: MapResult, view: View, x: Array, order: Array, name: str) -> None:
    values = np.asarray(view.values[name])[order]
    unit = found.unit(name)
    finite = values[np.isfinite(values)]
    if name in view.bands:  # zeros mark failed samples, and do not set the scale
        finite = view.bands[name][np.isfinite(view.bands[name]) & (view.bands[name] != 0)]
    scale = Scale(name, unit, finite if len(finite) else np.ones(1), spaced=False, area=found.area(name))
    if values.ndim == 3:  # ends of stable intervals: (points, intervals, 2)
        top = finite.max() * 3 if len(finite) else 1.0
        for i in range(values.shape[1]):
            low, high = values[:, i, 0], np.where(np.isinf(values[:, i, 1]), top, values[:, i, 1])
            if i and not np.isfinite(low).any():
                break
            ax.fill_between(x, scale(low), scale(high), color=CURVES[i % len(CURVES)], alpha=0.4,
                            label=f"interval {i + 1} of {name.replace('_', ' ')}")  # fmt: skip
    elif name in view.bands:
        top = 1e3 * finite.max(initial=1.0)  # with infinite samples the band ends beyond the axis
        low, middle, high = (scale(np.minimum(band[order], top)) for band in view.bands[name])
        ax.fill_between(x, low, high, color=BLUE, alpha=0.25, linewidth=0, label="95 % of samples")
        ax.plot(x, middle, color=BLUE, label="median of samples" + missing_note(view, name))
        if len(finite) and np.nanmax(high, initial=0.0) > scale(finite.max()):
            ax.set_ylim(top=1.3 * float(scale(finite.max())))
    else:
        ax.plot(x, np.where(np.isfinite(values), scale(values), np.nan), color=BLUE)
        if gaps := without_number(found, view, name, hatched="status" in view.values):
            add_legend_entry(ax, Patch(facecolor="none", edgecolor="none", label=f"where there is no line: {gaps}"))
    ax.set_yscale("log" if scale.log else "linear")
    ax.set_ylabel(axis_label(result_label(found, name), scale.unit))
    if name == "safety_factor":
        ax.axhline(1.0, color=BLACK, linewidth=0.8)
    if name == "growth_rate":
        ax.axhline(0.0, color=BLACK, linewidth=0.8)


def _curves_of_kinds(ax: Axes, found: MapResult, view: View, x: Array, order: Array, name: str) -> None:
    words = found.words(name)
    if name in view.shares:
        for code, word in enumerate(words):
            if view.shares[name][code].any():
                ax.plot(x, view.shares[name][code][order], color=KIND_COLOURS[code % len(KIND_COLOURS)], label=word)
        ax.set_ylabel("share of samples (1)")
        ax.set_ylim(-0.02, 1.02)
        return
    codes = np.asarray(view.values[name])[order]
    if name == "status":
        _bands_of_status(ax, x, codes)
        ax.set_yticks([])
        return
    ax.step(x, codes, where="mid", color=BLUE)
    ax.set_yticks(range(len(words)), words)
    ax.set_ylabel(name.replace("_", " "))


def draw_scatter(ax: Axes, found: MapResult, view: View, show: str | None) -> None:
    """Plot random samples as points over two parameters, or over one parameter and the result."""
    scales = label_axes(ax, found, view)
    name = drawn_result(found, view, show)
    across = [s(p) for s, p in zip(scales, view.places, strict=True)]
    if len(across) == 1:
        name = name or found.results[0]
        values = np.asarray(view.values[name], dtype=float)
        if values.ndim > 1:
            raise ParameterError([Problem("show", f"{name!r} has several numbers per point; choose another result")])
        up = Scale(name, found.unit(name), values, spaced=False, area=found.area(name))
        across.append(up(np.where(np.isfinite(values), values, np.nan)))
        ax.set_yscale("log" if up.log else "linear")
        ax.set_ylabel(axis_label(result_label(found, name), up.unit))
    status = view.values.get("status")
    kinds = (
        (UNSTABLE, "unstable", ORANGE, "v"),
        (STABLE, "stable", BLUE, "o"),
        (UNDAMPED, "undamped: nothing grows", BLUE, "."),
        (ABSENT, "no steady sliding", GREY, "x"),
        (UNKNOWN, OUT_OF_RANGE, GREY, "+"),
    )
    if status is None:
        ax.plot(*across, ".", color=BLUE, markersize=4, linestyle="none")
        return
    for code, label, colour, marker in kinds:
        chosen = status == code
        if chosen.any():
            ax.plot(across[0][chosen], across[1][chosen], marker, color=colour, markersize=3, linestyle="none",
                    label=label)  # fmt: skip
