"""Contact laws: normal stress as a function of displacement, velocity, acceleration and forces."""

from steadyslip.laws.contact.basic import Constant, Linear, Prescribed, pressed_at
from steadyslip.laws.contact.compliant import Compliant
from steadyslip.laws.contact.fluid import PoreFluid, porous
from steadyslip.laws.contact.law import ContactLaw, Motion, PreloadedContact
from steadyslip.laws.contact.mechanisms import (
    DilatingLayer,
    InclinedSpring,
    LeadScrew,
    Lift,
    SelfEnergising,
    SliderCrank,
    SlopedGuide,
    Triaxial,
)

USUAL = Constant.name
"""Default contact law of rig files."""

__all__ = [
    "USUAL", "Compliant", "Constant", "ContactLaw", "DilatingLayer", "InclinedSpring", "LeadScrew", "Lift", "Linear",
    "Motion", "PoreFluid", "PreloadedContact", "Prescribed", "SelfEnergising", "SliderCrank", "SlopedGuide",
    "Triaxial", "porous", "pressed_at",
]  # fmt: skip
