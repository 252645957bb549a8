"""Friction laws: friction stress τ(v, σ, memory), rates of the memory variables, and the steady state."""

from steadyslip.laws.friction.bristle import Coulomb, CoulombStribeck, LuGre
from steadyslip.laws.friction.evolution import PRZ, Aging, Evolution, Nagata, Slip
from steadyslip.laws.friction.law import FrictionLaw, State
from steadyslip.laws.friction.normal_memory import LinkerDieterich, NoMemory, NormalMemory, PrakashClifton
from steadyslip.laws.friction.rate_state import RateState

USUAL = RateState.name
"""Default friction law of rig files."""


def weakest(share: float) -> FrictionLaw:
    """Coulomb law with a given, usually tiny, friction coefficient: for control loops without friction."""
    return Coulomb(mu_coulomb=share)


__all__ = [
    "PRZ", "USUAL", "Aging", "Coulomb", "CoulombStribeck", "Evolution", "FrictionLaw", "LinkerDieterich", "LuGre",
    "Nagata", "NoMemory", "NormalMemory", "PrakashClifton", "RateState", "Slip", "State", "weakest",
]  # fmt: skip
