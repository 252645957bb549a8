"""What every contact law provides: the normal stress as a function of the motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from steadyslip.core.domains import positive
from steadyslip.core.errors import NotAvailable, Problem
from steadyslip.core.records import FrozenRecord, parameter

Expression = Any  # SymPy expression, or a plain number when a law is evaluated by hand


@dataclass(frozen=True)
class Motion:
    """Everything that a normal stress may depend on; the symbols handed to a contact law.

    Attributes
    ----------
    slip
        x (m): slip of the block ahead of the load point, relative to steady sliding.
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
        Distance (m) of the surfaces from where they just touch, in steady sliding too, and its rate (m/s). Only bodies
        of a machine that move away from the surface have one; a law that depends on it is `is_compliant`.
    memory, steady_memory
        The law's own states, in steady sliding too; empty for most.
    outside
        Change (Pa) of the pressure around the contact, of laws that have pores.
    """

    slip: Expression
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
    def steady(self) -> Motion:
        """The same contact in steady sliding."""
        return replace(
            self,
            slip=0,
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
    """How a mechanism is sketched.

    Attributes
    ----------
    rise : float
        Angle (rad) by which the spring leaves the surface; below zero it presses the block into it, from behind.
    tilt : float
        Angle (rad) by which the surface rises in the direction of sliding.
    between : str
        What is between the surfaces: ``film``, ``layer`` or nothing.
    part : str
        What there is besides: ``wedge``, ``crank`` or nothing.
    load : str
        Letter of what presses the block from above; empty where nothing does.
    """

    rise: float = 0.0
    tilt: float = 0.0
    between: str = ""
    part: str = ""
    load: str = "σ₀"


class ContactLaw(FrozenRecord, family="contact law"):
    """Base of contact laws: normal stress σ (Pa, compression positive) from the motion.

    σ = `load` + `coupling`(motion): a part that does not depend on the motion, and one that does. Where
    the law is given by its steady normal stress instead of its load, the coupling counts from its
    steady value. σ <= 0 is loss of contact. Laws are pure, read their own fields, return SymPy
    expressions.
    """

    def load(self) -> Expression | None:
        """Normal stress without the coupling, σ0 (Pa); None if `steady_stress` is given instead."""
        raise NotImplementedError

    def steady_stress(self) -> Expression | None:
        """Normal stress in steady sliding, σss (Pa), where it is given instead of the load."""
        return None

    def coupling(self, motion: Motion) -> Expression:
        """Normal stress due to the motion (Pa)."""
        return 0

    def memory(self) -> tuple[str, ...]:
        """Names of the law's own states, which are continuous; empty for a law without."""
        return ()

    def memory_units(self) -> tuple[str, ...]:
        """SI units of the states."""
        return tuple("Pa" for _ in self.memory())

    def rates(self, motion: Motion) -> tuple[Expression, ...]:
        """Time derivatives of the states."""
        return ()

    def steady_memory(self, velocity: Expression) -> tuple[Expression, ...]:
        """The states in steady sliding at a `velocity` > 0."""
        return ()

    def is_imposed(self) -> bool:
        """Whether the normal stress is given from outside, whatever the block does."""
        return type(self).coupling is ContactLaw.coupling

    def has_pores(self) -> bool:
        """Whether fluid in its pores feels the pressure around, `Motion.outside`."""
        return False

    def is_compliant(self) -> bool:
        """Whether it depends on the distance of the surfaces, so that bodies must be able to move apart."""
        return False

    def imposed(self, time: Expression) -> Expression:
        """Prescribed change of normal stress with time (Pa), zero on average."""
        return 0

    def normal_stress(self, motion: Motion) -> Expression:
        """Normal stress σ (Pa), the imposed part left out."""
        load = self.load()
        if load is not None:
            return load + self.coupling(motion)
        return self.steady_stress() + self.coupling(motion) - self.coupling(motion.steady)

    def sliding_stiffness(self, axial_stiffness: Expression) -> Expression:
        """Stiffness along the sliding direction of a spring with the given stiffness along its axis."""
        raise NotAvailable(
            f"the contact {self.name!r} has no axis at an angle; give stiffness instead of axial_stiffness"
        )

    def has_axis(self) -> bool:
        """Whether `sliding_stiffness` is defined."""
        return type(self).sliding_stiffness is not ContactLaw.sliding_stiffness

    def lock_up(self, friction_coefficient: float) -> str:
        """The lock-up condition in this law's own terms, empty if it has none to add."""
        return ""

    def shape(self) -> Shape:
        """How the mechanism is sketched: a block on a plane, pulled along it."""
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
        "normal stress σss in steady sliding, instead of preload",
        default=None,
        kind="normal stress",
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
