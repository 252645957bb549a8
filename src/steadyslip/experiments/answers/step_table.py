"""Table of a paper: every step of the records fitted alone, then all together; with a sentence on how."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import ParameterError, Problem, SteadyslipError
from steadyslip.core.format import enumerated, format_quantity
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.experiments.fitting.beginning import Beginning
from steadyslip.experiments.fitting.derived import DERIVED
from steadyslip.experiments.fitting.estimates import Estimate
from steadyslip.experiments.fitting.fit import search_fit
from steadyslip.experiments.fitting.plan import Plan
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.result import Fit
from steadyslip.experiments.fitting.search import Progress
from steadyslip.experiments.fitting.settings import STARTS
from steadyslip.experiments.fitting.words import slip_after_changes, warnings
from steadyslip.experiments.loading.pressing import LoadStep
from steadyslip.experiments.measured.record import Record
from steadyslip.experiments.numerics.noise import STRUCTURE
from steadyslip.files.output import write_columns, write_text
from steadyslip.machine.slider import Slider

SHOWN = {"displacement": "mm", "m": "um", "m/s": "um/s", "Pa": "MPa", "Pa/m": "GPa/m"}
"""Units of the table in LaTeX, by name of a column or SI unit; others stay as they are."""
ABOUT = {"record": "", "step": "", "time": "s", "displacement": "m", "rate before": "m/s", "rate after": "m/s",
         "normal stress": "Pa", "samples": "", "rms": "1"}  # fmt: skip
"""Columns before those of the estimates, with SI units."""
DRIVEN = {
    "measured": "the measured loading",
    "protocol": "the given protocol",
    "smoothed": "a smooth curve through the measured displacement",
}
"""What drives the model, by `drive` of a fit, where it is not found in the record."""
PRINTED, LABEL = 120, 20  # characters of a line of a printed table, and of a file's name in it
PLAIN = ("velocity step", "normal-stress step", "hold")  # kinds of steps that a printed change tells by its units
TIME = 7  # figures of times: steps are at some ten thousand seconds of a record, known to a tenth
TYPESET = {one: f"\\{one}" for one in "_%&#$"} | {
    "±": r"$\pm$", "−": "$-$", "×": r"$\times$", "²": "$^2$", "<": "$<$", ">": "$>$",
    "α": r"$\alpha$", "μ": r"$\mu$", "σ": r"$\sigma$", "Σ": r"$\Sigma$", "Θ": r"$\Theta$", "τ": r"$\tau$",
}  # fmt: skip
"""Characters that LaTeX takes for something else or does not have."""
GREEK = ("alpha", "beta", "gamma", "eta", "mu", "psi", "sigma", "tau", "theta")


@dataclass(frozen=True)
class FittedStep:
    """One line of a table: a step of a record, and the fit to the part of the record around it.

    Attributes
    ----------
    record : str
        Where the record comes from.
    step : LoadStep or None
        None for the fit to all records together.
    fit : Fit
    displacement, normal_stress : float or None
        Displacement of the load point since the beginning of the record (m), and effective normal stress (Pa), when
        the step begins; None if not measured.
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
        """Values of the columns `ABOUT`; None where there is none."""
        step = self.step
        kind = "all together" if step is None else step.kind
        kind += f" to {format_quantity(step.after, 'Pa')}" if step is not None and step.unit == "Pa" else ""
        values = (self.record, kind, None if step is None else step.time, self.displacement, *self.rates,
                  self.normal_stress, self.fit.samples, self.fit.rms)  # fmt: skip
        return dict(zip(ABOUT, values, strict=True))

    def label(self) -> str:
        """Name of the line in a printed table: file, time and change of the step; where too long, its end."""
        if self.step is None:
            return "all together"
        when = str(self.step)
        for kind in PLAIN:
            when = when.removeprefix(f"{kind} at ")
        name = Path(self.record).name
        return f"{name if len(name) <= LABEL else '...' + name[3 - LABEL :]}, {when}"

    def verdict(self, notes: list[str]) -> str:
        """Whether friction weakens with velocity, by a − b and its interval, and numbers of what the fit warns of."""
        numbers = ",".join(str(1 + notes.index(text)) for text in warnings(self.fit))
        found = next((one for one in self.fit.derived if one.name.startswith("a - ")), None)
        if found is None:
            return f"[{numbers}]" if numbers else ""
        sure = found.determined and not found.low <= 0 <= found.high
        said = ("strengthens" if found.value > 0 else "weakens") if sure else "not told"
        return f"{said} [{numbers}]" if numbers else said

    def estimates(self) -> dict[str, Estimate]:
        """Estimates of the rig's parameters and what follows from them, by name."""
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
        One for each step, in order of records and time; the last is of all together.
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
        """Names of the estimates of any line, with SI units, in order of columns.

        a − b is read first; then come parameters of the law, stiffnesses, the level of friction, and what every record
        has to itself.
        """
        found = {name: one.unit for line in self.lines for name, one in line.estimates().items()}
        level = self.joint.plan.rig.of_kind("friction level")
        return {name: found[name] for name in sorted(found, key=lambda name: _place(name, level))}

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units."""
        lines = []
        for line in self.lines:
            own = {name: {"value": one.value, "error": one.error if one.determined else None, "unit": one.unit}
                   for name, one in line.estimates().items()}  # fmt: skip
            lines.append(line.about() | {"estimates": own, "warnings": warnings(line.fit)})
        return {"lines": lines, "left_out": list(self.left_out), "methods": self.methods}

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table as CSV, SI units in the header, the warnings of each line last.

        An error is empty where a value is not determined.

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
        r"""Table as LaTeX: a ``tabular``, with the sentences for the methods section as a comment above it.

        Values in parentheses are not determined. Numbers at steps are those of the notes below, of what the fits warn.
        """
        names = self._estimated()
        about = {name: si for name, si in ABOUT.items() if name != "samples"}
        heads = [name + (f" ({_unit(si, name)})" if si not in ("", "1") else "") for name, si in about.items()]
        heads += [
            f"${_letter(name, self.joint.plan.rig)}$" + (f" ({_unit(si)})" if si != "1" else "")
            for name, si in names.items()
        ]
        rows, notes = [], self.notes
        for line in self.lines:
            own, here = line.estimates(), line.about()
            cells = [_cell(here[name], _shown(si, name), TIME if si == "s" else 4) for name, si in about.items()]
            told = ",".join(str(1 + notes.index(text)) for text in warnings(line.fit))
            cells[1] += f"$^{{{told}}}$" if told else ""
            cells += [_with_error(own.get(name)) for name in names]
            rows.append(" & ".join(cells) + r" \\")
        body = [f"% {self.methods}", rf"\begin{{tabular}}{{ll{'r' * (len(heads) - 2)}}}", r"\hline",
                " & ".join(heads) + r" \\", r"\hline", *rows[:-1], r"\hline", rows[-1], r"\hline",
                r"\end{tabular}"]  # fmt: skip
        if notes:
            below = [rf"$^{{{k}}}$ {_escaped(text)}." for k, text in enumerate(notes, start=1)]
            body += [r"\par\smallskip\noindent{\footnotesize", *below, r"\par}"]
        return "\n".join(body) + "\n"

    @property
    def notes(self) -> list[str]:
        """What the fits of any lines warn of, each once."""
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
        plan, line, law = self.joint.plan, self.lines[-1], self.joint.plan.rig.friction
        driven = DRIVEN.get(plan.drive, "the commanded loading found in the load point's displacement")
        states, evolution = len(getattr(law, "states", ()) or (law,)), getattr(law, "evolution", None)
        kind = f"{law.name} friction"
        if evolution is not None:
            kind += f", {evolution.name} law, {states} state{'s' * (states > 1)}"
        parts = (getattr(law, item.name) for item in fields(law))
        memories = [one.name for one in parts if one is not evolution and hasattr(one, "name")]
        kind += "" if law.forgets_stress() else "".join(f", {name} memory of normal stress" for name in memories)
        free = [name for name, one in line.estimates().items() if one not in self.joint.derived]
        changes = [one for loading in plan.loading if loading.load for one in loading.load.changes]
        late = [one for one in changes if one.lag]
        further = [
            f"The load point was taken to follow changes of its rate late, as a servo of second order does (by "
            f"{format_quantity(late[0].lag, 's')} in the end)."
            if late
            else "",
            "Around changes of its rate the load point was taken to move as measured, in straight pieces of the rate."
            if any(one.pieces for one in changes)
            else "",
            f"A polynomial of order {plan.trend} in {plan.trend_axis} was added to friction." if plan.trend else "",
            "A constant was added to friction." if plan.offset else "",
            "Friction was free to come later or earlier than the loading." if plan.lag else "",
            "How far records begin from steady sliding was fitted." if plan.initial == "free" else "",
            f"Values of a - b are those over at most {format_quantity(slip, 'm', 2)} of slip after a change of rate."
            if (slip := slip_after_changes(self.joint))
            else "",
            "Later steps begin with friction and state as the step before left them, with its errors."
            if any(one.plan.beginnings for one in self.steps)
            else "",
            f"Outliers weighed less ({plan.loss} loss)." if plan.loss != "linear" else "",
            ""
            if plan.weights is None
            else "Samples were weighted."
            if any(np.ptp(row) > 0 for row in plan.weights)
            else "Records weigh by their noise.",
        ]
        left = sum(one.whiteness.p < STRUCTURE for one in (*self.steps, self.joint))
        open_ones = any(not one.determined for line in self.lines for one in line.estimates().values())
        said = [
            f"Residuals of {left} of these {len(self.lines)} fits have structure (probability of their whiteness below "
            f"{STRUCTURE:g})."
            if left
            else "",
            "Values in parentheses are not determined by the data." if open_ones else "",
            "Notes to the table say of what these fits warn." if self.notes else "",
        ]
        noise = "allowing for correlated residuals" if self.joint.correlated else "for independent residuals"
        alone = f"{len(self.steps)} step{'s were' if len(self.steps) != 1 else ' was'} fitted alone"
        added = "".join(f" {text}" for text in further if text)
        return (
            f"Friction was fitted by least squares with steadyslip {self.joint.version}: {kind}, coupled to a spring "
            f"and driven by {driven}, with {', '.join(free)} free.{added} {alone}, and all together; errors are one "
            f"standard deviation, {noise}." + "".join(f" {text}" for text in said if text)
        )

    def _rows(self) -> tuple[list[list[str]], list[str]]:
        """Rows of the printed table, its head first, and names of estimates that do not fit beside each other."""
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
    """Fit every step of a fit's records alone, with the rig and options of the fit.

    The part of a step goes from halfway since the step before to the next step. Later steps begin with friction and
    state as the step before left them, with its errors (as all together did, where it does not determine everything).

    Parameters
    ----------
    fit : Fit
        To all records together; its line is the last.
    starts, effort
        As for `fit`, of each step.
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
                if part.time[0] > record.time[0]:  # then friction may still change since the step before
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
    """Rig with a memory of normal stress as fitted to all records, and what else is free: for a step without effect."""
    plan = fit.plan
    fields_of = tuple(f"friction.{name}." for name in plan.rig.friction.decided_by_stress)
    held = [n for n in plan.free if n.startswith(fields_of) or n in plan.rig.of_kind("stress share")]
    known = fit.rig(record)
    rig = plan.rig.with_values({name: known.value(name) for name in held})
    return rig, tuple(name for name in plan.free if name not in held)


