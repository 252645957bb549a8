"""Figures of maps: curves over one parameter, regions and contours over two, panels over a third."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError, unknown_name
from steadyslip.core.format import format_quantity, typeset
from steadyslip.core.names import resolve
from steadyslip.figures.map_axes import add_legend, drawn_result, parameter_words
from steadyslip.figures.map_curves import draw_curve, draw_scatter
from steadyslip.figures.map_plane import colour_scale, draw_plane
from steadyslip.figures.style import axes_or_new, is_narrow, new_panels
from steadyslip.maps.view.cut import View, axes_of, take
from steadyslip.maps.view.map_result import MapResult

MAX_FACETS = 6  # largest number of panels of one figure: two rows of three


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

    Over two parameters: regions of stable, unstable and no steady sliding, with contours of the result; or colours, if
    the result is not about steady sliding. Over one parameter: the result as a curve, with these regions
    shaded. Samples on grids are drawn as median and 95 % band, or as share that is stable; without grids as points. The
    base rig is marked, and the point of the edge of stability nearest to it in the figure.

    Parameters
    ----------
    found : MapResult
    x, y : str, optional
        Parameters on the axes; the first two of the map unless given. For a map of two or more dimensions, give
        ``y=""`` to draw curves over `x` alone.
    show : str, optional
        Result to draw; by default regions with contours of the safety factor or growth rate if the map has them.
    facet : str, optional
        A third parameter: one panel for each of up to six of its values.
    at : mapping of str to float or str, optional
        Values at which other parameters are held; by default those nearest to the rig's own.
    ax : matplotlib.axes.Axes, optional
        Not allowed with `facet`.

    Returns
    -------
    matplotlib.axes.Axes or ndarray of Axes
        An array with `facet`.

    Raises
    ------
    ParameterError
        If a name is not one of the map's.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> found = ss.run_map(ss.Map(rig, {"stiffness": [10e9, 20e9, 40e9]}, ["growth_rate"]), "curve.zarr")
    >>> axes = ss.figures.map_figure(found)
    >>> axes.figure.savefig("map-figure.svg")
    """
    if show is not None and show not in found.results:
        raise ParameterError([Problem("show", unknown_name("result", show, found.results))])
    third = None if facet is None else _facet_name(found, facet)
    names = axes_of(found, x, y or None, third)
    if y == "":
        names = names[:1]
    if third in names:
        raise ParameterError([Problem("facet", f"{third} is on an axis already; choose another parameter")])
    if third is not None:
        return _draw_facets(found, names, show, third, at or {})
    view = take(found, names, _needed_results(found, show), at)
    ax = axes_or_new(ax)
    _draw(ax, found, view, show)
    add_legend(ax)
    return ax


def _needed_results(found: MapResult, show: str | None) -> list[str]:
    wanted = ("status", "safety_factor", "growth_rate", show or found.results[0])
    return [name for name in dict.fromkeys(wanted) if name in found.results]


def _facet_name(found: MapResult, facet: str) -> str:
    grids = [dim for dim in found.dims if dim != "sample"]
    try:
        return resolve(facet, dict.fromkeys(grids))
    except UnknownNameError as error:
        raise ParameterError([Problem("facet", unknown_name("parameter", facet, grids))]) from error


def _draw_facets(found: MapResult, names: Sequence[str], show: str | None, third: str, at: Mapping[str, Any]) -> Any:
    values = np.asarray(found.dataset[third].values)
    chosen = values[np.unique(np.linspace(0, len(values) - 1, min(MAX_FACETS, len(values))).round().astype(int))]
    columns = min(1 if is_narrow() else 3, len(chosen))
    rows = -(-len(chosen) // columns)
    axes = new_panels(rows, columns, (4.2 * columns, 3.6 * rows + 0.6), sharex=True, sharey=True)
    flat, figure = axes.reshape(-1), axes[0, 0].figure
    views = [take(found, names, _needed_results(found, show), {**at, third: float(value)}) for value in chosen]
    scale = _common_scale(found, views, drawn_result(found, views[0], show))
    for ax, view, value in zip(flat, views, chosen, strict=False):
        _draw(ax, found, view, show, scale)
        words = typeset(format_quantity(float(value), found.unit(third), area=found.area(third))).replace("-", "−")
        ax.set_title(f"{parameter_words(found, third)} = {words}", fontsize="medium")
    for ax in flat[len(chosen) :]:
        ax.set_axis_off()
    for ax in flat:
        ax.label_outer()
    handles: dict[str, Any] = {}
    for ax in flat:
        handles |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside upper left",
        ncols=min(4, columns + 1),
        frameon=False,
        fontsize="small",
    )
    return axes


def _common_scale(found: MapResult, views: Sequence[View], name: str | None) -> Any:
    """Colour scale common to all panels; an empty tuple if nothing is drawn in colours of a scale."""
    if name is None or len(views[0].names) < 2 or found.words(name):
        return ()
    return colour_scale([view.values[name] for view in views], found.unit(name), found.area(name))


def _draw(ax: Axes, found: MapResult, view: View, show: str | None, scale: Any = None) -> None:
    """Plot samples as points, a curve or a plane, depending on the view; `scale` is a colour scale shared by panels."""
    if view.scattered:
        draw_scatter(ax, found, view, show)
    elif len(view.names) == 1:
        draw_curve(ax, found, view, show)
    else:
        draw_plane(ax, found, view, show, scale)
