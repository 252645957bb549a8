"""What a field of a record, or an option of a call, may hold: each kind checks, explains, reads and writes its values.

Numbers (`Parameter`) and measured columns are here; choices, words, counts and names in `entries`. A layer that needs
another kind derives one from `Entry`.
"""

from __future__ import annotations

import json
import math
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
    """What a field or an option may hold."""

    def checked(self, value: Any) -> Any:
        """The value as it is kept.

        Raises
        ------
        ParameterError
            Naming no field, only the fault.
        """
        raise NotImplementedError

    def allowed(self) -> str:
        """What may be given, in words."""
        raise NotImplementedError

    def refused(self, value: Any) -> ParameterError:
        """The exception for a value that is not allowed."""
        return fault(f"got {repr_short(value)}; allowed: {self.allowed()}")


def fault(message: str) -> ParameterError:
    """An exception that names no field yet."""
    return ParameterError([Problem("", message)])


class Entry(Role):
    """One entry of a table in a file; subclasses are dataclasses that say in a phrase, `doc`, what it means."""

    doc: str

    def schema(self) -> Schema:
        """The JSON schema of what a file may have."""
        raise NotImplementedError

    def read(self, raw: Any, area: float | None) -> Any:
        """The value of a file: where the rig has an area, quantities per unit area are for the whole of it.

        Raises
        ------
        ParameterError
            Naming no field, only the fault.
        """
        return self.checked(raw)

    def written(self, value: Any, area: float | None = None) -> str:
        """The value in TOML, of a rig with that area."""
        return json.dumps(value, ensure_ascii=False)


PARAMETER_KINDS = {
    "friction level": "friction coefficient in steady sliding at the reference rate",
    "direct effect": "rise of friction per e-fold of velocity, at once",
    "evolution effect": "fall of friction per e-fold of velocity, as the state follows",
    "slip distance": "slip over which a memory fades",
    "reference rate": "velocity at which other parameters hold",
    "stress share": "share of the response to normal stress that is not immediate",
    "normal stress": "of the contact, in steady sliding or without coupling to the motion",
    "stiffness": "of the spring, or of what acts as one",
    "delay": "time by which something acts late",
}
"""What a parameter can be to the stages that look for meaning, not for names."""


class Total(float):
    """A number given for a whole contact, in N, N/m, ..., in place of one per unit area; it waits for the area."""


class InUnit(float):
    """A number (SI) from text whose unit only some rigs have, ``"0.05 rpm"``; it waits for the rig."""

    unit: str

    def __new__(cls, number: float, unit: str) -> InUnit:
        """A number of a unit."""
        found = super().__new__(cls, number)
        found.unit = unit
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        """For copies in other processes."""
        return InUnit, (float(self), self.unit)


@dataclass(frozen=True)
class Parameter(Entry):
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
        What it is to those who scale motions or fit records without knowing the law: one of `PARAMETER_KINDS`, or
        nothing.
    size : float or None
        Change that matters, of a parameter that may be zero or of either sign; a positive one has its own size.
    letter : str
        Its symbol in equations; its name unless given.
    standing : float or None
        Stands for the parameter where it is yet to be fitted.
    idle : float or None
        Value at which the parameter, with the others of its own member of a list, does nothing: without it the law is
        a simpler one.
    elsewhere : tuple of str
        SI units that it has for rigs of other kinds: forces, angles.
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

    def __post_init__(self) -> None:
        if self.kind and self.kind not in PARAMETER_KINDS:
            raise TypeError(unknown_name("kind of parameter", self.kind, PARAMETER_KINDS))

    def checked(self, value: Any) -> float:
        """A number or text such as ``"5 MPa"`` as an SI float inside the parameter's domain."""
        if isinstance(value, str):
            try:
                number = parse(value, self.unit)
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
        if not self.domain.contains(number):
            raise self.refused(value)
        return number + 0.0  # -0.0 is 0: files do not write what equals a default

    def given(self, value: Any) -> float:
        """What a constructor takes: as `checked`; or text, a `Total` or `InUnit` where its unit depends on the rig."""
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

    def allowed(self) -> str:
        unit = "" if self.unit == "1" else f" in {self.unit}, or text such as {example(self.unit)}"
        return self.domain.text + unit

    def schema(self) -> Schema:
        domain = self.domain
        number: Schema = {"type": "integer" if domain.whole else "number"}
        if math.isfinite(domain.low):
            number["minimum" if domain.low_allowed else "exclusiveMinimum"] = domain.low
        if math.isfinite(domain.high):
            number["maximum" if domain.high_allowed else "exclusiveMaximum"] = domain.high
        unit = "" if self.unit == "1" else f", {self.unit}"
        return {"description": self.doc + unit, "anyOf": [number, _text(self.unit)]}

    def read(self, raw: Any, area: float | None) -> float:
        """For the whole area a bare number; text may give either."""
        if area is None or not is_per_area(self.unit):
            return self.checked(raw)
        if isinstance(raw, str):
            try:
                return self.checked(_per_area(raw, self.unit, area))
            except QuantityError as error:
                raise fault(str(error)) from error
        whole = Parameter(total_unit(self.unit), self.domain, self.doc)
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
    """A measured column: a tuple of finite numbers in the SI unit."""

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
        """For the whole area bare numbers; texts may give either."""
        if area is None or not is_per_area(self.unit):
            return self.checked(raw)
        try:
            found = numbers(raw, total_unit(self.unit), lambda text, _: _per_area(text, self.unit, area))
        except QuantityError as error:
            raise fault(str(error)) from error
        return tuple(v if isinstance(given, str) else v / area for given, v in zip(raw, found, strict=True))

    def written(self, value: Any, area: float | None = None) -> str:
        """A list of numbers, on as many lines as it needs."""
        factor, unit = outside(self.unit, area)
        each = [repr(v * factor) if _reads_back(v, factor) else f'"{v!r} {self.unit}"' for v in value]
        each = [one.replace(" ", "\xa0") for one in each]  # a line ends between two, not inside of a text
        text = [line.replace("\xa0", " ") for line in wrap(", ".join(each), 100, break_on_hyphens=False)]
        return "[\n    " + "\n    ".join(text) + f",\n]  # {unit}" if len(text) > 1 else f"[{''.join(text)}]  # {unit}"


def _text(unit: str) -> Schema:
    return {"type": "string", "description": f"text such as {example(unit)}"}


def _per_area(text: str, unit: str, area: float) -> float:
    """Text for the whole area, or per unit area, as the latter."""
    try:
        return parse(text, total_unit(unit)) / area
    except QuantityError as error:
        try:
            return parse(text, unit)
        except QuantityError:
            raise QuantityError(f"{error} (the rig has an area)") from error


def _reads_back(value: float, factor: float) -> bool:
    """Whether a total gives the same number per unit area again; otherwise that number is written, with its unit."""
    return float(value) * factor / factor == float(value)
