"""Sentence on a motion, from its slip events, or without them from its oscillation."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from steadyslip.core.format import format_like, format_quantity, format_range
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion.events import AnyEvent, AnySlip, ContactSlip

JUDDERS = {
    "again": "judders: every {every} it {waits}, then slips {slip} within {within}, a drop of {drop}",
    "over": "slips {count} times, the last time {slip} within {within}, a drop of {drop}, and no more after {ended}",
    "alone": "slips {slip} within {within}, a drop of {drop}",
    "sticks": "sticks",
    "lags": "lags",
    "of": "{drop} in {pull}",
    "rings": "; rings {rings} times at {often}",
    "backward": "; backward strokes {backward}, the last {back} within {during}",
}
"""Templates of the sentence, which Python and the browser page fill."""
OSCILLATES = "oscillates: every {every} between {speeds}"
"""Template of the sentence on a steady oscillation without slip events."""
GROWS = {True: "oscillates more and more", False: "leaves steady sliding"}
"""Begin of the sentence on a growing disturbance: with oscillation (True), or without."""
ON = ": after {time} between {speeds}, and still growing"
"""End of the sentence on a disturbance that grows up to the end of the run."""
CREEPS = ", at up to {peak}"
"""Addition for an event that is mostly creep: its peak velocity is more than `SUDDEN` times its mean."""
DIFFERS = " ({before} the time before)"
"""Addition with the slip of the last but one forward event, if it differs by more than `ALIKE`."""
DIGITS = 3  # significant digits of quantities in sentences
TREND = 0.01  # an oscillation is steady if its swings grow or decay by no more than this in the last half of a run
LAST = 0.9  # swings that grew before must be alike after this share of a run for an oscillation to be steady
BEATS = 1.2  # largest ratio of swings of a steady oscillation, which may beat; by trial
SUDDEN = 10.0  # an event is mostly creep if peak over mean velocity is larger; half sine: 1.6, stick-slip: 2 to 4
OVER = 2.0  # events have ended if none occurs for this many times the longest recurrence of late events
ALIKE = 0.01  # largest relative difference of slips, and of recurrences, of events that repeat


def pull_words(rig: Slider | Machine, contact: str) -> str:
    """Name of the pull at a contact, as "the pull of belt" or "the torque of worm on mount"; empty for a slider."""
    links = " and ".join(rig.pulls_at(contact))
    turns = rig.lever_at(contact) is not None
    return (
        f"the torque of {links} on {rig.contacts[contact].body}"
        if links and turns
        else links and f"the pull of {links}"
    )


def drop_of(slip: ContactSlip, lever: float | None) -> tuple[float, str]:
    """Drop of the pull in a slip event, and its unit: N, or N m if the body turns, with the radius `lever` (m)."""
    return (slip.force_drop, "N") if lever is None else (slip.force_drop * lever, "N m")


def sentence(
    events: Sequence[AnyEvent], slips: Sequence[AnySlip], area: float | None = None, pull: str = "",
    since: float = math.inf, end: float = math.nan, lever: float | None = None,
) -> str:  # fmt: skip
    """Sentence on the slip events of a block or contact; empty if there are none.

    It describes the last forward event (recurrence, slip, duration, drop, slip of the previous event if that differs,
    and ringing) and the last backward stroke. The block *sticks* if it was arrested since the previous event, else it
    *lags* behind the load point. It *judders* if events go on; long after the last event it slips no more.

    Parameters
    ----------
    events, slips
        Events of one block or contact.
    area : float, optional
        Area of a slider's contact, m², to report forces in place of stresses.
    pull : str
        Name of the pull at a machine's contact (`pull_words`).
    since : float
        Time (s) from which forward events are reported by their ranges; by default the last event alone.
    end : float
        End of the run, s; by default events may go on.
    lever : float, optional
        `Rig.lever_at` of a machine's contact, m.
    """
    if not slips:
        return ""
    back = [one for one in slips if one.slip < 0]
    last = next((one for one in reversed(slips) if one.slip > 0), back[-1] if back else slips[-1])
    some = [one for one in slips if one.slip > 0 and one.begin > since] or [last]
    if isinstance(last, ContactSlip):
        drops = [drop_of(one, lever) for one in some if isinstance(one, ContactSlip)]
        drop = _format([value for value, _ in drops], drops[0][1])
        drop = JUDDERS["of"].format(drop=drop, pull=pull) if pull else drop
    else:
        drop = _format([one.stress_drop for one in some if not isinstance(one, ContactSlip)], "Pa", area)
    holes = {
        "every": _format([one.recurrence for one in some if math.isfinite(one.recurrence)] or [math.nan], "s"),
        "waits": JUDDERS["sticks" if _stuck(events, last) else "lags"],
        "slip": _format([abs(one.slip) for one in some], "m"), "within": _format([one.duration for one in some], "s"),
        "drop": drop, "rings": str(last.rings), "often": _format([last.ring_frequency], "Hz"),
        "backward": str(len(back)), "count": str(len([one for one in slips if one.slip > 0])),
        "ended": _format([last.end], "s"),
    }  # fmt: skip
    over = end - last.end > OVER * _longest(slips, last, end)
    words = JUDDERS["over" if over else "again" if math.isfinite(last.recurrence) else "alone"]
    if last.peak_velocity > SUDDEN * last.slip / last.duration > 0:
        words += CREEPS.format(peak=_format([last.peak_velocity], "m/s"))
    before = next((one for one in reversed(slips[: slips.index(last)]) if one.slip > 0), last)
    if since == math.inf and not over and not math.isclose(before.slip, last.slip, rel_tol=ALIKE):
        words += DIFFERS.format(before=_format([before.slip], "m"))
    if math.isfinite(last.ring_frequency):
        words += JUDDERS["rings"]
    if back:
        holes |= {"back": _format([abs(back[-1].slip)], "m"), "during": _format([back[-1].duration], "s")}
        words += JUDDERS["backward"]
    return words.format(**holes)


def _longest(slips: Sequence[AnySlip], last: AnySlip, end: float) -> float:
    """Longest recurrence (s) among the last forward event and the events in the last half of a run."""
    late = [one.recurrence for one in slips if one.slip > 0 and one.begin > 0.5 * end and math.isfinite(one.recurrence)]
    return max([last.recurrence, *late])


def sentences(
    rig: Slider | Machine, events: Sequence[AnyEvent], slips: Sequence[AnySlip], since: float = math.inf,
    end: float = math.nan,
) -> dict[str, str]:  # fmt: skip
    """Sentence of each contact that slips, by name ("" for a slider's); see `sentence`."""
    found = {}
    for name in dict.fromkeys(one.contact for one in slips):
        own = [one for one in events if one.contact == name], [one for one in slips if one.contact == name]
        found[name] = sentence(*own, rig.area, pull_words(rig, name), since, end, rig.lever_at(name))
    return found


def joined(rig: Slider | Machine, sentences: Mapping[str, str]) -> str:
    """One sentence made of the sentences of the contacts.

    Each part begins with the name of the contact, or of the body if all its contacts have equal sentences.
    """
    held = {name: rig.contacts[name].held if name in rig.contacts else name for name in sentences}
    by_body: dict[str, set[str]] = {}
    for name, words in sentences.items():
        by_body.setdefault(held[name], set()).add(words)
    several = Counter(held.values())
    found = {held[name] if several[held[name]] > 1 and len(by_body[held[name]]) == 1 else name: words
             for name, words in sentences.items()}  # fmt: skip
    return "; ".join(f"{name} {words}" if name else words for name, words in found.items())


class Swings(NamedTuple):
    """Oscillation of a contact at the end of a run: mean period (s), lowest and highest velocity (m/s), trend.

    The trend is the relative growth of the swings (peak minus trough); 0 if they alternately grow and shrink.
    """

    period: float
    low: float
    high: float
    trend: float


def steady_swings(events: Sequence[AnyEvent], end: float) -> dict[str, Swings]:
    """Oscillation of each contact whose swings are alike in the last half of a run, or after growth at its end."""
    found = {}
    for name in dict.fromkeys(one.contact for one in events):
        peaks, troughs = _extremes(events, name, LAST * end if _settled(events, name, end) else 0.5 * end)
        sizes = _sizes(peaks, troughs)
        if len(sizes) > 1 and max(sizes) < BEATS * min(sizes):
            period = (peaks[-1].time - peaks[0].time) / (len(peaks) - 1)
            low, high = min(one.velocity for one in troughs), max(one.velocity for one in peaks)
            found[name] = Swings(period, low, high, _trend(sizes))
    return found


def growing_swings(events: Sequence[AnyEvent], end: float) -> dict[str, Swings]:
    """Last swing of each contact whose swings grow in the last half of a run and up to its end, by name.

    Decaying beats grow at times, too, but not beyond the swings of the second quarter of the run; the first quarter
    has the disturbance.
    """
    found = {}
    for name in dict.fromkeys(one.contact for one in events):
        peaks, troughs = _extremes(events, name, 0.5 * end)
        if min(len(peaks), len(troughs)) > 1 and not _settled(events, name, end):
            first, last = (peaks[i].velocity - troughs[i].velocity for i in (0, -1))
            earlier = _sizes(*_extremes([one for one in events if one.time <= 0.5 * end], name, 0.25 * end))
            if last > first and max(_sizes(peaks, troughs)) >= max(earlier, default=0.0):
                period = peaks[-1].time - peaks[-2].time
                found[name] = Swings(period, troughs[-1].velocity, peaks[-1].velocity, last / first - 1)
    return found


def _settled(events: Sequence[AnyEvent], name: str, end: float) -> bool:
    """True if swings that grew in the last half of a run differ by at most `TREND` in its last tenth.

    Swings that grow by `BEATS` in half a run at a constant rate would grow by 4 % in the last tenth.
    """
    half, late = (_sizes(*_extremes(events, name, share * end)) for share in (0.5, LAST))
    return len(late) > 2 and late[-1] > BEATS * half[0] and max(late) <= (1 + TREND) * min(late)


def oscillations(events: Sequence[AnyEvent], end: float) -> dict[str, str]:
    """Sentence of each contact that oscillates up to the `end` (s) of a run without slip events, by name.

    Contacts whose oscillation decays, or is below the printed digits, are left out.
    """
    time = format_quantity(end, "s", DIGITS)
    found = {name: GROWS[True] + ON.format(time=time, speeds=speeds(one))
             for name, one in growing_swings(events, end).items() if _seen(one)}  # fmt: skip
    steady = {name: oscillates(one) for name, one in steady_swings(events, end).items()
              if _seen(one) and abs(one.trend) <= TREND}  # fmt: skip
    return found | steady


def _trend(sizes: Sequence[float]) -> float:
    steps = [after - before for before, after in pairwise(sizes)]
    one_way = all(step > 0 for step in steps) or all(step < 0 for step in steps)
    return sizes[-1] / sizes[0] - 1 if one_way else 0.0


def oscillates(swings: Swings) -> str:
    """Sentence on a steady oscillation."""
    return OSCILLATES.format(every=format_quantity(swings.period, "s", DIGITS), speeds=speeds(swings))


def speeds(swings: Swings) -> str:
    """Text of the lowest and the highest velocity of an oscillation, both in the unit of the highest."""
    low = format_like(swings.low, swings.high, "m/s", DIGITS)
    return f"{low} and {format_quantity(swings.high, 'm/s', DIGITS)}"


def _seen(swings: Swings) -> bool:
    low, high = (format_quantity(one, "m/s", DIGITS) for one in (swings.low, swings.high))
    return low != high


def _sizes(peaks: Sequence[AnyEvent], troughs: Sequence[AnyEvent]) -> list[float]:
    """Velocities of peaks minus those of the troughs (m/s), in order of time."""
    return [peak.velocity - trough.velocity for peak, trough in zip(peaks, troughs, strict=False)]


def _extremes(events: Sequence[AnyEvent], name: str, since: float) -> tuple[list[AnyEvent], list[AnyEvent]]:
    """Peaks and troughs of the velocity of a contact from a time (s) on."""
    late = [one for one in events if one.contact == name and one.time > since]
    peaks, troughs = ([one for one in late if one.kind == f"velocity {kind}"] for kind in ("peak", "trough"))
    return peaks, troughs


def _stuck(events: Sequence[AnyEvent], last: AnySlip) -> bool:
    """True if the block was arrested between the previous slip event and `last`."""
    return any(one.kind == "arrest" and last.begin - last.recurrence < one.time < last.begin for one in events)


def _format(values: Sequence[float], unit: str, area: float | None = None) -> str:
    """Text of values: one number, or a range if they differ in the printed digits."""
    low, high = (format_quantity(end(values), unit, DIGITS, area) for end in (min, max))
    return low if low == high else format_range(min(values), max(values), unit, area, DIGITS)
