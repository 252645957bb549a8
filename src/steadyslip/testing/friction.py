"""Checks of friction laws: one function for each rule of the contract."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from steadyslip.core.dimensions import unit
from steadyslip.core.errors import QuantityError
from steadyslip.core.expressions import derivative
from steadyslip.laws.friction import FrictionLaw
from steadyslip.testing.precise import (
    DIGITS,
    TOLERANCE,
    ContractViolation,
    disagreement,
    eigenvalues,
    format_number,
    require,
    require_known_symbols,
)
from steadyslip.testing.symbolic import DEFAULT_CONDITIONS, Conditions, SymbolicLaw, symbolic_law


def _location(v: Any, sigma: Any) -> str:
    return f"at v = {format_number(v)} m/s, σ = {format_number(sigma)} Pa"


def check_names(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that the law is registered, and that names, units, rates and steady memory agree in number.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_names(law)
    """
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
    symbolic = symbolic_law(law)
    for what, found in (("rates", symbolic.rates), ("steady_memory", symbolic.steady_memory)):
        require(len(found) == len(names), law, f"{what}() has {len(found)} values for {len(names)} memory variables")
    shown_units = {
        n: u for n, (_, u) in law.observables(symbolic.v, symbolic.sigma, symbolic.memory, symbolic.tau).items()
    }
    for variable, text in [*zip(names, units, strict=True), *shown_units.items()]:
        try:
            unit(text)
        except QuantityError as error:
            require(False, law, f"unit of {variable}: {error}; write an SI unit such as 'Pa', or '1' for none")
    strange = sorted(set(law.meanings()) - set(shown_units) - set(names))
    message = f"meanings() describes {', '.join(strange)}, which neither observables() nor memory() gives"
    require(not strange, law, message)


