"""`analyze_machine`: the verdict on a machine, its text and its JSON-ready data."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from steadyslip.core.checks import UNDECIDED, Check, check
from steadyslip.core.errors import NoSteadySliding, NotAvailable, ParameterError
from steadyslip.core.format import format_quantity
from steadyslip.core.pictures import draw
from steadyslip.linear import formula as linear_formula
from steadyslip.linear.boundary import Margin, margins, margins_and_missing, oscillatory_edge
from steadyslip.linear.coupling import is_undamped
from steadyslip.linear.matrix_route import require_matrices
from steadyslip.linear.mode_origin import Origin
from steadyslip.linear.mode_table import growth_origin
from steadyslip.linear.modes import Mode, matrix_mode, mode_of
from steadyslip.linear.pencil import GOOD
from steadyslip.linear.status import decided_by_rounding, on_edge
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import GROUND
from steadyslip.model.numeric import by_matrices, has_response, has_structure
from steadyslip.model.numeric.measured import measured_machine
from steadyslip.model.point import operating_point
from steadyslip.model.range import require_range
from steadyslip.model.sliding import steady_machine
from steadyslip.model.steady_results import SteadyMachine
from steadyslip.nonlinear.onset.hopf import Onset, onset_at
from steadyslip.verdict.causes import undecided_without_mass, why_delay_is_ill_posed
from steadyslip.verdict.checks import edge_checks, undecided, verdict_checks
from steadyslip.verdict.export import common_numbers, finite, onset_dict
from steadyslip.verdict.findings import MachineFindings
from steadyslip.verdict.matrix_checks import is_on_edge, matrix_checks, matrix_edge_checks, matrix_numbers
from steadyslip.verdict.measured import response_facts, response_numbers
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.reasons import ON_EDGE, UNDAMPED
from steadyslip.verdict.words import (
    BEYOND,
    QUIET,
    beyond,
    disturbance,
    headline,
    instead,
    margin_table,
    onset_words,
    stable_speeds,
    threshold_words,
    unlikely_speed,
    verdict_text,
)

if TYPE_CHECKING:
    import sympy as sp

    from steadyslip.nonlinear.kicks.threshold import Threshold


@dataclass(frozen=True, repr=False)
class MachineAnalysis(MachineFindings):  # noqa: D101 -- its base has it
    __doc__ = MachineFindings.__doc__

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units, as ``--json`` prints it."""
        return as_dict(self)

    def to_json(self) -> str:
        """`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def plot(self, kind: str | None = None, **options: Any) -> Any:
        """A figure: ``"verdict"``, or of its parts ``"ranges"``, ``"mode"`` and ``"eigenvalues"`` alone."""
        return draw(self, kind, **options)

    def formula(self, along: str | None = None) -> sp.Eq:
        """The edge in a parameter as a formula, where one is short; see `steadyslip.formula`."""
        return linear_formula(self.rig, along)

    def __str__(self) -> str:
        return verdict_text(self, machine_facts(self), margin_table(self), machine_meaning(self))

    def __repr__(self) -> str:
        return f"<MachineAnalysis: {headline(self)}; print it for the whole verdict>"


def machine_facts(found: MachineAnalysis) -> list[tuple[str, str]]:
    """Rows (label, text) on steady sliding, small disturbances, leading mode, onset and kicks of a machine."""
    rows = []
    if found.steady:
        pulls = [row for name in found.rig.contacts for row in _pull(found.rig, name)]
        rows = [("steady sliding", _sliding(found.steady)), *pulls, ("a disturbance", disturbance(found))]
    rows += [("the mode", found.mode.words())] if found.mode else []
    rows += [("why it grows", found.origin.words)] if found.origin else []
    rows += response_facts(found.rig, found.margins) if has_response(found.rig) else []
    rows += stable_speeds(found)
    rows += [("onset", onset_words(found.onset))] if found.onset else []
    return rows + [("a kick", threshold_words(kick)) for kick in found.kicks]


def _pull(machine: Machine, name: str) -> list[tuple[str, str]]:
    """Row (label, text) on what T, the force that presses a contact, contains; none if one link alone."""
    surface = machine.contacts[name]
    at = [link for link, one in machine.links.items() if surface.held in one.between and "x" in one.directions()]
    controlled = machine.drive.driven() == surface.held
    if len(at) + controlled < 2 or not surface.contact.follows_spring():
        return []
    inside = [surface.loaded_by] if surface.loaded_by else [
        link for link in at if GROUND not in machine.links[link].between
    ]  # fmt: skip
    parts = [f"links.{link}" for link in inside] + ["the controller"] * (controlled and not surface.loaded_by)
    return [("the pull T", f"the normal force of {name} follows T, the pull of {' and '.join(parts)}")]


def machine_meaning(found: MachineAnalysis) -> list[str]:
    """Lines on the limits of a verdict "stable", and on what to ask next of an unstable machine."""
    if found.stable is None or found.on_edge:
        return []
    if not found.stable:
        return [] if found.growth_rate == math.inf or has_structure(found.rig) else [instead(found)]
    return ["Stable means: small disturbances die out. A large enough kick may still start an oscillation."]


def analyze_machine(machine: Machine, kicks: Sequence[str] = ()) -> MachineAnalysis:
    """Verdict on a machine; see `steadyslip.analyze`."""
    from steadyslip import __version__

    if has_response(machine):
        return _analyze_response(machine, kicks)
    if by_matrices(machine):
        return _analyze_by_matrices(machine, kicks)
    with np.errstate(all="ignore"):
        point = operating_point(machine)
        require_range(point)
        try:
            steady = steady_machine(machine)
        except NoSteadySliding as error:
            why = str(error).removeprefix("no steady sliding: ")
            return MachineAnalysis(rig=machine, stable=None, reason=why, margins=margins(machine), version=__version__)
        numbers = linear_numbers(point)  # refuses what cannot be counted, before the edges are looked for
        edged = bool(on_edge(point)) or decided_by_rounding(point)
        checks = verdict_checks(machine, point, numbers["stable"], edged, steady)
        posed = numbers["growth_rate"] != math.inf
        if doubt := undecided(checks) or ("" if posed else undecided_without_mass(machine)):
            return MachineAnalysis(
                rig=machine, stable=None, reason=doubt, margins=(), checks=checks, version=__version__
            )
        distances, of_edges = edge_checks(machine, *margins_and_missing(machine), 0)
        undamped = bool(is_undamped(point))
        known = numbers["growth_rate"] not in (math.inf, None)
        leading = next(iter(numbers["eigenvalues"] if known else ()), None)
        onset = None if undamped else _onset(machine, distances)
        mode = None if leading is None else mode_of(machine, point, complex(leading.real, abs(leading.imag)))
        origin, of_origin = _origin(machine, mode)
        found = MachineAnalysis(
            rig=machine,
            reason="",
            steady=steady,
            mode=mode,
            origin=origin,
            on_edge=edged,
            undamped=undamped,
            margins=distances,
            onset=onset,
            kicks=_kicks(machine, kicks),
            warnings=_warnings(machine, steady),
            checks=(*checks, *of_edges, *of_origin, *(onset.checks if onset else ())),
            version=__version__,
            **numbers,
        )
    return replace(found, reason=_reason(found))


def _analyze_by_matrices(machine: Machine, kicks: Sequence[str]) -> MachineAnalysis:
    """Verdict on a machine whose equations are matrices: as of others, without the kind of onset."""
    from steadyslip import __version__

    if kicks and has_structure(machine):
        raise NotAvailable("kicks are not offered for a machine with a structure, whose equations are matrices")
    with np.errstate(all="ignore"):
        point = require_matrices(machine)
        try:
            steady = steady_machine(machine)
        except NoSteadySliding as error:
            why = str(error).removeprefix("no steady sliding: ")
            return MachineAnalysis(rig=machine, stable=None, reason=why, margins=margins(machine), version=__version__)
        numbers, edged = matrix_numbers(point), is_on_edge(point)
        checks = matrix_checks(point, numbers["stable"], edged)
        if doubt := undecided(checks):
            return MachineAnalysis(
                rig=machine, stable=None, reason=doubt, margins=(), checks=checks, version=__version__
            )
        distances, of_edges = matrix_edge_checks(point, margins(machine))
        leading = next(iter(numbers.get("eigenvalues", ())), None)
        mode = None if leading is None else matrix_mode(point, complex(leading.real, abs(leading.imag)))
        origin, of_origin = _origin(machine, mode)
        found = MachineAnalysis(
            rig=machine, reason="", steady=steady, on_edge=edged, margins=distances, version=__version__,
            mode=mode, origin=origin, kicks=_kicks(machine, kicks), warnings=_warnings(machine, steady),
            checks=(*checks, *of_edges, *of_origin), **numbers,
        )  # fmt: skip
    return replace(found, reason=_reason(found))


def _analyze_response(machine: Machine, kicks: Sequence[str]) -> MachineAnalysis:
    """Verdict on a machine with a structure given by its measured response: the growing roots are counted."""
    from steadyslip import __version__

    if kicks:
        raise NotAvailable("kicks are not offered for a structure given by its measured response")
    found = measured_machine(machine)
    if found.count.growing is None:
        doubt = UNDECIDED + found.count.doubt
        return MachineAnalysis(rig=machine, stable=None, reason=doubt, margins=(), version=__version__)
    distances, missing = margins_and_missing(machine)
    steady = steady_machine(machine)
    lost = (f"{UNDECIDED}edges of {', '.join(missing)}",) if missing else ()
    answer = MachineAnalysis(
        rig=machine, reason="", steady=steady, margins=distances, warnings=(*_warnings(machine, steady), *lost),
        version=__version__, **response_numbers(found),
    )  # fmt: skip
    return replace(answer, reason=_reason(answer))


def _origin(machine: Machine, mode: Mode | None) -> tuple[Origin | None, tuple[Check, ...]]:
    """Why the leading mode grows, and its check; None where that fails, and of a mode that does not grow."""
    found = None if mode is None else growth_origin(machine, mode.eigenvalue, mode.number)
    if found is None or mode is None:
        return None, ()
    off = abs(sum(found.feeds.values()) - mode.eigenvalue.real) / abs(mode.eigenvalue)
    checked = check("why it grows", "work of all forces added up", off, GOOD)
    return (found if checked.passed else None), (checked,)


def _onset(machine: Machine, distances: Sequence[Margin]) -> Onset | None:
    """Onset at the nearest oscillatory edge of all parameters; None without one."""
    nearest = oscillatory_edge(distances)
    return None if nearest is None else onset_at(machine, nearest)


def _kicks(machine: Machine, kinds: Sequence[str]) -> tuple[Threshold, ...]:
    """Thresholds of kicks given as text such as ``force at table``."""
    if not kinds:
        return ()
    from steadyslip.nonlinear.cycle_commands import thresholds_shown  # compiles; only where asked for
    from steadyslip.nonlinear.kicks.kicks import kick_problems

    asked = [(kick.strip(), at.strip() or None) for kick, _, at in (words.partition(" at ") for words in kinds)]
    problems = [one for kick, at in asked for one in kick_problems(machine, kick, at)]
    if problems:
        raise ParameterError(problems)
    found = [one for kick, at in asked for one in thresholds_shown(machine, (kick,), at=at).found]
    return tuple(found)


PHRASES = {
    "are ill-posed": "the equations are ill-posed: somewhere mass, direct effect and dampings do not outweigh what "
    "friction, directly or by way of the normal force, may fall by at once, so any small lag grows at once",
    "on edge": ON_EDGE,
    "dies out": "every small disturbance dies out",
    "nearest": "the nearest edge is that of {name}: {side} {value} {beyond}",
    "stable": "it is stable",
    **BEYOND,
}
"""Phrases of which reasons of machines are made; the keys are used by pages too."""


def _reason(found: MachineAnalysis) -> str:
    """Sentence that explains a machine's verdict: what grows, and the nearest edge of all parameters."""
    if found.growth_rate == math.inf:
        late = "" if by_matrices(found.rig) else why_delay_is_ill_posed(operating_point(found.rig))
        return late or PHRASES["are ill-posed"]
    first = next((one for one in found.margins if one.edge is not None), None)
    hint = "" if first is None else f"; {_nearest(found, first)}"
    if found.on_edge:
        return UNDAMPED + hint if found.undamped else PHRASES["on edge"]
    if not found.stable:
        counted = not found.eigenvalues and found.unstable_roots  # pairs, as far as they are not odd
        swings = counted % 2 == 0 if counted else any(s.imag for s in found.eigenvalues[:1])
        return PHRASES["oscillatory" if swings else "divergence"] + hint
    return PHRASES["dies out"] + hint


