"""Commands on many rigs at once: `map` and `sensitivity`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from steadyslip.cli.answers import output_result, print_json, print_text
from steadyslip.cli.options import AsJson, Changes, Journal, RigFile, outputs


def map_(
    source: Annotated[Path, typer.Argument(metavar="RIG", help="rig file with a table [map], or a map (.zarr)")],
    changes: Changes = None,
    output: Annotated[
        list[Path] | None, outputs("the map (.zarr), and .nc, .parquet, .html, .png, .svg or .pdf")
    ] = None,
    journal: Journal = False,
    workers: Annotated[int | None, typer.Option(min=1, help="processes; all cores unless given")] = None,
    cluster: Annotated[
        str | None, typer.Option(help="compute on Dask: address of a scheduler such as tcp://host:8786, or local")
    ] = None,
    x: Annotated[str | None, typer.Option(help="parameter on the first axis of figures")] = None,
    y: Annotated[str | None, typer.Option(help="and on the second; '' for curves over the first alone")] = None,
    show: Annotated[str | None, typer.Option(help="result that figures show")] = None,
    facet: Annotated[str | None, typer.Option(help="parameter that differs between figures side by side")] = None,
    refine: Annotated[int, typer.Option(min=0, help="halve the cells along the edge of stability so often")] = 0,
    of: Annotated[str | None, typer.Option(help="result whose edge to refine; status unless given")] = None,
    level: Annotated[float | None, typer.Option(help="value that it crosses there, SI units")] = None,
    as_json: AsJson = False,
) -> None:
    """Any analysis over many rigs, kept on disk; the same command again goes on after an interruption."""
    from steadyslip.cli.map_files import STORE, map_file, write_map
    from steadyslip.maps import refine as refined

    figure: dict[str, Any] = {"x": x, "y": y, "show": show, "facet": facet}
    about: dict[str, Any] = {"of": of, "level": level}
    found = map_file(source, output or (), changes or (), workers, cluster, refine > 0, figure, about)
    if not found.complete:
        done, count = found.finished
        again = "map its rig file again to go on" if source.suffix == STORE else "the same command goes on"
        typer.secho(f"stopped: {done} of {count} chunks are finished and kept; {again}", err=True)
        raise typer.Exit(130)
    edge = refined(found, refine, **about, workers=workers, cluster=cluster) if refine else None
    others = [path for path in output or () if path.suffix != STORE]
    for path in others:
        write_map(found, path, figure, edge, source)
    if as_json:
        print_json(found.to_dict())
        return
    print_text(str(found))
    if edge is not None:
        print_text(f"\n{edge}")
    for path in others:
        print_text(f"wrote {path}")


def sensitivity(
    rig: RigFile,
    changes: Changes = None,
    of: Annotated[
        list[str] | None,
        typer.Option(help="result, such as critical_stiffness or margin; repeatable; those of [map] unless given"),
    ] = None,
    points: Annotated[int, typer.Option(help="sets of points, a power of 2")] = 4096,
    output: Annotated[list[Path] | None, outputs("write .html, or draw: .png, .svg or .pdf")] = None,
    journal: Journal = False,
    as_json: AsJson = False,
) -> None:
    """Which parameters decide? Sobol indices over the ranges of the file's [map]."""
    from steadyslip.cli.map_files import SHARES, sensitivity_file, write_sensitivity
    from steadyslip.files.output import check_output

    check_output(output or (), SHARES)
    found = sensitivity_file(rig, changes or (), of or (), points)
    output_result(found, output or (), as_json, partial(write_sensitivity, source=rig))
