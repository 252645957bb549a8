"""A fixed sample of fits of machines drawn at random: intervals hold the truth, and searches find the minimum."""

import pytest

import machine_fits_at_random as campaign

DRAWN = 16


@pytest.mark.campaign
@pytest.mark.parametrize("kind", campaign.KINDS)
def test_fits_of_machines_at_random_hold_the_truth(kind):
    found = [campaign.outcome(kind, seed) for seed in range(1, 1 + DRAWN)]
    rms, held, within_chance = campaign.told(found)
    assert within_chance, (rms, held)
    assert sum(bool(one.z) for one in found) >= DRAWN // 2
    assert not any(one.excess > campaign.MISSED for one in found)
