"""Delay in controllers and friction: closed forms, a discretised delay equation, windings of a matrix typed by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.special import lambertw

import steadyslip as ss
from delays import apart, lagging, late_axis, some, spectral, winding
from machines import at_random, coulomb, rate_state, surface, two_mass
from steadyslip.linear import delay_stable_sets, quasipolynomial as quasi, rightmost as late_roots
from steadyslip.linear.argument import count_by_argument
from steadyslip.linear.delay_stable_sets import delay_set, delay_set_among, linear_windows
from steadyslip.linear.spectrum import outgrown, unstable_roots
from steadyslip.linear.waves import Waves
from steadyslip.model.point import operating_point
from steadyslip.model.range import quasipolynomial as operating_quasi


def servo(gain, delay, mass=0.0):
    """x' = −gain x(t − delay): a body without mass in oil, held by a controller that acts late."""
    return ss.Machine(
        bodies={"block": ss.machine.SlidingBody(mass=mass)},
        links={"oil": ss.machine.Spring(between=("ground", "block"), damping=1.0)},
        contacts={"guide": surface("block", coulomb(0.3))},
        drive=ss.machine.PositionPD(velocity=1.0, body="block", kp=gain, delay=delay),
    )


# --- closed forms -----------------------------------------------------------------------------------


@pytest.mark.parametrize("gain", [0.3, 1.0, 20.0])
def test_a_first_order_loop_bears_a_quarter_of_its_turn(gain):
    """x' = −a x(t − τ): stable for a τ < π/2, eigenvalues W_k(−a τ)/τ."""
    ((low, high),) = ss.stable_values(servo(gain, 0.0), "drive.delay")
    assert (low, gain * high) == (0.0, pytest.approx(np.pi / 2, rel=1e-14))
    ((low, high),) = ss.stable_values(servo(gain, 0.7), "drive.kp")
    assert 0.7 * high == pytest.approx(np.pi / 2, rel=1e-13)
    tau = 0.8 / gain
    found = ss.eigenvalues(servo(gain, tau, mass=0.0))
    assert found[0] == pytest.approx(lambertw(-gain * tau, 0) / tau, rel=1e-12)
    several = late_roots.rightmost(np.array([[0.0, 1.0], [gain, 0.0]]), np.array([0.0, tau]), apart(2), 7)
    expected = [lambertw(-gain * tau, k) / tau for k in range(-4, 4)]
    for one in several:
        assert np.min(np.abs(one - expected)) < 1e-10 * abs(one)
    assert several.real == pytest.approx(np.sort(np.real(expected))[::-1][:7], rel=1e-9)


def test_stiffnesses_of_lagging_friction_are_stable_by_turns():
    """theory 10: cos βδ = −c/S, k = mβ² − Sβ sin βδ; 4.2051, 17.9087, 69.4583, 110.569 and so on."""
    edges = ss.boundary(lagging(10.0), "links.spring.stiffness", between=(1.0, 1000.0))
    first = np.arccos(-0.5)
    beta = np.sort(np.concatenate([first + 2 * np.pi * np.arange(5), 2 * np.pi * np.arange(1, 6) - first]))
    k = beta**2 - 0.1 * beta * np.sin(beta)
    assert [edge.value for edge in edges] == pytest.approx(k[k < 1000], rel=1e-12)
    assert [edge.value for edge in edges][:4] == pytest.approx([4.2051, 17.9087, 69.4583, 110.569], rel=1e-5)
    assert [edge.angular_frequency for edge in edges] == pytest.approx(beta[k < 1000], rel=1e-12)
    assert [edge.stable for edge in edges][:4] == ["below", "above", "below", "above"]
    intervals = ss.stable_values(lagging(10.0), "links.spring.stiffness")
    assert intervals[:2] == pytest.approx(np.array([[0.0, k[0]], [k[1], k[2]]]), rel=1e-12)
    inside = ss.stability(lagging(10.0), {"links.spring.stiffness": np.sqrt(intervals[1:8, 0] * intervals[1:8, 1])})
    assert set(inside.tolist()) == {"stable"}


