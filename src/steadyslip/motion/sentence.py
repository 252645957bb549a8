"""What a motion does, in one sentence, from its slip events."""

from __future__ import annotations

import math
from collections.abc import Sequence

from steadyslip.core.format import format_quantity
from steadyslip.motion.events import AnyEvent, AnySlip, ContactSlip

JUDDERS = {
    "again": "judders: every {every} it {waits}, then slips {slip} within {within}, a drop of {drop}",
    "alone": "slips {slip} within {within}, a drop of {drop}",
    "sticks": "sticks",
    "lags": "lags",
    "rings": "; rings {rings} times at {often}",
    "backward": "; backward strokes {backward}, the last {back} within {during}",
}
"""Parts of the sentence, with holes that Python and the page fill."""
DIGITS = 3  # significant, of quantities in sentences


def sentence(events: Sequence[AnyEvent], slips: Sequence[AnySlip], area: float | None = None) -> str:
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
    """
    if not slips:
        return ""
    back = [one for one in slips if one.slip < 0]
    last = next((one for one in reversed(slips) if one.slip > 0), back[-1] if back else slips[-1])
    holes = {
        "every": _told(last.recurrence, "s"), "waits": JUDDERS["sticks" if _stuck(events, last) else "lags"],
        "slip": _told(abs(last.slip), "m"), "within": _told(last.duration, "s"),
        "drop": _told(last.force_drop, "N") if isinstance(last, ContactSlip) else _told(last.stress_drop, "Pa", area),
        "rings": str(last.rings), "often": _told(last.ring_frequency, "Hz"), "backward": str(len(back)),
    }  # fmt: skip
    words = JUDDERS["again" if math.isfinite(last.recurrence) else "alone"]
    if math.isfinite(last.ring_frequency):
        words += JUDDERS["rings"]
    if back:
        holes |= {"back": _told(abs(back[-1].slip), "m"), "during": _told(back[-1].duration, "s")}
        words += JUDDERS["backward"]
    return words.format(**holes)


def sentences(events: Sequence[AnyEvent], slips: Sequence[AnySlip], area: float | None = None) -> dict[str, str]:
    """Sentence of each contact that slips, by name ("" for a slider's)."""
    found = {}
    for name in dict.fromkeys(one.contact for one in slips):
        own = [one for one in events if one.contact == name], [one for one in slips if one.contact == name]
        found[name] = sentence(*own, area)
    return found


def _stuck(events: Sequence[AnyEvent], last: AnySlip) -> bool:
    """True if the block was arrested between the event before and this one."""
    return any(one.kind == "arrest" and last.begin - last.recurrence < one.time < last.begin for one in events)


def _told(value: float, unit: str, area: float | None = None) -> str:
    return format_quantity(value, unit, DIGITS, area)
