"""Late terms of the highest derivatives under several delays: edges, counts and chains of roots."""

from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import pairwise

import numpy as np
import pytest

import steadyslip as ss
from delays import apart, lagging, late_axis
from machines import surface
from steadyslip.linear import neutral, quasipolynomial as quasi, rightmost as late_roots
from steadyslip.model.point import operating_point
from steadyslip.model.range import quasipolynomial as operating_quasi


def several_blocks(count, slope=0.9):
    """Blocks without mass side by side, each in oil beside friction whose slope, `slope` of the oil's, acts late."""
    numbers = range(count)
    return ss.Machine(
        bodies={f"block{i}": ss.machine.SlidingBody() for i in numbers},
        links={
            f"rod{i}": ss.machine.Spring(between=("drive", f"block{i}"), stiffness=1 + 0.1 * i, damping=1.0)
            for i in numbers
        },
        contacts={f"guide{i}": surface(f"block{i}", falling(slope, 0.3 * (1 + 0.37 * i)), load=1.0) for i in numbers},
        drive=ss.machine.Pull(velocity=1.0),
    )


def falling(slope, lag):
    return ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.3 + slope * np.e / 2, v_stribeck=1.0, lag=lag)


def test_a_highest_power_under_two_delays_vanishes_where_its_signs_say():
    """a + b x + c y + d x y has a zero with |x|, |y| <= 1 unless all four values at ±1 have the sign of a; its least
    size is that on a fine grid of phases."""
    chance, sets = np.random.default_rng(0), np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=bool)
    phases = np.exp(1j * np.linspace(0, np.pi, 181))
    x, y = np.meshgrid(phases, np.concatenate([phases, np.conj(phases)]))
    vanishing = 0
    for _ in range(200):
        c = np.append(1.0, chance.uniform(-1, 1, 3) * [0.9, 0.9, 0.5])
        signs = [c @ [1, x, y, x * y] for x in (1, -1) for y in (1, -1)]
        (found,) = neutral.least_size(c[None], sets)
        assert (found <= 0) == (min(signs) <= 0)
        vanishing += found <= 0
        if found > 0:
            least, plain = np.min(np.abs(c[0] + c[1] * x + c[2] * y + c[3] * x * y)), 1 - np.sum(np.abs(c[1:]))
            assert found == pytest.approx(plain if plain > 0 else 0.5 * least, rel=1e-2)  # half, as others may be less
    assert 40 < vanishing < 160


@pytest.mark.parametrize("count", [2, 3, 4])
def test_roots_of_a_product_are_those_of_its_factors(count):
    """Π [s (1 + b_i exp(−s τ_i)) + a_i], whose highest power has late terms that together outweigh the other."""
    chance, sets = np.random.default_rng(count), np.array(list(np.ndindex(*(2,) * count)), dtype=bool)
    growing = 0
    for _ in range(12 if count < 4 else 2):
        b, tau = chance.uniform(0.5, 0.8, count) * chance.choice([-1, 1], count), 10 ** chance.uniform(-1, 0.3, count)
        a = chance.uniform(-1.0, 3.0, count)
        late = [np.array([[a[i], 1.0], [0.0, b[i]]]) for i in range(count)]
        alone = sum(int(quasi.count_right(one, np.array([0.0, tau[i]]), apart(2))) for i, one in enumerate(late))
        c = np.array([poly(*(one[int(of)] for one, of in zip(late, row, strict=True))) for row in sets])
        assert int(quasi.count_right(c, sets @ tau, sets)) == alone
        growing += alone
    assert growing or count > 3
    late[0][1, 1] = 1.01
    c = np.array([poly(*(one[int(of)] for one, of in zip(late, row, strict=True))) for row in sets])
    assert int(quasi.count_right(c, sets @ tau, sets)) == quasi.INFINITE


def poly(first, *others):
    for one in others:
        first = np.convolve(first, one)
    return first


def test_two_late_blocks_side_by_side_are_as_stable_as_each():
    """Together their late terms outweigh what acts at once: they were told ill-posed."""
    one, two = several_blocks(1), several_blocks(2)
    assert ss.stability(one) == ss.stability(two) == "stable"
    assert ss.stability(several_blocks(2, 1.1)) == "unstable"
    assert ss.growth_rate(one) == pytest.approx(np.log(0.9) / 0.3, rel=1e-9)
    for machine in (one, two):
        (edge,) = ss.boundary(machine, "links.rod0.damping")
        assert (edge.kind, edge.stable, edge.value) == ("ill-posed", "above", pytest.approx(0.9, rel=1e-9))


