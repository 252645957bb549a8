"""Contact laws: the normal stress as a function of displacement, velocity, acceleration and forces."""

from steadyslip.contact.basic import Constant, Linear, Prescribed
from steadyslip.contact.law import ContactLaw, Motion, PreloadedContact
from steadyslip.contact.mechanisms import (
    DilatingLayer,
    InclinedSpring,
    LeadScrew,
    Lift,
    SelfEnergising,
    SliderCrank,
    SlopedGuide,
    Triaxial,
)

__all__ = [
    "Constant",
    "ContactLaw",
    "DilatingLayer",
    "InclinedSpring",
    "LeadScrew",
    "Lift",
    "Linear",
    "Motion",
    "PreloadedContact",
    "Prescribed",
    "SelfEnergising",
    "SliderCrank",
    "SlopedGuide",
    "Triaxial",
]
