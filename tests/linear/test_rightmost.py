"""Rightmost roots under delays: those found by ratios and one count are those found by bisection on counts."""

from __future__ import annotations

import numpy as np
import pytest

from steadyslip.linear import rightmost as late_roots
from steadyslip.linear.quasipolynomial import nondimensional, size_of_terms, value

ONE = np.array([[0], [1]], dtype=bool)
TWO = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=bool)  # two delays and their sum


def at_random(seed, sets, rigs):
    """Two oscillations and a decay, on which signals act late: coefficients (rigs, m, 6) and delays (rigs, m)."""
    rng = np.random.default_rng(seed)
    c = np.zeros((rigs, len(sets), 6))
    for one in c:
        rates, damping = np.exp(rng.uniform(-1.0, 3.0, 2)), rng.uniform(0.01, 0.3, 2)
        swings = rates * (-damping + 1j * np.sqrt(1 - damping**2))
        one[0] = np.poly([-np.exp(rng.normal()), *swings, *swings.conj()]).real[::-1]
        for late in one[1:]:
            powers = rng.integers(1, 4)
            late[:powers] = rng.normal(size=powers) * np.abs(one[0, :powers]) * rng.uniform(0.1, 1.5)
    return c, np.exp(rng.uniform(-4.0, 0.5, (rigs, sets.shape[1]))) @ sets.T


@pytest.mark.parametrize(("sets", "seed", "least"), [(ONE, 1, 0.9), (TWO, 2, 0.7)])
@pytest.mark.parametrize("count", [1, 4])
def test_roots_by_ratios_are_those_by_bisection(sets, seed, least, count):
    c, h, _ = nondimensional(*at_random(seed, sets, 16))
    with np.errstate(all="ignore"):
        found = late_roots._by_ratios(c, h, sets, count)
        told = np.flatnonzero(~np.isnan(found[:, -1]))
        assert len(told) >= least * len(c)  # else most are bisected, each a hundred times slower
        for row in told[:: len(told) // 2]:
            assert found[row] == pytest.approx(late_roots._rightmost_of_one(c[row], h[row], sets, count), rel=1e-9)


def test_every_root_is_one_and_none_lies_further_right():
    c, h = at_random(3, ONE, 12)
    found = late_roots.rightmost(c, h, ONE, 3)
    assert np.all(np.abs(value(c, h, found)) < 1e-8 * size_of_terms(c, h, found))
    for row, first in zip(zip(c, h, strict=True), found[:, 0], strict=True):  # Newton's method from everywhere else
        s = first.real + np.linspace(1e-3, 3.0, 40)[:, None] * abs(first) + 1j * np.linspace(0.0, 40.0, 200)
        size = np.abs(value(*row, s)) / size_of_terms(*row, s)
        assert np.min(size) > 1e-9


@pytest.mark.parametrize("delay", [30.0, 60.0, 90.0])
def test_roots_that_ratios_miss_are_found_by_bisection(delay):
    """Rightmost of s² + 0.02 s + 1 + 0.3 exp(−s delay): an oscillation of many turns within the delay."""
    c, h = np.array([[1.0, 0.02, 1.0], [0.3, 0.0, 0.0]]), np.array([0.0, delay])
    (found,) = late_roots.rightmost(c[None], h[None], ONE, 1)[0]
    assert found == pytest.approx(late_roots._rightmost_of_one(c, h, ONE, 1)[0], rel=1e-9)
    s = found.real + 1e-3 + 1j * np.linspace(0.0, 3.0, 100_000)  # no root lies right of this line: no turn along it
    turns = np.unwrap(np.angle(value(c, h, s)))[-1] / np.pi  # of the half line; two quarters of s² beyond
    assert turns == pytest.approx(1.0, abs=0.05)
