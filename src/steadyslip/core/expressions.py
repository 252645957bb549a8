"""NumPy and mpmath functions compiled from SymPy expressions, faster derivatives, and the function asinh(x exp(y))."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import BooleanAtom
from sympy.printing.latex import LatexPrinter

from steadyslip.core.errors import NotAvailable

Num = Any
"""A number, an array of numbers or a SymPy expression; the same formula serves all three."""
Choose = Callable[[Any, Any, Any], Any]
"""Function ``choose(condition, value, other)``: `np.where`, or a selection between nodes of a program."""


class asinh_exp(sp.Function):  # type: ignore[misc]  # noqa: N801  # named like the SymPy functions it stands beside
    """The function asinh(x exp(y)) of regularised rate-and-state friction, evaluated without overflow for large y."""

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


LONG_POWER = 4
"""Least absolute value of the exponent from which formulas show a power of ten as such, for example 10⁻²⁴."""


def power_of_ten(number: sp.Rational) -> int:
    """Exponent n if the number is 10^n; 0 for 1 and for numbers that are no power of ten.

    >>> power_of_ten(sp.Rational(1, 10**24)), power_of_ten(sp.Integer(1000)), power_of_ten(sp.Rational(3, 10))
    (-24, 3, 0)
    """
    digits = max(len(str(number.p)), len(str(number.q))) - 1
    if number == sp.Integer(10) ** digits:
        return digits
    return -digits if number == sp.Integer(10) ** -digits else 0


class _Latex(LatexPrinter):  # type: ignore[misc]  # SymPy has no types
    """LaTeX printer that writes long powers of ten as 10^{n}."""

    def _print_Rational(self, number: sp.Rational) -> str:  # noqa: N802 -- SymPy's name
        power = power_of_ten(number)
        if abs(power) >= LONG_POWER:
            return f"10^{{{power}}}"
        return str(number) if number.q == 1 else str(super()._print_Rational(number))

    _print_Integer = _print_Rational  # noqa: N815 -- SymPy's name


def latex(expression: sp.Basic) -> str:
    """LaTeX of an expression, in which numbers such as 10⁻²⁴ are written as powers of ten."""
    text: str = _Latex().doprint(expression)
    return text


def numpy_asinh_exp(x: Any, y: Any) -> Any:
    """Array of asinh(x exp(y)); intermediate values overflow or underflow only if x exp(y) does."""
    size, half = np.abs(x), np.exp(np.minimum(0.5 * y, 700.0))  # exp overflows beyond 709
    with np.errstate(over="ignore"):  # where the product overflows, the logarithm below is used
        product = size * half * half  # two factors of e^(y/2), so that none overflows or vanishes unless x e^y does
    # asinh(z) = log(2 z) to rounding for z > 1e8; used above 1e150, as log(2) + log|x| + y, since z may overflow
    return np.sign(x) * np.where(product > 1e150, np.log(size) + y + np.log(2.0), np.arcsinh(product))


_PYTHON = frozenset((int, float, bool))
"""Types whose arithmetic raises exceptions where NumPy's gives inf or NaN."""
_NUMPY = {
    sp.exp: "exp", sp.log: "log", sp.sin: "sin", sp.cos: "cos", sp.tan: "tan", sp.sinh: "sinh", sp.cosh: "cosh",
    sp.tanh: "tanh", sp.asin: "arcsin", sp.acos: "arccos", sp.atan: "arctan", sp.atan2: "arctan2", sp.asinh: "arcsinh",
    sp.acosh: "arccosh", sp.atanh: "arctanh", sp.Abs: "absolute", sp.sign: "sign", asinh_exp: "asinh_exp",
    sp.Max: "maximum", sp.Min: "minimum", sp.Not: "logical_not",
}  # fmt: skip
_COMPARED = {sp.Lt: "<", sp.Le: "<=", sp.Gt: ">", sp.Ge: ">=", sp.Eq: "==", sp.Ne: "!="}
_JOINED = {sp.And: " & ", sp.Or: " | ", sp.Xor: " ^ "}
_STRUCTURE = (
    sp.Symbol, sp.Number, sp.NumberSymbol, sp.Add, sp.Mul, sp.Pow, sp.Piecewise, ExprCondPair, sp.Implies,
    sp.Equivalent, sp.ITE, BooleanAtom,
)  # fmt: skip
_NO_NUMBERS = (sp.nan, sp.zoo, sp.I)
_WORLD = {
    name: getattr(np, name, numpy_asinh_exp)
    for name in (*_NUMPY.values(), "where", "sqrt", "square", "power", "nan", "inf")
}

