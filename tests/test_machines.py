"""Machines: theory 11's values, one body as a slider, what changes nothing, motion typed by hand, steady sliding."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from machines import at_random, brake, coulomb, rate_state, surface, three_bodies, two_blocks, two_mass
from steadyslip.linear.polynomials import roots
from steadyslip.model import build_model, operating_point
from steadyslip.model.linearisation import characteristic_coefficients

V = 1e-6


def leading(machine):
    return ss.eigenvalues(machine)[0]


# --- theory 11 --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("machine", "expected"),
    [
        (two_mass(kp=1.0, kd=3.0), -0.1750677262665799273 + 0.306510921457497034j),
        (two_mass(kp=10.0, kd=3.0), -0.199854608025679 + 1.11548151338012j),
        (brake(coulomb(1.1 * 0.1 / 0.24)), 0.0476240575692899 + 1.04988954221831j),
    ],
)
def test_rightmost_roots_of_theory_11(machine, expected):
    assert leading(machine) == pytest.approx(expected, rel=1e-12)


def test_flutter_with_rate_and_state_and_what_memory_of_normal_stress_does():
    """f = .02, S = −.01, r = .5, μ = .6 at the load that the pad has; memory of normal stress weakens the flutter."""

    def pad(alpha):
        memory = {"normal_memory": ss.LinkerDieterich(alpha=alpha, sigma_ref=1.0)} if alpha else {}
        load = 0.0
        for _ in range(60):  # the load depends on friction, which is given per load
            machine = brake(rate_state(0.02, -0.01, 0.5, load=load or 1.0, **memory))
            load = ss.steady_state(machine).contacts["disc"].normal_force
        return machine

    assert leading(pad(0.0)) == pytest.approx(0.0948386834987666 + 1.05258257673317j, rel=1e-11)
    growth = [leading(pad(alpha)).real for alpha in (0.0, 0.1, 0.2, 0.3)]
    assert np.all(np.diff(growth) < 0)


def test_edges_of_the_two_mass_axis():
    """Measured at the motor: stable above one gain, or at every one with more damping; at the table: a window."""
    assert ss.stable_values(two_mass(), "drive.kp") == pytest.approx(
        np.array([[2.63049277701904763, np.inf]]), rel=1e-11
    )
    assert ss.stable_values(two_mass(kd=3.0), "drive.kp").tolist() == [[0.0, np.inf]]
    ((low, high),) = ss.stable_values(two_mass(measured="table"), "drive.kp")
    assert (low, high) == (pytest.approx(2.5, abs=0.1), pytest.approx(114.0, abs=1.0))
    for edge in (low, high):
        assert abs(leading(two_mass(kp=edge, measured="table")).real) < 1e-11


@pytest.mark.parametrize(
    ("slope", "coupling", "critical"),
    [(-0.5, 0.7, 0.525), (-0.1, 0.1, 0.366029866987392913), (-0.1, 1e-9, 0.525), (-0.1, 1e9, 0.315)],
)
def test_critical_stiffness_of_two_blocks(slope, coupling, critical):
    """Alike: that of one. Unlike, hardly coupled: that of the worse; tied together: that of one with the mean S."""

    def growth(k):
        return leading(two_blocks(k, slope, coupling)).real

    near = 1e-8 if coupling == 1e-9 else 1e-10 if 1e-3 < coupling < 1e3 else 1e-7
    assert growth(critical * (1 - near)) > 0 > growth(critical * (1 + near))


def test_stable_values_of_a_slider_are_its_stable_stiffness():
    """By another route: where the polynomial is looked at, not p and q of the Model."""
    slider, _ = pair(FRICTIONS["two states"], CONTACTS["inclined"], DRIVES["pull"], False)
    assert ss.stable_values(slider, "stiffness") == pytest.approx(ss.stable_stiffness(slider), rel=1e-9)


def test_friction_that_pulls_is_told():
    machine = two_mass(friction=rate_state(0.5, -0.3, 1.0, mu=0.1)).with_values({"drive.velocity": 3.0})
    (warning,) = ss.analyze(machine).warnings
    assert "contact guide is not positive" in warning


def test_coulomb_flutter_begins_where_theory_says():
    critical = 0.1 / 0.24
    assert leading(brake(coulomb(critical * (1 + 1e-8)))).real > 1e-6
    assert abs(leading(brake(coulomb(critical * (1 - 1e-8)))).real) < 1e-9


# --- one body is a slider ---------------------------------------------------------------------------

FRICTIONS = {
    "slip": ss.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V),
    "aging, Linker-Dieterich, regularised": ss.RateState(
        a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V, regularised=True, evolution=ss.Aging(),
        normal_memory=ss.LinkerDieterich(alpha=0.3),
    ),
    "Nagata": ss.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=V, evolution=ss.Nagata(c_nagata=2.0)),
    "two states": ss.RateState(
        a=0.01, mu_ref=0.6, v_ref=V, states=(ss.State(b=0.01, d_c=1e-6), ss.State(b=0.006, d_c=2e-5))
    ),
    "LuGre": ss.LuGre(
        mu_coulomb=0.5, mu_static=0.6, v_stribeck=1e-5, bristle_stiffness=1e5, bristle_damping=1.0, viscous=10.0
    ),
}  # fmt: skip
CONTACTS = {
    "constant": ss.Constant(preload=5e6),
    "inclined": ss.InclinedSpring(preload=5e6, angle=-0.3),
    "self-energising": ss.SelfEnergising(preload=5e6, gain=0.2),
    "lift": ss.Lift(preload=5e6, lift=1e11, v_ref=2e-6),
    "linear": ss.Linear(preload=5e6, b0=1e3, b1=1e9, b2=0.2, b3=-1e8),
}
DRIVES = {
    "pull": (ss.Steady(V), ss.Pull(velocity=V)),
    "pd": (ss.PD(V, kp=2e8, kd=1e9), ss.PositionPD(velocity=V, body="block", kp=2e8, kd=1e9)),
    "pid": (ss.PID(V, kp=2e8, kd=1e9, ki=1e6), ss.PositionPID(velocity=V, body="block", kp=2e8, kd=1e9, ki=1e6)),
}


def pair(friction, contact, drive, idle):
    """A slider and the machine that it is the short form of; with an idle body, assembled the general way."""
    slider = ss.Slider(
        friction=friction, contact=contact, stiffness=1e9, mass=1e4, damping=1e8, radiation_damping=2e8, drive=drive[0]
    )
    bodies = {"block": ss.SlidingBody(mass=1e4)} | ({"idle": ss.SlidingBody()} if idle else {})
    links = {
        "spring": ss.Spring(between=("drive", "block"), stiffness=1e9, damping=1e8),
        "guide": ss.Spring(between=("ground", "block"), damping=2e8),
    } | ({"hook": ss.Spring(between=("block", "idle"), stiffness=3e7)} if idle else {})
    contacts = {"slide": ss.Surface(body="block", friction=friction, contact=contact)}
    return slider, ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=drive[1])


def varied(slider, machine, count, seed):
    """The same random numbers under the names of both."""
    random = np.random.default_rng(seed)

    def around(value):
        return value * np.exp(random.uniform(-2, 2, count))

    names = {"slider.stiffness": "links.spring.stiffness", "slider.mass": "bodies.block.mass"}
    names |= {"slider.damping": "links.spring.damping", "slider.radiation_damping": "links.guide.damping"}
    if slider.drive.name != "steady":
        names |= {f"drive.{n}": f"drive.{n}" for n in ("kp", "kd", "ki") if f"drive.{n}" in slider.parameters()}
    names |= {"drive.velocity": "drive.velocity"}
    names |= {n: f"contacts.slide.{n}" for n in slider.of_kind("slip distance") + slider.of_kind("direct effect")}
    names |= {n: f"contacts.slide.{n}" for n in slider.of_kind("normal stress")}
    both = {(one, other): around(slider.value(one)) for one, other in names.items()}
    return {a: x for (a, _), x in both.items()}, {b: x for (_, b), x in both.items()}


@pytest.mark.parametrize("idle", [False, True], ids=["alone", "idle body"])
@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_machine_with_one_body_is_a_slider(friction, contact, idle):
    """On random numbers: steady normal stress, characteristic polynomial and eigenvalues, to rounding."""
    place = list(FRICTIONS).index(friction) + list(CONTACTS).index(contact)
    drive = list(DRIVES.values())[place % 3]
    slider, machine = pair(FRICTIONS[friction], CONTACTS[contact], drive, idle)
    mine, other = varied(slider, machine, 100, place)
    one, two = operating_point(slider, mine), operating_point(machine, other)
    assert two.sigmas[0] == pytest.approx(one.sigma, rel=1e-12, nan_ok=True)
    a, b = ss.eigenvalues(slider, mine), ss.eigenvalues(machine, other)
    assert np.array_equal(np.isnan(a), np.isnan(b))
    good = ~np.isnan(a).any(axis=-1)
    assert good.sum() > 50
    first, second = np.sort_complex(a[good]), np.sort_complex(b[good])
    assert second == pytest.approx(first, rel=1e-5)  # roots that nearly meet move by the root of rounding;
    # the polynomials themselves agree to rounding
    c, d = (np.stack(np.broadcast_arrays(*p.evaluate(p.model.function(characteristic_coefficients(p.model)))), -1)
            for p in (one, two))  # fmt: skip
    ratio = d[good] / c[good]
    assert ratio == pytest.approx(ratio[:, :1] * np.ones_like(ratio), rel=1e-9)


def test_a_machine_with_one_body_has_the_verdict_of_a_slider():
    slider, machine = pair(FRICTIONS["slip"], CONTACTS["inclined"], DRIVES["pull"], False)
    one, two = ss.analyze(slider), ss.analyze(machine)
    assert (one.stable, one.growth_rate, one.period) == (two.stable, two.growth_rate, two.period)
    expected = one.stable_stiffness
    assert ss.stable_values(machine, "links.spring.stiffness") == pytest.approx(np.array(expected), rel=1e-9)
    edges = {m.parameter: m.edge.value for m in one.margins if m.edge is not None}
    found = {m.parameter: m.edge.value for m in two.margins if m.edge is not None}
    same = {"contact.preload": "contacts.slide.contact.preload", "slider.mass": "bodies.block.mass"}
    same |= {f"friction.{n}": f"contacts.slide.friction.{n}" for n in ("a", "b", "d_c")}
    for name, other in same.items():
        if name in edges:
            assert found[other] == pytest.approx(edges[name], rel=1e-8), name


# --- what changes nothing ---------------------------------------------------------------------------


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
    whole = replace(two_mass(kd=3.0), bodies={"motor": ss.SlidingBody(mass=0.0), "table": ss.SlidingBody(mass=7.0)})
    tied = {k: two_mass(kd=3.0).with_values({"links.screw.stiffness": k, "links.screw.damping": 1e-2 * k}) for k in
            (1e4, 1e5, 1e6, 1e7)}  # fmt: skip
    exact = leading(whole.with_values({"links.screw.stiffness": 1e12}))
    errors = np.array([abs(leading(one) - exact) for one in tied.values()])
    order = -np.diff(np.log10(errors))
    assert order == pytest.approx(np.ones(3), abs=0.02)


def test_two_guides_are_one_with_their_loads_together():
    one = two_mass()
    guide = one.contacts["guide"]
    half = {name: replace(guide, contact=ss.Constant(preload=0.5)) for name in ("left", "right")}
    both = replace(one, contacts=half)
    a, b = ss.eigenvalues(one), ss.eigenvalues(both)
    extra = np.argmin([np.min(np.abs(a - s)) < 1e-9 for s in b])  # the states may differ: that decays at v/d_c
    assert b[extra] == pytest.approx(-1.0, rel=1e-9)
    assert np.delete(b, extra) == pytest.approx(a, rel=1e-9)


def test_an_area_only_says_in_what_the_laws_are_given():
    one = two_mass()
    guide = one.contacts["guide"]
    spread = replace(guide, area=0.25, contact=ss.Constant(preload=4.0))
    assert ss.eigenvalues(replace(one, contacts={"guide": spread})) == pytest.approx(ss.eigenvalues(one), rel=1e-12)
    assert ss.steady_state(replace(one, contacts={"guide": spread})).contacts["guide"].normal_force == pytest.approx(
        1.0
    )


def test_a_motor_behind_a_screw_is_a_mass_on_the_slide():
    """J = m l², gains times l², speed over l: the same axis."""
    one, lead = two_mass(kp=4.0, kd=0.7), 0.3
    turning = ss.Machine(
        bodies={"motor": ss.RotatingBody(inertia=2.0 * lead**2), "table": ss.SlidingBody(mass=5.0)},
        links={"screw": ss.Screw(between=("motor", "table"), lead=lead, stiffness=100.0, damping=0.5)},
        contacts=one.contacts,
        drive=ss.RotaryPD(velocity=1 / lead, body="motor", kp=4.0 * lead**2, kd=0.7 * lead**2),
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
        bodies={"motor": ss.RotatingBody(inertia=0.1), "wheel": ss.RotatingBody(inertia=1e-3)},
        links={
            "shaft": ss.Shaft(between=("drive", "motor"), stiffness=10.0),
            "gear": ss.Shaft(between=("motor", "wheel"), gear=n, stiffness=1e3, damping=1.0),
        },
        contacts={"rim": surface("wheel", friction, radius=radius)},
        drive=ss.RotaryPull(velocity=1.0),
    )
    lever = n * radius
    straight = ss.Machine(
        bodies={"motor": ss.SlidingBody(mass=0.1 / lever**2), "wheel": ss.SlidingBody(mass=1e-3 / radius**2)},
        links={
            "shaft": ss.Spring(between=("drive", "motor"), stiffness=10.0 / lever**2),
            "gear": ss.Spring(between=("motor", "wheel"), stiffness=1e3 / radius**2, damping=1.0 / radius**2),
        },
        contacts={"rim": surface("wheel", friction)},
        drive=ss.Pull(velocity=lever),
    )
    assert geared.speeds() == {"motor": 1.0, "wheel": 5.0}
    assert ss.steady_state(geared).contacts["rim"].slip_rate == pytest.approx(1.0)
    assert ss.steady_state(geared).links == pytest.approx({"shaft": 0.6 * lever, "gear": 0.6 * radius})
    assert ss.eigenvalues(geared) == pytest.approx(ss.eigenvalues(straight), rel=1e-9)


def test_a_cascade_beside_its_motor_is_a_pid_controller():
    axis = two_mass()
    kv, kp, tn = 0.8, 3.0, 2.5
    cascade = ss.Cascade(velocity=1.0, body="motor", kv=kv, kp=kp, tn=tn)
    pid = ss.PositionPID(velocity=1.0, body="motor", kp=kp * (kv + 1 / tn), kd=kp, ki=kp * kv / tn)
    one, two = (ss.eigenvalues(replace(axis, drive=drive)) for drive in (cascade, pid))
    assert one == pytest.approx(two, rel=1e-11)
    scale = replace(cascade, measured="table")
    assert ss.eigenvalues(replace(axis, drive=scale))[0] != pytest.approx(one[0], rel=1e-3)


# --- routes that share nothing ----------------------------------------------------------------------


def test_eigenvalues_are_those_of_the_motion_typed_by_hand():
    """Three bodies, three contacts, slip law with memory of normal stress: the Jacobian of rates typed here."""
    lead, j, m, h = 0.5, 0.5, 5.0, 1.0

    def rates(y):
        phi, x, z, w, v, u, one, two, three = y
        screw = 100.0 * (x - lead * phi) + 0.5 * (v - lead * w)
        column = 300.0 * (z - x) + 0.2 * (u - v)
        left = 0.5 * np.log(v) + 0.8 * one
        right = 0.4 * np.log(v) + 0.5 * two
        seal = 0.1 * np.log(u) + 0.05 * three
        return np.array([
            w - 2.0, v - 1.0, u - 1.0,
            (-2.0 * phi - 0.3 * (w - 2.0) + lead * screw) / j,
            (-screw + column - 0.3 * (v - 1.0) - left - right) / m,
            (-column - seal) / h,
            -v * (np.log(v) + one), -2.0 * v * (np.log(v) + two), -u * (np.log(u) + three),
        ])  # fmt: skip

    steady = np.array([0, 0, 0, 2.0, 1.0, 1.0, 0, 0, 0], dtype=complex)
    step = 1e-30
    jacobian = np.array([rates(steady + 1j * step * e).imag / step for e in np.eye(9)]).T
    expected = np.sort_complex(np.linalg.eigvals(jacobian))
    assert np.sort_complex(ss.eigenvalues(three_bodies())) == pytest.approx(expected, rel=1e-10)


def test_the_polynomial_is_the_determinant_of_the_equations():
    """Theory 11's matrix typed by hand for the brake pad with friction that remembers."""
    machine = brake(rate_state(0.02, -0.01, 0.5))
    load = ss.steady_state(machine).contacts["disc"].normal_force
    f, slope, r, mu = 0.02 * load, -0.01 * load, 0.5, 0.6

    def determinant(s):
        friction = s * (f * s + r * slope) / (s + r)
        return (s * s + 1.0 + friction) * (s * s + 1.2) - 0.3 * (0.3 - 0.8 * mu) if True else None

    for s in ss.eigenvalues(machine):
        assert abs(determinant(s)) < 1e-11


