"""Edges of growth of undamped machines (theory 13): closed forms of two modes, and printed values."""

import math

import numpy as np
import pytest

import steadyslip as ss
from machines import ACROSS, ALONG, block
from steadyslip.linear.undamped import is_undamped
from steadyslip.model.point import operating_point

EXACT = 1e-13  # a double root is told from a close pair to within rounding of the polynomial


def edges(machine, name="mu_coulomb"):
    return [one.value for one in ss.boundary(machine, name)]


def test_undamped_edge_of_hoffmann_and_gaul():
    (edge,) = ss.boundary(block(), "mu_coulomb")
    assert (edge.kind, edge.quiet, edge.stable) == ("coupling", "below", "neither")
    assert edge.value == pytest.approx(1.0284051669940213, rel=EXACT)
    assert edge.angular_frequency == pytest.approx(math.sqrt(3), rel=EXACT)  # u = −(k11 + k22 + k3)/2 = −3
    assert "no root grows below" in str(edge)


@pytest.mark.parametrize(
    ("machine", "critical"),
    [
        (block(ALONG.format(0.05)), 0.8660254037844386),
        (block(ALONG.format(0.3)), 0.8660254037844386),
        (block(contact=0.05), 0.411197204687487),
        (block(contact=0.2), 0.411197204687487),
        (block(ALONG.format(0.05), contact=0.05), 0.870158834866838),
        (block(ALONG.format(0.01), contact=0.01), 0.866190736),
        (block(ALONG.format(0.1), contact=0.1), 0.882560660540601),
        (block(ACROSS.format(0.05)), 0.8660254037844386),
        (block(ACROSS.format(0.4)), 0.8660254037844386),
        (block(ACROSS.format(0.05), ALONG.format(0.05)), 1.03327655989031),
    ],
)
def test_damped_edges_of_hoffmann_and_gaul(machine, critical):
    """The least damping moves the edge from 1.03 to .87 or .41: an undamped edge is no limit of damped ones."""
    (edge,) = ss.boundary(machine, "mu_coulomb")
    assert (edge.kind, edge.stable) == ("oscillatory", "below")
    assert edge.value == pytest.approx(critical, rel=1e-9)


def test_mode_coupling_of_two_springs():
    """m = 1, k1 = 1, k12 = .3, k2 = 1.2 with k3 = .8: μ_c = [k12² + (k1 − k2)²/4]/(k12 k3); .0476 at 1.1 μ_c."""
    values, vectors = np.linalg.eigh([[1.0, 0.3], [0.3, 0.4]])
    angles = [math.atan2(*v[::-1]) for v in vectors.T]
    machine = block().with_values(
        {"one.stiffness": values[0], "one.angle": _angle(angles[0]), "two.stiffness": values[1],
         "two.angle": _angle(angles[1]), "normal_stiffness": 0.8, "mu_coulomb": 0.1}
    )  # fmt: skip
    if not edges(machine):  # friction acts towards the other side
        machine = machine.with_values({"one.angle": -_angle(angles[0]), "two.angle": -_angle(angles[1])})
    first = ss.boundary(machine, "mu_coulomb")[0]
    assert first.value == pytest.approx((0.3**2 + 0.2**2 / 4) / (0.3 * 0.8), rel=1e-12)
    grown = machine.with_values({"mu_coulomb": 1.1 * first.value})
    assert ss.growth_rate(grown) == pytest.approx(0.0476240575692899, rel=1e-11)


def _angle(angle):
    """The same line within a quarter turn of the slide."""
    return (angle + math.pi / 2) % math.pi - math.pi / 2


def closed_form(machine):
    """Edges of two modes in μ, from tr² = 4 det (coupling) and det = 0 (lock-up) of [[a, b − μ k], [b, c + k]]."""
    k, mass = machine.value("normal_stiffness"), machine.value("block.mass")
    a = b = c = 0.0
    for link in ("one", "two"):
        stiffness, angle = machine.value(f"links.{link}.stiffness"), machine.value(f"links.{link}.angle")
        a += stiffness * math.cos(angle) ** 2
        b += stiffness * math.cos(angle) * math.sin(angle)
        c += stiffness * math.sin(angle) ** 2
    coupling, static = b**2 + (a - c - k) ** 2 / 4, b**2 - a * (c + k)
    assert mass == 1
    return {"coupling": coupling / (b * k), "lock-up": static / (b * k)}


