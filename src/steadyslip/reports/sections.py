"""Sections of documents: assumptions, tolerances and notes of inputs, motion, letters, laws."""

from __future__ import annotations

import inspect
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from steadyslip import figures
from steadyslip.core.areas import outside, stress_name
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import QuantityError, SteadyslipError
from steadyslip.core.format import format_quantity
from steadyslip.core.records import records_in
from steadyslip.figures.inline import column_html
from steadyslip.linear.formula import MEANINGS
from steadyslip.machine.letters import letter_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model import Model
from steadyslip.model.build import build_model
from steadyslip.model.legend import legend, letters_in
from steadyslip.model.numeric import has_structure
from steadyslip.motion import History
from steadyslip.motion.sentence import DIGITS
from steadyslip.motion.status import BLOWN_UP
from steadyslip.reports.elements import beside, figure, heading, inline_math, paragraph, table, why, with_subscripts
from steadyslip.reports.literature import METHOD, cited
from steadyslip.verdict import Tolerated
from steadyslip.verdict.analysis import Analysis
from steadyslip.verdict.judder import STEP, grown, motion_after
from steadyslip.verdict.words import PACE, format_parameter_range

CUT_SHORT = "too many steps"
_NEARLY = 0.01  # a motion counts as steady again if it deviates from steady sliding by less than this share
SWINGS_DRAWN = 30  # number of last swings drawn (3 mm each in 100 mm) if there are more than twice as many
_LONGEST_UNIT = 12  # a comment with more characters is not taken as a unit: N m s/rad has 9


def assumptions(rig: Slider | Machine, warnings: Sequence[str], validity: str) -> Iterator[str]:
    """HTML of the assumptions behind a verdict, and its warnings."""
    yield heading("Assumptions")
    inertia = "with inertia" if has_structure(rig) or build_model(rig).inertial else "without inertia (quasistatic)"
    bodies = "structures move as their matrices say, other" if has_structure(rig) else ""
    what = "machine" if rig.in_forces else "rig"
    words = f"The {what} is modelled {inertia}; {bodies} bodies are rigid, and each contact has one normal force."
    yield paragraph(words.replace("  ", " "))
    yield paragraph(validity)
    yield from (paragraph(text, "warning") for text in warnings)


def tolerances_of(found: Tolerated | None) -> dict[str, str]:
    """Text of the tolerance range of each parameter by name; empty for None."""
    return {} if found is None else {
        one.parameter: format_parameter_range(found.rig, one.parameter, one.low, one.high) for one in found.alone
    }  # fmt: skip


def notes_of(text: str) -> dict[str, str]:
    """Comments on the values of a rig file by dotted name; empty text for no comment or only a unit.

    >>> notes_of("[friction]\\na = 0.01  # measured on B819\\nb = 0.02  # 1")
    {'friction.a': 'measured on B819', 'friction.b': ''}
    """
    found, section = dict.fromkeys(_keys(tomllib.loads(text)), ""), ""
    many: Counter[str] = Counter()
    for line in text.splitlines():
        if head := re.match(r"\s*(\[+)([\w.-]+)\]+", line):
            section = head[2]
            if len(head[1]) > 1:  # a list of tables, whose members are counted from 1
                many[section] += 1
                section = f"{section}.{many[section]}"
        elif key := re.match(r"\s*([\w-]+)\s*=\s*(?:\"[^\"]*\"|[^#\"])*(?:#\s*(.*))?$", line):
            note = (key[2] or "").strip()
            found |= {name: "" if _is_unit(note) else note for name in [f"{section}.{key[1]}"] if name in found}
    return found


def _is_unit(note: str) -> bool:
    """True for a comment that is only a unit, such as ``1/m``."""
    try:
        return len(note) <= _LONGEST_UNIT and unit(note) is not None
    except QuantityError:
        return False


def _keys(table: Mapping[str, Any], before: str = "") -> Iterator[str]:
    """Dotted names of the values of a TOML table; items of arrays of tables are numbered from 1."""
    for key, value in table.items():
        many = isinstance(value, list) and all(isinstance(one, dict) for one in value)
        inner = {f"{key}.{n}": one for n, one in enumerate(value, 1)} if many else {key: value}
        for name, one in inner.items():
            yield from _keys(one, f"{before}{name}.") if isinstance(one, dict) else [before + name]


