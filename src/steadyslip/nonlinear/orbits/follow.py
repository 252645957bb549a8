"""Follow the branch of cycles from the edge of stability: `cycles`, the entry point of this folder.

Cycles of twice the period are followed from each period doubling to the doubling at which they end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from steadyslip.core.arrays import checked_array
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.format import format_quantity
from steadyslip.core.options import BRANCH, LOW_AND_HIGH, NAME, checked, finite, whole
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.onset.hopf import Onset, hopf
from steadyslip.nonlinear.orbits.branch import CycleBranch
from steadyslip.nonlinear.orbits.branch_piece import BranchPiece
from steadyslip.nonlinear.orbits.cycle import Cycle, End
from steadyslip.nonlinear.orbits.cycle_search import cut_back, met, search_on
from steadyslip.nonlinear.orbits.end_reasons import ENDS
from steadyslip.nonlinear.orbits.parameter_flow import Flow
from steadyslip.nonlinear.orbits.ranges import is_open, is_undecided
from steadyslip.nonlinear.orbits.special import MET, SMALL, log_features
from steadyslip.nonlinear.orbits.tracer import INTERRUPTED, USED_UP, Tracer, orbit_of

SMALLEST = 1e-12  # smallest amplitude of ln v: some thousand roundings of the velocity
FINER, FINEST = 1e-2, 1e-13  # factor on rtol for recomputed cycles, and the smallest rtol above rounding
MOST_REPEATED = 40  # largest number of recomputed cycles: where more fail, the user should ask for a smaller rtol
LARGER = (1e-4, 1e-3, 1e-2, 1e-1)  # amplitudes of ln v of the first cycle, tried if smaller cycles cannot be followed


@checked(
    amplitude=finite(SMALLEST, 0.1, closed=True),
    most_points=whole(1),
    doublings=whole(0, 100),
    between=LOW_AND_HIGH,
    branch=BRANCH,
    along=NAME,
)
def cycles(
    rig: Slider | Machine,
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
    rig : Slider or Machine
    along : str, optional
        Dotted name, or unique last part, of the parameter that is varied; required for a machine with several
        stiffnesses.
    between : (low, high), optional
        Range in which to follow, SI units or text; by default a factor of a thousand to each side of the edge
        for positive parameters, the whole domain for others.
    amplitude : float, optional
        Amplitude of ln(v/v0) of the first cycle; by default 1e-6, with mass 1e-4, and more where no branch from so
        small a cycle can be followed.
    doublings : int, optional
        Number of successive period doublings to follow onto the branch of twice the period.
    most_points : int, optional
        Limit of cycles on a branch. Its integration steps are limited to four million (with structures to as many as
        take some 5 CPU s), those of its cycles of twice the period to as many, shared by the doublings. Cycles found
        until then are kept, and ``end`` gives the reason; ``not_followed`` lists doublings for which no steps were
        left.
    rtol : float, optional
        Relative error allowed per integration step; by default 1e-10, with mass 1e-9, for machines 1e-8.
    branch : int, optional
        Index of the steady sliding, by rising normal stress, where a rig has several.
    progress : callable, optional
        Called with the number of cycles found and the latest one. Ctrl-C, or a KeyboardInterrupt that it raises,
        returns the cycles found so far.

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
    motion; several shooting segments where one period is too unstable. A point is accepted only if it continues the
    curve, and as a primitive cycle, which does not repeat within its period. Where the branch from the edge breaks off
    before it has crossed the unstable range (canards, pieces behind a subcritical onset), motions are simulated there;
    from a cycle that one of them reaches and Newton's method confirms, another piece is followed both ways, and joined
    if it meets the first (`CycleBranch.gaps`). Cycles of twice the period are started at each doubling along the
    eigenvector of the multiplier −1, and followed to the doubling at which they end or until continuation fails.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml", ["radiation_damping=1 GPa s/m"])
    >>> branch = ss.cycles(rig)
    >>> (cycle,) = branch.at(20e9)
    >>> cycle.stable, round(cycle.period, 3)
    (True, 53.02)
    """
    onset = hopf(rig, along, branch=branch)
    flow = Flow(rig.with_values({onset.along: onset.value}), onset.along, branch, rtol, onset.contact)
    tracer = Tracer(flow, onset, _limits(rig, onset, between), most_points, progress)
    pieces = [_from_the_edge(tracer, amplitude)]
    search_on(tracer, pieces)
    return _branch(tracer, pieces, rtol, doublings)


