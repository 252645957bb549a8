"""Document on a rig whose drive holds a position: recommendation of changes that end its hunting."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.format import format_quantity
from steadyslip.machine.letters import label_of
from steadyslip.machine.rig import Rig
from steadyslip.nonlinear.hunting.hunt import hunt
from steadyslip.nonlinear.hunting.hunt_result import Hunt
from steadyslip.reports.elements import heading, paragraph, table

BAND = 2.0  # dead band that is tried, over the hunting amplitude; a band hardly wider than the cycle only slows it
STIFFER = 2.0  # factor by which all gains are multiplied as a trial
LONGER = 4.0  # runs with changes are at most this many times as long as the run without; bounds computing time
WHY = "it hunts because the integral winds up while friction at rest, larger than in sliding, holds the axis"
_ON_TARGET = "in the end on the target, which its ever smaller strokes approach"
HOLDS = (
    "Each contact has one normal force, and bodies are rigid. The motion is simulated for the values and the change of "
    "target below; it says nothing of wear, heat or of what the laws leave out."
)


@dataclass(frozen=True)
class Tried:
    """A changed version of a rig that hunts, and its simulated motion.

    Attributes
    ----------
    what : str
        The change, as text.
    then : Hunt
        Motion with the change.
    least : float
        Distance from the target (m or rad) at which other runs may come to rest: half the dead band, or 0.
    """

    what: str
    then: Hunt
    least: float

    @property
    def reach(self) -> float:
        """Largest distance from the target (m or rad) at which the axis may end, in this run or in others."""
        rests = np.isfinite(self.then.settled_at) or self.then.hunts
        return max(self.least, _reach(self.then) if rests else 0.0)  # ever smaller strokes end on the target

    def verdict(self, allowed: float) -> str:
        """Text on whether the change is a cure; `allowed` is the acceptable distance from the target (m or rad)."""
        if self.then.hunts is False and not self.then.runs_away:
            return "ends it" if self.reach <= allowed else "no cure: it rests, but farther off than that"
        if self.then.hunts and self.reach < allowed:
            return "no cure: it still hunts, with a smaller amplitude"
        return "no cure"


def recommendation(result: Hunt) -> Iterator[str]:
    """HTML of the changes that end hunting, each simulated alone; if the axis settles, its distance from the target.

    A change counts as a cure only if the axis then rests within the dead band of its controller or, without a dead
    band, nearer to the target than its present hunting amplitude.
    """
    yield heading("The recommendation")
    if result.runs_away:
        why = result.unstable_loop or "the controller is too weak for its load"
        yield paragraph(f"It is not friction that has to change: {why}.")
    elif result.hunts:
        yield from _cures(result)
    elif result.hunts is None:
        yield paragraph("Simulate it for longer (until) before it is judged.")
    elif np.isfinite(result.settled_at):
        far = format_quantity(_reach(result), result.unit)
        yield paragraph(f"Keep it as it is, if {far} from the target is near enough: there it rests.")
    else:
        yield paragraph("Keep it as it is: its strokes become ever smaller.")
    yield heading("Assumptions")
    yield paragraph(HOLDS)


def _cures(result: Hunt) -> Iterator[str]:
    """HTML of the changes that were tried, the best first, each with the distance from the target that it leaves."""
    unit, own, limits = result.unit, _reach(result), result.rig.drive.limits()
    asked = limits.dead_band if limits else None
    allowed = own if asked is None else float(asked) * _result_over_measured(result)
    until = LONGER * float(result.time[-1])
    found = [Tried(what, hunt(rig, result.protocol, until=until), least) for what, rig, least in _changed(result)]
    found.sort(key=lambda one: (one.verdict(allowed) != "ends it", one.reach))
    bound = "the dead band of its controller" if asked is not None else "as far as it hunts now"
    limit = f"{format_quantity(allowed, unit)} ({bound})"
    good = [one for one in found if one.verdict(allowed) == "ends it"]
    if good:
        text = f"Make this change: {good[0].what}. The axis then rests, "
        text += f"within {format_quantity(good[0].reach, unit)} of the target" if good[0].reach else _ON_TARGET
        yield paragraph(f"{text}; {WHY}.")
    else:
        yield paragraph(f"None of the changes below lets it rest within {limit} of the target; {WHY}.")
    rows = [
        (
            one.what,
            one.then.sentence.capitalize(),
            f"{format_quantity(one.reach, unit)}, {one.reach / own:.2g} times as far as now"
            if one.reach
            else f"0 {unit} in the end",
            one.verdict(allowed),
        )
        for one in found
    ]
    words = f"Changes, each alone and simulated. A cure leaves the axis at rest within {limit} of the target."
    yield table(rows, ("change", "then", "off the target by up to", "worth"), caption=words)


def _result_over_measured(result: Hunt) -> float:
    """Motion of the body to which results refer, per motion of the body that the controller measures."""
    return result.rig.feed()[0] / result.rig.seen()[0]


def _reach(result: Hunt) -> float:
    return max(abs(result.lowest), abs(result.highest))


def _changed(result: Hunt) -> Iterator[tuple[str, Any, float]]:
    """Yield changes that may end hunting: text, changed rig, and distance (m or rad) from target that may be left."""
    rig: Any = result.rig
    known = rig.parameters()
    rest = {
        name: float(known[sliding].value)
        for name, one in known.items()
        if name.endswith(".mu_static") and (sliding := f"{name.removesuffix('static')}coulomb") in known
        if one.value and known[sliding].value and one.value > known[sliding].value
    }
    if rest:
        lower = " and ".join(
            f"{label_of(rig, name)} from {known[name].value:.4g} to {to:.4g}" for name, to in rest.items()
        )
        yield (
            f"friction at rest no larger than in sliding ({lower}), by other guides or oil",
            rig.with_values(rest),
            0.0,
        )
    band = BAND * _reach(result)
    with suppress(ParameterError, NotAvailable, TypeError):  # a drive without these keys
        words = f"a dead band of {format_quantity(band, result.unit)} of the integral ({BAND:g} amplitudes)"
        measured = band / _result_over_measured(result)
        yield words, replace(rig, drive=replace(rig.drive, dead_band=measured, dead_band_of="integral")), band
    gains = {name: STIFFER * one.value for name, one in known.items() if _is_gain(rig, name) and one.value}
    if gains:
        names = ", ".join(label_of(rig, name) for name in gains)
        yield f"a stiffer controller, all gains times {STIFFER:g} ({names})", rig.with_values(gains), 0.0
    for name, one in known.items():
        if one.role.letter == "k_i" and one.value:
            yield f"no integral ({label_of(rig, name)} = 0)", rig.with_values({name: 0.0}), 0.0


def _is_gain(rig: Rig, name: str) -> bool:
    one = rig.parameters()[name]
    return name.startswith("drive.") and one.role.letter in ("k_p", "k_d", "k_i") and bool(one.value)