def _parts(record: Record) -> Iterator[tuple[LoadStep, Record]]:
    """Steps of a record, each with the part from halfway since the change before until the next step."""
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
    """Option of a fit that tells how its record begins: as a fit of what came before, of its record i, leaves it."""
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
    for k, one in enumerate(plan.space().unknowns):  # times of changes do not matter to what was before
        own[:, k] = given[one.parameter] if one.parameter in plan.free else 0.5 * (one.low + one.high)
    at = int(np.argmin(np.abs(source.record.time - target.record.time[0])))
    steady = target.states(own)
    away = np.column_stack([whole[:, at] - steady[name][:, 0] for name, whole in source.states(values).items()])
    if not np.all(np.isfinite(away)):
        return {"initial": "free"}
    spread = np.linalg.svd(away[1:] - away[0], full_matrices=False)  # as many directions as there are differences
    directions = (spread.S[:, None] * spread.Vh).tolist()
    known = Beginning(dict(zip(steady, away[0].tolist(), strict=True)), tuple(map(tuple, directions)))
    return {"initial": "steady", "beginnings": (known,)}


def _fitted_step(record: Record, step: LoadStep, alone: Fit) -> FittedStep:
    moved, normal = (None if own is None else float(np.interp(step.time, record.time, own))
                     for own in (record.displacement, record.normal))  # fmt: skip
    if moved is not None and record.displacement is not None:
        moved -= float(record.displacement[0])
    if step.kind.startswith("normal"):  # its samples lie on both sides of the step
        normal = step.before
    load = record.loading.load
    rates = (step.before, step.after) if step.unit == "m/s" else (None, None)
    if step.unit == "Pa" and load is not None:
        rates = (float(load.at(np.array([step.time]))[0]),) * 2
    return FittedStep(record.source, step, alone, moved, normal, rates)


