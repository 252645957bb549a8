"""`analyze`: steady sliding of a rig, its stability, edges, margins and onset, as one `Analysis`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from steadyslip.core.checks import UNDECIDED, Check, check
from steadyslip.core.errors import NoSteadySliding, NotAvailable, ParameterError, Problem
from steadyslip.core.options import checked
from steadyslip.core.version import version
from steadyslip.linear.boundary import Margin, edges_about, margins, margins_and_missing, oscillatory_edge
from steadyslip.linear.matrix_coupling import nothing_damps
from steadyslip.linear.matrix_route import require_matrices
from steadyslip.linear.mode_table import growth_origin
from steadyslip.linear.modes import Mode, matrix_mode, mode_of
from steadyslip.linear.pencil import GOOD
from steadyslip.linear.status import decided_by_rounding, on_edge
from steadyslip.linear.undamped import is_undamped
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.model.build import HELD
from steadyslip.model.numeric import by_matrices, has_response
from steadyslip.model.numeric.measured import measured_machine
from steadyslip.model.point import operating_point
from steadyslip.model.sliding import steady_machine, steady_states
from steadyslip.nonlinear.onset.hopf import Onset, onset_at
from steadyslip.verdict import machine, slider
from steadyslip.verdict.analysis import Analysis
from steadyslip.verdict.causes import undecided_without_mass
from steadyslip.verdict.checks import edge_checks, undecided, verdict_checks
from steadyslip.verdict.matrix_checks import is_on_edge, matrix_checks, matrix_edge_checks, matrix_numbers
from steadyslip.verdict.measured import doubt_of_growth, response_numbers
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.reasons import reason as slider_reason

if TYPE_CHECKING:
    from steadyslip.nonlinear.kicks.threshold import Threshold

ON_THE_EDGE = "the rig is on the edge of stability to within rounding; neither verdict should be relied on"


@checked()
def analyze(rig: Slider | Machine, *, branch: int = 0, kick: str | Sequence[str] = ()) -> Analysis:
    """Verdict on a rig.

    Parameters
    ----------
    rig : Slider or Machine
    branch : int
        Index of the steady sliding state to judge where several exist, in order of rising normal stress.
    kick : str or sequence of str
        Kinds of kick, as for `steadyslip.threshold`: for each the smallest kick that is not survived is found. For
        machines with the body or contact that is kicked, such as ``"force at table"``. On a terminal progress is shown;
        Ctrl-C skips the kinds that were not begun.

    Returns
    -------
    Analysis
        If steady sliding does not exist, ``stable`` is None and ``reason`` says why.

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
    if rig.holds:
        from steadyslip.nonlinear.hunting.free_loop import unstable_by_itself

        raise NotAvailable("; ".join(filter(None, (HELD, unstable_by_itself(rig)))))
    with np.errstate(all="ignore"):
        try:
            found = _judged_by_response(rig, kicks) if has_response(rig) else _judged(rig, branch, kicks)
        except NoSteadySliding as error:
            why = str(error).removeprefix("no steady sliding: ")
            found = Analysis(rig=rig, stable=None, reason=why, margins=margins(rig))
    return replace(found, version=version())


class _Linear(NamedTuple):
    """Linear stability of a rig at the operating point `point`, from its symbolic equations or from its matrices.

    `numbers` are fields of `Analysis` by name. `edges()` returns margins and the checks of their edges; `mode(s)`
    returns the mode of eigenvalue s (1/s).
    """

    point: Any
    numbers: dict[str, Any]
    on_edge: bool
    undamped: bool
    checks: tuple[Check, ...]
    edges: Callable[[], tuple[tuple[Margin, ...], tuple[Check, ...]]]
    mode: Callable[[complex], Mode]


def _by_equations(rig: Any, branch: int, steady: Any) -> _Linear:
    point = operating_point(rig, None, rig.kept_zeros(), branch)
    numbers = linear_numbers(point)  # raises NotAvailable before the costly search for edges
    edged = bool(on_edge(point)) or decided_by_rounding(point)
    return _Linear(
        point,
        numbers,
        edged,
        bool(is_undamped(point)),
        verdict_checks(rig, point, numbers["stable"], edged, steady if rig.in_forces else None),
        lambda: edge_checks(rig, *margins_and_missing(rig, branch), branch),
        lambda eigenvalue: mode_of(rig, point, eigenvalue),
    )


def _by_matrices(rig: Machine) -> _Linear:
    point = require_matrices(rig)
    numbers, edged = matrix_numbers(point), is_on_edge(point)
    return _Linear(
        point,
        numbers,
        edged,
        nothing_damps(point.pencil),
        matrix_checks(point, numbers["stable"], edged),
        lambda: matrix_edge_checks(point, *margins_and_missing(rig)),
        lambda eigenvalue: matrix_mode(point, eigenvalue),
    )


