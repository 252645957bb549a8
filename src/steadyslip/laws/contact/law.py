"""Base classes of contact laws, and the motion that they depend on."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import sympy as sp

from steadyslip.core.domains import positive
from steadyslip.core.errors import NotAvailable, Problem
from steadyslip.core.records import FrozenRecord, parameter

Expression = Any  # SymPy expression, or a plain number when a law is evaluated by hand


@dataclass(frozen=True)
class ContactInputs:
    """Variables that a normal stress may depend on; passed to the methods of a contact law.

    Attributes
    ----------
    lead
        x (m): lead of the block over the load point, relative to steady sliding.
    velocity, acceleration
        v (m/s) and v̇ (m/s²) of the block.
    spring, steady_spring
        T and Tss (Pa): stress exerted by the spring (and dashpot, and controller) on the block.
    friction, steady_friction
        τ and τss (Pa): friction stress on the block; τ = T − ηv − m v̇ + q by the balance of forces.
    stiffness
        k (Pa/m): total stiffness between block and load point, gain of a controller included.
    steady_velocity
        v0 (m/s): velocity of slip in steady sliding.
    separation, steady_separation, separation_rate
        Distance (m) of the surfaces from first touch, its steady value and its rate (m/s). Nonzero only for bodies of
        a machine that move away from the surface; a law that depends on it returns True from `is_compliant`.
    memory, steady_memory
        States of the law and their steady values; empty for most laws.
    outside
        Change (Pa) of the pressure around the contact, for laws with pores.
    """

    lead: Expression
    velocity: Expression
    acceleration: Expression
    spring: Expression
    steady_spring: Expression
    friction: Expression
    steady_friction: Expression
    stiffness: Expression
    steady_velocity: Expression
    separation: Expression = 0
    steady_separation: Expression = 0
    separation_rate: Expression = 0
    memory: tuple[Expression, ...] = ()
    steady_memory: tuple[Expression, ...] = ()
    outside: Expression = 0

    @property
    def slip(self) -> Expression:
        """Earlier name of `lead`, kept for laws that use it."""
        warnings.warn("ContactInputs.slip is ContactInputs.lead now", DeprecationWarning, stacklevel=2)
        return self.lead

    @property
    def steady(self) -> ContactInputs:
        """Copy in which all variables have their values in steady sliding."""
        return replace(
            self,
            lead=0,
            velocity=self.steady_velocity,
            acceleration=0,
            separation=self.steady_separation,
            separation_rate=0,
            spring=self.steady_spring,
            friction=self.steady_friction,
            memory=self.steady_memory,
            outside=0,
        )


@dataclass(frozen=True)
class Shape:
    """Shape of the sketch of a mechanism.

    Attributes
    ----------
    rise : float
        Angle (rad) by which the spring leaves the surface; below zero it presses the block into it, from behind.
    tilt : float
        Angle (rad) by which the surface rises in the direction of sliding.
    between : str
        Material between the surfaces: ``film``, ``layer`` or empty.
    part : str
        Additional part: ``wedge``, ``crank`` or empty.
    load : str
        Letter of the load from above; empty if there is none.
    """

    rise: float = 0.0
    tilt: float = 0.0
    between: str = ""
    part: str = ""
    load: str = "σ₀"


class ContactLaw(FrozenRecord, family="contact law"):
    """Base of contact laws: normal stress σ (Pa, compression positive) from the motion.

    σ = `load` + `coupling`(motion): a constant part and a part that depends on the motion. If the steady normal stress
    is given instead of the load, σ is the steady stress plus the change of the coupling from its steady value. σ <= 0
    is loss of contact. Methods are pure, read the record's own fields and return SymPy expressions.
    """

    lock_up: ClassVar[str] = ""
    """Condition for no lock-up, for messages; {inverse} is replaced by 1/μss and {angle} by arccot μss in degrees."""

    def load(self) -> Expression | None:
        """Normal stress without the coupling, σ0 (Pa); None if `steady_stress` is given instead."""
        raise NotImplementedError

    def steady_stress(self) -> Expression | None:
        """Normal stress in steady sliding, σss (Pa), if given instead of the load; else None."""
        return None

    def coupling(self, motion: ContactInputs) -> Expression:
        """Normal stress due to the motion (Pa)."""
        return 0

    def memory(self) -> tuple[str, ...]:
        """Names of the law's states, which are continuous in time; empty if there are none."""
        return ()

    def memory_units(self) -> tuple[str, ...]:
        """SI units of the states; Pa unless overridden."""
        return tuple("Pa" for _ in self.memory())

    def rates(self, motion: ContactInputs) -> tuple[Expression, ...]:
        """Time derivatives of the states (their unit per s)."""
        return ()

    def steady_memory(self, velocity: Expression) -> tuple[Expression, ...]:
        """States in steady sliding at a `velocity` > 0 (m/s)."""
        return ()

    def is_imposed(self) -> bool:
        """True if the normal stress does not depend on the motion."""
        return type(self).coupling is ContactLaw.coupling

    def follows_spring(self) -> bool:
        """True if the normal stress depends on T, the stress that spring, dashpot and controller exert."""
        memory = tuple(sp.Symbol(f"memory_{i}") for i in range(len(self.memory())))
        letters: dict[str, Any] = {item.name: sp.Symbol(item.name) for item in fields(ContactInputs)}
        inputs = ContactInputs(**letters | {"memory": memory, "steady_memory": memory})
        return inputs.spring in sp.sympify(self.coupling(inputs)).free_symbols

    def has_pores(self) -> bool:
        """True if the law depends on the surrounding pore pressure, `ContactInputs.outside`."""
        return False

    def is_compliant(self) -> bool:
        """True if the law depends on the distance of the surfaces, so that its body must be able to move away."""
        return False

    def imposed(self, time: Expression) -> Expression:
        """Prescribed change of normal stress (Pa) as a function of `time` (s), zero on average."""
        return 0

    def normal_stress(self, motion: ContactInputs) -> Expression:
        """Normal stress σ (Pa) without the `imposed` part."""
        load = self.load()
        if load is not None:
            return load + self.coupling(motion)
        return self.steady_stress() + self.coupling(motion) - self.coupling(motion.steady)

    def sliding_stiffness(self, axial_stiffness: Expression) -> Expression:
        """Stiffness k (Pa/m) along the slide of a spring with the given stiffness (Pa/m) along its axis.

        Raises NotAvailable for laws without an inclined axis.
        """
        raise NotAvailable(
            f"the contact {self.name!r} has no axis at an angle; give stiffness instead of axial_stiffness"
        )

    def has_axis(self) -> bool:
        """True if `sliding_stiffness` is defined."""
        return type(self).sliding_stiffness is not ContactLaw.sliding_stiffness

    def shape(self) -> Shape:
        """Shape of the law's sketch; a block pulled along a plane unless overridden."""
        return Shape()


class PreloadedContact(ContactLaw):
    """Base of contacts that take either the preload σ0 or the steady normal stress σss."""

    preload: float | None = parameter(
        "Pa",
        positive,
        "normal stress σ0 without coupling to the motion",
        default=None,
        kind="normal stress",
        letter="sigma_0",
    )
    steady_normal_stress: float | None = parameter(
        "Pa",
        positive,
        "normal stress σ_n in steady sliding, instead of preload",
        default=None,
        kind="normal stress",
        letter="sigma_n",
        standing=1e6,
    )

    def inconsistencies(self) -> Iterator[Problem]:
        if self.preload is None and self.steady_normal_stress is None:
            yield Problem("preload", "missing; give preload or steady_normal_stress")
        if self.preload is not None and self.steady_normal_stress is not None:
            yield Problem("steady_normal_stress", "given beside preload; give one of the two")

    def load(self) -> Expression | None:
        return self.preload

    def steady_stress(self) -> Expression | None:
        return self.steady_normal_stress
