"""What a document says of a machine: question, inputs, verdict, how it moves, edges, caveats."""

from __future__ import annotations

from collections.abc import Iterator

from steadyslip import figures
from steadyslip.core.format import format_quantity
from steadyslip.figures.inline import figure_html
from steadyslip.figures.machine_verdict import undrawn_edges
from steadyslip.reports import rig as of_rig
from steadyslip.reports.brief import inside
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, paragraph, table
from steadyslip.verdict import MachineAnalysis, Tolerated
from steadyslip.verdict.machine import machine_facts
from steadyslip.verdict.words import headline


def about(analysis: MachineAnalysis, tolerated: Tolerated | None = None) -> Parts:
    """The document of a verdict on a machine."""
    machine = analysis.rig
    drive = machine.parameters()["drive.velocity"]
    speed = format_quantity(float(drive.value or 0.0), drive.role.unit)
    body = [
        heading("The machine"), inside(machine),
        heading("The verdict"), *_verdict(analysis),
        heading("How far is the edge?"), _picture(analysis), *of_rig.edges(analysis), *of_rig.checked(analysis),
        *of_rig.within(tolerated),
        heading("What to keep in mind"), *(paragraph(text, "warning") for text in analysis.warnings),
        paragraph(of_rig.SMALL),
    ]  # fmt: skip
    question = f"Will this machine slide steadily at {speed}, and how far is it from the edge?"
    lead = analysis.reason[:1].upper() + analysis.reason[1:] + "."
    return Parts(headline(analysis, capitals=False), lead, question, body, machine, of_rig.as_file(machine))


def _picture(analysis: MachineAnalysis) -> str:
    words = "Where it is stable in each parameter, how it moves in its leading mode, and its eigenvalues."
    if far := undrawn_edges(analysis):
        words += (
            f" Not drawn, but in the list below, is the edge of {', '.join(far)}: a factor of 100 away or more, or not "
            "of a positive value."
        )
    return figure(figure_html(lambda: figures.machine_verdict(analysis), words, 8.0), words)


def _verdict(analysis: MachineAnalysis) -> Iterator[str]:
    """Steady sliding of every contact, what disturbances do, and the eigenvalues."""
    if analysis.steady is None:
        return
    yield table(row for row in machine_facts(analysis) if row[0] != "steady sliding")  # which has a table of its own
    contacts = [
        (name, format_quantity(one.slip_rate, "m/s"), format_quantity(one.normal_force, "N"),
         format_quantity(one.friction_force, "N"), f"{one.friction:.4g}")
        for name, one in analysis.steady.contacts.items()
    ]  # fmt: skip
    yield heading("Steady sliding", 3)
    yield table(contacts, ("contact", "slides at", "normal force", "friction force", "friction"))
    yield heading("Eigenvalues", 3)
    yield table(map(_eigenvalue, (s for s in analysis.eigenvalues if s.imag >= 0)), ("rate", "period", "size"))


def _eigenvalue(s: complex) -> tuple[str, str, str]:
    from math import log, pi

    period = format_quantity(2 * pi / s.imag, "s") if s.imag else "none"
    if s.real == 0:
        return "0 1/s", period, "stays"
    return (
        f"{s.real:.4g} 1/s",
        period,
        f"{'doubles' if s.real > 0 else 'halves'} in {format_quantity(log(2) / abs(s.real), 's')}",
    )
