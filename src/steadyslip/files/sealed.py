"""Sealed files: results written and read by this program, with kind, version of the layout and checksum.

A sealed file ends in one line of text after its content::

    steadyslip run 2 <sha256 of the purpose> <sha256 of all before>

Other programs can still open the file, since they ignore data after the content of their format. Reading first checks
size, kind, version and checksum. The seal detects damage and mistakes; it is no signature, so the content is checked
as well.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from os import PathLike
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.files.inputs import read_bytes
from steadyslip.files.output import whole_file

_LINE = re.compile(rb"\nsteadyslip ([a-z]{1,20}) ([0-9]{1,6}) ([0-9a-f]{64}) ([0-9a-f]{64})\n\Z")
_LONGEST = 180  # bytes; upper bound of the length of the seal line, which has at most 170
_DIGEST = 65  # bytes of the last field of the seal line, with line end


@dataclass(frozen=True)
class FileKind:
    """Kind of sealed file.

    Attributes
    ----------
    name : str
        One word in lower case.
    version : int
        Version of the layout; other versions are refused.
    most : int
        Largest size in bytes.
    remedy : str
        Advice in the error message for a file that cannot be read.
    """

    name: str
    version: int
    most: int
    remedy: str


def seal(content: bytes, kind: FileKind, of: str = "") -> bytes:
    """Content with its seal appended; `of` is the purpose of the file, which reading must give again."""
    line = f"\nsteadyslip {kind.name} {kind.version} {_name(of)} ".encode()
    digest = hashlib.sha256(content)
    digest.update(line)
    return b"".join((content, line, digest.hexdigest().encode(), b"\n"))


def unseal(raw: bytes, path: str | PathLike[str], kind: FileKind, of: str = "") -> memoryview:
    """Content of a sealed file without its seal, after all checks.

    Raises
    ------
    NotAvailable
        If `raw` is not a sealed file of this kind, version and purpose, or was changed.
    """

    def refusal(reason: str) -> NotAvailable:
        return NotAvailable(f"cannot read {str(path)!r}: {reason}; {kind.remedy}")

    found = _LINE.search(raw, max(0, len(raw) - _LONGEST))
    if found is None:
        raise refusal(
            f"it is not a steadyslip {kind.name}, is damaged, or was written by an earlier version or changed by "
            "another program"
        )
    content = memoryview(raw)
    if hashlib.sha256(content[: len(raw) - _DIGEST]).hexdigest().encode() != found[4]:
        raise refusal("it is damaged: its content has changed since it was written")
    if found[1] != kind.name.encode():
        raise refusal(f"it holds a {found[1].decode()} and is not a steadyslip {kind.name}")
    if int(found[2]) != kind.version:
        raise refusal(f"its layout has version {int(found[2])}, and this program reads version {kind.version}")
    if found[3] != _name(of).encode():
        raise refusal(f"it is a {kind.name} of something else")
    return content[: found.start()]


def write_sealed(
    path: str | PathLike[str], content: bytes, kind: FileKind, of: str = "", *, private: bool = False
) -> None:
    """Write a sealed file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    NotAvailable
        If it cannot be written, or exceeds the size allowed for reading.
    """
    sealed = seal(content, kind, of)
    if len(sealed) > kind.most:
        size = f"has {len(sealed) / 2**20:.0f} MiB, more than the {kind.most // 2**20} MiB that a {kind.name} may have"
        raise NotAvailable(f"cannot write {str(path)!r}: it {size}")
    with whole_file(path, private=private) as temporary, open(temporary, "wb") as file:
        file.write(sealed)


def read_sealed(path: str | PathLike[str], kind: FileKind, of: str = "", *, private: bool = False) -> memoryview:
    """Content of a file written by `write_sealed`; `private` raises an error if other users can change the file.

    Raises
    ------
    NotAvailable
        If it cannot be read, or fails a check of `unseal`.
    """
    return unseal(read_bytes(path, kind.most, private=private), path, kind, of)


def holds(path: str | PathLike[str], kind: FileKind) -> bool:
    """True if the seal line of a file names this kind; the content is not checked.

    Raises
    ------
    NotAvailable
        If it cannot be read.
    """
    found = _LINE.search(read_bytes(path, kind.most)[-_LONGEST:])
    return found is not None and found[1] == kind.name.encode()


def fingerprint(data: Any) -> str:
    """SHA-256 (hex) of plain data as JSON, independent of the order of keys."""
    return hashlib.sha256(json.dumps(data, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _name(of: str) -> str:
    return hashlib.sha256(of.encode()).hexdigest()
