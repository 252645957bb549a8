"""Parts of a verdict's text that only machines have: forces, pull of the links, modes, reason, warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from steadyslip.core.format import format_percent, format_quantity
from steadyslip.linear.boundary import Margin
from steadyslip.machine.letters import label_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.structures import StructureBody
from steadyslip.model.numeric import by_matrices, has_response
from steadyslip.model.point import operating_point
from steadyslip.model.steady_results import SteadyMachine
from steadyslip.verdict.causes import why_delay_is_ill_posed
from steadyslip.verdict.measured import response_facts
from steadyslip.verdict.reasons import ON_EDGE, UNDAMPED
from steadyslip.verdict.words import BEYOND, EDGE_WORDS, STABLE_MEANS, beyond, format_parameter, instead

if TYPE_CHECKING:
    from steadyslip.verdict.findings import Findings

MEANS = STABLE_MEANS.format(what="an oscillation")
"""Limits of the verdict "stable" on a machine, as text."""


def sliding_rows(analysis: Findings) -> list[tuple[str, str]]:
    """Rows (label, text) on steady sliding, and on the links whose pull T sets a normal force."""
    pulls = [row for name in analysis.rig.contacts for row in _pull(analysis.rig, name)]
    return [("steady sliding", _sliding(analysis.steady)), *pulls]


def stability_rows(analysis: Findings) -> list[tuple[str, str]]:
    """Rows (label, text) on the leading mode, why it grows, and the errors of a measured response."""
    rows = [("the mode", analysis.mode.words())] if analysis.mode else []
    rows += [("why it grows", analysis.origin.words)] if analysis.origin else []
    return rows + (response_facts(analysis.rig, analysis.margins) if has_response(analysis.rig) else [])


def _pull(machine: Machine, name: str) -> list[tuple[str, str]]:
    """Row (label, text) that names the links whose pull T sets a contact's normal force; none if it is one link."""
    surface = machine.contacts[name]
    at = [link for link, one in machine.links.items() if surface.held in one.between and "x" in one.directions()]
    controlled = machine.drive.driven() == surface.held
    if len(at) + controlled < 2 or not surface.contact.follows_spring():
        return []
    return [("the pull T", f"the normal force of {name} follows T, the pull of {' and '.join(machine.pulls_at(name))}")]


def meaning(analysis: Findings) -> list[str]:
    """Lines on the limits of the verdict "stable", or on the motion of an unstable machine; none if undecided."""
    if not analysis.stable:
        return [] if analysis.growth_rate == math.inf or has_response(analysis.rig) else [instead(analysis)]
    return [MEANS]


PHRASES = {
    "are ill-posed": "the equations are ill-posed: somewhere mass, direct effect and dampings do not outweigh what "
    "friction, directly or by way of the normal force, may fall by at once, so any small lag grows at once",
    "on edge": ON_EDGE,
    "undamped": UNDAMPED,
    "dies out": "every small disturbance dies out",
    "nearest": "the nearest edge is that of {name}: {side} {value} {beyond}",
    "stable": "it is stable",
    **BEYOND,
}
"""Phrases for the reasons of machines' verdicts; browser pages use the same keys."""


def reason(found: Findings) -> str:
    """Sentence that explains a machine's verdict: kind of growth, and the nearest edge among all parameters."""
    if found.growth_rate == math.inf:
        late = "" if by_matrices(found.rig) else why_delay_is_ill_posed(operating_point(found.rig))
        return late or PHRASES["are ill-posed"]
    first = next((one for one in found.margins if one.edge is not None), None)
    hint = "" if first is None else f"; {nearest_edge(found, first)}"
    if found.on_edge:
        return PHRASES["undamped"] + hint if found.undamped else PHRASES["on edge"]
    if not found.stable:
        counted = not found.eigenvalues and found.unstable_roots  # even: roots in oscillating pairs
        swings = counted % 2 == 0 if counted else any(s.imag for s in found.eigenvalues[:1])
        return PHRASES["oscillatory" if swings else "divergence"] + hint
    return PHRASES["dies out"] + hint


def nearest_edge(found: Findings, margin: Margin) -> str:
    """Clause on the nearest edge of a parameter: side, value and what happens beyond; empty without an edge."""
    edge = margin.edge
    if edge is None:
        return ""
    side = "above" if edge.value > margin.value else "below"
    value = format_parameter(found.rig, margin.parameter, edge.value, margin.value)
    what = PHRASES["stable"] if edge.stable == side else EDGE_WORDS["quiet"] if edge.quiet == side else beyond(edge)
    return PHRASES["nearest"].format(name=label_of(found.rig, margin.parameter), side=side, value=value, beyond=what)


def _sliding(steady: SteadyMachine) -> str:
    """Text on steady sliding of each contact; contacts with equal numbers share a clause."""
    alike: dict[str, list[str]] = {}
    for name, one in steady.contacts.items():
        told_of = (
            f"{format_quantity(one.slip_rate, 'm/s')}, normal force {format_quantity(one.normal_force, 'N')}, "
            f"friction force {format_quantity(one.friction_force, 'N')}, friction {one.friction:.4g}"
        )
        alike.setdefault(told_of, []).append(name)
    return "; ".join(
        f"{', '.join(names[:-1])} and {names[-1]} each slide at {what}" if names[1:] else f"{names[0]} slides at {what}"
        for what, names in alike.items()
    )


def warnings(analysis: Findings, states: Sequence[SteadyMachine]) -> Iterator[str]:
    """Warnings on friction that is not positive, laws without memory, reduced and unstable structures."""
    contacts = states[0].contacts
    for name, one in contacts.items():
        if one.friction <= 0:
            yield f"friction of contact {name} is not positive in steady sliding; check its level and the velocity"
    blind = [name for name, touch in analysis.rig.contacts.items() if not touch.friction.memory()]
    if blind:
        alone = len(blind) == 1
        which = f"law of contact {blind[0]} has" if alone else f"laws of contacts {', '.join(blind)} have"
        yield (
            f"the friction {which} no memory of sliding, so that whether {'it judders' if alone else 'they judder'} at "
            "low speed is not predicted; use a law with memory"
        )
    for name, body in analysis.rig.bodies.items():
        if isinstance(body, StructureBody) and body.reduction_error is not None:
            yield (
                f"{name} is reduced to {body.data.size} degrees of freedom: its own frequencies, up to half that of "
                f"the last mode kept, are off by up to {format_percent(body.reduction_error)}"
            )
        if not analysis.stable and isinstance(body, StructureBody) and body.data.gives_way:
            yield (
                f"the stiffness matrix of {name} is negative in some direction, so that the structure gives way "
                "without any contact; check its signs and supports"
            )
