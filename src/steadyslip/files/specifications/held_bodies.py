"""Bodies of a rig in forces, and the springs that hold them: what questions about sizes compare."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from steadyslip.core.format import format_quantity
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig

YOUNG, SHEAR, DENSITY = 2.1e11, 8e10, 7850.0  # Pa, Pa, kg/m^3, of steel


class HeldBody(NamedTuple):
    """A body and what holds it in its direction of motion.

    Attributes
    ----------
    name : str
    turns : bool
    inertia : float
        Mass (kg) or moment of inertia (kg m²); inf of ground and drive.
    pull, load : float
        Friction at rest, and the constant force (N or N m).
    speed : float
        In steady sliding, m/s or rad/s; 0 where a place is held.
    springs : dict of str to float
        Stiffness at the body (N/m or N m/rad) by the name of its parameter.
    """

    name: str
    turns: bool
    inertia: float
    pull: float
    load: float
    speed: float
    springs: dict[str, float]

    @property
    def told(self) -> str:
        """Inertia with its unit."""
        return format_quantity(self.inertia, "kg m^2" if self.turns else "kg")

    @property
    def block(self) -> float:
        """Stiffness of a cube of steel as heavy (N/m), or of a cylinder as thick as long with its inertia (N m/rad)."""
        if not self.turns:
            return YOUNG * math.cbrt(self.inertia / DENSITY)
        across: float = (32 * self.inertia / (math.pi * DENSITY)) ** 0.2
        return SHEAR * math.pi * across**3 / 32

    @property
    def ball(self) -> float:
        """Radius (m) of a ball of steel with the moment of inertia of a body that turns."""
        radius: float = (15 * self.inertia / (8 * math.pi * DENSITY)) ** 0.2
        return radius


APART = HeldBody("", False, math.inf, 0.0, 0.0, 0.0, {})
"""The ground, or the load point of the drive."""


class HoldingSpring(NamedTuple):
    """A spring between two bodies: stiffness (N/m or N m/rad) at the second, speed of that for one of the first."""

    stiffness: float
    ratio: float
    first: HeldBody
    second: HeldBody

    @property
    def ends(self) -> list[tuple[HeldBody, float]]:
        """Bodies at its ends, and the stiffness there."""
        both = ((self.first, self.stiffness * self.ratio**2), (self.second, self.stiffness))
        return [one for one in both if one[0] is not APART]

    @property
    def frequency(self) -> float:
        """Natural frequency (Hz) of the two ends against each other; inf where one has no inertia."""
        inverse = sum(stiffness / body.inertia if body.inertia else math.inf for body, stiffness in self.ends)
        return math.sqrt(inverse) / (2 * math.pi)

    @property
    def heavier(self) -> tuple[HeldBody, float]:
        """The slower of its ends on this spring, and the stiffness there."""
        return min(self.ends, key=lambda one: one[1] / one[0].inertia if one[0].inertia else math.inf)


def bodies_of(rig: Rig) -> dict[str, HeldBody]:
    """Bodies of a rig by name, with no springs yet: of a slider one named ``slider``; without structures."""
    if not isinstance(rig, Machine):
        pull = friction_at_rest(rig, "friction.any") * (rig.load_of("friction.any") or 0.0)
        mass = (rig.value("slider.mass") or 0.0) * (rig.area or 1.0)
        return {"slider": HeldBody("the slider", False, mass, pull, 0.0, abs(float(rig.drive.velocity)), {})}
    speeds = {} if rig.holds else rig.speeds()
    found = {}
    for name, body in rig.bodies.items():
        if not body.is_structure:
            load, speed = abs(float(body.along())), abs(float(speeds.get(name, 0.0)))
            found[name] = HeldBody(name, body.turns, float(body.inertia_of()), 0.0, load, speed, {})
    for name, surface in rig.contacts.items():
        if one := found.get(surface.held):
            parameter = f"contacts.{name}.friction.any"
            pull = friction_at_rest(rig, parameter) * (rig.load_of(parameter) or 0.0) * (surface.radius or 1.0)
            found[surface.held] = one._replace(pull=one.pull + pull)
    return found


def springs_of(rig: Rig, bodies: Mapping[str, HeldBody]) -> dict[str, HoldingSpring]:
    """Springs along the motion by the names of their stiffnesses, which are noted at `bodies` too."""
    found = {}
    for name, link in rig.links.items() if isinstance(rig, Machine) else ():
        ends = [APART if end not in rig.bodies else bodies.get(end) for end in link.between]
        if link.rigidity() is not None and "x" in link.directions() and not any("." in end for end in link.between):
            first, second = (end for end in ends if end is not None)
            found[f"links.{name}.stiffness"] = HoldingSpring(float(link.rigidity()), float(link.ratio()), first, second)
    for name in rig.of_kind("stiffness"):
        if name.startswith("slider.") and (stiffness := (rig.value(name) or 0.0) * (rig.area or 1.0)):
            found[name] = HoldingSpring(stiffness, 1.0, APART, bodies["slider"])
    for name, spring in found.items():
        for body, stiffness in spring.ends:
            body.springs[name] = stiffness
    return found


def mass_at(rig: Rig, name: str) -> str:
    """Name of the mass of what slides at the contact whose parameter this is."""
    return f"bodies.{rig.contacts[name.split('.')[1]].body}.mass" if isinstance(rig, Machine) else "slider.mass"


def mass_on(rig: Rig, name: str) -> float:
    """Mass (kg) of the body that slides at the contact whose parameter this is; 0 if it is not known."""
    address = rig.parameters().get(mass_at(rig, name))
    return (address.value or 0.0) * (1.0 if isinstance(rig, Machine) else rig.area or 0.0) if address else 0.0


def is_of_forces(rig: Rig, name: str) -> bool:
    """True if the friction of a contact is given as forces, pressed with 1 N, so that no size is unusual."""
    return rig.load_of(name) == 1.0


def friction_at_rest(rig: Rig, name: str) -> float:
    """Friction coefficient at rest beside this parameter of a friction law; 0 if the law has none."""
    address = rig.parameters().get(f"{name.rpartition('.')[0]}.mu_static")
    return address.value if address and address.value else 0.0
