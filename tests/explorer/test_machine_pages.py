"""Pages of machines: what they say is what Python says, to rounding, and in the same words."""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from explored import ExploredMachine, MovedOnAPage, differences, same_motion
from machines import at_random, surface, two_mass
from steadyslip.explorer.assembly import page_parts
from steadyslip.explorer.equations import linear_part
from steadyslip.explorer.machine_sketch import machine_sketch
from steadyslip.explorer.motion import OPTIONS
from steadyslip.files.specifications.read import rig_from_text
from steadyslip.kernels.layout import Setting
from steadyslip.linear.status import status
from steadyslip.model.point import operating_point
from steadyslip.motion.jobs import prepare

MACHINES = Path(__file__).parents[2] / "examples" / "machines"
NAMES = sorted(path.stem for path in MACHINES.glob("*.toml"))


def example(name):
    return ss.read_rig(MACHINES / f"{name}.toml")


@pytest.mark.parametrize("name", NAMES)
def test_a_machine_is_judged_as_in_python(name):
    """Verdict, eigenvalues, mode in words, and the exact stable values of whatever enters linearly."""
    machine = example(name)
    explored = ExploredMachine(machine)
    assert differences(explored, machine, machine.of_kind("stiffness")) == []
    faster = machine.with_values({"drive.velocity": 5 * machine.value("drive.velocity")})
    assert differences(explored, faster) == []


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(40))
def test_machines_drawn_at_random_are_judged_as_in_python(seed):
    machine, _ = at_random(seed)
    gains = machine.of_kind("stiffness")
    assert differences(ExploredMachine(machine), machine, gains[:1]) == []


@pytest.mark.parametrize("changes", [
    {"contacts.mesh.friction.mu_ref": 3.0, "contacts.mesh.contact.angle": "80 deg"},
    {"contacts.mesh.contact.preload": 1e-3, "contacts.mesh.contact.angle": "-40 deg"},
    {"contacts.guide.friction.mu_ref": 2.0},
])  # fmt: skip
def test_contacts_that_press_on_each_other_slide_or_do_not_as_in_python(changes):
    machine = example("geared-servo").with_values(changes)
    assert differences(ExploredMachine(machine), machine) == []


@pytest.mark.parametrize("name", NAMES)
def test_settings_of_a_page_are_those_of_python(name):
    """Scales of bodies and contacts, tolerances, limits: printed from the lines that arrays go through."""
    machine = example(name)
    jobs = prepare(machine, (), 1.0, {}, {}, OPTIONS)
    expected = jobs.tables(jobs.runner(1, True), 0, 1, True, True)[2][0]
    expected[Setting.GUESS] = 0.0
    np.testing.assert_allclose(MovedOnAPage(machine).settings(machine), expected, rtol=1e-14)


def disturbances(machine, at):
    """What a page asks for, the same in Python, and what it starts from."""
    body, contact = list(machine.bodies)[-1], list(machine.contacts)[-1]
    steady = ss.steady_state(machine)
    v0, force = machine.value("drive.velocity"), 0.01 * steady.contacts[contact].normal_force
    blown = {f"{body}.v": 3 * steady.speeds[body]}
    return [
        ({"disturbance": "velocity", "size": 2.0}, ss.protocol.VelocityStep(at=at, to=2 * v0), {}),
        ({"disturbance": "pull", "on": body, "size": force}, ss.protocol.DisturbanceStep(at=at, by=force, on=body), {}),
        (
            {"disturbance": "normal", "on": contact, "size": force},
            ss.protocol.NormalStressStep(at=at, by=force, on=contact),
            {},
        ),
        ({"disturbance": "hold", "size": at}, ss.protocol.Hold(at=at, duration=at), {}),
        ({"disturbance": "blow", "on": body, "size": 3.0}, (), blown),
    ]


def moves_as_python(machine, which, until):
    found = MovedOnAPage(machine)
    for asked, piece, initial in [disturbances(machine, until / 12)[i] for i in which]:
        runs = [ss.simulate(machine, piece, until=until, rtol=rtol, initial=initial) for rtol in (1e-6, 1e-9)]
        same_motion(found(machine, **asked, at=until / 12, until=until), runs, until)


def test_a_machine_moves_on_a_page_as_in_python():
    """Slip events of each contact, velocities, forces and places; disturbed at a named body and a named contact."""
    moves_as_python(example("geared-servo"), (1, 2), 40.0)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "until"), [
    ("brake-pad", 0.016), ("feed-axis", 6.0), ("geared-servo", 55.0), ("telescope", 4.0), ("two-guides", 3.0),
])  # fmt: skip
def test_examples_move_on_pages_as_in_python(name, until):
    moves_as_python(example(name), range(5), until)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(0, 40, 2))
