"""Document on the verdict on a slider: question, inputs, verdict, uncertainty, edges, charts, formulas."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import sympy as sp

from steadyslip import figures
from steadyslip.core.areas import stress_name
from steadyslip.core.checks import in_words
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import format_own, format_quantity
from steadyslip.core.records import Address, choices
from steadyslip.core.roles import PARAMETER_KINDS
from steadyslip.core.written import displayed_as
from steadyslip.experiments import Prediction
from steadyslip.figures.inline import column_html, figure_html
from steadyslip.linear.boundary import REMOTE
from steadyslip.linear.formula import formula_in_parts
from steadyslip.linear.stiffness import STIFFNESS
from steadyslip.machine.letters import MEMBERS, label_of, letter_of, worded, words_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.build import build_model
from steadyslip.model.legend import states_of_laws
from steadyslip.model.numeric import by_matrices
from steadyslip.reports.brief import sketch_of, text_html
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import (
    beside,
    equation as equation_html,
    figure,
    heading,
    inline_math,
    paragraph,
    table,
    why,
)
from steadyslip.reports.recommendation import ORDER, Order, changeable, recommendation
from steadyslip.reports.sections import (
    assumptions,
    input_letters,
    letters,
    motion,
    notes_of,
    references,
    subscript_of,
    tolerances_of,
)
from steadyslip.verdict import Analysis, Tolerated
from steadyslip.verdict.change_costs import unit_cost
from steadyslip.verdict.whole_text import facts, meaning
from steadyslip.verdict.words import EDGE_WORDS, edge_rows, format_parameter, headline

VALIDITY = (
    "The verdict is on small disturbances of steady sliding: it holds for the model and the inputs below, and says "
    "nothing of wear, heat or of what the laws leave out."
)


def verdict_parts(
    analysis: Analysis, prediction: Prediction | None = None, tolerated: Tolerated | None = None, order: Order = ORDER
) -> Parts:
    """Contents (`Parts`) of the document on a slider's verdict, with uncertainty from a fit or tolerances if given."""
    rig = analysis.rig
    speed = format_parameter(rig, "drive.velocity", float(rig.drive.velocity))
    body = [
        *recommendation(analysis, order, tolerated), *assumptions(rig, analysis.warnings, VALIDITY),
        heading("The rig"), sketch_of(rig),
        input_table(rig, tolerances_of(tolerated), notes_of(order.source)),
        heading("The verdict"), table(facts(analysis), caption="The verdict."),
        *(paragraph(text) for text in meaning(analysis) if "steadyslip" not in text),  # motion has a section below
        *_confidence_section(prediction), *tolerance_section(tolerated),
        heading("How far is the edge?"), *edge_table(analysis), *checks_line(analysis),
        *_chart_section(analysis, order), *motion(analysis, source=order.source),
        heading("The formulas"), *formula_section(analysis), *references(rig),
    ]  # fmt: skip
    question = f"Will this rig slide steadily at {speed}, what would make it, and how far is it from the edge?"
    lead = analysis.reason[:1].upper() + analysis.reason[1:] + "."
    return Parts(headline(analysis, capitals=False), lead, question, body, rig, branch=analysis.branch)


