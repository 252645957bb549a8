"""Contacts of a machine: two bodies, with a friction law and a contact law."""

from __future__ import annotations

from typing import ClassVar

from steadyslip.core.domains import positive
from steadyslip.core.entries import Text
from steadyslip.core.records import FrozenRecord, parameter, part, setting
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.mechanism import GROUND, LOAD_POINT


class Surface(FrozenRecord):
    """A contact of a machine: a body that slides on another, on the ground or on the moving load point.

    The laws are in stresses over `area`; without one they are in forces. Slip is positive in the direction of motion.
    """

    has_area: ClassVar[bool] = True
    in_totals: ClassVar[bool] = True

    body: str = setting(Text("the body that slides; drive where that moves beneath a body, as a belt does"))
    against: str = setting(Text("what it slides on: a body, ground or drive"), default=GROUND)
    friction: FrictionLaw = part(FrictionLaw, "friction law")
    contact: ContactLaw = part(ContactLaw, "contact law")
    area: float | None = parameter(
        "m^2", positive, "contact area A; without one the laws are in forces", default=None, letter="A"
    )
    radius: float | None = parameter(
        "m",
        positive,
        "radius r of the contact, half its diameter, of a body that turns; slip is radius times angle",
        default=None,
        letter="r",
    )
    loaded_by: str | None = setting(
        Text("the link whose force the contact law sees as T; what pulls at the body unless given"), default=None
    )

    @property
    def held(self) -> str:
        """Body on which friction acts: `body`, or `against` if that lies on the moving load point (a belt)."""
        return self.against if self.body == LOAD_POINT else self.body

    @property
    def base(self) -> str:
        """Body, ground or load point on which `held` slides."""
        return self.body if self.body == LOAD_POINT else self.against
