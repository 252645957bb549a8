"""Contact laws: normal stress as a function of displacement, velocity, acceleration and forces."""

from steadyslip.laws.contact.basic import ConstantNormalStress, LinearNormalStress, Prescribed, pressed_at
from steadyslip.laws.contact.compliant import Compliant
from steadyslip.laws.contact.fluid import PoreFluid, porous
from steadyslip.laws.contact.law import ContactInputs, ContactLaw, PreloadedContact
from steadyslip.laws.contact.mechanisms import (
    DilatingLayer,
    InclinedSpring,
    LeadScrew,
    Lift,
    SelfEnergising,
    SliderCrank,
    SlopedGuide,
    Transmitted,
    Triaxial,
)

USUAL = ConstantNormalStress.name
"""Default contact law of rig files."""

__all__ = [
    "USUAL",
    "Compliant",
    "ConstantNormalStress",
    "ContactInputs",
    "ContactLaw",
    "DilatingLayer",
    "InclinedSpring",
    "LeadScrew",
    "Lift",
    "LinearNormalStress",
    "PoreFluid",
    "PreloadedContact",
    "Prescribed",
    "SelfEnergising",
    "SliderCrank",
    "SlopedGuide",
    "Transmitted",
    "Triaxial",
    "porous",
    "pressed_at",
]  # fmt: skip
