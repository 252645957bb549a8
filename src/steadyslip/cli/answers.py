"""Answers on the standard output, and in files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import typer

from steadyslip.core.version import stamped


def say(text: str) -> None:
    """Print an answer; that it cannot be written is an error like any other."""
    from steadyslip.files.output import answering

    with answering():
        typer.echo(text)


def say_json(data: Any) -> None:
    """Print an answer for other programs, an object with the version that gave it."""
    say(json.dumps(stamped(data), indent=2, allow_nan=False))


def formula_of(result: Any, along: str | None) -> dict[str, str | None]:
    """The formula of an edge for JSON; null where there is none."""
    from steadyslip.core.errors import NotAvailable

    try:
        return {"formula": str(result.formula(along).rhs)}
    except NotAvailable:
        return {"formula": None}


def say_formula(result: Any, along: str | None) -> None:
    """Print the formula of an edge, or why there is none."""
    from steadyslip.core.errors import NotAvailable
    from steadyslip.core.progress import progress_text

    try:
        with progress_text("simplifying the formula"):
            equation = result.formula(along)
        say(f"\n{f'Edge in {along}' if along else 'Critical stiffness'}\n  {equation.lhs} = {equation.rhs}")
    except NotAvailable as reason:
        say(f"\nNo formula: {reason}")


def give(result: Any, output: Sequence[Path], as_json: bool, write: Callable[[Any, Path], bool | None]) -> None:
    """Print JSON or words, then write the files asked for: an answer is not lost with a file.

    After Ctrl-C there is something to give as well. `write` says whether it was cut short itself.
    """
    if as_json:
        say_json(result.to_dict())
    else:
        say(str(result))
    interrupted = bool(getattr(result, "interrupted", False))
    for path in output:
        interrupted = bool(write(result, path)) or interrupted
        if not as_json:
            say(f"wrote {path}")
    if interrupted:
        raise typer.Exit(130)
