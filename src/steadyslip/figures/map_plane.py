"""Figures of maps over two parameters: regions or colours, contours, edge of stability, mark of the base rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity, typeset
from steadyslip.core.palette import BLACK, GREY, VERMILION
from steadyslip.figures import regions
from steadyslip.figures.cells import mark_areas
from steadyslip.figures.chart import SLIDING, absence_reasons, draw_edges, write_inside
from steadyslip.figures.contours import SAFETY_LEVELS, draw_levels, extended, pieces_of, safety_fields
from steadyslip.figures.map_axes import (
    KIND_COLOURS,
    LOG_RATIO,
    WORD_COLOURS,
    Scale,
    add_legend_entry,
    drawn_result,
    label_axes,
    missing_note,
    parameter_words,
    result_label,
)
from steadyslip.figures.style import AREAS, EDGES, OWN_RIG, SAFETY_WORDS, axis_label, display_unit
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.status import ABSENT, QUIET, STABLE, UNDAMPED, status as status_of
from steadyslip.linear.stiffness import growth_rate
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.view.absence import points_at, without_number
from steadyslip.maps.view.cut import View, own_value
from steadyslip.maps.view.map_result import MapResult
from steadyslip.model.numeric import by_matrices
from steadyslip.model.point import operating_point

_POWERS, _SUPERSCRIPTS = 4, str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")  # 0.001 to 1000 are printed as plain numbers
_ROOM = 0.03  # share of an axis added at an end, so that a mark there is drawn whole: over half its size
_CLOSER, _MOST = 8, 101  # contours use a grid _CLOSER times finer than the map's, at most _MOST points along an axis
_FINE = 8  # words in areas are placed on a grid this many times finer than the map's


def draw_plane(ax: Axes, found: MapResult, view: View, show: str | None, scale: Any) -> None:
    """Plot a result over two parameters: stability regions with contours, or colours on a `scale` shared by panels."""
    scales = label_axes(ax, found, view)
    x, y = (s(p) for s, p in zip(scales, view.places, strict=True))
    name = drawn_result(found, view, show)
    judged = "status" in view.values and name in (None, "safety_factor", "growth_rate", "critical_stiffness", "edge")
    line: list[Array] = []
    if judged and view.shares:
        _share_of_stable(ax, x, y, view)
        line = _edge_of_shares(ax, x, y, view.shares["status"][STABLE])
        name = None if show is None else name
    ax.set_xlim(_limits(x, scales[0], own_value(found, view.names[0])))
    ax.set_ylim(_limits(y, scales[1], own_value(found, view.names[1])))
    plane, within = _Refined(found, view, scales), None
    if judged and not view.shares:
        within = _areas(ax, found, view, plane)
    if name is not None and not judged:
        _colours(ax, found, view, x, y, name, scale)
    if "status" in view.values and not view.shares:
        line = _edge(ax, view.values["status"], plane, within)
    _mark_own(ax, found, view, scales, line, with_values=scale is None)
    drawn = _contours(ax, plane, name, found, (within, line)) if name is not None and judged else []
    if judged and not view.shares:
        _words(ax, view.values["status"], plane, [*drawn, *line])


def _limits(values: Array, scale: Scale, own: float | None) -> tuple[float, float]:
    """Limits of an axis of a map: its least and largest value, widened where the mark of the rig lies at an end.

    `values` are in the unit of the axis, `own` is the rig's value in SI units.
    """
    low, high = float(values.min()), float(values.max())
    if own is None or low == high:
        return low, high
    at = float(scale(own))
    room = _ROOM * (math.log(high / low) if scale.log else high - low)
    ends = []
    for end, sign in ((low, -1.0), (high, 1.0)):
        beyond = end * math.exp(sign * room) if scale.log else end + sign * room
        near = abs(math.log(at / end)) < room if scale.log and at > 0 else abs(at - end) < room
        ends.append(beyond if near and low <= at <= high else end)
    return ends[0], ends[1]


def _areas(ax: Axes, found: MapResult, view: View, refined: _Refined) -> Path | None:
    """Fill the area of each status, its outline refined between the points of the map.

    Return the outline of steady sliding in the units of the axes; None if the whole map slides steadily.
    """
    status = view.values["status"]
    absent = ~np.isin(status, SLIDING)
    slides, _ = regions.carried(status, absent)
    for code, (words, style) in AREAS.items():  # areas without steady sliding are drawn last, on top
        if not (here := status == code).any():
            continue
        label = words + (_absence_reasons(found, view, here) if code == ABSENT else "")
        path = refined.outline(slides == code if code in SLIDING else here, code, known=~absent | (code not in SLIDING))
        if len(path):
            ax.add_patch(PathPatch(path, label=label, **style))
        else:
            add_legend_entry(ax, Patch(label=label, **style))
    if (status < 0).any():
        missing = refined.outline(status < 0, known=False)
        ax.add_patch(PathPatch(missing, facecolor="white", edgecolor=GREY, label="not computed yet"))
    return refined.outline(~absent, *SLIDING) if absent.any() else None


def _words(ax: Axes, status: Array, refined: _Refined, lines: Sequence[Array]) -> None:
    """Write the word of each status into its area; if it fits, the legend entry of the status is removed."""
    fine = np.repeat(np.repeat(status, _FINE, axis=0), _FINE, axis=1)
    for code, (words, _) in AREAS.items():
        if (fine == code).any() and write_inside(ax, fine == code, words, refined.place, lines):
            for patch in ax.patches:
                if patch.get_label() == words:
                    patch.set_label("_" + words)


def _edge(ax: Axes, status: Array, refined: _Refined, within: Path | None) -> list[Array]:
    """Draw the edge of stability; return its pieces as vertices of shape (n, 2) in the units of the axes."""
    if min(status.shape) < 2:
        return []
    absent = ~np.isin(status, SLIDING)
    slides, far = regions.carried(status, absent)
    line = regions.edges(refined.has(*QUIET), np.isin(slides, QUIET), far, ~absent)
    if refined.rig is not None:
        draw_edges(ax, refined.rig, line, refined.vary, refined.place, within)
    elif np.isfinite(line).any():
        ax.plot(*refined.place(line), **EDGES["oscillation"], label="edge of stability")
    known = regions.edges(refined.has(*QUIET), np.isin(status, QUIET), absent)
    return [np.column_stack(refined.place(piece)) for piece in _pieces(known)]


def _pieces(line: Array) -> list[Array]:
    """Pieces of a line of points (n, 2), split at NaN."""
    whole = np.isfinite(line[:, 0])
    cuts = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(int)))
    return [line[a:b] for a, b in cuts.reshape(-1, 2)]


class _Refined:
    """Status between the points of a map: computed with the map's rig, or without a rig that of the nearest point."""

    def __init__(self, found: MapResult, view: View, scales: Sequence[Scale]) -> None:
        self.view, self.scales = view, scales
        self.rig: Slider | Machine | None = None
        names = [*view.names, *view.held]
        with suppress(NotAvailable):
            self.rig = None if any(name.startswith("protocol.") for name in names) else found.rig

    def _values(self, shares: Any, which: int) -> Any:
        """SI values of a parameter at fractions of its axis, on which grid points are equally spaced."""
        places = self.view.places[which]
        log = self.scales[which].log
        at = np.interp(np.asarray(shares) * (len(places) - 1), range(len(places)), np.log(places) if log else places)
        return np.exp(at) if log else at

    def vary(self, a: Any, b: Any) -> dict[str, Any]:
        """Parameters of the rig at fractions of both axes."""
        x, y = self.view.names
        return self.view.held | {x: self._values(a, 0), y: self._values(b, 1)}

    def place(self, shares: Any) -> tuple[Any, Any]:
        """Convert fractions of the axes, shape (n, 2), to their units."""
        return self.scales[0](self._values(shares[:, 0], 0)), self.scales[1](self._values(shares[:, 1], 1))

    def finer(self, name: str, along: str | None, values: Array) -> tuple[Array, Array, Array, Array]:
        """Data for contours on a grid `_CLOSER` times finer: x (m,), y (n,) axis units; status, result (n, m).

        Results that cannot be recomputed quickly, and those of maps without a rig, are the values of the map itself.
        """
        status = self.view.values["status"]
        sizes = [min(_CLOSER * (n - 1) + 1, max(n, _MOST)) for n in status.shape[::-1]]
        quick = self.rig is not None and not by_matrices(self.rig) and not operating_point(self.rig).model.delays
        if self.rig is None or not quick or self.view.shares or name not in ("growth_rate", "safety_factor"):
            x, y = (s(p) for s, p in zip(self.scales, self.view.places, strict=True))
            return x, y, status, values
        a, b = (np.linspace(0, 1, n) for n in sizes)
        vary = self.vary(*np.meshgrid(a, b))
        status = status_of(operating_point(self.rig, vary, scan=True))
        rate = growth_rate(self.rig, vary) if name == "growth_rate" else safety_factor(self.rig, vary, along=along)
        x, y = (scale(self._values(one, n)) for n, (scale, one) in enumerate(zip(self.scales, (a, b), strict=True)))
        return x, y, status, np.where(np.isin(status, SLIDING) & (status != UNDAMPED), rate, np.nan)

    def outline(self, mask: Array, *codes: int, known: Any = True) -> Path:
        """Outline, in units of the axes, of the region with a status in `codes`; `mask` is this region on the grid."""
        if min(mask.shape) < 2 or not len(path := regions.region_path(self.has(*codes), mask, known)):
            return Path(np.empty((0, 2)))
        return Path(np.column_stack(self.place(path.vertices)), path.codes)

    def has(self, *codes: int) -> regions.Predicate:
        """Predicate of fractions of both axes: True where the status is one of `codes`."""

        def predicate(a: Any, b: Any) -> Any:
            if self.rig is not None:
                return np.isin(status_of(operating_point(self.rig, self.vary(a, b), scan=True)), codes)
            status = self.view.values["status"]
            row, column = (
                np.rint(np.asarray(s) * (n - 1)).astype(int) for s, n in zip((b, a), status.shape, strict=True)
            )
            return np.isin(status[row, column], codes)

        return predicate


