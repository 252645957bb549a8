"""Protocol pieces: motions of the load point, and stresses on block, contact, drive and pores.

Before the first piece that sets it, the velocity of the load point is that of the rig's drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.domains import Condition, count, nonnegative, positive, real
from steadyslip.core.entries import Text
from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.records import parameter, samples, setting
from steadyslip.protocol.curves import Array, Curve, Jump, Wave, column, join_columns, knots
from steadyslip.protocol.protocol import DISTURBANCE, NORMAL_STRESS, Piece

FORCES = ("N", "N m")
"""Units in which the stresses of pieces are given for machines and for rigs with an area."""


class StressStep(Piece):
    """The stress changes suddenly, then remains constant."""

    at: float = parameter("s", nonnegative, "time of the step")
    by: float = parameter("Pa", real, "change of the stress", elsewhere=FORCES)

    def curve(self, before: Any) -> Curve:
        return knots((self.at, 0, self.by))


class StressPulse(Piece):
    """The stress changes at once, and back after some time."""

    at: float = parameter("s", nonnegative, "start of the pulse")
    by: float = parameter("Pa", real, "change of the stress", elsewhere=FORCES)
    duration: float = parameter("s", positive, "duration of the pulse")

    def curve(self, before: Any) -> Curve:
        return knots((self.at, 0, self.by), (self.at + self.duration, self.by, 0))


class StressRamp(Piece):
    """The stress changes at a constant rate for some time, then remains constant."""

    at: float = parameter("s", nonnegative, "start of the ramp")
    by: float = parameter("Pa", real, "change of the stress in all", elsewhere=FORCES)
    duration: float = parameter("s", positive, "duration of the ramp")

    def curve(self, before: Any) -> Curve:
        return knots((self.at, 0, 0), (self.at + self.duration, self.by, self.by))


class Harmonic(Piece):
    """A sine wave: amplitude · sin(2π (t − at)/period + phase) is added between `at` and `until`."""

    amplitude: float = parameter("Pa", real, "amplitude of the stress", elsewhere=FORCES)
    period: float = parameter("s", positive, "period")
    at: float = parameter("s", nonnegative, "start", default=0.0)
    until: float | None = parameter("s", positive, "end; without it the wave goes on", default=None)
    phase: float = parameter("rad", real, "phase at the start", default=0.0)

    def conditions(self) -> Iterator[Condition]:
        if self.until is not None:
            message = "got {}; allowed: a time after the start at = {} s"
            yield Condition("until", self.until > self.at, message, (self.until, self.at))
        with np.errstate(over="ignore"):
            finite = np.isfinite(2 * math.pi / np.asarray(self.period))
        yield Condition("period", finite, "got {}; it is too short for floating point", (self.period,))

    def wave(self) -> Wave:
        return Wave(
            column(self.at),
            column(math.inf if self.until is None else self.until),
            column(self.amplitude),
            2 * math.pi / column(self.period),
            column(self.phase),
        )


class StressTable(Piece):
    """A measured change of the stress: linear between samples, constant before the first and after the last."""

    time: tuple[float, ...] = samples("s", "times of the samples, ascending")
    change: tuple[float, ...] = samples("Pa", "change of the stress at these times")

    def inconsistencies(self) -> Iterator[Problem]:
        yield from table_problems(self.time, "change", self.change)

    def curve(self, before: Any) -> Curve:
        change = np.array([self.change])
        return Curve(np.array([self.time]), change, change)


def table_problems(time: Sequence[float], name: str, values: Sequence[float]) -> Iterator[Problem]:
    """Yield Problems with a table: lengths, order of times, or changes too fast for floating point."""
    if len(time) < 2:
        yield Problem("time", f"got {len(time)} samples; allowed: two or more")
    if len(values) != len(time):
        yield Problem(name, f"got {len(values)} samples, but time has {len(time)}; give as many of both")
        return
    gaps = np.diff(time)
    if np.any(gaps <= 0):
        place = int(np.argmax(gaps <= 0)) + 2
        message = f"value {place}: got {time[place - 1]!r} after {time[place - 2]!r}; allowed: times that increase"
        yield Problem("time", message)
        return
    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.isfinite(np.diff(values) / gaps)
    if not np.all(finite):
        place = int(np.argmin(finite)) + 2
        yield Problem(name, f"value {place}: got {values[place - 1]!r}; the change is too fast for floating point")


class VelocityStep(Piece, name="velocity-step"):
    """The load-point velocity changes suddenly, then remains constant."""

    at: float = parameter("s", nonnegative, "time of the step")
    to: float = parameter("m/s", real, "velocity from then on", elsewhere=("rad/s",))

    def curve(self, before: Any) -> Curve:
        return knots((self.at, before, self.to))


class VelocityRamp(Piece, name="velocity-ramp"):
    """The load-point velocity changes at a constant rate from its present value to another, then remains constant."""

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
        """Times (s) at which the holds start and end, in order of time, (lanes, 2 per hold)."""
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
    """The drive is released for some time and pulls with a given stress, whatever the motion of the block.

    The stress is that at release, or `to`, plus the steps, ramps and tables of creep that begin during the release.
    Afterwards the drive goes on with its former velocity, from the position at which it carries this stress.
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

    Velocity is constant between samples; displacements count from the first one. Before the first sample the load
    point goes on with its former velocity, after the last one with that of the last interval.
    """

    time: tuple[float, ...] = samples("s", "times of the samples, ascending")
    displacement: tuple[float, ...] = samples("m", "displacement of the load point at these times")

    def inconsistencies(self) -> Iterator[Problem]:
        yield from table_problems(self.time, "displacement", self.displacement)

    def curve(self, before: Any) -> Curve:
        velocity = np.diff([self.displacement]) / np.diff([self.time])
        left = join_columns([column(before), velocity])
        return Curve(np.array([self.time]), left, np.append(velocity, velocity[:, -1:], axis=1))


class OnNormalStress(Piece):
    """Base of pieces that add to the normal stress of the contact law, or the normal force of a machine's contact."""

    channel: ClassVar[int] = NORMAL_STRESS

    on: str | None = setting(Text("the contact, of a machine that has several"), default=None)


