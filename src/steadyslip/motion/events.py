"""What happened in a run: moments, and the slip events that they delimit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steadyslip.core.errors import InternalError
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


@dataclass(frozen=True)
class ContactEvent(Displayed):
    """A moment of a run of a machine, at one of its contacts.

    Attributes
    ----------
    kind : str
        As of an `Event`.
    time : float
        s.
    contact : str
    velocity : float
        At which it slips, m/s.
    normal_force, friction_force, pull : float
        N; `pull` is what its contact law sees as T.
    slip : float
        Distance slipped since the start of the run, m.
    """

    kind: str
    time: float
    contact: str
    velocity: float
    normal_force: float
    friction_force: float
    pull: float
    slip: float


@dataclass(frozen=True)
class ContactSlip(Displayed):
    """A `SlipEvent` of one contact of a machine; slip rates count as shares of those in steady sliding.

    Attributes
    ----------
    contact : str
    begin, end, duration : float
        s.
    slip : float
        m.
    force_drop : float
        Fall of the pull, N.
    peak_velocity, peak_time : float
        m/s and s.
    recurrence : float
        Time since the event before began, s; NaN for the first, and after one that was going on at the start.
    """

    contact: str
    begin: float
    end: float
    duration: float
    slip: float
    force_drop: float
    peak_velocity: float
    peak_time: float
    recurrence: float


AnyEvent = Event | ContactEvent
AnySlip = SlipEvent | ContactSlip


def events_of(
    log: np.ndarray, contacts: Sequence[str] = ("",), areas: Sequence[float] = (1.0,)
) -> tuple[AnyEvent, ...]:
    """The kernel's log as records, in the order of time: it logs a beginning only when slip has become fast."""
    log = log[np.argsort(log[:, 1], kind="stable")]
    each = len(LOG_KINDS) - 2
    found: list[AnyEvent] = []
    for number, time, v, sigma, tau, pull, slip in log[:, :7].tolist():
        index, kind = divmod(int(number) - 1, each)
        found.append(event_of(LOG_KINDS[kind + 1], contacts[index], areas[index], (time, v, sigma, tau, pull, slip)))
    return tuple(found)


def event_of(kind: str, contact: str, area: float, numbers: Sequence[float]) -> AnyEvent:
    """A record of an event, from time, velocity, σ, τ, T and slip."""
    if not contact:
        return Event(kind, *numbers)
    time, v, sigma, tau, pull, slip = numbers
    return ContactEvent(kind, time, contact, v, area * sigma, area * tau, area * pull, slip)


def slip_events(events: Sequence[AnyEvent]) -> tuple[AnySlip, ...]:
    """Complete slip events of a run; one that is still going on at the end is not among them."""
    contacts = list(dict.fromkeys(event.contact if isinstance(event, ContactEvent) else "" for event in events))
    found: list[AnySlip] = []
    for name in contacts:
        own = [one for one in events if not isinstance(one, ContactEvent) or one.contact == name]
        found += _slips(own)
    return tuple(sorted(found, key=lambda one: one.end))


def _slips(events: Sequence[AnyEvent]) -> list[AnySlip]:
    """Those of one contact."""
    found: list[AnySlip] = []
    begin: AnyEvent | None = None
    peak: AnyEvent | None = None
    for event in events:
        if event.kind == "slip begins":
            begin, peak = event, event
        elif begin is not None and event.kind == "velocity peak":
            peak = event if peak is None or event.velocity > peak.velocity else peak
        elif begin is not None and peak is not None and event.kind == "slip ends":
            recurrence = begin.time - found[-1].begin if found and found[-1].begin > 0 else float("nan")
            found.append(_slip(begin, peak, event, recurrence))
            begin = None
    return found


def _slip(begin: AnyEvent, peak: AnyEvent, end: AnyEvent, recurrence: float) -> AnySlip:
    times = {"begin": begin.time, "end": end.time, "duration": end.time - begin.time, "slip": end.slip - begin.slip}
    top = {"peak_velocity": peak.velocity, "peak_time": peak.time, "recurrence": recurrence}
    if isinstance(begin, ContactEvent) and isinstance(end, ContactEvent):
        return ContactSlip(contact=begin.contact, force_drop=begin.pull - end.pull, **times, **top)
    if isinstance(begin, Event) and isinstance(end, Event):
        return SlipEvent(stress_drop=begin.spring_stress - end.spring_stress, **times, **top)
    raise InternalError("events of one run are of one kind")
