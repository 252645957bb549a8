"""The Model: the symbolic equations of a rig, from which all later stages are derived.

This folder depends on the methods of laws and rigs; it does not depend on kernels, motion or stability.
"""

from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.sliding import SteadyContact, SteadyMachine, SteadySliding, steady_state, steady_states

__all__ = [
    "Model",
    "SteadyContact",
    "SteadyMachine",
    "SteadySliding",
    "build_model",
    "steady_state",
    "steady_states",
]
