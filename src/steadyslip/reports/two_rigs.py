"""Document on two rigs side by side: verdicts, the differences that decide them, and recommended changes."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from typing import Any

from steadyslip.figures.inline import figure_html
from steadyslip.figures.two_rigs import abscissa
from steadyslip.machine.letters import label_of, worded
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, paragraph, table
from steadyslip.reports.recommendation import Order, recommendation
from steadyslip.reports.results import parts_of, rig_section
from steadyslip.reports.rig import VALIDITY, edge_table
from steadyslip.reports.sections import assumptions, motion, references, tolerances_of
from steadyslip.verdict import RigComparison, Tolerated
from steadyslip.verdict.between import IMPOSSIBLE
from steadyslip.verdict.words import headline


@parts_of.register
def _comparison(result: RigComparison) -> Parts:
    rigs: list[Any] = [one.rig for one in result.verdicts]
    of_each: list[tuple[str, Any, Tolerated | None]] = list(
        zip(result.names, result.verdicts, result.within, strict=True)
    )
    a, b = result.names
    (label, *names), *sides = result.side_by_side()
    compared = [tuple(_with_words(rigs, cells)) for cells in sides]
    body = [
        *(part for name, one, within in of_each
          for part in recommendation(one, _order(within), within, f"The recommendation for {name}")),
        *_assumed(result),
        heading("Side by side"), table(compared, (label or "of", *names), caption="The two rigs."),
        heading("What differs?"), *_differences(result), _chart(result),
        *(part for name, one, within in of_each
          for part in (heading(f"How far is the edge of {name}?"), *edge_table(one),
                       *motion(one, f"The motion of {name}"), heading(f"Inputs of {name}"),
                       *rig_section(one.rig, tolerances=tolerances_of(within))[1:])),
        *references(*rigs, names=result.names),
    ]  # fmt: skip
    verdicts = [headline(one, capitals=False).partition(":")[0].lower() for one in result.verdicts]
    question = "Which of the two slides steadily, and which of their differences decides it?"
    return Parts(f"{a}: {verdicts[0]}; {b}: {verdicts[1]}", _answer(result), question, body)


def _assumed(result: RigComparison) -> Iterator[str]:
    """HTML of the assumptions of both verdicts; an assumption on one rig only begins with the name of that rig."""
    first, second = ([*assumptions(one.rig, one.warnings, VALIDITY)] for one in result.verdicts)
    yield from (part for part in first if part in second)
    for name, parts, others in zip(result.names, (first, second), (second, first), strict=True):
        yield from (part.replace(">", f">{html.escape(name)}: ", 1) for part in parts if part not in others)


def _order(within: Tolerated | None) -> Order:
    return Order((), {} if within is None else getattr(within.tolerances, "adjust", {}))


def _answer(result: RigComparison) -> str:
    """Sentences on the differences that change the verdict by themselves, or on the one with the largest part."""
    rig: Any = result.verdicts[0].rig
    if decisive := [worded(rig, text) for text in result.decisive()]:
        return f"{'; '.join(decisive)}."
    if not result.differences:
        return "They have the same equations and numbers."
    if not result.measure:
        return "No difference decides, as the verdict is the same."
    one = result.differences[0]
    name = label_of(rig, one.parameter)
    part = f", by {result.part_in_words(one).replace('x ', 'a factor of ')} of {result.of}" if result.measure else ""
    return f"No difference decides, as the verdict is the same; most of what differs comes from {name}{part}."


def _differences(result: RigComparison) -> Iterator[str]:
    """HTML table of the differences, with the part of each in the change, and an explanation of parts."""
    rig: Any = result.verdicts[0].rig
    a, b = result.names
    known = bool(result.measure)
    rows = [
        (label_of(rig, one.parameter), one.first, one.second, *([result.part_in_words(one)] if known else []),
         one.first_with, one.second_with)
        for one in result.differences
    ]  # fmt: skip
    if not known:
        lost = [one.parameter for one in result.differences if IMPOSSIBLE in (one.first_with, one.second_with)]
        such = f", as with the {' or '.join(label_of(rig, name) for name in lost)} of the other alone" if lost else ""
        yield paragraph(
            f"How much each difference contributes is not given: that needs all mixtures of {a} and {b}, and some "
            f"cannot be built or do not slide steadily{such}. The last two columns give the effect of each alone."
        )
    part = [f"its part in {result.of}"] if known else []
    head = ("difference", a, b, *part, f"{a} with that of {b}", f"{b} with that of {a}")
    first = "Differences, the one with the largest part first." if known else "Differences."
    yield table(rows, head, caption=first)
    if known:
        of = "the factor of k/k_cr" if result.measure == "safety" else "the change of the growth rate"
        over = "; a range of parts is that over values of what is not known" if any(result.unknown) else ""
        yield paragraph(f"A part is {of} in the mean over all orders of making the changes{over}.", "small")


def _chart(result: RigComparison) -> str:
    """HTML figure of the distance of both rigs from the edge, over a parameter in which they differ."""
    a, b = result.names
    over = label_of(result.verdicts[0].rig, abscissa(result))
    words = f"How near {a} and {b} are to the edge of stability, over {over}; the marks are the rigs."
    return figure(figure_html(result.plot, words, 6.0), words)


def _with_words(rigs: Sequence[Any], cells: Sequence[str]) -> Iterator[str]:
    """Cells of a row about two rigs, with dotted parameter names at their beginning replaced by words."""
    yield next((label_of(rig, cells[0]) for rig in rigs if cells[0] in rig.parameters()), cells[0])
    for rig, cell in zip(rigs, cells[1:], strict=True):
        name, _, rest = cell.partition(" ")
        yield f"{label_of(rig, name)} {rest}" if name in rig.parameters() else cell
