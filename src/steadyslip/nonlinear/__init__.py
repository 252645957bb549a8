"""Beyond small perturbations: onset, stick-slip cycles, kicks that are survived, answers to what swings for ever.

Knows stability and motion; no records of experiments, no maps, no words of the verdict.
"""

from __future__ import annotations

from steadyslip.nonlinear.forced import response
from steadyslip.nonlinear.frequency_response import FrequencyResponse
from steadyslip.nonlinear.frozen import FrozenVerdicts, frozen_verdicts
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
    "FrequencyResponse",
    "FrozenVerdicts",
    "HopfCurve",
    "KickMargin",
    "Onset",
    "SpecialCycle",
    "SpecialPoint",
    "Threshold",
    "basin",
    "cycles",
    "frozen_verdicts",
    "hopf",
    "hopf_curve",
    "margin_to_kick",
    "orbit",
    "response",
    "threshold",
    "threshold_map",
]
