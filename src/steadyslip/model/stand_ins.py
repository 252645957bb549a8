"""Symbols in place of what exact arithmetic of polynomials cannot take."""

from __future__ import annotations

import sympy as sp

from steadyslip.core.symbols import inner_symbol


class StandIns:
    """Symbols in place of whatever is no polynomial, so that exact arithmetic can be done with what is left."""

    def __init__(self) -> None:
        self.names: dict[sp.Symbol, sp.Expr] = {}
        self._known: dict[sp.Expr, sp.Symbol] = {}

    def whole(self, expression: sp.Expr) -> sp.Expr:
        """A symbol for an expression; numbers stay."""
        if expression.is_Number:
            return expression
        symbol = inner_symbol(f"e{len(self.names)}")
        self.names[symbol] = expression
        return symbol

    def polynomial(self, expression: sp.Expr) -> sp.Expr:
        """A polynomial in parameters and in symbols for its other parts, the same for the same."""
        e = sp.sympify(expression)
        if e.is_Symbol or e.is_Rational:
            return e
        if e.is_Add or e.is_Mul:
            return e.func(*(self.polynomial(part) for part in e.args))
        if e.is_Pow and e.exp.is_Integer and e.exp.is_positive:
            return self.polynomial(e.base) ** e.exp
        if e not in self._known:
            self._known[e] = self.whole(e)
        return self._known[e]

    def back(self, expression: sp.Expr) -> sp.Expr:
        """The expression that a result stands for."""
        return expression.xreplace(self.names)
