"""Bodies of a machine: inertia, constant forces and kind of motion."""

from __future__ import annotations

from typing import Any, ClassVar

from steadyslip.core.domains import nonnegative, real
from steadyslip.core.records import FrozenRecord, parameter


class Body(FrozenRecord, family="body"):
    """Base of bodies; the default inertia, zero, means that inertia is neglected."""

    chosen_by: ClassVar[tuple[str, str | None]] = ("motion", "slide")
    turns: ClassVar[bool] = False
    lifts: ClassVar[bool] = False
    """True if the body also moves away from the surface."""
    is_structure: ClassVar[bool] = False
    """True if links and contacts are attached to named points of the body."""

    def inertia_of(self) -> Any:
        """Mass (kg), or moment of inertia (kg m²)."""
        raise NotImplementedError

    def along(self) -> Any:
        """Constant force (N), or torque (N m), in the direction of motion."""
        return 0

    def away(self) -> Any:
        """Constant force (N) away from the surface."""
        return 0


class SlidingBody(Body, name="slide"):
    """A body that moves only along the slide."""

    mass: float = parameter("kg", nonnegative, "mass m", default=0.0, structural=True, letter="m")
    force: float = parameter(
        "N",
        real,
        "constant force in the direction of motion (weight on a slope, process)",
        default=0.0,
        structural=True,
        letter="F",
    )

    def inertia_of(self) -> Any:
        return self.mass

    def along(self) -> Any:
        return self.force


class PlanarBody(SlidingBody, name="plane"):
    """A body that moves along the slide and away from the surface, supported by a compliant contact."""

    press: float = parameter(
        "N", real, "constant force towards the surface (weight, piston)", default=0.0, structural=True, letter="P"
    )
    lifts: ClassVar[bool] = True

    def away(self) -> Any:
        return -self.press


class RotatingBody(Body, name="rotation"):
    """A body that rotates: motor, screw, gear wheel."""

    inertia: float = parameter("kg m^2", nonnegative, "moment of inertia J", default=0.0, structural=True, letter="J")
    torque: float = parameter(
        "N m", real, "constant torque in the direction of motion", default=0.0, structural=True, letter="M"
    )
    turns: ClassVar[bool] = True

    def inertia_of(self) -> Any:
        return self.inertia

    def along(self) -> Any:
        return self.torque
