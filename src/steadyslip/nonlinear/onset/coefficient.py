"""Compute the cubic coefficient c1 of an oscillatory edge, with a bound of its rounding error.

First Lyapunov coefficient by projection on the critical eigenvectors (Kuznetsov, Elements of Applied Bifurcation
Theory, eq. 5.62), for the Model as a differential-algebraic system M Y' = F(Y). With delays the projection is that
on the centre manifold of the delay equation (Hale and Verduyn Lunel 1993): late values are unknowns of their own, with
rows exp(−s delay) in the characteristic matrix D(s) = s M − F', and D'(iω) takes the place of M in the normalisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.linear.roots import quietly
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.taylor import Taylor, taylor

EPS = float(np.finfo(float).eps)
RIDGE = 1e-9
"""Added to the diagonal of the least-squares matrix, which is singular: a factor of all rows and its inverse of all
columns cancel. Changes the scales by a share of about 1e-9."""
EVEN_STEPS = 20
"""Number of rounds in which rows, then columns are scaled: enough for entries within a few decades of 1, which one
more round would change by a few per cent at most."""


@dataclass(frozen=True)
class Cubic:
    """Cubic coefficients of rigs on an oscillatory edge, arrays (m,).

    Attributes
    ----------
    c1 : ndarray (m,)
        Growth rate of the amplitude per squared amplitude of ln v at `contact`, 1/s; NaN if beyond floating point.
    error : ndarray (m,)
        Bound of the change of c1 by rounding of the rig's numbers and in the computation, 1/s.
    share : ndarray (m,)
        |c1| over the sum of the absolute values of its terms; small where they cancel.
    stress_ratio : ndarray (m,)
        Amplitude of the spring stress (Pa), or for machines of the pull (N), per unit amplitude of ln v at `contact`.
    contact : ndarray of int (m,)
        Index of the contact at which slip rate oscillates most, relative to its steady value.
    shares : ndarray (m, contacts)
        Amplitude of ln v at each contact over that at `contact`.
    vector : ndarray (m, n)
        Critical eigenvector with unit amplitude of ln v at `contact`, unknowns as `steadyslip.model.taylor.System`.
    """

    c1: Array
    error: Array
    share: Array
    stress_ratio: Array
    contact: Array
    shares: Array
    vector: Array


@quietly
def coefficients(point: OperatingPoint, omega: Array) -> Cubic:
    """First Lyapunov coefficients of rigs on an oscillatory edge.

    Parameters
    ----------
    point : OperatingPoint
        Flat arrays, (m,).
    omega : ndarray (m,)
        Angular frequency of each rig at its edge, rad/s.
    """
    expansion = taylor(point)
    size = max(len(omega), len(expansion.gradient))
    omega = np.broadcast_to(omega, (size,))
    numbers = [np.broadcast_to(one, (size,)) for one in point.evaluate(_at_contacts(point.model))]
    return _projected(expansion, omega, *np.split(np.stack(numbers, axis=1), 2, axis=1))


@cached
def _at_contacts(model: Model) -> ArrayFunction:
    """Steady slip rates (m/s) and areas (m²) of the contacts (cached)."""
    contacts = model.contacts
    return model.function([*(model.steady[one.velocity] for one in contacts), *(one.area for one in contacts)])


def _projected(expansion: Taylor, omega: Array, speeds: Array, areas: Array) -> Cubic:
    """First Lyapunov coefficients (m,) of oscillations with angular frequencies `omega` (m,), rad/s.

    `speeds` are the steady slip rates (m/s) and `areas` the areas (m²) of the contacts, each (m, contacts).
    """
    n = len(expansion.mass)
    gradient, unsure = (np.broadcast_to(e, (len(omega), n, n)) for e in (expansion.gradient, expansion.gradient_error))
    mass = np.diag(expansion.mass)
    oscillating = omega[:, None, None] * mass
    late = [expansion.followed(1j * turns * omega) for turns in (1, 0, 2)]
    rows, columns = even_scales(np.abs(gradient) + oscillating + np.abs(late[1][0]))
    linear = [
        _Scaled(
            rows, columns, gradient + follows - 1j * turns * oscillating,
            unsure + EPS * turns * (oscillating + omega[:, None, None] * np.abs(slope)),
        )
        for turns, (follows, slope) in zip((1, 0, 2), late, strict=True)
    ]  # fmt: skip
    weight = mass - late[0][1]
    critical, still, twice = linear
    (q, q_error), (p, p_error) = critical.null_vectors()
    place, model = expansion.system.place, expansion.system.model
    v, spring = ([place(getattr(one, what)) for one in model.contacts] for what in ("velocity", "spring"))
    relative = q[:, v] / speeds
    most = np.argmax(np.abs(relative), axis=1)
    each = np.arange(len(q))
    size = (0.5 / relative[each, most])[:, None]
    q, q_error = q * size, q_error * np.abs(size)
    share = np.abs(q_error / q)[each, np.asarray(v)[most]]  # relative error of the amplitude of ln v at `contact`
    product = np.sum(p.conj() * _times(weight, q), axis=1)[:, None]
    lost = np.abs(p) * _times(np.abs(weight), q_error) + p_error * _times(np.abs(weight), np.abs(q))
    share = 2 * share + np.sum(lost, axis=1) / np.abs(product[:, 0])
    p, p_error = p / product.conj(), p_error / np.abs(product)

    own, double = expansion.quadratic(q, q.conj()), expansion.quadratic(q, q)
    sizes, q_size = expansion.sizes(), np.abs(q)
    curved = sizes.quadratic(q_size, 2 * q_error) + expansion.errors().quadratic(q_size, q_size)
    mean, mean_error = still.solve(-own, curved)
    second, second_error = twice.solve(-double, curved)
    parts = (expansion.cubic(q, q, q.conj()), 2 * expansion.quadratic(q, mean), expansion.quadratic(q.conj(), second))
    terms = [0.5 * np.sum(p.conj() * part, axis=1) for part in parts]
    others, others_error = 2 * np.abs(mean) + np.abs(second), 2 * mean_error + second_error
    whole = sizes.cubic(q_size, q_size, q_size) + sizes.quadratic(q_size, others)
    parts_error = (
        sizes.cubic(q_size, q_size, 3 * q_error) + expansion.errors().cubic(q_size, q_size, q_size)
        + sizes.quadratic(q_error, others) + sizes.quadratic(q_size, others_error)
        + expansion.errors().quadratic(q_size, others) + n * EPS * whole
    )  # fmt: skip
    error = 0.5 * np.sum(np.abs(p) * parts_error + p_error * whole, axis=1)
    known = np.all([one.known for one in linear], axis=0)
    c1 = np.where(known, np.real(sum(terms)), np.nan)
    error = np.where(np.isfinite(error), error + np.abs(c1) * share, np.inf)
    pull = 2 * np.abs(q[:, spring]) * areas
    return Cubic(
        c1, error, np.abs(c1) / sum(np.abs(term) for term in terms), pull[each, most], most,
        np.abs(relative) / np.abs(relative[each, most])[:, None], q,
    )  # fmt: skip


class _Scaled:
    """Matrices (m, n, n) scaled by rows and columns to entries of similar size, with componentwise error bounds.

    Error bounds are first order in the errors of the entries and in the rounding of n products.
    """

    def __init__(self, rows: Array, columns: Array, matrix: Array, error: Array) -> None:
        self.rows, self.columns, n = rows, columns, matrix.shape[-1]
        even = rows[:, :, None] * matrix * columns[:, None, :]
        self.known = np.all(np.isfinite(even), axis=(1, 2))
        self.matrix = np.where(self.known[:, None, None], even, np.eye(n))
        self.error = rows[:, :, None] * error * columns[:, None, :] + n * EPS * np.abs(self.matrix)

    def solve(self, right: Array, right_error: Array) -> tuple[Array, Array]:
        """Solution (m, n) for a right side (m, n), and its error bound: infinite where a matrix is nearly singular."""
        singular = np.linalg.cond(self.matrix) > 1 / EPS
        matrix = np.where(singular[:, None, None], np.eye(self.matrix.shape[-1]), self.matrix)
        inverse = np.linalg.inv(matrix)
        found = np.linalg.solve(matrix, (self.rows * right)[:, :, None])[:, :, 0]
        missed = self.rows * right_error + _times(self.error, np.abs(found))
        error = np.where(singular[:, None], np.inf, _times(np.abs(inverse), missed))
        return self.columns * found, self.columns * error

    def null_vectors(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Right and left singular vectors (m, n) of the smallest singular value, each with its error bound."""
        left, values, right = np.linalg.svd(self.matrix)
        others = (1 / values[:, None, :-1]) * left[:, :, :-1]
        inverse = np.abs(others @ right[:, :-1]).swapaxes(1, 2)  # pseudo-inverse without the smallest singular value
        found = []
        for vector, error, own, scale in (
            (right[:, -1].conj(), self.error, inverse, self.columns),
            (left[:, :, -1], self.error.swapaxes(1, 2), inverse.swapaxes(1, 2), self.rows),
        ):
            missed = _times(error, np.abs(vector)) + values[:, -1:]
            found.append((scale * vector, scale * _times(own, missed)))
        return found[0], found[1]


