"""Figures of the refined edges of maps, and of Sobol indices."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.errors import InternalError, ParameterError, Problem
from steadyslip.core.palette import BLACK, BLUE, ORANGE
from steadyslip.figures.map_axes import KIND_COLOURS, add_legend, label_axes, short_name
from steadyslip.figures.style import axes_or_new, is_narrow, new_panels, parameter_label
from steadyslip.maps.refine import Refined
from steadyslip.maps.sensitivity import Sensitivity
from steadyslip.maps.view.cut import View, own_value


def refined(found: Refined, ax: Axes | None = None) -> Axes:
    """Plot the points added along an edge of a map over two grids, and the edge found from them.

    Further parameters, given as lists, are held at the value nearest to the rig's own.

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

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> grids = {"stiffness": ss.maps.Grid("10 GPa/m", "40 GPa/m", 4), "friction.a": ss.maps.Grid(0.014, 0.015, 3)}
    >>> found = ss.run_map(ss.Map(rig, grids, ["growth_rate"]), "plane.zarr")
    >>> axes = ss.figures.refined(ss.refine(found, 1))
    >>> axes.figure.savefig("refined.svg")
    """
    names = [name for name in found.map.dims if name in found.spacing]
    if len(names) != 2:
        message = f"is over {', '.join(names)}; edges are drawn over two grids only: write this one as .csv"
        raise ParameterError([Problem(str(found.map.path), message)])
    ax = axes_or_new(ax)
    places = tuple(np.asarray(found.map.dataset[name].values) for name in names)
    view = View(tuple(names), places, {}, {}, {}, {}, False)
    scales = label_axes(ax, found.map, view)
    held = {n: found.map.read(n) for n in found.map.dims if n not in names}
    near = {n: values[np.argmin(np.abs(values - (own_value(found.map, n) or 0.0)))] for n, values in held.items()}
    shown = np.all([found.points[n] == at for n, at in near.items()] or [True], axis=0)
    on_edge = np.all([found.edge[n] == at for n, at in near.items()] or [True], axis=0)
    columns = [scale(np.where(shown, found.points[name], np.nan)) for name, scale in zip(names, scales, strict=True)]
    values = found.points[found.of]
    words = found.map.words(found.of)
    if words:
        groups = [(values == code, words[code], KIND_COLOURS[code % len(KIND_COLOURS)]) for code in np.unique(values)]
    else:
        if found.level is None:
            raise InternalError(f"a level for the refined edge of {found.of}, a number")
        above = values > found.level
        groups = [(above, f"above {found.level:.4g}", BLUE), (~above, f"below {found.level:.4g}", ORANGE)]
    for chosen, label, colour in groups:
        ax.plot(columns[0][chosen], columns[1][chosen], ".", color=colour, markersize=3, linestyle="none", label=label)
    edge = [scale(np.where(on_edge, found.edge[name], np.nan)) for name, scale in zip(names, scales, strict=True)]
    ax.plot(*edge, ".", color=BLACK, markersize=1.5, linestyle="none", label=f"edge of {found.of.replace('_', ' ')}")
    ax.set_xlim(*(scales[0](places[0][[0, -1]])))
    ax.set_ylim(*(scales[1](places[1][[0, -1]])))
    add_legend(ax)
    return ax


def sensitivity(found: Sensitivity, ax: Any = None) -> Any:
    """Plot Sobol indices: share of the variance due to each parameter alone, and with its interactions.

    Parameters
    ----------
    found : Sensitivity
    ax : matplotlib.axes.Axes or sequence of them, optional
        One Axes for each result.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
    """
    results, known = list(found.first), found.rig.parameters()
    if ax is None:
        high, many = 0.42 * len(found.parameters) + 1.6, len(results)
        ax = new_panels(many, 1, (4.6, high * many)) if is_narrow() else new_panels(1, many, (4.6 * many, high))
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
        one.set_yticks(
            place, [parameter_label(found.rig, name) if name in known else short_name(name) for name in order]
        )
        one.set_xlim(left=min(0.0, one.get_xlim()[0]))
        one.set_xlabel("share of the variance (1)")
        title = result.replace("_", " ")
        missing = found.missing[result]
        one.set_title(title + (f"\n(missing at {100 * missing:.3g} % of the points)" if missing else ""),
                      fontsize="medium")  # fmt: skip
    shown = axes[0].get_legend_handles_labels()
    axes[0].figure.legend(*shown, loc="outside upper left", ncols=2, frameon=False, fontsize="small")
    return axes
