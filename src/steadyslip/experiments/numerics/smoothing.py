"""Smoothing curves through noisy columns."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_smoothing_spline

from steadyslip.core.arrays import Array

MOST_KNOTS = 4000
CLEAN = 1e-3  # of its range: noise of a column that is followed sample by sample


def smoothing_curve(time: Array, values: Array, noise: float, knots: int = MOST_KNOTS) -> Smooth:
    """A smoothing cubic spline through samples, as smooth as cross-validation says; of means where samples are many.

    Noise that remembers itself makes cross-validation follow it; means of what is shorter than anything wanted do not.

    Cross-validation takes a second; whoever reads a record again gets the same curve at once.
    """
    columns = (np.asarray(column, dtype=float).tobytes() for column in (time, values))
    return _curve(*columns, noise, min(knots, MOST_KNOTS))


@lru_cache(maxsize=16)
def _curve(times: bytes, samples: bytes, noise: float, knots: int) -> Smooth:
    time, values = np.frombuffer(times), np.frombuffer(samples)
    step = -(-len(time) // (knots if noise > CLEAN * float(np.ptp(values)) else MOST_KNOTS))
    if step > 1:
        ends = np.arange(0, len(time), step)
        count = np.diff(np.append(ends, len(time)))
        time, values = np.add.reduceat(time, ends) / count, np.add.reduceat(values, ends) / count
    if noise <= 2e-7 * float(np.ptp(values)):
        return Smooth(make_interp_spline(time, values, k=3))
    size, origin, unit = float(np.ptp(values)) or 1.0, float(time[0]), float(np.ptp(time)) / len(time)
    return Smooth(make_smoothing_spline((time - origin) / unit, values / size), origin, unit, size)


class Smooth:
    """A spline, in units of time and value of its own for the sake of rounding."""

    def __init__(self, spline: Any, origin: float = 0.0, unit: float = 1.0, size: float = 1.0) -> None:
        self.spline, self.origin, self.unit, self.size = spline, origin, unit, size

    def __call__(self, time: Array) -> Array:
        return np.asarray(self.spline((np.asarray(time) - self.origin) / self.unit)) * self.size

    def parts(self) -> list[Any]:
        """Numbers that make the same curve again (`from_parts`): units, degree, knots and coefficients."""
        own = self.spline
        return [self.origin, self.unit, self.size, int(own.k), own.t.tolist(), own.c.tolist()]

    @classmethod
    def from_parts(cls, origin: float, unit: float, size: float, degree: int, knots: Any, coefficients: Any) -> Smooth:
        """The curve of such numbers.

        Raises
        ------
        ValueError
            If no curve has them.
        """
        columns = [np.array(column, dtype=float) for column in (knots, coefficients)]
        if not all(
            np.all(np.isfinite(column)) for column in (*columns, np.array([origin, size, 1 / (unit or np.inf)]))
        ):
            raise ValueError("is not finite throughout")
        return cls(BSpline(*columns, degree), origin, unit, size)

    def derivative(self) -> Smooth:
        return Smooth(self.spline.derivative(), self.origin, self.unit, self.size / self.unit)
