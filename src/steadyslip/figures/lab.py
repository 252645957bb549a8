"""Records of experiments, fits to them, and what follows for a rig."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from steadyslip.core.errors import InternalError, NotAvailable, ParameterError, Problem
from steadyslip.core.quantities import percent
from steadyslip.experiments.answers.predict import probability_text
from steadyslip.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    VERMILION,
    axes_or_new,
    display_unit,
    labelled,
)

if TYPE_CHECKING:
    from steadyslip.experiments import Draws, Fit, Prediction, Record

MOST_DRAWN = 4000  # points of a record; more would not be seen


def record(data: Record, ax: Sequence[Axes] | None = None) -> np.ndarray:
    """Friction, load-point rate and normal stress in time, with the steps that were found.

    Parameters
    ----------
    data : Record
    ax : three matplotlib Axes, optional

    Returns
    -------
    ndarray of three matplotlib.axes.Axes
    """
    panels = _panels(ax, 3, (1.6, 1.0, 1.0))
    factor, unit, origin = _clock(data)
    time = (data.time - origin) / factor
    panels[0].plot(time, data.friction, color=BLUE, linewidth=0.6)
    panels[0].set_ylabel("friction τ/σ (1)")
    panels[0].set_title(_name(data), fontsize="medium", parse_math=False)
    if data.rate is not None:
        _rate_panel(data, panels[1], time)
    else:
        panels[1].text(0.5, 0.5, "load point not measured", ha="center", transform=panels[1].transAxes)
    panels[1].set_ylabel(panels[1].get_ylabel() or "load-point rate")
    if data.normal is not None:
        size, name = display_unit("Pa", float(np.max(np.abs(data.normal))))
        panels[2].plot(time, data.normal / size, color=BLUE, linewidth=0.8)
        panels[2].set_ylabel(labelled("normal stress", name))
        panels[2].ticklabel_format(axis="y", useOffset=False)
    panels[2].set_xlabel(_time_label(origin, unit))
    for panel in panels:
        panel.grid(color=GREY, linewidth=0.3)
        for step in data.steps:
            panel.axvline((step.time - origin) / factor, color=ORANGE, linewidth=1, linestyle="--")
    return panels


def _rate_panel(data: Record, ax: Axes, time: np.ndarray) -> None:
    """Measured rates as dots, those between the steps found as a line; logarithmic where they span a decade."""
    if data.rate is None:
        raise InternalError("data.rate is not None")
    rates = [s.after for s in data.steps if s.unit == "m/s"] + [data.initial_rate or 0.0]
    size, name = display_unit("m/s", max(rates) or float(np.max(np.abs(data.rate))))
    moving = np.where(data.rate > 0, data.rate, np.nan)
    positive = [rate for rate in rates if rate > 0]
    low, high = (min(positive), max(positive)) if positive else (1.0, 1.0)
    if high > 5 * low and all(rate > 0 for rate in rates):
        ax.set_yscale("log")
        ax.set_ylim(0.1 * low / size, 10 * high / size)
    else:
        ax.set_ylim(-0.5 * high / size, 2.0 * high / size)
        moving = data.rate
    ax.plot(time, moving / size, ".", color=SKY, markersize=1.5, rasterized=True)
    ax.set_ylabel(labelled("load-point rate", name))


def fit(result: Fit, ax: Sequence[Axes] | None = None, record: int = 0) -> np.ndarray:
    """A record, the fitted model and the residuals.

    Parameters
    ----------
    result : Fit
    ax : two matplotlib Axes, optional
    record : int, optional
        Which of several records to draw.

    Returns
    -------
    ndarray of two matplotlib.axes.Axes
    """
    panels = _panels(ax, 2, (2.2, 1.0))
    data = result.plan.records[record]
    factor, unit, origin = _clock(data)
    time = (data.time - origin) / factor
    panels[0].plot(time, data.friction, ".", color=SKY, markersize=2, label="record", rasterized=True)
    panels[0].plot(time, result.part(result.model, record), color=BLACK, linewidth=1, label="model")
    panels[0].set_ylabel("friction τ/σ (1)")
    panels[0].legend(loc="best", fontsize="small", markerscale=3)
    panels[0].set_title(_name(data), fontsize="medium", parse_math=False)
    residuals = result.part(result.residuals, record)
    panels[1].plot(time, 1e3 * residuals, ".", color=SKY, markersize=2, rasterized=True)
    panels[1].plot(time, 1e3 * _running(residuals), color=VERMILION, linewidth=1, label="running mean")
    panels[1].axhline(0, color=BLACK, linewidth=0.8)
    panels[1].set_ylabel("residual (10⁻³)")
    panels[1].legend(loc="best", fontsize="small")
    panels[1].set_xlabel(_time_label(origin, unit))
    for panel in panels:
        panel.grid(color=GREY, linewidth=0.3)
    return panels


def corner(result: Fit | Draws, ax: Any = None) -> np.ndarray:
    """Parameters against each other: ellipses of 68 and 95 % for a fit, clouds for draws.

    Parameters
    ----------
    result : Fit or Draws
    ax : array of matplotlib Axes, optional
        As many rows and columns as there are determined parameters.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
    """
    from steadyslip.experiments import Draws, normal_draws

    draws = result if isinstance(result, Draws) else None
    source = draws.fit if draws is not None else result
    if isinstance(source, Draws):
        raise InternalError("not isinstance(source, Draws)")
    names = [e.name for e in source.estimates if e.determined]
    if not names:
        raise NotAvailable("no parameter is determined; there is nothing to draw")
    if draws is None and len(names) == len(source.names):
        draws = normal_draws(source, 4000)
    grid = _grid(ax, len(names))
    estimates = [source[n] for n in names]
    units = [display_unit(e.unit, abs(e.value) or e.error, e.area) for e in estimates]
    for i, row in enumerate(names):
        for k, column in enumerate(names):
            panel = grid[i, k]
            if k > i:
                panel.set_visible(False)
                continue
            if draws is not None:
                _cloud(panel, draws[column] / units[k][0], draws[row] / units[i][0], i == k)
            if i == len(names) - 1:
                panel.set_xlabel(labelled(_brief(column), units[k][1]), fontsize="small")
            if k == 0 and i:
                panel.set_ylabel(labelled(_brief(row), units[i][1]), fontsize="small")
            panel.tick_params(labelsize="x-small", labelbottom=i == len(names) - 1, labelleft=k == 0 and i > 0)
            panel.tick_params(axis="x", rotation=45)
            panel.locator_params(nbins=3)
            value = source[column].value / units[k][0]
            panel.axvline(value, color=VERMILION, linewidth=0.8)
            if i != k:
                panel.axhline(source[row].value / units[i][0], color=VERMILION, linewidth=0.8)
    return grid


def _cloud(panel: Axes, x: np.ndarray, y: np.ndarray, alone: bool) -> None:
    if alone:
        panel.hist(x, bins=40, color=SKY)
        panel.set_yticks([])
        return
    few = slice(0, MOST_DRAWN)
    panel.plot(x[few], y[few], ".", color=BLUE, markersize=1, alpha=0.4, rasterized=True)


def prediction(result: Prediction, ax: Axes | None = None) -> Axes:
    """Distribution of the critical stiffness that the records allow, and the rig's own stiffness.

    Parameters
    ----------
    result : Prediction
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_or_new(ax)
    critical = result.critical_stiffness[np.isfinite(result.critical_stiffness)]
    own = float(np.nanmedian(result.safety * result.critical_stiffness)) if len(critical) else float("nan")
    if not len(critical):
        raise NotAvailable("no draw has a critical stiffness; the verdict does not depend on the stiffness")
    factor, unit = display_unit("Pa/m", max(float(np.median(critical)), own), result.rig.area)
    ax.hist(critical / factor, bins=60, color=SKY, label="critical stiffness")
    ax.axvline(own / factor, color=VERMILION, linewidth=1.5, label="this rig")
    middle = result.quantiles(result.critical_stiffness)[2]
    ax.axvline(middle / factor, color=BLACK, linewidth=1, linestyle="--", label="median")
    if missing := np.mean(~np.isfinite(result.critical_stiffness)):
        ax.plot([], [], " ", label=f"{percent(missing)} of the draws have none")
    ax.set_xlabel(labelled("stiffness", unit))
    ax.set_ylabel("draws (1)")
    probability = probability_text(result.probability_stable, len(result.stable))
    ax.set_title(f"stable with probability {probability}", fontsize="medium",
                 color=GREEN if result.probability_stable > 0.5 else VERMILION)  # fmt: skip
    ax.legend(loc="best", fontsize="small")
    return ax


