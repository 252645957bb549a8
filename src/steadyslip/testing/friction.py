"""The contract of friction laws: one function for each promise that a law makes."""

from __future__ import annotations

import math
from typing import Any

import mpmath

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import QuantityError
from steadyslip.core.expressions import derivative
from steadyslip.laws.friction import FrictionLaw
from steadyslip.testing.precise import (
    DIGITS,
    TOLERANCE,
    disagreement,
    eigenvalues,
    require,
    require_known_symbols,
    shown,
)
from steadyslip.testing.statement import MIDDLE, Conditions, statement


def _where(v: Any, sigma: Any) -> str:
    return f"at v = {shown(v)} m/s, σ = {shown(sigma)} Pa"


def check_names(law: FrictionLaw, conditions: Conditions = MIDDLE) -> None:
    """Names, units, rates and steady memory agree in number; units exist; the law is registered."""
    name = type(law).name
    require(
        name and FrictionLaw.registry.get(name) is type(law),
        law,
        f"is not registered; write class {type(law).__name__}(FrictionLaw, name='...') so that rig files can name it",
    )
    names, units = law.memory(), law.memory_units()
    require(len(set(names)) == len(names), law, f"memory() repeats a name: {names}")
    require(all(n.isidentifier() for n in names), law, f"memory() gives {names}; names must be letters, digits and _")
    require(len(units) == len(names), law, f"memory_units() has {len(units)} units for {len(names)} memory variables")
    said = statement(law)
    for what, found in (("rates", said.rates), ("steady_memory", said.steady_memory)):
        require(len(found) == len(names), law, f"{what}() has {len(found)} values for {len(names)} memory variables")
    shown_units = {n: u for n, (_, u) in law.observables(said.v, said.sigma, said.memory, said.tau).items()}
    for variable, text in [*zip(names, units, strict=True), *shown_units.items()]:
        try:
            unit(text)
        except QuantityError as error:
            require(False, law, f"unit of {variable}: {error}; write an SI unit such as 'Pa', or '1' for none")
    strange = sorted(set(law.meanings()) - set(shown_units))
    require(not strange, law, f"meanings() tells of {', '.join(strange)}, which observables() does not give")


def check_symbols(law: FrictionLaw, conditions: Conditions = MIDDLE) -> None:
    """Equations depend on their arguments only, and no name of the law collides with one of the Model's."""
    from steadyslip.laws.contact import Constant
    from steadyslip.machine.drive import Steady
    from steadyslip.machine.slider import Slider
    from steadyslip.model import build_model

    said = statement(law)
    own = list(said.numbers)
    for what, expression in [("strength", said.strength), *(("rates", rate) for rate in said.rates)]:
        require_known_symbols(law, what, expression, [*said.inputs, *own])
    for what, expression in [
        ("steady_strength", said.steady_strength),
        *(("steady_memory", y) for y in said.steady_memory),
    ]:
        require_known_symbols(law, what, expression, [said.v, said.sigma, *own])
    press = Constant(steady_normal_stress=conditions.normal_stress)
    rig = Slider(friction=law, contact=press, stiffness=1.0, drive=Steady(conditions.velocity))
    model = build_model(rig, present=["slider.mass", "slider.damping", "slider.radiation_damping"])
    used = [
        *((name, symbol) for name, symbol in model.parameters.items()),
        *((item.name, item.symbol) for item in model.variables),
        *((name, symbol) for name, symbol in model.inputs.items()),
        ("acceleration", model.contact.acceleration),
        *((symbol.name, symbol) for symbol in model.definitions),
        ("steady normal stress", model.contact.sigma_ss),
    ]
    for i, (name, symbol) in enumerate(used):
        for other, same in used[:i]:
            one, two = model.written(symbol), model.written(same)
            require(one != two, law, f"{name} and {other} share the symbol {one} in the equations; rename the law's")


def check_steady_state(law: FrictionLaw, conditions: Conditions = MIDDLE) -> None:
    """Rates vanish at `steady_memory`, and the strength there is `steady_strength`, over decades of v and σ."""
    said = statement(law)
    values = said.function(*said.rates, said.strength)
    gradients = [said.function(*said.gradient(rate)) for rate in said.rates]
    for v, sigma in conditions.grid():
        with mpmath.workdps(DIGITS):
            point = said.steady(v, sigma)
            *rates, strength = values(*point)
            for name, rate, gradient in zip(law.memory(), rates, gradients, strict=True):
                # what each input contributes to the rate: the size of the terms that have to cancel
                terms = sum(abs(d * x) for d, x in zip(gradient(*point), point, strict=True))
                require(
                    abs(rate) <= TOLERANCE * terms,
                    law,
                    f"the steady state is not steady {_where(v, sigma)}: rates() gives {shown(rate)} for {name} at "
                    f"steady_memory() = {[shown(y) for y in point[2:-1]]}, must be 0; correct one of the two",
                )
            tau = point[-1]
            require(
                abs(strength - tau) <= TOLERANCE * abs(tau),
                law,
                f"strength() at steady_memory() is {shown(strength)} Pa {_where(v, sigma)}, steady_strength() is "
                f"{shown(tau)} Pa; they must agree (leave steady_strength out to use the former)",
            )


