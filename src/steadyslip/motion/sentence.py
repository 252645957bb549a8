"""What a motion does, in one sentence, from its slip events."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from steadyslip.core.format import format_quantity, format_range
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.motion.events import AnyEvent, AnySlip, ContactSlip

JUDDERS = {
    "again": "judders: every {every} it {waits}, then slips {slip} within {within}, a drop of {drop}",
    "alone": "slips {slip} within {within}, a drop of {drop}",
    "sticks": "sticks",
    "lags": "lags",
    "pull": "{drop} in the pull of {links}",
    "rings": "; rings {rings} times at {often}",
    "backward": "; backward strokes {backward}, the last {back} within {during}",
}
"""Parts of the sentence, with holes that Python and the page fill."""
DIGITS = 3  # significant, of quantities in sentences


def sentence(
    events: Sequence[AnyEvent], slips: Sequence[AnySlip], area: float | None = None, pulls: Sequence[str] = (),
    since: float = math.inf,
) -> str:  # fmt: skip
    """Sentence on the slip events of a block or contact; empty if there are none.

    It tells of the last forward event: how long after the one before, how far, how fast, how much the spring sheds and
    how it rings; and of the last backward stroke. The block *sticks* if it was arrested since the event before, else it
    *lags* behind the load point.

    Parameters
    ----------
    events, slips
        Of one block or contact.
    area : float, optional
        Of a slider's contact, m², if forces are told.
    pulls : sequence of str
        Names of what pulls at a machine's contact, which sheds the force (`Rig.pulls_at`).
    since : float
        Time from which forward events are told by their ranges, s; the last alone by default.
    """
    if not slips:
        return ""
    back = [one for one in slips if one.slip < 0]
    last = next((one for one in reversed(slips) if one.slip > 0), back[-1] if back else slips[-1])
    told = [one for one in slips if one.slip > 0 and one.begin > since] or [last]
    if isinstance(last, ContactSlip):
        drop = _told([one.force_drop for one in told if isinstance(one, ContactSlip)], "N")
        drop = JUDDERS["pull"].format(drop=drop, links=" and ".join(pulls)) if pulls else drop
    else:
        drop = _told([one.stress_drop for one in told if not isinstance(one, ContactSlip)], "Pa", area)
    holes = {
        "every": _told([one.recurrence for one in told if math.isfinite(one.recurrence)] or [math.nan], "s"),
        "waits": JUDDERS["sticks" if _stuck(events, last) else "lags"],
        "slip": _told([abs(one.slip) for one in told], "m"), "within": _told([one.duration for one in told], "s"),
        "drop": drop, "rings": str(last.rings), "often": _told([last.ring_frequency], "Hz"), "backward": str(len(back)),
    }  # fmt: skip
    words = JUDDERS["again" if math.isfinite(last.recurrence) else "alone"]
    if math.isfinite(last.ring_frequency):
        words += JUDDERS["rings"]
    if back:
        holes |= {"back": _told([abs(back[-1].slip)], "m"), "during": _told([back[-1].duration], "s")}
        words += JUDDERS["backward"]
    return words.format(**holes)


def sentences(
    rig: Slider | Machine, events: Sequence[AnyEvent], slips: Sequence[AnySlip], since: float = math.inf
) -> dict[str, str]:
    """Sentence of each contact that slips, by name ("" for a slider's)."""
    found = {}
    for name in dict.fromkeys(one.contact for one in slips):
        own = [one for one in events if one.contact == name], [one for one in slips if one.contact == name]
        found[name] = sentence(*own, rig.area, rig.pulls_at(name), since)
    return found


def joined(sentences: Mapping[str, str]) -> str:
    """One sentence from those of the contacts, each after the contact's name."""
    return "; ".join(f"{name} {words}" if name else words for name, words in sentences.items())


def _stuck(events: Sequence[AnyEvent], last: AnySlip) -> bool:
    """True if the block was arrested between the event before and this one."""
    return any(one.kind == "arrest" and last.begin - last.recurrence < one.time < last.begin for one in events)


def _told(values: Sequence[float], unit: str, area: float | None = None) -> str:
    """Value, or range of values that differ in the digits that are told."""
    low, high = (format_quantity(end(values), unit, DIGITS, area) for end in (min, max))
    return low if low == high else format_range(min(values), max(values), unit, area, DIGITS)
