"""The command-line program: all commands, in the order of `--help`."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from steadyslip.cli.analysis import analyze, compare, cure, modes
from steadyslip.cli.answers import print_text
from steadyslip.cli.documents import explore, report
from steadyslip.cli.dynamics import cycles, hunt, response, simulate, threshold, verdicts
from steadyslip.cli.ending import end, print_message
from steadyslip.cli.fits import fit
from steadyslip.cli.mapping import map_, sensitivity
from steadyslip.cli.starting import examples, init, reproduce, schema
from steadyslip.core.version import version as program_version

COMMANDS = (
    *(analyze, modes, cure, compare, fit, explore, report),
    *(simulate, cycles, threshold, response, hunt, verdicts),
    *(map_, sensitivity, reproduce, examples, init, schema),
)
WRITTEN = (".html", ".png", ".svg", ".pdf", ".csv", ".nc", ".toml")  # files that commands write
GARBAGE = 300_000
"""Number of new objects after which garbage is collected: more than a verdict creates, some 2·10⁵ by imports and
formulas, most of which last. With Python's default of 700, collections take a tenth of the time of a verdict."""


class _Conversion:
    """Conversion of a parameter's value by Typer, but only of a value that is not yet what the command declares.

    Typer converts with pydantic, whose import takes a fifteenth of the time of a verdict.
    """

    def __init__(self, by_typer: Callable[[], Any]) -> None:
        self.by_typer = by_typer

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Convert a value; Typer calls this method with these argument names."""
        kind = param.type_descriptor.annotation
        if value is None:
            return () if param.multiple or param.nargs == -1 else None
        if type(value) is kind or (kind == list[str] and not isinstance(value, str)):
            return value
        if kind is Path and os.access(value, os.R_OK):
            return Path(value)
        return self.by_typer().coerce(value, param=param, ctx=ctx)


class _Converting:
    """Commands whose parameters are converted by `_Conversion`."""

    def get_params(self, ctx: Any) -> list[Any]:
        found: list[Any] = super().get_params(ctx)  # type: ignore[misc]  # method of the other base class, from Typer
        for one in found:
            if hasattr(one, "get_runtime_param") and "get_runtime_param" not in vars(one):  # Typer from 0.29
                one.get_runtime_param = partial(_Conversion, one.get_runtime_param)
        return found


class _Commands(_Converting, TyperGroup):
    """Group of commands that prints a message after Ctrl-C, unlike Typer's own."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as stopped:
            raise typer.Exit(print_message(str(stopped) or "before there was an answer", 130, "stopped")) from None


class _Command(_Converting, TyperCommand):
    """Command whose error for a surplus word suggests the option that was probably meant."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        ctx.allow_extra_args = True  # surplus words are returned, for an error with advice
        rest: list[str] = super().parse_args(ctx, args)
        if rest and not ctx.resilient_parsing:
            ctx.fail(self._surplus(rest[0]))
        return rest

    def _surplus(self, word: str) -> str:
        """Error message for a word that is neither an option nor an argument."""
        if "=" in word:
            option, advice = "--set", f"to change a value write --set '{word}'"
        elif word.lower().endswith(WRITTEN):
            option, advice = "--output", f"to write a file write -o {word}"
        else:
            option, advice = "--along", f"to name the parameter that is varied write --along {word}"
        known = any(option in one.opts for one in self.params)
        return f"{word!r} is a word too many{f'; {advice}' if known else ''}"


def _start(version: Annotated[bool, typer.Option("--version", help="print the version and stop")] = False) -> None:
    if version:
        print_text(f"steadyslip {program_version()}")
        raise typer.Exit


def _word(command: Callable[..., None]) -> str:
    """Name of a command on the command line, made from that of its function."""
    return command.__name__.rstrip("_")


def program_of(commands: Iterable[Callable[..., None]]) -> typer.Typer:
    """Program with the given commands."""
    program = typer.Typer(
        cls=_Commands,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        help="Stability of frictional sliding: will it slide steadily, what would make it, how far is the edge.",
    )
    program.callback(invoke_without_command=True)(_start)
    for command in commands:
        program.command(_word(command), cls=_Command)(command)
    return program


app = program_of(COMMANDS)


def main() -> None:
    """Run the command line and exit; entry point of the package."""
    gc.set_threshold(GARBAGE)
    asked = [command for command in COMMANDS if sys.argv[1:2] == [_word(command)]]
    end(program_of(asked) if asked else app)  # Typer reads the options of all commands, which takes time