def _branch(tracer: Tracer, pieces: list[BranchPiece], rtol: float | None, doublings: int) -> CycleBranch:
    """Result of `cycles`: pieces of a branch joined, and cycles of twice the period followed from its doublings."""
    left = [(piece.bounds[0], piece.end) for piece in pieces if not piece.followed]
    pieces = [piece for piece in pieces if piece.followed] or pieces[:1]
    whole, gaps, ends = pieces[0], [], [pieces[0].end]
    for piece in pieces[1:]:
        gaps.append(len(whole.points))
        ends.append(piece.end)
        whole = whole.joined(piece)
    doubled = None
    flips = [point.cycle for point in whole.special if point.kind == "period doubling"]
    if flips and doublings > 0 and not tracer.interrupted:
        further = doubled_pieces(tracer, flips)
        if any(piece.points for piece in further) or not tracer.interrupted:
            doubled = _branch(tracer, further, rtol, doublings - 1)
    if tracer.interrupted and doubled is None:
        ends[-1] = INTERRUPTED
    onset, flow = tracer.onset, tracer.flow
    found, repeated = _repeated(tracer, [known.cycle for known in whole.points])
    return CycleBranch(
        onset.rig, onset.along, onset.unit, onset, tuple(found), tuple(whole.special), ends[-1], doubled,
        tuple(gaps), tuple(ends[:-1]), flow.branch, rtol, whole.contact, tuple(piece.bounds for piece in pieces),
        repeated, tuple(left),
    )  # fmt: skip


def _repeated(tracer: Tracer, found: list[Cycle]) -> tuple[list[Cycle], int]:
    """The cycles, and how many of them were replaced: cycles that fail a check are computed again more accurately."""
    failing = [i for i, cycle in enumerate(found) if is_open(cycle) or is_undecided(cycle)][:MOST_REPEATED]
    if not failing or tracer.interrupted:
        return found, 0
    flow, repeated = tracer.flow, 0
    rtol = max(FINER * flow.options.rtol, FINEST)
    try:
        finer = Tracer(
            Flow(flow.rig, flow.name, flow.branch, rtol, tracer.onset.contact), tracer.onset, tracer.limits, tracer.most
        )
        finer.flow.last_step = finer.last_step  # one long cycle may take more steps than the limit of a run
        for i in failing:
            if finer.is_spent:
                break
            with suppress(Failure, np.linalg.LinAlgError):
                again = finer.resumed(orbit_of(found[i]), min(1.0, found[i].amplitude)).cycle
                if max(again.closing, again.multiplier_error) < max(found[i].closing, found[i].multiplier_error):
                    found[i], repeated = again, repeated + 1
    except KeyboardInterrupt:
        tracer.interrupted = True
    return found, repeated


def _from_the_edge(tracer: Tracer, amplitude: float | None) -> BranchPiece:
    """Piece of the branch that begins at the edge of stability.

    Where rounding hides small cycles, as at an almost degenerate onset, it begins with a larger one.
    """
    smallest = max(1e-6, 1e9 * tracer.flow.noise)
    tried: list[BranchPiece] = []
    for size in (smallest, *(size for size in LARGER if size > smallest)) if amplitude is None else (amplitude,):
        tried.append(_of_amplitude(tracer, size))
        known = tried[-1].points
        if tried[-1].whole or tracer.interrupted or (known and known[-1].cycle.amplitude > SMALL):
            break
    return max(tried, key=lambda piece: piece.points[-1].cycle.amplitude if piece.points else 0.0)


def _of_amplitude(tracer: Tracer, amplitude: float) -> BranchPiece:
    """Piece of the branch that begins at the edge, with the cycle of a given small amplitude of ln v."""
    onset = End("onset", tracer.onset.value)
    try:
        shooting, first = tracer.small(amplitude)
    except np.linalg.LinAlgError:
        why = "broke off: no small cycle was found at the edge, where numbers leave floating point"
        return BranchPiece(end=why, begins=onset)
    except Failure as failure:
        return BranchPiece(end=f"broke off: no small cycle was found at the edge ({failure})", begins=onset)
    piece = tracer.followed(shooting, first, amplitude)
    piece.begins = onset
    return piece


def _limits(rig: Slider | Machine, onset: Onset, between: Sequence[Any] | None) -> tuple[float, float]:
    """Lowest and highest parameter value (SI units) of the branch, from `between` (checked) or by default."""
    role = rig.parameters()[onset.along].role
    if between is None:
        if role.domain.low == 0 and onset.value > 0:
            return max(onset.value * 1e-3, role.domain.low), min(onset.value * 1e3, role.domain.high)
        return role.domain.low, role.domain.high
    if len(between) != 2:
        raise ParameterError([Problem("between", f"got {between!r}; allowed: two values, low and high")])
    low, high = (float(checked_array(onset.along, role, rig.read(onset.along, x))) for x in between)
    if not low < high:
        raise ParameterError([Problem("between", f"got {between!r}; allowed: low < high")])
    if not low <= onset.value <= high:
        edge = format_quantity(onset.value, onset.unit, 6, rig.printed_area(onset.along))
        raise ParameterError([Problem("between", f"got {between!r}; it must contain the edge, {edge}")])
    return low, high


SIZES = (1e-3, 1e-4, 1e-5, 1e-2)  # distances (in unknowns) of the first doubled cycle from the doubling, as tried