def test_without_its_delay_a_machine_is_as_it_was():
    """The leading eigenvalue moves by the delay, order one; at none at all it is the same to rounding."""
    axis = two_mass(kp=4.0, kd=3.0)
    exact = ss.eigenvalues(axis)[0]
    delays = np.array([1e-2, 1e-3, 1e-4, 1e-5])
    moved = np.abs(ss.eigenvalues(axis, {"drive.delay": delays})[:, 0] - exact)
    assert np.diff(np.log10(moved)) == pytest.approx(-np.ones(3), abs=0.01)
    assert ss.eigenvalues(axis, {"drive.delay": [0.0]})[0] == pytest.approx(ss.eigenvalues(axis), rel=1e-12)


@pytest.mark.parametrize("terms", [2, 3])
def test_a_root_of_what_nothing_late_acts_on_is_found(terms):
    """A post that swings on its own beside a block: a factor of all terms, whose first leads at every frequency."""
    post, block = np.array([100.0, 0.02, 1.0]), np.array([5.0, 10.0, 5.0])
    late = [np.array([one, 0.0, 0.0]) for one in (0.3, 0.2)][: terms - 1]
    c = np.array([np.convolve(post, one) for one in (block, *late)])
    found = late_roots.rightmost(c, np.array([0.0, 0.05, 4.0])[:terms], apart(terms), 2)
    assert found == pytest.approx(np.roots(post[::-1]), rel=1e-9)


# --- other routes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("terms", [2, 3])
@pytest.mark.campaign
def test_counted_and_rightmost_roots_are_those_of_the_discretised_equation(terms):
    for seed in range(16 if terms == 2 else 4):
        c, h = some(seed, terms)
        found = spectral(c, h)
        if np.min(np.abs(found.real[:12])) < 1e-6:
            continue
        assert int(quasi.count_right(c, h, apart(len(c)))) == np.sum(found.real > 0), seed
        assert int(count_by_argument(c[None], h[None], apart(len(c)))[0]) == np.sum(found.real > 0), seed
        for one in late_roots.rightmost(c, h, apart(len(c)), 3):
            assert np.min(np.abs(found - one)) < 1e-6 * max(1.0, abs(one)), seed


@pytest.mark.campaign
def test_edges_of_delays_are_those_of_the_discretised_equation():
    seen = 0
    for seed in range(20):
        c, _ = some(seed)
        c[0] += np.poly(-np.ones(c.shape[1] - 1))[::-1] * 2.0  # so that it is often stable
        c[1] *= 4.0
        edges = delay_set(c[0], c[1], 1)
        ends = edges.edges[edges.edges < 5.0]
        if not len(ends):
            continue
        seen += 1
        probes = np.concatenate([[0.5 * ends[0]], 0.5 * (ends[1:] + ends[:-1])])
        inside = np.any((edges.intervals[:, :1] < probes) & (probes < edges.intervals[:, 1:]), axis=0)
        for probe, stable in zip(probes, inside, strict=True):
            assert (spectral(c, [0.0, probe], 60)[0].real < 0) == stable, seed
        for edge, frequency in zip(ends, edges.frequencies, strict=False):
            assert abs(quasi.value(c, np.array([0.0, edge]), 1j * frequency)) < 1e-9
    assert seen > 5


def test_windows_of_what_enters_linearly_are_those_of_counting():
    """On a grid of θ, for random P + θ Q with one delay, with two and with three."""
    both = 0
    for seed in range(30):
        c, h = some(seed, 2 + seed % 3)
        q, _ = some(seed + 500, 2 + seed % 3)
        q = q[:, : c.shape[1]] if q.shape[1] >= c.shape[1] else np.pad(q, ((0, 0), (0, c.shape[1] - q.shape[1])))
        q[:, -1] = 0.0
        c[0] += np.poly(-np.ones(c.shape[1] - 1))[::-1] * 3.0
        found = linear_windows(c, q, h, 1e-3, 1e3, apart(len(c)), 1)
        theta = np.geomspace(2e-3, 5e2, 60)
        stable = quasi.count_right(c + theta[:, None, None] * q, h, apart(len(c))) == 0
        if found is None:
            continue
        inside = np.any((found.intervals[:, :1] < theta) & (theta < found.intervals[:, 1:]), axis=0)
        known = theta < (found.intervals[-1, 1] if stable[-1] and len(found.intervals) else np.inf)
        assert np.array_equal(inside[known], stable[known]), seed
        both += 0 < stable.sum() < len(stable)
    assert both > 10


