"""Second and third derivatives of a Model at steady sliding, exact and symbolic.

The Model is taken as it stands: variables, unknowns of contacts and coordinates, velocities of slip and the stresses
T, τ, σ are all unknowns of one system M Y' = F(Y), whose last rows (balances and definitions) have no derivative. Every
equation then stays short and so do its derivatives; nothing has to be solved for first, bodies without mass included.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint

Index = tuple[int, ...]
"""(equation, variable, ...), variables in rising order."""


@dataclass(frozen=True, eq=False)
class System:
    """The equations of a Model with everything that appears in them as unknowns.

    Attributes
    ----------
    unknowns : tuple of sympy.Symbol
        Variables, then the algebraic unknowns of contacts and coordinates, velocities of slip, T, τ and σ.
    dynamic : int
        How many of them have a time derivative (the first ones).
    entries : tuple of (Index, ...)
        For orders one, two and three: where derivatives do not vanish.
    """

    model: Model
    unknowns: tuple[sp.Symbol, ...]
    dynamic: int
    entries: tuple[tuple[Index, ...], ...]
    function: ArrayFunction

    def place(self, symbol: sp.Symbol) -> int:
        """Index of one of the unknowns."""
        return self.unknowns.index(symbol)


@question
def system(model: Model) -> System:
    """Differentiate a model three times at steady sliding.

    Raises
    ------
    NotAvailable
        If there are delays.
    """
    if model.delays:
        raise NotAvailable("the kind of an onset is not offered with a delay")
    variables = [item.symbol for item in model.variables]
    balances = {contact.unknown: contact.balance for contact in model.contacts}
    for one in model.coordinates:
        if one.balance is not None:
            balances[one.acceleration if one.inertial else one.velocity] = one.balance
    unknowns = [*variables, *balances, *model.definitions]
    equations = [*model.rates, *balances.values()]
    equations += [definition - symbol for symbol, definition in model.definitions.items()]
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
    function = model.function(e for part in expressions for e in part)
    return System(model, tuple(unknowns), len(variables), tuple(map(tuple, entries)), function)


@dataclass(frozen=True, eq=False)
class Taylor:
    """Derivatives of F in numbers, for one rig or `m` of them.

    Attributes
    ----------
    gradient : ndarray (m, n, n)
    second, third : list of (Index, ndarray (m,))
    mass : ndarray (n,)
        Ones for equations with a time derivative, zeros for the others.
    """

    system: System
    gradient: Array
    second: list[tuple[Index, Array]]
    third: list[tuple[Index, Array]]
    mass: Array

    def quadratic(self, u: Array, v: Array) -> Array:
        """Second derivative applied to two directions (m, n), symmetric."""
        out: Array = np.zeros_like(u * v)
        for (row, j, k), value in self.second:
            out[:, row] += value * (u[:, j] * v[:, k] + (u[:, k] * v[:, j] if j != k else 0))
        return out

    def cubic(self, u: Array, v: Array, w: Array) -> Array:
        """Third derivative applied to three directions (m, n), symmetric."""
        out: Array = np.zeros_like(u * v * w)
        for (row, *index), value in self.third:
            for a, b, c in _arrangements(*index):
                out[:, row] += value * u[:, a] * v[:, b] * w[:, c]
        return out


@lru_cache(maxsize=1024)
def _arrangements(i: int, j: int, k: int) -> tuple[Index, ...]:
    return tuple({(i, j, k), (i, k, j), (j, i, k), (j, k, i), (k, i, j), (k, j, i)})


def taylor(point: OperatingPoint) -> Taylor:
    """Derivatives of every rig of an operating point (flat arrays) in its steady sliding."""
    found = system(point.model)
    stresses = [np.atleast_1d(np.asarray(one, dtype=float)) for one in point.steady]
    numbers = found.function(*map(np.asarray, point.arguments), *stresses)
    size = max([1, *(np.size(x) for x in numbers)])
    columns = [np.broadcast_to(np.asarray(x, dtype=float), (size,)) for x in numbers]
    n = len(found.unknowns)
    gradient = np.zeros((size, n, n))
    first, second, third = (len(part) for part in found.entries)
    for (row, j), column in zip(found.entries[0], columns, strict=False):
        gradient[:, row, j] = column
    mass = np.zeros(n)
    mass[: found.dynamic] = 1.0
    return Taylor(
        found,
        gradient,
        list(zip(found.entries[1], columns[first : first + second], strict=True)),
        list(zip(found.entries[2], columns[first + second : first + second + third], strict=True)),
        mass,
    )