FEW = 8
"""Largest number of rows for which evaluation row by row, with floats, is faster than with arrays; chosen by trial."""


def _of_numbers(function: Callable[..., Any]) -> Callable[..., float]:
    """NumPy function for floats, bit for bit equal to its array results; raises ArithmeticError on inf and NaN."""

    def own(*values: float) -> float:
        found = float(function(*values))
        if found - found != 0.0:
            raise ArithmeticError("beyond floating point")
        return found

    return own


_PLAIN: dict[str, Any] = {
    name: _of_numbers(function) for name, function in _WORLD.items() if callable(function)
} | {
    "absolute": abs, "square": lambda x: x * x, "sqrt": math.sqrt, "power": math.pow, "logical_not": lambda x: not x,
    "maximum": lambda x, y: x if x >= y or x != x else y, "minimum": lambda x, y: x if x <= y or x != x else y,
    "where": lambda condition, x, y: x if condition else y, "nan": math.nan, "inf": math.inf,
}  # fmt: skip
"""Functions of Python floats by NumPy name; they raise where NumPy's give inf or NaN."""


_PRECISE: dict[str, Any] = {
    "exp": mpmath.exp, "log": mpmath.log, "sin": mpmath.sin, "cos": mpmath.cos, "tan": mpmath.tan,
    "sinh": mpmath.sinh, "cosh": mpmath.cosh, "tanh": mpmath.tanh, "arcsin": mpmath.asin, "arccos": mpmath.acos,
    "arctan": mpmath.atan, "arctan2": mpmath.atan2, "arcsinh": mpmath.asinh, "arccosh": mpmath.acosh,
    "arctanh": mpmath.atanh, "sign": mpmath.sign, "sqrt": mpmath.sqrt, "power": mpmath.power,
    "nan": mpmath.nan, "inf": mpmath.inf, "asinh_exp": lambda x, y: mpmath.asinh(x * mpmath.exp(y)), "mpf": mpmath.mpf,
    **{name: _PLAIN[name] for name in ("absolute", "square", "logical_not", "maximum", "minimum", "where")},
}  # fmt: skip
"""Functions of mpmath numbers by NumPy name."""


def occurrences(expressions: Iterable[sp.Basic]) -> dict[sp.Basic, int]:
    """Number of uses of each subexpression if each is computed only once."""
    found: dict[sp.Basic, int] = {}
    waiting = list(expressions)
    while waiting:
        one = waiting.pop()
        found[one] = found.get(one, 0) + 1
        if found[one] == 1:
            waiting += one.args
    return found


def supported(e: Any, what: str) -> sp.Expr:
    """SymPy expression of a law without Max and Min, after a check that all its functions can be computed.

    Raises
    ------
    NotAvailable
        If a function or number cannot be computed; the message contains `what`, such as "strength of MyLaw".
    """
    found = sp.sympify(e)
    if found.has(sp.Max, sp.Min):
        found = found.replace(lambda one: isinstance(one, (sp.Max, sp.Min)), lambda one: one.rewrite(sp.Piecewise))
    for one in occurrences([found]):
        known = isinstance(one, (*_NUMPY, *_COMPARED, *_JOINED, *_STRUCTURE)) and one not in _NO_NUMBERS
        if not known:
            name = str(one) if one.is_Atom else f"{one.func.__name__}(...)"
            raise NotAvailable(
                f"the {what} contains {name}, which is not offered; allowed: numbers, arguments, powers, Piecewise, "
                f"Max, Min, sign, Abs, exp, log, sin, cos, tan, sinh, cosh, tanh and their inverses"
            )
    return found


