"""Symbolic linearisation of a Model at steady sliding, and its characteristic polynomial.

Balances and rates are differentiated; the intermediate stresses T, τ, σ are eliminated by the chain rule, so every
entry is a function of the parameters and the steady normal stresses. The characteristic polynomial (with delays a sum
of several), its split p(s) + k q(s) and state-space matrices follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.model.determinant import (
    Placeholders,
    Polynomial,
    TooManyTerms,
    determinant,
    machine_determinant,
    sum_of_terms,
    without_cancellation,
)
from steadyslip.model.equations import Model

Gradient = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True)
class Term:
    """Polynomial in s times exp(−s delay) for each delay in `late`; coefficients with the lowest power first."""

    late: tuple[sp.Expr, ...]
    coefficients: tuple[sp.Expr, ...]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Gradients of the equations of a Model at steady sliding.

    Attributes
    ----------
    columns : tuple of sympy.Symbol
        Displacements, velocities, memory variables, integral, unknown friction stresses, kept stresses.
    rows : dict
        Gradients with respect to columns, accelerations, delayed symbols and inputs, one for each column: for a
        variable the gradient of its rate; for a velocity, of the balance of forces; for a friction stress, of its law
        minus the stress; for a kept stress, of its definition minus the stress.
    outputs : dict
        Gradients of the observables.
    """

    model: Model
    columns: tuple[sp.Symbol, ...]
    rows: dict[sp.Symbol, Gradient]
    outputs: dict[str, Gradient]


@cached
def linearise(model: Model, kept: tuple[sp.Symbol, ...] = ()) -> Linearisation:
    """Linearise a Model at steady sliding.

    The intermediate stresses in `kept` remain unknowns, others are eliminated.
    """
    velocities = {one.displacement: one.velocity for one in model.coordinates}
    columns: dict[sp.Symbol, None] = {}
    for item in model.variables:  # velocities of massless bodies are columns too, though they are no variables
        columns |= {item.symbol: None} | ({velocities[item.symbol]: None} if item.symbol in velocities else {})
    columns |= dict.fromkeys(contact.friction for contact in model.contacts if contact.unknown is contact.friction)
    inputs = [s for name, s in model.inputs.items() if name != "time"]
    columns |= dict.fromkeys(kept)
    basis = [*columns, *(one.acceleration for one in model.coordinates), *model.late, *inputs]
    intermediate: dict[sp.Symbol, Gradient] = {}

    def gradient(expression: sp.Expr) -> Gradient:
        """Total derivative with respect to the basis, at steady sliding."""
        total: Gradient = {}
        free = expression.free_symbols
        for name in basis:
            value = model.at_steady(derivative(expression, name)) if name in free else sp.Integer(0)
            for middle, row in intermediate.items():
                if middle in free and row.get(name, 0) != 0:
                    value += model.at_steady(derivative(expression, middle)) * row[name]
            total[name] = value
        return total

    for name, definition in model.definitions.items():
        if name not in kept:
            intermediate[name] = gradient(definition)
    rows = {symbol: gradient(rate) for symbol, rate in model.rate_of.items()}
    balances = {one.velocity: one.balance for one in model.coordinates if one.balance is not None}
    balances |= {c.friction if c.unknown is c.friction else c.velocity: c.balance for c in model.contacts}
    balances |= {symbol: model.definitions[symbol] - symbol for symbol in kept}
    rows |= {symbol: gradient(balance) for symbol, balance in balances.items()}
    outputs = {name: gradient(expression) for name, (expression, _) in model.observables.items()}
    return Linearisation(model, tuple(columns), rows, outputs)


@cached
def characteristic_coefficients(model: Model) -> tuple[sp.Expr, ...]:
    """Coefficients of the characteristic polynomial in s, lowest power first (theory 3: a0, a1, ...).

    With inertia the highest coefficient is m + f1 B0 times a positive factor; it may be 0 for m = 0. Terms that cancel
    for all values of stiffnesses and inertias of several bodies have cancelled exactly.

    Raises
    ------
    NotAvailable
        If there are delays (use `characteristic_terms`), or if `is_written_out` is False.
    """
    if model.delays:
        raise NotAvailable("this is not offered with a delay, whose characteristic equation is no polynomial")
    return characteristic_terms(model)[0].coefficients


@cached
def characteristic_terms(model: Model) -> tuple[Term, ...]:
    """Terms of the characteristic equation: polynomials in s times exp(−s delay), first the term without delay.

    Each delay occurs at most once as a factor, because a delayed controller or contact exerts a single force.

    Raises
    ------
    NotAvailable
        If `is_written_out` is False.
    """
    found = _determinant(model)
    if found is None:
        raise NotAvailable(
            f"this is not available for a machine of {len(model.coordinates)} coordinates with so many links: its "
            "characteristic polynomial would fill pages"
        )
    highest = max((powers[0] for powers in found), default=0)
    nothing = (0,) * len(model.delays)
    lates = sorted({powers[1:] for powers in found} | {nothing}, key=lambda late: (sum(late), late))
    return tuple(
        Term(
            tuple(delay for power, delay in zip(late, model.delays, strict=True) if power),
            tuple(found.get((power, *late), sp.Integer(0)) for power in range(highest + 1)),
        )
        for late in lates
    )


