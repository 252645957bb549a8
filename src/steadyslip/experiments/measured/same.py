"""Test whether two records come from the same measurement, which must not count twice in a fit."""

from __future__ import annotations

import numpy as np

from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.splitting import displacement_noise, spread

FEWEST_SHARED, LEAST_SHARED = 8, 0.5
"""Least overlap of two records of the same measurement: number of samples of the record with fewer samples, and share
of that record."""
SAME_NOISE = 0.3  # largest ratio of the scatter of the difference to the noise; the same data have 0, others 1 or more


def is_same_measurement(one: Record, other: Record) -> bool:
    """True if one record is the other after cutting, thinning or averaging: both have the same noise in the overlap.

    The noise of two experiments is independent, so the difference of their friction has at least the noise of the
    record with fewer samples.
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