class _Text:
    """Python source of expressions: `lines` assign common subexpressions to t0, t1, ...; `results` are expressions."""

    def __init__(
        self, names: Mapping[sp.Symbol, str], expressions: Sequence[sp.Basic], number: Callable[[Any], str]
    ) -> None:
        self.lines: list[str] = []
        self._known: dict[sp.Basic, str] = dict(names)
        self._count, self._number = occurrences(expressions), number
        self.results = [self._of(expression) for expression in expressions]

    def _of(self, e: Any) -> str:
        known = self._known.get(e)
        if known is not None:
            return known
        text = self._composed(e)
        if e.args and self._count[e] > 1:
            self.lines.append(f"t{len(self.lines)} = {text}")
            text = self._known[e] = f"t{len(self.lines) - 1}"
        return text

    def _composed(self, e: Any) -> str:
        if e.is_Number or e.is_NumberSymbol:
            return self._number(e)
        if e.is_Add:
            return f"({self._sum(e)})"
        if e.is_Mul:
            return f"({self._product(e.args)})"
        if e.is_Pow:
            return self._power(e.base, e.exp)
        if isinstance(e, sp.Piecewise):
            text = "nan"
            for branch, condition in reversed(e.args):
                text = f"where({self._of(condition)}, {self._of(branch)}, {text})"
            return text
        if e in (sp.true, sp.false):
            return str(bool(e))
        if e is sp.zoo:
            return "nan"
        parts = [self._of(argument) for argument in e.args]
        if e.func in _COMPARED:
            return f"({parts[0]} {_COMPARED[e.func]} {parts[1]})"
        if e.func in _JOINED:
            return f"({_JOINED[e.func].join(parts)})"
        if isinstance(e, sp.Implies):
            return f"(logical_not({parts[0]}) | {parts[1]})"
        if isinstance(e, sp.Equivalent):
            return f"(({' & '.join(parts)}) | logical_not({' | '.join(parts)}))"
        if isinstance(e, sp.ITE):
            return f"where({', '.join(parts)})"
        if e.func not in _NUMPY:
            raise NotAvailable(f"the equations contain {e.func.__name__}(...), which NumPy does not have")
        while e.func in (sp.Max, sp.Min) and len(parts) > 2:
            parts = [f"{_NUMPY[e.func]}({parts[0]}, {parts[1]})", *parts[2:]]
        return f"{_NUMPY[e.func]}({', '.join(parts)})"

    def _sum(self, e: Any) -> str:
        text = ""
        for term in e.args:
            first = term.args[0] if term.is_Mul else term
            if first.is_Number and first.is_negative and (term.is_Number or self._count[term] == 1):
                text += f" - {self._product((-first, *term.args[1:]) if term.is_Mul else (-first,))}"
            else:
                text += f" + {self._of(term)}"
        return text.removeprefix(" + ") if text.startswith(" + ") else text.removeprefix(" ")

    def _product(self, factors: Sequence[Any]) -> str:
        above, below = [], []
        for factor in factors:
            if factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative and self._count[factor] == 1:
                below.append(self._power(factor.base, -factor.exp))
            elif factor is not sp.S.One:
                above.append(self._of(factor))
        text = "*".join(above) or "1.0"
        if text.startswith("-1.0*"):
            text = f"-{text[5:]}"
        return text + (f"/({'*'.join(below)})" if len(below) > 1 else f"/{below[0]}" if below else "")

    def _power(self, base: Any, exponent: Any) -> str:
        if exponent is sp.S.One:
            return self._of(base)
        if exponent.is_Rational and exponent.is_negative:
            return f"(1.0/{self._power(base, -exponent)})"
        if exponent == sp.S.Half:
            return f"sqrt({self._of(base)})"
        if exponent == 2:
            return f"square({self._of(base)})"
        if exponent.is_Integer and not base.is_number:  # ** of two Python floats raises where NumPy's is inf
            return f"({self._of(base)}**{exponent})"
        return f"power({self._of(base)}, {self._of(exponent)})"  # ** of Python floats is complex where NumPy's is NaN


def _number(e: Any) -> str:
    value = repr(float(e))
    return value if value[0] != "-" else f"({value})"


def _precise_number(e: Any) -> str:
    if e.is_Integer:
        return f"mpf({int(e)})"
    if e.is_Rational:
        return f"(mpf({e.p})/{e.q})"
    return f"mpf('{e.evalf(60) if e.is_NumberSymbol else float(e)!r}')"


