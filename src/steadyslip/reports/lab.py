"""Documents on fits, draws (samples of fitted parameters), predictions, comparisons of laws and populations."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from steadyslip import figures
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.experiments import Draws, Fit, LawComparison, MachineFit, Population, Prediction
from steadyslip.experiments.fitting.words import better, warnings
from steadyslip.figures.inline import figure_html
from steadyslip.machine.letters import estimate_words, worded
from steadyslip.machine.rig import Rig
from steadyslip.reports import rig as rig_report
from steadyslip.reports.brief import result_html
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, listing, paragraph, result_listing, table, typographic
from steadyslip.reports.results import parts_of
from steadyslip.verdict import analyze

_FOUND = ("parameter", "value", "95 %")
_FITTED = "Values that were fitted."
_OVER_STRESS = "k/σ"  # symbol for stiffness over normal stress in the text of a fit


def record_names(fit: Fit) -> str:
    """File names of the records of a fit, comma-separated."""
    return ", ".join(Path(record.source).name for record in fit.plan.records)


@parts_of.register
def _fit(result: Fit, comparison: LawComparison | None = None, draws: Draws | None = None) -> Parts:
    rig, rows = result.rig(), _estimate_rows(result, result.rig())
    body = [
        *_use(result), heading("What was found"), table(rows, _FOUND, caption=_FITTED),
        *(paragraph(worded(rig, text), "warning") for text in warnings(result)),
    ]  # fmt: skip
    if draws is not None:
        body += [heading("How sure is that?"), *_draws_section(draws)]
    if comparison is not None:
        body += [heading("Laws compared"), result_listing(comparison)]
    for i, record in enumerate(result.plan.records):
        name = Path(record.source).name
        fitted = figure_html(lambda i=i: figures.fit(result, record=i), "record and fit", 7.0)  # type: ignore[misc]
        steps = figure_html(lambda i=i: figures.steps(result, record=i), "steps of the record", 7.0)  # type: ignore[misc]
        body += [figure(fitted, f"{name}: record and fit."), figure(steps, "Its steps.")]
    corner = figure_html(lambda: figures.corner(result), "uncertainty", max(6.5, 1.3 * len(rows)))
    body += [figure(corner, "What the records leave open."), heading("Details"), _details(result, rig)]
    for record in result.plan.records:
        body += [heading(f"Record {Path(record.source).name}", 3), result_listing(record)]
    question = f"Which friction do these records show, and how sure is that: {record_names(result)}?"
    values = _lead(result, rig)
    lead = values if better(result) is None else f"For now: {values[:1].lower()}{values[1:]}"
    return Parts(f"{_answer(result)}. Fit to {record_names(result)}", lead, question, body, rig)


def _answer(fit: Fit) -> str:
    """Headline of a fit: friction rises or falls with velocity, is not determined, or the law is not to be used."""
    if better(fit) is not None:
        return "Not to be used yet: this law leaves structure in the residuals"
    found = next((one for one in fit.derived if one.name.partition("@")[0] == "a - b"), None)
    if found is None or not found.determined or not found.low * found.high > 0:
        return "It is not determined whether friction rises or falls with velocity"
    return f"Friction {'falls' if found.high < 0 else 'rises'} with velocity, a - b = {found.shown()}"


def _use(fit: Fit) -> Iterator[str]:
    """HTML of the recommendation on using the values of a fit."""
    yield heading("The recommendation")
    if (other := better(fit)) is not None:
        yield paragraph(
            f"Fit again with {other.choice}, as keys of the fit file or by --set: what these values leave unexplained "
            "is no noise, and that explains more of it. Values and errors below are those of the simpler law."
        )
    elif warnings(fit):
        yield paragraph("Read the warnings below before these values are used.")
    else:
        yield paragraph("Use these values with their errors: what they leave unexplained is noise.")


def _estimate_rows(fit: Fit | MachineFit, rig: Rig) -> list[tuple[str, str, str]]:
    """Rows of the table of fitted parameters: name in words with letter, value with error, 95 % interval."""
    return [
        (estimate_words(rig, one.name), one.shown(), one.range() if one.determined else "not determined")
        for one in fit.estimates
    ]


def _details(fit: Fit | MachineFit, rig: Rig) -> str:
    """HTML listing of the text of a fit, with names in words and letters instead of keys of files."""
    found = [*fit.estimates, *(fit.derived if isinstance(fit, Fit) else ())]
    words = {one.name: estimate_words(rig, one.name) for one in found} | {_OVER_STRESS: _OVER_STRESS}
    wide = max(map(len, words.values()))
    names = "|".join(map(re.escape, words))
    aligned = re.sub(rf"^  ({names}) {{2,}}", lambda row: f"  {words[row[1]]:<{wide}}  ", str(fit), flags=re.M)
    return listing(typographic(worded(rig, aligned)))


def _lead(fit: Fit | MachineFit, rig: Rig) -> str:
    """Sentence with the parameters that are determined, and their values."""
    values = ", ".join(f"{estimate_words(rig, one.name)} {one.shown()}" for one in fit.estimates if one.determined)
    return f"{values[:1].upper()}{values[1:]}." if values else "No parameter is determined."


@parts_of.register
def _machine_fit(result: MachineFit, comparison: None = None, draws: None = None) -> Parts:
    rig = result.rig()
    body = [heading("What was found"), table(_estimate_rows(result, rig), _FOUND, caption=_FITTED)]
    for i, record in enumerate(result.plan.records):
        shown = figure_html(lambda i=i: figures.machine_fit(result, record=i), "record and fit", 7.0)  # type: ignore[misc]
        body.append(figure(shown, f"{Path(record.source).name}: record and machine."))
    body += [heading("Details"), _details(result, rig)]
    names = ", ".join(Path(record.source).name for record in result.plan.records)
    question = f"Which machine do these records show, and how sure is that: {names}?"
    return Parts(f"Machine fitted to {names}", _lead(result, rig), question, body, rig)


def _draws_section(result: Draws) -> list[str]:
    """HTML of draws: values of the fit, errors and 95 % intervals of the draws, sampler details and figure."""
    rows = []
    for one in result.fit.estimates:
        low, high = result.interval(one.name)
        error = format_quantity(result.error(one.name), one.unit, 3, one.area)
        interval = replace(one, low=low, high=high).range()
        rows.append((estimate_words(result.fit.rig(), one.name), one.shown(), error, interval))
    details = ", ".join(f"{name} {value:.4g}" for name, value in result.details.items())
    many = f"{len(result)} draws, {result.kind}{f' ({details})' if details else ''}."
    body = [
        table(
            rows,
            ("parameter", "of the fit", "error of the draws", "95 % of the draws"),
            caption="Values that the draws leave open.",
        ),
        paragraph(many, "small"),
    ]
    if result.interrupted:
        body.append(paragraph("It was stopped before all draws were done.", "warning"))
    return [
        *body,
        figure(figure_html(result.plot, "draws", max(6.5, 1.3 * len(rows))), "The draws, parameter against parameter."),
    ]


@parts_of.register
def _draws(result: Draws) -> Parts:
    rig, names = result.fit.rig(), record_names(result.fit)
    body = [
        heading("What was found"), *_draws_section(result),
        heading("The fit"), *(paragraph(worded(rig, text), "warning") for text in warnings(result.fit)),
        _details(result.fit, rig),
    ]  # fmt: skip
    question = f"Which values of friction do the records allow: {names}?"
    return Parts(f"{len(result)} draws, {result.kind}, from {names}", "", question, body, rig)


@parts_of.register
def _prediction(result: Prediction) -> Parts:
    return rig_report.verdict_parts(analyze(result.rig), result)


@parts_of.register
def _comparison(result: LawComparison) -> Parts:
    best = next(iter(result.fits.values()))
    drawing = figure_html(result.plot, "laws compared", 6.5)
    rows = [
        (
            label,
            len(one.names),
            f"{one.ssq:.4g}",
            *(f"{x:.6g}" for x in result.criteria[label]),
            format_percent(result.weights[label]),
        )
        for label, one in result.fits.items()
    ]
    columns = ("law", "parameters", "sum of squares", "AIC", "BIC", "weight")
    body = [
        heading("What was found"), table(rows, columns, caption="The laws, the best first."),
        figure(drawing, "How well each law explains the records."),
        heading("In words"), result_listing(result),
    ]  # fmt: skip
    question = f"Which law of friction explains the records best: {record_names(best)}?"
    return Parts(f"{len(result.fits)} laws compared on {record_names(best)}", "", question, body)


@parts_of.register
def _population(result: Population) -> Parts:
    rows, own, rig = [], [], next(iter(result.fits.values())).rig()
    for name in result.axes.quantities:
        mean, other, words = result.mean(name), result.another(name), estimate_words(rig, name)
        rows.append((words, mean.shown(), mean.range(), other.range()))
        for label, alone in result.alone(name).items():
            alone_text = "not determined alone" if alone is None else alone.shown()
            own.append((words, label, alone_text, result.experiment(label, name).shown()))
    body = [
        heading("What was found"), table(
            rows,
            ("parameter", "mean", "mean, 95 %", "another experiment, 95 %"),
            caption="Means of the population, and what another experiment would have.",
        ),
        figure(figure_html(result.plot, "population"), "Every experiment alone and with the others."),
        heading("The experiments"), table(
            own,
            ("parameter", "experiment", "alone", "with the others"),
            left=False,
            caption="Every experiment, alone and with the others.",
        ),
        heading("In words"), result_listing(result),
        *(heading(f"Fit {label}") + result_html(fit) for label, fit in result.fits.items()),
    ]  # fmt: skip
    question = "What do several experiments say together, how much do they differ, and what would another one show?"
    head = f"Population of {len(result.fits)} experiments"
    return Parts(head, f"{len(result.names)} parameters each.", question, body)