def test_stable_values_are_where_scans_find_the_edges():
    """Against the growth rate on a grid, for every parameter that enters linearly; others say that they do not."""
    machine = three_bodies().with_values({"drive.kp": 1.5, "drive.kd": 0.01})
    exact = 0
    for name, address in machine.parameters().items():
        if not address.value:
            continue
        try:
            intervals = ss.stable_values(machine, name)
        except ss.NotAvailable:
            continue
        exact += 1
        values = address.value * np.geomspace(1e-3, 1e3, 61)
        growth = ss.growth_rate(machine, {name: values})
        inside = np.any((values[:, None] > intervals[:, 0]) & (values[:, None] < intervals[:, 1]), axis=-1)
        clear = np.abs(growth) > 1e-9
        assert np.array_equal(inside[clear], growth[clear] < 0), name
    assert exact >= 12
    with pytest.raises(ss.NotAvailable, match=r"boundary\(rig, 'contacts.left.friction.d_c'\)"):
        ss.stable_values(machine, "contacts.left.friction.d_c")


# --- steady sliding ---------------------------------------------------------------------------------


def test_forces_of_steady_sliding():
    machine = three_bodies()
    steady = ss.steady_state(machine)
    assert steady.speeds == {"motor": 2.0, "table": 1.0, "head": 1.0}
    assert {name: one.friction_force for name, one in steady.contacts.items()} == pytest.approx(
        {"left": 0.6, "right": 0.6, "seal": 0.6}
    )
    assert steady.links == pytest.approx({"screw": 2.1, "column": 0.6, "hose": -0.3})
    pushed = machine.with_values({"bodies.head.force": -0.5})
    assert ss.steady_state(pushed).links == pytest.approx({"screw": 2.6, "column": 1.1, "hose": -0.3})
    assert "left slides at 1 m/s: normal force 1 N, friction force 600 mN, friction 0.6" in str(steady)


