"""The values at which a scan looks at a parameter.

They follow from the parameter's domain, its value and its natural size, never from the range that somebody asks for:
a range adds samples beyond the usual ones and moves none, so that edges within it are the same whatever it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.domains import Domain

Array = NDArray[np.float64]

DECADES = 6
"""Decades to each side of a value, and of the natural size, that are searched unless more is asked for."""
_PER_DECADE = 40
_FURTHER = 10  # samples a decade beyond those: what is so far off is of less use
_LINEAR = 721  # a quarter of a degree between angles
_TOWARDS = 4  # samples a decade of the distance to an end of the domain, or to an edge
_NEAREST = 1e-9  # share of the size of an edge, nearer than which rounding may decide
_LARGEST = 300  # decades from one: products with what is larger leave the range of floating point


def bounded(domain: Domain, share: int) -> Array:
    """Samples of a parameter with two ends: evenly spaced, and ever closer towards either end."""
    width = domain.high - domain.low
    near = _NEAREST * width
    low = domain.low if domain.low_allowed else domain.low + near
    high = domain.high if domain.high_allowed else domain.high - near
    even = np.linspace(low, high, _LINEAR // share)
    return np.unique(np.concatenate([even, towards(low, even[1], near, share), towards(high, even[-2], near, share)]))


def unbounded(domain: Domain, zero: bool, size: float, least: float, most: float, share: int) -> Array:
    """Samples by decades around a size, down to `least` and up to `most`, of both signs where these are allowed.

    `zero` says whether that is one of them.
    """
    middle = np.linspace(-DECADES, DECADES, 2 * DECADES * _PER_DECADE // share + 1)
    with np.errstate(all="ignore"):
        down, up = (np.log10(np.divide(*ends)) - DECADES for ends in ((size, least), (most, size)))  # least may be 0
    step = share / _FURTHER
    lower, upper = (
        DECADES + step * np.arange(1, int(np.ceil(min(max(far, 0.0), 2 * _LARGEST) / step)) + 1) for far in (down, up)
    )
    decades = np.concatenate([-lower[::-1], middle, upper])
    power = decades + np.log10(size)
    decades, power = decades[np.abs(power) < _LARGEST], power[np.abs(power) < _LARGEST]
    with np.errstate(over="ignore"):  # of a size that is nearly nothing
        samples = np.where(decades < _LARGEST, size * 10.0**decades, 10.0**power)
    nothing = np.zeros(int(zero or domain.low < 0))
    samples = np.concatenate([-samples[::-1] if domain.low < 0 else [], nothing, samples])
    return np.asarray(samples[domain.contains(samples)])


def towards(edge: float, other: float, near: float = 0.0, share: int = 1) -> Array:
    """Samples between an edge and another value, ever closer to the edge, as near as `near` or what rounding allows."""
    distance = abs(other - edge)
    least = near or _NEAREST * max(abs(edge), distance)
    if not distance > least:
        return np.empty(0)
    count = int(np.log10(distance / least) * _TOWARDS / share) + 1
    away = np.geomspace(least, distance, count, endpoint=False)
    return np.asarray(edge + np.sign(other - edge) * away)
