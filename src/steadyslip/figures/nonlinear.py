"""Figures of cycle branches, Hopf curves, basins of attraction and kick thresholds."""

from __future__ import annotations

from itertools import cycle, pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity, typeset
from steadyslip.core.palette import BLACK, BLOW_UP, BLUE, GREEN, GREY, ORANGE, SKY, STABLE, UNSTABLE, VERMILION, YELLOW
from steadyslip.figures.cells import mark_areas
from steadyslip.figures.map_axes import is_geometric
from steadyslip.figures.style import (
    AREAS,
    add_legend_above,
    axes_or_new,
    axis_label,
    display_unit,
    parameter_label,
    with_subscripts,
)
from steadyslip.linear.boundary import boundary
from steadyslip.linear.status import ABSENT, UNKNOWN, UNSTABLE as UNSTABLE_CODE, stability
from steadyslip.nonlinear.orbits.ranges import WORDS

if TYPE_CHECKING:
    from steadyslip.nonlinear import Basin, CycleBranch, HopfCurve
    from steadyslip.nonlinear.orbits.cycle import Cycle

_MARKERS = {"fold": ("D", ORANGE), "period doubling": ("s", VERMILION), "torus": ("^", GREEN),
            "branch point": ("v", SKY)}  # fmt: skip
_COLOURS = {"supercritical": BLUE, "subcritical": VERMILION, "degenerate": GREY, "not decided": BLACK}
_OUTCOME_COLOURS = {"returns": STABLE, "oscillation": UNSTABLE, "blow-up": BLOW_UP, "contact lost": GREEN,
                    "no solution": GREY, "undecided": YELLOW, "interrupted": BLACK}  # fmt: skip
_ENDS: dict[str, dict[str, Any]] = {
    "range": {"marker": "|", "markersize": 8, "markeredgewidth": 1.5},
    "last cycle": {"marker": "x", "markersize": 7, "markeredgewidth": 1.5},
    "not located": {"marker": "x", "markersize": 7, "markeredgewidth": 1.5},
    "edge": {"marker": "o", "markerfacecolor": "white"},
    "not followed": {"marker": "+", "markersize": 9, "markeredgewidth": 1.5},
}
"""Marker styles of the ends of a branch, by kind of end."""
_STEADY: dict[str, dict[str, Any]] = {
    "steady sliding": {"color": BLACK, "linewidth": 0.8, "linestyle": ":"},
    "steady sliding, stable": {"color": BLACK, "linewidth": 1.4, "linestyle": "-"},
    "steady sliding, unstable": {"color": BLACK, "linewidth": 0.8, "linestyle": "--"},
}
"""Line styles of steady sliding: stable, unstable, and dotted where that is not known."""
_UNDECIDED_HATCHES = ("++", "oo", "..")
NARROW_RANGE = 1e-3  # if the relative range of a branch is smaller, the axis has the distance from the onset (by trial)
BEYOND = 1.5  # drawn range of steady sliding beyond the onset, as a factor, or in tenths of the branch (by trial)
LEGEND_WIDTH = 36  # characters per line of a legend with two columns


