"""Ensembles: runs of variants of a rig in lanes, on all cores."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Any, TypeVar

import numpy as np

from steadyslip.core.arrays import BroadcastArrays, broadcast
from steadyslip.core.errors import InternalError, ParameterError, Problem, UnknownNameError, unknown_name
from steadyslip.core.names import resolve
from steadyslip.core.options import DURATION, TIMES, checked
from steadyslip.core.progress import progress_bar
from steadyslip.core.records import parameters
from steadyslip.core.results import ReadOnly, read_only
from steadyslip.core.version import version
from steadyslip.kernels.layout import Final, Sampled
from steadyslip.kernels.runner import STATUSES, TALLY
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.delay_order import finer_order
from steadyslip.motion.engine import (
    ILL_POSED,
    INTERRUPTED,
    LANES,
    NO_STEADY,
    OUT_OF_RANGE,
    Outcome,
    run_chunk,
    run_many,
)
from steadyslip.motion.jobs import Jobs, Options, prepare
from steadyslip.motion.late_check import LATE_TOLERANCE, late_errors
from steadyslip.motion.observe import observable_units, observe, out_of_range
from steadyslip.motion.single import areas, checked_times
from steadyslip.motion.status import UNRESOLVED, WORDS
from steadyslip.protocol import Protocol
from steadyslip.protocol.inputs import segment_of

DONE, NOT_RESOLVED = STATUSES.index("done"), WORDS.index(UNRESOLVED)
_UNITS = ("1", "m/s", "m/s", "s", "s", "m", "Pa", "m/s", "s", "1", "Hz", "s", "s", "1")
EVENT_UNITS = {name: unit for name, unit in zip_longest(TALLY, _UNITS, fillvalue="1") if name}
R = TypeVar("R", bound=Rig)


def event_unit(name: str) -> str:
    """Unit of a column of `Ensemble.events`."""
    plain = name.rpartition(".")[2]
    return "N" if plain == "event_force_drop" else EVENT_UNITS[plain]


def event_names(rig: Rig) -> tuple[str, ...]:
    """Names of the columns of `Ensemble.events`; a machine has them for each contact, with its name as prefix."""
    if not rig.contact_names:
        return tuple(EVENT_UNITS)
    return tuple(f"{contact}.{_contact_column(name)}" for contact in rig.contact_names for name in EVENT_UNITS)


NORMAL_FORCE = ".normal_force"


def _contact_column(name: str) -> str:
    """Name that a column has for a contact of a machine, where stresses become forces."""
    return name.replace("stress_drop", "force_drop")


@dataclass(frozen=True, eq=False)
class Ensemble(ReadOnly):
    """Results of many runs; every array has the broadcast shape of what was varied.

    Attributes
    ----------
    status_code : ndarray of int
    end : ndarray
        Time reached, s.
    steps, rejected : ndarray of int
    final : dict of str to ndarray
        Observables at the end, SI units.
    events : dict of str to ndarray
        Per run: number of complete slip events (see `SlipEvent`), highest and lowest velocity; begin, duration, slip,
        stress drop, peak velocity, recurrence, rings and ring frequency of the last complete event; number of arrests
        and velocity peaks, time of the last peak, period between the last two, growth of |ln(peak velocity/drive)|
        between them. Without events, duration, slip, stress drop and rings are 0, times and velocities NaN. Empty with
        ``events=False``. For a machine, these for each contact, prefixed with its name, and force drop (N) in place of
        stress drop.
    samples : dict of str to ndarray
        Observables at `times`, which is the last axis; NaN after the end of a run.
    times : ndarray
    units : dict of str to str
    """

    status_code: np.ndarray
    end: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray
    final: dict[str, np.ndarray] = field(repr=False)
    events: dict[str, np.ndarray] = field(repr=False)
    samples: dict[str, np.ndarray] = field(repr=False)
    times: np.ndarray = field(repr=False)
    units: dict[str, str] = field(repr=False)
    _dims: tuple[str, ...] = field(default=(), repr=False)
    _coords: Any = field(default=None, repr=False)

    @property
    def status(self) -> np.ndarray:
        """Status of each run, in words."""
        return np.asarray(read_only(np.array(WORDS)[self.status_code]))

    @property
    def shape(self) -> tuple[int, ...]:
        return self.status_code.shape

    @property
    def contact(self) -> np.ndarray:
        """Contact of a machine that lifted off, for runs with status ``contact lost``; empty for others.

        Empty for all runs if normal forces are not among the observables.
        """
        lost = self.status_code == WORDS.index("contact lost")
        names = [name.removesuffix(NORMAL_FORCE) for name in self.final if name.endswith(NORMAL_FORCE)]
        found = np.full(self.shape, "", dtype=object)
        if names and np.any(lost):
            forces = np.stack([self.final[name + NORMAL_FORCE] for name in names])
            found[lost] = np.asarray(np.take(names, np.argmin(forces, axis=0)), dtype=object)[lost]
        return np.asarray(read_only(found.astype(str)))

    def summary(self) -> str:
        """Numbers of runs by status."""
        codes, counts = np.unique(self.status_code, return_counts=True)
        parts = [f"{count} {WORDS[code]}{self._lifted(code)}" for code, count in zip(codes, counts, strict=True)]
        return f"{self.status_code.size} runs: " + ", ".join(parts)

    def _lifted(self, code: int) -> str:
        """Text of the contacts that lifted off in runs with the status `code`, with the number of runs for each."""
        names, counts = np.unique(self.contact[self.status_code == code], return_counts=True)
        parts = [f"{name} {count}" for name, count in zip(names, counts, strict=True) if name]
        return f" ({', '.join(parts)})" if parts else ""

    def __str__(self) -> str:
        return self.summary()

    def to_xarray(self) -> Any:
        """xarray.Dataset; axes are named as those of the DataArrays that were varied, or dim_0, dim_1, ..."""
        import xarray as xr

        dims = self._dims or tuple(f"dim_{i}" for i in range(len(self.shape)))
        variables: dict[str, Any] = {
            "status": (dims, self.status),
            "end": (dims, self.end, {"units": "s"}),
            "steps": (dims, self.steps),
            "rejected": (dims, self.rejected),
        }
        if np.any(self.contact != ""):
            variables["contact"] = (dims, self.contact)
        variables |= {f"final_{n}": (dims, a, {"units": self.units[n]}) for n, a in self.final.items()}
        variables |= {f"event_{n}": (dims, a, {"units": event_unit(n)}) for n, a in self.events.items()}
        variables |= {n: ((*dims, "time"), a, {"units": self.units[n]}) for n, a in self.samples.items()}
        coords = dict(self._coords or {})
        if len(self.times):
            coords["time"] = ("time", self.times, {"units": "s"})
        return xr.Dataset(variables, coords=coords, attrs={"steadyslip": version()})


@checked(until=DURATION, times=TIMES)
def simulate_many(
    rig: Slider | Machine,
    vary: Mapping[str, Any],
    protocol: Any = None,
    *,
    until: float | str | None = None,
    initial: Mapping[str, Any] | None = None,
    times: Any = None,
    observables: Sequence[str] | None = None,
    events: bool = True,
    method: str = "auto",
    rtol: float = 1e-7,
    most_steps: int = 1_000_000,
    arrest: float = 1e-3,
    threads: int | None = None,
    progress: bool | None = None,
    branch: int = 0,
) -> Ensemble:
    """Motions of many variants of a rig, integrated in parallel.

    Results do not depend on the number of threads or on the other runs. They agree with `simulate` within its
    tolerance; step sizes are rounded differently, so that a few steps may differ.

    Parameters
    ----------
    rig : Slider or Machine
    vary : mapping of str to array_like or xarray.DataArray
        Parameters by dotted name, in SI units: of the rig, or of the protocol as ``protocol.pieces.1.to``.
        Arrays broadcast against each other.
    protocol, until, method, rtol, most_steps, arrest, branch
        As in `simulate`.
    initial : mapping of str to array_like, optional
        Starting values as in `simulate`; arrays broadcast with those of `vary`.
    times : array_like, optional
        Times at which to sample, s.
    observables : sequence of str, optional
        Observables to keep in `final` and `samples`; by default all.
    events : bool, optional
        True to compute event statistics; without them runs take some tenths less time.
    threads : int, optional
        Number of threads; by default all cores.
    progress : bool, optional
        True to show a progress bar; by default on a terminal, for work of more than a second or two.

    Returns
    -------
    Ensemble
        After Ctrl-C, unfinished runs have the status ``interrupted``.

    Raises
    ------
    ParameterError
        If any argument is wrong; lists every problem.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["stiffness=40 GPa/m"])
    >>> step = ss.protocol.VelocityStep(at="10 s", to="2 um/s")
    >>> print(ss.simulate_many(rig, {"stiffness": [20e9, 40e9]}, step, until=200))
    2 runs: 1 done, 1 blow-up
    """
    options = Options(method, rtol, most_steps, arrest)
    flat, start, together = broadcast_arrays(rig, Protocol.of(protocol), vary, initial or {})
    shape = together.shape
    size = int(np.prod(shape, dtype=int))
    store: _Store | None = None
    groups = list(regimes(rig, flat, size))
    with progress_bar(size, progress) as advanced:
        for group_rig, chosen, index in groups:
            part = {name: _at(a, index) for name, a in chosen.items()}
            begin = {name: _at(a, index) for name, a in start.items()}
            jobs = prepare(group_rig, protocol, until, part, begin, options, branch)
            requested = checked_times(times, float(jobs.segments.end.max()))
            if store is None:
                store = _Store(jobs, size, requested, observables, events)
            count = size if index is None else len(index)
            if not _run(jobs, store, index, count, requested, threads, advanced):
                break
            if jobs.late_order:
                own = replace(options, order=finer_order(jobs.late_order))
                finer = prepare(group_rig, protocol, until, part, begin, own, branch)
                if not store.check_late(finer, index, count, requested, threads):
                    break
    if store is None:
        raise InternalError("an ensemble has no runs; this is a bug, please report it")
    return store.result(shape, together.dims or (), together.coords)


def broadcast_arrays(
    rig: Slider | Machine, plan: Protocol, vary: Mapping[str, Any], initial: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any], BroadcastArrays]:
    """Flat arrays of equal length of parameters (by full name) and of initial values, and their broadcast shape."""
    known = dict.fromkeys([*rig.parameters(), *parameters(plan, "protocol.")])
    problems, named = [], {}
    for name, value in vary.items():
        try:
            full = resolve(name, known)
            own = full in rig.parameters() and not isinstance(value, str)
            named[full] = rig.read(full, value) if own else value
        except UnknownNameError as error:
            problems.append(Problem(name, str(error)))
        except ParameterError as error:
            problems += error.problems
    named |= {f"initial.{name}": value for name, value in initial.items()}
    try:
        together = broadcast(named)
    except ParameterError as error:
        problems += error.problems
    if problems:
        raise ParameterError(problems)
    flat = together.flat()
    start = {name.removeprefix("initial."): flat.pop(name) for name in list(flat) if name.startswith("initial.")}
    return flat, start, together


def _at(array: Any, index: np.ndarray | None) -> Any:
    return array[index] if index is not None and np.ndim(array) else array


def regimes(rig: R, flat: dict[str, Any], size: int) -> Iterator[tuple[R, dict[str, Any], np.ndarray | None]]:
    """Yield groups of runs with equal equations: rig, parameters and indices (None for all).

    Equations differ between runs in which different structural parameters (mass, B0, ...) are zero.
    """
    structural = [
        name
        for name, value in flat.items()
        if not name.startswith("protocol.")
        and rig.parameters()[name].role.structural
        and not isinstance(value, str)
        and np.any(np.asarray(value) == 0)
    ]
    if not structural:
        yield rig, flat, None
        return
    zero = np.column_stack([np.broadcast_to(np.asarray(flat[name]) == 0, (size,)) for name in structural])
    patterns, member = np.unique(zero, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        absent = [name for name, is_zero in zip(structural, pattern, strict=True) if is_zero]
        rest = {name: value for name, value in flat.items() if name not in absent}
        yield rig.with_values(dict.fromkeys(absent, 0.0)), rest, np.flatnonzero(member.reshape(-1) == number)


def _columns(model: Model) -> dict[str, tuple[int, int, bool]]:
    """Columns of the event statistics by name: (column, contact, True for a force in place of a stress)."""
    found: dict[str, tuple[int, int, bool]] = {}
    for i, contact in enumerate(model.contacts):
        for k, name in enumerate(TALLY):
            if name and contact.name:
                own = _contact_column(name)
                found[f"{contact.name}.{own}"] = (i * len(TALLY) + k, i, own != name)
            elif name:
                found[name] = (k, 0, False)
    return found


class _Store:
    """Arrays that collect the results of all runs."""

    def __init__(
        self, jobs: Jobs, size: int, times: np.ndarray, observables: Sequence[str] | None, events: bool
    ) -> None:
        self.units = observable_units(jobs.point.model, jobs.targets)
        wanted = list(self.units) if observables is None else list(observables)
        problems = [
            Problem("observables", unknown_name("observable", name, self.units))
            for name in wanted
            if name not in self.units
        ]
        if problems:
            raise ParameterError(problems)
        self.watch, self.keeps_events, self.times = events or jobs.late_order > 0, events, times
        self.code = np.full(size, INTERRUPTED, dtype=np.int8)
        self.end = np.full(size, np.nan)
        self.steps = np.zeros(size, dtype=np.int64)
        self.rejected = np.zeros(size, dtype=np.int64)
        self.final: dict[str, np.ndarray] = {name: np.full(size, np.nan) for name in wanted}
        self.columns = _columns(jobs.point.model) if self.watch else {}
        self.events = {name: np.full(size, np.nan) for name in self.columns}
        self.samples: dict[str, np.ndarray] = {}
        if len(times):
            self.samples = {name: np.full((size, len(times)), np.nan) for name in wanted}

    def put(self, where: Any, jobs: Jobs, machine: Any, first: int, outcome: Outcome) -> None:
        """Store the results of a chunk of runs."""
        own = jobs.point.part(slice(first, first + len(outcome.status)))
        absent = np.broadcast_to(~np.asarray(own.exists), outcome.status.shape)
        posed = jobs.posed[first : first + len(outcome.status)] if len(jobs.posed) > 1 else jobs.posed
        known = jobs.in_range[first : first + len(outcome.status)] if len(jobs.in_range) > 1 else jobs.in_range
        ended = np.where(absent, NO_STEADY, np.where(posed, outcome.status, ILL_POSED))
        self.code[where] = np.where(known, ended, OUT_OF_RANGE)
        self.end[where] = np.where(absent, np.nan, outcome.final[:, Final.TIME])
        counts = np.nan_to_num(outcome.steps)  # the number of steps is NaN for runs that were not finished
        self.steps[where], self.rejected[where] = counts.T
        for name, (column, contact, force) in self.columns.items():
            area = own.evaluate(areas(own.model))[contact] if force else 1.0
            self.events[name][where] = np.where(absent, np.nan, area * outcome.tally[:, column])
        if not self.final:
            return
        ran = np.flatnonzero(np.isfinite(outcome.state).all(axis=1) & ~absent)
        final = outcome.final[ran]
        segment, time = final[:, Final.SEGMENT].astype(int), final[:, Final.TIME]
        found = observe(jobs, machine, first, ran, segment, time, outcome.point[ran], outcome.tables)
        rows = np.arange(len(self.code))[where]
        self._mark_out_of_range(rows[ran], time, out_of_range(found))
        for name, array in self.final.items():
            if name in found:
                array[rows[ran]] = found[name]
        if self.samples:
            lane, k = np.nonzero(np.isfinite(outcome.samples[:, :, Sampled.STATE]) & ~absent[:, None])
            segment = segment_of(jobs.segments, first + lane, self.times[k])
            found = observe(
                jobs, machine, first, lane, segment, self.times[k], outcome.samples[lane, k], outcome.tables
            )
            self._mark_out_of_range(rows[lane], self.times[k], out_of_range(found))
            for name, array in self.samples.items():
                if name in found:
                    array[rows[lane], k] = found[name]

    def _mark_out_of_range(self, rows: np.ndarray, time: np.ndarray, bad: np.ndarray) -> None:
        """Mark finished runs with infinite or NaN observables as out of range."""
        bad &= np.isin(self.code[rows], (DONE, OUT_OF_RANGE))
        self.code[rows[bad]] = OUT_OF_RANGE
        np.minimum.at(self.end, rows[bad], time[bad])

    def check_late(
        self, jobs: Jobs, index: np.ndarray | None, size: int, times: np.ndarray, threads: int | None
    ) -> bool:
        """Repeat runs with more variables for delayed signals, and mark the runs that differ; False after Ctrl-C."""
        finer = _Store(jobs, len(self.code), times, (), True)
        if not _run(jobs, finer, index, size, times, threads, None):
            return False
        where = slice(None) if index is None else index
        apart = late_errors(self.events, finer.events)[where] > LATE_TOLERANCE
        ran = (self.code[where] == DONE) | (finer.code[where] == DONE)
        unlike = ran & (apart | (self.code[where] != finer.code[where]))
        self.code[where] = np.where(unlike, NOT_RESOLVED, self.code[where])
        return True

    def result(self, shape: tuple[int, ...], dims: tuple[str, ...], coords: Any) -> Ensemble:
        def shaped(array: np.ndarray) -> np.ndarray:
            return array.reshape(shape + array.shape[1:])

        return Ensemble(
            shaped(self.code), shaped(self.end), shaped(self.steps), shaped(self.rejected),
            {n: shaped(a) for n, a in self.final.items()},
            {n: shaped(a) for n, a in self.events.items() if self.keeps_events},
            {n: shaped(a) for n, a in self.samples.items()}, self.times, self.units, dims, coords,
        )  # fmt: skip


def _run(
    jobs: Jobs, store: _Store, index: np.ndarray | None, size: int, times: np.ndarray, threads: int | None,
    advanced: Callable[[int], None] | None,
) -> bool:  # fmt: skip
    """Integrate jobs in chunks and store their results; False if Ctrl-C ended it early."""
    machine = jobs.runner(LANES, dense=store.watch or len(times) > 0)
    lock = threading.Lock()

    def work(start: int, stop: int, stopped: threading.Event) -> None:
        outcome = run_chunk(jobs, machine, start, stop, times, store.watch, stopped)
        where = slice(start, stop) if index is None else index[start:stop]
        with lock:
            store.put(where, jobs, machine, start, outcome)

    _ = machine.code.advance  # compile before the threads start
    return run_many(work, size, threads, advanced=advanced)
