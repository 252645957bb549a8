"""Eigenvalues with their errors: against pencils typed by hand in many digits, and QZ, of machines far from alike."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eig

import steadyslip as ss
from machines import rate_state, stacked_pads, surface, two_blocks
from steadyslip.linear import pencil, spectrum
from steadyslip.linear.pencil import checked_spectrum
from steadyslip.linear.roots import roots
from steadyslip.model.point import operating_point
from stiff_machines import at_random, eigenvalues, pencil as typed, worst


def checked(machine):
    return checked_spectrum.__wrapped__(operating_point(machine))  # asked anew


def screw_axis(ratio, static=0.07):
    """Two bodies without mass, which one dashpot holds, LuGre friction at a multiple of its Stribeck velocity."""
    friction = ss.laws.LuGre(
        mu_coulomb=0.2, mu_static=static, v_stribeck=1e-4, bristle_stiffness=5e5, bristle_damping=0.07
    )  # fmt: skip
    return ss.Machine(
        bodies={
            "screw": ss.machine.RotatingBody(),
            "nut": ss.machine.SlidingBody(),
            "table": ss.machine.SlidingBody(mass=0.6),
        },
        links={
            "shaft": ss.machine.Shaft(between=("drive", "screw"), stiffness=9e7),
            "thread": ss.machine.Screw(between=("screw", "nut"), lead=0.006, stiffness=1e5, damping=2.0),
            "bracket": ss.machine.Spring(between=("nut", "table"), stiffness=1.3e4),
        },
        contacts={"guide": surface("nut", friction, load=100.0)},
        drive=ss.machine.RotaryPull(velocity=ratio * 1e-4 / 0.006),
    )


LATER = pytest.mark.campaign


@pytest.mark.parametrize(
    ("ratio", "digits"),
    [(9.5, 200), pytest.param(1.3, 100, marks=LATER), pytest.param(25.0, 1200, marks=LATER)],
)
def test_above_the_stribeck_velocity_roots_many_decades_apart_are_all_found(ratio, digits):
    """The direct effect falls as exp(−(v/v_s)²), and with it one root grows beyond all others."""
    machine, right = screw_axis(ratio), eigenvalues(screw_axis(ratio), digits)
    found = checked(machine)
    assert worst(ss.eigenvalues(machine), right) < 1e-9
    assert worst(found.values, right) < 1e-9
    assert found.decided
    assert found.growing == 0
    assert np.all(np.abs(found.values - right) <= found.errors + 1e-300)


def test_polynomials_with_roots_of_any_size_give_them_all():
    """Newton's polygon: c0 … cn of (s + 1e-40)(s + 1)(s + 1e40)(s² + 1e-20)."""
    c = np.array([1e-20, 1e20, 1e20, 1.0 + 1e40, 1e40, 1.0]) * 1e-100
    found = roots(np.stack([c, c[::-1]]))
    for row, right in ((0, [-1e-40, 1e-10j, -1e-10j, -1.0, -1e40]), (1, [-1e40, 1e10j, -1e10j, -1.0, -1e-40])):
        assert worst(found[row], right) < 1e-12


def test_a_double_eigenvalue_is_told_with_its_error():
    """Alike blocks that do not touch each other: double, and so is an aperiodic block."""
    twice = two_blocks(k=1.0, second_slope=-0.5, coupling=1e-30)
    found = checked(twice)
    assert found.decided
    assert np.max(found.errors / np.abs(found.values)) < 1e-7
    critical = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"spring": ss.machine.Spring(between=("drive", "block"), stiffness=1.0, damping=2.0)},
        contacts={"guide": surface("block", ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.3, v_stribeck=1.0))},
        drive=ss.machine.Pull(velocity=1.0),
    )
    found = checked(critical)
    assert found.decided
    np.testing.assert_array_less(1e-9, found.errors)
    np.testing.assert_array_less(found.errors, 1e-6)
    for damping in (2.0 - 1e-15, 2.0 + 1e-15):
        moved = ss.eigenvalues(replace(critical, links={"spring": replace(critical.links["spring"], damping=damping)}))
        np.testing.assert_array_less(np.abs(moved + 1.0), found.errors)


def test_what_is_lost_or_wrong_is_noticed(monkeypatch):
    """A root that is not there, one that is there twice for another, and one moved by a millionth."""
    machine = two_blocks(k=1.0, second_slope=-0.1, coupling=0.3)
    right = checked(machine)
    assert right.decided
    assert not right.refined
    assert right.growing == np.sum(right.values.real > 0)
    wrong = {
        "missing": right.values[:-1],
        "twice": np.append(right.values[:-1], right.values[0].real),
        "moved": right.values * (1 + 1e-5),
        "mirrored": np.append(right.values[:-1], -right.values[-1]),
    }
    for what, values in wrong.items():
        monkeypatch.setattr(pencil, "spectrum", lambda point, values=values: values)
        monkeypatch.setattr(pencil, "precise_eigenvalues", lambda *_: None)
        assert not checked(machine).decided, what


