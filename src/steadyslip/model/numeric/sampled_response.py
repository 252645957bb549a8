"""Samples of a measured receptance over frequency, and polynomials through neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.model.numeric.pencil import ComplexArray

_NEAR = 6  # number of neighbouring samples through which the interpolating polynomial passes


@dataclass(frozen=True)
class ReceptanceSamples:
    """Receptance (d, d, p) at frequencies (p,), standard deviations of its errors, and its possible errors between
    samples."""

    omega: Array
    receptance: ComplexArray
    error: Array
    between: Array

    def at(self, places: Array | ComplexArray) -> ReceptanceSamples:
        """Samples at other frequencies, by polynomials through the nearest samples."""
        start = np.searchsorted(self.omega, places.real) - _NEAR // 2
        start = np.clip(start, 0, len(self.omega) - _NEAR)
        around = start[:, None] + np.arange(_NEAR)
        inside = around[:, _NEAR // 2 - 1 : _NEAR // 2 + 1]
        shares = polynomial_shares(places, self.omega[around].T).T
        return ReceptanceSamples(
            places,
            np.sum(shares * self.receptance[..., around], axis=-1),
            np.sqrt(np.sum(np.abs(shares * self.error[..., around]) ** 2, axis=-1)),
            np.max(self.between[..., inside], axis=-1),
        )


def polynomial_shares(places: Any, known: Array) -> Any:
    """Lagrange weights (k, p): a polynomial at `places` (p,) is the sum of its values at `known` (k, p) times these."""
    found = np.ones(known.shape, dtype=np.result_type(places, known))
    for i, one in enumerate(known):
        for j, other in enumerate(known):
            if i != j:
                found[i] *= (places - other) / (one - other)
    return found


def product(a: Any, b: Any) -> ComplexArray:
    """Products (n, m, p) of p small matrices (n, k, p) and (k, m, p): a loop over k, vectorised over p."""
    return np.asarray(sum(a[:, i, None] * b[i] for i in range(len(b))))


def determinant(a: Any) -> ComplexArray:
    """Determinants (p,) of matrices (n, n, p)."""
    if len(a) == 2:  # the size for one contact; many times faster than LAPACK
        return np.asarray(a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    return np.asarray(np.linalg.det(np.moveaxis(a, -1, 0)))


def inverse(a: Any) -> ComplexArray:
    """Inverses (n, n, p) of matrices (n, n, p)."""
    if len(a) == 1:
        return np.asarray(1 / a)
    if len(a) == 2:
        return np.array([[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]) / determinant(a)
    return np.asarray(np.moveaxis(np.linalg.inv(np.moveaxis(a, -1, 0)), 0, -1))
