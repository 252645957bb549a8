"""Fields of controllers other than gains: dead time; to hold a place: limits, dead band, sampling, encoder (theory 14).

At a velocity other than 0 a controller follows a ramp and is linear, so that the fields for holding are refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from steadyslip.core.domains import nonnegative, positive, speed
from steadyslip.core.errors import Problem
from steadyslip.core.records import FrozenRecord, option, parameter
from steadyslip.core.roles import Parameter
from steadyslip.machine.mechanism import Limits

AS_MEASURED = ("drive.dead_band", "drive.resolution")
"""Parameters of a controller in the unit (m or rad) of the measured body, which may differ from that of the driven."""


def as_measured(role: Parameter, turns: bool) -> Parameter:
    """Role of a parameter in `AS_MEASURED`, with the unit for a measured body that turns (rad) or slides (m)."""
    unit = "rad" if turns else "m"
    return role if role.unit == unit else replace(role, unit=unit, instance="")


def dead_time() -> Any:
    """Declare the dead time (s) of a controller."""
    doc = "dead time between measuring and acting"
    return parameter("s", nonnegative, doc, default=0.0, structural=True, kind="delay", letter="t_d", instance="2 ms")


def limit(unit: str) -> Any:
    """Declare the largest force of a controller, in an SI unit; its integral continues to grow at the limit."""
    return parameter(
        unit, positive, "at velocity 0: largest force of the controller; its integral winds up", default=None
    )


def windup(unit: str) -> Any:
    """Declare the largest force of a controller's integral term, in an SI unit."""
    return parameter(unit, positive, "at velocity 0: largest force of the integral term, clamped there", default=None)


def band(unit: str) -> Any:
    """Declare the dead band of a controller, in an SI unit."""
    doc = "at velocity 0: error of the measured body up to which there is none; beyond it, counted from its end"
    return parameter(unit, positive, doc, default=None)


def encoder(unit: str) -> Any:
    """Declare the step of a controller's encoder, in an SI unit."""
    doc = "at velocity 0: step of the encoder of the measured body, to which its place is rounded; needs a sample_time"
    return parameter(unit, positive, doc, default=None, instance="0.1 arcsec" if unit == "rad" else "0.1 um")


class Holding(FrozenRecord):
    """Base of controllers, which hold a place at velocity 0.

    With `sample_time`, derivatives are differences of samples.
    """

    velocity: float = parameter("m/s", speed, "velocity v0 in steady sliding; 0 to hold a place", letter="v_0")
    derivative: str = option(
        "error", "measurement", doc="at velocity 0: of what the derivative is taken", default="error"
    )
    force_limit: float | None = limit("N")
    integral_limit: float | None = windup("N")
    dead_band: float | None = band("m")
    dead_band_of: str = option(
        "error",
        "integral",
        doc="whether the dead band acts on the error of all terms or of the integral",
        default="error",
    )
    sample_time: float | None = parameter(
        "s",
        positive,
        "at velocity 0: time between samples, the force being constant between; without it none",
        default=None,
        instance="1 ms",
    )
    resolution: float | None = encoder("m")

    def inconsistencies(self) -> Iterator[Problem]:
        yield from super().inconsistencies()
        own = ("force_limit", "integral_limit", "dead_band", "sample_time", "resolution")
        if self.velocity != 0:
            named = [key for key in own if getattr(self, key) is not None]
            named += ["derivative"] * (self.derivative != "error") + ["dead_band_of"] * (self.dead_band_of != "error")
            for key in named:
                yield Problem(key, "is only for a controller that holds a place; leave it out, or write velocity = 0")
        if self.resolution is not None and self.sample_time is None:
            yield Problem("sample_time", "missing; an encoder with a resolution is read once every sample time")
        if self.dead_band_of != "error" and self.dead_band is None:
            yield Problem("dead_band", "missing; give it, or leave out dead_band_of, which has no effect without it")

    def limits(self) -> Limits:
        return Limits(
            on_measurement=self.derivative == "measurement",
            force=self.force_limit,
            integral=self.integral_limit,
            dead_band=self.dead_band,
            of_integral=self.dead_band_of == "integral",
            sample_time=self.sample_time,
            resolution=self.resolution,
        )
