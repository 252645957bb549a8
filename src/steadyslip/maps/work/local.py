"""Execution of chunks on the cores of this machine, by processes that are replaced if they die."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.core.progress import interrupts_held
from steadyslip.maps.work.chunk import Done, Job, do_chunk, reuse_memory

PATIENCE = 8  # a run is given up if so many worker pools in a row die without a finished chunk; chosen by trial
WATCH = 0.5  # s, time between a worker's checks that its parent is alive


def run_here(job: Job, chunks: Sequence[int], report: Callable[[Done], None]) -> None:
    """Compute all chunks one after the other in this process; Ctrl-C takes effect between chunks."""
    with interrupts_held() as interrupted:
        for number in chunks:
            done = do_chunk(job, number)
            report(done)
            if interrupted:
                raise KeyboardInterrupt


def run_local(job: Job, chunks: Sequence[int], report: Callable[[Done], None], workers: int) -> None:
    """Compute all chunks on several processes; `report` is called for each and may raise an exception to stop.

    Raises
    ------
    NotAvailable
        If workers die repeatedly.
    """
    left, deaths = list(chunks), 0
    while left:
        before = len(left)
        try:
            with _workers(min(workers, len(left))) as pool:
                for done in _finished_chunks(pool, job, left):
                    left.remove(done.number)
                    report(done)
        except BrokenProcessPool as error:
            deaths = deaths + 1 if len(left) == before else 0
            if deaths == PATIENCE:
                message = (
                    f"worker processes die on chunks {', '.join(map(str, sorted(left)[:workers]))}: killed, or out of "
                    "memory. Finished chunks are kept; try fewer workers, or another map with a smaller chunk"
                )
                raise NotAvailable(message) from error


def _finished_chunks(pool: Any, job: Job, chunks: Sequence[int]) -> Iterator[Done]:
    """Yield a report for each chunk as it finishes; at any time two chunks per worker are submitted."""
    waiting = iter(list(chunks))
    ahead: set[Future[Done]] = set()
    while True:
        while len(ahead) < 2 * pool._max_workers and (number := next(waiting, None)) is not None:
            with _interrupts_blocked():
                ahead.add(pool.submit(do_chunk, job, number))
        if not ahead:
            return
        finished, ahead = wait(ahead, return_when=FIRST_COMPLETED)
        broken = None
        for future in finished:
            if (error := future.exception()) is not None:
                broken = error
                continue
            yield future.result()
        if broken is not None:
            raise broken


@contextmanager
def _workers(count: int) -> Iterator[Any]:
    """Pool of processes that needs no main guard in the caller's script, and accepts functions typed at a prompt."""
    from loky import ProcessPoolExecutor
    from loky.backend import resource_tracker as loky_tracker

    if hasattr(signal, "pthread_sigmask"):
        for tracker in (resource_tracker, loky_tracker):  # started later, these processes would unblock SIGINT
            tracker.ensure_running()
    with _interrupts_blocked():
        pool = ProcessPoolExecutor(count, initializer=_set_up_worker, initargs=(os.getpid(),))
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=True, kill_workers=True)
        raise
    pool.shutdown(wait=True)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Context in which new processes and threads start with Ctrl-C blocked; this process receives it at the end.

    A worker killed by Ctrl-C while it starts would leave the pool waiting for it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows: workers ignore Ctrl-C only after `_set_up_worker` has run
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _set_up_worker(driver: int) -> None:
    """Set up a worker: Ctrl-C is left to the parent, which ends the workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if "fork" in multiprocessing.get_all_start_methods():
        # without fork the compressor would use a named lock, which a killed worker would leave in the system
        multiprocessing.set_start_method("fork", force=True)
    reuse_memory()
    threading.Thread(target=_exit_with_parent, args=(driver,), daemon=True).start()


def _exit_with_parent(driver: int) -> None:
    """End this worker soon after its parent has been killed; otherwise it would wait for work forever."""
    while os.getppid() == driver:
        time.sleep(WATCH)
    os._exit(1)
