"""Edges of growth of undamped structures: as of the same machine by its equations, and by eigenvalues typed by hand."""

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.linear.matrix_coupling import nothing_damps
from steadyslip.model.numeric.machine_point import machine_point

FRICTION = "contacts.tip.friction.mu_coulomb"
ROOT = np.sqrt(3)
HOFFMANN_AND_GAUL = np.array([[3.5, -2 / ROOT], [-2 / ROOT, 3.5 / 3]])  # springs 11/3 and 1 at -30 and 30 deg


def on_a_belt(inertia, stiffness, spring, damping=None):
    """A structure whose first two coordinates are a point along and across a belt that is pressed on it."""
    size = len(inertia)
    zero = np.zeros((size, size))
    data = ss.machine.StructureData(inertia, zero if damping is None else damping, stiffness, zero)
    return ss.machine.Machine(
        bodies={"frame": ss.machine.StructureBody(matrices=data, points={"tip": ss.machine.StructurePoint(x=1, y=2)})},
        contacts={"tip": ss.machine.Surface(
            body="drive", against="frame.tip", friction=ss.laws.Coulomb(mu_coulomb=0.1),
            contact=ss.laws.Compliant(normal_stiffness=spring, steady_normal_stress=1.0),
        )},
        drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip


def test_undamped_edge_of_hoffmann_and_gaul():
    (edge,) = ss.boundary(on_a_belt(np.eye(2), HOFFMANN_AND_GAUL, 4 / 3), FRICTION)
    assert (edge.kind, edge.quiet, edge.stable) == ("coupling", "below", "neither")
    assert edge.value == pytest.approx(1.0284051669940213, rel=1e-10)
    assert edge.angular_frequency == pytest.approx(ROOT, rel=1e-10)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(n, marks=pytest.mark.campaign) for n in range(2, 20))])
def test_edges_of_random_structures(seed):
    """Against eigenvalues of M⁻¹ (K + k (across + μ along) acrossᵀ) at twenty thousand values of μ."""
    chance = np.random.default_rng(seed)
    size = int(chance.integers(2, 6))
    factor = chance.standard_normal((size, size))
    inertia, stiffness = np.diag(chance.uniform(0.5, 2, size)), factor @ factor.T + 0.2 * np.eye(size)
    spring = float(chance.uniform(0.5, 4))
    machine = on_a_belt(inertia, stiffness, spring)
    grid = np.geomspace(1e-2, 20, 20_000)
    pulled = np.zeros((len(grid), size, size))
    pulled[:, 0, 1], pulled[:, 1, 1] = spring * grid, spring
    u = np.linalg.eigvals(-np.linalg.solve(inertia, stiffness + pulled))
    grows = np.any((np.abs(u.imag) > 1e-6 * np.abs(u)) | (u.real > 0), axis=1)
    wanted = np.sqrt(grid[1:] * grid[:-1])[np.diff(grows)]
    found = [one.value for one in ss.boundary(machine, FRICTION, (1e-2, 20)) if one.quiet]
    assert found == pytest.approx(wanted.tolist(), rel=5e-4)


def test_damping_anywhere_makes_it_an_ordinary_search():
    assert nothing_damps(machine_point(on_a_belt(np.eye(2), HOFFMANN_AND_GAUL, 4 / 3)).pencil)
    damped = on_a_belt(np.eye(2), HOFFMANN_AND_GAUL, 4 / 3, np.diag([0.05, 0.05]))
    assert not nothing_damps(machine_point(damped).pencil)
    (edge,) = ss.boundary(damped, FRICTION)
    assert edge.stable == "below"


def test_the_verdict_says_that_nothing_damps_it():
    found = ss.analyze(on_a_belt(np.eye(2), HOFFMANN_AND_GAUL, 4 / 3))
    assert found.undamped
    assert "two oscillations couple and one grows" in str(found)
    assert "not decided" not in str(found)
