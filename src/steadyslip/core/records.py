"""Frozen records of named parameters: the base of every law, drive and slider.

A record declares each parameter once, with unit, domain and meaning::

    class Constant(ContactLaw, name="constant"):
        normal_stress: float = parameter("Pa", positive, "normal stress")

From that one line come the constructor and its checks, reading and writing of rig files, the JSON
schema, the reference page, the symbol in the equations and the range searched for stability edges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from typing import Any, ClassVar, TypeVar, dataclass_transform

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, QuantityError, UnknownNameError, came, unknown_name
from steadyslip.core.quantities import example, numbers, parse
from steadyslip.core.settings import Setting


@dataclass(frozen=True)
class Domain:
    """The values that a parameter may take: an interval, open or closed at each end."""

    low: float
    high: float
    low_allowed: bool
    high_allowed: bool
    text: str
    whole: bool = False

    def contains(self, value: Any) -> Any:
        """Elementwise test, false for NaN and infinity."""
        above = value >= self.low if self.low_allowed else value > self.low
        below = value <= self.high if self.high_allowed else value < self.high
        return above & below & np.isfinite(value) & (not self.whole or np.floor(value) == value)


_INF = math.inf
positive = Domain(0, _INF, False, True, "a finite number > 0")
nonnegative = Domain(0, _INF, True, True, "a finite number >= 0")
real = Domain(-_INF, _INF, True, True, "a finite number")
share = Domain(0, 1, True, True, "a number from 0 to 1")
angle = Domain(-math.pi / 2, math.pi / 2, False, False, "an angle between -90 deg and 90 deg, both excluded")
acute = Domain(0, math.pi / 2, False, False, "an angle between 0 and 90 deg, both excluded")
turn = Domain(-2 * math.pi, 2 * math.pi, True, True, "an angle from -360 deg to 360 deg")
count = Domain(1, 100_000, True, True, "a whole number from 1 to 100000", whole=True)


KINDS = {
    "friction level": "friction coefficient in steady sliding at the reference rate",
    "direct effect": "rise of friction per e-fold of velocity, at once",
    "evolution effect": "fall of friction per e-fold of velocity, as the state follows",
    "slip distance": "slip over which a memory fades",
    "reference rate": "velocity at which other parameters hold",
    "stress share": "share of the response to normal stress that is not immediate",
    "normal stress": "of the contact, in steady sliding or without coupling to the motion",
    "stiffness": "of the spring, or of what acts as one",
}
"""What a parameter can be to the stages that look for meaning, not for names."""


@dataclass(frozen=True)
class Parameter:
    """What a numeric field of a record means.

    Attributes
    ----------
    unit : str
        SI unit; ``"1"`` if dimensionless.
    domain : Domain
        Allowed values.
    doc : str
        Meaning, a phrase.
    structural : bool
        Zero means that the term is absent from the equations (mass, B0, ...), not merely small.
    adds_state : bool
        Structural, and its presence adds a variable to the model, so that zero is no limit of small values.
    gauge : bool
        Changes no observable result (a reference that only shifts a state), so has no edge.
    kind : str
        What it is to those who scale motions or fit records without knowing the law: one of `KINDS`, or nothing.
    size : float or None
        Change that matters, of a parameter that may be zero or of either sign; a positive one has its own size.
    letter : str
        Its symbol in equations; its name unless given.
    standing : float or None
        Stands for the parameter where it is yet to be fitted.
    idle : float or None
        Value at which the parameter, with the others of its own member of a list, does nothing: without it the law is
        a simpler one.
    """

    unit: str
    domain: Domain
    doc: str
    structural: bool = False
    gauge: bool = False
    adds_state: bool = False
    kind: str = ""
    size: float | None = None
    standing: float | None = None
    letter: str = ""
    idle: float | None = None

    def __post_init__(self) -> None:
        if self.kind and self.kind not in KINDS:
            raise TypeError(unknown_name("kind of parameter", self.kind, KINDS))


@dataclass(frozen=True)
class Option:
    """A field that selects one of a few words, or true or false."""

    choices: tuple[Any, ...]
    doc: str


@dataclass(frozen=True)
class Series:
    """A field that holds a measured column: a tuple of finite numbers in the SI unit."""

    unit: str
    doc: str


@dataclass(frozen=True)
class Part:
    """A field that holds another record; ``inline`` puts its parameters beside the owner's.

    With ``many`` it holds a tuple of them: a list of tables, or with ``by_name`` tables named after their laws.
    """

    family: type[FrozenRecord]
    doc: str
    inline: bool = False
    many: bool = False
    by_name: bool = False


@dataclass(frozen=True)
class Named:
    """A field that holds a record for each of some dotted names; ``listed`` lets a list of values stand for one."""

    family: type[FrozenRecord]
    doc: str
    listed: bool = False


@dataclass(frozen=True)
class Condition:
    """A relation that numbers of a record must obey together.

    Attributes
    ----------
    name : str
        Field that a message names.
    holds : bool or ndarray of bool
        Per rig, where the numbers are arrays.
    message : str
        What came and what is allowed, with places ``{}`` for `numbers`.
    numbers : tuple of float or ndarray
        On which the condition depends.
    """

    name: str
    holds: Any
    message: str
    numbers: tuple[Any, ...] = ()

    def problem(self, name: str = "") -> Problem | None:
        """What is wrong, at the first position where it is; None if the condition holds."""
        holds = np.asarray(self.holds)
        if np.all(holds):
            return None
        arrays = np.broadcast_arrays(holds, *self.numbers)
        where = tuple(int(i) for i in np.argwhere(~arrays[0])[0])
        place = f" (at position {where})" if arrays[0].size > 1 else ""
        return Problem(name or self.name, self.message.format(*(repr(float(a[where])) for a in arrays[1:])) + place)


Role = Parameter | Option | Part | Named | Series | Setting
_ROLE, _KEY = "steadyslip", "key"
R = TypeVar("R", bound="FrozenRecord")


def parameter(
    unit: str,
    domain: Domain,
    doc: str,
    *,
    default: Any = MISSING,
    structural: bool = False,
    gauge: bool = False,
    adds_state: bool = False,
    kind: str = "",
    size: float | None = None,
    idle: float | None = None,
    standing: float | None = None,
    letter: str = "",
) -> Any:
    """Declare a numeric parameter; ``default=None`` makes it optional, the rest is as in `Parameter`."""
    role = Parameter(unit, domain, doc, structural, gauge, adds_state, kind, size, standing, letter, idle)
    return field(default=default, metadata={_ROLE: role})


def option(*choices: Any, doc: str, default: Any) -> Any:
    """Declare a choice between words, or between true and false."""
    return field(default=default, metadata={_ROLE: Option(choices, doc)})


def samples(unit: str, doc: str) -> Any:
    """Declare a measured column: a list or array of numbers, or of texts with units."""
    return field(metadata={_ROLE: Series(unit, doc)})


def part(family: type[FrozenRecord], doc: str, *, default: Any = MISSING, inline: bool = False) -> Any:
    """Declare a field that holds another record of `family`."""
    return field(default=default, metadata={_ROLE: Part(family, doc, inline)})


def parts(family: type[FrozenRecord], doc: str, *, default: tuple[()], by_name: bool = False) -> Any:
    """Declare a field that holds a tuple of records; the default is the empty one."""
    return field(default=default, metadata={_ROLE: Part(family, doc, many=True, by_name=by_name)})


def named(family: type[FrozenRecord], doc: str, *, listed: bool = False) -> Any:
    """Declare a field that holds a mapping of dotted names to records, None by default."""
    return field(default=None, metadata={_ROLE: Named(family, doc, listed)})


def setting(role: Setting, *, default: Any = MISSING, key: str = "") -> Any:
    """Declare a field of another kind; ``key`` is its name in files where Python keeps that word for itself."""
    return field(default=default, metadata={_ROLE: role, _KEY: key})


@dataclass_transform(
    kw_only_default=True,
    frozen_default=True,
    field_specifiers=(parameter, option, samples, part, parts, named, setting),
)
class FrozenRecord:
    """Frozen, checked when built, addressed by dotted names.

    Subclasses become frozen keyword-only dataclasses by themselves. ``name="..."`` registers a law
    under the word used in rig files; ``family="..."`` starts a new family of interchangeable laws;
    ``section="..."`` puts a word before the record's own numbers; ``kw_only=False`` lets the
    constructor take numbers by position.
    """

    name: ClassVar[str] = ""
    family: ClassVar[str] = ""
    section: ClassVar[str] = ""
    short: ClassVar[tuple[str, ...]] = ()
    """Keys of its table that a single value, or a list of values in their order, stands for."""
    registry: ClassVar[dict[str, type[FrozenRecord]]] = {}

    def __init_subclass__(
        cls, *, name: str = "", family: str = "", section: str = "", kw_only: bool = True, **kwargs: Any
    ) -> None:
        super().__init_subclass__(**kwargs)
        dataclass(frozen=True, kw_only=kw_only, repr=False)(cls)
        if section:
            cls.section = section + "."
        if family:
            cls.family, cls.registry = family, {}
        cls.name = name
        if name:
            taken = cls.registry.get(name)
            if taken is not None and (taken.__module__, taken.__qualname__) != (
                cls.__module__,
                cls.__qualname__,
            ):
                raise TypeError(f"the {cls.family} name {name!r} already belongs to {taken.__qualname__}")
            cls.registry[name] = cls

    def __post_init__(self) -> None:
        problems = []
        for item in fields(self):  # type: ignore[arg-type]  # every subclass is a dataclass
            value = getattr(self, item.name)
            try:
                object.__setattr__(self, item.name, checked(item, value))
            except ParameterError as error:
                problems += [p.under(item.name) for p in error.problems]
        problems = problems or list(self.inconsistencies())
        problems = problems or [p for condition in self.conditions() if (p := condition.problem()) is not None]
        if problems:
            raise ParameterError(problems, title=type(self).__name__)

    def inconsistencies(self) -> Iterator[Problem]:
        """Problems with which fields are given together; called once each field is valid by itself."""
        yield from ()

    def conditions(self) -> Iterator[Condition]:
        """Relations between several numbers; valid for single numbers, and for arrays in a `twin`."""
        yield from ()

    def __repr__(self) -> str:
        shown = (
            f"{item.name}={getattr(self, item.name)!r}"
            for item in fields(self)  # type: ignore[arg-type]
            if getattr(self, item.name) not in (None, ()) and getattr(self, item.name) != item.default
        )
        return f"{type(self).__name__}({', '.join(shown)})"


class Settings(FrozenRecord):
    """Base of tables that say what to do with a rig; what is right in a faulty one helps to find further faults."""


def key_of(item: Field[Any]) -> str:
    """The key that stands for a field in files."""
    return item.metadata.get(_KEY) or item.name


def given(record: FrozenRecord) -> dict[str, Any]:
    """The fields of a record that differ from their default."""
    found = {item.name: getattr(record, item.name) for item in fields(record)}  # type: ignore[arg-type]
    return {item.name: found[item.name] for item in fields(record) if found[item.name] != item.default}  # type: ignore[arg-type]


def role_of(item: Field[Any]) -> Role:
    """The declaration behind a dataclass field."""
    role: Role | None = item.metadata.get(_ROLE)
    if role is None:
        raise TypeError(f"field {item.name!r} has no unit or domain; declare it with parameter(), option() or part()")
    return role


def field_name(record: FrozenRecord | type[FrozenRecord], item: Field[Any], prefix: str) -> str:
    """Dotted name of a field."""
    return f"{prefix}{record.section if isinstance(role_of(item), Parameter) else ''}{item.name}"


def is_required(item: Field[Any]) -> bool:
    """Whether a field has no default."""
    return item.default is MISSING


def checked(item: Field[Any], value: Any) -> Any:
    """The value of a field, converted and checked; ParameterError names no field, only the fault."""
    role = role_of(item)
    if value is None and item.default is None:
        return None
    if isinstance(role, Parameter):
        return checked_number(role, value)
    if isinstance(role, Option):
        if not any(value == c and isinstance(value, bool) == isinstance(c, bool) for c in role.choices):
            if role.choices == (False, True):
                raise _fault(f"got {came(value)}; allowed: true or false")
            raise _fault(unknown_name("choice", value, [str(c) for c in role.choices]))
        return value
    if isinstance(role, Series):
        try:
            return numbers(value, role.unit)
        except QuantityError as error:
            raise _fault(str(error)) from error
    if isinstance(role, Setting):
        return role.checked(value)
    if isinstance(role, Named):
        return _checked_named(role, value)
    if role.many:
        if not isinstance(value, (list, tuple)):
            raise _fault(f"got {came(value)}; allowed: a list of {role.family.__name__}")
        return tuple(_checked_part(role, v, f"{i}") for i, v in enumerate(value, start=1))
    return _checked_part(role, value, "")


def _checked_named(role: Named, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise _fault(f"got {came(value)}; allowed: names and their values")
    for name, one in value.items():
        if not (isinstance(one, role.family) or (role.listed and isinstance(one, (list, tuple)))):
            raise ParameterError([Problem(name, f"got {came(one)}; allowed: a {role.family.__name__}")])
    return dict(value)


def _checked_part(role: Part, value: Any, index: str) -> FrozenRecord:
    if isinstance(value, role.family):
        return value
    message = f"got {came(value)}; allowed: a {role.family.__name__}"
    known = ", ".join(f"{law.__name__}" for law in role.family.registry.values())
    raise ParameterError([Problem(index, message + (f" ({known})" if known else ""))])


def checked_number(role: Parameter, value: Any) -> float:
    """A number or text such as ``"5 MPa"`` as an SI float inside the parameter's domain."""
    if isinstance(value, str):
        try:
            number = parse(value, role.unit)
        except QuantityError as error:
            raise _fault(str(error)) from error
    elif isinstance(value, bool) or not hasattr(value, "__float__"):
        raise _fault(f"got {came(value)}; allowed: {allowed(role)}")
    elif np.ndim(value) != 0:
        raise _fault("got an array; a rig holds single values, pass arrays by dotted name instead")
    else:
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError) as error:
            raise _fault(f"got {came(value)}; allowed: {allowed(role)}") from error
    if not role.domain.contains(number):
        raise _fault(f"got {came(value)}; allowed: {allowed(role)}")
    return number


