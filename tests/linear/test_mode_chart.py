"""Chart of modes over a parameter: closed forms, oscillations that cross without coupling, edges, files."""

import json

import numpy as np
import pytest
from scipy.linalg import eigvals

import steadyslip as ss
from command import run
from machines import block, coulomb, two_mass
from steadyslip.linear import mode_chart
from steadyslip.linear.mode_chart import MOST_POINTS, followed
from structures_at_random import by_hand, random_structure, reed

BRAKE = "examples/machines/brake-pad.toml"


def test_modes_of_hoffmann_and_gaul_meet_where_their_equations_say():
    """Typed by hand: λ² = −3 ± √(.25 + 4/3 − μ 8/(3√3)), a meeting at 1.0284 and √3 rad/s."""
    found = mode_chart(block(), "mu_coulomb", (0.1, 2.0))
    apart = np.sqrt(0.25 + 4 / 3 - found.values * 8 / (3 * np.sqrt(3)) + 0j)
    expected = np.sqrt(-3 + np.outer(apart, [-1, 1]))
    for one, other in zip(found.eigenvalues, np.where(expected.imag > 0, expected, -expected), strict=True):
        own, both = (s[np.lexsort((s.real, s.imag.round(6)))] for s in (one, other))
        np.testing.assert_allclose(own, both, atol=2e-7)  # √ of rounding where double
    assert found.numbers == (1, 2)
    meeting = np.searchsorted(found.values, 1.0284051669940213)
    assert np.diff(found.frequencies[: meeting - 1], axis=1).min() > 0
    grown = found.eigenvalues.real[meeting + 1 :]
    assert np.all(np.abs(grown) > 0)
    assert np.ptp(np.sign(grown), axis=0).max() == 0  # the one that grows is one column
    assert found.origins[0].friction == pytest.approx(1.0284051669940213, rel=1e-10)


def two_masses_apart(first, second):
    """Two bodies that do not touch each other, each on a spring from the ground and on the moving surface."""
    contact = ss.laws.ConstantNormalStress(preload=10.0)
    return ss.Machine(
        bodies={"a": ss.machine.SlidingBody(mass=1.0), "b": ss.machine.SlidingBody(mass=1.0)},
        links={
            name: ss.machine.Spring(between=("ground", name), stiffness=stiffness, damping=damping)
            for name, stiffness, damping in (("a", first, 0.02), ("b", second, 0.05))
        },
        contacts={
            name: ss.machine.Surface(body="drive", against=name, friction=coulomb(0.3), contact=contact)
            for name in "ab"
        },
        drive=ss.machine.Pull(velocity=1.0),
    )


def test_modes_that_do_not_couple_cross_and_stay_themselves():
    machine = two_masses_apart(1.0, 4.0)
    found = mode_chart(machine, "links.a.stiffness", (0.5, 9.0))
    stiffness = found.values
    np.testing.assert_allclose(found.eigenvalues[:, 0], -0.01 + 1j * np.sqrt(stiffness - 1e-4), rtol=1e-9)
    np.testing.assert_allclose(
        found.eigenvalues[:, 1], np.full(len(stiffness), -0.025 + 1j * np.sqrt(4 - 6.25e-4)), rtol=1e-9
    )
    np.testing.assert_allclose(found.damping_ratios[:, 1], 0.0125, rtol=1e-9)
    assert (found.edges, found.origins, found.numbers) == ((), (), (1, 2))
    assert "stable throughout" in str(found)


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3])
def test_narrow_avoided_crossings_are_followed(gap):
    """√ of a coupling: the lower stays the lower, however late the two turn; closer points are put there alone."""

    def roots(x):
        middle, apart = 0.5 * (x + 1), np.sqrt((0.5 * (x - 1)) ** 2 + gap**2)
        return 1j * np.stack([middle - apart, middle + apart], axis=-1)

    values, found = followed(roots, np.linspace(0.5, 1.5, 21))
    np.testing.assert_array_equal(found, roots(values))
    assert 41 <= len(values) < MOST_POINTS
    assert np.min(np.diff(values)[np.abs(values[1:] - 1) > 0.3]) > 0.02


def test_points_are_added_where_all_move_by_the_distance_to_the_next():
    """Roots on a circle that turns by 1.3 places from value to value: what lies where another lay is not that one."""

    def roots(x):
        return 3j + np.exp(2j * np.pi * (np.arange(5) / 5 + 0.01 + 2.6 * x[:, None]))

    values, found = followed(roots, np.linspace(0, 1, 11))
    order = np.argsort(np.angle(found[0] - 3j) % (2 * np.pi))
    np.testing.assert_allclose(found[:, order], roots(values), rtol=1e-14)


