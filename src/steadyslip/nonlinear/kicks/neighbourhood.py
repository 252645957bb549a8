"""A neighbourhood of steady sliding from which all motion returns to it.

With y = y0 + B q, the columns of B the modes of the linearisation, V = |q|² is a Lyapunov function of the linearised
motion. It is one of the motion itself wherever V' < 0, and a ball of V on and in which this holds is never left and
leads to steady sliding. The largest such ball is looked for: V' is computed from the full rates on
shells, in many directions, and must everywhere be at least half of what the linearisation gives. The half is the margin
for what lies between the directions.

Modes that decay fast are followed by the slow ones with a lag that grows like the square of the distance; in a plain
ball this alone would make V' positive at tiny distances (with mass rates differ by ten decades). Modes are therefore
weighted by the square root of their decay times.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import ndtri

from steadyslip.nonlinear.kicks.rest import Rest, field_of

Array = np.ndarray
LARGEST, SMALLEST = 4.0, 1e-9  # radius, in natural sizes of the weakest mode
SHRINK = 0.6
INNER = (0.75, 0.5, 0.25, 0.1)  # shells inside the ball that are looked at too
MARGIN = 0.5  # share of the linear decay of V that is asked for
ROUNDS = 12  # of Newton's method for the balance of forces


class Neighbourhood:
    """Balls around the steady sliding of m rigs.

    Parameters
    ----------
    rest : Rest

    Attributes
    ----------
    radius : ndarray (m,)
        In the norm of q; 0 where steady sliding is not stable or no ball was found, NaN where nobody has asked yet.
    """

    def __init__(self, rest: Rest) -> None:
        self.rest = rest
        count, n = rest.state.shape
        self.basis = np.zeros((count, n, n))
        self.inverse = np.zeros((count, n, n))
        self.radius = np.where(rest.stable, np.nan, 0.0)

    def part(self, which: Array) -> Neighbourhood:
        """Those of some of the rigs."""
        found = Neighbourhood(self.rest.part(which))
        found.basis, found.inverse, found.radius = self.basis[which], self.inverse[which], self.radius[which]
        return found

    def computed(self, which: Array | None = None) -> Array:
        """Radii of some rigs, of all unless given."""
        which = np.arange(len(self.radius)) if which is None else which
        asked = np.unique(which[np.isnan(self.radius[which])])
        for start in range(0, len(asked), 512):
            piece = asked[start : start + 512]
            self.basis[piece], good = modes(self.rest.matrix[piece])
            self.radius[piece[~good]] = 0.0
            piece = piece[good]
            if len(piece):
                self.inverse[piece] = np.linalg.inv(self.basis[piece])
                self.radius[piece] = self._radii(piece)
        return np.asarray(self.radius[which])

    def coordinates(self, which: Array, states: Array) -> Array:
        """q of states (k, n) of rigs `which` (k,)."""
        rest = self.rest
        with np.errstate(all="ignore"):
            away = (states - rest.state[which]) / rest.scales[which]
            return np.asarray(np.einsum("kij,kj->ki", self.inverse[which], away))

    def distance(self, which: Array, states: Array) -> Array:
        """|q| of states (k, n) of rigs `which` (k,); beyond the radius it means nothing."""
        with np.errstate(all="ignore"):
            found = np.linalg.norm(self.coordinates(which, states), axis=1)
        return np.asarray(np.where(np.isfinite(found), found, np.inf))

    def holds(self, which: Array, states: Array) -> Array:
        """Whether states (k, n) of rigs `which` (k,) lie in the ball."""
        radius = self.computed(which)
        return np.asarray(self.distance(which, states) < radius)

    def _radii(self, which: Array) -> Array:
        radius = np.full(len(which), LARGEST)
        trying = np.arange(len(which))
        while len(trying):
            good = self._decays(which[trying], radius[trying])
            for share in INNER:
                inside = np.flatnonzero(good)
                if len(inside):
                    good[inside] = self._decays(which[trying[inside]], share * radius[trying[inside]])
            trying = trying[~good]
            radius[trying] *= SHRINK
            lost = radius[trying] < SMALLEST
            radius[trying[lost]] = 0.0
            trying = trying[~lost]
        return radius

    def _decays(self, which: Array, radius: Array) -> Array:
        """Whether V falls as fast as asked for, everywhere on a shell."""
        rest = self.rest.part(which)
        n = rest.state.shape[1]
        q = directions(n)[None] * radius[:, None, None]
        away = np.einsum("kij,kdj->kdi", self.basis[which], q)
        rates = rates_at(rest, rest.state[:, None, :] + rest.scales[:, None, :] * away)
        back = np.einsum("kij,kdj->kdi", self.inverse[which], rates / rest.scales[:, None, :])
        linear = np.einsum("kij,kdj->kdi", self.inverse[which] @ rest.matrix @ self.basis[which], q)
        slope, asked = np.sum(q * back, axis=2), MARGIN * np.sum(q * linear, axis=2)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.all(slope < asked, axis=1))


def modes(matrix: Array) -> tuple[Array, Array]:
    """Real weighted modes of stable matrices (m, n, n) as columns, slow ones first, and where they can be used (m,)."""
    roots, vectors = np.linalg.eig(matrix)
    order = np.lexsort((-roots.imag, -roots.real))  # the slowest first
    roots, vectors = np.take_along_axis(roots, order, axis=1), np.take_along_axis(vectors, order[:, None, :], axis=2)
    size = np.max(np.abs(vectors), axis=1)
    vectors = vectors / size[:, None, :]
    imaginary = np.abs(roots.imag) > 1e-12 * np.abs(roots)
    second = imaginary & (roots.imag < 0)
    columns = np.where(second[:, None, :], -vectors.imag, vectors.real)
    decay = -roots.real
    weight = (np.min(decay, axis=1)[:, None] / decay) ** 0.25  # V weighs q² by the root of the decay time
    with np.errstate(all="ignore"):
        columns = columns / weight[:, None, :]
        good = np.all(np.isfinite(columns), axis=(1, 2)) & (np.linalg.cond(columns) < 1e9)
    return columns, good


@lru_cache(maxsize=8)
def directions(n: int) -> Array:
    """Directions all around, (count, n): evenly spread, with the axes among them."""
    if n == 1:
        return np.array([[1.0], [-1.0]])
    if n == 2:
        angle = np.arange(48) * (2 * np.pi / 48)
        return np.column_stack([np.cos(angle), np.sin(angle)])
    from scipy.stats import qmc  # slow to import

    power = 6 + (n - 2).bit_length()  # 64 (n - 1), rounded up to a power of 2, which Sobol points need
    normal = ndtri(qmc.Sobol(n, seed=1).random_base2(power) * (1 - 2e-9) + 1e-9)
    found = np.vstack([normal, np.eye(n), -np.eye(n)])
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


def rates_at(rest: Rest, states: Array) -> Array:
    """Rates (m, d, n) at states (m, d, n), d of them for each rig; NaN where the balance of forces has no solution."""
    given = (*(rest.column(np.asarray(a)) for a in rest.arguments), rest.sigma[:, None], rest.velocity[:, None])
    given = (*given, rest.pressure[:, None])
    function, split = field_of(rest.reduction), np.moveaxis(states, 2, 0)
    shape = states.shape[:2]
    with np.errstate(all="ignore"):
        if rest.reduction.unknown is None:
            found = function(*given, *split)
        else:
            unknown = np.broadcast_to(rest.unknown[:, None], shape).copy()
            for _ in range(ROUNDS):
                found = function(*given, *split, unknown)
                change = found[-2] / found[-1]
                unknown = unknown - change
            settled = np.abs(change) <= 1e-10 * (1e-30 + np.abs(unknown)) + 1e-10 * _size(rest)[:, None]
            found = [np.where(settled, rate, np.nan) for rate in found[:-2]]
    return np.stack([np.broadcast_to(np.asarray(rate, dtype=float), shape) for rate in found], axis=2)


def _size(rest: Rest) -> Array:
    """Natural size of the unknown: of the velocity variable, or an acceleration."""
    if not rest.reduction.model.inertial:
        return np.ones(len(rest.velocity)) if rest.reduction.velocity != "linear" else rest.velocity
    return np.asarray(rest.velocity**2 / rest.scales[:, rest.reduction.names.index("x")])
