"""Check of a cycle by the motion from its start."""

import numpy as np
import pytest

from steadyslip.nonlinear.orbits.cycle_from_motion import closing_error


def test_an_end_that_is_late_counts_by_its_delay_and_one_beside_the_cycle_by_its_distance():
    """A cycle is a curve: states along it are told apart by a time."""
    chance = np.random.default_rng(5)
    for _ in range(100):
        rates = chance.normal(size=(3, 4)) * 10.0 ** chance.uniform(-3, 3)
        across = chance.normal(size=(3, 4))
        across -= rates * np.sum(across * rates, axis=1, keepdims=True) / np.sum(rates**2, axis=1, keepdims=True)
        late = chance.normal(size=(3, 1))
        period, amplitude = 10.0 ** chance.uniform(-2, 2), 10.0 ** chance.uniform(-6, 0)
        found = closing_error(late * rates + across, rates, period, amplitude)
        assert found == pytest.approx(max(np.abs(late).max() / period, np.abs(across).max() / amplitude))
