"""Verdict on one rig: steady sliding, linear stability and edges of stability, as numbers and as text.

Imports no maps, figures or documents.
"""

from steadyslip.files.specifications.tolerance_tables import Adjustment, Tolerances, read_tolerances
from steadyslip.verdict.analysis import Analysis
from steadyslip.verdict.analyze import analyze
from steadyslip.verdict.compare import RigComparison, compare_rigs
from steadyslip.verdict.cure_window import Window
from steadyslip.verdict.cures import Cures, cure
from steadyslip.verdict.rig_differences import Difference
from steadyslip.verdict.tolerances import Tolerated, tolerate
from steadyslip.verdict.unknown import StableWithin, ValuesWithin, stable_within

__all__ = [
    "Adjustment",
    "Analysis",
    "Cures",
    "Difference",
    "RigComparison",
    "StableWithin",
    "Tolerances",
    "Tolerated",
    "ValuesWithin",
    "Window",
    "analyze",
    "compare_rigs",
    "cure",
    "read_tolerances",
    "stable_within",
    "tolerate",
]
