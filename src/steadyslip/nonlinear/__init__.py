"""Beyond small perturbations: kind of onset, stick-slip cycles, and the kick that steady sliding survives.

Knows stability and motion; no records of experiments, no maps, no words of the verdict.
"""

from __future__ import annotations

from steadyslip.nonlinear.kicks.basin import Basin, basin, orbit
from steadyslip.nonlinear.kicks.brackets import threshold_map
from steadyslip.nonlinear.kicks.threshold import KickMargin, Threshold, margin_to_kick, threshold
from steadyslip.nonlinear.onset.hopf import Onset, hopf
from steadyslip.nonlinear.onset.hopf_curve import HopfCurve, SpecialPoint, hopf_curve
from steadyslip.nonlinear.orbits.branch import CycleBranch
from steadyslip.nonlinear.orbits.cycle import Cycle, SpecialCycle
from steadyslip.nonlinear.orbits.cycles import cycles

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
