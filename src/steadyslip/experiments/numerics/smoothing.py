"""Smoothing splines through noisy columns."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_smoothing_spline

from steadyslip.core.arrays import Array

MOST_KNOTS = 4000  # largest number of knots of a smoothing spline: cross-validation then takes about a second
LOW_NOISE = 1e-3  # columns with less noise, as a share of their range, always get `MOST_KNOTS`


def smoothing_curve(time: Array, values: Array, noise: float, knots: int = MOST_KNOTS) -> Smooth:
    """Cubic smoothing spline through samples; cross-validation sets its smoothness.

    If there are more samples than `knots`, the spline is fitted to means of groups of samples, whose noise is nearly
    independent: correlated noise would mislead cross-validation. Results are cached.
    """
    columns = (np.asarray(column, dtype=float).tobytes() for column in (time, values))
    return _curve(*columns, noise, min(knots, MOST_KNOTS))


@lru_cache(maxsize=16)
def _curve(times: bytes, samples: bytes, noise: float, knots: int) -> Smooth:
    time, values = np.frombuffer(times), np.frombuffer(samples)
    step = -(-len(time) // (knots if noise > LOW_NOISE * float(np.ptp(values)) else MOST_KNOTS))
    if step > 1:
        ends = np.arange(0, len(time), step)
        count = np.diff(np.append(ends, len(time)))
        time, values = np.add.reduceat(time, ends) / count, np.add.reduceat(values, ends) / count
    if noise <= 2e-7 * float(np.ptp(values)):
        return Smooth(make_interp_spline(time, values, k=3))
    size, origin, unit = float(np.ptp(values)) or 1.0, float(time[0]), float(np.ptp(time)) / len(time)
    return Smooth(make_smoothing_spline((time - origin) / unit, values / size), origin, unit, size)


class Smooth:
    """Spline of time (s), scaled internally to avoid rounding errors: (time - origin) / unit, value / size."""

    def __init__(self, spline: Any, origin: float = 0.0, unit: float = 1.0, size: float = 1.0) -> None:
        self.spline, self.origin, self.unit, self.size = spline, origin, unit, size

    def __call__(self, time: Array) -> Array:
        return np.asarray(self.spline((np.asarray(time) - self.origin) / self.unit)) * self.size

    def parts(self) -> list[Any]:
        """List of origin, unit, size, degree, knots and coefficients, from which `from_parts` makes the curve again."""
        own = self.spline
        return [self.origin, self.unit, self.size, int(own.k), own.t.tolist(), own.c.tolist()]

    @classmethod
    def from_parts(cls, origin: float, unit: float, size: float, degree: int, knots: Any, coefficients: Any) -> Smooth:
        """Spline from the items of the list that `parts` returns.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        columns = [np.array(column, dtype=float) for column in (knots, coefficients)]
        if not all(
            np.all(np.isfinite(column)) for column in (*columns, np.array([origin, size, 1 / (unit or np.inf)]))
        ):
            raise ValueError("is not finite throughout")
        return cls(BSpline(*columns, degree), origin, unit, size)

    def derivative(self) -> Smooth:
        return Smooth(self.spline.derivative(), self.origin, self.unit, self.size / self.unit)
