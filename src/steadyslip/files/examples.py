"""Example files that come with the package: list, text and copies."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

from steadyslip.core.errors import NotAvailable
from steadyslip.files.output import whole_file

_PACKAGE = Path(__file__).parents[1]
_PLACES = (_PACKAGE / "examples", _PACKAGE.parents[1] / "examples")
"""Folders of the examples: in an installed package, and in a checkout of the repository (the original)."""
_HEADLINE = re.compile(r"(?s)# (.*?)(?:[.](?=\s+[A-Z])|[:;]\s|\?|\s\(|[.]?\s*\Z)")
"""First statement of the comment at the head of a file, without text in brackets."""


def example_files() -> dict[str, str]:
    """First statement of each example file by name, such as ``machines/feed-axis.toml``; empty for data files.

    Raises
    ------
    NotAvailable
        If the package was installed without them.
    """
    folder = _folder()
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc")  # pip makes .pyc files
    found = sorted(path.relative_to(folder).as_posix() for path in files)
    return {name: _headline(folder / name) for name in sorted(found, key=lambda name: (name.count("/"), name))}


def copy_examples(folder: str | PathLike[str]) -> list[Path]:
    """Copy all example files into a folder, created if missing; returns their paths.

    Files that exist with the same content are kept; nothing is written if any file has other content.

    Raises
    ------
    NotAvailable
        If a file in the folder differs from the example of that name, or a file cannot be written.
    """
    source, goal = _folder(), Path(folder)
    contents = {goal / name: (source / name).read_bytes() for name in example_files()}
    try:
        changed = [str(path) for path, content in contents.items() if path.exists() and path.read_bytes() != content]
        if changed:
            raise NotAvailable(
                f"cannot copy the examples to {str(goal)!r}: {', '.join(changed)} differ from the examples;"
                " name another folder, or move them"
            )
        for path, content in contents.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as temporary:
                Path(temporary).write_bytes(content)
    except OSError as error:
        raise NotAvailable(f"cannot copy the examples to {str(goal)!r}: {error.strerror or error}") from error
    return list(contents)


def example_text(name: str) -> str:
    """Text of an example file, such as ``machines/feed-axis.toml``.

    Raises
    ------
    NotAvailable
        If the package was installed without them.
    """
    return (_folder() / name).read_text(encoding="utf-8")


def _folder() -> Path:
    for place in _PLACES:
        if (place / "inclined-spring.toml").is_file():
            return place
    raise NotAvailable("this installation has no examples; install the wheel or work in a checkout")


def _headline(path: Path) -> str:
    """First statement of the comment at the head of a TOML file, or the title of a notebook; empty for other files."""
    if path.suffix == ".ipynb":
        title = re.search(r'"# (.*?)(?:\\n)?"', path.read_text(encoding="utf-8"))
        return title[1] if title else ""
    if path.suffix != ".toml":
        return ""
    head = re.match(r"(?:#.*\n)*", path.read_text(encoding="utf-8"))
    words = " ".join(line.removeprefix("#").strip() for line in (head[0] if head else "").splitlines())
    found = _HEADLINE.match(f"# {words}")
    return found[1] if found else ""
