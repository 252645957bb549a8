"""The rig: one block, its friction, its contact, the spring and dampers, and the drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError
from steadyslip.core.questions import Keeper, question
from steadyslip.core.records import Address, Condition, FrozenRecord, parameter, parameters, part, replaced, resolve
from steadyslip.core.roles import nonnegative, positive
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.drive import Drive


class Slider(FrozenRecord, Keeper, section="slider"):
    """A block pushed through a spring: m v̇ = T − τ(v, σ, memory) − ηv + q (theory 1).

    All stresses, stiffnesses, dampings and the mass are per unit nominal contact area; with area 1 the
    same numbers are forces. `stiffness` is the component along the sliding direction; where the contact
    has an axis, `axial_stiffness` may be given instead. Mass zero is the quasistatic model.

    Parameters have dotted names (``friction.a``, ``contact.angle``, ``slider.stiffness``,
    ``drive.velocity``); a bare last part is enough where it is unique.
    """

    friction: FrictionLaw = part(FrictionLaw, "friction law")
    contact: ContactLaw = part(ContactLaw, "contact law")
    stiffness: float | None = parameter(
        "Pa/m", nonnegative, "stiffness k along the sliding direction", default=None, kind="stiffness", standing=1e10
    )
    axial_stiffness: float | None = parameter(
        "Pa/m", nonnegative, "stiffness along the axis of spring, rod or press, instead", default=None, kind="stiffness"
    )
    mass: float = parameter("kg/m^2", nonnegative, "mass m; 0 is quasistatic", default=0.0, structural=True)
    damping: float = parameter("Pa s/m", nonnegative, "dashpot c beside the spring", default=0.0, structural=True)
    radiation_damping: float = parameter(
        "Pa s/m",
        nonnegative,
        "damping η to the ground (radiation, viscous guide)",
        default=0.0,
        structural=True,
    )
    area: float | None = parameter("m^2", positive, "contact area, to report forces as well", default=None, gauge=True)
    drive: Drive = part(Drive, "drive")

    def inconsistencies(self) -> Iterator[Problem]:
        if self.stiffness is not None and self.axial_stiffness is not None:
            yield Problem("axial_stiffness", "given beside stiffness; give one of the two")
        if self.axial_stiffness is not None and not self.contact.has_axis():
            yield Problem(
                "axial_stiffness",
                f"the contact {self.contact.name!r} has no axis at an angle; give stiffness instead",
            )

    def conditions(self) -> Iterator[Condition]:
        if self.stiffness is None and self.axial_stiffness is None:
            message = "missing; give stiffness such as '9 GPa/m' (or a drive with gain kp > 0)"
            gain = self.drive.proportional()
            yield Condition("stiffness", np.asarray(gain) > 0, message, (gain,))

    def parameters(self) -> dict[str, Address]:
        """Every parameter of the rig by dotted name: declaration and present value."""
        return dict(_parameters(self))

    def resolve(self, name: str) -> str:
        """The full dotted name of a parameter.

        Raises
        ------
        UnknownNameError
            If `name` is unknown or ambiguous; the message lists the nearest valid names.
        """
        return resolve(name, self.parameters())

    def of_kind(self, kind: str) -> tuple[str, ...]:
        """Dotted names of the given parameters whose laws declare them to be of a `kind`, in order."""
        return tuple(n for n, a in self.parameters().items() if a.role.kind == kind and a.value is not None)

    def stiffness_name(self) -> str:
        """The parameter that is this rig's stiffness: the spring's, along the slide or its axis, else a gain."""
        own = [name for name in self.of_kind("stiffness") if not name.startswith("drive.")]
        return (own or [name for name in self.of_kind("stiffness") if self.value(name)] or ["slider.stiffness"])[0]

    def value(self, name: str) -> float | None:
        """The value of a parameter in SI units, None if it is not given."""
        return self.parameters()[self.resolve(name)].value

    def with_values(self, changes: Mapping[str, Any]) -> Slider:
        """A copy with some parameters changed.

        Parameters
        ----------
        changes : mapping of str to float or str
            Dotted name to value in SI units, or text with a unit.

        Raises
        ------
        UnknownNameError, ParameterError
            If a name is unknown or a value is not allowed; all problems are listed.
        """
        problems, full = [], {}
        for name, value in changes.items():
            try:
                full[self.resolve(name)] = value
            except UnknownNameError as error:
                problems.append(Problem(name, str(error)))
        if problems:
            raise ParameterError(problems)
        return replaced(self, full)


@question
def _parameters(rig: Slider) -> dict[str, Address]:
    return parameters(rig)
