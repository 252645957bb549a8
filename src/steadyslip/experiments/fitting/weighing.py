"""Weights of the records in a joint fit, from the noise of each record.

With equal weights, records of unequal noise may give larger errors than the quietest record alone (Aitken 1935). The
weights for the search follow from the scatter of friction from sample to sample, the weights of the final fit from the
residuals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.search import SearchResult, minima_near
from steadyslip.experiments.numerics.noise import describe
from steadyslip.experiments.numerics.splitting import displacement_noise, spread

LEAST_RATIO = 1.3  # records have equal weights below this ratio of noise: weights would reduce errors by 3 % at most
MOST_RATIO = 100.0  # largest ratio of noise in weights; a record with this ratio adds 1e-4 of the information
MAX_WEIGHINGS = 4  # largest number of times that the noise is estimated; two usually suffice
ALIKE = 0.1  # weights are final if the noise changes by less than this share: errors then change by less than 0.2 %
FAR = 4.0  # residuals beyond this number of robust standard deviations are outliers and ignored


def weighed_by_scatter(plan: Plan) -> Plan:
    """Plan of two or more records weighted by the scatter of friction about the line through neighbouring samples."""
    return _weighed(plan, np.array([displacement_noise(one.time, one.friction) for one in plan.records]))


def weighed_by_residuals(alike: Plan, plan: Plan, found: SearchResult, effort: Effort) -> tuple[Plan, SearchResult]:
    """Plan with records weighted by the (correlated) noise of their residuals, and its minimum.

    Parameters
    ----------
    alike : Plan
        Plan of two or more records with equal weights.
    plan : Plan
        The same plan with the weights of the search.
    found : SearchResult
        Minimum of `plan`; searches with new weights start at the last minimum.
    effort : Effort
        Limits, with the budget of the whole fit.
    """
    for _ in range(MAX_WEIGHINGS):
        own = _weighed(alike, _noise(alike, found))
        change = [np.max(a) / np.max(b) for a, b in zip(_weights(own), _weights(plan), strict=True)]
        if np.all(np.abs(np.array(change) - 1) < ALIKE):
            break
        comparison = own.comparison(effort)
        ends = minima_near(comparison, found.coordinates[None], found.bounds, effort)
        if not np.isfinite(ends.ssq[0]):
            break
        summary = replace(found.summary, converged=bool(ends.converged[0]), iterations=int(ends.iterations[0]))
        found = SearchResult(
            ends.coordinates[0], float(ends.ssq[0]), comparison, summary, found.bounds, found.ends
        )  # fmt: skip
        plan = own
    return plan, found


def _weights(plan: Plan) -> tuple[Array, ...]:
    return plan.weights or tuple(np.ones(len(record)) for record in plan.records)


def _weighed(plan: Plan, noise: Array) -> Plan:
    """Plan with records weighted by their noise (records,); the given plan if the noise hardly differs."""
    noise = np.maximum(noise, np.max(noise) / MOST_RATIO)
    if not np.max(noise) > LEAST_RATIO * np.min(noise):
        return plan
    mean = np.average(np.log(noise), weights=[len(record) for record in plan.records])
    sizes = noise / np.exp(mean)  # so that sums of squares with different weights can be compared
    return replace(plan, weights=tuple(row / size for row, size in zip(_weights(plan), sizes, strict=True)))


def _noise(plan: Plan, found: SearchResult) -> Array:
    """Standard deviation (records,) of white noise equivalent to the noise of residuals weighted as in the plan."""
    one, weights = found.comparison, np.concatenate(_weights(plan))
    predicted, jacobian = (own[0] for own in one.model(found.coordinates[None]))
    residuals, rows = (one.data - predicted) * weights, jacobian * weights
    noise = []
    for where in one.slices:
        left = residuals[where] - np.median(residuals[where])
        usual = np.where(np.abs(left) < (FAR * spread(left) or np.inf), left, 0.0)
        own = describe(usual, rows=rows[:, where])
        noise.append(float(np.sqrt(own.covariance[0] * max(own.inflation, 1.0))))
    return np.array(noise)
