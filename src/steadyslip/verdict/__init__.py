"""The verdict on one rig: gathers steady sliding, linear stability and edges, and says it in words.

Knows no maps, figures or documents.
"""

from steadyslip.verdict.analyze import Analysis, analyze
from steadyslip.verdict.machine import MachineAnalysis
from steadyslip.verdict.tolerances import Tolerated, tolerate

__all__ = ["Analysis", "MachineAnalysis", "Tolerated", "analyze", "tolerate"]
