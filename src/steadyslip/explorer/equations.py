"""The linear part of a rig's Model as programs: functions of its parameters and the steady normal stress.

Each program reads the record R, the parameters in the Model's order and behind them σss, and writes the array y.
`web/linear.js` asks them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.records import conditions, twin
from steadyslip.kernels.nodes import Node, Program, Value, as_node, select
from steadyslip.kernels.printers import javascript
from steadyslip.kernels.source import Formulas
from steadyslip.linear import crossing, cubic
from steadyslip.linear.boundary import present_zeros
from steadyslip.linear.response import has_closed_form, response
from steadyslip.linear.status import ON_THE_EDGE
from steadyslip.linear.stiffness import interval_ingredients
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_coefficients, stiffness_split
from steadyslip.model.sliding import observed_in_steady_sliding
from steadyslip.model.steady import GRID, SOLVED, steady_equation

Then = Callable[[list[Node]], Sequence[Value]]


def model_of(rig: Slider) -> Model:
    """The rig's Model with what a page can vary from zero kept in it."""
    return build_model(rig, present_zeros(rig))


def program(
    model: Model, name: str, expressions: Sequence[Any], number: sp.Symbol | None = None, then: Then | None = None
) -> Program:
    """Expressions in the Model's parameters, σss and perhaps one number more as a program.

    What `then` makes of their values is stored instead of them, if it is given.

    Raises
    ------
    NotAvailable
        If an expression contains what cannot be printed; it is named.
    """
    made = Program(name)
    names = {symbol: f"p{i}" for i, symbol in enumerate(model.arguments)}
    if number is not None:
        names[number] = "number"
    formulas = Formulas(expressions, names)
    values = {n: made.load(i) for i, n in enumerate(names.values()) if n in formulas.symbols and n != "number"}
    values["number"] = made.number
    found = list(map(as_node, formulas(values)))
    for place, value in enumerate(found if then is None else then(found)):
        made.store(place, value, "y")
    return made


def linear_part(rig: Slider) -> tuple[str, dict[str, Any]]:
    """The linear part as an expression of JavaScript, and what must be known about it.

    Returns
    -------
    text : str
        An object of functions.
    facts : dict
        ``parameters`` (dotted names in the order of R), ``affine`` (whether `steady` gives σss; else `residual` is to
        be solved), ``degree`` of the characteristic polynomial, ``closed`` (whether the `interval` of the closed form
        exists), ``edge`` (what rounding alone can make), ``grid`` (how many stresses steady sliding is searched on, and
        the powers of ten that it runs from and to), ``solved`` (misfit of a root as a share of the stress),
        ``observed`` (names, units and meanings of what `observables` gives).
    """
    model = model_of(rig)
    equation = steady_equation(model)
    coefficients = characteristic_coefficients(model)
    without, slope = stiffness_split(model)
    names, observables = observed_in_steady_sliding(model)
    closed, meanings = (
        has_closed_form(model),
        {"spring_stress": "with the damping to the ground", **rig.friction.meanings()},
    )
    programs = [
        _steady(model) if equation.affine else program(model, "residual", [_mismatch(model)]),
        program(model, "allowed", [_allowed(rig, model)]),
        program(model, "coefficients", coefficients, then=_judged),
        program(model, "split", [*without, *slope]),
        program(model, "statics", _static_terms(model), then=lambda terms: [crossing.share_left(terms, select)]),
        program(model, "observables", observables),
        program(model, "stiffness", [model.axial_share or 1, model.gain]),
    ]
    if closed:
        programs.append(program(model, "interval", interval_ingredients(model), then=_interval))
    else:
        programs += _stable_set(len(coefficients) - 1)
    facts = {
        "parameters": list(model.parameters),
        "affine": equation.affine,
        "degree": len(coefficients) - 1,
        "squares": 0 if closed else len(programs[-3].stores) - 2,
        "closed": closed,
        "edge": ON_THE_EDGE,
        "grid": [len(GRID), float(np.log10(GRID[0])), float(np.log10(GRID[-1]))],
        "solved": SOLVED,
        "observed": [[name, model.observables[name][1], meanings.get(name, "")] for name in names],
    }
    text = "".join(javascript.text(one) for one in programs)
    return f"(() => {{\n{text}return {{ {', '.join(one.name for one in programs)} }};\n}})()", facts


def _steady(model: Model) -> Program:
    """σss (NaN where there is none), its coupling and its load, where that is a formula."""
    equation = steady_equation(model)
    sigma, slope = sp.sympify(equation.sigma), sp.sympify(equation.slope)
    exists = sp.And(slope < 1, sp.StrictGreaterThan(sigma, 0, evaluate=False))
    load = sigma if equation.given else sigma * (1 - slope)
    return program(model, "steady", [sp.Piecewise((sigma, exists), (sp.nan, True)), slope, load])


def _static_terms(model: Model) -> list[sp.Expr]:
    """What adds up to the static stiffness, as `steadyslip.linear.status.on_edge` takes it."""
    if has_closed_form(model):
        part = response(model)
        return [part.k, part.mu * part.k * part.B2, part.mu * part.B3]
    without, slope = stiffness_split(model)
    return [without[0], model.parameters["slider.stiffness"] * slope[0]]


def _judged(c: list[Node]) -> list[Value]:
    """Coefficients, and behind them whether all roots are on the left, and whether the equations are ill-posed."""
    truths = crossing.is_hurwitz(c, select), crossing.is_ill_posed(c)
    return [*c, *(select(truth, 1.0, 0.0) for truth in truths)]


def _stable_set(degree: int) -> list[Program]:
    """Where p + k q may change: real edges and the polynomial in β²; k of a root of it; the verdict at any k.

    These read the coefficients of p and q from a record of their own.
    """

    def edges(p: list[Node], q: list[Node], _: Node) -> list[Value]:
        return [*crossing.real_edges(p, q, select), *crossing.axis_polynomial(p, q, select)]

    def on_axis(p: list[Node], q: list[Node], square: Node) -> list[Value]:
        return [crossing.stiffness_on_axis(p, q, square)]

    def stable_at(p: list[Node], q: list[Node], k: Node) -> list[Value]:
        both = [one + k * other for one, other in zip(p, q, strict=True)]
        return [select(crossing.is_hurwitz(both, select), 1.0, 0.0)]

    found = []
    for name, values in (("edges", edges), ("onAxis", on_axis), ("stableAt", stable_at)):
        made = Program(name)
        p, q = ([made.load(start + i) for i in range(degree + 1)] for start in (0, degree + 1))
        for place, value in enumerate(values(p, q, made.number)):
            made.store(place, value, "y")
        found.append(made)
    return found


def _interval(ingredients: list[Node]) -> Sequence[Value]:
    """Ends of the stable interval in closed form, NaN where there is none."""
    numerator, denominator, mu_b2, mu_b3, a2, a3, gain = ingredients
    low, high = cubic.stable_interval(numerator, denominator, mu_b2, mu_b3, a2, a3, select)
    return cubic.without_gain(low, high, gain, select)


def _mismatch(model: Model) -> sp.Expr:
    return model.contact.steady_stress - model.contact.sigma_ss


def _allowed(rig: Slider, model: Model) -> sp.Expr:
    """1 where the conditions that several numbers obey together hold, else 0."""
    symbols: dict[str, Any] = dict(model.parameters)
    relations = [condition.holds for _, condition in conditions(twin(rig, symbols))]
    holds = [one if isinstance(one, sp.Basic) else sp.sympify(bool(np.all(one))) for one in relations]
    return sp.Piecewise((1, sp.And(*holds)), (0, True))