def allowed(role: Parameter) -> str:
    """What a parameter may be, in words for messages."""
    unit = "" if role.unit == "1" else f" in {role.unit}, or text such as {example(role.unit)}"
    return role.domain.text + unit


def _fault(message: str) -> ParameterError:
    return ParameterError([Problem("", message)])


@dataclass(frozen=True)
class Address:
    """One parameter of a record: dotted name, declaration and present value (None if not given)."""

    name: str
    role: Parameter
    value: float | None


def parameters(record: FrozenRecord, prefix: str = "") -> dict[str, Address]:
    """All numeric parameters below `record`, by dotted name, in order of declaration."""
    found: dict[str, Address] = {}
    for item in fields(record):  # type: ignore[arg-type]
        role, value = role_of(item), getattr(record, item.name)
        name = field_name(record, item, prefix)
        if isinstance(role, Parameter):
            found[name] = Address(name, role, value)
        elif isinstance(role, Part) and role.many:
            for index, member in enumerate(value, start=1):
                found |= parameters(member, f"{name}.{index}.")
        elif isinstance(role, Part) and value is not None:
            found |= parameters(value, prefix if role.inline else f"{name}.")
    return found


def conditions(record: FrozenRecord, prefix: str = "") -> Iterator[tuple[str, Condition]]:
    """Every condition below `record`, with the dotted name of the field that it is about."""
    items = {item.name: item for item in fields(record)}  # type: ignore[arg-type]
    for condition in record.conditions():
        yield field_name(record, items[condition.name], prefix), condition
    for item in items.values():
        role, value = role_of(item), getattr(record, item.name)
        name = field_name(record, item, prefix)
        if isinstance(role, Part) and role.many:
            for index, member in enumerate(value, start=1):
                yield from conditions(member, f"{name}.{index}.")
        elif isinstance(role, Part) and value is not None:
            yield from conditions(value, prefix if role.inline else f"{name}.")