def _nearest(found: MachineAnalysis, margin: Margin) -> str:
    """Clause on the nearest edge of a parameter: side, value and what happens beyond it."""
    edge = margin.edge
    if edge is None:
        return ""
    side = "above" if edge.value > margin.value else "below"
    value = format_quantity(edge.value, margin.unit, area=found.rig.printed_area(margin.parameter))
    what = PHRASES["stable"] if edge.stable == side else QUIET if edge.quiet == side else beyond(edge)
    return PHRASES["nearest"].format(name=margin.parameter, side=side, value=value, beyond=what)


def _sliding(steady: SteadyMachine | None) -> str:
    if steady is None:
        return ""
    return "; ".join(
        f"{name} slides at {format_quantity(one.slip_rate, 'm/s')}, normal force "
        f"{format_quantity(one.normal_force, 'N')}, friction force "
        f"{format_quantity(one.friction_force, 'N')}, friction {one.friction:.4g}"
        for name, one in steady.contacts.items()
    )


def _warnings(machine: Machine, steady: SteadyMachine) -> tuple[str, ...]:
    """Warnings: contacts whose friction is not positive, and contacts whose friction law has no memory."""
    pulled = [name for name, one in steady.contacts.items() if one.friction <= 0]
    found = tuple(
        f"the friction coefficient of contact {name} is not positive in steady sliding; check level and velocity"
        for name in pulled
    )
    for name, one in steady.contacts.items():
        found += unlikely_speed(f"contact {name} slides at", one.slip_rate, machine.contacts[name].friction)
    blind = [name for name, touch in machine.contacts.items() if not touch.friction.memory()]
    if not blind:
        return found
    alone = len(blind) == 1
    which = f"law of contact {blind[0]} has" if alone else f"laws of contacts {', '.join(blind)} have"
    return (
        *found,
        f"the friction {which} no memory of sliding, so that whether {'it judders' if alone else 'they judder'} at low "
        "speed is not predicted; use a law with memory",
    )


def as_dict(found: MachineAnalysis) -> dict[str, Any]:
    """Verdict on a machine as JSON-ready dict, SI units with forces in N; NaN and infinite numbers become None."""
    data: dict[str, Any] = common_numbers(found) | {
        "steady": _steady(found.steady), "mode": found.mode and found.mode.to_dict(),
        "why_it_grows": found.origin and found.origin.to_dict(),
        "onset": None if found.onset is None else onset_dict(found.onset),
        "kicks": [kick.to_dict() for kick in found.kicks],
    }  # fmt: skip
    plain: dict[str, Any] = finite(data)
    return plain


def _steady(steady: SteadyMachine | None) -> dict[str, Any] | None:
    if steady is None:
        return None
    contacts = {
        name: {
            "slip_rate": one.slip_rate, "normal_force": one.normal_force, "friction_force": one.friction_force,
            "friction": one.friction, "states": one.states,
        }
        for name, one in steady.contacts.items()
    }  # fmt: skip
    return {
        "velocity": steady.velocity, "speeds": steady.speeds, "contacts": contacts, "links": steady.links,
        "units": steady.units,
    }  # fmt: skip
