"""Fits and populations from the paths of record files, as on the command line."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import NotAvailable, ParameterError, Problem, SteadyslipError
from steadyslip.core.options import checked
from steadyslip.core.progress import progress_text
from steadyslip.experiments.answers.laws import LawComparison
from steadyslip.experiments.answers.population import FEWEST, POPULATION, Population, load_population, population
from steadyslip.experiments.fitting.machines.machine_result import MachineFit
from steadyslip.experiments.fitting.result import Fit, load_friction_fit
from steadyslip.experiments.fitting.search import Progress
from steadyslip.experiments.fitting.settings import PopulationSettings
from steadyslip.experiments.machine_spec import MachineSpec
from steadyslip.experiments.measured.speeds import read_speed_table
from steadyslip.experiments.spec import Spec, spec_from_text
from steadyslip.files.sealed import holds
from steadyslip.files.specifications.read import text_of

Paths = Sequence[str | PathLike[str]]


def spec_of(spec: str | PathLike[str] | None, changes: Iterable[str] = ()) -> Spec | MachineSpec:
    """Contents of a fit file; without a file, those for the one-state slip law at the measured normal stress."""
    text = "[friction]\n" if spec is None else text_of(spec)
    return spec_from_text(text, "default" if spec is None else str(spec), changes)


@checked()
def fit_files(
    paths: Paths, spec: str | PathLike[str] | None = None, changes: Iterable[str] = (), *, skip_bad_lines: bool = False
) -> tuple[Fit | MachineFit, LawComparison | None]:
    """Fit to records in files, as on the command line; shows progress on a terminal.

    Parameters
    ----------
    paths : sequence of path
        Files of the records, which are fitted together.
    spec : path, optional
        Fit file; by default the one-state slip law at the measured normal stress is fitted.
    changes : iterable of str
        As for `read_spec`.
    skip_bad_lines : bool

    Returns
    -------
    fit : Fit or MachineFit
        The best fit, if laws are compared; a MachineFit if the file describes a machine.
    comparison : LawComparison or None
        Comparison of the laws that the file lists. If it lists no laws and chooses no memory of normal stress, and the
        normal stress changes, the slip and the aging law are compared, each with every memory. None for a single law.

    Raises
    ------
    ParameterError
        If records or the fit file have faults; lists all of them.

    Examples
    --------
    >>> fit, comparison = ss.fit_files(["examples/data/made_velocity_step.csv"])
    >>> print(fit["d_c"])
    friction.d_c = 10.06 ± 0.077 um
    """
    plan = spec_of(spec, changes)
    return fitted(plan, records_of(plan, paths, skip_bad_lines))


def fitted(plan: Spec | MachineSpec, records: Sequence[Any]) -> tuple[Fit | MachineFit, LawComparison | None]:
    """Fit to records, and comparison of laws if the fit file requires it (else None), as `fit_files` returns them."""
    with progress_text("searching") as said:
        report = _progress_reporter(said)
        if isinstance(plan, Spec) and plan.compared(records):
            found = plan.compare(records, progress=report)
            return found.fits[found.best].with_variants(), found
        return plan.fit(records, progress=report), None


@checked()
def population_files(
    paths: Paths, spec: str | PathLike[str], changes: Iterable[str] = (), *, skip_bad_lines: bool = False
) -> Population:
    """Population from fits to each of several record files, as on the command line; shows progress on a terminal.

    Parameters
    ----------
    paths : sequence of path
        Files of the records, each of which is a separate experiment.
    spec : path
        Fit file; its table ``[population]`` names the parameters that differ between experiments, and the condition on
        which these parameters depend.
    changes : iterable of str
        As for `read_spec`.
    skip_bad_lines : bool

    Returns
    -------
    Population
        The labels of its experiments are the names of the files.

    Raises
    ------
    ParameterError
        If the files have faults (lists all of them) or do not determine a population.
    NotAvailable
        If emcee is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> head, *rows = Path("examples/data/made_velocity_step.csv").read_text().splitlines()
    >>> paths = [Path(f"part{k}.csv") for k in range(3)]
    >>> for k, path in enumerate(paths):  # in place of three experiments
    ...     _ = path.write_text("\\n".join([head, *rows[k::3]]))
    >>> changes = ["fit.trend=0", "population.parameters=['friction.a', 'friction.b']", "population.draws=100"]
    >>> pooled = ss.experiments.population_files(paths, "examples/fits/basalt.toml", changes)
    >>> pooled.names
    ('friction.a', 'friction.b')
    """
    plan = spec_of(spec, changes)
    if not isinstance(plan, Spec):
        raise NotAvailable(f"{str(spec)!r} describes a machine; allowed: a slider, one block on one surface")
    members = plan.population or PopulationSettings()
    labels: list[str] = []
    for path in paths:
        stem = Path(path).stem
        labels.append(stem if stem not in labels else f"{stem} ({len(labels) + 1})")
    given = members.values
    if isinstance(given, dict) and set(given) != set(labels):
        message = f"got values for {', '.join(given)}; allowed: one for each of {', '.join(labels)}"
        raise ParameterError([Problem("population.values", message)])
    records = records_of(plan, paths, skip_bad_lines)
    needed = FEWEST + (members.condition is not None)
    if len(records) < needed:
        message = f"got {len(records)} record{'s' * (len(records) != 1)}; allowed: {needed} or more"
        raise ParameterError([Problem("population", message)])
    if given is not None and len(given) != len(records):
        message = f"got {len(given)}; allowed: {len(records)}, one for each record"
        raise ParameterError([Problem("population.values", message)])
    plan = plan.referred_to(records[0])  # levels of friction must refer to one velocity in all fits
    fits: dict[str, Fit] = {}
    with progress_text("searching") as said:
        for label, record in zip(labels, records, strict=True):
            fits[label] = plan.fit([record], progress=_progress_reporter(said, f"{label}, "))
    return population(
        fits, members.parameters, conditions=members.depends_on(), scale=members.scale, count=members.draws
    )


def load_friction(path: str | PathLike[str]) -> Fit | Population:
    """Fit or population that was saved in the file.

    Raises
    ------
    NotAvailable
        If the file contains neither, is damaged, or cannot be read.
    """
    return load_population(path) if holds(path, POPULATION) else load_friction_fit(path)


def records_of(plan: Spec | MachineSpec, paths: Paths, skip_bad_lines: bool) -> list[Any]:
    """Records of all files; one error lists the problems of all files."""
    records, faults = [], []
    for path in paths:
        try:
            records.append(plan.read(path, skip_bad_lines))
        except (ParameterError, NotAvailable) as error:
            faults.append(_of_speeds(path, error) or error)
    if len(faults) == 1:
        raise faults[0]
    if faults:
        raise NotAvailable("\n".join(map(str, faults)))
    return records


def _of_speeds(path: str | PathLike[str], error: ParameterError | NotAvailable) -> NotAvailable | None:
    """Error with advice for a file without times that is a table of friction over speed; None for other files."""
    if isinstance(error, ParameterError) and all(problem.name != "time" for problem in error.problems):
        return None
    try:
        read_speed_table(path)
    except SteadyslipError:
        return None
    return NotAvailable(
        f"{str(path)!r} is a table of friction over speed, not a record over time; name the law to fit with --law, "
        "such as --law lugre, or call experiments.fit_friction_table in Python"
    )


def _progress_reporter(said: Callable[[str], None], of: str = "") -> Progress:
    def report(what: str, starts: int, rms: float) -> None:
        reached = f", residuals {rms:.3g} of friction" if math.isfinite(rms) else ""
        said(f"{of}{what}: {starts} starts tried{reached}; Ctrl-C ends it")

    return report