class OnBlock(Piece):
    """Base of pieces with a disturbance stress q that pushes the block, or a force or torque on a machine's body."""

    channel: ClassVar[int] = DISTURBANCE

    on: str | None = setting(Text("the body, of a machine that has several"), default=None)


class OnPores(Piece):
    """Base of pieces that change the pressure around a contact with pore fluid (theory 4), such as injection."""

    channel: ClassVar[int] = NORMAL_STRESS

    on: str | None = setting(Text("the contact, of a machine that has several"), default=None)


class OnDrive(Piece):
    """Base of creep pieces: the stress of the drive is imposed, and its motion is free.

    If another piece (creep) releases the drive, the piece adds to the stress at release and ends with the release.
    Otherwise it adds to the stress in steady sliding, and the drive is free during the whole run.
    """

    channel: ClassVar[int] = DISTURBANCE
    frees_load_point: ClassVar[bool] = True


class CreepStep(StressStep, OnDrive, name="creep-step"):
    """The drive pulls with a constant stress, which changes suddenly to a new value."""


class CreepRamp(StressRamp, OnDrive, name="creep-ramp"):
    """The drive pulls with a stress that grows at a constant rate for some time, then remains constant."""


class CreepTable(StressTable, OnDrive, name="creep-table"):
    """The drive pulls with a measured stress: linear between samples, constant before the first and after the last."""


class InjectionStep(StressStep, OnPores, name="injection-step"):
    """The pressure around a contact with pore fluid changes suddenly, then remains constant."""


class InjectionPulse(StressPulse, OnPores, name="injection-pulse"):
    """The pressure around a contact with pore fluid changes at once, and back after some time."""


class InjectionRamp(StressRamp, OnPores, name="injection-ramp"):
    """The pressure around a contact with pore fluid changes at a constant rate for some time, then remains constant."""


class InjectionHarmonic(Harmonic, OnPores, name="injection-harmonic"):
    """The pressure around a contact with pore fluid oscillates."""


class InjectionTable(StressTable, OnPores, name="injection-table"):
    """A measured pressure around a contact with pore fluid: linear between samples, constant before and after."""


class NormalStressStep(StressStep, OnNormalStress, name="normal-stress-step"):
    """The normal stress changes suddenly, then remains constant."""


class NormalStressPulse(StressPulse, OnNormalStress, name="normal-stress-pulse"):
    """The normal stress changes at once, and back after some time."""


class NormalStressRamp(StressRamp, OnNormalStress, name="normal-stress-ramp"):
    """The normal stress changes at a constant rate for some time, then remains constant."""


class NormalStressHarmonic(Harmonic, OnNormalStress, name="normal-stress-harmonic"):
    """The normal stress oscillates: amplitude · sin(2π (t − at)/period + phase) is added between `at` and `until`."""


class NormalStressTable(StressTable, OnNormalStress, name="normal-stress-table"):
    """A measured change of the normal stress: linear between samples, constant before the first and after the last."""


class DisturbanceStep(StressStep, OnBlock, name="disturbance-step"):
    """A stress begins to push the block."""


class DisturbancePulse(StressPulse, OnBlock, name="disturbance-pulse"):
    """A stress pushes the block for some time."""


class DisturbanceRamp(StressRamp, OnBlock, name="disturbance-ramp"):
    """A stress that pushes the block grows at a constant rate for some time, then remains constant."""


class DisturbanceHarmonic(Harmonic, OnBlock, name="disturbance-harmonic"):
    """An oscillating stress on the block: amplitude · sin(2π (t − at)/period + phase) between `at` and `until`."""


class DisturbanceTable(StressTable, OnBlock, name="disturbance-table"):
    """A measured stress on the block: linear between samples, constant before the first and after the last."""
