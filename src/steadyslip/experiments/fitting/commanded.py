"""Input tables of the compiled models for commanded loading, in which times and durations of changes may be free."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import InternalError
from steadyslip.experiments.fitting.forward import InputTable
from steadyslip.experiments.loading.loading import Change, Course, Loading, resting_rate

STRAIGHT_TOLERANCE = 5e-4  # largest deviation of straight lines from a curve, as a share of its range; chosen by trial
MAX_PIECES = 30  # largest number of straight lines by which a curve between two samples is approximated
MIN_RAMP = 1e-9  # shortest duration of a ramp, as a share of the record; a step is computed as a ramp this long
NORMAL, PORES = 2, 3  # columns of the inputs: normal stress and pore pressure
SLIDING_SHARE = 1e-3  # duration of steady sliding before an initial rest, as a share of the record; any value would do


class CommandedInputs:
    """Input tables for the loading found in one record, for any values of its free times.

    Parameters
    ----------
    loading : Loading
        Changes of load-point velocity, normal stress and pore pressure found in the record.
    time : ndarray (n,)
        Times of the samples, s.
    pressed : bool
        True if the normal stress of the record drives the model.
    pores : bool
        True if the contact has pores that the pressure reaches by drainage; otherwise pore pressure acts at once.
    lag : bool
        True to shift all changes by one free time.
    given : sequence of int
        Indices in `free` of durations that are fixed in a fit: tables have no derivatives by them.
    """

    def __init__(
        self, loading: Loading, time: Array, pressed: bool, pores: bool = False, lag: bool = False,
        given: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.loading, self.time, self.lag, self.given = loading, time, lag, given
        self.resting = resting_rate(loading)
        self.courses: dict[str, Course] = {}
        if loading.load is not None:
            self.courses["load"] = loading.load
        if pressed and loading.stress is not None:
            self.courses["stress"] = loading.stress
            if loading.pore is not None:
                self.courses["pore"] = loading.pore
        self.inputs = 4 if pores else 3
        self.columns_and_signs = {
            "load": (0, 1.0),
            "stress": (NORMAL, 1.0),
            "pore": (PORES, 1.0) if pores else (NORMAL, -1.0),
        }
        self.changes = [one for one in loading.changes if one[0] in self.courses]
        self.ramps = [(i, ramp) for i, (_, _, change) in enumerate(self.changes) for ramp in change.ramps]
        self.base = {name: float(course.at(time[:1])[0]) for name, course in self.courses.items()} | {"load": 0.0}
        self.times = time - time[0]
        self.nodes = self._nodes()

    def _ramps_of(self, change: int) -> list[int]:
        """Indices in `ramps` of the ramps that belong to the change with index `change`; empty for −1."""
        return [j for j, (i, _) in enumerate(self.ramps) if i == change]

    def _nodes(self) -> Array:
        """Fixed nodes (s) of the input table: both ends, and samples along curves and along ramps of free duration."""
        if any(course.curve is not None for course in self.courses.values()):
            return np.union1d(self.time, self._cuts())
        held = np.zeros(len(self.time), dtype=bool)
        held[[0, -1]] = True
        for _, i, what in self.moved:
            if what == "duration":  # derivatives by a duration are constant on each row of the table
                change = self.changes[i][2]
                held |= (self.time >= change.earliest) & (self.time <= change.latest + change.longest)
        return np.asarray(self.time[held])

    def _cuts(self) -> Array:
        """Additional nodes (s) between samples, where a curve deviates too much from a straight line."""
        found = [np.empty(0)]
        spacing = np.diff(self.time)
        for course in self.courses.values():
            if course.curve is None:
                continue
            ends = course.curve(self.time)
            misses = np.zeros(len(spacing))
            for share in (0.25, 0.5, 0.75):
                straight = ends[:-1] + share * np.diff(ends)
                misses = np.maximum(misses, np.abs(course.curve(self.time[:-1] + share * spacing) - straight))
            least = STRAIGHT_TOLERANCE * max(float(np.ptp(ends)), 1e-300)
            pieces = np.minimum(np.ceil(np.sqrt(misses / least)), MAX_PIECES).astype(int)
            for i in np.flatnonzero(pieces > 1):
                found.append(np.linspace(self.time[i], self.time[i + 1], pieces[i] + 1)[1:-1])
        return np.concatenate(found)

    @cached_property
    def free(self) -> list[tuple[int, str]]:
        """Free times: pairs of a change's index and ``at`` or ``duration``, then of -1 and ``lag`` or ``hold``."""
        found = []
        for i, (_, _, change) in enumerate(self.changes):
            found += [(i, "at")] if change.free else []
            found += [(i, "duration")] if change.stretches else []
        found += [(-1, "lag")] if self.lag else []
        return found + ([(-1, "hold")] if self.resting is not None else [])

    def table_of(self, times: Array, loads: Sequence[Course]) -> InputTable:
        """Input table (loads, ...) for values of the free times (free,) and several courses of the load point.

        The courses may differ only in their levels and in the shares of their ramps.
        """
        return _ManyLoads(self, loads).table(np.tile(times, (len(loads), 1)))

    def table(self, times: Array, first: int = 0, directions: int = 0) -> InputTable:
        """Input table for values of the free times (jobs, free), s; see `MeasuredInputs.table`."""
        if not self.free:
            return self._fixed_table
        return self._table(times, first, directions)

    @cached_property
    def _fixed_table(self) -> InputTable:
        return self._table(np.empty((1, 0)), 0, 0)

    @cached_property
    def moved(self) -> list[tuple[int, int, str]]:
        """Free times by which tables have derivatives: index in `free`, then the two items of the pair in `free`."""
        return [(k, i, what) for k, (i, what) in enumerate(self.free) if k not in self.given]

    @cached_property
    def _times_of_ramps(self) -> Array:
        """Rows (3, ramps): time of the change of each ramp (s), begin of the ramp after this time (s), duration (s)."""
        return (
            np.array([(self.changes[i][2].time, since, length) for i, (since, length, _) in self.ramps])
            .reshape(-1, 3)
            .T
        )

    @cached_property
    def _ending(self) -> Array:
        """Indices of the ramps that have a duration, so that their ends are nodes as well."""
        return np.flatnonzero(self._times_of_ramps[2] > 0)

    @cached_property
    def _moves(self) -> Array:
        """Derivatives (moved, nodes) by free times, of the nodes at the ends of ramps and of a hold."""
        ending = self._ending
        ramps = len(self.ramps) + len(ending)
        found = np.zeros((len(self.moved), ramps + (2 if self.resting is not None else 0)))
        for row, (_, i, what) in zip(found, self.moved, strict=True):
            if what == "lag":
                row[:ramps] = 1.0
            elif what == "hold":
                row[-1] = -1.0
            else:
                own = self._ramps_of(i)
                row[own] = what == "at"
                row[len(self.ramps) + np.flatnonzero(np.isin(ending, own))] = 1.0
        return found

    def _table(self, times: Array, first: int, directions: int) -> InputTable:
        jobs = len(times)
        at, since, lasts = self._times_of_ramps
        begins, lengths = np.tile(at + since, (jobs, 1)), np.tile(lasts, (jobs, 1))
        for k, (i, what) in enumerate(self.free):
            own = self._ramps_of(i)
            if what == "at":
                begins[:, own] = times[:, k : k + 1] + since[own]
            elif what == "duration":
                lengths[:, own] = times[:, k : k + 1]
            elif what == "lag":
                begins = begins + times[:, k : k + 1]
        low, high = float(self.time[0]), float(self.time[-1])
        events = np.hstack([begins, (begins + lengths)[:, self._ending]])
        before = np.empty((jobs, 0))
        if self.resting is not None:  # steady sliding, then a hold until the record begins
            before = low - times[:, -1:] - np.array([[SLIDING_SHARE * (high - low), 0.0]])
        nodes = np.hstack([np.clip(events, low, high), before, np.tile(self.nodes, (jobs, 1))])
        order = np.argsort(nodes, axis=1, kind="stable")  # a step comes before a sample at the same time
        moving = nodes[:, : nodes.shape[1] - len(self.nodes)]
        curves = {channel: self._curve_values(channel, moving, order) for channel in self._curves}
        nodes = np.take_along_axis(nodes, order, axis=1)
        rows = np.zeros((jobs, nodes.shape[1] - 1, 3 + 2 * self.inputs))
        rows[:, :, 0], rows[:, :, 1] = nodes[:, :-1] - low, nodes[:, 1:] - low
        self._fill(rows, nodes, begins, lengths, curves)
        if not directions or not self.moved:
            return InputTable(rows, self.times)
        count = moving.shape[1]
        moves = np.tile(self._moves, (jobs, 1, 1))
        moves[:, :, : events.shape[1]] *= ((events > low) & (events < high))[:, None, :]
        event = order[:, :-1]
        rates = np.zeros((jobs, directions, event.shape[1]))
        job, row = np.nonzero(event < count)
        rates[job, first : first + len(self.moved), row] = moves[job, :, event[job, row]]
        changing = self._input_rates(nodes, begins, lengths, first, directions)
        return InputTable(rows, self.times, rates, changing)

    @cached_property
    def _curves(self) -> dict[str, Array]:
        """Values of the smooth curves at the fixed nodes, by channel."""
        return {name: course.curve(self.nodes) for name, course in self.courses.items() if course.curve is not None}

    def _curve_values(self, channel: str, moving: Array, order: Array) -> Array:
        """Values of a smooth curve at the nodes `moving` (jobs, k) and at the fixed nodes, sorted by `order`."""
        curve = self.courses[channel].curve
        if curve is None:
            raise InternalError(f"the {channel} has no curve")
        fixed = np.tile(self._curves[channel], (len(moving), 1))
        own = curve(moving.ravel()).reshape(moving.shape)
        return np.take_along_axis(np.hstack([own, fixed]), order, axis=1)

    def _fill(self, rows: Array, nodes: Array, begins: Array, lengths: Array, curves: dict[str, Array]) -> None:
        """Set the values and slopes of the inputs on every row of the table."""
        middle = 0.5 * (nodes[:, 1:] + nodes[:, :-1])
        for channel in self.courses:
            before = self._first(channel) - self.base[channel] + np.zeros(middle.shape)
            after = before.copy()
            heights = self._heights(channel)
            for j, (i, (_, ramped, _)) in enumerate(self.ramps):
                if self.changes[i][0] != channel:
                    continue
                begin, length = begins[:, j : j + 1], lengths[:, j : j + 1]
                height = heights[:, j : j + 1]
                if ramped > 0:
                    length = np.maximum(length, MIN_RAMP * np.ptp(self.time))
                    before += height * np.clip((nodes[:, :-1] - begin) / length, 0.0, 1.0)
                    after += height * np.clip((nodes[:, 1:] - begin) / length, 0.0, 1.0)
                else:
                    gone = height * (middle > begin)
                    before += gone
                    after += gone
            if channel == "load" and self.resting is not None:
                before[:, 0] = after[:, 0] = self._rates_before_rest()
            if channel in curves:
                before, after = before + curves[channel][:, :-1], after + curves[channel][:, 1:]
            spacing = nodes[:, 1:] - nodes[:, :-1]
            column, sign = self.columns_and_signs[channel]
            slope = np.where(spacing > 0, (after - before) / np.where(spacing > 0, spacing, 1.0), 0.0)
            rows[:, :, 3 + column] += sign * before
            rows[:, :, 3 + self.inputs + column] += sign * slope

    def _first(self, channel: str) -> Array:
        """First level (jobs or 1, 1) of a channel."""
        return np.array([[self.courses[channel].first]])

    def _heights(self, channel: str) -> Array:
        """Heights (jobs or 1, ramps) of the ramps of a channel; values for ramps of other channels are not used."""
        found = [share * (self.changes[i][2].after - self.changes[i][2].before) for i, (_, _, share) in self.ramps]
        return np.array(found).reshape(1, -1)

    def _rates_before_rest(self) -> Array | float | None:
        """Rate (m/s) before an initial hold: one number, or an array (jobs,); None without a hold."""
        return self.resting

    def _input_rates(self, nodes: Array, begins: Array, lengths: Array, first: int, directions: int) -> Array:
        """Derivatives (jobs, directions, rows, inputs), at fixed time, of the inputs by the free times of ramps."""
        if not any(ramped > 0 for _, (_, ramped, _) in self.ramps):
            return np.zeros((1, 0, 0, self.inputs))
        middle = 0.5 * (nodes[:, 1:] + nodes[:, :-1])
        rates = np.zeros((len(nodes), directions, middle.shape[1], self.inputs))
        for k, (_, place, what) in enumerate(self.moved):
            for j in range(len(self.ramps)) if what == "lag" else self._ramps_of(place):
                i, (_, ramped, part) = self.ramps[j]
                channel, _, change = self.changes[i]
                if not ramped > 0:
                    continue
                begin, length = begins[:, j : j + 1], np.maximum(lengths[:, j : j + 1], MIN_RAMP * np.ptp(self.time))
                share = (middle - begin) / length
                slope = -part * (change.after - change.before) / length * (share if what == "duration" else 1.0)
                column, sign = self.columns_and_signs[channel]
                rates[:, first + k, :, column] += np.where((share > 0) & (share < 1), sign * slope, 0.0)
        return rates


