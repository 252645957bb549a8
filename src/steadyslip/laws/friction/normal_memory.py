"""Laws for the memory of normal stress: the response of friction to the history of σ; one class per law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp

from steadyslip.core.domains import Condition, nonnegative, positive, share
from steadyslip.core.errors import Problem
from steadyslip.core.records import FrozenRecord, parameter
from steadyslip.laws.friction.law import Expression, Expressions, State


class NormalMemory(FrozenRecord, family="memory of normal stress"):
    """Base of the laws for the memory of normal stress.

    A memory acts in one of two ways, or both. Either `strength`, a function of additional memory variables with
    `rates`, replaces σ in τ = σ μ(v, bΘ). Or the state shifts when σ changes: the memory variable is then
    Ψ = bΘ + `offset`(σ), which stays continuous when σ jumps, so that no rate of σ is needed. Methods are pure, read
    the record's own fields and return SymPy expressions.
    """

    # strength

    def memory(self) -> tuple[str, ...]:
        """Names of the additional memory variables; none by default."""
        return ()

    def memory_units(self) -> tuple[str, ...]:
        """SI units of the additional memory variables; Pa by default."""
        return tuple("Pa" for _ in self.memory())

    def meanings(self) -> dict[str, str]:
        """Short explanations of the additional memory variables, by name; may be incomplete."""
        return {}

    def strength(self, sigma: Expression, own: Expressions) -> Expression:
        """Stress (Pa) that friction is proportional to, from σ and the additional memory variables."""
        return sigma

    def rates(self, speed: Expression, sigma: Expression, own: Expressions, distance: Expression) -> Expressions:
        """Time derivatives of the additional memory variables at slip rate `speed` >= 0 (m/s).

        `distance` is the slip distance d_c (m) of the friction law, None if it has several.
        """
        return ()

    def steady_memory(self, sigma: Expression) -> Expressions:
        """Additional memory variables in steady sliding."""
        return ()

    def steady_strength(self, sigma: Expression) -> Expression:
        """Value of `strength` in steady sliding (Pa); to be overridden if a shorter expression exists."""
        return self.strength(sigma, self.steady_memory(sigma))

    def has_strength(self) -> bool:
        """True if `strength` is overridden: friction is proportional to a stress other than σ."""
        return type(self).strength is not NormalMemory.strength

    # shift of the state

    def offset(self, sigma: Expression) -> Expression:
        """Difference Ψ − bΘ between the memory variable and bΘ, as a function of σ (Pa)."""
        return sp.Integer(0)

    def parts(self, states: Sequence[State]) -> Expressions:
        """Shares of `offset` for each of several states: proportional to their b by default."""
        total = sum(state.b for state in states)
        return tuple(state.b / total for state in states)

    def has_offset(self) -> bool:
        """True if `offset` is overridden: normal stress shifts the state."""
        return type(self).offset is not NormalMemory.offset

    # requirements on the friction law; names in problems are those of the law's fields

    def problems(self, states: Sequence[State]) -> Iterator[Problem]:
        """Yield Problems with forbidden combinations; `states` are those of the friction law, if it has several."""
        if any(state.alpha is not None for state in states):
            yield Problem("states", "alpha needs normal_memory linker-dieterich")

    def conditions_with(self, states: Sequence[State]) -> Iterator[Condition]:
        """Yield conditions between parameters."""
        if self.has_offset() and states:
            total = sum(state.b for state in states)
            yield Condition("states", total != 0, "Σb = 0 leaves no way to share the memory of normal stress", (total,))


class NoMemory(NormalMemory, name="none"):
    """Friction is proportional to the present normal stress at a given state (α = 0)."""


class LinkerDieterich(NormalMemory, name="linker-dieterich"):
    """Linker & Dieterich (1992): dΘ/dt has an extra −α σ̇/(bσ).

    With the memory variable Ψ = bΘ + α ln(σ/σ_ref) no rate of σ is needed and jumps are exact:
    a sudden change σ1 → σ2 moves Θ by −(α/b) ln(σ2/σ1).
    """

    alpha: float | None = parameter(
        "1", nonnegative, "evolutionary share of the response to normal stress, α", default=None,
        kind="stress share", size=0.2, standing=0.3, idle=0.0,
    )  # fmt: skip
    sigma_ref: float = parameter(
        "Pa",
        positive,
        "reference in ln(σ/σ_ref); shifts the memory variable only",
        default=1e6,
        gauge=True,
        letter="sigma_ref",
    )

    def offset(self, sigma: Expression) -> Expression:
        alpha = 1 if self.alpha is None else self.alpha  # if None, `parts` uses the alpha of each state
        return alpha * sp.log(sigma / self.sigma_ref)

    def parts(self, states: Sequence[State]) -> Expressions:
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
    """Prakash & Clifton (1993): friction is proportional to an effective normal stress σ_e that lags behind σ.

    τ = [gσ + (1 − g)σ_e] μ(v, Θ) and σ̇_e = −(v/d_σ)(σ_e − σ); g = 0 is the classic law without an
    instantaneous response.
    """

    direct_share: float = parameter(
        "1", share, "instantaneous share g of the response", default=0.0,
        kind="immediate share", size=0.2, standing=0.5, idle=1.0, letter="g",
    )  # fmt: skip
    slip_distance: float | None = parameter(
        "m", positive, "slip distance d_σ of the lag; d_c unless given", default=None,
        kind="slip distance", standing=1e-5, letter="d_sigma",
    )  # fmt: skip

    def memory(self) -> tuple[str, ...]:
        return ("sigma_e",)

    def meanings(self) -> dict[str, str]:
        return {"sigma_e": "normal stress that friction remembers"}

    def strength(self, sigma: Expression, own: Expressions) -> Expression:
        return self.direct_share * sigma + (1 - self.direct_share) * own[0]

    def rates(self, speed: Expression, sigma: Expression, own: Expressions, distance: Expression) -> Expressions:
        lag = distance if self.slip_distance is None else self.slip_distance
        return (-speed / lag * (own[0] - sigma),)

    def steady_memory(self, sigma: Expression) -> Expressions:
        return (sigma,)

    def steady_strength(self, sigma: Expression) -> Expression:
        return sigma

    def problems(self, states: Sequence[State]) -> Iterator[Problem]:
        yield from super().problems(states)
        if states and self.slip_distance is None:
            yield Problem("normal_memory.slip_distance", "missing; it has no default with several states")
