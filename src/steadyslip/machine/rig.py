"""Base class of rigs: parameters by dotted name, and a mechanism."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeVar

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError, unknown_name
from steadyslip.core.names import resolve
from steadyslip.core.quantities import column_with_text, parse, units_in, units_named
from steadyslip.core.questions import Keeper, question
from steadyslip.core.records import Address, FrozenRecord, parameters, replaced
from steadyslip.core.written import WrittenAs
from steadyslip.laws.contact import ContactLaw
from steadyslip.laws.friction import FrictionLaw
from steadyslip.machine.mechanism import Mechanism
from steadyslip.protocol.protocol import Piece

S = TypeVar("S", bound="Rig")


class LawsOfContact(NamedTuple):
    """Laws at one contact: prefix of their parameters' names, and area (m²) of a machine's contact that has one."""

    prefix: str
    friction: FrictionLaw
    contact: ContactLaw
    area: float | None = None


class Rig(FrozenRecord, Keeper):
    """Base of `Slider` and `Machine`: a frozen record with parameters by dotted name and a mechanism."""

    if TYPE_CHECKING:  # fields of the records, or constants of the class: named bodies, named contacts

        @property
        def area(self) -> float | None: ...
        @property
        def bodies(self) -> Mapping[str, Any]: ...
        @property
        def contacts(self) -> Mapping[str, Any]: ...
        @property
        def drive(self) -> Any: ...

    always_symbols: ClassVar[Mapping[str, str]] = {}
    """Parameters that are symbols of the Model even if the rig does not give them, with their letters."""
    replaces: ClassVar[Mapping[str, str]] = {}
    """Parameters that may be given in place of others: name to name of the replaced one."""

    not_in_model: ClassVar[tuple[str, ...]] = ()
    """Parameters that occur in no equation of the Model."""

    default_along: ClassVar[str | None] = None
    """Parameter along which edges and cycles are sought unless another is named; None if none stands out."""

    in_forces: ClassVar[bool] = False
    """True if loads and frictions of rigs of this class are told as forces, not as stresses."""

    words: ClassVar[Mapping[str, str]] = {}
    """Words of messages about a rig of this class: `rig`, `block`, `place` of a coordinate by its name, and what limits
    its speed, `damping` and `mass`."""

    read_from: ClassVar[str] = ""
    """Name of the file that the rig was read from, for a caption; no part of its value."""

    units_named: ClassVar[Mapping[str, str]] = {}
    """Units in which the file writes parameters, such as ``N/um at 6 kN``, by name; no part of the rig's value."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.written_in:  # of a copy by dataclasses.replace: its parts know the file
            self.told_in(name for one in self._parts() for name in one.written_in)

    def named(self, file: str) -> Self:
        """The rig itself, which is told to be from this file from now on."""
        object.__setattr__(self, "read_from", file)
        return self

    def told_by(self, units: Mapping[str, str]) -> Self:
        """The rig itself, of which parameters are told in these units from now on, by name."""
        object.__setattr__(self, "units_named", dict(units))
        return self

    def told_in(self, names: Iterable[str]) -> Self:
        """The rig itself, which is told in these units from now on, and so is what is made of its parts."""
        names = tuple(names)
        for one in self._parts():
            one.told_in(names)
        return super().told_in(names)

    def _parts(self) -> Iterator[FrozenRecord]:
        """Records that the rig is made of, such as its laws."""
        for item in fields(self):
            value = self.__dict__.get(item.name)  # not the default of a class, while it is being made
            several = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
            yield from (one for one in several if isinstance(one, FrozenRecord))

    def ends(self) -> tuple[str, ...]:
        """What can be pushed, by name: bodies, and of structures the points; none of a slider's one block."""
        return tuple(self.bodies)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the contacts, which prefix their results; empty for the one contact of a slider."""
        return ()

    def result_name(self, name: str) -> str:
        """Name of a result: that of a slider's, or of a machine's, whose loads are forces."""
        return name

    def result_unit(self, unit: str) -> str:
        """SI unit of a result: that of a slider's, or of a machine's, whose loads are forces."""
        return unit

    def protocol_unit(self, piece: Piece, unit: str) -> str:
        """SI unit of a quantity of a piece of a protocol on this rig; `unit` is the declared one."""
        return unit

    def turns_on(self, body: str | None) -> bool:
        """True if the named body rotates; None names the only body of a rig that has one."""
        return False

    @property
    def protocol_area(self) -> float | None:
        """Area (m²) by which stresses in a protocol are multiplied to be written as forces; None if they are not."""
        raise NotImplementedError

    def place_problems(
        self, argument: str, name: str | None, known: Iterable[str], what: str = "body"
    ) -> list[Problem]:  # fmt: skip
        """Problem with the name of a body or contact (`what`), one of those `known`, as a list; empty for None.

        A slider has no names of either. `argument` is what the message calls the name.
        """
        known = list(known)
        return [] if name is None or name in known else [Problem(argument, unknown_name(what, name, known))]

    def check_branch(self, branch: int) -> None:
        """Raise an error for a branch (number of a steady sliding) that rigs of this class never have.

        Raises
        ------
        ParameterError
            If `branch` is not 0 for a machine.
        """

    def laws_by_contact(self) -> dict[str, LawsOfContact]:
        """Laws of each contact by its name in the Model, which is empty for a slider's."""
        raise NotImplementedError

    def pulls_at(self, contact: str) -> tuple[str, ...]:
        """Names of the links, and ``the controller``, whose forces are the pull at a contact; none for a slider."""
        return ()

    def lever_at(self, contact: str) -> float | None:
        """Radius (m) by which the pull at a contact is a torque on a body that turns; None where that body slides."""
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
        """Area (m²) if this parameter is printed as a total of the contact; None where contacts have own areas."""
        raise NotImplementedError

    def load_of(self, name: str) -> float | None:
        """Force that presses the contact whose parameter this is, N; None of other parameters, or without an area."""
        for prefix, _, _, own in self.laws_by_contact().values():
            area = 1.0 if self.in_forces and own is None else self.area if own is None else own
            pressed = next((n for n in self.of_kind("normal stress") if n.startswith(prefix)), "")
            if pressed and area is not None and name.startswith(prefix):
                return abs(self.parameters()[pressed].value or 0.0) * area or None
        return None

    def written_as(self, name: str) -> WrittenAs:
        """Unit in which the file writes a parameter, and the load at which friction is told that it does not write.

        The load is that of the contact, or where it is not known one that the file names for another parameter there,
        or 0 without any, so that friction is told per load; None of what is of no contact.
        """
        prefix = next((own.prefix for own in self.laws_by_contact().values() if name.startswith(own.prefix)), None)
        if prefix is None:
            return WrittenAs(self.units_named.get(name, ""))
        loads = (one.partition(" at ")[2] for other, one in self.units_named.items() if other.startswith(prefix))
        beside = next((parse(load, "N") for load in loads if load), 0.0)
        return WrittenAs(self.units_named.get(name, ""), self.load_of(name) or beside)

    def parameters(self) -> dict[str, Address]:
        """Parameters of the rig by dotted name: role, with the user's unit, and value (cached)."""
        return dict(_parameters(self))

    def declared(self) -> dict[str, Address]:
        """Collect the parameters (uncached)."""
        return parameters(self)

    def told(self, name: str, value: float) -> tuple[float, str]:
        """Value of a parameter and its unit, as people are told it: the speed of the body whose speed they gave."""
        return value, self.parameters()[name].role.unit

    def feed(self) -> tuple[float, bool]:
        """Motion that people give and are told for one of the drive: its own, or of the body that they named; whether
        that body turns."""
        return 1.0, bool(self.drive.turns)

    def seen(self) -> tuple[float, bool]:
        """Motion of the body that a controller measures for one of the drive, and whether that body turns."""
        return 1.0, bool(self.drive.turns)

    def gain_name(self) -> str | None:
        """Name of the drive's parameter that equals the stiffness it adds; None if there is none."""
        return None

    def kept_zeros(self, name: str | None = None) -> tuple[str, ...]:
        """Names of parameters that are zero but stay in the equations, so that they can be varied from zero.

        For a machine that is at most `name`, the one that is varied: masses and dampings kept so would raise the degree
        of its polynomial and hide other edges.
        """
        raise NotImplementedError

    def parameter_along(self, name: str) -> str:
        """Full name of a parameter; a slider's "stiffness" becomes what it has: a spring's, a press's, or a gain kp."""
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

        Text may give a total of a contact with an area, and the speed of the body by which that of the drive is `told`.

        Raises
        ------
        ParameterError
            If text is not a quantity of the parameter's dimension.
        """
        if (items := column_with_text(value)) is not None:
            return [self.read(name, item) for item in items]
        if not isinstance(value, str):
            return value
        factor, unit = self.told(name, 1.0)
        role = self.parameters()[name].role
        try:
            found = (role if unit == role.unit else replace(role, unit=unit)).read(value, self.area_of(name))
            return found if factor == 1.0 else found / factor
        except ParameterError as error:
            raise ParameterError([problem.under(name) for problem in error.problems]) from error

    def of_kind(self, kind: str) -> tuple[str, ...]:
        """Dotted names of the given parameters with a `kind` of `PARAMETER_KINDS`, in order."""
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
        copy = replaced(self, full).told_in((*self.written_in, *units_in(texts))).named(self.read_from)
        return copy.told_by({**self.units_named, **units_named({self.resolve(n): one for n, one in changes.items()})})


@question
def _parameters(rig: Rig) -> dict[str, Address]:
    return rig.declared()
