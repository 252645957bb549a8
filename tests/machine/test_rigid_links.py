"""Rigid links: two bodies joined are those of ever stiffer links, to rounding, whichever end is kept."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from machines import rate_state, surface
from stiff_machines import worst

AXIS = """
[bodies.motor]
motion = "rotation"
inertia = 2e-3
[bodies.nut]
mass = 3.0
force = 1.5
[bodies.table]
mass = 40.0
[links.coupling]
kind = "shaft"
between = ["drive", "motor"]
stiffness = 900.0
damping = 0.1
[links.thread]
kind = "screw"
between = ["motor", "nut"]
lead = 0.01
stiffness = {stiffness}
[links.bracket]
between = ["nut", "table"]
stiffness = 1e6
damping = 20.0
[links.buffer]
between = ["table", "ground"]
damping = 8.0
[contacts.guide]
body = "table"
friction = {{ law = "rate-state", a = 0.01, b = 0.014, d_c = "10 um", mu_ref = 0.4, v_ref = "1 mm/s" }}
contact = {{ law = "constant", preload = 500.0 }}
[contacts.seal]
body = "nut"
friction = {{ law = "lugre", mu_coulomb = 0.1, mu_static = 0.2, v_stribeck = 0.01, bristle_stiffness = 1e5, \
viscous = 0.5, bristle_damping = 10.0 }}
contact = {{ law = "constant", preload = 30.0 }}
[drive]
control = "rotary-steady"
velocity = 0.2
"""


def read(tmp_path, stiffness):
    path = tmp_path / "axis.toml"
    path.write_text(AXIS.format(stiffness=stiffness), encoding="utf-8")
    return ss.read_rig(path)


def slow(machine, count):
    """Eigenvalues, the fastest left out."""
    found = ss.eigenvalues(machine)
    found = found[~np.isnan(found)]
    return found[np.argsort(np.abs(found))[:count]]


@pytest.mark.filterwarnings("ignore::steadyslip.core.errors.UnitWarning")  # which is asked whether it is meant
def test_a_rigid_link_of_a_file_is_the_limit_of_a_stiff_one(tmp_path):
    """A link of 1e16 N/m leaves two roots at 1e8 1/s; without them those of one body, J + m lead², radius lead."""
    rigid, stiff = read(tmp_path, '"rigid"'), read(tmp_path, "1e16")
    assert list(rigid.bodies) == ["motor", "table"]
    assert rigid.bodies["motor"].inertia == pytest.approx(2e-3 + 3.0 * 0.01**2)
    assert rigid.bodies["motor"].torque == pytest.approx(0.015)
    assert rigid.contacts["seal"].radius == pytest.approx(0.01)
    right = slow(rigid, 6)
    assert worst(slow(stiff, 6), right) < 1e-8
    assert ss.growth_rate(rigid) == pytest.approx(ss.growth_rate(stiff), rel=1e-8)
    assert len(ss.state_space(rigid).A) == 6
    own, others = (ss.steady_state(one).contacts["seal"].friction_force for one in (rigid, stiff))
    assert own == pytest.approx(others, rel=1e-12)


def chain(drive=None, **contacts):
    """Gears, a screw and tables: motor - shaft - gear - screw - table, with a plate on a spring."""
    law = rate_state(0.5, -0.3, 1.0)
    return ss.Machine(
        bodies={
            "motor": ss.machine.RotatingBody(inertia=2.0), "wheel": ss.machine.RotatingBody(inertia=0.5, torque=0.1),
            "table": ss.machine.SlidingBody(mass=5.0), "plate": ss.machine.SlidingBody(mass=1.0),
        },
        links={
            "gear": ss.machine.Shaft(between=("motor", "wheel"), gear=0.5, stiffness=70.0, damping=0.2),
            "screw": ss.machine.Screw(between=("wheel", "table"), lead=2.0, stiffness=30.0, damping=0.1),
            "clamp": ss.machine.Spring(between=("table", "plate"), stiffness=20.0, damping=0.3),
            "stop": ss.machine.Spring(between=("ground", "plate"), damping=0.2),
        },
        contacts={"guide": surface("plate", law), **contacts},
        drive=drive or ss.machine.RotaryPD(velocity=1.0, body="motor", measured="table", kp=40.0, kd=1.0),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "acts"),
    [
        ("screw", "motor"),
        *(pytest.param(n, "motor", marks=pytest.mark.campaign) for n in ("gear", "clamp")),
        *(pytest.param(n, "table", marks=pytest.mark.campaign) for n in ("gear", "screw", "clamp")),
    ],
)
def test_joined_bodies_move_as_those_of_a_link_ever_stiffer(name, acts):
    """Ends that turn, that slide and one of each, the drive on either side; k is 1e10 times the others'."""
    drive = (
        None
        if acts == "motor"
        else ss.machine.PositionPD(velocity=1.0, body="table", measured="motor", kp=40.0, kd=1.0)
    )
    machine = chain(
        drive, brake=surface("table", ss.laws.CoulombStribeck(mu_coulomb=0.2, mu_static=0.2, v_stribeck=1.0))
    )
    if name == "screw" and acts == "table":
        machine = replace(machine, links=dict(machine.links) | {"gear": replace(machine.links["gear"], damping=0.0)})
    one = ss.machine.joined(machine, f"links.{name}")
    assert len(one.bodies) == 3
    count = int(np.sum(~np.isnan(ss.eigenvalues(one))))
    stiff = machine.with_values({f"links.{name}.stiffness": 1e12})
    assert worst(slow(stiff, count), slow(one, count)) < 1e-7


def test_what_cannot_be_joined_says_why(tmp_path):
    machine = chain()
    with pytest.raises(ss.UnknownNameError, match="screws"):
        ss.machine.joined(machine, "screws")
    with pytest.raises(ss.NotAvailable, match=r"links\.stop cannot be rigid: it ends at the ground"):
        ss.machine.joined(machine, "stop")
    for place, given in ((2, (["screw"],)), (3, ("screw", ["stop"]))):
        with pytest.raises(ss.ParameterError, match=rf"^argument {place}: got \[.*; allowed: the name of a link"):
            ss.machine.joined(machine, *given)
    path = tmp_path / "axis.toml"
    path.write_text(AXIS.format(stiffness=1e5).replace("stiffness = 900.0", 'stiffness = "rigid"'), encoding="utf-8")
    with pytest.raises(ss.RigFileError, match=r"links\.coupling cannot be rigid: it ends at the drive"):
        ss.read_rig(path)
