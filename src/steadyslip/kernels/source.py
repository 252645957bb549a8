"""Translation of SymPy expressions to straight-line programs.

Parts that depend only on parameters become *constants* of the trajectory, which NumPy computes once for any number of
rigs, so that kernels have fewer operations and no parameters. Other common subexpressions are computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from operator import and_, ge, gt, le, lt, or_
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction, asinh_exp, occurrences
from steadyslip.core.symbols import inner_symbol
from steadyslip.kernels.nodes import Node, Value, as_node, primitive, select

SQUARED = 2**10
"""Largest exponent computed by repeated squaring; for larger ones its rounding error exceeds that of `power`."""


class Constants:
    """Subexpressions of a kernel that depend only on parameters, numbered in order of first use."""

    def __init__(self, variables: Iterable[sp.Symbol]) -> None:
        self.variables = frozenset(variables)
        self.symbols: dict[sp.Expr, sp.Symbol] = {}
        self.rates: dict[tuple[sp.Symbol, int], sp.Symbol] = {}
        self._seen: dict[sp.Expr, sp.Expr] = {}
        self._moves: dict[sp.Basic, bool] = {}
        self._rated: tuple[int, int, np.ndarray] = (-1, -1, np.empty((3, 0), dtype=int))

    def has_variable(self, expression: sp.Basic) -> bool:
        """True if an expression contains a variable (cached)."""
        known = self._moves.get(expression)
        if known is None:
            known = expression in self.variables or any(map(self.has_variable, expression.args))
            self._moves[expression] = known
        return known

    def with_constants(self, expression: sp.Expr) -> sp.Expr:
        """Expression with each maximal parameter-only part replaced by a constant (cached)."""
        known = self._seen.get(expression)
        if known is None:
            known = self._seen[expression] = self._lift(expression)
        return known

    def _lift(self, expression: sp.Expr) -> sp.Expr:
        if expression in self.variables or isinstance(expression, (sp.Number, sp.NumberSymbol)):
            return expression
        if not isinstance(expression, sp.Expr):  # conditions of a Piecewise
            return (
                expression.func(*(self.with_constants(a) for a in expression.args)) if expression.args else expression
            )
        if not self.has_variable(expression):
            return self._constant(expression)
        if expression.is_Mul or expression.is_Add:
            fixed = [a for a in expression.args if not self.has_variable(a)]
            moving = [self.with_constants(a) for a in expression.args if self.has_variable(a)]
            if fixed:
                part = expression.func(*fixed)
                moving.append(part if part.is_Number else self._constant(part))
            return expression.func(*moving)
        return expression.func(*(self.with_constants(a) for a in expression.args))

    def _constant(self, expression: sp.Expr) -> sp.Expr:
        if expression.could_extract_minus_sign():
            return -self._constant(-expression)
        if expression not in self.symbols:
            self.symbols[expression] = inner_symbol(f"c{len(self.symbols)}", real=True)
        return self.symbols[expression]

    @property
    def all(self) -> list[sp.Symbol]:
        """Symbols of all constants, then of the rates of change that were requested."""
        return [*self.symbols.values(), *self.rates.values()]

    def rate_of(self, constant: sp.Symbol, direction: int) -> sp.Symbol:
        """Symbol for the derivative of `constant` in a direction of parameter space; it is added to the constants."""
        return self.rates.setdefault(
            (constant, direction), inner_symbol(f"{constant.name}_rate_{direction}", real=True)
        )

    def with_rates(self, found: np.ndarray, rates: np.ndarray, inputs: Mapping[sp.Symbol, np.ndarray]) -> np.ndarray:
        """Values of all constants and their rates of change, shape (rigs, all).

        Parameters
        ----------
        found : ndarray (rigs, constants)
        rates : ndarray (rigs, directions, constants)
        inputs : mapping of symbol to ndarray (rigs, directions)
            Rates of change of inputs; zero for inputs that are missing.
        """
        size, (columns, directions, places) = len(self.symbols), self._rates_of_constants()
        table = np.zeros((len(found), len(self.all)))
        table[:, :size] = found
        table[:, columns] = rates[:, directions, places]
        if inputs:
            for column, (constant, direction) in enumerate(self.rates, start=size):
                if constant in inputs:
                    table[:, column] = inputs[constant][:, direction]
        return table

    def _rates_of_constants(self) -> np.ndarray:
        """Array (3, rates) for rates of change: column of the rate, direction, column of its constant (cached)."""
        size, count, found = self._rated
        if (size, count) != (len(self.symbols), len(self.rates)):
            order = {symbol: i for i, symbol in enumerate(self.symbols.values())}
            size, count = len(self.symbols), len(self.rates)
            known = enumerate(self.rates, start=size)
            rows = [(place, direction, order[one]) for place, (one, direction) in known if one in order]
            found = np.array(rows, dtype=int).reshape(-1, 3).T
            self._rated = size, count, found
        return found

    def function(self, arguments: Sequence[sp.Symbol]) -> Callable[..., list[Any]]:
        """NumPy function that computes the constants, without rates of change, from parameter values."""
        return ArrayFunction(arguments, list(self.symbols))


class Formulas:
    """Expressions that are evaluated together, so that common subexpressions are computed once.

    Parameters
    ----------
    expressions : sequence of sympy.Expr
    names : mapping of sympy.Symbol to str
        Key of each symbol in the mapping of values; its own name by default.
    """

    def __init__(self, expressions: Sequence[sp.Expr], names: Mapping[sp.Symbol, str]) -> None:
        self.expressions = [sp.sympify(expression) for expression in expressions]
        self.names = names
        self._count = occurrences(self.expressions)

    @property
    def symbols(self) -> set[str]:
        """Keys that the mapping of values must have."""
        return {self.names.get(e, e.name) for e in self._count if e.is_Symbol}

    def __call__(self, values: Mapping[str, Value]) -> list[Value]:
        """Values of the expressions, from numbers or nodes of a program by name."""
        evaluation = _Evaluation(values, self.names, self._count)
        return [evaluation.value(expression) for expression in self.expressions]


class _Evaluation:
    """One evaluation of expressions with given values; common subexpressions are cached."""

    def __init__(self, values: Mapping[str, Value], names: Mapping[sp.Symbol, str], count: dict[sp.Basic, int]) -> None:
        self.given, self.names, self.count = values, names, count
        self.known: dict[sp.Basic, Any] = {}

    def value(self, e: Any) -> Any:
        """Value of an expression: small powers are computed by products, Piecewise by selections."""
        if e.is_Symbol:
            return self.given[self.names.get(e, e.name)]
        if e not in self.known:
            self.known[e] = self._computed(e)
        return self.known[e]

    def _computed(self, e: Any) -> Any:
        if e.is_Number or e.is_NumberSymbol:
            return float(e)
        if e.is_Add:
            return self._sum(e)
        if e.is_Mul:
            negative, value = self._product(e)
            return -value if negative else value
        if e.is_Pow:
            return self._power(e.base, e.exp)
        if isinstance(e, sp.Piecewise):
            return self._piecewise(e)
        return self._condition(e) if isinstance(e, Boolean) else self._called(e)

    def _sum(self, e: sp.Expr) -> Any:
        total: Any = None
        for term in sorted(e.args, key=_is_number):
            negative, value = self._term(term)
            if total is None:
                total = -value if negative else value
                continue
            total = total - value if negative else total + value
        return total

    def _term(self, e: Any) -> tuple[bool, Any]:
        """True if a term is to be subtracted, and its value without the sign."""
        if e.is_Number and e.is_negative:
            return True, float(-e)
        return self._product(e) if e.is_Mul and self.count[e] == 1 else (False, self.value(e))

    def _product(self, e: Any) -> tuple[bool, Any]:
        first, *others = e.args
        negative = bool(first.is_Number and first.is_negative)
        if negative:
            others = others if first is sp.S.NegativeOne else [-first, *others]
        above, below = [], []
        for factor in others if negative else e.args:
            if factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative and self.count.get(factor, 1) == 1:
                below.append(self.value(factor.base**-factor.exp))
            else:
                above.append(self.value(factor))
        value = _multiplied(above or [1.0])
        return negative, value / _multiplied(below) if below else value

    def _power(self, base: Any, exponent: Any) -> Any:
        """Power by squaring for integer and half-integer exponents (with a square root); also for negative bases."""
        value = self.value(base)
        twice = 2.0 * float(exponent) if exponent.is_Number else 0.5
        if not (twice.is_integer() and abs(twice) <= 2 * SQUARED):
            return primitive("power", value, self.value(exponent))
        whole, half = divmod(abs(int(twice)), 2)
        factors = [primitive("sqrt", value)] if half else []
        while whole:
            factors += [value] if whole & 1 else []
            whole >>= 1
            value = value * value if whole else value
        return _multiplied(factors) if twice > 0 else 1.0 / _multiplied(factors)

    def _piecewise(self, e: sp.Piecewise) -> Any:
        value: Any = np.nan
        for branch, condition in reversed(e.args):
            holds = self._condition(condition)
            value = self.value(branch) if holds is True else select(as_node(holds, "bool"), self.value(branch), value)
        return value

    def _condition(self, c: Any) -> Any:
        if c in (sp.true, sp.false):
            return bool(c)
        if isinstance(c, Relational) and isinstance(c.lhs, sp.Expr):
            left, right = (self.value(side) for side in (c.lhs, c.rhs))
            if c.rel_op in ("==", "!="):
                equal = as_node((left <= right) & (left >= right), "bool")
                return equal if c.rel_op == "==" else ~equal
            return _COMPARED[c.rel_op](left, right)
        if type(c) not in _JOINED:
            raise NotAvailable(
                f"the equations contain the condition {c}, which cannot be compiled; laws in simulations may use "
                "comparisons, and And, Or, Not, Xor, Implies, Equivalent and ITE of them"
            )
        return _JOINED[type(c)](*(as_node(self._condition(part), "bool") for part in c.args))

    def _called(self, e: sp.Expr) -> Any:
        arguments = [self.value(argument) for argument in e.args]
        if isinstance(e, sp.Abs):
            return abs(arguments[0])
        if isinstance(e, sp.tan):
            return primitive("sin", *arguments) / primitive("cos", *arguments)
        if isinstance(e, sp.DiracDelta):
            return 0.0  # derivative of sign(x), except at x = 0
        if type(e) not in _FUNCTIONS:
            raise NotAvailable(
                f"the equations contain {type(e).__name__}(...), which cannot be compiled; laws in simulations may "
                f"use {', '.join(_FUNCTIONS.values())}, tan, abs, powers and Piecewise"
            )
        return primitive(_FUNCTIONS[type(e)], *arguments)


def _differ(first: Node, *others: Node) -> Node:
    """True where an odd number of conditions is true (exclusive or)."""
    for other in others:
        first = (first | other) & ~(first & other)
    return first


def _multiplied(factors: Sequence[Any]) -> Any:
    value = factors[0]
    for factor in factors[1:]:
        value = value * factor
    return value


def _is_number(e: sp.Expr) -> bool:
    return bool(e.is_Number)


_FUNCTIONS = {
    sp.exp: "exp", sp.log: "log", sp.sinh: "sinh", sp.cosh: "cosh", sp.tanh: "tanh", sp.asinh: "asinh",
    asinh_exp: "asinh_exp", sp.sin: "sin", sp.cos: "cos", sp.sign: "sign",
}  # fmt: skip
_COMPARED: dict[str, Callable[[Any, Any], Any]] = {"<": lt, "<=": le, ">": gt, ">=": ge}
_JOINED: dict[type, Callable[..., Node]] = {
    sp.And: lambda *parts: reduce(and_, parts),
    sp.Or: lambda *parts: reduce(or_, parts),
    sp.Not: lambda part: ~part,
    sp.Xor: _differ,
    sp.Ne: _differ,
    sp.Implies: lambda cause, effect: ~cause | effect,
    sp.Equivalent: lambda *parts: reduce(and_, parts) | ~reduce(or_, parts),
    sp.Eq: lambda left, right: ~_differ(left, right),
    sp.ITE: lambda condition, yes, no: (condition & yes) | (~condition & no),
}
"""Operations on conditions; `Eq` and `Ne` here compare two conditions, not two numbers."""
