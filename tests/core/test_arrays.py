"""Arrays in place of numbers."""

import numpy as np
import pytest

from steadyslip.core.arrays import distinct


@pytest.mark.parametrize("count", [0, 1, 2, 50])
def test_distinct_values_are_those_of_numpy(count):
    values = np.random.default_rng(count).integers(-9, 9, count) / 7
    for own, numpys in zip(distinct(values), np.unique(values, return_index=True), strict=True):
        np.testing.assert_array_equal(own, numpys)
