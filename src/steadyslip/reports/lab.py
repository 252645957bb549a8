"""What documents say of fits and what follows from them: draws, predictions, comparisons of laws, populations."""

from __future__ import annotations

from pathlib import Path

from steadyslip import figures
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.experiments import Draws, Fit, LawComparison, Population, Prediction
from steadyslip.experiments.fitting.words import warnings
from steadyslip.figures.inline import figure_html
from steadyslip.reports import rig as of_rig
from steadyslip.reports.brief import inside
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, lines, paragraph, table
from steadyslip.reports.results import parts_of
from steadyslip.verdict import analyze


def sources(fit: Fit) -> str:
    """Names of the records of a fit."""
    return ", ".join(Path(record.source).name for record in fit.plan.records)


@parts_of.register
def _fit(result: Fit, comparison: LawComparison | None = None, draws: Draws | None = None) -> Parts:
    rows = [(one.name, one.shown(), one.range() if one.determined else "not determined") for one in result.estimates]
    body = [
        heading("What was found"), table(rows, ("parameter", "value", "95 %")),
        *(paragraph(text, "warning") for text in warnings(result)),
    ]  # fmt: skip
    if draws is not None:
        body += [heading("How sure is that?"), *_drawn(draws)]
    if comparison is not None:
        body += [heading("Laws compared"), lines(comparison)]
    for i, record in enumerate(result.plan.records):
        name = Path(record.source).name
        fitted = figure_html(lambda i=i: figures.fit(result, record=i), "record and fit", 7.0)  # type: ignore[misc]
        steps = figure_html(lambda i=i: figures.steps(result, record=i), "steps of the record", 7.0)  # type: ignore[misc]
        body += [figure(fitted, f"{name}: record and fit."), figure(steps, "Its steps.")]
    corner = figure_html(lambda: figures.corner(result), "uncertainty", max(6.5, 1.3 * len(rows)))
    body += [figure(corner, "What the records leave open."), heading("Details"), lines(result)]
    for record in result.plan.records:
        body += [heading(f"Record {Path(record.source).name}", 3), lines(record)]
    question = f"Which friction do these records show, and how sure is that: {sources(result)}?"
    rig = result.rig()
    lead = ", ".join(f"{one.name} {one.shown()}" for one in result.estimates if one.determined)
    lead = f"{lead}." if lead else "No parameter is determined."
    return Parts(f"Fit to {sources(result)}", lead, question, body, rig, of_rig.as_file(rig))


def _drawn(result: Draws) -> list[str]:
    """Values, errors and intervals of draws beside those of the fit, and how they came about."""
    rows = []
    for one in result.fit.estimates:
        low, high = (format_quantity(end, one.unit, area=one.area) for end in result.interval(one.name))
        error = format_quantity(result.error(one.name), one.unit, 3, one.area)
        rows.append((one.name, one.shown(), error, f"{low} to {high}"))
    details = ", ".join(f"{name} {value:.4g}" for name, value in result.details.items())
    many = f"{len(result)} draws, {result.kind}{f' ({details})' if details else ''}."
    body = [
        table(rows, ("parameter", "of the fit", "error of the draws", "95 % of the draws")),
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
    rig, names = result.fit.rig(), sources(result.fit)
    body = [
        heading("What was found"), *_drawn(result),
        heading("The fit"), *(paragraph(text, "warning") for text in warnings(result.fit)), lines(result.fit),
    ]  # fmt: skip
    question = f"Which values of friction do the records allow: {names}?"
    return Parts(f"{len(result)} draws, {result.kind}, from {names}", "", question, body, rig, of_rig.as_file(rig))


@parts_of.register
def _prediction(result: Prediction) -> Parts:
    return of_rig.about(analyze(result.rig), result)


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
        heading("What was found"), table(rows, columns), figure(drawing, "How well each law explains the records."),
        heading("In words"), lines(result),
    ]  # fmt: skip
    question = f"Which law of friction explains the records best: {sources(best)}?"
    return Parts(f"{len(result.fits)} laws compared on {sources(best)}", "", question, body, None, "")


@parts_of.register
def _population(result: Population) -> Parts:
    rows, own = [], []
    for name in result.names:
        mean, other = result.mean(name), result.another(name)
        rows.append((name, mean.shown(), mean.range(), other.range()))
        for label, fit in result.fits.items():
            alone = fit[name].shown() if name in fit.names else "not fitted alone"
            own.append((name, label, alone, result.experiment(label, name).shown()))
    body = [
        heading("What was found"), table(rows, ("parameter", "mean", "mean, 95 %", "another experiment, 95 %")),
        figure(figure_html(result.plot, "population"), "Every experiment alone and with the others."),
        heading("The experiments"), table(own, ("parameter", "experiment", "alone", "with the others"), left=False),
        heading("In words"), lines(result),
        *(heading(f"Fit {label}") + inside(fit) for label, fit in result.fits.items()),
    ]  # fmt: skip
    question = "What do several experiments say together, how much do they differ, and what would another one show?"
    head = f"Population of {len(result.fits)} experiments"
    return Parts(head, f"{len(result.names)} parameters each.", question, body, None, "")
