"""Linear stability of machines: theory 11's values, and routes that share nothing with the package's."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import steadyslip as ss
from machines import at_random, block, brake, coulomb, leading, rate_state, surface, three_bodies, two_blocks, two_mass
from steadyslip.linear.roots import roots
from steadyslip.model import build_model
from steadyslip.model.linearisation import characteristic_coefficients


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
        memory = {"normal_memory": ss.laws.LinkerDieterich(alpha=alpha, sigma_ref=1.0)} if alpha else {}
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


def test_friction_that_pulls_is_told():
    machine = two_mass(friction=rate_state(0.5, -0.3, 1.0, mu=0.1)).with_values({"drive.velocity": 3.0})
    (warning,) = ss.analyze(machine).warnings
    assert "contact guide is not positive" in warning


def test_coulomb_flutter_begins_where_theory_says():
    critical = 0.1 / 0.24
    assert leading(brake(coulomb(critical * (1 + 1e-8)))).real > 1e-6
    assert abs(leading(brake(coulomb(critical * (1 - 1e-8)))).real) < 1e-9


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


def test_a_machine_is_ill_posed_where_friction_falls_at_once():
    machine = two_mass().with_values({"bodies.table.mass": 0.0, "links.screw.damping": 0.0})
    falling = ss.laws.LuGre(mu_coulomb=0.2, mu_static=0.6, v_stribeck=1.0, bristle_stiffness=1.0, bristle_damping=50.0)
    worse = replace(machine, contacts={"guide": surface("table", falling)})
    assert ss.growth_rate(worse) == np.inf
    assert "ill-posed" in ss.analyze(worse).reason


def test_bristles_without_damping_need_a_mass_in_machines_too():
    """On a body without mass beside one with mass; and two masses that go are not two orders that are missing."""
    machine = two_mass()
    bare = {"bodies.table.mass": 0.0, "links.screw.damping": 0.0}
    stiff = ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.45, v_stribeck=1.0, bristle_stiffness=1e3, bristle_damping=0.0)
    undamped = replace(machine.with_values(bare), contacts={"guide": surface("table", stiff)})
    assert ss.stability(undamped) == "unstable"
    assert ss.growth_rate(undamped) == np.inf
    assert "ill-posed" in ss.analyze(undamped).reason
    masses = {f"bodies.{name}.mass": [0.0, 1.0] for name in machine.bodies}
    assert ss.growth_rate(machine, masses)[0] == pytest.approx(
        ss.growth_rate(machine.with_values(dict.fromkeys(masses, 0.0))), rel=1e-9
    )


LEVEL = ss.laws.ConstantNormalStress(preload=1.0)
BARE = ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.45, v_stribeck=1.0, bristle_stiffness=20.0)


@pytest.mark.parametrize("seed", range(12))
def test_arrays_in_which_inertias_and_dampings_vanish_are_as_single_machines(seed):
    """Of a body without contact that has neither, two powers of s go; whatever the others have."""
    chance = np.random.default_rng(seed)
    names = "abc"[: chance.integers(2, 4)]
    law = ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.35, v_stribeck=1.0, viscous=0.5)
    machine = ss.Machine(
        bodies={name: ss.machine.SlidingBody(mass=1.0) for name in names},
        links={
            one + other: ss.machine.Spring(between=(one, other), stiffness=chance.uniform(1, 3), damping=0.3)
            for one, other in pairwise(names)
        },
        contacts={
            name: surface(name, chance.choice([law, BARE])) for name in names if chance.random() < 0.5 or name == "a"
        },
        drive=ss.machine.PositionPD(velocity=1.0, body=names[-1], kp=1.0),
    )
    vanishing = [f"bodies.{name}.mass" for name in names] + [f"links.{name}.damping" for name in machine.links]
    cases = chance.random((len(vanishing), 16)) < 0.4
    values = {name: np.where(own, 0.0, 1.0) for name, own in zip(vanishing, cases, strict=True)}
    growth, words = ss.growth_rate(machine, values), ss.stability(machine, values)
    for i in range(16):
        single = machine.with_values({name: float(own[i]) for name, own in values.items()})
        assert ss.stability(single) == words[i]
        assert ss.growth_rate(single) == pytest.approx(growth[i], rel=1e-7, abs=1e-12)


def test_a_body_on_a_spring_does_not_make_friction_rise():
    """The power of s that a body without anything misses is not that which undamped bristles miss; delays alike."""
    body, drive = ss.machine.SlidingBody(), ss.machine.PositionPD(velocity=1.0, body="a", kp=20.0)
    alone = ss.Machine(bodies={"a": body}, links={}, contacts={"a": surface("a", BARE)}, drive=drive)
    hung = {"on": ss.machine.Spring(between=("a", "b"), stiffness=2.0)}
    for one in (alone, replace(alone, bodies={"a": body, "b": body}, links=hung)):
        assert ss.growth_rate(one) == np.inf
        assert not ss.analyze(one).stable
        assert np.all(np.isnan(ss.stable_values(one, "drive.kp")))
    late = ss.Slider(
        friction=BARE, contact=LEVEL, stiffness=20.0, drive=ss.machine.PD(velocity=1.0, kp=1.0, delay=0.05)
    )
    assert ss.growth_rate(late) == np.inf
    assert np.all(np.isnan(ss.stable_stiffness(late)))


def test_what_cancels_in_the_structure_cancels_exactly():
    """Dashpots between bodies without mass: the highest coefficients are absent, not rounded."""
    bodies = {name: ss.machine.SlidingBody() for name in ("a", "b", "c")}
    links = {
        "pull": ss.machine.Spring(between=("drive", "a"), stiffness=1.0, damping=0.7),
        "one": ss.machine.Spring(between=("a", "b"), stiffness=1.1, damping=0.3),
        "two": ss.machine.Spring(between=("b", "c"), stiffness=1.3, damping=0.9),
    }
    contacts = {"slide": surface("c", rate_state(0.5, -0.3, 1.0))}
    machine = ss.Machine(bodies=bodies, links=links, contacts=contacts, drive=ss.machine.Pull(velocity=1.0))
    coefficients = characteristic_coefficients(build_model(machine))
    assert len(coefficients) == 5
    assert len(roots(np.array(ss.analyze(machine).characteristic_polynomial))) == 4


@pytest.mark.parametrize("drive", ["two springs", "spring and cascade"])
def test_a_contact_loaded_by_one_link_sees_no_other_force(drive):
    """One block that a spring and something else pull, tilted: steady sliding and determinant, typed by hand."""
    tangent, mu, k, c = np.tan(0.3), 0.6, 3.0, 0.2
    tilted = ss.laws.InclinedSpring(preload=1.0, angle=0.3)
    contact = ss.machine.Surface(body="block", friction=rate_state(0.5, 0.2, 1.0), contact=tilted, loaded_by="own")
    links = {"own": ss.machine.Spring(between=("drive", "block"), stiffness=k, damping=c)}
    gains = ss.machine.Cascade(velocity=1.0, body="block", kv=2.0, kp=1.5, tn=0.5)
    if drive == "two springs":
        links["other"] = ss.machine.Spring(between=("drive", "block"), stiffness=5.0, damping=0.1)
    machine = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=2.0)}, links=links, contacts={"guide": contact},
        drive=ss.machine.Pull(velocity=1.0) if drive == "two springs" else gains,
    )  # fmt: skip
    share = k / (k + 5.0) if drive == "two springs" else 0.0  # an integral leaves the spring without stretch
    load = 1.0 / (1.0 + tangent * mu * share)
    assert ss.steady_state(machine).contacts["guide"].normal_force == pytest.approx(load, rel=1e-12)

    def determinant(s):
        other = 5.0 + 0.1 * s if drive == "two springs" else 1.5 * (1 + 1 / (0.5 * s)) * (2.0 + s)
        friction = load * (0.5 * s - 0.3 * s / (s + 1)) + mu * tangent * (k + c * s)
        return 2.0 * s**2 + k + c * s + other + friction

    for s in ss.eigenvalues(machine):
        assert abs(determinant(s)) < 1e-10 * abs(2.0 * s**2)


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


def test_edges_of_dampings_that_are_zero_are_those_of_small_ones():
    """Also where a cure is sought among them; none of a machine that nothing damps, where the least decides."""
    axis = ss.read_rig("examples/machines/feed-axis.toml", ["links.screw.stiffness=8 N/um", "links.screw.damping=0"])
    (zero,) = (one for one in ss.margins(axis) if one.parameter == "links.screw.damping")
    (small,) = ss.boundary(axis.with_values({"links.screw.damping": 1e-3}), "links.screw.damping")
    assert zero.edge.value == pytest.approx(small.value, rel=1e-9)
    assert zero.edge.stable == "above"
    assert not [one for one in ss.margins(block()) if one.parameter.endswith(".damping")]
