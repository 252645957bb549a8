"""Events of a motion, declared once for single runs and ensembles, log and statistics.

An event is a sign change of a function of the observables. The step of each kernel compares the function's values at
both ends; the driver finds the time by dense output and logs the event. Without a log, frequent events (extremes of
velocity, begin of slip) are found in all lanes at once (`steadyslip.kernels.watch`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from steadyslip.kernels.layout import Out, Row
from steadyslip.kernels.nodes import larger

# a contact slips if its speed exceeds that of the load point by this factor (rounding at equal speeds)
FASTER = 1.000001
ROUNDED = 64 * 2.0**-52
"""Relative rounding error of the velocity: the rounding error of a sum of stresses (dozens of aσ) over aσ, which is the
change of stress per unit of ln v."""


@dataclass(frozen=True)
class Observed:
    """Arguments of event functions at one moment and contact: nodes of a program, SI units.

    Attributes
    ----------
    contact : int
    v, acceleration, sigma : Node
        Velocity of the block or slip rate of the contact, its rate of change, and normal stress.
    v_lp : Node
        Velocity of the load point.
    v_low, sigma_low : Node
        Velocity (m/s) below which the block counts as arrested; normal stress (Pa) below which contact is lost.
    h : Node
        Length of the step, s.
    outputs : callable
        Function without arguments that computes all outputs of the contact.
    error : Node
        Error of the velocity that the integration allows in a step, m/s.
    rounding : Node
        Possible rounding error of the acceleration, m/s².
    """

    contact: int
    v: Any
    acceleration: Any
    sigma: Any
    v_lp: Any
    v_low: Any
    sigma_low: Any
    h: Any
    outputs: Callable[[], Sequence[Any]]
    error: Any = 0.0
    rounding: Any = 0.0

    @property
    def tau(self) -> Any:
        """Shear stress of the contact, Pa."""
        return self.outputs()[Out.TAU]

    @property
    def T(self) -> Any:  # noqa: N802 -- the theory's letter
        """Stress of the spring, Pa."""
        return self.outputs()[Out.T]


@dataclass(frozen=True)
class Watched:
    """Function whose sign changes are events.

    Attributes
    ----------
    name : str
    function : callable
        Function of an `Observed` that returns a number, as a Node.
    falls, rises : str
        Name of the event when the function becomes negative, or positive; empty if it is not logged.
    falls_counted, rises_counted : str
        Column of an ensemble's statistics that counts the event; empty for none.
    uncertain : callable, optional
        Function of an `Observed` that returns the size up to which the sign is unknown, because of integration error or
        rounding. The sign changes only at the end of a step where the function is larger than that.
    """

    name: str
    function: Callable[[Observed], Any]
    falls: str = ""
    rises: str = ""
    falls_counted: str = ""
    rises_counted: str = ""
    uncertain: Callable[[Observed], Any] | None = None


def faster(at: Observed) -> Any:
    """Speed (m/s) above which a contact counts as slipping, forward or backward."""
    return larger(FASTER * abs(at.v_lp), at.v_low)


EVENTS = (
    Watched("slip", lambda at: at.v - faster(at), falls="slip ends", rises="slip begins",
            uncertain=lambda at: at.error),
    Watched("turn", lambda at: at.acceleration, falls="velocity peak", rises="velocity trough",
            falls_counted="velocity_peaks", uncertain=lambda at: at.error / at.h + at.rounding),
    Watched("contact", lambda at: at.sigma - at.sigma_low, falls="contact lost"),
    Watched("backward", lambda at: -at.v - faster(at), falls="backward slip ends", rises="backward slip begins",
            uncertain=lambda at: at.error),
    Watched("motion", lambda at: abs(at.v) - at.v_low, falls="arrest", rises="restart", falls_counted="arrests",
            uncertain=lambda at: at.error),
)  # fmt: skip
"""All events; the driver treats the first four specially (`steadyslip.kernels.layout.EventPlace`)."""
LOG_KINDS = ("", *(word for event in EVENTS for word in (event.falls, event.rises)), "blow-up")
"""Names of the kinds of log rows by number: 2 e + 1 where event function e falls, 2 e + 2 where it rises."""
COUNTED = tuple(word for event in EVENTS for word in (event.falls_counted, event.rises_counted))
"""Names of the event counts, by kind, that follow the statistics of `Row`; unnamed counts are not reported."""
RING = "ring"
"""Name of ringing: forward slip that follows a slip event and does not count as one; in a log its number is 0."""
TALLY = (*(row.name.lower() for row in Row if Row.EVENTS <= row <= Row.PEAK_GROWTH), *COUNTED)
"""Columns of the event statistics in results."""
