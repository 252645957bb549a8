"""Cubic and quartic terms of a Lyapunov function of stable steady sliding, from the Taylor series of the rates.

In complex modes z' = Λ z + N2(z) + N3(z) + ..., V2 = |q|² falls by the linear terms. V3 and V4 cancel the terms that N2
and N3 add to its time derivative: along the linear motion a monomial z^m changes at the rate m·λ, so that the term
to cancel is divided by m·λ (homological equation of Poincaré's normal form). Where m·λ is small, as for (z z̄)² of a
little damped mode, the term is left.

Derivatives of the rates are finite differences of their Jacobian, and the coefficients have no error bounds: the
decrease of V is therefore checked with the full rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations, combinations_with_replacement, permutations
from math import factorial, prod

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.nonlinear.kicks.field import slopes_at, solved_at
from steadyslip.nonlinear.kicks.rest import Rest

STEP = 6e-3  # step of finite differences, in natural sizes: truncation error STEP**4 is about the rounding error
PLACES = np.array([-2.0, -1.0, 1.0, 2.0])  # points of the finite differences, in steps; weights follow below
FIRST = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
SECOND = np.array([-1.0, 16.0, 16.0, -1.0]) / 12.0
REACH = 8.0  # largest distance |q| at which V is evaluated
BISECTIONS = 24  # number of bisections of that distance
RESONANT = 0.1  # a term is not cancelled if |m·λ| is less than this share of the sum of |λ|


def terms(rest: Rest, basis: Array, inverse: Array) -> tuple[Array, Array]:
    """Symmetric coefficients of V3 (m, n, n, n) and V4 (m, n, n, n, n) in coordinates q, where V2 = |q|².

    `basis` and `inverse` (m, n, n) are the real modes, as from `neighbourhood.modes`.
    """
    roots, vectors = np.linalg.eig(inverse @ rest.matrix @ basis)
    back = np.linalg.inv(vectors)
    second, third = _curved(rest, basis)
    second = _times(back @ inverse, _in(second, vectors, 2)) / 2
    third = _times(back @ inverse, _in(third, vectors, 3)) / 6
    metric = np.swapaxes(vectors, 1, 2) @ vectors  # |q|² as quadratic form in z
    v3 = _cancelling(2 * _times(metric, second), roots)
    slope = 2 * _times(metric, third) + 3 * np.einsum("mija,makl->mijkl", v3, second)
    v4 = _cancelling(slope, roots)
    return _in(v3, back, 3).real, _in(v4, back, 4).real


@dataclass(frozen=True, eq=False)
class Rays:
    """V = ρ² + a3 ρ³ + a4 ρ⁴ (m, d) and its gradient (m, d, n) on d rays from steady sliding of each of m rigs.

    V is used up to its first maximum on a ray.
    """

    way: Array
    gradient3: Array
    gradient4: Array

    @classmethod
    def along(cls, way: Array, v3: Array, v4: Array) -> Rays:
        """Rays along unit vectors `way` (m, d, n), with the coefficients returned by `terms`."""
        entries, gradients = np.moveaxis(way, 2, 0), [np.empty_like(way), np.empty_like(way)]
        for gradient, form in zip(gradients, (v3, v4), strict=True):
            order = form.ndim - 1
            places, times = _monomials(way.shape[2], order - 1)
            for i, own in enumerate(form):  # rig by rig: all monomials of many rays take 100 MB
                products = prod(entries[place, i] for place in places)
                gradient[i] = products.T @ (order * times * own[:, *places]).T
        return cls(way, *gradients)

    def part(self, which: Array) -> Rays:
        """The rays of the rigs with indices `which`."""
        return Rays(self.way[which], self.gradient3[which], self.gradient4[which])

    @cached_property
    def cubic(self) -> Array:
        """Coefficient a3 (m, d)."""
        return np.asarray(np.sum(self.gradient3 * self.way, axis=2) / 3)

    @cached_property
    def quartic(self) -> Array:
        """Coefficient a4 (m, d)."""
        return np.asarray(np.sum(self.gradient4 * self.way, axis=2) / 4)

    @cached_property
    def farthest(self) -> Array:
        """Distance ρ (m, d) of the first maximum of V; inf without one."""
        with np.errstate(all="ignore"):
            under = 9 * self.cubic**2 - 32 * self.quartic
            below = -3 * self.cubic + np.sqrt(under)
            return np.where((under >= 0) & (below > 0), 4 / below, np.inf)

    def value(self, rho: Array) -> Array:
        """V (m, d) at distances ρ (m, d)."""
        return np.asarray(rho**2 * (1 + rho * (self.cubic + rho * self.quartic)))

    def gradient(self, rho: Array) -> Array:
        """Gradient of V (m, d, n) at distances ρ (m, d)."""
        rho = rho[..., None]
        return np.asarray(rho * (2 * self.way + rho * (self.gradient3 + rho * self.gradient4)))

    def distance(self, level: Array) -> Array:
        """Distance ρ (m, d) at which V reaches levels (m,); NaN where it does not within `REACH`."""
        level = level[:, None]
        low, high = np.zeros(self.cubic.shape), np.minimum(self.farthest, REACH)
        met = self.value(high) >= level
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            above = self.value(middle) >= level
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return np.where(met, high, np.nan)


@lru_cache(maxsize=8)
def _monomials(n: int, order: int) -> tuple[tuple[Array, ...], Array]:
    """Indices of the factors of all monomials of an order in n variables, and multiplicity of each in a form."""
    places = np.array(list(combinations_with_replacement(range(n), order)))
    times = [factorial(order) / prod(map(factorial, np.unique(one, return_counts=True)[1])) for one in places]
    return tuple(places.T), np.array(times)


def _cancelling(slope: Array, roots: Array) -> Array:
    """Form (m, n, ..., n) whose time derivative in linear motion is −`slope`, except for resonant terms."""
    order, even = slope.ndim - 1, np.zeros_like(slope)
    rates, sizes = np.zeros_like(slope), np.zeros(slope.shape)
    for k in range(order):
        own = roots.reshape(len(roots), *(-1 if i == k else 1 for i in range(order)))
        rates, sizes = rates + own, sizes + np.abs(own)
    for places in permutations(range(1, order + 1)):
        even += slope.transpose(0, *places) / factorial(order)
    with np.errstate(all="ignore"):
        return np.where(np.abs(rates) > RESONANT * sizes, -even / rates, 0.0)


def _curved(rest: Rest, basis: Array) -> tuple[Array, Array]:
    """Second and third derivatives of the rates along `basis`, natural sizes, (m, n, n, n) and (m, n, n, n, n)."""
    count, n = rest.state.shape
    pairs = list(combinations(range(n), 2))
    sizes = np.max(np.abs(basis), axis=1)  # (m, n)
    even = basis / sizes[:, None, :]
    ways = [even[:, :, k] for k in range(n)] + [(even[:, :, k] + even[:, :, i]) for k, i in pairs]
    away = STEP * PLACES[None, None, :, None] * np.stack(ways, axis=1)[:, :, None, :]  # (m, ways, places, n)
    away = np.concatenate([np.zeros((count, 1, n)), away.reshape(count, -1, n)], axis=1)
    states = rest.state[:, None, :] + rest.scales[:, None, :] * away
    unknowns = solved_at(rest, states)[2]
    lane = np.repeat(np.arange(count), states.shape[1])
    inputs = rest.velocity[lane], rest.force[lane], rest.pressure[lane]
    with np.errstate(all="ignore"):
        slopes = slopes_at(
            rest.reduction, rest.point.part(lane), inputs, states.reshape(-1, n),
            unknowns.reshape(len(lane), -1), rest.scales[lane],
        ).reshape(count, -1, n, n)  # fmt: skip
    middle, beside = slopes[:, :1], slopes[:, 1:].reshape(count, -1, len(PLACES), n, n)
    first = np.einsum("p,mwpij->mwij", FIRST, beside[:, :n]) / STEP
    bent = np.einsum("p,mwpij->mwij", SECOND, beside - middle[:, :, None]) / STEP**2
    third = np.zeros((count, n, n, n, n))
    for k in range(n):
        third[:, k, k] = bent[:, k]
    for way, (k, i) in enumerate(pairs):
        third[:, k, i] = third[:, i, k] = 0.5 * (bent[:, n + way] - bent[:, k] - bent[:, i])
    third = np.einsum("mk,mi,mkirj->mrkij", sizes, sizes, third)
    second = np.einsum("mk,mkrj->mrkj", sizes, first)
    return _in(second, basis, 1), _in(third, basis, 1)


def _times(matrix: Array, form: Array) -> Array:
    """Matrices (m, n, n) times the first index of forms (m, n, ..., n)."""
    return np.asarray((matrix @ form.reshape(*form.shape[:2], -1)).reshape(form.shape))


def _in(form: Array, matrix: Array, count: int) -> Array:
    """The forms with their last `count` indices transformed to new coordinates, where old = `matrix` · new."""
    for _ in range(count):
        form = np.moveaxis(
            _times(np.swapaxes(matrix, 1, 2), np.moveaxis(form, -1, 1)), 1, form.ndim - count
        )  # fmt: skip
    return form