def cycle_branch(branch: CycleBranch, ax: Axes | None = None) -> Axes:
    """Plot a bifurcation diagram: peak and lowest velocity of the cycles against the parameter.

    Full lines are stable cycles, dashed ones unstable; black lines are steady sliding. Period-doubled branches are
    thin. Diamonds are the cycles of the rig itself, filled if they attract. Marks of ends: bar, end of the range;
    cross, no cycle could be followed further; ring, another edge; plus, a branch that was not followed.

    Parameters
    ----------
    branch : CycleBranch
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["radiation_damping=1 GPa s/m"])
    >>> axes = ss.figures.cycle_branch(ss.cycles(rig))
    >>> axes.figure.savefig("cycle-branch.svg")
    """
    ax = axes_or_new(ax)
    area, origin, along = branch.rig.printed_area(branch.along), 0.0, parameter_label(branch.rig, branch.along)
    factor, unit = display_unit(branch.unit, branch.onset.value, area)
    reach = max((abs(one.value - branch.onset.value) for one in branch.cycles), default=0.0)
    if 0 < reach < NARROW_RANGE * abs(branch.onset.value):  # tick labels with the values would all look alike
        origin = branch.onset.value
        factor, unit = display_unit(branch.unit, reach, area)
        along = f"{along} minus {format_quantity(origin, branch.unit, 6, area)}"
    drive = branch.cycles[0].speed if len(branch) and branch.cycles[0].contact else branch.rig.drive.velocity
    speed, speed_unit = display_unit("m/s", drive)
    onset_speed, driven = drive, branch.along == "drive.velocity"
    if driven:  # the velocity of steady sliding differs from point to point
        at = branch.cycles[0].value if len(branch) and branch.cycles[0].contact else branch.rig.drive.velocity
        onset_speed = drive * branch.onset.value / at
        speed, speed_unit = display_unit("m/s", onset_speed)
    _draw_velocities(branch, ax, (origin, factor), speed, 1.8, True)
    if branch.doubled is not None:
        _draw_velocities(branch.doubled, ax, (origin, factor), speed, 0.9, False)
    named: set[str] = set()
    for values, words in _steady_stretches(branch):
        steady = onset_speed * values / branch.onset.value if driven else np.full_like(values, drive)
        ax.plot((values - origin) / factor, steady / speed, label="" if words in named else words, **_STEADY[words])
        named.add(words)
    kind = branch.onset.kind
    mark: dict[str, Any] = {"color": _COLOURS[kind], "marker": "o", "linestyle": "none"}
    ax.plot([(branch.onset.value - origin) / factor], [onset_speed / speed], label=branch.onset.title, **mark)
    seen: set[str] = set()
    for point in (*branch.special, *(branch.doubled.special if branch.doubled else ())):
        symbol, colour = _MARKERS[point.kind]
        name = "" if point.kind in seen else point.kind
        seen.add(point.kind)
        x = (point.cycle.value - origin) / factor
        ax.plot([x], [point.cycle.peak_velocity / speed], symbol, color=colour, label=name)
    _draw_ends(branch, ax, (origin, factor), speed, onset_speed)
    _draw_own(branch, ax, (origin, factor), speed)
    lowest, highest = (min((one.lowest_velocity for one in branch.cycles), default=0.0),
                       max((one.peak_velocity for one in branch.cycles), default=0.0))  # fmt: skip
    ax.set_yscale("log" if len(branch) and not highest < 2 * lowest else "linear")
    if origin:
        ax.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useOffset=False)
    elif len(branch) and np.all(branch["value"] > 0) and branch["value"].max() > 10 * branch["value"].min():
        ax.set_xscale("log")
    where = f" at {branch.cycles[0].contact}" if len(branch) and branch.cycles[0].contact else ""
    ax.set_xlabel(axis_label(along, unit))
    ax.set_ylabel(axis_label(f"highest and lowest velocity{where}", speed_unit))
    ax.grid(color=GREY, linewidth=0.3)
    add_legend_above(ax, 2, 1.0, fontsize="small")
    return ax


def _steady_stretches(branch: CycleBranch) -> list[tuple[np.ndarray, str]]:
    """Parameter values along the branch and beyond its onset, in pieces of equal stability, each with its label."""
    values = np.unique([branch.onset.value, *(one.value for one in branch.cycles)])
    low, high = values[0], values[-1]
    if low == high:
        low, high = sorted((0.8 * low, 1.2 * low))
    elif low > 0 and high > 10 * low:  # on a log axis
        low, high = (low, BEYOND * high) if branch.onset.value**2 > low * high else (low / BEYOND, high)
    else:
        more = 0.1 * BEYOND * (high - low)
        low, high = (low, high + more) if 2 * branch.onset.value > low + high else (max(low - more, min(low, 0)), high)
    ends = float(low), float(high)
    try:
        edges = [one.value for one in boundary(branch.rig, branch.along, between=ends)]
        bounds = [ends[0], *(one for one in edges if ends[0] < one < ends[1]), ends[1]]
        found = []
        for first, last in pairwise(bounds):
            inside = values[(values > first) & (values < last)]
            kind = stability(branch.rig.with_values({branch.along: 0.5 * (first + last)}))
            found.append((np.array([first, *inside, last]), f"steady sliding, {kind}"))
        if all(words in _STEADY for _, words in found):
            return found
    except (ParameterError, NotAvailable):
        pass
    return [(np.array([ends[0], *values, ends[1]]), "steady sliding")]


