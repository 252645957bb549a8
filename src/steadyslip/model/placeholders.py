"""Placeholder symbols for subexpressions, so that the rest can be treated as polynomials."""

from __future__ import annotations

import sympy as sp

from steadyslip.core.symbols import inner_symbol


class Placeholders:
    """Placeholder symbols of subexpressions that are not polynomials, for exact polynomial arithmetic with the rest."""

    def __init__(self) -> None:
        self.names: dict[sp.Symbol, sp.Expr] = {}
        self._known: dict[sp.Expr, sp.Symbol] = {}

    def symbol_for(self, expression: sp.Expr) -> sp.Expr:
        """New placeholder of an expression; numbers are returned unchanged."""
        if expression.is_Number:
            return expression
        symbol = inner_symbol(f"e{len(self.names)}")
        self.names[symbol] = expression
        return symbol

    def polynomial(self, expression: sp.Expr) -> sp.Expr:
        """Polynomial with non-polynomial parts replaced by placeholders; equal parts have equal placeholders."""
        e = sp.sympify(expression)
        if e.is_Symbol or e.is_Rational:
            return e
        if e.is_Add or e.is_Mul:
            return e.func(*(self.polynomial(part) for part in e.args))
        if e.is_Pow and e.exp.is_Integer and e.exp.is_positive:
            return self.polynomial(e.base) ** e.exp
        if e not in self._known:
            self._known[e] = self.symbol_for(e)
        return self._known[e]

    def restored(self, expression: sp.Expr) -> sp.Expr:
        """Expression with placeholders replaced by the original subexpressions."""
        return expression.xreplace(self.names)
