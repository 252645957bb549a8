"""Rigs that are kicked in tests."""

import steadyslip as ss
from rigs_of_theory import SIGMA, rate_state, rig


def tilted(angle, factor, **more):
    base = rig(friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56)),
               contact=ss.laws.InclinedSpring(preload=SIGMA, angle=angle), **more)  # fmt: skip
    return base.with_values({"stiffness": factor * ss.critical_stiffness(base)})


def heavy(law, factor, mass, a=0.01, b=0.015):
    """The rigs of the issue: constant 5 MPa, mu .6."""
    base = ss.Slider(
        friction=ss.laws.RateState(a=a, b=b, d_c=1e-6, mu_ref=0.6, v_ref=1e-6, evolution=law),
        contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=1e10, mass=mass,
        drive=ss.machine.SteadyDrive(1e-6),
    )  # fmt: skip
    return base.with_values({"stiffness": factor * ss.critical_stiffness(base)})
