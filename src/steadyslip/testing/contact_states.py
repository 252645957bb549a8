"""The contract of contacts that have states of their own, feel fluid around them, or give under what presses them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from steadyslip.laws.contact import ContactLaw
from steadyslip.testing.contact import PRESS, ContactStatement, Surroundings, values_of
from steadyslip.testing.precise import (
    DIGITS,
    TOLERANCE,
    eigenvalues,
    precise_function,
    require,
    require_known_symbols,
    shown,
    stated,
)

FACTORS = (1.0, 0.01, 100.0)  # of the drive's velocity, at which states are looked at
STEP, ROUTES = 1e-6, 1e-4  # of differences, in natural sizes; and how well they tell slopes, of the largest


def check_contact_states(contact: ContactLaw, surroundings: Surroundings = PRESS) -> None:
    """States have names and units, rates that vanish in steady sliding, decay at constant velocity, and are felt.

    Called with plain floats, rates and steady states are those of the symbols.
    """
    names, units = contact.memory(), contact.memory_units()
    said = ContactStatement(contact)
    rates = _all(contact, "rates", stated(contact, "rates", said.copy.rates, said.motion))
    velocity = sp.Symbol("v", positive=True)
    steady = _all(contact, "steady_memory", stated(contact, "steady_memory", said.copy.steady_memory, velocity))
    lengths = {"memory_units()": len(units), "rates()": len(rates), "steady_memory()": len(steady)}
    for what, length in lengths.items():
        require(
            length == len(names),
            contact,
            f"memory() names {len(names)} states and {what} has {length}; each state needs one of each",
        )
    if not names:
        return
    require(
        len(set(names)) == len(names) and all(isinstance(one, str) and one.isidentifier() for one in names),
        contact,
        f"memory() is {names!r}; allowed: different names of letters, digits and underscores",
    )
    for rate in rates:
        require_known_symbols(contact, "rates", rate, [*said.inputs, *said.numbers])
    for one in steady:
        require_known_symbols(contact, "steady_memory", one, [velocity, *said.numbers])
    _felt(contact, said, rates)
    memory = said.motion.memory
    slopes = [sp.diff(rate, m) for rate in rates for m in memory]
    function = precise_function(contact, [*said.inputs, *said.numbers], [*rates, *slopes])
    at_steady = precise_function(contact, [velocity, *said.numbers], list(steady))
    sigma = surroundings.steady_stress(contact)
    for factor in FACTORS:
        v = factor * surroundings.velocity
        motion = surroundings.steady_motion(contact, sigma, v)
        numbers = said.numbers.values()
        for by_hand, exact, twice in zip(
            motion.memory, at_steady(v, *numbers), at_steady(2 * v, *numbers), strict=True
        ):
            require(
                abs(by_hand - exact) <= TOLERANCE * (abs(exact) + abs(twice - exact)),
                contact,
                f"steady_memory() called with floats is {by_hand!r}, in symbols {shown(exact)}",
            )
        found = function(*values_of(motion), *numbers)
        faster = function(*values_of(_faster(motion)), *numbers)
        for i, name in enumerate(names):
            size = abs(faster[i]) + sum(abs(found[len(names) * (i + 1) + j] * m) for j, m in enumerate(motion.memory))
            require(
                abs(found[i]) <= TOLERANCE * size,
                contact,
                f"in steady sliding at {v:g} m/s the rate of {name} is {shown(found[i])} per second; rates() must "
                "vanish at steady_memory()",
            )
        with mpmath.workdps(DIGITS):
            matrix = mpmath.matrix(len(names), len(names))
            for i in range(len(names)):
                for j in range(len(names)):
                    matrix[i, j] = found[len(names) * (i + 1) + j]
            worst = max(mpmath.re(s) for s in eigenvalues(matrix))
        require(
            worst < 0,
            contact,
            f"at a constant velocity of {v:g} m/s a state grows or stays at the rate {shown(worst)} 1/s; states must "
            "decay to steady_memory()",
        )
    for by_hand, exact in zip(contact.rates(_faster(motion)), faster, strict=False):
        require(
            abs(float(by_hand) - exact) <= TOLERANCE * abs(exact),
            contact,
            f"rates() called with floats is {float(by_hand)!r}, in symbols {shown(exact)}",
        )


def _all(contact: ContactLaw, what: str, found: Any) -> tuple[sp.Expr, ...]:
    require(isinstance(found, tuple), contact, f"{what}() must return a tuple, one entry for each state")
    return tuple(sp.sympify(one) for one in found)


def _faster(motion: Any) -> Any:
    """The same, slipping a tenth faster."""
    return replace(motion, velocity=1.1 * motion.velocity)


def _felt(contact: ContactLaw, said: ContactStatement, rates: tuple[sp.Expr, ...]) -> None:
    """Every state changes the normal stress, or one that does."""
    by_state = dict(zip(said.motion.memory, rates, strict=True))
    felt = {m for m in by_state if m in said.stress.free_symbols}
    for _ in by_state:
        felt |= {m for m in by_state for other in felt if m in by_state[other].free_symbols}
    lost = [name for name, m in zip(contact.memory(), by_state, strict=True) if m not in felt]
    require(not lost, contact, f"nothing depends on {', '.join(lost)}; leave it out, or let the normal stress feel it")


def check_contact_senses(contact: ContactLaw, surroundings: Surroundings = PRESS) -> None:
    """What the law depends on is what it says: `is_compliant` of the distance of the surfaces, `has_pores` of fluid.

    Surfaces that give press less when they part, and resist parting.
    """
    said = ContactStatement(contact)
    rates = stated(contact, "rates", said.copy.rates, said.motion) if contact.memory() else ()
    used = said.stress.free_symbols.union(*(rate.free_symbols for rate in rates))
    motion = said.motion
    apart = {motion.separation, motion.steady_separation, motion.separation_rate}
    for what, says, does in (
        ("is_compliant", contact.is_compliant(), bool(used & apart)),
        ("has_pores", contact.has_pores(), motion.outside in used),
    ):
        seen = "the distance of the surfaces" if what == "is_compliant" else "the pressure around"
        depends = "depends" if does else "does not depend"
        require(says == does, contact, f"the law {depends} on {seen}, and {what}() is {says}; they must agree")
    if not contact.is_compliant():
        return
    slopes = [sp.diff(said.stress, one) for one in (motion.separation, motion.separation_rate)]
    at = surroundings.steady_motion(contact, surroundings.steady_stress(contact))
    stiffness, damping = precise_function(contact, [*said.inputs, *said.numbers], slopes)(
        *values_of(at), *said.numbers.values()
    )
    require(
        stiffness < 0,
        contact,
        f"∂σ/∂(separation) is {shown(stiffness)} Pa/m, must be < 0: surfaces that part press less",
    )
    require(damping <= 0, contact, f"∂σ/∂(separation_rate) is {shown(damping)} Pa s/m, must be <= 0: damping resists")


def check_contact_routes(contact: ContactLaw, surroundings: Surroundings = PRESS) -> None:
    """Of a law with states, or on surfaces that give: motion, the linearisation and its eigenvalues agree.

    The rates of motion next to steady sliding, in differences to either side, have the slopes that differentiation
    gives, and these the eigenvalues of the characteristic polynomial.
    """
    from steadyslip.linear.stiffness import eigenvalues as of_polynomial
    from steadyslip.motion.jobs import Options, prepare
    from steadyslip.nonlinear.kicks.field import rates_at
    from steadyslip.nonlinear.kicks.settled import rest_of

    if not (contact.memory() or contact.is_compliant()):
        return
    rig = surroundings.rig(contact)
    surroundings.steady_stress(contact)  # says so where there is none
    jobs = prepare(rig, None, 1.0, {}, {}, Options())
    rest = rest_of(jobs, np.array([surroundings.velocity]), np.zeros(1))
    require(bool(rest.exists[0]), contact, "the motion has no steady sliding where the equations of statics have one")
    n = rest.state.shape[1]
    away = STEP * rest.scales * np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n)])
    rates = rates_at(rest, rest.state[:, None, :] + away[None])[0] / rest.scales
    forward, backward = (rates[1 : n + 1] - rates[0]).T / STEP, (rates[0] - rates[n + 1 :]).T / STEP
    slopes = rest.matrix[0]
    for i, name in enumerate(rest.reduction.names):
        off = np.max(np.abs([forward[i] - slopes[i], backward[i] - slopes[i]])) / max(np.max(np.abs(slopes[i])), 1e-300)
        require(
            off <= ROUTES,
            contact,
            f"the rate of {name} has other slopes by differences than by differentiation, by {off:.3g} of the largest; "
            "check kinks and functions of your own",
        )
    found, wanted = np.linalg.eigvals(slopes), np.asarray(of_polynomial(rig))
    for s in wanted[~np.isnan(wanted)]:
        off = np.min(np.abs(found - s)) / np.max(np.abs(wanted))
        require(off <= ROUTES, contact, f"the eigenvalue {s:.6g} 1/s of the polynomial is none of the motion's")
