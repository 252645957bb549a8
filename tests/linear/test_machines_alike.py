"""What changes nothing: machines that are one another in other words have the same eigenvalues."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from machines import at_random, leading, rate_state, surface, three_bodies, two_mass
from steadyslip.core.dimensions import unit


def test_names_and_their_order_do_not_matter():
    machine = three_bodies()
    new = {"motor": "z", "table": "a-body", "head": "M"}
    links = {f"l{i}": replace(one, between=tuple(new.get(e, e) for e in one.between)) for i, one in
             enumerate([*machine.links.values()][::-1])}  # fmt: skip
    contacts = {f"c-{i}": replace(one, body=new[one.body]) for i, one in enumerate([*machine.contacts.values()][::-1])}
    other = ss.Machine(
        bodies={new[n]: machine.bodies[n] for n in list(machine.bodies)[::-1]}, links=links, contacts=contacts,
        drive=replace(machine.drive, body=new[machine.drive.body]),
    )  # fmt: skip
    assert ss.eigenvalues(other) == pytest.approx(ss.eigenvalues(machine), rel=1e-11)


def test_a_rigid_link_makes_one_body_of_two():
    """The error falls with the stiffness, order one; damping grows with it."""
    whole = replace(
        two_mass(kd=3.0), bodies={"motor": ss.machine.SlidingBody(mass=0.0), "table": ss.machine.SlidingBody(mass=7.0)}
    )
    tied = {k: two_mass(kd=3.0).with_values({"links.screw.stiffness": k, "links.screw.damping": 1e-2 * k}) for k in
            (1e4, 1e5, 1e6, 1e7)}  # fmt: skip
    exact = leading(whole.with_values({"links.screw.stiffness": 1e12}))
    errors = np.array([abs(leading(one) - exact) for one in tied.values()])
    order = -np.diff(np.log10(errors))
    assert order == pytest.approx(np.ones(3), abs=0.02)


def test_two_guides_are_one_with_their_loads_together():
    one = two_mass()
    guide = one.contacts["guide"]
    half = {name: replace(guide, contact=ss.laws.ConstantNormalStress(preload=0.5)) for name in ("left", "right")}
    both = replace(one, contacts=half)
    a, b = ss.eigenvalues(one), ss.eigenvalues(both)
    extra = np.argmin([np.min(np.abs(a - s)) < 1e-9 for s in b])  # the states may differ: that decays at v/d_c
    assert b[extra] == pytest.approx(-1.0, rel=1e-9)
    assert np.delete(b, extra) == pytest.approx(a, rel=1e-9)


def test_an_area_only_says_in_what_the_laws_are_given():
    one = two_mass()
    guide = one.contacts["guide"]
    spread = replace(guide, area=0.25, contact=ss.laws.ConstantNormalStress(preload=4.0))
    assert ss.eigenvalues(replace(one, contacts={"guide": spread})) == pytest.approx(ss.eigenvalues(one), rel=1e-12)
    assert ss.steady_state(replace(one, contacts={"guide": spread})).contacts["guide"].normal_force == pytest.approx(
        1.0
    )


def test_a_motor_behind_a_screw_is_a_mass_on_the_slide():
    """J = m l², gains times l², speed over l: the same axis."""
    one, lead = two_mass(kp=4.0, kd=0.7), 0.3
    turning = ss.Machine(
        bodies={"motor": ss.machine.RotatingBody(inertia=2.0 * lead**2), "table": ss.machine.SlidingBody(mass=5.0)},
        links={"screw": ss.machine.Screw(between=("motor", "table"), lead=lead, stiffness=100.0, damping=0.5)},
        contacts=one.contacts,
        drive=ss.machine.RotaryPD(velocity=1 / lead, body="motor", kp=4.0 * lead**2, kd=0.7 * lead**2),
    )
    assert ss.eigenvalues(turning) == pytest.approx(ss.eigenvalues(one), rel=1e-11)
    away = replace(turning, drive=replace(turning.drive, measured="table"))
    assert ss.eigenvalues(away) == pytest.approx(ss.eigenvalues(two_mass(kp=4.0, kd=0.7, measured="table")), rel=1e-11)
    assert ss.steady_state(turning).links["screw"] == pytest.approx(0.6)


def test_a_gear_and_a_radius_change_speed_torque_and_stiffness_as_they_should():
    """A wheel of radius R behind a gear n: the same rubbing as a mass J/R² pulled through springs k/R² and k/(nR)²."""
    n, radius = 5.0, 0.2
    friction = rate_state(0.5, -0.3, 1.0)
    geared = ss.Machine(
        bodies={"motor": ss.machine.RotatingBody(inertia=0.1), "wheel": ss.machine.RotatingBody(inertia=1e-3)},
        links={
            "shaft": ss.machine.Shaft(between=("drive", "motor"), stiffness=10.0),
            "gear": ss.machine.Shaft(between=("motor", "wheel"), gear=n, stiffness=1e3, damping=1.0),
        },
        contacts={"rim": surface("wheel", friction, radius=radius)},
        drive=ss.machine.RotaryPull(velocity=1.0),
    )
    lever = n * radius
    straight = ss.Machine(
        bodies={
            "motor": ss.machine.SlidingBody(mass=0.1 / lever**2),
            "wheel": ss.machine.SlidingBody(mass=1e-3 / radius**2),
        },
        links={
            "shaft": ss.machine.Spring(between=("drive", "motor"), stiffness=10.0 / lever**2),
            "gear": ss.machine.Spring(between=("motor", "wheel"), stiffness=1e3 / radius**2, damping=1.0 / radius**2),
        },
        contacts={"rim": surface("wheel", friction)},
        drive=ss.machine.Pull(velocity=lever),
    )
    assert geared.speeds() == {"motor": 1.0, "wheel": 5.0}
    assert ss.steady_state(geared).contacts["rim"].slip_rate == pytest.approx(1.0)
    assert ss.steady_state(geared).links == pytest.approx({"shaft": 0.6 * lever, "gear": 0.6 * radius})
    assert ss.eigenvalues(geared) == pytest.approx(ss.eigenvalues(straight), rel=1e-9)


def test_a_cascade_beside_its_motor_is_a_pid_controller():
    axis = two_mass()
    kv, kp, tn = 0.8, 3.0, 2.5
    cascade = ss.machine.Cascade(velocity=1.0, body="motor", kv=kv, kp=kp, tn=tn)
    pid = ss.machine.PositionPID(velocity=1.0, body="motor", kp=kp * (kv + 1 / tn), kd=kp, ki=kp * kv / tn)
    one, two = (ss.eigenvalues(replace(axis, drive=drive)) for drive in (cascade, pid))
    assert one == pytest.approx(two, rel=1e-11)
    scale = replace(cascade, measured="table")
    assert ss.eigenvalues(replace(axis, drive=scale))[0] != pytest.approx(one[0], rel=1e-3)


def test_a_gear_whose_friction_grows_with_its_torque_is_an_inclined_spring():
    """σ = σ0 + g T with T the force of the link that loads it: the slider with −tan ψ in place of g."""
    gain, friction = 0.4, rate_state(0.5, -0.3, 1.0)
    tooth = ss.laws.InclinedSpring(preload=2.0, angle=-np.arctan(gain))
    machine = ss.Machine(
        bodies={"gear": ss.machine.SlidingBody(mass=1.0), "load": ss.machine.SlidingBody()},
        links={
            "shaft": ss.machine.Spring(between=("drive", "gear"), stiffness=3.0),
            "coupling": ss.machine.Spring(between=("gear", "load"), stiffness=5.0),
        },
        contacts={"mesh": ss.machine.Surface(body="gear", friction=friction, contact=tooth, loaded_by="shaft")},
        drive=ss.machine.Pull(velocity=1.0),
    )
    slider = ss.Slider(friction=friction, contact=tooth, stiffness=3.0, mass=1.0, drive=ss.machine.SteadyDrive(1.0))
    assert ss.eigenvalues(machine) == pytest.approx(ss.eigenvalues(slider), rel=1e-11)
    dragged = replace(machine, contacts={**machine.contacts, "drum": surface("load", friction, load=3.0)})
    sigma = (2.0 + gain * 1.8) / (1 - 0.6 * gain)  # the gear carries the friction of the load as well
    assert ss.steady_state(dragged).contacts["mesh"].normal_force == pytest.approx(sigma)


def _in_the_plane(belt):
    """A pad on three links over a compliant disc; with `belt` links end at the ground and the drive moves the disc."""
    held, lean = ("ground", -1.0) if belt else ("drive", 1.0)
    rubs = {"body": "drive", "against": "pad"} if belt else {"body": "pad"}
    return ss.Machine(
        bodies={"pad": ss.machine.PlanarBody(mass=1.0, press=1.0), "tail": ss.machine.SlidingBody(mass=0.2)},
        links={
            "arm": ss.machine.Spring(between=(held, "pad"), stiffness=0.7, damping=0.02),
            "lining": ss.machine.Spring(between=(held, "pad"), stiffness=0.1, direction="normal"),
            "caliper": ss.machine.Spring(between=(held, "pad"), stiffness=0.6, angle=lean * np.pi / 5),
            "hook": ss.machine.Spring(between=("pad", "tail"), stiffness=0.4),
            "air": ss.machine.Spring(between=("ground" if not belt else "drive", "tail"), damping=0.1),
        },
        contacts={
            "disc": ss.machine.Surface(
                **rubs, friction=rate_state(0.3, -0.1, 1.0), contact=ss.laws.Compliant(normal_stiffness=0.8)
            )
        },
        drive=ss.machine.Pull(velocity=1.0),
    )


def test_what_moves_and_what_stands_is_a_matter_of_view():
    """Seen from the drive the ground moves: a block on a belt is a block pulled over the ground, in the mirror."""
    pulled, belt = _in_the_plane(False), _in_the_plane(True)
    assert ss.eigenvalues(belt) == pytest.approx(ss.eigenvalues(pulled), rel=1e-11)
    assert ss.stable_values(belt, "hook.stiffness") == pytest.approx(ss.stable_values(pulled, "hook.stiffness"))
    a, b = ss.steady_state(pulled), ss.steady_state(belt)
    assert b.contacts["disc"].normal_force == pytest.approx(a.contacts["disc"].normal_force, rel=1e-12)
    assert b.links["arm"] == pytest.approx(-a.links["arm"], rel=1e-12)


def test_a_belt_that_a_tilted_spring_presses_on_is_the_ground_in_the_mirror():
    """The contact law sees what holds the block against what it slides on, be that the drive or the ground."""
    for law in (
        ss.laws.InclinedSpring(steady_normal_stress=1.4, angle=-0.5),
        ss.laws.LinearNormalStress(steady_normal_stress=1.4, b2=0.3),
    ):

        def machine(belt, law=law):
            held, base = ("ground", "drive") if belt else ("drive", "ground")
            rubs = {"body": "drive", "against": "b"} if belt else {"body": "b"}
            return ss.Machine(
                bodies={"b": ss.machine.SlidingBody(mass=0.5), "c": ss.machine.SlidingBody(mass=2.0)},
                links={
                    "k": ss.machine.Spring(between=(held, "b"), stiffness=3.0, damping=0.1),
                    "tie": ss.machine.Spring(between=("b", "c"), stiffness=1.0, damping=0.1),
                    "drag": ss.machine.Spring(between=(base, "b"), damping=0.4),
                },
                contacts={"s": ss.machine.Surface(**rubs, friction=rate_state(0.5, -0.3, 1.0), contact=law)},
                drive=ss.machine.Pull(velocity=1.0),
            )

        assert ss.eigenvalues(machine(True)) == pytest.approx(ss.eigenvalues(machine(False)), rel=1e-10)


def test_a_belt_moves_a_block_as_the_ground_does():
    def block(belt):
        ends, rubs = ("ground", {"body": "drive", "against": "b"}) if belt else ("drive", {"body": "b"})
        return ss.Machine(
            bodies={"b": ss.machine.SlidingBody(mass=0.5)},
            links={"k": ss.machine.Spring(between=(ends, "b"), stiffness=1.0)},
            contacts={"c": surface(friction=rate_state(0.5, -0.3, 1.0), **rubs)},
            drive=ss.machine.Pull(velocity=1.0),
        )

    times = np.linspace(0, 20, 30)
    pulled = ss.simulate(block(False), until=20.0, initial={"b.v": 1.3}, times=times)
    belt = ss.simulate(block(True), until=20.0, initial={"b.v": -0.3}, times=times)
    assert belt["c.slip_rate"] == pytest.approx(pulled["c.slip_rate"], rel=1e-6)
    assert belt["b.x"] == pytest.approx(-pulled["b.x"], abs=1e-6)


def test_a_body_and_a_contact_may_have_the_same_name():
    """Also where the contact slides at another rate than the body moves; and a-b and a_b are two bodies."""

    def machine(first, second, rubs):
        bodies = {
            first: ss.machine.SlidingBody(mass=2.0),
            second: ss.machine.SlidingBody(mass=0.5),
            "post": ss.machine.SlidingBody(mass=0.1),
        }
        links = {
            "pull": ss.machine.Spring(between=("drive", first), stiffness=3.0, damping=0.2),
            "tie": ss.machine.Spring(between=(first, second), stiffness=2.0),
            "held": ss.machine.Spring(between=("ground", "post"), stiffness=5.0, damping=0.1),
        }
        contacts = {rubs: surface(second, rate_state(0.5, -0.3, 1.0), against="post"),
                    "other": surface(first, rate_state(0.4, 0.1, 2.0))}  # fmt: skip
        return ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=ss.machine.Pull(velocity=1.0))

    plain = machine("one", "two", "rub")
    for names in (("one", "two", "post"), ("one", "two", "two"), ("one", "two", "one"), ("a-b", "a_b", "a-b")):
        other = machine(*names)
        assert ss.eigenvalues(other) == pytest.approx(ss.eigenvalues(plain), rel=1e-9)
        for key in ("friction.b", "contact.preload"):
            (edge, *_), (same, *_) = (
                ss.boundary(rig, f"contacts.{name}.{key}") for rig, name in ((plain, "rub"), (other, names[2]))
            )
            assert edge.value == pytest.approx(same.value, rel=1e-9)


NAMES = [
    "Theta", "v", "x", "slip", "links", "E", "I", "N", "friction", "pi", "S", "Q", "lambda", "t", "k", "exp", "normal",
    "push", "integral", "pull", "bodies", "load", "sigma", "tau", "mass", "None", "nan", "kg", "beta", "a-b", "a_b",
]  # fmt: skip
"""What quantities, units, constants and words of Python are called; the same may name a body, a link and a contact."""


def in_other_words(machine, random):
    """The same machine with other names in another order, and what its parameters are called then."""
    kinds = machine.bodies, machine.links, machine.contacts
    new = [dict(zip(kind, random.choice(NAMES, len(kind), replace=False).tolist(), strict=True)) for kind in kinds]
    end = {"ground": "ground", "drive": "drive", **new[0]}
    bodies, links, contacts = (random.permutation(list(kind)).tolist() for kind in kinds)
    drive = machine.drive
    if drive.driven():
        drive = replace(drive, body=end[drive.body], measured=end[drive.measured])
    other = ss.Machine(
        bodies={new[0][n]: machine.bodies[n] for n in bodies},
        links={new[1][n]: replace(one := machine.links[n], between=tuple(end[e] for e in one.between)) for n in links},
        contacts={
            new[2][n]: replace(one := machine.contacts[n], body=end[one.body], against=end[one.against])
            for n in contacts
        },
        drive=drive,
    )
    tables = dict(zip(("bodies", "links", "contacts"), new, strict=True))

    def called(name):
        table, member, *rest = name.split(".")
        return ".".join([table, tables[table][member], *rest]) if table in tables else name

    return other, called


@pytest.mark.slow
@pytest.mark.campaign
def test_random_machines_are_the_same_under_any_names():
    random = np.random.default_rng(7)
    for seed in range(12):
        machine = at_random(seed)[0]
        other, _ = in_other_words(machine, random)
        own, same = ss.eigenvalues(machine), ss.eigenvalues(other)
        assert [np.min(np.abs(same - s)) for s in own] == pytest.approx(np.zeros(len(own)), abs=1e-9 * abs(own).max())
        assert ss.growth_rate(ss.rig_from_text(ss.rig_to_text(other))) == pytest.approx(
            ss.growth_rate(machine), rel=1e-7
        )


def in_units(machine, sizes):
    """The same machine in smaller units of mass, length, time and angle; and by how much numbers of a unit grow."""

    def grows(unit_name):
        return float(np.prod(np.power(sizes, unit(unit_name)[1])))

    changed = {n: a.value * grows(a.role.unit) for n, a in machine.parameters().items() if a.value}
    return machine.with_values(changed), grows


@pytest.mark.parametrize("seed", [5, 8])
def test_stable_values_do_not_depend_on_units_names_or_idle_bodies(seed):
    """Nor is rounding of zero taken for an edge, at 1e-16 of a stiffness."""
    machine = at_random(seed)[0]
    along = next(name for name in machine.parameters() if name.startswith("links.") and name.endswith("stiffness"))
    name = {5: "contacts.c2.friction.a", 8: "contacts.c0.friction.b"}[seed]
    values = machine.value(name) * np.array([0.5, 1.0, 2.0])
    own = ss.stable_values(machine, along, {name: values})
    assert np.all(np.isnan(own) | (own == 0) | (own > 1e-12 * machine.value(along)))
    other, grows = in_units(machine, (1e3, 2e-4, 7e2, 1.0))
    roles = machine.parameters()
    found = ss.stable_values(other, along, {name: values * grows(roles[name].role.unit)})
    np.testing.assert_allclose(found / grows(roles[along].role.unit), own, rtol=1e-7)
    other, called = in_other_words(machine, np.random.default_rng(seed))
    np.testing.assert_allclose(ss.stable_values(other, called(along), {called(name): values}), own, rtol=1e-7)
    idle = replace(
        machine,
        bodies={**machine.bodies, "idle": ss.machine.SlidingBody(mass=3.0)},
        links={**machine.links, "idle": ss.machine.Spring(between=("ground", "idle"), stiffness=7.0, damping=1.0)},
    )
    np.testing.assert_allclose(ss.stable_values(idle, along, {name: values}), own, rtol=1e-7)
