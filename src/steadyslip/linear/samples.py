"""Values of a parameter at which a scan for edges of stability evaluates the status.

Samples follow from the parameter's domain, its value, and its typical size by dimensional analysis. A requested range
only adds samples beyond the default range, so that the edges found do not depend on the request.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import distinct
from steadyslip.core.domains import Domain

Array = NDArray[np.float64]

DECADES = 6
"""Number of decades to each side of a parameter's value, and of its typical size, that are searched by default."""
# Densities of samples, chosen by trial: computing time against narrow windows that fall between two samples.
_PER_DECADE = 40
_FURTHER = 10  # samples per decade beyond `DECADES`
_LINEAR = 721  # samples between the two ends of a domain: a quarter of a degree for angles from −90 to 90 degrees
_TOWARDS = 4  # samples per decade of the distance to an end of the domain or to an edge
_NEAREST = 1e-9  # relative distance from an edge below which the status may be wrong by rounding
_LARGEST = 300  # largest exponent of ten of a sample: doubles end at 308


def bounded(domain: Domain, share: int) -> Array:
    """Samples of a parameter with a bounded domain: evenly spaced, and geometrically closer to both ends.

    `share` divides the number of samples.
    """
    width = domain.high - domain.low
    near = _NEAREST * width
    low = domain.low if domain.low_allowed else domain.low + near
    high = domain.high if domain.high_allowed else domain.high - near
    even = np.linspace(low, high, _LINEAR // share)
    ends = towards(low, even[1], near, share), towards(high, even[-2], near, share)
    return distinct(np.concatenate([even, *ends]))[0]


def unbounded(domain: Domain, zero: bool, size: float, least: float, most: float, share: int) -> Array:
    """Samples spaced geometrically around `size`, from `least` to `most`; of both signs if the domain has both.

    With `zero` the value 0 is included; `share` divides the number of samples.
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
    with np.errstate(over="ignore"):  # for extremely small sizes
        samples = np.where(decades < _LARGEST, size * 10.0**decades, 10.0**power)
    nothing = np.zeros(int(zero or domain.low < 0))
    samples = np.concatenate([-samples[::-1] if domain.low < 0 else [], nothing, samples])
    return np.asarray(samples[domain.contains(samples)])


def towards(edge: float, other: float, near: float = 0.0, share: int = 1) -> Array:
    """Samples between an edge and another value, geometrically closer to the edge, down to the distance `near` from it.

    By default the least distance is what rounding allows; `share` divides the number of samples.
    """
    distance = abs(other - edge)
    least = near or _NEAREST * max(abs(edge), distance)
    if not distance > least:
        return np.empty(0)
    count = int(np.log10(distance / least) * _TOWARDS / share) + 1
    away = np.geomspace(least, distance, count, endpoint=False)
    return np.asarray(edge + np.sign(other - edge) * away)
