"""Stability chart: regions of stable, unstable and no steady sliding in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.figures import regions
from steadyslip.figures.axis import ChartAxis, chart_axis
from steadyslip.figures.style import BLACK, GREY, ORANGE, OWN_RIG, SKY, add_legend_above, axes_or_new
from steadyslip.linear.status import ABSENT, STABLE, UNSTABLE, status as status_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import explain_absence

_SAMPLES = 12  # points at which the reason for no steady sliding is computed: time against missing a reason (by trial)


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
    the spacing of the grid can be missed; the outlines of the others are exact.

    Parameters
    ----------
    rig : Slider
    x, y : str
        Parameters on the axes: dotted names, or unique last parts.
    ax : matplotlib.axes.Axes, optional
    x_range, y_range : (low, high), optional
        SI units, or text such as ``"10 deg"``. By default the domain of angles and shares, otherwise around
        the rig's own value with its nearest edge in view. An axis is logarithmic where its range is
        positive and spans more than two decades.
    points : int
        Grid points along each axis, at least 2.

    Returns
    -------
    matplotlib.axes.Axes
        Angles in degrees, other units with the prefix that suits; the rig's own point is marked if in view.

    Raises
    ------
    UnknownNameError, ParameterError, NotAvailable
        If a name or range is not allowed, or a range has to be given.
    """
    first, second = chart_axis(rig, x, x_range), chart_axis(rig, y, y_range)
    if first.name == second.name:
        raise ParameterError([Problem(first.name, "is on both axes; allowed: two different parameters")])
    if not isinstance(points, int) or points < 2:
        raise ParameterError([Problem("points", f"got {points!r}; allowed: a whole number >= 2")])

    def status(a: Any, b: Any) -> Any:
        return status_of(operating_point(rig, {first.name: first.at(a), second.name: second.at(b)}, scan=True))

    ax = axes_or_new(ax)

    def draw(code: int, label: str, **style: Any) -> bool:
        path = regions.region_path(lambda a, b: status(a, b) == code, points)
        if len(path):
            path = Path(np.column_stack(_display_points(path.vertices, first, second)), path.codes)
            ax.add_patch(PathPatch(path, label=label, linewidth=0, **style))
        return len(path) > 0

    draw(STABLE, "stable", facecolor=SKY, alpha=0.55)
    draw(UNSTABLE, "unstable", facecolor=ORANGE, alpha=0.45)
    reasons = _absence_reasons(rig, first, second, status, points)
    if draw(ABSENT, f"no steady sliding ({reasons})", facecolor="white", edgecolor=GREY, hatch="///"):
        gone = regions.edges(lambda a, b: status(a, b) == ABSENT, points)
        ax.plot(
            *_display_points(gone, first, second), color=BLACK, linestyle="--", linewidth=1.5, label=f"edge: {reasons}"
        )
    line = regions.edges(lambda a, b: status(a, b) == STABLE, points, lambda a, b: status(a, b) != ABSENT)
    if np.isfinite(line).any():
        ax.plot(*_display_points(line, first, second), color=BLACK, linewidth=2, label="edge of stability")
    _mark_own(ax, rig, first, second)
    _set_axes(ax, first, second)
    return ax


def _absence_reasons(rig: Slider, x: ChartAxis, y: ChartAxis, status: Any, points: int) -> str:
    """Reasons for no steady sliding (lock-up, lift-off), from up to `_SAMPLES` points of the chart without it."""
    share = np.linspace(0, 1, points)
    b, a = np.nonzero(status(*np.meshgrid(share, share)) == ABSENT)
    if not len(a):
        return ""
    chosen = np.unique(np.linspace(0, len(a) - 1, _SAMPLES).astype(int))
    return absence_reasons(rig, [{x.name: float(x.at(share[a[i]])), y.name: float(y.at(share[b[i]]))} for i in chosen])


def absence_reasons(rig: Slider | Machine, points: Sequence[dict[str, float]]) -> str:
    """Reasons for no steady sliding at the given points (parameter name to SI value), each once, comma-separated."""
    found = [explain_absence(rig.with_values(vary), operating_point(rig, vary)).condition for vary in points]
    return ", ".join(sorted(set(found)))


def _display_points(shares: Any, x: ChartAxis, y: ChartAxis) -> tuple[Any, Any]:
    return x.shown(x.at(shares[:, 0])), y.shown(y.at(shares[:, 1]))


def _mark_own(ax: Axes, rig: Slider, x: ChartAxis, y: ChartAxis) -> None:
    own = [rig.value(x.name), rig.value(y.name)]
    if all(v is not None and a.low <= v <= a.high for v, a in zip(own, (x, y), strict=True)):
        at = [x.shown(own[0])], [y.shown(own[1])]
        ax.plot(*at, "o", **OWN_RIG)


def _set_axes(ax: Axes, x: ChartAxis, y: ChartAxis) -> None:
    ax.set_xscale("log" if x.log else "linear")
    ax.set_yscale("log" if y.log else "linear")
    ax.set_xlim(x.shown(x.low), x.shown(x.high))
    ax.set_ylim(y.shown(y.low), y.shown(y.high))
    ax.set_xlabel(x.label)
    ax.set_ylabel(y.label)
    add_legend_above(ax)
