"""What figures of experiments share: panels, axes of time, names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.figures.style import display_unit, labelled

if TYPE_CHECKING:
    from steadyslip.experiments import Record
    from steadyslip.experiments.loading.loading import Course

LONGEST_NAME = 60  # characters of a file's name in a title
LEGEND = 6.0  # size of dots in a legend


def stacked(ax: Any, heights: tuple[float, ...], shared: int | None = None) -> np.ndarray:
    """Axes above each other, those given or new ones; the first `shared` have the time in common."""
    count = len(heights)
    if ax is not None:
        return given_panels(ax, (count,), f"a sequence of {count}")
    from matplotlib import pyplot as plt

    _, axes = plt.subplots(
        count, 1, figsize=(6.8, 1.4 + 1.1 * sum(heights)), layout="constrained", height_ratios=heights
    )
    for panel in axes[1 : count if shared is None else shared]:
        panel.sharex(axes[0])
    for panel in axes[: (count if shared is None else shared) - 1]:
        panel.tick_params(labelbottom=False)
    return np.asarray(axes, dtype=object)


def grid(ax: Any, rows: int, columns: int, size: tuple[float, float]) -> np.ndarray:
    """Rows and columns of Axes, those given or new ones."""
    if ax is not None:
        return given_panels(ax, (rows, columns), f"{rows} by {columns}")
    from matplotlib import pyplot as plt

    _, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False)
    return np.asarray(axes, dtype=object)


def given_panels(ax: Any, shape: tuple[int, ...], allowed: str) -> np.ndarray:
    """The Axes that a caller gave, of the right number."""
    given = np.asarray(ax, dtype=object)
    if given.shape != shape:
        raise ParameterError([Problem("ax", f"got Axes of shape {given.shape}; allowed: {allowed}")])
    return given


def clock(data: Record) -> tuple[float, str, float]:
    """Unit of time for an axis, its name, and where its zero is: the first step, or the first sample."""
    origin = data.steps[0].time if data.steps else float(data.time[0])
    factor, unit = display_unit("s", float(np.ptp(data.time)))
    return factor, unit, origin


def time_label(data: Record, unit: str) -> str:
    """Name of the axis that `clock` makes."""
    if not data.steps:
        return labelled("time", unit)
    return labelled("time after step" if len(data.steps) == 1 else "time after first step", unit)


def file_name(data: Record) -> str:
    """The last part of where a record comes from, without its middle where it is too long for a title."""
    name = data.source.replace("\\", "/").rpartition("/")[2]
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME // 2]}…{name[-LONGEST_NAME // 2 + 1 :]}"


def dots(count: int) -> float:
    """Size of the dots of so many samples: smaller the more there are."""
    return float(np.clip(2.0 * np.sqrt(1000 / max(count, 1)), 2.0, 6.0))


def followed(course: Course, data: Record, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What was commanded, and the places on an axis of times, its corners between samples included."""
    ends = [t for c in course.changes for t in (c.time, c.time + max(c.duration, 1e-9 * float(np.ptp(data.time))))]
    inside = [t for t in ends if data.time[0] < t < data.time[-1]]
    moments = np.sort(np.concatenate([data.time, inside]))
    return np.interp(moments, data.time, time), course.at(moments)


def brief(name: str) -> str:
    """A parameter's name as short as it is clear on an axis."""
    first, _, last = name.rpartition(".")
    if ".states" in first:
        return f"{last} {first.rpartition('.')[2]}"
    if first.partition(".")[0] in ("jump", "step", "start", "initial", "trend"):
        return name
    return last
