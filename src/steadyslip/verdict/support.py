"""Stiffness that supports the block of a slider (spring, position controller, or both), and its stable values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from steadyslip.linear.linear_sets import linear_set
from steadyslip.linear.nearness import doublings
from steadyslip.machine.letters import words_of
from steadyslip.machine.rig import Rig
from steadyslip.model.point import operating_point

if TYPE_CHECKING:
    from steadyslip.verdict.findings import Findings


class SupportStiffness(NamedTuple):
    """Stiffness that supports the block of a slider, per unit area (Pa/m), along the sliding direction.

    Attributes
    ----------
    name : str
        ``stiffness`` or, where no spring is beside the controller, the gain, such as ``drive proportional gain``.
    own : float
        The rig's own value.
    beside : float
        Gain of a controller that acts in parallel with the spring; 0 without one.
    critical : float or None
        Edge of the stable set nearest to `own`.
    side : str or None
        ``above`` or ``below``: the side of that edge on which sliding is stable.
    stable : tuple of (float, float)
        All stable values as open intervals, with `beside` unchanged.
    gain : str
        Name of the controller gain, such as ``drive proportional gain``.
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
        """Name of the varied stiffness for a sentence, such as ``stiffness beside the drive proportional gain``."""
        return f"{self.name} beside the {self.gain}" if self.beside else self.name


def support_stiffness(analysis: Findings) -> SupportStiffness:
    """Stiffness that supports the block of a slider: the controller's gain if the spring is zero, else the spring."""
    rig = analysis.rig
    point = operating_point(rig, branch=analysis.branch)
    own, gain = float(point.named()["slider.stiffness"]), float(rig.drive.proportional())
    name = rig.gain_name()
    label = gain_words(rig)
    found = linear_set(point, name) if name and gain and not own else None
    if found is None:
        edge = analysis.critical_stiffness, analysis.critical_side
        return SupportStiffness("stiffness", own, gain, *edge, analysis.stable_stiffness, label)
    stable = tuple((float(low), float(high)) for low, high in found.intervals if not math.isnan(low))
    ends = [(end, side) for pair in stable for end, side in zip(pair, ("above", "below"), strict=True)]
    edges = [(end, side) for end, side in ends if 0 < end < np.inf]
    critical, side = min(edges, key=lambda edge: doublings(gain, edge[0]), default=(None, None))
    return SupportStiffness(label, gain, 0.0, critical, side, stable, label)


def gain_words(rig: Rig) -> str:
    """Gain of a rig's controller in words: ``drive proportional gain`` for ``drive.kp``, ``gain`` where it has none."""
    name = rig.gain_name()
    return "gain" if name is None else words_of(rig, name)
