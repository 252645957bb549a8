"""Cycles, thresholds, hunting, responses and frozen verdicts of rig files, and the files they are written to."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from steadyslip.cli.run_files import progress_of, read_experiment
from steadyslip.core.areas import outside
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, QuantityError
from steadyslip.core.format import format_quantity
from steadyslip.core.progress import progress_text
from steadyslip.core.quantities import parse
from steadyslip.files.html_document import write_page
from steadyslip.files.output import FIGURES, write_by_ending, write_dataset
from steadyslip.files.specifications import read_rig
from steadyslip.linear.boundary import margins, oscillatory_edge
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.forced import amplitude_unit, response
from steadyslip.nonlinear.frequency_response import FrequencyResponse
from steadyslip.nonlinear.frozen import FrozenVerdicts, frozen_verdicts
from steadyslip.nonlinear.hunting.hunt import hunt
from steadyslip.nonlinear.hunting.hunt_result import Hunt
from steadyslip.nonlinear.kicks.kicks import kicks_of
from steadyslip.nonlinear.kicks.several_kicks import Thresholds, thresholds_shown
from steadyslip.nonlinear.orbits.at_value import own_motion
from steadyslip.nonlinear.orbits.branch import CycleBranch
from steadyslip.nonlinear.orbits.cycle import Cycle
from steadyslip.nonlinear.orbits.follow import cycles

ENDINGS = (".nc", ".csv", ".html", *FIGURES)
KICKED = (".html", *FIGURES)
ANSWERED = (".csv", ".html", *FIGURES)


def cycles_of_file(
    path: str | os.PathLike[str], changes: Iterable[str], along: str | None, between: Sequence[str] | None,
    doublings: int, say: Callable[[str], None],
) -> CycleBranch:  # fmt: skip
    """Branch of cycles by `steadyslip.cycles` for the rig of a file; shows progress on a terminal.

    The default of `along` is a slider's stiffness, or the link or drive parameter of a machine with the nearest
    oscillatory edge. The motion of the rig itself, a text that takes about a second, is passed to `say` before the
    branch is followed, which may take much longer.
    """
    rig = read_rig(path, changes)
    with progress_text("the motion of the rig itself"):
        own = own_motion(rig, along or "drive.velocity")
    if own:
        say(own)
    along = along or rig.default_along or _nearest_oscillation(rig)
    with progress_text("following cycles; Ctrl-C keeps what there is") as show:

        def progress(count: int, cycle: Cycle) -> None:
            show(f"{count} cycles, period {format_quantity(cycle.period, 's')}; Ctrl-C keeps what there is")

        found = cycles(rig, along, between=between, doublings=doublings, progress=progress)
        show("the cycle at the rig itself")
        found.at_rig  # noqa: B018  (computed here and cached, for printing and writing)
        return found


def _nearest_oscillation(machine: Slider | Machine) -> str:
    """Name of the link or drive parameter with the nearest oscillatory edge; of any parameter if these have none."""
    found = margins(machine)
    built = [one for one in found if one.parameter.startswith(("links.", "drive."))]
    nearest = oscillatory_edge(built) or oscillatory_edge(found)
    if nearest is None:
        raise NotAvailable(
            "no parameter has an oscillatory edge in its range, so none is chosen; name one with --along NAME"
        )
    return nearest.parameter


def write_branch(branch: CycleBranch, path: Path, source: Path | None = None) -> None:
    """Write a branch as netCDF, columns, document or figure, by the ending of the name.

    A document has the hash of `source`, the rig file.

    Raises
    ------
    NotAvailable
        If the ending is another one, or the file cannot be written.
    """
    writers = {
        ".nc": lambda p: write_dataset(branch.to_xarray(), p),
        ".csv": branch.to_csv,
        ".html": lambda p: write_page(branch, p, "Cycles", source=source),
    }
    write_by_ending(path, writers, branch.plot, branch)


def thresholds_of_file(
    path: str | os.PathLike[str], changes: Iterable[str], kicks: Iterable[str], reverse: bool, reference: str,
    at: str | None = None, up_to: float | None = None,
) -> Thresholds:  # fmt: skip
    """Thresholds of the rig of a file for the given kinds of kick; by default for the usual kinds."""
    rig = read_rig(path, changes)
    usual = tuple(name for name, kick in kicks_of(rig).items() if kick.usual)
    options = {"at": at, "direction": -1 if reverse else 1, "reference": reference, "up_to": up_to}
    return thresholds_shown(rig, tuple(kicks) or usual, **options)


def write_thresholds(thresholds: Thresholds, path: Path, source: Path | None = None) -> bool:
    """Write thresholds as document, or the rig's basin as figure, by the ending; True if Ctrl-C stopped the basin.

    A document has the hash of `source`, the rig file.

    Raises
    ------
    NotAvailable
        If the ending is another one, or the file cannot be written.
    """
    writers = {".html": lambda p: write_page(thresholds, p, "Kicks", source=source)}
    write_by_ending(path, writers, lambda: thresholds.basin.plot(), thresholds)
    return path.suffix.lower() != ".html" and thresholds.basin.interrupted


def hunt_of_file(
    path: str | os.PathLike[str], changes: Iterable[str], pieces: Iterable[str], until: str | None, rtol: float
) -> Hunt:
    """Result of `steadyslip.hunt` for rig and protocol of a file and additional pieces (text); shows progress.

    Raises
    ------
    ParameterError
        If the file or an argument is invalid; lists all problems.
    """
    rig, protocol = read_experiment(path, changes, pieces, until, ends=False)
    with progress_text("hunting") as show:

        def progress(time: float, strokes: int) -> None:
            show(f"hunting, {strokes} strokes by {format_quantity(time, 's')}")

        return hunt(rig, protocol, rtol=rtol, progress=progress)


def response_of_file(
    path: str | os.PathLike[str], changes: Iterable[str], periods: tuple[str, str], points: int,
    amplitudes: Iterable[str], input: str, output: str | None, on: str | None, limits: bool,
) -> FrequencyResponse:  # fmt: skip
    """Result of `steadyslip.response` for the rig of a file, at `points` periods between the two `periods`.

    Raises
    ------
    ParameterError
        If a period is not a time, or an amplitude has the wrong unit.
    """
    rig = read_rig(path, changes)
    low, high = (_quantity("--periods", text, "s") for text in periods)
    if not 0 < low < high:
        raise ParameterError(
            [Problem("--periods", f"got {periods[0]} {periods[1]}; allowed: a time > 0, and a longer one")]
        )
    factor, unit = outside(amplitude_unit(rig, input, on), rig.area)
    sizes = [_quantity("--amplitude", text, unit) / factor for text in amplitudes]
    return response(
        rig, np.geomspace(low, high, points), input=input, output=output, on=on, amplitudes=sizes, limits=limits
    )


def _quantity(option: str, text: str, unit: str) -> float:
    """Value of a command-line option in SI units; raises ParameterError that names the option."""
    try:
        return parse(text, unit)
    except QuantityError as error:
        raise ParameterError([Problem(option, str(error))]) from error


def write_answers(found: FrequencyResponse | FrozenVerdicts | Hunt, path: Path, title: str, source: Path) -> None:
    """Write columns, a document with the hash of `source`, or a figure, by the ending of the name.

    Raises
    ------
    NotAvailable
        If the ending is another one, or the file cannot be written.
    """
    writers = {".csv": found.to_csv, ".html": lambda p: write_page(found, p, title, source=source)}
    write_by_ending(path, writers, lambda: found.plot()[0], found)


def verdicts_of_file(
    path: str | os.PathLike[str], changes: Iterable[str], pieces: Iterable[str], until: str | None, rtol: float
) -> FrozenVerdicts:
    """Result of `steadyslip.frozen_verdicts` for rig and protocol of a file, and additional pieces given as text.

    Raises
    ------
    ParameterError
        If the file or an argument is invalid; lists all problems.
    """
    rig, protocol = read_experiment(path, changes, pieces, until)
    with progress_of(protocol) as progress:
        return frozen_verdicts(rig, protocol, rtol=rtol, progress=progress)
