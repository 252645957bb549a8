"""A friction law as its contract sees it: what it says in symbols, and where it is checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from steadyslip.core.expressions import ArrayFunction, derivative
from steadyslip.core.questions import Keeper, question
from steadyslip.laws.friction import FrictionLaw
from steadyslip.testing.precise import in_symbols, precise_function, stated


@dataclass(frozen=True)
class Conditions:
    """Where a friction law is checked.

    Attributes
    ----------
    velocity, normal_stress : float
        The middle (m/s, Pa).
    velocity_decades, stress_decades : float
        How far to each side, in powers of ten.
    instant_weakening : bool
        Whether friction may fall at once when the velocity rises (LuGre, Coulomb–Stribeck): legitimate, but
        such a rig is ill-posed without mass.
    """

    velocity: float = 1e-6
    normal_stress: float = 5e6
    velocity_decades: float = 3.0
    stress_decades: float = 1.0
    instant_weakening: bool = False

    def grid(self) -> Iterator[tuple[float, float]]:
        """Velocities and normal stresses, the middle first."""
        yield self.velocity, self.normal_stress
        for v in self.velocity * np.logspace(-self.velocity_decades, self.velocity_decades, 7):
            for sigma in self.normal_stress * np.logspace(-self.stress_decades, self.stress_decades, 3):
                yield float(v), float(sigma)


MIDDLE = Conditions()


class Statement(Keeper):
    """What a law says, in symbols: its expressions, their gradients, and both as numbers to fifty digits."""

    def __init__(self, law: FrictionLaw) -> None:
        self.law = law
        copy, self.numbers = in_symbols(law)
        self.v, self.sigma = sp.Dummy("v", positive=True), sp.Dummy("sigma", positive=True)
        self.tau = sp.Dummy("tau", real=True)
        self.memory = tuple(sp.Dummy(name, real=True) for name in law.memory())
        present = (self.v, self.sigma, self.memory, self.tau)
        self.strength = stated(law, "strength", copy.strength, *present)
        self.rates = stated(law, "rates", copy.rates, *present)
        self.steady_memory = stated(law, "steady_memory", copy.steady_memory, self.v, self.sigma)
        self._copy = copy
        self.inputs = (self.v, self.sigma, *self.memory, self.tau)

    @cached_property
    def steady_strength(self) -> sp.Expr:
        """τss(v, σ); stated last, because by default it uses the memory variables stated before."""
        return stated(self.law, "steady_strength", self._copy.steady_strength, self.v, self.sigma)

    @question
    def function(self, *expressions: sp.Expr) -> Callable[..., list[mpmath.mpf]]:
        """The expressions as a function of v, σ, memory variables, τ."""
        compiled = precise_function(self.law, [*self.inputs, *self.numbers], expressions)
        own = [mpmath.mpf(number) for number in self.numbers.values()]
        return lambda *numbers: compiled(*numbers, *own)

    @question
    def floats(self, *expressions: sp.Expr) -> Callable[..., list[Any]]:
        """The same in ordinary floats, as the rest of the package evaluates a law."""
        compiled = ArrayFunction([*self.inputs, *self.numbers], expressions)
        return lambda *numbers: compiled(*numbers, *self.numbers.values())

    @question
    def steady(self, v: float, sigma: float) -> tuple[mpmath.mpf, ...]:
        """v, σ, memory variables and τ of steady sliding."""
        unused = [0] * (len(self.memory) + 1)
        return (mpmath.mpf(v), mpmath.mpf(sigma), *self._steady(v, sigma, *unused))

    @cached_property
    def _steady(self) -> Callable[..., list[mpmath.mpf]]:
        return self.function(*self.steady_memory, self.steady_strength)

    @question
    def gradient(self, expression: sp.Expr) -> tuple[sp.Expr, ...]:
        """Partial derivatives with respect to v, σ, memory variables, τ."""
        return tuple(derivative(expression, name).doit() for name in self.inputs)

    @question
    def relaxation(self) -> Callable[..., Any]:
        """The matrix of ∂(rates)/∂(memory) at fixed v and σ, τ following the strength, as a function of numbers."""
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
def statement(law: FrictionLaw) -> Statement:
    """A law in symbols; raises `ContractViolation` where its methods do not take symbols."""
    return Statement(law)
