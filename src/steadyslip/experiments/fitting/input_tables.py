"""Input tables of the compiled models for loading as measured at the samples, or for a protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import InternalError
from steadyslip.core.records import parameters, with_values
from steadyslip.experiments.fitting.commanded import STRAIGHT_TOLERANCE
from steadyslip.experiments.fitting.forward import InputTable
from steadyslip.experiments.loading.pressing import LEAST_STRESS
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.splitting import MAD_TO_SIGMA
from steadyslip.protocol import Protocol
from steadyslip.protocol.inputs import inputs_at
from steadyslip.protocol.segments import Segments, pack

MIN_RATE_STEP = 0.05  # smallest relative change of velocity that counts as a change; less is a measuring error
ROWS_PER_PERIOD = 300  # rows per period of a sine wave; straight lines deviate from it by 6e-5 of its amplitude
MAX_JUMPS = 20  # largest number of jumps whose times are fitted
_SHIFT = 1e-3  # step (s) of central differences by free times; any step would do, as tables are linear in them


@dataclass(frozen=True)
class Sharp:
    """Sudden changes between two samples of a record.

    Attributes
    ----------
    jumps : tuple of (float, float)
        Times, s, of the samples before and after each jump of the normal stress or of a measured velocity.
    kinks : tuple of (float, float, float)
        Times, s, of the samples before and after each kink of the displacement, and of the kink itself.
    """

    jumps: tuple[tuple[float, float], ...] = ()
    kinks: tuple[tuple[float, float, float], ...] = ()

    def rows(self, time: Array) -> Array:
        """Indices of the samples around all sudden changes; a record with fewer samples must keep these samples."""
        places = [int(np.searchsorted(time, change[0])) for change in (*self.jumps, *self.kinks)]
        around = [np.arange(i - 3, i + 5) for i in places]
        return np.unique(np.clip(np.concatenate([np.empty(0, dtype=int), *around]), 0, len(time) - 1))


def sharp_changes(record: Record) -> Sharp:
    """Sudden changes of a record, which straight lines between samples would represent as gradual.

    A change between two samples is sudden if it is much larger than the changes before and after it. The time of a kink
    of the displacement follows from the lines on both sides; the time of a jump is not known and is fitted.
    """
    jumps: set[int] = set()
    if record.normal is not None:
        jumps |= set(_jumps(record.time, record.normal, LEAST_STRESS))
    kinks: list[tuple[int, float]] = []
    if record.integrated and record.velocity is not None:
        jumps |= set(_jumps(record.time, record.velocity, MIN_RATE_STEP))
    elif record.displacement is not None:
        kinks = _kinks(record.time, record.displacement)
    t = record.time
    return Sharp(
        tuple((float(t[i]), float(t[i + 1])) for i in sorted(jumps)[:MAX_JUMPS]),
        tuple((float(t[i]), float(t[i + 1]), moment) for i, moment in kinks if i not in jumps),
    )


def _jumps(time: Array, values: Array, least: float) -> Array:
    """Indices of the samples before isolated jumps that are larger than a share `least` of the largest value."""
    size, spacing = np.abs(np.diff(values)), np.diff(time)
    if len(size) < 5:
        return np.empty(0, dtype=int)
    usual = MAD_TO_SIGMA * float(np.median(size))
    padded = np.pad(size / spacing, 2)
    rates = np.max([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]], axis=0)  # of two intervals on each side
    alone = size > 8 * rates * spacing
    return np.flatnonzero(alone & (size > least * float(np.max(np.abs(values)))) & (size > 20 * usual))


def _kinks(time: Array, displacement: Array) -> list[tuple[int, float]]:
    """Kinks of the displacement: index of the sample before, and time (s) at which the lines on both sides meet."""
    slopes = np.diff(displacement) / np.diff(time)
    if len(slopes) < 7:
        return []
    before, after = np.full(len(slopes), np.nan), np.full(len(slopes), np.nan)
    unlike = np.full(len(slopes), np.inf)
    before[2:], after[:-2] = 0.5 * (slopes[1:-1] + slopes[:-2]), 0.5 * (slopes[1:-1] + slopes[2:])
    unlike[2:-2] = np.abs(slopes[1:-3] - slopes[:-4]) + np.abs(slopes[4:] - slopes[3:-1])
    change = np.abs(after - before)
    with np.errstate(all="ignore"):
        share = (slopes - after) / (before - after)  # share of the interval before the kink
        clear = (change > 20 * unlike) & (change > 1e-3 * np.max(np.abs(slopes))) & (share > 1e-6) & (share < 1 - 1e-6)
    return [(int(i), float(time[i] + share[i] * (time[i + 1] - time[i]))) for i in np.flatnonzero(clear)]


def _curve_through(time: Array, values: Array, jumping: set[float]) -> Any:
    """Piecewise cubic curve through samples, with zero slope next to jumps; `jumping` has the times before jumps."""
    from scipy.interpolate import CubicHermiteSpline

    slopes = np.gradient(values, time)
    for first in jumping:
        i = int(np.searchsorted(time, first))
        slopes[max(i - 1, 0) : i + 3] = 0.0
    return CubicHermiteSpline(time, values, slopes)


def _curve_cuts(time: Array, values: Array, jumping: set[float]) -> tuple[Array, Array]:
    """Intervals in which a smooth curve is clearly not straight, and times (s) that divide them finely enough.

    Only deviations from a line that exceed the noise count. The noise is that of samples about predictions from their
    neighbours.
    """
    if len(time) < 8:
        return np.empty(0, dtype=int), np.empty(0)
    spacing = np.diff(time)
    middle = 0.5 * (time[1:] + time[:-1])
    misses = np.abs(_curve_through(time, values, jumping)(middle) - 0.5 * (values[1:] + values[:-1]))
    even, odd = np.arange(0, len(time), 2), np.arange(1, len(time) - 1, 2)
    noise = float(np.median(np.abs(_curve_through(time[even], values[even], set())(time[odd]) - values[odd])))
    least = max(STRAIGHT_TOLERANCE * float(np.ptp(values)), 3 * noise)
    for first in jumping:
        i = int(np.searchsorted(time, first))
        misses[max(i - 3, 0) : i + 4] = 0.0
    places = np.flatnonzero(misses > least)
    pieces = np.ceil(np.sqrt(misses[places] / least)).astype(int)
    places, pieces = places[pieces > 1], np.minimum(pieces[pieces > 1], 20)
    cuts = np.repeat(places, pieces - 1)
    number = np.concatenate([np.arange(1, n) for n in pieces]) if len(pieces) else np.empty(0)
    return cuts, time[cuts] + spacing[cuts] * number / np.repeat(pieces, pieces - 1)


class MeasuredInputs:
    """Input tables for load point and normal stress as measured, with straight lines between the samples.

    The normal stress follows a smooth curve where it is clearly curved. Jumps and kinks lie between samples.

    Parameters
    ----------
    record : Record
    sharp : Sharp
        Sudden changes of the record.
    pressed : ndarray (n,), optional
        Change of the normal stress since the first sample, Pa, if it drives the model.
    """

    def __init__(self, record: Record, sharp: Sharp, pressed: Array | None = None) -> None:
        time = record.time
        self.origin = float(time[0])
        self.times = time - self.origin
        jumping, bending = {first for first, _ in sharp.jumps}, {first for first, _, _ in sharp.kinks}
        curved, bent = (
            _curve_cuts(time, pressed, jumping) if pressed is not None else (np.empty(0, dtype=int), np.empty(0))
        )
        moments = [*(float(np.mean(j)) for j in sharp.jumps), *(k[2] for k in sharp.kinks), *bent]
        cuts = [*(int(np.searchsorted(time, j[0])) for j in sharp.jumps),
                *(int(np.searchsorted(time, k[0])) for k in sharp.kinks), *curved]  # fmt: skip
        order = np.argsort(moments, kind="stable")
        places = np.array(cuts, dtype=int)[order]
        nodes = np.insert(time, places + 1, np.array(moments, dtype=float)[order]) - self.origin
        samples = np.insert(np.arange(len(time)), places + 1, -1)  # index of the sample at each node; -1 if none
        old = np.maximum.accumulate(np.where(samples >= 0, samples, 0))[:-1]  # interval of each row
        rows = np.zeros((1, len(nodes) - 1, 9))
        rows[0, :, 0], rows[0, :, 1] = nodes[:-1], nodes[1:]
        self._set_measured_inputs(rows[0], record, old, pressed, jumping, samples >= 0)
        halves = np.flatnonzero(samples[:-1] < 0)  # rows that are the second part of a divided interval
        self.moving = np.array([row for row in halves if float(time[old[row]]) in jumping], dtype=int)
        for row in halves:
            first = float(time[old[row]])
            if first in jumping or first in bending:
                self._set_divided_rows(rows[0], int(row), record, int(old[row]), first in jumping, pressed)
        self.rows = rows

    def _set_measured_inputs(
        self, rows: Array, record: Record, old: Array, pressed: Array | None, jumping: set[float], sampled: Array
    ) -> None:
        spacing = np.diff(record.time)
        if record.displacement is not None:
            rows[:, 3] = (np.diff(record.displacement) / spacing)[old]
        if record.integrated and record.velocity is not None:  # a measured velocity varies linearly between samples
            slope = (np.diff(record.velocity) / spacing)[old]
            rows[:, 3] = record.velocity[old] + slope * (rows[:, 0] - (record.time[old] - self.origin))
            rows[:, 6] = slope
        if pressed is not None:
            curve = _curve_through(record.time, pressed, jumping)
            before, after = curve(rows[:, 0] + self.origin), curve(rows[:, 1] + self.origin)
            before = np.where(sampled[:-1], pressed[old], before)
            after = np.where(sampled[1:], pressed[old + 1], after)
            rows[:, 5], rows[:, 8] = before, (after - before) / (rows[:, 1] - rows[:, 0])

    def _set_divided_rows(
        self, rows: Array, row: int, record: Record, i: int, jumps: bool, pressed: Array | None
    ) -> None:
        """Set the two rows of a divided interval: values before and after a jump, or two velocities at a kink."""
        if not jumps:
            early, late = rows[row - 1, 1] - rows[row - 1, 0], rows[row, 1] - rows[row, 0]
            if record.displacement is None:
                raise InternalError("a kink was found in a record without displacement")
            rate = (record.displacement[i] - record.displacement[i - 2]) / (record.time[i] - record.time[i - 2])
            gone = record.displacement[i + 1] - record.displacement[i]
            rows[row - 1, 3], rows[row, 3] = rate, (gone - rate * early) / late
            return
        if pressed is not None:
            rows[row - 1, 5], rows[row, 5] = pressed[i], pressed[i + 1]
            rows[row - 1 : row + 1, 8] = 0.0
        if record.integrated and record.velocity is not None:
            rows[row - 1, 3], rows[row, 3] = record.velocity[i], record.velocity[i + 1]
            rows[row - 1 : row + 1, 6] = 0.0

    def table(self, times: Array, first: int = 0, directions: int = 0) -> InputTable:
        """Input table for given times of the jumps.

        Parameters
        ----------
        times : ndarray (jobs, jumps)
            Times of the jumps, s, on the record's clock.
        first : int
            Index, among all directions, of the derivative by the time of the first jump.
        directions : int
            Number of directions of derivatives; 0 for a table without derivatives.
        """
        if not len(self.moving):
            return InputTable(self.rows, self.times)
        rows = np.repeat(self.rows, len(times), axis=0)
        rows[:, self.moving, 0] = rows[:, self.moving - 1, 1] = times - self.origin
        if not directions:
            return InputTable(rows, self.times)
        rates = np.zeros((1, directions, rows.shape[1]))
        for k, row in enumerate(self.moving):
            rates[0, first + k, row] = 1.0
        return InputTable(rows, self.times, rates)


class ProtocolInputs:
    """Input tables for a protocol at the samples of a record, for any values of its free times.

    Parameters
    ----------
    protocol : Protocol
        Protocol with times on the record's clock.
    velocity : float
        Velocity of the drive, m/s.
    time : ndarray
        Times of the samples, s.
    free : sequence of str
        Names of free times, ``protocol.pieces.1.at``.
    pressed : ndarray (n,), optional
        Measured change of normal stress at the samples, Pa.

    Attributes
    ----------
    plain : dict of str to float
        Parameters of the given protocol, by dotted name.
    """

    def __init__(
        self, protocol: Protocol, velocity: float, time: Array, free: Sequence[str] = (), pressed: Array | None = None
    ) -> None:
        self.protocol, self.velocity, self.time, self.pressed = protocol, velocity, np.array(time), pressed
        self.free = tuple(free)
        self.plain = {name: a.value for name, a in parameters(protocol, "protocol.").items()}

    def table(self, times: Array, first: int = 0, directions: int = 0) -> InputTable:
        """Input table for values of the free times (jobs, free), s; see `MeasuredInputs.table`."""
        if not self.free:
            return self._fixed_table
        segments = self._packed(times)
        moved = []
        for k in range(len(self.free)) if directions else ():
            shift = _SHIFT * np.eye(len(self.free))[k]
            moved.append((first + k, self._packed(times + shift), self._packed(times - shift)))
        return self._table(segments, moved, directions, len(times))

    @cached_property
    def _fixed_table(self) -> InputTable:
        return self._table(pack(self.protocol, self.velocity, float(self.time[-1])), [], 0, 1)

    def _packed(self, times: Array) -> Segments:
        values = {name: times[:, i] for i, name in enumerate(self.free)}
        return pack(with_values(self.protocol, self.plain | values, "protocol."), self.velocity, float(self.time[-1]))

    def _table(
        self, segments: Segments, moved: Sequence[tuple[int, Segments, Segments]], directions: int, jobs: int
    ) -> InputTable:
        first, last = float(self.time[0]), float(self.time[-1])
        starts = np.broadcast_to(segments.start, (jobs, segments.start.shape[1]))
        extra = _wave_nodes(segments, first, last)
        fixed = np.concatenate([[first, last] if self.pressed is None else self.time, extra])
        nodes = np.hstack([np.clip(starts, first, last), np.tile(fixed, (jobs, 1))])
        order = np.argsort(nodes, axis=1, kind="stable")  # a step sorts before a sample at the same time
        ends = np.take_along_axis(nodes, order, axis=1)
        begins = order < starts.shape[1]
        own = np.maximum.accumulate(np.where(begins, order, 0), axis=1)[:, :-1]
        rows = np.zeros((jobs, ends.shape[1] - 1, 9))
        rows[:, :, 0], rows[:, :, 1] = ends[:, :-1], ends[:, 1:]
        inside = begins & (np.take_along_axis(np.hstack([starts, nodes[:, starts.shape[1] :]]), order, 1) >= first)
        rows[:, :, 2] = np.where(inside[:, :-1], _rows_of(segments.jump, own, jobs), 0.0)
        before = _inputs_at(segments, own, rows[:, :, 0], jobs)
        after = _inputs_at(segments, own, rows[:, :, 1], jobs)
        if self.pressed is not None:
            before[:, :, 2] += np.interp(rows[:, :, 0], self.time, self.pressed)
            after[:, :, 2] += np.interp(rows[:, :, 1], self.time, self.pressed)
        spacing = (rows[:, :, 1] - rows[:, :, 0])[:, :, None]
        rows[:, :, 3:6] = before
        rows[:, :, 6:9] = np.where(spacing > 0, (after - before) / np.where(spacing > 0, spacing, 1.0), 0.0)
        if not moved:
            return InputTable(rows, self.time)
        node_rates = np.zeros((jobs, directions, rows.shape[1]))
        input_rates = np.zeros((jobs, directions, rows.shape[1], 3))
        middle = 0.5 * (rows[:, :, 0] + rows[:, :, 1])
        for direction, plus, minus in moved:
            shift = (plus.start - minus.start) / (2 * _SHIFT)
            node_rates[:, direction] = np.where(inside[:, :-1], _rows_of(shift, own, jobs), 0.0)
            change = _inputs_at(plus, own, middle, jobs) - _inputs_at(minus, own, middle, jobs)
            input_rates[:, direction] = change / (2 * _SHIFT)
        return InputTable(rows, self.time, node_rates, input_rates)


def _rows_of(array: Array, own: Array, jobs: int) -> Array:
    return np.take_along_axis(np.broadcast_to(array, (jobs, *array.shape[1:])), own, axis=1)


def _inputs_at(segments: Segments, own: Array, times: Array, jobs: int) -> Array:
    """Inputs (jobs, rows, 3) of the segments with the indices `own` (jobs, rows) at given times."""
    return inputs_at(segments, np.arange(jobs)[:, None], own, times)


def _wave_nodes(segments: Segments, first: float, last: float) -> Array:
    """Times (s) of further rows, on each of which a sine wave is nearly straight; empty without waves."""
    fastest = float(segments.angular_frequency.max(initial=0.0, where=segments.amplitude != 0))
    if not fastest:
        return np.empty(0)
    return np.arange(first, last, 2 * np.pi / fastest / ROWS_PER_PERIOD)[1:]
