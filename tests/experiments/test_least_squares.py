"""Least squares in lanes: each problem alone, whatever the others do."""

from __future__ import annotations

import numpy as np
import pytest

from steadyslip.experiments.numerics.least_squares import LOST, PROGRESS_ITERATIONS, minimise


def test_every_lane_solves_its_own_problem():
    """Rosenbrock's valley from many places, with bounds and with a coordinate held."""

    def valley(z, _):
        x, y = z.T
        r = np.stack([-10 * (y - x**2), -(1 - x)], axis=1)
        rows = np.stack(
            [np.stack([-20 * x, -np.ones_like(x)], 1), np.stack([np.full_like(x, 10.0), np.zeros_like(x)], 1)], 1
        )
        return r, rows

    start = np.random.default_rng(0).uniform(-2, 2, (40, 2))
    wide = np.full(2, -np.inf), np.full(2, np.inf)
    free = minimise(valley, start, *wide, most=300)
    np.testing.assert_allclose(free.coordinates, 1.0, rtol=1e-4)
    assert np.all(free.converged)
    bound = minimise(valley, start, np.array([-3.0, -3.0]), np.array([0.5, 3.0]), most=300)
    np.testing.assert_allclose(bound.coordinates, np.tile([0.5, 0.25], (40, 1)), rtol=1e-4)
    held = minimise(valley, start, *wide, held=np.tile([True, False], (40, 1)), most=300)
    np.testing.assert_allclose(held.coordinates[:, 1], start[:, 0] ** 2, rtol=1e-5, atol=1e-7)


def test_no_problems_have_no_minima():
    found = minimise(lambda z, _: 1 / 0, np.empty((0, 3)), np.full(3, -1.0), np.full(3, 1.0))
    assert found.coordinates.shape == (0, 3)
    assert found.distinct(2)[0].shape == (0, 3)


def test_steps_that_follow_each_other_along_one_line_are_stretched():
    """The textbook's case of Gauss and Newton's slow way: residuals x + 1 and λx² + x − 1, each step λ of the last."""
    pace = np.array([0.5, 0.9, 0.97])

    def textbook(z, lanes):
        x, share = z[:, 0], pace[lanes]
        slopes = np.stack([np.ones_like(x), 2 * share * x + 1], axis=1)
        return np.stack([x + 1, share * x**2 + x - 1], axis=1), -slopes[:, None, :]

    found = minimise(textbook, np.full((3, 1), 0.1), np.array([-1.0]), np.array([1.0]), most=300)
    assert np.all(found.converged)
    np.testing.assert_allclose(found.ssq, 2.0, rtol=1e-8)
    assert np.all(found.iterations < 20)  # 13, 58 and 131 one by one


def test_starts_a_step_away_from_where_others_ended_are_there():
    """Of linear problems, whose end one step tells: three starts agree as soon as one is there; none is run again."""
    rows = np.random.default_rng(3).standard_normal((2, 30))
    data, asked = np.random.default_rng(4).standard_normal(30), []
    best = np.linalg.lstsq(rows.T, data)[0]
    start = best + np.array([[0.0, 0.0], [0.02, -0.01], [-0.01, 0.02], [1.0, 1.0]])

    def linear(z, lanes):
        asked.append(len(z))
        return data - z @ rows, np.broadcast_to(rows, (len(z), 2, 30))

    wide = np.full(2, -9.0), np.full(2, 9.0)
    found = minimise(linear, start, *wide, race=3)
    assert asked == [4]
    assert np.all(found.converged)
    np.testing.assert_allclose(found.coordinates, np.tile(best, (4, 1)), atol=0.02)
    assert np.all(found.ssq >= found.ssq[0])
    minimise(linear, start, *wide, race=5)
    assert len(asked) > 3


def test_a_problem_that_cannot_be_computed_is_left_alone():
    def broken(z, _):
        r = np.where(z[:, :1] > 0, z - 1.0, np.nan)
        return -r, np.ones((len(z), 1, 1))

    found = minimise(broken, np.array([[3.0], [-3.0]]), np.array([-9.0]), np.array([9.0]))
    assert found.coordinates[0, 0] == pytest.approx(1.0)
    assert found.ssq[1] == np.inf
    assert not found.converged[1]


@pytest.mark.parametrize(("known", "gets_there"), [(0.02, False), (0.2, True)])
def test_searches_that_do_not_get_to_a_wanted_sum_of_squares_end_early(known, gets_there):
    """Decay of an exponential beside a curve that it never meets: sum of squares .0623 at the least, from far away."""
    t, asked = np.linspace(0, 4, 50), []
    data = np.exp(-t) + 0.05 * np.sin(9 * t)

    def decay(z, _):
        asked.append(len(z))
        model = np.exp(-np.exp(z) * t)
        return data - model, (-t * np.exp(z) * model)[:, None, :]

    start, wide = np.array([[-1.5]]), (np.array([-9.0]), np.array([9.0]))
    whole = minimise(decay, start, *wide)
    most = len(asked)
    asked.clear()
    found = minimise(decay, start, *wide, known=known)
    assert known < whole.ssq[0] if not gets_there else found.ssq[0] == whole.ssq[0]
    assert (len(asked) < most) is not gets_there


def test_searches_far_above_a_wanted_sum_of_squares_end_after_some_iterations():
    """A curve that bends as Rosenbrock's valley: it falls for long, and stays a hundred times above what is wanted."""
    asked = []

    def valley(z, _):
        asked.append(len(z))
        x, y = z.T
        lines = 10 * (y - x**2), 1 - x, np.full_like(x, 10.0)
        slopes = np.stack([np.stack([20 * x, np.ones_like(x), 0 * x], 1), np.stack([-10 + 0 * x, 0 * x, 0 * x], 1)], 1)
        return np.stack(lines, 1), slopes

    start, wide = np.array([[-6.0, 2.0]]), (np.array([-99.0, -999.0]), np.array([99.0, 999.0]))
    whole = minimise(valley, start, *wide)
    most = len(asked)
    asked.clear()
    lost = minimise(valley, start, *wide, known=1.0)
    assert whole.ssq[0] == pytest.approx(100.0)
    assert lost.ssq[0] > LOST
    assert len(asked) == PROGRESS_ITERATIONS < most
