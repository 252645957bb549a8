"""Variants of a fit: minima under other assumptions about the loading."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.effort import Budget, Effort, work_of_search
from steadyslip.experiments.fitting.plan import Plan, with_loading
from steadyslip.experiments.loading.loading import Change, Loading, resting_rate
from steadyslip.experiments.numerics.least_squares import DAMPING_NEAR, Minima, minimise

RAMP_SHARES = (0.01, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0)  # durations of ramps that are tried, over the longest one


@dataclass(frozen=True)
class RampFit:
    """Minimum with ramps in place of steps.

    Attributes
    ----------
    share : float
        Duration of each ramp as a share of its longest possible duration.
    ssq : float
        Sum of squares.
    values : dict of str to float
        Values of all unknowns, by name; durations are ``step.1.duration``.
    """

    share: float
    ssq: float
    values: dict[str, float]


def driven_as_measured(
    plan: Plan, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, float] | None:
    """Values, by name, of a fit in which measured columns drive the model, searched from a fit's minimum; or None.

    Parameters
    ----------
    plan : Plan
    values : mapping of str to float
        Values at the minimum, by name of the unknown.
    bounds : mapping of str to (float, float)
        Bounds of the search, in coordinates, by name.
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
    found = _minimised(plan, z[None], low, high, most=30, tolerance=1e-4)
    if not np.isfinite(found.ssq[0]):
        return None
    return dict(zip((u.name for u in space.unknowns), map(float, space.values(found.coordinates[0])), strict=True))


def _minimised(plan: Plan, z: Array, low: Array, high: Array, given: Collection[str] = (), **options: Any) -> Minima:
    """Minima from starting points `z` (m, p), with the durations in `given` fixed, within the work of one search."""
    samples = sum(len(record) for record in plan.records)
    allowance = (budget := Budget()).part(work_of_search(samples, z.shape[1]))
    comparison = plan.for_trial().comparison(Effort(budget=budget), given)
    return minimise(lambda x, _: comparison.residuals(x), z, low, high, stop=allowance, **options)


def may_be_ramp(channel: str, change: Change) -> bool:
    """True if a change is modelled as a step although a ramp would fit the displacement as well."""
    return channel == "load" and change.free and change.duration == 0 and change.longest > 0 and not change.slight


def with_ramps(
    plan: Plan, values: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], wanted: float
) -> tuple[RampFit, ...]:
    """Minima with ramps in place of steps that may be ramps, the shortest ramps first; empty if there are none.

    Parameters are those of `driven_as_measured`, and `wanted`: searches that will not reach this sum of squares end
    early. Several durations are tried, as shares of the longest possible durations; the middle of a ramp stays within
    the window of the step.
    """
    if not plan.follows or not any(may_be_ramp(c, change) for one in plan.loading for c, _, change in one.changes):
        return ()
    plan = replace(plan, loading=tuple(_with_ramps(loading) for loading in plan.loading))
    space = plan.space()
    low, high = ([bounds.get(u.name, u.bounds)[side] for u in space.unknowns] for side in (0, 1))
    lows, highs = (np.tile(ends, (len(RAMP_SHARES), 1)) for ends in (low, high))
    begin = np.array([[values.get(u.name, share * u.high) for u in space.unknowns] for share in RAMP_SHARES])
    lengths = [k for k, u in enumerate(space.unknowns) if u.name not in values]
    for k in lengths:  # the unknown just before a duration is the time at which the ramp begins
        earlier = 0.5 * begin[:, k : k + 1]
        begin[:, k - 1 : k] -= earlier
        for ends in (lows, highs):
            ends[:, k - 1 : k] -= earlier / space.unknowns[k - 1].size
    held = np.zeros(begin.shape, dtype=bool)
    held[:, lengths] = True
    z = space.coordinates(begin)
    lows[:, lengths], highs[:, lengths] = z[:, lengths], z[:, lengths]
    near = {"damping": DAMPING_NEAR, "known": wanted}
    # with a larger tolerance, searches would end too early in flat valleys
    given = [space.unknowns[k].name for k in lengths]
    found = _minimised(plan, z, lows, highs, given, most=40, held=held, tolerance=1e-8, **near)
    names, own = [u.name for u in space.unknowns], space.values(found.coordinates)
    return tuple(
        RampFit(share, float(ssq), dict(zip(names, map(float, row), strict=True)))
        for share, ssq, row in zip(RAMP_SHARES, found.ssq, own, strict=True)
        if np.isfinite(ssq)
    )


def _with_ramps(loading: Loading) -> Loading:
    if loading.load is None:
        return loading
    changes = tuple(
        replace(one, time=one.time - 0.25 * one.longest, duration=0.5 * one.longest, shortest=0.0)
        if may_be_ramp("load", one) else one
        for one in loading.load.changes
    )  # fmt: skip
    return replace(loading, load=replace(loading.load, changes=changes))
