"""Commands of the program; each calls one public function."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from steadyslip.cli.answers import formula_data, output_result, print_formula, print_json, print_text
from steadyslip.cli.ending import end, print_message
from steadyslip.cli.options import (
    AsJson,
    Branch,
    Changes,
    Fitted,
    OtherRigFile,
    Pieces,
    RigFile,
    Until,
    outputs,
    pair_of,
    refuse_branch,
)


class _Commands(TyperGroup):
    """Group of commands that prints a message after Ctrl-C; Typer would exit without one."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as stopped:
            raise typer.Exit(print_message(str(stopped) or "before there was an answer", 130, "stopped")) from None


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Stability of frictional sliding: will it slide steadily, what would make it, how far is the edge.",
)


@app.callback(invoke_without_command=True)
def _start(version: Annotated[bool, typer.Option("--version", help="print the version and stop")] = False) -> None:
    if version:
        from steadyslip import __version__

        print_text(f"steadyslip {__version__}")
        raise typer.Exit


@app.command()
def analyze(
    rig: RigFile,
    changes: Changes = None,
    as_json: AsJson = False,
    require_stable: Annotated[
        bool, typer.Option("--require-stable", help="exit with status 1 unless sliding is stable beyond rounding")
    ] = False,
    formula: Annotated[bool, typer.Option("--formula", help="also print the critical stiffness as a formula")] = False,
    along: Annotated[
        str | None, typer.Option("--along", help="parameter whose edge --formula writes instead, where that is short")
    ] = None,
    branch: Branch = 0,
    kick: Annotated[
        list[str] | None,
        typer.Option(
            "--kick", help="also find the smallest kick not survived: velocity, displacement, ...; repeatable"
        ),
    ] = None,
    fitted: Fitted = None,
    output: Annotated[list[Path] | None, outputs("write .html, .png, .svg or .pdf")] = None,
    journal: Annotated[bool, typer.Option("--journal", help="draw figures 85 mm wide, a column of a journal")] = False,
) -> None:
    """Is steady sliding of this rig stable, what would make it, and how far is the edge?"""
    from steadyslip.files.output import FIGURES, check_output
    from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
    from steadyslip.files.specifications.unknowns import intervals_of
    from steadyslip.verdict import analyze as run, stable_within, tolerate

    check_output(output or (), (".html", *FIGURES))
    formula = formula or along is not None
    if fitted is not None:
        _predicted(rig, changes or (), fitted, kick or (), as_json, require_stable, formula, along, branch)
        return
    read, tolerances = rig_and_tolerances(rig, changes or ())
    unknown = intervals_of(read, rig, changes or ())
    if along is not None:
        along = read.resolve(along)
    result = run(read, branch=branch, kick=kick or ())
    within = tolerate(read, tolerances) if tolerances else None
    anywhere = stable_within(read, unknown) if unknown else None
    if output:
        from steadyslip.reports.verdict_files import write_verdict

        for path in output:
            write_verdict(result, within, path, rig, journal)
    if as_json:
        data = result.to_dict()
        if within is not None:
            data["tolerances"] = within.to_dict()
        if anywhere is not None:
            data["unknown"] = anywhere.to_dict()
        if formula:
            data |= formula_data(result, along)
        print_json(data)
    else:
        head, _, rest = str(result).partition("\n")
        colour = {True: typer.colors.GREEN, False: typer.colors.RED, None: typer.colors.YELLOW}[result.stable]
        print_text(typer.style(head, bold=True, fg=colour))
        print_text(rest)
        for more in filter(None, (within, anywhere)):
            print_text(f"\n{more}")
        if formula:
            print_formula(result, along)
    if any(one.interrupted for one in getattr(result, "kicks", ())):
        raise typer.Exit(130)
    if require_stable and (not result.stable or result.on_edge or not (anywhere is None or anywhere.everywhere)):
        raise typer.Exit(1)


