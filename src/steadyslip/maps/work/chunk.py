"""One chunk of a map: read which points, compute, write, mark. What every worker does, on any engine."""

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
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.axes import Generated
from steadyslip.maps.plan.map import AnyMeasure, Map, evaluate
from steadyslip.maps.store.arrays import Store, cannot_write
from steadyslip.protocol import Protocol


@dataclass(frozen=True)
class Job:
    """What a worker has to know; small, since it is sent with every chunk.

    Attributes
    ----------
    path : str
        Of the store, the same on all machines. Coordinates are read from there.
    version : str
        Of the package that made the job.
    """

    path: str
    rig: Slider | Machine
    protocol: Protocol
    compute: tuple[AnyMeasure, ...]
    sampling: Generated | None
    version: str


@dataclass(frozen=True)
class Done:
    """What a worker says of a chunk.

    Attributes
    ----------
    number, points : int
    seconds : float
        That it took, 0 if it was done already.
    problem : str
        Why it could not be done; empty otherwise.
    """

    number: int
    points: int
    seconds: float = field(compare=False)
    problem: str = ""


def job_of(plan: Map, path: Path) -> Job:
    """The job of a map that is kept at `path`."""
    from steadyslip import __version__

    sampling = plan.sampling if isinstance(plan.sampling, Generated) else None
    return Job(str(path.absolute()), plan.rig, plan.protocol, tuple(plan.compute), sampling, __version__)


def do_chunk(job: Job, number: int) -> Done:
    """Compute and write one chunk, unless it is there already.

    Failures come back as `Done.problem`: exceptions lose their text on the way through some engines.
    """
    from steadyslip import __version__

    began = time.perf_counter()
    try:
        if job.version != __version__:
            message = f"this worker has steadyslip {__version__}, the map was started with {job.version}"
            return Done(number, 0, 0.0, message)
        if not Path(job.path).exists():
            message = f"a worker does not see {job.path!r}; give a folder that all machines share"
            return Done(number, 0, 0.0, message)
        store = _opened(job.path, _stamp(job.path))
        points = store.points(number)
        if store.is_done(number):  # by a worker that was thought lost
            return Done(number, points, 0.0)
        region = store.region(number)
        vary = store.parameters(region)
        samples: dict[str, Any] = {}
        if job.sampling is not None:
            samples = job.sampling.part(region[-1].start, region[-1].stop)
            vary |= samples
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", OutOfRangeWarning)  # the map's text says of what its points have none
            results = evaluate(job.rig, job.protocol, job.compute, vary)
        store.write(number, results, samples)
    except OSError as error:
        return Done(number, 0, 0.0, str(cannot_write(Path(job.path), error)))
    except SteadyslipError as error:
        return Done(number, 0, 0.0, str(error))
    except Exception as error:  # of a measure that is not ours
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{place.name}, line {place.lineno} of {Path(place.filename).name}"
        return Done(number, 0, 0.0, f"chunk {number} failed with {type(error).__name__}: {error} (in {where})")
    return Done(number, points, time.perf_counter() - began)


@lru_cache(maxsize=1)
def keep_memory() -> None:
    """Have a worker process reuse the memory of arrays instead of handing it back after each of them.

    Kernels make and drop arrays of some 100 kB all the time. Dask starts its workers with a setting of the GNU C
    library that returns such blocks to the system at once, which makes them half as fast; here that is undone.
    """
    if platform.libc_ver()[0] != "glibc":
        return
    with suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(_TRIM_THRESHOLD, 2**28)
        library.mallopt(_MMAP_THRESHOLD, 2**25)


_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of malloc.h


@lru_cache(maxsize=4)
def _opened(path: str, stamp: tuple[int, int]) -> Store:
    """A store that stays open from chunk to chunk, until another one takes its place."""
    return Store(Path(path))


def _stamp(path: str) -> tuple[int, int]:
    found = (Path(path) / "zarr.json").stat()
    return found.st_ino, found.st_mtime_ns