@pytest.mark.parametrize(("seed", "count"), [(1, 40), pytest.param(2, 400, marks=pytest.mark.campaign)])
def test_windows_of_an_inertia_are_those_of_counting(seed, count):
    """Where θ multiplies the highest powers, a pair of frequencies may be possible between two samples of θ alone."""
    chance, seen = np.random.default_rng(seed), 0
    for _ in range(count):
        degree, terms, lowest = chance.integers([3, 2, 1], [7, 4, 3])
        p = chance.normal(size=(terms, degree + 1)) * 10 ** chance.uniform(-3, 3, size=(terms, degree + 1))
        p[0], p[1:, -2:] = abs(p[0]), 0.0
        q = np.zeros_like(p)
        q[0, -1 - lowest :] = abs(chance.normal(size=lowest + 1)) * 10 ** chance.uniform(-1.5, 1.5, size=lowest + 1)
        h = np.append(0.0, 10 ** chance.uniform(-2, 0, size=terms - 1))
        found = linear_windows(p, q, h, 1e-3, 1e3, apart(terms), 0)
        if found is None:
            continue
        theta = np.geomspace(max(found.searched[0], 1e-3), min(found.searched[1], 1e3), 100)
        right = quasi.count_right_if_feasible(p + theta[:, None, None] * q, h, apart(terms))
        inside = np.any((found.intervals[:, :1] < theta) & (theta < found.intervals[:, 1:]), axis=0)
        assert np.array_equal(inside[right >= 0], right[right >= 0] == 0)
        seen += len(found.edges) > 0
    assert seen >= count // 20


def test_an_inertia_has_edges_where_frequencies_are_possible_between_samples_alone():
    """A telescope's axis behind a worm, held by a late controller on the axis: the motor's inertia, by counting."""
    p = np.array([[0, 0, -5.49516254e7, 2.89469628e6, 8.45399289e5, 802.469136, 0],
                  [1.46898168e9, 1.08244079e9, 2.75230501e8, 2.46211438e7, 2.32e4, 0, 0]])  # fmt: skip
    q = np.array([[0, 0, 0, 1.46898168e5, 4.14616430e4, 76.3747846, 10.4], [0.0] * 7])
    h = np.array([0.0, 1.5e-3])
    found = linear_windows(p, q, h, 1e-3, 1e3, apart(2), 0)
    np.testing.assert_allclose(found.intervals, [[0, 3.645], [110.37, 145.57]], rtol=1e-3)
    sides = np.concatenate([found.edges * (1 - 1e-9), found.edges * (1 + 1e-9)])
    right = quasi.count_right(p + sides[:, None, None] * q, h, apart(2)).tolist()
    assert right == [0, 2, 0, 2, 0, 2]


def test_stable_values_of_a_delay_among_others_are_those_of_counting():
    """On a grid of it, for random sums in which it comes on top of one or two of the others; alone by the formula."""
    changes = 0
    for seed in range(24):
        random, terms = np.random.default_rng(seed), 3 + seed % 2
        c, h = some(seed, terms)
        c[0] += np.poly(-np.ones(c.shape[1] - 1))[::-1] * 2.0
        late = np.arange(terms) >= terms - 1 - int(random.integers(0, terms - 2))
        h = np.where(late, random.choice([0.0, 0.5], terms), h)
        found = delay_set_among(c, h, apart(terms), late, 1)
        grid = np.geomspace(1e-2, 20.0, 40)
        stable = np.array([quasi.count_right(c, h + late * one, apart(terms)) == 0 for one in grid])
        inside = np.any((found.intervals[:, :1] < grid) & (grid < found.intervals[:, 1:]), axis=0)
        assert np.array_equal(inside, stable), seed
        changes += 0 < stable.sum() < len(stable)
        alone, same = (
            delay_set_among(c[:2], h[:2] * 0, apart(2), np.array([False, True]), 1),
            delay_set(c[0], c[1], 1),
        )
        np.testing.assert_allclose(alone.intervals, same.intervals, rtol=1e-9)
    assert changes > 3


