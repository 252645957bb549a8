"""Which program this is: its release, and a digest of the files that it consists of."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any

RELEASE = "0.2.0"
KINDS = (".py", ".pyi", ".js", ".css", ".json")
"""Endings of the files that the package consists of."""


@lru_cache(maxsize=1)
def version() -> str:
    """The release and a digest, such as ``0.2.0+s3f9c12ab``: another one as soon as a file of the package is another.

    Alike in a checkout, a wheel and a source distribution, on every system; kept from the first call on.
    """
    return f"{RELEASE}+s{digest(Path(__file__).parents[1])}"


def digest(folder: Path) -> str:
    """Eight letters that stand for the names and contents of a package's files, however their lines end."""
    from hashlib import sha256  # slow to import

    found = sha256()
    for name in sorted(_files(str(folder), "")):
        content = Path(folder, name).read_bytes()
        if b"\r" in content:
            content = content.replace(b"\r\n", b"\n")
        found.update(f"{name}\n{len(content)}\n".encode() + content)
    return found.hexdigest()[:8]


def _files(folder: str, above: str) -> list[str]:
    names: list[str] = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(KINDS) and not entry.name.startswith("."):
                names.append(above + entry.name)
            elif entry.is_dir() and entry.name != "__pycache__":
                names += _files(entry.path, f"{above}{entry.name}/")
    return names


def stamped(answer: Any) -> Any:
    """An answer as plain data, with the version that gave it unless it says that itself; lists are left as they are."""
    return {"version": version()} | answer if isinstance(answer, dict) else answer


def of_another(made: str) -> str:
    """What to say of an answer that another version gave, which may have been right to another digit or wrong."""
    from steadyslip import __version__

    return "" if made == __version__ else f"computed by steadyslip {made}, this is {__version__}"
