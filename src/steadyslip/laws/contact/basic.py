"""Contact laws without a mechanism: constant, prescribed in time, general linear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import sympy as sp

from steadyslip.core.domains import Condition, nonnegative, positive, real
from steadyslip.core.records import parameter
from steadyslip.laws.contact.law import ContactInputs, ContactLaw, Expression, PreloadedContact


class ConstantNormalStress(PreloadedContact, name="constant"):
    """A normal stress that never changes (dead weight, servo-controlled press)."""


def pressed_at(stress: float, like: ContactLaw | None = None) -> ContactLaw:
    """Contact law with a constant normal stress (Pa); if `like` has pores, a copy of it with this effective stress."""
    if isinstance(like, PreloadedContact) and like.has_pores():
        return replace(like, preload=None, steady_normal_stress=stress)
    return ConstantNormalStress(steady_normal_stress=stress)


class Prescribed(PreloadedContact, name="prescribed"):
    """A normal stress imposed from outside: σ(t) = σ0 + amplitude · cos(2πt/period).

    Stability is that of sliding at the mean; the response to the oscillation is the transfer function
    of `steadyslip.state_space` from the input ``normal_disturbance`` (the B4 of eq. 12).
    """

    amplitude: float = parameter("Pa", nonnegative, "amplitude of the oscillation", default=0.0)
    period: float | None = parameter("s", positive, "period of the oscillation", default=None)

    def conditions(self) -> Iterator[Condition]:
        mean = self.preload if self.preload is not None else self.steady_normal_stress
        if self.period is None:
            message = "missing; amplitude needs a period, such as '10 s'"
            yield Condition("period", self.amplitude == 0, message, (self.amplitude,))
        if mean is not None:
            message = "got {}; allowed: less than the mean {} Pa"
            yield Condition("amplitude", self.amplitude < mean, message, (self.amplitude, mean))

    def imposed(self, time: Expression) -> Expression:
        if self.period is None:
            return 0
        return self.amplitude * sp.cos(2 * sp.pi * time / self.period)


class LinearNormalStress(PreloadedContact, name="linear"):
    """The general linear law, eq. 12 of Dupont & Bapna: σ̂ = (B0 s² + B1 s + k B2 + B3) x̂.

    σ = σss + B0 v̇ + B1 (v − v0) + (k B2 + B3) x; x is the slip ahead of steady sliding and k the total
    stiffness between block and load point. Positive coefficients press harder as the block runs ahead.
    """

    b0: float = parameter("kg/m^2", real, "B0, with acceleration", default=0.0, structural=True)
    b1: float = parameter("Pa s/m", real, "B1, with velocity", default=0.0, structural=True)
    b2: float = parameter("1", real, "B2, with displacement through the stiffness", default=0.0, structural=True)
    b3: float = parameter("Pa/m", real, "B3, with displacement directly", default=0.0, structural=True)

    def coupling(self, motion: ContactInputs) -> Expression:
        return (
            self.b0 * motion.acceleration
            + self.b1 * (motion.velocity - motion.steady_velocity)
            + (motion.stiffness * self.b2 + self.b3) * motion.lead
        )
