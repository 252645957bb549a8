"""Recommendation of a document: keep a rig as it is, or change a parameter, and how far, so that it slides stably."""

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
from steadyslip.machine.letters import label_of
from steadyslip.reports.elements import heading, paragraph, table, why
from steadyslip.verdict import Cures, StableWithin, Tolerated, Window, analyze, cure, stable_within
from steadyslip.verdict.analysis import Analysis
from steadyslip.verdict.change_costs import PART, SETTING, TASK, unit_cost
from steadyslip.verdict.cures import default_adjust
from steadyslip.verdict.tolerances import LEAST, format_chance
from steadyslip.verdict.words import change_to, format_parameter

BEYOND_EDGE = 0.2  # recommended distance of a value from an edge, as share of the value: for errors of 10 % in both
_ROUNDED = 1.01  # factor on `BEYOND_EDGE`: values rounded to four digits still keep that distance
FAR = 10.0  # for a change by a larger factor no value is given, as nobody orders such a part
SURE = 0.95  # a rig is kept as it is if its chance of stable sliding is at least this; default of `cure`
_ROWS = 4  # largest number of changes that are recommended
_STEPS = (1.1, 1.25, 1.5, 2.0)  # factors on values that are tried to move a stable rig away from its edges (by trial)
_FARTHER = (1.5, 2.0, 3.0, 4.0)  # factors on an edge, tried if another edge is close to the first value (by trial)


@dataclass(frozen=True)
class Order:
    """Options for the document of a rig.

    Attributes
    ----------
    charts : sequence of (str, str)
        Pairs of parameters over which stability is drawn.
    adjustable : dict of str to Adjustment
        Parameters that can be changed, by dotted name; if empty, all except those of friction.
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
    """HTML of the recommended change, with a margin beyond the edge, or to keep the rig; each change is analysed anew.

    With tolerances, a rig is kept only if it is stable with a chance of `SURE`; otherwise the changes by `cure` are
    given.
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
    found = {one: begun for one in able if (begun := _begun(analysis, one, adjustable.get(one.parameter)))}
    close = [one for one, begun in found.items() if adjustable or not _is_far(one.value, begun.edge)]
    rows = [row for one in (close or list(found))[:_ROWS] if (row := _made_by(analysis, one, found[one].values))]
    if not rows:
        yield from _cured(analysis, {}, adjustable, "stable", "stable at")
        return
    rows.sort(key=_best_first)
    yield from _made_stable(analysis, rows, {one.parameter: begun for one, begun in found.items()})
    if close and (far := [label_of(analysis.rig, one.parameter) for one in found if one not in close]):
        yield _left_out(far)


def _made_stable(analysis: Analysis, rows: Sequence[_Moved], begun: Mapping[str, _Begun]) -> Iterator[str]:
    """HTML of the changes that make a rig stable: the first as a sentence, all in a table."""
    first, wanted = rows[0], format_percent(BEYOND_EDGE)
    origin = "" if analysis.origin is None else f" Why it is unstable: {analysis.origin.words}."
    origin += _friction_is_not_all(analysis)
    angles = any(one.unit == "rad" and one.edge for one in first.then.margins)
    near = f" No edge is then nearer than {wanted}{', those of angles left aside' if angles else ''}."
    if first.distance < BEYOND_EDGE:
        near = f" One edge is even then nearer than the {wanted} that are recommended: that of {first.nearest}."
    alone = " Each row below is enough alone, the others unchanged." if len(rows) > 1 else ""
    name, now, to = first.cells
    yield paragraph(f"Change {name} from {now} to {to}. Then {first.then.reason}.{near}{origin}{alone}")
    head = ("change", "now", "recommended", "its edge", "nearest edge then", f"all edges {wanted} away")
    caption = (
        f"Changes that make it stable, each alone: those that put all edges {wanted} away first, of these settings "
        "before parts; the speed, which the task sets, last."
    )
    cells = ((*one.cells, begun[one.parameter].words, one.nearest or "none within range", one.far) for one in rows)
    yield table(cells, head, caption=caption)


def _friction_is_not_all(analysis: Analysis) -> str:
    """Sentence for a machine driven unstable through the normal force, if less friction does not make it stable."""
    origin, levels = analysis.origin, set(analysis.rig.of_kind("friction level"))
    if origin is None or origin.kind not in ("coupling", "normal force"):
        return ""
    own = [one for one in analysis.margins if one.parameter in levels and f".{origin.name}." in one.parameter]
    if not own or any(edge.stable == "below" for one in own for edge in one.edges):
        return ""
    why_not = "" if any(one.edges for one in own) else ": it has no edge within range"
    return f" Less friction at {origin.name} alone does not make it stable{why_not}."


