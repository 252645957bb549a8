"""Small perturbations of steady sliding, symbolically from the Model.

The balance of forces and the rates of the memory variables are differentiated once; the intermediate
stresses T, τ, σ are eliminated by the chain rule, so every entry is in terms of the parameters and the
steady normal stress. From the entries come the characteristic polynomial (any number of states), its
split p(s) + k q(s), and state-space matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import sympy as sp
from sympy.polys.domains import ZZ
from sympy.polys.matrices import DomainMatrix

from steadyslip.model import Model

Row = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Gradients at steady sliding.

    Attributes
    ----------
    columns : tuple of sympy.Symbol
        x, v, memory variables, integral: the order of `rates` and of the characteristic matrix.
    balance : dict
        Gradient of the model's balance with respect to columns, acceleration and inputs.
    rates : dict
        For each column but v: gradient of its rate.
    """

    model: Model
    columns: tuple[sp.Symbol, ...]
    balance: Row
    rates: dict[sp.Symbol, Row]
    outputs: dict[str, Row]

    @property
    def acceleration(self) -> sp.Symbol:
        return self.model.symbols["acceleration"]

    def well_posedness(self) -> sp.Expr:
        """Derivative of the balance in its unknown: must be positive.

        It is the leading coefficient of the characteristic polynomial: m + f1 B0 with inertia,
        f + f1 B1 + ... without (theory 3).
        """
        return self.balance[self.model.unknown]


@lru_cache(maxsize=128)
def linearise(model: Model) -> Linearisation:
    """Differentiate a model at steady sliding."""
    symbol = model.symbols
    x, v, acceleration = symbol["x"], symbol["v"], symbol["acceleration"]
    others = [item.symbol for item in model.variables if item.symbol not in (x, v)]
    inputs = [s for name, s in model.inputs.items() if name != "time"]
    basis = [x, v, acceleration, *others, *inputs]
    intermediate: dict[sp.Symbol, Row] = {}

    def gradient(expression: sp.Expr) -> Row:
        """Total derivative with respect to the basis, at steady sliding."""
        total: Row = {}
        free = expression.free_symbols
        for name in basis:
            value = _at_steady(sp.diff(expression, name), model) if name in free else sp.Integer(0)
            for middle, row in intermediate.items():
                if middle in free and row.get(name, 0) != 0:
                    value += _at_steady(sp.diff(expression, middle), model) * row[name]
            total[name] = value
        return total

    for name, definition in model.definitions.items():
        intermediate[name] = gradient(definition)
    rates = {
        item.symbol: gradient(rate)
        for item, rate in zip(model.variables, model.rates, strict=True)
        if item.symbol is not v
    }
    outputs = {name: gradient(expression) for name, (expression, _) in model.observables.items()}
    return Linearisation(model, (x, v, *others), gradient(model.balance), rates, outputs)


def _at_steady(expression: sp.Expr, model: Model) -> sp.Expr:
    """Substitute steady sliding; terms that cancel there do so exactly."""
    steady = model.steady
    expression = expression.xreplace({s: steady[s] for s in expression.free_symbols & steady.keys()})
    return expression.doit() if expression.has(sp.sign, sp.Derivative, sp.Abs) else expression


@lru_cache(maxsize=128)
def characteristic_coefficients(model: Model) -> tuple[sp.Expr, ...]:
    """Coefficients of the characteristic polynomial in s, lowest power first (theory 3: a0, a1, ...).

    The highest is m + f1 B0 times a positive factor where there is inertia; it may vanish for m = 0.
    """
    linear = linearise(model)
    s = sp.Symbol("s")
    names: dict[sp.Symbol, sp.Expr] = {}

    def stand_in(expression: sp.Expr) -> sp.Expr:
        if expression.is_Number:
            return expression
        symbol = sp.Symbol(f"e{len(names)}")
        names[symbol] = expression
        return symbol

    size = len(linear.columns)
    matrix = sp.zeros(size, size)
    for i, row_symbol in enumerate(linear.columns):
        is_balance = row_symbol is linear.columns[1]
        row = linear.balance if is_balance else linear.rates[row_symbol]
        sign = 1 if is_balance else -1
        for j, column in enumerate(linear.columns):
            entry = sign * stand_in(row[column])
            if column is linear.columns[1] and row[linear.acceleration] != 0:
                entry += sign * s * stand_in(row[linear.acceleration])
            if i == j and not is_balance:
                entry += s
            matrix[i, j] = entry
    polynomial = _determinant(matrix, s, list(names))
    return tuple(coefficient.xreplace(names) for coefficient in polynomial)


def _determinant(matrix: sp.Matrix, s: sp.Symbol, names: list[sp.Symbol]) -> list[sp.Expr]:
    """Coefficients in s, lowest first, of a determinant, by a division-free method."""
    ring = ZZ[[s, *names]]
    entries = [[ring.from_sympy(entry) for entry in matrix.row(i)] for i in range(matrix.rows)]
    signed = DomainMatrix(entries, matrix.shape, ring).charpoly()[-1]
    expression = ring.to_sympy(signed) * (-1) ** matrix.rows
    coefficients = sp.Poly(expression, s).all_coeffs()[::-1]
    return [sp.sympify(c) for c in coefficients]


@lru_cache(maxsize=128)
def stiffness_split(model: Model, name: str = "slider.stiffness") -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """The characteristic polynomial as p(s) + k q(s), coefficients lowest first.

    Exact because k enters through one rank-one term; `name` may be another parameter that enters
    linearly (a controller's gain).
    """
    symbol = model.parameters[name]
    coefficients = characteristic_coefficients(model)
    without = tuple(c.xreplace({symbol: sp.Integer(0)}) for c in coefficients)
    slope = tuple(sp.diff(c, symbol) for c in coefficients)
    return without, slope
