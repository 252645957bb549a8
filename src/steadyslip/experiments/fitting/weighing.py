"""Weights of the records of a joint fit by their own noise.

Records of unequal noise that weigh alike give larger errors than the quietest of them alone (Aitken 1935). How friction
scatters from sample to sample gives weights for the search, the residuals that it leaves those of the fit.
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

LEAST_RATIO = 1.3  # of noise, below which records weigh alike: weights of two would lessen errors by 3 % at most
MOST_RATIO = 100.0  # of noise that counts: with it, the noisy one of two adds a ten-thousandth of the information
MAX_WEIGHINGS = 4  # times that noise is estimated anew at most; two usually suffice
ALIKE = 0.1  # relative change of noise by which errors change by less than two thousandths
FAR = 4.0  # robust standard deviations beyond which residuals are left out: outliers tell nothing of noise


def weighed_by_scatter(plan: Plan) -> Plan:
    """Plan of two or more records, weighed by how friction scatters about the line through neighbouring samples."""
    return _weighed(plan, np.array([displacement_noise(one.time, one.friction) for one in plan.records]))


def weighed_by_residuals(alike: Plan, plan: Plan, found: SearchResult, effort: Effort) -> tuple[Plan, SearchResult]:
    """Plan whose records weigh by the noise of their residuals, its correlation counted, and its minimum.

    Parameters
    ----------
    alike : Plan
        Of two or more records that weigh alike.
    plan : Plan
        The same with weights by which its minimum was searched.
    found : SearchResult
        That minimum, which is followed while weights change.
    effort : Effort
        Whose budget this is part of.
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
    """Plan whose records weigh by their noise (records,); the same plan where that hardly differs."""
    noise = np.maximum(noise, np.max(noise) / MOST_RATIO)
    if not np.max(noise) > LEAST_RATIO * np.min(noise):
        return plan
    mean = np.average(np.log(noise), weights=[len(record) for record in plan.records])
    sizes = noise / np.exp(mean)  # so that sums of squares of fits with other weights compare
    return replace(plan, weights=tuple(row / size for row, size in zip(_weights(plan), sizes, strict=True)))


def _noise(plan: Plan, found: SearchResult) -> Array:
    """Standard deviation (records,) of the noise in slow changes, from residuals with the weights of the plan."""
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
