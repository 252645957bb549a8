"""The command line in this process: what is asked of it is its answers, not the start of an interpreter."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

from steadyslip import cli
from steadyslip.core.records import FrozenRecord


def run(*arguments: object, folder: Path | None = None, together: bool = False) -> subprocess.CompletedProcess[str]:
    """Status, output and error output of ``steadyslip ...``; the latter within the output if `together`.

    Laws that tests have registered are not there, as in a fresh process.
    """
    words = ["steadyslip", *map(str, arguments)]
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    err = out if together else io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    status: object = 0
    with contextlib.ExitStack() as stack:
        stack.enter_context(patch.object(sys, "argv", words))
        stack.enter_context(patch.dict(os.environ, {"COLUMNS": "80"}))
        stack.enter_context(without_laws_of_tests())
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        if folder is not None:
            stack.enter_context(contextlib.chdir(folder))
        try:
            cli.main()
        except SystemExit as stop:
            status = stop.code
    texts = [stream.buffer.getvalue().decode("utf-8") for stream in (out, err)]
    return subprocess.CompletedProcess(words, status or 0, texts[0], "" if together else texts[1])


@contextlib.contextmanager
def without_laws_of_tests():
    """Only the laws that come with the package are registered, whatever ran before."""
    with contextlib.ExitStack() as stack:
        for family in families(FrozenRecord):
            own = {name: law for name, law in family.registry.items() if law.__module__.startswith("steadyslip.")}
            stack.enter_context(patch.object(family, "registry", own))
        yield


def families(base: type[FrozenRecord]) -> list[type[FrozenRecord]]:
    """All families of laws: classes with a registry of their own."""
    below = [family for inner in base.__subclasses__() for family in families(inner)]
    return ([base] if "registry" in vars(base) and base is not FrozenRecord else []) + below
