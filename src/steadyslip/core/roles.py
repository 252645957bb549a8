"""Roles: types of record fields and function arguments, which check, describe, read and write values.

Numbers (`Parameter`) and measured columns (`Series`) are here; choices, text, integers and names are in `entries`.
Other layers derive further roles from `Entry`.
"""

from __future__ import annotations

import json
import math
import re
from contextlib import suppress
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

import numpy as np

from steadyslip.core.areas import is_per_area, outside, total_unit
from steadyslip.core.domains import Domain
from steadyslip.core.errors import ParameterError, Problem, QuantityError, repr_short, unknown_name
from steadyslip.core.quantities import example, numbers, parse

Schema = dict[str, Any]


class Role:
    """Base of the types of record fields and function arguments."""

    def checked(self, value: Any) -> Any:
        """Check a value and convert it to the form that is stored.

        Raises
        ------
        ParameterError
            If the value is not allowed; the caller adds the name of the field.
        """
        raise NotImplementedError

    def allowed(self) -> str:
        """Description of the allowed values, for messages."""
        raise NotImplementedError

    def refused(self, value: Any) -> ParameterError:
        """ParameterError for a value that is not allowed."""
        return fault(f"got {repr_short(value)}; allowed: {self.allowed()}")


class Placeholder(float):
    """Provisional number for a parameter that the user has left out: fits take its value from records, or demand it.

    A value that replaces it is a plain float.
    """


def fault(message: str) -> ParameterError:
    """ParameterError with a message; the caller adds the name of the field."""
    return ParameterError([Problem("", message)])


class Entry(Role):
    """Base of roles of entries in file tables; subclasses are dataclasses whose `doc` describes the entry."""

    doc: str

    def schema(self) -> Schema:
        """JSON schema of the entry."""
        raise NotImplementedError

    def read(self, raw: Any, area: float | None) -> Any:
        """Convert a raw value of a file to the stored form; if the rig has an area (m²), the file has totals.

        Raises
        ------
        ParameterError
            If the value is not allowed; the caller adds the name of the field.
        """
        return self.checked(raw)

    def written(self, value: Any, area: float | None = None) -> str:
        """Format a value as TOML; per-area quantities as totals if the rig has an area (m²)."""
        return json.dumps(value, ensure_ascii=False)


PARAMETER_KINDS = {
    "friction level": "friction coefficient in steady sliding at the reference rate",
    "direct effect": "rise of friction per e-fold of velocity, at once",
    "evolution effect": "fall of friction per e-fold of velocity, as the state follows",
    "slip distance": "slip over which a memory fades",
    "reference rate": "velocity at which other parameters hold",
    "velocity scale": "velocity near which friction begins to depend on velocity otherwise",
    "stress share": "share of the response to normal stress that is not immediate",
    "exponent": "of the fall of friction near a velocity scale",
    "viscosity": "rise of friction with velocity, in proportion",
    "bristle stiffness": "of what gives way before sliding, per unit normal stress",
    "bristle damping": "beside the bristle stiffness, per unit normal stress",
    "drainage": "rate at which pore pressure evens out",
    "immediate share": "share of the response to normal stress that is immediate",
    "normal stress": "of the contact, in steady sliding or without coupling to the motion",
    "stiffness": "of the spring, or of what acts as one",
    "delay": "time by which something acts late",
}
"""Physical meanings of parameters (`Parameter.kind`), by which other code finds them, since laws choose the names."""


class Total(float):
    """Total of a contact (N, N/m, ...) given for a per-area parameter, before it is divided by the contact's area."""


class InUnit(float):
    """SI number from text like ``"0.05 rpm"``; whether its `unit` is allowed is checked once the rig is known."""

    unit: str

    def __new__(cls, number: float, unit: str) -> InUnit:
        """Float with the attribute `unit`."""
        found = super().__new__(cls, number)
        found.unit = unit
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        """Arguments for pickling, with the unit."""
        return InUnit, (float(self), self.unit)


_HINTS = re.compile(
    "^at velocity 0: |; (?:0 (?:to|is) |needs |without |[^;]* unless given).*$|, (?:instead|to report ).*$"
    "|, such as '[^']*'"
)
"""Matches the parts of a description that are hints for writing a file."""


