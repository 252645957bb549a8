"""The kind of onset of machines: limits, identities, a system typed by hand, and what motion does at the edge."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import steadyslip as ss
from machine_onsets import compared
from machines import rate_state, renamed, same_block, surface, three_bodies, two_mass
from steadyslip.machine.letters import label_of

KP = "drive.kp"


def numbers(found):
    return np.array([found.value, found.coefficient, found.angular_frequency, found.growth_slope, found.stress_ratio])


@pytest.mark.parametrize("seed", [1, 5, 7, 8])
def test_a_machine_of_one_body_has_the_onset_of_its_slider(seed):
    block, machine = same_block(seed)
    own, found = ss.hopf(block), ss.hopf(machine, "links.spring.stiffness")
    np.testing.assert_allclose(numbers(found), numbers(own), rtol=1e-9)
    assert (found.kind, found.stable, found.contact, dict(found.shares)) == (
        own.kind,
        own.stable,
        "base",
        {"base": 1.0},
    )


@pytest.mark.parametrize("measured", ["motor", "table"])
def test_the_coefficient_is_that_of_equations_typed_by_hand(measured):
    """Kuznetsov's formula, eq. 5.34, on an ordinary differential equation that nothing of the package has seen."""
    machine = two_mass(measured=measured, friction=rate_state(0.5, -0.3, 1.0, evolution=ss.laws.Aging()))
    found = ss.hopf(machine, KP)
    x1, v1, x2, v2, theta = y = sp.symbols("x1 v1 x2 v2 theta")
    f, slope, r, mu, kp = 0.5, -0.3, 1.0, 0.6, sp.Float(found.value)
    seen, speed = (x1, v1) if measured == "motor" else (x2, v2)
    friction = mu + f * sp.log(v2) + (f - slope) * sp.log(theta * r)
    pull = 100 * (x1 - x2) + 0.5 * (v1 - v2)
    rates = [
        v1 - 1,
        (-kp * seen - 0.1 * (speed - 1) - pull) / 2,
        v2 - 1,
        (pull - (friction - mu)) / 5,
        1 - v2 * theta * r,
    ]
    at = dict(zip(y, (0.0, 1.0, 0.0, 1.0, 1.0), strict=True))

    def numeric(*order):
        return np.array([[float(sp.diff(e, *o).subs(at)) for o in order] for e in rates])

    n = range(5)
    a = numeric(*((y[i],) for i in n))
    b = numeric(*((y[i], y[j]) for i in n for j in n)).reshape(5, 5, 5)
    c = numeric(*((y[i], y[j], y[k]) for i in n for j in n for k in n)).reshape(5, 5, 5, 5)
    values, vectors = np.linalg.eig(a)
    k = np.argmin(np.abs(values - 1j * found.angular_frequency))
    assert abs(values[k].real) < 1e-8
    q = vectors[:, k] / vectors[3, k] / 2
    rows, left = np.linalg.eig(a.T)
    p = left[:, np.argmin(np.abs(rows + 1j * values[k].imag))]
    p = p / np.conj(np.conj(p) @ q)
    iw, one = values[k], np.eye(5)
    bb = lambda u, v: np.einsum("ijk,j,k->i", b, u, v)  # noqa: E731
    cubic = np.einsum("ijkl,j,k,l->i", c, q, q, q.conj())
    mean, double = np.linalg.solve(a, bb(q, q.conj())), np.linalg.solve(2 * iw * one - a, bb(q, q))
    c1 = 0.5 * np.real(np.conj(p) @ (cubic - 2 * bb(q, mean) + bb(q.conj(), double)))
    assert found.coefficient == pytest.approx(c1, rel=1e-7)
    step = 1e-6
    rise = [
        np.max(np.linalg.eigvals(a + s * np.outer([0, -0.5, 0, 0, 0], np.eye(5)[0 if measured == "motor" else 2])).real)
        for s in (step, -step)
    ]
    assert found.growth_slope == pytest.approx((rise[0] - rise[1]) / (2 * step), rel=1e-5)


def test_names_and_order_change_nothing():
    machine = two_mass()
    np.testing.assert_allclose(numbers(ss.hopf(renamed(machine), KP)), numbers(ss.hopf(machine, KP)), rtol=1e-9)


def test_an_idle_body_changes_nothing():
    machine = two_mass()
    idle = replace(
        machine, bodies={**machine.bodies, "idle": ss.machine.SlidingBody(mass=0.3)},
        links={**machine.links, "held": ss.machine.Spring(between=("drive", "idle"), stiffness=5.0, damping=0.4)},
    )  # fmt: skip
    np.testing.assert_allclose(numbers(ss.hopf(idle, KP)), numbers(ss.hopf(machine, KP)), rtol=1e-9)


def test_two_springs_in_a_row_are_one_whatever_massless_body_is_between():
    machine = two_mass()
    plain = replace(machine, links={"screw": ss.machine.Spring(between=("motor", "table"), stiffness=100.0)})
    halves = {"one": ss.machine.Spring(between=("motor", "nut"), stiffness=150.0),
              "two": ss.machine.Spring(between=("nut", "table"), stiffness=300.0)}  # fmt: skip
    between = replace(machine, bodies={**machine.bodies, "nut": ss.machine.SlidingBody(mass=0.0)}, links=halves)
    np.testing.assert_allclose(numbers(ss.hopf(between, KP)), numbers(ss.hopf(plain, KP)), rtol=1e-8)