@pytest.mark.parametrize("seed", range(12))
def test_edges_of_random_pairs_of_springs(seed):
    chance = np.random.default_rng(seed)
    machine = block().with_values(
        {"one.stiffness": chance.uniform(0.5, 5), "two.stiffness": chance.uniform(0.5, 5),
         "one.angle": chance.uniform(0.1, 1.4), "two.angle": chance.uniform(-1.4, -0.1),
         "normal_stiffness": chance.uniform(0.3, 3), "mu_coulomb": 1e-3}
    )  # fmt: skip
    wanted = {kind: value for kind, value in closed_form(machine).items() if value > 0}
    found = {one.kind: one.value for one in ss.boundary(machine, "mu_coulomb", (1e-6, 1e3)) if one.quiet}
    assert found == pytest.approx(wanted, rel=1e-10)


def test_growth_rises_as_the_square_root_of_the_distance():
    machine = block()
    critical = edges(machine)[0]
    near, far = (ss.growth_rate(machine.with_values({"mu_coulomb": critical * (1 + h)})) for h in (1e-6, 4e-6))
    assert far / near == pytest.approx(2, rel=1e-4)


def test_any_damping_or_memory_is_damped():
    def undamped(machine):
        return bool(is_undamped(operating_point(machine)))

    assert undamped(block())
    assert not undamped(block(ALONG.format(1e-9)))
    assert not undamped(block(contact=1e-9))
    assert not undamped(ss.read_rig("examples/machines/brake-pad.toml"))


def test_the_verdict_says_that_nothing_dies_out():
    found = ss.analyze(block())
    assert str(found).startswith("UNDAMPED: no disturbance of steady sliding at 1 m/s grows, and none dies out")
    assert "two oscillations couple and one grows" in str(found)
    assert found.undamped
    assert found.to_dict()["undamped"]
    assert all(one.passed for one in found.checks)
    beyond = ss.analyze(block().with_values({"mu_coulomb": 1.1}))
    assert beyond.stable is False
    assert "no disturbance grows" in str(beyond)
    assert ss.analyze(block(ALONG.format(0.05))).undamped is False


def test_a_map_tells_where_nothing_grows_from_where_two_modes_couple(tmp_path):
    """Its edge is that of `boundary`, where `status` said "unstable" throughout; the least damping decides anew."""
    grids = {"mu_coulomb": ss.maps.Grid(0.2, 2.0, 10), "one.stiffness": ss.maps.Grid(2.0, 5.0, 4)}
    found = ss.run_map(ss.Map(block(), grids, ["status"]), tmp_path / "undamped.zarr")
    words = np.array(found.words("status"))[found.dataset["status"].values]
    for j, stiffness in enumerate(found.dataset["links.one.stiffness"].values):
        edge = edges(block().with_values({"one.stiffness": stiffness}))
        below = found.dataset["contacts.belt.friction.mu_coulomb"].values < (edge[0] if edge else np.inf)
        assert words[:, j].tolist() == np.where(below, "undamped", "unstable").tolist()
    axes = found.plot()
    line = next(one for one in axes.lines if one.get_label().startswith("edge of stability"))
    x, y = line.get_xdata(), line.get_ydata()
    for i in np.flatnonzero(np.isfinite(x))[::5]:
        assert min(abs(x[i] - edges(block().with_values({"one.stiffness": y[i]})))) < 1e-6 * x[i]
    refined = ss.refine(found, 1)
    assert len(refined.sides)
    assert ss.stability(block(ALONG.format(0.05)), {"mu_coulomb": [0.8, 0.95]}).tolist() == ["stable", "unstable"]
    assert ss.stability(block(), {"mu_coulomb": [0.95, 1.1]}).tolist() == ["undamped", "unstable"]
