"""Kicks of rigs with delays: what they survive is what simulation, and delay equations typed by hand, survive."""

import numpy as np
import pytest

import steadyslip as ss
from late_motion import history, massless

NEAR = 2e-3  # relative distance of the kicks on both sides


@pytest.fixture(scope="module")
def late():
    return massless(k=0.19, kp=0.06)


@pytest.fixture(scope="module")
def size(late):
    found = ss.threshold(late.rig, "displacement")
    assert found.decided
    assert found.outcome == "blow-up"
    return found.size


def test_simulation_on_both_sides(late, size):
    below, above = (
        ss.simulate(late.rig, ss.protocol.DisplacementStep(at=0.0, by=size * (1 + side)), until=300.0)
        for side in (-NEAR, NEAR)
    )
    assert (above.status, above.end < 1) == ("blow-up", True)
    assert below.end == 300.0
    assert np.ptp(below["x"][below["t"] > 250]) < 0.3 * np.ptp(below["x"])


def test_the_delay_equation_on_both_sides(late, size):
    """The load point ahead by a step is the block behind by it; what blows up overflows."""
    behind = [np.array([-size * (1 + side), 0.0, 0.0]) for side in (-NEAR, NEAR)]
    with np.errstate(all="ignore"):
        _, state = history(late, 60.0, behind[0], rtol=1e-9)
        assert abs(state(60.0)[0]) < 1.0
        with pytest.raises(ValueError, match="the reference fails"):
            history(late, 60.0, behind[1], rtol=1e-9)
