"""Input files, output files and JSON of the command ``steadyslip fit``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.core.version import stamped
from steadyslip.experiments.answers.laws import LawComparison
from steadyslip.experiments.answers.population import Population
from steadyslip.experiments.answers.step_table import StepTable
from steadyslip.experiments.answers.uncertainty import Draws
from steadyslip.experiments.fitting.machines.machine_result import MachineFit
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.speed_result import SpeedFit
from steadyslip.files.html_document import write_page
from steadyslip.files.output import FIGURES, write_by_ending, write_text

TABLES = (".csv", ".tex")
SPEED_ENDINGS = (".toml", ".json")
ENDINGS = (".nc", ".html", ".json", *TABLES, *FIGURES)


def split_files(files: Sequence[Path]) -> tuple[list[Path], Path | None]:
    """Paths of records, and path of the fit file, which ends in .toml (None if there is none).

    Raises
    ------
    NotAvailable
        If there is no record, or more than one file of the fit.
    """
    specs = [path for path in files if path.suffix.lower() == ".toml"]
    records = [path for path in files if path not in specs]
    if not records:
        raise NotAvailable("no record given; write steadyslip fit RECORD... [SPEC.toml]")
    if len(specs) > 1:
        raise NotAvailable(f"got {len(specs)} files that end in .toml; allowed: one, which says how to fit")
    return records, specs[0] if specs else None


def write_fit(fit: Fit | MachineFit, comparison: LawComparison | None, path: Path, draws: Draws | None = None,
    table: StepTable | None = None,
) -> None:  # fmt: skip
    """Write a fit in the format that the file's ending names; HTML includes the draws, JSON the table of steps.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """

    def as_text(target: Path) -> None:
        write_text(target, json.dumps(as_json(fit, comparison, table), indent=2, allow_nan=False) + "\n")

    def as_page(target: Path) -> None:
        write_page(fit, target, "Fit", comparison=comparison, draws=draws)

    write_by_ending(path, {".nc": fit.save, ".html": as_page, ".json": as_text}, fit.plot, fit)


def write_table(found: StepTable, path: Path) -> None:
    """Write a table of steps as CSV or LaTeX, by the file's ending.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    (found.to_csv if path.suffix.lower() == TABLES[0] else found.to_latex)(path)


def write_population(found: Population, path: Path) -> None:
    """Write a population in the format that the file's ending names.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """

    def as_text(target: Path) -> None:
        write_text(target, json.dumps(stamped(found.to_dict()), indent=2, allow_nan=False) + "\n")

    def as_page(target: Path) -> None:
        write_page(found, target, "Population")

    write_by_ending(path, {".nc": found.save, ".html": as_page, ".json": as_text}, found.plot, found)


def write_speeds(found: SpeedFit, path: Path) -> None:
    """Write the fit of a table of speeds: its rig as .toml, its numbers as .json.

    Raises
    ------
    NotAvailable
        If the file cannot be written.
    """
    numbers = path.suffix.lower() == SPEED_ENDINGS[1]
    write_text(path, json.dumps(found.to_dict(), indent=2, allow_nan=False) + "\n" if numbers else found.rig_text())


def as_json(fit: Fit | MachineFit, comparison: LawComparison | None, table: StepTable | None = None) -> dict[str, Any]:
    """JSON-ready data of a fit, with the laws compared and the table of steps if given."""
    data = fit.to_dict() | ({} if table is None else {"steps": table.to_dict()})
    if comparison is not None:
        data["comparison"] = {
            label: {"ssq": one.ssq, "aic": comparison.criteria[label][0], "bic": comparison.criteria[label][1],
                    "weight": comparison.weights[label],
                    "parameters": {e.name: e.value for e in one.estimates}}
            for label, one in comparison.fits.items()
        }  # fmt: skip
    return data
