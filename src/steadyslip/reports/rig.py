"""What a document says of a rig: question, sketch, inputs, verdict, edges, charts, formula, confidence, caveats."""

from __future__ import annotations

from collections.abc import Iterator

from steadyslip import figures
from steadyslip.core.areas import stress_name
from steadyslip.core.checks import in_words
from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.format import format_quantity
from steadyslip.experiments import Prediction
from steadyslip.explorer.sketch import sketch
from steadyslip.figures.inline import figure_html
from steadyslip.files.specifications import rig_to_text
from steadyslip.linear.formula import formula_in_parts
from steadyslip.linear.stiffness import STIFFNESS
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.protocol import Protocol
from steadyslip.reports.brief import rows_of
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import Markup, figure, heading, letter, math, paragraph, table
from steadyslip.verdict import Analysis, Tolerated
from steadyslip.verdict.findings import Verdict
from steadyslip.verdict.words import edge_rows, facts, headline, meaning

SMALL = (
    "The verdict is on small disturbances of steady sliding: it holds for the model and the numbers above, and says "
    "nothing of wear, heat or of what the laws leave out."
)


def about(analysis: Analysis, prediction: Prediction | None = None, tolerated: Tolerated | None = None) -> Parts:
    """The document of a verdict; with the friction of a fit, or tolerances, how sure that is."""
    rig = analysis.rig
    speed = format_quantity(rig.drive.velocity, "m/s")
    body = [
        heading("The rig"), figure(sketch(rig)), inputs(rig),
        heading("The verdict"), table(facts(analysis)), *(paragraph(text) for text in meaning(analysis)),
        *_confidence(prediction), *within(tolerated),
        heading("How far is the edge?"), *edges(analysis), *checked(analysis), *_charts(analysis),
        heading("The formulas"), *formulas(analysis),
        heading("What to keep in mind"), *(paragraph(text, "warning") for text in analysis.warnings), paragraph(SMALL),
    ]  # fmt: skip
    question = f"Will this rig slide steadily at {speed}, what would make it, and how far is it from the edge?"
    lead = analysis.reason[:1].upper() + analysis.reason[1:] + "."
    return Parts(headline(analysis, capitals=False), lead, question, body, rig, as_file(rig), analysis.branch)


def as_file(rig: Slider | Machine, protocol: Protocol | None = None) -> str:
    """A rig as the text of its file; one with a law that no file can name as Python writes it."""
    try:
        return rig_to_text(rig, protocol)
    except ParameterError:
        return f"{rig!r}\n[protocol]\n{protocol!r}" if protocol is not None else repr(rig)


def inputs(rig: Slider) -> str:
    """Every number of a rig with its letter, unit and meaning; totals where the rig has an area."""
    symbols = build_model(rig).parameters
    rows = []
    for name, one in rig.parameters().items():
        if one.value is None:
            continue
        known = letter(symbols[name]) if name in symbols else Markup("")
        rows.append(
            (
                name,
                known,
                format_quantity(one.value, one.role.unit, 6, rig.area_of(name)),
                stress_name(one.role.doc, rig.area_of(name)),
            )
        )
    return table(rows, ("parameter", "letter", "value", "meaning"))


def edges(analysis: Verdict) -> Iterator[str]:
    """The nearest edge of every parameter, and those that have none."""
    rows, without = edge_rows(analysis)
    if rows:
        head = ("parameter", "now", "edge", "change", "beyond it")
        yield paragraph("The nearest edge in each parameter, the others unchanged.")
        yield table(rows, head)
    if without:
        yield paragraph(f"No edge within range: {', '.join(without)}.", "small")


def checked(analysis: Verdict) -> Iterator[str]:
    """One line on what was asked a second time."""
    if analysis.checks:
        yield paragraph(in_words(analysis.checks), "small")


def _charts(analysis: Analysis) -> Iterator[str]:
    rig, stiffness = analysis.rig, analysis.rig.stiffness_name()
    near = [one.parameter for one in analysis.margins if one.edge is not None and one.parameter != stiffness]
    for name in near[:2]:
        words = f"Where sliding is stable over {name} and {stiffness}; the dot is this rig."
        chart = figure_html(lambda name=name: figures.stability_chart(rig, name, stiffness, points=101), words, 6.0)  # type: ignore[misc]
        yield figure(chart, words)
    if analysis.stable is not None:
        locus = figure_html(lambda: figures.root_locus(rig), "root locus", 6.0)
        yield figure(
            locus, f"Eigenvalues of small disturbances as {stiffness} varies; to the right of the axis they grow."
        )


def formulas(analysis: Analysis) -> Iterator[str]:
    """The critical stiffness where it has a formula, and the equations of the model."""
    try:
        whole, *parts = formula_in_parts(analysis.rig)
        yield paragraph("The critical stiffness of every rig with the same terms, along the sliding direction:")
        yield f'<div class="formula" tabindex="0">{math(whole)}</div>'
        if parts:
            yield paragraph("with what friction and contact answer to small changes in steady sliding:")
        for part in parts:
            yield f'<div class="formula" tabindex="0">{math(part)}</div>'
    except NotAvailable as refused:
        yield paragraph(f"The critical stiffness has no formula here: {refused}.")
    yield paragraph("The equations of motion:")
    for equation in build_model(analysis.rig).equations():
        yield f'<div class="formula" tabindex="0">{math(equation)}</div>'


def _confidence(prediction: Prediction | None) -> Iterator[str]:
    if prediction is None:
        return
    yield heading("How sure is that?")
    yield rows_of(str(prediction))
    yield figure(
        figure_html(lambda: prediction.plot(), "prediction", 6.0), "What the draws of the fit say about this rig."
    )


def within(found: Tolerated | None) -> Iterator[str]:
    """What tolerances make of a verdict."""
    if found is None:
        return
    yield heading("How sure is that, within the tolerances?")
    yield rows_of(str(found))
    left = "right of 0 disturbances grow"
    if found.along:
        left = "left of 1 the stiffness is less than critical" if found.along == STIFFNESS else "1 is the edge"
    words = f"Each parameter alone within its tolerance, and all of them; {left}."
    yield figure(figure_html(lambda: found.plot(), "tolerances", 7.0), words)
