"""Links: a spring and a dashpot in parallel between two bodies, or between a body and the ground or the drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import sympy as sp

from steadyslip.core.domains import line, nonnegative, positive
from steadyslip.core.entries import Names
from steadyslip.core.errors import Problem
from steadyslip.core.records import FrozenRecord, option, parameter, setting


class Link(FrozenRecord, family="link"):
    """Base of links; `between` names the two ends: bodies, ``ground`` or ``drive``."""

    chosen_by: ClassVar[tuple[str, str | None]] = ("kind", "spring")
    turning: ClassVar[tuple[bool | None, bool | None]] = (False, False)
    """For each end, True if it must rotate, False if it must slide, None if it may do either."""

    between: tuple[str, ...] = setting(Names("the two ends: names of bodies, ground or drive"))

    def inconsistencies(self) -> Iterator[Problem]:
        if len(self.between) != 2:
            yield Problem("between", f"got {list(self.between)}; allowed: two names, such as ['motor', 'table']")
        elif self.between[0] == self.between[1]:
            yield Problem("between", f"links {self.between[0]!r} to itself; allowed: two different ends")
        if self.rigidity() is None and not self.is_damped():
            yield Problem("stiffness", "missing; give stiffness, damping or both")

    def rigidity(self) -> Any:
        """Stiffness (N/m or N m/rad); None for a link with a dashpot only."""
        raise NotImplementedError

    def dashpot(self) -> Any:
        """Damping (N s/m or N m s/rad)."""
        raise NotImplementedError

    def is_damped(self) -> bool:
        """True if the damping is not zero."""
        return bool(self.dashpot() != 0)

    def ratio(self) -> Any:
        """Speed of the second end divided by that of the first while the stretch is constant."""
        return 1

    def keeps_pace(self) -> bool:
        """True if the stretch is constant in steady sliding, so that the speeds of the ends are coupled."""
        return self.rigidity() is not None

    def directions(self) -> Mapping[str, Any]:
        """Direction cosines of the link: along the slide (``x``) and away from the surface (``y``)."""
        return {"x": 1}


class Spring(Link, name="spring"):
    """A spring and a dashpot between bodies that slide; may be at an angle if they also move away from the surface."""

    stiffness: float | None = parameter(
        "N/m", positive, "stiffness k along the link", default=None, kind="stiffness", letter="k"
    )
    damping: float = parameter(
        "N s/m", nonnegative, "damping c along the link", default=0.0, structural=True, letter="c"
    )
    direction: str = option("slide", "normal", doc="along the slide, or away from the surface", default="slide")
    angle: float = parameter(
        "rad",
        line,
        "angle φ by which the second end lies higher, seen along the slide",
        default=0.0,
        structural=True,
        letter="phi",
    )

    def inconsistencies(self) -> Iterator[Problem]:
        yield from super().inconsistencies()
        if self.direction == "normal" and self.angle != 0:
            yield Problem("angle", "given with direction = 'normal', which means 90 deg; give only one of the two")

    def rigidity(self) -> Any:
        return self.stiffness

    def dashpot(self) -> Any:
        return self.damping

    def keeps_pace(self) -> bool:
        return self.stiffness is not None and self.direction == "slide"

    def directions(self) -> Mapping[str, Any]:
        if self.direction == "normal":
            return {"y": 1}
        if self.angle == 0:
            return {"x": 1}
        return {"x": sp.cos(self.angle), "y": sp.sin(self.angle)}


class Screw(Link, name="screw"):
    """A screw, rack or belt between a body that turns and one that slides: stretch x − lead · φ.

    `between` names the body that turns first. Stiffness and damping are along the slide.
    """

    turning: ClassVar[tuple[bool | None, bool | None]] = (True, False)

    lead: float = parameter(
        "m/rad", positive, "travel h for an angle, such as '5 mm/rev' (the pitch of a screw of one start)", letter="h"
    )
    stiffness: float | None = parameter(
        "N/m", positive, "stiffness k along the slide", default=None, kind="stiffness", letter="k"
    )
    damping: float = parameter(
        "N s/m", nonnegative, "damping c along the slide", default=0.0, structural=True, letter="c"
    )

    def rigidity(self) -> Any:
        return self.stiffness

    def dashpot(self) -> Any:
        return self.damping

    def ratio(self) -> Any:
        return self.lead


class Shaft(Link, name="shaft"):
    """A shaft, coupling or gear between two bodies that turn: twist φ2 − ratio · φ1, torque on the second."""

    turning: ClassVar[tuple[bool | None, bool | None]] = (True, True)

    gear: float | None = parameter(
        "1", positive, "gear ratio i, turns of the second body for one turn of the first", default=None, letter="i"
    )
    stiffness: float | None = parameter(
        "N m/rad", positive, "torsional stiffness k at the second body", default=None, kind="stiffness", letter="k"
    )
    damping: float = parameter(
        "N m s/rad", nonnegative, "torsional damping c there", default=0.0, structural=True, letter="c"
    )

    def rigidity(self) -> Any:
        return self.stiffness

    def dashpot(self) -> Any:
        return self.damping

    def ratio(self) -> Any:
        return 1 if self.gear is None else self.gear
