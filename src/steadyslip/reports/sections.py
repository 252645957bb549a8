"""Sections of a document for who ordered it: recommendation, assumptions, inputs, motion, laws and letters."""

from __future__ import annotations

import inspect
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import sympy as sp

from steadyslip import figures
from steadyslip.core.areas import outside, stress_name
from steadyslip.core.errors import NotAvailable, ParameterError, SteadyslipError
from steadyslip.core.format import format_quantity, format_range
from steadyslip.core.records import records_in
from steadyslip.figures.inline import figure_html
from steadyslip.linear.boundary import Margin
from steadyslip.linear.formula import MEANINGS
from steadyslip.linear.status import stability
from steadyslip.machine.letters import letter_of, said
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.build import build_model
from steadyslip.model.legend import legend, letters_in
from steadyslip.model.numeric import has_structure
from steadyslip.motion import History
from steadyslip.reports.elements import figure, heading, inline_math, paragraph, table, why
from steadyslip.reports.literature import METHOD, cited
from steadyslip.verdict import Tolerated
from steadyslip.verdict.analysis import Analysis
from steadyslip.verdict.judder import STEP, motion_after
from steadyslip.verdict.words import told

BEYOND_EDGE = 0.2  # margin of a recommended value beyond the edge, share of it: uses up 10 % of error on both sides
SURE = 0.95  # chance of stable sliding from which a rig is kept as it is: that which `cure` asks for
_ROWS = 4  # changes that are recommended, nearest first


def recommendation(
    analysis: Analysis, adjustable: Sequence[str] = (), tolerated: Tolerated | None = None
) -> Iterator[str]:
    """HTML of what to change, or to keep, with a margin beyond the edge; each value is judged anew.

    `adjustable` names what can be changed; otherwise all that the rig has but parameters of friction, and these if
    nothing else helps. With tolerances it is kept only where it is stable with a chance of `SURE`.
    """
    yield heading("The recommendation")
    if tolerated is not None and tolerated.share < SURE:
        asked = f"steadyslip cure --sure '{100 * SURE:g} %' gives changes that make it so sure"
        yield paragraph(f"{tolerated.headline()}: {asked}. What follows is of the values themselves.")
    elif analysis.stable:
        yield paragraph("Keep it as it is.")
    if analysis.stable:
        yield paragraph(_what_to_hold(analysis, adjustable))
        return
    rows = [row for one in changeable(analysis, adjustable) if (row := _change(analysis, one))][:_ROWS]
    if not rows:
        yield paragraph("No single change within range makes it stable; change several, as steadyslip cure proposes.")
        return
    name, now, to, *_ = rows[0]
    yield paragraph(f"Change {name} from {now} to {to}. Each row below is enough alone, the others unchanged.")
    share = f"{100 * BEYOND_EDGE:g} %"
    head = ("change", "now", "recommended", "edge", f"stable {share} beyond the edge")
    yield table(rows, head, caption="Changes that make it stable.")


def changeable(analysis: Analysis, adjustable: Sequence[str] = ()) -> list[Margin]:
    """Margins that a document speaks of, nearest first: of what would make the rig stable, or keep it so.

    Of what is named in `adjustable`; else of all that the rig has but friction, and of that if there is nothing else.
    """
    edged = [one for one in analysis.margins if one.edge is not None and (analysis.stable or _cures(one))]
    chosen = [one for one in edged if one.parameter in adjustable]
    present = [one for one in edged if one.value]  # from zero it is no change, but a part to be added
    return chosen or [one for one in present if "friction." not in one.parameter] or present


def _what_to_hold(analysis: Analysis, adjustable: Sequence[str]) -> str:
    """Sentences on the nearest edge of all, and on that of what can be set, if it is another."""
    edged = [one for one in analysis.margins if one.edge is not None]
    if not edged:
        return "No parameter has an edge within range."
    can_be_set = set(adjustable) or {one.parameter for one in edged if "friction." not in one.parameter}
    settable = [one for one in edged if one.parameter in can_be_set]
    nearest, chosen = edged[0], next(iter(settable), None)
    if nearest is chosen:
        return f"The nearest edge is that of {_side(analysis, nearest)}."
    text = f"The nearest edge is one of friction, {_side(analysis, nearest)}."
    if chosen is None:
        return f"{text} Nothing that can be set has one within range."
    return f"{text} Of what can be set, the nearest is that of {_side(analysis, chosen)}."


