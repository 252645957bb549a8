"""Maps and sensitivities from rig files and command-line options, and the files they are written to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.files.html_document import write_page
from steadyslip.files.output import FIGURES, check_output, write_by_ending
from steadyslip.maps.plan.axes import Axis, Generated
from steadyslip.maps.plan.map import Map
from steadyslip.maps.plan.map_file import read_map
from steadyslip.maps.refine import Refined
from steadyslip.maps.sensitivity import POINTS, Sensitivity, default_results, sensitivity
from steadyslip.maps.store.map_store import check_path
from steadyslip.maps.view.map_result import MapResult, open_map
from steadyslip.maps.work.run import run_map

STORE = ".zarr"
ENDINGS = (STORE, ".nc", ".parquet", ".html", *FIGURES)
SHARES = (".html", *FIGURES)
REFINED = (".csv", *ENDINGS)


def map_file(
    source: Path, outputs: Sequence[Path], changes: Iterable[str] = (), workers: int | None = None,
    cluster: str | None = None, refine: bool = False, figure: Mapping[str, Any] | None = None,
    edge: Mapping[str, Any] | None = None,
) -> MapResult:  # fmt: skip
    """Map of a rig file, computed into the path of `outputs` that ends in .zarr, or a computed map that is opened.

    Raises
    ------
    ParameterError, NotAvailable
        If the file or an argument is invalid; reported before the computation where possible.
    """
    _check_words(refine, figure or {}, edge or {})
    check_output([path for path in outputs if path.suffix != STORE], REFINED if refine else ENDINGS)
    stores = [path for path in outputs if path.suffix == STORE]
    if source.suffix == STORE:
        if stores or changes or cluster:
            message = "is a map already; give its rig file to compute another one"
            raise ParameterError([Problem(str(source), message)])
        return open_map(source)
    if len(stores) != 1:
        found = f"got {len(stores)} names for the map" if stores else f"got {outputs[0].name}" if outputs else "missing"
        name = (outputs[0] if outputs else source).with_suffix(STORE).name
        wanted = f"also give one for the map itself, such as -o {name}" if outputs and not stores else ""
        message = f"{found}; {wanted or f'give one name for the map, such as -o {name}'}"
        raise ParameterError([Problem("output", message)])
    check_path(stores[0])
    return run_map(read_map(source, changes), stores[0], workers=workers, cluster=cluster)


def _check_words(refine: bool, figure: Mapping[str, Any], edge: Mapping[str, Any]) -> None:
    """Raise ParameterError for options that would have no effect."""
    if refine:
        idle = [name for name, value in figure.items() if value is not None]
        message = "is for figures of a map; with --refine they show the edge. Draw the map itself in a second command"
    else:
        idle = [name for name, value in edge.items() if value is not None]
        message = "applies to a refined edge only; add --refine N"
    if idle:
        raise ParameterError([Problem(f"--{name}", message) for name in idle])


def write_map(
    found: MapResult, path: Path, options: Mapping[str, Any], edge: Refined | None = None, source: Path | None = None
) -> None:
    """Write a map as netCDF, Parquet, document or figure, or a refined edge as CSV or figure, by the name's ending.

    A document contains the hash of `source`, the rig file of the map.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    ParameterError
        If the figure cannot be drawn with these options.
    """
    writers: dict[str, Any] = {".nc": found.to_netcdf, ".parquet": found.to_parquet}
    if edge is None:
        writers[".html"] = lambda p: write_page(found, p, "Map", source=source)
    if edge is not None:
        writers[".csv"] = edge.to_csv
    write_by_ending(path, writers, lambda: found.plot(**options) if edge is None else edge.plot(), found)


def sensitivity_file(
    source: Path, changes: Iterable[str] = (), of: Sequence[str] = (), points: int = POINTS
) -> Sensitivity:
    """Sobol indices over the ranges of the grids and samples of a rig file's ``[map]``.

    Raises
    ------
    ParameterError
        If the file or an argument is invalid; lists all problems.
    NotAvailable
        If a parameter has no range.
    """
    plan = read_map(source, changes)
    ranges: dict[str, tuple[Any, ...]] = {axis.name: _range_of(axis) for axis in plan.axes}
    if isinstance(plan.sampling, Generated):
        ranges |= {name: (low, high, spacing) for name, low, high, spacing in plan.sampling.ranges}
    elif plan.sampling is not None:
        raise NotAvailable("the draws of a fit depend on each other, and Sobol indices are for independent parameters")
    own = {one.name: one for one in plan.compute}
    wanted = tuple(own.get(name, name) for name in of)  # the measure with its options from the file
    return sensitivity(plan.rig, ranges, wanted or _numeric_measures(plan), points=points, protocol=plan.protocol)


def write_sensitivity(found: Sensitivity, path: Path, source: Path | None = None) -> None:
    """Write a sensitivity as a document or as a figure of shares, by the ending of the name.

    A document contains the hash of `source`, the rig file.

    Raises
    ------
    NotAvailable
        If the ending is none of these, or the file cannot be written.
    """
    writers = {".html": lambda p: write_page(found, p, "Sensitivity", source=source)}
    write_by_ending(path, writers, found.plot, found)


def _range_of(axis: Axis) -> tuple[float, float, str]:
    low, high = float(np.min(axis.values)), float(np.max(axis.values))
    return low, high, "log" if axis.spacing == "log" else "linear"


def _numeric_measures(plan: Map) -> tuple[Any, ...]:
    """Quantities of the map that are one number per point; default ones if there are none."""
    found = tuple(
        one for one in plan.compute if not any(o.flags or o.extra for o in one.outputs(plan.rig, plan.varied))
    )
    return found or default_results(plan.rig)
