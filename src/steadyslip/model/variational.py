"""Variational equations: a Reduction extended by sensitivities along the motion.

In addition to the state y, S = ∂y(t)/∂y(0) with S' = J(y) S, and D = ∂y(t)/∂ε with D' = J(y) D + (∂f/∂c) c'
for constants c(ε), are integrated. The result is a Reduction, so the same kernels, methods and step control serve
cycles, Floquet multipliers, continuation and fits.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.reduction import Reduction

Column = tuple[sp.Symbol, ...]


@cached
def with_sensitivities(reduction: Reduction) -> Reduction:
    """Reduction whose state is y, then S by columns, then D in one direction."""
    n = len(reduction.state)
    columns = tuple(_column(f"S_{k}", n) for k in range(n))
    return _extended(reduction, columns, (_column("D", n),))


@cached
def with_directions(reduction: Reduction, count: int) -> Reduction:
    """Reduction whose state is y, then D in each of `count` directions."""
    return _extended(reduction, (), tuple(_column(f"D_{k}", len(reduction.state)) for k in range(count)))


def _column(name: str, size: int) -> Column:
    return tuple(inner_symbol(f"{name}_{i}", real=True) for i in range(size))


def _extended(reduction: Reduction, free: tuple[Column, ...], driven: tuple[Column, ...]) -> Reduction:
    """The Reduction with further columns that obey the linearised equations: `free` columns, and columns `driven` by
    changes of constants."""
    jacobian = reduction.jacobian()
    columns = free + driven
    rates = tuple(
        sp.Add(*(entry * variable for entry, variable in zip(row, column, strict=True) if entry != 0))
        for column in columns
        for row in jacobian
    )
    extra = tuple(symbol for column in columns for symbol in column)
    return replace(
        reduction,
        state=reduction.state + extra,
        names=reduction.names + tuple(one.name for one in extra),
        continuous=reduction.continuous + extra,
        rates=reduction.rates + rates,
        restored=reduction.restored + extra,
        directions=driven,
    )