def test_edges_that_take_too_long_are_named(monkeypatch):
    """Of each parameter an edge, none, or its name among what is not decided; those that are told are the same."""
    machine = replace(
        lagging(10.0), drive=ss.machine.PositionPD(velocity=1.0, body="block", kp=2.0, kd=0.5, delay=0.2),
        links={"spring": ss.machine.Spring(between=("ground", "block"), damping=0.4)},
    )  # fmt: skip
    asked = import_module("steadyslip.linear.boundary")
    monkeypatch.setattr(asked, "_TERMS", 3_000_000)
    found, late = asked.margins_and_missing(machine)
    whole = {one.parameter: one.edge for one in found}
    monkeypatch.setattr(asked, "_TERMS", 60_000)
    verdict = ss.analyze(machine)
    (failed,) = (one for one in verdict.checks if not one.passed)
    missing = failed.what.removeprefix("edges of ").split(", ")
    assert failed.what in " ".join(str(verdict).split())
    assert verdict.stable
    assert {*missing, *(one.parameter for one in verdict.margins)} == {*whole, *late}
    assert len(late) < len(missing)
    for one in verdict.margins:
        assert one.edge == whole[one.parameter]


def test_a_root_off_the_line_that_was_counted_is_not_taken(monkeypatch):
    """Newton's method may end at a root further left or right; the list ends before it."""
    c, h = operating_quasi(operating_point(late_axis("0.1 s")))
    found = late_roots.rightmost(c, h, apart(len(c)), 3)
    assert np.all(np.isfinite(found))
    monkeypatch.setattr(late_roots, "_by_ratios", lambda c, h, sets, count: np.full((len(c), count), np.nan + 0j))
    assert late_roots.rightmost(c, h, apart(len(c)), 3) == pytest.approx(found, rel=1e-9)
    monkeypatch.setattr(late_roots, "_root_on", lambda c, h, sets, real, known: complex(real - 0.01, 1.0))
    assert np.all(np.isnan(late_roots.rightmost(c, h, apart(len(c)), 3)))


def late_twice(kd):
    """theory 11: friction late by 1 s and a controller late by 0.3 s, both of the velocity of a slider without mass."""
    return ss.Slider(
        friction=ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.6, v_stribeck=1.0, viscous=1.0, lag=1.0),
        contact=ss.laws.ConstantNormalStress(preload=1.0), stiffness=1.0,
        drive=ss.machine.PD(1.0, kp=1.0, kd=kd, delay=0.3),
    )  # fmt: skip


@pytest.mark.parametrize("kd", [0.2, 0.5, 0.7])
def test_the_edge_where_late_terms_outweigh_is_found_from_every_gain(kd):
    """At kd = 1 − 0.6 exp(−1); from 0.2 another was told, and no rate of decay."""
    edge = 1 - 0.6 * np.exp(-1.0)
    (found,) = ss.boundary(late_twice(kd), "drive.kd")
    assert (found.kind, found.stable, found.value) == ("ill-posed", "below", pytest.approx(edge, rel=1e-12))
    rate = ss.growth_rate(late_twice(kd))
    assert 0.6 * np.exp(-1.0 - rate) + kd * np.exp(-0.3 * rate) == pytest.approx(1.0, abs=1e-3)
    verdict = ss.analyze(late_twice(kd))
    assert verdict.stable
    assert verdict.growth_rate == pytest.approx(rate)
    assert ("infinitely many oscillations nearly alike" in str(verdict)) == (not verdict.eigenvalues)


def turns_around(f, box, many):
    """Zeros of f in a box from 0 to `box` and ±i `box`, by how it turns along the sides; None if places are too few."""
    at = [-1j * box, box - 1j * box, box + 1j * box, 1j * box, -1j * box]
    sides = [a + (b - a) * np.linspace(0, 1, many)[1:] for a, b in pairwise(at)]
    values = f(np.concatenate([[at[0]], *sides]))
    steps = np.angle(values[1:] / values[:-1])
    return round(np.sum(steps) / (2 * np.pi)) if np.max(np.abs(steps)) < 1.5 else None


def test_counts_where_late_terms_of_the_highest_power_outweigh_are_those_around_a_box():
    """Random sums of four terms under two delays and both together, no product of factors."""
    chance, sets = np.random.default_rng(5), np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=bool)
    seen = []
    while len(seen) < 60:
        c = chance.normal(size=(4, int(chance.integers(2, 5)))) * 10 ** chance.uniform(-1, 0.7)
        c[:, -1] = np.append(1.0, chance.uniform(-1, 1, 3) * [0.95, 0.95, 0.6])
        if np.sum(np.abs(c[1:, -1])) < 1 or neutral.least_size(c[:, -1][None], sets)[0] <= 0.05:
            continue
        h, box = sets @ 10 ** chance.uniform(-1, 0.5, 2), 1.05 * float(neutral.bound_on_axis(c[None], sets)[0])
        if box > 400:
            continue
        around = turns_around(partial(quasi.value, c, h), box, int(120 * box * max(1, h.max())) + 2000)
        if around is not None:
            assert int(quasi.count_right(c, h, sets)) == around
            seen.append(around)
    assert len(set(seen)) > 4
