"""Evaluation of channels: lines plus sine waves on each segment.

The formulas use arithmetic operators only, so they serve NumPy arrays here and nodes of compiled programs in
`steadyslip.kernels.record`. On a segment a channel is ``value + slope t + Σ amplitude sin(ω t + phase)``, t in s from
the segment's start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.protocol.curves import Array
from steadyslip.protocol.segments import Segments

Waves = Iterable[tuple[Any, Any, Any]]
"""Amplitude, angular frequency (rad/s) and phase (rad) of each wave."""
Function = Callable[[Any], Any]
Indices = NDArray[np.intp]


def level_at(t: Any, value: Any, slope: Any, waves: Waves, sine: Function) -> Any:
    """Value of a channel at time t."""
    found = value + slope * t
    for amplitude, omega, phase in waves:
        found = found + amplitude * sine(omega * t + phase)
    return found


def slope_at(t: Any, slope: Any, waves: Waves, cosine: Function) -> Any:
    """Time derivative of a channel at time t."""
    for amplitude, omega, phase in waves:
        slope = slope + amplitude * omega * cosine(omega * t + phase)
    return slope


def integral_to(t: Any, value: Any, slope: Any, waves: Waves, cosine: Function) -> Any:
    """Integral of a channel from the segment's start to t; for the load point its displacement."""
    found = value * t + 0.5 * slope * t * t
    for amplitude, omega, phase in waves:
        found = found + amplitude / omega * (cosine(phase) - cosine(omega * t + phase))
    return found


# -- evaluation on Segments


def segment_of(segments: Segments, lane: Any, time: Array) -> Indices:
    """Index of the segment at each time: at a breakpoint the later segment, at the end the last segment.

    Parameters
    ----------
    lane : ndarray of int
        Lane of each time.
    time : ndarray (points,)
        s.
    """
    if len(segments.start) == 1:
        index = np.searchsorted(segments.start[0], time, side="right") - 1
    else:
        index = np.sum(segments.start[lane] <= time[:, None], axis=1) - 1
    real = np.sum(segments.start < segments.end, axis=1)
    last = real[lane if len(real) > 1 else np.zeros_like(lane)] - 1
    return np.clip(index, 0, last)


def _parts(segments: Segments, lane: Any, segment: Any) -> tuple[Any, Array, Array, list[tuple[Array, Array, Array]]]:
    """Index arrays, values, slopes and waves of the given lanes and segments; channels are the last axis."""
    where = (lane if len(segments.start) > 1 else np.zeros_like(lane), segment)
    if not segments.amplitude.shape[-1]:
        return where, segments.value[where], segments.slope[where], []
    found = [wave[where] for wave in (segments.amplitude, segments.divisors(), segments.phase)]
    waves = [(found[0][..., h], found[1][..., h], found[2][..., h]) for h in range(segments.amplitude.shape[-1])]
    return where, segments.value[where], segments.slope[where], waves


def inputs_at(segments: Segments, lane: Any, segment: Any, time: Array) -> Array:
    """Channels at given times: load-point velocity (m/s), disturbances and added normal stresses (Pa), (..., channels).

    Parameters
    ----------
    lane, segment : ndarray of int
        Lane and segment of each time, broadcast with it.
    time : ndarray
        Since the start of the run, s; outside the segment its line and waves are extrapolated.
    """
    where, value, slope, waves = _parts(segments, lane, segment)
    found: Array = level_at((time - segments.start[where])[..., None], value, slope, waves, np.sin)
    return found


def rates_at(segments: Segments, lane: Any, segment: Any, time: Array) -> Array:
    """Time derivatives of the channels (per s), (..., channels); arguments as in `inputs_at`."""
    where, _, slope, waves = _parts(segments, lane, segment)
    return np.asarray(slope_at((time - segments.start[where])[..., None], slope, waves, np.cos))


def evaluate(segments: Segments, t: Any) -> tuple[Array, Array, Array]:
    """Load-point velocity (m/s), disturbance stress (Pa) and added normal stress (Pa) of the first lane at times `t`.

    At the time of a jump the value just after it is returned; at the end, the value just before.

    Raises
    ------
    ParameterError
        If a time lies outside the protocol.
    """
    times = np.asarray(t, dtype=float)
    last = float(segments.end[0].max())
    if not np.all((times >= 0) & (times <= last)):
        raise ParameterError([Problem("t", f"got {t!r}; allowed: times between 0 and {last!r} s")])
    lane = np.zeros(times.size, dtype=int)
    first = Segments(*(getattr(segments, item.name)[:1] for item in fields(Segments)))
    found = inputs_at(first, lane, segment_of(first, lane, times.ravel()), times.ravel()).reshape(*times.shape, -1)
    return found[..., 0], found[..., 1], found[..., 2]
