"""Computation of a map: create or open its store, and compute the missing chunks."""

from __future__ import annotations

import re
import shutil
import sys
from os import PathLike
from pathlib import Path

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.progress import progress_bar
from steadyslip.maps.plan.map import Map
from steadyslip.maps.store.map_store import Store, cannot_write, check_path, open_or_create
from steadyslip.maps.store.store_layout import versions
from steadyslip.maps.view.map_result import MapResult
from steadyslip.maps.work.chunk import Done, job_of
from steadyslip.maps.work.cluster import run_cluster
from steadyslip.maps.work.local import run_here, run_local
from steadyslip.motion.engine import available_cores

SHORT = 2.0  # s; less work than this is done in this process, because further processes take a second to start


@checked()
def run_map(
    plan: Map,
    path: str | PathLike[str],
    *,
    workers: int | None = None,
    cluster: str | None = None,
    progress: bool | None = None,
) -> MapResult:
    """Compute a map, or the missing part of it.

    Each finished chunk is stored with a checksum. After Ctrl-C, a kill or a power failure the same call continues;
    damaged chunks are detected and computed again.

    Parameters
    ----------
    plan : Map
    path : path
        Folder ending in ``.zarr``, created if missing.
    workers : int, optional
        Number of processes; by default one per core, or only the calling process for short work.
    cluster : str, optional
        Compute on Dask: address of a scheduler such as ``tcp://host:8786``, or ``local`` for workers on this machine.
        All workers must have access to `path` and have this package.
    progress : bool, optional
        True to show a progress bar; by default on a terminal.

    Returns
    -------
    MapResult
        After Ctrl-C it is incomplete.

    Raises
    ------
    NotAvailable
        If the path holds another map or something else, or cannot be written; if a chunk fails. Finished chunks are
        kept.
    ParameterError
        If an argument is wrong.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> plan = ss.Map(rig, {"stiffness": [10e9, 40e9]}, ["status"])
    >>> print(ss.run_map(plan, "two.zarr"))
    map of status over slider.stiffness (2): 2 points
      in two.zarr             complete
      status                  stable 50 %, unstable 50 %
    """
    target = Path(path)
    _check(cluster)
    check_path(target)
    try:
        return _compute_missing(plan, open_or_create(target, plan), workers, cluster, progress)
    except OSError as error:
        raise cannot_write(target, error) from error


def _compute_missing(
    plan: Map, store: Store, workers: int | None, cluster: str | None, progress: bool | None
) -> MapResult:
    """Compute the missing and damaged chunks of a store; returns the map."""
    with store.locked():
        store.restore(plan)
        _note_differences(store, plan)
        for number in store.damaged():
            store.forget(number)
        missing = store.pending()
        if missing:
            _check_space(store)
            _compute(plan, store, missing, workers, cluster, progress)
        if store.marked() == store.count:
            store.tidy()
    return MapResult(store)


def _check(cluster: str | None) -> None:
    if cluster is not None and not (cluster == "local" or re.fullmatch(r"\w+://[^\s:/]+.*", cluster)):
        allowed = "'local', or an address such as tcp://host:8786"
        raise ParameterError([Problem("cluster", f"got {cluster!r}; allowed: {allowed}")])


def _note_differences(store: Store, plan: Map) -> None:
    """Print notes about differences between stored map and `plan` that do not prevent continuation."""
    then = store.versions
    for name, now in versions().items():
        if then.get(name) != now and store.marked() < store.count:
            _note(f"{name} was {then.get(name)}, is {now}; last digits of new chunks may differ from those of old ones")
    size = int(np.prod(store.chunks, dtype=int))
    if plan.chunk is not None and plan.chunks != store.chunks:
        _note(f"the map has chunks of {size} points already; they stay as they are")


def _check_space(store: Store) -> None:
    """Raise an error if the disk is full; the space that the whole map needs is unknown before compression."""
    free = shutil.disk_usage(store.path).free
    if free < 2**16:  # less than the smallest files of a map
        raise NotAvailable(f"cannot write {str(store.path)!r}: the disk is full")


def _compute(
    plan: Map, store: Store, missing: list[int], workers: int | None, cluster: str | None, progress: bool | None
) -> None:
    job = job_of(plan, store.path)
    count = min(workers or available_cores(), len(missing))
    if workers is None and plan.seconds * plan.size < SHORT:
        count = 1
    finished = sum(store.points(n) for n in set(range(store.count)) - set(missing))
    with progress_bar(plan.size, progress, "points", finished) as advanced:

        def report(done: Done) -> None:
            if done.problem:
                left = len(store.pending())
                kept = f"{store.count - left} of {store.count} chunks are finished and kept; the same command goes on"
                raise NotAvailable(f"{done.problem}\n{kept}")
            if advanced is not None:
                advanced(done.points)

        try:
            if cluster is not None:
                _note(f"computing on Dask, {cluster}")
                run_cluster(job, store, missing, report, cluster, workers or available_cores(), _note)
            elif count == 1:
                run_here(job, missing, report)
            else:
                run_local(job, missing, report, count)
        except KeyboardInterrupt:
            pass


def _note(text: str) -> None:
    print(f"note: {text}", file=sys.stderr)
