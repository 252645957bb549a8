"""Base class of protocol pieces, and the Protocol made of them."""

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
"""Number of channels of every run: load point, first disturbance, first normal stress."""


def channel_of(kind: int, number: int, disturbances: int) -> int:
    """Index of the channel of a disturbance or normal stress, which are numbered 0, 1, ... in a run.

    Number 0 has the channel of its kind. Further disturbances have the channels from `CHANNELS` on, and further normal
    stresses the channels after these.

    Parameters
    ----------
    kind : int
        `DISTURBANCE` or `NORMAL_STRESS`.
    number : int
    disturbances : int
        Number of disturbances in the run.
    """
    if number == 0:
        return kind
    return CHANNELS + number - 1 + (max(disturbances - 1, 0) if kind == NORMAL_STRESS else 0)


class Piece(FrozenRecord, family="protocol piece"):
    """Base of protocol pieces: each acts on one channel.

    A subclass is registered under a name, sets the kind of `channel` it acts on (load-point velocity, disturbance
    stress or normal stress; a run has one disturbance channel for each body and one normal-stress channel for each
    contact acted on), and overrides one of the methods `curve`, `wave` and `jump`. Fields may be floats or 1-D arrays
    with one value per lane.
    """

    chosen_by: ClassVar[tuple[str, str | None]] = ("kind", None)
    channel: ClassVar[int] = LOAD_POINT
    frees_load_point: ClassVar[bool] = False
    """True if the piece imposes the force of the drive in place of its motion (creep)."""
    lets_go: ClassVar[bool] = False
    """True if the drive is released for the duration of the piece only, and moves before and after it."""

    def curve(self, before: Any) -> Curve | None:
        """Piecewise-linear part of the piece; None if it has none.

        For the load point this is the velocity, which is `before` (m/s) until the piece begins. For other channels
        it is added to the channel, and `before` is ignored.
        """
        return None

    def wave(self) -> Wave | None:
        """Sine wave added to the channel; None if there is none."""
        return None

    def jump(self) -> Jump | None:
        """Sudden displacement of the load point; None if there is none."""
        return None

    def __add__(self, other: Piece | Protocol) -> Protocol:
        return _joined(self, other)


class Protocol(FrozenRecord):
    """Loading history of an experiment: pieces and end time.

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
        """Convert None, a piece, a sequence of pieces or a Protocol to a Protocol.

        Raises
        ------
        ParameterError
            If `given` has another type, or pieces overlap.
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
        """True if the force of the drive is imposed in place of its motion during the whole run (creep)."""
        return any(piece.frees_load_point for piece in self.pieces) and not self.lets_go

    @property
    def lets_go(self) -> bool:
        """True if the drive is released during a part of the run."""
        return any(piece.lets_go for piece in self.pieces)

    def varied(self, changes: Mapping[str, Any]) -> Protocol:
        """Copy of the protocol with arrays in place of some of its numbers, for many lanes at once.

        Parameters
        ----------
        changes : mapping of str to array_like
            Arrays of values (SI units) by dotted name, such as ``protocol.pieces.1.to``.

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
        """Yield Problems with pieces that set the velocity and overlap or are not in order of time."""
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
                    f"{earlier} ends at {format_quantity(last_end, 's')}; give the pieces that set the "
                    "velocity in the order of time, without overlap",
                )
            earlier, last_end = f"piece {number} ({piece.name or type(piece).__name__})", max(end, last_end)


_NOTHING = Protocol()


def _joined(first: Piece | Protocol, second: Piece | Protocol) -> Protocol:
    """Protocol with the pieces of both arguments and the later end; NotImplemented for other types."""
    if not isinstance(second, (Piece, Protocol)):
        return NotImplemented
    one, two = Protocol.of(first), Protocol.of(second)
    ends = [end for end in (one.until, two.until) if end is not None]
    return Protocol(pieces=one.pieces + two.pieces, until=max(ends, default=None))
