"""Figures: each takes a rig or a run and ``ax=None``, returns the Axes, labels with units and never shows.

The only part of the package that imports matplotlib.
"""

from __future__ import annotations

from steadyslip.figures.chart import stability_chart
from steadyslip.figures.critical import ANGLES, critical_stiffness_against_mass
from steadyslip.figures.lab import corner, fit, prediction, record
from steadyslip.figures.locus import root_locus
from steadyslip.figures.map_results import refined, sensitivity
from steadyslip.figures.maps import map_figure
from steadyslip.figures.motion import history, phase_plane
from steadyslip.figures.nonlinear import basin, cycle_branch, hopf_curve, threshold_map

__all__ = [
    "ANGLES",
    "basin",
    "corner",
    "critical_stiffness_against_mass",
    "cycle_branch",
    "fit",
    "history",
    "hopf_curve",
    "map_figure",
    "phase_plane",
    "prediction",
    "record",
    "refined",
    "root_locus",
    "sensitivity",
    "stability_chart",
    "threshold_map",
]