def test_two_crossings_that_nearly_touch_are_found_and_what_only_touches_is_told():
    """(ω² − w²)(ω² − (w + δ)²) cos ωd, δ ever smaller, beside the zeros of the cosine."""
    for gap in (1e-3, 1e-6):
        w, d = 0.7123456, 3.0
        polynomial = np.polynomial.Polynomial([-(w**2), 0, 1]) * np.polynomial.Polynomial([-((w + gap) ** 2), 0, 1])
        f = Waves(np.array([d]), polynomial.coef[None], np.zeros((1, 5)))
        at, way = f.zeros(5.0)
        cosine = (np.arange(5) + 0.5) * np.pi / d
        expected = np.sort(np.concatenate([[w, w + gap], cosine[cosine < 5.0]]))
        np.testing.assert_allclose(at, expected, rtol=1e-9)
        assert np.all(way[1:] == -way[:-1])
    touching = np.polynomial.Polynomial([-(w**2), 0, 1]) ** 2
    at, way = Waves(np.array([0.0]), touching.coef[None], np.zeros((1, 5))).zeros(5.0)
    assert np.all(np.abs(at - w) < 1e-6)
    assert np.sum(np.abs(way)) % 2 == 0


def test_stable_values_with_two_delays_are_those_of_a_typed_equation():
    """Late controller and late friction: of each delay and of a gain, counted by how the typed function winds."""
    machine = replace(
        lagging(10.0), drive=ss.machine.PositionPD(velocity=1.0, body="block", kp=2.0, kd=0.5, delay=0.2),
        links={"spring": ss.machine.Spring(between=("ground", "block"), damping=0.4)},
    )  # fmt: skip

    def whole(s, kp=2.0, lag=1.0, delay=0.2):
        return s**2 + 0.4 * s + 0.1 * s * np.exp(-lag * s) + (kp + 0.5 * s) * np.exp(-delay * s)

    cases = {"drive.kp": "kp", "contacts.guide.friction.lag": "lag", "drive.delay": "delay"}
    for name, own in cases.items():
        intervals = ss.stable_values(machine, name)
        ends = intervals[(intervals > 0) & np.isfinite(intervals)]
        probes = np.concatenate([[0.3 * np.min(ends, initial=1.0)], ends * 0.999, ends * 1.001, [0.7, 2.1]])
        for probe in probes:
            turned = winding(lambda s, given={own: probe}: np.array([[whole(s, **given)]]), 200.0)
            inside = np.any((intervals[:, 0] < probe) & (probe < intervals[:, 1]))
            assert inside == (turned == 0), (name, probe)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.campaign
def test_late_machines_at_random_have_the_roots_of_theory_11s_matrix(seed):
    machine, matrix = at_random(seed, delay=0.05 * (1 + seed))
    found = ss.eigenvalues(machine)
    if np.isnan(found).all():
        assert ss.growth_rate(machine) == np.inf
        return
    for s in found:
        values, near = (np.linalg.svd(matrix(z), compute_uv=False) for z in (s, s * (1 + 1e-6)))
        assert values[-1] < 1e-8 * values[0] or values[-1] < 1e-3 * near[-1]
    assert int(unstable_roots(operating_point(machine))) == winding(matrix, 300.0)


def test_edges_under_a_delay_are_judged_by_counts_without_eigenvalues(monkeypatch):
    machine = at_random(8, delay=0.208)[0]
    right = ss.eigenvalues(machine, {"drive.kp": (gains := np.geomspace(1.0, 300.0, 9))}).real[:, 0]
    assert 0 < np.sum(right > 0) < len(gains)
    assert np.array_equal(outgrown(operating_point(machine, {"drive.kp": gains}), False, 1e-9), right > 0)
    monkeypatch.setattr(late_roots, "rightmost", lambda *_: pytest.fail("all eigenvalues, which take seconds"))
    edges = ss.boundary(machine, "drive.kp")
    at_edges = operating_point(machine, {"drive.kp": np.array([edge.value for edge in edges])})
    assert edges
    assert np.array_equal(outgrown(at_edges, False, 1e-9), [edge.stable == "neither" for edge in edges])


# --- what people see --------------------------------------------------------------------------------


def test_a_verdict_with_delay():
    stable, unstable = ss.analyze(late_axis("0.1 s")), ss.analyze(late_axis("0.3 s"))
    assert (stable.stable, stable.unstable_roots) == (True, 0)
    assert (unstable.stable, unstable.unstable_roots) == (False, 2)
    edges = {m.parameter: m.edge for m in unstable.margins if m.edge is not None}
    assert edges["drive.delay"].value == pytest.approx(ss.stable_values(late_axis(), "drive.delay")[0, 1], rel=1e-13)
    assert "drive.delay" in str(unstable)
    assert "195.1 ms" in str(unstable)
    assert "unstable roots" not in str(stable)
    data = json.loads(unstable.to_json())
    assert (data["unstable_roots"], data["characteristic_polynomial"], data["routh"]) == (2, [], [])
    first, late = data["characteristic_terms"]
    assert (first["delay"], late["delay"]) == (0.0, 0.3)
    s = complex(*data["eigenvalues"][0])
    total = sum(np.polyval(t["coefficients"][::-1], s) * np.exp(-s * t["delay"]) for t in (first, late))
    assert abs(total) < 1e-9
    assert ss.modes(late_axis("0.3 s"))[0].eigenvalue == unstable.eigenvalues[0]


