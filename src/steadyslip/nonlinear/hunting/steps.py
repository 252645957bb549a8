"""Steps of the motion in one mode as polynomials in the fraction of the step, and the first guard that fails on them.

Without memory a mode is a linear system, and its step the Taylor series of the exact solution, to rounding. With
memory (bristles) it is a step of Rodas5P with its error control and dense output.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.kernels.methods import rodas5p
from steadyslip.nonlinear.hunting.held_modes import HeldPiece
from steadyslip.nonlinear.hunting.plant import Array, HeldContact, Plant

DEGREE = 22  # of the Taylor series: 1/22! is 1e-21, for steps of one over the largest eigenvalue
ROUNDING = 1e-13  # relative error of the first coefficients of a guard: some hundred roundings
NODES = np.linspace(0.0, 1.0, 33)  # fractions of a step where guards are looked at; chosen by trial
POWERS = NODES ** np.arange(DEGREE + 1)[:, None]
SHORTEST = 1e-15  # s, of a step; far below the period of any bristle


class ExactSteps:
    """Steps of the exact solution Y(t + s h) = Σ c_k s^k of linear pieces, h at most one over the fastest rate."""

    def step(self, piece: HeldPiece, state: Array, most: float) -> tuple[float, Array]:
        """Length h of a step of at most `most` (s), and its coefficients c, (degree + 1, width)."""
        matrix, length = piece.matrix, most
        if piece.fastest > 0:
            length = min(most, 1.0 / piece.fastest)
        found = np.empty((DEGREE + 1, len(state)))
        found[0] = state
        while True:
            for k in range(1, DEGREE + 1):
                found[k] = matrix @ found[k - 1] * (length / k)
            sizes = np.abs(found)
            if np.all(sizes[-1] <= 1e-16 * sizes.max(axis=0)):
                return length, found
            length *= 0.5

    def noise(self, piece: HeldPiece, rows: Array, coefficients: Array, length: float) -> Array:
        """Rounding errors of the first three coefficients of rows, (rows, 3)."""
        size, matrix = np.abs(coefficients[0]), np.abs(piece.matrix)
        sizes = [size, matrix @ size * length, matrix @ (matrix @ size) * (length**2 / 2)]
        return np.asarray(ROUNDING * np.abs(rows) @ np.transpose(sizes))

    def until(self, piece: HeldPiece, state: Array, coefficients: Array, length: float, share: float) -> Array:
        """State at a share of a step."""
        return np.asarray(share ** np.arange(DEGREE + 1) @ coefficients)

    def rate(self, piece: HeldPiece, state: Array) -> Array:
        """Rates of all variables."""
        return np.asarray(piece.matrix @ state)

    def fastest(self, piece: HeldPiece, state: Array) -> float:
        """Largest eigenvalue (1/s) of the motion."""
        return piece.fastest


class Passage:
    """Exact motion of a linear piece over a fixed time, often repeated, as one matrix: of what is between two samples.

    Parameters
    ----------
    piece : HeldPiece
    watched : ndarray (3, width)
        Rows whose values at `NODES` are told.
    length : float
        Time (s), at most one over the fastest rate.
    """

    def __init__(self, piece: HeldPiece, watched: Array, length: float) -> None:
        rows, self.switches = piece.guards
        powers = [np.eye(len(piece.matrix))]
        for k in range(1, DEGREE + 1):
            powers.append(piece.matrix @ powers[-1] * (length / k))
        series = np.array(powers)
        self.width, self.guards = len(piece.matrix), len(rows)
        guards = np.einsum("gi,kij->gkj", rows, series).reshape(-1, self.width)
        seen = np.einsum("wi,kij,kn->wnj", watched, series, POWERS).reshape(-1, self.width)
        self.all = np.vstack([series.sum(axis=0), guards, seen])

    def passed(self, state: Array) -> tuple[Array, Array] | None:
        """State at the end and values (3, nodes) on the way; None if a guard may become negative."""
        found = self.all @ state
        after = self.width + self.guards * (DEGREE + 1)
        guards = found[self.width : after].reshape(self.guards, -1)
        if not np.all(2 * guards[:, 0] > np.abs(guards).sum(axis=1)):
            return None
        return found[: self.width], found[after:].reshape(3, -1)


class BristleSteps:
    """Steps of Rodas5P for contacts with memory; the length of a step is kept for the next piece.

    Parameters
    ----------
    plant : Plant
    rtol : float
        Error allowed per step, relative to the largest size of each variable so far.
    scale : ndarray (width,)
        Least size of each variable.
    """

    def __init__(self, plant: Plant, rtol: float, scale: Array) -> None:
        self.plant, self.rtol, self.scale = plant, rtol, scale.copy()
        method = rodas5p()
        self.gamma, self.stages = method.gamma, method.stages
        self.arguments = [np.array(row) for row in method.arguments()]
        self.couplings = [np.array(row) for row in method.c]
        self.error, self.dense, self.order = np.array(method.error), np.array(method.dense), method.error_order
        self.length = np.nan
        self.bristles = []
        place = 2 * plant.size + 4
        for contact in plant.contacts:
            if contact.slow:
                own = slice(place, place + len(contact.port.friction.memory()))
                self.bristles.append((plant.slip(contact), own, contact, *_bristle(contact)))
                place = own.stop

    def step(self, piece: HeldPiece, state: Array, most: float) -> tuple[float, Array]:
        """Length of a step whose error is allowed, at most `most` (s), and its coefficients (5, width)."""
        np.maximum(self.scale, np.abs(state), out=self.scale)
        jacobian, rate = self._jacobian(piece, state), self.rate(piece, state)
        if np.isnan(self.length):
            self.length = 1.0 / self.fastest(piece, state)
        length = min(self.length, most)
        while True:
            with np.errstate(
                over="ignore", invalid="ignore"
            ):  # in a step that is much too long: its size is not finite
                found, error = self._tried(piece, state, length, jacobian, rate)
                size = float(np.sqrt(np.mean((error / (self.rtol * self.scale)) ** 2)))
            factor = min(5.0, max(0.2, 0.9 * size ** (-1.0 / (self.order + 1)))) if size > 0 else 5.0
            if size <= 1.0:
                if length < most or factor < 1.0:  # a step cut short says nothing of longer ones
                    self.length = length * factor
                return length, found
            length *= factor if np.isfinite(size) else 0.2
            if not length > SHORTEST:
                raise NotAvailable("the motion of the bristles cannot be followed: steps become too short")

    def noise(self, piece: HeldPiece, rows: Array, coefficients: Array, length: float) -> Array:
        """Errors of the first three coefficients of rows, (rows, 3): of a guard that was just passed, its value."""
        found = np.zeros((len(rows), 3))
        found[:, 0] = 1e-9 * np.abs(rows) @ np.abs(coefficients[0])
        return found

    def until(self, piece: HeldPiece, state: Array, coefficients: Array, length: float, share: float) -> Array:
        """State at a share of a step, by a step to there: dense output is of lower order."""
        if share == 0:
            return state
        jacobian, rate = self._jacobian(piece, state), self.rate(piece, state)
        found, _ = self._tried(piece, state, share * length, jacobian, rate)
        return np.asarray(found.sum(axis=0))

    def _tried(
        self, piece: HeldPiece, state: Array, length: float, jacobian: Array, rate: Array
    ) -> tuple[Array, Array]:
        """Coefficients of a step, and the estimate of its error."""
        inverse = np.linalg.inv(np.eye(len(state)) / (length * self.gamma) - jacobian)
        stages = np.zeros((self.stages, len(state)))
        for i in range(self.stages):
            if i:
                rate = self.rate(piece, state + self.arguments[i] @ stages[: len(self.arguments[i])])
            right = rate + self.couplings[i] @ stages[: len(self.couplings[i])] / length if i else rate
            stages[i] = inverse @ right
        change = self.arguments[self.stages] @ stages[: len(self.arguments[self.stages])]
        first, second, third = self.dense @ stages
        return np.array([state, change + first, second - first, third - second, -third]), self.error @ stages

    def rate(self, piece: HeldPiece, state: Array) -> Array:
        """Rates of all variables."""
        found: Array = piece.matrix @ state
        n = self.plant.size
        for slip, own, contact, values, _ in self.bristles:
            try:
                friction, *rates = values(float(slip @ state), *state[own])
            except OverflowError:  # of a stage of a step that is much too long
                return np.full(len(state), np.nan)
            found[n : 2 * n] -= contact.row / self.plant.inertia * friction
            found[own] = rates
        return found

    def fastest(self, piece: HeldPiece, state: Array) -> float:
        """Largest eigenvalue (1/s) of the motion."""
        return float(np.max(np.abs(np.linalg.eigvals(self._jacobian(piece, state)))))

    def _jacobian(self, piece: HeldPiece, state: Array) -> Array:
        found = piece.matrix.copy()
        n = self.plant.size
        for slip, own, contact, _, slopes in self.bristles:
            table = np.reshape(slopes(float(slip @ state), *state[own]), (1 + own.stop - own.start, -1))
            share = contact.row / self.plant.inertia
            found[n : 2 * n] -= np.outer(share, table[0, 0] * slip)
            found[n : 2 * n, own] -= np.outer(share, table[0, 1:])
            found[own] = np.outer(table[1:, 0], slip)
            found[own, own] = table[1:, 1:]
        return found


def _bristle(contact: HeldContact) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Functions of slip rate and memory: [friction force, rates of the memory], and their derivatives in a row."""
    law, v = contact.port.friction, sp.Symbol("v", real=True)
    memory = sp.symbols(f"z0:{len(law.memory())}", real=True)
    values = [contact.port.area * law.strength(v, contact.normal, memory, sp.nan)]
    values += law.rates(v, contact.normal, memory, sp.nan)
    slopes = [sp.diff(one, by) for one in map(sp.sympify, values) for by in (v, *memory)]
    words = [{"sign": np.sign, "Abs": abs}, "math"]
    return tuple(sp.lambdify((v, *memory), one, words, cse=True) for one in (values, slopes))


