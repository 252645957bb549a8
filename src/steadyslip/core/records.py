"""Frozen records of named parameters: the base of every law, drive and slider.

A record declares each parameter once, with unit, domain and meaning::

    class ConstantNormalStress(ContactLaw, name="constant"):
        stress: float = parameter("Pa", positive, "normal stress")

The constructor and its checks, reading and writing of rig files, the JSON schema, the reference page, the symbol in
the equations and the search range for stability edges are all derived from that line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from functools import cache
from typing import Any, ClassVar, TypeVar, dataclass_transform

from steadyslip.core.areas import total_unit
from steadyslip.core.domains import Condition, Domain
from steadyslip.core.entries import Option
from steadyslip.core.errors import ParameterError, Problem, one, repr_short
from steadyslip.core.names import Members, unfit_name
from steadyslip.core.pages import Displayed
from steadyslip.core.roles import Entry, Parameter, Role, Series, Total, fault


@dataclass(frozen=True)
class Part(Role):
    """Role of a field that holds another record; with ``inline`` its parameters are named like those of the owner.

    With ``many`` it holds a tuple of records: in files a list of tables, or with ``by_name`` tables named after their
    laws. With ``keyed`` it holds `Members`: in files a table of tables, each under a user-given name.
    """

    family: type[FrozenRecord]
    doc: str
    inline: bool = False
    many: bool = False
    by_name: bool = False
    keyed: bool = False

    def checked(self, value: Any) -> Any:
        if self.keyed:
            return self._keyed(value)
        if not self.many:
            return self._member(value, "")
        if not isinstance(value, (list, tuple)):
            raise fault(f"got {repr_short(value)}; allowed: a list of {self.family.__name__}")
        return tuple(self._member(one, f"{i}") for i, one in enumerate(value, start=1))

    def _keyed(self, value: Any) -> Members:
        if not isinstance(value, Mapping):
            raise fault(f"got {repr_short(value)}; allowed: names, and {one(self.family.__name__)} for each")
        problems = [Problem(str(name), wrong) for name in value if (wrong := unfit_name(name))]
        found = {}
        for name, member in value.items():
            try:
                found[name] = self._member(member, str(name))
            except ParameterError as error:
                problems += error.problems
        if problems:
            raise ParameterError(problems)
        return Members(found)

    def _member(self, value: Any, index: str) -> FrozenRecord:
        if isinstance(value, self.family):
            return value
        raise ParameterError([Problem(index, f"got {repr_short(value)}; allowed: {self.allowed()}")])

    def allowed(self) -> str:
        known = ", ".join(law.__name__ for law in self.family.registry.values())
        return one(self.family.__name__) + (f" ({known})" if known else "")


@dataclass(frozen=True)
class Named(Role):
    """Role of a field that maps dotted names to records; with ``listed`` a list of values may replace a record."""

    family: type[FrozenRecord]
    doc: str
    listed: bool = False

    def checked(self, value: Any) -> Mapping[str, Any]:
        if not isinstance(value, Mapping):
            raise self.refused(value)
        for name, found in value.items():
            if not (isinstance(found, self.family) or (self.listed and isinstance(found, (list, tuple)))):
                raise ParameterError([Problem(name, f"got {repr_short(found)}; allowed: {one(self.family.__name__)}")])
        return dict(value)

    def allowed(self) -> str:
        return "names and their values"


Declared = Entry | Part | Named
"""Types of roles with which record fields are declared."""
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
    elsewhere: tuple[str, ...] = (),
    instance: str = "",
) -> Any:
    """Declare a numeric field; ``default=None`` makes it optional, the other arguments are those of `Parameter`.

    Examples
    --------
    >>> ss.laws.parameter("m", ss.laws.positive, "slip distance").metadata["steadyslip"].unit
    'm'
    """
    role = Parameter(
        unit, domain, doc, structural, gauge, adds_state, kind, size, standing, letter, idle, elsewhere, instance,
        optional=default is None,
    )  # fmt: skip
    return field(default=default, metadata={_ROLE: role})


def option(*choices: Any, doc: str, default: Any) -> Any:
    """Declare a field whose value is one of the `choices`: words, or a bool.

    Examples
    --------
    >>> ss.laws.option("slow", "fast", doc="pace", default="slow").default
    'slow'
    """
    return field(default=default, metadata={_ROLE: Option(choices, doc)})


def samples(unit: str, doc: str) -> Any:
    """Declare a field for a measured column: a list or array of numbers, or of texts with units.

    Examples
    --------
    >>> ss.laws.samples("s", "times of the column").metadata["steadyslip"].unit
    's'
    """
    return field(metadata={_ROLE: Series(unit, doc)})


def part(family: type[FrozenRecord], doc: str, *, default: Any = MISSING, inline: bool = False) -> Any:
    """Declare a field that holds another record of `family`.

    Examples
    --------
    >>> ss.laws.part(ss.laws.NormalMemory, "memory of normal stress").metadata["steadyslip"].family.__name__
    'NormalMemory'
    """
    return field(default=default, metadata={_ROLE: Part(family, doc, inline)})


def parts(family: type[FrozenRecord], doc: str, *, default: tuple[()], by_name: bool = False) -> Any:
    """Declare a field that holds a tuple of records, empty by default.

    Examples
    --------
    >>> ss.laws.parts(ss.laws.State, "states of friction", default=()).default
    ()
    """
    return field(default=default, metadata={_ROLE: Part(family, doc, many=True, by_name=by_name)})


def members(family: type[FrozenRecord], doc: str, *, default: Any = MISSING) -> Any:
    """Declare a field that holds records of `family` by user-given names."""
    return field(default=default, metadata={_ROLE: Part(family, doc, keyed=True)})


def named(family: type[FrozenRecord], doc: str, *, listed: bool = False) -> Any:
    """Declare a field that holds a mapping of dotted names to records, None by default."""
    return field(default=None, metadata={_ROLE: Named(family, doc, listed)})


def setting(role: Entry, *, default: Any = MISSING, key: str = "") -> Any:
    """Declare a field whose role is given as an `Entry`, where no function above fits.

    ``key`` is its name in files if that is a Python keyword.
    """
    return field(default=default, metadata={_ROLE: role, _KEY: key})


@dataclass_transform(
    kw_only_default=True,
    frozen_default=True,
    field_specifiers=(parameter, option, samples, part, parts, members, named, setting),
)
class FrozenRecord(Displayed):
    """Base of frozen records: fields are checked by the constructor, and parameters have dotted names.

    Subclasses become frozen keyword-only dataclasses automatically. ``name="..."`` registers a law under the word used
    in rig files; ``family="..."`` starts a new family of interchangeable laws; ``section="..."`` is put before the
    names of the record's own parameters; ``kw_only=False`` allows positional arguments.
    """

    name: ClassVar[str] = ""
    family: ClassVar[str] = ""
    section: ClassVar[str] = ""
    short: ClassVar[tuple[str, ...]] = ()
    """Fields that may replace the record's table in files: one value for the first, or a list in this order."""
    registry: ClassVar[dict[str, type[FrozenRecord]]] = {}
    chosen_by: ClassVar[tuple[str, str | None]] = ("law", None)
    """Key of the family's tables that names the law, and the default law if it is absent."""
    has_area: ClassVar[bool] = False
    """True if the record is a complete contact with an optional field `area`."""
    in_totals: ClassVar[bool] = False
    """True if per-area quantities in the record's file table are totals of a contact with its own `area`."""

    def __init_subclass__(
        cls, *, name: str = "", family: str = "", section: str = "", kw_only: bool = True, **kwargs: Any
    ) -> None:
        super().__init_subclass__(**kwargs)
        _check_fields(cls)
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
        problems = problems or list(self._settled())
        problems = problems or list(self.inconsistencies())
        problems = problems or [p for condition in self.conditions() if (p := condition.problem()) is not None]
        if problems:
            raise ParameterError(problems, title=type(self).__name__)

    def _settled(self) -> Iterator[Problem]:
        """Convert totals (N, N/m, ...) to values per unit area; yield a Problem for each total if there is no area."""
        if not self.has_area:
            return
        totals = {name: found for name, found in parameters(self).items() if isinstance(found.value, Total)}
        area = getattr(self, "area", None) or (1.0 if self.in_totals else None)
        for name, address in totals.items():
            if area is None:
                unit, got = address.role.unit, f"got {address.value:g} {total_unit(address.role.unit)}"
                hint = f"give the contact's area, such as area = '0.01 m^2', or a quantity in {unit}"
                yield Problem(name, f"{got}, the total of a contact; this parameter is per unit area; {hint}")
        if totals and area is not None:
            other = replaced(self, {name: float(address.value or 0.0) / area for name, address in totals.items()})
            for item in fields(self):  # type: ignore[arg-type]
                object.__setattr__(self, item.name, getattr(other, item.name))

    def inconsistencies(self) -> Iterator[Problem]:
        """Yield a Problem for each forbidden combination of fields; called if every field is valid by itself."""
        yield from ()

    def conditions(self) -> Iterator[Condition]:
        """Yield the conditions between several parameters; fields may be numbers, or arrays set by `with_values`."""
        yield from ()

    def __repr__(self) -> str:
        shown = (
            f"{item.name}={getattr(self, item.name)!r}"
            for item in fields(self)  # type: ignore[arg-type]
            if getattr(self, item.name) not in (None, ()) and getattr(self, item.name) != item.default
        )
        return f"{type(self).__name__}({', '.join(shown)})"


