"""The branch of cycles that begins at an edge of stability, made of the sheets that can be followed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from steadyslip.core.arrays import checked_array
from steadyslip.core.errors import InternalError, ParameterError, Problem
from steadyslip.core.options import BRANCH, LOW_AND_HIGH, NAME, Number, checked, whole
from steadyslip.core.quantities import shown
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.continuation import Failure, turned_round
from steadyslip.nonlinear.onset.hopf import Onset, hopf
from steadyslip.nonlinear.orbits.branch import Cycle, CycleBranch
from steadyslip.nonlinear.orbits.flow import Flow
from steadyslip.nonlinear.orbits.special import Known
from steadyslip.nonlinear.orbits.tracer import INTERRUPTED, LARGEST_STEP, Sheet, Tracer
from steadyslip.nonlinear.orbits.verify import cycle_near

Array = np.ndarray
SEEDS = (0.003, 0.03, 0.2, 0.6)  # where to simulate, on the way from where a sheet broke off to the end of the range
PATIENCE = 12  # stretches of motion within which it has to come to a cycle
MET = 2e-3  # difference of logarithms of period and velocities within which cycles are the same
MOST_STEPS_BETWEEN = 40


@checked(
    amplitude=Number(0, 0.1),
    most_points=whole(1),
    doublings=whole(0, 100),
    rtol=Number(0, 0.1),
    between=LOW_AND_HIGH,
    branch=BRANCH,
    along=NAME,
)
def cycles(
    rig: Slider,
    along: str = "stiffness",
    *,
    between: Sequence[Any] | None = None,
    amplitude: float | None = None,
    doublings: int = 1,
    most_points: int = 2000,
    rtol: float | None = None,
    branch: int = 0,
    progress: Callable[[int, Cycle], None] | None = None,
) -> CycleBranch:
    """Follow the cycles that begin at the oscillatory edge of stability nearest to the rig.

    Parameters
    ----------
    rig : Slider
    along : str, optional
        Dotted name, or unique last part, of the parameter that is varied.
    between : (low, high), optional
        Range in which to follow, SI units or text; by default a factor of a thousand to each side of the edge
        for positive parameters, the whole domain for others.
    amplitude : float, optional
        Of ln(v/v0) at which the branch starts; 1e-6, with mass 1e-4, unless given.
    doublings : int, optional
        How many period doublings to follow onto the branch of twice the period, one after another.
    most_points : int, optional
        Limit of cycles on a branch.
    rtol : float, optional
        Error allowed per step of integration; 1e-10, with mass 1e-9, unless given.
    branch : int, optional
        Which steady sliding, where there are several. The result remembers it, and `rtol`.
    progress : callable, optional
        Called with the number of cycles found and the latest one. Ctrl-C (or KeyboardInterrupt from here) returns
        what there is.

    Returns
    -------
    CycleBranch

    Raises
    ------
    NotAvailable
        If there is no oscillatory edge along the parameter, or the rig's motion is ill-posed.
    UnknownNameError, ParameterError
        If names or ranges are wrong.

    Notes
    -----
    Pseudo-arclength continuation of shooting equations, with the variational equations integrated beside the
    motion; several shooting segments where one period is too unstable. A point is accepted only as the continuation
    of the one before, and as a primitive cycle, which does not return earlier. Where the branch from the edge breaks
    off before it has crossed the unstable range (canards, sheets behind a subcritical onset), motions are simulated
    there; from the cycle that one comes to, if Newton's method confirms it, another sheet is followed both ways, and
    joined if it meets the first (`CycleBranch.gaps`). The doubled branch is entered along the eigenvector of the
    multiplier −1.
    """
    onset = hopf(rig, along, branch=branch)
    if amplitude is not None and not 0 < amplitude <= 0.1:
        raise ParameterError([Problem("amplitude", f"got {amplitude!r}; allowed: above 0, up to 0.1")])
    flow = Flow(_at(rig, onset), onset.along, branch, rtol)
    tracer = Tracer(flow, onset, _limits(rig, onset, between), most_points, progress)
    sheets = [_from_the_edge(tracer, amplitude or max(1e-6, 1e9 * flow.noise))]
    _search_on(tracer, sheets)
    return _branch(tracer, sheets, rtol, doublings)


def _branch(tracer: Tracer, sheets: list[Sheet], rtol: float | None, doublings: int) -> CycleBranch:
    """What comes back: sheets one after another, and the first branch of twice the period."""
    whole, gaps, ends = sheets[0], [], [sheets[0].end]
    for sheet in sheets[1:]:
        gaps.append(len(whole.known))
        ends.append(sheet.end)
        whole = whole.joined(sheet)
    doubled = None
    flips = [point for point in whole.special if point.kind == "period doubling"]
    if flips and doublings > 0 and not tracer.interrupted:
        doubled = _twice(tracer, flips[0].cycle, rtol, doublings - 1)
    if tracer.interrupted and doubled is None:
        ends[-1] = INTERRUPTED
    onset, flow = tracer.onset, tracer.flow
    found = tuple(known.cycle for known in whole.known)
    return CycleBranch(
        onset.rig, onset.along, onset.unit, onset, found, tuple(whole.special), ends[-1], doubled,
        tuple(gaps), tuple(ends[:-1]), flow.branch, rtol,
    )  # fmt: skip


def _from_the_edge(tracer: Tracer, amplitude: float) -> Sheet:
    """The sheet that begins at the edge."""
    try:
        shooting, first = tracer.small(amplitude)
    except (Failure, np.linalg.LinAlgError) as failure:
        return Sheet(end=f"broke off: no small cycle was found at the edge ({failure})")
    return tracer.followed(shooting, first, amplitude)


def _twice(tracer: Tracer, flip: Cycle, rtol: float | None, doublings: int) -> CycleBranch | None:
    try:
        shooting, first, size = tracer.doubled(flip)
    except (Failure, np.linalg.LinAlgError):
        return None
    except KeyboardInterrupt:
        tracer.interrupted = True
        return None
    return _branch(tracer, [tracer.followed(shooting, first, size, twice=True)], rtol, doublings)


# -- sheets that cannot be reached from the edge


def _search_on(tracer: Tracer, sheets: list[Sheet]) -> None:
    """Add sheets found by simulation, as long as the last one does not cross the unstable range."""
    low, high = tracer.limits
    onset = tracer.onset
    limit = low if onset.stable == "above" else high
    if not np.isfinite(limit):
        limit = onset.value + np.sign(limit) * max(1.0, abs(onset.value))
    for share in SEEDS:
        last = sheets[-1]
        if tracer.interrupted or _crossed(last, tracer):
            return
        here = last.known[-1].cycle if last.known else None
        start = onset.value
        if here is not None and (here.value - onset.value) * (limit - onset.value) > 0:
            start = here.value
        value = start * (limit / start) ** share if start * limit > 0 else start + share * (limit - start)
        try:
            seed = _seed(tracer, value, here)
        except KeyboardInterrupt:
            tracer.interrupted = True
            return
        if seed is not None and not _met(sheets, seed):
            _add_sheet(tracer, sheets, seed, np.sign(limit - onset.value))


def _crossed(sheet: Sheet, tracer: Tracer) -> bool:
    """Whether a sheet ends for good: for a reason in the matter, other than leaving the range on the stable side."""
    if not sheet.whole or not sheet.known:
        return False
    if not sheet.end.startswith("end of the range"):
        return True
    return (sheet.known[-1].cycle.value < tracer.onset.value) == (tracer.onset.stable == "above")


def _seed(tracer: Tracer, value: float, near: Cycle | None) -> Known | None:
    """A cycle that motions at a value come to: from a known cycle beside it, and from beside steady sliding."""
    flow = tracer.flow
    try:
        steady = flow.steady(value)
    except Failure:
        return None
    pushed = steady.copy()
    pushed[0] -= 2.0 * flow.scales[0]
    starts = [pushed] if near is None or near._orbit is None else [near._orbit.states[0], pushed]
    for state in starts:
        found = cycle_near(flow, state, value, PATIENCE)
        if found is None or found._orbit is None:
            continue
        try:
            return tracer.resumed(found._orbit, 1.0)
        except (Failure, np.linalg.LinAlgError):
            continue
    return None


def _add_sheet(tracer: Tracer, sheets: list[Sheet], seed: Known, away: float) -> None:
    """Follow a cycle both ways: back to a sheet that is known, or the edge, and on."""
    forth = seed if seed.point.tangent[-1] * away > 0 else replace(seed, point=turned_round(seed.point))
    back = replace(forth, point=turned_round(forth.point))
    step = 0.1 * LARGEST_STEP
    behind = tracer.followed(back.shooting, back, step, met=lambda known: _met(sheets, known))
    ahead = Sheet()
    if not tracer.interrupted:
        ahead = tracer.followed(forth.shooting, forth, step)
    both = behind.reversed()
    both.known.pop()  # the seed, which `ahead` begins with
    both = both.joined(ahead) if ahead.known else behind.reversed()
    near = behind.known[-1].cycle
    if behind.end == "" and behind.whole:  # met
        _cut_back(sheets[-1], near)
        sheets[-1] = sheets[-1].joined(both)
    elif behind.end.startswith("back") and abs(near.value / tracer.onset.value - 1) < 1e-3 and near.amplitude < 0.5:
        sheets[-1] = both
    else:
        sheets.append(both)


def _met(sheets: list[Sheet], known: Known) -> bool:
    """Whether a cycle lies between two neighbours that are known."""
    return any(_between_neighbours(a.cycle, b.cycle, known.cycle) for sheet in sheets for a, b in pairwise(sheet.known))


def _between_neighbours(a: Cycle, b: Cycle, cycle: Cycle) -> bool:
    def looks(one: Cycle) -> Array:
        return np.array(
            [np.log(one.period), np.log(one.peak_velocity), np.arcsinh(one.lowest_velocity / one.start["v"])]
        )

    if not min(a.value, b.value) <= cycle.value <= max(a.value, b.value):
        return False
    share = (cycle.value - a.value) / (b.value - a.value) if b.value != a.value else 0.5
    spread = MET + 0.3 * np.abs(looks(b) - looks(a)).max() ** 2
    return bool(np.abs(looks(a) * (1 - share) + looks(b) * share - looks(cycle)).max() < spread)


def _cut_back(sheet: Sheet, meeting: Cycle) -> None:
    """Leave out what lies behind the place at which another sheet met this one."""
    for i in range(len(sheet.known) - 1):
        if _between_neighbours(sheet.known[i].cycle, sheet.known[i + 1].cycle, meeting):
            del sheet.known[i + 1 :]
            sheet.special = [point for point in sheet.special if point.index <= i]
            return


# -- one value


def cycles_at(branch: CycleBranch, value: float) -> tuple[Cycle, ...]:
    """The branch's cycles at one value of its parameter, in the order of the branch."""
    flow = Flow(_at(branch.rig, branch.onset), branch.along, branch.steady, branch.rtol)
    tracer = Tracer(flow, branch.onset, (-np.inf, np.inf), MOST_STEPS_BETWEEN)
    found: list[Cycle] = []
    for stretch in branch._stretches():
        for low, high in pairwise(stretch):
            if (low.value - value) * (high.value - value) <= 0 and high.value != value:
                cycle = _at_value(tracer, low, high, value)
                found += [] if cycle is None else [cycle]
        if stretch and stretch[-1].value == value:
            found.append(stretch[-1])
    return tuple(found)


