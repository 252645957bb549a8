"""Documents on rigs, simulated motions, cycles, thresholds, maps and sensitivities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np

from steadyslip import figures
from steadyslip.core.areas import stress_name
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_percent, format_quantity, format_range
from steadyslip.core.pages import Displayed
from steadyslip.experiments import Fit, Population, predict
from steadyslip.figures.hunting import hunting
from steadyslip.figures.inline import figure_html
from steadyslip.figures.maps import MAX_FACETS
from steadyslip.machine.letters import label_of, worded
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.maps import MapResult, Sensitivity
from steadyslip.motion import History
from steadyslip.motion.events import ContactSlip
from steadyslip.motion.protocol_words import piece_words
from steadyslip.motion.sentence import drop_of
from steadyslip.nonlinear import Basin, CycleBranch, Threshold
from steadyslip.nonlinear.hunting.hunt import hunt
from steadyslip.nonlinear.hunting.hunt_result import Hunt
from steadyslip.nonlinear.kicks.several_kicks import Thresholds
from steadyslip.protocol import Protocol
from steadyslip.reports import held, machine_parts as machine_report, rig as rig_report
from steadyslip.reports.brief import kind_of, result_html, sketch_of, text_html
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, paragraph, table
from steadyslip.reports.recommendation import Order
from steadyslip.reports.sections import notes_of, references
from steadyslip.verdict import Analysis, Cures, Tolerated, analyze, tolerate
from steadyslip.verdict.words import format_parameter_range

MAX_ROWS = 24  # largest number of rows of a table of slip events or cycles, so that a document stays short
PHASE_PLANE = "Spring stress over velocity; black: steady sliding at every velocity, the dot at that of the load point."
CONTACT_PHASE_PLANE = (
    "Friction force over slip rate; black: steady sliding at any velocity, the dot at that of the drive."
)


@singledispatch
def parts_of(result: Any) -> Parts:
    """Contents (`Parts`) of the document of a result; types without a document of their own get the HTML of notebooks.

    Raises
    ------
    ParameterError
        If `result` is neither a rig nor a result.
    """
    if not isinstance(result, Displayed):
        got = type(result).__name__
        raise ParameterError([Problem("result", f"got {got}; allowed: a rig or a result, such as that of analyze")])
    own = getattr(result, "rig", None)
    rig: Any = own if isinstance(own, Rig) else None
    first = str(result).partition("\n")[0]
    kind = kind_of(result).lower()
    if first.startswith(f"{type(result).__name__}("):  # a repr
        first = kind
    body = [
        *rig_section(rig),
        heading("What was found"),
        worded(rig, result_html(result)) if rig else result_html(result),
    ]
    many = kind.endswith("s") and not kind.endswith(("is", "ss"))
    return Parts(sentence(first).rstrip("."), "", f"What {'do' if many else 'does'} the {kind} say?", body, rig)


def rig_section(
    rig: Slider | Machine | None, source: str = "", tolerances: Mapping[str, str] | None = None
) -> list[str]:  # fmt: skip
    """HTML of the sketch and inputs of a rig, with comments from the text of its file, `source`; empty for None.

    Tolerances are texts by name, or None for results that have no tolerances.
    """
    if rig is None:
        return []
    what = "The machine" if rig.bodies else "The rig"
    return [heading(what), sketch_of(rig), rig_report.input_table(rig, tolerances, notes_of(source))]


@parts_of.register
def _threshold(result: Threshold) -> Parts:
    return _thresholds(Thresholds(result.rig, (result,)))


@parts_of.register
def _thresholds(result: Thresholds) -> Parts:
    rows = [str(one).split(": ", 1) for one in result.found]
    limits = [
        f"{'every' if np.isinf(one.size) else 'a'} {one.kick} kick{f' at {one.at}' if one.at else ''} up to "
        + format_quantity(one.survived, one.unit, 4, one.area)
        + (", the largest tried" if np.isinf(one.size) else "")
        for one in result.found
        if one.bracket[0] > 0
    ]
    unstable = any(one.size == 0 for one in result.found)
    none = "No kick is survived: steady sliding is unstable" if unstable else "Not decided: which kicks are survived"
    head = f"Survives {' and '.join(limits)}" if limits else none
    basins = [found] if (found := result.__dict__.get("basin")) is not None else []
    body = [
        *rig_section(result.rig),
        heading("What was found"), table(rows, caption="Kicks that are survived."),
        paragraph("Sizes have no unit: logarithms of ratios of velocities, natural lengths of displacement, shares of "
                  "the normal stress, and for blows velocities of the drive.", "small"),
        *(figure(figure_html(one.plot, "basin", 6.0), "What comes of every starting point.") for one in basins),
    ]  # fmt: skip
    question = "How large a kick does the steady sliding of this rig survive, and what happens beyond?"
    return Parts(head, "", question, body, result.rig)


@parts_of.register
def _basin(result: Basin) -> Parts:
    names, counts = np.unique(result.outcome, return_counts=True)
    rows = [(name, f"{100 * count / result.outcome.size:.3g} %") for name, count in zip(names, counts, strict=True)]
    reasons, numbers = np.unique(result.doubt[result.doubt != ""], return_counts=True)
    body = [
        *rig_section(result.rig),
        heading("What was found"),
        table(rows, ("comes to", "share of the points"), caption="What comes of the points."),
        figure(figure_html(result.plot, "basin", 6.5), "What comes of every starting point."),
        *(paragraph(f"{n} undecided: {why}.", "small") for why, n in zip(reasons, numbers, strict=True)),
    ]  # fmt: skip
    question = "From which starting points does this rig return to steady sliding?"
    head = f"{100 * result.share:.3g} % of the starting points return"
    return Parts(head, "", question, body, result.rig)


@parts_of.register
def _sensitivity(result: Sensitivity) -> Parts:
    known = result.rig.parameters()
    ranges = [
        (
            label_of(result.rig, name),
            format_range(low, high, known[name].role.unit, result.rig.printed_area(name)),
            spacing,
            known[name].role.doc,
        )
        for name, (low, high, spacing) in result.ranges.items()
    ]
    body = [
        *rig_section(result.rig),
        heading("What varied"),
        table(ranges, ("parameter", "range", "spacing", "meaning"), caption="What varied, within which range."),
    ]
    for name in result.first:
        rows = []
        for parameter in result.ranked(name):
            i = result.parameters.index(parameter)
            (least, most), (low, high) = result.first_interval[name][:, i], result.total_interval[name][:, i]
            rows.append((label_of(result.rig, parameter), f"{result.first[name][i]:.3f}", f"{least:.3f} to {most:.3f}",
                         f"{result.total[name][i]:.3f}", f"{low:.3f} to {high:.3f}"))  # fmt: skip
        columns = ("parameter", "alone", "95 %", "with others", "95 %")
        body += [
            heading(name.replace("_", " ").capitalize()),
            table(rows, columns, caption="Shares of its variance that each parameter explains."),
        ]
        if result.missing[name]:
            missing = f"It does not exist at {100 * result.missing[name]:.3g} % of the points, which are left out."
            body.append(paragraph(missing, "warning"))
    body.append(figure(figure_html(result.plot, "shares of variance", 6.5), "Shares of the variance (Sobol indices)."))
    if result.interrupted:
        body.append(paragraph("It was stopped before all points were done.", "warning"))
    (first, *_), question = result.first, "Which parameters decide, over the ranges below?"
    head = f"{label_of(result.rig, result.ranked(first)[0])} decides most about the {first.replace('_', ' ')}"
    return Parts(head, "", question, body, result.rig)


@parts_of.register
def _rig(
    result: Slider, branch: int = 0, fit: Fit | Population | None = None, tolerances: Mapping[str, Any] | None = None,
    charts: Sequence[tuple[str, str]] = (), source: str = "",
) -> Parts:  # fmt: skip
    found = None
    if result.holds:
        return _of_held(result, source, fit is not None or branch or tolerances or charts)
    if fit is not None:
        found = predict(result, fit)
        result = found.rig
    within = tolerate(result, tolerances) if tolerances else None
    order = Order(charts, getattr(tolerances, "adjust", {}), source, getattr(tolerances, "unknown", {}))
    return rig_report.verdict_parts(analyze(result, branch=branch), found, within, order)


@parts_of.register
def _machine(
    result: Machine, branch: int = 0, fit: Fit | Population | None = None, tolerances: Mapping[str, Any] | None = None,
    charts: Sequence[tuple[str, str]] = (), source: str = "",
) -> Parts:  # fmt: skip
    if result.holds:
        return _of_held(result, source, fit is not None or branch or tolerances or charts)
    if branch or fit is not None:
        raise NotAvailable("a machine has one steady state, and fits are for sliders; leave branch and fit out")
    within = tolerate(result, tolerances) if tolerances else None
    order = Order(charts, getattr(tolerances, "adjust", {}), source, getattr(tolerances, "unknown", {}))
    return machine_report.verdict_parts(analyze(result), within, order)


def _of_held(rig: Slider | Machine, source: str, asked: Any) -> Parts:
    """Contents (`Parts`) of the document of a rig whose drive holds a position: whether it hunts."""
    if asked:
        raise NotAvailable(
            "the drive holds a position (velocity = 0), so the document is on whether the axis hunts; leave out "
            "branch, fit, tolerances and charts, which have no effect on that"
        )
    return replace(_hunt(hunt(rig), source), protocol=None)  # list the rig's own file, without the tried disturbance


@parts_of.register
def _hunt(result: Hunt, source: str = "") -> Parts:
    rig, (first, _, rest) = result.rig, str(result).partition("\n")
    words = "How far it is from its target, and the force of the drive, over time."
    body = [
        *held.recommendation(result), heading("What was done to it"), *protocol_table(rig, result.protocol),
        paragraph("It is at rest before, and its target is where this puts it."),
        heading("What was found"), text_html(worded(rig, rest), "What was found."),
        figure(figure_html(lambda: hunting(result), words, 7.0), words),
        *rig_section(rig, source), *references(rig),
    ]  # fmt: skip
    question = "Does this axis come to rest at the place that it holds, or does it hunt: how far, and how often?"
    return Parts(first.capitalize(), "", question, body, rig, result.protocol)


@parts_of.register
def _tolerated(result: Tolerated, source: str = "") -> Parts:
    order = Order((), getattr(result.tolerances, "adjust", {}), source)
    return _verdict_parts(analyze(result.rig), order, result)


@parts_of.register
def _analysis(result: Analysis, source: str = "") -> Parts:
    return _verdict_parts(result, Order((), {}, source))


def _verdict_parts(result: Analysis, order: Order, within: Tolerated | None = None) -> Parts:
    if result.rig.in_forces:
        return machine_report.verdict_parts(result, within, order)
    return rig_report.verdict_parts(result, tolerated=within, order=order)


@parts_of.register
def _cures(result: Cures, source: str = "") -> Parts:
    rig, lines = result.rig, [worded(result.rig, one) for one in result.sentences()]
    ranges = {name: format_parameter_range(rig, name, *ends) for name, ends in result.ranges.items()}
    body = [
        *rig_section(rig, source, ranges),
        heading("What was found"), *(paragraph(sentence(one)) for one in lines[1:]), *_changes(result),
    ]  # fmt: skip
    stable = f"is stable with a chance of {format_percent(result.sure)}" if result.error else "is stable"
    of = "machine" if rig.in_forces else "rig"
    question = f"What is to be changed so that this {of} {stable}, and what does it cost?"
    if result.chance >= result.sure:
        question = f"Is it certain enough that this {of} is stable, and what would lose it?"
    return Parts(lines[0].rstrip(":"), "", question, body, rig)


def _changes(result: Cures) -> Iterator[str]:
    """HTML tables by parameter of the values that reach the required chance, or beyond which it is lost."""
    rig = result.rig
    if result.chance >= result.sure:
        rows = [
            (label_of(rig, one.parameter), one.written(one.value), " or ".join(map(one.written, ends)))
            for one, ends in result.losses().items()
        ]
        yield (
            table(rows, ("parameter", "now", "lost from"), caption="Changes of one value that lose it.") if rows else ""
        )
        return
    for several, words in ((result.windows, "may be changed"), (result.unlisted, "are not listed as adjustable")):
        found = [
            (
                label_of(rig, one.parameter),
                one.written(one.value),
                str(one),
                f"{one.cost:.3g}" if one.windows else "none",
            )
            for one in several
        ]
        if found:
            head = ("parameter", "now", "enough alone", "cost of the nearest")
            yield table(found, head, caption=f"Values that {words}, one at a time.")


@parts_of.register
def _history(result: History) -> Parts:
    rig = result.rig
    caption = CONTACT_PHASE_PLANE if rig.contacts else PHASE_PLANE
    plane = figure(figure_html(lambda: figures.phase_plane(result), "phase plane", 5.5), caption)
    body = [
        *rig_section(rig),
        heading("What was done to it"), *protocol_table(rig, result.protocol),
        heading("What it did"), text_html(worded(rig, result.summary()), "What it did."),
        figure(figure_html(lambda: figures.history(result), "history", 7.0), f"Velocity, friction, {_load_name(rig)}."),
        plane,
        *_slip_table(result),
    ]  # fmt: skip
    slips = len(result.slip_events)
    head = f"{slips or 'No'} slip event{'' if slips == 1 else 's'} in {format_quantity(result.end, 's')}"
    if result.undisturbed:
        head = "Undisturbed: steady sliding goes on, which does not tell whether it is stable"
    question = (
        f"What does this rig do in {format_quantity(result.protocol.until or result.end, 's')} "
        "under the protocol below?"
    )
    lead = " ".join(sentence(words) for words in (result.message, result.sentence) if words)
    return Parts(head, lead, question, body, rig, result.protocol)


def _load_name(rig: Slider | Machine) -> str:
    """Name of the normal load in the figures of a rig: force for machines and rigs with an area, else stress."""
    return stress_name(rig.result_name("normal stress"), rig.area)


def protocol_table(rig: Slider | Machine, protocol: Protocol) -> Iterator[str]:
    """HTML table of the pieces of a protocol, with numbers in display units."""
    rows = [(name, ", ".join(items)) for name, items in (piece_words(rig, one) for one in protocol.pieces)]
    yield table(rows, caption="What was done to it.") if rows else paragraph("Nothing: it starts in steady sliding.")


def _slip_table(result: History) -> Iterator[str]:
    slips = result.slip_events
    if not slips:
        return
    yield heading("Slip events", 3)
    area = result.rig.area
    rows = [
        (one.contact if isinstance(one, ContactSlip) else i, format_quantity(one.begin, "s"),
         format_quantity(one.duration, "s"), format_quantity(one.slip, "m"), format_quantity(one.peak_velocity, "m/s"),
         format_quantity(*drop_of(one, result.rig.lever_at(one.contact))) if isinstance(one, ContactSlip)
         else format_quantity(one.stress_drop, "Pa", area=area))
        for i, one in enumerate(slips, start=1)
    ]  # fmt: skip
    turning = {result.rig.lever_at(name) is not None for name in result.rig.contacts}
    drop = ("torque drop" if min(turning) else "drop" if max(turning) else "force drop") if turning else "stress drop"
    if len(rows) > MAX_ROWS:
        yield paragraph(f"The last {MAX_ROWS} of {len(rows)}.", "small")
    yield table(
        rows[-MAX_ROWS:],
        ("contact" if result.rig.contacts else "number", "begins", "lasts", "slip", "peak velocity", drop),
        caption="Slip events.",
    )


@parts_of.register
def _branch(result: CycleBranch) -> Parts:
    along, unit, area = result.along, result.unit, result.rig.printed_area(result.along)
    swings, of = result.swings()
    first, _, rest = str(result).partition("\n")
    words = label_of(result.rig, along)
    rows = [
        (format_quantity(one.value, unit, area=area), format_quantity(one.period, "s"),
         format_quantity(one.peak_velocity, "m/s"),
         format_quantity(float(swing), of, area=area if of == "Pa" else None),
         "attracts" if one.stable else "unstable")
        for one, swing in zip(result.cycles, swings, strict=True)
    ]  # fmt: skip
    listed = _distinct_rows(rows)
    special = [
        (one.kind, format_quantity(one.cycle.value, unit, area=area), format_quantity(one.cycle.period, "s"))
        for one in result.special
    ]
    body = [
        *rig_section(result.rig),
        heading("The cycles"), text_html(worded(result.rig, rest), "The branch of cycles."),
        figure(figure_html(lambda: figures.cycle_branch(result), "branch of cycles", 6.5),
               f"Cycles along {words}."),
        table(special, ("special", words, "period"), caption="Where the branch turns, ends or changes its kind."),
        table(listed, (words, "period", "peak velocity", result.swing_label, ""), False, "Cycles along the branch."),
        *([paragraph(f"{len(listed)} of the {len(rows)}.", "small")] if len(listed) < len(rows) else []),
    ]  # fmt: skip
    question = f"Which stick-slip cycles does this rig have as {words} varies?"
    own = result.at_rig.sentence
    lead = sentence(first) + (f" The rig itself: {own}." if own else "")
    return Parts(f"{len(result.cycles)} cycles along {words}", lead, question, body, result.rig)


def _distinct_rows(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Rows whose first three cells differ from those of the previous row, thinned evenly to at most `MAX_ROWS`."""
    apart = [row for i, row in enumerate(rows) if i == 0 or row[:3] != rows[i - 1][:3]]
    step = max(1, -(-len(apart) // MAX_ROWS))
    return apart[::-step][::-1]


@parts_of.register
def _map(result: MapResult) -> Parts:
    rig, (first, _, rest) = result.rig, str(result).partition("\n")
    about, found = sentence(first).rstrip(".").replace(" x ", " × "), _status_shares(result)
    body = [
        *rig_section(rig),
        heading("The map"),
        text_html(worded(rig, rest), "What the map found."),
        *_map_figures(result),
    ]
    question = "How does the answer depend on the numbers that vary here?"
    return Parts(found or about, f"{about}." if found else "", question, body, rig)


def _status_shares(result: MapResult) -> str:
    """Sentence with the share of points of each status, largest first; empty for maps without status."""
    if "status" not in result.results:
        return ""
    shares = sorted(result.statistics()["status"].items(), key=lambda one: -one[1])
    return sentence(
        ", ".join(f"{word} at {format_percent(share)}" for word, share in shares) + " of the points"
    ).rstrip(".")


def _map_figures(result: MapResult) -> Iterator[str]:
    """HTML figure of a map over its first two parameters: a panel for each value of a third, or at the rig's values."""
    rig, others = result.rig, [name for name in result.dims if name != "sample"][2:]
    if len(others) == 1 and len(result.read(others[0])) <= MAX_FACETS:
        words = f"One picture for each value of {label_of(rig, others[0])}."
        yield figure(figure_html(lambda: result.plot(facet=others[0]), words), words)
        return
    held = f"At the rig's own {', '.join(label_of(rig, name) for name in others)}, or next to it." if others else ""
    yield figure(figure_html(lambda: result.plot(), "map", 6.5), held)


def sentence(text: str) -> str:
    """Text with a capital first letter and a full stop."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."
