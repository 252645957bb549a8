"""Commands for verdicts on rigs: `analyze`, `modes`, `cure` and `compare`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from steadyslip.cli.answers import formula_data, output_result, print_formula, print_json, print_text
from steadyslip.cli.options import (
    Approval,
    AsJson,
    Author,
    Branch,
    Changes,
    Fitted,
    Journal,
    OtherRigFile,
    Project,
    Revision,
    RigFile,
    outputs,
    refuse_branch,
)  # fmt: skip


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
    journal: Journal = False,
) -> None:
    """Is steady sliding of this rig stable, what would make it, and how far is the edge?"""
    from steadyslip.files.output import FIGURES, check_output
    from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
    from steadyslip.verdict import analyze as run, stable_within, tolerate

    check_output(output or (), (".html", *FIGURES))
    formula = formula or along is not None
    if fitted is not None:
        _predicted(rig, changes or (), fitted, kick or (), as_json, require_stable, formula, along, branch)
        return
    read, tolerances = rig_and_tolerances(rig, changes or ())
    if along is not None:
        along = read.resolve(along)
    result = run(read, branch=branch, kick=kick or ())
    within = tolerate(read, tolerances) if tolerances else None
    anywhere = stable_within(read, tolerances.unknown) if tolerances.unknown else None
    if output:
        from steadyslip.cli.verdict_files import write_verdict

        for path in output:
            write_verdict(result, within, path, rig)
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
    """Run `analyze --fit`: verdict with the best values of a fit, and probability of stable sliding."""
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


def cure(
    rig: RigFile,
    changes: Changes = None,
    sure: Annotated[str, typer.Option(help="chance of stable sliding that is asked for")] = "95 %",
    output: Annotated[list[Path] | None, outputs("write .html")] = None,
    as_json: AsJson = False,
) -> None:
    """What to change so that it slides stably with a chance, what that costs, and what would make it fail first."""
    from steadyslip.files.html_document import write_page
    from steadyslip.files.output import check_output
    from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
    from steadyslip.verdict import cure as run

    check_output(output or (), (".html",))
    found = run(*rig_and_tolerances(rig, changes or ()), sure=sure)
    output_result(found, output or (), as_json, partial(write_page, kind="Cures", source=rig))


def compare(
    rig: RigFile,
    other: OtherRigFile,
    changes: Changes = None,
    output: Annotated[list[Path] | None, outputs("write .html")] = None,
    as_json: AsJson = False,
    project: Project = "",
    author: Author = "",
    revision: Revision = "",
    approval: Approval = "",
) -> None:
    """Two rigs side by side: verdicts, margins, chances, and which of their differences matters."""
    from steadyslip.files.html_document import write_page
    from steadyslip.files.output import check_output
    from steadyslip.verdict.compare import compare_files

    check_output(output or (), (".html",))
    found = compare_files(rig, other, changes or ())
    block: dict[str, Any] = {"project": project, "author": author, "revision": revision, "approval": approval}
    block |= {"kind": "Comparison", "of": " and ".join(found.names), "source": [rig, other]}
    output_result(found, output or (), as_json, partial(write_page, **block))


def modes(
    rig: RigFile,
    changes: Changes = None,
    mode: Annotated[
        int | None,
        typer.Option(help="number of the oscillation to look at closely; the one that grows fastest unless given"),
    ] = None,
    along: Annotated[
        str | None, typer.Option(help="chart frequencies and damping ratios of all modes over this parameter instead")
    ] = None,
    between: Annotated[
        tuple[str, str] | None, typer.Option(metavar="LOW HIGH", help="range of it, such as '1 mm/s' '1 m/s'")
    ] = None,
    output: Annotated[list[Path] | None, outputs("write .csv, .html, .png, .svg or .pdf")] = None,
    journal: Journal = False,
    as_json: AsJson = False,
) -> None:
    """Frequencies, dampings and shapes of a machine's modes; what feeds the one that grows, and what to change."""
    from steadyslip.core.errors import ParameterError, Problem
    from steadyslip.files.output import check_output
    from steadyslip.files.specifications import read_rig
    from steadyslip.linear.mode_chart import mode_chart
    from steadyslip.linear.mode_table import ENDINGS, modes as run, write_modes

    check_output(output or (), ENDINGS)
    if along and mode is not None:
        raise ParameterError([Problem("mode", f"got {mode}; a chart along {along} has all modes: leave out --mode")])
    if between and not along:
        raise ParameterError([Problem("between", "got a range but no parameter; name it with --along")])
    machine = read_rig(rig, changes or ())
    found = mode_chart(machine, along, between) if along else run(machine, mode)
    output_result(found, output or (), as_json, partial(write_modes, source=rig))
