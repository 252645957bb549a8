"""Choice of the velocity variables of a Model, and all other velocities as functions of them.

Each contact has a preferred velocity variable w, such as ln v, in which its friction law is smooth; w replaces the
velocity of one coordinate that contributes to the slip. If the velocities of all these coordinates are already replaced
(a body on two contacts), the slip rate is a function of the other variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import sympy as sp

from steadyslip.core.caching import cached
from steadyslip.core.errors import InternalError
from steadyslip.core.expressions import asinh_exp, derivative, replaced
from steadyslip.core.symbols import inner_symbol
from steadyslip.model.equations import Contact, Coordinate, Model

W = inner_symbol("w", real=True)
_FIRST = ("logarithm", "asinh", "linear")  # order in which contacts choose a coordinate


@dataclass(frozen=True, eq=False)
class VelocityVariable:
    """Variable that is integrated in place of a contact's slip rate.

    Attributes
    ----------
    kind : str
        ``logarithm``, ``asinh`` or ``linear``.
    w : sympy.Symbol
    of_w : sympy.Expr
        Slip rate as a function of w and the memory variables.
    w_of_v : sympy.Expr
        w as a function of the slip rate and the memory variables.
    scale : sympy.Expr
        Slip rate in steady sliding, m/s.
    regularised : sympy.Expr or None
        The `asinh_exp` term of the regularised law, for kind ``asinh``.
    """

    kind: str
    w: sp.Symbol
    of_w: sp.Expr
    w_of_v: sp.Expr
    scale: sp.Expr
    regularised: sp.Expr | None = None


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Velocity variables, and all other velocities as functions of them.

    Attributes
    ----------
    variables : tuple of VelocityVariable or None
        One per contact; None if the slip rate is a function of other velocities.
    coordinates : tuple of Coordinate or None
        The coordinate whose velocity the contact's variable replaces; None if there is none.
    speeds : dict of sympy.Symbol to sympy.Expr
        Dependent velocities of coordinates and contacts, as functions of independent velocities and the load point's.
    """

    variables: tuple[VelocityVariable | None, ...]
    coordinates: tuple[Coordinate | None, ...]
    speeds: Mapping[sp.Symbol, sp.Expr]

    def contact_at(self, coordinate: Coordinate) -> int | None:
        """Index of the contact whose variable replaces the velocity of a coordinate; None if there is none."""
        return next((i for i, one in enumerate(self.coordinates) if one is coordinate), None)


@cached
def kinematics(model: Model) -> Kinematics:
    """Choose the velocity variables of a model."""
    wanted = [_variable(model, i) for i in range(len(model.contacts))]
    chosen: list[Coordinate | None] = [None] * len(wanted)
    free = {one.velocity: one for one in model.coordinates}
    speeds: dict[sp.Symbol, sp.Expr] = {}
    for i in sorted(range(len(wanted)), key=lambda i: _FIRST.index(wanted[i].kind)):
        velocity = model.contacts[i].velocity
        slip = sp.sympify(model.definitions.get(velocity, velocity)).xreplace(speeds)
        slip = sp.expand(slip) if slip is not velocity else slip
        moving = sorted((v for v in free if slip.has(v)), key=lambda v: free[v].inertial)
        if not moving:
            speeds[velocity] = slip
            continue
        chosen[i] = free.pop(moving[0])
        if moving[0] is not velocity:
            share = derivative(slip, moving[0])
            found = {moving[0]: (velocity - slip.xreplace({moving[0]: sp.Integer(0)})) / share}
            speeds = {v: e.xreplace(found) for v, e in speeds.items()} | found
    own = tuple(one if place is not None else None for one, place in zip(wanted, chosen, strict=True))
    return Kinematics(own, tuple(chosen), speeds)


def _variable(model: Model, index: int) -> VelocityVariable:
    """Preferred velocity variable of a contact: logarithm, asinh or linear."""
    contact = model.contacts[index]
    w = W if len(model.contacts) == 1 else inner_symbol(f"w_{index}", real=True)
    v, scale = contact.velocity, sp.sympify(model.steady[contact.velocity])
    everything = [contact.balance, *model.rates, *model.definitions.values()]
    for expression in (contact.balance, *model.definitions.values()):
        if _singular_at_rest(expression, v):
            return VelocityVariable("logarithm", w, scale * sp.exp(w), sp.log(v / scale), scale)
    primitives = {primitive for e in everything for primitive in e.atoms(asinh_exp) if primitive.has(v)}
    if len(primitives) == 1:
        own = primitives.pop()
        scaled, exponent = own.args
        factor = scaled / v
        reference = at_steady_stress(exponent, contact, model)
        memory = {item.symbol for item in contact.memory}
        if not factor.has(v) and not exponent.has(v) and reference.free_symbols & memory:
            of_w = sp.sinh(w) * sp.exp(-reference) / factor
            return VelocityVariable("asinh", w, of_w, asinh_exp(scaled, reference), scale, own)
    return VelocityVariable("linear", w, w, v, scale)


