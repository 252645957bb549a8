"""Poles common to several responses by vector fitting (Gustavsen & Semlyen 1999, relaxed as by Gustavsen 2006).

The poles are starting values for nonlinear least squares: residuals are weighted by the errors, but as each step is a
linear problem, noise biases the poles.
"""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.model.numeric.pencil import ComplexArray

_STEPS = 8  # number of relocations of the poles; where they start at the peaks, a few suffice


def relocated(omega: Array, responses: ComplexArray, weights: Array, poles: ComplexArray) -> ComplexArray:
    """Poles (1/s) above the real axis after `_STEPS` relocations, for responses and weights (p, c) at omega (p,)."""
    for _ in range(_STEPS):
        poles = _once(omega, responses, weights, poles)
        if not poles.size:
            break
    return poles


def residues(omega: Array, responses: ComplexArray, weights: Array, poles: ComplexArray) -> tuple[ComplexArray, Array]:
    """Residues (k, c) at given poles, and real constants (c,), of each response by least squares."""
    basis = _basis(1j * omega, poles, True)
    found = np.empty((basis.shape[1], responses.shape[1]))
    for c in range(responses.shape[1]):
        rows = _real(weights[:, c, None] * basis)
        scale = np.linalg.norm(rows, axis=0)
        found[:, c] = np.linalg.lstsq(rows / scale, _real(weights[:, c] * responses[:, c]))[0] / scale
    return np.asarray(found[:-1:2] + 1j * found[1:-1:2]), found[-1]


def _basis(s: ComplexArray, poles: ComplexArray, constant: bool) -> ComplexArray:
    """Partial fractions (p, 2 k + 1) at s.

    For each pole the factors of the residue's real and imaginary part; last a constant 1.
    """
    near, far = 1 / (s[:, None] - poles), 1 / (s[:, None] - poles.conj())
    pairs = np.stack([near + far, 1j * (near - far)], axis=-1).reshape(len(s), -1)
    return np.concatenate([pairs, np.ones((len(s), 1))], axis=1) if constant else pairs


def _real(rows: ComplexArray) -> Array:
    return np.concatenate([rows.real, rows.imag])


def _once(omega: Array, responses: ComplexArray, weights: Array, poles: ComplexArray) -> ComplexArray:
    """Poles after one relocation.

    They are the zeros of Σ c/(s − p) + d, whose product with each response is a sum over the poles p.
    """
    basis = _basis(1j * omega, poles, True)
    count = basis.shape[1]
    kept = []
    for c in range(responses.shape[1]):
        own = _real(weights[:, c, None] * np.concatenate([basis, -responses[:, c, None] * basis], axis=1))
        kept.append(np.asarray(np.linalg.qr(own, mode="r"))[count:, count:])
    scale = np.linalg.norm(weights * responses) / len(omega)
    total = scale * np.sum(basis.real, axis=0)  # row that excludes the solution zero
    rows = np.concatenate([*kept, total[None]])
    wanted = np.append(np.zeros(len(rows) - 1), scale * len(omega))
    sizes = np.linalg.norm(rows, axis=0)
    found = np.linalg.lstsq(rows / sizes, wanted)[0] / sizes
    turning = np.zeros((count - 1, count - 1))
    inputs = np.zeros(count - 1)
    for k, pole in enumerate(poles):
        turning[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
        inputs[2 * k] = 2
    zeros = np.linalg.eigvals(turning - np.outer(inputs, found[:-1]) / found[-1])
    zeros = zeros[zeros.imag > 0]
    return np.asarray(-np.abs(zeros.real) + 1j * zeros.imag)