def resolve(name: str, known: Mapping[str, Any]) -> str:
    """The full dotted name for `name`, which may leave out leading or middle parts where that is unique.

    Raises
    ------
    UnknownNameError
        If nothing, or more than one parameter, has that name.
    """
    if name in known:
        return name
    first, _, rest = name.partition(".")
    ends = [full for full in known if full.endswith("." + name)]
    ends = ends or [full for full in known if rest and full.startswith(first + ".") and full.endswith("." + rest)]
    if len(ends) == 1:
        return ends[0]
    if ends:
        raise UnknownNameError("parameter (it is ambiguous)", name, ends)
    raise UnknownNameError("parameter", name, known)


def replaced(record: R, changes: Mapping[str, Any], prefix: str = "") -> R:
    """A copy with the parameters of the given full dotted names changed; checked like any other."""
    own: dict[str, Any] = {}
    for item in fields(record):  # type: ignore[arg-type]
        role, value = role_of(item), getattr(record, item.name)
        name = field_name(record, item, prefix)
        if isinstance(role, Part) and role.many:
            own[item.name] = tuple(
                replaced(member, changes, f"{name}.{index}.") for index, member in enumerate(value, start=1)
            )
        elif isinstance(role, Part) and value is not None:
            own[item.name] = replaced(value, changes, prefix if role.inline else f"{name}.")
        elif name in changes:
            own[item.name] = changes[name]
    return replace(record, **own)  # type: ignore[type-var]


