"""Table for a paper: a fit to every step of the records and a fit to all records, with text for the methods section."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, SteadyslipError
from steadyslip.core.format import enumerated, format_quantity
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.experiments.answers.latex import cell, symbol, tabular, unit_head, value_with_error
from steadyslip.experiments.answers.methods import methods_text
from steadyslip.experiments.fitting.beginning import Beginning
from steadyslip.experiments.fitting.derived import DERIVED
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.fit import search_fit
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.search import Progress
from steadyslip.experiments.fitting.settings import STARTS
from steadyslip.experiments.fitting.words import warnings
from steadyslip.experiments.loading.pressing import LoadStep
from steadyslip.experiments.measured.record import Record
from steadyslip.files.output import write_columns, write_text
from steadyslip.machine.slider import Slider

ABOUT = {"record": "", "step": "", "time": "s", "displacement": "m", "rate before": "m/s", "rate after": "m/s",
         "normal stress": "Pa", "samples": "", "rms": "1"}  # fmt: skip
"""Columns before those of the estimates, with SI units."""
PRINTED, LABEL = 120, 20  # largest number of characters in a line of a printed table, and in a file's name in it
PLAIN = ("velocity step", "normal-stress step", "hold")  # kinds of steps that are not named in print: units show them


@dataclass(frozen=True)
class FittedStep:
    """Line of a table: a step of a record, and the fit to the part of the record around it.

    Attributes
    ----------
    record : str
        Source of the record, such as the name of its file.
    step : LoadStep or None
        None for the fit to all records together.
    fit : Fit
    displacement, normal_stress : float or None
        Displacement of the load point since the beginning of the record (m), and effective normal stress (Pa), both at
        the beginning of the step; None if not measured.
    rates : tuple of two float or None
        Rate of the load point before and after the step, m/s.
    """

    record: str
    step: LoadStep | None
    fit: Fit
    displacement: float | None = None
    normal_stress: float | None = None
    rates: tuple[float | None, float | None] = (None, None)

    def about(self) -> dict[str, Any]:
        """Values of the columns in `ABOUT`, by name; None for a column without a value in this line."""
        step = self.step
        kind = "all together" if step is None else step.kind
        kind += f" to {format_quantity(step.after, 'Pa')}" if step is not None and step.unit == "Pa" else ""
        values = (self.record, kind, None if step is None else step.time, self.displacement, *self.rates,
                  self.normal_stress, self.fit.samples, self.fit.rms)  # fmt: skip
        return dict(zip(ABOUT, values, strict=True))

    def label(self) -> str:
        """Label of the line in a printed table: file name (its end, if it is long), time and change of the step."""
        if self.step is None:
            return "all together"
        when = str(self.step)
        for kind in PLAIN:
            when = when.removeprefix(f"{kind} at ")
        name = Path(self.record).name
        return f"{name if len(name) <= LABEL else '...' + name[3 - LABEL :]}, {when}"

    def verdict(self, notes: list[str]) -> str:
        """Text "weakens" or "strengthens" (with velocity), from a − b and its interval, and numbers of warnings.

        Parameters
        ----------
        notes : list of str
            All warnings of the table; their order gives the numbers.
        """
        numbers = ",".join(str(1 + notes.index(text)) for text in warnings(self.fit))
        found = next((one for one in self.fit.derived if one.name.startswith("a - ")), None)
        if found is None:
            return f"[{numbers}]" if numbers else ""
        sure = found.determined and not found.low <= 0 <= found.high
        said = ("strengthens" if found.value > 0 else "weakens") if sure else "undecided"
        return f"{said} [{numbers}]" if numbers else said

    def estimates(self) -> dict[str, Estimate]:
        """Estimates by name: fitted parameters of the rig and quantities derived from them, such as a − b."""
        rig = [one for one in self.fit.estimates if one.name.partition("@")[0] in self.fit.plan.free]
        stiff = self.fit.plan.rig.of_kind("stiffness")
        bare = [f"k{one.name.removeprefix(own)}" if (own := one.name.partition("@")[0]) in stiff
                else one.name.removeprefix("friction.") for one in rig]  # fmt: skip
        return dict(zip(bare, rig, strict=True)) | {one.name: one for one in self.fit.derived}


@dataclass(frozen=True, eq=False)
class StepTable(Displayed):
    """Fits to every step alone and to all records together, as a table.

    Attributes
    ----------
    lines : tuple of FittedStep
        One line for each step, in order of records and time; the last line is the fit to all records together.
    left_out : tuple of str
        Sentences on steps that could not be fitted alone.
    """

    lines: tuple[FittedStep, ...]
    left_out: tuple[str, ...] = ()

    @property
    def joint(self) -> Fit:
        """Fit to all records together."""
        return self.lines[-1].fit

    @property
    def steps(self) -> tuple[Fit, ...]:
        """Fits to every step alone."""
        return tuple(line.fit for line in self.lines[:-1])

    def _estimated(self) -> dict[str, str]:
        """SI units of all estimates by name, in the order of the columns.

        a − b comes first, then parameters of the law, stiffnesses, the level of friction, and parameters that differ
        between records.
        """
        found = {name: one.unit for line in self.lines for name, one in line.estimates().items()}
        level = self.joint.plan.rig.of_kind("friction level")
        return {name: found[name] for name in sorted(found, key=lambda name: _place(name, level))}

    def to_dict(self) -> dict[str, Any]:
        """Convert to a dict of JSON-ready data in SI units."""
        lines = []
        for line in self.lines:
            own = {name: {"value": one.value, "error": one.error if one.determined else None, "unit": one.unit}
                   for name, one in line.estimates().items()}  # fmt: skip
            lines.append(line.about() | {"estimates": own, "warnings": warnings(line.fit)})
        return {"lines": lines, "left_out": list(self.left_out), "methods": self.methods}

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table as CSV with SI units in the header; the last column holds the warnings of each line.

        The error of a value that is not determined is an empty cell.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        about, own = [line.about() for line in self.lines], [line.estimates() for line in self.lines]
        columns: dict[str, list[Any]] = {
            f"{name} ({unit})" if unit else name: [one[name] for one in about] for name, unit in ABOUT.items()
        }
        for name, si in self._estimated().items():
            found = [one.get(name) for one in own]
            columns[f"{name} ({si})"] = [one and one.value for one in found]
            columns[f"{name} error ({si})"] = [one.error if one and one.determined else None for one in found]
        columns["warnings"] = ["; ".join(warnings(line.fit)) for line in self.lines]
        write_columns(path, columns, "%.8g")

    def latex_text(self) -> str:
        r"""Table as LaTeX: a ``tabular`` with the sentences of `methods` as a comment above it.

        Values in parentheses are not determined. Raised numbers at a step refer to `notes`, which are below the table.
        """
        names, notes, rig = self._estimated(), self.notes, self.joint.plan.rig
        about = {name: si for name, si in ABOUT.items() if name != "samples"}
        heads = [name + unit_head(si, name) for name, si in about.items()]
        heads += [f"${symbol(name, rig)}${unit_head(si)}" for name, si in names.items()]
        rows = []
        for line in self.lines:
            own, here = line.estimates(), line.about()
            cells = [cell(here[name], si, name) for name, si in about.items()]
            raised = ",".join(str(1 + notes.index(text)) for text in warnings(line.fit))
            cells[1] += f"$^{{{raised}}}$" if raised else ""
            rows.append(cells + [value_with_error(own.get(name)) for name in names])
        return tabular(heads, rows, notes, self.methods)

    @property
    def notes(self) -> list[str]:
        """Distinct warnings of the fits of all lines."""
        return list(dict.fromkeys(text for line in self.lines for text in warnings(line.fit)))

    def to_latex(self, path: str | PathLike[str]) -> None:
        """Write the table as LaTeX.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        write_text(path, self.latex_text())

    @property
    def methods(self) -> str:
        """Sentences for the methods section of a paper."""
        fits = (*self.steps, self.joint)
        return methods_text(fits, [line.estimates() for line in self.lines], bool(self.notes))

    def _rows(self) -> tuple[list[list[str]], list[str]]:
        """Rows of the printed table, with names in the first row; names of estimates that do not fit into a line."""
        notes, level = self.notes, self.joint.plan.rig.of_kind("friction level")
        own = [line.estimates() for line in self.lines]
        verdicts = [line.verdict(notes) for line in self.lines]
        rows = [["", *(line.label() for line in self.lines)]]
        room = PRINTED - max(map(len, rows[0])) - max(map(len, verdicts)) - 2
        cells = {name: [name, *(_value(one[name]) if name in one else "" for one in own)] for name in self._estimated()}
        wide = {name: max(map(len, column)) + 2 for name, column in cells.items() if "@" not in name}
        shown = set()
        for name in sorted(wide, key=lambda name: (*_place(name, level), name == "b")):  # b follows from a and a − b
            if wide[name] <= room:
                room -= wide[name]
                shown.add(name)
        rows += [column for name, column in cells.items() if name in shown]
        return list(map(list, zip(*rows, ["", *verdicts], strict=True))), [name for name in cells if name not in shown]

    def __str__(self) -> str:
        rows, beside = self._rows()
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(f"{cell:<{n}}" for cell, n in zip(row, wide, strict=True)).rstrip() for row in rows]
        joint = self.lines[-1].estimates()
        more = ", ".join(f"{name} {_value(joint[name])}" for name in beside if name in joint)
        alone = enumerated([name for name in beside if "@" not in name])
        told = [f"all together, besides: {more}{f'; of steps {alone}: in the CSV (-o table.csv)' if alone else ''}"]
        told = told if beside else []
        told += [f"[{k}] {text}" for k, text in enumerate(self.notes, start=1)]
        told += [f"! {text}" for text in (*self.left_out, self.methods)]
        told[-1] = "\n" + told[-1].removeprefix("! ")
        return "\n".join([*lines, *(textwrap.fill(text, PRINTED, subsequent_indent="  ", replace_whitespace=False)
                                    for text in told)])  # fmt: skip


