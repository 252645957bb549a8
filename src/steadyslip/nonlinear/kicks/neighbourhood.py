"""Compute a ball around steady sliding from which all motion returns to it.

With y = y0 + B q, the columns of B the modes of the linearisation, V = |q|² is a Lyapunov function of the linearised
motion. If V' < 0 on and in a ball |q| < r for the full motion too, no motion leaves the ball, and all motion in it
converges to steady sliding. The largest such ball is searched for: V' is computed from the full rates on shells, in
many directions, and must everywhere be at least half of its linear value. The half is a margin for values between the
directions. This relies on smooth rates, so the ball ends before the block stops, where laws may have a kink (the
bristles of LuGre).

Fast modes follow the slow ones with a lag that grows like the square of the distance; in a plain ball this alone would
make V' positive at tiny distances (with mass, rates differ by ten decades). Modes are therefore weighted by the square
root of their decay times. For the same reason V' varies most between directions close to the slow modes, where a small
share of fast modes decides its sign; a part of the directions is concentrated there.

Where modes are almost undamped these balls are tiny. Then V = |q|² + V3 + V4 (`quartic`) is used in place of |q|², and
a level of V in place of the radius.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.nonlinear.kicks.field import motion_at
from steadyslip.nonlinear.kicks.quartic import REACH, Rays, terms
from steadyslip.nonlinear.kicks.rest import Rest

LARGEST, SMALLEST = 4.0, 1e-12  # limits of the ball's radius |q|; 1 is the natural size of the slowest mode
SHRINK = 0.6  # factor between successive trial radii
LONG = 30.0  # limit of a mode's slip over its other variables, in natural sizes; above it, slip does not scale the mode
SPREAD = (
    0.0,
    0.25,
    0.5,
)  # powers of the decay time that scale the modes in a direction; each for a third of directions
INNER = (0.75, 0.5, 0.25, 0.1)  # radii of the inner shells that are checked too, as shares of the ball's radius
FEW = 8  # only every 8th direction is checked first, which is quick and excludes most radii
MARGIN = 0.5  # share of the linear decay rate of V that V must reach in every direction


class Neighbourhood:
    """Balls around the steady sliding of m rigs.

    Parameters
    ----------
    rest : Rest

    Attributes
    ----------
    radius : ndarray (m,)
        Radius |q| of the ball; 0 where steady sliding is not stable or no ball was found, NaN where not computed yet.
    levels : dict of int to list
        V3, V4 and the root of the level of V, by the rig's number in `key`, as far as computed.
    """

    def __init__(self, rest: Rest) -> None:
        self.rest = rest
        count, n = rest.state.shape
        self.basis = np.zeros((count, n, n))
        self.inverse = np.zeros((count, n, n))
        self.decay = np.ones((count, n))
        self.radius = np.where(rest.stable, np.nan, 0.0)
        # motions of the same rig have the same key and share its level
        self.key, self.levels = np.arange(count), dict[int, list[Array]]()

    def part(self, which: Array) -> Neighbourhood:
        """The `Neighbourhood` of some of the rigs, with the indices `which`."""
        found = Neighbourhood(self.rest.part(which))
        for name in ("basis", "inverse", "decay", "radius", "key"):
            setattr(found, name, getattr(self, name)[which])
        found.levels = self.levels
        return found

    def computed(self, which: Array | None = None) -> Array:
        """Radii |q| (k,) of the balls of rigs `which` (k,), by default of all; unknown radii are computed."""
        which = np.arange(len(self.radius)) if which is None else which
        missing = np.unique(which[np.isnan(self.radius[which])])
        for start in range(0, len(missing), 512):
            piece = missing[start : start + 512]
            self.basis[piece], self.inverse[piece], self.decay[piece], good = modes(self.rest.part(piece))
            self.radius[piece[~good]] = 0.0
            piece = piece[good]
            if len(piece):
                self.radius[piece] = self._radii(piece)
        return np.asarray(self.radius[which])

    def coordinates(self, which: Array, states: Array) -> Array:
        """Coordinates q (k, n) of states (k, n) of rigs `which` (k,)."""
        rest = self.rest
        with np.errstate(all="ignore"):
            away = (states - rest.state[which]) / rest.scales[which]
            return np.asarray(np.einsum("kij,kj->ki", self.inverse[which], away))

    def around(self, which: Array) -> Array:
        """Unit vectors (k, d, n) in q along which V' is checked for rigs `which` (k,)."""
        decay = self.decay[which]
        lessened = (np.min(decay, axis=1)[:, None] / decay)[:, None, :]
        even = directions(decay.shape[1])[None]
        found = np.concatenate([even * lessened**power for power in SPREAD], axis=1)
        return np.asarray(found / np.linalg.norm(found, axis=2)[:, :, None])

    def distance(self, which: Array, states: Array) -> Array:
        """Distance |q| (k,) from steady sliding of states (k, n) of rigs `which`; inf where it is not finite."""
        with np.errstate(all="ignore"):
            found = np.linalg.norm(self.coordinates(which, states), axis=1)
        return np.asarray(np.where(np.isfinite(found), found, np.inf))

    def holds(self, which: Array, states: Array, steps: Array | float = 0.0) -> Array:
        """True (k,) for states (k, n) of rigs `which` that lie inside their ball, or at which V is below its level.

        A level costs as much as about n⁴ integration steps. It is computed if several motions of a rig need it, or if
        one motion has taken n⁴ `steps` (k,); until then a motion outside the ball counts as outside.
        """
        radius, away = self.computed(which), self.distance(which, states)
        inside = np.asarray(away < radius)
        left = np.flatnonzero(~inside & (away < REACH) & (radius > 0))
        key = self.key[which[left]]
        many = np.isin(key, [one for one, count in zip(*np.unique(key, return_counts=True), strict=True) if count > 1])
        late = np.broadcast_to(steps, which.shape)[left] >= states.shape[1] ** 4
        left = left[many | late | np.isin(key, list(self.levels))]
        if len(left):
            inside[left] = self._below(which[left], states[left])
        return inside

    def _below(self, which: Array, states: Array) -> Array:
        """True (k,) where V at `states` is below its level; unknown levels of rigs are computed."""
        keys, first = np.unique(self.key[which], return_index=True)
        new = np.array([key not in self.levels for key in keys])
        if new.any():
            for key, *found in zip(keys[new], *self._levels(which[first[new]]), strict=True):
                self.levels[key] = found
        v3, v4, size = (np.stack(one) for one in zip(*(self.levels[key] for key in self.key[which]), strict=True))
        q = self.coordinates(which, states)
        rho = np.linalg.norm(q, axis=1)
        rays = Rays.along((q / rho[:, None])[:, None, :], v3, v4)
        return np.asarray((rays.value(rho[:, None])[:, 0] < size**2) & (rho < rays.farthest[:, 0]))

    def _levels(self, which: Array) -> tuple[Array, Array, Array]:
        """V3, V4, and the square root of the level below which V decreases; that root is 0 where the ball is larger."""
        v3, v4 = terms(self.rest.part(which), self.basis[which], self.inverse[which])
        known = np.all(np.isfinite(v3), axis=(1, 2, 3)) & np.all(np.isfinite(v4), axis=(1, 2, 3, 4))
        size, around = np.where(known, LARGEST, 0.0), self.around(which)
        for ways in (around[:, ::FEW], around):
            rays = Rays.along(ways, v3, v4)

            def falls(some: Array, size: Array, rays: Rays = rays) -> Array:
                own = rays.part(some)
                rho = own.distance(size**2)
                return self._falls(which[some], rho[..., None] * own.way, own.gradient(rho))

            size = _largest(size, self.radius[which], falls)
        return v3, v4, size

    def _radii(self, which: Array) -> Array:
        """Radii |q| (k,) of the balls of rigs `which` (k,)."""
        size, around = np.full(len(which), LARGEST), self.around(which)
        for ways in (around[:, ::FEW], around):

            def falls(some: Array, size: Array, ways: Array = ways) -> Array:
                q = ways[some] * size[:, None, None]
                return self._falls(which[some], q, 2 * q)

            size = _largest(size, np.full(len(which), SMALLEST), falls)
        return size

    def _falls(self, which: Array, q: Array, gradient: Array) -> Array:
        """True (k,) where V decreases at all q (k, d, n), at least `MARGIN` times as fast as |q|² in linear motion."""
        rest = self.rest.part(which)
        away = q @ np.swapaxes(self.basis[which], 1, 2)
        rates, velocity = motion_at(rest, rest.state[:, None, :] + rest.scales[:, None, :] * away)
        linear = q @ np.swapaxes(self.inverse[which] @ rest.matrix @ self.basis[which], 1, 2)
        with np.errstate(all="ignore"):
            back = (rates / rest.scales[:, None, :]) @ np.swapaxes(self.inverse[which], 1, 2)
            slope, bound = np.sum(gradient * back, axis=2), 2 * MARGIN * np.sum(q * linear, axis=2)
            return np.asarray(np.all((slope < bound) & (velocity > 0), axis=1))


