"""Execution of kernels: one trajectory with its steps recorded, or many in lanes on all cores."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from steadyslip.kernels.driver.interpolate import copy_state
from steadyslip.kernels.driver.places import output_size, point_at, point_size, unknown_at
from steadyslip.kernels.driver.segments import clock
from steadyslip.kernels.layout import LOG_COLUMNS, Cursor, Final, Recorded, Row, Setting
from steadyslip.kernels.runner import STATUSES, TALLY, Runner
from steadyslip.motion.jobs import Jobs

LANES = 24  # three vectors of eight doubles (`printers.llvm` fills the processor with several chains)
CHUNK = 2048  # jobs per call of the kernel: keeps arrays small, and Ctrl-C acts promptly; chosen by trial
QUOTA = 20_000  # steps per call of the kernel, some tens of ms; between calls, Ctrl-C and progress are handled
# statuses in addition to those of kernels
INTERRUPTED, NO_STEADY, ILL_POSED, OUT_OF_RANGE = range(len(STATUSES), len(STATUSES) + 4)


@dataclass
class Outcome:
    """Result of a kernel for some jobs.

    `log` and `recorded` are empty except for a single run; `tables` are the arrays with which the kernel was called.
    ``final``, ``recorded`` and ``samples`` have the columns of `Final`, `Recorded` and `Sampled`; `size` is the length
    of the state, `balances` the number of unknowns of the algebraic equations (balances of forces).
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
        """Accepted and rejected steps, (jobs, 2)."""
        return self.final[:, Final.ACCEPTED : Final.POINT]

    @property
    def point(self) -> np.ndarray:
        """Final points, (jobs, 1 + state + further unknowns)."""
        return self.final[:, Final.POINT :]

    @property
    def unknowns(self) -> np.ndarray:
        """Final solutions of the algebraic equations, (jobs, unknowns)."""
        own = np.hstack([self.point[:, :1], self.point[:, 1 + self.size :]])
        return np.asarray(own[:, : self.balances])

    @property
    def state(self) -> np.ndarray:
        """Final states, (jobs, state)."""
        return self.final[:, Final.STATE : Final.STATE + self.size]


class Call:
    """Arrays of a series of calls to a kernel."""

    def __init__(self, machine: Runner, tables: tuple[np.ndarray, ...], size: int, times: np.ndarray) -> None:
        layout = self.layout = machine.kernel.layout
        lanes = layout.lanes
        self.advance = machine.code.advance
        self.tables, self.times = tables, times
        if any(len(table) not in (1, size) for table in tables):  # machine code does not check its bounds
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

    def run_steps(self, quota: int) -> int:
        """Continue for at most `quota` steps; returns 0 if done, 1 if a buffer is full, 2 if the quota is used up."""
        found: int = self.advance(
            self.work, self.ids, self.cursor, *self.tables, self.times, self.status, self.final, self.tally,
            self.samples, self.log, self.recorded, quota,
        )  # fmt: skip
        return found

    def time(self) -> float:
        """Time (s) that the job has reached; for a kernel with a single lane."""
        return clock(self.work, float(self.work[Row.TAU]))

    def store_interrupted(self) -> None:
        """Store the current state as the end of the run after an interruption; for a kernel with a single lane."""
        layout, y = self.layout, np.empty(output_size(self.layout))
        copy_state(self.work, layout, y)
        self.final[0, : Final.POINT] = [self.time(), *self.work[[Row.SEGMENT, Row.ACCEPTED, Row.REJECTED]]]
        self.final[0, Final.STATE : Final.STATE + layout.size] = y[: layout.size]
        for k in range(max(layout.unknowns, 1)):
            self.final[0, Final.POINT + point_at(layout, k)] = y[unknown_at(layout, k)]

    def outcome(self) -> Outcome:
        """Results so far; unfinished jobs have the status `INTERRUPTED`."""
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
    """Outcome of one trajectory, with events (`watch`) and solver steps (`record`); after Ctrl-C, its part so far."""
    return run_tables(machine, jobs.tables(machine, 0, 1, watch, record), times, progress)


def run_tables(
    machine: Runner, tables: tuple[np.ndarray, ...], times: np.ndarray,
    progress: Callable[[float], None] | None = None,
) -> Outcome:  # fmt: skip
    """Outcome of one trajectory from the kernel's arrays, whose settings switch events and recording on.

    `progress` is called between calls of the kernel with the time reached, s.
    """
    settings = tables[2][0]
    call = Call(machine, tables, 1, times)
    if settings[Setting.WATCH]:
        call.log = np.zeros((64, LOG_COLUMNS))
    if settings[Setting.RECORD]:
        call.recorded = np.zeros((512, call.recorded.shape[1]))
    try:
        while (reason := call.run_steps(QUOTA * 10)) != 0:
            if reason == 1:
                call.log = np.concatenate([call.log, np.zeros_like(call.log)])
                call.recorded = np.concatenate([call.recorded, np.zeros_like(call.recorded)])
            if progress is not None:
                progress(call.time())
    except KeyboardInterrupt:
        if call.status[0] == 0:
            call.store_interrupted()
    return call.outcome()


def run_chunk(
    jobs: Jobs, machine: Runner, start: int, stop: int, times: np.ndarray, watch: bool, stopped: threading.Event
) -> Outcome:
    """Outcome of the jobs from `start` to `stop`, integrated in lanes until they are done or `stopped` is set."""
    call = Call(machine, jobs.tables(machine, start, stop, watch, False), stop - start, times)
    while call.run_steps(QUOTA) != 0 and not stopped.is_set():
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
    """Call `work` for consecutive chunks of jobs on all cores; returns False if Ctrl-C ended it early.

    At most two chunks per thread wait at any time, so that memory does not grow with the number of jobs.
    """
    from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait  # slow to import

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
                done, _ = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)  # a timeout lets Ctrl-C through
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
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
