"""The verdict on one rig: gathers steady sliding, linear stability and edges, and says it in words.

Knows no maps, figures or documents.
"""

from steadyslip.files.specifications.tolerances import Adjustment, Tolerances, read_tolerances
from steadyslip.verdict.analyze import Analysis, analyze
from steadyslip.verdict.machine import MachineAnalysis
from steadyslip.verdict.tolerances import Tolerated, tolerate

__all__ = [
    "Adjustment",
    "Analysis",
    "MachineAnalysis",
    "Tolerances",
    "Tolerated",
    "analyze",
    "read_tolerances",
    "tolerate",
]
