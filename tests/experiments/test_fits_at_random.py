"""A fixed sample of fits of records drawn at random: intervals hold the truth, servos are named."""

import numpy as np
import pytest

import fits_at_random as campaign

DRAWN = 4


@pytest.mark.campaign
@pytest.mark.parametrize("kind", campaign.DESIGNS)
def test_fits_of_records_at_random_hold_the_truth(kind):
    """Of 16 deviations or more at most a quarter is beyond 1.96 errors, and none beyond 4.5."""
    found = [campaign.outcome(one) for one in campaign.drawn(kind, DRAWN, 3)]
    z = np.abs([z for own in found for z in own.z.values()])
    assert len(z) >= 4 * DRAWN
    assert np.mean(z > 1.96) <= 0.25
    assert np.max(z) < 4.5
    if kind.endswith("ideal"):
        assert not any(own.servo for own in found)
    elif "," in kind and "brief" not in kind and "curve" not in kind:  # a smooth curve is followed as a ramp
        assert any(own.servo for own in found)


@pytest.mark.campaign
def test_errors_of_a_minus_b_of_soft_presses_are_those_of_repetition():
    """Soft presses have valleys along which a and b go together: their difference stays known, and no better."""
    found = [campaign.outcome(one) for one in campaign.drawn("soft", 60, 7)]
    for name in ("a", "b", "a - b"):
        z = np.array([own.z[name] for own in found if name in own.z])
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.25), name