def _made_certain(
    analysis: Analysis, anywhere: StableWithin, tolerated: Tolerated | None, order: Order
) -> Iterator[str]:  # fmt: skip
    """HTML of the changes that make a rig stable at all values of its unknown parameters; measuring may do instead."""
    rig: Any = analysis.rig
    for one in anywhere.each:
        values = str(one).partition(": ")[2]
        yield paragraph(
            f"It is not known how large {label_of(rig, one.parameter)} is: {values}. Wanted is what holds for all."
        )
    reached = "stable" if tolerated is None else f"stable in {format_percent(SURE)} of all that are built"
    tolerances = {} if tolerated is None else tolerated.tolerances
    yield from _cured(
        analysis, tolerances, order.adjustable, f"{reached}, whatever is not known", f"{reached} at", order.unknown
    )
    if analysis.stable or any(one.values for one in anywhere.each):
        yield paragraph("Measuring what is not known may be enough, or make a smaller change do.")


def _made_sure(analysis: Analysis, tolerated: Tolerated, adjustable: Mapping[str, Adjustment]) -> Iterator[str]:
    """HTML of the changes that make a rig stable with a chance of `SURE`, and of the parameter best measured first."""
    wanted = format_percent(SURE)
    yield paragraph(f"{_within(tolerated)} Wanted is that {wanted} of all that is built within them are stable.")
    yield from _cured(
        analysis, tolerated.tolerances, adjustable, f"stable in {wanted} of them", f"stable in {wanted} at"
    )
    telling = [one for one in tolerated.alone if one.share >= LEAST]
    if 0 < tolerated.share < 1 and telling:
        name, part = label_of(tolerated.rig, telling[0].parameter), format_percent(round(telling[0].share, 2))
        yield paragraph(
            f"Before anything is changed it may be worth measuring {name}: of all tolerances, that of this value "
            f"decides most ({part} of the variance of the verdict)."
        )


def _within(tolerated: Tolerated) -> str:
    """Sentence on the share of rigs within the tolerances that are stable."""
    rig, count = tolerated.rig, len(tolerated.stable)
    kind = "machine" if rig.in_forces else "rig"
    tried = f"({count} were tried{', and all corners of the ranges' if tolerated.corners else ''})"
    if tolerated.share:
        chance = format_chance(tolerated.share, tolerated.error)
        return f"Of the {kind}s that may be built within the tolerances, {chance} are stable {tried}."
    text = f"No {kind} within the tolerances is stable {tried}"
    if tolerated.otherwise:
        values = (
            f"{label_of(rig, name)} {format_parameter(rig, name, value)}" for name, value in tolerated.otherwise.items()
        )
        return f"{text}, except one at the very end of the ranges: {', '.join(values)}."
    return f"{text}."


def _is_far(value: float, to: float | None) -> bool:
    """True if a change from `value` to `to` is by more than a factor of `FAR`, or if one of them is zero or None."""
    return to is None or not value or not to or not 1 / FAR <= abs(to / value) <= FAR


