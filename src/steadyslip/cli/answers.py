"""Printing of results, and writing them to files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import typer

from steadyslip.core.version import stamped

_WIDTH = 120  # characters in a line, as in printed tables


def print_text(text: str) -> None:
    """Print text; raises NotAvailable or OutputClosed if the standard output cannot be written."""
    from steadyslip.files.output import answering

    with answering():
        typer.echo(text)


def print_json(data: Any) -> None:
    """Print data as a JSON object, with the version of steadyslip."""
    print_text(json.dumps(stamped(data), indent=2, allow_nan=False))


def formula_data(result: Any, along: str | None) -> dict[str, str | None]:
    """Formula of an edge of stability as entry ``formula`` for JSON; its value is None if there is no formula."""
    from steadyslip.core.errors import NotAvailable

    try:
        return {"formula": str(result.formula(along).rhs)}
    except NotAvailable:
        return {"formula": None}


def print_formula(result: Any, along: str | None) -> None:
    """Print the formula of an edge of stability, in parts as in documents, or the reason why there is none."""
    from steadyslip.core.errors import NotAvailable
    from steadyslip.core.progress import progress_text
    from steadyslip.linear.formula import formula_in_parts

    try:
        with progress_text("simplifying the formula"):
            parts = formula_in_parts(result.rig, along)
        lines = [
            fill(
                f"{one.lhs} = {one.rhs}", _WIDTH, initial_indent="  ", subsequent_indent="    ", break_long_words=False
            )
            for one in parts
        ]
        print_text("\n".join(["", f"Edge in {along}" if along else "Critical stiffness", *lines]))
    except NotAvailable as reason:
        print_text(f"\nNo formula: {reason}")


def output_result(
    result: Any, output: Sequence[Path], as_json: bool, write: Callable[[Any, Path], bool | None]
) -> None:
    """Print a result as text or JSON, then write it to files: if a file cannot be written, the result is printed.

    Exits with status 130 if Ctrl-C interrupted the computation of the result, or its writing (`write` returns True).
    """
    if as_json:
        print_json(result.to_dict())
    else:
        print_text(str(result))
    interrupted = bool(getattr(result, "interrupted", False))
    for path in output:
        interrupted = bool(write(result, path)) or interrupted
        if not as_json:
            print_text(f"wrote {path}")
    if interrupted:
        raise typer.Exit(130)
