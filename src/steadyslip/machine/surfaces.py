"""Contacts of a machine: which bodies slide on what, by which laws."""

from __future__ import annotations

from typing import ClassVar

from steadyslip.core.domains import positive
from steadyslip.core.entries import Text
from steadyslip.core.records import FrozenRecord, parameter, part, setting
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.mechanism import GROUND, LOAD_POINT


class Surface(FrozenRecord):
    """A contact of a machine: a body that slides on another, on the ground or on what the drive moves.

    The laws are in stresses over `area`; without one they are in forces. Slip is counted in the direction of motion.
    """

    has_area: ClassVar[bool] = True
    in_totals: ClassVar[bool] = True

    body: str = setting(Text("the body that slides; drive where that moves beneath a body, as a belt does"))
    against: str = setting(Text("what it slides on: a body, ground or drive"), default=GROUND)
    friction: FrictionLaw = part(FrictionLaw, "friction law")
    contact: ContactLaw = part(ContactLaw, "contact law")
    area: float | None = parameter("m^2", positive, "contact area; without one the laws are in forces", default=None)
    radius: float | None = parameter(
        "m", positive, "radius of the contact, of a body that turns; slip is radius times angle", default=None
    )
    loaded_by: str | None = setting(
        Text("the link whose force the contact law sees as T; what pulls at the body unless given"), default=None
    )

    @property
    def held(self) -> str:
        """The body that the contact rubs on: that which slides, or lies on what the drive moves."""
        return self.against if self.body == LOAD_POINT else self.body

    @property
    def base(self) -> str:
        """The other end."""
        return self.body if self.body == LOAD_POINT else self.against