def _predicted(
    rig: Path,
    changes: Sequence[str],
    fitted: Path,
    kick: Sequence[str],
    as_json: bool,
    require_stable: bool,
    formula: bool,
    along: str | None,
    branch: int,
) -> None:
    """Analyze a rig with the friction of a fit: verdict of the best values, and probability of stability."""
    from steadyslip.experiments import predict
    from steadyslip.experiments.from_files import load_friction
    from steadyslip.files.specifications import read_slider
    from steadyslip.verdict import analyze as run

    refuse_branch(fitted, branch)
    slider = read_slider(rig, changes)
    along = along if along is None else slider.resolve(along)
    found = predict(slider, load_friction(fitted), kick=kick)
    best = run(found.rig)
    if as_json:
        data = best.to_dict() | {"prediction": found.to_dict()} | (formula_data(best, along) if formula else {})
        print_json(data)
    else:
        print_text(f"{found}\n\nWith the best values\n{best}")
        if formula:
            print_formula(best, along)
    if found.left_out:
        raise typer.Exit(130)
    if require_stable and not found.probability_stable >= 0.95:
        raise typer.Exit(1)


@app.command()
def cure(
    rig: RigFile,
    changes: Changes = None,
    sure: Annotated[str, typer.Option(help="chance of stable sliding that is asked for")] = "95 %",
    output: Annotated[list[Path] | None, outputs("write .html")] = None,
    as_json: AsJson = False,
) -> None:
    """What to change so that it slides stably with a chance, what that costs, and what would make it fail first."""
    from steadyslip.files.output import check_output
    from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
    from steadyslip.files.standalone import write_page
    from steadyslip.verdict import cure as run

    check_output(output or (), (".html",))
    found = run(*rig_and_tolerances(rig, changes or ()), sure=sure)
    output_result(found, output or (), as_json, partial(write_page, kind="Cures"))


@app.command()
def compare(
    rig: RigFile,
    other: OtherRigFile,
    changes: Changes = None,
    output: Annotated[list[Path] | None, outputs("write .html")] = None,
    as_json: AsJson = False,
) -> None:
    """Two rigs beside each other: verdicts, margins, chances, and which of their differences matters."""
    from steadyslip.files.output import check_output
    from steadyslip.files.standalone import write_page
    from steadyslip.verdict.compare import compare_files

    check_output(output or (), (".html",))
    found = compare_files(rig, other, changes or ())
    output_result(found, output or (), as_json, partial(write_page, kind="Comparison"))


