"""Records of experiments, with what was commanded in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from steadyslip.figures.experiments.panels import LEGEND, clock, dots, file_name, followed, stacked, time_label
from steadyslip.figures.style import BLACK, BLUE, GREY, ORANGE, SKY, display_unit, labelled

if TYPE_CHECKING:
    from steadyslip.experiments import Record

MOST_HIDDEN = 0.01  # of the slopes of a record
DECADE = 5.0  # ratio of rates from which on their axis is logarithmic


def record(data: Record, ax: Sequence[Axes] | None = None) -> np.ndarray:
    """Friction, load-point rate and normal stress in time, with the steps and the loading that were found.

    Parameters
    ----------
    data : Record
    ax : three matplotlib Axes, optional

    Returns
    -------
    ndarray of three matplotlib.axes.Axes
    """
    panels = stacked(ax, (1.6, 1.0, 1.0))
    factor, unit, origin = clock(data)
    time = (data.time - origin) / factor
    panels[0].plot(time, data.friction, color=BLUE, linewidth=0.6)
    panels[0].set_ylabel("friction τ/σ (1)")
    panels[0].set_title(file_name(data), fontsize="medium", parse_math=False)
    rates(data, panels[1], time)
    stresses(data, panels[2], time)
    panels[2].set_xlabel(time_label(data, unit))
    for panel in panels:
        panel.grid(color=GREY, linewidth=0.3)
        for step in data.steps:
            panel.axvline((step.time - origin) / factor, color=ORANGE, linewidth=1, linestyle="--")
    return panels


def stresses(data: Record, ax: Axes, time: np.ndarray) -> None:
    """Measured normal stress, and the one that was found to be commanded."""
    if data.normal is None:
        return
    size, name = display_unit("Pa", float(np.max(np.abs(data.normal))))
    ax.plot(time, data.normal / size, color=SKY, linewidth=0.8)
    if data.loading.stress is not None:
        along, commanded = followed(data.loading.stress, data, time)
        ax.plot(along, commanded / size, color=BLACK, linewidth=1)
    ax.set_ylabel(labelled("normal\nstress", name))
    ax.ticklabel_format(axis="y", useOffset=False)


def rates(data: Record, ax: Axes, time: np.ndarray) -> None:
    """Measured rates of the load point as dots, the commanded ones as a line."""
    course, rate = data.loading.load, data.rate
    if course is None or rate is None:
        ax.text(0.5, 0.5, "load point not measured", ha="center", transform=ax.transAxes)
        ax.set_ylabel("load-point\nrate")
        return
    along, commanded = followed(course, data, time)
    high = float(np.max(np.abs(commanded))) or float(np.max(np.abs(rate)))
    low = float(np.min(np.abs(commanded)))
    size, name = display_unit("m/s", high)
    hidden = float(np.mean(rate <= 0))  # by a logarithmic axis, which would lift all that is left of the noise
    if low > 0 and high > DECADE * low and hidden < MOST_HIDDEN:
        ax.set_yscale("log")
        ax.set_ylim(0.1 * low / size, 10 * high / size)
        rate = np.where(rate > 0, rate, np.nan)
    else:
        ax.set_ylim(-0.5 * high / size, 2.0 * high / size)
    mark = 0.75 * dots(len(time))
    ax.plot(time, rate / size, ".", color=SKY, markersize=mark, rasterized=True, label="slopes of the record")
    ax.plot(along, commanded / size, color=BLACK, linewidth=1, label="commanded, as found")
    ax.set_ylabel(labelled("load-point\nrate", name))
    ax.legend(loc="best", fontsize="x-small", markerscale=LEGEND / mark)