def motion(analysis: Analysis, title: str = "The motion", source: str = "") -> Iterator[str]:
    """HTML of the motion after a small disturbance: text, time history and phase plane.

    `source` is the text of the rig file. If it has a protocol, a note says that the protocol is not used here.
    """
    yield heading(title)
    rig: Any = analysis.rig
    try:
        branch, unstable = getattr(analysis, "branch", 0), analysis.stable is False
        run = None if analysis.stable is None else motion_after(rig, analysis.eigenvalues, branch, repeated=unstable)
    except SteadyslipError as refused:
        yield paragraph(f"It was not simulated: {why(refused)}.{_by_eigenvalues(analysis)}")
        return
    if run is None:
        yield paragraph("There is no steady sliding to disturb, or no rate at which a disturbance changes.")
        return
    pieces: Sequence[Any] = run.protocol.pieces
    begin, end = (format_quantity(piece.at, "s") for piece in pieces[:2])
    kick = f"the drive runs {100 * (STEP - 1):.0f} % faster from {begin} to {end}"
    yield paragraph(
        f"A small disturbance shows what the verdict means: {kick}, and at its own speed again from then on. The "
        f"{'machine' if rig.in_forces else 'rig'} itself is not changed. What follows: {_outcome(run, analysis)}."
    )
    if "protocol" in tomllib.loads(source):
        yield paragraph(
            "The file of the rig has a protocol of its own. Its motion is not shown here, as the verdict is on small "
            "disturbances, of which this one is the same for all rigs."
        )
    over = "Motion after this disturbance, over time."
    shown = _last_swings(run) if unstable else run
    if shown is not run:
        over = f"Motion after this disturbance, over time: the last {SWINGS_DRAWN} swings of many."
    words = f"The same motion in the phase plane{_course(run, analysis.stable)}."
    drawn = (
        (column_html(lambda: figures.history(shown), over), over),
        (
            column_html(lambda: figures.phase_plane(shown), words),
            words,
        ),
    )
    yield beside(figure(*one) for one in drawn)


def _last_swings(run: History) -> History:
    """Motion, cut to its last `SWINGS_DRAWN` swings if it has more than twice that number.

    Swings are slip events or, without any, the times at which a slip rate rises through its median.
    """
    times = [one.begin for one in run.slip_events]
    if not times:
        rates = [run[f"{name}.slip_rate"] for name in run.rig.contacts] or [run["v"]]
        above = [one > np.median(one) for one in rates]
        times = max((run["t"][1:][one[1:] & ~one[:-1]] for one in above), key=len)
    if len(times) <= 2 * SWINGS_DRAWN:
        return run
    begin = times[-SWINGS_DRAWN]
    late = run["t"] >= begin
    return replace(
        run,
        data={name: values[late] for name, values in run.data.items()},
        events=tuple(one for one in run.events if one.time >= begin),
    )


def _course(run: History, stable: bool | None) -> str:
    """Clause for a caption on the course of a motion in the phase plane."""
    if run.status == BLOWN_UP:
        return ", which it leaves to the right"
    if run.status not in ("done", CUT_SHORT):
        return ", as far as it goes"
    if run.sentence and (run.slip_events or not stable):
        return ": what it circles is the cycle, if it settles on one"
    return ": it returns to steady sliding"


def _by_eigenvalues(analysis: Analysis) -> str:
    """Sentence on the motion of a rig with a structure by its eigenvalues; empty for other rigs."""
    leading = next(iter(analysis.eigenvalues), None)
    if not has_structure(analysis.rig) or leading is None or not leading.real:
        return ""
    grows, share = leading.real > 0, STEP - 1
    first = f"a disturbance of the slip rate by {100 * share:.0f} %"
    swings = f"oscillates at {format_quantity(leading.imag / (2 * math.pi), 'Hz')}, " if leading.imag else ""
    changes = PACE["grows" if grows else "decays"].format(time=format_quantity(math.log(2) / abs(leading.real), "s"))
    text = f" By its eigenvalues {first} {swings}{changes}"
    if not grows:
        return f"{text} and dies out."
    after = format_quantity(-math.log(share) / leading.real, "s")
    return (
        f"{text} and after {after} is as large as the slip rate itself: from then on the contact sticks for a part of "
        "each period, which these eigenvalues know nothing of."
    )