def _absence_reasons(found: MapResult, view: View, absent: Array) -> str:
    """Text of reasons for no steady sliding in brackets (lock-up, lift-off), from some points; empty if unknown."""
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


def _contours(
    ax: Axes, plane: _Refined, name: str, found: MapResult, around: tuple[Path | None, Sequence[Array]]
) -> list[Array]:
    """Draw contours of a result and return their lines; `around` has the outline of steady sliding and the edges."""
    view = plane.view
    values = np.where(view.values["status"] == UNDAMPED, np.nan, view.values[name])
    good = values[np.isfinite(values)]  # the growth rate of an undamped rig is only rounding
    if min(values.shape) < 2 or not len(good) or good.min() == good.max():
        return []
    x, y, status, values = plane.finer(name, found.along(name), values)
    levels, fields = [one for one in SAFETY_LEVELS if one != 1 or view.shares], [values]
    label = SAFETY_WORDS if found.along(name) is None else result_label(found, name)
    shown = levels
    if name != "safety_factor":
        factor, shown_unit = display_unit(found.unit(name), float(np.median(np.abs(good))) or 1.0, found.area(name))
        shown, label = _levels(good / factor), axis_label(result_label(found, name), shown_unit)
        fields, levels = [values / factor], shown
    elif not view.shares:
        fields, levels = safety_fields(values, status), [one / (1 + one) for one in levels]
    if not view.shares:
        fields = [extended(one, ~np.isin(status, SLIDING)) for one in fields]
    words = [_level_words(one) for one in shown]
    drawn = draw_levels(ax, x, y, fields, levels, words, around[0], around[1], linestyles="--")
    if drawn:
        label += missing_note(view, name)
        add_legend_entry(ax, Line2D([], [], color=BLACK, linewidth=0.6, linestyle="--", label=label))
    return drawn


