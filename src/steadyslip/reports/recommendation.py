"""What a document recommends: to keep a rig, or what to change so that it slides stably, and how far."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.format import format_percent
from steadyslip.files.specifications.tolerance_tables import Adjustment
from steadyslip.linear.boundary import Margin
from steadyslip.linear.nearness import doublings
from steadyslip.linear.search import Boundary
from steadyslip.linear.status import stability
from steadyslip.machine.letters import said
from steadyslip.reports.elements import heading, paragraph, table, why
from steadyslip.verdict import Cures, StableWithin, Tolerated, Window, analyze, cure, stable_within
from steadyslip.verdict.analysis import Analysis
from steadyslip.verdict.change_costs import PART, SETTING, TASK, unit_cost
from steadyslip.verdict.cures import default_adjust
from steadyslip.verdict.tolerances import LEAST, format_chance
from steadyslip.verdict.words import change_to, told

BEYOND_EDGE = 0.2  # margin of a recommended value beyond the edge, share of it: uses up 10 % of error on both sides
FAR = 10.0  # factor between a value and its change from which the change is named only: nobody orders such a part
SURE = 0.95  # chance of stable sliding from which a rig is kept as it is: that which `cure` asks for
_ROWS = 4  # changes that are recommended
_STEPS = (1.1, 1.25, 1.5, 2.0)  # factors of a value that are tried to move a stable rig away from its edges (by trial)


@dataclass(frozen=True)
class Order:
    """What a document was asked for.

    Attributes
    ----------
    charts : sequence of (str, str)
        Pairs of parameters over which stability is drawn.
    adjustable : dict of str to Adjustment
        What can be changed, by dotted name; if empty, all that the rig has but friction.
    source : str
        Text of the rig's file.
    unknown : mapping of str to (float, float)
        Intervals of parameters that are not known, SI units.
    """

    charts: Sequence[tuple[str, str]] = ()
    adjustable: Mapping[str, Adjustment] = field(default_factory=dict)
    source: str = ""
    unknown: Mapping[str, tuple[float, float]] = field(default_factory=dict)


ORDER = Order()


def recommendation(
    analysis: Analysis, order: Order = ORDER, tolerated: Tolerated | None = None, title: str = "The recommendation"
) -> Iterator[str]:
    """HTML of what to change, or to keep, with a margin beyond the edge; each value is judged anew.

    With tolerances a rig is kept only where it is stable with a chance of `SURE`; otherwise stands what `cure` finds.
    """
    adjustable = order.adjustable
    yield heading(title)
    anywhere = stable_within(analysis.rig, order.unknown) if order.unknown else None
    if anywhere is not None and not anywhere.everywhere:
        yield from _made_certain(analysis, anywhere, tolerated, order)
        return
    if tolerated is not None and tolerated.share < SURE:
        yield from _made_sure(analysis, tolerated, adjustable)
        if analysis.stable:
            yield paragraph(f"Of the values themselves: {_what_to_hold(analysis, adjustable)}")
        return
    if analysis.stable:
        known = {} if tolerated is None else {one.parameter for one in tolerated.alone}
        near = [one for one in _close_edges(analysis.margins) if one[0].parameter not in known]
        yield from _kept_apart(analysis, near, adjustable) if near else [paragraph("Keep it as it is.")]
        yield paragraph(_what_to_hold(analysis, adjustable))
        return
    able = [one for one in changeable(analysis, adjustable) if not adjustable or one.parameter in adjustable]
    found = {one: row for one in able if (row := _change(analysis, one, adjustable.get(one.parameter)))}
    if not found:
        yield from _cured(analysis, {}, adjustable, "stable", "stable at")
        return
    close = [one for one, row in found.items() if adjustable or not _is_far(one.value, row.edge)]
    first, *_ = close or found
    rows = [found[one].cells for one in close or found][:_ROWS]
    name, now, to, *_ = rows[0]
    alone = " Each row below is enough alone, the others unchanged." if len(rows) > 1 else ""
    because = _because(analysis, {first.parameter: found[first].to})
    yield paragraph(f"Change {name} from {now} to {to}.{because}{alone}")
    share = f"{100 * BEYOND_EDGE:g} %"
    head = ("change", "now", "recommended", "edge", f"stable {share} beyond the edge")
    sequence = "Changes that make it stable: settings first, then parts; the speed, which the task sets, last."
    yield table(rows, head, caption=sequence)
    if close and (far := [row.cells[0] for one, row in found.items() if one not in close]):
        yield _left_out(far)


def _made_certain(
    analysis: Analysis, anywhere: StableWithin, tolerated: Tolerated | None, order: Order
) -> Iterator[str]:  # fmt: skip
    """HTML of what makes a rig stable at all values of what is not known, and that measuring it may be enough."""
    rig: Any = analysis.rig
    for one in anywhere.each:
        values = str(one).partition(": ")[2]
        yield paragraph(
            f"It is not known how large {said(rig, one.parameter)} is: {values}. Wanted is what holds for all."
        )
    reached = "stable" if tolerated is None else f"stable in {format_percent(SURE)} of all that are built"
    tolerances = {} if tolerated is None else tolerated.tolerances
    yield from _cured(
        analysis, tolerances, order.adjustable, f"{reached}, whatever is not known", f"{reached} at", order.unknown
    )
    if analysis.stable or any(one.values for one in anywhere.each):
        yield paragraph("Measuring what is not known may be enough, or make a smaller change do.")


def _made_sure(analysis: Analysis, tolerated: Tolerated, adjustable: Mapping[str, Adjustment]) -> Iterator[str]:
    """HTML of what makes a rig stable with a chance of `SURE`, and of what to measure where that may be enough."""
    wanted = format_percent(SURE)
    yield paragraph(f"{_within(tolerated)} Wanted is that {wanted} of all that is built within them are stable.")
    yield from _cured(
        analysis, tolerated.tolerances, adjustable, f"stable in {wanted} of them", f"stable in {wanted} at"
    )
    telling = [one for one in tolerated.alone if one.share >= LEAST]
    if 0 < tolerated.share < 1 and telling:
        name, part = said(tolerated.rig, telling[0].parameter), format_percent(round(telling[0].share, 2))
        yield paragraph(
            f"Before anything is changed it may be worth measuring {name}: of all tolerances, that of this value "
            f"decides most ({part} of the variance of the verdict)."
        )


def _within(tolerated: Tolerated) -> str:
    """Sentences on how many rigs within the tolerances are stable."""
    rig, count = tolerated.rig, len(tolerated.stable)
    kind = "machine" if rig.in_forces else "rig"
    tried = f"({count} were tried{', and all corners of the ranges' if tolerated.corners else ''})"
    if tolerated.share:
        chance = format_chance(tolerated.share, tolerated.error)
        return f"Of the {kind}s that may be built within the tolerances, {chance} are stable {tried}."
    text = f"No {kind} within the tolerances is stable {tried}"
    if tolerated.otherwise:
        values = (f"{said(rig, name)} {told(rig, name, value)}" for name, value in tolerated.otherwise.items())
        return f"{text}, but for one at their very end: {', '.join(values)}."
    return f"{text}."


def _is_far(value: float, to: float | None) -> bool:
    """True of a change by more than a factor of `FAR`, or of what is zero."""
    return to is None or not value or not to or not 1 / FAR <= abs(to / value) <= FAR


def _cured(
    analysis: Analysis, tolerances: Any, adjustable: Mapping[str, Adjustment], reached: str, at: str,
    unknown: Mapping[str, tuple[float, float]] | None = None,
) -> Iterator[str]:  # fmt: skip
    """HTML of what `cure` finds: the cheapest change, the cheapest pair, and the windows of each parameter.

    What has the nearest edge is among the parameters, as the headline speaks of it.
    """
    rig: Any = analysis.rig
    present = {name: one for name, one in default_adjust(rig).items() if rig.parameters()[name].value}
    named = next((one for one in analysis.margins if _curing(one)), None)
    if named is not None and named.value and "friction." not in named.parameter:
        present.setdefault(named.parameter, Adjustment())
    try:
        found = cure(rig, tolerances, sure=SURE, adjust=adjustable or present, unknown=unknown)
    except (NotAvailable, ParameterError) as refused:
        yield paragraph(f"No single change within range makes it stable, and several were not tried: {why(refused)}.")
        return
    of = {one.parameter: one for one in found.windows}
    pair = " and ".join(_moved(rig, of[name], value) for name, value in found.pair.items())
    if found.best is not None:
        one = found.best
        text = f"Change {_moved(rig, one, one.nearest)}: with this change alone it is {reached}."
        text += f" Two smaller changes do it as well: {pair}." if pair else ""
    elif pair:
        text = f"No single change is enough. Change {pair}: with both it is {reached}."
    else:
        text = f"None of the values below makes it {reached}, nor do two of them together: something else must change."
    yield paragraph(text)
    if not tolerances and (pair or found.best):
        yield paragraph("These values are edges: go beyond them as far as you can.")
    if named is not None and named.parameter not in (adjustable or present):
        which = "one of friction, " if "friction." in named.parameter else ""
        yield paragraph(f"The nearest edge is {which}that of {said(rig, named.parameter)}, which is not changed here.")
    yield from _windows(found, at, bool(adjustable))


def _left_out(far: Sequence[str]) -> str:
    """HTML on changes by more than a factor of `FAR`, which are named only."""
    they = "they" if len(far) > 1 else "it"
    text = f"Left out, as {they} would have to change by more than a factor of {FAR:g}: {', '.join(far)}."
    return paragraph(text, "small")


def _moved(rig: Any, window: Window, to: float | None) -> str:
    return f"{said(rig, window.parameter)} from {window.written(window.value)} to {window.written(to or 0.0)}"


def _windows(found: Cures, at: str, whole: bool) -> Iterator[str]:
    """HTML table of the values of each parameter at which the chance is reached, and a line of those without any.

    Changes by more than a factor of `FAR` are named only, unless `whole`.
    """
    rig: Any = found.rig
    every = sorted((one for one in found.windows if one.windows), key=lambda one: one.cost)
    able = [one for one in every if whole or one.nearest is None or not _is_far(one.value, one.nearest)] or every
    rows = [(said(rig, one.parameter), one.written(one.value), str(one), f"{one.cost:.2g}") for one in able]
    words = "Values that are enough, each alone, the others unchanged, the cheapest first. "
    cost = (
        f"Doubling or halving a setting of the drive costs {SETTING:g}, a part {PART:g}, the speed, which is the task, "
        f"{TASK:g}, unless the rig file gives another cost."
    )
    yield table(rows, ("change", "now", at, "cost"), caption=words + cost)
    if far := [said(rig, one.parameter) for one in every if one not in able]:
        yield _left_out(far)
    if without := [said(rig, one.parameter) for one in found.windows if not one.windows]:
        yield paragraph(f"Not enough alone, whatever the value within range: {', '.join(without)}.", "small")


def changeable(analysis: Analysis, adjustable: Collection[str] = ()) -> list[Margin]:
    """Margins that a document speaks of: of what would make the rig stable, or keep it so.

    Those that keep it so are nearest first; of the others those within a factor of `FAR` are first, and among them
    what costs least by `steadyslip.verdict.change_costs`. They are of what is named in `adjustable`;
    else of all that the rig has but friction, and of that if there is nothing else.
    """
    edged = [one for one in analysis.margins if (one.edge if analysis.stable else _curing(one))]
    chosen = [one for one in edged if one.parameter in adjustable]
    present = [one for one in edged if one.value]  # from zero it is no change, but a part to be added
    found = chosen or [one for one in present if "friction." not in one.parameter] or present
    return found if analysis.stable or chosen else sorted(found, key=_in_order)


def _in_order(margin: Margin) -> tuple[bool, float, bool]:
    """Sort key of a change: far ones last; then by what it costs; then those beside which no edge is nearer."""
    begins = _curing(margin)[0]
    return _is_far(margin.value, begins.value), unit_cost(margin.parameter), begins is not margin.edge


def _what_to_hold(analysis: Analysis, adjustable: Collection[str]) -> str:
    """Sentences on the nearest edge of all, and on that of what can be set, if it is another."""
    edged = [one for one in analysis.margins if one.edge is not None]
    if not edged:
        return "No parameter has an edge within range."
    can_be_set = set(adjustable) or {one.parameter for one in edged if "friction." not in one.parameter}
    settable = [one for one in edged if one.parameter in can_be_set]
    nearest, chosen = edged[0], next(iter(settable), None)
    if nearest is chosen:
        return f"The nearest edge is that of {_side(analysis, nearest)}."
    of = "one of friction," if "friction." in nearest.parameter else "that of"
    text = f"The nearest edge is {of} {_side(analysis, nearest)}."
    if chosen is None:
        return f"{text} Nothing that can be set has one within range."
    return f"{text} Of what can be set, the nearest is that of {_side(analysis, chosen)}."


def _distance(margin: Margin, edge: Boundary) -> float:
    """Distance of an edge from the value, as a share of the value; infinite where a share says nothing."""
    return math.inf if margin.unit == "rad" or not margin.value else abs(edge.value / margin.value - 1)


def _close_edges(margins: Sequence[Margin]) -> list[tuple[Margin, Boundary]]:
    """Edges of a stable rig that are nearer than is recommended, nearest first."""
    every = [(one, edge) for one in margins for edge in one.about if _distance(one, edge) < BEYOND_EDGE]
    return sorted(every, key=lambda found: _distance(*found))


def _kept_apart(
    analysis: Analysis, near: Sequence[tuple[Margin, Boundary]], adjustable: Collection[str]
) -> Iterator[str]:
    """HTML of the edges of a stable rig that are too near, and of changes that move it away from them."""
    rig, wanted = analysis.rig, format_percent(BEYOND_EDGE)
    listed = ", ".join(
        f"{said(rig, one.parameter)} at {_value(analysis, one, edge.value)} ({change_to(one, edge)})"
        for one, edge in near
    )
    whose = "their values are the edges" if len(near) > 1 else "its value is the edge"
    yield paragraph(
        f"It is stable, with less distance from the edge than the {wanted} that are recommended. Within {wanted} of "
        f"{whose} of {listed}. Know what has an edge so near more closely than that, or make a change."
    )
    found = sorted(
        filter(None, (_moved_away(analysis, one) for one in _movable(analysis, adjustable))), key=_best_first
    )
    if not found:
        yield paragraph(f"No single change that was tried puts all edges {wanted} away.")
        return
    name, first, to, after, _ = found[0].cells
    yield paragraph(
        f"Change {name} from {first} to {to}: it stays stable, and the nearest edge is then that of {after}."
    )
    head = ("change", "now", "recommended", "nearest edge then", f"all edges {wanted} away")
    yield table((one.cells for one in found), head, caption="Changes that move it away from its edges, each alone.")


def _movable(analysis: Analysis, adjustable: Collection[str]) -> list[Margin]:
    """What can be changed of a stable rig to move it away from its edges: the nearest ones, the speed last."""
    able = [one for one in changeable(analysis, adjustable) if one.value and one.unit != "rad" and not one.remote]
    return sorted(able[:_ROWS], key=lambda one: unit_cost(one.parameter))


class _MovedAway(NamedTuple):
    """Row of a table: name, value, recommended value, nearest edge then, whether all are far; that edge's distance."""

    cells: tuple[str, str, str, str, str]
    distance: float


