"""The linear part of a rig's Model as programs: functions of its parameters and the steady normal stresses.

`web/linear.js` asks them.
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
from steadyslip.explorer.sliding import searched, steady_programs
from steadyslip.kernels.nodes import Node, Program, Value, select
from steadyslip.kernels.printers import javascript
from steadyslip.linear import crossing, cubic
from steadyslip.linear.boundary import present_zeros
from steadyslip.linear.response import has_closed_form, response
from steadyslip.linear.status import ON_THE_EDGE
from steadyslip.linear.stiffness import interval_ingredients
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.build import build_model
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_coefficients, is_written_out, stiffness_split
from steadyslip.model.sliding import observed_in_steady_sliding
from steadyslip.model.steady import GRID, ROOT_TOLERANCE, joint_equation

SLIP_RATE = "slip_rate"
"""What pages call the velocity of a contact in steady sliding."""


def model_of(rig: Slider | Machine) -> Model:
    """The rig's Model with what a page can vary from zero kept in it."""
    return build_model(rig, present_zeros(rig))


def linear_part(rig: Slider | Machine) -> tuple[str, dict[str, Any]]:
    """The linear part as an expression of JavaScript, and what must be known about it.

    Returns
    -------
    text : str
        An object of functions.
    facts : dict
        ``parameters`` (dotted names in the order of R), ``contacts`` (their names), ``searched`` (of which of them the
        `residual` is to be solved for σss; those of others `steady` gives), ``joint`` (whether all σss follow
        together), ``degree`` of the characteristic polynomial, ``closed`` (whether the `interval` of the closed form
        exists), ``edge`` (what rounding alone can make), ``grid`` (how many stresses steady sliding is searched on, and
        the powers of ten that it runs from and to), ``solved`` (misfit of a root as a share of the stress),
        ``observed`` (names, units and meanings of what `observables` gives), of machines also what `mode_part` says,
        of sliders ``gain`` (the parameter of the drive that acts as a stiffness, or None).

    Raises
    ------
    NotAvailable
        If an equation contains what cannot be printed, or acts with a delay, or is too long.
    """
    model = model_of(rig)
    if model.carried is not None or not is_written_out(model):
        raise NotAvailable(
            "a page has its equations written out, and those of this machine, whose bodies hold each other in so many "
            "ways, would be too long for one; steadyslip analyze, simulate and report take it"
        )
    if model.delays:
        raise NotAvailable(
            "the page judges by a polynomial, and the characteristic equation of a rig with delay is none; "
            "steadyslip analyze and boundary take it, and stable_values in Python"
        )
    coefficients = characteristic_coefficients(model)
    names, observables = _observed(model)
    meanings = _meanings(rig)
    closed = has_closed_form(model)
    further: dict[str, Any] = {}
    programs = [
        *steady_programs(model),
        program(model, "allowed", [_allowed(rig, model)]),
        program(model, "coefficients", coefficients, then=_judged),
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
    edges = _stable_set(len(coefficients) - 1)
    if closed:
        programs.append(program(model, "interval", interval_ingredients(model), then=_interval))
    facts = {
        "parameters": list(model.parameters),
        "contacts": [contact.name for contact in model.contacts],
        "searched": searched(model),
        "joint": joint_equation(model) is not None,
        "degree": len(coefficients) - 1,
        "squares": len(edges[0].stores) - 2,
        "closed": closed,
        "edge": ON_THE_EDGE,
        "grid": [len(GRID), float(np.log10(GRID[0])), float(np.log10(GRID[-1]))],
        "solved": ROOT_TOLERANCE,
        "observed": [[name, _unit(model, name), meanings.get(name, "")] for name in names],
    } | further
    programs += [_linear_split(), *edges]
    text = "".join(javascript.text(one) for one in programs)
    return f"(() => {{\n{text}return {{ {', '.join(one.name for one in programs)} }};\n}})()", facts


def _meanings(rig: Slider | Machine) -> dict[str, str]:
    """What friction laws say of the names of their states."""
    if isinstance(rig, Machine):
        own = ((name, one.friction.meanings()) for name, one in rig.contacts.items())
        return {f"{name}.{key}": words for name, meant in own for key, words in meant.items()}
    return {"spring_stress": "with the damping to the ground", **rig.friction.meanings()}


def _observed(model: Model) -> tuple[list[str], list[sp.Expr]]:
    """What is shown of steady sliding: not the places of bodies, which count from there, nor what stands still."""
    names, values = observed_in_steady_sliding(model)
    unseen = {f"{one.name}.x" for one in model.coordinates}
    unseen |= {f"{one.name}.v" for one in model.coordinates if one.speed == 0}
    kept = [(name, value) for name, value in zip(names, values, strict=True) if name not in unseen]
    contacts = () if model.is_slider else model.contacts
    slips = [(f"{one.name}.{SLIP_RATE}", model.steady[one.velocity]) for one in contacts]
    return [name for name, _ in (*slips, *kept)], [sp.sympify(value) for _, value in (*slips, *kept)]


def _unit(model: Model, name: str) -> str:
    return model.observables[name][1] if name in model.observables else "m/s"


def _static_terms(model: Model) -> list[sp.Expr]:
    """What adds up to the static stiffness, as `steadyslip.linear.status.on_edge` takes it."""
    if has_closed_form(model):
        part = response(model)
        return [part.k, part.mu * part.k * part.B2, part.mu * part.B3]
    if not model.is_slider:
        return list(sp.Add.make_args(characteristic_coefficients(model)[0]))
    without, slope = stiffness_split(model)
    return [without[0], model.parameters["slider.stiffness"] * slope[0]]


def _judged(c: list[Node]) -> list[Value]:
    """Coefficients, whether all roots are on the left, whether the equations are ill-posed, and `crossing.judged`'s."""
    stable, functions = crossing.judged(c, select)
    return [*c, *(select(truth, 1.0, 0.0) for truth in (stable, crossing.is_ill_posed(c))), *functions]


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


def _linear_split() -> Program:
    """p and q of one coefficient, from it at three values of a parameter, and whether it is linear in that."""
    made = Program("linear")
    low, own, high = ([made.load(place)] for place in range(3))
    p, q, straight = crossing.linear_split(low, own, high, select)
    for place, value in enumerate([*p, *q, select(straight, 1.0, 0.0)]):
        made.store(place, value, "y")
    return made


def _allowed(rig: Slider | Machine, model: Model) -> sp.Expr:
    """1 where the conditions that several numbers obey together hold, else 0."""
    symbols: dict[str, Any] = dict(model.parameters)
    relations = [condition.holds for _, condition in conditions(with_values(rig, symbols))]
    holds = [one if isinstance(one, sp.Basic) else sp.sympify(bool(np.all(one))) for one in relations]
    return sp.Piecewise((1, sp.And(*holds)), (0, True))
