"""Statics of steady sliding: forces of springs, and displacements of compliant contacts.

With given friction and normal stresses, the balances of forces at steady speeds are linear in the displacements. They
are solved exactly, so that stiffnesses cancel in forces that do not depend on them (the pull on a single block, the
force in a chain of links).

If bodies are supported by several links each, as in the plane, the exact solution is too long. Forces and displacements
are then symbols (`Carried`), and their equations are solved numerically at every operating point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.core.symbols import inner_symbol
from steadyslip.machine.mechanism import LOAD_POINT, Element, Mechanism, Shares
from steadyslip.model.determinant import Placeholders, TooManyTerms, determinant
from steadyslip.model.equations import Carried, Entries

MAX_TERMS = 8
"""Largest number of terms of the determinant for which the statics are solved symbolically; chosen by trial."""
UNHELD = "nothing holds some body of this machine in its place; give every body a link"
SymbolFactory = Callable[..., sp.Symbol]


@dataclass(frozen=True)
class Statics:
    """Displacements from the unstressed state of springs, and integral of the controller, in steady sliding.

    Without a symbolic solution, `tensions` are symbols of spring forces by `id` of the element, and `carried` has the
    equations that determine them.
    """

    displacement: Mapping[str, sp.Expr]
    integral: sp.Expr
    tensions: Mapping[int, sp.Expr] = field(default_factory=dict)
    carried: Carried | None = None

    def tension(self, element: Element) -> sp.Expr:
        """Force of an element's spring."""
        if id(element) in self.tensions:
            return self.tensions[id(element)]
        return element.stiffness * row_of(element.senses, self.displacement)


def row_of(row: Shares, values: Mapping[str, Any]) -> sp.Expr:
    """Sum of `values` of coordinates times their coefficients in `row`; coordinates without a value count as zero."""
    return sp.Add(*(sp.sympify(coefficient) * values[name] for name, coefficient in row.items() if name in values))


@dataclass(frozen=True)
class NormalStress:
    """Normal stress of a contact, linear in the distance: value at first touch (Pa), and slope (Pa/m)."""

    at_contact: sp.Expr
    slope: sp.Expr


def statics(
    mechanism: Mechanism,
    friction: Mapping[str, sp.Expr],
    normal: Mapping[str, NormalStress],
    make_symbol: SymbolFactory,
) -> Statics:
    """Solve the balances of forces in steady sliding.

    Parameters
    ----------
    mechanism : Mechanism
    friction : dict of str to sympy.Symbol
        Steady friction stress of each contact.
    normal : dict of str to NormalStress
    make_symbol : callable
        Function that makes a symbol from its name and the dotted name of which its letter is made: `Letters.symbol`.
    """
    names = [one.name for one in mechanism.coordinates]
    places = {name: inner_symbol(f"place.{i}") for i, name in enumerate(names)}
    held = inner_symbol("held_back")
    integral = mechanism.integral
    unknowns = [*places.values(), *([held] if integral is not None else [])]
    stretched = {id(one): one.stiffness * row_of(one.senses, places) for one in mechanism.elements}
    equations = _balances(mechanism, friction, normal, places, held, stretched)
    found = _solve(equations, unknowns)
    if found is None:
        return _with_symbolic_forces(mechanism, friction, normal, make_symbol)
    return Statics(dict(zip(names, found, strict=False)), found[-1] if integral is not None else sp.Integer(0))


def _balances(
    mechanism: Mechanism, friction: Mapping[str, sp.Expr], normal: Mapping[str, NormalStress],
    places: Mapping[str, sp.Expr], held: sp.Expr, tensions: Mapping[int, sp.Expr],
) -> list[sp.Expr]:  # fmt: skip
    """Residuals of the statics: the controller's error, if there is a controller, then the force on every
    coordinate."""
    integral = mechanism.integral
    speeds = {one.name: sp.sympify(one.speed) for one in mechanism.coordinates} | {LOAD_POINT: mechanism.velocity}
    equations = [] if integral is None else [row_of(integral.senses, places)]
    for one in mechanism.coordinates:
        total = sp.sympify(one.force)
        for element in mechanism.elements:
            share = element.acts.get(one.name, 0)
            total -= share * (tensions[id(element)] + element.damping * row_of(element.senses, speeds))
        if integral is not None:
            total -= integral.acts.get(one.name, 0) * integral.gain * held
        for port in mechanism.contacts:
            own = normal[port.name]
            total -= port.slip.get(one.name, 0) * port.area * friction[port.name]
            pressed = own.at_contact + own.slope * row_of(port.separation, places)
            total += port.separation.get(one.name, 0) * port.area * pressed
        equations.append(total)
    return equations