def _best_first(found: _MovedAway) -> float:
    """Sort key: those at which all edges are far, in their order; of the others the farthest first."""
    return -min(found.distance, BEYOND_EDGE)


def _moved_away(analysis: Analysis, margin: Margin) -> _MovedAway | None:
    """Change of a parameter away from its edge by the steps of `_STEPS`, to the first at which all edges are far.

    Else the one at which the nearest edge is farthest; None if none is farther than now.
    """
    rig: Any = analysis.rig
    rises = margin.edge is None or margin.edge.value < margin.value
    sign = 1 if rises == (margin.value > 0) else -1
    best: _MovedAway | None = None
    now = min((_distance(one, edge) for one in analysis.margins for edge in one.about), default=math.inf)
    for step in _STEPS:
        to = margin.value * step**sign
        with suppress(ParameterError, NotAvailable):
            changed = analyze(rig.with_values({margin.parameter: to}), branch=analysis.branch)
            edges = [(one, edge) for one in changed.margins for edge in one.about]
            if not changed.stable or not edges:
                continue
            one, edge = min(edges, key=lambda found: _distance(*found))
            away = _distance(one, edge)
            if away <= (now if best is None else best.distance):
                continue
            after = f"{said(rig, one.parameter)}, {format_percent(away)} away"
            first, then = (_value(analysis, margin, value) for value in (margin.value, to))
            far = "yes" if away >= BEYOND_EDGE else "no"
            best = _MovedAway((said(rig, margin.parameter), first, then, after, far), away)
            if away >= BEYOND_EDGE:
                break
    return best


