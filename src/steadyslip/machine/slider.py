"""Sliders: one block with friction, contact, spring, dampers and a drive."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.domains import Condition, nonnegative, positive
from steadyslip.core.errors import Problem
from steadyslip.core.records import parameter, part
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.drive import Drive
from steadyslip.machine.mechanism import LOAD_POINT, ContactPort, DegreeOfFreedom, Element, Integral, Mechanism
from steadyslip.machine.rig import LawsOfContact, Rig


class Slider(Rig, section="slider"):
    """A block pushed through a spring: m v̇ = T − τ(v, σ, memory) − ηv + q (theory 1).

    All stresses, stiffnesses, dampings and the mass are per unit nominal contact area; with area 1 the same numbers are
    forces. `stiffness` is the component along the sliding direction; if the contact has an axis, `axial_stiffness` may
    be given instead. Mass zero is the quasistatic model.

    Parameters have dotted names (``friction.a``, ``contact.angle``, ``slider.stiffness``, ``drive.velocity``); the last
    part is enough if it is unique.
    """

    has_area: ClassVar[bool] = True
    always_symbols: ClassVar[Mapping[str, str]] = {"slider.stiffness": "k"}
    replaces: ClassVar[Mapping[str, str]] = {"slider.axial_stiffness": "slider.stiffness"}
    not_in_model: ClassVar[tuple[str, ...]] = ("slider.area",)
    default_along: ClassVar[str | None] = "stiffness"
    words: ClassVar[Mapping[str, str]] = {
        "rig": "slider", "block": "slider", "place": "the slider", "damping": "radiation_damping",
        "mass": "the slider mass or radiation_damping",
    }  # fmt: skip
    bodies: ClassVar[Mapping[str, Any]] = {}
    """Empty: the block of a slider has no name; a `Machine` has named bodies."""
    contacts: ClassVar[Mapping[str, Any]] = {}
    """Empty: the contact of a slider has no name; a `Machine` has named contacts."""
    links: ClassVar[Mapping[str, Any]] = {}
    """Empty: a slider has no named links; a `Machine` has."""
    fed: ClassVar[None] = None
    """None: only a `Machine` can have a body to whose motion drive.velocity refers."""

    friction: FrictionLaw = part(FrictionLaw, "friction law")
    contact: ContactLaw = part(ContactLaw, "contact law")
    stiffness: float | None = parameter(
        "Pa/m",
        nonnegative,
        "stiffness k along the sliding direction",
        default=None,
        kind="stiffness",
        standing=1e10,
        letter="k",
    )
    axial_stiffness: float | None = parameter(
        "Pa/m",
        nonnegative,
        "stiffness along the axis of spring, rod or press, instead",
        default=None,
        kind="stiffness",
        letter="k_s",
    )
    mass: float = parameter("kg/m^2", nonnegative, "mass m; 0 is quasistatic", default=0.0, structural=True, letter="m")
    damping: float = parameter(
        "Pa s/m", nonnegative, "dashpot c beside the spring", default=0.0, structural=True, letter="c"
    )
    radiation_damping: float = parameter(
        "Pa s/m",
        nonnegative,
        "damping η to the ground (radiation, viscous guide)",
        default=0.0,
        structural=True,
        letter="eta",
    )
    area: float | None = parameter(
        "m^2", positive, "contact area, to report forces as well", default=None, gauge=True, letter="A"
    )
    drive: Drive = part(Drive, "drive")

    def inconsistencies(self) -> Iterator[Problem]:
        if self.stiffness is not None and self.axial_stiffness is not None:
            yield Problem("axial_stiffness", "given together with stiffness; give only one of the two")
        if self.axial_stiffness is not None and not self.contact.has_axis():
            yield Problem(
                "axial_stiffness",
                f"the contact {self.contact.name!r} has no axis at an angle; give stiffness instead",
            )

        if self.contact.is_compliant():
            yield Problem(
                "contact",
                f"the contact {self.contact.name!r} needs a body that moves away from the surface, which a slider does "
                "not; describe the rig as a machine, with motion = 'plane' for the body",
            )

    def conditions(self) -> Iterator[Condition]:
        if self.stiffness is None and self.axial_stiffness is None:
            message = "missing; give stiffness such as '9 GPa/m' (or a drive with gain kp > 0)"
            gain = self.drive.proportional()
            yield Condition("stiffness", np.asarray(gain) > 0, message, (gain,))

    def stiffness_name(self) -> str:
        """Dotted name of the stiffness that was given: of the spring, along the slide or its axis.

        Else a controller's gain.
        """
        own = [name for name in self.of_kind("stiffness") if not name.startswith("drive.")]
        return (own or [name for name in self.of_kind("stiffness") if self.value(name)] or ["slider.stiffness"])[0]

    def kept_zeros(self, name: str | None = None) -> tuple[str, ...]:
        return tuple(
            name
            for name, a in self.parameters().items()
            if a.role.structural and a.value == 0 and not a.role.adds_state and a.role.kind != "delay"
        )

    def parameter_along(self, name: str) -> str:
        full = self.resolve(name)
        return self.stiffness_name() if full == "slider.stiffness" and self.stiffness is None else full

    def gain_name(self) -> str | None:
        names = [name for name in self.of_kind("stiffness") if name.startswith("drive.")]
        if len(names) != 1 or self.value(names[0]) != self.drive.proportional():
            return None
        return names[0]

    def area_of(self, name: str) -> float | None:
        return self.area

    printed_area = area_of

    @property
    def protocol_area(self) -> float | None:
        return self.area

    def place_problems(
        self, argument: str, name: str | None, known: Iterable[str] = (), what: str = "body"
    ) -> list[Problem]:  # fmt: skip
        if name is None:
            return []
        one = "has one contact" if argument == "contact" else "is one block"
        return [Problem(argument, f"got {name!r}; a slider {one} without a name; leave the argument out")]

    def laws_by_contact(self) -> dict[str, LawsOfContact]:
        return {"": LawsOfContact("", self.friction, self.contact)}

    def mechanism(self) -> Mechanism:
        """Mechanism with one coordinate x, and with spring and controller between the block and the load point."""
        pulled = {"x": 1, LOAD_POINT: -1}
        drive = self.drive
        ki, late = drive.integral(), drive.lateness()
        return Mechanism(
            coordinates=(DegreeOfFreedom("x", self.mass, drive.velocity),),
            elements=(
                Element("", {"x": 1}, pulled, self.stiffness, self.damping),
                Element("", {"x": 1}, pulled, drive.proportional(), drive.dashpot(), delay=late, active=True),
                Element("", {"x": 1}, {"x": 1}, 0, self.radiation_damping, grounded=True),
            ),
            integral=None if ki is None else Integral({"x": 1}, {"x": 1}, ki, late),
            contacts=(ContactPort("", self.friction, self.contact, {"x": 1}, {}, 1),),
            velocity=drive.velocity,
            gain=drive.proportional(),
            axial_share=None if self.axial_stiffness is None else self.contact.sliding_stiffness(1),
            limits=drive.limits(),
        )
