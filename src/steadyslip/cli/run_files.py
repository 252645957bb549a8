"""Simulation of a rig file with command-line options, and the files it is written to."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.progress import progress_text
from steadyslip.core.roles import Parameter
from steadyslip.files.html_document import write_page
from steadyslip.files.output import FIGURES, write_by_ending
from steadyslip.files.specifications import piece_from_text, read_protocol, read_rig
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion.result import History, check_contact
from steadyslip.motion.single import simulate
from steadyslip.protocol import Piece, Protocol

ENDINGS = (".nc", ".csv", ".html", *FIGURES)


def run_file(
    path: str | os.PathLike[str],
    changes: Iterable[str] = (),
    pieces: Iterable[str] = (),
    start: Iterable[str] = (),
    until: str | None = None,
    samples: int | None = None,
    method: str = "auto",
    rtol: float = 1e-7,
    contact: str | None = None,
) -> History:
    """Simulated motion of the rig of a file under its ``[protocol]`` and additional pieces.

    Parameters
    ----------
    path : path
    changes : iterable of str
        As in `read_rig`.
    pieces : iterable of str
        Pieces as text, see `piece_from_text`, added to those of the file.
    start : iterable of str
        Starting values as ``name=number`` in SI units.
    until : str, optional
        End of the run with its unit; by default that of the file.
    samples : int, optional
        Number of evenly spaced times to report at; by default the solver's own steps.
    method, rtol
        As in `simulate`.
    contact : str, optional
        Contact of a machine whose phase plane will be drawn; checked before the run.

    Raises
    ------
    ParameterError
        If the file or an argument is invalid; lists all problems.
    """
    rig, protocol = read_experiment(path, changes, pieces, until)
    check_contact(rig, contact)
    times = None if samples is None else np.linspace(0.0, protocol.until or np.nan, samples)
    with progress_of(protocol) as progress:
        return simulate(
            rig, protocol, initial=_starting_values(start), times=times, method=method, rtol=rtol, progress=progress
        )


def read_experiment(
    path: str | os.PathLike[str], changes: Iterable[str], pieces: Iterable[str], until: str | None, *,
    ends: bool = True,
) -> tuple[Slider | Machine, Protocol]:  # fmt: skip
    """Rig of a file, and its ``[protocol]`` with additional pieces, as for `run_file`; `ends`: an end is required.

    Raises
    ------
    ParameterError
        If the file or an argument is invalid; lists all problems.
    """
    changes = (changes,) if isinstance(changes, str) else tuple(changes)  # iterated twice
    rig = read_rig(path, changes)
    protocol = read_protocol(path, changes) or Protocol()
    added = _pieces(pieces, rig)
    end = protocol.until if until is None else _seconds(until)
    if end is None and ends:
        raise ParameterError(
            [Problem("until", "missing; give the end as --until '200 s', or write [protocol] with until in the file")]
        )
    return rig, Protocol(pieces=(*protocol.pieces, *added), until=end)


@contextmanager
def progress_of(protocol: Protocol) -> Iterator[Callable[[float], None]]:
    """Context that shows the progress of a run on a terminal; yields a function to call with the time reached (s)."""
    end = format_quantity(protocol.until or np.nan, "s")
    with progress_text("simulating") as show:
        yield lambda time: show(f"simulating, at {format_quantity(time, 's')} of {end}; Ctrl-C keeps what there is")


def _pieces(texts: Iterable[str], rig: Slider | Machine) -> list[Piece]:
    """Protocol pieces from texts; raises ParameterError with all problems."""
    found, problems = [], []
    for text in texts:
        if text.endswith(".toml"):
            message = (
                'is a file; allowed: a piece such as "hold at=10s". The protocol of a file is its table [protocol]'
            )
            problems.append(Problem(repr(text), f"{message}: copy that into the rig's"))
            continue
        try:
            found.append(piece_from_text(text, rig.area, rig))
        except ParameterError as error:
            problems += [problem.under(repr(text)) for problem in error.problems]
    if problems:
        raise ParameterError(problems)
    return found


def _seconds(text: str) -> float:
    """Time (s) from text with a unit or a number of seconds."""
    try:
        number: float | str = float(text)
    except ValueError:
        number = text
    try:
        return Parameter("s", positive, "end of the run").checked(number)
    except ParameterError as error:
        raise ParameterError([problem.under("until") for problem in error.problems]) from error


def _starting_values(texts: Iterable[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    problems = []
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        try:
            if not equals:
                raise ValueError
            found[name] = float(value)
        except ValueError:
            problems.append(Problem("initial", f"got {text!r}; write NAME=NUMBER in SI units, such as v=1.1e-6"))
    if problems:
        raise ParameterError(problems)
    return found


def write_history(
    history: History, path: Path, kind: str = "history", source: Path | None = None, contact: str | None = None
) -> None:  # fmt: skip
    """Write a run as netCDF, CSV, HTML document or figure, chosen by the ending of the name.

    A document contains the hash of `source`, the rig file of the run.

    Raises
    ------
    NotAvailable
        If the ending is none of these, or the file cannot be written.
    """
    writers = {
        ".nc": history.save,
        ".csv": history.to_csv,
        ".html": lambda p: write_page(history, p, "Run", source=source),
    }
    write_by_ending(path, writers, lambda: history.plot(kind, contact=contact), history)
