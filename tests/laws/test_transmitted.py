"""Contacts pressed by the load that they carry: inclined springs, and servo friction with load terms."""

import math

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import rate_state, rig
from steadyslip.testing import CONTACT_CHECKS, Surroundings

JOINT = """
[bodies.motor]
motion = "rotation"
inertia = "2 kg m^2"
[bodies.arm]
motion = "rotation"
inertia = "5 kg m^2"
torque = "-0.6 N m"
[links.gear]
kind = "shaft"
between = ["motor", "arm"]
stiffness = "2e4 N m/rad"
[links.winding]
kind = "shaft"
between = ["drive", "motor"]
stiffness = "1e4 N m/rad"
[contacts.seals]
body = "motor"
radius = "1 m"
[contacts.seals.friction]
law = "coulomb"
mu_coulomb = 1
viscous = "0.04 s/m"
[contacts.seals.contact]
law = "constant"
preload = "0.03 N"
[contacts.mesh]
body = "motor"
radius = "1 m"
loaded_by = "gear"
[contacts.mesh.friction]
law = "coulomb-stribeck"
mu_coulomb = 0.2
mu_static = 1
v_stribeck = "9 m/s"
stribeck_exponent = 1.3
[contacts.mesh.contact]
law = "transmitted"
transmitted = 0.10
transmitted_back = 0.12
[drive]
control = "rotary-steady"
velocity = "2 rad/s"
"""
SERVOS = {
    # F_c, F_s; of the load: F_cτ, F_sτ; of the motor's torque: b, b_s; v_s, α, F_v, inertia
    "xl320": (6.936756e-9, 0.01628865, 0.158058, 0.2462341, 3.027099e-8, 7.425588e-9, 2.302667, 1.703662, 0.007224488,
              0.001162383),
    "xl330": (0.002039181, 5.468353e-9, 0.2582576, 0.1170081, 0.2300757, 5.004478e-7, 0.2225873, 2.328838, 0.01868655,
              0.002568503),
}  # fmt: skip
"""Parameter sets "m5" of Duclusaud et al. (2025), as published in Rhoban/bam, to 7 digits; N m, rad, s, kg m²."""
MEMORY = {"normal_memory": ss.laws.LinkerDieterich(alpha=0.3)}


def carried(share, **more):
    return ss.laws.Transmitted(preload=5e6, transmitted=share, **more)


@pytest.mark.parametrize("check", CONTACT_CHECKS)
@pytest.mark.parametrize("contact", [carried(0.4), carried(0.4, transmitted_back=0.1)], ids=repr)
def test_contract(contact, check):
    check(contact, Surroundings())


def test_a_pulled_block_is_an_inclined_spring():
    """σ = σ0 + g T is an inclined spring with tan ψ = −g: same steady sliding, edges, eigenvalues and motion."""
    own = {"friction": rate_state(**MEMORY), "mass": 1e3, "damping": 1e8}
    a = rig(contact=carried(0.4, transmitted_back=0.9), **own)
    b = rig(contact=ss.laws.InclinedSpring(preload=5e6, angle=-math.atan(0.4)), **own)
    assert ss.steady_state(a).normal_stress == pytest.approx(ss.steady_state(b).normal_stress, rel=1e-14)
    assert ss.critical_stiffness(a) == pytest.approx(ss.critical_stiffness(b), rel=1e-13)
    np.testing.assert_allclose(ss.eigenvalues(a), ss.eigenvalues(b), rtol=1e-10)
    step = ss.protocol.VelocityStep(at=1, to=1.1e-6)
    ends = [ss.simulate(one, step, until=20)["v"][-1] for one in (a, b)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_lock_up_names_the_share():
    found = ss.analyze(rig(contact=carried(1.5)))
    assert found.stable is None
    assert "the transmitted share must be below 1/μss = 1.429" in found.reason
    (edge,) = (one for one in found.boundaries if one.parameter == "contact.transmitted")
    assert edge.value == pytest.approx(1 / 0.7, rel=1e-10)  # brackets of lock-up are that wide


@pytest.mark.parametrize("load", [-0.6, -0.1, 0.1, 0.6])
@pytest.mark.parametrize("speed", [0.5, 2.0, 20.0])
def test_servo_friction_with_load_terms(load, speed):
    """F_c0 + F_cτ|τ| + F_sτ|τ| exp(−|v/v_s|^α) + F_v v, as of Bittencourt et al. 2010, as two contacts.

    The load τ is the torque of the link behind the gear; its share differs by direction.
    """
    joint = ss.rig_from_text(JOINT).with_values({"arm.torque": load, "drive.velocity": speed})
    steady = ss.steady_state(joint)
    total = sum(one.friction_force for one in steady.contacts.values())
    share = 0.10 if load > 0 else 0.12  # an arm that falls, load > 0, drives the motor
    stribeck = share * abs(load) * (0.2 + 0.8 * math.exp(-((speed / 9) ** 1.3)))
    assert total == pytest.approx(0.03 * (1 + 0.04 * speed) + stribeck, rel=1e-11)


def servo_contact(name, constant, falling, stribeck, alpha, viscous, pressed):
    """A contact of the motor whose friction is constant + falling exp(−(v/v_s)^α) + viscous v, N m or of a torque."""
    total = constant + falling
    return f"""
[contacts.{name}.friction]
law = "coulomb-stribeck"
mu_static = 1
mu_coulomb = {constant / total}
v_stribeck = "{stribeck} m/s"
stribeck_exponent = {alpha}
viscous = "{viscous / total} s/m"
[contacts.{name}.contact]
{pressed.format(total)}
[contacts.{name}]
body = "motor"
radius = "1 m"
"""


@pytest.mark.parametrize("speed", [0.05, 1.0, 6.0])
@pytest.mark.parametrize("servo", SERVOS)
def test_published_servos_are_rigs(servo, speed):
    """The motor works against a load τ: it takes τ and all friction F, which also grows by b (τ + F).

    So F is what it is at b = 0, with b added to the shares of τ, all over 1 - b. Published b hardly depend on speed.
    """
    seals, more, load, load_more, b, b_more, stribeck, alpha, viscous, inertia = SERVOS[servo]
    bodies = JOINT.split("[contacts.seals]")[0].replace("2 kg m^2", f"{inertia} kg m^2")
    curve, over = (stribeck, alpha), 1 - b
    contacts = servo_contact(
        "seals", seals / over, more / over, *curve, viscous / over, 'law = "constant"\npreload = "{} N"'
    )
    mesh = servo_contact(
        "mesh", (load + b) / over, load_more / over, *curve, 0, 'law = "transmitted"\ntransmitted = {}'
    )
    drive = f'[drive]\ncontrol = "rotary-steady"\nvelocity = "{speed} rad/s"\n'
    rig = ss.rig_from_text(f'{bodies}{contacts}{mesh}loaded_by = "gear"\n{drive}')
    total = sum(one.friction_force for one in ss.steady_state(rig).contacts.values())
    fades, torque = math.exp(-((speed / stribeck) ** alpha)), 0.6
    own, share = seals + more * fades + viscous * speed, b + b_more * fades
    expected = (own + (load + load_more * fades + share) * torque) / (1 - share)
    assert total == pytest.approx(expected, rel=2e-6)
    assert ss.analyze(rig).stable is not None


def test_a_page_of_it_is_written(tmp_path):
    page = ss.explore(rig(contact=carried(0.4)))
    page.save(tmp_path / "page.html")
    assert "transmitted" in (tmp_path / "page.html").read_text()