def test_a_gear_whose_friction_grows_with_its_torque_is_an_inclined_spring():
    """σ = σ0 + g T with T the force of the link that loads it: the slider with −tan ψ in place of g."""
    gain, friction = 0.4, rate_state(0.5, -0.3, 1.0)
    tooth = ss.InclinedSpring(preload=2.0, angle=-np.arctan(gain))
    machine = ss.Machine(
        bodies={"gear": ss.SlidingBody(mass=1.0), "load": ss.SlidingBody()},
        links={
            "shaft": ss.Spring(between=("drive", "gear"), stiffness=3.0),
            "coupling": ss.Spring(between=("gear", "load"), stiffness=5.0),
        },
        contacts={"mesh": ss.Surface(body="gear", friction=friction, contact=tooth, loaded_by="shaft")},
        drive=ss.Pull(velocity=1.0),
    )
    slider = ss.Slider(friction=friction, contact=tooth, stiffness=3.0, mass=1.0, drive=ss.Steady(1.0))
    assert ss.eigenvalues(machine) == pytest.approx(ss.eigenvalues(slider), rel=1e-11)
    dragged = replace(machine, contacts={**machine.contacts, "drum": surface("load", friction, load=3.0)})
    sigma = (2.0 + gain * 1.8) / (1 - 0.6 * gain)  # the gear carries the friction of the load as well
    assert ss.steady_state(dragged).contacts["mesh"].normal_force == pytest.approx(sigma)


