"""Follow the branches of twice the period, from each period doubling to the one where they end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits.cycle import Cycle, End
from steadyslip.nonlinear.orbits.end_reasons import ENDS
from steadyslip.nonlinear.orbits.search import cut_back, met
from steadyslip.nonlinear.orbits.special import MET, log_features
from steadyslip.nonlinear.orbits.tracer import BranchPiece, Tracer

SIZES = (1e-3, 1e-2, 1e-4, 1e-1)  # distances of the first cycle from the doubling, in unknowns, tried in this order


def doubled_pieces(tracer: Tracer, flips: Sequence[Cycle]) -> list[BranchPiece]:
    """Follow the cycles of twice the period from each doubling at which no earlier piece has ended."""
    pieces: list[BranchPiece] = []
    reached: set[int] = set()
    since = tracer.flow.steps
    for i, flip in enumerate(flips):
        if i in reached or tracer.interrupted:
            continue
        tracer.allot(since, 1.0 if i == len(flips) - 1 else 1.0 - 0.5 ** (i + 1))  # half of what is left
        piece = _entered(tracer, pieces, flip)
        reached.add(i)
        if piece.end == ENDS["doubling"]:
            other = _nearest(flips, piece)
            if other is not None:
                reached.add(other)
                _close(tracer, piece, flips[other])
        if piece.end == "" and piece.whole:
            _join(pieces, piece)
        else:
            pieces.append(piece)
    return pieces


def _entered(tracer: Tracer, pieces: list[BranchPiece], flip: Cycle) -> BranchPiece:
    """Follow the piece from one doubling, as far as possible or to a known piece."""
    begins, why = End("period doubling", flip.value, flip), ""
    for size in SIZES:
        try:
            first = tracer.doubled(flip, size)
        except (Failure, np.linalg.LinAlgError) as failure:
            why = str(failure)
            continue
        except KeyboardInterrupt:
            tracer.interrupted = True
            break
        piece = tracer.followed(first.shooting, first, size, twice=True, met=lambda known: met(pieces, known))
        piece.begins = begins
        return piece
    return BranchPiece(
        end=f"broke off: no cycle of twice the period was found beside the doubling ({why})", begins=begins
    )


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
