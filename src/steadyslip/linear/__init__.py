"""Linear stability of steady sliding: eigenvalues, edges, formulas, transfer functions, modes.

Independent of the folder `motion`; tests, and layers above both folders, compare their results.
"""

from __future__ import annotations

from steadyslip.core.errors import UndecidedWarning
from steadyslip.linear import paper
from steadyslip.linear.boundary import Margin, boundary, margins
from steadyslip.linear.formula import formula
from steadyslip.linear.identification.identify import IdentifiedModes, identified_modes
from steadyslip.linear.mode_changes import ModeChange
from steadyslip.linear.mode_chart import ModeChart, mode_chart
from steadyslip.linear.mode_origin import Origin
from steadyslip.linear.mode_table import Modes, modes
from steadyslip.linear.modes import Mode
from steadyslip.linear.response import Response, small_signal
from steadyslip.linear.search import Boundary
from steadyslip.linear.stable_values import safety_factor, stable_values
from steadyslip.linear.state_space import state_space, to_control
from steadyslip.linear.status import stability
from steadyslip.linear.stiffness import (
    critical_stiffness,
    eigenvalues,
    growth_rate,
    stable_stiffness,
)

__all__ = [
    "Boundary",
    "IdentifiedModes",
    "Margin",
    "Mode",
    "ModeChange",
    "ModeChart",
    "Modes",
    "Origin",
    "Response",
    "UndecidedWarning",
    "boundary",
    "critical_stiffness",
    "eigenvalues",
    "formula",
    "growth_rate",
    "identified_modes",
    "margins",
    "mode_chart",
    "modes",
    "paper",
    "safety_factor",
    "small_signal",
    "stability",
    "stable_stiffness",
    "stable_values",
    "state_space",
    "to_control",
]
