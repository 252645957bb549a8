"""How friction remembers its normal-stress history. One class is one memory: strength, rate or offset."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp

from steadyslip.core.conditions import Condition
from steadyslip.core.domains import nonnegative, positive, share
from steadyslip.core.errors import Problem
from steadyslip.core.records import FrozenRecord, parameter
from steadyslip.laws.friction.law import Expression
from steadyslip.laws.friction.state import State


class NormalMemory(FrozenRecord, family="memory of normal stress"):
    """Base of the laws for the memory of normal stress.

    A memory acts in one of two ways, or both. It may put another stress in the place of σ in τ = σ μ(v, bΘ):
    `strength`, of memory variables of its own that follow `rates`. Or it may shift the state when σ changes: the memory
    variable is then Ψ = bΘ + `offset`(σ), which stays continuous when σ jumps, so that no rate of σ is needed. Methods
    are pure, read the record's own fields and return SymPy expressions.
    """

    # A strength of its own.

    def memory(self) -> tuple[str, ...]:
        """Names of its own memory variables; none unless overridden."""
        return ()

    def memory_units(self) -> tuple[str, ...]:
        """Their SI units; stresses unless overridden."""
        return tuple("Pa" for _ in self.memory())

    def meanings(self) -> dict[str, str]:
        """What its own memory variables mean, in a few words, by name; none must be told."""
        return {}

    def strength(self, sigma: Expression, own: tuple[Expression, ...]) -> Expression:
        """The stress (Pa) that friction is proportional to, from σ and its own memory variables."""
        return sigma

    def rates(
        self, speed: Expression, sigma: Expression, own: tuple[Expression, ...], distance: Expression
    ) -> tuple[Expression, ...]:
        """Time derivatives of its own memory variables, at slip rate `speed` >= 0.

        `distance` is the slip distance of friction, None where that has several.
        """
        return ()

    def steady_memory(self, sigma: Expression) -> tuple[Expression, ...]:
        """Its own memory variables in steady sliding."""
        return ()

    def steady_strength(self, sigma: Expression) -> Expression:
        """`strength` in steady sliding; override it where that is shorter."""
        return self.strength(sigma, self.steady_memory(sigma))

    def has_strength(self) -> bool:
        """Whether friction is proportional to anything but σ."""
        return type(self).strength is not NormalMemory.strength

    # A shift of the state.

    def offset(self, sigma: Expression) -> Expression:
        """Ψ − bΘ: what the memory variable holds beside the state, as a function of σ."""
        return sp.Integer(0)

    def parts(self, states: Sequence[State]) -> tuple[Expression, ...]:
        """Parts of `offset` that belong to each of several states: as their b unless overridden."""
        total = sum(state.b for state in states)
        return tuple(state.b / total for state in states)

    def has_offset(self) -> bool:
        """Whether it shifts the state."""
        return type(self).offset is not NormalMemory.offset

    # What it needs of the friction law; names are those of the friction law's fields.

    def problems(self, states: Sequence[State]) -> Iterator[Problem]:
        """Problems with what is given together; `states` are those of the friction law, if it has several."""
        if any(state.alpha is not None for state in states):
            yield Problem("states", "alpha needs normal_memory linker-dieterich")

    def conditions_with(self, states: Sequence[State]) -> Iterator[Condition]:
        """Relations that numbers must obey together."""
        if self.has_offset() and states:
            total = sum(state.b for state in states)
            yield Condition("states", total != 0, "Σb = 0 leaves no way to share the memory of normal stress", (total,))


class NoMemory(NormalMemory, name="none"):
    """Friction is proportional to the present normal stress at a given state (α = 0)."""


class LinkerDieterich(NormalMemory, name="linker-dieterich"):
    """Linker & Dieterich (1992): Θ̇ has an extra −α σ̇/(bσ).

    With the memory variable Ψ = bΘ + α ln(σ/σ_ref) no rate of σ is needed and jumps are exact:
    a sudden change σ1 → σ2 moves Θ by −(α/b) ln(σ2/σ1).
    """

    alpha: float | None = parameter(
        "1", nonnegative, "evolutionary share of the response to normal stress, α", default=None,
        kind="stress share", size=0.2, standing=0.3, idle=0.0,
    )  # fmt: skip
    sigma_ref: float = parameter(
        "Pa", positive, "reference in ln(σ/σ_ref); shifts the memory variable only", default=1e6, gauge=True
    )

    def offset(self, sigma: Expression) -> Expression:
        alpha = 1 if self.alpha is None else self.alpha  # else the states' own
        return alpha * sp.log(sigma / self.sigma_ref)

    def parts(self, states: Sequence[State]) -> tuple[Expression, ...]:
        return tuple(state.alpha for state in states) if self.alpha is None else super().parts(states)

    def problems(self, states: Sequence[State]) -> Iterator[Problem]:
        given = [state.alpha for state in states if state.alpha is not None]
        if given and len(given) < len(states):
            yield Problem("states", "alpha is given for some states only; give it for all or none")
        if given and self.alpha is not None:
            yield Problem("normal_memory.alpha", "given beside the states' own alpha; their sum is α")
        if not given and self.alpha is None:
            yield Problem("normal_memory.alpha", f"missing; allowed: {nonnegative.text}")

    def conditions_with(self, states: Sequence[State]) -> Iterator[Condition]:
        if states and self.alpha is not None:
            total = sum(state.b for state in states)
            message = "Σb = 0 leaves no way to share α; give each state its own alpha"
            yield Condition("states", total != 0, message, (total,))


class PrakashClifton(NormalMemory, name="prakash-clifton"):
    """Prakash & Clifton (1993): friction follows an effective normal stress σ_e that lags behind σ.

    τ = [gσ + (1 − g)σ_e] μ(v, Θ) and σ̇_e = −(v/d_σ)(σ_e − σ); g = 0 is the classic law without an
    instantaneous response.
    """

    direct_share: float = parameter(
        "1", share, "instantaneous share g of the response", default=0.0, size=0.2, idle=1.0
    )
    slip_distance: float | None = parameter(
        "m", positive, "slip distance d_σ of the lag; d_c unless given", default=None, kind="slip distance"
    )

    def memory(self) -> tuple[str, ...]:
        return ("sigma_e",)

    def meanings(self) -> dict[str, str]:
        return {"sigma_e": "normal stress that friction remembers"}

    def strength(self, sigma: Expression, own: tuple[Expression, ...]) -> Expression:
        return self.direct_share * sigma + (1 - self.direct_share) * own[0]

    def rates(
        self, speed: Expression, sigma: Expression, own: tuple[Expression, ...], distance: Expression
    ) -> tuple[Expression, ...]:
        lag = distance if self.slip_distance is None else self.slip_distance
        return (-speed / lag * (own[0] - sigma),)

    def steady_memory(self, sigma: Expression) -> tuple[Expression, ...]:
        return (sigma,)

    def steady_strength(self, sigma: Expression) -> Expression:
        return sigma

    def problems(self, states: Sequence[State]) -> Iterator[Problem]:
        yield from super().problems(states)
        if states and self.slip_distance is None:
            yield Problem("normal_memory.slip_distance", "missing; it has no default with several states")
