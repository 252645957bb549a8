"""The Model: the symbolic equations of a rig, from which all later stages are derived.

This folder depends on the methods of laws and rigs; it does not depend on kernels, motion or stability.
"""

from steadyslip.model.build import build_model
from steadyslip.model.equations import Contact, Model, Variable
from steadyslip.model.point import OperatingPoint, operating_point

__all__ = ["Contact", "Model", "OperatingPoint", "Variable", "build_model", "operating_point"]
