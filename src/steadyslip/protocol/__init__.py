"""Protocols: time histories of load point, normal stress and disturbances in an experiment.

pieces -> Protocol -> segments (one lane or many) -> kernels. A protocol drives numbered channels; it does not depend
on laws or rigs.
"""

from steadyslip.protocol.pieces import (
    Creep,
    CreepRamp,
    CreepStep,
    CreepTable,
    DisplacementStep,
    DisturbanceHarmonic,
    DisturbancePulse,
    DisturbanceRamp,
    DisturbanceStep,
    DisturbanceTable,
    Hold,
    InjectionHarmonic,
    InjectionPulse,
    InjectionRamp,
    InjectionStep,
    InjectionTable,
    LoadPointTable,
    NormalStressHarmonic,
    NormalStressPulse,
    NormalStressRamp,
    NormalStressStep,
    NormalStressTable,
    SlideHoldSlide,
    VelocityHarmonic,
    VelocityRamp,
    VelocityStep,
)
from steadyslip.protocol.protocol import Piece, Protocol

__all__ = [
    "Creep", "CreepRamp", "CreepStep", "CreepTable", "DisplacementStep", "DisturbanceHarmonic", "DisturbancePulse",
    "DisturbanceRamp", "DisturbanceStep", "DisturbanceTable", "Hold", "InjectionHarmonic", "InjectionPulse",
    "InjectionRamp", "InjectionStep", "InjectionTable", "LoadPointTable", "NormalStressHarmonic", "NormalStressPulse",
    "NormalStressRamp", "NormalStressStep", "NormalStressTable", "Piece", "Protocol", "SlideHoldSlide",
    "VelocityHarmonic", "VelocityRamp", "VelocityStep",
]  # fmt: skip
