"""Reading of protocols from rig files and command lines."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from os import PathLike

from steadyslip.core.errors import InternalError, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.files.specifications.changes import value_of
from steadyslip.files.specifications.layout import selector
from steadyslip.files.specifications.read import protocol_of, text_of
from steadyslip.files.specifications.tables import TableReader
from steadyslip.files.specifications.toml import Table
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.protocol import Piece, Protocol


@checked()
def read_protocol(path: str | PathLike[str], changes: Iterable[str] = ()) -> Protocol | None:
    """Read the protocol of a rig file, or of a file with only the table ``[protocol]``.

    Parameters
    ----------
    path : path
        TOML file, UTF-8.
    changes : iterable of str
        Values that replace or add to those of the file, as ``"protocol.pieces.1.to=2 um/s"``.

    Returns
    -------
    Protocol or None
        None if the file has no such table.

    Raises
    ------
    RigFileError
        If the file cannot be read or anything in it is wrong (the rig included).

    Examples
    --------
    >>> ss.read_protocol("examples/stick-slip.toml").until
    500.0
    """
    return protocol_from_text(text_of(path), str(path), changes)


@checked()
def protocol_from_text(text: str, source: str = "rig", changes: Iterable[str] = ()) -> Protocol | None:
    """Read the protocol from the text of a rig file; see `read_protocol`.

    Examples
    --------
    >>> from pathlib import Path
    >>> ss.protocol_from_text(Path("examples/stick-slip.toml").read_text())
    Protocol(until=500.0, pieces=(VelocityStep(at=100.0, to=5e-06), Hold(at=300.0, duration=100.0)))
    """
    return protocol_of(text, source, changes)


@checked()
def piece_from_text(text: str, area: float | None = None, machine: Slider | Machine | None = None) -> Piece:
    """Read one piece of a protocol from a line of text.

    Parameters
    ----------
    text : str
        Kind, then KEY=VALUE, as in ``"velocity-step at=10s to='2 um/s'"``; quoted as in a shell.
    area : float, optional
        Contact area of the rig, m^2; with it stresses are given as forces, as in a rig file.
    machine : Machine, optional
        Machine that the piece acts on: values are then forces, and angles if its load point turns. No effect for a
        slider.

    Raises
    ------
    ParameterError
        If anything is wrong; lists every problem.

    Examples
    --------
    >>> ss.piece_from_text("velocity-step at=10s to='2 um/s'")
    VelocityStep(at=10.0, to=2e-06)
    """
    try:
        kind, *words = shlex.split(text)
    except ValueError as error:
        message = f"{error}" if text.strip() else f"is empty; write KIND KEY=VALUE ..., {_kinds()}"
        raise ParameterError([Problem("piece", message)], title=repr(text)) from error
    reader = TableReader()
    reader.area = area
    table: Table = {selector(Piece)[0]: kind}
    for word in words:
        name, equals, raw = word.partition("=")
        if not (equals and name and raw):
            reader.problem(word, "is not KEY=VALUE, such as at=10s; put quotes around a value with blanks")
        elif name in table:
            reader.problem(name, "is given twice")
        else:
            table[name] = value_of(raw, name)
    with reader.of_rig(machine):
        piece = reader.record(Piece, table, "")
    if reader.problems:
        raise ParameterError(reader.problems, title=repr(text))
    if not isinstance(piece, Piece):
        raise InternalError(f"a piece of a protocol, not a {type(piece).__name__}")
    return piece


def _kinds() -> str:
    return f"KIND one of {', '.join(Piece.registry)}"
