"""Base classes of stress pieces by shape in time, for any channel: step, pulse, ramp, wave and table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from steadyslip.core.conditions import Condition
from steadyslip.core.domains import nonnegative, positive, real
from steadyslip.core.errors import Problem
from steadyslip.core.records import parameter, samples
from steadyslip.protocol.curves import Curve, Wave, column, knots
from steadyslip.protocol.protocol import Piece

FORCES = ("N", "N m")
"""Units in which rigs with an area and machines give stresses."""


class StressStep(Piece):
    """The stress changes at once and stays so."""

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
    """The stress changes at a constant rate for some time and stays so."""

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
