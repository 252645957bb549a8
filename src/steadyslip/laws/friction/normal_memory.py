"""How friction remembers its normal-stress history."""

from __future__ import annotations

from steadyslip.core.records import FrozenRecord, nonnegative, parameter, positive, share


class NormalMemory(FrozenRecord, family="memory of normal stress"):
    """Base of the laws for the memory of normal stress; `RateState` reads their parameters."""


class NoMemory(NormalMemory, name="none"):
    """Friction is proportional to the present normal stress at a given state (α = 0)."""


class LinkerDieterich(NormalMemory, name="linker-dieterich"):
    """Linker & Dieterich (1992): Θ̇ has an extra −α σ̇/(bσ).

    With the memory variable Ψ = bΘ + α ln(σ/σ_ref) no rate of σ is needed and jumps are exact:
    a sudden change σ1 → σ2 moves Θ by −(α/b) ln(σ2/σ1).
    """

    alpha: float | None = parameter(
        "1", nonnegative, "evolutionary share of the response to normal stress, α", default=None
    )
    sigma_ref: float = parameter(
        "Pa", positive, "reference in ln(σ/σ_ref); shifts the memory variable only", default=1e6, gauge=True
    )


class PrakashClifton(NormalMemory, name="prakash-clifton"):
    """Prakash & Clifton (1993): friction follows an effective normal stress σ_e that lags behind σ.

    τ = [gσ + (1 − g)σ_e] μ(v, Θ) and σ̇_e = −(v/d_σ)(σ_e − σ); g = 0 is the classic law without an
    instantaneous response.
    """

    direct_share: float = parameter("1", share, "instantaneous share g of the response", default=0.0)
    slip_distance: float | None = parameter(
        "m", positive, "slip distance d_σ of the lag; d_c unless given", default=None
    )
