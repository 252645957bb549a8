"""Protocols: what the load point, the normal stress and a disturbance do in the course of an experiment.

pieces -> Protocol -> segments (one lane or many) -> kernels
"""

from steadyslip.protocol.inputs import evaluate
from steadyslip.protocol.load_point import (
    DisplacementStep,
    Hold,
    LoadPointTable,
    SlideHoldSlide,
    VelocityHarmonic,
    VelocityRamp,
    VelocityStep,
)
from steadyslip.protocol.protocol import Piece, Protocol
from steadyslip.protocol.segments import Segments, pack
from steadyslip.protocol.stress import (
    DisturbanceHarmonic,
    DisturbancePulse,
    DisturbanceRamp,
    DisturbanceStep,
    DisturbanceTable,
    NormalStressHarmonic,
    NormalStressPulse,
    NormalStressRamp,
    NormalStressStep,
    NormalStressTable,
)

__all__ = [
    "DisplacementStep",
    "DisturbanceHarmonic",
    "DisturbancePulse",
    "DisturbanceRamp",
    "DisturbanceStep",
    "DisturbanceTable",
    "Hold",
    "LoadPointTable",
    "NormalStressHarmonic",
    "NormalStressPulse",
    "NormalStressRamp",
    "NormalStressStep",
    "NormalStressTable",
    "Piece",
    "Protocol",
    "Segments",
    "SlideHoldSlide",
    "VelocityHarmonic",
    "VelocityRamp",
    "VelocityStep",
    "evaluate",
    "pack",
]
