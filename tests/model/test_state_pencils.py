"""Pencils of machines in numbers: eigenvalues, resolvent and errors by SciPy and NumPy on random matrices."""

import numpy as np
import pytest
from scipy import linalg as la

from steadyslip.model.numeric.change import change_between
from steadyslip.model.numeric.pencil import StatePencil


def random_pencil(seed, size=12, memories=3, coupled=True):
    """Springs with damping, contacts that are not symmetric, and memories that also follow accelerations."""
    chance = np.random.default_rng(seed)
    square = chance.standard_normal((3, size, size))
    mass, stiffness = (
        square[0] @ square[0].T + size * np.eye(size),
        1e6 * (square[1] @ square[1].T + size * np.eye(size)),
    )
    width = 2 * size + memories
    e, a = np.eye(width), np.zeros((width, width))
    at, moving, rest = slice(size), slice(size, 2 * size), slice(2 * size, None)
    e[moving, moving], a[at, moving] = mass, np.eye(size)
    a[moving, at], a[moving, moving] = -stiffness - 1e5 * square[2], -1e-5 * stiffness
    a[moving, rest], a[rest] = 1e4 * chance.standard_normal((size, memories)), chance.standard_normal((memories, width))
    a[rest, rest] -= 50 * np.eye(memories)
    if coupled:
        e[moving, moving] += 0.3 * square[2]
        e[rest, moving] = chance.standard_normal((memories, size))
    return StatePencil(e, a, size, True)


@pytest.mark.parametrize("coupled", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_eigenvalues_and_resolvent_are_those_of_the_matrices(seed, coupled):
    pencil = random_pencil(seed, coupled=coupled)
    other = la.eigvals(pencil.a, pencil.e)
    own = pencil.eigenvalues
    assert np.max(np.min(np.abs(own[:, None] - other), axis=1) / np.abs(own)) < 1e-9
    chance = np.random.default_rng(seed)
    out, into = chance.standard_normal((2, len(own), 2))
    places = 1j * np.array([3.0, 400.0, 5e4])
    found = pencil.resolvent(out, into)(places)
    for s, one in zip(places, found, strict=True):
        np.testing.assert_allclose(one, out.T @ la.solve(s * pencil.e - pencil.a, into), rtol=1e-6)


@pytest.mark.parametrize("beside", [1.0, 1 + 1e-6])
def test_errors_of_eigenvalues_are_by_the_least_singular_value(beside):
    """A place beside an eigenvalue is off by its distance, and by the singular vectors that NumPy finds."""
    pencil = random_pencil(1)
    rows, columns = pencil.scale
    for root in pencil.eigenvalues[::4]:
        s = complex(root) * beside
        left, sizes, right = np.linalg.svd(rows[:, None] * (s * pencil.e - pencil.a) * columns)
        slope = abs(left[:, -1].conj() @ (rows[:, None] * pencil.e * columns) @ right[-1].conj())
        assert pencil.error(s) == pytest.approx(sizes[-1] / slope, rel=1e-3, abs=1e-12 * abs(root))
        assert pencil.error(s) == pytest.approx(abs(s - root), rel=0.01, abs=1e-11 * abs(root))


@pytest.mark.parametrize("shape", [(3, 1), (1, 3), (2, 2)])
def test_the_ratio_of_characteristic_functions_is_that_of_determinants(shape):
    """Of changes with more rows than columns, fewer, and as many."""
    own, chance = random_pencil(2), np.random.default_rng(5)
    e, a = own.e.copy(), own.a.copy()
    at = slice(12, 12 + shape[0]), slice(12, 12 + shape[1])
    e[at] += 0.2 * chance.standard_normal(shape)
    a[at] += 1e5 * chance.standard_normal(shape)
    other = StatePencil(e, a, own.size, True)
    change = change_between(own, [other])
    omega = np.array([1.0, 700.0, 1e5])
    found = change.ratio(omega, change.response(omega), change.core_of(other))
    for one, s in zip(found, 1j * omega, strict=True):
        sign, size = np.linalg.slogdet(s * e - a)
        before, smaller = np.linalg.slogdet(s * own.e - own.a)
        assert one == pytest.approx(sign / before * np.exp(size - smaller), rel=1e-7)


@pytest.mark.parametrize("size", [3, 24])
def test_the_response_at_an_undamped_mode_is_that_beside_it(size):
    """Equal masses on equal springs, one of them damped: others ring at 100 rad/s exactly."""
    one = np.eye(size)
    damped = np.zeros((size, size))
    damped[0, 0] = 3.0
    pencil = StatePencil(la.block_diag(one, one), np.block([[0 * one, one], [-1e4 * one, -damped]]), size, True)
    out = la.block_diag(one, one)[:, :2]
    found = pencil.resolvent(out, out)(np.array([100j, 250j]))
    assert np.all(np.isfinite(found))
    assert abs(found[0, 1, 1]) > 1e6 * abs(found[1, 1, 1])
    np.testing.assert_allclose(found[1], out.T @ la.solve(250j * pencil.e - pencil.a, out), rtol=1e-8)
    assert found[0, 0, 0] == pytest.approx((100j + 3) / 300j, rel=1e-9)  # (s + c)/(s² + c s + k) of the damped one
