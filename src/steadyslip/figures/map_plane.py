"""Figures of maps over two parameters: regions or colours, contours, edge of stability, the base rig."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.figures.chart import absence_reasons
from steadyslip.figures.map_axes import (
    KIND_COLOURS,
    LOG_RATIO,
    OUT_OF_RANGE,
    Scale,
    add_legend_entry,
    drawn_result,
    label_axes,
    missing_note,
    result_label,
    short_name,
)
from steadyslip.figures.style import BLACK, GREY, ORANGE, OWN_RIG, SKY, VERMILION, axis_label, display_unit
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE
from steadyslip.maps.view.absence import points_at, without_number
from steadyslip.maps.view.cut import View, own_value
from steadyslip.maps.view.result import MapResult

Array = np.ndarray
SAFETY_LEVELS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # contours of the safety factor k/k_cr


def draw_plane(ax: Axes, found: MapResult, view: View, show: str | None, scale: Any) -> None:
    """Plot a result over two parameters: regions with contours, or colours; panels may share a colour `scale`."""
    scales = label_axes(ax, found, view)
    x, y = (s(p) for s, p in zip(scales, view.places, strict=True))
    name = drawn_result(found, view, show)
    regions = "status" in view.values and name in (None, "safety_factor", "growth_rate", "critical_stiffness", "edge")
    if regions and view.shares:
        _share_of_stable(ax, x, y, view)
        name = None if show is None else name
    elif regions:
        _regions(ax, found, view, x, y)
    if name is not None and regions:
        _contours(ax, x, y, view.values[name], name, found, missing_note(view, name))
    elif name is not None:
        _colours(ax, found, view, x, y, name, scale)
    line = _edge(ax, x, y, view)
    ax.set_xlim(x.min(), x.max())
    ax.set_ylim(y.min(), y.max())
    _mark_own(ax, found, view, scales, line, with_values=scale is None)


def _regions(ax: Axes, found: MapResult, view: View, x: Array, y: Array) -> None:
    status = view.values["status"]
    colours = {UNSTABLE: (ORANGE, 0.45, "unstable"), STABLE: (SKY, 0.55, "stable")}
    for code, (colour, alpha, label) in colours.items():
        inside = np.where(status == code, 1.0, np.nan)
        if np.isfinite(inside).any():
            ax.pcolormesh(x, y, inside, cmap=ListedColormap([colour]), alpha=alpha, shading="nearest", rasterized=True,
                          linewidth=0)  # fmt: skip
            add_legend_entry(ax, Patch(facecolor=colour, alpha=alpha, label=label))
    absent = status == ABSENT
    if absent.any():
        if min(absent.shape) > 1:
            ax.contourf(x, y, absent.astype(float), levels=[0.5, 1.5], colors="none", hatches=["///"])
        reasons = _absence_reasons(found, view, absent)
        add_legend_entry(ax, Patch(facecolor="white", edgecolor=GREY, hatch="///", label=f"no steady sliding{reasons}"))
    if (unknown := status == UNKNOWN).any():
        if min(unknown.shape) > 1:
            ax.contourf(x, y, unknown.astype(float), levels=[0.5, 1.5], colors="none", hatches=["xx"])
        add_legend_entry(ax, Patch(facecolor="white", edgecolor=GREY, hatch="xx", label=OUT_OF_RANGE))
    if (status < 0).any():
        add_legend_entry(ax, Patch(facecolor="white", edgecolor=GREY, label="not computed yet"))


def _absence_reasons(found: MapResult, view: View, absent: Array) -> str:
    """Reasons for no steady sliding in brackets (lock-up, lift-off), from some of the points; empty if unknown."""
    try:
        rig = found.rig
    except NotAvailable:
        return ""
    found_reasons = absence_reasons(rig, points_at(view, np.argwhere(absent)))
    return f" ({found_reasons})" if found_reasons else ""


def _share_of_stable(ax: Axes, x: Array, y: Array, view: View) -> None:
    share = view.shares["status"][STABLE]
    mesh = ax.pcolormesh(x, y, share, cmap="cividis", vmin=0, vmax=1, shading="nearest", rasterized=True)
    ax.figure.colorbar(mesh, ax=ax, label="share of samples that are stable (1)")
    if min(share.shape) > 1:
        lines = ax.contour(x, y, share, levels=[0.05, 0.5, 0.95], colors="white", linewidths=0.9)
        ax.clabel(lines, fontsize="small")


def _contours(ax: Axes, x: Array, y: Array, values: Array, name: str, found: MapResult, note: str) -> None:
    good = values[np.isfinite(values)]
    if min(values.shape) < 2 or not len(good) or good.min() == good.max():
        return
    if name == "safety_factor":
        levels, factor = [s for s in SAFETY_LEVELS if good.min() < s < good.max()], 1.0
        label = "k/k_cr" if found.along(name) is None else result_label(found, name)
    else:
        factor, shown_unit = display_unit(found.unit(name), float(np.median(np.abs(good))) or 1.0, found.area(name))
        levels, label = _levels(good / factor), axis_label(result_label(found, name), shown_unit)
    if not levels:
        return
    lines = ax.contour(x, y, values / factor, levels=levels, colors=BLACK, linewidths=0.6, linestyles="--")
    ax.clabel(lines, fontsize="small", fmt=lambda level: f"{level:g}")
    add_legend_entry(ax, Line2D([], [], color=BLACK, linewidth=0.6, linestyle="--", label=label + note))


def _levels(values: Array) -> list[float]:
    """Contour levels: powers of ten on both sides of zero, or even steps if the values span less than a decade."""
    found: list[float] = []
    for sign in (-1, 1):
        size = sign * values[sign * values > 0]
        if not len(size):
            continue
        low, high = np.quantile(size, [0.05, 1.0])
        top = math.floor(math.log10(high))
        found += [sign * 10.0**e for e in range(top - 3, top + 1) if 10.0**e >= low]
    if len(found) < 2:
        low, high = np.quantile(values, [0.05, 0.95])
        found = [float(f"{v:.2g}") for v in np.linspace(low, high, 6)[1:-1]]
    return sorted(set(found))


def _colours(ax: Axes, found: MapResult, view: View, x: Array, y: Array, name: str, scale: Any) -> None:
    values = view.values[name]
    if values.ndim > 2:
        message = f"{name!r} has several numbers a point; draw it over one parameter, y=''"
        raise ParameterError([Problem("show", message)])
    words = found.words(name)
    if words:
        colours = [KIND_COLOURS[i % len(KIND_COLOURS)] for i in range(len(words))]
        norm = BoundaryNorm(np.arange(len(words) + 1) - 0.5, len(words))
        kinds = np.where(values >= 0, values, np.nan).astype(float)
        ax.pcolormesh(x, y, kinds, cmap=ListedColormap(colours), norm=norm, shading="nearest", rasterized=True)
        for code in np.unique(values[values >= 0]):
            add_legend_entry(ax, Patch(facecolor=colours[int(code)], label=words[int(code)]))
        if (values < 0).any():
            add_legend_entry(ax, Patch(facecolor="white", edgecolor=GREY, label="not computed yet"))
        return
    factor, unit, norm = scale or colour_scale([values], found.unit(name), found.area(name))
    mesh = ax.pcolormesh(x, y, np.where(np.isfinite(values), values, np.nan) / factor, cmap="cividis", norm=norm,
                         shading="nearest", rasterized=True)  # fmt: skip
    ax.figure.colorbar(mesh, ax=ax, label=axis_label(result_label(found, name), unit))
    if note := missing_note(view, name):
        add_legend_entry(ax, Patch(facecolor="none", label=f"median of samples{note}"))
    if white := without_number(found, view, name):
        add_legend_entry(ax, Patch(facecolor="white", edgecolor=GREY, label=white))


def colour_scale(fields: Sequence[Array], unit: str, area: float | None) -> tuple[float, str, Any]:
    """Display unit (size in SI units, name) and Matplotlib norm for the values of all fields."""
    values = np.concatenate([f[np.isfinite(f)].reshape(-1) for f in fields])
    if not len(values):
        return 1.0, unit, Normalize(0, 1)
    factor, name = display_unit(unit, float(np.median(np.abs(values))) or 1.0, area)
    low, high = np.quantile(values, [0.001, 0.999])
    positive = values[values > 0]
    if low >= 0 and len(positive) and high / np.quantile(positive, 0.02) >= LOG_RATIO:
        return factor, name, LogNorm(float(np.quantile(positive, 0.02)) / factor, float(high) / factor, clip=False)
    return factor, name, Normalize(float(low) / factor, float(high) / factor)


def _edge(ax: Axes, x: Array, y: Array, view: View) -> list[Array]:
    """Draw the edge of stability; return its pieces as vertices of shape (n, 2) in the units of the axes."""
    if len(x) < 2 or len(y) < 2:
        return []
    values = view.values
    if view.shares.get("status") is not None:
        field, level = view.shares["status"][STABLE], 0.5
    elif "status" in values:
        sign = np.select([values["status"] == STABLE, values["status"] == UNSTABLE], [1.0, -1.0], np.nan)
        field, level = sign * _edge_distance(values, sign), 0.0
    else:
        return []
    good = field[np.isfinite(field)]
    if not len(good) or not good.min() < level < good.max():
        return []
    lines = ax.contour(x, y, np.where(np.isfinite(field), field, np.nan), levels=[level], colors=BLACK, linewidths=2)
    add_legend_entry(ax, Line2D([], [], color=BLACK, linewidth=2, label="edge of stability"))
    polygons = [np.asarray(p) for path in lines.get_paths() for p in path.to_polygons(closed_only=False)]
    return [p for p in polygons if len(p)]


def _edge_distance(values: Mapping[str, Array], sign: Array) -> Array:
    """Non-negative values that vanish at the edge, so that contours are finer than the grid; ones if unavailable."""
    if "growth_rate" in values and np.isfinite(values["growth_rate"]).any():
        rate = np.abs(values["growth_rate"])
        return np.asarray(np.where(np.isfinite(rate), np.arcsinh(rate / (np.nanmedian(rate) or 1.0)), 1.0))
    if "safety_factor" in values:
        with np.errstate(all="ignore"):
            away = np.abs(np.log(values["safety_factor"]))
        return np.asarray(np.where(np.isfinite(away), away, np.nanmax(away, initial=1.0, where=np.isfinite(away))))
    return np.asarray(np.ones_like(sign))


def _mark_own(
    ax: Axes, found: MapResult, view: View, scales: Sequence[Scale], pieces: Sequence[Array], with_values: bool
) -> None:
    """Mark the base rig, if in view, and the point of the edge nearest to it, with its values if `with_values`."""
    own = [own_value(found, name) for name in view.names]
    limits = [ax.get_xlim(), ax.get_ylim()]
    if any(value is None for value in own):
        return
    at = [float(scale(value)) for scale, value in zip(scales, own, strict=True)]
    if not all(min(ends) <= value <= max(ends) for value, ends in zip(at, limits, strict=True)):
        return
    ax.plot(*([v] for v in at), "o", **OWN_RIG, zorder=5)
    nearest = _nearest(pieces, at, limits, [s.log for s in scales])
    if nearest is None:
        return
    ax.plot(*zip(at, nearest, strict=True), color=VERMILION, linewidth=1.2, linestyle=":", zorder=4)
    words = ", ".join(
        f"{short_name(name)} {format_quantity(float(value * scale.factor), found.unit(name), 3, found.area(name))}"
        for name, value, scale in zip(view.names, nearest, scales, strict=True)
    )
    ax.plot(*([v] for v in nearest), "X", color=VERMILION, markeredgecolor=BLACK, markersize=9, linestyle="none",
            label=f"nearest edge\n({words})" if with_values else "nearest edge", zorder=5)  # fmt: skip


def _nearest(pieces: Sequence[Array], at: Sequence[float], limits: Sequence[Any], logs: Sequence[bool]) -> Any:
    """Point of the edge nearest to `at` in the drawn figure, in the units of the axes; None without an edge."""

    def drawn(points: Array) -> Array:
        columns = [
            (np.log(c / lo) / np.log(hi / lo)) if log else (c - lo) / (hi - lo)
            for c, (lo, hi), log in zip(points.T, limits, logs, strict=True)
        ]
        return np.column_stack(columns)

    best, found = np.inf, None
    origin = drawn(np.array([at], dtype=float))[0]
    for piece in pieces:
        points = drawn(piece)
        starts, steps = points[:-1], np.diff(points, axis=0)
        if not len(steps):
            continue
        length = np.maximum(np.sum(steps**2, axis=1), 1e-300)
        share = np.clip(np.sum((origin - starts) * steps, axis=1) / length, 0, 1)
        distance = np.hypot(*(starts + share[:, None] * steps - origin).T)
        i = int(np.argmin(distance))
        if distance[i] < best:
            best, found = float(distance[i]), piece[i] + share[i] * (piece[i + 1] - piece[i])
    return found
