"""Document on the verdict on a machine: question, inputs, verdict, modes, edges, assumptions."""

from __future__ import annotations

from collections.abc import Iterator

from steadyslip import figures
from steadyslip.core.format import format_quantity
from steadyslip.figures.inline import column_html, figure_html
from steadyslip.figures.machine_verdict import undrawn_edges
from steadyslip.machine.letters import label_of
from steadyslip.reports import rig as rig_report
from steadyslip.reports.brief import sketch_of
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, paragraph, table
from steadyslip.reports.recommendation import ORDER, Order, changeable, recommendation
from steadyslip.reports.sections import assumptions, motion, notes_of, references, tolerances_of
from steadyslip.verdict import Analysis, Tolerated
from steadyslip.verdict.machine import nearest_edge
from steadyslip.verdict.whole_text import facts
from steadyslip.verdict.words import EIGENVALUE_COLUMNS, eigenvalue_row, format_parameter, headline

_MAX_ROOTS = 12  # largest number of rows of the table of eigenvalues, so that it fits half a page (by trial)


def verdict_parts(analysis: Analysis, tolerated: Tolerated | None = None, order: Order = ORDER) -> Parts:
    """Contents (`Parts`) of the document on a machine's verdict, with verdicts within tolerances if given."""
    machine = analysis.rig
    speed = format_parameter(machine, "drive.velocity", float(machine.drive.velocity))
    body = [
        *recommendation(analysis, order, tolerated),
        *assumptions(machine, analysis.warnings, rig_report.VALIDITY),
        heading("The machine"), sketch_of(machine),
        rig_report.input_table(machine, tolerances_of(tolerated), notes_of(order.source)),
        heading("The verdict"), *_verdict_section(analysis),
        heading("How far is the edge?"), _verdict_figure(analysis), *rig_report.charts_over(analysis, order),
        *rig_report.edge_table(analysis), *rig_report.checks_line(analysis),
        *rig_report.tolerance_section(tolerated),
        *motion(analysis, source=order.source),
        heading("The formulas"), *rig_report.motion_equations(machine), *references(machine),
    ]  # fmt: skip
    question = f"Will this machine slide steadily at {speed}, and how far is it from the edge?"
    lead = f"{analysis.reason[:1].upper()}{analysis.reason[1:]}.{_settable_edge(analysis)}"
    return Parts(headline(analysis, capitals=False), lead, question, body, machine)


def _settable_edge(analysis: Analysis) -> str:
    """Sentence on the nearest edge of a changeable parameter, if a parameter that cannot change has a nearer edge."""
    edged = [one for one in analysis.margins if one.edge is not None]
    able = {one.parameter for one in changeable(analysis)}
    settable = next((one for one in edged if one.parameter in able), None)
    if settable is None or settable is edged[0]:
        return ""
    return f" Of what can be set, {nearest_edge(analysis, settable)}."


def _verdict_figure(analysis: Analysis) -> str:
    words = "Where it is stable in each parameter, how it moves in its leading mode, and its eigenvalues."
    if far := undrawn_edges(analysis):
        names = ", ".join(label_of(analysis.rig, name) for name in far)
        words += (
            f" Not drawn, but named below, {'are the edges' if len(far) > 1 else 'is the edge'} of {names}: a factor "
            "of 100 away or more, or not of a positive value."
        )
    broad = figure_html(lambda: figures.machine_verdict(analysis), words, 8.0)
    narrow = column_html(lambda: figures.machine_verdict(analysis), words)  # one column, for a narrow window
    return figure(f'<div class="broad">{broad}</div><div class="narrow">{narrow}</div>' if broad else "", words)


def _verdict_section(analysis: Analysis) -> Iterator[str]:
    """HTML of the verdict: facts, steady sliding of every contact, eigenvalues."""
    if analysis.steady is None:
        return
    yield table(
        (row for row in facts(analysis) if row[0] != "steady sliding"), caption="The verdict."
    )  # steady sliding has its own table below
    contacts = [
        (name, format_quantity(one.slip_rate, "m/s"), format_quantity(one.normal_force, "N"),
         format_quantity(one.friction_force, "N"), f"{one.friction:.4g}")
        for name, one in analysis.steady.contacts.items()
    ]  # fmt: skip
    yield heading("Steady sliding", 3)
    yield table(
        contacts, ("contact", "slides at", "normal force", "friction force", "friction"), caption="Steady sliding."
    )
    yield heading("Eigenvalues", 3)
    roots = [s for s in analysis.eigenvalues if s.imag >= 0]
    yield table(map(eigenvalue_row, roots[:_MAX_ROOTS]), EIGENVALUE_COLUMNS, caption="Eigenvalues.")
    if len(roots) > _MAX_ROOTS:
        yield paragraph(f"and {len(roots) - _MAX_ROOTS} more, which decay faster", "small")