def _side(analysis: Analysis, margin: Margin) -> str:
    """Parameter, its own value, and the side of its edge on which sliding stays stable."""
    edge = margin.edge.value if margin.edge else math.nan
    side = "below" if edge > margin.value else "above"
    now, end = (_value(analysis, margin, value) for value in (margin.value, edge))
    return f"{said(analysis.rig, margin.parameter)}, now {now}: keep it {side} {end}"


def _curing(margin: Margin) -> list[Boundary]:
    """Edges at which windows of stable values begin as seen from the rig's own value, the nearest window first."""
    begins = [
        edge
        for edge in margin.edges
        if edge.value
        and not margin.is_remote(edge)
        and edge.stable == ("above" if edge.value > margin.value else "below")
    ]
    return sorted(begins, key=lambda edge: float(doublings(margin.value, edge.value, margin.unit)))


class _Change(NamedTuple):
    """Row of a table: name, value, recommended value, edge, that it is stable there; edge and new value in SI units."""

    cells: tuple[str, str, str, str, str]
    edge: float
    to: float


def _change(analysis: Analysis, margin: Margin, within: Adjustment | None) -> _Change | None:
    """Change into the nearest window of stable values that is wide enough and allowed; None if there is none."""
    rig: Any = analysis.rig
    low, high = (None, None) if within is None else (within.low, within.high)
    for edge in (one.value for one in _curing(margin)):
        away = BEYOND_EDGE * abs(edge - margin.value if margin.unit == "rad" else edge)
        rises = edge > margin.value
        to = edge + away if rises else edge - away
        nearer = low if rises else high  # the end of what is allowed that may ask for more than the margin
        if nearer is not None:
            to = max(to, nearer) if rises else min(to, nearer)
        if (low is not None and to < low) or (high is not None and to > high):
            continue
        with suppress(ParameterError, NotAvailable):
            if stability(rig.with_values({margin.parameter: to})) == "stable":
                now, then, end = (_value(analysis, margin, value) for value in (margin.value, to, edge))
                word = "above" if rises else "below"
                return _Change((said(rig, margin.parameter), now, then, f"{word} {end}", "yes"), edge, to)
    return None


def _because(analysis: Analysis, change: Mapping[str, float]) -> str:
    """Sentence on why a change helps: what feeds the motion of a machine, or the reason for the verdict with it."""
    because = "" if analysis.origin is None else f" Why it is unstable: {analysis.origin.words}."
    rig: Any = analysis.rig
    return f" Then {analyze(rig.with_values(change), branch=analysis.branch).reason}.{because}"


def _value(analysis: Analysis, margin: Margin, value: float) -> str:
    return told(analysis.rig, margin.parameter, value, margin.value)
