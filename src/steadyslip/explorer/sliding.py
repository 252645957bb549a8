"""Programs for steady sliding on a page: steady normal stresses σss of all contacts, or their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from steadyslip.core.expressions import derivative
from steadyslip.explorer.programs import program
from steadyslip.kernels.nodes import Node, Program, Value, as_node, select
from steadyslip.model.equations import Model
from steadyslip.model.sliding import REFERENCE, friction_coefficient
from steadyslip.model.steady import JointEquation, joint_equation, steady_equation

Rows = list[list[Value | None]]  # matrix of nodes; None is zero
VALUES_PER_CONTACT = 5  # number of values of program `steady` for each contact


def needs_search(model: Model) -> list[bool]:
    """For each contact True if its steady normal stress has no formula and must be found by a root search."""
    if joint_equation(model) is not None:
        return [False] * len(model.contacts)
    return [not steady_equation(model, place).affine for place in range(len(model.contacts))]


def steady_programs(model: Model) -> list[Program]:
    """Program ``steady``, and ``residual0``, ``residual1``, ... of the contacts whose σss must be searched.

    ``steady`` stores `VALUES_PER_CONTACT` values per contact: σss (NaN if there is none), slope of the normal stress,
    load left, steady load and friction coefficient. For contacts that press on each other it stores all σss, then the
    coefficients of the characteristic polynomial of their coupling matrix A, lowest power first.
    """
    joint = joint_equation(model)
    if joint is not None:
        return [_joint_program(model, joint)]
    searched = needs_search(model)
    formulas = [
        one
        for place, look in enumerate(searched)
        for one in ([0] * VALUES_PER_CONTACT if look else _formula(model, place))
    ]
    residuals = [
        program(model, f"residual{place}", [contact.steady_stress - contact.sigma_ss])
        for place, contact in enumerate(model.contacts)
        if searched[place]
    ]
    return [program(model, "steady", formulas), *residuals]


def _formula(model: Model, place: int) -> list[sp.Expr]:
    equation = steady_equation(model, place)
    sigma, slope = sp.sympify(equation.sigma), sp.sympify(equation.slope)
    exists = sp.And(slope < 1, sp.StrictGreaterThan(sigma, 0, evaluate=False))
    left = sigma if equation.given else sigma * (1 - slope)
    own = model.contacts[place].steady_load
    friction = friction_coefficient(model, place).subs({contact.sigma_ss: REFERENCE for contact in model.contacts})
    return [sp.Piecewise((sigma, exists), (sp.nan, True)), slope, left, left if own is None else own, friction]


def _joint_program(model: Model, joint: JointEquation) -> Program:
    """Program that solves σ = A σ + b by Cramer's rule, and stores σ, then the characteristic polynomial of A.

    With `JointEquation.bends` it chooses the solution as `JointEquation.solve` does.
    """
    n = joint.size
    sigmas = [contact.sigma_ss for contact in model.contacts]
    nothing = dict.fromkeys(sigmas, sp.Integer(0))
    inner = [e for one in joint.bends.inner for e in (*(derivative(one, s) for s in sigmas), one.xreplace(nothing))]
    equations = [*(e for row in joint.matrix for e in row), *joint.rest, *inner]
    patterns = joint.bends.patterns
    wanted = [
        sp.sympify(e).xreplace(dict(zip(joint.bends.signs, map(int, signs), strict=True)))
        for signs in patterns
        for e in equations
    ]
    many = len(equations)
    shapes = [wanted[k * many : (k + 1) * many] for k in range(len(patterns))]

    def solved(found: list[Node]) -> Sequence[Value]:
        chosen: list[Value] = []
        settled: Any = False
        for k, signs in enumerate(patterns):
            values: list[Value | None] = [
                None if e == 0 else v for e, v in zip(shapes[k], found[k * many :], strict=False)
            ]
            outcome, holds = _solution(values, n, signs)
            takes = holds & ~settled if k else True
            chosen = [select(takes, value, old) for value, old in zip(outcome, chosen or outcome, strict=True)]
            settled = holds | settled if k else holds
        return chosen

    return program(model, "steady", wanted, then=solved)


def _solution(values: list[Value | None], n: int, signs: Sequence[float]) -> tuple[list[Value], Any]:
    """Solution of σ = A σ + b and characteristic polynomial of A; node that is true if it agrees with `signs`."""
    a: Rows = [values[i * n : (i + 1) * n] for i in range(n)]
    right = values[n * n : n * n + n]
    left: Rows = [[_difference(1.0 if i == j else None, a[i][j]) for j in range(n)] for i in range(n)]
    whole = _determinant(left)
    sigmas: list[Value] = []
    for column in range(n):
        above = _determinant([[right[i] if j == column else left[i][j] for j in range(n)] for i in range(n)])
        sigmas.append(float("nan") if whole is None else 0.0 if above is None else above / whole)
    outcome = [*sigmas, *characteristic_polynomial(a)]
    if not signs:
        return outcome, True
    holds: Any = as_node(0.0 if whole is None else whole) > 0
    for sigma in sigmas:
        holds = holds & (as_node(sigma) > 0)
    for place, sign in enumerate(signs, start=n):
        *slopes, inner = values[place * (n + 1) : (place + 1) * (n + 1)]
        for slope, sigma in zip(slopes, sigmas, strict=True):
            inner = _sum(inner, _product(slope, sigma))
        holds = holds & (sign * as_node(0.0 if inner is None else inner) >= 0)
    return outcome, holds


def _sum(one: Value | None, other: Value | None) -> Value | None:
    return other if one is None else one if other is None else one + other


def _difference(one: Value | None, other: Value | None) -> Value | None:
    return one if other is None else -other if one is None else one - other


def _product(one: Value | None, other: Value | None) -> Value | None:
    return None if one is None or other is None else one * other


def _determinant(rows: Rows) -> Value | None:
    """Determinant of a matrix of nodes, by expansion along the first row; None stands for zero."""
    if not rows:
        return 1.0
    total: Value | None = None
    for j, entry in enumerate(rows[0]):
        term = None if entry is None else _product(entry, _determinant([row[:j] + row[j + 1 :] for row in rows[1:]]))
        total = _difference(total, term) if j % 2 else _sum(total, term)
    return total


def characteristic_polynomial(a: Rows) -> list[Value]:
    """Coefficients of det(λ − A), lowest power first, by the method of Faddeev and LeVerrier."""
    n = len(a)
    coefficients: list[Value | None] = [1.0]
    m: Rows = [[None] * n for _ in range(n)]
    for k in range(1, n + 1):
        m = [[_product_entry(a, m, i, j) for j in range(n)] for i in range(n)]
        for i in range(n):
            m[i][i] = _sum(m[i][i], coefficients[0])
        trace: Value | None = None
        for i in range(n):
            trace = _sum(trace, _product_entry(a, m, i, i))
        coefficients.insert(0, None if trace is None else -trace / float(k))
    return [0.0 if one is None else one for one in coefficients]


def _product_entry(a: Rows, b: Rows, i: int, j: int) -> Value | None:
    total: Value | None = None
    for k in range(len(a)):
        total = _sum(total, _product(a[i][k], b[k][j]))
    return total
