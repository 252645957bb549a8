"""Figure of an axis that holds a position: its error and the force of the drive over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from steadyslip.core.palette import BLUE, GREY
from steadyslip.figures.style import axis_label, display_unit, given_panels, new_panels
from steadyslip.nonlinear.hunting.hunt_result import Hunt

_LATER = 3.0  # the figure of an axis that creeps to its target ends at this many times the time of its last strokes


def hunting(result: Hunt, ax: Any = None) -> Any:
    """Plot error and force of the drive over time in two panels; grey: the target.

    Parameters
    ----------
    result : Hunt
    ax : sequence of matplotlib.axes.Axes, optional
        Two, for error and force.

    Returns
    -------
    ndarray of matplotlib.axes.Axes

    Examples
    --------
    >>> axes = ss.figures.hunting(ss.hunt(ss.read_rig("examples/hunting-axis.toml")))
    >>> axes[0].figure.savefig("hunting.svg")
    """
    panels = given_panels(new_panels(2, 1, (6.4, 5.2), sharex=True)[:, 0] if ax is None else ax, (2,), "two Axes")
    end = float(result.time[-1]) if len(result.time) else 1.0
    until = min(end, _LATER * result.approached_at or end)  # afterwards the axis only rests on the target
    across, seconds = display_unit("s", until)
    series = (
        (f"target minus position{result.at_body}", result.error, result.unit),
        (result.force_label, result.force, result.force_unit),
    )
    for axes, (name, values, si) in zip(panels, series, strict=True):
        area = result.rig.area if si == "Pa" else None
        factor, unit = display_unit(si, float(np.max(np.abs(values), initial=0.0)) or 1.0, area)
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        axes.plot(result.time / across, values / factor, color=BLUE)
        axes.set_ylabel(axis_label(name, unit))
    if until < end:
        panels[1].set_xlim(0, until / across)
    panels[1].set_xlabel(axis_label("time", seconds))
    return panels