@cached
def _determinant(model: Model) -> Polynomial | None:
    """Characteristic determinant; None if it has too many terms."""
    if model.is_single:
        return _single_determinant(model)
    try:
        tensions = _loading_tensions(model)
        return machine_determinant(model, characteristic_rows(model, tensions), tensions)
    except TooManyTerms:
        return None


def _loading_tensions(model: Model) -> tuple[sp.Symbol, ...]:
    """Forces of links (as stresses) on which the normal stress or the friction of a contact depends.

    The force of such a link acts on a contact and on the bodies that the link joins. If the force is an unknown of the
    determinant, terms of contact and bodies that cancel for every stiffness of the link cancel exactly.
    """
    springs = [contact.spring for contact in model.contacts if contact.spring in model.definitions]
    using = [e for symbol, e in model.definitions.items() if symbol not in springs]
    using += [contact.balance for contact in model.contacts] + list(model.rates)
    return tuple(spring for spring in springs if any(sp.sympify(e).has(spring) for e in using))


def is_written_out(model: Model) -> bool:
    """True if symbolic `characteristic_terms` exist; large machines have numbers only (`model.eigenvalues`)."""
    return _determinant(model) is not None


@cached
def delays_of_terms(model: Model) -> list[tuple[sp.Expr, ...]]:
    """Delays (s) of each term of the characteristic equation, first of the term without delay."""
    return [term.late for term in characteristic_terms(model)] if is_written_out(model) else sets_of_delays(model)


def sets_of_delays(model: Model) -> list[tuple[sp.Expr, ...]]:
    """All subsets of the delays, the empty set first."""
    return [late for count in range(len(model.delays) + 1) for late in combinations(model.delays, count)]


def _single_determinant(model: Model) -> Polynomial:
    rows = characteristic_rows(model)
    if exact := without_cancellation(list(rows.values())):
        return exact
    placeholders = Placeholders()
    own, body = placeholders.symbol_for, model.coordinates[0].velocity
    matrix = [
        [{power: own(e) if name == body else -own(-e) for power, e in entry.items()} for entry in row]
        for name, row in rows.items()
    ]  # fmt: skip
    names, found = determinant(matrix)
    return {powers: placeholders.restored(sum_of_terms(terms, names)) for powers, terms in found.items()}


@cached
def characteristic_rows(model: Model, kept: tuple[sp.Symbol, ...] = ()) -> dict[sp.Symbol, list[Polynomial]]:
    """Rows of the characteristic matrix; each entry is a dict of coefficients by exponents of s and exp(−s delay).

    Columns are displacements, memory variables, integral, unknown friction stresses and the stresses `kept`. Rows,
    named as in `Linearisation`, are balances of forces, s times variables minus their rates, and stresses minus their
    laws.
    """
    linear = linearise(model, kept)
    bodies = {one.displacement: one for one in model.coordinates}
    places = {one.velocity: one.displacement for one in model.coordinates}
    stresses = {contact.friction for contact in model.contacts}.union(kept)
    columns = [symbol for symbol in linear.columns if symbol not in places]
    late = [
        (symbol, places.get(base, base), (int(base in places), *(int(delay == own) for own in model.delays)))
        for symbol, (base, delay) in model.late.items()
    ]
    nothing = (0,) * len(model.delays)
    found = {}
    for column in columns:
        row_symbol = bodies[column].velocity if column in bodies else column
        row = linear.rows[row_symbol]
        # signs: inertia minus forces, friction stress minus its law, s times a variable minus its rate
        sign = 1 if column in bodies and (bodies[column].balance is not None or model.is_single) else -1
        entries = []
        for other in columns:
            body = bodies.get(other)
            parts = {(0, *nothing): row[other]}
            if body is not None:
                parts |= {(1, *nothing): row[body.velocity], (2, *nothing): row[body.acceleration]}
            parts |= {powers: row[symbol] for symbol, base, powers in late if base is other}
            entry = {powers: sign * e for powers, e in parts.items()}
            if other is column and column not in bodies and column not in stresses:
                entry[(1, *nothing)] = entry.get((1, *nothing), sp.Integer(0)) + 1
            entries.append({powers: e for powers, e in entry.items() if e != 0})
        found[row_symbol] = entries
    return found


@cached
def stiffness_split(model: Model) -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """Split the characteristic polynomial into p(s) + k q(s); coefficients of p and q, lowest power first.

    The split is exact, because the slider's stiffness k enters by a term of rank one.
    """
    symbol = model.parameters["slider.stiffness"]
    coefficients = characteristic_coefficients(model)
    without = tuple(c.xreplace({symbol: sp.Integer(0)}) for c in coefficients)
    slope = tuple(derivative(c, symbol) for c in coefficients)
    return without, slope
