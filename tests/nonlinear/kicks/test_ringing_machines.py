"""A fixed part of what `ringing_machines.py` does by hand: thresholds of machines that ring, and simulations beside."""

import pytest

from ringing_machines import drawn, judged


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [0, 2, 6, 7])
def test_thresholds_of_machines_that_ring_are_decided_and_right(seed):
    case = drawn(seed)
    assert judged(case, case.threshold()) == "right", str(case)