@pytest.mark.campaign
def test_one_stiff_link_among_many_hides_no_other():
    """Pads that hold each other in so many ways that only numbers are there: as stiff as 1e9 N/m, a link is rigid."""
    pads = stacked_pads(3)
    rates = [ss.growth_rate(pads.with_values({"links.along-pad1.stiffness": k})) for k in (1e9, 1e14)]
    assert rates[1] == pytest.approx(rates[0], rel=1e-6)


def late_servo(joint):
    """A late controller pushes a motor whose joint to a carriage is stiff; the joint hides the oscillation below."""
    return ss.Machine(
        bodies={
            "motor": ss.machine.SlidingBody(mass=1.0),
            "carriage": ss.machine.SlidingBody(mass=0.1),
            "table": ss.machine.SlidingBody(mass=0.6),
        },
        links={
            "joint": ss.machine.Spring(between=("motor", "carriage"), stiffness=joint),
            "belt": ss.machine.Spring(between=("carriage", "table"), stiffness=1e5, damping=1.0),
        },
        contacts={
            "guide": surface("carriage", ss.laws.CoulombStribeck(mu_coulomb=0.2, mu_static=0.1, v_stribeck=1e-3))
        },
        drive=ss.machine.PositionPD(velocity=1e-3, body="motor", kp=1e4, kd=30.0, delay=1e-3),
    )


@pytest.mark.parametrize("joint", [1e13, 1e17])
def test_roots_under_a_delay_that_fail_are_found_by_newton_with_many_digits(joint, monkeypatch):
    """As they are with the joint rigid; where nothing else was tried they were withheld."""
    machine = late_servo(joint)
    right = checked(ss.machine.joined(machine, "joint"))
    assert right.decided
    found = checked(machine)
    assert found.refined
    assert found.decided
    assert found.growing == right.growing
    for root in right.values:
        assert np.min(np.abs(found.values - root)) < 1e-6 * abs(root)
    monkeypatch.setattr(pencil, "precise_root", lambda *_: None)
    assert not checked(machine).decided


def test_roots_under_a_delay_are_counted_by_the_argument(monkeypatch):
    late = ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=1.0)},
        links={"oil": ss.machine.Spring(between=("ground", "block"), damping=1.0)},
        contacts={"guide": surface("block", rate_state(0.5, -0.3, 1.0))},
        drive=ss.machine.PositionPD(velocity=1.0, body="block", kp=4.0, kd=1.0, delay=1.0),
    )
    found = checked(late)
    assert found.decided
    assert found.growing == 2
    monkeypatch.setattr(pencil, "spectrum", lambda point: np.append(spectrum.spectrum(point)[2:], -1.0))
    assert not checked(late).complete


@pytest.mark.parametrize("seeds", [range(21, 22), pytest.param(range(12), marks=LATER)], ids=["one", "many"])
def test_machines_of_any_stiffness_have_the_eigenvalues_of_pencils_typed_by_hand(seeds):
    for seed in seeds:
        machine = at_random(np.random.default_rng(seed), decades=10.0 if seed % 2 else 3.0)
        right, found = eigenvalues(machine, 400), checked(machine)
        assert worst(found.values, right) < 1e-6, seed
        assert worst(ss.eigenvalues(machine), right) < 1e-6, seed
        assert found.decided, seed
        assert found.growing == np.sum(np.real(right) > found.errors), seed
        off = np.min(np.abs(found.values[:, None] - np.asarray(right)), axis=1)
        assert np.all(off <= found.errors + 1e-14 * np.abs(found.values)), seed


@pytest.mark.parametrize("seed", [3, *(pytest.param(s, marks=LATER) for s in range(3))])
def test_ordinary_machines_have_the_eigenvalues_of_qz(seed):
    machine = at_random(np.random.default_rng(100 + seed), decades=1.0, ratio=1.5)
    a, e = (np.array(part.tolist(), dtype=float) for part in typed(machine))
    found, (above, below) = checked(machine), eig(a, e, right=False, homogeneous_eigvals=True)
    finite = above[np.abs(below) > 1e-14 * np.abs(above)] / below[np.abs(below) > 1e-14 * np.abs(above)]
    near = np.min(np.abs(found.values[:, None] - finite[None, :]), axis=1)
    np.testing.assert_array_less(near, 1e-6 * np.abs(found.values) + 1e-9 * np.max(np.abs(found.values)))
