"""Hunting with a contact that a load presses (`transmitted`), by a second route."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from hunting_under_load import KINDS, compared, random_numbers, rig_of
from steadyslip.protocol import DisplacementStep, VelocityStep

EXAMPLES = Path(__file__).parents[3] / "examples"
CLOSE = {"coulomb": 1e-8, "viscous": 1e-8, "lugre": 1e-6}
"""Of SciPy's 1e-12 and 1e-10 a step, which begins anew at each of some hundred events or samples."""


@pytest.mark.parametrize("kind", KINDS, ids=" ".join)
def test_an_axis_moves_as_by_scipy(kind):
    difference, found = compared(np.random.default_rng([1, 3]), kind, until=6.0)
    assert difference < CLOSE[kind[1]]
    assert found.strokes


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS, ids=" ".join)
def test_random_axes_move_as_by_scipy(kind):
    assert max(compared(np.random.default_rng([2, i]), kind)[0] for i in range(4)) < CLOSE[kind[1]]


@pytest.mark.parametrize("law", ["coulomb", "viscous", "lugre"])
def test_a_preload_of_its_own_contact_is_the_same_axis(law):
    """As servos are written: one contact with a preload, one that the load presses, on one body."""
    one = rig_of(random_numbers(np.random.default_rng(8), "machine", law, "continuous"))
    guide = one.contacts["guide"]
    seals = replace(guide, loaded_by=None, contact=ss.laws.ConstantNormalStress(preload=guide.contact.preload))
    mesh = replace(guide, contact=replace(guide.contact, preload=0.0))
    two = replace(one, contacts={"seals": seals, "mesh": mesh})
    found = [ss.hunt(rig, DisplacementStep(at=0, by=1.0), until=10.0) for rig in (one, two)]
    assert found[0].strokes[-1].start == pytest.approx(found[1].strokes[-1].start, rel=1e-6)
    assert found[0].error[-1] == pytest.approx(found[1].error[-1], rel=1e-6)


def test_viscous_friction_of_a_load_does_not_ask_at_which_radius_it_is_written():
    """At twice the radius half the load presses, by twice the lever, at twice the speed."""
    m, found = ss.machine, []
    for radius, viscous in ((1.0, 0.6), (2.0, 0.3)):
        law = ss.laws.Coulomb(mu_coulomb=0.8, mu_static=1.0, viscous=viscous)
        contacts = {
            "seal": m.Surface(body="motor", radius=1.0, friction=ss.laws.Coulomb(mu_coulomb=0.5, mu_static=1.0),
                                    contact=ss.laws.ConstantNormalStress(preload=1.0)),
            "mesh": m.Surface(body="motor", radius=radius, friction=law,
                                    contact=ss.laws.Transmitted(transmitted=0.3)),
        }  # fmt: skip
        drive = m.RotaryPID(body="motor", velocity=0.0, kp=3.0, kd=4.0, ki=1.0)
        rig = ss.Machine(bodies={"motor": m.RotatingBody(inertia=1.0)}, links={}, contacts=contacts, drive=drive)
        found.append(ss.hunt(rig, DisplacementStep(at=0, by=1.0), until=20.0))
    assert found[0].strokes
    assert [one.start for one in found[0].strokes] == pytest.approx([one.start for one in found[1].strokes], rel=1e-7)
    assert found[0].error[-1] == pytest.approx(found[1].error[-1], rel=1e-7)


@pytest.mark.parametrize("sampled", [{}, {"drive.sample_time": 0.05}], ids=["continuous", "sampled"])
def test_without_a_share_the_preload_alone_presses(sampled):
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml").with_values(sampled)
    loaded = replace(held, contact=ss.laws.Transmitted(preload=1.0, transmitted=0.0))
    one, two = (ss.hunt(rig, until=60.0) for rig in (held, loaded))
    assert [a.start for a in one.strokes] == pytest.approx([b.start for b in two.strokes], rel=1e-6)


