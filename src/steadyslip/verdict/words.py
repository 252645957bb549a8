"""Text of verdicts: headline, clauses on disturbances, onset and kicks, table of nearest edges."""

from __future__ import annotations

import math
import textwrap
from itertools import pairwise
from typing import TYPE_CHECKING

from steadyslip.core.checks import UNDECIDED
from steadyslip.core.format import digits_apart, format_as_written, format_growth, format_quantity, format_range
from steadyslip.core.written import displayed_as
from steadyslip.linear.boundary import REMOTE
from steadyslip.machine.letters import label_of
from steadyslip.verdict.reasons import NEXT_TO_IT
from steadyslip.verdict.support import gain_words

if TYPE_CHECKING:
    from steadyslip.linear.boundary import Margin
    from steadyslip.linear.search import Boundary
    from steadyslip.machine.rig import Rig
    from steadyslip.nonlinear.kicks.threshold import Threshold
    from steadyslip.nonlinear.onset.hopf import Onset
    from steadyslip.verdict.findings import Findings

_ONSETS = {
    "supercritical": "just beyond the edge in stiffness, oscillation begins small and grows with distance",
    "subcritical": "on the stable side of the edge in stiffness an unstable oscillation surrounds steady sliding, the "
    "smaller the nearer the edge; larger kicks do not die out",
    "degenerate": "at the edge in stiffness, small oscillations neither grow nor decay to lowest order",
    "not decided": "at the edge in stiffness, what tells whether oscillation begins small is lost in rounding",
}

BEYOND = {
    "oscillatory": "an oscillation grows",
    "coupling": "two oscillations couple and one grows",
    "divergence": "a disturbance grows without oscillating",
    "ill-posed": "the equations become ill-posed",
    "lock-up": "it locks up",
    "lift-off": "it lifts off",
    "no solution": "steady sliding ceases to exist",
}


EDGE_WORDS = {
    "stable": "becomes stable",
    "quiet": "no disturbance grows",
    "unstable": "slides steadily, but unstable",
    "here": "on the edge",
    "beside": "on the edge, stable {side} it",
    "far": "further off than a factor of {remote}",
}
"""Phrases of the table of nearest edges, besides those in `BEYOND`; browser pages use both."""

PACE = {"grows": "doubles in {time}", "decays": "halves in {time}", "stays": "neither grows nor dies"}
"""Phrases on how fast a disturbance changes; browser pages and reports use the same."""

EIGENVALUE_COLUMNS = ("rate", "period", "size")
NO_PERIOD = "none"
"""Column heads of a table of eigenvalues, and text for the period of a real one; pages and reports use the same."""


def eigenvalue_row(s: complex) -> tuple[str, str, str]:
    """Row of a table of eigenvalues (1/s) with the columns of `EIGENVALUE_COLUMNS`."""
    kind = "grows" if s.real > 0 else "decays" if s.real < 0 else "stays"
    time = format_quantity(math.log(2) / abs(s.real), "s") if s.real else ""
    period = format_quantity(2 * math.pi / abs(s.imag), "s") if s.imag else NO_PERIOD
    return format_growth(s.real), period, PACE[kind].format(time=time)


STABLE_MEANS = "Stable means: small disturbances die out. A large enough kick may still start {what}."
"""Limits of the verdict "stable"; {what} is what a large kick may start. Browser pages use the same sentence."""


def beyond(edge: Boundary) -> str:
    """Clause on what happens beyond an edge, such as ``it locks up``; for a machine with the contact's name."""
    words = BEYOND.get(edge.kind, edge.kind)
    return f"{edge.contact} {words.removeprefix('it ')}" if edge.contact and words.startswith("it ") else words


JUDDERS = "steadyslip simulate shows what it does instead: how often it slips, how far, and with what force."
"""Line on an unstable rig for which no motion in words was found; see `Findings.judders`."""


def instead(analysis: Findings) -> str:
    """Line on the motion of an unstable rig, or on how to simulate it."""
    return f"{analysis.judders} (simulated, after a small disturbance)" if analysis.judders else JUDDERS


HEADLINES = {
    "stable": ("Stable", ": steady sliding {speed}"),
    "unstable": ("Unstable", ": steady sliding {speed}"),
    "undamped": ("Undamped", ": no disturbance of steady sliding {speed} grows, and none dies out"),
    "edge": ("On the edge", " of stability to within rounding: steady sliding {speed}"),
    "none": ("No steady sliding", " {speed}"),
    "undecided": ("Not decided", ": steady sliding {speed}"),
}
"""First line of a verdict by kind: the part in capitals, and the rest; browser pages use the same words."""


def headline(analysis: Findings, capitals: bool = True) -> str:
    """First line of a verdict: stable, unstable, on the edge, not decided, or no steady sliding; with the speed."""
    speed = format_parameter(analysis.rig, "drive.velocity", float(analysis.rig.drive.velocity))
    if analysis.stable is None:
        kind = "undecided" if is_undecided(analysis) else "none"
    else:
        kind = "edge" if analysis.on_edge else "stable" if analysis.stable else "unstable"
        kind = "undamped" if analysis.on_edge and analysis.undamped else kind
    first, rest = HEADLINES[kind]
    return (first.upper() if capitals else first) + rest.format(speed=f"at {speed}")


