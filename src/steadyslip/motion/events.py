"""Events of a run, and the slip events between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from steadyslip.core.errors import InternalError
from steadyslip.core.pages import Displayed
from steadyslip.kernels.events import RING
from steadyslip.kernels.layout import EVENT_SHARE, NUMBER, Kind
from steadyslip.kernels.runner import LOG_KINDS

BEGINS = {"slip begins": 1.0, "backward slip begins": -1.0}
ENDS = ("slip ends", "backward slip ends")


@dataclass(frozen=True)
class Event(Displayed):
    """Moment of a run at which something happens.

    Attributes
    ----------
    kind : str
        ``slip begins`` and ``slip ends`` (of a `SlipEvent`), ``backward slip begins`` and ``backward slip ends``,
        ``ring`` (begin of forward slip after an event that sheds too little for one), ``velocity peak``, ``velocity
        trough``, ``arrest``, ``restart``, ``contact lost`` or ``blow-up``.
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
    contact: ClassVar[str] = ""  # the contact of a slider has no name


@dataclass(frozen=True)
class SlipEvent(Displayed):
    """Slip ahead of the load point, which unloads the spring, with a peak of at least twice the load point's velocity.

    The event begins where the block becomes faster than the load point, or at its lowest speed if it was faster before,
    and ends where it is slower again and rests: the spring is loaded by more than a tenth of the largest drop before
    it slips again. Its peak speed is at least twice that of the load point (of the rig's drive while the load point
    rests) and twice its own at the beginning; its stress drop is at least a tenth of the largest so far, and that of a
    later event at most ten times the largest before. Fast slip with a smaller drop is ringing; if three such slips in a
    row, each after a rest, are alike, as after a knock, events are counted anew from the third. A backward stroke is an
    event of its own, by the same definition with the absolute velocity.

    Attributes
    ----------
    begin, end, duration : float
        s.
    slip : float
        m; negative for a backward stroke.
    stress_drop : float
        Fall of the spring stress (for a backward stroke its rise), Pa; never negative.
    peak_velocity, peak_time : float
        m/s (negative of a backward stroke) and s.
    recurrence : float
        Time (s) since the beginning of the previous event in the same direction; NaN for the first event, and if the
        previous event began before the run.
    rings : int
        Number of times that the block is again faster than the load point, by a factor of two, before the next event.
    ring_frequency : float
        1 over the time between the last two rings, Hz; NaN with fewer than two.
    """

    begin: float
    end: float
    duration: float
    slip: float
    stress_drop: float
    peak_velocity: float
    peak_time: float
    recurrence: float
    rings: int
    ring_frequency: float
    contact: ClassVar[str] = ""  # the contact of a slider has no name


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
        N; `pull` is the spring force on which the contact law depends (the stress T times the area).
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
    """A `SlipEvent` at one contact of a machine; velocities are compared as ratios to those in steady sliding.

    Attributes
    ----------
    contact : str
    begin, end, duration : float
        s.
    slip : float
        m.
    force_drop : float
        Fall of the pull during the event (for a backward stroke its rise), N.
    peak_velocity, peak_time, recurrence, rings, ring_frequency : float
        As in `SlipEvent`.
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
    rings: int
    ring_frequency: float


AnyEvent = Event | ContactEvent
AnySlip = SlipEvent | ContactSlip


def events_of(
    log: np.ndarray, contacts: Sequence[str] = ("",), areas: Sequence[float] = (1.0,)
) -> tuple[AnyEvent, ...]:
    """Events of a kernel's log, in order of time, for contacts with names and areas (m²)."""
    each = len(LOG_KINDS) - 2
    found: list[AnyEvent] = []
    for number, *numbers in valid_rows(log)[:, [*range(7), NUMBER]].tolist():
        index, kind = divmod(int(number) - 1, each)
        word = RING if kind + 1 == Kind.SLIP_BEGINS and not numbers.pop() else LOG_KINDS[kind + 1]
        found.append(event_of(word, contacts[index], areas[index], numbers[:6]))
    return tuple(found)


