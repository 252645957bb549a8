"""What documents say of runs, cycles, maps and fits."""

from __future__ import annotations

from collections.abc import Iterator
from functools import singledispatch
from pathlib import Path
from typing import Any

from steadyslip import figures
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.quantities import shown
from steadyslip.experiments import Fit, LawComparison
from steadyslip.experiments.fitting.words import warnings
from steadyslip.explorer.sketch import sketch
from steadyslip.machine.slider import Slider
from steadyslip.maps import MapResult
from steadyslip.motion import History
from steadyslip.nonlinear import CycleBranch
from steadyslip.reports import rig as of_rig
from steadyslip.reports.brief import rows_of
from steadyslip.reports.document import Parts
from steadyslip.reports.drawings import drawn
from steadyslip.reports.elements import figure, heading, listing, paragraph, table
from steadyslip.verdict import Analysis, analyze

LISTED = 24


@singledispatch
def parts_of(result: Any, **options: Any) -> Parts:
    """What the document of a result says.

    Raises
    ------
    ParameterError
        If there is no document of it.
    """
    allowed = "a rig, a verdict, a run, a branch of cycles, a map or a fit"
    raise ParameterError([Problem("result", f"got {type(result).__name__}; allowed: {allowed}")])


@parts_of.register
def _rig(result: Slider, branch: int = 0, fit: Fit | None = None) -> Parts:
    if fit is None:
        return of_rig.about(analyze(result, branch=branch))
    from steadyslip.experiments import predict

    found = predict(result, fit)
    return of_rig.about(analyze(found.rig), found)


@parts_of.register
def _analysis(result: Analysis) -> Parts:
    return of_rig.about(result)


@parts_of.register
def _history(result: History) -> Parts:
    text = of_rig.as_file(result.rig, result.protocol)
    body = [
        heading("The rig"), figure(sketch(result.rig)), of_rig.inputs(result.rig),
        heading("What was done to it"), listing(text.partition("[protocol]")[2].strip()),
        heading("What it did"), *_words(result.summary()),
        figure(drawn(lambda: figures.history(result), "history", 7.0), "Velocity, friction, normal stress."),
        figure(drawn(lambda: figures.phase_plane(result), "phase plane", 5.5), "Friction over velocity."),
        *_slips(result),
    ]  # fmt: skip
    slips = len(result.slip_events)
    head = f"{slips or 'No'} slip event{'' if slips == 1 else 's'} in {shown(result.end, 's')}"
    question = f"What does this rig do in {shown(result.protocol.until or result.end, 's')} under the protocol below?"
    return Parts(head, _sentence(result.message), question, body, result.rig, text)


def _slips(result: History) -> Iterator[str]:
    slips = result.slip_events
    if not slips:
        return
    yield heading("Slip events", 3)
    area = result.rig.area
    rows = [
        (i, shown(one.begin, "s"), shown(one.duration, "s"), shown(one.slip, "m"), shown(one.peak_velocity, "m/s"),
         shown(one.stress_drop, "Pa", area=area))
        for i, one in enumerate(slips, start=1)
    ]  # fmt: skip
    if len(rows) > LISTED:
        yield paragraph(f"The last {LISTED} of {len(rows)}.", "small")
    yield table(rows[-LISTED:], ("", "begins", "lasts", "slip", "peak velocity", "stress drop"))


@parts_of.register
def _branch(result: CycleBranch) -> Parts:
    along, unit, area = result.along, result.unit, result.rig.area
    first, _, rest = str(result).partition("\n")
    step = max(1, len(result.cycles) // LISTED)
    rows = [
        (shown(one.value, unit, area=area), shown(one.period, "s"), shown(one.peak_velocity, "m/s"),
         shown(one.stress_drop, "Pa", area=area), "attracts" if one.stable else "unstable")
        for one in result.cycles[::step]
    ]  # fmt: skip
    special = [
        (one.kind, shown(one.cycle.value, unit, area=area), shown(one.cycle.period, "s")) for one in result.special
    ]
    body = [
        heading("The rig"), figure(sketch(result.rig)), of_rig.inputs(result.rig),
        heading("The cycles"), *_words(rest),
        figure(drawn(lambda: figures.cycle_branch(result), "branch of cycles", 6.5), f"Cycles along {along}."),
        table(special, ("special", along, "period")),
        table(rows, (along, "period", "peak velocity", "stress drop", ""), left=False),
    ]  # fmt: skip
    question = f"Which stick-slip cycles does this rig have as {along} varies?"
    return Parts(
        f"{len(result.cycles)} cycles along {along}",
        _sentence(first),
        question,
        body,
        result.rig,
        of_rig.as_file(result.rig),
    )


@parts_of.register
def _map(result: MapResult) -> Parts:
    rig, (first, _, rest) = result.rig, str(result).partition("\n")
    body = [
        heading("The rig"), figure(sketch(rig)), of_rig.inputs(rig),
        heading("The map"), *_words(rest),
        figure(drawn(lambda: result.plot(), "map", 6.5)),
    ]  # fmt: skip
    question = "How does the answer depend on the numbers that vary here?"
    return Parts(_sentence(first).rstrip("."), "", question, body, rig, of_rig.as_file(rig))


@parts_of.register
def _fit(result: Fit, comparison: LawComparison | None = None) -> Parts:
    names = [Path(record.source).name for record in result.plan.records]
    sources = ", ".join(names)
    rows = [(one.name, one.shown(), one.range() if one.determined else "not determined") for one in result.estimates]
    body = [
        heading("What was found"), table(rows, ("parameter", "value", "95 %")),
        *(paragraph(text, "warning") for text in warnings(result)),
    ]  # fmt: skip
    if comparison is not None:
        body += [heading("Laws compared"), listing(str(comparison))]
    for i in range(len(names)):
        fitted = drawn(lambda i=i: figures.fit(result, record=i), "record and fit", 7.0)  # type: ignore[misc]
        steps = drawn(lambda i=i: figures.steps(result, record=i), "steps of the record", 7.0)  # type: ignore[misc]
        body += [figure(fitted, f"{names[i]}: record and fit."), figure(steps, "Its steps.")]
    corner = drawn(lambda: figures.corner(result), "uncertainty", 6.5)
    body += [figure(corner, "What the records leave open."), heading("Details"), listing(str(result))]
    for name, record in zip(names, result.plan.records, strict=True):
        body += [heading(f"Record {name}", 3), listing(str(record))]
    question = f"Which friction do these records show, and how sure is that: {sources}?"
    rig = result.rig()
    return Parts(f"Fit to {sources}", f"{len(rows)} parameters.", question, body, rig, of_rig.as_file(rig))


def _sentence(text: str) -> str:
    """A line with a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def _words(text: str) -> Iterator[str]:
    """Lines of an answer: columns of name and words as a table, the rest as paragraphs."""
    yield rows_of(text)
