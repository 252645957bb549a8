"""Differences between two records, and copies of one record with some values from the other."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from steadyslip.core.names import Members
from steadyslip.core.records import Declared, FrozenRecord, Part, field_layout
from steadyslip.core.roles import Parameter

R = TypeVar("R", bound=FrozenRecord)


@dataclass(frozen=True)
class Differing:
    """A parameter, option, law or member in which two records differ.

    Attributes
    ----------
    name : str
        Dotted name of a parameter, an option, a law or a member.
    first, second : object
        Values in the two records: numbers in SI units, words or records; None if a record has no value.
    role : Parameter or None
        Role of the parameter; None if the values are not numbers.
    """

    name: str
    first: Any
    second: Any
    role: Parameter | None


def differing(first: FrozenRecord, second: FrozenRecord, prefix: str = "") -> Iterator[Differing]:
    """Yield the fields in which two records differ; if their laws differ, the whole laws."""
    if type(first) is not type(second):
        yield Differing(prefix.rstrip("."), first, second, None)
        return
    for field_name, own_name, role in field_layout(first):
        one, other, name = getattr(first, field_name), getattr(second, field_name), prefix + own_name
        pairs = _pairs(role, one, other, name, prefix)
        if pairs is None:
            if one != other:
                yield Differing(name, one, other, role if isinstance(role, Parameter) else None)
            continue
        for at, a, b in pairs:
            if a is None or b is None:
                yield Differing(at.rstrip("."), a, b, None)
            else:
                yield from differing(a, b, at)


def mixed(first: R, second: R, taken: Collection[str], prefix: str = "") -> R:
    """Copy of the first record that has the second record's values of the dotted names `taken`.

    Checked by the constructors.

    Raises
    ------
    ParameterError
        If the mixed record has forbidden values or combinations.
    """
    if type(first) is not type(second):
        return second if prefix.rstrip(".") in taken else first
    own: dict[str, Any] = {}
    for field_name, own_name, role in field_layout(first):
        one, other, name = getattr(first, field_name), getattr(second, field_name), prefix + own_name
        pairs = _pairs(role, one, other, name, prefix)
        if pairs is None:
            own[field_name] = other if name in taken else one
            continue
        made = [
            mixed(a, b, taken, at) if a is not None and b is not None else b if at.rstrip(".") in taken else a
            for at, a, b in pairs
        ]
        if isinstance(role, Part) and role.keyed:
            names = list(dict.fromkeys((*one, *other)))
            own[field_name] = Members({n: m for n, m in zip(names, made, strict=True) if m is not None})
        else:
            own[field_name] = tuple(made) if isinstance(role, Part) and role.many else made[0]
    return replace(first, **own)  # type: ignore[type-var]


def _pairs(
    role: Declared, one: Any, other: Any, name: str, prefix: str
) -> list[tuple[str, FrozenRecord | None, FrozenRecord | None]] | None:
    """Prefix and members of both records for each member of a field; None if the field has no comparable members.

    If only one of the records has a member, None stands for the missing member of the other record.
    """
    if not isinstance(role, Part) or one is None or other is None:
        return None
    if role.many:
        if len(one) != len(other):
            return None
        return [(f"{name}.{i}.", a, b) for i, (a, b) in enumerate(zip(one, other, strict=True), start=1)]
    if role.keyed:
        return [(f"{name}.{key}.", one.get(key), other.get(key)) for key in dict.fromkeys((*one, *other))]
    return [(prefix if role.inline and type(one) is type(other) else f"{name}.", one, other)]
