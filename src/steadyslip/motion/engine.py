"""Runs kernels: one trajectory with everything recorded, or many in lanes on all cores."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np

from steadyslip.kernels.driver.interpolate import copy_state
from steadyslip.kernels.driver.places import output_size, point_at, point_size, unknown_at
from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import LOG_COLUMNS, Cursor, Final, Recorded, Row, Setting
from steadyslip.kernels.runner import STATUSES, TALLY, Runner
from steadyslip.motion.jobs import Jobs

LANES = 24  # three vectors of eight doubles, see compiled.kernel
CHUNK = 2048  # jobs per call: keeps the arrays small and Ctrl-C prompt
QUOTA = 20_000  # passes between looks at the clock and at Ctrl-C, some tens of milliseconds
# statuses that no kernel gives
INTERRUPTED, NO_STEADY, ILL_POSED, OUT_OF_RANGE = range(len(STATUSES), len(STATUSES) + 4)


@dataclass
class Outcome:
    """What a kernel leaves behind for some jobs; `log` and `recorded` for a single run only; `tables` it was given.
    `size` is the length of the state, `balances` how many unknowns balances fix.

    ``final``, ``recorded`` and ``samples`` have the columns of `Final`, `Recorded` and `Sampled`.
    """

    status: np.ndarray
    final: np.ndarray
    tally: np.ndarray
    samples: np.ndarray
    log: np.ndarray
    recorded: np.ndarray
    tables: tuple[np.ndarray, ...]
    size: int
    balances: int

    @property
    def steps(self) -> np.ndarray:
        """Taken and refused, (jobs, 2)."""
        return self.final[:, Final.ACCEPTED : Final.POINT]

    @property
    def point(self) -> np.ndarray:
        """Where each ended, (jobs, 1 + state + further unknowns)."""
        return self.final[:, Final.POINT :]

    @property
    def unknowns(self) -> np.ndarray:
        """Those of the balances where each ended, (jobs, unknowns)."""
        own = np.hstack([self.point[:, :1], self.point[:, 1 + self.size :]])
        return np.asarray(own[:, : self.balances])

    @property
    def state(self) -> np.ndarray:
        """Where each ended, (jobs, state)."""
        return self.final[:, Final.STATE : Final.STATE + self.size]


class Call:
    """The arrays of one chain of calls to a kernel."""

    def __init__(self, machine: Runner, tables: tuple[np.ndarray, ...], size: int, times: np.ndarray) -> None:
        layout = self.layout = machine.kernel.layout
        lanes = layout.lanes
        self.advance = machine.code.advance
        self.tables, self.times = tables, times
        if any(len(table) not in (1, size) for table in tables):  # machine code would read what is not there
            raise ValueError(f"tables of {', '.join(str(len(table)) for table in tables)} rows for {size} jobs")
        self.work = np.zeros(layout.rows * lanes)
        self.ids = np.zeros(lanes, dtype=np.int64)
        self.cursor = np.zeros(len(Cursor), dtype=np.int64)
        self.cursor[[Cursor.LAST_JOB, Cursor.BUSY, Cursor.PAUSED]] = size, lanes, -1
        self.status = np.zeros(size, dtype=np.int64)
        self.final = np.full((size, Final.POINT + point_size(layout)), np.nan)
        self.tally = np.full((size, layout.contacts * len(TALLY)), np.nan)
        self.samples = np.full((size, len(times), point_size(layout)), np.nan)
        self.log = np.zeros((0, LOG_COLUMNS))
        self.recorded = np.zeros((0, Recorded.POINT + point_size(layout)))

    def go(self, quota: int) -> int:
        """0 done, 1 a buffer is full, 2 quota used up."""
        found: int = self.advance(
            self.work, self.ids, self.cursor, *self.tables, self.times, self.status, self.final, self.tally,
            self.samples, self.log, self.recorded, quota,
        )  # fmt: skip
        return found

    def time(self) -> float:
        """Time that the job of the only lane has reached, s."""
        return clock(self.work, float(self.work[Row.TAU]))

    def cut_off(self) -> None:
        """Where the job of the only lane is, as its end: it will not go on."""
        layout, y = self.layout, np.empty(output_size(self.layout))
        copy_state(self.work, layout, y)
        self.final[0, : Final.POINT] = [self.time(), *self.work[[Row.SEGMENT, Row.ACCEPTED, Row.REJECTED]]]
        self.final[0, Final.STATE : Final.STATE + layout.size] = y[: layout.size]
        for k in range(max(layout.unknowns, 1)):
            self.final[0, Final.POINT + point_at(layout, k)] = y[unknown_at(layout, k)]

    def outcome(self) -> Outcome:
        self.status[self.status == 0] = INTERRUPTED
        return Outcome(
            self.status, self.final, self.tally, self.samples,
            self.log[: self.cursor[Cursor.LOGGED]], self.recorded[: self.cursor[Cursor.RECORDED]], self.tables,
            self.layout.size, self.layout.unknowns,
        )  # fmt: skip


def run_single(
    jobs: Jobs, machine: Runner, times: np.ndarray, watch: bool, record: bool,
    progress: Callable[[float], None] | None = None,
) -> Outcome:  # fmt: skip
    """One trajectory, with its events and, if asked, its own steps. Ctrl-C ends it early, with what there is."""
    return run_tables(machine, jobs.tables(machine, 0, 1, watch, record), times, progress)


def run_tables(
    machine: Runner, tables: tuple[np.ndarray, ...], times: np.ndarray,
    progress: Callable[[float], None] | None = None,
) -> Outcome:  # fmt: skip
    """`run_single` from the kernel's own arrays; what to watch and record stands in the settings.

    `progress` is told the time reached, in s, now and then.
    """
    settings = tables[2][0]
    call = Call(machine, tables, 1, times)
    if settings[Setting.WATCH]:
        call.log = np.zeros((64, LOG_COLUMNS))
    if settings[Setting.RECORD]:
        call.recorded = np.zeros((512, call.recorded.shape[1]))
    try:
        while (reason := call.go(QUOTA * 10)) != 0:
            if reason == 1:
                call.log = np.concatenate([call.log, np.zeros_like(call.log)])
                call.recorded = np.concatenate([call.recorded, np.zeros_like(call.recorded)])
            if progress is not None:
                progress(call.time())
    except KeyboardInterrupt:
        if call.status[0] == 0:
            call.cut_off()
    return call.outcome()


def run_chunk(
    jobs: Jobs, machine: Runner, start: int, stop: int, times: np.ndarray, watch: bool, stopped: threading.Event
) -> Outcome:
    """Some jobs in lanes, until done or asked to stop."""
    call = Call(machine, jobs.tables(machine, start, stop, watch, False), stop - start, times)
    while call.go(QUOTA) != 0 and not stopped.is_set():
        pass
    return call.outcome()


def run_many(
    work: Callable[[int, int, threading.Event], None],
    size: int,
    threads: int | None = None,
    chunk: int = CHUNK,
    advanced: Callable[[int], None] | None = None,
    lanes: int = LANES,
) -> bool:
    """Do `work` on consecutive chunks of jobs on all cores; False if Ctrl-C ended it early.

    At most two chunks per thread wait at any time, so that memory does not grow with the number of jobs.
    """
    count = threads or available_cores()
    chunk = max(lanes, min(chunk, -(-size // (4 * count))))
    chunk = -(-chunk // lanes) * lanes
    stopped = threading.Event()
    starts = iter(range(0, size, chunk))
    pending: dict[Future[None], int] = {}
    with ThreadPoolExecutor(count) as pool:
        try:
            while True:
                while len(pending) < 2 * count and (start := next(starts, None)) is not None:
                    stop = min(start + chunk, size)
                    pending[pool.submit(work, start, stop, stopped)] = stop - start
                if not pending:
                    return True
                done, _ = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)  # so that Ctrl-C is seen
                for future in done:
                    future.result()
                    if advanced is not None:
                        advanced(pending[future])
                    del pending[future]
        except KeyboardInterrupt:
            stopped.set()
            for future in pending:
                future.cancel()
            return False
        except BaseException:
            stopped.set()
            raise


def available_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