def _with_symbolic_forces(
    mechanism: Mechanism,
    friction: Mapping[str, sp.Expr],
    normal: Mapping[str, NormalStress],
    make_symbol: SymbolFactory,
) -> Statics:
    """Statics with symbols for displacements and spring forces, and their linear equations.

    Spring forces are unknowns because the force of a stiff spring would be lost in the difference of displacements.
    """
    places = {
        one.name: make_symbol(f"displaced_{i:03d}", f"{one.name}.place", real=True)
        for i, one in enumerate(mechanism.coordinates)
    }
    springs = [one for one in mechanism.elements if one.stiffness != 0]
    tensions = {
        id(one): make_symbol(f"carried_{i:03d}", f"{one.name or 'controller'}.carried", real=True)
        for i, one in enumerate(springs)
    }
    held = make_symbol("carried_integral", "controller.integral", real=True)
    every = {id(one): sp.Integer(0) for one in mechanism.elements} | tensions
    equations = _balances(mechanism, friction, normal, places, held, every)
    equations += [row_of(one.senses, places) - tensions[id(one)] / one.stiffness for one in springs]
    unknowns = [*places.values(), *([held] if mechanism.integral is not None else []), *tensions.values()]
    frictions = [*friction.values()]
    stresses = [own.at_contact if own.slope == 0 else None for own in normal.values()]
    nothing = dict.fromkeys((*unknowns, *frictions, *filter(None, stresses)), sp.Integer(0))

    def slopes(along: Sequence[sp.Symbol | None], sign: int) -> Entries:
        both = ((i, j, e, s) for i, e in enumerate(equations) for j, s in enumerate(along))
        known = {(i, j): sign * derivative(e, s) for i, j, e, s in both if s is not None and e.has(s)}
        return {place: e for place, e in known.items() if e != 0}

    carried = Carried(
        tuple(unknowns), slopes([*unknowns], 1), tuple(-e.xreplace(nothing) for e in equations),
        slopes(frictions, -1), slopes(stresses, -1),
    )  # fmt: skip
    return Statics(places, held if mechanism.integral is not None else sp.Integer(0), every, carried)


def _solve(equations: list[sp.Expr], unknowns: list[sp.Symbol]) -> list[sp.Expr] | None:
    """Exact solution of linear equations, in lowest terms; None if it would be too long."""
    placeholders = Placeholders()
    nothing = dict.fromkeys(unknowns, sp.Integer(0))
    matrix = [[placeholders.polynomial(derivative(sp.expand(e), u)) for u in unknowns] for e in equations]
    right = [[placeholders.polynomial(-e.xreplace(nothing))] for e in equations]
    try:
        determinant([[{(0,): one} if one != 0 else {} for one in row] for row in matrix], MAX_TERMS)
    except TooManyTerms:
        return None
    symbols = sorted(_free_symbols(entry for row in (*matrix, *right) for entry in row), key=str)
    ring = QQ[tuple(symbols)] if symbols else QQ
    field = ring.get_field()
    table, known = (
        DomainMatrix([[ring.from_sympy(one) for one in row] for row in rows], (len(rows), len(rows[0])), ring)
        for rows in (matrix, right)
    )
    try:  # as polynomials over a common denominator; cancelling quotients at every step takes a thousand times as long
        tops, below = table.solve_den(known, method="rref")
    except (DMNonInvertibleMatrixError, ZeroDivisionError):
        raise NotAvailable(UNHELD) from None
    found = [field.convert_from(top, ring) / field.convert_from(below, ring) for top in tops.to_list_flat()]
    return [placeholders.restored(field.to_sympy(one)) for one in found]


def _free_symbols(expressions: Iterable[sp.Expr]) -> set[sp.Symbol]:
    return {symbol for e in expressions for symbol in e.free_symbols}
