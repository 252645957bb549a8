"""Figures: each function takes a rig or a result and ``ax=None``, draws with units and returns the Axes.

Figures are never displayed or closed here. Only this folder imports matplotlib. Figures that ``result.plot()`` draws
are registered below.
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

from matplotlib.axes import Axes

from steadyslip.core.pictures import register_figures, saved_by
from steadyslip.core.written import in_written_units
from steadyslip.experiments import Draws, Fit, LawComparison, MachineFit, Population, Prediction, Profile, Record
from steadyslip.experiments.answers.precision import Ranking
from steadyslip.figures.chart import stability_chart
from steadyslip.figures.experiments.answers import comparison, kicks, prediction, profile, ranking
from steadyslip.figures.experiments.corners import corner
from steadyslip.figures.experiments.fits import fit, steps
from steadyslip.figures.experiments.machine_fits import machine_fit
from steadyslip.figures.experiments.populations import population
from steadyslip.figures.experiments.records import record
from steadyslip.figures.forced import frequency_response, frozen_verdicts
from steadyslip.figures.hunting import hunting
from steadyslip.figures.locus import root_locus
from steadyslip.figures.machine_verdict import eigenvalue_plane, machine_verdict, mode_shape, stable_ranges
from steadyslip.figures.machines import machine_sketch
from steadyslip.figures.map_edges_and_sobol import refined, sensitivity
from steadyslip.figures.maps import map_figure
from steadyslip.figures.mode_chart import mode_chart
from steadyslip.figures.motion import history, phase_plane
from steadyslip.figures.nonlinear import basin, cycle_branch, hopf_curve, threshold_map
from steadyslip.figures.paper_figure_7 import ANGLES, critical_stiffness_against_mass
from steadyslip.figures.style import journal, save_with_footer
from steadyslip.figures.tolerance_bars import tolerances
from steadyslip.figures.two_rigs import two_rigs
from steadyslip.linear import ModeChart, Modes
from steadyslip.machine.machine import Machine
from steadyslip.maps import MapResult, Refined, Sensitivity
from steadyslip.motion import History
from steadyslip.nonlinear import Basin, CycleBranch, FrequencyResponse, FrozenVerdicts, HopfCurve, Hunt
from steadyslip.verdict import Analysis, RigComparison, Tolerated

__all__ = [
    "ANGLES",
    "basin",
    "comparison",
    "corner",
    "critical_stiffness_against_mass",
    "cycle_branch",
    "eigenvalue_plane",
    "fit",
    "frequency_response",
    "frozen_verdicts",
    "history",
    "hopf_curve",
    "hunting",
    "journal",
    "kicks",
    "machine_fit",
    "machine_sketch",
    "machine_verdict",
    "map_figure",
    "mode_chart",
    "mode_shape",
    "phase_plane",
    "population",
    "prediction",
    "profile",
    "ranking",
    "record",
    "refined",
    "root_locus",
    "sensitivity",
    "stability_chart",
    "stable_ranges",
    "steps",
    "threshold_map",
    "tolerances",
    "two_rigs",
]


def _verdict(found: Analysis, ax: Axes | None = None) -> Any:
    return machine_verdict(found) if found.rig.in_forces else _locus(found, ax)


def _locus(found: Analysis, ax: Axes | None = None, stiffness: Any = None) -> Axes:
    return root_locus(found.rig, ax, stiffness)


for _name in __all__:
    if isinstance(_drawn := globals()[_name], FunctionType):  # only functions, not the tuple ANGLES
        globals()[_name] = in_written_units(_drawn)
saved_by(save_with_footer, journal)
register_figures(
    Analysis, verdict=_verdict, locus=_locus, ranges=stable_ranges, mode=mode_shape, eigenvalues=eigenvalue_plane
)
register_figures(Modes, mode=mode_shape)
register_figures(ModeChart, chart=mode_chart)
register_figures(Machine, sketch=machine_sketch)
register_figures(History, history=history, phase=phase_plane)
register_figures(CycleBranch, branch=cycle_branch)
register_figures(HopfCurve, curve=hopf_curve)
register_figures(Basin, basin=basin)
register_figures(FrequencyResponse, response=frequency_response)
register_figures(FrozenVerdicts, verdicts=frozen_verdicts)
register_figures(Hunt, hunting=hunting)
register_figures(Record, record=record)
register_figures(Fit, fit=fit, steps=steps, corner=corner)
register_figures(MachineFit, fit=machine_fit)
register_figures(Draws, corner=corner)
register_figures(Profile, profile=profile)
register_figures(LawComparison, comparison=comparison)
register_figures(Population, population=population)
register_figures(Ranking, ranking=ranking)
register_figures(Prediction, prediction=prediction, kicks=kicks)
register_figures(MapResult, map=map_figure)
register_figures(Refined, refined=refined)
register_figures(Sensitivity, sensitivity=sensitivity)
register_figures(Tolerated, tolerances=tolerances)
register_figures(RigComparison, rigs=two_rigs)
