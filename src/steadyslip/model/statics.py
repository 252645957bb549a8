"""The forces of steady sliding: what every spring carries, and how far surfaces that give are pressed together.

Friction and normal stresses are taken as known; the balance of forces of every coordinate, with everything moving at
its steady speed, is then linear in the displacements. It is solved exactly, so that what the structure alone decides
(the pull on a single block, the force in a chain of links) has no stiffness left in it.

Where bodies are held in several ways at once, as in the plane, the exact solution soon fills pages. Forces and
displacements are symbols of their own then, `Carried`, and their equations are solved in numbers at every operating
point.
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
from steadyslip.model.determinant import TooLong, determinant
from steadyslip.model.equations import Carried, Entries
from steadyslip.model.stand_ins import StandIns

LONGEST = 8
"""Terms that the determinant of a balance of forces may have for its exact solution to be worth having."""
UNHELD = "nothing holds some body of this machine in its place; give every body a link"
Lettered = Callable[..., sp.Symbol]


@dataclass(frozen=True)
class Statics:
    """Displacements from where springs are slack, and the integral of the controller, in steady sliding.

    `tensions` are forces of springs by the `id` of their element, where they are symbols of their own, with `carried`.
    """

    displacement: Mapping[str, sp.Expr]
    integral: sp.Expr
    tensions: Mapping[int, sp.Expr] = field(default_factory=dict)
    carried: Carried | None = None

    def tension(self, element: Element) -> sp.Expr:
        """Force of the spring of an element."""
        if id(element) in self.tensions:
            return self.tensions[id(element)]
        return element.stiffness * row_of(element.senses, self.displacement)


def row_of(row: Shares, values: Mapping[str, Any]) -> sp.Expr:
    """What a row makes of values of the coordinates, and of the load point where they have one."""
    return sp.Add(*(sp.sympify(coefficient) * values[name] for name, coefficient in row.items() if name in values))


@dataclass(frozen=True)
class Press:
    """Normal stress of a contact: `at_contact` where surfaces just touch, and its `slope` in their distance."""

    at_contact: sp.Expr
    slope: sp.Expr


def statics(
    mechanism: Mechanism, friction: Mapping[str, sp.Expr], normal: Mapping[str, Press], lettered: Lettered
) -> Statics:
    """Solve the balance of forces.

    Parameters
    ----------
    mechanism : Mechanism
    friction : dict of str to sympy.Symbol
        Steady friction stress of every contact.
    normal : dict of str to Press
    lettered : callable
        A symbol called by the first word, with an unused letter for the dotted name that is the second.
    """
    names = [one.name for one in mechanism.coordinates]
    places = {name: inner_symbol(f"place.{i}") for i, name in enumerate(names)}
    held = inner_symbol("held_back")
    integral = mechanism.integral
    unknowns = [*places.values(), *([held] if integral is not None else [])]
    stretched = {id(one): one.stiffness * row_of(one.senses, places) for one in mechanism.elements}
    equations = _balances(mechanism, friction, normal, places, held, stretched)
    found = _solved(equations, unknowns)
    if found is None:
        return _carried(mechanism, friction, normal, lettered)
    return Statics(dict(zip(names, found, strict=False)), found[-1] if integral is not None else sp.Integer(0))


def _balances(
    mechanism: Mechanism, friction: Mapping[str, sp.Expr], normal: Mapping[str, Press],
    places: Mapping[str, sp.Expr], held: sp.Expr, tensions: Mapping[int, sp.Expr],
) -> list[sp.Expr]:  # fmt: skip
    """What has to vanish: the error of the controller, where it is integrated, and the forces on every coordinate."""
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


def _carried(
    mechanism: Mechanism, friction: Mapping[str, sp.Expr], normal: Mapping[str, Press], lettered: Lettered
) -> Statics:
    """The same, with symbols for what is displaced and carried.

    The force of a stiff spring would be lost in the difference of the places of its ends, so that it is an unknown.
    """
    places = {
        one.name: lettered(f"displaced_{i:03d}", f"{one.name}.place", real=True)
        for i, one in enumerate(mechanism.coordinates)
    }
    springs = [one for one in mechanism.elements if one.stiffness != 0]
    tensions = {
        id(one): lettered(f"carried_{i:03d}", f"{one.name or 'controller'}.carried", real=True)
        for i, one in enumerate(springs)
    }
    held = lettered("carried_integral", "controller.integral", real=True)
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


def _solved(equations: list[sp.Expr], unknowns: list[sp.Symbol]) -> list[sp.Expr] | None:
    """The solution of linear equations, in lowest terms; None where it is too long to be written."""
    stand_ins = StandIns()
    nothing = dict.fromkeys(unknowns, sp.Integer(0))
    matrix = [[stand_ins.polynomial(derivative(sp.expand(e), u)) for u in unknowns] for e in equations]
    right = [[stand_ins.polynomial(-e.xreplace(nothing))] for e in equations]
    try:
        determinant([[{(0,): one} if one != 0 else {} for one in row] for row in matrix], LONGEST)
    except TooLong:
        return None
    symbols = sorted(_symbols(entry for row in (*matrix, *right) for entry in row), key=str)
    field = QQ.frac_field(*symbols) if symbols else QQ
    try:
        table, known = (
            DomainMatrix([[field.from_sympy(one) for one in row] for row in rows], (len(rows), len(rows[0])), field)
            for rows in (matrix, right)
        )
        found = table.lu_solve(known).to_Matrix()
    except (DMNonInvertibleMatrixError, ZeroDivisionError):
        raise NotAvailable(UNHELD) from None
    return [stand_ins.back(found[i, 0]) for i in range(len(unknowns))]


def _symbols(expressions: Iterable[sp.Expr]) -> set[sp.Symbol]:
    return {symbol for e in expressions for symbol in e.free_symbols}