@dataclass(frozen=True)
class Parameter(Entry):
    """Role of a numeric field: unit, allowed values and meaning.

    Attributes
    ----------
    unit : str
        SI unit; ``"1"`` if dimensionless.
    domain : Domain
        Allowed values.
    doc : str
        Meaning, in a phrase.
    structural : bool
        Zero removes the term from the equations (mass, B0, ...), so the Model has another structure.
    adds_state : bool
        Structural, and a nonzero value adds a variable, so zero is not the limit of small values.
    gauge : bool
        Changes no observable result (a reference that only shifts a state), so it has no stability edge.
    kind : str
        Physical meaning for scaling and fitting without knowledge of the law: a key of `PARAMETER_KINDS`, or empty.
    size : float or None
        Typical change of a parameter that may be zero or negative; of positive parameters it is the value itself.
    letter : str
        Symbol in equations; the name by default.
    standing : float or None
        Value used while the parameter is still to be fitted.
    idle : float or None
        Value at which a member of a list of records has no effect if all its parameters have their `idle` value; the
        law without that member is a simpler law.
    elsewhere : tuple of str
        SI units of the parameter for other kinds of rig: forces, angles.
    instance : str
        Typical value with its unit, for messages, such as ``2 ms``; by default an example for the SI unit.
    optional : bool
        The field may be left out; the message for a forbidden zero recommends it.
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
    elsewhere: tuple[str, ...] = ()
    instance: str = ""
    optional: bool = False

    @property
    def meaning(self) -> str:
        """`doc` without its hints for writing a file, such as alternatives and defaults."""
        return _HINTS.sub("", self.doc)

    @property
    def unless_given(self) -> str:
        """Default that `doc` states, such as ``2`` or ``infinite``; empty if it states none."""
        found = re.search(r"; ([^;]+) unless given", self.doc)
        return found[1] if found else ""

    def __post_init__(self) -> None:
        if self.kind and self.kind not in PARAMETER_KINDS:
            raise TypeError(unknown_name("kind of parameter", self.kind, PARAMETER_KINDS))

    def checked(self, value: Any) -> float:
        """Convert a number or text such as ``"5 MPa"`` to an SI float inside the domain."""
        if isinstance(value, str):
            try:
                number = parse(value, self.unit, self.instance)
            except QuantityError as error:
                raise fault(str(error)) from error
        elif isinstance(value, bool) or not hasattr(value, "__float__"):
            raise self.refused(value)
        elif np.ndim(value) != 0:
            raise fault("got an array; a rig holds single values, pass arrays by dotted name instead")
        else:
            try:
                number = float(value)
            except (TypeError, ValueError, OverflowError) as error:
                raise self.refused(value) from error
        if not self.domain.contains(number) and number != self.domain.apart:
            if (self.domain.low, self.domain.high) == (0, 1) and number > 1:
                bare = self.domain.contains(number / 100) and "%" not in str(value)
                percent = ", or '0 %' to '100 %'" if self.domain.low_allowed and self.domain.high_allowed else ""
                meant = f"; write '{number:g} %'" if bare else percent
                raise fault(f"got {repr_short(value)}; allowed: {self.allowed()}{meant}")
            if self.optional and number == 0:
                raise fault(f"got {repr_short(value)}; allowed: {self.allowed()}; or leave it out")
            raise self.refused(value)
        # + 0.0 turns -0.0 into 0.0, which equals the default when files are written
        return value if isinstance(value, Placeholder) else number + 0.0

    def given(self, value: Any) -> float:
        """Check a constructor argument; text whose unit only some rigs allow becomes a `Total` or an `InUnit`."""
        if isinstance(value, (Total, InUnit)):
            return value
        try:
            number = self.checked(value)
            return InUnit(number, self.unit) if self.elsewhere and isinstance(value, str) else number
        except ParameterError:
            for unit in self.elsewhere if isinstance(value, str) else ():
                with suppress(ParameterError):
                    return InUnit(Parameter(unit, self.domain, self.doc).checked(value), unit)
            if isinstance(value, str) and is_per_area(self.unit):
                with suppress(ParameterError):
                    return Total(Parameter(total_unit(self.unit), self.domain, self.doc).checked(value))
            raise

    def shown_instance(self) -> str:
        """Quoted example of a value, for messages."""
        return repr(self.instance) if self.instance else example(self.unit)

    def allowed(self) -> str:
        unit = "" if self.unit == "1" else f" in {self.unit}, or text such as {self.shown_instance()}"
        return self.domain.text + unit

    def schema(self) -> Schema:
        domain = self.domain
        number: Schema = {"type": "integer" if domain.whole else "number"}
        if math.isfinite(domain.low):
            reached = domain.low_allowed or domain.apart == domain.low
            number["minimum" if reached else "exclusiveMinimum"] = domain.low
        if math.isfinite(domain.high):
            number["maximum" if domain.high_allowed else "exclusiveMaximum"] = domain.high
        unit = "" if self.unit == "1" else f", {self.unit}"
        return {"description": self.doc + unit, "anyOf": [number, _text(self.unit)]}

    def read(self, raw: Any, area: float | None) -> float:
        """Convert a raw value: a bare number is a total if the rig has an area; text is read in its own unit."""
        if area is None or not is_per_area(self.unit):
            return self.checked(raw)
        whole = Parameter(total_unit(self.unit), self.domain, self.doc)
        if isinstance(raw, str):
            try:
                value = _per_area(raw, self.unit, area)
            except QuantityError as error:
                raise fault(str(error)) from error
            if math.isfinite(value * area):
                whole.checked(value * area)  # so that an error message states the total
            return self.checked(value)
        return self.checked(whole.checked(raw) / area)

    def written(self, value: Any, area: float | None = None) -> str:
        if self.domain.whole:
            return f"{value:.0f}"
        factor, unit = outside(self.unit, area)
        if not _reads_back(value, factor):
            return f'"{float(value)!r} {self.unit}"'
        return repr(float(value) * factor) + (f"  # {unit}" if unit != "1" else "")


@dataclass(frozen=True)
class Series(Entry):
    """Role of a measured column: a tuple of finite SI numbers."""

    unit: str
    doc: str

    def checked(self, value: Any) -> tuple[float, ...]:
        try:
            return numbers(value, self.unit)
        except QuantityError as error:
            raise fault(str(error)) from error

    def allowed(self) -> str:
        return f"a list of numbers in {self.unit}, or of texts with units"

    def schema(self) -> Schema:
        member = {"anyOf": [{"type": "number"}, _text(self.unit)]}
        return {"type": "array", "items": member, "description": f"{self.doc}, {self.unit}"}

    def read(self, raw: Any, area: float | None) -> tuple[float, ...]:
        """Convert a raw column: bare numbers are totals if the rig has an area; texts are read in their own unit."""
        if area is None or not is_per_area(self.unit):
            return self.checked(raw)
        try:
            found = numbers(raw, total_unit(self.unit), lambda text, _: _per_area(text, self.unit, area))
        except QuantityError as error:
            raise fault(str(error)) from error
        return tuple(v if isinstance(given, str) else v / area for given, v in zip(raw, found, strict=True))

    def written(self, value: Any, area: float | None = None) -> str:
        """Format the column as a TOML list, wrapped."""
        factor, unit = outside(self.unit, area)
        each = [repr(v * factor) if _reads_back(v, factor) else f'"{v!r} {self.unit}"' for v in value]
        each = [one.replace(" ", "\xa0") for one in each]  # so that lines break between items only
        text = [line.replace("\xa0", " ") for line in wrap(", ".join(each), 100, break_on_hyphens=False)]
        return "[\n    " + "\n    ".join(text) + f",\n]  # {unit}" if len(text) > 1 else f"[{''.join(text)}]  # {unit}"


def _text(unit: str) -> Schema:
    return {"type": "string", "description": f"text such as {example(unit)}"}


def _per_area(text: str, unit: str, area: float) -> float:
    """SI value per unit area of a text with a total or a per-area quantity, for a contact of an `area` (m²)."""
    try:
        return parse(text, total_unit(unit)) / area
    except QuantityError as error:
        try:
            return parse(text, unit)
        except QuantityError:
            raise QuantityError(f"{error} (the rig has an area)") from error


def _reads_back(value: float, factor: float) -> bool:
    """True if value times factor (area), divided by factor, gives the value bit for bit."""
    return float(value) * factor / factor == float(value)