def at_steady_stress(exponent: sp.Expr, contact: Contact, model: Model) -> sp.Expr:
    """Exponent of the regularised law with τ and σ at their steady values."""
    return exponent.xreplace({stress: model.steady[stress] for stress in (contact.friction, contact.normal)})


def _singular_at_rest(expression: sp.Expr, v: sp.Symbol) -> bool:
    """True if an expression contains ln v, or a negative or fractional power of v."""
    for logarithm in expression.atoms(sp.log):
        if logarithm.has(v) and logarithm.args[0].xreplace({v: sp.Integer(0)}) == 0:
            return True
    return any(
        power.base.xreplace({v: sp.Integer(0)}) == 0 and not (power.exp.is_integer and power.exp.is_positive)
        for power in expression.atoms(sp.Pow)
        if power.base.has(v)
    )


def in_variables(expression: sp.Expr, found: Kinematics, model: Model) -> sp.Expr:
    """Rewrite an expression in the velocity variables, in which ln v and the regularised law's argument are linear."""
    expression = expression.xreplace(dict(found.speeds))
    for variable, contact in zip(found.variables, model.contacts, strict=True):
        if variable is not None:
            expression = _in_w(expression, variable, contact, model)
    return expression


def _in_w(expression: sp.Expr, variable: VelocityVariable, contact: Contact, model: Model) -> sp.Expr:
    v, w = contact.velocity, variable.w
    if variable.kind == "logarithm":

        def log_of(argument: sp.Expr) -> sp.Expr:
            rest = argument / v
            return sp.log(argument) if rest.has(v) else w + sp.log(variable.scale * rest)

        expression = expression.replace(sp.log, log_of).replace(sp.Abs, lambda a: a if (a / v).is_positive else abs(a))
        expression = expression.replace(
            lambda e: _is_product_with_sum(e, w), lambda product: sp.expand_mul(product, deep=False)
        )
    elif variable.regularised is not None:
        own, reference = variable.regularised.args

        def regularised(x: sp.Expr, y: sp.Expr) -> sp.Expr:
            if x != own:
                return asinh_exp(x, y)
            rest = y - at_steady_stress(reference, contact, model)
            return w if rest == 0 else asinh_exp(sp.sinh(w), rest)

        expression = expression.replace(asinh_exp, regularised)
    return expression.xreplace({v: variable.of_w})


def _is_product_with_sum(expression: sp.Expr, w: sp.Symbol) -> bool:
    """True for a factor times (w + constant), which must be expanded for terms to cancel."""
    if not expression.is_Mul or sum(factor.is_Add for factor in expression.args) != 1:
        return False
    return any(factor.is_Add and w in factor.args for factor in expression.args)


def solve_linear(residual: sp.Expr, unknown: sp.Symbol) -> sp.Expr | None:
    """Value of an unknown at which a residual is zero.

    None if the residual is nonlinear in it or does not contain it.
    """
    slope = derivative(residual, unknown)
    if slope.has(unknown) or slope == 0:
        return None
    return -residual.xreplace({unknown: sp.Integer(0)}) / slope


def solve_sequentially(
    equations: Iterable[tuple[sp.Expr, sp.Symbol]],
) -> tuple[dict[sp.Symbol, sp.Expr], list[tuple[sp.Expr, sp.Symbol]]]:
    """Solve each residual for its unknown in turn, and substitute the solution in all others.

    Returns the solutions, and the pairs whose residual is not linear in its unknown, with all solutions substituted.
    """
    found: dict[sp.Symbol, sp.Expr] = {}
    left: list[tuple[sp.Expr, sp.Symbol]] = []
    for residual, unknown in equations:
        here = replaced(residual, found)
        solution = solve_linear(here, unknown)
        if solution is None:
            left.append((here, unknown))
            continue
        found = {symbol: replaced(e, {unknown: solution}) for symbol, e in found.items()} | {unknown: solution}
    return found, [(replaced(residual, found), unknown) for residual, unknown in left]


def solve_jointly(equations: Iterable[sp.Expr], unknowns: Iterable[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    """Solve linear equations one by one, each for the first remaining unknown that it contains."""
    found: dict[sp.Symbol, sp.Expr] = {}
    left = list(unknowns)
    for residual in equations:
        here = replaced(residual, found)
        unknown = next((one for one in left if derivative(here, one) != 0), None)
        solution = None if unknown is None else solve_linear(here, unknown)
        if unknown is None or solution is None:
            raise InternalError("as many independent linear equations as unknowns")
        left.remove(unknown)
        found = {symbol: replaced(e, {unknown: solution}) for symbol, e in found.items()} | {unknown: solution}
    return found


def single_variable(variables: Iterable[VelocityVariable | None]) -> VelocityVariable:
    """The velocity variable of a slider's only contact."""
    (one,) = variables
    if one is None:
        raise InternalError("the only contact to have a velocity variable")
    return one