def format_parameter(rig: Rig, name: str, value: float, beside: float | None = None) -> str:
    """Format a value of a parameter in the unit of the rig's file, with enough digits to differ from `beside`."""
    digits = 4 if beside is None else digits_apart(value, beside)
    number, unit = rig.display_value(name, value)
    own, _ = rig.display_value(name, rig.parameters()[name].value or 0.0)
    with displayed_as(rig.written_as(name)):
        return format_as_written(number, own, unit, digits, area=rig.printed_area(name))


def format_parameter_range(rig: Rig, name: str, low: float, high: float) -> str:
    """Format a range of a parameter in the unit of the rig's file."""
    (first, unit), (last, _) = rig.display_value(name, low), rig.display_value(name, high)
    with displayed_as(rig.written_as(name)):
        return format_range(first, last, unit, rig.printed_area(name))


def is_undecided(analysis: Findings) -> bool:
    """True if there is no verdict because one of its checks failed."""
    return analysis.reason.startswith(UNDECIDED)


def stable_speeds(analysis: Findings) -> list[tuple[str, str]]:
    """Row (label, text) on all drive velocities at which sliding is stable.

    There is no row if these velocities were not searched for, nor for a rig in stresses whose stability does not
    depend on velocity.
    """
    rig, margin = analysis.rig, next((one for one in analysis.margins if one.parameter == "drive.velocity"), None)
    if margin is None:
        return []
    if not margin.edges:
        if analysis.stable is None or analysis.on_edge or not (rig.in_forces or rig.area is not None):
            return []
        searched = " to ".join(format_parameter(analysis.rig, margin.parameter, end) for end in margin.searched)
        return [("stable speeds", f"{'all' if analysis.stable else 'none'} (searched from {searched})")]
    ends = [0.0, *(edge.value for edge in margin.edges), math.inf]
    below = [edge.stable == "below" for edge in margin.edges] + [False]
    above = [False] + [edge.stable == "above" for edge in margin.edges]
    sides = zip(pairwise(ends), below, above, strict=True)
    windows = [between for between, up_to_its_end, from_its_start in sides if up_to_its_end or from_its_start]
    parts = []
    for low, high in windows:
        first, last = (format_parameter(analysis.rig, margin.parameter, end) for end in (low, high))
        parts.append(f"above {first}" if high == math.inf else f"{first} to {last}" if low else f"below {last}")
    none = f"none up to {format_parameter(analysis.rig, margin.parameter, margin.searched[1])}"
    return [("stable speeds", ", or ".join(parts) or none)]


def onset_words(onset: Onset) -> str:
    """Sentence on the kind of onset; if subcritical, with the size of the unstable oscillation for this rig."""
    text = f"{onset.kind}: {_ONSETS[onset.kind]}"
    if onset.rig.default_along is None:
        text = text.replace("edge in stiffness", f"edge in {label_of(onset.rig, onset.along)}")
    elif onset.along == onset.rig.gain_name():
        text = text.replace("edge in stiffness", f"edge in the {gain_words(onset.rig)}")
    own = onset.rig.parameters()[onset.along].value
    if onset.kind != "subcritical" or own is None:
        return text
    amplitude = float(onset.velocity_amplitude(own))
    if onset.is_near:
        return (
            f"{text}; this rig is near: the oscillation changes velocity by a factor of about {math.exp(amplitude):.3g}"
        )
    return f"{text}; this rig is too far from it to say how large it is" if math.isfinite(amplitude) else text


_KICKS = {
    "velocity": ("lasting velocity step", "a lasting velocity step{at} to"),
    "displacement": ("displacement step", "a displacement step{at} of"),
    "normal-stress": ("normal-stress step", "a normal-stress step{at} of"),
    "normal-force": ("normal-force step", "a step of the normal force{at} of"),
    "force": ("force step", "a step of the force{at} of"),
    "impulse": ("blow", "a blow{at} of"),
}


def threshold_words(kick: Threshold) -> str:
    """Clause on a threshold: the kick that is survived, and what a larger kick leads to."""
    name, what = _KICKS[kick.kick]
    at = f" at {kick.at}" if kick.at else ""
    if kick.size == 0:
        return f"no {name}{at} is survived: steady sliding is unstable"
    if math.isinf(kick.size):
        return (
            f"survives {what.format(at=at)} {format_quantity(kick.survived, kick.unit, area=kick.area)} and all smaller"
        )
    reason = f" ({kick.doubt})" if kick.doubt else ""
    why = "stopped, not known" if kick.interrupted else "undecided"
    if math.isnan(kick.size) and kick.bracket[0] == 0:
        return f"{why} for every {name}{at}, even the smallest tried{reason}"
    if math.isnan(kick.size):
        most = format_quantity(kick.survived, kick.unit, area=kick.area)
        return f"survives {what.format(at=at)} {most} and all smaller that were tried; {why} beyond{reason}"
    what = what.format(at=at)
    edge = ", the edge of the sliding that it leads to" if kick.edge else ""
    where = f" at {kick.contact}" if kick.contact else ""
    after = f"{kick.outcome}{reason}" if kick.outcome == "undecided" else f"more leads to {kick.outcome}{where}"
    amount = format_quantity(kick.amount, kick.unit, area=kick.area)
    if kick.decided:
        return f"survives {what} {amount}{edge}; {after}"
    survived = format_quantity(kick.survived, kick.unit, area=kick.area)
    return f"survives {what} {survived}; {why} from there to {amount}{edge}{reason}; {after}"


