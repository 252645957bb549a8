"""The verdict on one rig: gathers steady sliding, linear stability and edges, and says it in words.

Knows no maps, figures or documents.
"""

from steadyslip.files.specifications.tolerances import Adjustment, Tolerances, read_tolerances
from steadyslip.verdict.analyze import Analysis, analyze
from steadyslip.verdict.cures import Cures, Window, cure
from steadyslip.verdict.machine import MachineAnalysis
from steadyslip.verdict.tolerances import Tolerated, tolerate
from steadyslip.verdict.unknown import StableWithin, ValuesWithin, stable_within

__all__ = [
    "Adjustment",
    "Analysis",
    "Cures",
    "MachineAnalysis",
    "StableWithin",
    "Tolerances",
    "Tolerated",
    "ValuesWithin",
    "Window",
    "analyze",
    "cure",
    "read_tolerances",
    "stable_within",
    "tolerate",
]
