"""One measure of how far an edge is: laws of the measure, and that verdict, cure and page name the same end."""

import math

import numpy as np
import pytest

import steadyslip as ss
from cures_at_random import random_rig
from explored import page_modules
from javascript import Script
from steadyslip.linear.nearness import doublings, ends_about, nearest_end
from steadyslip.verdict import Adjustment


@pytest.fixture
def chance():
    return np.random.default_rng(33)


def test_it_measures_factors_the_same_both_ways(chance):
    one, other, third = np.sort(10 ** chance.uniform(-12, 12, (3, 300)), axis=0) * np.sign(chance.uniform(-1, 1, 300))
    assert doublings(one, other) == pytest.approx(doublings(other, one))
    assert doublings(one, third) == pytest.approx(doublings(one, other) + doublings(other, third))
    assert doublings(one, one / 8) == pytest.approx(3)
    assert doublings(one, one).tolist() == [0.0] * 300


def test_zero_is_one_doubling_away_and_what_lies_behind_it_is_further():
    assert doublings(3.0, 0.0) == doublings(0.0, -7.0) == 1.0
    assert np.all(np.diff(doublings(3.0, [0.0, -1e-6, -1.0, -3.0, -1e9])) > 0)
    assert math.isnan(doublings(1.0, math.nan))
    assert doublings(-0.2, 0.3, "rad") == pytest.approx(0.5)


def test_only_the_next_ends_on_each_side_count(chance):
    """By an own search over all values, of which none may lie between; arrays and single values agree."""
    for _ in range(300):
        ends = chance.normal(size=chance.integers(1, 6)) * 10 ** chance.uniform(-2, 2)
        own = float(chance.choice([0.0, chance.normal(), ends[0]]))
        free = [end for end in ends if not np.any((ends > min(own, end)) & (ends < max(own, end)))]
        about = ends_about(own, list(ends))
        assert set(about) == ({own} if own in ends else set(free))
        far = [(float(doublings(own, end)), abs(end - own)) for end in about]
        assert far == sorted(far)
        assert ends[nearest_end(ends, own)] == about[0]
        assert np.append(np.nan, ends)[nearest_end(np.append(np.nan, ends), own)] == about[0]


def test_pages_measure_alike(chance):
    script = Script(f"{page_modules()}")
    for _ in range(100):
        own = float(chance.choice([0.0, chance.normal()]))
        ends = [float(end) for end in chance.normal(size=chance.integers(0, 5))]
        unit = str(chance.choice(["", "rad"]))
        found = script("about(ends, (x) => x, own, unit)", ends=ends, own=own, unit=unit)
        assert found == list(ends_about(own, ends, unit))
        far = script("ends.map((one) => doublings(own, one, unit))", ends=ends, own=own, unit=unit)
        assert far == pytest.approx([float(doublings(own, end, unit)) for end in ends])


@pytest.mark.parametrize("seed", range(8))
def test_verdict_and_cure_name_the_same_end(seed):
    """Of every parameter without zero: what would lose stability first, or what would cure it."""
    rig = random_rig(seed)
    for margin in ss.margins(rig):
        edges = [edge for edge in margin.edges if edge.stable in ("above", "below")]
        if margin.edge not in edges or not margin.value or margin.remote or margin.unit == "rad":
            continue
        wide = {margin.parameter: Adjustment()}
        (window,) = ss.cure(rig, adjust=wide).windows
        told = window.leaves if ss.stability(rig) == "stable" else window.nearest
        assert told == pytest.approx(margin.edge.value, rel=1e-6), margin.parameter


def test_both_ends_of_a_window_are_told():
    """Of one from 0.627 to 51 um/s at 10 um/s: by share of the value the lower end is nearer, by factor the upper."""
    rig = random_rig(27).with_values({"drive.velocity": 1e-5})
    margin = next(one for one in ss.margins(rig) if one.parameter == "drive.velocity")
    upper, lower = (edge.value for edge in margin.about)
    assert 1e-5 - lower < upper - 1e-5
    assert upper / 1e-5 < 1e-5 / lower
    rows = str(ss.analyze(rig)).splitlines()
    at = next(i for i, row in enumerate(rows) if row.startswith("  drive.velocity "))
    assert rows[at].split()[3:] == ["->", "51", "um/s", "+410", "%", "it", "lifts", "off"]
    assert rows[at + 1].split()[:3] == rows[at].split()[:3]
    assert rows[at + 1].split()[4:] == ["626.9", "nm/s", "x", "0.06269", "becomes", "stable"]
