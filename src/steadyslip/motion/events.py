"""Events of a run, and the slip events between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steadyslip.core.errors import InternalError
from steadyslip.core.pages import Displayed
from steadyslip.kernels.runner import LOG_KINDS


@dataclass(frozen=True)
class Event(Displayed):
    """Moment of a run at which something happens.

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
    """Slip ahead of the load point, which unloads the spring, with a peak of at least twice the load point's velocity.

    The block is faster than the load point (and not arrested) throughout. Its peak velocity is at least twice that of
    the load point (of the rig's drive while the load point rests) and twice its own at the beginning. The event begins
    where the block becomes faster than the load point, or at its lowest velocity if it was faster before.

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
        Time since the beginning of the event before, s; NaN for the first, and if the event before began before the
        run.
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
    """Moment of a run of a machine at which something happens at one of its contacts.

    Attributes
    ----------
    kind : str
        As in `Event`.
    time : float
        s.
    contact : str
    velocity : float
        Slip rate, m/s.
    normal_force, friction_force, pull : float
        N; `pull` is the spring force that the contact law takes (its stress T times the area).
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
    """`SlipEvent` of one contact of a machine; velocities are compared as shares of their values in steady sliding.

    Attributes
    ----------
    contact : str
    begin, end, duration : float
        s.
    slip : float
        m.
    force_drop : float
        Fall of the pull during the event, N.
    peak_velocity, peak_time : float
        m/s and s.
    recurrence : float
        Time since the beginning of the event before, s; NaN for the first, and if the event before began before the
        run.
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
    """Events of a kernel's log, in order of time (begins of slip are logged only when it becomes a slip event)."""
    log = log[np.argsort(log[:, 1], kind="stable")]
    each = len(LOG_KINDS) - 2
    found: list[AnyEvent] = []
    for number, time, v, sigma, tau, pull, slip in log[:, :7].tolist():
        index, kind = divmod(int(number) - 1, each)
        found.append(event_of(LOG_KINDS[kind + 1], contacts[index], areas[index], (time, v, sigma, tau, pull, slip)))
    return tuple(found)


def event_of(kind: str, contact: str, area: float, numbers: Sequence[float]) -> AnyEvent:
    """Event from its kind and (time, velocity, σ, τ, T, slip)."""
    if not contact:
        return Event(kind, *numbers)
    time, v, sigma, tau, pull, slip = numbers
    return ContactEvent(kind, time, contact, v, area * sigma, area * tau, area * pull, slip)


def slip_events(events: Sequence[AnyEvent]) -> tuple[AnySlip, ...]:
    """Complete slip events of a run, without one that is still going on at the end."""
    contacts = list(dict.fromkeys(event.contact if isinstance(event, ContactEvent) else "" for event in events))
    found: list[AnySlip] = []
    for name in contacts:
        own = [one for one in events if not isinstance(one, ContactEvent) or one.contact == name]
        found += _slips(own)
    return tuple(sorted(found, key=lambda one: one.end))


def _slips(events: Sequence[AnyEvent]) -> list[AnySlip]:
    """Complete slip events of one contact."""
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
    raise InternalError("events of one kind in a run")