def self_pressing(gain, load=1.0):
    """Two blocks in a row; the second is pressed by the pull that drags the first."""
    friction = rate_state(0.5, -0.3, 1.0)
    tooth = ss.InclinedSpring(preload=load, angle=float(-np.arctan(gain)))
    return ss.Machine(
        bodies={"one": ss.SlidingBody(), "two": ss.SlidingBody()},
        links={
            "front": ss.Spring(between=("drive", "one"), stiffness=10.0),
            "back": ss.Spring(between=("one", "two"), stiffness=10.0),
        },
        contacts={
            "fore": ss.Surface(body="one", friction=friction, contact=tooth, loaded_by="front"),
            "aft": ss.Surface(body="two", friction=friction, contact=ss.Constant(preload=2.0)),
        },
        drive=ss.Pull(velocity=1.0),
    )


def test_contacts_that_press_on_each_other_agree_or_the_one_that_fails_is_named():
    steady = ss.steady_state(self_pressing(0.5))
    assert steady.contacts["fore"].normal_force == pytest.approx((1 + 0.5 * 1.2) / (1 - 0.3))
    for gain, word in ((2.0, "lock-up at contact fore"), (-0.9, "lift-off at contact fore")):
        with pytest.raises(ss.NoSteadySliding, match=word):
            ss.steady_state(self_pressing(gain))
        found = ss.analyze(self_pressing(gain))
        assert found.stable is None
        assert word in str(found)
        assert "NO STEADY SLIDING" in str(found)
    edges = ss.boundary(self_pressing(0.5), "contacts.fore.contact.angle")
    assert {"lock-up", "lift-off"} <= {edge.kind for edge in edges}
    growing = ss.growth_rate(self_pressing(0.5), {"contacts.fore.contact.angle": -np.arctan([0.5, 2.0])})
    assert np.isfinite(growing).tolist() == [True, False]


