"""Drives of machines: a load point at constant velocity, or a position controller; sliding or rotating.

A controller measures the position of a body, converted to the driven body by the ratio of their steady speeds, and
acts on the driven body with F = Fss − (gain) (position ahead of the reference v0 t) − (gain) (speed above v0)
− (gain) ∫ (position ahead). The measured and the driven body may differ (non-collocated control).
"""

from __future__ import annotations

from typing import Any, ClassVar

from steadyslip.core.domains import moving, nonnegative, positive, speed, turning
from steadyslip.core.entries import Text
from steadyslip.core.errors import Problem
from steadyslip.core.records import FrozenRecord, parameter, setting
from steadyslip.machine.holding import Holding, band, dead_time, encoder, limit, windup
from steadyslip.machine.mechanism import Limits


class MachineDrive(FrozenRecord, family="drive of a machine"):
    """Base of drives of machines; `velocity` is that of the driven body, or of the load point, ``drive`` in links.

    If `velocity_of` names another body, the given velocity is that of this body, such as the feed of a table; the
    constructor of the machine converts it.
    """

    chosen_by: ClassVar[tuple[str, str | None]] = ("control", "steady")
    turns: ClassVar[bool] = False

    velocity: float = parameter("m/s", moving, "velocity v0 in steady sliding", letter="v_0")
    velocity_of: str | None = setting(
        Text("the body whose velocity is given, in m/s or rad/s; that on which the drive acts unless given"),
        default=None,
    )

    def driven(self) -> str | None:
        """Body on which a controller acts; None for a load point."""
        return None

    def watched(self) -> tuple[str, str]:
        """Names of the body whose position and of the body whose speed a controller measures."""
        raise NotImplementedError

    def lateness(self) -> Any:
        """Dead time (s) between measuring and acting."""
        return 0

    def gains(self) -> tuple[Any, Any, Any, Any]:
        """Four gains: on position of the first `watched` body, on speed and position of the second, on the integral.

        The integral is that of the first body's position error; its gain is None without integral action.
        """
        return 0, 0, 0, None

    def limits(self) -> Limits | None:
        """Limits, dead band and sampling of a controller; None for a load point."""
        return None


class Pull(MachineDrive, name="steady"):
    """A load point that moves along the slide at constant velocity; links tie bodies to it as ``drive``."""


class RotaryPull(MachineDrive, name="rotary-steady"):
    """A shaft end that turns at constant speed; links tie bodies to it as ``drive``."""

    turns: ClassVar[bool] = True
    velocity: float = parameter("rad/s", turning, "speed of the load point in steady sliding", letter="v_0")


class _Controller(Holding, MachineDrive):
    """Base of controllers that act on a body; `delay` is the dead time (s) between measuring and acting."""

    body: str = setting(Text("the body on which it acts"))
    measured: str | None = setting(
        Text("the body whose place it measures; that on which it acts unless given"), default=None
    )
    delay: float = dead_time()

    def lateness(self) -> Any:
        return self.delay

    def driven(self) -> str | None:
        return self.body

    def watched(self) -> tuple[str, str]:
        return self.measured or self.body, self.measured or self.body


class PositionPD(_Controller, name="pd"):
    """A position controller with proportional and derivative gain."""

    kp: float = parameter("N/m", positive, "proportional gain", kind="stiffness", letter="k_p")
    kd: float = parameter("N s/m", nonnegative, "derivative gain", default=0.0, structural=True, letter="k_d")

    def gains(self) -> tuple[Any, Any, Any, Any]:
        return self.kp, self.kd, 0, None


class PositionPID(PositionPD, name="pid"):
    """A position controller with proportional, integral and derivative gain."""

    ki: float = parameter("N/(m s)", positive, "integral gain", letter="k_i")

    def gains(self) -> tuple[Any, Any, Any, Any]:
        return self.kp, self.kd, 0, self.ki


class Cascade(_Controller, name="p-pi"):
    """Cascade of a position loop and a speed loop (P-PI): F = Kp [e + ∫e dt / Tn], e = Kv x_e + v_e.

    x_e is the position error of the body `measured` (a scale at the table); v_e is the speed error of the driven body
    (the encoder of the motor), or of `speed_measured` if given.
    """

    speed_measured: str | None = setting(
        Text("the body whose speed it measures; that on which it acts unless given"), default=None
    )
    kv: float = parameter("1/s", positive, "gain Kv of the position loop", letter="K_v")
    kp: float = parameter("N s/m", positive, "gain Kp of the speed loop", letter="K_p")
    tn: float = parameter("s", positive, "reset time Tn of the speed loop", letter="T_n", instance="20 ms")

    def watched(self) -> tuple[str, str]:
        return self.measured or self.body, self.speed_measured or self.body

    def gains(self) -> tuple[Any, Any, Any, Any]:
        return self.kp * self.kv, self.kp, self.kp / self.tn, self.kp * self.kv / self.tn


class _Rotary(_Controller):
    """Base of controllers that act on a body that rotates."""

    turns: ClassVar[bool] = True
    velocity: float = parameter("rad/s", speed, "speed of the body in steady sliding; 0 to hold a place", letter="v_0")
    force_limit: float | None = limit("N m")
    integral_limit: float | None = windup("N m")
    dead_band: float | None = band("rad")
    resolution: float | None = encoder("rad")


class RotaryPD(_Rotary, PositionPD, name="rotary-pd"):
    """`PositionPD` for a body that rotates."""

    kp: float = parameter("N m/rad", positive, "proportional gain", kind="stiffness", letter="k_p")
    kd: float = parameter("N m s/rad", nonnegative, "derivative gain", default=0.0, structural=True, letter="k_d")


class RotaryPID(_Rotary, PositionPID, name="rotary-pid"):
    """`PositionPID` for a body that rotates."""

    kp: float = parameter("N m/rad", positive, "proportional gain", kind="stiffness", letter="k_p")
    kd: float = parameter("N m s/rad", nonnegative, "derivative gain", default=0.0, structural=True, letter="k_d")
    ki: float = parameter("N m/(rad s)", positive, "integral gain", letter="k_i")


class RotaryCascade(_Rotary, Cascade, name="rotary-p-pi"):
    """`Cascade` for a body that rotates."""

    kp: float = parameter("N m s/rad", positive, "gain Kp of the speed loop", letter="K_p")


def control_for(control: str, turns: bool) -> str:
    """Name of a drive's counterpart for a body that turns (``rotary-pd`` for ``pd``), or for a body that slides."""
    return f"rotary-{control.removeprefix('rotary-')}" if turns else control.removeprefix("rotary-")


def kind_of_control(control: str) -> str:
    """Usual name of a kind of controller: "PID" for ``rotary-pid``."""
    return control_for(control, turns=False).upper()


def wrong_control(control: str, body: str, turns: bool) -> Problem:
    """Problem for a rotary drive on a body that slides, or the reverse; the message has the right `control`."""
    does = "turns" if turns else "slides"
    return Problem("drive.control", f"got {control!r}, but {body!r} {does}; write {control_for(control, turns)!r}")