def _check_fields(cls: type[FrozenRecord]) -> None:
    """Raise TypeError if a field is named like a method or attribute of a base, or like the law's key in files."""
    known = {name for base in cls.__mro__[1:] for name in getattr(base, "__dataclass_fields__", ())}
    own = [name for name in vars(cls).get("__annotations__", ()) if isinstance(vars(cls).get(name), Field)]
    for name in own:
        if name not in known and any(name in vars(base) for base in cls.__mro__[1:]):
            raise TypeError(
                f"{cls.__name__}: a parameter cannot be called {name!r}: {cls.__mro__[1].__name__} already has a "
                "method or attribute of that name; give it another"
            )
        if name == cls.chosen_by[0]:
            raise TypeError(f"{cls.__name__}: a parameter cannot be called {name!r}, the key that names a law in files")


class Settings(FrozenRecord):
    """Base of file tables about tasks ([map], [fit], ...); valid entries of a faulty table help check other tables."""


def key_of(item: Field[Any]) -> str:
    """Key of a dataclass field in files: its name, unless another key was declared."""
    return item.metadata.get(_KEY) or item.name


def given(record: FrozenRecord) -> dict[str, Any]:
    """Values of a record's fields that differ from the default, by field name."""
    found = {item.name: getattr(record, item.name) for item in fields(record)}  # type: ignore[arg-type]
    return {item.name: found[item.name] for item in fields(record) if found[item.name] != item.default}  # type: ignore[arg-type]


