"""Creep during a part of a run: time spans in which the drive is released and pulls with an imposed force."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, ClassVar, Protocol

import numpy as np

from steadyslip.core.errors import Problem
from steadyslip.protocol.curves import Array, Curve, Jump, Wave, column

LOADING, FREE, SWITCH = 1, 3, 4
"""Disturbance channels of a run with a released drive. `LOADING`: force of the drive (Pa, N or N m); `FREE`: 1 while
it is released; `SWITCH`, where a release begins: 1 to keep the drive's present force, 2 to take the imposed one."""
ROUNDING = 1e-12  # two times count as equal if their relative difference is smaller: some thousand rounding errors


class PieceLike(Protocol):
    """Interface of `steadyslip.protocol.Piece`, which cannot be imported here because its module imports this one."""

    name: ClassVar[str]
    channel: ClassVar[int]
    frees_load_point: ClassVar[bool]
    lets_go: ClassVar[bool]

    def curve(self, before: Any) -> Curve | None: ...
    def wave(self) -> Wave | None: ...
    def jump(self) -> Jump | None: ...


@dataclass(frozen=True)
class Release:
    """A time span in which the drive is released and pulls with an imposed force.

    Attributes
    ----------
    begin, end : ndarray (lanes or 1, 1)
        Begin and end of the span, s.
    to : ndarray (lanes or 1, 1) or None
        Imposed force (Pa, for machines N or N m); None to keep the force at release.
    changes : tuple of Curve
        Changes that are added to the force.
    """

    begin: Array
    end: Array
    to: Array | None
    changes: tuple[Curve, ...] = ()

    def holds(self, time: Array) -> bool:
        """True if the span contains a time (s) in every lane."""
        return bool(np.all((self.begin <= time) & (time < self.end)))

    def breakpoints(self) -> Iterator[Array]:
        """Yield the times (s) at which the span begins or ends or its force changes."""
        yield from (self.begin, self.end, *(curve.times for curve in self.changes))

    def numbers(self) -> Iterator[Array]:
        """Yield the force values, which may differ between lanes."""
        yield from (part for curve in self.changes for part in (curve.left, curve.right))
        if self.to is not None:
            yield self.to

    def add_to(self, start: Array, value: Array, slope: Array) -> None:
        """Add the span's channels to `value` and `slope` (lanes, n, channels) of segments with `start` (lanes or 1, n).

        Earlier spans must be added first: where one ends and the next begins, the later one sets `SWITCH`.
        """
        within = (self.begin <= start) & (start < self.end)
        value[:, :, FREE] += within
        value[:, :, SWITCH][np.broadcast_to(start == self.end, value.shape[:2])] = 1.0
        begins = np.broadcast_to(start == self.begin, value.shape[:2])
        first = np.where(start > 0, 1.0, 0.0) if self.to is None else np.full(start.shape, 2.0)
        value[:, :, SWITCH][begins] = np.broadcast_to(first, value.shape[:2])[begins]
        if self.to is not None:
            value[:, :, LOADING] += within * self.to
        for curve in self.changes:
            level, rate = curve.value_and_slope(start)
            value[:, :, LOADING] += within * level
            slope[:, :, LOADING] += within * rate


def spans_of(pieces: Sequence[PieceLike], drive: Sequence[Curve]) -> tuple[list[Release], list[Problem]]:
    """Spans in which the drive is released, in order of time, and Problems with pieces that conflict with them.

    Parameters
    ----------
    pieces : sequence of Piece
        Pieces of the protocol; numbers may be arrays with one value for each lane.
    drive : sequence of Curve
        Velocity curves of the pieces that set the velocity, including those that release the drive.
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
        elif piece.channel == 0 and _overlaps(piece, spans):
            message = f"{piece.name} moves the load point while creep leaves it to the force of the drive"
            problems.append(Problem(where, f"{message}; allowed: before or after it"))
    return [Release(one.begin, one.end, one.to, tuple(own)) for one, own in zip(spans, added, strict=True)], problems


def _spans(pieces: Sequence[PieceLike], drive: Sequence[Curve]) -> list[Release]:
    """Spans in which the drive is released, in order of time, without changes of the force."""
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
            own = times[:, 1:]  # rounding may make at + duration exceed the start of the next piece
            end = np.where(np.abs(later - own) <= ROUNDING * np.abs(own), np.maximum(later, own), own)
        force = getattr(piece, "to", None)
        found.append(Release(times[:, :1], end, None if force is None else column(force)))
    return found


def _overlaps(piece: PieceLike, spans: Sequence[Release]) -> bool:
    """True if a wave or jump of the load point overlaps a span with a released drive, in any lane."""
    wave, jump = piece.wave(), piece.jump()
    if wave is not None:
        return any(bool(np.any((wave.start < span.end) & (span.begin < wave.stop))) for span in spans)
    return jump is not None and any(bool(np.any((span.begin <= jump.time) & (jump.time < span.end))) for span in spans)
