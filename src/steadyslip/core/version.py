"""Version of the program: release number and a digest of its source files."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any

RELEASE = "0.2.0"
KINDS = (".py", ".pyi", ".js", ".css", ".json", ".toml")
"""Extensions of the package's source files."""


@lru_cache(maxsize=1)
def version() -> str:
    """Release and digest, such as ``0.2.0+s3f9c12ab``; any change of a source file changes the digest (cached).

    The digest is the same in a checkout, a wheel and a source distribution, on every system.
    """
    return f"{RELEASE}+s{digest(Path(__file__).parents[1])}"


def digest(folder: Path) -> str:
    """First eight hexadecimal digits of the SHA-256 of a folder's file names and contents, with LF line endings."""
    from hashlib import sha256  # slow to import

    found = sha256()
    for name in sorted(_files(str(folder), "")):
        content = Path(folder, name).read_bytes()
        if b"\r" in content:
            content = content.replace(b"\r\n", b"\n")
        found.update(f"{name}\n{len(content)}\n".encode() + content)
    return found.hexdigest()[:8]  # 32 bits are enough to distinguish versions


def _files(folder: str, above: str) -> list[str]:
    names: list[str] = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(KINDS) and not entry.name.startswith("."):
                names.append(above + entry.name)
            elif entry.is_dir() and entry.name not in ("__pycache__", "examples"):  # the wheel holds examples too
                names += _files(entry.path, f"{above}{entry.name}/")
    return names


def stamped(answer: Any) -> Any:
    """Copy of a dict of results, or of each dict in a list, with the program's version added unless it has one."""
    if isinstance(answer, list):
        return [stamped(one) for one in answer]
    return {"version": version()} | answer if isinstance(answer, dict) else answer


def of_another(made: str) -> str:
    """Note that a result was computed by the version `made`; empty if `made` is this version."""
    return "" if made == (own := version()) else f"computed by steadyslip {made}, this is {own}"
