"""JavaScript programs for linear stability on a page: functions of parameters and steady normal stresses.

They are called by `web/linear.js`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.errors import NotAvailable
from steadyslip.core.records import conditions, with_values
from steadyslip.explorer.modes import mode_part
from steadyslip.explorer.programs import program
from steadyslip.explorer.sliding import needs_search, steady_programs
from steadyslip.kernels.nodes import Node, Program, Value, select
from steadyslip.kernels.printers import javascript
from steadyslip.linear import crossing, cubic
from steadyslip.linear.response import has_closed_form, response
from steadyslip.linear.status import ON_THE_EDGE
from steadyslip.linear.stiffness import interval_ingredients
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_coefficients, is_written_out, stiffness_split
from steadyslip.model.posed import vanishing_terms
from steadyslip.model.range import highest_coefficients, highest_is_lost
from steadyslip.model.sliding import observed_in_steady_sliding
from steadyslip.model.steady import GRID, ROOT_TOLERANCE, joint_equation

SLIP_RATE = "slip_rate"  # name of the slip velocity of a contact on pages


def page_model(rig: Slider | Machine) -> Model:
    """Model of a rig that keeps the terms of zero parameters which a page can vary."""
    return build_model(rig, rig.kept_zeros())


def linear_part(rig: Slider | Machine) -> tuple[str, dict[str, Any]]:
    """JavaScript expression with the programs of linear stability, and data about these programs.

    Returns
    -------
    text : str
        Expression whose value is an object of functions.
    facts : dict
        ``parameters`` (dotted names in the order of R), ``contacts`` (their names), ``searched`` (for each contact,
        True if σss is a root of its `residual`, False if `steady` has it), ``joint`` (True if all σss follow together),
        ``degree`` of the characteristic polynomial, ``closed`` (True if there is an `interval` in closed form),
        ``couples`` (True if oscillations can couple, so that growth is reported for undamped rigs),
        ``edge`` (relative size of rounding at an edge), ``grid`` (number of stresses of the search, first and last
        power of ten),
        ``solved`` (tolerance of a root's residual, relative to the stress), ``observed`` (names, units and meanings of
        `observables`); for machines those of `mode_part`, for sliders ``gain`` (drive parameter that acts as a
        stiffness, or None).

    Raises
    ------
    NotAvailable
        If an equation has a delay, a function without JavaScript equivalent, or is too long.
    """
    model = page_model(rig)
    if model.carried is not None or not is_written_out(model):
        raise NotAvailable(
            "a page has its equations written out, and those of this machine, whose bodies are coupled in many ways, "
            "are too long for that; use steadyslip analyze, simulate or report"
        )
    if model.delays:
        raise NotAvailable(
            "a page needs a characteristic polynomial, which a rig with a delay does not have; use steadyslip analyze, "
            "or ss.boundary and ss.stable_values in Python"
        )
    coefficients = characteristic_coefficients(model)
    names, observables = _shown_observables(model)
    meanings = _meanings(rig)
    closed = has_closed_form(model)
    further: dict[str, Any] = {}
    programs = [
        *steady_programs(model),
        program(model, "allowed", [_allowed(rig, model)]),
        _coefficient_program(model, coefficients),
        program(model, "statics", _static_terms(model), then=lambda terms: [crossing.share_left(terms, select)]),
        program(model, "observables", observables),
    ]
    if isinstance(rig, Machine):
        modes, further = mode_part(rig, model)
        programs += modes
    else:
        without, slope = stiffness_split(model)
        programs.append(program(model, "split", [*without, *slope]))
        programs.append(program(model, "stiffness", [model.axial_share or 1, model.gain]))
        further = {"gain": rig.gain_name()}
    edges = _stable_set_programs(len(coefficients) - 1, sum(map(len, vanishing_terms(model))))
    if closed:
        programs.append(program(model, "interval", interval_ingredients(model), then=_interval))
    facts = {
        "parameters": list(model.parameters),
        "contacts": [contact.name for contact in model.contacts],
        "searched": needs_search(model),
        "joint": joint_equation(model) is not None,
        "degree": len(coefficients) - 1,
        "squares": len(edges[0].stores) - 2,
        "closed": closed,
        "couples": not model.is_single,
        "edge": ON_THE_EDGE,
        "grid": [len(GRID), float(np.log10(GRID[0])), float(np.log10(GRID[-1]))],
        "solved": ROOT_TOLERANCE,
        "observed": [[name, _unit(model, name), meanings.get(name, "")] for name in names],
    } | further
    programs += [_linear_split_program(), *edges]
    text = "".join(javascript.text(one) for one in programs)
    return f"(() => {{\n{text}return {{ {', '.join(one.name for one in programs)} }};\n}})()", facts


def _meanings(rig: Slider | Machine) -> dict[str, str]:
    """Meanings of observables by name, from the friction laws of a rig."""
    own = {f"{name}." if name else "": one.friction.meanings() for name, one in rig.laws_by_contact().items()}
    named = {prefix + key: words for prefix, meant in own.items() for key, words in meant.items()}
    return {"spring_stress": "with the damping to the ground", **named}


def _shown_observables(model: Model) -> tuple[list[str], list[sp.Expr]]:
    """Names and expressions of observables in steady sliding, without displacements and velocities that are zero."""
    names, values = observed_in_steady_sliding(model)
    unseen = {f"{one.name}.x" for one in model.coordinates}
    unseen |= {f"{one.name}.v" for one in model.coordinates if one.speed == 0}
    kept = [(name, value) for name, value in zip(names, values, strict=True) if name not in unseen]
    slips = [(f"{one.name}.{SLIP_RATE}", model.steady[one.velocity]) for one in model.contacts if one.name]
    return [name for name, _ in (*slips, *kept)], [sp.sympify(value) for _, value in (*slips, *kept)]


def _unit(model: Model, name: str) -> str:
    return model.observables[name][1] if name in model.observables else "m/s"


def _static_terms(model: Model) -> list[sp.Expr]:
    """Terms whose sum is the static stiffness, as used by `steadyslip.linear.status.on_edge`."""
    if has_closed_form(model):
        part = response(model)
        return [part.k, part.mu * part.k * part.B2, part.mu * part.B3]
    if not model.is_slider:
        return list(sp.Add.make_args(characteristic_coefficients(model)[0]))
    without, slope = stiffness_split(model)
    return [without[0], model.parameters["slider.stiffness"] * slope[0]]


def _coefficient_program(model: Model, coefficients: Sequence[sp.Expr]) -> Program:
    """Program of the coefficients and their `_verdict_values`.

    The highest coefficient is NaN if cancellation leaves only rounding.
    """
    levels = highest_coefficients(model)

    def judged(values: list[Node]) -> list[Value]:
        c, rest = values[: len(coefficients)], iter(values[len(coefficients) :])
        if levels:
            lost = highest_is_lost([[(next(rest), next(rest)) for _ in level] for level in levels], select)
            c[-1] = select(lost > 0, float("nan"), c[-1])
        spare: Value = 0.0
        for terms in vanishing:
            gone: Value = 0.0  # size of inertia, or of inertia and damping together
            for _ in terms:
                gone = gone + abs(next(rest))
                spare = spare + select(gone <= 0, 1.0, 0.0)
        return _verdict_values(c, spare, sum(map(len, vanishing)))

    vanishing = vanishing_terms(model)
    further = [e for level in levels for pair in level for e in pair]
    further += [e for terms in vanishing for e in terms]
    return program(model, "coefficients", [*coefficients, *further], then=judged)


def _verdict_values(c: list[Node], spare: Value, most: int) -> list[Value]:
    """Nodes: coefficients; 1 or 0 for stable, and for ill-posed; the test functions of `crossing.judged`."""
    stable, functions = crossing.judged(c, select, spare, most)
    return [*c, *(select(truth, 1.0, 0.0) for truth in (stable, crossing.is_ill_posed(c, spare))), *functions]


def _stable_set_programs(degree: int, spare: int) -> list[Program]:
    """Programs for the stable set of p + k q: edges and polynomial in β² of crossings, k at a root, stability at k.

    They read an array with the coefficients of p, then those of q. The `spare` highest of p + k q may be 0.
    """

    def edges(p: list[Node], q: list[Node], _: Node) -> list[Value]:
        return [*crossing.real_edges(p, q, select), *crossing.axis_polynomial(p, q, select)]

    def on_axis(p: list[Node], q: list[Node], square: Node) -> list[Value]:
        return [crossing.stiffness_on_axis(p, q, square)]

    def stable_at(p: list[Node], q: list[Node], k: Node) -> list[Value]:
        both = [one + k * other for one, other in zip(p, q, strict=True)]
        return [select(crossing.is_hurwitz(both, select, spare), 1.0, 0.0)]

    found = []
    for name, values in (("edges", edges), ("onAxis", on_axis), ("stableAt", stable_at)):
        made = Program(name)
        p, q = ([made.load(start + i) for i in range(degree + 1)] for start in (0, degree + 1))
        for place, value in enumerate(values(p, q, made.number)):
            made.store(place, value, "y")
        found.append(made)
    return found


def _interval(ingredients: list[Node]) -> Sequence[Value]:
    """Ends of the stable interval of stiffness in closed form, NaN if there is none."""
    numerator, denominator, mu_b2, mu_b3, a2, a3, gain = ingredients
    low, high = cubic.stable_interval(numerator, denominator, mu_b2, mu_b3, a2, a3, select)
    return cubic.without_gain(low, high, gain, select)


def _linear_split_program() -> Program:
    """Program that finds p and q of a coefficient p + k q from its values at three k; and 1 if it is linear, else 0."""
    made = Program("linear")
    low, own, high = ([made.load(place)] for place in range(3))
    p, q, straight = crossing.linear_split(low, own, high, select)
    for place, value in enumerate([*p, *q, select(straight, 1.0, 0.0)]):
        made.store(place, value, "y")
    return made


def _allowed(rig: Slider | Machine, model: Model) -> sp.Expr:
    """Expression that is 1 if all conditions between parameters hold, else 0."""
    symbols: dict[str, Any] = dict(model.parameters)
    relations = [condition.holds for _, condition in conditions(with_values(rig, symbols))]
    holds = [one if isinstance(one, sp.Basic) else sp.sympify(bool(np.all(one))) for one in relations]
    return sp.Piecewise((1, sp.And(*holds)), (0, True))