def first_crossing(guards: Array, fresh: Array, noise: Array) -> tuple[float, int] | None:
    """Share of a step at which the first guard becomes negative, and its index; None if none does.

    Parameters
    ----------
    guards : ndarray (guards, degree + 1)
        Coefficients; those of fresh guards lose what is below the noise.
    fresh : ndarray of bool (guards,)
        Guards that were just switched to, whose first values are 0 but for rounding.
    noise : ndarray (guards, 3)
    """
    guards[:, :3][fresh[:, None] & (np.cumsum(np.abs(guards[:, :3]) > noise, axis=1) == 0)] = 0.0
    leading = guards[np.arange(len(guards)), np.argmax(guards != 0, axis=1)]
    if np.any(down := (guards[:, 0] < 0) | (fresh & (guards[:, 0] == 0) & (leading < 0))):
        return 0.0, int(np.argmax(down))
    bounded = guards[:, 0] > np.abs(guards[:, 1:]).sum(axis=1)
    found = [(at, int(i)) for i in np.flatnonzero(~bounded) if (at := _root(guards[i])) is not None]
    return min(found, default=None)


def _root(guard: Array) -> float | None:
    """First share of a step at which a guard that is not negative at first becomes so; None if there is none."""
    from scipy.optimize import brentq, minimize_scalar  # not at start-up

    values = guard @ POWERS[: len(guard)]
    polynomial = np.polynomial.Polynomial(guard)
    skip = int(np.argmax(guard != 0)) if np.any(guard) else 0
    rest = np.polynomial.Polynomial(guard[skip:])  # without the root at 0 of a fresh guard
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