def input_table(
    rig: Slider | Machine,
    tolerances: Mapping[str, str] | None = MappingProxyType({}),
    notes: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """HTML table of the parameters of a rig: name in words, letter, value (total if the rig has an area), meaning.

    If `tolerances` is not empty a column has them (None: for results without tolerances), if `notes` is not empty one
    has the comment of the rig file on each value. The drive's speed is that of the body that the file names.
    """
    model = None if rig.holds or by_matrices(rig) else build_model(rig)
    rows, inputs = [], rig.parameters()
    letters_of_inputs = input_letters(model, rig)
    for name, letter in letters_of_inputs.items():
        one = inputs[name]
        known = inline_math(sp.Symbol(letter))
        number, of = rig.display_value(name, float(one.value or 0.0))
        with displayed_as(rig.written_as(name)):
            text = format_own(number, of, rig.printed_area(name))
        rows.append(
            (
                words_of(rig, name),
                known,
                text,
                stress_name(_meaning(one, letter_of(rig, name)), rig.printed_area(name)) + _fed_body(rig, name),
                *((tolerances.get(name, "none given"),) if tolerances else ()),
                *((_remark(notes, name),) if notes else ()),
            )
        )
    for name, (choice, value, usual) in choices(rig).items():
        if not usual or name in notes:
            chosen = "yes" if value is True else "no" if value is False else str(value)
            both = *(("",) if tolerances else ()), *((_remark(notes, name),) if notes else ())
            rows.append((label_of(rig, name), "", chosen, choice.doc, *both))
    more = (*(("tolerance",) if tolerances else ()), *(("source or remark",) if notes else ()))
    words = "Inputs." if tolerances or tolerances is None else "Inputs. Tolerances: none given."
    own = [name for name in letters_of_inputs if name.partition(".")[0] in MEMBERS]
    if shared := [one for one in own if letters_of_inputs[one].endswith(f"_{subscript_of(one)}")]:
        example = f"{label_of(rig, shared[0])} for {letters_of_inputs[shared[0]]}"
        words += f" Behind the name of a member its letter stands without the subscript: {example}."
    return table(rows, ("input", "letter", "value", "meaning", *more), caption=words)


def _fed_body(rig: Slider | Machine, name: str) -> str:
    """Clause on the body whose speed is printed as the drive's, and on the drive speed in the equations.

    Empty if both speeds are equal.
    """
    in_si = Rig.display_value(rig, name, 1.0)
    if rig.fed is None or name != "drive.velocity" or rig.display_value(name, 1.0) == in_si:
        return ""
    own = format_quantity(*Rig.display_value(rig, name, float(rig.drive.velocity)))
    return f", that of {rig.fed}; in the equations it is that of {rig.drive.driven() or 'the load point'}, {own}"


def _remark(notes: Mapping[str, str], name: str) -> str:
    """Comment on a value in the rig file, without backticks.

    ``rig file`` if the value has no comment, ``default`` if the file does not give the value.
    """
    return (notes[name].replace("`", "") or "rig file") if name in notes else "default"


def _meaning(one: Address, letter: str) -> str:
    """Meaning of a parameter, with its `letter`; for parameters of friction effects also what the effect does."""
    kind, doc = one.role.kind, one.role.meaning
    if "_" in letter:  # "Kp" of a description is the letter K_p
        doc = re.sub(rf"\b{letter.replace('_', '')}\b", letter, doc)
    return f"{doc}: {PARAMETER_KINDS[kind]}" if kind.endswith("effect") and doc.startswith(kind) else doc


def edge_table(analysis: Analysis) -> Iterator[str]:
    """HTML table of the nearest edge of every parameter, and a line that names parameters without an edge."""
    rig, far = analysis.rig, [one.parameter for one in analysis.margins if one.remote]
    without = [one.parameter for one in analysis.margins if one.edge is None]
    if rows := [row for one in analysis.margins if not one.remote for row in edge_rows(analysis, one)]:
        head = ("parameter", "now", "edge", "change", "beyond it")
        yield paragraph("The nearest edges in each parameter, below and above it, the others unchanged.")
        yield table(((label_of(rig, name), *rest) for name, *rest in rows), head, caption="Nearest edges.")
    if far:
        words = EDGE_WORDS["far"].format(remote=REMOTE).capitalize()
        yield paragraph(f"{words}: {', '.join(label_of(rig, name) for name in far)}.", "small")
    if without:
        names = ", ".join(label_of(rig, name) for name in without)
        yield paragraph(f"No edge within range: {names}.", "small")


def checks_line(analysis: Analysis) -> Iterator[str]:
    """HTML line on the independent checks of a verdict; nothing if there were none."""
    if analysis.checks:
        yield paragraph(in_words(analysis.checks), "small")


def chart_pairs(analysis: Analysis, order: Order) -> list[tuple[str, str]]:
    """Pairs of parameters over which to draw stability: changeable ones first, then those with the nearest edges.

    Two pairs for a slider, each with the stiffness; one for a machine, of the cheapest changes; none with matrices.
    """
    ordered = [*changeable(analysis, order.adjustable), *(one for one in analysis.margins if one.edge is not None)]
    names = list(dict.fromkeys(one.parameter for one in ordered))
    if not analysis.rig.in_forces:
        stiffness = analysis.rig.stiffness_name()
        return [(name, stiffness) for name in names if name != stiffness][:2]
    names.sort(key=unit_cost)
    return [(names[0], names[1])] if len(names) > 1 and not by_matrices(analysis.rig) else []


def charts_over(analysis: Analysis, order: Order) -> Iterator[str]:
    """HTML charts of stability over the pairs in `order.charts`, by default over `chart_pairs`."""
    rig = analysis.rig
    for x, y in order.charts or chart_pairs(analysis, order):
        over = " and ".join(label_of(rig, rig.resolve(name)) for name in (x, y))
        words = f"Where sliding is stable over {over}; the dot is this {'machine' if rig.in_forces else 'rig'}."
        chart = column_html(lambda x=x, y=y: figures.stability_chart(rig, x, y, points=101), words)  # type: ignore[misc]
        yield figure(chart, words)


def _chart_section(analysis: Analysis, order: Order) -> Iterator[str]:
    rig = analysis.rig
    drawn = list(charts_over(analysis, order))
    if analysis.stable is not None:
        varied = "stiffness k along the slide" if rig.axial_stiffness else label_of(rig, rig.stiffness_name())
        words = f"Eigenvalues of small disturbances as {varied} varies; to the right of the axis they grow."
        drawn.append(figure(column_html(lambda: figures.root_locus(rig), "root locus"), words))
    if charts := beside(drawn):
        yield charts


def formula_section(analysis: Analysis) -> Iterator[str]:
    """HTML of the formula of the critical stiffness, if one exists, and of the equations of motion."""
    printed: list[sp.Eq] = []
    try:
        whole, *parts = printed = formula_in_parts(analysis.rig)
        yield paragraph("The critical stiffness of every rig with the same terms, along the sliding direction:")
        yield equation_html(whole)
        if parts:
            yield paragraph("with what friction and contact answer to small changes in steady sliding:")
        for part in parts:
            yield equation_html(part)
    except NotAvailable as refused:
        yield paragraph(f"The critical stiffness has no formula here: {why(refused)}.")
    yield from motion_equations(analysis.rig, printed)


def motion_equations(rig: Slider | Machine, printed: Sequence[sp.Eq] = ()) -> Iterator[str]:
    """HTML of the equations of motion, and a table of the letters in these and in the earlier equations `printed`."""
    if by_matrices(rig):
        yield paragraph("The equations of motion are matrices, too large to be printed.")
        return
    model = build_model(rig)
    equations = model.equations()
    shown = [one for one in equations if _is_used(one, equations)]
    yield paragraph("The equations of motion:")
    for equation in shown:
        yield equation_html(equation)
    if axial := list(_along_axis(rig, model)):
        yield paragraph("The stiffness along the sliding direction, of that along the axis:")
        yield from map(equation_html, axial)
    if states := list(states_of_laws(model)):
        yield paragraph("The state of friction in the descriptions of its laws, which are named below:")
        yield from map(equation_html, states)
    yield letters(rig, [*printed, *shown, *axial, *states])


def _along_axis(rig: Slider | Machine, model: Model) -> Iterator[sp.Eq]:
    """Equation of the stiffness along the sliding direction, if the rig's stiffness is given along another axis."""
    if model.axial_share is not None:
        axial = sp.Symbol(rig.parameters()["slider.axial_stiffness"].role.letter)
        stiffness, share = (model.written(one) for one in (model.parameters["slider.stiffness"], model.axial_share))
        yield sp.Eq(stiffness, share * axial, evaluate=False)


def _is_used(equation: sp.Eq, others: Sequence[sp.Eq]) -> bool:
    """False for an equation that defines a symbol which no other equation contains."""
    return not equation.lhs.is_Symbol or any(
        equation.lhs in one.rhs.free_symbols | one.lhs.free_symbols for one in others if one is not equation
    )


def _confidence_section(prediction: Prediction | None) -> Iterator[str]:
    if prediction is None:
        return
    yield heading("How sure is that?")
    yield text_html(worded(prediction.rig, str(prediction)), "What the fit leaves open.")
    yield figure(
        figure_html(lambda: prediction.plot(), "prediction", 6.0), "What the draws of the fit say about this rig."
    )


def tolerance_section(found: Tolerated | None) -> Iterator[str]:
    """HTML of a verdict within tolerances; nothing for None."""
    if found is None:
        return
    yield heading("How sure is that, within the tolerances?")
    yield text_html(worded(found.rig, str(found)), "The verdict within the tolerances.")
    left = "right of 0 disturbances grow"
    if found.along:
        left = "left of 1 the stiffness is less than critical" if found.along == STIFFNESS else "1 is the edge"
    words = f"Each parameter alone within its tolerance, and all of them; {left}."
    yield figure(figure_html(lambda: found.plot(), "tolerances", 7.0), words)
