"""The Model: everything that is known of a rig, as expressions; the waist through which all later stages go.

It knows laws and machines by what their methods return, and no stage that asks it: neither kernels nor protocols.
"""

from steadyslip.model.build import build_model
from steadyslip.model.equations import Contact, Model, Variable
from steadyslip.model.point import OperatingPoint, operating_point

__all__ = ["Contact", "Model", "OperatingPoint", "Variable", "build_model", "operating_point"]
