"""A reduced Model together with its linearisation along the motion.

Beside the state y, two things are integrated: the matrix S = ∂y(t)/∂y(0), S' = J(y) S, and the vector D = ∂y(t)/∂ε for
constants c(ε) that change, D' = J(y) D + (∂f/∂c) c'. The result is a Reduction like any other, so that the same
kernels, methods and step control serve cycles, their Floquet multipliers and their continuation.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import sympy as sp

from steadyslip.compiled.reduction import Reduction


@lru_cache(maxsize=64)
def with_sensitivities(reduction: Reduction) -> Reduction:
    """The reduction whose state is y, then S column by column, then D."""
    n = len(reduction.state)
    jacobian = reduction.jacobian()
    columns = [[sp.Symbol(f"S_{i}_{k}", real=True) for i in range(n)] for k in range(n)]
    columns.append([sp.Symbol(f"D_{i}", real=True) for i in range(n)])
    rates = [
        sp.Add(*(jacobian[i][j] * column[j] for j in range(n) if jacobian[i][j] != 0))
        for column in columns
        for i in range(n)
    ]
    extra = tuple(symbol for column in columns for symbol in column)
    return replace(
        reduction,
        state=reduction.state + extra,
        names=reduction.names + tuple(map(str, extra)),
        continuous=reduction.continuous + extra,
        rates=reduction.rates + tuple(rates),
        restored=reduction.restored + extra,
        direction=tuple(columns[-1]),
    )
