"""What holds the block: a spring, a controller's gain, or both; and for which values of it sliding is stable."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from steadyslip.linear.linear_sets import linear_set
from steadyslip.model.point import operating_point

if TYPE_CHECKING:
    from steadyslip.verdict.findings import Findings


class Holding(NamedTuple):
    """Per unit area (Pa/m), along the sliding direction.

    Attributes
    ----------
    name : str
        ``stiffness`` or, where no spring is beside the controller, the gain, such as ``gain kp``.
    own : float
    beside : float
        Gain of a controller that acts with the spring.
    critical : float or None
        Edge of the stable set nearest to `own`.
    side : str or None
        ``above`` or ``below``: where, next to that edge, sliding is stable.
    stable : tuple of (float, float)
        All stable values as open intervals, `beside` as it is.
    gain : str
        What `beside` is called.
    """

    name: str
    own: float
    beside: float
    critical: float | None
    side: str | None
    stable: tuple[tuple[float, float], ...]
    gain: str

    @property
    def words(self) -> str:
        """What the stable values are values of."""
        return f"{self.name} beside the {self.gain}" if self.beside else self.name


def holding(analysis: Findings) -> Holding:
    """What holds the block of a rig that slides."""
    rig = analysis.rig
    point = operating_point(rig, branch=analysis.branch)
    own, gain = float(point.named()["slider.stiffness"]), float(rig.drive.proportional())
    name = rig.gain_name()
    called = gain_words(name)
    found = linear_set(point, name) if name and gain and not own else None
    if found is None:
        edge = analysis.critical_stiffness, analysis.critical_side
        return Holding("stiffness", own, gain, *edge, analysis.stable_stiffness, called)
    stable = tuple((float(low), float(high)) for low, high in found.intervals if not math.isnan(low))
    ends = [(end, side) for pair in stable for end, side in zip(pair, ("above", "below"), strict=True)]
    some = [(end, side) for end, side in ends if 0 < end < np.inf]
    critical, side = min(some, key=lambda one: abs(one[0] - gain), default=(None, None))
    return Holding(called, gain, 0.0, critical, side, stable, called)


def gain_words(name: str | None) -> str:
    """What the gain of a drive is called, by the parameter that it is."""
    return "gain" if name is None else f"gain {name.rpartition('.')[2]}"
