"""Chunks on the cores of this machine: worker processes that may die without harm."""

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
from steadyslip.maps.work.chunk import Done, Job, do_chunk, keep_memory

PATIENCE = 8  # times that workers may die without a single chunk being finished in between
WATCH = 0.5  # seconds between a worker's looks at whether its driver lives


def run_here(job: Job, chunks: Sequence[int], report: Callable[[Done], None]) -> None:
    """All chunks, one after the other, in this process; Ctrl-C takes effect between them."""
    with interrupts_held() as interrupted:
        for number in chunks:
            done = do_chunk(job, number)
            report(done)
            if interrupted:
                raise KeyboardInterrupt


def run_local(job: Job, chunks: Sequence[int], report: Callable[[Done], None], workers: int) -> None:
    """All chunks on a number of processes; `report` may raise to stop.

    Raises
    ------
    NotAvailable
        If workers die again and again.
    """
    left, deaths = list(chunks), 0
    while left:
        before = len(left)
        try:
            with _workers(min(workers, len(left))) as pool:
                for done in _flow(pool, job, left):
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


def _flow(pool: Any, job: Job, chunks: Sequence[int]) -> Iterator[Done]:
    """Chunks as they are finished; no more are handed out than keep the workers busy."""
    waiting = iter(list(chunks))
    ahead: set[Future[Done]] = set()
    while True:
        while len(ahead) < 2 * pool._max_workers and (number := next(waiting, None)) is not None:
            with _deaf_to_interrupts():
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
    """Processes that need no guard in the caller's script, and take functions typed at a prompt."""
    from loky import ProcessPoolExecutor
    from loky.backend import resource_tracker as loky_tracker

    if hasattr(signal, "pthread_sigmask"):
        for tracker in (resource_tracker, loky_tracker):  # started later, they would let signals through again
            tracker.ensure_running()
    with _deaf_to_interrupts():
        pool = ProcessPoolExecutor(count, initializer=_prepared, initargs=(os.getpid(),))
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=True, kill_workers=True)
        raise
    pool.shutdown(wait=True)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes and threads that begin meanwhile never see Ctrl-C; this one sees it afterwards.

    A worker that it ended while it was starting would leave the pool waiting for it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows: `_prepared` alone
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepared(driver: int) -> None:
    """Set up a worker. Ctrl-C is for the driver, which ends the workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if "fork" in multiprocessing.get_all_start_methods():
        # The lock of the compressor has then no name that a worker ended by force would leave behind.
        multiprocessing.set_start_method("fork", force=True)
    keep_memory()
    threading.Thread(target=_end_with, args=(driver,), daemon=True).start()


def _end_with(driver: int) -> None:
    """End this worker soon after its driver was killed; it would wait for work forever."""
    while os.getppid() == driver:
        time.sleep(WATCH)
    os._exit(1)
