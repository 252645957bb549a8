"""What the fields of a table may hold that says what to do with a rig: words, counts, names, quantities of any kind.

Each kind of value checks itself, says what it allows, and knows its JSON schema and how a file writes it. A layer that
needs another kind derives one from `Setting`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from steadyslip.core.errors import ParameterError, Problem, QuantityError, came
from steadyslip.core.quantities import example, numbers

Schema = dict[str, Any]


@dataclass(frozen=True)
class Setting:
    """What a field may hold that is no parameter of a rig.

    Attributes
    ----------
    doc : str
        Meaning, a phrase.
    """

    doc: str

    def checked(self, value: Any) -> Any:
        """The value as the record keeps it.

        Raises
        ------
        ParameterError
            Naming no field, only the fault.
        """
        raise NotImplementedError

    def allowed(self) -> str:
        """What may be given, in words."""
        raise NotImplementedError

    def schema(self) -> Schema:
        """The JSON schema of what a file may have."""
        raise NotImplementedError

    def written(self, value: Any) -> str:
        """The value in TOML."""
        return json.dumps(value, ensure_ascii=False)

    def refused(self, value: Any, allowed: str = "") -> ParameterError:
        """The exception for a value that is not allowed."""
        return ParameterError([Problem("", f"got {came(value)}; allowed: {allowed or self.allowed()}")])


@dataclass(frozen=True)
class Text(Setting):
    """A word or a name, kept as it is."""

    def checked(self, value: Any) -> str:
        if not isinstance(value, str) or not value:
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return "a text"

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1, "description": self.doc}


@dataclass(frozen=True)
class Label(Setting):
    """A name, or a number counted from 1."""

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
class Names(Setting):
    """One name or a list of them, kept as a tuple."""

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
class Whole(Setting):
    """A whole number between two ends, both included."""

    low: int
    high: int | None = None

    def checked(self, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise self.refused(value, f"a whole number >= {self.low}")
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
class Span(Setting):
    """Start and end, as a pair of numbers in the SI unit."""

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

    def written(self, value: Any) -> str:
        return f"[{', '.join(repr(one) for one in value)}]  # {self.unit}"


@dataclass(frozen=True)
class Quantity(Setting):
    """A number in an SI unit, or text with a unit, of a dimension that another part of the file decides."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, (str, Real)):
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return "a number in the SI unit, or text with a unit"

    def schema(self) -> Schema:
        return {"anyOf": [{"type": "number"}, {"type": "string"}], "description": self.doc}

    def written(self, value: Any) -> str:
        return json.dumps(value) if isinstance(value, str) else repr(float(value))
