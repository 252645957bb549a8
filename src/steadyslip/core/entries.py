"""Field types of file tables other than parameters: choices, text, integers, names, intervals, quantities."""

from __future__ import annotations

import json
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from steadyslip.core.errors import ParameterError, Problem, QuantityError, unknown_name
from steadyslip.core.quantities import example, numbers
from steadyslip.core.roles import Entry, Schema, fault


@dataclass(frozen=True)
class Option(Entry):
    """Field type whose value is one of several listed words or numbers, or a bool."""

    choices: tuple[Any, ...]
    doc: str

    def checked(self, value: Any) -> Any:
        for choice in self.choices:
            if (
                isinstance(value, type(choice))
                and isinstance(value, bool) == isinstance(choice, bool)
                and value == choice
            ):
                return value
        raise self.refused(value) if self._truth else fault(unknown_name("choice", value, map(str, self.choices)))

    @property
    def _truth(self) -> bool:
        return self.choices == (False, True)

    def allowed(self) -> str:
        return "true or false" if self._truth else ", ".join(map(str, self.choices))

    def schema(self) -> Schema:
        return {"enum": list(self.choices), "description": self.doc}


@dataclass(frozen=True)
class Text(Entry):
    """Field type whose value is a non-empty text."""

    doc: str

    def checked(self, value: Any) -> str:
        if not isinstance(value, str) or not value:
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return "a text"

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1, "description": self.doc}


@dataclass(frozen=True)
class Label(Entry):
    """Field type whose value is a name, or an integer from 1."""

    doc: str

    def checked(self, value: Any) -> str | int:
        if (isinstance(value, str) and value) or (isinstance(value, int) and value >= 1 and value is not True):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a name, or a number from 1"

    def schema(self) -> Schema:
        return {
            "anyOf": [{"type": "string", "minLength": 1}, {"type": "integer", "minimum": 1}],
            "description": self.doc,
        }


@dataclass(frozen=True)
class Names(Entry):
    """Field type whose value is a name or a list of names; it is stored as a tuple."""

    doc: str

    def checked(self, value: Any) -> tuple[str, ...]:
        if isinstance(value, str):
            return (value,)
        if not isinstance(value, (list, tuple)) or not all(isinstance(one, str) for one in value):
            raise self.refused(value)
        return tuple(value)

    def allowed(self) -> str:
        return "a list of names"

    def schema(self) -> Schema:
        word = {"type": "string"}
        return {"anyOf": [word, {"type": "array", "items": word}], "description": self.doc}


@dataclass(frozen=True)
class LabelledNumbers(Entry):
    """Field type whose value is a list of finite dimensionless numbers, or a dict of such numbers by label."""

    doc: str

    def checked(self, value: Any) -> tuple[float, ...] | dict[str, float]:
        try:
            if isinstance(value, dict):
                return dict(zip(value, numbers(list(value.values()), "1"), strict=True))
            return numbers(value, "1")
        except QuantityError as error:
            raise fault(str(error)) from error

    def written(self, value: Any, area: float | None = None) -> str:
        if not isinstance(value, dict):
            return super().written(value)
        pairs = (f"{json.dumps(label, ensure_ascii=False)} = {number!r}" for label, number in value.items())
        return f"{{ {', '.join(pairs)} }}"

    def allowed(self) -> str:
        return "a list of numbers, or a table of labels and numbers"

    def schema(self) -> Schema:
        number = {"type": "number"}
        listed = {"type": "array", "items": number}
        return {"anyOf": [listed, {"type": "object", "additionalProperties": number}], "description": self.doc}


@dataclass(frozen=True)
class Headings(Entry):
    """Field type whose value is a dict that assigns names to columns of a data file.

    A column is given by its heading, by its number from 1, or by a pair of either with the unit.
    """

    doc: str

    def checked(self, value: Any) -> dict[str, Any]:
        if not isinstance(value, dict) or not value:
            raise self.refused(value)
        found = {}
        for name, column in value.items():
            one = tuple(column) if isinstance(column, (list, tuple)) else (column,)
            place = isinstance(one[0], int) and not isinstance(one[0], bool) if one else False
            if not (len(one) in (1, 2) and (isinstance(one[0], str) or place) and isinstance(one[-1], (str, int))):
                raise self.refused(value)
            found[str(name)] = one if len(one) == 2 else one[0]
        return found

    def written(self, value: Any, area: float | None = None) -> str:
        pairs = (f"{json.dumps(name, ensure_ascii=False)} = {json.dumps(column)}" for name, column in value.items())
        return f"{{ {', '.join(pairs)} }}"

    def allowed(self) -> str:
        return "a table of names and headings, or of names and [heading, unit]"

    def schema(self) -> Schema:
        one: Schema = {"type": ["string", "integer"]}
        pair = {"type": "array", "items": one, "minItems": 2, "maxItems": 2}
        return {"type": "object", "additionalProperties": {"anyOf": [one, pair]}, "description": self.doc}


@dataclass(frozen=True)
class Whole(Entry):
    """Field type whose value is an integer between two bounds, both included."""

    doc: str
    low: int
    high: int | None = None

    def checked(self, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise self.refused(value)
        number = int(value)
        if number < self.low or (self.high is not None and number > self.high):
            raise self.refused(value)
        return number

    def allowed(self) -> str:
        return (
            f"a whole number >= {self.low}" if self.high is None else f"a whole number from {self.low} to {self.high}"
        )

    def schema(self) -> Schema:
        ends = {"minimum": self.low} | ({} if self.high is None else {"maximum": self.high})
        return {"type": "integer", **ends, "description": self.doc}


@dataclass(frozen=True)
class Span(Entry):
    """Field type whose value is an interval: a pair of start and end, SI numbers or texts with units."""

    doc: str
    unit: str

    def checked(self, value: Any) -> tuple[float, float]:
        if not isinstance(value, (list, tuple)) or len(value) != 2:
            raise self.refused(value)
        try:
            start, end = numbers(value, self.unit)
        except QuantityError as error:
            raise ParameterError([Problem("", str(error))]) from error
        return start, end

    def allowed(self) -> str:
        return f"[start, end] in {self.unit}"

    def schema(self) -> Schema:
        one = {"anyOf": [{"type": "number"}, {"type": "string", "description": f"text such as {example(self.unit)}"}]}
        return {"type": "array", "items": one, "minItems": 2, "maxItems": 2, "description": f"{self.doc}, {self.unit}"}

    def written(self, value: Any, area: float | None = None) -> str:
        return f"[{', '.join(repr(one) for one in value)}]  # {self.unit}"


@dataclass(frozen=True)
class Quantity(Entry):
    """Field type whose value is an SI number or a text with a unit; another entry of the file sets its dimension."""

    doc: str

    def checked(self, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, (str, Real)):
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return "a number in the SI unit, or text with a unit"

    def schema(self) -> Schema:
        return {"anyOf": [{"type": "number"}, {"type": "string"}], "description": self.doc}

    def written(self, value: Any, area: float | None = None) -> str:
        return json.dumps(value) if isinstance(value, str) else repr(float(value))