class _ManyLoads(CommandedInputs):
    """Input tables for several courses of the load point, one per job, that differ only in levels and shares."""

    def __init__(self, like: CommandedInputs, loads: Sequence[Course]) -> None:
        self.__dict__.update(vars(like))
        self.loads = loads

    def _first(self, channel: str) -> Array:
        own = super()._first(channel)
        return own if channel != "load" else np.array([[one.first] for one in self.loads])

    def _heights(self, channel: str) -> Array:
        if channel != "load":
            return super()._heights(channel)
        own = [k for k, (of, _, _) in enumerate(self.changes) if of == "load"]
        found = np.zeros((len(self.loads), len(self.ramps)))
        for j, load in enumerate(self.loads):
            for k, change in zip(own, load.changes, strict=True):
                found[j, self._ramps_of(k)] = [share * (change.after - change.before) for _, _, share in change.ramps]
        return found

    def _rates_before_rest(self) -> Array | float | None:
        if self.resting is None:
            return None
        return np.array([next(level for level in one.levels.tolist() if level > 0) for one in self.loads])


def time_windows(changes: list[tuple[str, int, Change]]) -> list[tuple[float, float, float]]:
    """Starting value, smallest value and largest value (s) of each free time or duration of the changes."""
    found = []
    for _, _, change in changes:
        if change.free:
            found.append((change.time, change.earliest, change.latest))
        if change.stretches:
            found.append((change.duration, change.shortest, change.longest))
    return found
