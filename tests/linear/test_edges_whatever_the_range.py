"""Edges do not depend on how they are asked for: on the range, the parameter's own value, units or order."""

import math
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from edges_at_random import differences
from rigs_of_theory import SIGMA, rate_state, rig

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("apart", [math.radians(0.18), 1e-5, 1e-7])
def test_a_strip_beside_lock_up_is_found_whatever_the_range(apart):
    """Sliding is made to change so near to lock-up, where it would be unstable from there to the next sample."""
    friction = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    plain = rig(friction=friction, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5))
    lock = -math.atan(1 / 0.7)
    held = plain.with_values({"stiffness": float(ss.critical_stiffness(plain, {"contact.angle": lock + apart}))})
    edges = ss.boundary(held, "contact.angle")
    assert [edge.kind for edge in edges][:2] == ["lock-up", "oscillatory"]
    assert edges[0].value == pytest.approx(lock, abs=1e-12)
    assert edges[1].value - lock == pytest.approx(apart, rel=1e-4)
    for between in ((-1.5, 1.5), (-1.0, 0.3), (lock - 0.1, lock + 2 * apart), (lock + 0.5 * apart, 0.0)):
        assert ss.boundary(held, "contact.angle", between) == tuple(
            edge for edge in edges if between[0] <= edge.value <= between[1]
        )


@pytest.mark.parametrize("own", [0.0, 138.0, 1e7])
def test_an_edge_is_found_from_any_own_value(own):
    """The damping that a stiffness just below the critical one needs lies seven decades above the small one."""
    held = ss.read_rig(EXAMPLES / "two-states.toml").with_values({"damping": own, "v_ref": 8.7094e-6})
    (edge,) = ss.boundary(held, "slider.damping")
    (wide,) = ss.boundary(held, "slider.damping", (0.0, 1e12))
    assert edge.value == pytest.approx(1724607691.0, rel=1e-9)
    assert wide.value == edge.value


def test_stable_values_follow_from_any_own_value():
    """Exact ones, of a single rig and of arrays alike, up to fifteen decades away."""
    guides = ss.read_rig(EXAMPLES / "machines" / "two-guides.toml")
    for name in ("links.belt.stiffness", "bodies.carriage.mass"):
        (wanted,) = ss.stable_values(guides, name)
        for factor in (1e-15, 1e-7, 1e7, 1e15):
            other = guides.with_values({name: guides.value(name) * factor})
            assert ss.stable_values(other, name)[0] == pytest.approx(wanted, rel=1e-6)
            many = ss.stable_values(other, name, {"drive.velocity": np.full(2, guides.value("drive.velocity"))})
            assert many[1][0] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.campaign
def test_random_rigs_have_the_same_edges_however_they_are_asked_for():
    found = [differences(seed) for seed in (*range(60, 80), *range(100, 112))]
    assert [words for _, wrong in found for words in wrong] == []
    assert sum(compared for compared, _ in found) > 200
