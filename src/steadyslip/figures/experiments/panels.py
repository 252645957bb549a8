"""Helpers for figures of experiments: panels, time axis, names of parameters and records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.figures.style import axis_label, display_unit, given_panels, new_panels

if TYPE_CHECKING:
    from steadyslip.experiments import Record
    from steadyslip.experiments.loading.loading import Course

MAX_NAME_LENGTH = 60  # characters of a file name in a title: what fits above a panel
LEGEND_DOT_SIZE = 6.0  # points, size of dots in a legend, where the smaller dots of the data could not be seen


def stacked_panels(ax: Any, heights: tuple[float, ...], shared: int | None = None) -> np.ndarray:
    """Axes (given or new) stacked with relative heights; the first `shared`, by default all, share the x axis."""
    count = len(heights)
    if ax is not None:
        return given_panels(ax, (count,), f"a sequence of {count}")
    axes: np.ndarray = new_panels(count, 1, (6.8, 1.4 + 1.1 * sum(heights)), height_ratios=heights)[:, 0]
    shared = shared or count
    for panel in axes[1:shared]:
        panel.sharex(axes[0])
    for panel in axes[: shared - 1]:
        panel.tick_params(labelbottom=False)
    return axes


def panel_grid(ax: Any, rows: int, columns: int, size: tuple[float, float]) -> np.ndarray:
    """Axes of shape (rows, columns): the given Axes, or those of a new figure of the given size (inches)."""
    if ax is not None:
        return given_panels(ax, (rows, columns), f"{rows} by {columns}")
    return new_panels(rows, columns, size)


def time_axis(data: Record) -> tuple[float, str, float]:
    """Unit of the time axis (size in s, and name) and time (s) of its zero: the first step, or the first sample."""
    origin = data.steps[0].time if data.steps else float(data.time[0])
    factor, unit = display_unit("s", float(np.ptp(data.time)))
    return factor, unit, origin


def time_label(data: Record, unit: str) -> str:
    """Label of the time axis of a record, with the given unit."""
    if not data.steps:
        return axis_label("time", unit)
    return axis_label("time after step" if len(data.steps) == 1 else "time after first step", unit)


def title_name(data: Record) -> str:
    """File name of a record for a title; the middle of a long name is left out."""
    name = data.source.replace("\\", "/").rpartition("/")[2]
    return (
        name if len(name) <= MAX_NAME_LENGTH else f"{name[: MAX_NAME_LENGTH // 2]}…{name[-MAX_NAME_LENGTH // 2 + 1 :]}"
    )


def dot_size(count: int) -> float:
    """Marker size in points for `count` samples: smaller for more samples, between 2 and 6."""
    return float(np.clip(2.0 * np.sqrt(1000 / max(count, 1)), 2.0, 6.0))


def commanded_curve(course: Course, data: Record, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions on the time axis and commanded values of a course, at the samples and at its corners, both (n,)."""
    ends = [t for c in course.changes for t in (c.time, c.time + max(c.duration, 1e-9 * float(np.ptp(data.time))))]
    inside = [t for t in ends if data.time[0] < t < data.time[-1]]
    moments = np.sort(np.concatenate([data.time, inside]))
    return np.interp(moments, data.time, time), course.at(moments)
