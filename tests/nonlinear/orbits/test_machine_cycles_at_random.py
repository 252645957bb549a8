"""A fixed part of what `machine_cycles_at_random.py` does by hand: branches of cycles by a second route."""

import numpy as np
import pytest

from kicks_at_random import drawn
from machine_cycles_at_random import apart, of_one_body
from scaled_machines import same


@pytest.mark.campaign
def test_cycles_of_machines_of_one_body_are_those_of_sliders():
    random = np.random.default_rng(3)
    for kind in ("slip damped level", "aging mass level"):
        own, machine = of_one_body(drawn(random, (kind,)).rig, points=6)
        assert apart(own, machine) < 1e-6


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [5, 6])
def test_machines_in_other_units_and_another_order_have_the_same_cycles_and_survive_the_same_kicks(seed):
    *_, off = same(np.random.default_rng(seed))
    assert off < 1e-6