def valid_rows(log: np.ndarray) -> np.ndarray:
    """Rows of a log in order of time, without those begins and ends of slip events that later rows replace."""
    each = len(LOG_KINDS) - 2
    keep = np.ones(len(log), dtype=bool)
    counted: dict[int, list[list[int]]] = {}  # by contact: for each slip event the rows of its begin and end
    for i in np.flatnonzero(log[:, NUMBER] > 0).tolist():
        index, kind = divmod(int(log[i, 0]) - 1, each)
        events, number = counted.setdefault(index, []), int(log[i, NUMBER])
        if kind + 1 in (Kind.SLIP_BEGINS, Kind.BACKWARD_BEGINS):
            keep[[row for event in events[number - 1 :] for row in event]] = False
            events[number - 1 :] = [[i]]
        else:
            keep[events[number - 1][1:]] = False
            events[number - 1][1:] = [i]
    log = log[keep]
    return np.asarray(log[np.argsort(log[:, 1], kind="stable")])


def event_of(kind: str, contact: str, area: float, numbers: Sequence[float]) -> AnyEvent:
    """Event of a kind with `numbers` (time, velocity, σ, τ, T, slip), SI units; `area` (m²) turns stress into force."""
    if not contact:
        return Event(kind, *numbers)
    time, v, sigma, tau, pull, slip = numbers
    return ContactEvent(kind, time, contact, v, area * sigma, area * tau, area * pull, slip)


def slip_events(events: Sequence[AnyEvent]) -> tuple[AnySlip, ...]:
    """Complete slip events of a run, in order of their ends; events that go on when the run ends are left out."""
    found: list[AnySlip] = []
    for name in dict.fromkeys(event.contact for event in events):
        found += _slips([one for one in events if one.contact == name])
    return tuple(sorted(found, key=lambda one: one.end))


def _slips(events: Sequence[AnyEvent]) -> list[AnySlip]:
    """Complete slip events of one contact."""
    found: list[tuple[AnyEvent, AnyEvent, AnyEvent]] = []
    rings: list[list[float]] = []
    begin: AnyEvent | None = None
    peak: AnyEvent | None = None
    for event in events:
        if event.kind in BEGINS:
            begin, peak = event, event
        elif event.kind == RING and rings and begin is None:
            rings[-1].append(event.time)
        elif begin is not None and peak is not None and event.kind.startswith("velocity"):
            faster = BEGINS[begin.kind] * (event.velocity - peak.velocity) > 0
            peak = event if faster else peak
        elif begin is not None and peak is not None and event.kind in ENDS:
            found.append((begin, peak, event))
            rings.append([])
            begin = None
    slips = [_slip(*one, _recurrence([each[0] for each in found[: i + 1]]), rings[i]) for i, one in enumerate(found)]
    return list(_begun_anew(slips))


def _begun_anew(slips: Sequence[AnySlip]) -> Iterator[AnySlip]:
    """Yield slip events; the first one after an event with a far larger drop (a knock) gets the recurrence NaN."""
    largest = 0.0
    for one in slips:
        anew = _drop(one) < EVENT_SHARE * largest
        largest = _drop(one) if anew else max(largest, _drop(one))
        yield replace(one, recurrence=float("nan")) if anew else one


def _drop(slip: AnySlip) -> float:
    return slip.force_drop if isinstance(slip, ContactSlip) else slip.stress_drop


def _recurrence(begins: Sequence[AnyEvent]) -> float:
    """Time (s) between the last begin in `begins` and the previous begin in the same direction; NaN if not known."""
    before = next((one.time for one in begins[-2::-1] if one.kind == begins[-1].kind), 0.0)
    return begins[-1].time - before if before > 0 else float("nan")


def _slip(begin: AnyEvent, peak: AnyEvent, end: AnyEvent, recurrence: float, rings: Sequence[float]) -> AnySlip:
    """Slip event from its begin, velocity peak and end, with the times (s) of its rings."""
    sign = BEGINS[begin.kind]
    often = 1 / (rings[-1] - rings[-2]) if len(rings) > 1 else float("nan")
    times = {"begin": begin.time, "end": end.time, "duration": end.time - begin.time, "slip": end.slip - begin.slip}
    top = {"peak_velocity": peak.velocity, "peak_time": peak.time, "recurrence": recurrence, "ring_frequency": often}
    if isinstance(begin, ContactEvent) and isinstance(end, ContactEvent):
        drop = sign * (begin.pull - end.pull)
        return ContactSlip(contact=begin.contact, force_drop=drop, rings=len(rings), **times, **top)
    if isinstance(begin, Event) and isinstance(end, Event):
        drop = sign * (begin.spring_stress - end.spring_stress)
        return SlipEvent(stress_drop=drop, rings=len(rings), **times, **top)
    raise InternalError("a slip event begins and ends with events of two types; this is a bug, please report it")
