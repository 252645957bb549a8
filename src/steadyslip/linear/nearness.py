"""Distance between values of a parameter, and nearest edges: one measure for verdicts, margins and pages.

Distance is counted in doublings, so that half and twice a value are equally far. A relative difference would call a
hundredth of a value (-99 %) nearer than twice the value (+100 %).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from steadyslip.core.arrays import Array


def doublings(value: ArrayLike, other: ArrayLike, unit: str = "") -> Any:
    """Number of doublings from one value to another; for angles the difference in radians.

    Parameters
    ----------
    value, other : array_like
        Values in the same unit; they broadcast.
    unit : str
        SI unit of the parameter; only ``rad`` matters.

    Returns
    -------
    float or ndarray
        Zero or positive. From or to zero it is 1; for values of opposite sign 1 + log2(1 + |other/value|); NaN where a
        value is NaN.

    Examples
    --------
    >>> [float(doublings(8.0, other)) for other in (2.0, 16.0, 0.0, -8.0)], float(doublings(-0.5, 0.25, "rad"))
    ([2.0, 1.0, 1.0, 2.0], 0.75)
    """
    value, other = np.broadcast_arrays(np.asarray(value, dtype=float), np.asarray(other, dtype=float))
    if unit == "rad":
        return np.abs(other - value)[()]
    with np.errstate(all="ignore"):
        ratio = other / value
        far = np.where(ratio > 0, np.abs(np.log2(ratio)), 1 + np.log2(1 + np.abs(ratio)))
    far = np.where((value == 0) | (other == 0), 1.0, far)
    return np.where(value == other, 0.0, np.where(np.isnan(value + other), np.nan, far))[()]


def nearest_end(ends: Array, own: ArrayLike, unit: str = "") -> Array:
    """Index (...) of the end nearest to each value `own`, by `doublings`.

    Only the next end below `own` and the next above are compared, as larger changes pass these first. Of two ends
    equally far in doublings, the end with the smaller difference is taken.

    Parameters
    ----------
    ends : ndarray (..., m)
        Ends in any order, padded with NaN.
    own : array_like (...)
    unit : str

    Returns
    -------
    ndarray of int
        0 where all are NaN.
    """
    own = np.asarray(own, dtype=float)[..., None]
    low = np.max(np.where(ends < own, ends, -np.inf), axis=-1, keepdims=True)
    high = np.min(np.where(ends >= own, ends, np.inf), axis=-1, keepdims=True)
    far = np.where((ends == low) | (ends == high), doublings(own, ends, unit), np.inf)
    gap = np.where(far == np.min(far, axis=-1, keepdims=True), np.abs(ends - own), np.inf)
    return np.asarray(np.argmin(np.where(np.isnan(gap), np.inf, gap), axis=-1))


def ends_about(own: float, ends: Sequence[float], unit: str = "") -> tuple[float, ...]:
    """The next end below the value `own` and the next above, nearer one first: two, one or none.

    If an end is equal to `own`, only that end is returned.
    """
    beside = [*sorted(end for end in ends if end < own)[-1:], *sorted(end for end in ends if end >= own)[:1]]
    beside.sort(key=lambda end: (doublings(own, end, unit), abs(end - own)))
    return (own,) if own in beside else tuple(beside)