def _panels(ax: Any, count: int, heights: tuple[float, ...]) -> np.ndarray:
    if ax is not None:
        given = np.asarray(ax, dtype=object)
        if given.shape != (count,):
            raise ParameterError([Problem("ax", f"got Axes of shape {given.shape}; allowed: a sequence of {count}")])
        return given
    from matplotlib import pyplot as plt

    _, axes = plt.subplots(
        count, 1, sharex=True, figsize=(6.8, 1.4 + 1.5 * count), layout="constrained", height_ratios=heights
    )
    return np.asarray(axes, dtype=object)


def _grid(ax: Any, count: int) -> np.ndarray:
    if ax is not None:
        given = np.asarray(ax, dtype=object)
        if given.shape != (count, count):
            raise ParameterError([Problem("ax", f"got Axes of shape {given.shape}; allowed: {count} by {count}")])
        return given
    from matplotlib import pyplot as plt

    size = max(3.0, 1.5 * count + 0.8)
    _, axes = plt.subplots(count, count, figsize=(size, size), layout="constrained", squeeze=False)
    return np.asarray(axes, dtype=object)


def _clock(data: Record) -> tuple[float, str, float]:
    """Unit of time for an axis, and where its zero is: the first step, or the first sample."""
    origin = data.steps[0].time if data.steps else float(data.time[0])
    factor, unit = display_unit("s", float(np.ptp(data.time)))
    return factor, unit, origin


def _time_label(origin: float, unit: str) -> str:
    return labelled(f"time after {origin:.6g} s" if origin else "time", unit)


def _name(data: Record) -> str:
    return data.source.replace("\\", "/").rpartition("/")[2]


def _brief(name: str) -> str:
    first, _, last = name.rpartition(".")
    if ".states" in first or first in ("jump", "trend"):
        number = first.rpartition(".")[2]
        return f"{last} {number}" if ".states" in first else name
    return last


def _running(values: np.ndarray) -> np.ndarray:
    """Mean over a fiftieth of the record, shorter at its ends."""
    half = max(len(values) // 100, 1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    low = np.maximum(np.arange(len(values)) - half, 0)
    high = np.minimum(np.arange(len(values)) + half + 1, len(values))
    return np.asarray((total[high] - total[low]) / (high - low))