@pytest.mark.parametrize(
    ("name", "between"),
    [
        ("links.screw.stiffness", (1.0, 1e6)),
        ("bodies.table.mass", None),
        ("drive.velocity", None),
        ("friction.a", None),
    ],
)
def test_edges_of_other_parameters_are_on_the_axis(name, between):
    machine = late_axis("0.3 s")
    edges = ss.boundary(machine, name, between)
    assert edges
    for edge in edges[:4]:
        leading = ss.eigenvalues(machine.with_values({name: edge.value}))
        assert np.min(np.abs(leading.real)) < 1e-8 * np.max(np.abs(leading))
        sides = ss.stability(machine, {name: [edge.value * (1 - 1e-6), edge.value * (1 + 1e-6)]}).tolist()
        assert sorted(sides) == ["stable", "unstable"]


def test_a_late_controller_and_late_friction_together():
    """Products of both delays: counted by the argument principle; each delay alone is the edge without the other."""
    machine = replace(
        lagging(10.0), drive=ss.machine.PositionPD(velocity=1.0, body="block", kp=2.0, kd=0.5, delay=0.2),
        links={"spring": ss.machine.Spring(between=("ground", "block"), damping=0.4)},
    )  # fmt: skip
    point = operating_point(machine)
    assert len(point.model.delays) == 2
    found = ss.eigenvalues(machine)

    def whole(s):
        return s**2 + 0.4 * s + 0.1 * s * np.exp(-s) + (2.0 + 0.5 * s) * np.exp(-0.2 * s)

    assert np.abs(whole(found)) == pytest.approx(np.zeros(len(found)), abs=1e-10)
    (edge, *_) = ss.boundary(machine, "drive.delay", between=(0.05, 2.0))
    on = machine.with_values({"drive.delay": edge.value})
    assert abs(ss.eigenvalues(on)[0].real) < 1e-8
    (edge, *_) = ss.boundary(machine, "drive.kp", between=(0.5, 50.0))
    assert abs(ss.eigenvalues(machine.with_values({"drive.kp": edge.value}))[0].real) < 1e-8


def test_a_scan_with_two_delays_goes_on_where_some_far_samples_cannot_be_counted():
    """A lag of ten natural times, of which some samples decades off the own value oscillate millions of times."""
    machine = replace(
        lagging(10.0, lag=10.0), drive=ss.machine.PositionPD(velocity=1.0, body="block", kp=2.0, kd=0.5, delay=0.2),
        links={"spring": ss.machine.Spring(between=("ground", "block"), damping=0.4)},
    )  # fmt: skip
    assert ss.boundary(machine, "friction.v_stribeck") == ()
    assert set(ss.stability(machine, {"friction.v_stribeck": [0.1, 1.0, 10.0]}).tolist()) == {"stable"}


def test_a_map_tells_ill_posed_points_from_those_without_an_answer(tmp_path):
    """They were told as points without a growth rate, to know more of by the status."""
    gains = {"drive.kd": np.array([0.5, 0.9, 1.1, 1.5])}
    found = ss.run_map(ss.Map(servo(1.0, 0.1), gains, ["growth_rate"]), tmp_path / "late.zarr")
    assert found.statistics()["growth_rate"]["infinite"] == 0.5
    said = str(found)
    assert "for 50 % of the points; ill-posed for 50 %" in said
    assert "compute status" not in said


