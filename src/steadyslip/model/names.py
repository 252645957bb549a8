"""Names of results: reserved ones of the equations, and checks of those that laws add."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import sympy as sp

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw

RESERVED_NAMES = {
    "t": "the time", "time": "the time", "x": "how far a block is ahead of steady sliding", "v": "the velocity",
    "acceleration": "the acceleration", "displacement": "the way of a body", "slip": "the slip",
    "slip_rate": "the velocity of slip", "load_velocity": "the velocity of the load point",
    "load_displacement": "the way of the load point", "disturbance": "what pushes the block",
    "normal_disturbance": "the normal stress that a protocol adds", "injection": "the pressure of an injection",
    "creep": "whether the drive is let go", "integral": "the integral of a controller",
    "friction": "the friction coefficient", "shear_stress": "the friction stress", "normal_stress": "the normal stress",
    "spring_stress": "the stress of the spring", "friction_force": "the friction force",
    "normal_force": "the normal force", "force": "the force of a link",
}  # fmt: skip
"""Names that results of every rig use, with their meanings; laws cannot use them."""
EVENTS = "event_"  # prefix of the columns of events in files of runs

Observables = Mapping[str, tuple[sp.Expr, str]]


def check_names(place: str, law: FrictionLaw | ContactLaw, names: Iterable[str]) -> None:
    """Check names of memory variables, states and observables of a law against reserved names and duplicates.

    Raises
    ------
    ParameterError
        Listing all invalid names.
    """
    owner, problems = type(law).name or type(law).__name__, []
    given = list(names)
    for name in dict.fromkeys(given):
        if name in RESERVED_NAMES or name.startswith(EVENTS):
            what = RESERVED_NAMES.get(name, "what is known of events")
            problems.append(f"law {owner!r} calls a memory, state or observable {name!r}, as results call {what}")
        elif given.count(name) > 1:
            problems.append(f"law {owner!r} calls two memories or states {name!r}")
        elif not name.isidentifier():
            problems.append(f"law {owner!r} calls a memory, state or observable {name!r}; allowed: letters, digits, _")
    if problems:
        raise ParameterError([Problem(place, f"{one}; rename it in the law") for one in problems])


def merge_observables(tables: Iterable[tuple[str, Observables]]) -> dict[str, tuple[sp.Expr, str]]:
    """Merge tables of observables of several owners; equal observables of one name are kept once.

    Raises
    ------
    ParameterError
        If two observables that differ have the same name.
    """
    found: dict[str, tuple[sp.Expr, str]] = {}
    owners: dict[str, str] = {}
    problems = []
    for owner, table in tables:
        for name, seen in table.items():
            if found.setdefault(name, seen) != seen:
                message = f"is the name of two observables, of {owners[name]} and of {owner}; rename one in its law"
                problems.append(Problem(name, message))
            owners.setdefault(name, owner)
    if problems:
        raise ParameterError(problems)
    return found
