"""Rig of the paper."""

from __future__ import annotations

from steadyslip.laws.contact import InclinedSpring
from steadyslip.laws.friction import LinkerDieterich, RateState, Slip
from steadyslip.machine.drive import SteadyDrive
from steadyslip.machine.slider import Slider
from steadyslip.units import GPa, MPa, deg, m, s, um

D_C = 1 * um
V0 = 1 * um / s


def paper_rig(angle: float = -45 * deg) -> Slider:
    """Inclined spring of the paper (section 4) at a spring angle (rad); stiffness 9 GPa/m, no mass.

    The paper gives neither v0 nor a stiffness; both are round numbers without effect on dimensionless results.
    """
    rock = RateState(
        a=0.0145, b=0.0160, d_c=D_C, mu_ref=0.7, v_ref=V0, evolution=Slip(), normal_memory=LinkerDieterich(alpha=0.56)
    )
    contact = InclinedSpring(preload=5 * MPa, angle=angle)
    return Slider(friction=rock, contact=contact, stiffness=9 * GPa / m, drive=SteadyDrive(V0))