def _largest(start: Array, least: Array, falls: Callable[[Array, Array], Array]) -> Array:
    """Largest sizes (m,) of shells on and inside which V decreases; 0 if smaller than `least`.

    Sizes are tried downwards from `start`.

    `falls(which, size)` is True (k,) where V decreases on the shells of rigs `which` (k,) with the sizes `size` (k,).
    """
    size = start.copy()
    trying = np.flatnonzero(size > 0)
    while len(trying):
        good = falls(trying, size[trying])
        for share in INNER:
            inside = np.flatnonzero(good)
            if len(inside):
                good[inside] = falls(trying[inside], share * size[trying[inside]])
        trying = trying[~good]
        size[trying] *= SHRINK
        lost = size[trying] < least[trying]
        size[trying[lost]] = 0.0
        trying = trying[~lost]
    return size


def modes(rest: Rest) -> tuple[Array, Array, Array, Array]:
    """Modes of the linearised motion about stable steady sliding, as real weighted vectors, slowest decay first.

    Each mode is scaled so that its largest variable has its natural size. Where slip exceeds the velocity and memory of
    a mode by more than `LONG`, velocity and memory alone decide the scale, because forces are linear in slip.

    Returns
    -------
    columns, inverse : ndarray (m, n, n)
        Modes as columns of a matrix, and its inverse.
    decay : ndarray (m, n)
        Decay rates of the modes, 1/s.
    good : ndarray of bool (m,)
        True where the modes are finite and well-conditioned.
    """
    roots, vectors = np.linalg.eig(rest.matrix)
    order = np.lexsort((-roots.imag, -roots.real))  # the slowest first
    roots, vectors = np.take_along_axis(roots, order, axis=1), np.take_along_axis(vectors, order[:, None, :], axis=2)
    slips = list(rest.places)
    moving = np.abs(roots[:, None, :] * vectors[:, slips]) * (rest.scales[:, slips] / rest.speeds)[:, :, None]
    velocity = np.max(moving, axis=1)
    others = np.maximum(np.max(np.abs(np.delete(vectors, slips, axis=1)), axis=1, initial=0.0), velocity)
    size = np.max(np.abs(vectors), axis=1)
    size = np.where(size > LONG * others, others, size)
    imaginary = np.abs(roots.imag) > 1e-12 * np.abs(roots)
    second = imaginary & (roots.imag < 0)
    decay = -roots.real
    weight = (np.min(decay, axis=1)[:, None] / decay) ** 0.25  # so that V sums amplitude² · decay time^½
    with np.errstate(all="ignore"):
        vectors = vectors / size[:, None, :]
        columns = np.where(second[:, None, :], -vectors.imag, vectors.real) / weight[:, None, :]
        rows = np.max(np.abs(columns), axis=2)[:, :, None]
        good = np.all(np.isfinite(columns), axis=(1, 2)) & (np.linalg.cond(columns / rows) < 1e9)
    inverse = np.zeros_like(columns)
    inverse[good] = np.linalg.inv((columns / rows)[good]) / rows[good].transpose(0, 2, 1)
    return columns, inverse, decay, good


@lru_cache(maxsize=8)
def directions(n: int) -> Array:
    """Unit vectors (count, n), evenly spread over all directions, with both directions of each axis (cached)."""
    if n == 1:
        return np.array([[1.0], [-1.0]])
    if n == 2:
        angle = np.arange(48) * (2 * np.pi / 48)
        return np.column_stack([np.cos(angle), np.sin(angle)])
    from scipy.special import ndtri  # slow to import
    from scipy.stats import qmc

    power = 6 + (n - 2).bit_length()  # 64 (n - 1), rounded up to a power of 2, which Sobol points need
    normal = ndtri(qmc.Sobol(n, seed=1).random_base2(power) * (1 - 2e-9) + 1e-9)
    found = np.vstack([normal, np.eye(n), -np.eye(n)])
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])