def test_a_pad_that_is_pulled_off_is_told():
    with pytest.raises(ss.NoSteadySliding, match="lift-off at contact disc"):
        ss.steady_state(brake(coulomb(0.4), press=-1.0))


# --- modes ------------------------------------------------------------------------------------------


def test_modes_are_those_of_an_undamped_pair():
    """Two masses on a spring, hardly rubbed: they move against each other, inversely to their masses."""
    machine = two_mass(kp=1e-9, kd=0.0, friction=rate_state(1e-9, -1e-10, 1.0, mu=0.1)).with_values(
        {"links.screw.damping": 0.0}
    )
    fast = max(ss.modes(machine), key=lambda one: one.eigenvalue.imag)
    assert fast.eigenvalue.imag == pytest.approx(np.sqrt(100.0 * (1 / 2 + 1 / 5)), rel=1e-8)
    assert fast.amplitudes["table"] / fast.amplitudes["motor"] == pytest.approx(-2 / 5, rel=1e-7)
    assert sum(fast.energy.values()) == pytest.approx(1.0)
    assert fast.energy["links.screw"] == pytest.approx(0.5, rel=1e-7)
    assert fast.energy["bodies.motor"] == pytest.approx(0.5 * 5 / 7, rel=1e-6)
    assert fast.words() == (
        "the motor judders, table by 40 % of that; 50 % of the energy is in the screw"
        if fast.energy["links.screw"] >= fast.energy["bodies.motor"]
        else fast.words()
    )


