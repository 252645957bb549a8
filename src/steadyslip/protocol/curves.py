"""What a piece of a protocol consists of: piecewise-linear curves and sine waves, in one lane or many.

Numbers are plain, or 1-D arrays with one value for each lane. Inside they are columns: arrays (lanes, knots)
whose first length is 1 where all lanes agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def column(value: Any) -> Array:
    """A number, or one for each lane, as an array (lanes, 1)."""
    return np.asarray(value, dtype=float).reshape(-1, 1)


def side_by_side(columns: Sequence[Array]) -> Array:
    """Columns put beside one another, those common to all lanes repeated."""
    lanes = max(len(part) for part in columns)
    return np.concatenate([np.broadcast_to(part, (lanes, part.shape[1])) for part in columns], axis=1)


@dataclass(frozen=True)
class Curve:
    """A function of time, linear between knots, that may jump at them.

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

    def on(self, start: Array) -> tuple[Array, Array]:
        """Value just after `start` (lanes or 1, n), and the slope there."""
        before, after = self.times[:, :1], self.times[:, 1:]
        gap = after - self.times[:, :-1]
        rise = self.left[:, 1:] - self.right[:, :-1]
        rates = np.zeros(np.broadcast_shapes(rise.shape, gap.shape))
        with np.errstate(over="ignore"):
            np.divide(rise, gap, out=rates, where=gap > 0)
        rates[~np.isfinite(rates)] = 0.0  # too steep to be told from a step
        flat = np.zeros((1, 1))
        passed = _passed(self.times, start)
        value = _picked(side_by_side([self.left[:, :1], self.right]), passed)
        if not rates.any():
            return value, flat
        slope = _picked(side_by_side([flat, rates, flat]), passed)
        anchor = _picked(side_by_side([before, self.times]), passed)
        return value + slope * (start - anchor), slope


def _passed(times: Array, start: Array) -> NDArray[np.intp]:
    """How many knots lie at or before each of `start`."""
    if len(times) == 1:
        return np.searchsorted(times[0], start, side="right")
    passed = np.zeros(np.broadcast_shapes((len(times), 1), start.shape), dtype=np.intp)
    for knot in times.T:
        passed += knot[:, None] <= start
    return passed


def _picked(columns: Array, index: NDArray[np.intp]) -> Array:
    if len(columns) == 1:
        columns = np.broadcast_to(columns, (len(index), columns.shape[1]))
    elif len(index) == 1:
        index = np.broadcast_to(index, (len(columns), index.shape[1]))
    picked: Array = np.take_along_axis(columns, index, axis=1)
    return picked


def knots(*points: tuple[Any, Any, Any]) -> Curve:
    """The curve through points (time, value before, value after)."""
    times, left, right = (side_by_side([column(value) for value in row]) for row in zip(*points, strict=True))
    return Curve(times, left, right)


def chain(curves: Sequence[Curve]) -> Curve:
    """Curves that follow one another in time as one; a start that rounding puts too early is moved to its place."""
    times = side_by_side([curve.times for curve in curves])
    return Curve(
        np.maximum.accumulate(times, axis=1),
        side_by_side([curve.left for curve in curves]),
        side_by_side([curve.right for curve in curves]),
    )


@dataclass(frozen=True)
class Wave:
    """amplitude · sin(ω (t − start) + phase) from `start` to `stop`, else zero; all columns (lanes or 1, 1)."""

    start: Array
    stop: Array
    amplitude: Array
    angular_frequency: Array
    phase: Array


@dataclass(frozen=True)
class Jump:
    """A sudden displacement `by` of the load point at a time; columns (lanes or 1, 1)."""

    time: Array
    by: Array