def role_of(item: Field[Any]) -> Declared:
    """Role with which a dataclass field was declared; TypeError if it has none."""
    role: Declared | None = item.metadata.get(_ROLE)
    if role is None:
        raise TypeError(f"field {item.name!r} has no unit or domain; declare it with parameter(), option() or part()")
    return role


def stand_in(law: type[R]) -> R | None:
    """Record of a law with the `standing` values of its parameters; None if a required field has no standing value."""
    standing = {item.name: getattr(role_of(item), "standing", None) for item in fields(law)}  # type: ignore[arg-type]
    own = {name: value for name, value in standing.items() if value is not None}
    lacking = [item for item in fields(law) if is_required(item) and item.name not in own]  # type: ignore[arg-type]
    return None if lacking else law(**own)


def field_layout(record: FrozenRecord) -> tuple[tuple[str, str, Declared], ...]:
    """Attribute name, dotted name within the record, and role of every field of a record."""
    kind: Any = type(record)
    return _layout_of(kind)


@cache
def _layout_of(kind: Any) -> tuple[tuple[str, str, Declared], ...]:
    found = [(item.name, role_of(item)) for item in fields(kind)]
    return tuple((name, (kind.section if isinstance(role, Parameter) else "") + name, role) for name, role in found)


def is_required(item: Field[Any]) -> bool:
    """True if a field has no default."""
    return item.default is MISSING


def checked(item: Field[Any], value: Any) -> Any:
    """Check and convert the value of a field; a ParameterError does not yet name the field."""
    if value is None and item.default is None:
        return None
    role = role_of(item)
    return role.given(value) if isinstance(role, Parameter) else role.checked(value)


def below(role: Part, value: Any, name: str, prefix: str) -> Iterator[tuple[str, FrozenRecord]]:
    """Yield the records that a field holds, each with the prefix that its parameters' dotted names have."""
    if role.many:
        yield from ((f"{name}.{index}.", member) for index, member in enumerate(value, start=1))
    elif role.keyed:
        yield from ((f"{name}.{key}.", member) for key, member in value.items())
    elif value is not None:
        yield (prefix if role.inline else f"{name}."), value


def records_in(record: FrozenRecord) -> Iterator[FrozenRecord]:
    """Yield all records inside a record, depth first."""
    for name, own, role in field_layout(record):
        if isinstance(role, Part):
            for _, member in below(role, getattr(record, name), own, ""):
                yield member
                yield from records_in(member)


