"""Kicks drawn at random end as SciPy says: a fixed part of benchmarks/kicks.py."""

import numpy as np
import pytest

from kicks_at_random import KINDS, drawn, outcome_of

FEW = ("slip massless tilted", "lugre mass level", "nagata massless level")


@pytest.mark.parametrize("kind", FEW)
@pytest.mark.campaign
def test_random_kicks_equal_scipy(kind):
    """Of a few kinds here, that kernels are compiled for anyway; the others by hand."""
    from kicks_by_scipy import Reference  # compiled by numba, which takes long to import

    assert kind in KINDS
    random = np.random.default_rng(11)
    told = 0
    for _ in range(4):
        case = drawn(random, (kind,))
        found, truth = outcome_of(case), Reference(case).outcome(limit=2.0)
        assert found in (truth, "undecided") or truth == "?", str(case)
        told += found == truth
    assert told >= 2
