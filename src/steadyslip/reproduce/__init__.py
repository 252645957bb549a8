"""The figures and numbers of Dupont & Bapna (1994), from this package's general route.

rig -> numbers (paper beside ours), drawings (each figure) -> files. Another figure is one more entry of `FIGURES`.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from steadyslip.core.errors import SteadyslipError
from steadyslip.core.progress import progress_bar
from steadyslip.figures import style
from steadyslip.reproduce.drawings import FIGURES, PaperFigure
from steadyslip.reproduce.numbers import PaperNumber, PaperTable, paper_table
from steadyslip.reproduce.rig import D_C, V0, paper_rig

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
    """Results cannot be written where they were asked for."""


def reproduce(folder: str | PathLike[str], *, progress: bool | None = None) -> list[Path]:
    """Write the paper's figures and the table of its numbers.

    Parameters
    ----------
    folder : path
        Where to write; created if missing. Files of the same names are replaced.
    progress : bool, optional
        Whether to show a progress bar; on a terminal unless given. Ctrl-C leaves the files that are written.

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
        for path, text in (
            (folder / "paper-numbers.md", table.markdown()),
            (folder / "paper-numbers.csv", table.csv()),
        ):
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
