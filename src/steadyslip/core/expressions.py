"""SymPy expressions to array functions, and the one primitive that SymPy lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.numpy import NumPyPrinter

Num = Any
"""A number, an array of numbers or a SymPy expression: formulas are written once for all three."""


class asinh_exp(sp.Function):  # type: ignore[misc]  # noqa: N801  # named like the SymPy functions it stands beside
    """asinh(x exp(y)), evaluated without overflow for large y (regularised rate-and-state friction)."""

    nargs = 2

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        x, y = self.args
        root = sp.sqrt(x**2 + sp.exp(-2 * y))
        return 1 / root if argindex == 1 else x / root

    def _eval_is_positive(self) -> bool | None:
        return bool(self.args[0].is_positive) or None

    def _eval_is_real(self) -> bool | None:
        return bool(self.args[0].is_real and self.args[1].is_real) or None

    def _latex(self, printer: Any) -> str:
        x, y = (printer._print(argument) for argument in self.args)
        return rf"\operatorname{{asinh}}\left({x} e^{{{y}}}\right)"

    def _eval_evalf(self, prec: int) -> sp.Expr:
        x, y = self.args
        return sp.asinh(x * sp.exp(y))._eval_evalf(prec)


def numpy_asinh_exp(x: Any, y: Any) -> Any:
    """NumPy counterpart of `asinh_exp`."""
    size = np.log(np.abs(x) + np.finfo(float).tiny) + y
    small = np.arcsinh(np.exp(np.minimum(size, 20.0)))
    return np.sign(x) * np.where(size > 20.0, size + np.log(2.0), small)


_PYTHON = frozenset((int, float, bool))
"""Numbers that raise where NumPy's become inf or NaN."""


class _Printer(NumPyPrinter):  # type: ignore[misc]  # SymPy's printers are untyped
    """SymPy's own NumPy printer, powers of two and the primitive above added."""

    def _print_asinh_exp(self, expr: sp.Expr) -> str:
        return f"asinh_exp({', '.join(self._print(a) for a in expr.args)})"

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:  # noqa: N802
        """`numpy.where` takes numbers and arrays alike; `numpy.select`, which SymPy writes, arrays only."""
        where, text = self._module_format("numpy.where"), str(self._module_format("numpy.nan"))
        for branch, condition in reversed(expr.args):
            text = f"{where}({self._print(condition)}, {self._print(branch)}, {text})"
        return text


def array_function(arguments: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
    """A function of the arguments' values that returns the values of all expressions.

    Common subexpressions are computed once; every argument may be a scalar or an array. What leaves the range of
    floating point is inf or NaN, without a warning: Python's own floats would raise instead.
    """
    order = sorted(arguments, key=lambda symbol: symbol.name)
    names = {symbol: sp.Symbol(f"p{i}") for i, symbol in enumerate(order)}
    renamed = [sp.sympify(e).xreplace(names) for e in expressions]
    function = sp.lambdify(
        [names[symbol] for symbol in arguments],
        renamed,
        modules=[{"asinh_exp": numpy_asinh_exp}, "numpy"],
        printer=_Printer,
        cse=True,
        docstring_limit=0,  # nobody reads it, and writing it takes long
    )

    def evaluate(*values: Any) -> list[Any]:
        with np.errstate(all="ignore"):
            found: list[Any] = function(*[np.float64(v) if type(v) in _PYTHON else v for v in values])
        return found

    return evaluate
