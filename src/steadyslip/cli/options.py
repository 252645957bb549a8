"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

RigFile = Annotated[Path, typer.Argument(metavar="RIG", help="rig file (TOML); see 'steadyslip schema'")]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="change a value, such as contact.angle='10 deg'; repeatable"),
]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON, in SI units")]
Branch = Annotated[int, typer.Option(help="which steady sliding, where there are several")]


def outputs(what: str) -> Any:
    """The option that names files to write."""
    return typer.Option("-o", "--output", help=f"{what}; repeatable")