def _draw_velocities(
    branch: CycleBranch, ax: Axes, axis: tuple[float, float], speed: float, width: float, named: bool
) -> None:
    """Plot peak and lowest velocity along a branch, a line for each piece of equal stability.

    Velocities ≤ 0 (the block stops or reverses) are left out, as the axis is logarithmic. `axis` is the origin and unit
    of the parameter (SI), `speed` the unit of velocity (m/s).
    """
    used: set[bool] = set()
    for stretch in branch.stretches:
        good = stretch.stable
        style = {"color": BLUE if good else VERMILION, "linestyle": "-" if good else "--", "linewidth": width}
        name = ("stable cycle" if good else "unstable cycle") if named and good not in used else ""
        used.add(good)
        x = (np.array([cycle.value for cycle in stretch.cycles]) - axis[0]) / axis[1]
        for quantity in ("peak_velocity", "lowest_velocity"):
            velocity = np.array([getattr(cycle, quantity) for cycle in stretch.cycles])
            ax.plot(x, np.where(velocity > 0, velocity, np.nan) / speed, label=name, **style)  # type: ignore[arg-type]
            name = ""


def _draw_ends(branch: CycleBranch, ax: Axes, axis: tuple[float, float], speed: float, steady_speed: float) -> None:
    """Mark peak and lowest velocity at the ends of the branch and of its doublings, by kind of end, with the reason.

    `axis` and `speed` as in `_draw_velocities`; `steady_speed` (m/s) is the velocity of steady sliding at the onset.
    """
    marked: list[tuple[str, str, float, Cycle | None]] = []
    for part in filter(None, (branch, branch.doubled)):
        for n, (begins, stops) in enumerate(part.bounds):
            why = part.broken[n] if n < len(part.broken) else part.end
            marked += [(begins.kind, WORDS.get(begins.kind, begins.kind), begins.value, begins.cycle)]
            marked += [(stops.kind, why if stops.kind in _ENDS else stops.kind, stops.value, stops.cycle)]
        marked += [("not followed", "not followed from here", end.value, end.cycle) for end, _ in part.not_followed]
    named: set[str] = set()
    for kind, words, value, one in marked:
        if kind not in _ENDS:  # the onset and special cycles have marks of their own
            continue
        velocities = np.array([one.peak_velocity, one.lowest_velocity] if one else [steady_speed])
        known = words in named or kind == "not followed" or words.startswith("end ")
        label = "" if words in named else fill(typeset(words if known else f"end: {words}"), LEGEND_WIDTH)
        named.add(words)
        ax.plot(
            len(velocities) * [(value - axis[0]) / axis[1]], np.where(velocities > 0, velocities, np.nan) / speed,
            color=BLACK, linestyle="none", zorder=3, label=label, **_ENDS[kind],
        )  # fmt: skip


def _draw_own(branch: CycleBranch, ax: Axes, axis: tuple[float, float], speed: float) -> None:
    """Mark peak and lowest velocity of the cycles of the rig itself; `axis` and `speed` as in `_draw_velocities`."""
    for i, one in enumerate(branch.at_rig):
        velocity = np.array([one.peak_velocity, one.lowest_velocity])
        face = BLACK if one.stable else "white"
        ax.plot(
            2 * [(one.value - axis[0]) / axis[1]], np.where(velocity > 0, velocity, np.nan) / speed, "D", markersize=5,
            color=BLACK, markerfacecolor=face, zorder=3, label="" if i else "the rig itself",
        )  # fmt: skip