def twin(record: R, values: Mapping[str, Any], prefix: str = "") -> R:
    """The same record with other things, usually symbols, in place of its numbers; nothing is checked.

    Law methods read their own fields, so the same method serves numbers and symbols.
    """
    copy: R = object.__new__(type(record))
    for item in fields(record):  # type: ignore[arg-type]
        role, value = role_of(item), getattr(record, item.name)
        name = field_name(record, item, prefix)
        if isinstance(role, Part) and role.many:
            value = tuple(twin(member, values, f"{name}.{i}.") for i, member in enumerate(value, start=1))
        elif isinstance(role, Part) and value is not None:
            value = twin(value, values, prefix if role.inline else f"{name}.")
        elif isinstance(role, Parameter):
            value = values.get(name, value)
        object.__setattr__(copy, item.name, value)
    return copy


def shape_of(record: FrozenRecord, prefix: str = "") -> tuple[Any, ...]:
    """A hashable description of everything but the numbers: types, options, which parameters are given."""
    shape: list[Any] = [type(record)]
    for item in fields(record):  # type: ignore[arg-type]
        role, value = role_of(item), getattr(record, item.name)
        if isinstance(role, Option):
            shape.append(value)
        elif isinstance(role, Parameter):
            shape.append("none" if value is None else "zero" if role.structural and value == 0 else "given")
        elif isinstance(role, Series):
            shape.append("samples")
        elif isinstance(role, Part) and role.many:
            shape.append(tuple(shape_of(member) for member in value))
        elif isinstance(role, Part):
            shape.append(None if value is None else shape_of(value))
        else:
            shape.append(value)
    return tuple(shape)
