"""Implicit differentiation of unknowns that are determined together by equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from steadyslip.core.errors import InternalError
from steadyslip.core.expressions import derivative


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Unknowns and as many residuals, which are zero in motion.

    Attributes
    ----------
    symbols : tuple of sympy.Symbol
    residuals : tuple of sympy.Expr
    """

    symbols: tuple[sp.Symbol, ...]
    residuals: tuple[sp.Expr, ...]

    @cached_property
    def matrix(self) -> list[list[sp.Expr]]:
        """Jacobian of the residuals with respect to the unknowns, rows of expressions."""
        return [[derivative(residual, symbol) for symbol in self.symbols] for residual in self.residuals]

    def followed(self, expression: sp.Expr, perturbation: Sequence[sp.Expr]) -> sp.Expr:
        """First-order change of an expression through the unknowns for a `perturbation` of the residuals."""
        own = [(k, derivative(expression, symbol)) for k, symbol in enumerate(self.symbols) if expression.has(symbol)]
        if not own:
            return sp.Integer(0)
        changes = self.changes(perturbation)
        return sp.Add(*(slope * changes[k] for k, slope in own))

    def along(self, expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        """Total derivative with respect to a variable, with the unknowns following so that the residuals stay zero."""
        own = [derivative(residual, variable) for residual in self.residuals]
        return derivative(expression, variable) + self.followed(expression, own)

    def changes(self, perturbation: Sequence[sp.Expr]) -> list[sp.Expr]:
        """First-order changes −M⁻¹ `perturbation` of the unknowns, M the `matrix`, by elimination without expansion."""
        rows, factors = self._factors
        right = [-one for one in perturbation]
        for i, k, factor in factors:
            right[i] -= factor * right[k]
        found: dict[int, sp.Expr] = {}
        for k in reversed(range(len(rows))):
            row, entries = rows[k]
            known = sp.Add(*(entries[c] * change for c, change in found.items()))
            found[k] = (right[row] - known) / entries[k]
        return [found[k] for k in range(len(rows))]

    @cached_property
    def _factors(self) -> tuple[list[tuple[int, list[sp.Expr]]], list[tuple[int, int, sp.Expr]]]:
        """LU factors: rows of the upper triangle with their equation; steps (i, k, f), equation i minus f times k."""
        rows, factors = list(enumerate(map(list, self.matrix))), []
        for k in range(len(rows)):
            pivot = next((i for i in range(k, len(rows)) if rows[i][1][k] != 0), None)
            if pivot is None:
                raise InternalError("equations with a regular Jacobian")
            rows[k], rows[pivot] = rows[pivot], rows[k]
            above, own = rows[k]
            for i in range(k + 1, len(rows)):
                below, entries = rows[i]
                if entries[k] != 0:
                    factor = entries[k] / own[k]
                    factors.append((below, above, factor))
                    rows[i] = below, [a if b == 0 else a - factor * b for a, b in zip(entries, own, strict=True)]
        return rows, factors
