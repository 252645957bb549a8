"""Execution of chunks on a Dask cluster: workers compute and store, this process hands out chunk numbers.

The store alone decides which chunks are finished; what scheduler and workers remember does not count.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.maps.store.map_store import Store
from steadyslip.maps.work.chunk import Done, Job, do_chunk, reuse_memory

LOCAL = "local"
PATIENCE = 3  # a run is given up if this many workers die on the same chunk
WAIT = 600.0  # s; a lost scheduler is given up after this time without a finished chunk; restarts take minutes
COUNT = 5.0  # s between counts of the workers, whose number may change
RETRY = 2.0  # s between attempts to connect
CONNECT = 30.0  # s, longest time to wait for a connection; Dask's own default


class _Lost(Exception):
    """Error: the scheduler has lost tasks."""


def run_cluster(
    job: Job, store: Store, chunks: Sequence[int], report: Callable[[Done], None], address: str, workers: int,
    note: Callable[[str], None],
) -> None:  # fmt: skip
    """Compute all chunks on the Dask scheduler at `address`; ``local`` starts a cluster on this machine.

    Raises
    ------
    NotAvailable
        If Dask is not installed, or the scheduler cannot be reached, or is lost for more than `WAIT`.
    """
    try:
        import distributed
    except ImportError as error:
        message = "maps on a cluster need Dask; install it with pip install 'steadyslip[cluster]'"
        raise NotAvailable(message) from error
    lost = (
        _Lost,
        OSError,
        TimeoutError,
        distributed.comm.core.CommClosedError,
        distributed.client.FutureCancelledError,
    )
    left, connected, since = list(chunks), False, time.monotonic()
    while left:
        try:
            with _client(address, min(workers, len(left))) as client:
                connected = True
                for done in _finished_chunks(client, job, left):
                    left.remove(done.number)
                    since = time.monotonic()
                    report(done)
        except lost as error:
            if not connected or address == LOCAL:
                raise NotAvailable(f"no Dask scheduler at {address!r}: {error}") from error
            if time.monotonic() - since > WAIT:
                message = f"the scheduler at {address!r} is lost and has not come back; finished chunks are kept"
                raise NotAvailable(message) from error
            note(f"the scheduler at {address!r} is lost; trying again")
            time.sleep(RETRY)
            pending = set(store.pending())
            for number in [n for n in left if n not in pending]:  # these chunks are finished, but were not reported
                left.remove(number)
                report(Done(number, store.points(number), 0.0))


def _finished_chunks(client: Any, job: Job, chunks: Sequence[int]) -> Iterator[Done]:
    """Yield a report for each chunk as it finishes; at any time two chunks per worker are submitted, not all."""
    from distributed import as_completed

    run = uuid.uuid4().hex[:8]
    waiting = iter(list(chunks))
    deaths: dict[int, int] = {}
    under_way = as_completed(loop=client.loop)
    count, wanted, counted = 0, 2, -COUNT
    numbers: dict[str, int] = {}

    def hand_out(number: int) -> None:
        nonlocal count
        key = f"steadyslip-map-{run}-{number}-{deaths.get(number, 0)}"
        numbers[key] = number
        under_way.add(client.submit(_do_chunk, job, number, key=key, pure=False))
        count += 1

    def fill() -> None:
        nonlocal wanted, counted
        if time.monotonic() - counted > COUNT:  # clusters grow and shrink
            wanted, counted = 2 * max(1, sum(client.nthreads().values())), time.monotonic()
        while count < wanted and (number := next(waiting, None)) is not None:
            hand_out(number)

    fill()
    while count:
        future = next(under_way)
        count -= 1
        number = numbers.pop(future.key)
        if future.status == "finished":
            yield future.result()
        elif future.status == "error":
            error = future.exception()
            deaths[number] = deaths.get(number, 0) + 1
            if type(error).__name__ != "KilledWorker" or deaths[number] == PATIENCE:
                raise NotAvailable(f"chunk {number} failed on the cluster: {error}; finished chunks are kept")
            hand_out(number)
        else:
            raise _Lost(f"chunk {number} was {future.status}")
        fill()


def _do_chunk(job: Job, number: int) -> Done:
    """Compute one chunk in a Dask worker."""
    reuse_memory()
    return do_chunk(job, number)


@contextmanager
def _client(address: str, workers: int) -> Iterator[Any]:
    import dask
    from distributed import Client, LocalCluster

    quiet = [logging.getLogger(name) for name in ("distributed", "distributed.client", "tornado.application")]
    levels = [logger.level for logger in quiet]
    for logger in quiet:
        logger.setLevel(logging.CRITICAL)
    try:
        if address == LOCAL:
            unwatched = {"distributed.worker.profile.enabled": False}  # Dask's profiler costs some percent of the time
            with (
                dask.config.set(unwatched),
                LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.CRITICAL
                ) as cluster,
                Client(cluster, set_as_default=False) as client,
            ):
                yield client
        else:
            try:
                client = Client(address, set_as_default=False, timeout=CONNECT)
            except (ValueError, TypeError) as error:
                message = f"no Dask scheduler at {address!r}: {error}; an address is like tcp://host:8786"
                raise NotAvailable(message) from error
            with client:
                yield client
    finally:
        for logger, level in zip(quiet, levels, strict=True):
            logger.setLevel(level)