@checked()
def step_table(
    fit: Fit, *, starts: int = STARTS, effort: float = 1.0, progress: Progress | None = None
) -> StepTable:  # fmt: skip
    """Table of fits to every step of a fit's records alone, with the rig and options of the fit.

    A step is fitted to the part of its record from halfway between the step before and this step until the next step.
    Friction and state at the beginning of this part, with errors, follow from the fit to the step before; or from the
    fit to all records, if the step before does not determine all parameters.

    Parameters
    ----------
    fit : Fit
        Fit to all records together, which becomes the last line.
    starts, effort
        As for `fit`, for each step.
    progress : callable, optional
        As for `fit`.

    Raises
    ------
    ParameterError
        If no record has a step.

    Examples
    --------
    >>> record = ss.read_record("examples/data/made_velocity_step.csv")
    >>> fit = ss.fit(ss.lab_rig("slip"), record, starts=4)
    >>> print(ss.experiments.step_table(fit))
                                                  a - b               a                  d_c
    ...velocity_step.csv, 20 s: 1 um/s to 3 um/s  -0.00303 ± 2.2e-05  0.01192 ± 8.5e-05  10.06 ± 0.077 um  weakens
    all together                                  -0.00303 ± 2.2e-05  0.01192 ± 8.5e-05  10.06 ± 0.077 um  weakens
    ...
    """
    plan = fit.plan
    level = plan.rig.of_kind("friction level")
    names = ("trend", "trend_axis", "offset", "lag", "initial", "loss", "width", "calibrated")
    options = {name: getattr(plan, name) for name in names}
    options |= {"fixed": [name for name in level if name not in plan.free], "errors": "auto"}
    options |= {"starts": starts, "effort": effort}
    options |= {"protocol": plan.protocol} if plan.drive == "protocol" else {"drive": plan.drive}
    lines, left_out = [], []
    for i, record in enumerate(plan.records):
        before = None
        for step, part in _parts(record):
            weights = None if plan.weights is None else plan.weights[i][np.isin(record.time, part.time)]
            rig, free = (plan.rig, plan.free) if part.stress_changes else _without_memory(fit, i)
            try:
                own = options | {"weights": weights}
                if part.time[0] > record.time[0]:  # friction may still change after the previous step
                    own |= _begun(before or (fit, i), make_plan(rig, part, free, **own))
                alone = search_fit(rig, part, free, progress=progress, **own)
                before = (alone, 0) if all(one.determined for one in alone.estimates) else None
            except SteadyslipError as error:
                before = None
                left_out.append(f"{record.source}: {step} could not be fitted alone: {error}")
                continue
            lines.append(_fitted_step(record, step, alone))
    if not lines and not left_out:
        raise ParameterError([Problem("fit", "no steps were found in its records, so there is nothing to list")])
    sources = ", ".join(dict.fromkeys(record.source for record in plan.records))
    lines.append(FittedStep(sources, None, fit))
    return StepTable(tuple(lines), tuple(left_out))


