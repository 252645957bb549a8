"""Creep as a part of a run: for how long a drive is let go, and with which force it pulls then."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, ClassVar, Protocol

import numpy as np

from steadyslip.core.errors import Problem
from steadyslip.protocol.curves import Array, Curve, Jump, Wave, column

LOADING, FREE, SWITCH = 1, 3, 4
"""Channels of a run in which a drive is let go, the first disturbances: the force of the drive, whether it is free, and
at the start of a segment where that changes, 1 if its force goes on, 2 if it is told."""
ROUNDING = 1e-12  # relative; ends and starts closer than this are meant to be the same time


class PieceLike(Protocol):
    """What pieces of a protocol say of themselves here; see `steadyslip.protocol.Piece`."""

    name: ClassVar[str]
    channel: ClassVar[int]
    frees_load_point: ClassVar[bool]
    lets_go: ClassVar[bool]

    def curve(self, before: Any) -> Curve | None: ...
    def wave(self) -> Wave | None: ...
    def jump(self) -> Jump | None: ...


@dataclass(frozen=True)
class Release:
    """A time in which a drive pulls with a force of its own.

    Attributes
    ----------
    begin, end : ndarray (lanes or 1, 1)
        s.
    to : ndarray (lanes or 1, 1) or None
        The force, Pa or as the rig has it; None for that with which it is let go.
    changes : tuple of Curve
        What is added to it.
    """

    begin: Array
    end: Array
    to: Array | None
    changes: tuple[Curve, ...] = ()

    def holds(self, time: Array) -> bool:
        """Whether it goes on at a time, in every lane."""
        return bool(np.all((self.begin <= time) & (time < self.end)))

    def breakpoints(self) -> Iterator[Array]:
        """Times at which something begins or ends."""
        yield from (self.begin, self.end, *(curve.times for curve in self.changes))

    def numbers(self) -> Iterator[Array]:
        """What may differ between lanes beside times."""
        yield from (part for curve in self.changes for part in (curve.left, curve.right))
        if self.to is not None:
            yield self.to

    def tell(self, start: Array, value: Array, slope: Array) -> None:
        """Write the channels on segments that begin at `start`, (lanes or 1, n); of earlier spans before later ones."""
        within = (self.begin <= start) & (start < self.end)
        value[:, :, FREE] += within
        value[:, :, SWITCH][np.broadcast_to(start == self.end, value.shape[:2])] = 1.0
        begins = np.broadcast_to(start == self.begin, value.shape[:2])
        first = np.where(start > 0, 1.0, 0.0) if self.to is None else np.full(start.shape, 2.0)
        value[:, :, SWITCH][begins] = np.broadcast_to(first, value.shape[:2])[begins]
        if self.to is not None:
            value[:, :, LOADING] += within * self.to
        for curve in self.changes:
            level, rate = curve.on(start)
            value[:, :, LOADING] += within * level
            slope[:, :, LOADING] += within * rate


def spans_of(pieces: Sequence[PieceLike], drive: Sequence[Curve]) -> tuple[list[Release], list[Problem]]:
    """When a drive is let go, in the order of time, and what pieces do then that they cannot.

    Parameters
    ----------
    pieces : sequence of Piece
        Their numbers may be arrays with one value for each lane.
    drive : sequence of Curve
        Of the pieces that set the velocity, those that let the drive go among them.
    """
    spans = _spans(pieces, drive)
    added: list[list[Curve]] = [[] for _ in spans]
    problems = []
    for number, piece in enumerate(pieces, start=1):
        where = f"pieces.{number}"
        if piece.frees_load_point and not piece.lets_go and (curve := piece.curve(None)) is not None:
            own = next((k for k, span in enumerate(spans) if span.holds(curve.times[:, :1])), None)
            if own is not None:
                added[own].append(curve)
                continue
            message = f"{piece.name} begins where nothing creeps; give it a time while the drive is let go (creep)"
            problems.append(Problem(where, message))
        elif piece.channel == 0 and _moves_within(piece, spans):
            message = f"{piece.name} moves the load point while creep leaves it to the force of the drive"
            problems.append(Problem(where, f"{message}; allowed: before or after it"))
    return [Release(one.begin, one.end, one.to, tuple(own)) for one, own in zip(spans, added, strict=True)], problems


def _spans(pieces: Sequence[PieceLike], drive: Sequence[Curve]) -> list[Release]:
    found, place = [], count()
    for piece in pieces:
        if piece.channel != 0 or piece.curve(0.0) is None:
            continue
        k = next(place)
        if not piece.lets_go:
            continue
        times = drive[k].times
        later = drive[k + 1].times[:, :1] if k + 1 < len(drive) else np.full((1, 1), np.inf)
        end = later
        if times.shape[1] > 1:
            own = times[:, 1:]  # the next piece begins no earlier, whatever rounding says of their sum
            end = np.where(np.abs(later - own) <= ROUNDING * np.abs(own), np.maximum(later, own), own)
        told = getattr(piece, "to", None)
        found.append(Release(times[:, :1], end, None if told is None else column(told)))
    return found


def _moves_within(piece: PieceLike, spans: Sequence[Release]) -> bool:
    """Whether a wave or a jump of the load point meets a time in which it is free, in any lane."""
    wave, jump = piece.wave(), piece.jump()
    if wave is not None:
        return any(bool(np.any((wave.start < span.end) & (span.begin < wave.stop))) for span in spans)
    return jump is not None and any(bool(np.any((span.begin <= jump.time) & (jump.time < span.end))) for span in spans)
