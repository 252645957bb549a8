"""Bodies of a rig and the springs that hold them, in N, kg and N/m, for warnings of implausible sizes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from steadyslip.core.format import format_quantity
from steadyslip.machine.rig import Rig

YOUNG, SHEAR, DENSITY = 2.1e11, 8e10, 7850.0  # Pa, Pa, kg/m^3, of steel


class HeldBody(NamedTuple):
    """A body, and the loads and springs on it in its direction of motion.

    Attributes
    ----------
    name : str
    turns : bool
    inertia : float
        Mass (kg) or moment of inertia (kg m²); inf for ground and drive.
    pull, load : float
        Friction at rest, and constant force (both N or N m).
    speed : float
        Speed in steady sliding, m/s or rad/s; 0 if the drive holds a position.
    springs : dict of str to float
        Stiffness at the body (N/m or N m/rad) by parameter name.
    """

    name: str
    turns: bool
    inertia: float
    pull: float
    load: float
    speed: float
    springs: dict[str, float]

    @property
    def text(self) -> str:
        """Inertia as text with its unit."""
        return format_quantity(self.inertia, "kg m^2" if self.turns else "kg")

    @property
    def block(self) -> float:
        """Stiffness of a steel cube of equal mass (N/m) or, if the body turns, of a steel cylinder of equal inertia.

        The cylinder is as long as it is thick, and its stiffness is torsional (N m/rad).
        """
        if not self.turns:
            return YOUNG * math.cbrt(self.inertia / DENSITY)
        across: float = (32 * self.inertia / (math.pi * DENSITY)) ** 0.2
        return SHEAR * math.pi * across**3 / 32

    @property
    def ball(self) -> float:
        """Radius (m) of a steel ball with the moment of inertia of a body that turns."""
        radius: float = (15 * self.inertia / (8 * math.pi * DENSITY)) ** 0.2
        return radius


FIXED_END = HeldBody("", False, math.inf, 0.0, 0.0, 0.0, {})
"""Stands for the ground, or the load point of the drive, at an end of a spring."""


class HoldingSpring(NamedTuple):
    """A spring between two bodies: stiffness felt at the second body, N/m or N m/rad, and the ratio of their speeds.

    `ratio` is the speed of the second body over that of the first.
    """

    stiffness: float
    ratio: float
    first: HeldBody
    second: HeldBody

    @property
    def ends(self) -> list[tuple[HeldBody, float]]:
        """Bodies at the ends of the spring (ground and drive left out), each with the stiffness felt at that end."""
        both = ((self.first, self.stiffness * self.ratio**2), (self.second, self.stiffness))
        return [one for one in both if one[0] is not FIXED_END]

    @property
    def frequency(self) -> float:
        """Natural frequency (Hz) of the two bodies on this spring; inf if one of them has no inertia."""
        inverse = sum(stiffness / body.inertia if body.inertia else math.inf for body, stiffness in self.ends)
        return math.sqrt(inverse) / (2 * math.pi)

    @property
    def heavier(self) -> tuple[HeldBody, float]:
        """Body that would have the lower natural frequency alone on this spring, and the stiffness at its end."""
        return min(self.ends, key=lambda one: one[1] / one[0].inertia if one[0].inertia else math.inf)


def bodies_of(rig: Rig) -> dict[str, HeldBody]:
    """Bodies of a rig by name, without springs and structures; a slider has one, ``slider``."""
    if not rig.bodies:
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
    """Springs along the motion, by the name of their stiffness; they are also added to `bodies[...].springs`."""
    found = {}
    for name, link in rig.links.items():
        ends = [FIXED_END if end not in rig.bodies else bodies.get(end) for end in link.between]
        if link.rigidity() is not None and "x" in link.directions() and not any("." in end for end in link.between):
            first, second = (end for end in ends if end is not None)
            found[f"links.{name}.stiffness"] = HoldingSpring(float(link.rigidity()), float(link.ratio()), first, second)
    for name in rig.of_kind("stiffness"):
        if name.startswith("slider.") and (stiffness := (rig.value(name) or 0.0) * (rig.area or 1.0)):
            found[name] = HoldingSpring(stiffness, 1.0, FIXED_END, bodies["slider"])
    for name, spring in found.items():
        for body, stiffness in spring.ends:
            body.springs[name] = stiffness
    return found


def mass_at(rig: Rig, name: str) -> str:
    """Name of the mass of the body that slides at the contact to which the parameter `name` belongs."""
    return f"bodies.{rig.contacts[name.split('.')[1]].body}.mass" if rig.contacts else "slider.mass"


def mass_on(rig: Rig, name: str) -> float:
    """Mass (kg) of the body that slides at the contact to which the parameter `name` belongs; 0 if not known."""
    address = rig.parameters().get(mass_at(rig, name))
    return (address.value or 0.0) * (1.0 if rig.in_forces else rig.area or 0.0) if address else 0.0


def is_of_forces(rig: Rig, name: str) -> bool:
    """True if friction at a contact is given in N, at a load of 1 N, so that coefficients may have any size."""
    return rig.load_of(name) == 1.0


def friction_at_rest(rig: Rig, name: str) -> float:
    """Static friction coefficient of the law to which the parameter `name` belongs; 0 if the law has none."""
    address = rig.parameters().get(f"{name.rpartition('.')[0]}.mu_static")
    return address.value if address and address.value else 0.0
