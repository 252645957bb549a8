"""Whether two records are one measurement, whole, cut, thinned or averaged: it must not count twice."""

from __future__ import annotations

import numpy as np

from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.splitting import displacement_noise, spread

FEWEST_SHARED, LEAST_SHARED = 8, 0.5  # samples, and share of the sparser record, that two must share to be one
SAME_NOISE = 0.3  # scatter of their difference, in that of its noise: 1 or more of two experiments, 0 of one


def is_same_measurement(one: Record, other: Record) -> bool:
    """True if two records have the same noise where they overlap, so that one is the other, cut, thinned or averaged.

    The noise of two experiments is independent, and so their difference has at least that of the sparser one.
    """
    fine, sparse = (one, other) if len(one) >= len(other) else (other, one)
    inside = (sparse.time >= fine.time[0]) & (sparse.time <= fine.time[-1])
    time, friction = sparse.time[inside], sparse.friction[inside]
    if len(time) < max(FEWEST_SHARED, LEAST_SHARED * len(sparse)):
        return False
    noise = displacement_noise(time, friction)
    edges = np.searchsorted(fine.time, np.append(time[0], 0.5 * (time[1:] + time[:-1])))
    counts = np.diff(edges, append=max(int(np.searchsorted(fine.time, time[-1], side="right")), edges[-1] + 1))
    sums = np.append(0.0, np.cumsum(fine.friction))
    means = (sums[np.minimum(edges + counts, len(fine))] - sums[edges]) / np.maximum(counts, 1)
    return any(
        spread(friction - same) < SAME_NOISE * noise for same in (means, np.interp(time, fine.time, fine.friction))
    )