def _place(name: str, level: Sequence[str]) -> tuple[bool, int]:
    """Place of an estimate among the columns; `level` are names of the level of friction in the rig."""
    bare = name.partition("@")[0]
    stiffness = bare == "k" or bare in DERIVED
    return bare != name, 0 if bare == "a - b" else 3 if f"friction.{bare}" in level else 2 if stiffness else 1


def _value(one: Estimate) -> str:
    """Value and error with units; a value that is not determined in parentheses."""
    return one.shown() if one.determined else f"({format_quantity(one.value, one.unit, area=one.area)})"


def _shown(si: str, column: str = "") -> str:
    """Unit of a column in LaTeX."""
    return SHOWN.get(column, SHOWN.get(si, si))


def _unit(si: str, column: str = "") -> str:
    return _shown(si, column).replace("um", r"\textmu m")


def _letter(name: str, rig: Slider) -> str:
    """Name of an estimate in the mathematics of LaTeX; ``b`` of the second state is b_2."""
    *before, last = name.split(".")
    declared = next((one.role.letter for full, one in rig.parameters().items() if full.endswith(f".{name}")), "")
    words = (part.split("_") for part in (declared or last).split("/"))
    number = [part for part in before if part.isdigit()]
    found = []
    for head, *tail in words:
        below = ",".join([*tail, *number])
        found.append((f"\\{head}" if head in GREEK else head) + (f"_{{{below}}}" if below else ""))
    return " / ".join(found)


def _cell(value: Any, shown: str, digits: int) -> str:
    """Text or number (SI) of a cell, in the unit shown."""
    if value is None:
        return "--"
    if isinstance(value, str):
        return _escaped(value)
    return format_quantity(value / unit(shown)[0], "1", digits)


def _escaped(text: str) -> str:
    """Text in LaTeX."""
    return "".join(TYPESET.get(one, one) for one in text)


def _with_error(one: Estimate | None) -> str:
    """Value and error in the units of the table, rounded to two digits of the error."""
    if one is None:
        return "--"
    factor = unit(_shown(one.unit))[0]
    value, error = one.value / factor, one.error / factor
    if not one.determined:
        return f"({value:.3g})"
    if not error > 0:
        return f"${value:.4g}$"
    digits = max(1 - int(np.floor(np.log10(error))), 0)
    return rf"${value:.{digits}f} \pm {error:.{digits}f}$"
