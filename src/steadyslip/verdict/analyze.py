"""`analyze`: steady sliding of a rig, its stability, critical stiffness, margins and onset, as one `Analysis`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from steadyslip.core.areas import stress_name
from steadyslip.core.errors import NoSteadySliding, NotAvailable, ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import checked
from steadyslip.core.pictures import draw
from steadyslip.linear import formula as linear_formula
from steadyslip.linear.boundary import Margin, margins, margins_and_missing
from steadyslip.linear.status import decided_by_rounding, on_edge
from steadyslip.linear.stiffness import set_of_one
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.sliding import steady_states
from steadyslip.model.steady_results import SteadySliding
from steadyslip.nonlinear.onset.hopf import Onset, onset_at
from steadyslip.verdict.causes import undecided_without_mass
from steadyslip.verdict.checks import critical_check, edge_checks, undecided, verdict_checks
from steadyslip.verdict.export import as_dict
from steadyslip.verdict.findings import Findings
from steadyslip.verdict.machine import MachineAnalysis, analyze_machine
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.words import headline, unlikely_speed, verdict

if TYPE_CHECKING:
    import sympy as sp

    from steadyslip.nonlinear.kicks.threshold import Threshold


@dataclass(frozen=True, repr=False)
class Analysis(Findings):  # noqa: D101 -- its base has it
    __doc__ = Findings.__doc__

    def formula(self, along: str | None = None) -> sp.Eq:
        """Critical stiffness, or the edge in another parameter, as a SymPy equation; see `steadyslip.formula`."""
        return linear_formula(self.rig, along)

    def plot(self, ax: Any = None) -> Any:
        """Root locus in the stiffness; see `steadyslip.figures.root_locus`."""
        return draw(self, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units per unit area (with an area, forces as well), as ``--json`` prints it."""
        return as_dict(self)

    def to_json(self) -> str:
        """`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def __str__(self) -> str:
        return verdict(self)

    def __repr__(self) -> str:
        return f"<Analysis: {headline(self)}; print it for the whole verdict>"


@overload
def analyze(rig: Slider, *, branch: int = 0, kick: str | Sequence[str] = ()) -> Analysis: ...


@overload
def analyze(rig: Machine, *, branch: int = 0, kick: str | Sequence[str] = ()) -> MachineAnalysis: ...


@checked()
def analyze(rig: Slider | Machine, *, branch: int = 0, kick: str | Sequence[str] = ()) -> Analysis | MachineAnalysis:
    """Verdict on a rig.

    Parameters
    ----------
    rig : Slider or Machine
    branch : int
        Which steady sliding to judge where there are several, by rising normal stress.
    kick : str or sequence of str
        Kinds of kick, as for `steadyslip.threshold`, of which to find the smallest that is not survived; of machines
        with the body or contact where it is, such as ``"force at table"``. On a terminal progress is shown; Ctrl-C
        leaves the kinds that were not begun out.

    Returns
    -------
    Analysis or MachineAnalysis
        With ``stable = None`` and the reason if steady sliding does not exist.

    Raises
    ------
    ParameterError
        If `rig` is neither a Slider nor a Machine, or `branch` is not 0 for a machine.
    NotAvailable
        If `branch` does not exist, or the numbers of the rig leave the range of floating point.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> verdict = ss.analyze(rig)
    >>> verdict.stable, round(verdict.critical_stiffness / 1e9, 3)
    (False, 29.07)
    """
    if not isinstance(rig, Rig):
        raise ParameterError([Problem("rig", f"got {rig!r}; allowed: a Slider or a Machine, such as read_rig gives")])
    rig.check_branch(branch)
    kicks = (kick,) if isinstance(kick, str) else tuple(kick)
    return analyze_machine(rig, kicks) if isinstance(rig, Machine) else _analyze_slider(rig, branch, kicks)


def _analyze_slider(rig: Slider, branch: int, kicks: tuple[str, ...]) -> Analysis:
    from steadyslip import __version__

    with np.errstate(all="ignore"):
        try:
            states = steady_states(rig)
        except NoSteadySliding as error:
            why = str(error).removeprefix("no steady sliding: ")
            return Analysis(rig=rig, stable=None, reason=why, margins=margins(rig), version=__version__)
        if not 0 <= branch < len(states):
            raise NotAvailable(f"branch {branch} does not exist; this rig has {len(states)} steady sliding state(s)")
        values = operating_point(rig, None, rig.kept_zeros(), branch)
        numbers = numbers_of(rig, values)
        on_the_edge = bool(on_edge(values)) or decided_by_rounding(values)
        checks = verdict_checks(rig, values, numbers["stable"], on_the_edge)
        posed = numbers["growth_rate"] != math.inf
        if doubt := undecided(checks) or ("" if posed else undecided_without_mass(rig, branch)):
            return Analysis(rig=rig, stable=None, reason=doubt, margins=(), checks=checks, version=__version__)
        distances, of_edges = edge_checks(rig, *margins_and_missing(rig, branch), branch)
        checks += of_edges
        if numbers.get("critical_angular_frequency") is not None:
            checks += (critical_check(values, numbers["critical_stiffness"], numbers["critical_angular_frequency"]),)
            if not checks[-1].passed:
                numbers |= dict.fromkeys([name for name in numbers if name.startswith("critical_")])
        onset = _onset(rig, distances, branch)
        found = Analysis(
            rig=rig,
            steady=states[branch],
            reason="",
            margins=distances,
            onset=onset,
            kicks=_kicks(rig, kicks, branch),
            on_edge=on_the_edge,
            branch=branch,
            warnings=_warnings(rig, values, states, on_the_edge),
            checks=(*checks, *(onset.checks if onset else ())),
            version=__version__,
            **numbers,
        )
    from steadyslip.verdict.reasons import reason

    return replace(found, reason=reason(found))


def _onset(rig: Slider, distances: tuple[Margin, ...], branch: int) -> Onset | None:
    """Onset at the oscillatory edge nearest to the rig's stiffness (or gain kp); None without such an edge."""
    name = rig.parameter_along("slider.stiffness")
    for margin in distances:
        if margin.parameter == name:
            edges = [e for e in margin.edges if e.kind == "oscillatory" and e.stable != "neither"]
            if edges:
                with suppress(NotAvailable):  # with a delay
                    return onset_at(rig, min(edges, key=lambda e: abs(e.value - margin.value)), branch)
    return None


