"""SymPy expressions to straight-line kernel text.

What depends on parameters only is lifted out first: it becomes a *constant* of the trajectory, computed once
by NumPy for any number of rigs, so that kernels see few operations and never a parameter's unit. Common
subexpressions of the rest are computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from steadyslip.errors import NotAvailable
from steadyslip.expressions import array_function

Lines = list[str]

PRIMITIVES = (
    "exp", "log", "log1p", "expm1", "sinh", "cosh", "tanh", "asinh", "asinh_exp", "sin", "cos", "sqrt", "power", "sign",
)  # fmt: skip


class _Printer(PythonCodePrinter):  # type: ignore[misc]  # SymPy's printers are untyped
    """Kernel text: our own primitives, products for small powers, selections for branches."""

    def _print_Function(self, expr: sp.Expr) -> str:  # noqa: N802
        name = type(expr).__name__
        if name not in PRIMITIVES:
            raise NotAvailable(
                f"the equations contain {name}(...), which cannot be compiled; a law that is to move may use "
                f"{', '.join(PRIMITIVES)}, tan, abs, powers and Piecewise"
            )
        return f"{name}({', '.join(self._print(argument) for argument in expr.args)})"

    _print_exp = _print_log = _print_sinh = _print_cosh = _print_tanh = _print_asinh = _print_Function
    _print_sin = _print_cos = _print_asinh_exp = _print_sign = _print_Function

    def _print_Abs(self, expr: sp.Expr) -> str:  # noqa: N802
        return f"abs({self._print(expr.args[0])})"

    def _print_tan(self, expr: sp.Expr) -> str:
        argument = self._print(expr.args[0])
        return f"(sin({argument})/cos({argument}))"

    def _print_Rational(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    def _print_Integer(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    def _print_NumberSymbol(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    _print_Pi = _print_NumberSymbol  # noqa: N815
    _print_Exp1 = _print_NumberSymbol  # noqa: N815

    def _print_DiracDelta(self, expr: sp.Expr) -> str:  # noqa: N802
        return "0.0"  # the derivative of sign, but for one point

    def _print_Pow(self, expr: sp.Expr, rational: bool = False) -> str:  # noqa: N802
        base, exponent = expr.args
        text = f"({self._print(base)})"
        if exponent.is_Integer and 0 < int(exponent) <= 8:
            return "(" + "*".join([text] * int(exponent)) + ")"
        if exponent.is_Integer and -8 <= int(exponent) < 0:
            return "(1.0/(" + "*".join([text] * -int(exponent)) + "))"
        if exponent == sp.Rational(1, 2):
            return f"sqrt({text})"
        if exponent == -sp.Rational(1, 2):
            return f"(1.0/sqrt({text}))"
        return f"power({text}, {self._print(exponent)})"

    def _print_Piecewise(self, expr: sp.Expr) -> str:  # noqa: N802
        text = "math.nan"
        for value, condition in reversed(expr.args):
            text = f"({self._print(value)} if {self._print(condition)} else {text})"
        return text


class Constants:
    """The constants of a kernel: parameter-only expressions, numbered in order of first use."""

    def __init__(self, variables: Iterable[sp.Symbol]) -> None:
        self.variables = frozenset(variables)
        self.symbols: dict[sp.Expr, sp.Symbol] = {}
        self.rates: dict[tuple[sp.Symbol, int], sp.Symbol] = {}
        self._seen: dict[sp.Expr, sp.Expr] = {}

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
        if not expression.free_symbols & self.variables:
            return self._constant(expression)
        if expression.is_Mul or expression.is_Add:
            fixed = [a for a in expression.args if not a.free_symbols & self.variables]
            moving = [self.lifted(a) for a in expression.args if a.free_symbols & self.variables]
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


def statements(targets: Sequence[tuple[str, sp.Expr]], names: dict[sp.Symbol, str]) -> Lines:
    """Assignments that compute named targets; temporaries start with an underscore."""
    renamed = [expression.xreplace({s: sp.Symbol(n, real=True) for s, n in names.items()}) for _, expression in targets]
    temporaries, results = sp.cse(renamed, symbols=(sp.Symbol(f"_{i}", real=True) for i in range(10**6)))
    printer = _Printer()
    lines = [f"{symbol} = {printer.doprint(expression)}" for symbol, expression in temporaries]
    return lines + [f"{n} = {printer.doprint(e)}" for (n, _), e in zip(targets, results, strict=True)]


def indented(lines: Iterable[str], depth: int) -> str:
    """Lines as text, `depth` levels deep."""
    return "".join("    " * depth + line + "\n" for line in lines)


def weighted(weights: Iterable[float], terms: Iterable[str]) -> str:
    """A weighted sum as text, zero weights left out."""
    parts = []
    for weight, term in zip(weights, terms, strict=False):
        if weight == 1.0:
            parts.append(term)
        elif weight:
            parts.append(f"{weight!r}*{term}")
    return " + ".join(parts) or "0.0"