def _level_words(level: float) -> str:
    """Text of a contour level; powers of ten far from 1 are written as 10ⁿ."""
    power = round(math.log10(abs(level))) if level else 0
    if abs(power) < _POWERS or not math.isclose(abs(level), 10.0**power):
        return f"{level:g}".replace("-", "−")
    return f"{'−' * (level < 0)}10{str(power).translate(_SUPERSCRIPTS)}"


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
        message = f"{name!r} has several numbers per point; draw it over one parameter, y=''"
        raise ParameterError([Problem("show", message)])
    words = found.words(name)
    if words:
        colours = [WORD_COLOURS.get(word, KIND_COLOURS[i % len(KIND_COLOURS)]) for i, word in enumerate(words)]
        norm = BoundaryNorm(np.arange(len(words) + 1) - 0.5, len(words))
        kinds = np.where(values >= 0, values, np.nan).astype(float)
        ax.pcolormesh(x, y, kinds, cmap=ListedColormap(colours), norm=norm, shading="nearest", rasterized=True)
        for code in np.unique(values[values >= 0]):
            add_legend_entry(ax, Patch(facecolor=colours[int(code)], label=words[int(code)]))
        if min(values.shape) > 1:
            mark_areas(ax, x, y, values, dict(enumerate(words)))
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


def _edge_of_shares(ax: Axes, x: Array, y: Array, share: Array) -> list[Array]:
    """Draw the line where half of the samples are stable; return its pieces, (n, 2) in the units of the axes."""
    if min(share.shape) < 2 or not np.nanmin(share) < 0.5 < np.nanmax(share):
        return []
    lines = ax.contour(x, y, share, levels=[0.5], colors=BLACK, linewidths=2)
    add_legend_entry(ax, Line2D([], [], color=BLACK, linewidth=2, label="edge of stability"))
    return [piece for path in lines.get_paths() for piece in pieces_of(path)]


def _mark_own(
    ax: Axes, found: MapResult, view: View, scales: Sequence[Scale], pieces: Sequence[Array], with_values: bool
) -> None:
    """Mark the base rig, if in view, and the nearest point of the edge, with its values if `with_values`."""
    own = [own_value(found, name) for name in view.names]
    if not all(_is_own(found, name, value) for name, value in view.held.items()):
        return  # the rig belongs to another panel, or to no panel
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
    values = [
        typeset(format_quantity(float(value * scale.factor), found.unit(name), 3, found.area(name))).replace("-", "−")
        for name, value, scale in zip(view.names, nearest, scales, strict=True)
    ]
    words = ",\n".join(
        f"{parameter_words(found, name)} {value}" for name, value in zip(view.names, values, strict=True)
    )
    ax.plot(*([v] for v in nearest), "X", color=VERMILION, markeredgecolor=BLACK, markersize=9, linestyle="none",
            label=f"nearest edge\n({words})" if with_values else "nearest edge", zorder=5)  # fmt: skip


def _is_own(found: MapResult, name: str, value: float) -> bool:
    """True if `value`, at which a parameter is held, is the value of the map nearest to the rig's own."""
    own, values = own_value(found, name), np.asarray(found.dataset[name].values)
    return own is None or (values.min() <= own <= values.max() and value == values[np.argmin(np.abs(values - own))])


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