def _judged(rig: Any, branch: int, kicks: Sequence[str]) -> Analysis:
    """Verdict from a rig's symbolic equations or, where these would be too long, from its matrices (then no onset)."""
    matrices = by_matrices(rig)
    states = steady_states(rig)
    if not 0 <= branch < len(states):
        raise NotAvailable(f"branch {branch} does not exist; this rig has {len(states)} steady sliding state(s)")
    linear = _by_matrices(rig) if matrices else _by_equations(rig, branch, states[branch])
    numbers, checks = linear.numbers, linear.checks
    massless = numbers["growth_rate"] == math.inf and not matrices
    if doubt := undecided(checks) or (undecided_without_mass(rig, branch) if massless else ""):
        return Analysis(rig=rig, stable=None, reason=doubt, checks=checks, branch=branch)
    distances, of_edges = linear.edges()
    if rig.in_forces:
        own, of_own = _leading_mode(rig, linear)
    else:
        own, of_own = slider.checked_stiffness_numbers(rig, linear.point)
    onset = None if matrices or linear.undamped else _onset(rig, distances, branch)
    found = Analysis(
        rig=rig,
        steady=states[branch],
        margins=distances,
        onset=onset,
        kicks=_kicks(rig, kicks, branch),
        on_edge=linear.on_edge,
        undamped=linear.undamped,
        branch=branch,
        checks=(*checks, *of_edges, *of_own, *(onset.checks if onset else ())),
        **numbers,
        **own,
    )
    return _explained(found, states)


def _explained(found: Analysis, states: Sequence[Any]) -> Analysis:
    """Copy of `found` with reason and warnings filled in; `states` are all steady states of the rig."""
    if found.rig.in_forces:
        return replace(found, reason=machine.reason(found), warnings=tuple(machine.warnings(found, states)))
    edged = (ON_THE_EDGE,) if found.on_edge else ()
    return replace(found, reason=slider_reason(found), warnings=(*edged, *slider.warnings(found, states)))


def _judged_by_response(rig: Any, kicks: Sequence[str]) -> Analysis:
    """Verdict on a machine with a structure given by its measured frequency response, from a count of growing roots."""
    if kicks:
        raise NotAvailable("kicks are not offered for a structure given by its measured response")
    found = measured_machine(rig)
    if doubt := found.count.doubt or doubt_of_growth(rig):
        return Analysis(rig=rig, stable=None, reason=UNDECIDED + doubt)
    distances, missing = margins_and_missing(rig)
    steady = steady_machine(rig)
    answer = _explained(
        Analysis(rig=rig, steady=steady, margins=distances, **response_numbers(found)),
        (steady,),
    )
    lost = (f"{UNDECIDED}edges of {', '.join(missing)}",) if missing else ()
    return replace(answer, warnings=(*answer.warnings, *lost))


def _leading_mode(rig: Machine, linear: _Linear) -> tuple[dict[str, Any], tuple[Check, ...]]:
    """Fields `mode` and `origin` of a machine's verdict, and the check of `origin`; `origin` is None if it fails."""
    known = linear.numbers["growth_rate"] not in (math.inf, None)
    first = next(iter(linear.numbers.get("eigenvalues", ()) if known else ()), None)
    if first is None:
        return {}, ()
    mode = linear.mode(complex(first.real, abs(first.imag)))
    origin = growth_origin(rig, mode.eigenvalue, mode.number)
    if origin is None:
        return {"mode": mode}, ()
    off = abs(sum(origin.feeds.values()) - mode.eigenvalue.real) / abs(mode.eigenvalue)
    own = check("why it grows", "work of all forces added up", off, GOOD)
    return {"mode": mode, "origin": origin if own.passed else None}, (own,)


def _onset(rig: Slider | Machine, distances: Sequence[Margin], branch: int) -> Onset | None:
    """Onset (kind of Hopf bifurcation) at the nearest oscillatory edge: in a slider's stiffness or gain kp, in any
    parameter of a machine; None without an oscillatory edge.
    """
    if rig.default_along is None:
        nearest = oscillatory_edge(distances)
        return None if nearest is None else onset_at(rig, nearest)
    name = rig.parameter_along("slider.stiffness")
    margin = next((one for one in distances if one.parameter == name), None)
    edges = [one for one in margin.edges if one.kind == "oscillatory" and one.stable != "neither"] if margin else []
    if margin is None or not edges:
        return None
    with suppress(NotAvailable):  # NotAvailable is raised for rigs with a delay
        return onset_at(rig, edges_about(margin.value, edges)[0], branch)
    return None


def _kicks(rig: Slider | Machine, kinds: Sequence[str], branch: int) -> tuple[Threshold, ...]:
    """Thresholds of the kicks named in `kinds`, text such as ``force at table``; empty without any."""
    if not kinds:
        return ()
    from steadyslip.nonlinear.kicks.kicks import kick_problems
    from steadyslip.nonlinear.kicks.several_kicks import thresholds_shown  # compiles code: only if needed

    asked = [(kick.strip(), at.strip() or None) for kick, _, at in (words.partition(" at ") for words in kinds)]
    if problems := [one for kick, at in asked for one in kick_problems(rig, kick, at)]:
        raise ParameterError(problems)
    return tuple(
        one
        for at, same in groupby(asked, key=lambda kick: kick[1])
        for one in thresholds_shown(rig, [kick for kick, _ in same], at=at, branch=branch).found
    )
