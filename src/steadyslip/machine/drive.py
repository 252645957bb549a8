"""Drives of sliders: a load point at constant velocity, or a position controller that follows a ramp.

The spring stress on the block is T = Tss − k x − c (v − v_lp) − (controller), with x the slip of the block ahead of
the load point. A controller that holds the block to the reference v0 t sees the position error −x, so its
proportional gain acts as a stiffness and its derivative gain as a dashpot (theory 4).
"""

from __future__ import annotations

from typing import Any, ClassVar

from steadyslip.core.domains import moving, nonnegative, speed
from steadyslip.core.records import FrozenRecord, parameter
from steadyslip.machine.holding import Holding, dead_time, limit, windup
from steadyslip.machine.mechanism import Limits


class Drive(FrozenRecord, family="drive", kw_only=False):
    """Base of drives of sliders: steady velocity, and controller gains that are zero unless overridden."""

    chosen_by: ClassVar[tuple[str, str | None]] = ("control", "steady")
    turns: ClassVar[bool] = False
    """True for a drive that rotates; only machines have one."""

    velocity: float = parameter("m/s", moving, "velocity of the load point in steady sliding", letter="v_0")

    def proportional(self) -> Any:
        """Stiffness added by the controller (Pa/m)."""
        return 0

    def dashpot(self) -> Any:
        """Damping added by the controller (Pa s/m)."""
        return 0

    def integral(self) -> Any:
        """Integral gain (Pa/(m s)): stress per time integral of the slip x; None without integral action."""
        return None

    def lateness(self) -> Any:
        """Dead time (s) between measuring and acting."""
        return 0

    def limits(self) -> Limits | None:
        """Limits, dead band and sampling of a controller; None for a load point."""
        return None


class SteadyDrive(Drive, name="steady", kw_only=False):
    """A load point pulled at constant velocity."""


class PD(Holding, Drive, name="pd", kw_only=False):
    """A position controller with proportional and derivative gain, following the ramp v0 t."""

    velocity: float = parameter(
        "m/s", speed, "velocity of the load point in steady sliding; 0 to hold a place", letter="v_0"
    )
    force_limit: float | None = limit("Pa")
    integral_limit: float | None = windup("Pa")
    kp: float = parameter(
        "Pa/m", nonnegative, "proportional gain", default=0.0, structural=True, kind="stiffness", letter="k_p"
    )
    kd: float = parameter("Pa s/m", nonnegative, "derivative gain", default=0.0, structural=True, letter="k_d")
    delay: float = dead_time()

    def proportional(self) -> Any:
        return self.kp

    def dashpot(self) -> Any:
        return self.kd

    def lateness(self) -> Any:
        return self.delay


class PID(PD, name="pid", kw_only=False):
    """A position controller with proportional, integral and derivative gain, following the ramp v0 t."""

    ki: float = parameter(
        "Pa/m/s", nonnegative, "integral gain", default=0.0, structural=True, adds_state=True, letter="k_i"
    )

    def integral(self) -> Any:
        return None if self.ki == 0 else self.ki
