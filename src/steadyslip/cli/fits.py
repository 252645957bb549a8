"""The command `fit`: friction from records of experiments or a table of speeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from steadyslip.cli.answers import output_result, print_json, print_text
from steadyslip.cli.options import AsJson, Journal, outputs

if TYPE_CHECKING:
    from steadyslip.experiments import Fit, LawComparison


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
    journal: Journal = False,
    as_json: AsJson = False,
) -> None:
    """Which friction do these records show (or, with SPEC of a machine, which machine), and how sure is that?"""
    if law is not None:
        _fit_speeds(files, law, changes or (), output or (), as_json)
        return
    from steadyslip.cli.fit_files import (
        ENDINGS,
        TABLES,
        as_json as plain,
        split_files,
        write_fit,
        write_population,
        write_table,
    )
    from steadyslip.core.errors import ParameterError, Problem
    from steadyslip.experiments import bootstrap as resample, fit_files, population_files, step_table
    from steadyslip.experiments.from_files import fitted, records_of, spec_of
    from steadyslip.experiments.machine_spec import MachineSpec
    from steadyslip.files.output import check_output

    if any(path.suffix.lower() == ".toml" for path in output or ()):
        message = "a rig as .toml is written from a table of speeds; say which law with --law, such as --law lugre"
        raise ParameterError([Problem("-o", message)])
    check_output(output or (), ENDINGS)
    listed = [path for path in output or () if path.suffix.lower() in TABLES]
    others = [path for path in output or () if path not in listed]
    if bootstrap == 1:
        raise ParameterError([Problem("--bootstrap", "got 1; allowed: 0 for none, or 2 or more resampled records")])
    records, spec = split_files(files)
    plan = spec_of(spec, changes or ())
    if isinstance(plan, MachineSpec):
        if bootstrap or steps or listed:
            message = "is for records of sliders; leave --bootstrap, --steps and tables out for a machine"
            raise ParameterError([Problem("--steps" if steps or listed else "--bootstrap", message)])
        machine, _ = fit_files(records, spec, changes or (), skip_bad_lines=skip_bad_lines)
        for record in () if as_json else machine.plan.records:
            print_text(f"{record}\n")
        output_result(machine, output or (), as_json, lambda one, path: write_fit(one, None, path))
        return
    if plan.population is not None and spec is not None:
        if bootstrap:
            message = "cannot be combined with [population], whose draws carry the uncertainty"
            raise ParameterError([Problem("--bootstrap", message)])
        if steps or listed:
            name = "--steps" if steps else f"-o {listed[0]}"
            message = "a population has no table of steps; allowed: files .nc, .html, .json or of a figure"
            raise ParameterError([Problem(name, message)])
        members = population_files(records, spec, changes or (), skip_bad_lines=skip_bad_lines)
        output_result(members, output or (), as_json, write_population)
        return
    own = records_of(plan, records, skip_bad_lines)
    for record in () if as_json else own:  # printed before the search, which may take long
        print_text(f"{record}\n")
    found, comparison = cast("tuple[Fit, LawComparison | None]", fitted(plan, own))
    for path in others:
        write_fit(found, comparison, path)
    if not as_json:
        known = {note for record in own for note in record.notes}
        added = dict.fromkeys(note for record in found.plan.records for note in record.notes if note not in known)
        if added:
            print_text("".join(f"note            {note}\n" for note in added))
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
    table = None
    if (steps or listed) and not stopped:
        search = {name: plan.options[name] for name in ("starts", "effort") if name in plan.options}
        table = step_table(found, **search)
    if table is not None:
        for path in listed:
            write_table(table, path)
        for path in others:
            if path.suffix.lower() == ".json":
                write_fit(found, comparison, path, draws, table)
    if as_json:
        data = plain(found, comparison, table)
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
    """Fit a law to a table of speeds and friction; print the result and write it to files."""
    from steadyslip.cli.fit_files import SPEED_ENDINGS, write_speeds
    from steadyslip.experiments.from_speeds import fit_speed_files
    from steadyslip.files.output import check_output

    check_output(output, SPEED_ENDINGS)
    output_result(fit_speed_files(files, law, changes), output, as_json, write_speeds)