def hopf_curve(curve: HopfCurve, ax: Axes | None = None) -> Axes:
    """Plot the oscillatory edge in the plane of two parameters, coloured by the kind of onset.

    Parameters
    ----------
    curve : HopfCurve
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_or_new(ax)
    factors, names = [], []
    for name, unit, column in zip(curve.names, curve.units, (curve.first, curve.second), strict=True):
        factor, shown_unit = display_unit(unit, float(np.median(np.abs(column))), curve.rig.printed_area(name))
        factors.append(factor)
        names.append(axis_label(parameter_label(curve.rig, name), shown_unit))
    x, y = curve.first / factors[0], curve.second / factors[1]
    for kind, colour in _COLOURS.items():
        here = curve.kind == kind
        if not here.any():
            continue
        for edge, style in ((True, "-"), (False, ":")):
            inside = here & (curve.is_edge == edge)
            if inside.any():
                wide = inside.copy()
                wide[1:] |= inside[:-1]  # include the next point, so that there is no gap between pieces
                label = kind if edge else f"{kind}, behind another edge"
                ax.plot(np.where(wide, x, np.nan), np.where(wide, y, np.nan), style, color=colour, label=label)
    for i, point in enumerate(curve.special):
        at = [point.values[name] / factor for name, factor in zip(curve.names, factors, strict=True)]
        ax.plot(at[:1], at[1:], "o", color=BLACK, markersize=5, label="" if i else "kind of onset changes")
    for column, scale in ((curve.first, ax.set_xscale), (curve.second, ax.set_yscale)):
        if np.all(column > 0) and column.max() > 100 * column.min():
            scale("log")
    ax.set_xlabel(names[0])
    ax.set_ylabel(names[1])
    ax.grid(color=GREY, linewidth=0.3)
    ax.legend(fontsize="small")
    return ax


def basin(found: Basin, ax: Axes | None = None) -> Axes:
    """Plot the outcome of motion from every starting point, over slip ahead of the load point and velocity.

    Pale blue: motion returns to steady sliding (the dot). Yellow: undecided, with the reason in the legend. Dashed
    lines: unstable cycles. Full lines separate areas, which are named where the word fits.

    Parameters
    ----------
    found : Basin
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_or_new(ax)
    length, length_unit = display_unit(found.units[0], float(np.max(np.abs(found.x))) / 3)
    speed, speed_unit = display_unit(found.units[1], abs(found.steady[1]) or float(np.max(np.abs(found.v))))
    names = list(_OUTCOME_COLOURS)
    codes = np.vectorize(names.index)(found.outcome)
    colours = ListedColormap([*_OUTCOME_COLOURS.values()])
    norm = BoundaryNorm(np.arange(len(names) + 1) - 0.5, colours.N)
    ax.pcolormesh(found.x / length, found.v / speed, codes, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    for i, run in enumerate(run for run in found.cycles if found.names[1] in run.units):
        label = "" if i else "unstable cycle"
        ax.plot(run[found.names[0]] / length, run[found.names[1]] / speed, "--", color=VERMILION, label=label)
    ax.plot([0], [found.steady[1] / speed], "o", color=BLACK, markersize=4, label="steady sliding")
    for index in np.unique(codes):
        patch: dict[str, Any] = {"facecolor": _OUTCOME_COLOURS[names[index]], "edgecolor": GREY}
        doubts = np.unique(found.doubt[found.outcome == names[index]])
        for why in doubts:
            label = fill(f"undecided: {why}", LEGEND_WIDTH) if why else names[index]
            if where := ", ".join(sorted({*found.contact[found.outcome == names[index]].ravel()} - {""})):
                label = fill(f"{label} at {where}", LEGEND_WIDTH)
            ax.fill_between([], [], label=label, **patch)
    if found.v.min() > 0 and found.units[1].endswith("/s"):
        ax.set_yscale("log")
    ax.set_xlim(found.x.min() / length, found.x.max() / length)
    ax.set_ylim(found.v.min() / speed, found.v.max() / speed)
    mark_areas(ax, found.x / length, found.v / speed, codes, dict(enumerate(names)))
    if np.all(found.outcome == "returns"):
        words = "every starting point in this picture returns to steady sliding"
        ax.text(0.5, 0.04, fill(words, LEGEND_WIDTH), transform=ax.transAxes, ha="center", va="bottom")
    place, height = "slip ahead of the load point", "velocity"
    if body := found.names[0].rpartition(".")[0]:
        kind, name = found.names[1].rsplit(".", 1)
        place, height = f"{body} ahead of where it slides steadily", f"velocity of {body}"
        if name != "v":
            height = f"memory {name} of {kind}"
    ax.set_xlabel(axis_label(place, length_unit))
    ax.set_ylabel(axis_label(height, speed_unit))
    columns = 1 if np.any(found.doubt != "") else 2
    add_legend_above(ax, columns, 1.0, fontsize="small")
    return ax


def threshold_map(found: Any, ax: Axes | None = None) -> Axes:
    """Plot thresholds over two parameters, from `steadyslip.threshold_map` with DataArrays.

    Areas without a threshold are drawn as in a stability chart: orange where steady sliding is unstable, hatched where
    there is none. Crossed: the threshold is undecided, with the reason in the legend. White: no kick in the range is
    large enough.

    Parameters
    ----------
    found : xarray.DataArray
        With two dimensions that have coordinates; names and units of the axes from their attributes ``long_name`` and
        ``units``.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If `found` is not such a DataArray.
    """
    dims = getattr(found, "dims", ())
    if len(dims) != 2 or not all(dim in found.coords for dim in dims):
        raise ParameterError(
            [Problem("found", "allowed: a DataArray with two dimensions that have coordinates; vary DataArrays")]
        )
    ax = axes_or_new(ax)
    axes = []
    for dim in dims[::-1]:
        values = np.asarray(found[dim].values, dtype=float)
        factor, unit = display_unit(found[dim].attrs.get("units", "1"), float(np.median(np.abs(values))))
        words = found[dim].attrs.get("long_name") or str(dim).rpartition(".")[2].replace("_", " ")
        axes.append((values / factor, axis_label(with_subscripts(words), unit)))
    size = np.where(np.isfinite(found.values) & (found.values > 0), found.values, np.nan)
    (x, x_label), (y, y_label) = axes
    label = found.attrs.get("long_name", str(found.name or "threshold").replace("_", " "))
    if np.isfinite(size).any():
        mesh = ax.pcolormesh(x, y, size, cmap="cividis", shading="nearest", rasterized=True)
        ax.figure.colorbar(mesh, ax=ax, label=with_subscripts(fill(f"{label} (1)", LEGEND_WIDTH)))
    else:
        ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    if np.isinf(found.values).any():
        ax.fill_between([], [], facecolor="white", edgecolor=GREY, label="no kick in the range is large enough")
    if np.isfinite(size).sum() > 3:
        lines = ax.contour(x, y, size, colors=BLACK, linewidths=0.7)
        ax.clabel(lines, fontsize="small")
    if np.any(found.values == 0):
        _fill_cells(ax, x, y, found.values == 0, color=ListedColormap([UNSTABLE]))
        ax.fill_between([], [], label="steady sliding is unstable", **AREAS[UNSTABLE_CODE][1])
    for label, where, hatch in _missing_regions(found):
        _fill_cells(ax, x, y, where, hatch=hatch, edgecolor=BLACK, linewidth=0, color=ListedColormap(["none"]))
        ax.fill_between([], [], facecolor="none", edgecolor=BLACK, hatch=hatch, label=label)
    if ax.get_legend_handles_labels()[0]:
        add_legend_above(ax, 2, 1.0, fontsize="small")
    for values, set_scale in ((x, ax.set_xscale), (y, ax.set_yscale)):
        if len(values) > 2 and values.min() > 0 and is_geometric(values):
            set_scale("log")
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    return ax


def _fill_cells(ax: Axes, x: Any, y: Any, where: Any, color: Any, **style: Any) -> None:
    """Fill the cells of a grid around the points where the mask `where` is True."""
    ax.pcolor(x, y, np.where(where, 1.0, np.nan), cmap=color, shading="nearest", **style)


def _missing_regions(found: Any) -> list[tuple[str, Any, str]]:
    """Legend text, mask and hatch of each reason for missing thresholds."""
    missing = np.isnan(found.values)
    limit = np.asarray(found["limit"].values) if "limit" in found.coords else np.full(missing.shape, "not known")
    doubts = cycle(_UNDECIDED_HATCHES)
    known = {
        words: AREAS[code][1]["hatch"] for words, code in (("no steady sliding", ABSENT), ("out of range", UNKNOWN))
    }
    hatches = {word: known.get(str(word)) or next(doubts) for word in np.unique(limit[missing])}
    return [(fill(str(word), LEGEND_WIDTH), missing & (limit == word), hatch) for word, hatch in hatches.items()]
