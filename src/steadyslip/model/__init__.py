"""The Model: the symbolic equations of a rig, from which all later stages are derived.

This folder depends on the methods of laws and rigs; it does not depend on kernels, motion or stability.
"""

from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.sliding import steady_state, steady_states
from steadyslip.model.steady_results import SteadyContact, SteadyMachine, SteadySliding

__all__ = [
    "Model",
    "SteadyContact",
    "SteadyMachine",
    "SteadySliding",
    "build_model",
    "steady_state",
    "steady_states",
]
