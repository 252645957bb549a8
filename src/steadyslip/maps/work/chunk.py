"""Computation of one chunk of a map, by any worker: read its parameters, compute, store, mark as done."""

from __future__ import annotations

import ctypes
import platform
import time
import traceback
import warnings
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import OutOfRangeWarning, SteadyslipError
from steadyslip.core.version import version
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.axes import Generated
from steadyslip.maps.plan.map import AnyMeasure, Map, evaluate
from steadyslip.maps.store.map_store import Store, cannot_write
from steadyslip.protocol import Protocol


@dataclass(frozen=True)
class Job:
    """Description of a map for workers; small, because it is sent with every chunk.

    Attributes
    ----------
    path : str
        Path of the store, valid on all machines; coordinates are read from there.
    version : str
        Version of the package that made the job.
    """

    path: str
    rig: Slider | Machine
    protocol: Protocol
    compute: tuple[AnyMeasure, ...]
    sampling: Generated | None
    version: str


@dataclass(frozen=True)
class Done:
    """Report of a worker about a chunk.

    Attributes
    ----------
    number, points : int
        Number of the chunk, and its number of points.
    seconds : float
        Time taken (s); 0 if the chunk was done already.
    problem : str
        Reason why the chunk could not be computed; empty if it was.
    """

    number: int
    points: int
    seconds: float = field(compare=False)
    problem: str = ""


def job_of(plan: Map, path: Path) -> Job:
    """Job for a map stored at `path`."""
    sampling = plan.sampling if isinstance(plan.sampling, Generated) else None
    return Job(str(path.absolute()), plan.rig, plan.protocol, tuple(plan.compute), sampling, version())


def do_chunk(job: Job, number: int) -> Done:
    """Compute and store one chunk, unless it is done already.

    Errors are returned as `Done.problem`, because some kinds of workers lose the text of exceptions.
    """
    began = time.perf_counter()
    try:
        if job.version != version():
            message = f"this worker has steadyslip {version()}, the map was started with {job.version}"
            return Done(number, 0, 0.0, message)
        if not Path(job.path).exists():
            message = f"a worker cannot find {job.path!r}; give a folder that all machines share"
            return Done(number, 0, 0.0, message)
        store = _open_store(job.path, _stamp(job.path))
        points = store.points(number)
        if store.is_done(number):  # a worker that was believed to be lost has computed the chunk
            return Done(number, points, 0.0)
        region = store.region(number)
        vary = store.parameters(region)
        samples: dict[str, Any] = {}
        if job.sampling is not None:
            samples = job.sampling.part(region[-1].start, region[-1].stop)
            vary |= samples
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", OutOfRangeWarning)  # the summary of the map counts points out of range
            results = evaluate(job.rig, job.protocol, job.compute, vary)
        store.write(number, results, samples)
    except OSError as error:
        return Done(number, 0, 0.0, str(cannot_write(Path(job.path), error)))
    except SteadyslipError as error:
        return Done(number, 0, 0.0, str(error))
    except Exception as error:  # a user's measure may raise anything
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{place.name}, line {place.lineno} of {Path(place.filename).name}"
        return Done(number, 0, 0.0, f"chunk {number} failed with {type(error).__name__}: {error} (in {where})")
    return Done(number, points, time.perf_counter() - began)


@lru_cache(maxsize=1)
def reuse_memory() -> None:
    """Make a worker process reuse the memory of arrays instead of returning it to the system.

    Kernels constantly allocate and free arrays of some 100 kB. Dask makes the GNU C library of its workers return freed
    blocks at once, which doubles the time; this restores the default behaviour.
    """
    if platform.libc_ver()[0] != "glibc":
        return
    with suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(_TRIM_THRESHOLD, 2**28)  # bytes: far more than the arrays of a chunk
        library.mallopt(_MMAP_THRESHOLD, 2**25)  # bytes: the largest that the library accepts


_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # M_TRIM_THRESHOLD, M_MMAP_THRESHOLD of malloc.h


@lru_cache(maxsize=4)
def _open_store(path: str, stamp: tuple[int, int]) -> Store:
    """Opened store, cached between chunks; `stamp` changes if another store replaces the one at `path`."""
    return Store(Path(path))


def _stamp(path: str) -> tuple[int, int]:
    found = (Path(path) / "zarr.json").stat()
    return found.st_ino, found.st_mtime_ns
