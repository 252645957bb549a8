"""What every rig has, whether it is a slider or a machine: parameters by dotted name, and a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError
from steadyslip.core.names import resolve
from steadyslip.core.questions import Keeper, question
from steadyslip.core.records import Address, FrozenRecord, parameters, replaced
from steadyslip.machine.mechanism import Mechanism

S = TypeVar("S", bound="Rig")


class Rig(FrozenRecord, Keeper):
    """Base of `Slider` and `Machine`: a frozen record whose parameters have dotted names, and its mechanism."""

    assumed: ClassVar[Mapping[str, str]] = {}
    """Parameters that the Model has even where the rig does not give them, with their letters."""
    instead: ClassVar[Mapping[str, str]] = {}
    """Parameters that are given in place of others, and of which."""

    aside: ClassVar[tuple[str, ...]] = ()
    """Parameters that the Model does not have, because no equation does."""

    def mechanism(self) -> Mechanism:
        """The rig as its Model is assembled from it; of a twin with symbols, in symbols."""
        raise NotImplementedError

    def area_of(self, name: str) -> float | None:
        """Area (m²) for which people give and get a parameter as a total; None where it is in its own unit."""
        raise NotImplementedError

    def parameters(self) -> dict[str, Address]:
        """Every parameter of the rig by dotted name: declaration, in the unit of its user, and present value."""
        return dict(_parameters(self))

    def declared(self) -> dict[str, Address]:
        """The same, worked out."""
        return parameters(self)

    def resolve(self, name: str) -> str:
        """The full dotted name of a parameter.

        Raises
        ------
        UnknownNameError
            If `name` is unknown or ambiguous; the message lists the nearest valid names.
        """
        return resolve(name, self.parameters())

    def read(self, name: str, value: Any) -> Any:
        """A value of a parameter of this name in SI units; text as its user writes it, in totals where it has an area.

        Raises
        ------
        ParameterError
            If text is none of its quantities.
        """
        if not isinstance(value, str):
            return value
        try:
            return self.parameters()[name].role.read(value, self.area_of(name))
        except ParameterError as error:
            raise ParameterError([problem.under(name) for problem in error.problems]) from error

    def of_kind(self, kind: str) -> tuple[str, ...]:
        """Dotted names of the given parameters whose laws declare them to be of a `kind`, in order."""
        return tuple(n for n, a in self.parameters().items() if a.role.kind == kind and a.value is not None)

    def value(self, name: str) -> float | None:
        """The value of a parameter in SI units, None if it is not given."""
        return self.parameters()[self.resolve(name)].value

    def with_values(self: S, changes: Mapping[str, Any]) -> S:
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
                full[self.resolve(name)] = self.read(self.resolve(name), value)
            except UnknownNameError as error:
                problems.append(Problem(name, str(error)))
            except ParameterError as error:
                problems += error.problems
        if problems:
            raise ParameterError(problems)
        return replaced(self, full)


@question
def _parameters(rig: Rig) -> dict[str, Address]:
    return rig.declared()
