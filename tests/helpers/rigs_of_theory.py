"""Rigs that several test files start from: the paper's numbers, every contact, every law with one memory."""

import numpy as np
import pytest

import steadyslip as ss

A, B, D_C, V0, SIGMA = 0.0145, 0.0160, 1e-6, 1e-6, 5e6
EPS = np.finfo(float).eps


def rate_state(**changes):
    return ss.laws.RateState(**({"a": A, "b": B, "d_c": D_C, "mu_ref": 0.7, "v_ref": V0} | changes))


def rig(**changes):
    parts = {
        "friction": rate_state(),
        "contact": ss.laws.ConstantNormalStress(preload=SIGMA),
        "stiffness": 7e9,
        "drive": ss.machine.SteadyDrive(V0),
    }
    return ss.Slider(**(parts | changes))


CONTACTS = (
    ss.laws.ConstantNormalStress(preload=SIGMA),
    ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5),
    ss.laws.SliderCrank(preload=SIGMA, crank_angle=1.0, crank_radius=0.1, rod_length=0.3),
    ss.laws.Triaxial(confining_pressure=SIGMA, angle=0.5),
    ss.laws.SelfEnergising(preload=SIGMA, gain=0.4),
    ss.laws.LeadScrew(axial_load=SIGMA, lead_angle=0.2, direction="lowering"),
    ss.laws.DilatingLayer(preload=SIGMA, ram_stiffness=1e11, dilatancy=1e-8, v_ref=V0),
    ss.laws.Lift(preload=SIGMA, lift=1e11, v_ref=V0),
    ss.laws.SlopedGuide(preload=SIGMA, guide_stiffness=1e10, slope=0.1),
    ss.laws.LinearNormalStress(steady_normal_stress=SIGMA, b0=2e9, b1=1e10, b2=0.3, b3=2e9),
)
ONE_MEMORY = (
    rate_state(),
    rate_state(evolution=ss.laws.Aging(), normal_memory=ss.laws.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.laws.PRZ(), regularised=True, normal_memory=ss.laws.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.laws.Nagata(c_nagata=0.7), normal_memory=ss.laws.LinkerDieterich(alpha=0.4)),
    rate_state(evolution=ss.laws.Nagata(c_nagata=0.7), regularised=True),
    ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=10, viscous=5),
)


def plain_guide(**changes):
    """Axis of 240 kg on a dry guide, forces on 200 cm²: sticks and slips at .5 mm/min, and rings after each slip."""
    friction = ss.laws.LuGre(
        mu_coulomb=0.11, mu_static=0.19, v_stribeck=8e-3 / 60, bristle_stiffness=125000, viscous=1.25,
        **{"stribeck_exponent": 0.8, "bristle_damping": 0.0} | changes,
    )  # fmt: skip
    return ss.Slider(
        friction=friction, contact=ss.laws.ConstantNormalStress(preload=3200 / 0.02), stiffness=12e6 / 0.02,
        mass=240 / 0.02, damping=5e3 / 0.02, area=0.02, drive=ss.machine.SteadyDrive(0.5e-3 / 60),
    )  # fmt: skip


STICKING = ss.Slider(
    friction=ss.laws.CoulombStribeck(mu_coulomb=0.2, mu_static=0.3, v_stribeck=1e-3, viscous=0.5),
    contact=ss.laws.ConstantNormalStress(preload=1e5), stiffness=1e8, mass=100.0, drive=ss.machine.SteadyDrive(1e-3),
)  # fmt: skip

LAWS = {
    "slip": ONE_MEMORY[0],
    "aging+ld": ONE_MEMORY[1],
    "prz regularised+ld": ONE_MEMORY[2],
    "nagata+ld": ONE_MEMORY[3],
    "nagata regularised": ONE_MEMORY[4],
    "lugre": ONE_MEMORY[5],
    "two states": rate_state(
        b=None, d_c=None, states=(ss.laws.State(b=0.01, d_c=1e-6), ss.laws.State(b=0.008, d_c=2e-5))
    ),
    "prakash-clifton": rate_state(normal_memory=ss.laws.PrakashClifton()),
    "prakash-clifton g": rate_state(normal_memory=ss.laws.PrakashClifton(direct_share=0.5)),
    "b=0": rate_state(b=0.0),
    "aging b<0": rate_state(evolution=ss.laws.Aging(), b=-0.002),
}


def quarter(which):
    """Every fourth combination of law, contact and mass; each law meets each contact in the first two parts."""
    return [
        pytest.param(law, contact, mass, id=f"{law}-{contact.name}-{'mass' if mass else 'massless'}")
        for i, law in enumerate(LAWS)
        for j, contact in enumerate(CONTACTS)
        for k, mass in enumerate((0.0, 1e9))
        if (i + j + 2 * k) % 4 == which
    ]