def test_the_onset_without_mass_is_the_limit_of_small_masses():
    machine = ss.Machine(
        bodies={"left": ss.machine.SlidingBody(mass=0.0), "right": ss.machine.SlidingBody(mass=0.0)},
        links={
            "one": ss.machine.Spring(between=("drive", "left"), stiffness=1.0, damping=0.2),
            "two": ss.machine.Spring(between=("left", "right"), stiffness=2.0),
            "rail": ss.machine.Spring(between=("ground", "right"), damping=0.1),
        },
        contacts={
            "one": surface("left", rate_state(0.5, -0.4, 1.0)), "two": surface("right", rate_state(0.4, -0.1, 2.0)),
        },
        drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip
    along = "links.one.stiffness"
    limit = numbers(ss.hopf(machine, along))
    apart = []
    for mass in (1e-4, 1e-5):
        near = numbers(ss.hopf(machine.with_values({"bodies.left.mass": mass, "bodies.right.mass": mass}), along))
        apart.append(np.abs(near / limit - 1))
    assert np.all(apart[1] < 1e-3)
    assert np.all(apart[1] < 0.11 * apart[0] + 1e-9)  # the first order in mass


def test_a_contact_with_an_area_is_that_of_its_forces():
    machine = two_mass()
    area, guide = 0.02, machine.contacts["guide"]
    wide = replace(machine, contacts={
        "guide": replace(guide, area=area, contact=ss.laws.ConstantNormalStress(preload=1.0 / area)),
    })  # fmt: skip
    found, own = ss.hopf(wide, KP), ss.hopf(machine, KP)
    np.testing.assert_allclose(numbers(found), numbers(own), rtol=1e-9)
    along = "contacts.guide.contact.preload"
    assert ss.hopf(wide, along).value * area == pytest.approx(ss.hopf(machine, along).value)
    assert str(ss.hopf(wide, along)).splitlines()[0].endswith(" Pa")  # as its file has it
    assert str(ss.hopf(machine, along)).splitlines()[0].endswith("N")


def test_amplitudes_fall_at_the_edge_as_the_coefficient_says():
    """At the edge itself ρ' = c1 ρ³: 1/ρ² grows by −2 c1 in each unit of time."""
    machine = two_mass()
    found = ss.hopf(machine, KP)
    edge = machine.with_values({KP: found.value})
    period = 2 * np.pi / found.angular_frequency
    times = np.arange(0.0, 121 * period, period / 80)
    run = ss.simulate(edge, until=times[-1], times=times, initial={"table.v": 1.04}, rtol=1e-10)
    speed = run["guide.slip_rate"][: 120 * 80].reshape(120, 80)
    size = 0.5 * np.log(speed.max(axis=1) / speed.min(axis=1))
    slope = np.polyfit(period * np.arange(20, 120), 1 / size[20:] ** 2, 1)[0]
    assert slope == pytest.approx(-2 * found.coefficient, rel=0.03)  # to the second order of the amplitude, .03


def test_an_onset_on_arrays_is_that_of_each(tmp_path):
    machine = two_mass()
    screws = np.array([20.0, 100.0, 1000.0])
    plan = ss.Map(machine, {"links.screw.stiffness": screws}, ss.maps.OnsetKind(along=KP))
    found = ss.run_map(plan, tmp_path / "onset.zarr", progress=False)
    for i, stiffness in enumerate(screws):
        one = ss.hopf(machine.with_values({"links.screw.stiffness": stiffness}), KP)
        assert found.words("onset")[int(found.dataset["onset"].values[i])] == one.kind
        assert found.dataset["onset_edge"].values[i] == pytest.approx(one.value, rel=1e-9)
        assert found.dataset["onset_coefficient"].values[i] == pytest.approx(one.coefficient, rel=1e-7)
    assert found.unit("onset_edge") == "N/m"


def test_the_edge_in_two_parameters_is_that_in_each():
    machine = two_mass()
    curve = ss.hopf_curve(machine, "links.screw.stiffness", KP, between={"links.screw.stiffness": (30.0, 300.0)})
    for i in (0, len(curve.first) // 2, -1):
        one = ss.hopf(machine.with_values({"links.screw.stiffness": curve.first[i]}), KP)
        assert curve.second[i] == pytest.approx(one.value, rel=1e-6)
        assert curve.coefficient[i] == pytest.approx(one.coefficient, rel=1e-4)
    assert curve.units == ("N/m", "N/m")


def test_what_cannot_be_told_is_said():
    with pytest.raises(ss.UnknownNameError, match="ambiguous"):
        ss.hopf(three_bodies())
    with pytest.raises(ss.NotAvailable, match="no oscillatory edge"):
        ss.hopf(two_mass(friction=rate_state(0.5, 0.3, 1.0)), KP)


def test_the_verdict_on_a_machine_tells_the_onset_at_its_nearest_edge():
    for machine in (two_mass(), two_mass(kp=4.0, kd=3.0).with_values({"drive.delay": 0.1})):
        found = ss.analyze(machine)
        nearest = next(one for one in found.margins if one.edge is not None and one.edge.kind == "oscillatory")
        own = ss.hopf(machine, nearest.parameter)
        np.testing.assert_allclose(numbers(found.onset), numbers(own), rtol=1e-9)
        assert f"onset {own.kind}: just beyond the edge in {label_of(machine, nearest.parameter)}" in " ".join(
            str(found).split()
        )
        data = found.to_dict()["onset"]
        told = data["parameter"], data["contact"], data["coefficient"]
        assert told == (nearest.parameter, "guide", own.coefficient)


@pytest.mark.campaign
def test_random_machines_have_the_coefficients_of_their_motion():
    """Massless bodies, several contacts, controllers: the equations as they stand against reduced rates in steps."""
    found = [one for one in map(compared, range(12)) if one is not None]
    assert len(found) >= 10
    assert max(found) < 1e-3
