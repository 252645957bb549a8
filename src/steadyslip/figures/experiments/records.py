"""Figures of records of experiments, with the commanded loading."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.palette import BLACK, BLUE, GREY, ORANGE, SKY
from steadyslip.figures.experiments.panels import (
    LEGEND_DOT_SIZE,
    commanded_curve,
    dot_size,
    stacked_panels,
    time_axis,
    time_label,
    title_name,
)
from steadyslip.figures.style import axis_label, display_unit

if TYPE_CHECKING:
    from steadyslip.experiments import Record

MAX_HIDDEN_SHARE = 0.01  # a logarithmic axis, which hides rates <= 0, is used up to this share of them (by trial)
LOG_RATE_RATIO = 5.0  # the axis of rates is logarithmic if highest over lowest commanded rate is larger (by trial)


def record(data: Record, ax: Sequence[Axes] | None = None) -> np.ndarray:
    """Plot friction, load-point rate and normal stress over time, with the steps and commanded loading of the record.

    Parameters
    ----------
    data : Record
    ax : three matplotlib Axes, optional

    Returns
    -------
    ndarray of three matplotlib.axes.Axes

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> axes = ss.figures.record(record)
    >>> axes[0].figure.savefig("record.svg")
    """
    panels = stacked_panels(ax, (1.6, 1.0, 1.0))
    factor, unit, origin = time_axis(data)
    time = (data.time - origin) / factor
    panels[0].plot(time, data.friction, color=BLUE, linewidth=0.6)
    panels[0].set_ylabel("friction τ/σ (1)")
    panels[0].set_title(title_name(data), fontsize="medium", parse_math=False)
    draw_rates(data, panels[1], time)
    draw_normal_stress(data, panels[2], time)
    panels[2].set_xlabel(time_label(data, unit))
    for panel in panels:
        panel.grid(color=GREY, linewidth=0.3)
        for step in data.steps:
            panel.axvline((step.time - origin) / factor, color=ORANGE, linewidth=1, linestyle="--")
    return panels


def draw_normal_stress(data: Record, ax: Axes, time: np.ndarray) -> None:
    """Plot the measured total normal stress and pore pressure, and the commanded courses found from them."""
    if data.total_normal is None:
        return
    size, name = display_unit("Pa", float(np.max(np.abs(data.total_normal))))
    ax.plot(time, data.total_normal / size, color=SKY, linewidth=0.8)
    if data.pore_pressure is not None:
        ax.plot(time, data.pore_pressure / size, color=BLUE, linewidth=0.8, label="pore pressure")
        ax.legend(loc="best", fontsize="x-small")
    for course in (data.loading.stress, data.loading.pore):
        if course is not None:
            along, commanded = commanded_curve(course, data, time)
            ax.plot(along, commanded / size, color=BLACK, linewidth=1)
    ax.set_ylabel(axis_label("normal\nstress", name))
    ax.ticklabel_format(axis="y", useOffset=False)


def draw_rates(data: Record, ax: Axes, time: np.ndarray) -> None:
    """Plot measured load-point rates as dots, and the commanded rate found from them as a line."""
    course, rate = data.loading.load, data.rate
    if course is None or rate is None:
        ax.text(0.5, 0.5, "load point not measured", ha="center", transform=ax.transAxes)
        ax.set_ylabel("load-point\nrate")
        return
    along, commanded = commanded_curve(course, data, time)
    high = float(np.max(np.abs(commanded))) or float(np.max(np.abs(rate)))
    low = float(np.min(np.abs(commanded)))
    size, name = display_unit("m/s", high)
    hidden = float(np.mean(rate <= 0))
    if low > 0 and high > LOG_RATE_RATIO * low and hidden < MAX_HIDDEN_SHARE:
        ax.set_yscale("log")
        ax.set_ylim(0.1 * low / size, 10 * high / size)
        rate = np.where(rate > 0, rate, np.nan)
    else:
        ax.set_ylim(-0.5 * high / size, 2.0 * high / size)
    mark = 0.75 * dot_size(len(time))
    ax.plot(time, rate / size, ".", color=SKY, markersize=mark, rasterized=True, label="slopes of the record")
    ax.plot(along, commanded / size, color=BLACK, linewidth=1, label="commanded, as found")
    ax.set_ylabel(axis_label("load-point\nrate", name))
    ax.legend(loc="best", fontsize="x-small", markerscale=LEGEND_DOT_SIZE / mark)
