"""Changes of rate as straight pieces, for a load point that follows its command neither at once nor as a servo does.

A displacement whose samples around changes lie beside the best steps, ramps or servo by more than its noise is fitted
by a rate that is constant between changes and free around them: straight between nodes that are dense at a change, no
rougher than cross-validation asks for.
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
"""Standard deviations by which a mean of samples near a change is off. Of 240 records of steps and servos with white
and correlated noise none was beyond 4.7; loads that creep, stick or have two time constants are from 11 on."""
ELSEWHERE = 1.3  # factor by which it must be off by more than means of as many samples far from changes
SHORTEST, WINDOWS = 4, 20  # samples of the shortest mean, and means of samples far from changes that show their scatter
DENSE, GROWTH = 4, 1.25  # nodes one sampling interval apart on each side of a change, then wider by this factor
SHARE = 0.45  # of the time to the next change that may belong to a change: lines need the rest
BEGUN = 0.05  # share of a change that is made when it counts as begun
COMPARED, EVEN = 25, 1e-9  # weights of roughness that are compared, and its smallest share: the largest is 1
SINGULAR = 1e-12  # share of each column added where samples are lost and pieces have none


def is_beside(time: Array, off: Array, changes: Array) -> bool:
    """True if means of samples near changes are off by more than their noise and than those of samples far away.

    Parameters
    ----------
    time, off : ndarray (n,)
        s; deviations in standard deviations of a sample.
    changes : ndarray (changes,)
        s.
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
    """Fit a rate that is free around changes and constant between them.

    Parameters
    ----------
    samples : SensorSamples
    step : JointFit
        Of steps at once to the same samples.
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
    for k, i in enumerate(
        own.tolist()
    ):  # differences of neighbouring pieces of a change, and of the outer ones from none
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
    """Ends of the pieces of each change, s."""
    edges = np.concatenate([time[:1], changes, time[-1:]])
    steps = spacing * np.concatenate([np.ones(DENSE), GROWTH ** np.arange(1, 100)])
    found = []
    for before, at, after in zip(edges, edges[1:], edges[2:], strict=False):
        sides = [np.cumsum(steps)[np.cumsum(steps) <= SHARE * length] for length in (at - before, after - at)]
        found.append(np.concatenate([at - sides[0][::-1], [at], at + sides[1]]))
    return found


def _smoothest(rows: Array, values: Array, rough: Array) -> tuple[Array, Array]:
    """Coefficients (p,) of a robust fit, no rougher than generalised cross-validation asks for, and deviations (p, p).

    The latter are one standard deviation along the axes of the coefficients' distribution, if roughness beforehand is
    as likely as its penalty says (Wahba 1983): that of noise alone would leave out what smoothing takes away.
    """
    weight, found, axes = np.ones(len(values)), np.zeros(rows.shape[1]), np.empty((0, rows.shape[1]))
    for _ in range(ROUNDS):
        heavy = rows * weight[:, None]
        size = np.maximum(np.linalg.norm(heavy, axis=0), 1e-300)
        normal = (heavy / size).T @ (heavy / size) + SINGULAR * np.eye(len(size))
        strength, ways = eigh((rough / size).T @ (rough / size), normal)  # both are diagonal along these ways
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
