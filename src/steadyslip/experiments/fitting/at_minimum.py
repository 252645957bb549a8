"""Errors at a minimum: covariance from the noise of residuals, undetermined parameters, and a test of the minimum."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.version import version
from steadyslip.experiments.fitting.comparison import Comparison, DataComparison
from steadyslip.experiments.fitting.equal_minima import AS_GOOD, EqualMinimum, ends_beside, opened
from steadyslip.experiments.fitting.estimates import combinations, prior_information, whole_covariance
from steadyslip.experiments.fitting.fitted import Fitted
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.search import MIN_GAIN, SearchSummary, jump_left, times_of_changes
from steadyslip.experiments.fitting.valleys import along_open, along_valleys
from steadyslip.experiments.loading.loading import raised, shifted
from steadyslip.experiments.numerics.noise import STRUCTURE, Noise, describe, white, whiteness

ARRIVED = 0.1  # a stopped search is at a minimum if its next step is shorter than this many standard deviations
F = TypeVar("F", bound=Fitted)


def loading_shifts(plan: Plan, comparison: Comparison, z: Array) -> Iterator[Array]:
    """Changes (n,) of the weighted model, each for one uncertain number of the loading changed by its standard error.

    The uncertain numbers are levels of normal stress, the measured motion of the load point, parameters of its servo,
    and known initial states. Nothing is returned if the loading is not found in the records.
    """
    if not plan.follows:
        return
    predicted: Array | None = None
    values = comparison.space.values(z[None])[0]
    for k, (loading, part, where) in enumerate(zip(plan.loading, comparison.parts, comparison.slices, strict=True)):
        loads = () if loading.load is None else tuple(raised(loading.load))
        models = []
        if loads and loading.load is not None:
            models.append(part.driven_by(values, [loading.load, *loads]))
        if plan.beginnings:
            models.append(part.begun_from(values, plan.beginning(k).ends()))
        for model in (one - first for first, *others in models for one in others):
            own = np.zeros(comparison.size)
            own[where] = model * part.weights
            if np.all(np.isfinite(own)):
                yield own
    for i, loading in enumerate(plan.loading):
        for moved in shifted(loading, plan.pressed):
            if predicted is None:
                predicted = comparison.model(z[None])[0][0]
            others = tuple(moved if k == i else own for k, own in enumerate(plan.loading))
            model = replace(plan, loading=others).comparison().model(z[None])[0][0]
            if np.all(np.isfinite(model)):
                yield (model - predicted) * comparison.weights


def spread_of_gradient(plan: Plan, comparison: Comparison, z: Array, rows: Array, noises: Sequence[Noise]) -> Array:
    """Covariance (p, p) of Jᵀr, with derivatives Jᵀ in `rows` (p, n), due to noise and to the uncertain loading."""
    found = np.zeros((len(z), len(z)))
    for noise, where in zip(noises, comparison.slices, strict=True):
        found += noise.spread(rows[:, where])
    for shift in loading_shifts(plan, comparison, z):
        found += np.outer(push := rows @ shift, push)
    return found


def _is_minimum(
    comparison: DataComparison, z: Array, bounds: tuple[Array, Array], information: Array, gradient: Array,
    deviations: Array,
) -> bool:  # fmt: skip
    """True if the coordinates `z` (p,) at which a search ended are within `ARRIVED` standard deviations of a minimum.

    The test is that the next Gauss-Newton step is shorter. The sum of squares has a kink where the time of a change
    equals the time of a sample. A time at a kink is left out of the step if the sum of squares rises on both sides of
    the kink.
    """
    free = (bounds[0] < z) & (z < bounds[1])
    ssq = float(np.sum(comparison.residuals(z[None])[0] ** 2))
    times = times_of_changes(comparison.space)
    while np.any(free):
        own = information[np.ix_(free, free)]
        length = np.zeros(len(z))
        length[free] = np.abs(np.linalg.lstsq(own, gradient[free])[0]) / deviations[free]
        if np.all(length <= ARRIVED):
            break
        worst = int(np.argmax(np.where(times, length, 0.0)))
        if not length[worst] > ARRIVED:
            return False
        along = np.zeros(len(z))
        along[free] = np.linalg.lstsq(own, (np.flatnonzero(free) == worst).astype(float))[0]
        along *= ARRIVED * deviations[worst] / along[worst]
        beside = np.sum(comparison.residuals(z + np.array([[-1.0], [1.0]]) * along)[0] ** 2, axis=1)
        if not np.all(beside > ssq):
            return False
        free[worst] = False
    return True


def fit_with_errors(
    made: type[F], plan: Any, comparison: Any, z: Array, search: SearchSummary, errors: str,
    bounds: tuple[Array, Array], ends: Array | None = None,
) -> F:  # fmt: skip
    """Fit of the class `made` at the coordinates (p,) of a minimum, with errors, noise and undetermined parameters.

    Errors are infinite if few of many starts lead to the minimum and structure is left in the residuals, or if
    residuals jump, as a better minimum may have been missed. Other starts ended at `ends` (m, p). A better minimum near
    them replaces `z`; if a minimum near them fits as well, the parameters that differ there are not determined.
    """
    r, jacobian = comparison.residuals(z[None])
    residuals, rows = r[0], jacobian[0]
    free = len(z)
    information = rows @ rows.T
    noises = []
    for where in comparison.slices:
        own = residuals[where]
        share = free * len(own) // comparison.size
        if errors == "independent":
            noise = white(own, share)
        else:
            noise = describe(own, share, errors == "correlated", rows[:, where])
        noises.append(noise)
    spread = spread_of_gradient(plan, comparison, z, rows, noises)
    known = prior_information(comparison.space)
    counted = np.maximum(np.diag(information), 1e-300)
    scale = np.diag(spread) / counted  # variance of the data per unit of information on each unknown
    covariance, undetermined = combinations(information + scale * known, spread + scale**2 * known, comparison.space)
    doubted = bool(jump_left(comparison, residuals)) or (
        search.is_chance and whiteness(residuals[where] for where in comparison.slices).p < STRUCTURE
    )
    if doubted or not search.converged:
        search = replace(search, converged=False)
        if not doubted and _is_minimum(
            comparison, z, bounds, information, rows @ residuals, np.sqrt(np.diag(covariance))
        ):
            search = replace(search, converged=True)
        else:  # only the curvature at a minimum gives errors
            covariance = np.diag(np.full(free, np.inf))
    ssq, near = float(residuals @ residuals), np.empty((0, free))
    if search.converged:
        ends = np.empty((0, free)) if ends is None else ends
        covariance, by_valley, near = along_valleys(plan, comparison, z, bounds, information, covariance)
        undetermined += by_valley
        if undetermined:
            names = [one.name for one in comparison.space.unknowns]
            held = names.index(next(iter(undetermined[0].weights)))
            variance = max(noise.inflation * float(noise.covariance[0]) for noise in noises)
            covariance, others = along_open(plan, comparison, z, bounds, covariance, held, variance)
            near = np.concatenate([near, others])
        worth = sum(
            (where.stop - where.start) / max(n.inflation, 1.0)
            for n, where in zip(noises, comparison.slices, strict=True)
        )
        beside = ends_beside(comparison, z, ends, bounds, covariance, ssq * float(np.exp(AS_GOOD / worth)))
        if len(beside.ssq) and beside.ssq[0] < ssq * (1 - MIN_GAIN):
            search = replace(search, arrived=1, converged=bool(beside.converged[0]))
            others = np.vstack([z, beside.coordinates[1:]])
            return fit_with_errors(made, plan, comparison, beside.coordinates[0], search, errors, bounds, others)
        equal = [EqualMinimum(comparison.space, own - z) for own in beside.coordinates]
        covariance, by_minima = opened(comparison.space, covariance, equal)
        undetermined += by_minima
        near = np.concatenate([near, beside.coordinates])
    found = made(plan, z, ssq, search, tuple(noises), covariance, undetermined, bounds, version())
    whole = whole_covariance(information + scale * known, spread + scale**2 * known)
    return found.with_open(whole, near).with_memories()
