"""Receptances as sums of modes, R(s) = Σ u uᵀ/(s − p) + conjugates + D, and their derivatives by the unknowns.

D is the compliance of modes beyond the band. The unknowns are real: of each mode Re p, Im p and Re u, Im u for every
direction, and then the upper triangle of D.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.model.numeric.pencil import ComplexArray


@dataclass(frozen=True)
class ModalSum:
    """A receptance as a sum of modes, reciprocal: the residues are symmetric.

    Attributes
    ----------
    poles : ndarray (k,)
        Poles with positive imaginary part, 1/s.
    shapes : ndarray (k, d)
        Vectors u; the residues are u uᵀ, m/(N s).
    rest : ndarray (d, d)
        Symmetric matrix D, m/N.
    """

    poles: ComplexArray
    shapes: ComplexArray
    rest: Array

    @classmethod
    def from_unknowns(cls, unknowns: Array, count: int, size: int) -> ModalSum:
        """Sum of `count` modes in `size` directions with the given real unknowns (n,)."""
        modes = unknowns[: count * (2 + 2 * size)].reshape(count, 1 + size, 2) @ np.array([1, 1j])
        rest = np.zeros((size, size))
        rest[np.triu_indices(size)] = unknowns[count * (2 + 2 * size) :]
        return cls(modes[:, 0], modes[:, 1:], rest + np.triu(rest, 1).T)

    @property
    def unknowns(self) -> Array:
        """Real unknowns, (n,), in the order described in the module."""
        modes = np.concatenate([self.poles[:, None], self.shapes], axis=1)
        own = np.stack([modes.real, modes.imag], axis=-1).ravel()
        return np.concatenate([own, self.rest[np.triu_indices(len(self.rest))]])

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Receptance (p, d, d) in m/N at s (p,) in 1/s."""
        residues = self.shapes[:, :, None] * self.shapes[:, None, :]
        found = np.tensordot(1 / (s[:, None] - self.poles), residues, 1)
        found = found + np.tensordot(1 / (s[:, None] - self.poles.conj()), residues.conj(), 1)
        return np.asarray(found + self.rest)

    def derivatives(self, s: ComplexArray) -> ComplexArray:
        """Derivatives (p, d, d, n) of the receptance at s (p,) by the unknowns."""
        size = self.shapes.shape[1]
        one, columns = np.eye(size), []
        for pole, shape in zip(self.poles, self.shapes, strict=True):
            near, far = 1 / (s - pole), 1 / (s - pole.conj())
            residue = np.outer(shape, shape)
            parts = [(near**2, far**2, residue)]
            parts += [(near, far, np.outer(unit, shape) + np.outer(shape, unit)) for unit in one]
            for at, mirrored, by in parts:
                first, second = at[:, None, None] * by, mirrored[:, None, None] * by.conj()
                columns += [first + second, 1j * (first - second)]
        for i, j in zip(*np.triu_indices(size), strict=True):
            by = np.zeros((size, size))
            by[i, j] = by[j, i] = 1
            columns.append(np.broadcast_to(by, (len(s), size, size)).astype(complex))
        return np.stack(columns, axis=-1)
