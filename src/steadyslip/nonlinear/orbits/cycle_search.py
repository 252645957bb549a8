"""Find pieces of the branch that cannot be reached from the edge, by simulation, and join pieces that meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from steadyslip.nonlinear.continuation import Failure, turned_round
from steadyslip.nonlinear.orbits.branch_piece import BranchPiece
from steadyslip.nonlinear.orbits.cycle import Cycle, End
from steadyslip.nonlinear.orbits.cycle_from_motion import cycle_near
from steadyslip.nonlinear.orbits.special import BranchPoint, lies_between
from steadyslip.nonlinear.orbits.tracer import LARGEST_STEP, USED_UP, Tracer, orbit_of

SEEDS = (0.003, 0.03, 0.2, 0.6)  # parameter values of simulations: shares of the way from the break to the range's end
AHEAD = 2.0  # initial displacement of a motion that starts near steady sliding, in natural sizes of slip
PATIENCE = 12  # number of stretches (see `cycle_from_motion`) within which a motion has to reach a cycle


def search_on(tracer: Tracer, pieces: list[BranchPiece]) -> None:
    """Append pieces found by simulation, until the last one crosses the unstable range of steady sliding."""
    low, high = tracer.limits
    onset = tracer.onset
    limit = low if onset.stable == "above" else high
    if not np.isfinite(limit):
        limit = onset.value + np.sign(limit) * max(1.0, abs(onset.value))
    for share in SEEDS:
        last = pieces[-1]
        if tracer.interrupted or _crossed(last, tracer):
            return
        if tracer.is_spent:
            pieces.append(BranchPiece(end=USED_UP, begins=last.bounds[1], followed=False))
            return
        here = last.points[-1].cycle if last.points else None
        start = onset.value
        if here is not None and (here.value - onset.value) * (limit - onset.value) > 0:
            start = here.value
        value = start * (limit / start) ** share if start * limit > 0 else start + share * (limit - start)
        try:
            seed = seed_at(tracer, value, [] if here is None else [here])
        except KeyboardInterrupt:
            tracer.interrupted = True
            return
        if seed is not None and not met(pieces, seed):
            _add_piece(tracer, pieces, seed, np.sign(limit - onset.value))


def _crossed(piece: BranchPiece, tracer: Tracer) -> bool:
    """True if a piece ends for a physical reason; the limit of the range counts only on the unstable side."""
    if not piece.whole or not piece.points:
        return False
    if not piece.end.startswith("end of the range"):
        return True
    return (piece.points[-1].cycle.value < tracer.onset.value) == (tracer.onset.stable == "above")


def seed_at(tracer: Tracer, value: float, near: Sequence[Cycle]) -> BranchPoint | None:
    """First cycle reached by motions from known cycles `near` and from near steady sliding; None if there is none."""
    try:
        starts = [orbit_of(cycle).states[0] for cycle in near] + [tracer.flow.ahead(value, AHEAD)]
    except Failure:
        return None
    for state in starts:
        found = cycle_near(tracer.flow, state, value, PATIENCE)
        if found is not None:
            try:
                return tracer.resumed(orbit_of(found), 1.0)
            except (Failure, np.linalg.LinAlgError):
                continue
    return None


def _add_piece(tracer: Tracer, pieces: list[BranchPiece], seed: BranchPoint, away: float) -> None:
    """Follow the branch from a cycle both ways; join the new piece to a known piece that it meets, or append it."""
    forth = seed if seed.point.tangent[-1] * away > 0 else replace(seed, point=turned_round(seed.point))
    back = replace(forth, point=turned_round(forth.point))
    step = 0.1 * LARGEST_STEP
    behind = tracer.followed(back.shooting, back, step, met=lambda known: met(pieces, known))
    ahead = BranchPiece()
    if not tracer.interrupted:
        ahead = tracer.followed(forth.shooting, forth, step)
    both = behind.reversed()
    both.points.pop()  # the seed, with which `ahead` begins
    both = both.joined(ahead) if ahead.points else behind.reversed()
    near = behind.points[-1].cycle
    if behind.end == "" and behind.whole:  # `behind` has met a known piece
        cut_back(pieces[-1], near)
        pieces[-1] = pieces[-1].joined(both)
    elif behind.end.startswith("back") and abs(near.value / tracer.onset.value - 1) < 1e-3 and near.amplitude < 0.5:
        both.begins = End("onset", tracer.onset.value)
        pieces[-1] = both
    else:
        pieces.append(both)


def met(pieces: list[BranchPiece], known: BranchPoint) -> bool:
    """True if a cycle lies between two neighbours of a known piece."""
    return any(lies_between(a.cycle, b.cycle, known.cycle) for piece in pieces for a, b in pairwise(piece.points))


def cut_back(piece: BranchPiece, meeting: Cycle) -> None:
    """Remove the cycles of a piece beyond the neighbours of `meeting`, the cycle at which another piece met it."""
    for i in range(len(piece.points) - 1):
        if lies_between(piece.points[i].cycle, piece.points[i + 1].cycle, meeting):
            del piece.points[i + 1 :]
            piece.special = [point for point in piece.special if point.index <= i]
            return
