"""What every rig has, whether it is a slider or a machine: parameters by dotted name, and a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

from steadyslip.core.errors import ParameterError, Problem, UnknownNameError
from steadyslip.core.questions import Keeper, question
from steadyslip.core.records import Address, FrozenRecord, parameters, replaced, resolve
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
        """Area (m²) for which people give and get a parameter as a total; None where it is what it is inside."""
        raise NotImplementedError

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
                full[self.resolve(name)] = value
            except UnknownNameError as error:
                problems.append(Problem(name, str(error)))
        if problems:
            raise ParameterError(problems)
        return replaced(self, full)


@question
def _parameters(rig: Rig) -> dict[str, Address]:
    return parameters(rig)
