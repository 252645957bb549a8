"""Evolution laws of the state of rate-and-state friction at constant normal stress.

Θ is the dimensionless state, −ln(v/v_ref) in steady sliding for every law, so slip, aging and PRZ laws have the same
linearisation and differ only in higher order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp

from steadyslip.core.domains import Condition, nonnegative
from steadyslip.core.errors import Problem
from steadyslip.core.records import FrozenRecord, parameter
from steadyslip.laws.friction.law import Expression, State
from steadyslip.laws.friction.normal_memory import NormalMemory


class Evolution(FrozenRecord, family="evolution law"):
    """Base of evolution laws: rate dΘ/dt at constant normal stress."""

    def rate(self, v: Expression, state: Expression, d_c: Expression, v_ref: Expression) -> Expression:
        """Rate of Θ (1/s) at slip rate `v` >= 0, slip distance `d_c` and reference rate `v_ref`."""
        raise NotImplementedError

    def scaled_rate(
        self, v: Expression, b_theta: Expression, b: Expression, d_c: Expression, v_ref: Expression
    ) -> Expression:
        """Rate of bΘ (1/s) as a function of bΘ; to be overridden if this rate is defined for b = 0."""
        return b * self.rate(v, b_theta / b, d_c, v_ref)

    def divides(self) -> bool:
        """True if `scaled_rate` divides by b."""
        return type(self).scaled_rate is Evolution.scaled_rate

    def offset(self, sigma: Expression, tau: Expression) -> Expression:
        """Difference Ψ − bΘ as a function of the stresses: the part of the memory that follows stresses at once."""
        return sp.Integer(0)

    def has_offset(self) -> bool:
        """True if `offset` is overridden: the state responds to stresses."""
        return type(self).offset is not Evolution.offset

    def problems(self, states: Sequence[State], memory: NormalMemory) -> Iterator[Problem]:
        """Yield Problems with forbidden combinations; names are those of the friction law's fields."""
        yield from ()

    def conditions_with(self, b: Expression) -> Iterator[Condition]:
        """Yield conditions between parameters; `b` is that of the friction law if it has one state."""
        yield from ()

    def state_time(self, state: Expression, d_c: Expression, v_ref: Expression) -> Expression:
        """State θ (s) in its usual form, from Θ = ln(v_ref θ/d_c) unless overridden."""
        return d_c / v_ref * sp.exp(state)


class Slip(Evolution, name="slip"):
    """Slip law (Ruina 1983; eq. 1 of Dupont & Bapna): dΘ/dt = −(v/d_c)[ln(v/v_ref) + Θ]."""

    def rate(self, v: Expression, state: Expression, d_c: Expression, v_ref: Expression) -> Expression:
        return -v / d_c * (sp.log(v / v_ref) + state)

    def scaled_rate(
        self, v: Expression, b_theta: Expression, b: Expression, d_c: Expression, v_ref: Expression
    ) -> Expression:
        return -v / d_c * (b * sp.log(v / v_ref) + b_theta)  # no division by b, which may be zero


class Aging(Evolution, name="aging"):
    """Aging law (Dieterich 1979): θ̇ = 1 − vθ/d_c, with Θ = ln(v_ref θ/d_c)."""

    def rate(self, v: Expression, state: Expression, d_c: Expression, v_ref: Expression) -> Expression:
        return v_ref / d_c * sp.exp(-state) - v / d_c


class PRZ(Evolution, name="prz"):
    """Perrin–Rice–Zheng law (1995): θ̇ = 1 − (vθ/2d_c)², with Θ = ln(v_ref θ/2d_c)."""

    def rate(self, v: Expression, state: Expression, d_c: Expression, v_ref: Expression) -> Expression:
        return v_ref / (2 * d_c) * sp.exp(-state) - v**2 / (2 * d_c * v_ref) * sp.exp(state)

    def state_time(self, state: Expression, d_c: Expression, v_ref: Expression) -> Expression:
        return 2 * d_c / v_ref * sp.exp(state)


class Nagata(Aging, name="nagata"):
    """Nagata law (Nagata et al. 2012): aging with an extra −(c_N θ/b) d(τ/σ)/dt.

    The memory variable Ψ = bΘ + c_N τ/σ integrates the extra term exactly; `rate` is the aging part.
    """

    c_nagata: float = parameter("1", nonnegative, "stress-weakening coefficient c_N", idle=0.0, letter="c_N")

    def offset(self, sigma: Expression, tau: Expression) -> Expression:
        return self.c_nagata * tau / sigma

    def problems(self, states: Sequence[State], memory: NormalMemory) -> Iterator[Problem]:
        if states:
            yield Problem("evolution", f"{self.name} is defined for one state; use slip, aging or prz")
        if memory.has_strength():
            word = memory.name
            yield Problem("normal_memory", f"{word} is not defined with {self.name}; use none or linker-dieterich")

    def conditions_with(self, b: Expression) -> Iterator[Condition]:
        yield Condition("b", b != 0, f"got 0; {self.name} divides by b, use aging instead", (b,))
