"""The base of the pieces of an experiment, and the protocol that they make up."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.arrays import check_together, checked_array
from steadyslip.core.domains import positive
from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.core.format import format_quantity
from steadyslip.core.records import FrozenRecord, parameter, parameters, parts, with_values
from steadyslip.protocol.creep import ROUNDING, spans_of
from steadyslip.protocol.curves import Curve, Jump, Wave

LOAD_POINT, DISTURBANCE, NORMAL_STRESS = range(3)
CHANNELS = 3
"""That are always there: load point, first disturbance, first normal stress."""


def channel_of(kind: int, number: int, disturbances: int) -> int:
    """Which channel is disturbance or normal stress number 0, 1, ... of a run: further ones follow the first of each.

    Parameters
    ----------
    kind : int
        `DISTURBANCE` or `NORMAL_STRESS`.
    number : int
    disturbances : int
        How many there are in the run.
    """
    if number == 0:
        return kind
    return CHANNELS + number - 1 + (max(disturbances - 1, 0) if kind == NORMAL_STRESS else 0)


class Piece(FrozenRecord, family="protocol piece"):
    """Base of the pieces of a protocol: something that happens to one channel at some time.

    A subclass is registered under a name, says which kind of `channel` it acts on (load-point velocity,
    disturbance stress or normal stress; a run has one of the latter two for whatever is acted on), and
    returns what it consists of from one of the methods. Fields may be plain numbers or 1-D arrays with one
    value for each lane.
    """

    chosen_by: ClassVar[tuple[str, str | None]] = ("kind", None)
    channel: ClassVar[int] = LOAD_POINT
    frees_load_point: ClassVar[bool] = False
    """Whether it tells a force of the drive's own, by which this pulls however the load point moves."""
    lets_go: ClassVar[bool] = False
    """Whether the drive does that for the time of the piece, and moves before and after it."""

    def curve(self, before: Any) -> Curve | None:
        """The part that is linear between knots.

        For the load point this is the velocity itself, which is `before` (m/s) until then. For the other
        channels it is what the piece adds, and `before` has no meaning.
        """
        return None

    def wave(self) -> Wave | None:
        """The sine wave that the piece adds to its channel."""
        return None

    def jump(self) -> Jump | None:
        """A sudden displacement of the load point."""
        return None

    def __add__(self, other: Piece | Protocol) -> Protocol:
        return _joined(self, other)


class Protocol(FrozenRecord):
    """What is done to a rig in an experiment: its pieces, and when it ends.

    Pieces that set the load-point velocity (steps, ramps, holds, a measured table) are given in the order of
    time and do not overlap; all others add up in any order. ``a + b`` of pieces or protocols joins them, and the
    later end of the two is kept.

    Examples
    --------
    >>> from steadyslip.protocol import Hold, Protocol, VelocityStep
    >>> Hold(at=10.0, duration=100.0) + VelocityStep(at=200.0, to="2 um/s")
    Protocol(pieces=(Hold(at=10.0, duration=100.0), VelocityStep(at=200.0, to=2e-06)))
    """

    until: float | None = parameter("s", positive, "end of the experiment", default=None)
    pieces: tuple[Piece, ...] = parts(Piece, "what happens, one table each", default=())

    @classmethod
    def of(cls, given: Any) -> Protocol:
        """A protocol from what a caller may give: None, a piece, a sequence of pieces or a protocol.

        Raises
        ------
        ParameterError
            If `given` is none of these, or pieces overlap.
        """
        if given is None:
            return _NOTHING
        if isinstance(given, Protocol):
            return given
        if isinstance(given, Piece):
            return cls(pieces=(given,))
        if isinstance(given, (list, tuple)):
            return cls(pieces=tuple(given))
        message = f"got {given!r}; allowed: None, a piece such as VelocityStep(at=10, to=2e-6), a list or a Protocol"
        raise ParameterError([Problem("protocol", message)])

    @property
    def frees_load_point(self) -> bool:
        """Whether the force of the drive is imposed in place of its motion throughout: creep."""
        return any(piece.frees_load_point for piece in self.pieces) and not self.lets_go

    @property
    def lets_go(self) -> bool:
        """Whether the drive is let go for some time: creep as a part of a run."""
        return any(piece.lets_go for piece in self.pieces)

    def varied(self, changes: Mapping[str, Any]) -> Protocol:
        """The protocol with arrays in place of some of its numbers, for many lanes at once.

        Parameters
        ----------
        changes : mapping of str to array_like
            By dotted name such as ``protocol.pieces.1.to``, in SI units.

        Raises
        ------
        ParameterError
            If names are unknown or values are not allowed, by themselves or together.
        """
        if not changes:
            return self
        known = parameters(self, "protocol.")
        problems, found = [], {}
        for name, value in changes.items():
            if name not in known:
                problems.append(Problem(name, unknown_name("parameter", name, known)))
                continue
            try:
                found[name] = checked_array(name, known[name].role, value)
            except ParameterError as error:
                problems += error.problems
        if problems:
            raise ParameterError(problems)
        check_together(self, "protocol.", found)
        return with_values(self, found, "protocol.")

    def __add__(self, other: Piece | Protocol) -> Protocol:
        return _joined(self, other)

    def inconsistencies(self) -> Iterator[Problem]:
        yield from self._order()
        if self.lets_go:
            own = (piece.curve(0.0) for piece in self.pieces if piece.channel == LOAD_POINT)
            yield from spans_of(self.pieces, [curve for curve in own if curve is not None])[1]

    def _order(self) -> Iterator[Problem]:
        """Pieces that set the velocity must follow each other."""
        earlier, last_end = "", -np.inf
        for number, piece in enumerate(self.pieces, start=1):
            curve = piece.curve(0.0) if piece.channel == LOAD_POINT else None
            if curve is None:
                continue
            start, end = float(curve.times[0, 0]), float(curve.times[0, -1])
            if start < last_end - ROUNDING * abs(last_end):
                yield Problem(
                    f"pieces.{number}",
                    f"{piece.name or type(piece).__name__} starts at {format_quantity(start, 's')}, before "
                    f"{earlier} ends at "
                    f"{format_quantity(last_end, 's')}; give the pieces that set the velocity in the order of time, "
                    "without overlap",
                )
            earlier, last_end = f"piece {number} ({piece.name or type(piece).__name__})", max(end, last_end)


_NOTHING = Protocol()


def _joined(first: Piece | Protocol, second: Piece | Protocol) -> Protocol:
    if not isinstance(second, (Piece, Protocol)):
        return NotImplemented
    one, two = Protocol.of(first), Protocol.of(second)
    ends = [end for end in (one.until, two.until) if end is not None]
    return Protocol(pieces=one.pieces + two.pieces, until=max(ends, default=None))
