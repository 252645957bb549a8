"""Laws of machine friction: LuGre bristles, and the memoryless Coulomb–Stribeck curve."""

from __future__ import annotations

import sympy as sp

from steadyslip.core.domains import nonnegative, positive
from steadyslip.core.records import parameter
from steadyslip.laws.friction.law import Expression, FrictionLaw

REST = sp.Rational(1, 10**12)
"""Of the Stribeck velocity: below it friction no longer follows a curve whose slope at rest may be infinite."""


class StribeckCurve(FrictionLaw):
    """Base of laws with the Stribeck curve g(v) = μ_C + (μ_S − μ_C) exp(−|v/v_S|^δ_S).

    The exponent δ_S is 2 unless given (Gauss). Lubricated and dry pairs were measured from 0.5 to 2 and more
    (Armstrong-Hélouvry 1991): with 2 friction hardly falls far below v_S, with 1 and less it falls most at rest.
    """

    mu_coulomb: float = parameter("1", positive, "Coulomb friction coefficient μ_C")
    mu_static: float = parameter("1", positive, "static friction coefficient μ_S")
    v_stribeck: float = parameter("m/s", positive, "Stribeck velocity v_S")
    viscous: float = parameter("s/m", nonnegative, "viscous coefficient σ2, per unit normal stress", default=0.0)
    stribeck_exponent: float | None = parameter(
        "1", positive, "Stribeck exponent δ_S; 2 unless given", default=None, standing=2.0
    )

    def _curve(self, v: Expression) -> Expression:
        """g(v), the falling part of the friction coefficient."""
        fast = (v / self.v_stribeck) ** 2
        if self.stribeck_exponent is not None:
            fast = (fast + REST**2) ** (self.stribeck_exponent / 2)
        return self.mu_coulomb + (self.mu_static - self.mu_coulomb) * sp.exp(-fast)


class CoulombStribeck(StribeckCurve, name="coulomb-stribeck"):
    """Friction that depends on velocity only, on the present one or on that of a moment ago.

    τ = σ[g(v) + σ2 v], g as in `StribeckCurve`. Without a memory there is no critical stiffness: where friction falls
    with velocity, the quasistatic problem is ill-posed and with mass no stiffness stabilises. Here to show just that.

    With a `lag` δ the curve follows velocity late, τ = σ[g(v(t − δ)) + σ2 v(t)]: the frictional memory of
    Hess & Soom (1990) and Armstrong-Hélouvry (1991). Then stiffnesses are stable and unstable by turns.
    """

    lag: float = parameter(
        "s", nonnegative, "time δ by which the curve follows velocity late", default=0.0, structural=True, kind="delay"
    )

    def strength(self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression) -> Expression:
        return sigma * (self._curve(v) * sp.sign(v) + self.viscous * v)

    def lateness(self) -> Expression:
        return self.lag

    def late_strength(
        self, v: Expression, late: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> Expression:
        return sigma * (self._curve(late) * sp.sign(v) + self.viscous * v)


class LuGre(StribeckCurve, name="lugre"):
    """LuGre friction (Canudas de Wit et al. 1995), per unit normal stress.

    τ = σ[σ0 z + σ1 ż + σ2 v], ż = v − σ0 |v| z/g(v), with the mean bristle deflection z (m) as memory.
    """

    bristle_stiffness: float = parameter("1/m", positive, "bristle stiffness σ0, per unit normal stress")
    bristle_damping: float = parameter("s/m", nonnegative, "bristle damping σ1, per unit normal stress", default=0.0)

    def memory(self) -> tuple[str, ...]:
        return ("z",)

    def memory_units(self) -> tuple[str, ...]:
        return ("m",)

    def meanings(self) -> dict[str, str]:
        return {"z": "mean deflection of the bristles"}

    def strength(self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression) -> Expression:
        (rate,) = self.rates(v, sigma, memory, tau)
        return sigma * (self.bristle_stiffness * memory[0] + self.bristle_damping * rate + self.viscous * v)

    def rates(
        self, v: Expression, sigma: Expression, memory: tuple[Expression, ...], tau: Expression
    ) -> tuple[Expression, ...]:
        return (v - self.bristle_stiffness * sp.Abs(v) * memory[0] / self._curve(v),)

    def steady_memory(self, v: Expression, sigma: Expression) -> tuple[Expression, ...]:
        return (self._curve(v) / self.bristle_stiffness,)

    def steady_strength(self, v: Expression, sigma: Expression) -> Expression:
        return sigma * (self._curve(v) + self.viscous * v)
