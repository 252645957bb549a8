"""Stiffness of bristles from a loop of displacement and force before sliding."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.experiments.measured.speeds import PreslidingLoop
from steadyslip.experiments.numerics.profiled import intervals, least

LEVELS = (0.6827, 0.95)
FEWEST_ROWS = 5
LEAST_RISE = 1e-3  # of the displacements, as a share of the largest step: smaller ones say nothing on stiffness


@dataclass(frozen=True)
class BristleStiffness:
    """Stiffness of bristles with its intervals, N/m (N m/rad where the loop turns).

    Attributes
    ----------
    value, error : float
    low, high : float
        Ends of the 95 % interval.
    breakaway : float
        Force at which the bristles would slip, as the loop bends towards it; N.
    scatter : float
        Standard deviation of the forces about the loop, N.
    """

    value: float
    error: float
    low: float
    high: float
    breakaway: float
    scatter: float


def loop_forces(displacement: Array, stiffness: float, breakaway: float, first: float) -> tuple[Array, Array]:
    """Forces (n,) of LuGre bristles over displacement (n,), m, and derivatives (n, 3) by ln K, ln F_S and the first.

    Slow bristles obey dF/dx = K (1 − F sign(dx)/F_S): between turns the force goes exponentially towards ±F_S.
    """
    force, slopes = np.empty(len(displacement)), np.empty((len(displacement), 3))
    now, by = first, np.array([0.0, 0.0, 1.0])
    force[0], slopes[0] = now, by
    for i, step in enumerate(np.diff(displacement), start=1):
        end, decay = math.copysign(breakaway, step), math.exp(-abs(step) * stiffness / breakaway)
        rate = abs(step) * stiffness / breakaway * decay * (end - now)  # derivative by ln(K/F_S)
        by = by * decay + np.array([rate, (1 - decay) * end - rate, 0.0])
        now = end + (now - end) * decay
        force[i], slopes[i] = now, by
    return force, slopes


def fit_loop(loop: PreslidingLoop) -> BristleStiffness:
    """Stiffness of bristles from a loop, with errors from the scatter of its forces.

    Raises
    ------
    NotAvailable
        If the loop has too few rows, or its force does not follow the displacement.
    """
    x, f = loop.displacement, loop.force
    if len(x) < FEWEST_ROWS or not np.ptp(x) > 0 or not np.ptp(f) > 0:
        raise NotAvailable(
            f"{loop.source!r} has {len(x)} rows of displacement and force; a loop has {FEWEST_ROWS} at least, and moves"
        )
    steps = np.diff(x)
    large = np.abs(steps) > LEAST_RISE * np.abs(steps).max()
    steep = float(np.median(np.diff(f)[large] / steps[large]))
    size, slope = float(np.abs(f).max()), max(steep, float(np.ptp(f) / np.ptp(x)) / 10)

    def residuals(inner: Array) -> tuple[Array, Array]:
        found, slopes = loop_forces(x, math.exp(inner[0]), math.exp(inner[1]), inner[2])
        return (found - f) / size, slopes / size

    low = np.array([math.log(slope) - 7, math.log(size) - 2, -2 * size])
    high = np.array([math.log(slope) + 7, math.log(size) + 5, 2 * size])
    starts = [np.array([math.log(slope * k), math.log(size * s), f[0]]) for k in (1, 3) for s in (1.02, 1.5)]
    found, ends = intervals(least(residuals, starts, low, high), LEVELS)
    if not np.all(np.isfinite(ends[0])):
        raise NotAvailable(f"the loop {loop.source!r} does not tell a stiffness: its forces do not follow displacement")
    (low68, high68), (low95, high95) = np.exp(ends[0])
    return BristleStiffness(
        float(np.exp(found.at[0])), float(high68 - low68) / 2, float(low95), float(high95),
        float(np.exp(found.at[1])), float(np.sqrt(found.variance)) * size,
    )  # fmt: skip
