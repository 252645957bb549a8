"""Pictures of maps: curves over one parameter, regions and contours over two, several side by side over a third."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from steadyslip.errors import NotAvailable, ParameterError, Problem, UnknownNameError, unknown_name
from steadyslip.figures.chart import absence_reasons
from steadyslip.figures.style import (
    BLACK,
    BLUE,
    CURVES,
    GREY,
    ORANGE,
    SKY,
    VERMILION,
    axes_or_new,
    display_unit,
    labelled,
)
from steadyslip.linear.status import ABSENT, STABLE, UNSTABLE
from steadyslip.quantities import shown
from steadyslip.records import resolve
from steadyslip.sweep.refine import Refined
from steadyslip.sweep.result import MapResult
from steadyslip.sweep.sensitivity import Sensitivity
from steadyslip.sweep.view import View, axes_of, own_value, take

Array = np.ndarray
SAFETY = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
FACETS = 6
MANY = 100.0  # ratio from which on an axis or colour scale is logarithmic
KINDS = (GREY, SKY, ORANGE, BLACK, BLUE, VERMILION, "#009E73", "#CC79A7", "#F0E442")


def map_figure(
    found: MapResult,
    x: str | None = None,
    y: str | None = None,
    show: str | None = None,
    *,
    facet: str | None = None,
    at: Mapping[str, Any] | None = None,
    ax: Any = None,
) -> Any:
    """Draw a map.

    Over two parameters: regions that are stable, unstable and without steady sliding, with contours of the result
    shown; or colours, where it is not about steady sliding. Over one: the result as a curve above those regions.
    Samples are summed up: median and 95 % band, share that is stable; alone they are drawn as points. The base rig is
    marked, and the point of the edge of stability that is nearest to it in the picture.

    Parameters
    ----------
    found : MapResult
    x, y : str, optional
        Parameters on the axes; the first two of the map unless given. For a map of two or more dimensions, give
        ``y=""`` to draw curves over `x` alone.
    show : str, optional
        Result; unless given, regions with contours of the safety factor or growth rate where the map has them.
    facet : str, optional
        A third parameter: one picture for each of up to six of its values.
    at : mapping of str to float or str, optional
        Where to hold other parameters; at the value nearest to the rig's own unless given.
    ax : matplotlib.axes.Axes, optional
        Not with `facet`.

    Returns
    -------
    matplotlib.axes.Axes or ndarray of Axes
        An array with `facet`.

    Raises
    ------
    ParameterError
        If a name is not one of the map's.
    """
    if show is not None and show not in found.results:
        raise ParameterError([Problem("show", unknown_name("result", show, found.results))])
    names = axes_of(found, x, y or None)
    if y == "":
        names = names[:1]
    if facet is not None:
        return _facets(found, names, show, facet, at or {})
    view = take(found, names, _needed(found, show), at)
    ax = axes_or_new(ax)
    _draw(ax, found, view, show)
    _legend(ax)
    return ax


def _needed(found: MapResult, show: str | None) -> list[str]:
    wanted = ("status", "safety_factor", "growth_rate", show or found.results[0])
    return [name for name in dict.fromkeys(wanted) if name in found.results]


def _facets(found: MapResult, names: Sequence[str], show: str | None, facet: str, at: Mapping[str, Any]) -> Any:
    from matplotlib import pyplot as plt

    others = [dim for dim in found.dims if dim not in (*names, "sample")]
    try:
        third = resolve(facet, dict.fromkeys(others))
    except UnknownNameError as error:
        raise ParameterError([Problem("facet", unknown_name("parameter", facet, others))]) from error
    values = np.asarray(found.dataset[third].values)
    chosen = values[np.unique(np.linspace(0, len(values) - 1, min(FACETS, len(values))).round().astype(int))]
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 3.6 * rows + 0.6), layout="constrained", squeeze=False,
        sharex=True, sharey=True,
    )  # fmt: skip
    flat = axes.reshape(-1)
    views = [take(found, names, _needed(found, show), {**at, third: float(value)}) for value in chosen]
    scale = _common_scale(found, views, _shown_name(found, views[0], show))
    for ax, view, value in zip(flat, views, chosen, strict=False):
        _draw(ax, found, view, show, scale)
        ax.set_title(f"{_short(third)} = {shown(float(value), found.unit(third))}", fontsize="medium")
    for ax in flat[len(chosen) :]:
        ax.set_axis_off()
    for ax in flat:
        ax.label_outer()
    handles: dict[str, Any] = {}
    for ax in flat:
        handles |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=4, frameon=False, fontsize="small")
    return axes


def _short(name: str) -> str:
    return name.rpartition(".")[2].replace("_", " ")


def _shown_name(found: MapResult, view: View, show: str | None) -> str | None:
    """The result that is drawn besides the regions."""
    if show is not None:
        return None if show == "status" else show
    if "status" not in view.values:
        return found.results[0]
    return next((name for name in ("safety_factor", "growth_rate") if name in view.values), None)


def _draw(ax: Axes, found: MapResult, view: View, show: str | None, scale: Any = None) -> None:
    """`scale` is that of the colours, where pictures share it."""
    if view.scattered:
        _scatter(ax, found, view, show)
    elif len(view.names) == 1:
        _curve(ax, found, view, show)
    else:
        _plane(ax, found, view, show, scale)


# -- axes ------------------------------------------------------------------------------------------------


class _Scale:
    """How a column of SI values is put on an axis."""

    def __init__(self, name: str, unit: str, values: Array, spaced: bool = True) -> None:
        finite = np.abs(values[np.isfinite(values) & (values != 0)])
        typical = float(np.median(finite)) if len(finite) else 1.0
        self.factor, self.unit = display_unit(unit, typical)
        self.label = labelled(_short(name), self.unit)
        good = values[np.isfinite(values)]
        self.log = bool(len(good)) and bool(good.min() > 0) and bool(good.max() / good.min() >= MANY)
        if spaced and self.log and len(good) > 2:  # as the grid is spaced
            self.log = bool(np.ptp(np.diff(np.log(good))) < np.ptp(np.diff(good / good.max())) + 1e-9)

    def __call__(self, values: Any) -> Any:
        return np.asarray(values) / self.factor


def _place_axes(ax: Axes, found: MapResult, view: View) -> list[_Scale]:
    scales = [_Scale(n, found.unit(n), p, not view.scattered) for n, p in zip(view.names, view.places, strict=True)]
    ax.set_xlabel(scales[0].label)
    ax.set_xscale("log" if scales[0].log else "linear")
    if len(scales) == 2:
        ax.set_ylabel(scales[1].label)
        ax.set_yscale("log" if scales[1].log else "linear")
    return scales


def _legend(ax: Axes) -> None:
    if ax.get_legend_handles_labels()[0]:
        # above the axes, where it hides no region, with room for a power of ten on the axis
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.04), ncols=2, frameon=False, borderaxespad=0.2,
                  fontsize="small")  # fmt: skip


# -- two parameters --------------------------------------------------------------------------------------


def _plane(ax: Axes, found: MapResult, view: View, show: str | None, scale: Any) -> None:
    scales = _place_axes(ax, found, view)
    x, y = (s(p) for s, p in zip(scales, view.places, strict=True))
    name = _shown_name(found, view, show)
    regions = "status" in view.values and name in (None, "safety_factor", "growth_rate", "critical_stiffness")
    if regions and view.shares:
        _share_of_stable(ax, x, y, view)
        name = None if show is None else name
    elif regions:
        _regions(ax, found, view, x, y)
    if name is not None and regions:
        _contours(ax, x, y, view.values[name], name, found.unit(name))
    elif name is not None:
        _colours(ax, found, view, x, y, name, scale)
    line = _edge(ax, x, y, view)
    ax.set_xlim(x.min(), x.max())
    ax.set_ylim(y.min(), y.max())
    _mark_own(ax, found, view, scales, line, told=scale is None)


def _regions(ax: Axes, found: MapResult, view: View, x: Array, y: Array) -> None:
    status = view.values["status"]
    colours = {UNSTABLE: (ORANGE, 0.45, "unstable"), STABLE: (SKY, 0.55, "stable")}
    for code, (colour, alpha, label) in colours.items():
        inside = np.where(status == code, 1.0, np.nan)
        if np.isfinite(inside).any():
            ax.pcolormesh(x, y, inside, cmap=ListedColormap([colour]), alpha=alpha, shading="nearest", rasterized=True,
                          linewidth=0)  # fmt: skip
            _entry(ax, Patch(facecolor=colour, alpha=alpha, label=label))
    absent = status == ABSENT
    if absent.any():
        if min(absent.shape) > 1:
            ax.contourf(x, y, absent.astype(float), levels=[0.5, 1.5], colors="none", hatches=["///"])
        reasons = _reasons(found, view, absent)
        _entry(ax, Patch(facecolor="white", edgecolor=GREY, hatch="///", label=f"no steady sliding{reasons}"))


def _entry(ax: Axes, handle: Any) -> None:
    """An entry of the legend without anything drawn in the Axes."""
    if isinstance(handle, Patch):
        ax.fill_between([], [], facecolor=handle.get_facecolor(), edgecolor=handle.get_edgecolor(),
                        hatch=handle.get_hatch(), label=handle.get_label())  # fmt: skip
    else:
        ax.add_line(handle)


def _reasons(found: MapResult, view: View, absent: Array) -> str:
    """Lock-up, lift-off or both, asked at some of the points without steady sliding."""
    try:
        rig = found.rig
    except NotAvailable:
        return ""
    rows = np.argwhere(absent)
    points = []
    for row in rows[np.unique(np.linspace(0, len(rows) - 1, 12).astype(int))]:
        place = {n: float(p[i]) for n, p, i in zip(view.names, view.places, row[::-1], strict=True)}
        points.append({n: v for n, v in (view.held | place).items() if not n.startswith("protocol.")})
    found_reasons = absence_reasons(rig, points)
    return f" ({found_reasons})" if found_reasons else ""


def _share_of_stable(ax: Axes, x: Array, y: Array, view: View) -> None:
    share = view.shares["status"][STABLE]
    mesh = ax.pcolormesh(x, y, share, cmap="cividis", vmin=0, vmax=1, shading="nearest", rasterized=True)
    ax.figure.colorbar(mesh, ax=ax, label="share of samples that are stable (1)")
    if min(share.shape) > 1:
        lines = ax.contour(x, y, share, levels=[0.05, 0.5, 0.95], colors="white", linewidths=0.9)
        ax.clabel(lines, fontsize="small")


def _contours(ax: Axes, x: Array, y: Array, values: Array, name: str, unit: str) -> None:
    good = values[np.isfinite(values)]
    if min(values.shape) < 2 or not len(good) or good.min() == good.max():
        return
    if name == "safety_factor":
        levels, factor, label = [s for s in SAFETY if good.min() < s < good.max()], 1.0, "k/k_cr"
    else:
        factor, shown_unit = display_unit(unit, float(np.median(np.abs(good))) or 1.0)
        levels, label = _levels(good / factor), f"{_short(name)} ({shown_unit})"
    if not levels:
        return
    lines = ax.contour(x, y, values / factor, levels=levels, colors=BLACK, linewidths=0.6, linestyles="--")
    ax.clabel(lines, fontsize="small", fmt=lambda level: f"{level:g}")
    _entry(ax, Line2D([], [], color=BLACK, linewidth=0.6, linestyle="--", label=label))


def _levels(values: Array) -> list[float]:
    """Powers of ten on both sides of zero, or even steps where the values span less than a decade."""
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
        colours = [KINDS[i % len(KINDS)] for i in range(len(words))]
        norm = BoundaryNorm(np.arange(len(words) + 1) - 0.5, len(words))
        kinds = np.where(values >= 0, values, np.nan).astype(float)
        ax.pcolormesh(x, y, kinds, cmap=ListedColormap(colours), norm=norm, shading="nearest", rasterized=True)
        for code in np.unique(values[values >= 0]):
            _entry(ax, Patch(facecolor=colours[int(code)], label=words[int(code)]))
        return
    factor, unit, norm = scale or _colour_scale([values], found.unit(name))
    mesh = ax.pcolormesh(x, y, np.where(np.isfinite(values), values, np.nan) / factor, cmap="cividis", norm=norm,
                         shading="nearest", rasterized=True)  # fmt: skip
    ax.figure.colorbar(mesh, ax=ax, label=labelled(name.replace("_", " "), unit))


def _colour_scale(fields: Sequence[Array], unit: str) -> tuple[float, str, Any]:
    from matplotlib.colors import Normalize

    values = np.concatenate([f[np.isfinite(f)].reshape(-1) for f in fields])
    if not len(values):
        return 1.0, unit, Normalize(0, 1)
    factor, name = display_unit(unit, float(np.median(np.abs(values))) or 1.0)
    low, high = np.quantile(values, [0.001, 0.999])
    positive = values[values > 0]
    if low >= 0 and len(positive) and high / np.quantile(positive, 0.02) >= MANY:
        return factor, name, LogNorm(float(np.quantile(positive, 0.02)) / factor, float(high) / factor, clip=False)
    return factor, name, Normalize(float(low) / factor, float(high) / factor)


def _common_scale(found: MapResult, views: Sequence[View], name: str | None) -> Any:
    """One colour scale for pictures side by side."""
    if name is None or len(views[0].names) < 2 or found.words(name):
        return ()
    return _colour_scale([view.values[name] for view in views], found.unit(name))


def _edge(ax: Axes, x: Array, y: Array, view: View) -> list[Array]:
    """Draw the edge of stability; returns its pieces as vertices (n, 2) in the units of the axes."""
    if len(x) < 2 or len(y) < 2:
        return []
    values = view.values
    if view.shares.get("status") is not None:
        field, level = view.shares["status"][STABLE], 0.5
    elif "status" in values:
        sign = np.select([values["status"] == STABLE, values["status"] == UNSTABLE], [1.0, -1.0], np.nan)
        field, level = sign * _distance(values, sign), 0.0
    else:
        return []
    good = field[np.isfinite(field)]
    if not len(good) or not good.min() < level < good.max():
        return []
    lines = ax.contour(x, y, np.where(np.isfinite(field), field, np.nan), levels=[level], colors=BLACK, linewidths=2)
    _entry(ax, Line2D([], [], color=BLACK, linewidth=2, label="edge of stability"))
    polygons = [np.asarray(p) for path in lines.get_paths() for p in path.to_polygons(closed_only=False)]
    return [p for p in polygons if len(p)]


def _distance(values: Mapping[str, Array], sign: Array) -> Array:
    """Something that vanishes at the edge, so that it can be drawn finer than the grid; 1 where there is nothing."""
    if "growth_rate" in values:
        rate = np.abs(values["growth_rate"])
        return np.asarray(np.where(np.isfinite(rate), np.arcsinh(rate / (np.nanmedian(rate) or 1.0)), 1.0))
    if "safety_factor" in values:
        with np.errstate(all="ignore"):
            away = np.abs(np.log(values["safety_factor"]))
        return np.asarray(np.where(np.isfinite(away), away, np.nanmax(away, initial=1.0, where=np.isfinite(away))))
    return np.asarray(np.ones_like(sign))


def _mark_own(
    ax: Axes, found: MapResult, view: View, scales: Sequence[_Scale], pieces: Sequence[Array], told: bool
) -> None:
    """The base rig, if it is in view, and the point of the edge nearest to it, with its numbers where there is room."""
    own = [own_value(found, name) for name in view.names]
    limits = [ax.get_xlim(), ax.get_ylim()]
    if any(value is None for value in own):
        return
    at = [float(scale(value)) for scale, value in zip(scales, own, strict=True)]
    if not all(min(ends) <= value <= max(ends) for value, ends in zip(at, limits, strict=True)):
        return
    ax.plot(*([v] for v in at), "o", color=VERMILION, markeredgecolor=BLACK, markersize=9, linestyle="none",
            label="this rig", clip_on=False, zorder=5)  # fmt: skip
    nearest = _nearest(pieces, at, limits, [s.log for s in scales])
    if nearest is None:
        return
    ax.plot(*zip(at, nearest, strict=True), color=VERMILION, linewidth=1.2, linestyle=":", zorder=4)
    words = ", ".join(
        f"{_short(name)} {shown(float(value * scale.factor), found.unit(name), 3)}"
        for name, value, scale in zip(view.names, nearest, scales, strict=True)
    )
    ax.plot(*([v] for v in nearest), "X", color=VERMILION, markeredgecolor=BLACK, markersize=9, linestyle="none",
            label=f"nearest edge\n({words})" if told else "nearest edge", zorder=5)  # fmt: skip


def _nearest(pieces: Sequence[Array], at: Sequence[float], limits: Sequence[Any], logs: Sequence[bool]) -> Any:
    """The point of the edge nearest to a point in the picture, in the units of the axes."""

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


# -- one parameter ---------------------------------------------------------------------------------------


def _curve(ax: Axes, found: MapResult, view: View, show: str | None) -> None:
    (scale,) = _place_axes(ax, found, view)
    x = scale(view.places[0])
    order = np.argsort(x)
    x = x[order]
    name = _shown_name(found, view, show) or "status"
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
    """Shading of stable and unstable stretches, ending midway between points."""
    ends = np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]])
    styles: dict[int, dict[str, Any]] = {
        STABLE: {"facecolor": SKY, "alpha": 0.35, "label": "stable"},
        UNSTABLE: {"facecolor": ORANGE, "alpha": 0.3, "label": "unstable"},
        ABSENT: {"facecolor": "none", "edgecolor": GREY, "hatch": "///", "label": "no steady sliding"},
    }
    for code, style in styles.items():
        inside = np.concatenate([[False], status == code, [False]])
        turns = np.flatnonzero(np.diff(inside.astype(int)))
        for number, (start, stop) in enumerate(zip(turns[::2], turns[1::2], strict=True)):
            keep = {k: v for k, v in style.items() if k != "label" or number == 0}
            ax.axvspan(ends[start], ends[stop], linewidth=0, zorder=0, **keep)


def _curve_of_numbers(ax: Axes, found: MapResult, view: View, x: Array, order: Array, name: str) -> None:
    values = np.asarray(view.values[name])[order]
    unit = found.unit(name)
    finite = values[np.isfinite(values)]
    scale = _Scale(name, unit, finite if len(finite) else np.ones(1), spaced=False)
    if values.ndim == 3:  # intervals and their ends
        top = finite.max() * 3 if len(finite) else 1.0
        for i in range(values.shape[1]):
            low, high = values[:, i, 0], np.where(np.isinf(values[:, i, 1]), top, values[:, i, 1])
            ax.fill_between(x, scale(low), scale(high), color=CURVES[i % len(CURVES)], alpha=0.4,
                            label=f"interval {i + 1} of stable stiffness")  # fmt: skip
    elif name in view.bands:
        low, middle, high = (scale(band[order]) for band in view.bands[name])
        ax.fill_between(x, low, high, color=BLUE, alpha=0.25, linewidth=0, label="95 % of samples")
        ax.plot(x, middle, color=BLUE, label="median of samples")
    else:
        ax.plot(x, np.where(np.isfinite(values), scale(values), np.nan), color=BLUE)
    ax.set_yscale("log" if scale.log else "linear")
    ax.set_ylabel(labelled(name.replace("_", " "), scale.unit))
    if name == "safety_factor":
        ax.axhline(1.0, color=BLACK, linewidth=0.8)
    if name == "growth_rate":
        ax.axhline(0.0, color=BLACK, linewidth=0.8)


def _curves_of_kinds(ax: Axes, found: MapResult, view: View, x: Array, order: Array, name: str) -> None:
    words = found.words(name)
    if name in view.shares:
        for code, word in enumerate(words):
            if view.shares[name][code].any():
                ax.plot(x, view.shares[name][code][order], color=KINDS[code % len(KINDS)], label=word)
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


# -- samples alone ---------------------------------------------------------------------------------------


def _scatter(ax: Axes, found: MapResult, view: View, show: str | None) -> None:
    scales = _place_axes(ax, found, view)
    name = _shown_name(found, view, show)
    across = [s(p) for s, p in zip(scales, view.places, strict=True)]
    if len(across) == 1:
        name = name or found.results[0]
        values = np.asarray(view.values[name], dtype=float)
        if values.ndim > 1:
            raise ParameterError([Problem("show", f"{name!r} has several numbers a point; choose another result")])
        up = _Scale(name, found.unit(name), values, spaced=False)
        across.append(up(np.where(np.isfinite(values), values, np.nan)))
        ax.set_yscale("log" if up.log else "linear")
        ax.set_ylabel(labelled(name.replace("_", " "), up.unit))
    status = view.values.get("status")
    kinds = (
        (UNSTABLE, "unstable", ORANGE, "v"),
        (STABLE, "stable", BLUE, "o"),
        (ABSENT, "no steady sliding", GREY, "x"),
    )
    if status is None:
        ax.plot(*across, ".", color=BLUE, markersize=4, linestyle="none")
        return
    for code, label, colour, marker in kinds:
        chosen = status == code
        if chosen.any():
            ax.plot(across[0][chosen], across[1][chosen], marker, color=colour, markersize=3, linestyle="none",
                    label=label)  # fmt: skip


# -- edges and shares ------------------------------------------------------------------------------------


def refined(found: Refined, ax: Axes | None = None) -> Axes:
    """Draw the points that were put along an edge of a map over two parameters, and the edge that they found.

    Parameters
    ----------
    found : Refined
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If the map is over another number of parameters.
    """
    names = [name for name in found.map.dims if name in found.spacing]
    if len(names) != 2 or len(found.map.dims) != 2:
        message = f"got a map over {', '.join(found.map.dims)}; allowed: two grids. Use points and edge for others"
        raise ParameterError([Problem("found", message)])
    ax = axes_or_new(ax)
    places = tuple(np.asarray(found.map.dataset[name].values) for name in names)
    view = View(tuple(names), places, {}, {}, {}, {}, False)
    scales = _place_axes(ax, found.map, view)
    columns = [scale(found.points[name]) for name, scale in zip(names, scales, strict=True)]
    values = found.points[found.of]
    words = found.map.words(found.of)
    if words:
        groups = [(values == code, words[code], KINDS[code % len(KINDS)]) for code in np.unique(values)]
    else:
        assert found.level is not None
        above = values > found.level
        groups = [(above, f"above {found.level:.4g}", BLUE), (~above, f"below {found.level:.4g}", ORANGE)]
    for chosen, label, colour in groups:
        ax.plot(columns[0][chosen], columns[1][chosen], ".", color=colour, markersize=3, linestyle="none", label=label)
    edge = [scale(found.edge[name]) for name, scale in zip(names, scales, strict=True)]
    ax.plot(*edge, ".", color=BLACK, markersize=1.5, linestyle="none", label=f"edge of {found.of.replace('_', ' ')}")
    ax.set_xlim(*(scales[0](places[0][[0, -1]])))
    ax.set_ylim(*(scales[1](places[1][[0, -1]])))
    _legend(ax)
    return ax


def sensitivity(found: Sensitivity, ax: Any = None) -> Any:
    """Draw Sobol indices: for each parameter the share that it has alone, and with others.

    Parameters
    ----------
    found : Sensitivity
    ax : matplotlib.axes.Axes or sequence of them, optional
        One for each result.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
    """
    results = list(found.first)
    if ax is None:
        from matplotlib import pyplot as plt

        height = 0.42 * len(found.parameters) + 1.6
        _, ax = plt.subplots(1, len(results), figsize=(4.6 * len(results), height), layout="constrained", squeeze=False)
    axes = np.atleast_1d(np.asarray(ax, dtype=object)).reshape(-1)
    for one, result in zip(axes, results, strict=True):
        order = found.ranked(result)[::-1]
        rows = np.array([found.parameters.index(name) for name in order])
        place = np.arange(len(rows))
        parts = (
            ("alone", found.first[result], found.first_interval[result], BLUE, 0.2),
            ("with others", found.total[result], found.total_interval[result], ORANGE, -0.2),
        )
        for label, values, (low, high), colour, shift in parts:
            reach = np.abs(np.stack([values - low, high - values]))[:, rows]
            one.barh(place + shift, values[rows], 0.36, xerr=reach, color=colour, ecolor=BLACK, capsize=2, label=label)
        one.set_yticks(place, [_short(name) for name in order])
        one.set_xlim(left=min(0.0, one.get_xlim()[0]))
        one.set_xlabel("share of the variance (1)")
        title = result.replace("_", " ")
        missing = found.missing[result]
        one.set_title(title + (f"\n(missing at {100 * missing:.3g} % of the points)" if missing else ""),
                      fontsize="medium")  # fmt: skip
    axes[0].legend(loc="lower right", fontsize="small")
    return axes