@app.command()
def fit(
    files: Annotated[
        list[Path], typer.Argument(metavar="RECORD... [SPEC.toml]", help="records of experiments, and how to fit them")
    ],
    law: Annotated[
        str | None,
        typer.Option("--law", help="the file is a table of speeds and friction: fit this law's steady curve, as lugre"),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="change a value of SPEC, such as fit.trend=2; repeatable"),
    ] = None,
    skip_bad_lines: Annotated[
        bool, typer.Option("--skip-bad-lines", help="leave damaged lines out, and say so")
    ] = False,
    bootstrap: Annotated[int, typer.Option(min=0, max=1_000_000, help="also refit this many resampled records")] = 0,
    steps: Annotated[bool, typer.Option("--steps", help="also fit every step alone")] = False,
    output: Annotated[
        list[Path] | None,
        outputs(
            "write .nc, .html, .json, .png, .svg or .pdf, or the table of all steps as .csv or .tex; with --law "
            "the rig as .toml, or .json"
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Which friction do these records show, and how sure is that?"""
    if law is not None:
        _fit_speeds(files, law, changes or (), output or (), as_json)
        return
    from steadyslip.core.errors import ParameterError, Problem
    from steadyslip.experiments import bootstrap as resample, fit_files, population_files, step_table
    from steadyslip.experiments.fit_commands import (
        ENDINGS,
        TABLES,
        as_json as plain,
        split_files,
        write_fit,
        write_population,
        write_table,
    )
    from steadyslip.experiments.from_files import spec_of
    from steadyslip.files.output import check_output

    check_output(output or (), ENDINGS)
    listed = [path for path in output or () if path.suffix.lower() in TABLES]
    others = [path for path in output or () if path not in listed]
    if bootstrap == 1:
        raise ParameterError([Problem("--bootstrap", "got 1; allowed: 0 for none, or 2 or more resampled records")])
    records, spec = split_files(files)
    if spec is not None and spec_of(spec, changes or ()).population is not None:
        if bootstrap:
            message = "cannot be combined with [population], whose draws carry the uncertainty"
            raise ParameterError([Problem("--bootstrap", message)])
        if steps or listed:
            raise ParameterError(
                [Problem("--steps", "cannot be combined with [population]; leave it and its table out")]
            )
        members = population_files(records, spec, changes or (), skip_bad_lines=skip_bad_lines)
        output_result(members, output or (), as_json, write_population)
        return
    found, comparison = fit_files(records, spec, changes or (), skip_bad_lines=skip_bad_lines)
    for path in others:
        write_fit(found, comparison, path)
    if not as_json:
        for record in found.plan.records:
            print_text(f"{record}\n")
        if comparison is not None:
            print_text(f"{comparison}\n")
        print_text(str(found))
    draws, stopped = None, comparison is not None and comparison.interrupted
    if bootstrap and not stopped:
        try:
            draws = resample(found, bootstrap)
            stopped = draws.interrupted
            for path in others:
                if path.suffix.lower() == ".html":
                    write_fit(found, comparison, path, draws)
        except KeyboardInterrupt:
            stopped = True
    table = step_table(found) if (steps or listed) and not stopped else None
    if table is not None:
        for path in listed:
            write_table(table, path)
    if as_json:
        data = plain(found, comparison)
        if table is not None:
            data["steps"] = table.to_dict()
        if draws is not None:
            data["bootstrap"] = {n: {"error": draws.error(n), "interval": draws.interval(n)} for n in found.names}
        print_json(data)
    for text in () if as_json else filter(None, (draws, table)):
        print_text(f"\n{text}")
    for path in () if as_json else others + listed * (table is not None):
        print_text(f"wrote {path}")
    if stopped:
        raise typer.Exit(130)


def _fit_speeds(files: Sequence[Path], law: str, changes: Sequence[str], output: Sequence[Path], as_json: bool) -> None:
    """Fit a law to a table of speeds, and write the rig."""
    from steadyslip.experiments.fit_commands import SPEED_ENDINGS, write_speeds
    from steadyslip.experiments.from_speeds import fit_speed_files
    from steadyslip.files.output import check_output

    check_output(output, SPEED_ENDINGS)
    output_result(fit_speed_files(files, law, changes), output, as_json, write_speeds)


@app.command()
def explore(
    rig: RigFile,
    changes: Changes = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="write the page (.html) instead of opening it")
    ] = None,
    branch: Branch = 0,
) -> None:
    """A page for the browser: the verdict as the rig's values are moved. It needs nothing else, and can be sent on."""
    from steadyslip.explorer import explore as run
    from steadyslip.files.output import check_output
    from steadyslip.files.specifications import read_rig

    if output is not None:
        check_output([output], [".html"])
    found = run(read_rig(rig, changes or ()), title=rig.stem, branch=branch, source=rig)
    if output is None:
        print_text(f"opened {found.open()}")
        return
    found.save(output)
    print_text(f"wrote {output}")


@app.command()
def report(
    rig: RigFile,
    changes: Changes = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="write the document (.html) instead of opening it")
    ] = None,
    branch: Branch = 0,
    fitted: Fitted = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            "--tolerance", metavar="NAME=VALUE", help="how far a value may be off, such as stiffness='5 %'; repeatable"
        ),
    ] = None,
    chart: Annotated[
        list[str] | None,
        typer.Option("--chart", metavar="X,Y", help="draw stability over these two, as angle,stiffness; repeatable"),
    ] = None,
    project: Annotated[str, typer.Option(help="project, for the title block")] = "",
    author: Annotated[str, typer.Option(help="author, for the title block")] = "",
    revision: Annotated[str, typer.Option(help="revision, for the title block")] = "",
    approval: Annotated[str, typer.Option(help="who approved it, for the title block")] = "",
) -> None:
    """A printable document about a rig: answer, recommendation, inputs, edges, charts, motion, formula, provenance."""
    from steadyslip.files.output import check_output
    from steadyslip.files.specifications import named_value
    from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
    from steadyslip.reports import report as run

    if output is not None:
        check_output([output], [".html"])
    refuse_branch(fitted, branch)
    read, written = rig_and_tolerances(rig, changes or ())
    given: Any = dict(map(named_value, tolerance or ()))
    if written:
        given = replace(written, values=dict(written.values) | {read.resolve(name): one for name, one in given.items()})
    options: dict[str, Any] = {"branch": branch, "tolerances": given, "charts": list(map(pair_of, chart or ()))}
    options |= {"project": project, "author": author, "revision": revision, "approval": approval}
    if fitted is not None:
        from steadyslip.experiments.from_files import load_friction

        options["fit"] = load_friction(fitted)
    found = run(read, title=rig.stem, source=rig, **options)
    if output is None:
        print_text(f"opened {found.open()}")
        return
    found.save(output)
    print_text(f"wrote {output}")