def _each(role: Part, value: Any, name: str, prefix: str, change: Callable[[Any, str], Any]) -> Any:
    """Copy of a field's value with every record in it replaced by ``change(record, prefix)``."""
    changed = [change(member, before) for before, member in below(role, value, name, prefix)]
    if role.many:
        return tuple(changed)
    if role.keyed:
        return Members(dict(zip(value, changed, strict=True)))
    return changed[0] if changed else None


@dataclass(frozen=True)
class Address:
    """A parameter of a record: dotted name, role and value (None if not given)."""

    name: str
    role: Parameter
    value: float | None


def parameters(record: FrozenRecord, prefix: str = "") -> dict[str, Address]:
    """Numeric parameters of a record and the records in it, by dotted name, in order of declaration."""
    found: dict[str, Address] = {}
    for field_name, own_name, role in field_layout(record):
        value, name = getattr(record, field_name), prefix + own_name
        if isinstance(role, Parameter):
            found[name] = Address(name, role, value)
        elif isinstance(role, Part):
            for before, member in below(role, value, name, prefix):
                own = parameters(member, before)
                if twice := found.keys() & own.keys():
                    owners = f"{type(record).__name__} and of {type(member).__name__}"
                    raise ParameterError(
                        [Problem(one, f"is a parameter of {owners}; rename one") for one in sorted(twice)]
                    )
                found |= own
    return found


def choices(record: FrozenRecord, prefix: str = "") -> dict[str, tuple[Option, Any, bool]]:
    """Options of a record and of the records in it by dotted name: role, present value, True if that is the default."""
    found: dict[str, tuple[Option, Any, bool]] = {}
    usual = {item.name: item.default for item in fields(record)}  # type: ignore[arg-type]
    for field_name, own_name, role in field_layout(record):
        value, name = getattr(record, field_name), prefix + own_name
        if isinstance(role, Option):
            found[name] = role, value, value == usual[field_name]
        elif isinstance(role, Part):
            for before, member in below(role, value, name, prefix):
                found |= choices(member, before)
    return found


def conditions(record: FrozenRecord, prefix: str = "") -> Iterator[tuple[str, Condition]]:
    """Yield the conditions of a record and the records in it, each with the dotted name of its field."""
    layout = field_layout(record)
    own = {field_name: prefix + own_name for field_name, own_name, _ in layout}
    for condition in record.conditions():
        first, dot, rest = condition.name.partition(".")
        yield own[first] + dot + rest, condition
    for field_name, _, role in layout:
        if isinstance(role, Part):
            for before, member in below(role, getattr(record, field_name), own[field_name], prefix):
                yield from conditions(member, before)


def replaced(record: R, changes: Mapping[str, Any], prefix: str = "") -> R:
    """Copy of a record with parameters changed by full dotted name; checked by the constructors."""
    own: dict[str, Any] = {}
    for field_name, own_name, role in field_layout(record):
        value, name = getattr(record, field_name), prefix + own_name
        if isinstance(role, Part):
            own[field_name] = _each(role, value, name, prefix, lambda member, at: replaced(member, changes, at))
        elif name in changes:
            own[field_name] = changes[name]
    return replace(record, **own)  # type: ignore[type-var]


def with_values(record: R, values: Mapping[str, Any], prefix: str = "") -> R:
    """Copy of a record with symbols or arrays in place of its numbers, by dotted name; nothing is checked.

    Methods of laws read the record's fields, so one method serves numbers, arrays and symbols.
    """
    copy: R = object.__new__(type(record))
    for field_name, own_name, role in field_layout(record):
        value, name = getattr(record, field_name), prefix + own_name
        if isinstance(role, Part):
            value = _each(role, value, name, prefix, lambda member, at: with_values(member, values, at))
        elif isinstance(role, Parameter):
            value = values.get(name, value)
        object.__setattr__(copy, field_name, value)
    return copy


def shape_of(record: FrozenRecord, prefix: str = "") -> tuple[Any, ...]:
    """Hashable structure of a record without its numbers: types, options, and which parameters are None or zero."""
    shape: list[Any] = [type(record)]
    for field_name, _, role in field_layout(record):
        value = getattr(record, field_name)
        if isinstance(role, Parameter):
            shape.append("none" if value is None else "zero" if role.structural and value == 0 else "given")
        elif isinstance(role, Series):
            shape.append("samples")
        elif isinstance(role, Part):
            inside = [shape_of(member) for _, member in below(role, value, "", "")]
            shape.append((tuple(value), *inside) if role.keyed else tuple(inside))
        else:
            shape.append(value)
    return tuple(shape)
