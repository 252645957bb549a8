"""A reduced Model together with its linearisation along the motion.

Beside the state y, further columns are integrated: S = ∂y(t)/∂y(0), S' = J(y) S, and for constants c(ε) that change
in some direction, D = ∂y(t)/∂ε, D' = J(y) D + (∂f/∂c) c'. The result is a Reduction like any other, so that the
same kernels, methods and step control serve cycles, their Floquet multipliers and continuation, and fits.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from steadyslip.core.questions import question
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.reduction import Reduction

Column = tuple[sp.Symbol, ...]


@question
def with_sensitivities(reduction: Reduction) -> Reduction:
    """The reduction whose state is y, then S column by column, then D in one direction."""
    n = len(reduction.state)
    columns = tuple(_column(f"S_{k}", n) for k in range(n))
    return _extended(reduction, columns, (_column("D", n),))


@question
def with_directions(reduction: Reduction, count: int) -> Reduction:
    """The reduction whose state is y, then D in each of several directions."""
    return _extended(reduction, (), tuple(_column(f"D_{k}", len(reduction.state)) for k in range(count)))


def _column(name: str, size: int) -> Column:
    return tuple(inner_symbol(f"{name}_{i}", real=True) for i in range(size))


def _extended(reduction: Reduction, free: tuple[Column, ...], driven: tuple[Column, ...]) -> Reduction:
    """Add columns that follow the linearised equations, freely or driven by changing constants."""
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
