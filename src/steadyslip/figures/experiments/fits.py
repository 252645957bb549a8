"""Figures of fits to records: model beside data, residuals, their autocorrelation, and every step enlarged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.errors import NotAvailable
from steadyslip.core.palette import BLACK, BLUE, GREY, SKY, VERMILION
from steadyslip.experiments.numerics.noise import autocorrelation
from steadyslip.figures.experiments.panels import (
    LEGEND_DOT_SIZE,
    dot_size,
    panel_grid,
    stacked_panels,
    time_axis,
    time_label,
    title_name,
)
from steadyslip.figures.experiments.records import draw_normal_stress, draw_rates
from steadyslip.figures.style import add_legend_above, axis_label, display_unit

if TYPE_CHECKING:
    from steadyslip.experiments import Fit, Record

MAX_LAGS = 60  # largest lag of the autocorrelation that is drawn, samples
MAX_STEPS = 12  # largest number of panels of `steps`: four rows of three
MIN_STRESS_CHANGE = 0.01  # normal stress is not drawn if its smooth relative change is smaller (by trial)
ZOOM_SHARES = (0.15, 0.6)  # drawn shares of the times to the previous and to the next step (by trial)


def fit(result: Fit, ax: Sequence[Axes] | None = None, record: int = 0) -> np.ndarray:
    """Plot load-point rate, record and model, residuals, and their autocorrelation.

    If the normal stress changes it has the second of five panels.

    Parameters
    ----------
    result : Fit
    ax : four matplotlib Axes, optional
        Five with one for the normal stress.
    record : int, optional
        Index of the record to draw.

    Returns
    -------
    ndarray of four or five matplotlib.axes.Axes
    """
    data = result.plan.records[record]
    pressed = result.plan.pressed and _is_pressed(data)
    given = stacked_panels(ax, (1.1, *[0.9] * pressed, 2.2, 1.1, 1.1), shared=3 + pressed)
    panels = given if not pressed else given[[0, 2, 3, 4]]
    factor, unit, origin = time_axis(data)
    time = (data.time - origin) / factor
    panels[0].set_title(title_name(data), fontsize="medium", parse_math=False)
    draw_rates(data, panels[0], time)
    if pressed:
        draw_normal_stress(data, given[1], time)
    _draw_record_and_model(panels[1], time, data.friction, result.part(result.model, record))
    residuals = result.part(result.residuals, record)
    panels[2].plot(time, 1e3 * residuals, ".", color=SKY, markersize=dot_size(len(time)), rasterized=True)
    panels[2].plot(time, 1e3 * _running_mean(residuals), color=VERMILION, linewidth=1, label="running mean")
    panels[2].axhline(0, color=BLACK, linewidth=0.8)
    panels[2].set_ylabel("residual (10⁻³)")
    add_legend_above(panels[2], 1, 1.0, fontsize="small")
    panels[2].set_xlabel(time_label(data, unit))
    _draw_autocorrelation(panels[3], result, residuals, record)
    for panel in given:
        panel.grid(color=GREY, linewidth=0.3)
        panel.yaxis.label.set_size("small")
    return given


def _is_pressed(data: Record) -> bool:
    """True if the commanded normal stress of a record has steps, or a smooth change above `MIN_STRESS_CHANGE`."""
    course = data.loading.stress
    if course is None:
        return False
    return (
        data.pressure_changes
        or bool(course.changes)
        or (course.curve is not None and float(np.ptp(course.at(data.time))) > MIN_STRESS_CHANGE * course.first)
    )


def _draw_record_and_model(ax: Axes, time: np.ndarray, data: np.ndarray, model: np.ndarray, named: bool = True) -> None:
    ax.plot(time, data, ".", color=SKY, markersize=dot_size(len(time)), label="record", rasterized=True)
    ax.plot(time, model, color=BLACK, linewidth=1, label="model")
    if named:
        ax.set_ylabel("friction τ/σ (1)")
        ax.legend(loc="best", fontsize="small", markerscale=LEGEND_DOT_SIZE / dot_size(len(time)))


def _draw_autocorrelation(ax: Axes, result: Fit, residuals: np.ndarray, record: int) -> None:
    """Plot the autocorrelation of residuals, that of the noise model, and 95 % limits of white noise."""
    lags = np.arange(min(MAX_LAGS, len(residuals) // 4) + 1)
    ax.bar(lags, autocorrelation(residuals, lags[-1]), width=0.6, color=SKY, label="residuals")
    noise = result.noise[record]
    known = noise.covariance[: len(lags)] / noise.covariance[0] if noise.covariance[0] > 0 else np.ones(1)
    ax.plot(lags, np.pad(known, (0, len(lags) - len(known))), color=BLACK, linewidth=1, label="as in the errors")
    chance = 1.96 / np.sqrt(len(residuals))
    ax.axhspan(-chance, chance, color=GREY, alpha=0.5, linewidth=0, label="95 % of independent noise")
    ax.set_xlabel("lag (samples)")
    ax.set_ylabel("autocorrelation (1)")
    ax.legend(loc="upper right", fontsize="x-small")


def steps(result: Fit, ax: Any = None, record: int = 0) -> np.ndarray:
    """Plot record and model around each of the first twelve steps, three in a row.

    Parameters
    ----------
    result : Fit
    ax : array of matplotlib Axes, optional
        As many rows of up to three as the steps need.
    record : int, optional

    Returns
    -------
    ndarray of matplotlib.axes.Axes

    Raises
    ------
    NotAvailable
        If there are no steps.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> axes = ss.figures.steps(fit)
    >>> axes.flat[0].figure.savefig("steps.svg")
    """
    data = result.plan.records[record]
    shown = data.steps[:MAX_STEPS]
    if not shown:
        raise NotAvailable(f"{data.source}: no steps were found in this record")
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    panels = panel_grid(ax, rows, columns, (1.0 + 2.9 * columns, 0.6 + 2.3 * rows))
    model = result.part(result.model, record)
    for k, panel in enumerate(panels.flat):
        if k >= len(shown):
            panel.set_visible(False)
            continue
        inside = _samples_near(data, k)
        factor, unit = display_unit("s", float(np.ptp(data.time[inside])))
        _draw_record_and_model(
            panel, (data.time[inside] - shown[k].time) / factor, data.friction[inside], model[inside], named=k == 0
        )
        panel.axvline(0.0, color=BLUE, linewidth=0.8, linestyle="--")
        panel.set_xlabel(axis_label("time after step", unit))
        panel.set_title(str(shown[k]).partition(": ")[2].replace("um", "µm"), fontsize="small")
        panel.grid(color=GREY, linewidth=0.3)
        panel.ticklabel_format(axis="y", useOffset=False)
        panel.locator_params(axis="x", nbins=5)
    if len(data.steps) > len(shown):
        last = panels.flat[len(shown) - 1]
        left = len(data.steps) - len(shown)
        last.set_xlabel(f"{last.get_xlabel()}\n{left} further {'step is' if left == 1 else 'steps are'} not drawn")
    return panels


def _samples_near(data: Record, k: int) -> np.ndarray:
    """Mask (n,) of the samples near step `k`: more after it than before, none beyond its neighbouring steps."""
    ends = [float(data.time[0]), *(step.time for step in data.steps), float(data.time[-1])]
    before, at, after = ends[k : k + 3]
    reach = max(after - at, 1e-300)
    return np.asarray(
        (data.time >= at - ZOOM_SHARES[0] * min(at - before, reach)) & (data.time <= at + ZOOM_SHARES[1] * reach)
    )


def _running_mean(values: np.ndarray) -> np.ndarray:
    """Running mean (n,) over a fiftieth of the record; at the ends of the record over fewer samples."""
    half = max(len(values) // 100, 1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    low = np.maximum(np.arange(len(values)) - half, 0)
    high = np.minimum(np.arange(len(values)) + half + 1, len(values))
    return np.asarray((total[high] - total[low]) / (high - low))
