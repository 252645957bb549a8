"""Where the search of a fit ends if something about it is changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from steadyslip.experiments.fitting.plan import Plan, with_loading
from steadyslip.experiments.loading.loading import resting_rate
from steadyslip.experiments.numerics.least_squares import minimise


def driven_as_measured(
    plan: Plan, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, float] | None:
    """Where the search ends if the measured columns drive the model instead, from the fit's own minimum.

    Parameters
    ----------
    plan : Plan
    values : mapping of str to float
        At the minimum, by name of the unknown.
    bounds : mapping of str to (float, float)
        Where the coordinates were searched.
    """
    noisy = [c for loading in plan.loading for c in (loading.load,) if c is not None and np.any(c.errors > 0)]
    if any(resting_rate(loading) is not None for loading in plan.loading):
        return None
    if not noisy or any(course.curve is not None for course in noisy):
        return None
    plan = with_loading(replace(plan, drive="measured"))
    space = plan.space()
    z = space.coordinates(np.array([values.get(u.name, 0.5 * (u.low + u.high)) for u in space.unknowns]))
    low, high = (np.array([bounds.get(u.name, u.bounds)[side] for u in space.unknowns]) for side in (0, 1))
    comparison = plan.comparison()
    found = minimise(lambda x, _: comparison.residuals(x), z[None], low, high, most=30, tolerance=1e-4)
    if not np.isfinite(found.ssq[0]):
        return None
    return dict(zip((u.name for u in space.unknowns), map(float, space.values(found.coordinates[0])), strict=True))