class ArrayFunction:
    """Numeric function of the arguments that returns the list of values of all expressions.

    Common subexpressions are computed once; every argument may be a scalar or an array. Overflow and invalid
    operations give inf or NaN without a warning.

    Raises
    ------
    NotAvailable
        If an expression contains a function that NumPy does not have.
    """

    def __init__(self, arguments: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> None:
        code = _compiled(arguments, expressions, _number)
        self._arrays, self._numbers = (_made(code, world) for world in (_WORLD, _PLAIN))

    def __call__(self, *values: Any) -> list[Any]:
        with np.errstate(all="ignore"):
            return self._arrays(*[np.float64(v) if type(v) in _PYTHON else v for v in values])

    def rows(self, arguments: np.ndarray) -> np.ndarray:
        """Values of all expressions, shape (rows, expressions), for arguments of shape (rows, arguments).

        Up to `FEW` rows are computed one by one with Python floats, whose operations take a tenth of NumPy's time.
        """
        if len(arguments) <= FEW:
            try:
                with np.errstate(all="ignore"):
                    return np.array([self._numbers(*row) for row in arguments.tolist()], dtype=float)
            except (ArithmeticError, ValueError, TypeError):  # a value is inf, NaN or complex: use NumPy below
                pass
        found = self(*arguments.T)
        table = np.empty((len(arguments), len(found)))
        for i, column in enumerate(found):
            table[:, i] = column
        return table


def _made(code: Any, world: Mapping[str, Any]) -> Callable[..., list[Any]]:
    own = dict(world)
    exec(code, own)
    function: Callable[..., list[Any]] = own["function"]
    return function


class PreciseFunction:
    """Function of mpmath numbers that returns the list of values of all expressions, with mpmath's current precision.

    Raises
    ------
    NotAvailable
        If an expression contains a function that NumPy does not have.
    """

    def __init__(self, arguments: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> None:
        self._function = _made(_compiled(arguments, expressions, _precise_number), _PRECISE)

    def __call__(self, *values: Any) -> list[Any]:
        return [mpmath.mpmathify(one) for one in self._function(*values)]


def _compiled(arguments: Sequence[sp.Symbol], expressions: Sequence[sp.Expr], number: Callable[[Any], str]) -> Any:
    names = {symbol: f"p{i}" for i, symbol in enumerate(arguments)}
    written = _Text(names, [sp.sympify(e) for e in expressions], number)
    body = [*written.lines, f"return [{', '.join(written.results)}]"]
    return compile(f"def function({', '.join(names.values())}):\n    " + "\n    ".join(body), "<equations>", "exec")


def replaced(e: sp.Expr, found: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Same result as ``e.xreplace(found)``, faster: each common subexpression is replaced once, also across calls."""
    return _replaced(e, _seen(tuple(found.items()))) if found else e


@lru_cache(maxsize=64)
def _seen(found: tuple[tuple[sp.Symbol, sp.Expr], ...]) -> dict[sp.Basic, sp.Basic]:
    """Cache of replaced subexpressions for one substitution; starts with the substitution itself."""
    return dict(found)


def _replaced(e: Any, seen: dict[sp.Basic, sp.Basic]) -> Any:
    known = seen.get(e)
    if known is not None:
        return known
    if not isinstance(e, sp.Basic) or not e.args:
        return e
    parts = [_replaced(part, seen) for part in e.args]
    changed = any(own is not part for own, part in zip(parts, e.args, strict=True))
    seen[e] = found = e.func(*parts) if changed else e
    return found


@lru_cache(maxsize=2**12)
def symbols_of(e: sp.Expr) -> frozenset[sp.Symbol]:
    """Symbols in an expression.

    The result is cached, as `free_symbols` visits all parts of the expression each time.
    """
    return frozenset(sp.sympify(e).free_symbols)


@lru_cache(maxsize=2**15)
def derivative(e: sp.Expr, x: sp.Symbol) -> sp.Expr:
    """Derivative of an expression with respect to a symbol, equal to `sympy.diff` but faster and cached.

    `sympy.diff` checks every cofactor of a vanishing derivative for finiteness, which takes most of its time.
    """
    if e == x:
        return sp.S.One
    if not isinstance(e, sp.Basic) or e.is_Atom:
        return sp.S.Zero
    if e.is_Add:
        return sp.Add(*(derivative(term, x) for term in e.args))
    if e.is_Mul:
        moving = [(i, own) for i, factor in enumerate(e.args) if (own := derivative(factor, x)) is not sp.S.Zero]
        return sp.Add(*(sp.Mul(*e.args[:i], own, *e.args[i + 1 :]) for i, own in moving))
    if e.is_Pow and derivative(e.exp, x) is sp.S.Zero:
        own = derivative(e.base, x)
        return sp.S.Zero if own is sp.S.Zero else e.exp * e.base ** (e.exp - 1) * own
    if isinstance(e, sp.Piecewise):
        return sp.Piecewise(*((derivative(branch, x), condition) for branch, condition in e.args))
    if isinstance(e, sp.sign):
        return sp.S.Zero
    if isinstance(e, (sp.exp, sp.log, sp.sin, sp.cos, sp.sinh, sp.cosh, sp.tanh, sp.asinh, asinh_exp)):
        inner = [(i, own) for i, part in enumerate(e.args, 1) if (own := derivative(part, x)) is not sp.S.Zero]
        return sp.Add(*(e.fdiff(i) * own for i, own in inner))
    return sp.diff(e, x) if x in e.free_symbols else sp.S.Zero