def _outcome(run: History, analysis: Analysis) -> str:
    """Clause on a motion: slip events and early end, or else its final deviation from steady sliding.

    The message of an early end is given without its advice: the document has a recommendation.
    """
    if run.sentence and run.status == CUT_SHORT:
        return f"{run.sentence} (simulated for {format_quantity(run.end, 's')})"
    if run.status != "done":
        ended = run.message.partition("; ")[0].replace("_", " ")
        pieces: Sequence[Any] = run.protocol.pieces
        since = format_quantity(run.end - pieces[0].at, "s", DIGITS)
        before = run.sentence if run.slip_events else grown(run)
        return "; then ".join(filter(None, [before, f"{ended} ({since} after the disturbance began)"]))
    if run.sentence and (run.slip_events or not analysis.stable):
        return run.sentence
    steady: Any = getattr(analysis, "steady", None)
    speeds = {f"{name}.slip_rate": one.slip_rate for name, one in steady.contacts.items()} if run.rig.contacts else {}
    off = max(abs(run[name][-1] / own - 1) for name, own in (speeds or {"v": run.rig.drive.velocity}).items())
    after = format_quantity(run.end, "s")
    if off > _NEARLY:
        left = f"no slip event; after {after} it is still {100 * off:.1g} % off steady sliding"
        return f"{left}, and by its eigenvalues that {PACE['decays'].format(time=_half_time(analysis))}"
    return f"no slip event; after {after} it slides steadily again to within {max(100 * off, 1e-3):.1g} %"


def _half_time(analysis: Analysis) -> str:
    """Text of the time in which the slowest small disturbance of a stable rig halves."""
    return format_quantity(math.log(2) / abs(max(one.real for one in analysis.eigenvalues)), "s")


def letters(rig: Slider | Machine, printed: Iterable[sp.Basic]) -> str:
    """HTML table of those letters in printed equations that are not inputs."""
    model = build_model(rig)
    inputs = set(input_letters(model, rig).values())
    known = legend(model) | MEANINGS
    rows = []
    for letter in letters_in(printed):
        if letter not in inputs:
            counted, words = known.get(letter, ("", ""))
            if counted:
                counted = outside(counted, rig.area)[1]
            rows.append((inline_math(sp.Symbol(letter)), counted, stress_name(words, rig.area)))
    return table(
        rows, ("letter", "unit", "meaning"), left=False, caption="Letters of the equations besides the inputs."
    )


def input_letters(model: Model | None, rig: Slider | Machine) -> dict[str, str]:
    """Letters of the inputs by dotted name, as in the equations; also for inputs that enter no equation.

    Letters that several inputs would share have the name of their member as a subscript.
    """
    given = [name for name, one in rig.parameters().items() if one.value is not None]
    bare = {name: letter_of(rig, name) or name.rpartition(".")[2] for name in given}
    in_model = {} if model is None else {name: str(model.written(one)) for name, one in model.parameters.items()}
    many = Counter([*bare.values(), *(in_model[name] for name in given if name in in_model)])

    def letter(name: str) -> str:
        if name in in_model:
            return in_model[name]
        alone = many[bare[name]] == 1 or "." not in name.partition(".")[2]
        return bare[name] if alone else f"{bare[name]}_{subscript_of(name)}"

    return {name: letter(name) for name in given}


def subscript_of(name: str) -> str:
    """Subscript for the letters of a member's parameters: the second part of the dotted name `name`."""
    return name.split(".")[1].replace("-", "_")


def references(*rigs: Slider | Machine, names: Sequence[str] = ()) -> Iterator[str]:
    """HTML of the laws of the rigs (labelled by `names`), the publications that these cite, and the method."""
    yield heading("References")
    rows: dict[tuple[str, str, str], list[str]] = {}
    for rig, name in zip(rigs, names or [""] * len(rigs), strict=True):
        both = [law for own in rig.laws_by_contact().values() for law in (own.friction, own.contact)]
        for one in (part for law in both for part in (law, *records_in(law)) if part.name):
            of = (one.family, one.name, (inspect.getdoc(type(one)) or "").partition("\n")[0])
            whose = rows.setdefault(of, [])
            whose += [] if name in whose else [name]
    columns = ("part", "law", "what it is", "of")[: 4 if names else 3]
    table_rows = [(*of, with_subscripts(words), " and ".join(whose)) for (*of, words), whose in rows.items()]
    yield table(
        (row[: len(columns)] for row in table_rows),
        columns,
        caption="Laws that were used.",
    )
    yield from map(paragraph, dict.fromkeys(one for *_, words in rows for one in cited(words)))
    if not any(rig.holds for rig in rigs):
        yield paragraph(f"Method and numbered equations: {METHOD}, eqs 17-32, with corrections.")
