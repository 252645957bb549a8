"""What drives an experiment, as tables for the kernels: measured histories exactly at samples, or a protocol."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from steadyslip.lab.forward import Table
from steadyslip.lab.record import Record
from steadyslip.lab.steps import smoothed
from steadyslip.protocol import Protocol, Segments, pack
from steadyslip.records import parameters, twin

Array = np.ndarray
PER_PERIOD = 200  # rows per period of a sine wave, on which it becomes straight: 1e-4 of its amplitude
_SHIFT = 1e-3  # s; free times are moved by it to see what moves with them, which is linear


def measured_table(record: Record, pressed: Array | None = None, smooth: bool = False) -> Table:
    """A record's own load point, and its change of normal stress (Pa), as straight lines between samples.

    With `smooth` the load point moves without the noise of the measured displacement.
    """
    time = record.time - record.time[0]
    rows = len(time) - 1
    segments = np.zeros((1, rows, 9))
    segments[0, :, 0], segments[0, :, 1] = time[:-1], time[1:]
    spacing = np.diff(time)
    assert record.displacement is not None
    displacement = smoothed(record.time, record.displacement) if smooth else record.displacement
    segments[0, :, 3] = np.diff(displacement) / spacing
    if record.integrated and record.velocity is not None:  # the rate itself is the straight line
        segments[0, :, 3] = record.velocity[:-1]
        segments[0, :, 6] = np.diff(record.velocity) / spacing
    if pressed is not None:
        segments[0, :, 5] = pressed[:-1]
        segments[0, :, 8] = np.diff(pressed) / spacing
    return Table(segments, np.arange(rows + 1)[None], rows + 1)


class ProtocolInputs:
    """Tables of a protocol at a record's samples, for any values of its free times.

    Parameters
    ----------
    protocol : Protocol
        Its times are on the record's clock.
    velocity : float
        Of the drive, m/s.
    time : ndarray
        Of the samples, s.
    free : mapping of str to int
        Names of free times, ``protocol.pieces.1.at``, and the direction of each.
    directions : int
        How many directions there are.
    pressed : ndarray (n,), optional
        Measured change of normal stress at the samples, Pa.
    """

    def __init__(
        self, protocol: Protocol, velocity: float, time: Array, free: Mapping[str, int] | None = None,
        directions: int = 0, pressed: Array | None = None,
    ) -> None:  # fmt: skip
        self.protocol, self.velocity, self.time, self.pressed = protocol, velocity, time, pressed
        self.free, self.directions = dict(free or {}), directions
        self._plain = {name: a.value for name, a in parameters(protocol, "protocol.").items()}

    def table(self, values: Mapping[str, Array], sensitive: bool = True) -> Table:
        """Tables for arrays of the free times, one job each."""
        if not self.free:
            return self._table(self._packed({}), None)
        jobs = len(next(iter(values.values())))
        segments = self._packed(values)
        if not sensitive:
            return self._table(segments, None, jobs)
        moved = {}
        for name, direction in self.free.items():
            ends = [self._packed({**values, name: values[name] + sign * _SHIFT}) for sign in (1.0, -1.0)]
            moved[direction] = ends
        return self._table(segments, moved, jobs)

    def _packed(self, values: Mapping[str, Array]) -> Segments:
        until = float(self.time[-1])
        plan = twin(self.protocol, self._plain | dict(values), "protocol.") if values else self.protocol
        return pack(plan, self.velocity, until)

    def _table(self, segments: Segments, moved: Mapping[int, list[Segments]] | None, jobs: int = 1) -> Table:
        first, last = float(self.time[0]), float(self.time[-1])
        starts = np.broadcast_to(segments.start, (jobs, segments.start.shape[1]))
        extra = _wave_nodes(segments, first, last)
        nodes = np.hstack([np.clip(starts, first, last), np.tile(np.append(self.time, extra), (jobs, 1))])
        order = np.argsort(nodes, axis=1, kind="stable")  # a step before the sample at its very time
        ends = np.take_along_axis(nodes, order, axis=1)
        begins = order < starts.shape[1]
        own = np.maximum.accumulate(np.where(begins, order, 0), axis=1)[:, :-1]
        samples = order - starts.shape[1]
        samples = np.where((samples >= 0) & (samples < len(self.time)), samples, -1)
        rows = np.zeros((jobs, ends.shape[1] - 1, 9))
        rows[:, :, 0], rows[:, :, 1] = ends[:, :-1], ends[:, 1:]
        inside = begins & (np.take_along_axis(np.hstack([starts, nodes[:, starts.shape[1] :]]), order, 1) >= first)
        rows[:, :, 2] = np.where(inside[:, :-1], _of(segments.jump, own, jobs), 0.0)
        before = _at(segments, own, rows[:, :, 0], jobs)
        after = _at(segments, own, rows[:, :, 1], jobs)
        if self.pressed is not None:
            before[:, :, 2] += np.interp(rows[:, :, 0], self.time, self.pressed)
            after[:, :, 2] += np.interp(rows[:, :, 1], self.time, self.pressed)
        spacing = (rows[:, :, 1] - rows[:, :, 0])[:, :, None]
        rows[:, :, 3:6] = before
        rows[:, :, 6:9] = np.where(spacing > 0, (after - before) / np.where(spacing > 0, spacing, 1.0), 0.0)
        table = Table(rows, np.ascontiguousarray(samples), len(self.time))
        if moved is None:
            return table
        node_rates = np.zeros((jobs, self.directions, rows.shape[1]))
        input_rates = np.zeros((jobs, self.directions, rows.shape[1], 3))
        middle = 0.5 * (rows[:, :, 0] + rows[:, :, 1])
        for direction, (plus, minus) in moved.items():
            shift = (plus.start - minus.start) / (2 * _SHIFT)
            node_rates[:, direction] = np.where(inside[:, :-1], _of(shift, own, jobs), 0.0)
            change = _at(plus, own, middle, jobs) - _at(minus, own, middle, jobs)
            input_rates[:, direction] = change / (2 * _SHIFT)
        return Table(rows, table.samples, table.count, node_rates, input_rates)


def _of(array: Array, own: Array, jobs: int) -> Array:
    return np.take_along_axis(np.broadcast_to(array, (jobs, *array.shape[1:])), own, axis=1)


def _at(segments: Segments, own: Array, times: Array, jobs: int) -> Array:
    """Inputs of the segments `own` at given times, (jobs, rows, 3)."""
    since = (times - _of(segments.start, own, jobs))[:, :, None]
    lane = np.arange(jobs)[:, None] if len(segments.start) > 1 else np.zeros((jobs, 1), dtype=int)
    found: Array = segments.value[lane, own] + segments.slope[lane, own] * since
    if segments.amplitude.shape[-1]:
        angle = segments.angular_frequency[lane, own] * since[..., None] + segments.phase[lane, own]
        found = found + np.sum(segments.amplitude[lane, own] * np.sin(angle), axis=-1)
    return found


def _wave_nodes(segments: Segments, first: float, last: float) -> Array:
    """Further rows, so that sine waves are nearly straight on each."""
    fastest = float(segments.angular_frequency.max(initial=0.0))
    if not fastest:
        return np.empty(0)
    return np.arange(first, last, 2 * np.pi / fastest / PER_PERIOD)[1:]
