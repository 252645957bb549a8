"""Stability chart: regions of stable, unstable and no steady sliding in the plane of two parameters."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.figures import regions
from steadyslip.figures.axis import ChartAxis, chart_axis
from steadyslip.figures.contours import SAFETY_LEVELS, draw_levels, extended, safety_fields
from steadyslip.figures.style import (
    AREA_WORD,
    AREAS,
    CONTOURS,
    EDGES,
    HALO,
    OWN_RIG,
    SAFETY_WORDS,
    add_legend_above,
    axes_or_new,
)  # fmt: skip
from steadyslip.linear.response import has_closed_form
from steadyslip.linear.stable_values import safety_factor
from steadyslip.linear.status import ABSENT, QUIET, STABLE, UNDAMPED, UNSTABLE, status as status_of
from steadyslip.linear.stiffness import eigenvalues
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import explain_absence

_CONTOUR_POINTS_LATE = 61  # number of points along each axis for rigs with delays: a point takes some 0.1 ms (measured)
_STEPS = 8  # words keep clear of this many points on each segment of a line (by trial)
_LETTER, _LINE = 0.0105, 0.045  # half a letter's width, a line's height with halo: fractions of a new figure's axes
_SAMPLES = 12  # limit of points at which the reason for no steady sliding is computed, for time (by trial)


def stability_chart(
    rig: Slider,
    x: str,
    y: str,
    ax: Axes | None = None,
    x_range: Sequence[Any] | None = None,
    y_range: Sequence[Any] | None = None,
    points: int = 201,
) -> Axes:
    """Regions of stable, unstable and no steady sliding in the plane of two parameters.

    Ill-posed rigs (negative effective mass or direct effect) count as unstable. A region narrower than
    the spacing of the grid can be missed; the outlines of other regions are exact.

    Parameters
    ----------
    rig : Slider
    x, y : str
        Parameters on the axes: dotted names, or unique last parts.
    ax : matplotlib.axes.Axes, optional
    x_range, y_range : (low, high), optional
        SI numbers, or text such as ``"10 deg"``. By default the domain of angles and shares, otherwise around
        the rig's own value with its nearest edge in view. An axis is logarithmic where its range is
        positive and spans more than two decades.
    points : int
        Grid points along each axis, at least 2.

    Returns
    -------
    matplotlib.axes.Axes
        Angles in degrees, other units with a suitable prefix; the rig's own point is marked if in view.

    Raises
    ------
    UnknownNameError, ParameterError, NotAvailable
        If a name or range is not allowed, or a range has to be given.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> axes = ss.figures.stability_chart(rig, "contact.angle", "stiffness", points=21)
    >>> axes.figure.savefig("stability-chart.svg")
    """
    first, second = chart_axis(rig, x, x_range), chart_axis(rig, y, y_range)
    if first.name == second.name:
        raise ParameterError([Problem(first.name, "is on both axes; allowed: two different parameters")])
    if not isinstance(points, int) or points < 2:
        raise ParameterError([Problem("points", f"got {points!r}; allowed: a whole number >= 2")])

    def vary(a: Any, b: Any) -> dict[str, Any]:
        return {first.name: first.at(a), second.name: second.at(b)}

    def status(a: Any, b: Any) -> Any:
        return status_of(operating_point(rig, vary(a, b), scan=True))

    ax = axes_or_new(ax)
    _set_axes(ax, first, second)
    grid = regions.on_grid(status, points)

    def place(shares: Any) -> tuple[Any, Any]:
        return _display_points(shares, first, second)

    def inside(code: int) -> regions.Predicate:
        return lambda a, b: status(a, b) == code

    reasons = _absence_reasons(rig, first, second, grid)
    absent = ~np.isin(grid, SLIDING)
    slides, far = regions.carried(grid, absent)
    for code, (words, style) in AREAS.items():  # areas without steady sliding are drawn last, on top
        path = regions.region_path(
            inside(code), (slides if code in SLIDING else grid) == code, ~absent | (code not in SLIDING)
        )
        if len(path):
            label = f"{words} ({reasons})" if code == ABSENT and reasons else words
            ax.add_patch(PathPatch(Path(np.column_stack(place(path.vertices)), path.codes), label=label, **style))
    within = None
    if absent.any():
        path = regions.region_path(lambda a, b: np.isin(status(a, b), SLIDING), ~absent)
        within = Path(np.column_stack(place(path.vertices)), path.codes)
    gone = regions.edges(inside(ABSENT), grid == ABSENT)
    if np.isfinite(gone).any():
        ax.plot(*place(gone), **EDGES["no steady sliding"], label=f"edge: {reasons}")
    line = regions.edges(lambda a, b: np.isin(status(a, b), QUIET), np.isin(slides, QUIET), far, ~absent)
    draw_edges(ax, rig, line, vary, place, within)
    _mark_own(ax, rig, first, second)
    drawn = [np.column_stack(place(one[np.isfinite(one[:, 0])])) for one in (line, gone)]
    contours = _draw_contours(ax, rig, first, second, grid, within, [one for one in drawn if len(one)])
    written = [words for code, (words, _) in AREAS.items() if write_inside(ax, grid == code, words, place, contours)]
    add_legend_above(ax, without=written)
    return ax


SLIDING = (STABLE, UNSTABLE, UNDAMPED)
Place = Callable[[Any], tuple[Any, Any]]  # from fractions of the axes, shape (n, 2), to their units


def draw_edges(
    ax: Axes, rig: Slider | Machine, line: Any, vary: Callable[[Any, Any], Any], place: Place, within: Any = None
) -> None:
    """Draw the edge of stability in the style of the disturbance that grows beyond it (oscillation or drift).

    At each point of the edge this is the least damped disturbance. `line`, shape (n, 2), has points in fractions of the
    axes, NaN between pieces; `vary` returns the parameters at these points. The line is clipped to the outline
    `within`, a path in the units of the axes, if given.
    """
    kinds = np.full(len(line), "", dtype="<U16")
    known = np.flatnonzero(np.isfinite(line[:, 0]))
    if not len(known):
        return
    roots = eigenvalues(rig, vary(*line[known].T))
    sizes = np.maximum(np.abs(roots), np.finfo(float).tiny)
    rates = np.where(np.isfinite(roots), np.abs(roots.real) / sizes, np.inf)
    least = np.take_along_axis(roots, np.argmin(rates, axis=-1)[:, None], axis=-1)[:, 0]
    kinds[known] = np.where(np.abs(least.imag) > np.abs(least.real), "oscillation", "drift")
    good = known[np.isfinite(roots).any(axis=-1)]
    if len(good):  # points without eigenvalues get the kind of the nearest point that has eigenvalues
        kinds[known] = kinds[good[np.argmin(np.abs(known[:, None] - good), axis=1)]]
    for kind in ("oscillation", "drift"):
        here = kinds == kind
        here[1:] |= here[:-1] & (kinds[1:] != "")  # up to the next point, so that there is no gap between pieces
        if here.any():
            points = place(np.where(here[:, None], line, np.nan))
            (drawn,) = ax.plot(*points, **EDGES[kind], label=f"edge of stability: {kind}")
            if within is not None:
                drawn.set_clip_path(PathPatch(within, transform=ax.transData))


def _draw_contours(
    ax: Axes, rig: Slider, x: ChartAxis, y: ChartAxis, grid: Any, within: Any, edges: Sequence[Any]
) -> list[Any]:
    """Draw contours of k/k_cr over a chart with status codes `grid`; return their lines, as vertices (n, 2).

    They are clipped to the outline `within` of steady sliding, if given; their labels keep clear of `edges`.
    """
    model = operating_point(rig).model
    late = bool(model.delays)
    fine = has_closed_form(model)
    points = 2 * len(grid) - 1 if fine else min(len(grid), _CONTOUR_POINTS_LATE) if late else len(grid)
    chosen = np.linspace(0, len(grid) - 1, points).round(1 if fine else 0)  # fine: also halfway between grid points
    share = chosen / (len(grid) - 1)
    a, b = np.meshgrid(share, share)
    vary = {x.name: x.at(a), y.name: y.at(b)}
    here = status_of(operating_point(rig, vary, scan=True)) if fine else grid[np.ix_(*2 * [chosen.astype(int)])]
    values = None
    with suppress(NotAvailable, ParameterError), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings on delays too long for a verdict: there are no contours there
        along = rig.parameter_along("stiffness") if late else None  # a delayed gain does not act as a stiffness
        values = safety_factor(rig, vary, along=along)
    if values is None or not np.isfinite(values).any():
        return []
    absent = ~np.isin(here, SLIDING)
    status = np.where(np.isnan(values), ABSENT, here) if late else here  # with delays NaN may mean unknown
    fields = [extended(one, absent) for one in safety_fields(np.where(absent, np.nan, values), status)]
    own = [rig.value(axis.name) for axis in (x, y)]
    marked = [] if None in own else [np.array([[axis.displayed(v) for axis, v in zip((x, y), own, strict=True)]])]
    levels = [level for level in SAFETY_LEVELS if level != 1]
    lines = draw_levels(
        ax, x.displayed(x.at(share)), y.displayed(y.at(share)), fields, [one / (1 + one) for one in levels],
        [f"{one:g}" for one in levels], within, [*marked, *edges],
    )  # fmt: skip
    if lines:
        ax.plot([], [], color=CONTOURS["colors"], linewidth=CONTOURS["linewidths"], label=SAFETY_WORDS)
    return lines


def write_inside(ax: Axes, region: Any, words: str, place: Place, lines: Sequence[Any] = ()) -> bool:
    """Write words into the widest place of each connected area of a region; True if they fit into any.

    Words are written vertically where they fit in no other way. `region`, shape (rows, columns), is True inside;
    `place` converts fractions of the axes, (n, 2), to their units. If possible, words keep clear of `lines`, each given
    by its vertices (n, 2).
    """
    from scipy.ndimage import label

    areas, many = label(region)
    written = [_write_in_area(ax, areas == n, words, place, lines) for n in range(1, many + 1)]
    return any(written)


def _write_in_area(ax: Axes, region: Any, words: str, place: Place, lines: Sequence[Any]) -> bool:
    mask, length = region.copy(), _LETTER * len(words)
    rows, columns = np.indices(mask.shape)
    own = [np.asarray(line.get_xydata())[0] for line in ax.lines if line.get_label() == OWN_RIG["label"]]
    others = np.reshape([*(text.get_position() for text in ax.texts), *own], (-1, 2))
    for x, y in _in_axes(ax, others):
        away = np.abs(columns / (mask.shape[1] - 1) - x), np.abs(rows / (mask.shape[0] - 1) - y)
        mask &= (away[0] > 2 * _LETTER) | (away[1] > _LINE)
    clear = mask.copy()
    for line in lines:
        ends = _in_axes(ax, line)
        steps = np.linspace(0, 1, _STEPS)[:, None, None]
        crossed = np.clip((1 - steps) * ends[None, :-1] + steps * ends[None, 1:], 0, 1).reshape(-1, 2)
        across, up = np.rint(crossed * (np.array(mask.shape[::-1]) - 1)).astype(int).T
        clear[up, across] = False
    for inside in (clear, mask) if lines else (mask,):
        for size, turned in (((length, _LINE), 0), ((_LINE, length), 90)):
            across, up, room = regions.widest_place(inside, size)
            if room >= 1:
                x, y = (float(one[0]) for one in place(np.array([[across, up]])))
                ax.text(
                    x, y, words, ha="center", va="center", rotation=turned, path_effects=HALO, zorder=4, gid=AREA_WORD
                )  # fmt: skip
                return True
    return False


def _in_axes(ax: Axes, points: Any) -> Any:
    """Fractions of the axes of points in data coordinates, both (n, 2)."""
    return ax.transAxes.inverted().transform(ax.transData.transform(points))


def _absence_reasons(rig: Slider, x: ChartAxis, y: ChartAxis, grid: Any) -> str:
    """Text of reasons for no steady sliding (lock-up, lift-off), from up to `_SAMPLES` points without it."""
    share = np.linspace(0, 1, len(grid))
    b, a = np.nonzero(grid == ABSENT)
    if not len(a):
        return ""
    chosen = np.unique(np.linspace(0, len(a) - 1, _SAMPLES).astype(int))
    return absence_reasons(rig, [{x.name: float(x.at(share[a[i]])), y.name: float(y.at(share[b[i]]))} for i in chosen])


def absence_reasons(rig: Slider | Machine, points: Sequence[dict[str, float]]) -> str:
    """Text of the distinct reasons for no steady sliding at points (SI value by parameter), comma-separated."""
    found = [explain_absence(rig.with_values(vary), operating_point(rig, vary)).condition for vary in points]
    return ", ".join(sorted(set(found)))


def _display_points(shares: Any, x: ChartAxis, y: ChartAxis) -> tuple[Any, Any]:
    return x.displayed(x.at(shares[:, 0])), y.displayed(y.at(shares[:, 1]))


def _mark_own(ax: Axes, rig: Slider, x: ChartAxis, y: ChartAxis) -> None:
    own = [rig.value(x.name), rig.value(y.name)]
    if all(v is not None and a.low <= v <= a.high for v, a in zip(own, (x, y), strict=True)):
        at = [x.displayed(own[0])], [y.displayed(own[1])]
        ax.plot(*at, "o", **OWN_RIG)


def _set_axes(ax: Axes, x: ChartAxis, y: ChartAxis) -> None:
    ax.set_xscale("log" if x.log else "linear")
    ax.set_yscale("log" if y.log else "linear")
    ax.set_xlim(x.displayed(x.low), x.displayed(x.high))
    ax.set_ylim(y.displayed(y.low), y.displayed(y.high))
    ax.set_xlabel(x.label)
    ax.set_ylabel(y.label)
