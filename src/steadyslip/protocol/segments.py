"""Segments of a protocol, on each of which every channel is a line plus sine waves; input of the kernels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.results import read_only
from steadyslip.protocol.creep import ROUNDING, SWITCH, Release, spans_of
from steadyslip.protocol.curves import Array, Curve, Jump, Wave, chain, column, join_columns, knots
from steadyslip.protocol.protocol import CHANNELS, LOAD_POINT, Protocol


@dataclass(frozen=True)
class Segments:
    """Consecutive time spans of each lane, and the channels on them.

    The channels are load-point velocity (m/s), disturbance stress q (Pa) and added normal stress p (Pa), then further
    disturbances and normal stresses (`steadyslip.protocol.protocol.channel_of`). On a segment a channel is
    ``value + slope (t - start)`` plus the sum of ``amplitude sin(angular_frequency (t - start) + phase)`` over the last
    axis.

    Parameters
    ----------
    start, end : ndarray (lanes, n)
        s; the first segment starts at 0. Lanes with fewer segments than others are padded with empty ones at their end.
    jump : ndarray (lanes, n)
        Displacement step of the load point at the start of the segment, m.
    value, slope : ndarray (lanes, n, channels)
        Value at the start and slope (per s) of the linear part.
    amplitude, angular_frequency, phase : ndarray (lanes, n, channels, h)
        Sine waves; h is the largest number of simultaneous waves of a channel, unused ones are zero.
    """

    start: Array
    end: Array
    jump: Array
    value: Array
    slope: Array
    amplitude: Array
    angular_frequency: Array
    phase: Array

    def level(self) -> str:
        """Class of inputs that a kernel must support: ``"constant"``, ``"linear"`` or ``"harmonic"``."""
        if self.amplitude.shape[-1]:
            return "harmonic"
        return "linear" if np.any(self.slope) else "constant"

    def divisors(self) -> Array:
        """Angular frequencies (rad/s) by which to divide; 1 where there is no wave."""
        return np.where(self.amplitude == 0, 1.0, self.angular_frequency)

    def rows(self, start: int, stop: int) -> Array:
        """Segments of lanes `start` to `stop` in the layout of the kernels, (lanes or 1, n, columns).

        The columns are start, end, jump, values, slopes, amplitudes, angular frequencies and phases.
        """
        return self._rows(slice(start, stop)) if len(self.start) > 1 else self._shared_rows

    @cached_property
    def _shared_rows(self) -> Array:
        """Kernel rows if all lanes have the same segments, (1, n, columns)."""
        return self._rows(slice(None))

    def _rows(self, lanes: slice) -> Array:
        parts = [part[lanes, :, None] for part in (self.start, self.end, self.jump)]
        parts += [self.value[lanes], self.slope[lanes]]
        for wave in (self.amplitude, self.divisors(), self.phase):
            block = wave[lanes]
            parts.append(block.reshape(*block.shape[:2], -1))
        return np.ascontiguousarray(np.concatenate(parts, axis=2))


@dataclass
class _Terms:
    """Elements of all pieces of a protocol: curves and waves with their channels, jumps, and spans of creep."""

    curves: list[tuple[int, Curve]] = field(default_factory=list)
    waves: list[tuple[int, Wave]] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    spans: list[Release] = field(default_factory=list)

    def breakpoints(self) -> Iterator[Array]:
        for _, curve in self.curves:
            yield curve.times
        for _, wave in self.waves:
            yield from (wave.start, wave.stop)
        for jump in self.jumps:
            yield jump.time
        for span in self.spans:
            yield from span.breakpoints()

    def lanes(self, *others: Array) -> int:
        """Number of lanes; raises ParameterError if arrays have different lengths other than 1."""
        lengths = {len(part) for part in (*others, *self.breakpoints())}
        lengths |= {len(part) for _, curve in self.curves for part in (curve.left, curve.right)}
        lengths |= {len(part) for _, w in self.waves for part in (w.amplitude, w.angular_frequency, w.phase)}
        lengths |= {len(jump.by) for jump in self.jumps}
        lengths |= {len(part) for span in self.spans for part in span.numbers()}
        if len(lengths - {1}) > 1:
            raise ParameterError([Problem("protocol", f"arrays of different lengths {sorted(lengths - {1})}")])
        return max(lengths)


def pack(protocol: Protocol, velocity: Any, until: Any, channels: tuple[int, ...] | None = None) -> Segments:
    """Segments of a protocol: time spans on which every channel is a line plus sine waves.

    Parameters
    ----------
    protocol : Protocol
        Numbers in the protocol may be 1-D arrays with one value for each lane, see `records.with_values`.
    velocity : float or 1-D array
        Velocity of the rig's drive, m/s.
    until : float or 1-D array
        End of each lane, s; the protocol is cut there, and changes at this very time have no effect.
    channels : tuple of int, optional
        Channel of each piece; by default the first channel of its kind.

    Returns
    -------
    Segments

    Raises
    ------
    ParameterError
        If arrays differ in length, `until` is not positive, or the pieces that set the velocity overlap in a lane.
    """
    try:
        hash((protocol, velocity, until))
    except TypeError:  # arrays
        return _segments(protocol, velocity, until, channels)
    return _cached_segments(protocol, velocity, until, channels)


def _segments(protocol: Protocol, velocity: Any, until: Any, channels: tuple[int, ...] | None) -> Segments:
    final = column(until)
    if not np.all((final > 0) & np.isfinite(final)):
        raise ParameterError([Problem("until", f"got {until!r}; allowed: a finite number > 0 in s")])
    own = tuple(piece.channel for piece in protocol.pieces) if channels is None else channels
    terms = _terms(protocol, velocity, own)
    lanes = terms.lanes(final, column(velocity))
    start, end = _grid([*terms.breakpoints()], final)
    shape = (lanes, start.shape[1])
    count = max((*own, CHANNELS - 1, SWITCH if terms.spans else 0)) + 1
    jump, value, slope = np.zeros(shape), np.zeros((*shape, count)), np.zeros((*shape, count))
    for step in terms.jumps:
        jump += np.where((start == step.time) & (start < end), step.by, 0.0)
    for channel, curve in terms.curves:
        level, rate = curve.value_and_slope(start)
        value[:, :, channel] += level
        slope[:, :, channel] += rate
    for span in terms.spans:
        span.add_to(start, value, slope)
    waves = _waves(terms.waves, start, end, (*shape, count))
    return Segments(_broadcast(start, shape), _broadcast(end, shape), jump, value, slope, *waves)


@lru_cache(maxsize=32)
def _cached_segments(
    protocol: Protocol, velocity: float, until: float, channels: tuple[int, ...] | None
) -> Segments:  # fmt: skip
    return Segments(*map(read_only, vars(_segments(protocol, velocity, until, channels)).values()))


def _terms(protocol: Protocol, velocity: Any, channels: tuple[int, ...]) -> _Terms:
    terms = _Terms()
    drive: list[Curve] = []
    present: Any = velocity
    for piece, channel in zip(protocol.pieces, channels, strict=True):
        if (curve := piece.curve(present)) is not None:
            if piece.channel == LOAD_POINT:
                drive.append(curve)
                present = curve.right[:, -1]
            elif not (protocol.lets_go and piece.frees_load_point):  # `spans_of` adds these pieces to the creep spans
                terms.curves.append((channel, curve))
        if (wave := piece.wave()) is not None:
            terms.waves.append((channel, wave))
        if (jump := piece.jump()) is not None:
            terms.jumps.append(jump)
    for earlier, later in pairwise(drive):
        last, first = earlier.times[:, -1], later.times[:, 0]
        if np.any(first < last - ROUNDING * np.abs(last)):
            message = "the pieces that set the velocity overlap, or are not in the order of time, in some lanes"
            raise ParameterError([Problem("protocol.pieces", message)])
    if protocol.lets_go:
        terms.spans, problems = spans_of(protocol.pieces, drive)
        if problems:
            raise ParameterError([problem.under("protocol") for problem in problems])
    terms.curves.append((LOAD_POINT, chain(drive) if drive else knots((0, velocity, velocity))))
    return terms


def _grid(breakpoints: list[Array], final: Array) -> tuple[Array, Array]:
    """Start and end (s) of the segments between breakpoints, each (lanes, n); empty segments are last."""
    points = np.clip(join_columns([np.zeros((1, 1)), *breakpoints, final]), 0, final)
    points.sort(axis=1)
    repeated = points[:, 1:] == points[:, :-1]
    points[:, 1:] = np.where(repeated, final, points[:, 1:])
    points.sort(axis=1)
    count = int(np.max(np.sum(points < final, axis=1)))
    return points[:, :count], points[:, 1 : count + 1]


def _waves(terms: list[tuple[int, Wave]], start: Array, end: Array, sizes: tuple[int, ...]) -> tuple[Array, ...]:
    """Amplitude, angular frequency and phase on each segment, each (lanes, n, channels, h).

    The waves that are present on a segment take the slots 0, 1, ... of their channel.
    """
    *shape, channels = sizes
    if not terms:
        return tuple(np.zeros((*sizes, 0)) for _ in range(3))
    active = [(start >= w.start) & (start < w.stop) & (start < end) for _, w in terms]
    taken = np.zeros((channels, *shape), dtype=np.intp)
    places: list[NDArray[np.intp]] = []
    for (channel, _), present in zip(terms, active, strict=True):
        places.append(taken[channel].copy())
        taken[channel] += present
    found = tuple(np.zeros((*sizes, int(taken.max(initial=0)))) for _ in range(3))
    for (channel, wave), present, place in zip(terms, active, places, strict=True):
        lane, segment = np.nonzero(_broadcast(present, tuple(shape)))
        slot = place[lane, segment]
        phase = wave.angular_frequency * (start - wave.start) + wave.phase
        for array, numbers in zip(found, (wave.amplitude, wave.angular_frequency, phase), strict=True):
            array[lane, segment, channel, slot] = np.broadcast_to(numbers, shape)[lane, segment]
    return found


def _broadcast(array: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    return np.ascontiguousarray(np.broadcast_to(array, shape))
