"""Safe reading of files from outside: regular files of bounded size, opened without blocking."""

from __future__ import annotations

import os
import stat
from os import PathLike
from pathlib import Path

from steadyslip.core.errors import NotAvailable

MOST_TEXT = 2**20
"""Largest allowed size of a hand-written file (rig, protocol, map, fit), bytes; by trial, far above real ones."""
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)


class UnreadableFile(NotAvailable):
    """Error: a file cannot be read.

    Attributes
    ----------
    reason : str
        Reason without the file's name: ``no such file``, ``it is a pipe; give a regular file``, ...
    """

    def __init__(self, name: str, reason: str) -> None:
        self.reason = reason
        super().__init__(f"cannot read {name!r}: {reason}")


def read_bytes(path: str | PathLike[str], most: int, *, links: bool = True, private: bool = False) -> bytes:
    """Content of a regular file.

    The file is opened before it is checked, so that it cannot be replaced in between. Opening a pipe does not block,
    and no more bytes are read than allowed, whatever size the file system reports.

    Parameters
    ----------
    path : path
    most : int
        Largest allowed size in bytes.
    links : bool
        True if `path` itself may be a symbolic link.
    private : bool
        True to raise an error for a file that other users can change.

    Raises
    ------
    UnreadableFile
        If it is not a regular file, larger than allowed, or cannot be read.
    """
    name = str(path)
    if "\0" in name:
        raise UnreadableFile(name, "file names cannot contain a null character")
    try:
        descriptor = os.open(path, _FLAGS | (0 if links else getattr(os, "O_NOFOLLOW", 0)))
    except OSError as error:
        raise UnreadableFile(name, _reason(error)) from error
    try:
        found = os.fstat(descriptor)
        check_kind(name, found)
        if private and not is_private(found):
            raise UnreadableFile(name, "others can change it")
        _check_size(name, found.st_size, most)
        parts, left = [], most + 1
        while left and (part := os.read(descriptor, min(left, 2**24))):
            parts.append(part)
            left -= len(part)
    except OSError as error:
        raise UnreadableFile(name, _reason(error)) from error
    finally:
        os.close(descriptor)
    content = parts[0] if len(parts) == 1 else b"".join(parts)
    _check_size(name, len(content), most)  # the file may have grown since, or its file system reports no sizes
    return content


def check_file(path: str | PathLike[str], most: int) -> int:
    """Size of a file in bytes, after the checks of `read_bytes`; for files that other libraries open by name.

    Raises
    ------
    UnreadableFile
    """
    name = str(path)
    try:
        found = os.stat(path)
    except (OSError, ValueError) as error:
        raise UnreadableFile(name, _reason(error)) from error
    check_kind(name, found)
    _check_size(name, found.st_size, most)
    return found.st_size


def inside(root: Path, key: str) -> Path:
    """Path in the folder `root` for a `key` such as ``rate/c/0/1``, which joins names by ``/``; it need not exist.

    Raises
    ------
    UnreadableFile
        If the key leads out of the folder, or through a symbolic link.
    """
    path = root
    for part in key.split("/"):
        path = path / part
        if part in ("", ".", "..") or "\0" in part:
            raise UnreadableFile(str(path), "no file has this name")
        if path.is_symlink():
            raise UnreadableFile(str(path), "it is a symbolic link, which may lead anywhere; remove it")
    return path


def check_room(path: Path) -> Path:
    """Return the path of a file to be written, after a check that the path is not a folder.

    Raises
    ------
    UnreadableFile
        If it is a folder.
    """
    if path.is_dir():
        raise UnreadableFile(str(path), "it is a folder, not a file; give another name, or move the folder")
    return path


def check_kind(name: str, found: os.stat_result) -> None:
    """Raise an error unless a file is regular.

    Raises
    ------
    UnreadableFile
    """
    if not stat.S_ISREG(found.st_mode):
        raise UnreadableFile(name, f"it is {_KINDS.get(stat.S_IFMT(found.st_mode), 'special')}; give a regular file")


def is_private(found: os.stat_result) -> bool:
    """True if only this user, the owner, may write to a file or folder, or if the system has no owners."""
    if not hasattr(os, "getuid"):
        return True
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _check_size(name: str, size: int, most: int) -> None:
    if size > most:
        raise UnreadableFile(name, f"it has {_shown(size)}, more than the {_shown(most)} allowed")


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return (getattr(error, "strerror", None) or str(error)).lower()


def _shown(size: int) -> str:
    """Number of bytes as text, in bytes, kiB, MiB or GiB."""
    for unit in ("bytes", "kiB", "MiB"):
        if size < 10_000:
            return f"{size} {unit}"
        size = -(-size // 1024)
    return f"{size} GiB"
