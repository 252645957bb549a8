"""Commands that need no rig: `examples`, `init`, `schema` and `reproduce`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from steadyslip.cli.answers import print_text


def reproduce(
    folder: Annotated[Path, typer.Argument(help="where to write; created if missing")] = Path("paper-figures"),
) -> None:
    """Draw the paper's figures and put its numbers next to ours."""
    from steadyslip.reproduce import paper_table, reproduce as run

    written = run(folder)
    print_text(str(paper_table()))
    for path in written:
        print_text(f"wrote {path}")


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


def schema() -> None:
    """Print the JSON schema of the files that are read: rigs, protocols, maps and fits."""
    from steadyslip.schemas import json_schema

    print_text(json.dumps(json_schema(), indent=2, ensure_ascii=False))