def _at_value(tracer: Tracer, low: Cycle, high: Cycle, value: float) -> Cycle | None:
    """The cycle between two neighbours: along the branch from one to the other, from either side."""
    for one, other in ((low, high), (high, low)):
        if one.value == value:
            return one
        try:
            return _reached(tracer, one, other, value)
        except (Failure, np.linalg.LinAlgError):
            continue
    return None


def _reached(tracer: Tracer, start: Cycle, end: Cycle, value: float) -> Cycle:
    """Follow the cycles from one known to another until the value is passed; the cycle there."""
    if start._orbit is None:
        raise InternalError("start._orbit is not None")
    if end._orbit is None:
        raise InternalError("end._orbit is not None")
    first = tracer.shooting()
    ends = [first.packed(replace(c._orbit, states=c._orbit.states[:1])) for c in (start, end) if c._orbit is not None]
    here = tracer.resumed(start._orbit, min(1.0, start.amplitude), ends[1] - ends[0])
    curve = here.shooting.curve()
    step = min(LARGEST_STEP, float(np.linalg.norm(ends[1] - ends[0])))
    for _, point in zip(range(MOST_STEPS_BETWEEN), curve.follow(here.point, step, 1e-9, LARGEST_STEP), strict=False):
        now = tracer.known(here.shooting, point)
        if (here.cycle.value - value) * (now.cycle.value - value) <= 0:
            return tracer.between(here, now, value).cycle
        here = now
    raise Failure("not reached")


def _at(rig: Slider, onset: Onset) -> Slider:
    return rig.with_values({onset.along: onset.value})


def _limits(rig: Slider, onset: Onset, between: Sequence[Any] | None) -> tuple[float, float]:
    role = rig.parameters()[onset.along].role
    if between is None:
        if role.domain.low == 0 and onset.value > 0:
            return max(onset.value * 1e-3, role.domain.low), min(onset.value * 1e3, role.domain.high)
        return role.domain.low, role.domain.high
    if len(between) != 2:
        raise ParameterError([Problem("between", f"got {between!r}; allowed: two values, low and high")])
    low, high = (float(checked_array(onset.along, role, x)) for x in between)
    if not low < high:
        raise ParameterError([Problem("between", f"got {between!r}; allowed: low < high")])
    if not low <= onset.value <= high:
        edge = shown(onset.value, onset.unit, 6, rig.area)
        raise ParameterError([Problem("between", f"got {between!r}; it must contain the edge, {edge}")])
    return low, high
