"""What documents say of runs, cycles, thresholds, maps and sensitivities."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from steadyslip import figures
from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_percent, format_quantity, format_range
from steadyslip.core.pages import Displayed
from steadyslip.core.records import key_of
from steadyslip.core.roles import Parameter
from steadyslip.experiments import Fit, predict
from steadyslip.explorer.sketch import sketch
from steadyslip.figures.inline import figure_html
from steadyslip.figures.maps import MAX_FACETS
from steadyslip.files.specifications.layout import own_fields
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps import MapResult, Sensitivity
from steadyslip.motion import History
from steadyslip.motion.events import ContactSlip
from steadyslip.nonlinear import Basin, CycleBranch, Threshold
from steadyslip.nonlinear.commands import Thresholds
from steadyslip.protocol import Protocol
from steadyslip.reports import machine as of_machine, rig as of_rig
from steadyslip.reports.brief import inside, rows_of
from steadyslip.reports.document import Parts
from steadyslip.reports.elements import figure, heading, paragraph, table
from steadyslip.verdict import Analysis, MachineAnalysis, Tolerated, analyze, tolerate

LISTED = 24
PLANE = "Spring stress over velocity; black: steady sliding at every velocity, the dot at that of the load point."
PLANE_OF_CONTACT = "Friction force over slip rate; black: steady sliding at any velocity, the dot at that of the drive."


@singledispatch
def parts_of(result: Any, **options: Any) -> Parts:
    """What the document of a result says; of one that has no document of its own, what notebooks show of it.

    Raises
    ------
    ParameterError
        If it is no result.
    """
    if not isinstance(result, Displayed) or options:
        got = ", ".join([type(result).__name__, *options])
        raise ParameterError([Problem("result", f"got {got}; allowed: a rig or a result, such as that of analyze")])
    rig = getattr(result, "rig", None)
    rig = rig if isinstance(rig, Slider | Machine) else None
    first = str(result).partition("\n")[0]
    kind = " ".join(re.findall("[A-Z]+[a-z]*", type(result).__name__)).lower()
    if first.startswith(f"{type(result).__name__}("):  # a repr
        first = kind
    body = [*about_rig(rig), heading("What was found"), inside(result)]
    return Parts(
        sentence(first).rstrip("."), "", f"What does the {kind} say?", body, rig, of_rig.as_file(rig) if rig else ""
    )


def about_rig(rig: Slider | Machine | None) -> list[str]:
    """Sketch and inputs; nothing where there is no rig."""
    if isinstance(rig, Machine):
        return [heading("The machine"), inside(rig)]
    return [] if rig is None else [heading("The rig"), figure(sketch(rig)), of_rig.inputs(rig)]


@parts_of.register
def _threshold(result: Threshold) -> Parts:
    return _thresholds(Thresholds(result.rig, (result,)))


@parts_of.register
def _thresholds(result: Thresholds) -> Parts:
    rows = [str(one).split(": ", 1) for one in result.found]
    limits = [
        f"a {one.kick} kick up to {format_quantity(one.survived, one.unit, 4, one.area)}"
        for one in result.found
        if one.bracket[0] > 0 and not np.isinf(one.size)
    ]
    unstable = any(one.size == 0 for one in result.found)
    none = "No kick is survived: steady sliding is unstable" if unstable else "Every kick that was tried is survived"
    head = f"Survives {' and '.join(limits)}" if limits else none
    basins = [found] if (found := result.__dict__.get("basin")) is not None else []
    body = [
        *about_rig(result.rig),
        heading("What was found"), table(rows),
        paragraph("Sizes have no unit: logarithms of ratios of velocities, natural lengths of displacement, shares of "
                  "the normal stress, and for blows velocities of the drive.", "small"),
        *(figure(figure_html(one.plot, "basin", 6.0), "What comes of every starting point.") for one in basins),
    ]  # fmt: skip
    question = "How large a kick does the steady sliding of this rig survive, and what happens beyond?"
    return Parts(head, "", question, body, result.rig, of_rig.as_file(result.rig))


@parts_of.register
def _basin(result: Basin) -> Parts:
    names, counts = np.unique(result.outcome, return_counts=True)
    rows = [(name, f"{100 * count / result.outcome.size:.3g} %") for name, count in zip(names, counts, strict=True)]
    reasons, numbers = np.unique(result.doubt[result.doubt != ""], return_counts=True)
    body = [
        *about_rig(result.rig),
        heading("What was found"), table(rows, ("comes to", "share of the points")),
        figure(figure_html(result.plot, "basin", 6.5), "What comes of every starting point."),
        *(paragraph(f"{n} undecided: {why}.", "small") for why, n in zip(reasons, numbers, strict=True)),
    ]  # fmt: skip
    question = "From which starting points does this rig return to steady sliding?"
    head = f"{100 * result.share:.3g} % of the starting points return"
    return Parts(head, "", question, body, result.rig, of_rig.as_file(result.rig))


@parts_of.register
def _sensitivity(result: Sensitivity) -> Parts:
    known = result.rig.parameters()
    ranges = [
        (name, format_range(low, high, known[name].role.unit, result.rig.area_of(name)), spacing, known[name].role.doc)
        for name, (low, high, spacing) in result.ranges.items()
    ]
    body = [*about_rig(result.rig), heading("What varied"), table(ranges, ("parameter", "range", "spacing", "meaning"))]
    for name in result.first:
        rows = []
        for parameter in result.ranked(name):
            i = result.parameters.index(parameter)
            (least, most), (low, high) = result.first_interval[name][:, i], result.total_interval[name][:, i]
            rows.append((parameter, f"{result.first[name][i]:.3f}", f"{least:.3f} to {most:.3f}",
                         f"{result.total[name][i]:.3f}", f"{low:.3f} to {high:.3f}"))  # fmt: skip
        columns = ("parameter", "alone", "95 %", "with others", "95 %")
        body += [heading(name.replace("_", " ").capitalize()), table(rows, columns)]
        if result.missing[name]:
            missing = f"It does not exist at {100 * result.missing[name]:.3g} % of the points, which are left out."
            body.append(paragraph(missing, "warning"))
    body.append(figure(figure_html(result.plot, "shares of variance", 6.5), "Shares of the variance (Sobol indices)."))
    if result.interrupted:
        body.append(paragraph("It was stopped before all points were done.", "warning"))
    (first, *_), question = result.first, "Which parameters decide, over the ranges below?"
    head = f"{result.ranked(first)[0]} decides most about the {first.replace('_', ' ')}"
    return Parts(head, "", question, body, result.rig, of_rig.as_file(result.rig))


@parts_of.register
def _rig(
    result: Slider, branch: int = 0, fit: Fit | None = None, tolerances: Mapping[str, Any] | None = None
) -> Parts:  # fmt: skip
    found = None
    if fit is not None:
        found = predict(result, fit)
        result = found.rig
    within = tolerate(result, tolerances) if tolerances else None
    return of_rig.about(analyze(result, branch=branch), found, within)


@parts_of.register
def _machine(
    result: Machine, branch: int = 0, fit: Fit | None = None, tolerances: Mapping[str, Any] | None = None
) -> Parts:  # fmt: skip
    if branch or fit is not None:
        raise NotAvailable("a machine has one steady sliding, and fits are of a slider; leave branch and fit out")
    return of_machine.about(analyze(result), tolerate(result, tolerances) if tolerances else None)


@parts_of.register
def _machine_analysis(result: MachineAnalysis) -> Parts:
    return of_machine.about(result)


@parts_of.register
def _tolerated(result: Tolerated) -> Parts:
    if isinstance(result.rig, Machine):
        return of_machine.about(analyze(result.rig), result)
    return of_rig.about(analyze(result.rig), None, result)


@parts_of.register
def _analysis(result: Analysis) -> Parts:
    return of_rig.about(result)


@parts_of.register
def _history(result: History) -> Parts:
    rig, text = result.rig, of_rig.as_file(result.rig, result.protocol)
    said = PLANE_OF_CONTACT if isinstance(rig, Machine) else PLANE
    plane = figure(figure_html(lambda: figures.phase_plane(result), "phase plane", 5.5), said)
    body = [
        *about_rig(rig),
        heading("What was done to it"), *done_to(rig, result.protocol),
        heading("What it did"), *_words(result.summary()),
        figure(figure_html(lambda: figures.history(result), "history", 7.0), f"Velocity, friction, {_load(rig)}."),
        plane,
        *_slips(result),
    ]  # fmt: skip
    slips = len(result.slip_events)
    head = f"{slips or 'No'} slip event{'' if slips == 1 else 's'} in {format_quantity(result.end, 's')}"
    if result.undisturbed:
        head = "Undisturbed: steady sliding goes on, which does not tell whether it is stable"
    question = (
        f"What does this rig do in {format_quantity(result.protocol.until or result.end, 's')} "
        "under the protocol below?"
    )
    return Parts(head, sentence(result.message), question, body, rig, text)


def _load(rig: Slider | Machine) -> str:
    """What presses, as the pictures of a rig have it."""
    return "normal force" if isinstance(rig, Machine) or rig.area is not None else "normal stress"


def done_to(rig: Slider | Machine, protocol: Protocol) -> Iterator[str]:
    """The pieces of a protocol one below the other, numbers in units that people read."""
    area = rig.area if isinstance(rig, Slider) else 1.0  # in forces
    turns = rig.parameters()["drive.velocity"].role.unit == "rad/s"
    rows = []
    for piece in protocol.pieces:
        told = []
        for item, role in own_fields(type(piece)):
            value = getattr(piece, item.name)
            if value is None or value == item.default:
                continue
            if isinstance(role, Parameter) and isinstance(value, float | int):
                unit = {"m/s": "rad/s", "m": "rad"}.get(role.unit, role.unit) if turns else role.unit
                told.append(f"{key_of(item)} {format_quantity(value, unit, area=area)}")
            else:
                told.append(f"{key_of(item)} {value if isinstance(value, str) else f'{np.size(value)} numbers'}")
        rows.append((piece.name.replace("-", " "), ", ".join(told)))
    yield table(rows) if rows else paragraph("Nothing: it starts in steady sliding.")


def _slips(result: History) -> Iterator[str]:
    slips = result.slip_events
    if not slips:
        return
    yield heading("Slip events", 3)
    area = result.rig.area if isinstance(result.rig, Slider) else None
    rows = [
        (one.contact if isinstance(one, ContactSlip) else i, format_quantity(one.begin, "s"),
         format_quantity(one.duration, "s"), format_quantity(one.slip, "m"), format_quantity(one.peak_velocity, "m/s"),
         format_quantity(one.force_drop, "N") if isinstance(one, ContactSlip)
         else format_quantity(one.stress_drop, "Pa", area=area))
        for i, one in enumerate(slips, start=1)
    ]  # fmt: skip
    drop = "force drop" if isinstance(slips[0], ContactSlip) else "stress drop"
    if len(rows) > LISTED:
        yield paragraph(f"The last {LISTED} of {len(rows)}.", "small")
    yield table(rows[-LISTED:], ("", "begins", "lasts", "slip", "peak velocity", drop))


@parts_of.register
def _branch(result: CycleBranch) -> Parts:
    along, unit, area = result.along, result.unit, result.rig.area_of(result.along)
    stress = "Pa" if isinstance(result.rig, Slider) else "N"
    drop = "stress drop" if isinstance(result.rig, Slider) else "force drop"
    first, _, rest = str(result).partition("\n")
    rows = [
        (format_quantity(one.value, unit, area=area), format_quantity(one.period, "s"),
         format_quantity(one.peak_velocity, "m/s"),
         format_quantity(one.stress_drop, stress, area=area if stress == "Pa" else None),
         "attracts" if one.stable else "unstable")
        for one in result.cycles
    ]  # fmt: skip
    listed = _told_apart(rows)
    special = [
        (one.kind, format_quantity(one.cycle.value, unit, area=area), format_quantity(one.cycle.period, "s"))
        for one in result.special
    ]
    body = [
        *about_rig(result.rig),
        heading("The cycles"), *_words(rest),
        figure(figure_html(lambda: figures.cycle_branch(result), "branch of cycles", 6.5), f"Cycles along {along}."),
        table(special, ("special", along, "period")),
        table(listed, (along, "period", "peak velocity", drop, ""), left=False),
        *([paragraph(f"{len(listed)} of the {len(rows)}.", "small")] if len(listed) < len(rows) else []),
    ]  # fmt: skip
    question = f"Which stick-slip cycles does this rig have as {along} varies?"
    return Parts(
        f"{len(result.cycles)} cycles along {along}",
        sentence(first),
        question,
        body,
        result.rig,
        of_rig.as_file(result.rig),
    )


def _told_apart(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Rows whose first cells differ from those of the row before; evenly taken from them where they are many."""
    apart = [row for i, row in enumerate(rows) if i == 0 or row[:3] != rows[i - 1][:3]]
    step = max(1, -(-len(apart) // LISTED))
    return apart[::-step][::-1]


@parts_of.register
def _map(result: MapResult) -> Parts:
    rig, (first, _, rest) = result.rig, str(result).partition("\n")
    about, found = sentence(first).rstrip(".").replace(" x ", " × "), _verdicts(result)
    body = [
        *about_rig(rig),
        heading("The map"), *_words(rest),
        *_pictures(result),
    ]  # fmt: skip
    question = "How does the answer depend on the numbers that vary here?"
    return Parts(found or about, f"{about}." if found else "", question, body, rig, of_rig.as_file(rig))


def _verdicts(result: MapResult) -> str:
    """How large a share of the points has each verdict, the largest first; empty where there is none."""
    if "status" not in result.results:
        return ""
    shares = sorted(result.statistics()["status"].items(), key=lambda one: -one[1])
    return sentence(
        ", ".join(f"{word} at {format_percent(share)}" for word, share in shares) + " of the points"
    ).rstrip(".")


def _pictures(result: MapResult) -> Iterator[str]:
    """Over the first two parameters: for each of a few values of a third, else at the values of the rig."""
    others = [name for name in result.dims if name != "sample"][2:]
    if len(others) == 1 and len(result.read(others[0])) <= MAX_FACETS:
        words = f"One picture for each value of {others[0]}."
        yield figure(figure_html(lambda: result.plot(facet=others[0]), words), words)
        return
    held = f"At the rig's own {', '.join(others)}, or next to it." if others else ""
    yield figure(figure_html(lambda: result.plot(), "map", 6.5), held)


def sentence(text: str) -> str:
    """A line with a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def _words(text: str) -> Iterator[str]:
    """Lines of an answer: columns of name and words as a table, the rest as paragraphs."""
    yield rows_of(text)
