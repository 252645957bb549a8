"""Friction laws in symbols with their gradients, and the range of velocity and normal stress of the checks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from steadyslip.core.caching import HasCache, cached
from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.laws.friction import FrictionLaw
from steadyslip.testing.precise import call_with_symbols, precise_function, symbolic_copy


@dataclass(frozen=True)
class Conditions:
    """Range of velocity and normal stress over which a friction law is checked.

    Attributes
    ----------
    velocity, normal_stress : float
        Centre of the range (m/s, Pa).
    velocity_decades, stress_decades : float
        Powers of ten to each side of the centre.
    instant_weakening : bool
        Allow friction that falls at once when the velocity rises (LuGre, Coulomb–Stribeck); without mass such a rig
        is ill-posed.
    """

    velocity: float = 1e-6
    normal_stress: float = 5e6
    velocity_decades: float = 3.0
    stress_decades: float = 1.0
    instant_weakening: bool = False

    def grid(self) -> Iterator[tuple[float, float]]:
        """Pairs of velocity (m/s) and normal stress (Pa): the centre first, then a logarithmic grid of 7 by 3."""
        yield self.velocity, self.normal_stress
        for v in self.velocity * np.logspace(-self.velocity_decades, self.velocity_decades, 7):
            for sigma in self.normal_stress * np.logspace(-self.stress_decades, self.stress_decades, 3):
                yield float(v), float(sigma)


DEFAULT_CONDITIONS = Conditions()


class SymbolicLaw(HasCache):
    """Equations of a friction law as SymPy expressions, with their gradients and functions that evaluate them.

    The inputs of all expressions are v (m/s), σ (Pa), the memory variables and τ (Pa), in this order.
    """

    def __init__(self, law: FrictionLaw) -> None:
        self.law = law
        copy, self.numbers = symbolic_copy(law)
        self.v, self.sigma = sp.Dummy("v", positive=True), sp.Dummy("sigma", positive=True)
        self.tau = sp.Dummy("tau", real=True)
        self.memory = tuple(sp.Dummy(name, real=True) for name in law.memory())
        present = (self.v, self.sigma, self.memory, self.tau)
        self.strength = call_with_symbols(law, "strength", copy.strength, *present)
        self.rates = call_with_symbols(law, "rates", copy.rates, *present)
        self.steady_memory = call_with_symbols(law, "steady_memory", copy.steady_memory, self.v, self.sigma)
        self._copy = copy
        self.inputs = (self.v, self.sigma, *self.memory, self.tau)

    @cached_property
    def steady_strength(self) -> sp.Expr:
        """Steady strength τss(v, σ), Pa; evaluated on first use, as by default it needs the steady memory variables."""
        return call_with_symbols(self.law, "steady_strength", self._copy.steady_strength, self.v, self.sigma)

    @cached
    def function(self, *expressions: sp.Expr) -> Callable[..., list[mpmath.mpf]]:
        """Function of the inputs that returns the values of the expressions to fifty digits."""
        compiled = precise_function(self.law, [*self.inputs, *self.numbers], expressions)
        own = [mpmath.mpf(number) for number in self.numbers.values()]
        return lambda *numbers: compiled(*numbers, *own)

    @cached
    def floats(self, *expressions: sp.Expr) -> Callable[..., list[Any]]:
        """Function of the inputs that returns the values of the expressions in floats, compiled as for a Model."""
        compiled = ArrayFunction([*self.inputs, *self.numbers], expressions)
        return lambda *numbers: compiled(*numbers, *self.numbers.values())

    @cached
    def steady(self, v: float, sigma: float) -> tuple[mpmath.mpf, ...]:
        """Values of the inputs (v, σ, memory variables, τ) in steady sliding."""
        unused = [0] * (len(self.memory) + 1)
        return (mpmath.mpf(v), mpmath.mpf(sigma), *self._steady(v, sigma, *unused))

    @cached_property
    def _steady(self) -> Callable[..., list[mpmath.mpf]]:
        return self.function(*self.steady_memory, self.steady_strength)

    @cached
    def gradient(self, expression: sp.Expr) -> tuple[sp.Expr, ...]:
        """Partial derivatives of an expression by each input."""
        return tuple(derivative(expression, name).doit() for name in self.inputs)

    @cached
    def relaxation(self) -> Callable[..., Any]:
        """Function of the inputs that returns the matrix d(rates)/d(memory) at fixed v and σ, with τ = strength."""
        slope = 1 - derivative(self.strength, self.tau)
        function = self.function(
            *(
                derivative(rate, y) + derivative(rate, self.tau) * derivative(self.strength, y) / slope
                for rate in self.rates
                for y in self.memory
            )
        )
        size = len(self.memory)
        return lambda *numbers: mpmath.matrix(np.reshape(function(*numbers), (size, size)).tolist())


@lru_cache(maxsize=64)
def symbolic_law(law: FrictionLaw) -> SymbolicLaw:
    """Symbolic equations of a law (cached); raises ContractViolation if its methods do not accept symbols."""
    return SymbolicLaw(law)