def _cured(
    analysis: Analysis, tolerances: Any, adjustable: Mapping[str, Adjustment], reached: str, at: str,
    unknown: Mapping[str, tuple[float, float]] | None = None,
) -> Iterator[str]:  # fmt: skip
    """HTML of the results of `cure`: the cheapest change, the cheapest pair, and the windows of each parameter.

    The parameter with the nearest edge is among those changed, since the headline names it.
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
        yield paragraph(
            f"The nearest edge is {which}that of {label_of(rig, named.parameter)}, which is not changed here."
        )
    yield from _windows(found, at, bool(adjustable))


def _left_out(far: Sequence[str]) -> str:
    """HTML line that names the parameters whose changes are left out as larger than a factor of `FAR`."""
    they = "they" if len(far) > 1 else "it"
    text = f"Left out, as {they} would have to change by more than a factor of {FAR:g}: {', '.join(far)}."
    return paragraph(text, "small")


def _moved(rig: Any, window: Window, to: float | None) -> str:
    return f"{label_of(rig, window.parameter)} from {window.written(window.value)} to {window.written(to or 0.0)}"


def _windows(found: Cures, at: str, whole: bool) -> Iterator[str]:
    """HTML table of the windows of each parameter, and a line that names parameters without a window.

    Changes by more than a factor of `FAR` are only named, unless `whole` is True.
    """
    rig: Any = found.rig
    every = sorted((one for one in found.windows if one.windows), key=lambda one: one.cost)
    able = [one for one in every if whole or one.nearest is None or not _is_far(one.value, one.nearest)] or every
    rows = [(label_of(rig, one.parameter), one.written(one.value), str(one), f"{one.cost:.2g}") for one in able]
    words = "Values that are enough, each alone, the others unchanged, the cheapest first. "
    cost = (
        f"Doubling or halving a setting of the drive costs {SETTING:g}, a part {PART:g}, the speed, which is the task, "
        f"{TASK:g}, unless the rig file gives another cost."
    )
    yield table(rows, ("change", "now", at, "cost"), caption=words + cost)
    if far := [label_of(rig, one.parameter) for one in every if one not in able]:
        yield _left_out(far)
    if without := [label_of(rig, one.parameter) for one in found.windows if not one.windows]:
        yield paragraph(f"Not enough alone, whatever the value within range: {', '.join(without)}.", "small")


def changeable(analysis: Analysis, adjustable: Collection[str] = ()) -> list[Margin]:
    """Margins of the parameters whose change is discussed in a document.

    If the rig is stable, these are parameters with an edge, nearest first; if not, parameters that could make it so:
    first those within a factor of `FAR`, then by cost (`steadyslip.verdict.change_costs`). Only parameters named in
    `adjustable` are taken; without any, all except those of friction, or else those of friction too.
    """
    edged = [one for one in analysis.margins if (one.edge if analysis.stable else _curing(one))]
    chosen = [one for one in edged if one.parameter in adjustable]
    present = [one for one in edged if one.value]  # a value of zero cannot be changed: the part would have to be added
    found = chosen or [one for one in present if "friction." not in one.parameter] or present
    return found if analysis.stable or chosen else sorted(found, key=_in_order)


def _in_order(margin: Margin) -> tuple[bool, float, bool]:
    """Sort key of a change: near before far, then by cost, then changes whose stable window begins at `margin.edge`."""
    begins = _curing(margin)[0]
    return _is_far(margin.value, begins.value), unit_cost(margin.parameter), begins is not margin.edge


def _what_to_hold(analysis: Analysis, adjustable: Collection[str]) -> str:
    """Sentences on the nearest edge of all parameters and, if different, on the nearest of a changeable parameter."""
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
    """Distance of an edge from the value, as a share of the value; infinite for angles and values of zero."""
    return math.inf if margin.unit == "rad" or not margin.value else abs(edge.value / margin.value - 1)


def _close_edges(margins: Sequence[Margin]) -> list[tuple[Margin, Boundary]]:
    """Edges of a stable rig that are nearer than `BEYOND_EDGE`, nearest first, each with its margin."""
    every = [(one, edge) for one in margins for edge in one.about if _distance(one, edge) < BEYOND_EDGE]
    return sorted(every, key=lambda found: _distance(*found))


def _kept_apart(
    analysis: Analysis, near: Sequence[tuple[Margin, Boundary]], adjustable: Collection[str]
) -> Iterator[str]:
    """HTML of the edges `near` to a stable rig, and of changes that move the rig away from them."""
    rig, wanted = analysis.rig, format_percent(BEYOND_EDGE)
    listed = ", ".join(
        f"{label_of(rig, one.parameter)} at {_value(analysis, one, edge.value)} ({change_to(one, edge)})"
        for one, edge in near
    )
    whose = "their values are the edges" if len(near) > 1 else "its value is the edge"
    yield paragraph(
        f"It is stable, with less distance from the edge than the {wanted} that are recommended. Within {wanted} of "
        f"{whose} of {listed}. Make sure of these values to better than that, or make a change."
    )
    found = sorted(
        filter(None, (_moved_away(analysis, one) for one in _movable(analysis, adjustable))), key=_best_first
    )
    if not found:
        yield paragraph(f"No single change that was tried puts all edges {wanted} away.")
        return
    name, first, to = found[0].cells
    yield paragraph(
        f"Change {name} from {first} to {to}: it stays stable, and the nearest edge is then that of {found[0].nearest}."
    )
    head = ("change", "now", "recommended", "nearest edge then", f"all edges {wanted} away")
    rows = ((*one.cells, one.nearest, one.far) for one in found)
    yield table(rows, head, caption="Changes that move it away from its edges, each alone.")


def _movable(analysis: Analysis, adjustable: Collection[str]) -> list[Margin]:
    """Margins of the parameters to change to move a stable rig away from its edges: nearest edge first, speed last."""
    able = [one for one in changeable(analysis, adjustable) if one.value and one.unit != "rad" and not one.remote]
    return sorted(able[:_ROWS], key=lambda one: unit_cost(one.parameter))


class _Moved(NamedTuple):
    """Result of changing one parameter: its name; texts of name, old and new value; analysis after the change; text on
    the edge then nearest, and its distance as a share of the value.
    """

    parameter: str
    cells: tuple[str, str, str]
    then: Analysis
    nearest: str
    distance: float

    @property
    def far(self) -> str:
        """Text ``yes`` if all edges are at least `BEYOND_EDGE` away, else ``no``."""
        return "yes" if self.distance >= BEYOND_EDGE else "no"


def _best_first(found: _Moved) -> tuple[bool, float]:
    """Sort key of changes: farthest from the nearest edge first, up to `BEYOND_EDGE`; changes of the speed last."""
    return unit_cost(found.parameter) == TASK, -min(found.distance, BEYOND_EDGE)


def _moved_away(analysis: Analysis, margin: Margin) -> _Moved | None:
    """Best change of a parameter away from its edge by factors in `_STEPS`; None if none increases the distance from
    the nearest edge.
    """
    rises = margin.edge is None or margin.edge.value < margin.value
    sign = 1 if rises == (margin.value > 0) else -1
    now = min((_distance(one, edge) for one in analysis.margins for edge in one.about), default=math.inf)
    found = [one for one in _tried(analysis, margin, [margin.value * step**sign for step in _STEPS]) if one.nearest]
    best = max(found, key=lambda one: one.distance, default=None)
    return best if best is not None and best.distance > now else None


def _tried(analysis: Analysis, margin: Margin, values: Sequence[float]) -> list[_Moved]:
    """Results for those `values` of a parameter at which sliding is stable, up to the first whose edges are all far."""
    rig: Any = analysis.rig
    found = []
    for to in values:
        with suppress(ParameterError, NotAvailable):
            changed = analyze(rig.with_values({margin.parameter: to}), branch=analysis.branch)
            if not changed.stable:
                continue
            edges = [(_distance(one, edge), one) for one in changed.margins for edge in one.about]
            away, of = min(edges, key=lambda found: found[0], default=(math.inf, None))
            near = "" if of is None else label_of(rig, of.parameter)
            near += f", {format_percent(away)} away" if math.isfinite(away) else ""
            first, then = (_value(analysis, margin, value) for value in (margin.value, to))
            found.append(_Moved(margin.parameter, (label_of(rig, margin.parameter), first, then), changed, near, away))
            if away >= BEYOND_EDGE:
                break
    return found


def _made_by(analysis: Analysis, margin: Margin, values: Sequence[float]) -> _Moved | None:
    """Result for the first of `values` whose edges are all far, else for the first stable value; None without one."""

    found = _tried(analysis, margin, values)
    return next((one for one in found if one.distance >= BEYOND_EDGE), found[0] if found else None)


def _side(analysis: Analysis, margin: Margin) -> str:
    """Text with a parameter, its value, and the side of its edge on which to keep it."""
    edge = margin.edge.value if margin.edge else math.nan
    side = "below" if edge > margin.value else "above"
    now, end = (_value(analysis, margin, value) for value in (margin.value, edge))
    return f"{label_of(analysis.rig, margin.parameter)}, now {now}: keep it {side} {end}"


def _curing(margin: Margin) -> list[Boundary]:
    """Edges beyond which, seen from the rig's own value, sliding becomes stable; nearest first, without remote ones."""
    begins = [
        edge
        for edge in margin.edges
        if edge.value
        and not margin.is_remote(edge)
        and edge.stable == ("above" if edge.value > margin.value else "below")
    ]
    return sorted(begins, key=lambda edge: float(doublings(margin.value, edge.value, margin.unit)))


