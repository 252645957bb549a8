"""Small perturbations of steady sliding, symbolically from the Model.

The balances of forces, one for each contact, and the rates of the memory variables are differentiated once; the
intermediate stresses T, τ, σ are eliminated by the chain rule, so every entry is in terms of the parameters and the
steady normal stress. From the entries come the characteristic polynomial (any number of states), its
split p(s) + k q(s), and state-space matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.polys.domains import ZZ

from steadyslip.core.expressions import derivative
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.statics import StandIns

Row = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Gradients at steady sliding.

    Attributes
    ----------
    columns : tuple of sympy.Symbol
        Displacements, velocities, memory variables, integral, frictions that are unknowns.
    rows : dict
        For each column the gradient, in columns, accelerations and inputs, of its rate; for a velocity that of the
        balance of forces, for a friction that of its law less friction.
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
    velocities = {one.displacement: one.velocity for one in model.coordinates}
    columns: dict[sp.Symbol, None] = {}
    for item in model.variables:  # a body without inertia has its velocity beside its slip all the same
        columns |= {item.symbol: None} | ({velocities[item.symbol]: None} if item.symbol in velocities else {})
    columns |= dict.fromkeys(contact.friction for contact in model.contacts if contact.unknown is contact.friction)
    inputs = [s for name, s in model.inputs.items() if name != "time"]
    basis = [*columns, *(one.acceleration for one in model.coordinates), *inputs]
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
    balances = {one.velocity: one.balance for one in model.coordinates if one.balance is not None}
    balances |= {c.friction if c.unknown is c.friction else c.velocity: c.balance for c in model.contacts}
    rows |= {symbol: gradient(balance) for symbol, balance in balances.items()}
    outputs = {name: gradient(expression) for name, (expression, _) in model.observables.items()}
    return Linearisation(model, tuple(columns), rows, outputs)


@question
def characteristic_coefficients(model: Model) -> tuple[sp.Expr, ...]:
    """Coefficients of the characteristic polynomial in s, lowest power first (theory 3: a0, a1, ...).

    The highest is m + f1 B0 times a positive factor where there is inertia; it may vanish for m = 0. What the structure
    alone makes cancel, of stiffnesses and inertias of several bodies, has cancelled exactly.
    """
    stand_ins = StandIns()
    rows = characteristic_rows(model)
    forces = {one.velocity: one.balance is not None for one in model.coordinates}

    def stand_in(e: sp.Expr, row: sp.Symbol) -> sp.Expr:
        if row not in forces:
            return -stand_ins.whole(-e)  # a rate as it is
        return stand_ins.polynomial(e) if forces[row] else stand_ins.whole(e)

    matrix = [[[stand_in(e, name) for e in entry] for entry in row] for name, row in rows.items()]
    names, coefficients = _determinant(matrix)
    if model.is_single:
        return tuple(stand_ins.back(c.as_expr()) for c in coefficients)
    expressions = [stand_ins.back(name) for name in names]
    return tuple(_nested(list(c.terms()), expressions) for c in coefficients)


@question
def characteristic_rows(model: Model) -> dict[sp.Symbol, list[tuple[sp.Expr, sp.Expr, sp.Expr]]]:
    """The characteristic matrix: of every entry the coefficients of 1, s and s².

    Columns are displacements, memory variables, integral, unknown frictions; rows the balances of forces, the rates
    less s times their variables, the frictions less their laws, named as the rows of `Linearisation`.
    """
    linear = linearise(model)
    bodies = {one.displacement: one for one in model.coordinates}
    velocities = {one.velocity for one in model.coordinates}
    frictions = {contact.friction for contact in model.contacts}
    columns = [symbol for symbol in linear.columns if symbol not in velocities]
    found = {}
    for column in columns:
        row_symbol = bodies[column].velocity if column in bodies else column
        row = linear.rows[row_symbol]
        # forces stand as inertia less force; friction as itself less its law; variables as s times them less their rate
        sign = 1 if column in bodies and (bodies[column].balance is not None or model.is_single) else -1
        entries = []
        for other in columns:
            body = bodies.get(other)
            entry = [row[other], sp.Integer(0), sp.Integer(0)]
            if body is not None:
                entry[1:] = row[body.velocity], row[body.acceleration]
            entry = [sign * e for e in entry]
            if other is column and column not in bodies and column not in frictions:
                entry[1] += 1
            entries.append((entry[0], entry[1], entry[2]))
        found[row_symbol] = entries
    return found


Terms = list[tuple[tuple[int, ...], Any]]


def _nested(terms: Terms, factors: list[sp.Expr], first: int = 0) -> sp.Expr:
    """A polynomial with each factor taken out of the terms that have it, one after the other: thousands stay few.

    Nothing is added that was not: what cancels had cancelled in `terms`.
    """
    if len(terms) == 1:
        powers, number = terms[0]
        return sp.Mul(int(number), *(factors[i] ** power for i, power in enumerate(powers) if power and i >= first))
    while first < len(factors) and not any(powers[first] for powers, _ in terms):
        first += 1
    groups: dict[int, Terms] = {}
    for term in terms:
        groups.setdefault(term[0][first], []).append(term)
    inner = {power: _nested(group, factors, first + 1) for power, group in groups.items()}
    return sp.Add(*(sp.Mul(factors[first] ** power, part) for power, part in inner.items()))


def _determinant(matrix: list[list[list[sp.Expr]]]) -> tuple[list[sp.Symbol], list[Any]]:
    """Symbols, and the coefficients in s, lowest first, of a determinant as polynomials in them.

    Exact: by rows, each minor of the rows below once.
    """
    names = sorted({n for row in matrix for entry in row for e in entry for n in e.free_symbols}, key=str)
    ring = ZZ[(sp.Symbol("s"), *names)].ring
    s = ring.gens[0]
    table = [
        [sum((ring.from_expr(e) * s**power for power, e in enumerate(entry) if e != 0), ring.zero) for entry in row]
        for row in matrix
    ]
    known = {frozenset[int](): ring.one}

    def minor(columns: frozenset[int]) -> Any:
        """Of the last rows, as many as there are columns."""
        if columns not in known:
            row, total, sign = table[len(table) - len(columns)], ring.zero, 1
            for column in sorted(columns):
                if row[column]:
                    total += sign * row[column] * minor(columns - {column})
                sign = -sign
            known[columns] = total
        return known[columns]

    parts: dict[int, dict[tuple[int, ...], Any]] = {}
    for (power, *rest), number in minor(frozenset(range(len(table)))).terms():
        parts.setdefault(power, {})[tuple(rest)] = number
    of_names = ring.drop(s)
    return names, [of_names.from_dict(parts.get(power, {})) for power in range(max(parts, default=0) + 1)]


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