def test_machines_drawn_at_random_move_on_pages_as_in_python(seed):
    machine, _ = at_random(seed)
    try:
        found = MovedOnAPage(machine)
    except ss.NotAvailable as refused:
        with pytest.raises(ss.NotAvailable, match=re.escape(str(refused)[:40])):
            ss.simulate(machine, until=1.0)
        return
    (asked, piece, _), *_ = disturbances(machine, 1.0)
    runs = [ss.simulate(machine, piece, until=8.0, rtol=rtol) for rtol in (1e-6, 1e-9)]
    same_motion(found(machine, **asked, at=1.0, until=8.0), runs, 8.0)


def test_a_delay_is_refused_in_words():
    late = two_mass().with_values({"drive.delay": 0.01})
    with pytest.raises(ss.NotAvailable, match="delay does not have; use steadyslip analyze"):
        linear_part(late)


def test_a_machine_has_one_steady_sliding():
    with pytest.raises(ss.ParameterError, match="allowed: 0"):
        ss.explore(example("brake-pad"), branch=1)


def test_the_file_of_a_page_is_the_machine_to_the_last_digit():
    """The template, filled with other values, reads as the machine with these values."""
    machine = example("geared-servo")
    _, known = page_parts(machine, "geared", 0)
    values = [one["value"] * (1.1 if one["value"] else 1.0) for one in known["parameters"]]
    filled = "".join(one if isinstance(one, str) else one[1] + repr(values[one[0]]) + one[2] for one in known["toml"])
    changes = {one["name"]: value for one, value in zip(known["parameters"], values, strict=True)}
    assert rig_from_text(filled) == machine.with_values(changes)


@pytest.mark.parametrize("name", [*NAMES, "inclined-spring", "stick-slip", "two-states", "slow-axis"])
def test_a_page_is_below_215_kilobytes(name):
    own = example(name) if name in NAMES else ss.read_rig(MACHINES.parent / f"{name}.toml")
    assert len(ss.explore(own, title=name).html.encode()) < 215_000


@pytest.mark.parametrize("name", NAMES)
def test_the_sketch_of_a_page_has_everything_that_moves(name):
    machine = example(name)
    text = machine_sketch(machine)
    assert set(re.findall(r'data-body="([^"]+)"', text)) == set(machine.bodies)
    ends = [tuple(sorted(one.split())) for one in re.findall(r'data-bodies="([^"]*)"', text)]
    held = [tuple(sorted(end for end in link.between if end in machine.bodies)) for link in machine.links.values()]
    assert sorted(ends) == sorted(held)
    assert "nan" not in text
    assert not re.search(r">[^<]*\d (k|M|G|µ|m)?(N|kg|m|rad)\b", text)  # numbers change on the page, not in the sketch
    for one in (*machine.bodies, *machine.links, *machine.contacts):
        assert one in text


VANISHING = (
    "bodies.p.mass", "bodies.q.mass", "links.s.damping", "links.t.damping", "contacts.c.friction.bristle_damping",
    "contacts.c.friction.viscous",
)  # fmt: skip


@pytest.mark.parametrize("without", [(), ("bodies.q.mass",), ("bodies.p.mass",)])
def test_what_vanishes_on_a_page_is_judged_as_in_python(without):
    """Masses, dampings and what a bristle adds at once, each set to 0 or not: up to four powers of s are lost."""
    law = ss.laws.LuGre(
        mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800.0, viscous=80.0
    )
    machine = ss.Machine(
        bodies={"p": ss.machine.SlidingBody(mass=1.0), "q": ss.machine.SlidingBody(mass=0.5)},
        links={
            "s": ss.machine.Spring(between=("drive", "q"), stiffness=1e5, damping=3.0),
            "t": ss.machine.Spring(between=("q", "p"), stiffness=2e5, damping=2.0),
        },
        contacts={"c": surface("p", law, load=100.0)},
        drive=ss.machine.Pull(velocity=1e-3),
    ).with_values(dict.fromkeys(without, 0.0))
    explored, names = ExploredMachine(machine), [name for name in VANISHING if name not in without]
    for kept in product((0.0, 1.0), repeat=len(names)):
        vary = {name: share * machine.value(name) for name, share in zip(names, kept, strict=True)}
        point = operating_point(machine, {name: np.array([value]) for name, value in vary.items()})
        values = [float(np.ravel(one)[0]) for one in point.arguments]
        found = explored.script("linear.set(values).assess().status", values=values)
        assert found == int(status(point)[0]) == int(status(operating_point(machine.with_values(vary)))), vary