def disturbance(analysis: Findings) -> str:
    """Clause on a small disturbance: time to double or halve, period and damping ratio."""
    if analysis.growth_rate == math.inf:
        return "grows without limit at once; the model misses an inertia or a direct effect that matters here"
    if analysis.growth_rate is None:
        return f"{'dies away' if analysis.stable else 'grows'}; not decided: how fast"
    if analysis.on_edge:
        text = PACE["stays"] + ("" if analysis.undamped else ", to within rounding")
    elif analysis.time_to_double is not None:
        text = PACE["grows"].format(time=format_quantity(analysis.time_to_double, "s"))
    elif analysis.time_to_halve is not None:
        text = PACE["decays"].format(time=format_quantity(analysis.time_to_halve, "s"))
    else:  # only the sign of the leading root is certain; its value is within rounding
        return f"{'dies away' if analysis.stable else 'grows'} too slowly for a rate to be distinguished from rounding"
    if not analysis.eigenvalues:
        return f"{text} at the slowest, infinitely many oscillations nearly alike"
    leading = analysis.eigenvalues[0]
    if leading.imag != 0 and analysis.period is not None and analysis.damping_ratio is not None:
        text += f", oscillating with period {format_quantity(analysis.period, 's')}"
        return text if analysis.on_edge else f"{text} (damping ratio {analysis.damping_ratio:.3g})"
    return text if analysis.on_edge else f"{text} without oscillating"


def edge_rows(analysis: Findings, margin: Margin) -> list[tuple[str, str, str, str, str]]:
    """Rows (name, value, edge, change, what happens beyond) for the edges next to the rig's value, nearest first."""
    return [_margin_row(analysis, margin, edge) for edge in margin.about]


def margin_table(analysis: Findings) -> list[str]:
    """Lines of the table of nearest edges, one parameter varied at a time; edges beyond a factor `REMOTE` last."""
    if not analysis.margins:
        return []
    lines = ["", "Nearest edges in each parameter, the others unchanged, and what happens beyond them"]
    rows = [
        (one.remote, (name, value, f"-> {edge}", change, words))
        for one in analysis.margins
        for name, value, edge, change, words in edge_rows(analysis, one)
    ]
    widths = [max(len(cells[i]) for _, cells in rows) for i in range(4)] if rows else []
    for far in (False, True):
        table = [cells for is_far, cells in rows if is_far == far]
        lines += [f"  {EDGE_WORDS['far'].format(remote=REMOTE)}:"] if far and table else []
        lines += [
            "  " + "  ".join([*(cell.ljust(w) for cell, w in zip(cells, widths, strict=False)), cells[4]])
            for cells in table
        ]
    if without := [one.parameter for one in analysis.margins if one.edge is None]:
        lines += textwrap.wrap(
            f"no edge within range: {', '.join(without)}", 98, initial_indent="  ", subsequent_indent="    "
        )
    return lines


def change_to(margin: Margin, edge: Boundary) -> str:
    """Format the change of a parameter to an edge: in degrees, percent or as a factor."""
    gap = edge.value - margin.value
    if margin.unit == "rad":
        return f"{math.degrees(gap):+.4g} deg"
    if not margin.value:
        return "from zero"
    ratio = edge.value / margin.value
    if ratio < -10:
        return "to the other sign"
    return f"x {ratio:.4g}" if 0 < ratio < 0.1 or ratio > 10 else f"{100 * gap / abs(margin.value):+.4g} %"


def _margin_row(analysis: Findings, margin: Margin, edge: Boundary) -> tuple[str, str, str, str, str]:
    """Row of the table of nearest edges: name, value, edge, change and what happens beyond."""
    gap, change = edge.value - margin.value, change_to(margin, edge)
    towards = "above" if gap > 0 or (gap == 0 and edge.stable == "below") else "below"
    if analysis.on_edge and abs(gap) <= NEXT_TO_IT * abs(margin.value):
        change, words = "0", EDGE_WORDS["here" if edge.stable == "neither" else "beside"].format(side=edge.stable)
    elif edge.stable == towards:
        words = EDGE_WORDS["stable"]
    elif edge.quiet == towards:
        words = EDGE_WORDS["quiet"]
    elif analysis.stable is None:
        words = EDGE_WORDS["unstable"]
    else:
        words = beyond(edge)
    return (
        margin.parameter,
        format_parameter(analysis.rig, margin.parameter, margin.value, edge.value),
        format_parameter(analysis.rig, margin.parameter, edge.value, margin.value),
        change,
        words,
    )
