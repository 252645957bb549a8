"""Figure of a population of experiments: estimates of each, mean, and spread."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.palette import BLUE, GREY, SKY, VERMILION
from steadyslip.figures.experiments.panels import panel_grid
from steadyslip.figures.style import axis_label, display_unit, with_subscripts
from steadyslip.machine.letters import estimate_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from steadyslip.experiments import Estimate, Population

ROW_OFFSET = 0.15  # vertical offset, in rows, between the estimate from an experiment alone and the pooled estimate


def population(result: Population, ax: Any = None) -> np.ndarray:
    """Plot each parameter of each experiment, fitted alone and pooled, with 95 % ranges of mean and a new experiment.

    Parameters
    ----------
    result : Population
    ax : array of matplotlib Axes, optional
        One Axes for each parameter, and one for a - b, in a row.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
    """
    names, rows = tuple(result.axes.quantities), len(result.fits)
    count = len(names)
    panels = panel_grid(ax if ax is None else np.reshape(ax, (1, -1)), 1, count, (1.2 + 2.2 * count, 2.2 + 0.3 * rows))[
        0
    ]
    place = np.arange(rows)[::-1]
    for panel, name in zip(panels, names, strict=True):
        mean, other = result.mean(name), result.another(name)
        size, unit = display_unit(mean.unit, abs(mean.value) or mean.error, mean.area)
        panel.axvspan(
            other.low / size, other.high / size, color=GREY, alpha=0.4, linewidth=0, label="another one, 95 %"
        )
        panel.axvspan(mean.low / size, mean.high / size, color=SKY, alpha=0.6, linewidth=0, label="mean, 95 %")
        panel.axvline(mean.value / size, color=BLUE, linewidth=1)
        for y, (label, alone) in zip(place, result.alone(name).items(), strict=True):
            if alone is not None:
                _draw_interval(
                    panel, y + ROW_OFFSET, alone, size, VERMILION, "o", "alone, 95 %" if y == place[0] else ""
                )
            _draw_interval(
                panel,
                y - ROW_OFFSET,
                result.experiment(label, name),
                size,
                BLUE,
                "s",
                "with the others, 95 %" if y == place[0] else "",
            )
        panel.set_xlabel(axis_label(with_subscripts(estimate_label(name)), unit))
        panel.set_yticks(place, list(result.fits) if panel is panels[0] else [""] * rows)
        panel.set_ylim(-0.6, rows - 0.4)
        panel.locator_params(axis="x", nbins=4)
        panel.ticklabel_format(axis="x", useOffset=False)
        panel.tick_params(axis="x", rotation=45)
    figure = panels[0].get_figure(root=True)
    if ax is None and figure is not None:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, fontsize="small")
    return np.asarray(panels)


def _draw_interval(panel: Axes, y: float, one: Estimate, size: float, colour: str, marker: str, label: str) -> None:
    """Plot a value and its 95 % interval as a dot on a line."""
    panel.plot([one.low / size, one.high / size], [y, y], color=colour, linewidth=1.2)
    panel.plot([one.value / size], [y], marker, color=colour, markersize=4, label=label or None)
