"""Output files: endings are checked before anything is computed; files are replaced only by complete ones."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.core.pictures import drawn_for_file, save

_NO_FILES = ("/dev", "/proc", "/sys")
FIGURES = (".png", ".svg", ".pdf")


class OutputClosed(Exception):
    """Error: the reader of the standard output has closed it, as ``| head`` does."""


@contextmanager
def answering() -> Iterator[None]:
    """Context that flushes the standard output at its end and translates errors of writing.

    Raises
    ------
    OutputClosed
    NotAvailable
        If the standard output cannot be written, as on a full disk.
    """
    try:
        yield
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        discard_output()
        raise OutputClosed from None
    except OSError as error:
        discard_output()
        raise NotAvailable(f"cannot write to the standard output: {error.strerror or error}") from error


def discard_output() -> None:
    """Redirect the standard output to the null device, so that no write error occurs when Python exits."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


def check_output(paths: Iterable[Path], allowed: Sequence[str]) -> None:
    """Raise an error for files that cannot be written, before anything is computed.

    Raises
    ------
    NotAvailable
        If an ending is unknown, or the folder does not exist.
    """
    for path in paths:
        if path.suffix.lower() not in allowed:
            raise NotAvailable(f"cannot write {str(path)!r}: allowed endings are {', '.join(allowed)}")
        if not path.parent.is_dir():
            raise NotAvailable(f"cannot write {str(path)!r}: there is no folder {str(path.parent)!r}")


def write_by_ending(
    path: Path, writers: Mapping[str, Callable[[Path], object]], figure: Callable[[], Any], result: Any
) -> None:
    """Write a file with the writer for its ending, else the figure (Axes or an array of Axes) of a result.

    Raises
    ------
    NotAvailable
        If the ending is unknown or the file cannot be written.
    """
    check_output([path], (*writers, *FIGURES))
    ending = path.suffix.lower()
    try:
        if ending in writers:
            writers[ending](path)
            return
        axes = drawn_for_file(figure)
        with whole_file(path) as temporary:
            save(axes, temporary, result)
    except OSError as error:
        raise NotAvailable(f"cannot write {str(path)!r}: {error.strerror or error}") from error


@contextmanager
def whole_file(path: str | PathLike[str], *, private: bool = False) -> Iterator[str]:
    """Context with the name of a temporary file that replaces `path` at the end, if no error occurred.

    If `path` is a symbolic link, its target is replaced. A `private` file is readable by its owner only, and replaces
    the link itself.

    Raises
    ------
    NotAvailable
        If the file cannot be written, or `path` is a device, pipe or folder.
    """
    target, temporary = Path(path) if private else Path(os.path.realpath(path)), ""
    _refuse_other_than_files(path, target)
    try:
        descriptor, temporary = tempfile.mkstemp(dir=target.parent or Path(), suffix=target.suffix)
        os.close(descriptor)
        yield temporary
        if not private:
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(temporary, 0o666 & ~mask)  # mkstemp restricts it to the owner
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError):
            raise NotAvailable(f"cannot write {str(path)!r}: {error.strerror or error}") from error
        raise


def _refuse_other_than_files(path: str | PathLike[str], target: Path) -> None:
    """Raise an error unless the target is a file or absent; names such as /dev/stdout always raise one."""
    named = Path(os.path.abspath(path))
    place = any(named.is_relative_to(folder) for folder in _NO_FILES) and not named.is_relative_to("/dev/shm")
    if place or (target.exists() and not target.is_file()):
        kind = "a folder" if target.is_dir() else "a device or a pipe"
        raise NotAvailable(f"cannot write {str(path)!r}: it is {kind}; give the name of a file")


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write text as UTF-8.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    with whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8", newline="\n")


def write_columns(path: str | PathLike[str], columns: Mapping[str, Iterable[Any]], form: str) -> None:
    """Write columns as comma-separated text under their titles.

    Parameters
    ----------
    columns : mapping of str to iterable
        Numbers or text, as many in each; None leaves a cell empty.
    form : str
        Format of numbers, such as ``%.12g``.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """

    def quoted(one: str) -> str:
        return '"' + one.replace('"', '""') + '"' if set(one) & set(',"\n') else one

    def cells(column: Iterable[Any]) -> Iterable[str]:
        if getattr(getattr(column, "dtype", None), "kind", "") == "f":
            return map(form.__mod__, column.tolist())  # type: ignore[attr-defined]  # an array, often a long one
        return (quoted(one) if isinstance(one, str) else "" if one is None else form % one for one in column)

    rows = zip(*map(cells, columns.values()), strict=True)
    with whole_file(path) as temporary, Path(temporary).open("w", encoding="utf-8", newline="\n") as target:
        target.writelines(f"{','.join(row)}\n" for row in chain([map(quoted, columns)], rows))


def write_dataset(dataset: Any, path: str | PathLike[str]) -> None:
    """Write an xarray.Dataset as netCDF; an existing file is replaced only when the new one is complete.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    with whole_file(path) as temporary:
        dataset.to_netcdf(temporary, engine="netcdf4")