@app.command()
def simulate(
    rig: RigFile,
    changes: Changes = None,
    until: Until = None,
    pieces: Pieces = None,
    start: Annotated[
        list[str] | None,
        typer.Option("--initial", metavar="NAME=VALUE", help="start elsewhere than in steady sliding; SI; repeatable"),
    ] = None,
    output: Annotated[list[Path] | None, outputs("write .nc, .csv, .html, .png, .svg or .pdf")] = None,
    samples: Annotated[int | None, typer.Option(min=2, max=10_000_000, help="report at this many even times")] = None,
    phase: Annotated[bool, typer.Option("--phase", help="draw the phase plane instead of the history")] = False,
    contact: Annotated[
        str | None,
        typer.Option(help="of a machine: draw its phase plane; that which moves most unless given"),
    ] = None,
    method: Annotated[str, typer.Option(help="auto, explicit, rosenbrock, dop853 or rodas5p")] = "auto",
    rtol: Annotated[float, typer.Option(help="error allowed per step")] = 1e-7,
    as_json: AsJson = False,
) -> None:
    """What does this rig do, under the protocol of its file and of the command line?"""
    from steadyslip.files.output import check_output
    from steadyslip.motion.commands import ENDINGS, run_file, write_history

    check_output(output or (), ENDINGS)
    history = run_file(rig, changes or (), pieces or (), start or (), until, samples, method, rtol, contact)
    output_result(
        history,
        output or (),
        as_json,
        partial(write_history, kind="phase" if phase or contact else "history", source=rig, contact=contact),
    )


@app.command()
def cycles(
    rig: RigFile,
    changes: Changes = None,
    along: Annotated[
        str | None,
        typer.Option(
            help="the parameter that is varied; stiffness unless given, of a machine the one of a link or the drive "
            "whose edge of oscillation is nearest"
        ),
    ] = None,
    between: Annotated[
        tuple[str, str] | None, typer.Option(metavar="LOW HIGH", help="range of it, such as '1 GPa/m' '50 GPa/m'")
    ] = None,
    doublings: Annotated[int, typer.Option(min=0, help="how many period doublings to follow")] = 1,
    output: Annotated[list[Path] | None, outputs("write .nc, .csv, .html, .png, .svg or .pdf")] = None,
    as_json: AsJson = False,
) -> None:
    """Which stick-slip cycles does this rig have, as a parameter varies? Ctrl-C keeps what there is."""
    from steadyslip.files.output import check_output
    from steadyslip.nonlinear.cycle_commands import ENDINGS, cycles_of_file, write_branch

    check_output(output or (), ENDINGS)
    branch = cycles_of_file(rig, changes or (), along, between, doublings)
    output_result(branch, output or (), as_json, partial(write_branch, source=rig))