def _without_memory(fit: Fit, record: int) -> tuple[Slider, tuple[str, ...]]:
    """Rig with the memory of normal stress fixed as fitted to all records, and names of the other free parameters.

    The rig is used for steps at constant normal stress, on which the memory has no effect.
    """
    plan = fit.plan
    fields_of = tuple(f"friction.{name}." for name in plan.rig.friction.decided_by_stress)
    held = [n for n in plan.free if n.startswith(fields_of) or n in plan.rig.of_kind("stress share")]
    known = fit.rig(record)
    rig = plan.rig.with_values({name: known.value(name) for name in held})
    return rig, tuple(name for name in plan.free if name not in held)


def _parts(record: Record) -> Iterator[tuple[LoadStep, Record]]:
    """Steps of a record, and for each the part of the record from halfway after the change before to the next step."""
    changes = [step.time for step in record.steps]
    steps = [step for step in record.steps if step.kind != "reslide"]
    ends = [*(_beginning_of(record, step) for step in steps[1:]), np.inf]
    for step, end in zip(steps, ends[: len(steps)], strict=True):
        before = [moment for moment in changes if moment < step.time]
        begin = 0.5 * (before[-1] + step.time) if before else float(record.time[0])
        last = float(record.time[record.time < end][-1])
        loading = record.loading.within(begin, last)
        yield step, replace(record.between(begin, last), commanded=loading)