def test_a_pad_that_moves_both_ways_is_one_body():
    words = ss.modes(brake(rate_state(0.02, -0.01, 0.5)))[0].words()
    assert words.startswith("the pad (along and normal) judders;")


def test_the_verdict_says_what_moves():
    machine = two_mass(kp=2.0).with_values({"links.screw.stiffness": 3.0})
    found = ss.analyze(machine)
    assert found.stable is False
    assert found.mode.eigenvalue == found.eigenvalues[0]
    text = str(found)
    assert "the mode" in text
    assert "of the energy is in" in text
    assert found.to_dict()["mode"]["words"] == found.mode.words()
    assert found.to_dict()["steady"]["contacts"]["guide"]["normal_force"] == 1.0
    named = {row["parameter"] for row in found.to_dict()["boundaries"]}
    assert {"drive.kp", "links.screw.stiffness"} <= named


def test_a_machine_is_ill_posed_where_friction_falls_at_once():
    machine = two_mass().with_values({"bodies.table.mass": 0.0, "links.screw.damping": 0.0})
    falling = ss.LuGre(mu_coulomb=0.2, mu_static=0.6, v_stribeck=1.0, bristle_stiffness=1.0, bristle_damping=50.0)
    worse = replace(machine, contacts={"guide": surface("table", falling)})
    assert ss.growth_rate(worse) == np.inf
    assert "ill-posed" in ss.analyze(worse).reason