def _side(analysis: Analysis, margin: Margin) -> str:
    """Parameter, its own value, and the side of its edge on which sliding stays stable."""
    edge = margin.edge.value if margin.edge else math.nan
    side = "below" if edge > margin.value else "above"
    now, end = (_value(analysis, margin, value) for value in (margin.value, edge))
    return f"{said(analysis.rig, margin.parameter)}, now {now}: keep it {side} {end}"


def _cures(margin: Margin) -> bool:
    edge = margin.edge
    if edge is None or not edge.value:
        return False
    return not margin.remote and edge.stable == ("above" if edge.value > margin.value else "below")


def _change(analysis: Analysis, margin: Margin) -> tuple[str, str, str, str, str] | None:
    """Row of a change: name, value, recommended value, edge, and whether it is stable there; None if not."""
    if margin.edge is None:
        return None
    rig: Any = analysis.rig
    edge = margin.edge.value
    away = math.copysign(BEYOND_EDGE * abs(edge - margin.value if margin.unit == "rad" else edge), edge - margin.value)
    try:
        holds = stability(rig.with_values({margin.parameter: edge + away})) == "stable"
    except (ParameterError, NotAvailable):
        holds = False
    if not holds:
        return None
    word = "above" if edge > margin.value else "below"
    words = [_value(analysis, margin, value) for value in (margin.value, edge + away, edge)]
    return said(rig, margin.parameter), words[0], words[1], f"{word} {words[2]}", "yes"


def _value(analysis: Analysis, margin: Margin, value: float) -> str:
    return told(analysis.rig, margin.parameter, value)


def assumptions(rig: Slider | Machine, warnings: Sequence[str], validity: str) -> Iterator[str]:
    """HTML of what the verdict takes for granted."""
    yield heading("Assumptions")
    inertia = "with inertia" if has_structure(rig) or build_model(rig).inertial else "without inertia (quasistatic)"
    bodies = "structures move as their matrices say, other" if has_structure(rig) else ""
    words = f"The rig is modelled {inertia}; {bodies} bodies are rigid, and each contact has one normal force."
    yield paragraph(words.replace("  ", " "))
    yield paragraph(validity)
    yield from (paragraph(text, "warning") for text in warnings)


def tolerances_of(found: Tolerated | None) -> dict[str, str]:
    """Text of the tolerance of each parameter by name."""
    return (
        {}
        if found is None
        else {one.parameter: format_range(one.low, one.high, one.unit, one.area) for one in found.alone}
    )


def notes_of(text: str) -> dict[str, str]:
    """Comments behind the values of a rig file by dotted name, empty where there is none.

    >>> notes_of("[friction]\\na = 0.01  # measured on B819\\nb = 0.02")
    {'friction.a': 'measured on B819', 'friction.b': ''}
    """
    found, section = dict.fromkeys(_keys(tomllib.loads(text)), ""), ""
    many: Counter[str] = Counter()
    for line in text.splitlines():
        if head := re.match(r"\s*(\[+)([\w.-]+)\]+", line):
            section = head[2]
            if len(head[1]) > 1:  # one of several tables, which are counted from 1
                many[section] += 1
                section = f"{section}.{many[section]}"
        elif key := re.match(r"\s*([\w-]+)\s*=\s*(?:\"[^\"]*\"|[^#\"])*(?:#\s*(.*))?$", line):
            found |= {name: (key[2] or "").strip() for name in [f"{section}.{key[1]}"] if name in found}
    return found


