"""Base class of sliders and machines: parameters by dotted name, display units, and the mechanism."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeVar

from steadyslip.core.caching import HasCache, cached
from steadyslip.core.errors import ParameterError, Problem, UnknownNameError, unknown_name
from steadyslip.core.names import resolve
from steadyslip.core.quantities import column_with_text, parse, units_in, units_named
from steadyslip.core.records import Address, FrozenRecord, parameters, replaced
from steadyslip.core.written import WrittenAs
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.mechanism import Mechanism
from steadyslip.protocol.protocol import Piece

S = TypeVar("S", bound="Rig")


class LawsOfContact(NamedTuple):
    """Laws of one contact, prefix of the names of their parameters, and area (m²) of a machine's contact or None."""

    prefix: str
    friction: FrictionLaw
    contact: ContactLaw
    area: float | None = None


class Rig(FrozenRecord, HasCache):
    """Base of `Slider` and `Machine`: a frozen record with parameters by dotted name and a mechanism."""

    if TYPE_CHECKING:  # these are fields in one of the two subclasses and class constants in the other

        @property
        def area(self) -> float | None: ...
        @property
        def bodies(self) -> Mapping[str, Any]: ...
        @property
        def contacts(self) -> Mapping[str, Any]: ...
        @property
        def links(self) -> Mapping[str, Any]: ...
        @property
        def fed(self) -> str | None: ...
        @property
        def drive(self) -> Any: ...
        def speeds(self) -> dict[str, Any]: ...
        def ratios(self) -> dict[str, float]: ...

    always_symbols: ClassVar[Mapping[str, str]] = {}
    """Parameters that are symbols of the Model even if the rig does not give them, with their letters."""
    replaces: ClassVar[Mapping[str, str]] = {}
    """Parameters that may be given instead of others: dotted name to the name of the parameter replaced."""

    not_in_model: ClassVar[tuple[str, ...]] = ()
    """Parameters that occur in no equation of the Model."""

    default_along: ClassVar[str | None] = None
    """Parameter that searches for edges and cycles vary by default; None if the user must name one."""

    in_forces: ClassVar[bool] = False
    """True if normal loads and friction of this class are forces (N), not stresses (Pa)."""

    words: ClassVar[Mapping[str, str]] = {}
    """Words for messages about this class: ``rig``, ``block``, ``place`` of a coordinate ({}: its name), and
    ``damping`` and ``mass``, of which one must be added if nothing limits a speed."""

    read_from: ClassVar[str] = ""
    """Name of the file from which the rig was read, for captions; not compared by ==."""

    units_named: ClassVar[Mapping[str, str]] = {}
    """Units of parameters in the file, such as ``N/um at 6 kN``, by dotted name; not compared by ==."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.written_in:  # a copy by dataclasses.replace takes the file's units from its parts
            self.set_display_units(name for one in self._parts() for name in one.written_in)

    def named(self, file: str) -> Self:
        """Set the name of the file from which the rig was read, and return the rig itself."""
        object.__setattr__(self, "read_from", file)
        return self

    def set_parameter_units(self, units: Mapping[str, str]) -> Self:
        """Set the units in which parameters are printed from now on, by dotted name, and return the rig itself."""
        object.__setattr__(self, "units_named", dict(units))
        return self

    def set_display_units(self, names: Iterable[str]) -> Self:
        """Set the units in which the rig and its parts are printed from now on, and return the rig itself."""
        names = tuple(names)
        for one in self._parts():
            one.set_display_units(names)
        return super().set_display_units(names)

    def _parts(self) -> Iterator[FrozenRecord]:
        """Yield the records in the rig's fields, such as its laws."""
        for item in fields(self):
            value = self.__dict__.get(item.name)  # not getattr: class defaults are no parts, and fields may be unset
            several = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
            yield from (one for one in several if isinstance(one, FrozenRecord))

    def ends(self) -> tuple[str, ...]:
        """Names of bodies, and of points of structures, on which forces can act; empty for a slider."""
        return tuple(self.bodies)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of a machine's contacts, which are prefixes of their results; empty for a slider."""
        return ()

    def result_name(self, name: str) -> str:
        """Name of a result of this rig, from the name for sliders: machines have forces in place of stresses."""
        return name

    def result_unit(self, unit: str) -> str:
        """SI unit of a result of this rig, from the unit for sliders: machines have N in place of Pa."""
        return unit

    def protocol_unit(self, piece: Piece, unit: str) -> str:
        """SI unit, for this rig, of a quantity of a protocol piece that is declared with the SI unit `unit`."""
        return unit

    def turns_on(self, body: str | None) -> bool:
        """True if the named body rotates; None stands for the rig's only body."""
        return False

    @property
    def protocol_area(self) -> float | None:
        """Area (m²) that converts stresses in a protocol to forces in files; None if files have stresses."""
        raise NotImplementedError

    def place_problems(
        self, argument: str, name: str | None, known: Iterable[str], what: str = "body"
    ) -> list[Problem]:  # fmt: skip
        """List with a Problem if `name` is not a `known` body or contact (`what`); empty if it is, or for None.

        `argument` is the argument that the Problem names. A slider has neither named bodies nor named contacts.
        """
        known = list(known)
        return [] if name is None or name in known else [Problem(argument, unknown_name(what, name, known))]

    def check_branch(self, branch: int) -> None:
        """Raise an error for a branch (number of a solution for steady sliding) that rigs of this class never have.

        Raises
        ------
        ParameterError
            If `branch` is not 0 for a machine.
        """

    def laws_by_contact(self) -> dict[str, LawsOfContact]:
        """Laws of each contact by its name in the Model; the name of a slider's contact is empty."""
        raise NotImplementedError

    def pulls_at(self, contact: str) -> tuple[str, ...]:
        """Names of the links, or "the controller", whose forces make up the pull at a contact; empty for a slider."""
        return ()

    def lever_at(self, contact: str) -> float | None:
        """Radius (m) of a contact at which the pull is a torque on a rotating body; None for a sliding body."""
        return None

    @property
    def holds(self) -> bool:
        """True if a controller holds a place: the velocity of the drive is 0, and there is no steady sliding."""
        velocity = self.drive.velocity
        return isinstance(velocity, (int, float)) and velocity == 0

    def mechanism(self) -> Mechanism:
        """Mechanism from which the Model is assembled; symbolic for a copy of the rig with symbols."""
        raise NotImplementedError

    def area_of(self, name: str) -> float | None:
        """Area (m²) if users may give this parameter as a total of the contact, else None."""
        raise NotImplementedError

    def printed_area(self, name: str) -> float | None:
        """Area (m²) if this parameter is printed as a total of the contact, else None (always for machines)."""
        raise NotImplementedError

    def load_of(self, name: str) -> float | None:
        """Normal force (N) on the contact to which a parameter belongs; None for other parameters or without area."""
        for prefix, _, _, own in self.laws_by_contact().values():
            area = 1.0 if self.in_forces and own is None else self.area if own is None else own
            pressed = next((n for n in self.of_kind("normal stress") if n.startswith(prefix)), "")
            if pressed and area is not None and name.startswith(prefix):
                return abs(self.parameters()[pressed].value or 0.0) * area or None
        return None

    def written_as(self, name: str) -> WrittenAs:
        """Unit of a parameter in the file, and the load (N) at which friction per load is printed without such a unit.

        The load is the normal force of the contact; if this is unknown, a load in the file for another parameter of the
        contact; else 0, with which friction is printed per load. It is None for parameters that belong to no contact.
        """
        prefix = next((own.prefix for own in self.laws_by_contact().values() if name.startswith(own.prefix)), None)
        if prefix is None:
            return WrittenAs(self.units_named.get(name, ""))
        loads = (one.partition(" at ")[2] for other, one in self.units_named.items() if other.startswith(prefix))
        beside = next((parse(load, "N") for load in loads if load), 0.0)
        return WrittenAs(self.units_named.get(name, ""), self.load_of(name) or beside)

    def parameters(self) -> dict[str, Address]:
        """Parameters of the rig by dotted name: role, with the SI unit for this kind of rig, and value (cached)."""
        return dict(_parameters(self))

    def declared(self) -> dict[str, Address]:
        """Parameters of the rig by dotted name, collected anew (`parameters` caches them)."""
        return parameters(self)

    def display_value(self, name: str, value: float) -> tuple[float, str]:
        """Value and SI unit with which a parameter is printed: drive.velocity as speed of the body in velocity_of."""
        return value, self.parameters()[name].role.unit

    def feed(self) -> tuple[float, bool]:
        """Ratio of the motion that users give to the motion of the drive, and True if the motion given is a rotation.

        Users give the motion of the body in `velocity_of`, or, without this entry, the motion of the drive.
        """
        return 1.0, bool(self.drive.turns)

    def seen(self) -> tuple[float, bool]:
        """Ratio of the measured body's motion to the motion of the drive, and True if the measured body turns."""
        return 1.0, bool(self.drive.turns)

    def gain_name(self) -> str | None:
        """Name of the drive's parameter that equals the stiffness added by the controller; None if there is none."""
        return None

    def kept_zeros(self, name: str | None = None) -> tuple[str, ...]:
        """Names of parameters that are zero but stay in the equations, so that they can be varied from zero.

        For a machine this is at most `name`, the parameter that is varied: further masses and dampings would raise the
        degree of the characteristic polynomial and hide other edges.
        """
        raise NotImplementedError

    def parameter_along(self, name: str) -> str:
        """Full name of a parameter.

        A slider's "stiffness" becomes axial_stiffness or kp if it has no other stiffness.
        """
        return self.resolve(name)

    def resolve(self, name: str) -> str:
        """Full dotted name of a parameter.

        Raises
        ------
        UnknownNameError
            If `name` is unknown or ambiguous; the message lists the nearest valid names.
        """
        return resolve(name, self.parameters())

    def read(self, name: str, value: Any) -> Any:
        """Convert a value of a parameter, or a list of them, to SI units.

        Text may have the unit of the total of a contact with an area; for drive.velocity it has the unit of
        `display_value`.

        Raises
        ------
        ParameterError
            If text is not a quantity of the parameter's dimension.
        """
        if (items := column_with_text(value)) is not None:
            return [self.read(name, item) for item in items]
        if not isinstance(value, str):
            return value
        factor, unit = self.display_value(name, 1.0)
        role = self.parameters()[name].role
        try:
            found = (role if unit == role.unit else replace(role, unit=unit)).read(value, self.area_of(name))
            return found if factor == 1.0 else found / factor
        except ParameterError as error:
            raise ParameterError([problem.under(name) for problem in error.problems]) from error

    def of_kind(self, kind: str) -> tuple[str, ...]:
        """Dotted names of the parameters of a `kind` (`PARAMETER_KINDS`) that have a value, in order."""
        return tuple(n for n, a in self.parameters().items() if a.role.kind == kind and a.value is not None)

    def value(self, name: str) -> float | None:
        """Value of a parameter in SI units, None if it is not given."""
        return self.parameters()[self.resolve(name)].value

    def with_values(self: S, changes: Mapping[str, Any]) -> S:
        """Copy of the rig with some parameters changed.

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
                full[self.resolve(name)] = self.read(self.resolve(name), value)
            except UnknownNameError as error:
                problems.append(Problem(name, str(error)))
            except ParameterError as error:
                problems += error.problems
        if problems:
            raise ParameterError(problems)
        texts = {one for one in changes.values() if isinstance(one, str)}
        copy = replaced(self, full).set_display_units((*self.written_in, *units_in(texts))).named(self.read_from)
        units = units_named({self.resolve(name): value for name, value in changes.items()})
        return copy.set_parameter_units({**self.units_named, **units})


@cached
def _parameters(rig: Rig) -> dict[str, Address]:
    return rig.declared()
