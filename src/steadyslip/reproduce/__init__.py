"""Figures and numbers of Dupont & Bapna (1994), recomputed with this package.

`drawings.py` has the rig and the figures of the paper (`FIGURES`), `paper_numbers.py` compares its numbers with ours.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from steadyslip.core.errors import SteadyslipError
from steadyslip.core.progress import progress_bar
from steadyslip.figures import style
from steadyslip.reproduce.drawings import D_C, FIGURES, V0, PaperFigure, paper_rig
from steadyslip.reproduce.paper_numbers import PaperNumber, PaperTable, paper_table

__all__ = [
    "D_C",
    "FIGURES",
    "V0",
    "OutputError",
    "PaperFigure",
    "PaperNumber",
    "PaperTable",
    "paper_rig",
    "paper_table",
    "reproduce",
]  # fmt: skip


class OutputError(SteadyslipError, OSError):
    """The output folder cannot be created or written to."""


def reproduce(folder: str | PathLike[str], *, progress: bool | None = None) -> list[Path]:
    """Write the paper's figures and the table of its numbers to a folder; returns the paths of the files.

    Parameters
    ----------
    folder : path
        Output folder, created if missing. Files with equal names are replaced.
    progress : bool, optional
        If True, show a progress bar; by default only on a terminal. Ctrl-C keeps the files written so far.

    Returns
    -------
    list of Path
        ``fig1.png``, ``fig1.svg``, ... for every figure; ``paper-numbers.md``, ``paper-numbers.csv``.

    Raises
    ------
    OutputError
        If the folder cannot be created or written to.
    """
    folder = Path(folder)
    written: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with progress_bar(len(FIGURES) + 1, progress, "figures and table") as advanced:
            for figure in FIGURES:
                written += style.save_figure(figure.draw(style.unmanaged_axes()), folder / figure.name)
                if advanced is not None:
                    advanced(1)
            table = paper_table()
        for suffix, text in (("md", table.markdown()), ("csv", table.csv())):
            path = folder / f"paper-numbers.{suffix}"
            path.write_text(text, encoding="utf-8", newline="\n")
            written.append(path)
    except KeyboardInterrupt:
        names = ", ".join(path.name for path in written) or "none"
        raise KeyboardInterrupt(f"these files are written: {names}") from None
    except OSError as error:
        raise OutputError(
            f"folder: got {str(folder)!r}, which cannot be written ({error.strerror or error}); "
            "allowed: a folder, existing or new, where files may be created"
        ) from error
    return written
