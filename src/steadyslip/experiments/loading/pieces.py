"""Changes of rate as piecewise linear functions, for a load point that responds neither at once nor as a servo does.

This model is used if samples around changes deviate from the best steps, ramps or servo by more than their noise. The
rate is constant between changes. Around a change it is linear between nodes, which are closest together at the change,
and as smooth as cross-validation requires.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from steadyslip.core.arrays import Array
from steadyslip.experiments.loading.joint import (
    OUTLIER,
    ROUNDS,
    JointFit,
    SensorSamples,
    Shape,
    joint_columns,
    misfit,
    ramp_responses,
)
from steadyslip.experiments.numerics.splitting import MAD_TO_SIGMA

BESIDE = 5.0
"""A fit fails if a mean of residuals near a change is off zero by more than this number of its standard deviations. In
240 records of steps and servos with white and correlated noise no mean was off by more than 4.7; in records of load
points that creep, stick or have two time constants, means are off by 11 and more."""
ELSEWHERE = 1.3  # the mean must also exceed all means of as many residuals far from changes by this factor
SHORTEST, WINDOWS = 4, 20  # samples in the shortest means; least number of means far from changes for their scatter
DENSE, GROWTH = 4, 1.25  # nodes one sampling interval apart on each side of a change; growth of the distances beyond
SHARE = 0.45  # largest share of the time to the next change that a change may take: the rest determines the lines
BEGUN = 0.05  # the time of a change is that at which this share of it is done
COMPARED, EVEN = 25, 1e-9  # number of smoothing strengths compared, and ratio of the weakest to the strongest
SINGULAR = 1e-12  # added to the unit diagonal of the normal matrix, which ramps without samples would make singular


def is_off_at_changes(time: Array, off: Array, changes: Array) -> bool:
    """True if residuals around changes show that a fit fails: their means exceed the noise and means far from changes.

    Parameters
    ----------
    time : ndarray (n,)
        s.
    off : ndarray (n,)
        Deviations from the fit, in standard deviations of a sample.
    changes : ndarray (changes,)
        Times of the changes, s.
    """
    places, count = np.searchsorted(time, changes), len(time)
    total = np.concatenate([[0.0], np.cumsum(np.clip(off, -OUTLIER, OUTLIER))])
    usual = float(np.median(np.min(np.abs(np.arange(count)[:, None] - places), axis=1)))
    shortest = int(np.min(np.diff([0, *places, count])))
    size = SHORTEST
    while size <= max(shortest // 2, SHORTEST):
        means = np.abs(total[size:] - total[:-size]) / np.sqrt(size)
        away = np.abs(np.arange(len(means))[:, None] + 0.5 * size - places)
        far = means[np.min(away, axis=1) > max(4 * size, usual)]
        if len(far) < WINDOWS * size:
            return False
        most = max(BESIDE * max(1.0, MAD_TO_SIGMA * float(np.median(far))), ELSEWHERE * float(np.max(far)))
        if np.any(means[np.min(away, axis=1) <= 1.5 * size] > most):
            return True
        size *= 2
    return False


def fit_pieces(samples: SensorSamples, step: JointFit, spacing: float) -> JointFit:
    """Fit of a rate that is free around changes and constant between them.

    Parameters
    ----------
    samples : SensorSamples
    step : JointFit
        Fit of sudden steps to the same samples.
    spacing : float
        Sampling interval, s.
    """
    nodes = _nodes(samples.time, step.times, spacing)
    begins, ends = (np.concatenate([one[side] for one in nodes]) for side in (slice(None, -1), slice(1, None)))
    own = np.repeat(np.arange(len(nodes)), [len(one) - 1 for one in nodes])
    jumps = np.diff(step.rates)

    def columns(time: Array) -> Array:
        moved, _ = ramp_responses(time, begins, ends - begins)
        return joint_columns(replace(samples, time=time), moved)

    rows, values = columns(samples.time) / samples.scale[:, None], samples.values / samples.scale
    rough = np.zeros((len(own) + len(nodes), rows.shape[1]))
    for k, i in enumerate(own.tolist()):  # differences of neighbouring pieces, with 0 beyond the outer ones
        rough[k + i : k + i + 2, 2 + k] = np.array([1.0, -1.0]) / jumps[i]
    found, deviations = _smoothest(rows, values, rough)

    def shape(coefficients: Array) -> Shape:
        made = coefficients[2 : 2 + len(own)]
        rates = coefficients[1] + np.concatenate([[0.0], np.cumsum(np.bincount(own, made, len(nodes)))])
        return rates, [made[own == i] / change for i, change in enumerate(np.diff(rates))]

    rates, shares = shape(found)
    times, pieces = [], []
    for i, share in enumerate(shares):
        time = float(begins[own == i][np.argmax(np.cumsum(share) > BEGUN)])
        times.append(time)
        since, duration = begins[own == i] - time, (ends - begins)[own == i]
        pieces.append(tuple(zip(since.tolist(), duration.tolist(), share.tolist(), strict=True)))
    off = values - rows @ found
    others = [shape(found + one) for one in deviations]
    return JointFit(rates, np.array(times), samples.levels, 0.0, 0.0, lambda t: columns(t) @ found, off, misfit(off),
                    np.empty((0, 0)), tuple(pieces), others)  # fmt: skip


def _nodes(time: Array, changes: Array, spacing: float) -> list[Array]:
    """Times (s), for each change, between which the rate is linear."""
    edges = np.concatenate([time[:1], changes, time[-1:]])
    steps = spacing * np.concatenate([np.ones(DENSE), GROWTH ** np.arange(1, 100)])
    found = []
    for before, at, after in zip(edges, edges[1:], edges[2:], strict=False):
        sides = [np.cumsum(steps)[np.cumsum(steps) <= SHARE * length] for length in (at - before, after - at)]
        found.append(np.concatenate([at - sides[0][::-1], [at], at + sides[1]]))
    return found


def _smoothest(rows: Array, values: Array, rough: Array) -> tuple[Array, Array]:
    """Coefficients (p,) of a robust fit with a roughness penalty, and their errors (p, p) in independent directions.

    Generalised cross-validation chooses the strength of the penalty. Each row of the errors is one standard deviation
    along an axis of the posterior of the coefficients, with the penalty as prior (Wahba 1983): the effect of noise
    alone would not include the error that smoothing causes.
    """
    weight, found, axes = np.ones(len(values)), np.zeros(rows.shape[1]), np.empty((0, rows.shape[1]))
    for _ in range(ROUNDS):
        heavy = rows * weight[:, None]
        size = np.maximum(np.linalg.norm(heavy, axis=0), 1e-300)
        normal = (heavy / size).T @ (heavy / size) + SINGULAR * np.eye(len(size))
        strength, ways = eigh((rough / size).T @ (rough / size), normal)  # these vectors make both matrices diagonal
        strength = np.maximum(strength, 0.0)
        right = ways.T @ ((heavy / size).T @ (values * weight))
        least = np.inf
        for much in np.geomspace(1 / strength[-1], 1 / (EVEN * strength[-1]), COMPARED):
            kept = 1 / (1 + much * strength)
            own = ways @ (kept * right) / size
            spare = len(values) - float(np.sum(kept))
            score = float(np.sum((weight * (values - rows @ own)) ** 2)) / spare**2
            if score < least:
                least, found = score, own
                axes = (ways * np.sqrt(score * spare * kept) / size[:, None]).T
        weight = 1 / np.sqrt(1 + ((values - rows @ found) / OUTLIER) ** 2)
    return found, axes