def doubled_pieces(tracer: Tracer, flips: Sequence[Cycle]) -> list[BranchPiece]:
    """Pieces of cycles of twice the period, one from each doubling in `flips` at which no earlier piece ends.

    The integration steps left are shared equally by the doublings; unused steps go to those that need more. Doublings
    of cycles that are stable on one side come first, as their cycles of twice the period may be stable.
    """
    pieces: list[BranchPiece] = []
    reached: set[int] = set()
    tracer.begin_branch()
    may_attract = [_may_attract(flip) for flip in flips]
    for kind in (True, False):
        group = [i for i in range(len(flips)) if may_attract[i] == kind]
        for i in group:
            if i not in reached:
                tracer.allot(sum(j not in reached for j in group))
                reached.add(i)
                pieces.append(_entered(tracer, pieces, flips[i]))
                _settle(tracer, pieces, len(pieces) - 1, flips, reached)
        _go_on(tracer, pieces, flips, reached)
    return sorted(pieces, key=lambda piece: next(i for i, flip in enumerate(flips) if flip is piece.bounds[0].cycle))


def _may_attract(flip: Cycle) -> bool:
    """True if all multipliers of the cycle `flip`, except that of the doubling, lie inside the unit circle."""
    others = sorted(flip.multipliers, key=lambda one: abs(one + 1))[1:]
    return all(abs(one) < 1 for one in others)


def _go_on(tracer: Tracer, pieces: list[BranchPiece], flips: Sequence[Cycle], reached: set[int]) -> None:
    """Extend the pieces whose integration steps were used up, with equal parts of the steps that are left."""
    while waiting := [piece for piece in pieces if piece.rest is not None]:
        for k, piece in enumerate(waiting):
            if tracer.interrupted or tracer.is_spent:
                return
            if piece in pieces:  # otherwise it was joined to another piece
                tracer.allot(len(waiting) - k)
                others = [one for one in pieces if one is not piece]
                tracer.gone_on(piece, met=partial(met, others))
                _settle(tracer, pieces, pieces.index(piece), flips, reached)


def _settle(tracer: Tracer, pieces: list[BranchPiece], i: int, flips: Sequence[Cycle], reached: set[int]) -> None:
    """End piece `i` at the doubling that it has reached, or join it to the piece that it has met."""
    piece = pieces[i]
    if piece.end == ENDS["doubling"]:
        other = _nearest(flips, piece)
        if other is not None:
            reached.add(other)
            _close(tracer, piece, flips[other])
    if piece.end == "" and piece.whole:
        del pieces[i]
        _join(pieces, piece)


def _entered(tracer: Tracer, pieces: list[BranchPiece], flip: Cycle) -> BranchPiece:
    """Piece of cycles of twice the period from one doubling, to its end or to a known piece."""
    begins, why = End("period doubling", flip.value, flip), ""
    for size in SIZES:
        if tracer.interrupted or tracer.is_spent:
            return BranchPiece(end=INTERRUPTED if tracer.interrupted else USED_UP, begins=begins, followed=False)
        try:
            first = tracer.doubled(flip, size)
        except (Failure, np.linalg.LinAlgError) as failure:
            why = str(failure)
        except KeyboardInterrupt:
            tracer.interrupted = True
        else:
            piece = tracer.followed(first.shooting, first, size, twice=True, met=partial(met, pieces))
            piece.begins = begins
            return piece
    why = f"no cycle of twice the period was found beside it ({why})"
    return BranchPiece(end=INTERRUPTED if tracer.interrupted else why, begins=begins, followed=False)


def _nearest(flips: Sequence[Cycle], piece: BranchPiece) -> int | None:
    """Index of the doubling at which a piece ends, where its period is halved; None if none is near."""
    pair = [piece.points[-1], *([] if piece.beyond is None else [piece.beyond])]
    seen = np.array([log_features(known.cycle) - [np.log(2), 0, 0] for known in pair])
    reach = MET + float(np.ptp(seen, axis=0).max()) + 2 * max(float(np.abs(known.half).max()) for known in pair)
    away = [float(np.abs(seen - log_features(flip)).max(axis=1).min()) for flip in flips]
    best = int(np.argmin(away))
    return best if away[best] < reach else None


def _close(tracer: Tracer, piece: BranchPiece, flip: Cycle) -> None:
    """End a piece at a doubling: append a cycle near it, at a distance of `SIZES`.

    Two cycles lie near the doubling, which differ by half a period; the cycle in phase with the last cycle is taken.
    """
    piece.stops = End("period doubling", flip.value, flip)
    last = piece.points[-1]
    for size in SIZES:
        try:
            sides = [tracer.doubled(flip, way * size) for way in (1.0, -1.0)]
        except (Failure, np.linalg.LinAlgError):
            continue
        first = [float(last.half @ known.half) for known in sides]
        if last.cycle.value != sides[0].cycle.value:
            piece.points.append(sides[int(np.argmax(first))])
        return


def _join(pieces: list[BranchPiece], piece: BranchPiece) -> None:
    """Join a piece between two doublings to the piece in `pieces` that it has met."""
    meeting = piece.beyond or piece.points[-1]
    i = next(i for i, one in enumerate(pieces) if met([one], meeting))
    cut_back(pieces[i], meeting.cycle)
    pieces[i] = pieces[i].joined(piece.reversed())
    pieces[i].end = ENDS["doubling"]
