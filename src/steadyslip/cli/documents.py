"""Commands that make a page or a document of a rig: `explore` and `report`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from steadyslip.cli.answers import print_text
from steadyslip.cli.options import (
    Approval,
    Author,
    Branch,
    Changes,
    Fitted,
    Project,
    Revision,
    RigFile,
    pair_of,
    refuse_branch,
)  # fmt: skip


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
    project: Project = "",
    author: Author = "",
    revision: Revision = "",
    approval: Approval = "",
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
    if written or written.adjust or written.unknown:
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
