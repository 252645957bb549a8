"""The forces of steady sliding: what every spring carries, and how far surfaces that give are pressed together.

Friction and normal stresses are taken as known; the balance of forces of every coordinate, with everything moving at
its steady speed, is then linear in the displacements. It is solved exactly, so that what the structure alone decides
(the pull on a single block, the force in a chain of links) has no stiffness left in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError

from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import derivative
from steadyslip.machine.mechanism import LOAD_POINT, Mechanism, Shares


@dataclass(frozen=True)
class Statics:
    """Displacements from where springs are slack, and the integral of the controller, in steady sliding."""

    displacement: Mapping[str, sp.Expr]
    integral: sp.Expr


class StandIns:
    """Symbols in place of whatever is no polynomial, so that exact arithmetic can be done with what is left."""

    def __init__(self) -> None:
        self.names: dict[sp.Symbol, sp.Expr] = {}
        self._known: dict[sp.Expr, sp.Symbol] = {}

    def whole(self, expression: sp.Expr) -> sp.Expr:
        """A symbol for an expression; numbers stay."""
        if expression.is_Number:
            return expression
        symbol = sp.Symbol(f"e{len(self.names)}")
        self.names[symbol] = expression
        return symbol

    def polynomial(self, expression: sp.Expr) -> sp.Expr:
        """A polynomial in parameters and in symbols for its other parts, the same for the same."""
        e = sp.sympify(expression)
        if e.is_Symbol or e.is_Rational:
            return e
        if e.is_Add or e.is_Mul:
            return e.func(*(self.polynomial(part) for part in e.args))
        if e.is_Pow and e.exp.is_Integer and e.exp.is_positive:
            return self.polynomial(e.base) ** e.exp
        if e not in self._known:
            self._known[e] = self.whole(e)
        return self._known[e]

    def back(self, expression: sp.Expr) -> sp.Expr:
        """The expression that a result stands for."""
        return expression.xreplace(self.names)


def row_of(row: Shares, values: Mapping[str, Any]) -> sp.Expr:
    """What a row makes of values of the coordinates, and of the load point where they have one."""
    return sp.Add(*(sp.sympify(coefficient) * values[name] for name, coefficient in row.items() if name in values))


def statics(
    mechanism: Mechanism, friction: Mapping[str, sp.Expr], normal: Mapping[str, tuple[sp.Expr, sp.Expr]]
) -> Statics:
    """Solve the balance of forces.

    Parameters
    ----------
    mechanism : Mechanism
    friction : dict of str to sympy.Expr
        Steady friction stress of every contact.
    normal : dict of str to (sympy.Expr, sympy.Expr)
        Normal stress where surfaces just touch, and its slope in their distance.
    """
    names = [one.name for one in mechanism.coordinates]
    speeds = {one.name: sp.sympify(one.speed) for one in mechanism.coordinates} | {LOAD_POINT: mechanism.velocity}
    places = {name: sp.Symbol(f"place_{i}") for i, name in enumerate(names)}
    held = sp.Symbol("held_back")
    integral = mechanism.integral
    unknowns = [*places.values(), *([held] if integral is not None else [])]
    equations = [] if integral is None else [row_of(integral.senses, places)]
    for one in mechanism.coordinates:
        total = sp.sympify(one.force)
        for element in mechanism.elements:
            share = element.acts.get(one.name, 0)
            stretched = element.stiffness * row_of(element.senses, places)
            total -= share * (stretched + element.damping * row_of(element.senses, speeds))
        if integral is not None:
            total -= integral.acts.get(one.name, 0) * integral.gain * held
        for touch in mechanism.touches:
            at_touch, slope = normal[touch.name]
            total -= touch.slip.get(one.name, 0) * touch.area * friction[touch.name]
            pressed = at_touch + slope * row_of(touch.separation, places)
            total += touch.separation.get(one.name, 0) * touch.area * pressed
        equations.append(total)
    found = _solved(equations, unknowns)
    return Statics(dict(zip(names, found, strict=False)), found[-1] if integral is not None else sp.Integer(0))


def _solved(equations: list[sp.Expr], unknowns: list[sp.Symbol]) -> list[sp.Expr]:
    """The solution of linear equations, in lowest terms."""
    stand_ins = StandIns()
    nothing = dict.fromkeys(unknowns, sp.Integer(0))
    matrix = [[stand_ins.polynomial(derivative(sp.expand(e), u)) for u in unknowns] for e in equations]
    right = [[stand_ins.polynomial(-e.xreplace(nothing))] for e in equations]
    symbols = sorted(_symbols(entry for row in (*matrix, *right) for entry in row), key=str)
    field = QQ.frac_field(*symbols) if symbols else QQ
    try:
        table, known = (
            DomainMatrix([[field.from_sympy(one) for one in row] for row in rows], (len(rows), len(rows[0])), field)
            for rows in (matrix, right)
        )
        found = table.lu_solve(known).to_Matrix()
    except (DMNonInvertibleMatrixError, ZeroDivisionError):
        raise NotAvailable("nothing holds some body of this machine in its place; give every body a link") from None
    return [stand_ins.back(found[i, 0]) for i in range(len(unknowns))]


def _symbols(expressions: Iterable[sp.Expr]) -> set[sp.Symbol]:
    return {symbol for e in expressions for symbol in e.free_symbols}