def test_delayed_damping_that_outweighs_what_acts_at_once_is_ill_posed():
    """Without mass, c s + Kd s exp(−sτ): from Kd = c on there are infinitely many growing roots."""
    base = servo(1.0, 0.1)
    for gain, posed in ((0.9, True), (1.1, False)):
        machine = replace(base, drive=replace(base.drive, kd=gain))
        assert np.isfinite(ss.growth_rate(machine)) == posed
        found = ss.analyze(machine)
        assert found.reason.startswith("the equations are ill-posed") != posed
        if not posed:
            assert "late (by drive.delay)" in found.reason
            assert "friction" not in found.reason
            with pytest.warns(ss.IllPosedWarning, match="this rig has no rightmost eigenvalue"):
                assert np.all(np.isnan(ss.eigenvalues(machine)))
        json.loads(found.to_json())
    with pytest.warns(ss.IllPosedWarning, match="1 of 2 rigs have no rightmost"):
        ss.eigenvalues(replace(base, drive=replace(base.drive, kd=0.9)), {"drive.kd": [0.9, 1.1]})
    (edge,) = ss.boundary(replace(base, drive=replace(base.drive, kd=0.9)), "drive.kd", between=(0.5, 3.0))

    def on_axis(at):  # just before: a root of s + (1 + kd s) exp(−s/10) is on the axis
        kd, s = at[0], 1j * at[1]
        left = s + (1.0 + kd * s) * np.exp(-0.1 * s)
        return left.real, left.imag

    kd, omega = fsolve(on_axis, (0.999, 31.0), xtol=1e-13)
    assert (edge.kind, edge.value) == ("oscillatory", pytest.approx(kd, rel=1e-12))
    assert edge.angular_frequency == pytest.approx(omega, rel=1e-9)
    assert 1 - 1e-3 < kd < 1 - 1e-4


@pytest.mark.parametrize("delay", [1e2, 1e7])
@pytest.mark.campaign
def test_roots_that_crowd_at_the_axis_under_long_delays_are_found(delay):
    """The rightmost, of millions to the right: none lies further, and each is a root."""
    machine = late_axis(f"{delay} s")
    found = ss.eigenvalues(machine)
    c, h = operating_quasi(operating_point(machine))
    for k, s in enumerate(found):
        assert abs(quasi.value(c, h, s)) < 1e-8 * quasi.size_of_terms(c, h, s)
        assert int(quasi.count_right(c, h, apart(len(c)), s.real * (1 + 1e-6) + 1e-12)) <= k + 1
    assert np.all(np.diff(found.real) <= 1e-9)
    assert ss.analyze(machine).unstable_roots > delay / 10


def test_a_delay_of_absurd_length_is_refused_in_words():
    with pytest.raises(ss.NotAvailable, match="so long beside the oscillations"):
        ss.analyze(late_axis("1e100 s"))


def test_roots_that_are_too_many_to_be_counted_are_refused_in_words():
    """With several delays, where no term outweighs the others for long; where one does, any delay is counted."""
    c = np.array([[4.0, 1.2, 1.0], [1.0, 0.1, 0.0], [0.5, 0.2, 0.0]])
    for delay in (1e4, 1e7, 1e12):
        assert quasi.count_right(c, np.array([0.0, delay, 0.77 * delay]), apart(3)) == 0
    c[1:] *= 3
    h = np.array([0.0, 40.0, 31.0])
    assert quasi.count_right(c, h, apart(3)) == winding(lambda s: np.array([[quasi.value(c, h, s)]]), 200.0)
    with pytest.raises(ss.NotAvailable, match="so long beside the oscillations"):
        quasi.count_right(c, np.array([0.0, 1e7, 0.77e7]), apart(3))


def test_all_that_a_controller_does_is_late():
    """A cascade: place of the table, speed of the motor and integral, all one delay ago."""
    drive = ss.machine.Cascade(velocity=1.0, body="motor", measured="table", kv=0.8, kp=3.0, tn=2.5, delay=0.05)
    found = ss.eigenvalues(replace(two_mass(), drive=drive))
    friction = rate_state(0.5, -0.3, 1.0)

    def matrix(s):
        late = np.exp(-0.05 * s)
        screw = 100 + 0.5 * s
        rubbing = s * (friction.a * s + (friction.a - friction.b)) / (s + 1)
        place, speed = 3.0 * 0.8 + 3.0 * 0.8 / 2.5 / s, 3.0 * s + 3.0 / 2.5
        return np.array(
            [[2 * s**2 + screw + speed * late, -screw + place * late], [-screw, 5 * s**2 + screw + rubbing]]
        )

    for s in found:
        values = np.linalg.svd(matrix(s), compute_uv=False)
        assert values[-1] < 1e-9 * values[0]


