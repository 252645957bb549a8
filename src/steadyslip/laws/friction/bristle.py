"""Friction laws of machines: LuGre bristles, Coulomb–Stribeck friction without memory, and Coulomb friction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.domains import Condition, nonnegative, positive
from steadyslip.core.records import parameter
from steadyslip.laws.friction.law import Expression, Expressions, FrictionLaw

REST = sp.Rational(1, 10**12)
"""Share of v_S below which the Stribeck curve is made flat, as its slope at rest would be infinite for δ_S < 1.
Chosen by trial, far below any velocity of interest."""


def _viscous() -> Any:
    """Declare the viscous coefficient that all laws here have."""
    doc = "viscous coefficient s_2 (σ2 of LuGre), per unit normal stress"
    return parameter("s/m", nonnegative, doc, default=0.0, kind="viscosity", letter="s_2")


class Coulomb(FrictionLaw, name="coulomb"):
    """Coulomb friction, constant in sliding, with larger friction at rest and viscosity if given.

    τ = σ[μ_C sign(v) + σ2 v] in sliding. At rest friction balances the load up to σ μ_S, with μ_S = μ_C unless
    `mu_static` is given; steady sliding does not depend on it.
    """

    mu_coulomb: float = parameter("1", positive, "Coulomb friction coefficient μ_C", letter="mu_C")
    mu_static: float | None = parameter(
        "1", positive, "friction coefficient at rest μ_S; μ_C unless given", default=None, letter="mu_S"
    )
    viscous: float = _viscous()

    def conditions(self) -> Iterator[Condition]:
        if self.mu_static is not None:
            message = "got {}, with mu_coulomb = {}; allowed: at least mu_coulomb: exchange the two if that is meant"
            at_rest, sliding = np.asarray(self.mu_static), np.asarray(self.mu_coulomb)
            yield Condition("mu_static", at_rest >= sliding, message, (at_rest, sliding))

    def motion_conditions(self) -> Iterator[Condition]:
        if self.mu_static is not None:
            message = (
                "got {}, more than mu_coulomb = {}; simulation has no friction that is larger at rest under this law: "
                "leave mu_static out, or use the law lugre; `steadyslip hunt` has it, for drives that hold a place"
            )
            at_rest, sliding = np.asarray(self.mu_static), np.asarray(self.mu_coulomb)
            yield Condition("mu_static", at_rest <= sliding, message, (at_rest, sliding))

    def strength(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expression:
        return sigma * (self.mu_coulomb * sp.sign(v) + self.viscous * v)

    def rest_strength(self, sigma: Expression) -> Expression:
        return sigma * (self.mu_coulomb if self.mu_static is None else self.mu_static)


class StribeckCurve(FrictionLaw):
    """Base of laws with the Stribeck curve g(v) = μ_C + (μ_S − μ_C) exp(−|v/v_S|^δ_S).

    The exponent δ_S is 2 unless given (Gauss). Measured exponents of lubricated and dry pairs range from 0.5 to over 2
    (Armstrong-Hélouvry 1991): with 2, friction is almost flat far below v_S; with 1 or less it falls most at rest.
    """

    mu_coulomb: float = parameter("1", positive, "Coulomb friction coefficient μ_C", letter="mu_C")
    mu_static: float = parameter("1", positive, "static friction coefficient μ_S", letter="mu_S")
    v_stribeck: float = parameter("m/s", positive, "Stribeck velocity v_S", kind="velocity scale", letter="v_S")
    viscous: float = _viscous()
    stribeck_exponent: float | None = parameter(
        "1",
        positive,
        "Stribeck exponent δ_S; 2 unless given",
        default=None,
        standing=2.0,
        kind="exponent",
        letter="delta_S",
    )

    def doubts(self) -> Iterator[str]:
        if self.mu_static < self.mu_coulomb:
            yield (
                f"friction.mu_static = {self.mu_static:.4g} is smaller than mu_coulomb = {self.mu_coulomb:.4g}: "
                "friction rises with velocity; it is usually larger at rest: exchange the two if that is meant"
            )

    def _curve(self, v: Expression) -> Expression:
        """Stribeck curve g(v): friction coefficient without the viscous part."""
        fast = (v / self.v_stribeck) ** 2
        if self.stribeck_exponent is not None:
            fast = (fast + REST**2) ** (self.stribeck_exponent / 2)
        return self.mu_coulomb + (self.mu_static - self.mu_coulomb) * sp.exp(-fast)

    def slow_velocity(self) -> Expression | None:
        return self.v_stribeck


class CoulombStribeck(StribeckCurve, name="coulomb-stribeck"):
    """Friction as a function of velocity only: of the present velocity, or of the velocity a time lag ago.

    τ = σ[g(v) + σ2 v], g as in `StribeckCurve`. Without a memory there is no critical stiffness: where friction falls
    with velocity, the quasistatic problem is ill-posed, and with mass no stiffness stabilises.

    With a `lag` δ the curve depends on the earlier velocity, τ = σ[g(v(t − δ)) + σ2 v(t)]: the frictional memory of
    Hess & Soom (1990) and Armstrong-Hélouvry (1991). Intervals of stable and unstable stiffness then alternate.
    """

    lag: float = parameter(
        "s",
        nonnegative,
        "time δ by which the curve follows velocity late",
        default=0.0,
        structural=True,
        kind="delay",
        letter="delta",
        instance="2 ms",
    )

    def strength(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expression:
        return sigma * (self._curve(v) * sp.sign(v) + self.viscous * v)

    def lateness(self) -> Expression:
        return self.lag

    def late_strength(
        self, v: Expression, late: Expression, sigma: Expression, memory: Expressions, tau: Expression
    ) -> Expression:
        return sigma * (self._curve(late) * sp.sign(v) + self.viscous * v)


class LuGre(StribeckCurve, name="lugre"):
    """LuGre friction (Canudas de Wit et al. 1995), per unit normal stress.

    τ = σ[σ0 z + σ1 ż + σ2 v], ż = v − σ0 |v| z/g(v), with the mean bristle deflection z (m) as memory.
    """

    bristle_stiffness: float = parameter(
        "1/m",
        positive,
        "bristle stiffness s_0 (σ0 of LuGre), per unit normal stress",
        kind="bristle stiffness",
        letter="s_0",
    )
    bristle_damping: float = parameter(
        "s/m",
        nonnegative,
        "bristle damping s_1 (σ1 of LuGre), per unit normal stress",
        default=0.0,
        kind="bristle damping",
        letter="s_1",
    )

    def memory(self) -> tuple[str, ...]:
        return ("z",)

    def memory_units(self) -> tuple[str, ...]:
        return ("m",)

    def meanings(self) -> dict[str, str]:
        return {"z": "mean deflection of the bristles"}

    def strength(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expression:
        (rate,) = self.rates(v, sigma, memory, tau)
        return sigma * (self.bristle_stiffness * memory[0] + self.bristle_damping * rate + self.viscous * v)

    def rates(self, v: Expression, sigma: Expression, memory: Expressions, tau: Expression) -> Expressions:
        return (v - self.bristle_stiffness * sp.Abs(v) * memory[0] / self._curve(v),)

    def steady_memory(self, v: Expression, sigma: Expression) -> Expressions:
        return (self._curve(v) / self.bristle_stiffness,)

    def steady_strength(self, v: Expression, sigma: Expression) -> Expression:
        return sigma * (self._curve(v) + self.viscous * v)
