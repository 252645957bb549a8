"""What is watched in a motion. An event is declared here, once: for lanes and single runs, for log and tally.

An event is a change of sign of a function of what can be observed. The step of every kernel compares the function at
both ends; the driver finds the moment on the dense output, and logs it. Extremes of velocity and the begin of slip,
which are frequent, are found in all lanes at once where there is no log (`steadyslip.kernels.watch`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from steadyslip.kernels.layout import Row
from steadyslip.kernels.nodes import larger

FASTER = 1.000001  # than the load point, beyond rounding: slipping
ROUNDED = 64 * 2.0**-52
"""Rounding of a sum of stresses as a share of aσ, by which friction answers velocity; stresses are dozens of it."""


class Observed(Protocol):
    """What events are functions of, at some moment: numbers of a program, in SI units."""

    @property
    def v(self) -> Any:
        """Velocity of the block."""

    @property
    def acceleration(self) -> Any:
        """Its acceleration."""

    @property
    def sigma(self) -> Any:
        """Normal stress."""

    @property
    def tau(self) -> Any:
        """Shear stress of the contact."""

    @property
    def T(self) -> Any:  # noqa: N802 -- the theory's letter
        """Stress of the spring."""

    @property
    def v_lp(self) -> Any:
        """Velocity of the load point."""

    @property
    def v_low(self) -> Any:
        """Velocity below which the block counts as arrested."""

    @property
    def sigma_low(self) -> Any:
        """Normal stress below which contact is lost."""

    @property
    def h(self) -> Any:
        """Length of the step, s."""

    @property
    def error(self) -> Any:
        """Error of the velocity that the integration allows in a step, m/s."""

    @property
    def rounding(self) -> Any:
        """Size up to which the acceleration may be rounding, m/s²."""


@dataclass(frozen=True)
class Watched:
    """A function whose changes of sign are events.

    Attributes
    ----------
    name : str
    function : callable
        Of what is `Observed`.
    falls, rises : str
        What it is called when the function becomes negative, or positive; empty if nobody wants to know.
    falls_counted, rises_counted : str
        Column of an ensemble's tally that counts it; empty for none.
    uncertain : callable, optional
        Size up to which its sign says nothing: what the integration does not tell from zero, or rounding. A sign counts
        from the first step on at whose end the function is larger, and until it is as clearly another.
    """

    name: str
    function: Callable[[Observed], Any]
    falls: str = ""
    rises: str = ""
    falls_counted: str = ""
    rises_counted: str = ""
    uncertain: Callable[[Observed], Any] | None = None


def faster(at: Observed) -> Any:
    """The velocity above which the block slips."""
    return larger(FASTER * at.v_lp, at.v_low)


EVENTS = (
    Watched("slip", lambda at: at.v - faster(at), falls="slip ends", rises="slip begins",
            uncertain=lambda at: at.error),
    Watched("turn", lambda at: at.acceleration, falls="velocity peak", rises="velocity trough",
            falls_counted="velocity_peaks", uncertain=lambda at: at.error / at.h + at.rounding),
    Watched("contact", lambda at: at.sigma - at.sigma_low, falls="contact lost"),
    Watched("motion", lambda at: abs(at.v) - at.v_low, falls="arrest", rises="restart", falls_counted="arrests",
            uncertain=lambda at: at.error),
)  # fmt: skip
"""All events; the driver knows the first three by their place (`steadyslip.kernels.layout.Kind`)."""
LOG_KINDS = ("", *(word for event in EVENTS for word in (event.falls, event.rises)), "blow-up")
"""What the kinds of a log are called: 2 e + 1 where event number e falls, 2 e + 2 where it rises."""
COUNTED = tuple(word for event in EVENTS for word in (event.falls_counted, event.rises_counted))
"""Columns of the tally behind those of `Row`, by kind; an empty name is not shown."""
TALLY = (*(row.name.lower() for row in Row if Row.EVENTS <= row <= Row.PEAK_GROWTH), *COUNTED)
"""Columns of the tally of events, a result."""