def _beginning_of(record: Record, step: LoadStep) -> float:
    """Earliest time (s) at which a step may begin."""
    return min((one.earliest for _, _, one in record.loading.changes if one.time == step.time), default=step.time)


def _begun(before: tuple[Fit, int], plan: Plan) -> dict[str, Any]:
    """Options of a fit for the beginning of its record.

    Parameters
    ----------
    before : tuple of Fit and int
        A fit, and the index of one of its records that contains the beginning: it gives friction, state and errors.
    plan : Plan
        Plan of the new fit.
    """
    fit, i = before
    if plan.rests(0) or not (fit.plan.follows and fit.search.converged):
        return {"initial": "free"}
    errors = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)
    variances, axes = np.linalg.eigh(errors)
    ends = fit.coordinates + np.vstack([np.zeros(len(axes)), (np.sqrt(np.maximum(variances, 0.0)) * axes).T])
    values = fit.space.values(np.clip(ends, *fit.bounds))
    source, target = fit.comparison.parts[i], plan.comparison().parts[0]
    given = {one.parameter: values[:, k] for k, one in enumerate(fit.space.unknowns) if one.record in (None, i)}
    own = np.empty((len(values), len(plan.space())))
    for k, one in enumerate(plan.space().unknowns):  # times of changes have no effect on friction before the changes
        own[:, k] = given[one.parameter] if one.parameter in plan.free else 0.5 * (one.low + one.high)
    at = int(np.argmin(np.abs(source.record.time - target.record.time[0])))
    steady = target.states(own)
    away = np.column_stack([whole[:, at] - steady[name][:, 0] for name, whole in source.states(values).items()])
    if not np.all(np.isfinite(away)):
        return {"initial": "free"}
    spread = np.linalg.svd(away[1:] - away[0], full_matrices=False)  # one direction per difference
    directions = (spread.S[:, None] * spread.Vh).tolist()
    known = Beginning(dict(zip(steady, away[0].tolist(), strict=True)), tuple(map(tuple, directions)))
    return {"initial": "steady", "beginnings": (known,)}


def _fitted_step(record: Record, step: LoadStep, alone: Fit) -> FittedStep:
    moved, normal = (None if own is None else float(np.interp(step.time, record.time, own))
                     for own in (record.displacement, record.normal))  # fmt: skip
    if moved is not None and record.displacement is not None:
        moved -= float(record.displacement[0])
    if step.kind.startswith("normal"):  # a mean over samples would mix both sides of a normal-stress step
        normal = step.before
    load = record.loading.load
    rates = (step.before, step.after) if step.unit == "m/s" else (None, None)
    if step.unit == "Pa" and load is not None:
        rates = (float(load.at(np.array([step.time]))[0]),) * 2
    return FittedStep(record.source, step, alone, moved, normal, rates)


def _place(name: str, level: Sequence[str]) -> tuple[bool, int]:
    """Sort key of an estimate among the columns; `level` holds the rig's parameters that set the level of friction."""
    bare = name.partition("@")[0]
    stiffness = bare == "k" or bare in DERIVED
    return bare != name, 0 if bare == "a - b" else 3 if f"friction.{bare}" in level else 2 if stiffness else 1


def _value(one: Estimate) -> str:
    """Value and error with units as text; a value that is not determined is in parentheses."""
    return one.shown() if one.determined else f"({format_quantity(one.value, one.unit, area=one.area)})"
