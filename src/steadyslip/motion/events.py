"""What happened in a run: moments, and the slip events that they delimit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.pages import Displayed
from steadyslip.kernels.runner import LOG_KINDS


@dataclass(frozen=True)
class Event(Displayed):
    """A moment of a run.

    Attributes
    ----------
    kind : str
        ``slip begins`` and ``slip ends`` (of a `SlipEvent`), ``velocity peak``, ``velocity trough``, ``arrest``,
        ``restart``, ``contact lost`` or ``blow-up``.
    time : float
        s, located on the dense output.
    velocity : float
        m/s.
    normal_stress, shear_stress, spring_stress : float
        Pa.
    slip : float
        Distance slipped since the start of the run, m.
    """

    kind: str
    time: float
    velocity: float
    normal_stress: float
    shear_stress: float
    spring_stress: float
    slip: float


@dataclass(frozen=True)
class SlipEvent(Displayed):
    """Slip ahead of the load point, so that the spring unloads, at twice its velocity or more.

    The block is faster than the load point (and not arrested) throughout, and at the peak at least twice as fast
    as the load point is then, or as the rig's drive while the load point rests, and as itself at the beginning.
    It begins where the block passes the load point, or, where it had not slowed down to it, where it was slowest.

    Attributes
    ----------
    begin, end, duration : float
        s.
    slip : float
        m.
    stress_drop : float
        Fall of the spring stress, Pa.
    peak_velocity, peak_time : float
        m/s and s.
    recurrence : float
        Time since the event before began, s; NaN for the first, and after one that was going on at the start.
    """

    begin: float
    end: float
    duration: float
    slip: float
    stress_drop: float
    peak_velocity: float
    peak_time: float
    recurrence: float


def events_of(log: np.ndarray) -> tuple[Event, ...]:
    """The kernel's log as records, in the order of time: it logs a beginning only when slip has become fast."""
    log = log[np.argsort(log[:, 1], kind="stable")]
    kinds, *columns = log.T[:7].tolist()
    return tuple(map(Event, [LOG_KINDS[int(kind)] for kind in kinds], *columns))


def slip_events(events: tuple[Event, ...]) -> tuple[SlipEvent, ...]:
    """Complete slip events of a run; one that is still going on at the end is not among them."""
    found: list[SlipEvent] = []
    begin: Event | None = None
    peak: Event | None = None
    for event in events:
        if event.kind == "slip begins":
            begin, peak = event, event
        elif begin is not None and event.kind == "velocity peak":
            peak = event if peak is None or event.velocity > peak.velocity else peak
        elif begin is not None and peak is not None and event.kind == "slip ends":
            found.append(
                SlipEvent(
                    begin=begin.time,
                    end=event.time,
                    duration=event.time - begin.time,
                    slip=event.slip - begin.slip,
                    stress_drop=begin.spring_stress - event.spring_stress,
                    peak_velocity=peak.velocity,
                    peak_time=peak.time,
                    recurrence=begin.time - found[-1].begin if found and found[-1].begin > 0 else float("nan"),
                )
            )
            begin = None
    return tuple(found)
