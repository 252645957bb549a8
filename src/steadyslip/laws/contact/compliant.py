"""Compliant contact: normal stress from the approach of the surfaces."""

from __future__ import annotations

from steadyslip.core.domains import nonnegative, positive
from steadyslip.core.records import parameter
from steadyslip.laws.contact.law import ContactInputs, ContactLaw, Expression


class Compliant(ContactLaw, name="compliant"):
    """Surfaces with a normal stiffness and damping: σ = −k_n u − c_n u̇ with u their distance.

    For bodies of a machine that move away from the surface (`PlanarBody`), so that normal and tangential vibration
    couple. The steady normal force follows from the balance of forces, or is given if it is known (a clamping force
    measured in service); u is then measured from its value in steady sliding.
    """

    normal_stiffness: float = parameter("Pa/m", positive, "normal stiffness k_n", kind="stiffness", letter="k_n")
    normal_damping: float = parameter(
        "Pa s/m", nonnegative, "normal damping c_n", default=0.0, structural=True, letter="c_n"
    )

    steady_normal_stress: float | None = parameter(
        "Pa",
        positive,
        "normal stress σ_n in steady sliding, if that is known",
        default=None,
        kind="normal stress",
        letter="sigma_n",
    )

    def load(self) -> Expression | None:
        return 0 if self.steady_normal_stress is None else None

    def steady_stress(self) -> Expression | None:
        return self.steady_normal_stress

    def coupling(self, motion: ContactInputs) -> Expression:
        return -self.normal_stiffness * motion.separation - self.normal_damping * motion.separation_rate

    def is_compliant(self) -> bool:
        return True