@pytest.mark.parametrize("sampled", [{}, {"sample_time": 0.05}], ids=["continuous", "sampled"])
def test_a_load_that_turns_at_once_presses_at_once(sampled):
    """From 1 N to -1.5 N the contact holds 1 + 0.5 · 1.5 N; it slid, pressed by 1 - 0.5 · 1.5 N for no time at all."""
    drive = ss.machine.PID(0.0, kp=1.0, kd=0.0, ki=0.0, **sampled)
    contact = ss.laws.Transmitted(preload=1.0, transmitted=0.5)
    law = ss.laws.Coulomb(mu_coulomb=0.7, mu_static=1.0)
    rig = ss.Slider(friction=law, contact=contact, mass=1.0, area=1.0, drive=drive)
    turned = [DisplacementStep(at=0, by=1.0), DisplacementStep(at=1.0, by=-2.5)]
    found = ss.hunt(rig, turned, until=3.0)
    assert found.strokes == ()
    assert found.force[-1] == pytest.approx(-1.5)


def test_friction_at_rest_that_bristles_would_decide_is_refused():
    """It said that contacts switch between rest and sliding without time passing."""
    one = rig_of(random_numbers(np.random.default_rng(8), "machine", "lugre", "continuous"))
    seal = ss.machine.Surface(
        body="motor", friction=ss.laws.Coulomb(mu_coulomb=0.5), contact=ss.laws.ConstantNormalStress(preload=1.0)
    )
    two = replace(one, contacts={**one.contacts, "seal": seal})
    with pytest.raises(ss.NotAvailable, match=r"contacts.seal.friction: .* contacts.guide, .* write law = 'lugre' in "):
        ss.hunt(two)


def test_what_hunting_cannot_take_is_refused_with_the_way_out():
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml")
    loaded = replace(held, contact=ss.laws.Transmitted(preload=1.0, transmitted=0.1))
    inclined = replace(held, contact=ss.laws.InclinedSpring(preload=1.0, angle=-0.1))
    with pytest.raises(ss.NotAvailable, match=r"'inclined-spring' lets .* takes 'constant' .* or 'transmitted'"):
        ss.hunt(inclined)
    free = replace(loaded, contact=ss.laws.Transmitted(transmitted=0.1))
    with pytest.raises(ss.ParameterError, match=r"friction at rest without a load is 0 .*, such as .displacement-step"):
        ss.hunt(free)


@pytest.mark.parametrize("sampled", [{}, {"drive.sample_time": 0.01}], ids=["continuous", "sampled"])
@pytest.mark.parametrize("law", [ss.laws.Coulomb(mu_coulomb=0.5), None], ids=["coulomb", "lugre"])
def test_an_axis_that_nothing_presses_at_first_moves(law, sampled):
    """It follows a ramp, and the integral brings the error to zero."""
    held = ss.read_rig(EXAMPLES / "hunting-axis.toml").with_values(sampled)
    free = replace(held, friction=law or held.friction, contact=ss.laws.Transmitted(transmitted=0.1))
    found = ss.hunt(free, VelocityStep(at=0, to=0.1), until=60.0)
    assert np.abs(found.error).max() > 0.01
    assert abs(found.error[-1]) < 1e-3


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("inclined-spring.toml", "drive.velocity: got .*: write velocity = 0, and control = 'pid' with gains$"),
        ("machines/feed-axis.toml", "drive.velocity: got .*: write velocity = 0$"),  # has a controller
        ("machines/geared-servo.toml", "drive.velocity: got .*: write velocity = 0$"),
    ],
)
def test_an_axis_that_slides_is_told_the_controller_of_its_motion(name, words):
    with pytest.raises(ss.ParameterError, match=words):
        ss.hunt(ss.read_rig(EXAMPLES / name))


def test_a_shaft_at_constant_speed_is_told_the_rotary_controller():
    with pytest.raises(ss.ParameterError, match="0 to hold a place with control = 'rotary-pid'"):
        ss.machine.RotaryPull(velocity=0.0)
    m = ss.machine
    surface = m.Surface(body="arm", radius=1.0, friction=ss.laws.Coulomb(mu_coulomb=0.5),
                        contact=ss.laws.ConstantNormalStress(preload=1.0))  # fmt: skip
    arm = ss.Machine(bodies={"arm": m.RotatingBody(inertia=1.0)}, contacts={"seal": surface},
                     links={"shaft": m.Shaft(between=("drive", "arm"), stiffness=1e4)},
                     drive=m.RotaryPull(velocity=1.0))  # fmt: skip
    with pytest.raises(ss.ParameterError, match="and control = 'rotary-pid' with gains"):
        ss.hunt(arm)
