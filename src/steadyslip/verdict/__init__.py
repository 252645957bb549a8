"""The verdict on one rig: gathers steady sliding, linear stability and edges, and says it in words."""

from steadyslip.verdict.analyze import Analysis, analyze

__all__ = ["Analysis", "analyze"]