class _Begun(NamedTuple):
    """Window of stable values: its edge (SI units), text on the edge, and values to try inside, in order."""

    edge: float
    words: str
    values: list[float]


def _begun(analysis: Analysis, margin: Margin, within: Adjustment | None) -> _Begun | None:
    """Nearest window of stable values that is allowed and wide enough for `BEYOND_EDGE`; None if there is none."""
    rig: Any = analysis.rig
    for edge in (one.value for one in _curing(margin)):
        rises = edge > margin.value
        sign = 1 if rises == (edge > 0) else -1
        if margin.unit == "rad":
            values = [edge + BEYOND_EDGE * (edge - margin.value)]
        else:  # the first of the values has the recommended distance from the edge
            values = [edge / (1 - sign * _ROUNDED * BEYOND_EDGE), *(edge * step**sign for step in _FARTHER)]
        values = _allowed(values, edge, rises, within)
        if not values:
            continue
        to = values[0]
        with suppress(ParameterError, NotAvailable):
            if stability(rig.with_values({margin.parameter: to})) == "stable":
                end = _value(analysis, margin, edge)
                return _Begun(edge, f"{'above' if rises else 'below'} {end}", values)
    return None


def _allowed(values: Sequence[float], edge: float, rises: bool, within: Adjustment | None) -> list[float]:
    """Values beyond an edge, limited to the allowed range; empty if the allowed range ends before the edge."""
    if within is None:
        return list(values)
    low = -math.inf if within.low is None else within.low
    high = math.inf if within.high is None else within.high
    cut = dict.fromkeys(min(max(one, low), high) for one in values)
    return [one for one in cut if one != edge and (one > edge) == rises]


def _value(analysis: Analysis, margin: Margin, value: float) -> str:
    return format_parameter(analysis.rig, margin.parameter, value, margin.value)
