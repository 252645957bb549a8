"""Contact with pore fluid: dilatancy lowers pore pressure, which drainage restores."""

from __future__ import annotations

import sympy as sp

from steadyslip.core.domains import positive, real
from steadyslip.core.records import parameter
from steadyslip.laws.contact.law import ContactInputs, Expression, PreloadedContact


class PoreFluid(PreloadedContact, name="pore-fluid"):
    """Pore fluid with dilatancy and drainage (Segall & Rice 1995): σ' = σ0 − p, the effective normal stress.

    Porosity φ follows slip, φ̇ = −(v/d_c)[φ − φ0 − ε ln(v/v_ref)], and pore pressure p, relative to the surroundings,
    ṗ = −c* p − φ̇/β. The states are both pressures, D = (φ − φ0)/β and p, and `suction` is ε/β, the undrained fall of
    pressure per e-fold of velocity. Injection (a piece of the protocol) changes the surrounding pressure p∞:
    ṗ = −c* (p − p∞) − φ̇/β. `preload` is an effective stress.
    """

    suction: float = parameter("Pa", real, "fall of pore pressure ε/β per e-fold of velocity, undrained")
    drainage: float = parameter(
        "1/s", positive, "rate c* at which pore pressure evens out", letter="c_d",
        kind="drainage",
    )  # fmt: skip
    slip_distance: float = parameter("m", positive, "slip over which porosity follows", letter="d_p")
    v_ref: float = parameter("m/s", positive, "velocity from which porosity counts", gauge=True)

    def memory(self) -> tuple[str, ...]:
        return ("dilation", "pore_pressure")

    def rates(self, motion: ContactInputs) -> tuple[Expression, ...]:
        dilation, pressure = motion.memory
        v = motion.velocity
        opening = -v / self.slip_distance * (dilation - self.suction * sp.log(v / self.v_ref))
        return opening, -self.drainage * (pressure - motion.outside) - opening

    def has_pores(self) -> bool:
        return True

    def steady_memory(self, velocity: Expression) -> tuple[Expression, ...]:
        return self.suction * sp.log(velocity / self.v_ref), sp.Integer(0)

    def coupling(self, motion: ContactInputs) -> Expression:
        return -motion.memory[1]


def porous(stress: float) -> PoreFluid:
    """Contact law with pores at an effective normal stress (Pa), without dilatancy; drainage is a placeholder."""
    return PoreFluid(
        steady_normal_stress=stress, suction=0.0, drainage=0.1,
        slip_distance=1e-5, v_ref=1e-6,
    )  # fmt: skip