def test_an_oscillation_that_ends_and_begins_again():
    def roots(x):
        return np.stack([-1 + np.sqrt(1 - x**2 + 0j), 3j + 0 * x], axis=-1)

    values, found = followed(roots, np.linspace(-3, 3, 31))
    there = np.isfinite(found)
    assert found.shape[1] == 3
    assert np.all(there[:, found[0].imag == 3])
    others = there[:, found[0].imag != 3]
    np.testing.assert_array_equal(np.sum(others, axis=1), np.abs(values) > 1)


def test_columns_are_the_roots_of_equations_typed_by_hand():
    machine, numbers = random_structure(np.random.default_rng(5), 12, 1)
    name = "contacts.c0.friction.mu_ref"
    found = mode_chart(machine, name, (0.1, 1.0))
    for value, own in list(zip(found.values, found.eigenvalues, strict=True))[::10]:
        e, a = by_hand(*numbers[:4], [(*numbers[4][0][:6], value, *numbers[4][0][7:])])
        roots = eigvals(a, e)
        expected = np.sort_complex(roots[np.isfinite(roots) & (roots.imag > 1e-9 * np.abs(roots))])
        np.testing.assert_allclose(np.sort_complex(own[np.isfinite(own)]), expected, rtol=1e-7)


def test_damping_is_zero_at_edges():
    found = mode_chart(reed(), "steady_normal_stress", (10.0, 1e4))
    assert [round(one.value, 4) for one in found.edges] == [355.5297, 6297.806]
    for edge in found.edges:
        at = np.searchsorted(found.values, edge.value)
        ratios = found.damping_ratios[at]
        assert np.nanmin(np.abs(ratios)) < 1e-9
        nearest = found.frequencies[at, np.nanargmin(np.abs(ratios))]
        assert nearest == pytest.approx(edge.angular_frequency / (2 * np.pi), rel=1e-8)
    assert [one.kind for one in found.origins] == ["normal force", "normal force"]
    assert [one.number for one in found.origins] == [2, 3]  # as columns, not as places by frequency there
    assert "and 18 that are damped more" in str(found)


def test_with_a_delay_the_rightmost_are_drawn():
    late = two_mass(kp=2.0).with_values({"drive.delay": 0.1})
    found = mode_chart(late, "drive.kp", ("1 N/m", "3 N/m"))
    assert np.nanmax(found.eigenvalues.real) > 0
    assert found.origins == ()
    rightmost = ss.eigenvalues(late, {"drive.kp": found.values})
    assert np.nanmax(np.abs(np.nanmax(found.eigenvalues.real, axis=1) - rightmost[:, 0].real)) < 1e-12


def test_what_is_refused():
    with pytest.raises(ss.NotAvailable, match="a slider is one body"):
        mode_chart(ss.read_rig("examples/stick-slip.toml"), "stiffness")
    machine = ss.read_rig(BRAKE)
    with pytest.raises(ss.ParameterError, match="is zero in this machine; give a range"):
        mode_chart(machine, "links.lining.damping")
    with pytest.raises(ss.ParameterError, match="low < high"):
        mode_chart(machine, "mu_ref", (0.5, 0.1))
    with pytest.raises(ss.ParameterError, match="two values, low and high"):
        mode_chart(machine, "mu_ref", 0.5)


def test_angles_stay_within_their_domain():
    found = mode_chart(ss.read_rig(BRAKE), "links.caliper.angle")
    assert found.values[-1] < np.pi / 2
    assert "4.5 deg to 89.1 deg" in str(found)


def test_the_command_charts_modes(tmp_path):
    along = ("modes", BRAKE, "--along", "mu_ref", "--between", "0.2", "0.6")
    told = json.loads(run(*along, "--json").stdout)
    assert [one["number"] for one in told["modes"]] == [1, 2]
    assert len(told["modes"][0]["frequencies"]) == len(told["values"])
    assert told["why_it_grows"][0]["modes"] == [1, 2]
    names = [tmp_path / f"chart.{ending}" for ending in ("csv", "html", "svg")]
    done = run(*along, *(word for name in names for word in ("-o", name)))
    assert "modes 1 and 2 meet at 746.5 Hz where friction at disc exceeds 0.417" in done.stdout
    header = "contacts.disc.friction.mu_ref (1),frequency of mode 1 (Hz),damping ratio of mode 1,"
    assert names[0].read_text().startswith(header)
    assert "modes 1 and 2 meet at 746.5 Hz" in names[1].read_text(encoding="utf-8").replace("\xa0", " ")
    assert names[2].stat().st_size > 0
    assert "leave out --mode" in run(*along, "--mode", "1").stderr
    assert "name it with --along" in run("modes", BRAKE, "--between", "0.2", "0.6").stderr
