"""Small perturbations of steady sliding, symbolically from the Model.

The balances of forces, one for each contact, and the rates of the memory variables are differentiated once; the
intermediate stresses T, τ, σ are eliminated by the chain rule, so every entry is in terms of the parameters and the
steady normal stress. From the entries come the characteristic polynomial (any number of states), its
split p(s) + k q(s), and state-space matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp
from sympy.polys.domains import ZZ
from sympy.polys.matrices import DomainMatrix

from steadyslip.core.expressions import derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model

Row = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Gradients at steady sliding.

    Attributes
    ----------
    columns : tuple of sympy.Symbol
        x, v, memory variables, integral: the order of `rows` and of the characteristic matrix.
    rows : dict
        For each column the gradient, in columns, accelerations and inputs, of its rate; for the velocity of a contact
        that of the contact's balance.
    outputs : dict
        Gradients of the observables.
    """

    model: Model
    columns: tuple[sp.Symbol, ...]
    rows: dict[sp.Symbol, Row]
    outputs: dict[str, Row]


@question
def linearise(model: Model) -> Linearisation:
    """Differentiate a model at steady sliding."""
    velocities = {contact.slip: contact.velocity for contact in model.contacts}
    columns: dict[sp.Symbol, None] = {}
    for item in model.variables:  # a body without inertia has its velocity beside its slip all the same
        columns |= {item.symbol: None} | ({velocities[item.symbol]: None} if item.symbol in velocities else {})
    inputs = [s for name, s in model.inputs.items() if name != "time"]
    basis = [*columns, *(contact.acceleration for contact in model.contacts), *inputs]
    intermediate: dict[sp.Symbol, Row] = {}

    def gradient(expression: sp.Expr) -> Row:
        """Total derivative with respect to the basis, at steady sliding."""
        total: Row = {}
        free = expression.free_symbols
        for name in basis:
            value = model.at_steady(derivative(expression, name)) if name in free else sp.Integer(0)
            for middle, row in intermediate.items():
                if middle in free and row.get(name, 0) != 0:
                    value += model.at_steady(derivative(expression, middle)) * row[name]
            total[name] = value
        return total

    for name, definition in model.definitions.items():
        intermediate[name] = gradient(definition)
    rows = {symbol: gradient(rate) for symbol, rate in model.rate_of.items()}
    rows |= {contact.velocity: gradient(contact.balance) for contact in model.contacts}
    outputs = {name: gradient(expression) for name, (expression, _) in model.observables.items()}
    return Linearisation(model, tuple(columns), rows, outputs)


@question
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
    faster = {contact.velocity: contact.acceleration for contact in model.contacts}
    for i, row_symbol in enumerate(linear.columns):
        row, sign = linear.rows[row_symbol], 1 if row_symbol in faster else -1
        for j, column in enumerate(linear.columns):
            entry = sign * stand_in(row[column])
            if column in faster and row[faster[column]] != 0:
                entry += sign * s * stand_in(row[faster[column]])
            if i == j and row_symbol not in faster:
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


@question
def stiffness_split(model: Model, name: str = "slider.stiffness") -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """The characteristic polynomial as p(s) + k q(s), coefficients lowest first.

    Exact because k enters through one rank-one term; `name` may be another parameter that enters
    linearly (a controller's gain).
    """
    symbol = model.parameters[name]
    coefficients = characteristic_coefficients(model)
    without = tuple(c.xreplace({symbol: sp.Integer(0)}) for c in coefficients)
    slope = tuple(derivative(c, symbol) for c in coefficients)
    return without, slope