def test_what_cancels_in_the_structure_cancels_exactly():
    """Dashpots between bodies without mass: the highest coefficients are absent, not rounded."""
    bodies = {name: ss.SlidingBody() for name in ("a", "b", "c")}
    links = {
        "pull": ss.Spring(between=("drive", "a"), stiffness=1.0, damping=0.7),
        "one": ss.Spring(between=("a", "b"), stiffness=1.1, damping=0.3),
        "two": ss.Spring(between=("b", "c"), stiffness=1.3, damping=0.9),
    }
    contacts = {"slide": surface("c", rate_state(0.5, -0.3, 1.0))}
    machine = ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=ss.Pull(velocity=1.0))
    coefficients = characteristic_coefficients(build_model(machine))
    assert len(coefficients) == 5
    assert len(roots(np.array(ss.analyze(machine).characteristic_polynomial))) == 4


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.campaign
def test_eigenvalues_of_machines_at_random_make_theory_11s_matrix_singular(seed):
    machine, matrix = at_random(seed)
    found = ss.eigenvalues(machine)
    assert np.all(np.isfinite(found))
    for s in found:
        values = np.linalg.svd(matrix(s), compute_uv=False)
        near = np.linalg.svd(matrix(s * (1 + 1e-6)), compute_uv=False)
        assert values[-1] < 1e-8 * values[0] or values[-1] < 1e-3 * near[-1]


@pytest.mark.parametrize("machine", [two_mass(), three_bodies(), brake(rate_state(0.02, -0.01, 0.5))])
def test_every_balance_is_zero_in_steady_sliding(machine):
    """Forces of coordinates and friction of contacts, T, τ and σ as they are defined; rates too, so that it goes on."""
    point = operating_point(machine)
    model = point.model
    balances = [one.balance for one in (*model.coordinates, *model.contacts)]
    stated = [model.inlined(symbol) - model.steady[symbol] for symbol in model.definitions]
    values = point.evaluate(
        model.function([model.at_steady(model.inlined(e)) for e in (*balances, *stated, *model.rates)])
    )
    assert np.abs(np.array(values, dtype=float)) == pytest.approx(np.zeros(len(values)), abs=1e-14)


def test_motors_and_tables_are_measured_by_the_rigid_motion():
    """Two radians of the motor are one metre of the table: in the slow mode both go alike."""
    slow = ss.modes(three_bodies())[0]
    assert abs(slow.amplitudes["motor"] / slow.amplitudes["table"] - 1) < 0.1
