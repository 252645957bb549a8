"""SymPy expressions to straight-line programs.

What depends on parameters only is lifted out first: it becomes a *constant* of the trajectory, computed once
by NumPy for any number of rigs, so that kernels see few operations and never a parameter's unit. Common
subexpressions of the rest are computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import array_function
from steadyslip.kernels.nodes import PRIMITIVES, Value, as_node, primitive, select


class Constants:
    """The constants of a kernel: parameter-only expressions, numbered in order of first use."""

    def __init__(self, variables: Iterable[sp.Symbol]) -> None:
        self.variables = frozenset(variables)
        self.symbols: dict[sp.Expr, sp.Symbol] = {}
        self.rates: dict[tuple[sp.Symbol, int], sp.Symbol] = {}
        self._seen: dict[sp.Expr, sp.Expr] = {}
        self._moves: dict[sp.Basic, bool] = {}

    def moves(self, expression: sp.Basic) -> bool:
        """Whether an expression has a variable in it."""
        known = self._moves.get(expression)
        if known is None:
            known = expression in self.variables or any(map(self.moves, expression.args))
            self._moves[expression] = known
        return known

    def lifted(self, expression: sp.Expr) -> sp.Expr:
        """The expression with every largest parameter-only part replaced by a constant."""
        known = self._seen.get(expression)
        if known is None:
            known = self._seen[expression] = self._lift(expression)
        return known

    def _lift(self, expression: sp.Expr) -> sp.Expr:
        if expression in self.variables or isinstance(expression, (sp.Number, sp.NumberSymbol)):
            return expression
        if not isinstance(expression, sp.Expr):  # conditions of a Piecewise
            return expression.func(*(self.lifted(a) for a in expression.args)) if expression.args else expression
        if not self.moves(expression):
            return self._constant(expression)
        if expression.is_Mul or expression.is_Add:
            fixed = [a for a in expression.args if not self.moves(a)]
            moving = [self.lifted(a) for a in expression.args if self.moves(a)]
            if fixed:
                part = expression.func(*fixed)
                moving.append(part if part.is_Number else self._constant(part))
            return expression.func(*moving)
        return expression.func(*(self.lifted(a) for a in expression.args))

    def _constant(self, expression: sp.Expr) -> sp.Expr:
        if expression.could_extract_minus_sign():
            return -self._constant(-expression)
        if expression not in self.symbols:
            self.symbols[expression] = sp.Symbol(f"c{len(self.symbols)}", real=True)
        return self.symbols[expression]

    @property
    def all(self) -> list[sp.Symbol]:
        """Every constant, then the rates of change of some."""
        return [*self.symbols.values(), *self.rates.values()]

    def rate_of(self, constant: sp.Symbol, direction: int) -> sp.Symbol:
        """A further constant: how fast `constant` changes with one of the things that the caller varies."""
        return self.rates.setdefault((constant, direction), sp.Symbol(f"{constant}_rate_{direction}", real=True))

    def with_rates(self, found: np.ndarray, rates: np.ndarray, inputs: Mapping[sp.Symbol, np.ndarray]) -> np.ndarray:
        """Rows of all constants, from those of the constants and of their rates of change.

        Parameters
        ----------
        found : ndarray (rigs, constants)
        rates : ndarray (rigs, directions, constants)
        inputs : mapping of symbol to ndarray (rigs, directions)
            Rates of change of inputs, zero unless given.
        """
        order = {symbol: i for i, symbol in enumerate(self.symbols.values())}
        table = np.zeros((len(found), len(self.all)))
        table[:, : len(order)] = found
        for column, (constant, direction) in enumerate(self.rates, start=len(order)):
            if constant in order:
                table[:, column] = rates[:, direction, order[constant]]
            elif constant in inputs:
                table[:, column] = inputs[constant][:, direction]
        return table

    def function(self, arguments: Sequence[sp.Symbol]) -> Callable[..., list[Any]]:
        """A NumPy function from parameter values to the constants, not to their rates of change."""
        return array_function(arguments, list(self.symbols))


class Formulas:
    """Expressions that are computed together.

    Parameters
    ----------
    expressions : sequence of sympy.Expr
    names : mapping of sympy.Symbol to str
        What their symbols are called where values are given; a symbol's own name unless given.
    """

    def __init__(self, expressions: Sequence[sp.Expr], names: Mapping[sp.Symbol, str]) -> None:
        called = {s: sp.Symbol(n, real=True) for s, n in names.items()}
        renamed = [sp.sympify(expression).xreplace(called) for expression in expressions]
        symbols = (sp.Symbol(f"_{i}", real=True) for i in range(10**6))
        self.temporaries, self.results = sp.cse(renamed, symbols=symbols)

    def __call__(self, values: Mapping[str, Value]) -> list[Value]:
        """The value of each expression; values are numbers or nodes of a program."""
        known = dict(values)
        for symbol, expression in self.temporaries:
            known[symbol.name] = _value(expression, known)
        return [_value(expression, known) for expression in self.results]


def _value(e: Any, known: Mapping[str, Value]) -> Any:
    """An expression from the values of its symbols: products for small powers, selections for branches."""
    if e.is_Symbol:
        return known[e.name]
    if e.is_Add:
        return _sum(e, known)
    if e.is_Mul:
        negative, value = _product(e, known)
        return -value if negative else value
    if e.is_Pow:
        return _power(_value(e.base, known), e.exp, known)
    if isinstance(e, sp.Piecewise):
        return _piecewise(e, known)
    if isinstance(e, (sp.Number, sp.NumberSymbol)):
        return float(e)
    if isinstance(e, Boolean):  # a condition that several branches share
        return _condition(e, known)
    return _called(e, known)


def _sum(e: sp.Expr, known: Mapping[str, Value]) -> Any:
    total: Any = None
    for term in e.as_ordered_terms():
        negative, value = _product(term, known)
        if total is None:
            total = -value if negative else value
            continue
        total = total - value if negative else total + value
    return total


def _product(e: Any, known: Mapping[str, Value]) -> tuple[bool, Any]:
    """Whether a term is subtracted, and what is: the first factor negated where it stands alone comes to the same."""
    coefficient, rest = e.as_coeff_Mul()
    if e.is_Number or not e.is_Mul:
        return (True, float(-e)) if e.is_Number and e < 0 else (False, _value(e, known))
    negative = bool(coefficient < 0)
    if negative and rest.is_Add:
        e = rest if coefficient == -1 else sp.Mul(-coefficient, rest, evaluate=False)
    elif negative:
        e = -coefficient * rest
    above, below = [], []
    for factor in e.as_ordered_factors() if e.is_Mul else [e]:
        if factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative:
            below.append(_power(_value(factor.base, known), -factor.exp, known))
        else:
            above.append(_value(factor, known))
    value = _multiplied(above or [1.0])
    return negative, value / _multiplied(below) if below else value


def _multiplied(factors: Sequence[Any]) -> Any:
    value = factors[0]
    for factor in factors[1:]:
        value = value * factor
    return value


def _power(base: Any, exponent: Any, known: Mapping[str, Value]) -> Any:
    if exponent.is_Integer and 0 < abs(int(exponent)) <= 8:
        value = _multiplied([base] * abs(int(exponent)))
        return value if exponent > 0 else 1.0 / value
    if abs(exponent) == sp.Rational(1, 2):
        root = primitive("sqrt", base)
        return root if exponent > 0 else 1.0 / root
    return primitive("power", base, _value(exponent, known))


def _piecewise(e: sp.Piecewise, known: Mapping[str, Value]) -> Any:
    value: Any = np.nan
    for branch, condition in reversed(e.args):
        holds = _condition(condition, known)
        value = _value(branch, known) if holds is True else select(as_node(holds, "bool"), _value(branch, known), value)
    return value


def _condition(c: Any, known: Mapping[str, Value]) -> Any:
    if c in (sp.true, sp.false):
        return bool(c)
    if c.is_Symbol:
        return known[c.name]
    if isinstance(c, Relational):
        left, right = (_value(side, known) for side in (c.lhs, c.rhs))
        compared = {"<": lambda: left < right, "<=": lambda: left <= right, ">": lambda: left > right,
                    ">=": lambda: left >= right, "==": lambda: (left <= right) & (left >= right),
                    "!=": lambda: (left < right) | (left > right)}  # fmt: skip
        return compared[c.rel_op]()
    parts = [as_node(_condition(part, known), "bool") for part in c.args]
    if isinstance(c, sp.Not):
        return ~parts[0]
    value = parts[0]
    for part in parts[1:]:
        value = value & part if isinstance(c, sp.And) else value | part
    return value


def _called(e: sp.Expr, known: Mapping[str, Value]) -> Any:
    name = type(e).__name__
    arguments = [_value(argument, known) for argument in e.args]
    if name == "Abs":
        return abs(arguments[0])
    if name == "tan":
        return primitive("sin", *arguments) / primitive("cos", *arguments)
    if name == "DiracDelta":
        return 0.0  # the derivative of sign, but for one point
    if name not in PRIMITIVES:
        raise NotAvailable(
            f"the equations contain {name}(...), which cannot be compiled; a law that is to move may use "
            f"{', '.join(PRIMITIVES)}, tan, abs, powers and Piecewise"
        )
    return primitive(name, *arguments)
