"""Protocol pieces that move the load point; before the first one its velocity is that of the rig's drive."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.conditions import Condition
from steadyslip.core.domains import count, nonnegative, positive, real
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import parameter, samples
from steadyslip.protocol.curves import Array, Curve, Jump, column, join_columns, knots
from steadyslip.protocol.protocol import Piece
from steadyslip.protocol.shapes import FORCES, Harmonic, table_problems


class VelocityStep(Piece, name="velocity-step"):
    """The load-point velocity changes at once and stays so."""

    at: float = parameter("s", nonnegative, "time of the step")
    to: float = parameter("m/s", real, "velocity from then on", elsewhere=("rad/s",))

    def curve(self, before: Any) -> Curve:
        return knots((self.at, before, self.to))


class VelocityRamp(Piece, name="velocity-ramp"):
    """The load-point velocity changes at a constant rate from its present value to another, and stays so."""

    at: float = parameter("s", nonnegative, "start of the ramp")
    to: float = parameter("m/s", real, "velocity at its end", elsewhere=("rad/s",))
    duration: float = parameter("s", positive, "duration of the ramp")

    def curve(self, before: Any) -> Curve:
        return knots((self.at, before, before), (self.at + self.duration, self.to, self.to))


class Hold(Piece, name="hold"):
    """The load point rests for some time, then goes on with its former velocity."""

    at: float = parameter("s", nonnegative, "start of the hold")
    duration: float = parameter("s", positive, "duration of the hold")

    def curve(self, before: Any) -> Curve:
        return knots((self.at, before, 0), (self.at + self.duration, 0, before))


class SlideHoldSlide(Piece, name="slide-hold-slide"):
    """Several holds, each longer than the one before by a factor, with sliding at the former velocity between them."""

    at: float = parameter("s", nonnegative, "start of the first hold")
    hold: float = parameter("s", positive, "duration of the first hold")
    factor: float = parameter("1", positive, "each hold is longer than the one before by this factor", default=1.0)
    slide: float = parameter("s", positive, "time of sliding between holds")
    repeats: float = parameter("1", count, "number of holds")

    def conditions(self) -> Iterator[Condition]:
        message = "got {}; the holds grow out of the range of floating point"
        if np.all(np.asarray(self.repeats) >= 1):
            yield Condition("factor", np.isfinite(self._times()[:, -1]), message, (self.factor,))

    def curve(self, before: Any) -> Curve:
        times = self._times()
        holds = times.shape[1] // 2
        sliding = join_columns([column(before), np.zeros((1, 1))])
        return Curve(times, np.tile(sliding, holds), np.tile(sliding[:, ::-1], holds))

    def _times(self) -> Array:
        """Start and end of the holds in turn (s), (lanes, 2 holds)."""
        holds = np.unique(np.asarray(self.repeats, dtype=int))
        if holds.size != 1:
            raise ParameterError([Problem("repeats", "differs between lanes; all need the same number of holds")])
        with np.errstate(over="ignore"):
            length = column(self.hold) * column(self.factor) ** np.arange(holds[0])
            later = np.cumsum((length + column(self.slide))[:, :-1], axis=1)
            starts = column(self.at) + np.insert(later, 0, 0.0, axis=1)
            times: Array = np.stack([starts, starts + length], axis=-1).reshape(len(starts), -1)
        return times


class Creep(Piece, name="creep"):
    """The drive is let go for some time and pulls with a stress of its own, whatever the block does.

    That is its pull at that moment, or what it is told, and as much more as steps, ramps and tables of creep say that
    begin in this time. Then it goes on with its former velocity from where it carries the same stress.
    """

    frees_load_point: ClassVar[bool] = True
    lets_go: ClassVar[bool] = True

    at: float = parameter("s", nonnegative, "time at which the drive is let go")
    duration: float | None = parameter(
        "s", positive, "duration; without it until the next piece that sets the velocity, or to the end", default=None
    )
    to: float | None = parameter(
        "Pa", real, "stress with which it pulls; without it as at that moment", default=None, elsewhere=FORCES
    )

    def curve(self, before: Any) -> Curve:
        if self.duration is None:
            return knots((self.at, before, before))
        return knots((self.at, before, before), (self.at + self.duration, before, before))


class DisplacementStep(Piece, name="displacement-step"):
    """The load point jumps forward (or back) without time passing; its velocity goes on as before."""

    at: float = parameter("s", nonnegative, "time of the jump")
    by: float = parameter("m", real, "displacement", elsewhere=("rad",))

    def jump(self) -> Jump:
        return Jump(column(self.at), column(self.by))


class VelocityHarmonic(Harmonic, name="velocity-harmonic"):
    """The load-point velocity oscillates: amplitude · sin(2π (t − at)/period + phase) is added to it."""

    amplitude: float = parameter("m/s", real, "amplitude of the velocity", elsewhere=("rad/s",))


class LoadPointTable(Piece, name="load-point-table"):
    """A measured motion of the load point: the displacement is linear between samples.

    So the velocity is constant between samples; displacements count from the first one. Before the first
    sample the load point goes on with its former velocity, after the last one with that of the last interval.
    """

    time: tuple[float, ...] = samples("s", "times of the samples, ascending")
    displacement: tuple[float, ...] = samples("m", "displacement of the load point at these times")

    def inconsistencies(self) -> Iterator[Problem]:
        yield from table_problems(self.time, "displacement", self.displacement)

    def curve(self, before: Any) -> Curve:
        velocity = np.diff([self.displacement]) / np.diff([self.time])
        left = join_columns([column(before), velocity])
        return Curve(np.array([self.time]), left, np.append(velocity, velocity[:, -1:], axis=1))
