"""Beyond small perturbations: kind of onset, stick-slip cycles, and the kick that steady sliding survives."""

from __future__ import annotations

from steadyslip.nonlinear.basin import Basin, basin, orbit
from steadyslip.nonlinear.brackets import threshold_map
from steadyslip.nonlinear.branch import Cycle, CycleBranch, SpecialCycle
from steadyslip.nonlinear.cycles import cycles
from steadyslip.nonlinear.hopf_curve import HopfCurve, SpecialPoint, hopf_curve
from steadyslip.nonlinear.onset import Onset, hopf
from steadyslip.nonlinear.threshold import KickMargin, Threshold, margin_to_kick, threshold

__all__ = [
    "Basin",
    "Cycle",
    "CycleBranch",
    "HopfCurve",
    "KickMargin",
    "Onset",
    "SpecialCycle",
    "SpecialPoint",
    "Threshold",
    "basin",
    "cycles",
    "hopf",
    "hopf_curve",
    "margin_to_kick",
    "orbit",
    "threshold",
    "threshold_map",
]
