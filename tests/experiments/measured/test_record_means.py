"""Means in the place of many samples: what they are worth, and that nothing is averaged across a change."""

from __future__ import annotations

import numpy as np
import pytest

import steadyslip as ss


def test_means_take_the_place_of_many_samples():
    """White noise: the mean of n is worth n. Nothing is averaged across a step, and what is linear stays so."""
    rng = np.random.default_rng(5)
    time = 0.01 * np.arange(20_000)
    moved = 3e-6 * time + 7e-6 * np.maximum(time - 80.0, 0.0)
    noise = 1e-3 * rng.standard_normal(len(time))
    record = ss.record_from_arrays(time, friction=0.6 + noise, normal=1e7, displacement=moved)
    few = record.decimated(500)
    assert 490 <= len(few) <= 520
    assert few.worth.sum() == pytest.approx(len(record), rel=0.1)  # whiteness itself is told from the noise
    np.testing.assert_allclose(few.displacement, 3e-6 * few.time + 7e-6 * np.maximum(few.time - 80.0, 0.0), rtol=1e-9)
    assert np.average(few.friction, weights=few.worth) == pytest.approx(np.mean(record.friction), abs=2e-6)
    spread = np.std((few.friction - 0.6) * np.sqrt(few.worth))
    assert spread == pytest.approx(1e-3, rel=0.15)
    assert few.loading is record.loading
    assert [step.time for step in few.steps] == [step.time for step in record.steps]


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_worth_of_means_of_noise_that_lasts(memory):
    """The deviation of means times the root of their worth is that of single samples, whatever the noise remembers."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(6)
    noise = lfilter([1e-3 * np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(100_000))
    time = 0.01 * np.arange(len(noise))
    few = ss.record_from_arrays(time, friction=0.6 + noise, normal=1e7, displacement=3e-6 * time).decimated(3000)
    late = few.time > 100
    spread = np.std((few.friction[late] - 0.6) * np.sqrt(few.worth[late]))
    assert spread == pytest.approx(np.std(noise), rel=0.1)