def _keys(table: Mapping[str, Any], before: str = "") -> Iterator[str]:
    """Dotted names of the values of a table, in which tables of an array are counted from 1."""
    for key, value in table.items():
        many = isinstance(value, list) and all(isinstance(one, dict) for one in value)
        inner = {f"{key}.{n}": one for n, one in enumerate(value, 1)} if many else {key: value}
        for name, one in inner.items():
            yield from _keys(one, f"{before}{name}.") if isinstance(one, dict) else [before + name]


def motion(analysis: Analysis) -> Iterator[str]:
    """HTML of the motion after a small disturbance: time history and phase plane with the cycle."""
    yield heading("The motion")
    rig: Any = analysis.rig
    try:
        branch, unstable = getattr(analysis, "branch", 0), analysis.stable is False
        run = None if analysis.stable is None else motion_after(rig, analysis.eigenvalues, branch, repeated=unstable)
    except SteadyslipError as refused:
        yield paragraph(f"It was not simulated: {why(refused)}.")
        return
    if run is None:
        yield paragraph("There is no steady sliding to disturb, or no rate at which a disturbance changes.")
        return
    faster = f"After the drive was faster by {100 * (STEP - 1):.0f} % for a while"
    yield paragraph(f"{faster}: {_told(run, analysis)}.")
    words = "Motion after the drive was faster for a while, over time."
    yield figure(figure_html(lambda: figures.history(run), words, 6.4), words)
    words = "The same motion in the phase plane: what it circles is the cycle, if it settles on one."
    yield figure(figure_html(lambda: figures.phase_plane(run), words, 5.0), words)


def _told(run: History, analysis: Analysis) -> str:
    """What a run did: its slip events and its early end, or else how near it comes to steady sliding."""
    ended = [run.message.replace("_", " ")] if run.status != "done" else []
    if run.sentence or ended:
        return "; then ".join([run.sentence, *ended] if run.sentence else ended)
    steady: Any = getattr(analysis, "steady", None)
    speeds = {f"{name}.slip_rate": one.slip_rate for name, one in steady.contacts.items()} if run.rig.contacts else {}
    off = max(abs(run[name][-1] / own - 1) for name, own in (speeds or {"v": run.rig.drive.velocity}).items())
    after = format_quantity(run.end, "s")
    return f"no slip event; after {after} it slides steadily again to within {max(100 * off, 1e-3):.1g} %"


def letters(rig: Slider | Machine, printed: Iterable[sp.Basic]) -> str:
    """HTML table of the letters in printed equations that are not those of the inputs."""
    model = build_model(rig)
    inputs = {input_letter(model, rig, name) for name, one in rig.parameters().items() if one.value is not None}
    known = legend(model) | MEANINGS
    rows = []
    for letter in letters_in(printed):
        if letter not in inputs:
            unit, words = known.get(letter, ("", ""))
            if unit:
                unit = outside(unit, rig.area)[1]
            rows.append((inline_math(sp.Symbol(letter)), unit, stress_name(words, rig.area)))
    return table(
        rows, ("letter", "unit", "meaning"), left=False, caption="Letters of the equations besides the inputs."
    )


def input_letter(model: Model | None, rig: Slider | Machine, name: str) -> str:
    """Letter of an input: as the equations write it, or would if it were in them, or there were any."""
    if model is None or name not in model.parameters:
        return letter_of(rig, name) or name.rpartition(".")[2]
    return str(model.written(model.parameters[name]))


def references(*rigs: Slider | Machine) -> Iterator[str]:
    """HTML of the laws of rigs with what their descriptions cite, and of the source of the method."""
    yield heading("References")
    both = [law for rig in rigs for own in rig.laws_by_contact().values() for law in (own.friction, own.contact)]
    laws = [one for law in both for one in (law, *records_in(law)) if one.name]
    rows = dict.fromkeys((law.family, law.name, (inspect.getdoc(type(law)) or "").partition("\n")[0]) for law in laws)
    yield table(rows, ("part", "law", "what it is"), caption="Laws that were used.")
    yield from map(paragraph, dict.fromkeys(one for *_, words in rows for one in cited(words)))
    if not any(rig.holds for rig in rigs):
        yield paragraph(f"Method and numbered equations: {METHOD}, eqs 17-32, with corrections.")
