"""Elements of protocol pieces: piecewise-linear curves, sine waves and jumps, in one lane or many.

Parameters are floats, or 1-D arrays with one value per lane. Internally they are columns: arrays of shape
(lanes, knots), or (1, knots) if all lanes agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def column(value: Any) -> Array:
    """Array of shape (lanes, 1) made from a number or from one number per lane."""
    return np.asarray(value, dtype=float).reshape(-1, 1)


def join_columns(columns: Sequence[Array]) -> Array:
    """Concatenate columns along the knots; columns common to all lanes are repeated."""
    lanes = max(len(part) for part in columns)
    return np.concatenate([np.broadcast_to(part, (lanes, part.shape[1])) for part in columns], axis=1)


@dataclass(frozen=True)
class Curve:
    """Piecewise-linear function of time that may jump at its knots.

    Parameters
    ----------
    times : ndarray (lanes or 1, knots)
        Knots in s, ascending.
    left, right : ndarray (lanes or 1, knots)
        Values just before and just after each knot. Before the first knot the function is ``left[:, 0]``,
        after the last one ``right[:, -1]``.
    """

    times: Array
    left: Array
    right: Array

    def value_and_slope(self, start: Array) -> tuple[Array, Array]:
        """Value and slope (per s) just after times `start` (s), each of shape (lanes or 1, n)."""
        before, after = self.times[:, :1], self.times[:, 1:]
        gap = after - self.times[:, :-1]
        rise = self.left[:, 1:] - self.right[:, :-1]
        rates = np.zeros(np.broadcast_shapes(rise.shape, gap.shape))
        with np.errstate(over="ignore"):
            np.divide(rise, gap, out=rates, where=gap > 0)
        rates[~np.isfinite(rates)] = 0.0  # an overflowing slope counts as a step
        flat = np.zeros((1, 1))
        passed = _passed(self.times, start)
        value = _take(join_columns([self.left[:, :1], self.right]), passed)
        if not rates.any():
            return value, flat
        slope = _take(join_columns([flat, rates, flat]), passed)
        anchor = _take(join_columns([before, self.times]), passed)
        return value + slope * (start - anchor), slope


def _passed(times: Array, start: Array) -> NDArray[np.intp]:
    """Number of knots at or before each time, (lanes or 1, n)."""
    if len(times) == 1:
        return np.searchsorted(times[0], start, side="right")
    passed = np.zeros(np.broadcast_shapes((len(times), 1), start.shape), dtype=np.intp)
    for knot in times.T:
        passed += knot[:, None] <= start
    return passed


def _take(columns: Array, index: NDArray[np.intp]) -> Array:
    if len(columns) == 1:
        columns = np.broadcast_to(columns, (len(index), columns.shape[1]))
    elif len(index) == 1:
        index = np.broadcast_to(index, (len(columns), index.shape[1]))
    picked: Array = np.take_along_axis(columns, index, axis=1)
    return picked


def knots(*points: tuple[Any, Any, Any]) -> Curve:
    """Make the Curve through points (time, value before, value after)."""
    times, left, right = (join_columns([column(value) for value in row]) for row in zip(*points, strict=True))
    return Curve(times, left, right)


def chain(curves: Sequence[Curve]) -> Curve:
    """Join Curves in order of time; knots that rounding puts before their predecessor are moved onto it."""
    times = join_columns([curve.times for curve in curves])
    return Curve(
        np.maximum.accumulate(times, axis=1),
        join_columns([curve.left for curve in curves]),
        join_columns([curve.right for curve in curves]),
    )


@dataclass(frozen=True)
class Wave:
    """Sine wave amplitude · sin(ω (t − start) + phase) from `start` to `stop`, else zero; columns (lanes or 1, 1)."""

    start: Array
    stop: Array
    amplitude: Array
    angular_frequency: Array
    phase: Array


@dataclass(frozen=True)
class Jump:
    """Sudden displacement `by` (m or rad) of the load point at `time` (s); columns (lanes or 1, 1)."""

    time: Array
    by: Array
