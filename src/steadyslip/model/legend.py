"""Unit and meaning of every letter in the equations of a Model that is not a parameter."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import sympy as sp

from steadyslip.model.equations import Contact, Coordinate, Model

Meaning = tuple[str, str]
"""SI unit, and description in words."""
STATE_OF_LAW = "state of friction, as its law is described"
"""Description of a state Θ that appears in a law's text but is not a variable of the Model."""


def legend(model: Model) -> dict[str, Meaning]:
    """SI unit and meaning of each letter that may occur in the equations; keys are the letters as written.

    >>> from steadyslip.model import build_model
    >>> from steadyslip.reproduce import paper_rig
    >>> legend(build_model(paper_rig()))["v_lp"]
    ('m/s', 'velocity of the load point')
    """
    speed = model.roles["drive.velocity"].unit
    found = {
        model.inputs["load_velocity"]: (speed, "velocity of the load point"),
        model.inputs["time"]: ("s", "time"),
    }
    for coordinate in model.coordinates:
        found |= _of_coordinate(coordinate, model.is_slider)
    for contact in model.contacts:
        found |= _of_contact(contact, model.is_slider)
    found |= {model.parameters[name]: (model.roles[name].unit, model.roles[name].doc) for name in model.parameters}
    found |= {one.symbol: (one.unit, one.doc) for one in model.variables}
    for late, (symbol, _) in model.late.items():
        unit, words = found[symbol]
        found[late] = (unit, f"{words}, a delay ago")
    if model.letting_go is not None:
        found[model.letting_go.free] = ("1", "1 while the force of the drive is imposed, else 0")
    letters = {str(model.written(symbol)): meaning for symbol, meaning in found.items()}
    return letters | {str(one.lhs): ("1", STATE_OF_LAW) for one in states_of_laws(model)}


def states_of_laws(model: Model) -> Iterator[sp.Eq]:
    """Equations of the states Θ used in the descriptions of laws, in terms of the Model's variables Ψ.

    >>> from steadyslip.model import build_model
    >>> from steadyslip.reproduce import paper_rig
    >>> list(states_of_laws(build_model(paper_rig())))
    [Eq(Theta, (Psi - alpha*log(sigma/sigma_ref))/b)]
    """
    for one in model.memory:
        if (state := one.name.replace("Psi", "Theta")) != one.name:
            letter = str(model.written(one.symbol)).replace("Psi", "Theta")
            yield sp.Eq(sp.Symbol(letter), model.written(model.observables[state][0]), evaluate=False)


def letters_in(expressions: Iterable[sp.Basic]) -> Iterator[str]:
    """Names of the symbols and functions in expressions, in order of appearance, without repetition."""
    seen: dict[str, None] = {}
    for expression in expressions:
        for one in sp.preorder_traversal(expression):
            if isinstance(one, sp.Symbol):
                seen[str(one)] = None
            elif isinstance(one, sp.core.function.AppliedUndef):
                seen[str(one.func)] = None
    yield from seen


def _of_coordinate(one: Coordinate, only: bool) -> dict[sp.Symbol, Meaning]:
    body, turns = "the block" if only else one.words, one.unit == "rad"
    push = ("Pa", "stress") if only else ("N m", "torque") if turns else ("N", "force")
    return {
        one.velocity: (f"{one.unit}/s", f"velocity of {body}"),
        one.acceleration: (f"{one.unit}/s^2", f"acceleration of {body}"),
        one.push: (push[0], f"disturbance: {push[1]} on {body}"),
    }


def _of_contact(one: Contact, only: bool) -> dict[sp.Symbol, Meaning]:
    at = "" if only else f" at {one.name}"
    unit, load = ("N", "force") if not only and one.area == 1 else ("Pa", "stress")
    pull = "of spring and drive on the block" if only else "of links and drive against friction"
    found = {
        one.velocity: ("m/s", f"slip rate{at}"),
        one.spring: (unit, f"{load} {pull}{at}"),
        one.friction: (unit, f"friction {load}{at}"),
        one.normal: (unit, f"normal {load}{at}"),
        one.sigma_ss: (unit, f"normal {load} in steady sliding{at}"),
        one.press: (unit, f"disturbance: normal {load} added{at}"),
    }
    if one.outside is not None:
        found[one.outside] = (unit, f"change of the surrounding pressure{at}")
    return found
