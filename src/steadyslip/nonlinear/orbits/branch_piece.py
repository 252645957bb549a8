"""Piece of a branch of cycles: cycles in the order in which they were followed, and how they end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from steadyslip.nonlinear.orbits.cycle import End, SpecialCycle
from steadyslip.nonlinear.orbits.special import BranchPoint


@dataclass(eq=False)
class BranchPiece:
    """Cycles in the order in which they were followed, and the bifurcations among them.

    `end` is the reason for which the piece ends; `whole` is True for a physical reason, False if continuation failed.
    `contact` names the contact of a machine that lifts off at the end, or is the fastest. `begins` and `stops` are the
    ends, if these are not the first and last cycle; `beyond` is the next cycle past the end, not part of the piece.
    If the integration steps allowed for the piece were used up, `rest` yields the cycles that follow and `steps` is the
    number of steps taken. `followed` is False for an end from which no cycle was followed, for the reason `end`.
    """

    points: list[BranchPoint] = field(default_factory=list)
    special: list[SpecialCycle] = field(default_factory=list)
    end: str = ""
    whole: bool = False
    contact: str = ""
    begins: End | None = None
    stops: End | None = None
    beyond: BranchPoint | None = None
    rest: Iterator[tuple[BranchPoint, BranchPoint]] | None = None
    twice: bool = False
    steps: int = 0
    followed: bool = True

    @property
    def bounds(self) -> tuple[End, End]:
        """The two ends of the piece: where it begins, and where it stops."""
        ends = []
        for end, i in ((self.begins, 0), (self.stops, -1)):
            if end is None and self.points:
                end = End("last cycle", self.points[i].cycle.value, self.points[i].cycle)
            ends.append(end or self.begins or End("last cycle", np.nan))
        return ends[0], ends[1]

    def reversed(self) -> BranchPiece:
        """Copy of the piece with its cycles in reverse order."""
        count = len(self.points)
        special = [replace(one, index=count - one.index) for one in reversed(self.special)]
        return BranchPiece(self.points[::-1], special, self.end, self.whole, self.contact, self.stops, self.begins)

    def joined(self, more: BranchPiece) -> BranchPiece:
        """Piece with the cycles of this piece followed by those of `more`, which begins where this piece ends."""
        count = len(self.points)
        special = [replace(one, index=one.index + count) for one in more.special]
        return BranchPiece(
            self.points + more.points,
            self.special + special,
            more.end,
            more.whole,
            more.contact,
            self.begins,
            more.stops,
        )