def _times(matrix: Array, vector: Array) -> Array:
    """Product of matrices (m, n, n) and vectors (m, n)."""
    return np.asarray((matrix @ vector[:, :, None])[:, :, 0])


def even_scales(size: Array) -> tuple[Array, Array]:
    """Factors for rows and columns (m, n) that bring the entries of matrices to similar size, in any units.

    First, the mean square logarithm of the non-zero entries is minimised (Curtis and Reid 1972), which makes the
    result independent of units. Then rows and columns are scaled to similar Euclidean length.
    """
    count, n = size.shape[:2]
    rows, columns = np.ones((count, n)), np.ones((count, n))
    present = (size > 0) & np.isfinite(size)
    for pattern in np.unique(present, axis=0) if count > 1 else present:
        own = np.all(present == pattern, axis=(1, 2))
        i, j = np.nonzero(pattern)
        places = np.zeros((len(i), 2 * n))
        places[np.arange(len(i)), i] = places[np.arange(len(i)), n + j] = 1.0
        normal = places.T @ places + RIDGE * np.eye(2 * n)
        found = np.exp(np.linalg.solve(normal, -places.T @ np.log(size[own][:, i, j]).T).T)
        rows[own], columns[own] = found[:, :n], found[:, n:]
    squares = np.where(present, rows[:, :, None] * size * columns[:, None, :], 0.0) ** 2
    down, across = np.ones((count, n)), np.ones((count, n))
    for _ in range(EVEN_STEPS):
        down = _inverse(_times(squares, across))
        across = _inverse(_times(squares.swapaxes(1, 2), down))
    return rows * np.sqrt(down), columns * np.sqrt(across)


def _inverse(value: Array) -> Array:
    """Reciprocal of `value`; 1 where `value` is not positive."""
    return 1 / np.where(value > 0, value, 1.0)
