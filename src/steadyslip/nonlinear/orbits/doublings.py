"""Follow the branches of twice the period, from each period doubling to the one where they end."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits.cycle import Cycle, End
from steadyslip.nonlinear.orbits.end_reasons import ENDS
from steadyslip.nonlinear.orbits.search import cut_back, met
from steadyslip.nonlinear.orbits.special import MET, log_features
from steadyslip.nonlinear.orbits.tracer import INTERRUPTED, USED_UP, BranchPiece, Tracer

SIZES = (1e-3, 1e-4, 1e-5, 1e-2)  # distances of the first cycle from the doubling, in unknowns, tried in this order


def doubled_pieces(tracer: Tracer, flips: Sequence[Cycle]) -> list[BranchPiece]:
    """Follow the cycles of twice the period from each doubling at which no earlier piece has ended.

    Each doubling may take an equal part of the work that is left, and what others leave goes to those that need more:
    first to the doublings of cycles that attract on one side, where those of twice the period may attract too.
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
    """True if no multiplier but that of the doubling is outside the unit circle."""
    others = sorted(flip.multipliers, key=lambda one: abs(one + 1))[1:]
    return all(abs(one) < 1 for one in others)


def _go_on(tracer: Tracer, pieces: list[BranchPiece], flips: Sequence[Cycle], reached: set[int]) -> None:
    """Go on with the pieces whose part of the work was used up, with equal parts of what the others have left."""
    while waiting := [piece for piece in pieces if piece.rest is not None]:
        for k, piece in enumerate(waiting):
            if tracer.interrupted or tracer.is_spent:
                return
            if piece in pieces:  # else another one has met it
                tracer.allot(len(waiting) - k)
                others = [one for one in pieces if one is not piece]
                tracer.gone_on(piece, met=partial(met, others))
                _settle(tracer, pieces, pieces.index(piece), flips, reached)


def _settle(tracer: Tracer, pieces: list[BranchPiece], i: int, flips: Sequence[Cycle], reached: set[int]) -> None:
    """End a piece at the doubling that it has reached, or join it to the one that it has met."""
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
    """Follow the piece from one doubling, as far as possible or to a known piece."""
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
    """Append a cycle next to the doubling at which a piece ends, as near to it as the first cycle is to its own.

    The cycle there begins in the half of the period in which the one before it does.
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
    """Join a piece to the one that it has met."""
    meeting = piece.beyond or piece.points[-1]
    i = next(i for i, one in enumerate(pieces) if met([one], meeting))
    cut_back(pieces[i], meeting.cycle)
    pieces[i] = pieces[i].joined(piece.reversed())
    pieces[i].end = ENDS["doubling"]