def check_symbols(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that equations depend on their arguments only, and that no symbol of the law collides with the Model's.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_symbols(law)
    """
    from steadyslip.laws.contact import ConstantNormalStress
    from steadyslip.machine.drive import SteadyDrive
    from steadyslip.machine.slider import Slider
    from steadyslip.model import build_model

    symbolic = symbolic_law(law)
    own = list(symbolic.numbers)
    for what, expression in [("strength", symbolic.strength), *(("rates", rate) for rate in symbolic.rates)]:
        require_known_symbols(law, what, expression, [*symbolic.inputs, *own])
    for what, expression in [
        ("steady_strength", symbolic.steady_strength),
        *(("steady_memory", y) for y in symbolic.steady_memory),
    ]:
        require_known_symbols(law, what, expression, [symbolic.v, symbolic.sigma, *own])
    press = ConstantNormalStress(steady_normal_stress=conditions.normal_stress)
    rig = Slider(friction=law, contact=press, stiffness=1.0, drive=SteadyDrive(conditions.velocity))
    model = build_model(rig, present=["slider.mass", "slider.damping", "slider.radiation_damping"])
    used = [
        *model.parameters.items(),
        *((item.name, item.symbol) for item in model.variables),
        *model.inputs.items(),
        ("acceleration", model.contact.acceleration),
        *((symbol.name, symbol) for symbol in model.definitions),
        ("steady normal stress", model.contact.sigma_ss),
    ]
    for i, (name, symbol) in enumerate(used):
        for other, same in used[:i]:
            one, two = model.written(symbol), model.written(same)
            require(one != two, law, f"{name} and {other} share the symbol {one} in the equations; rename the law's")


def check_steady_state(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that rates vanish at `steady_memory` and the strength there is `steady_strength`, over decades of v, σ.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_steady_state(law)
    """
    symbolic = symbolic_law(law)
    values = symbolic.function(*symbolic.rates, symbolic.strength)
    gradients = [symbolic.function(*symbolic.gradient(rate)) for rate in symbolic.rates]
    for v, sigma in conditions.grid():
        with mpmath.workdps(DIGITS):
            point = symbolic.steady(v, sigma)
            *rates, strength = values(*point)
            for name, value in (("strength", strength), *(("rates", rate) for rate in rates)):
                require(
                    mpmath.isfinite(value),
                    law,
                    f"{name}() is no real number {_location(v, sigma)}, as the root or the logarithm of a negative "
                    "number, or an overflow; if the law does not hold there, narrow velocity_decades or stress_decades",
                )
            for name, rate, gradient in zip(law.memory(), rates, gradients, strict=True):
                # size of the terms that must cancel: contribution of each input to the rate
                terms = sum(abs(d * x) for d, x in zip(gradient(*point), point, strict=True))
                require(
                    abs(rate) <= TOLERANCE * terms,
                    law,
                    f"the steady state is not steady {_location(v, sigma)}: rates() gives {format_number(rate)} for "
                    f"{name} at steady_memory() = {[format_number(y) for y in point[2:-1]]}, must be 0; correct one "
                    "of the two",
                )
            tau = point[-1]
            require(
                abs(strength - tau) <= TOLERANCE * abs(tau),
                law,
                f"strength() at steady_memory() is {format_number(strength)} Pa {_location(v, sigma)}, "
                f"steady_strength() is {format_number(tau)} Pa; they must agree (leave steady_strength out to use the "
                "former)",
            )


def check_signs(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that strength and direct effect are positive in steady sliding, and that the memory relaxes.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_signs(law)
    """
    symbolic = symbolic_law(law)
    values = symbolic.function(
        symbolic.strength,
        derivative(symbolic.strength, symbolic.v).doit(),
        1 - derivative(symbolic.strength, symbolic.tau),
    )
    relaxation = symbolic.relaxation()
    for v, sigma in conditions.grid():
        with mpmath.workdps(DIGITS):
            point = symbolic.steady(v, sigma)
            strength, slope, own = values(*point)
            where = _location(v, sigma)
            require(
                strength > 0,
                law,
                f"the strength is {format_number(strength)} Pa {where}, must be > 0; if the law does not hold there, "
                "narrow velocity_decades or stress_decades",
            )
            require(
                own > 0,
                law,
                f"strength() rises with tau by {format_number(1 - own)} {where}, must be < 1 to have a solution",
            )
            require(
                slope / own > 0 or (conditions.instant_weakening and mpmath.isfinite(slope)),
                law,
                f"the direct effect ∂τ/∂v at fixed memory is {format_number(slope / own)} Pa s/m {where}, must be > "
                "0: without mass such a rig is ill-posed. If it is meant (LuGre, Stribeck), pass "
                "instant_weakening=True",
            )
            if symbolic.memory:
                growth = max(mpmath.re(root) for root in eigenvalues(relaxation(*point)))
                require(
                    growth < 0,
                    law,
                    f"the memory {', '.join(law.memory())} does not relax {where}: at fixed velocity and normal stress "
                    f"a deviation grows at {format_number(growth)} 1/s, must decay; check the sign of rates()",
                )


def check_derivatives(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check SymPy's derivatives of strength and rates against central differences, away from steady sliding.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_derivatives(law)
    """
    symbolic = symbolic_law(law)
    expressions = {"strength": symbolic.strength} | {
        f"rate of {n}": r for n, r in zip(law.memory(), symbolic.rates, strict=True)
    }
    size = [max(abs(symbolic.steady(v, s)[i]) for v, s in conditions.grid()) or 1 for i in range(len(symbolic.inputs))]
    for what, expression in expressions.items():
        function, gradient = symbolic.function(expression), symbolic.function(*symbolic.gradient(expression))
        for v, sigma in list(conditions.grid())[::5]:
            with mpmath.workdps(DIGITS):
                point = list(symbolic.steady(v, sigma))
                point[0], point[1] = point[0] * 1.5, point[1] * 1.25
                slopes = gradient(*point)
                terms = sum(abs(slope * x) for slope, x in zip(slopes, point, strict=True))
                for i, (name, slope) in enumerate(zip(symbolic.inputs, slopes, strict=True)):
                    scale = abs(point[i]) or size[i]

                    def along(x: Any, i: int = i, point: list[Any] = point, f: Any = function) -> Any:
                        return f(*point[:i], x, *point[i + 1 :])[0]

                    found, excess = disagreement(along, slope, point[i], scale, terms)
                    require(
                        excess <= 0,
                        law,
                        f"∂({what})/∂{name.name} is {format_number(slope)} by SymPy and {format_number(found)} by "
                        f"central differences {_location(*point[:2])}; check fdiff of your own functions, and kinks",
                    )


def check_numbers(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that methods called with floats, and their compiled expressions, equal the symbolic expressions.

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_numbers(law)
    """
    symbolic = symbolic_law(law)
    expressions = (symbolic.strength, *symbolic.rates)
    exact, compiled = symbolic.function(*expressions), symbolic.floats(*expressions)
    gradients = [symbolic.function(*symbolic.gradient(e)) for e in expressions]
    for v, sigma in list(conditions.grid())[::4]:
        point = [float(x) for x in symbolic.steady(v, sigma)]
        point[0] *= 1.5
        arguments = (point[0], point[1], tuple(point[2:-1]), point[-1])
        by_hand = [float(e) for e in (law.strength(*arguments), *law.rates(*arguments))]
        for what, reference, slopes, a, b in zip(
            ("strength", *law.memory()), exact(*point), gradients, by_hand, compiled(*point), strict=True
        ):
            terms = abs(reference) + sum(abs(d * x) for d, x in zip(slopes(*point), point, strict=True))
            # a backward-stable evaluation is off by some ten roundings of each input: 256 leaves a margin
            allowed = 256 * math.ulp(1.0) * float(terms)
            for how, value in (("called with floats", a), ("compiled", float(b))):
                require(
                    abs(value - float(reference)) <= allowed,
                    law,
                    f"{what} {how} is {value!r} {_location(*point[:2])}, in symbols {float(reference)!r}; a law's "
                    "method must be one expression for numbers and symbols",
                )


_VELOCITY_JUMP, _STRESS_JUMP = 3.0, 1.5  # ratio of values after and before a jump: not small, allowed by most laws
_RAMP_DURATION = 1e-3  # duration of the ramp over the fastest relaxation time
_HALVING_RATIO = 0.6  # limit of the ratio of changes: one of first order halves with the duration; 0.1 for second order


def check_jumps(law: FrictionLaw, conditions: Conditions = DEFAULT_CONDITIONS) -> None:
    """Check that memory is continuous when normal stress or velocity jump, and that strength follows at once.

    The rates are integrated through two smooth ramps, one half as long as the other: the change of each memory
    variable must vanish with the duration at first order, and the strength at the end must tend to
    strength(v2, σ2, memory before the jump).

    Examples
    --------
    >>> law = ss.laws.RateState(a=0.01, b=0.015, d_c="1 um", mu_ref=0.6, v_ref="1 um/s")
    >>> ss.testing.check_jumps(law)
    """
    symbolic = symbolic_law(law)
    v, sigma = conditions.velocity, conditions.normal_stress
    start = [float(x) for x in symbolic.steady(v, sigma)]
    ends = {"normal stress": (v, sigma * _STRESS_JUMP), "velocity": (v * _VELOCITY_JUMP, sigma)}
    stress = _strength_solver(symbolic)
    for what, (v2, sigma2) in ends.items():
        at_once = stress(v2, sigma2, start[2:-1], start[-1])
        require(np.isfinite(at_once), law, f"strength() has no finite value after a sudden change of {what}")
        if not symbolic.memory:
            continue
        duration = _RAMP_DURATION / _fastest_rate(symbolic, (start, [v2, sigma2, *start[2:-1], at_once]))
        memory = np.array(start[2:-1])
        found = [_memory_after_ramp(symbolic, stress, start, (v2, sigma2), d) for d in (duration, duration / 2)]
        changes = [np.abs(end - memory) for end in found]
        noise = 1e-9 * np.maximum(np.abs(memory), np.abs(changes[0]))
        for i, name in enumerate(law.memory()):
            long, short = changes[0][i], changes[1][i]
            require(
                short <= _HALVING_RATIO * long + noise[i],
                law,
                f"{name} jumps with the {what}: it changes by {format_number(long)} in a ramp of {duration:.3g} s and "
                f"by {format_number(short)} in one half as long; choose a memory variable that stays continuous, such "
                "as Θ + (α/b) ln σ, and leave the rate of the normal stress out of rates()",
            )
        misses = [abs(stress(v2, sigma2, end, at_once) - at_once) for end in found]
        require(
            misses[1] <= _HALVING_RATIO * misses[0] + 1e-9 * abs(at_once),
            law,
            f"after a sudden change of {what} the strength tends to {format_number(at_once + misses[1])} Pa, not to "
            f"strength(v2, σ2, memory before) = {format_number(at_once)} Pa",
        )


def _fastest_rate(symbolic: SymbolicLaw, points: Any) -> float:
    """Largest eigenvalue magnitude (1/s) of the relaxation of memory, over points before and after the jump."""
    relaxation = symbolic.relaxation()
    sizes = [abs(root) for point in points for root in eigenvalues(relaxation(*point))]
    return float(max(sizes))


def _strength_solver(symbolic: SymbolicLaw) -> Callable[..., float]:
    """Function that solves τ = strength(v, σ, memory, τ) for τ (Pa) by Newton's method."""
    function = symbolic.floats(symbolic.strength, sp.diff(symbolic.strength, symbolic.tau))

    def solve(v: float, sigma: float, memory: Any, guess: float) -> float:
        tau = guess
        for _ in range(50):
            with np.errstate(all="ignore"):
                strength, slope = (float(x) for x in function(v, sigma, *memory, tau))
            step = (strength - tau) / (1 - slope)
            tau += step
            if not abs(step) > 1e-14 * abs(tau):  # NaN is returned, too; the caller checks the result
                return tau
        raise ContractViolation(
            f"{symbolic.law!r}: strength(v, σ, memory, tau) = tau cannot be solved at v = {v}, σ = {sigma}"
        )

    return solve


def _memory_after_ramp(
    symbolic: SymbolicLaw, stress: Callable[..., float], start: list[float], end: tuple[float, float], duration: float
) -> Any:
    """Memory variables at the end of a smooth ramp of velocity and normal stress; `duration` in s."""
    from scipy.integrate import solve_ivp

    rates = symbolic.floats(*symbolic.rates)
    first = np.log(start[:2])
    last = np.log(end)

    def slope(t: float, memory: Any) -> Any:
        s = t / duration
        v, sigma = np.exp(first + (last - first) * s * s * (3 - 2 * s))
        return [float(rate) for rate in rates(v, sigma, *memory, stress(v, sigma, memory, start[-1]))]

    scale = np.maximum(np.abs(start[2:-1]), 1e-3 * np.max(np.abs([duration * r for r in slope(duration, start[2:-1])])))
    run = solve_ivp(
        slope, (0.0, duration), start[2:-1], method="DOP853", rtol=1e-11, atol=1e-13 * np.maximum(scale, 1e-300)
    )
    if not run.success or not np.all(np.isfinite(run.y[:, -1])):
        raise ContractViolation(
            f"{symbolic.law!r}: rates() cannot be integrated through a smooth ramp of velocity or normal stress "
            f"({run.message}); they must be finite and continuous"
        )
    return run.y[:, -1]
