"""Derivatives of a Model at steady sliding up to third order, symbolic.

Variables, unknowns of contacts and coordinates, slip rates and the stresses T, τ, σ are the unknowns of one
differential-algebraic system M Y' = F(Y), whose last rows (balances and definitions) have no time derivative. Nothing
is eliminated, so equations and their derivatives stay short, with massless bodies too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations_with_replacement, permutations

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.range import delays_of

Index = tuple[int, ...]
"""Indices (equation, variable, ...) of a derivative, variables in rising order."""
Entry = tuple[Index, Array, Array]
"""A derivative: its indices, its values for m rigs (m,), and rounding errors of the values (m,)."""
EPS = float(np.finfo(float).eps)
ROUNDING_PATTERNS = 4
"""Number of perturbed copies for estimates of errors: all numbers of a rig change by ±`EPS` with random signs."""
OPERATIONS_PER_ENTRY = 4
"""Assumed number of roundings (each `EPS` at most, relative) in the value of a derivative; chosen by trial."""


@dataclass(frozen=True, eq=False)
class System:
    """Equations of a Model as a differential-algebraic system, with its derivatives.

    Attributes
    ----------
    unknowns : tuple of sympy.Symbol
        Variables, then the algebraic unknowns of contacts and coordinates, slip rates, T, τ and σ.
    dynamic : int
        Number of unknowns with a time derivative (the first ones).
    entries : tuple of (Index, ...)
        Indices of the nonzero derivatives of orders one, two and three.
    expressions : tuple of sympy.Expr
        The derivatives in steady sliding, in the order of `entries`.
    function : ArrayFunction
        Array function of the expressions.
    late : tuple of (int, int, int)
        Three indices for each late unknown, which is the value of another unknown one delay ago: of the late unknown
        (and its equation), of the other unknown, and of the delay in `Model.delays`.
    """

    model: Model
    unknowns: tuple[sp.Symbol, ...]
    dynamic: int
    entries: tuple[tuple[Index, ...], ...]
    expressions: tuple[sp.Expr, ...]
    function: ArrayFunction
    late: tuple[tuple[int, int, int], ...]

    def place(self, symbol: sp.Symbol) -> int:
        """Index of an unknown."""
        return self.unknowns.index(symbol)


@cached
def system(model: Model) -> System:
    """Equations of a Model with their derivatives up to third order at steady sliding.

    Delayed values are separate unknowns, so that equations may be nonlinear in them.
    """
    variables = [item.symbol for item in model.variables]
    balances = {contact.unknown: contact.balance for contact in model.contacts}
    for one in model.coordinates:
        if one.balance is not None:
            balances[one.acceleration if one.inertial else one.velocity] = one.balance
    unknowns = [*variables, *balances, *model.definitions, *model.late]
    equations = [*model.rates, *balances.values()]
    equations += [definition - symbol for symbol, definition in model.definitions.items()]
    equations += [-symbol for symbol in model.late]  # `Taylor.followed` adds the delayed unknown
    late = tuple(
        (unknowns.index(symbol), unknowns.index(base), model.delays.index(delay))
        for symbol, (base, delay) in model.late.items()
    )
    inputs = {model.inputs[name]: model.steady[model.inputs[name]] for name in model.inputs if name != "time"}
    entries: tuple[list[Index], ...] = ([], [], [])
    expressions: tuple[list[sp.Expr], ...] = ([], [], [])
    for row, equation in enumerate(equations):
        equation = equation.xreplace(inputs)
        present = [i for i, symbol in enumerate(unknowns) if equation.has(symbol)]
        derivatives: dict[Index, sp.Expr] = {(): equation}
        for order in (1, 2, 3):
            for index in combinations_with_replacement(present, order):
                below = derivatives.get(index[:-1], sp.Integer(0))
                above = derivative(below, unknowns[index[-1]]) if below != 0 else sp.Integer(0)
                if above == 0:
                    continue
                derivatives[index] = above
                value = model.at_steady(above)
                if value != 0:
                    entries[order - 1].append((row, *index))
                    expressions[order - 1].append(value)
    flat = tuple(e for part in expressions for e in part)
    return System(model, tuple(unknowns), len(variables), tuple(map(tuple, entries)), flat, model.function(flat), late)


@dataclass(frozen=True, eq=False)
class Taylor:
    """Values of the derivatives of F for `m` rigs.

    Attributes
    ----------
    gradient, gradient_error : ndarray (m, n, n)
        Jacobian of F and its rounding errors, which include rounding of the rig's parameters.
    second, third : list of Entry
    mass : ndarray (n,)
        1 for equations with a time derivative, 0 for equations without.
    delays : ndarray (m, d)
        Delays of the model, s.
    """

    system: System
    gradient: Array
    gradient_error: Array
    second: list[Entry]
    third: list[Entry]
    mass: Array
    delays: Array

    def followed(self, s: Array) -> tuple[Array, Array]:
        """Terms exp(−s delay) of late unknowns in the gradient, for s (m,), and their derivatives by s; (m, n, n)."""
        found = np.zeros((2, len(s), len(self.mass), len(self.mass)), dtype=complex)
        for row, column, which in self.system.late:
            delay = self.delays[:, which]
            found[0, :, row, column] = np.exp(-s * delay)
            found[1, :, row, column] = -delay * found[0, :, row, column]
        return found[0], found[1]

    def sizes(self) -> Taylor:
        """Copy with absolute values of the second and third derivatives, for bounds."""
        second, third = ([(at, np.abs(e), error) for at, e, error in part] for part in (self.second, self.third))
        return replace(self, second=second, third=third)

    def errors(self) -> Taylor:
        """Copy with errors in place of the second and third derivatives, for bounds."""
        second, third = ([(at, error, error) for at, _, error in part] for part in (self.second, self.third))
        return replace(self, second=second, third=third)

    def quadratic(self, u: Array, v: Array) -> Array:
        """Second derivative applied to two directions (m, n), symmetric."""
        out: Array = np.zeros_like(u * v)
        for (row, j, k), value, _ in self.second:
            out[:, row] += value * (u[:, j] * v[:, k] + (u[:, k] * v[:, j] if j != k else 0))
        return out

    def cubic(self, u: Array, v: Array, w: Array) -> Array:
        """Third derivative applied to three directions (m, n), symmetric."""
        out: Array = np.zeros_like(u * v * w)
        for (row, *index), value, _ in self.third:
            for a, b, c in arrangements(*index):
                out[:, row] += value * u[:, a] * v[:, b] * w[:, c]
        return out


@lru_cache(maxsize=1024)
def arrangements(*index: int) -> tuple[Index, ...]:
    """Distinct permutations of variable indices."""
    return tuple(set(permutations(index)))


def taylor(point: OperatingPoint) -> Taylor:
    """Values of the derivatives in steady sliding for every rig of a flat operating point."""
    found = system(point.model)
    arguments = [np.atleast_1d(np.asarray(one, dtype=float)) for one in (*point.arguments, *point.steady)]
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (ROUNDING_PATTERNS, len(arguments)))
    moved = 1.0 + EPS * np.concatenate([np.zeros((1, len(arguments))), signs])
    numbers = found.function(*(factor[:, None] * one for factor, one in zip(moved.T, arguments, strict=True)))
    shape = np.broadcast_shapes((ROUNDING_PATTERNS + 1, 1), *(np.shape(one) for one in numbers))
    entries: list[Entry] = []
    for place, number in zip((place for part in found.entries for place in part), numbers, strict=True):
        whole = np.broadcast_to(np.asarray(number, dtype=float), shape)
        error = np.max(np.abs(whole[1:] - whole[0]), axis=0) + OPERATIONS_PER_ENTRY * EPS * np.abs(whole[0])
        entries.append((place, whole[0], error))
    n, first, second = len(found.unknowns), *(len(part) for part in found.entries[:2])
    gradient = np.zeros((2, shape[1], n, n))
    for (row, j), *both in entries[:first]:
        gradient[:, :, row, j] = both
    mass = np.zeros(n)
    mass[: found.dynamic] = 1.0
    values, errors = gradient
    delays = np.broadcast_to(delays_of(point), (shape[1], len(point.model.delays)))
    return Taylor(found, values, errors, entries[first : first + second], entries[first + second :], mass, delays)
