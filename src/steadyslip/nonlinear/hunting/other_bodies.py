"""Distances from their targets of the bodies of a held machine other than the reported one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from steadyslip.core.pages import Displayed
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.nonlinear.hunting.plant import Array, Plant


@dataclass(frozen=True)
class BodySwing(Displayed):
    """Extremes of position minus target of a body with friction.

    The body's target is the drive's target, converted as in steady motion.

    Attributes
    ----------
    body : str
    lowest, highest : float
        Extremes of position minus target, over the time of `Hunt.lowest`; m or rad.
    unit : str
    """

    body: str
    lowest: float
    highest: float
    unit: str


def reported_body(rig: Rig) -> str:
    """Body whose position `Hunt` reports: that whose feed is given, or the drive's; empty for a rig with one body."""
    if len(rig.bodies) < 2:
        return ""
    return rig.fed or rig.drive.driven() or ""


def measured_body(rig: Rig) -> str:
    """Body of a machine whose position the controller measures; empty for a rig with one body."""
    return rig.drive.watched()[0] if reported_body(rig) else ""


def other_bodies(rig: Rig) -> dict[str, float]:
    """Bodies with contacts, by name, with their motion per motion of the drive; without the reported body.

    If the reported body is not the one that the controller measures, it is included.
    """
    own = reported_body(rig)
    if not own:
        return {}
    speeds, measured = rig.ratios(), measured_body(rig)
    held = dict.fromkeys(surface.held for surface in rig.contacts.values())
    return {name: speeds[name] for name in held if speeds.get(name) and not name == own == measured}


def rows_of(rig: Slider | Machine, plant: Plant) -> list[Array]:
    """Rows (width,) that give the errors (target minus position) of the other bodies from the state of a plant."""
    names = [one.name for one in rig.mechanism().coordinates]
    return [
        plant.row(-np.eye(plant.size)[names.index(body)], target=ratio) for body, ratio in other_bodies(rig).items()
    ]


def swings_of(rig: Slider | Machine, times: Array, errors: Array) -> tuple[BodySwing, ...]:
    """Extremes of the other bodies, from their errors (times, bodies) at times (s)."""
    if not len(times):
        return ()
    return tuple(
        BodySwing(body, -_largest(times, own), _largest(times, -own), "rad" if rig.turns_on(body) else "m")
        for body, own in zip(other_bodies(rig), np.transpose(errors), strict=True)
    )


def _largest(times: Array, values: Sequence[float] | Array) -> float:
    """Maximum of a smooth function from values at times, by a parabola through the largest and its neighbours."""
    i = int(np.argmax(values))
    if not 0 < i < len(values) - 1:
        return float(values[i])
    left, right = times[i] - times[i - 1], times[i + 1] - times[i]
    if not (left > 0 and right > 0):
        return float(values[i])
    falls, rises = (values[i] - values[i - 1]) / left, (values[i + 1] - values[i]) / right
    bend = (falls - rises) / (left + right)
    slope = (falls * right + rises * left) / (left + right)
    return float(values[i] + slope**2 / (4 * bend)) if bend > 0 else float(values[i])
