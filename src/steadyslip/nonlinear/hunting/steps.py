"""Steps of a linear piece as polynomials in the fraction of the step, and the guard that first becomes negative.

Without memory a mode is a linear system, and a step is the Taylor series of the exact solution, to rounding.
"""

from __future__ import annotations

import numpy as np

from steadyslip.kernels.driver import holding
from steadyslip.nonlinear.hunting.held_modes import HeldPiece
from steadyslip.nonlinear.hunting.plant import Array

DEGREE = 22  # degree of the Taylor series: 1/22! is 1e-21, and steps are at most one over the largest eigenvalue
ROUNDING = 1e-13  # assumed relative error of the first coefficients of a guard: some hundred rounding errors
NODES = np.linspace(0.0, 1.0, holding.NODES)  # fractions of a step at which guards are evaluated
POWERS = NODES ** np.arange(DEGREE + 1)[:, None]


def series(piece: HeldPiece, length: float) -> Array:
    """Matrices C_k, (degree + 1, width, width), with Y(t + s h) = Σ C_k Y(t) s^k for a length h (s)."""
    powers = [np.eye(len(piece.matrix))]
    for k in range(1, DEGREE + 1):
        powers.append(piece.matrix @ powers[-1] * (length / k))
    return np.array(powers)


class ExactSteps:
    """Steps of the exact solution Y(t + s h) = Σ c_k s^k of linear pieces.

    The step length h is at most one over the largest eigenvalue."""

    def __init__(self) -> None:
        self._series: dict[HeldPiece, tuple[float, Array]] = {}

    def step(self, piece: HeldPiece, state: Array, most: float) -> tuple[float, Array]:
        """Length h of a step of at most `most` (s), and its coefficients c, (degree + 1, width)."""
        length = min(most, 1.0 / piece.fastest) if piece.fastest > 0 else most
        while True:
            whole, matrices = self._series.get(piece, (0.0, np.zeros(0)))
            if length > whole or piece.fastest == 0:
                whole, matrices = self._series[piece] = length, series(piece, length)
            found = matrices @ state
            if length < whole:
                found *= (length / whole) ** np.arange(DEGREE + 1)[:, None]
            sizes = np.abs(found)
            if np.all(sizes[-1] <= 1e-16 * sizes.max(axis=0)):
                return length, np.asarray(found)
            length *= 0.5

    def noise(self, piece: HeldPiece, rows: Array, coefficients: Array, length: float) -> Array:
        """Rounding errors (rows, 3) of the first three coefficients of the quantities given by `rows`."""
        size, matrix = np.abs(coefficients[0]), np.abs(piece.matrix)
        sizes = [size, matrix @ size * length, matrix @ (matrix @ size) * (length**2 / 2)]
        return np.asarray(ROUNDING * np.abs(rows) @ np.transpose(sizes))

    def until(self, piece: HeldPiece, state: Array, coefficients: Array, length: float, share: float) -> Array:
        """State (width,) at a share of a step."""
        return np.asarray(share ** np.arange(DEGREE + 1) @ coefficients)

    def rate(self, piece: HeldPiece, state: Array) -> Array:
        """Time derivative (width,) of the state."""
        return np.asarray(piece.matrix @ state)

    def fastest(self, piece: HeldPiece, state: Array) -> float:
        """Largest absolute eigenvalue, 1/s."""
        return piece.fastest


def passage(piece: HeldPiece, watched: Array, length: float) -> Array:
    """Matrix of the exact motion of a linear piece over a fixed time (s), at most one over the fastest rate.

    Parameters
    ----------
    piece : HeldPiece
    watched : ndarray (values, width)
        Rows of quantities to be recorded at `NODES`.
    length : float

    Returns
    -------
    ndarray (rows, width)
        Multiplied by the state at the start it gives the state at the end, then the coefficients of each guard in turn,
        then the values of `watched`.
    """
    rows, _ = piece.guards
    width, powers = len(piece.matrix), series(piece, length)
    guards = np.einsum("gi,kij->gkj", rows, powers).reshape(-1, width)
    seen = np.einsum("wi,kij,kn->wnj", watched, powers, POWERS).reshape(-1, width)
    return np.vstack([powers.sum(axis=0), guards, seen])


def first_crossing(guards: Array, fresh: Array, noise: Array) -> tuple[float, int] | None:
    """Share of a step at which a guard first becomes negative, and the index of this guard; None if none does.

    Parameters
    ----------
    guards : ndarray (guards, degree + 1)
        Polynomial coefficients; first coefficients of fresh guards that are below the noise are set to 0 (in place).
    fresh : ndarray of bool (guards,)
        Guards of the last switch, whose first values are 0 apart from rounding.
    noise : ndarray (guards, 3)
        Errors of the first three coefficients.
    """
    guards[:, :3][fresh[:, None] & (np.cumsum(np.abs(guards[:, :3]) > noise, axis=1) == 0)] = 0.0
    leading = guards[np.arange(len(guards)), np.argmax(guards != 0, axis=1)]
    if np.any(down := (guards[:, 0] < 0) | (fresh & (guards[:, 0] == 0) & (leading < 0))):
        return 0.0, int(np.argmax(down))
    bounded = guards[:, 0] > np.abs(guards[:, 1:]).sum(axis=1)
    found = [(at, int(i)) for i in np.flatnonzero(~bounded) if (at := _root(guards[i])) is not None]
    return min(found, default=None)


def _root(guard: Array) -> float | None:
    """Share of a step at which a guard, not negative at the start, first becomes negative; None if it does not."""
    from scipy.optimize import brentq, minimize_scalar  # not at start-up

    values = guard @ POWERS[: len(guard)]
    polynomial = np.polynomial.Polynomial(guard)
    skip = int(np.argmax(guard != 0)) if np.any(guard) else 0
    rest = np.polynomial.Polynomial(guard[skip:])  # without the root at 0 that a fresh guard has
    dips = (values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]) & (values[1:-1] > 0)
    bend = values[2:] + values[:-2] - 2 * values[1:-1]
    least = values[1:-1] - (values[2:] - values[:-2]) ** 2 / (8 * np.where(bend > 0, bend, np.inf))
    doubtful = dips & (least < 0.1 * values[1:-1])
    for i in np.flatnonzero((values[1:] < 0) | np.append(doubtful, False)):
        low, high = NODES[i], NODES[i + 1]
        if not values[i + 1] < 0:
            lowest = minimize_scalar(polynomial, bounds=(low, NODES[i + 2]), method="bounded", options={"xatol": 1e-12})
            if not lowest.fun < 0:
                continue
            high = float(lowest.x)
        if not rest(low) > 0:
            return float(low)
        return float(brentq(rest, low, high, xtol=1e-300, rtol=1e-15))
    return None
