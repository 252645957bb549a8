"""Arguments and options shared by several commands."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer


def _set_units(context: typer.Context, rig: Path) -> Path:
    """Set the output units to those used in the rig file."""
    from steadyslip.core.errors import ParameterError
    from steadyslip.core.quantities import result_units
    from steadyslip.files.specifications.deviations import taken_out
    from steadyslip.files.specifications.read import text_of
    from steadyslip.files.specifications.toml import NotToml, tables_of

    with suppress(ParameterError, NotToml):  # problems of the file are reported when the rig is read
        tables = tables_of(text_of(rig))
        taken_out(tables)
        _print_in(context, result_units(tables))
    return rig


def _add_units(context: typer.Context, changes: list[str] | None) -> list[str] | None:
    """Add the units of changed values to the output units."""
    if changes:
        from steadyslip.core.quantities import units_in

        _print_in(context, units_in([change.partition("=")[2].strip(" \"'") for change in changes]))
    return changes


def _print_in(context: typer.Context, names: set[str]) -> None:
    from steadyslip.core.written import display_units

    context.with_resource(display_units(sorted(names)))


def _set_width(context: typer.Context, wanted: bool) -> bool:
    """Make figures as wide as one column of a journal if `wanted`."""
    from steadyslip.core.pictures import for_a_journal

    if wanted:
        context.with_resource(for_a_journal())
    return wanted


RigFile = Annotated[
    Path, typer.Argument(metavar="RIG", help="rig file (TOML); see 'steadyslip schema'", callback=_set_units)
]
OtherRigFile = Annotated[Path, typer.Argument(metavar="OTHER", help="rig file to compare it with")]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="change a value, such as contact.angle='10 deg'; repeatable",
        callback=_add_units,
    ),
]
Project = Annotated[str, typer.Option(help="project, for the title block")]
Author = Annotated[str, typer.Option(help="author, for the title block")]
Revision = Annotated[str, typer.Option(help="revision, for the title block")]
Approval = Annotated[str, typer.Option(help="who approved it, for the title block")]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON, in SI units")]
Journal = Annotated[
    bool,
    typer.Option("--journal", help="draw figures 85 mm wide, a column of a journal", callback=_set_width),
]
Until = Annotated[str | None, typer.Option(help="end of the run, such as '200 s'; that of the file unless given")]
Pieces = Annotated[
    list[str] | None,
    typer.Option(
        "--protocol", metavar="PIECE", help="add a piece, such as \"velocity-step at=10s to='2 um/s'\"; repeatable"
    ),
]
Branch = Annotated[int, typer.Option(help="which steady sliding, where there are several")]
Fitted = Annotated[
    Path | None,
    typer.Option(
        "--fit", metavar="FIT", help="a fit or a population (.nc): judge with its friction, and say how sure that is"
    ),
]


def outputs(what: str) -> Any:
    """Option ``-o``, ``--output`` with a help text, which names output files."""
    return typer.Option("-o", "--output", help=f"{what}; repeatable")


def refuse_branch(fitted: Path | None, branch: int) -> None:
    """Raise ParameterError for --fit with --branch: a fit applies to the steady sliding of lowest normal stress.

    Raises
    ------
    ParameterError
    """
    from steadyslip.core.errors import ParameterError, Problem

    if fitted is not None and branch:
        message = "cannot be combined with --fit, which judges the steady sliding of lowest normal stress"
        raise ParameterError([Problem("--branch", message)])


def pair_of(text: str) -> tuple[str, str]:
    """Two names from a text such as ``angle,stiffness``.

    Raises
    ------
    ParameterError
        If there are not two.
    """
    from steadyslip.core.errors import ParameterError, Problem

    names = [name.strip() for name in text.split(",")]
    if len(names) != 2 or not all(names):
        raise ParameterError([Problem("--chart", f"got {text!r}; allowed: two parameters, such as angle,stiffness")])
    return names[0], names[1]