@app.command()
def threshold(
    rig: RigFile,
    changes: Changes = None,
    kick: Annotated[
        list[str] | None,
        typer.Option(
            "--kick",
            help="velocity, displacement, normal-stress or impulse; repeatable; the first two unless given; of "
            "a machine velocity, displacement, force, normal-force or impulse",
        ),
    ] = None,
    at: Annotated[str | None, typer.Option(help="of a machine: the body or contact that is kicked")] = None,
    reverse: Annotated[bool, typer.Option("--reverse", help="slower, backward, pressed less")] = False,
    reference: Annotated[
        str, typer.Option(help="whether the rig's drive is the velocity 'before' or 'after' a velocity step")
    ] = "before",
    output: Annotated[
        list[Path] | None, outputs("write .html, or draw the basin in the phase plane: .png, .svg or .pdf")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """How large a kick does steady sliding survive? Ctrl-C keeps what there is."""
    from steadyslip.files.output import check_output
    from steadyslip.nonlinear.cycle_commands import KICKED, thresholds_of_file, write_thresholds

    check_output(output or (), KICKED)
    found = thresholds_of_file(rig, changes or (), kick or (), reverse, reference, at)
    wanted = [path for path in output or () if not found.interrupted or path.suffix == ".html"]
    if len(wanted) < len(output or ()):
        typer.secho("stopped: the basin is not drawn", err=True)
    output_result(found, wanted, as_json, partial(write_thresholds, source=rig))


@app.command()
def response(
    rig: RigFile,
    changes: Changes = None,
    swings: Annotated[
        str, typer.Option("--input", help="what swings: normal-stress, drive-velocity, push or injection")
    ] = "normal-stress",
    answers: Annotated[
        str | None, typer.Option("--output", help="observable that answers: friction, shear-stress, v, guide.friction")
    ] = None,
    on: Annotated[str | None, typer.Option(help="of a machine: the contact or body on which the input acts")] = None,
    periods: Annotated[tuple[str, str], typer.Option(help="shortest and longest, such as 0.1s 1000s")] = (
        "0.1 s", "1000 s",
    ),
    points: Annotated[int, typer.Option(min=2, max=1000, help="periods from the one to the other")] = 41,
    amplitudes: Annotated[
        list[str] | None, typer.Option("--amplitude", help="simulate it, such as '1 MPa'; repeatable")
    ] = None,
    limits: Annotated[
        bool, typer.Option("--limits", help="amplitudes up to which it is linear and from which sliding is lost")
    ] = False,
    files: Annotated[
        list[Path] | None, typer.Option("-o", help="write .csv, .html, or a Bode plot: .png, .svg or .pdf; repeatable")
    ] = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Gain and phase of steady sliding under an input that swings: exact for small amplitudes, simulated for large."""
    from steadyslip.files.output import check_output
    from steadyslip.nonlinear.cycle_commands import ANSWERED, response_of_file, write_answers

    check_output(files or (), ANSWERED)
    found = response_of_file(rig, changes or (), periods, points, amplitudes or (), swings, answers, on, limits)
    output_result(found, files or (), as_json, partial(write_answers, title="Response", source=rig))


@app.command()
def hunt(
    rig: RigFile,
    changes: Changes = None,
    until: Annotated[
        str | None, typer.Option(help="end, such as '200 s'; where it rests or a cycle repeats itself unless given")
    ] = None,
    pieces: Pieces = None,
    rtol: Annotated[float, typer.Option(help="error of the motion allowed per step, with bristles")] = 1e-8,
    require_settled: Annotated[
        bool, typer.Option("--require-settled", help="exit with status 1 unless it settles")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Does an axis that is held (velocity = 0) hunt about its target, how far and how often, or settle?"""
    from steadyslip.nonlinear.cycle_commands import hunt_of_file

    found = hunt_of_file(rig, changes or (), pieces or (), until, rtol)
    output_result(found, (), as_json, lambda result, path: None)
    if require_settled and found.hunts is not False:
        raise typer.Exit(1)


@app.command()
def verdicts(
    rig: RigFile,
    changes: Changes = None,
    until: Until = None,
    pieces: Pieces = None,
    output: Annotated[list[Path] | None, outputs("write .csv, .html, .png, .svg or .pdf")] = None,
    rtol: Annotated[float, typer.Option(help="error of the motion allowed per step")] = 1e-7,
    as_json: AsJson = False,
) -> None:
    """Is it stable at every moment of a protocol of slow changes, and when does motion depart?"""
    from steadyslip.files.output import check_output
    from steadyslip.nonlinear.cycle_commands import ANSWERED, verdicts_of_file, write_answers

    check_output(output or (), ANSWERED)
    found = verdicts_of_file(rig, changes or (), pieces or (), until, rtol)
    output_result(found, output or (), as_json, partial(write_answers, title="Verdicts", source=rig))


@app.command("map")
def map_(
    source: Annotated[Path, typer.Argument(metavar="RIG", help="rig file with a table [map], or a map (.zarr)")],
    changes: Changes = None,
    output: Annotated[
        list[Path] | None, outputs("the map (.zarr), and .nc, .parquet, .html, .png, .svg or .pdf")
    ] = None,
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
    from steadyslip.maps import refine as refined
    from steadyslip.maps.map_commands import STORE, map_file, write_map

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


@app.command()
def sensitivity(
    rig: RigFile,
    changes: Changes = None,
    of: Annotated[
        list[str] | None,
        typer.Option(help="result, such as critical_stiffness or margin; repeatable; those of [map] unless given"),
    ] = None,
    points: Annotated[int, typer.Option(help="sets of points, a power of 2")] = 4096,
    output: Annotated[list[Path] | None, outputs("write .html, or draw: .png, .svg or .pdf")] = None,
    as_json: AsJson = False,
) -> None:
    """Which parameters decide? Sobol indices over the ranges of the file's [map]."""
    from steadyslip.files.output import check_output
    from steadyslip.maps.map_commands import SHARES, sensitivity_file, write_sensitivity

    check_output(output or (), SHARES)
    found = sensitivity_file(rig, changes or (), of or (), points)
    output_result(found, output or (), as_json, partial(write_sensitivity, source=rig))


@app.command()
def reproduce(
    folder: Annotated[Path, typer.Argument(help="where to write; created if missing")] = Path("paper-figures"),
) -> None:
    """Draw the paper's figures and put its numbers next to ours."""
    from steadyslip.reproduce import paper_table, reproduce as run

    written = run(folder)
    print_text(str(paper_table()))
    for path in written:
        print_text(f"wrote {path}")


@app.command()
def examples(
    output: Annotated[Path | None, typer.Option("-o", "--output", help="folder to copy them to")] = None,
) -> None:
    """The example files that come with the package: a list, or copies to work on."""
    from steadyslip.files.examples import copy_examples, example_files

    if output is None:
        listed = {name: about for name, about in example_files().items() if about}
        width = max(map(len, listed))
        print_text("\n".join(f"{name:{width}}  {about}" for name, about in listed.items()))
        print_text("\n'steadyslip examples -o examples' copies them to the folder examples")
        return
    for path in copy_examples(output):
        print_text(f"wrote {path}")


@app.command()
def init(
    kind: Annotated[str, typer.Argument(help="rig, machine, protocol, fit or map")] = "rig",
    friction: Annotated[str, typer.Option(help="friction law of a rig")] = "lugre",
    contact: Annotated[str, typer.Option(help="its contact law")] = "constant",
    drive: Annotated[str, typer.Option(help="its drive: steady, pd or pid")] = "steady",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the file (.toml)")] = None,
) -> None:
    """A commented file to begin with: every key of the chosen laws, with its meaning; a rig answers as it is."""
    from steadyslip.core.errors import NotAvailable
    from steadyslip.files.output import check_output, write_text
    from steadyslip.files.specifications.starter import starter_text

    text = starter_text(kind, friction, contact, drive)
    if output is None:
        print_text(text.rstrip())
        return
    check_output([output], [".toml"])
    if output.exists():
        raise NotAvailable(f"{output} exists already; name another file, or remove it")
    write_text(output, text)
    print_text(f"wrote {output}")


@app.command()
def schema() -> None:
    """Print the JSON schema of the files that are read: rigs, protocols, maps and fits."""
    from steadyslip.schemas import json_schema

    print_text(json.dumps(json_schema(), indent=2, ensure_ascii=False))


def main() -> None:
    """Run the command line and exit; entry point of the package."""
    end(app)
