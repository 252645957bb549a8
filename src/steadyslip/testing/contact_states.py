"""Checks of contact laws with states, pore fluid or compliant surfaces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from steadyslip.laws.contact import ContactLaw
from steadyslip.testing.contact import DEFAULT_SURROUNDINGS, Surroundings, SymbolicContactLaw, motion_values
from steadyslip.testing.precise import (
    DIGITS,
    TOLERANCE,
    call_with_symbols,
    eigenvalues,
    format_number,
    precise_function,
    require,
    require_known_symbols,
)

FACTORS = (1.0, 0.01, 100.0)  # velocities at which states are checked, as multiples of the drive's velocity
STEP = 1e-6  # step of one-sided differences, relative to the natural scale of a variable
SLOPE_TOLERANCE = 1e-4  # allowed error of derivatives over the largest one: 100 STEP, far below the jump at a kink


def check_contact_states(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that states have names and units, rates that vanish in steady sliding, decay, and change the normal stress.

    Rates and steady states called with floats must equal those in symbols.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_states(contact)
    """
    names, units = contact.memory(), contact.memory_units()
    symbolic = SymbolicContactLaw(contact)
    rates = _checked_tuple(contact, "rates", call_with_symbols(contact, "rates", symbolic.copy.rates, symbolic.motion))
    velocity = sp.Symbol("v", positive=True)
    steady = _checked_tuple(
        contact, "steady_memory", call_with_symbols(contact, "steady_memory", symbolic.copy.steady_memory, velocity)
    )
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
        require_known_symbols(contact, "rates", rate, [*symbolic.inputs, *symbolic.numbers])
    for one in steady:
        require_known_symbols(contact, "steady_memory", one, [velocity, *symbolic.numbers])
    _require_effect(contact, symbolic, rates)
    memory = symbolic.motion.memory
    slopes = [sp.diff(rate, m) for rate in rates for m in memory]
    function = precise_function(contact, [*symbolic.inputs, *symbolic.numbers], [*rates, *slopes])
    at_steady = precise_function(contact, [velocity, *symbolic.numbers], list(steady))
    sigma = surroundings.steady_stress(contact)
    for factor in FACTORS:
        v = factor * surroundings.velocity
        motion = surroundings.steady_motion(contact, sigma, v)
        numbers = symbolic.numbers.values()
        for by_hand, exact, twice in zip(
            motion.memory, at_steady(v, *numbers), at_steady(2 * v, *numbers), strict=True
        ):
            require(
                abs(by_hand - exact) <= TOLERANCE * (abs(exact) + abs(twice - exact)),
                contact,
                f"steady_memory() called with floats is {by_hand!r}, in symbols {format_number(exact)}",
            )
        found = function(*motion_values(motion), *numbers)
        faster = function(*motion_values(_faster(motion)), *numbers)
        for i, name in enumerate(names):
            size = abs(faster[i]) + sum(abs(found[len(names) * (i + 1) + j] * m) for j, m in enumerate(motion.memory))
            require(
                abs(found[i]) <= TOLERANCE * size,
                contact,
                f"in steady sliding at {v:g} m/s the rate of {name} is {format_number(found[i])} per second; rates() "
                "must vanish at steady_memory()",
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
            f"at a constant velocity of {v:g} m/s a state grows or stays at the rate {format_number(worst)} 1/s; "
            "states must decay to steady_memory()",
        )
    for by_hand, exact in zip(contact.rates(_faster(motion)), faster, strict=False):
        require(
            abs(float(by_hand) - exact) <= TOLERANCE * abs(exact),
            contact,
            f"rates() called with floats is {float(by_hand)!r}, in symbols {format_number(exact)}",
        )


def _checked_tuple(contact: ContactLaw, what: str, found: Any) -> tuple[sp.Expr, ...]:
    require(isinstance(found, tuple), contact, f"{what}() must return a tuple, one entry for each state")
    return tuple(sp.sympify(one) for one in found)


def _faster(motion: Any) -> Any:
    """Copy of the motion with a velocity ten percent higher."""
    return replace(motion, velocity=1.1 * motion.velocity)


def _require_effect(contact: ContactLaw, symbolic: SymbolicContactLaw, rates: tuple[sp.Expr, ...]) -> None:
    """Require that every state changes the normal stress, directly or through other states."""
    by_state = dict(zip(symbolic.motion.memory, rates, strict=True))
    effective = {m for m in by_state if m in symbolic.stress.free_symbols}
    for _ in by_state:
        effective |= {m for m in by_state for other in effective if m in by_state[other].free_symbols}
    lost = [name for name, m in zip(contact.memory(), by_state, strict=True) if m not in effective]
    require(not lost, contact, f"nothing depends on {', '.join(lost)}; leave it out, or let the normal stress feel it")


def check_contact_senses(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check `is_compliant` and `has_pores` against what the law depends on: separation of surfaces, outside pressure.

    The normal stress of compliant surfaces must fall with separation, and resist the rate of separation.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_senses(contact)
    """
    symbolic = SymbolicContactLaw(contact)
    rates = call_with_symbols(contact, "rates", symbolic.copy.rates, symbolic.motion) if contact.memory() else ()
    used = symbolic.stress.free_symbols.union(*(rate.free_symbols for rate in rates))
    motion = symbolic.motion
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
    slopes = [sp.diff(symbolic.stress, one) for one in (motion.separation, motion.separation_rate)]
    at = surroundings.steady_motion(contact, surroundings.steady_stress(contact))
    stiffness, damping = precise_function(contact, [*symbolic.inputs, *symbolic.numbers], slopes)(
        *motion_values(at), *symbolic.numbers.values()
    )
    require(
        stiffness < 0,
        contact,
        f"∂σ/∂(separation) is {format_number(stiffness)} Pa/m, must be < 0: surfaces that part press less",
    )
    require(
        damping <= 0,
        contact,
        f"∂σ/∂(separation_rate) is {format_number(damping)} Pa s/m, must be <= 0: damping resists",
    )


def check_contact_routes(contact: ContactLaw, surroundings: Surroundings = DEFAULT_SURROUNDINGS) -> None:
    """Check that simulated rates, linearisation and eigenvalues agree, for laws with states or compliant surfaces.

    One-sided differences of the rates of motion at steady sliding must equal the derivatives, and the eigenvalues of
    these the roots of the characteristic polynomial.

    Examples
    --------
    >>> contact = ss.laws.InclinedSpring(preload="5 MPa", angle="-45 deg")
    >>> ss.testing.check_contact_routes(contact)
    """
    from steadyslip.linear.stiffness import eigenvalues as of_polynomial
    from steadyslip.motion.jobs import Options, prepare
    from steadyslip.nonlinear.kicks.field import rates_at
    from steadyslip.nonlinear.kicks.settled import rest_of

    if not (contact.memory() or contact.is_compliant()):
        return
    rig = surroundings.rig(contact)
    surroundings.steady_stress(contact)  # raises ContractViolation if there is no steady sliding
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
            off <= SLOPE_TOLERANCE,
            contact,
            f"the rate of {name} has other slopes by differences than by differentiation, by {off:.3g} of the largest; "
            "check kinks and functions of your own",
        )
    found, wanted = np.linalg.eigvals(slopes), np.asarray(of_polynomial(rig))
    for s in wanted[~np.isnan(wanted)]:
        off = np.min(np.abs(found - s)) / np.max(np.abs(wanted))
        require(
            off <= SLOPE_TOLERANCE, contact, f"the eigenvalue {s:.6g} 1/s of the polynomial is none of the motion's"
        )