def check_signs(law: FrictionLaw, conditions: Conditions = MIDDLE) -> None:
    """Strength and direct effect are positive, and the memory relaxes, in steady sliding."""
    said = statement(law)
    values = said.function(
        said.strength, derivative(said.strength, said.v).doit(), 1 - derivative(said.strength, said.tau)
    )
    relaxation = said.relaxation()
    for v, sigma in conditions.grid():
        with mpmath.workdps(DIGITS):
            point = said.steady(v, sigma)
            strength, slope, own = values(*point)
            where = _where(v, sigma)
            require(
                strength > 0,
                law,
                f"the strength is {shown(strength)} Pa {where}, must be > 0; if the law does not hold there, narrow "
                "velocity_decades or stress_decades",
            )
            require(
                own > 0, law, f"strength() rises with tau by {shown(1 - own)} {where}, must be < 1 to have a solution"
            )
            require(
                slope / own > 0 or (conditions.instant_weakening and mpmath.isfinite(slope)),
                law,
                f"the direct effect ∂τ/∂v at fixed memory is {shown(slope / own)} Pa s/m {where}, must be > 0: without "
                "mass such a rig is ill-posed. If it is meant (LuGre, Stribeck), pass instant_weakening=True",
            )
            if said.memory:
                growth = max(mpmath.re(root) for root in eigenvalues(relaxation(*point)))
                require(
                    growth < 0,
                    law,
                    f"the memory {', '.join(law.memory())} does not relax {where}: at fixed velocity and normal stress "
                    f"a deviation grows at {shown(growth)} 1/s, must decay; check the sign of rates()",
                )


def check_derivatives(law: FrictionLaw, conditions: Conditions = MIDDLE) -> None:
    """SymPy's partial derivatives of strength and rates agree with central differences, away from steady sliding."""
    said = statement(law)
    expressions = {"strength": said.strength} | {
        f"rate of {n}": r for n, r in zip(law.memory(), said.rates, strict=True)
    }
    size = [max(abs(said.steady(v, s)[i]) for v, s in conditions.grid()) or 1 for i in range(len(said.inputs))]
    for what, expression in expressions.items():
        function, gradient = said.function(expression), said.function(*said.gradient(expression))
        for v, sigma in list(conditions.grid())[::5]:
            with mpmath.workdps(DIGITS):
                point = list(said.steady(v, sigma))
                point[0], point[1] = point[0] * 1.5, point[1] * 1.25
                slopes = gradient(*point)
                terms = sum(abs(slope * x) for slope, x in zip(slopes, point, strict=True))
                for i, (name, slope) in enumerate(zip(said.inputs, slopes, strict=True)):
                    scale = abs(point[i]) or size[i]

                    def along(x: Any, i: int = i, point: list[Any] = point, f: Any = function) -> Any:
                        return f(*point[:i], x, *point[i + 1 :])[0]

                    found, excess = disagreement(along, slope, point[i], scale, terms)
                    require(
                        excess <= 0,
                        law,
                        f"∂({what})/∂{name.name} is {shown(slope)} by SymPy and {shown(found)} by central differences "
                        f"{_where(*point[:2])}; check fdiff of your own functions, and kinks",
                    )


def check_numbers(law: FrictionLaw, conditions: Conditions = MIDDLE) -> None:
    """Methods called with plain floats give what they give in symbols, compiled or not."""
    said = statement(law)
    expressions = (said.strength, *said.rates)
    exact, compiled = said.function(*expressions), said.floats(*expressions)
    gradients = [said.function(*said.gradient(e)) for e in expressions]
    for v, sigma in list(conditions.grid())[::4]:
        point = [float(x) for x in said.steady(v, sigma)]
        point[0] *= 1.5
        arguments = (point[0], point[1], tuple(point[2:-1]), point[-1])
        by_hand = [float(e) for e in (law.strength(*arguments), *law.rates(*arguments))]
        for what, reference, slopes, a, b in zip(
            ("strength", *law.memory()), exact(*point), gradients, by_hand, compiled(*point), strict=True
        ):
            terms = abs(reference) + sum(abs(d * x) for d, x in zip(slopes(*point), point, strict=True))
            # a backward-stable evaluation is off by some ten roundings of each input
            allowed = 256 * math.ulp(1.0) * float(terms)
            for how, value in (("called with floats", a), ("compiled", float(b))):
                require(
                    abs(value - float(reference)) <= allowed,
                    law,
                    f"{what} {how} is {value!r} {_where(*point[:2])}, in symbols {float(reference)!r}; a law's method "
                    "must be one expression for numbers and symbols",
                )