def _kicks(rig: Slider, kinds: tuple[str, ...], branch: int) -> tuple[Threshold, ...]:
    if not kinds:
        return ()
    from steadyslip.nonlinear.cycle_commands import thresholds_shown  # compiles; only where asked for

    return thresholds_shown(rig, kinds, branch=branch).found


def numbers_of(rig: Slider, values: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` that follow from the characteristic equation and from the stable set in stiffness."""
    return linear_numbers(values) | _stiffness_numbers(rig, values)


def _stiffness_numbers(rig: Slider, values: OperatingPoint) -> dict[str, Any]:
    """Fields of `Analysis` on stiffness: stable intervals (Pa/m) and the edge nearest to the rig's own stiffness."""
    try:
        found = set_of_one(values)
    except NotAvailable:  # a delay makes windows without end
        return {}
    own = float(values.named()["slider.stiffness"])
    intervals = found.intervals[np.all(np.isfinite(found.intervals[:, :1]), axis=-1)]
    numbers: dict[str, Any] = {"stable_stiffness": tuple((float(a), float(b)) for a, b in intervals)}
    at = np.flatnonzero(found.changes)
    if at.size:
        i = at[np.argmin(np.abs(found.edges[at] - own))]
        critical, beta = float(found.edges[i]), float(found.frequencies[i])
        numbers["critical_stiffness"] = critical
        numbers["critical_angular_frequency"] = beta if math.isfinite(beta) else None
        numbers["critical_side"] = "above" if np.any(intervals[:, 0] == critical) else "below"
        if rig.axial_stiffness is not None:
            numbers["critical_axial_stiffness"] = critical / float(values.axial_share)
    return numbers


def _warnings(
    rig: Slider, values: OperatingPoint, states: tuple[SteadySliding, ...], on_the_edge: bool
) -> tuple[str, ...]:
    """Warnings: on an edge, several steady states, no memory in the friction law, friction that is not positive."""
    found = []
    if on_the_edge:
        found.append("the rig is on the edge of stability to within rounding; neither verdict should be relied on")
    if len(states) > 1:
        stresses = ", ".join(format_quantity(s.normal_stress, "Pa", area=rig.area) for s in states)
        found.append(
            f"steady sliding is possible at {len(states)} values of {stress_name('normal stress', rig.area)} "
            f"({stresses}); "
            "this verdict is for the one at "
            f"{format_quantity(states[values.branch].normal_stress, 'Pa', area=rig.area)}"
        )
    found += unlikely_speed("the drive's velocity is", float(rig.drive.velocity), rig.friction)
    if not rig.friction.memory() and rig.friction.lateness() == 0:
        found.append(
            "this friction law has no memory of sliding, so it cannot predict a critical stiffness; "
            "use a law with memory"
        )
    if states[values.branch].friction <= 0:
        level = "".join(f"{name.rpartition('.')[2]} and " for name in rig.of_kind("friction level"))
        found.append(f"the friction coefficient in steady sliding is not positive; check {level}the velocity")
    return tuple(found)