def test_a_delay_is_kept_in_files_and_is_never_negative():
    assert ss.rig_from_text(ss.rig_to_text(late_axis("0.1 s"))) == late_axis("0.1 s")
    with pytest.raises(ss.ParameterError, match="delay"):
        ss.machine.PositionPD(velocity=1.0, body="motor", kp=1.0, delay=-0.1)


@np.errstate(all="ignore")  # as where it is used
def test_roots_followed_through_their_crossings_are_those_that_are_counted(monkeypatch):
    """With several delays: what stands right between two values of a gain follows from which way each root goes."""
    chance, counts, cells, asked = np.random.default_rng(3), delay_stable_sets.count_right_if_feasible, 0, []
    while cells < 50:
        p, q = chance.normal(size=(2, 3, 4)) * 10.0 ** chance.uniform(-1, 1, size=(2, 3, 4))
        p[0, -1] = abs(p[0, -1])
        p[1:, -1] = q[:, -1] = 0.0
        h = np.append(0.0, 10.0 ** chance.uniform(-1, 1, size=2))
        fast = float(np.max(delay_stable_sets._frequency_bound(p, q, apart(3), np.geomspace(0.2, 5.0, 9))))
        found = delay_stable_sets._candidates(p, q, h, 0.2, 5.0, fast, np.empty(0)) if fast < 50 else None
        if found is None or len(found[0]) < 3:
            continue
        ends = np.concatenate([[0.2], found[0], [5.0]])
        each = p, q, h, apart(3), *found, np.sqrt(ends[:-1] * ends[1:])
        own = delay_stable_sets._count_each(*each)
        monkeypatch.setattr(
            delay_stable_sets, "count_right_if_feasible", lambda c, *h: (asked.append(len(c)), counts(c, *h))[1]
        )
        assert np.array_equal(delay_stable_sets._count_by_crossings(*each), own)
        monkeypatch.undo()
        cells += len(own)
    assert sum(asked) < 0.5 * cells  # the few ends of rows of crossings; wrong directions would have all counted


def test_where_delayed_terms_outweigh_what_acts_at_once_is_told_to_the_last_digit():
    """The two sides of that edge are neighbours in floating point: both are asked in the same words."""
    machine = at_random(78, delay=10 ** np.random.default_rng(78).uniform(-3, 2))[0]
    assert [edge.kind for edge in ss.boundary(machine, "drive.velocity")] == ["ill-posed"]


def late_and_light(kd, delay):
    """A late controller on a body without mass, whose roots form a chain that bends to a line at high frequency."""
    friction = ss.laws.CoulombStribeck(mu_coulomb=0.2, mu_static=0.3, v_stribeck=1e-3, viscous=75.0)
    return ss.Machine(
        bodies={"m": ss.machine.SlidingBody(mass=1.0), "p": ss.machine.SlidingBody()},
        links={"s": ss.machine.Spring(between=("m", "p"), stiffness=1e5)},
        contacts={"c": surface("p", friction, load=100.0)},
        drive=ss.machine.PositionPD(velocity=1e-3, body="p", kp=1e4, kd=kd, delay=delay),
    )


def test_a_chain_of_roots_that_leads_is_no_slower_root():
    """It bends to Re s = ln(kd/c)/delay, c what friction adds at once; a root far to the left of it was given."""
    kd, delay, load, v_stribeck = 100.0, 0.01, 100.0, 1e-3
    machine = late_and_light(kd, delay)
    at_once = load * (75.0 - 2 * 0.1 * np.exp(-1.0) / v_stribeck)  # at the Stribeck velocity
    assert ss.growth_rate(machine) == pytest.approx(np.log(kd / at_once) / delay, rel=1e-4)
    with pytest.warns(ss.linear.UndecidedWarning, match="many are nearly alike"):
        found = ss.eigenvalues(machine)
    assert len(set(found.tolist())) == len(found)


def test_a_search_that_cannot_count_somewhere_answers_elsewhere():
    """A late controller on a body without mass: for some masses its roots turn too often; the verdict needs none."""
    machine = late_and_light(10.0, 1e-3)
    assert ss.boundary(machine, "bodies.m.mass", between=(1e-3, 1e3)) == ()
    rates = ss.growth_rate(machine, {"bodies.m.mass": np.array([0.1, 1.0, 10.0])})
    assert np.all(rates < 0)
