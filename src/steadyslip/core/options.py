"""Argument checks of public functions: each argument has a `Role`, like a field of a record."""

from __future__ import annotations

import functools
import inspect
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar

import numpy as np

from steadyslip.core.domains import Domain, below_one, steps, tolerance
from steadyslip.core.entries import Names, Option, Text, Whole
from steadyslip.core.errors import ParameterError, Problem, QuantityError, one
from steadyslip.core.quantities import example, in_si
from steadyslip.core.roles import Role, fault
from steadyslip.core.written import in_written_units

LARGEST = 1.7e308  # largest accepted number, just below the largest float; larger Python integers are refused
MOST = 1e150  # largest accepted size of array items, whose squares must be finite
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Tested(Role):
    """Role of values that pass a test; `words` describes them in messages."""

    words: str
    passes: Callable[[Any], bool]

    def checked(self, value: Any) -> Any:
        if not self.passes(value):
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return self.words


@dataclass(frozen=True)
class Measured(Tested):
    """Role of numbers, or texts with a unit, that are converted to SI numbers before they are tested."""

    unit: str

    def checked(self, value: Any) -> Any:
        try:
            return super().checked(in_si(value, self.unit))
        except QuantityError as error:
            raise fault(str(error)) from error

    def allowed(self) -> str:
        return f"{self.words} in {self.unit}, or text such as {example(self.unit)}"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def finite(above: float, most: float = math.inf, *, closed: bool = False, unit: str = "") -> Role:
    """Role of finite numbers > `above` (>= if `closed`) and <= `most`; texts with a unit too if `unit` is given."""

    def passes(value: Any) -> bool:
        above_low = _is_number(value) and (above < value or (closed and value == above))
        return above_low and bool(value <= min(most, LARGEST))

    least = "" if math.isinf(above) else f" {'from' if closed else 'above'} {above:g}"
    words = f"a finite number{least}" + (f", up to {most:g}" if math.isfinite(most) else "")
    return Measured(words, passes, unit) if unit else Tested(words, passes)


def within(domain: Domain) -> Role:
    """Role of numbers inside a domain."""

    def passes(value: Any) -> bool:
        return _is_number(value) and bool(abs(value) <= LARGEST) and bool(domain.contains(value))

    return Tested(domain.text, passes)


def _all_numbers(value: Any) -> bool:
    """True for a non-empty array of real numbers, each with a finite square."""
    if type(value) is float:
        return abs(value) <= MOST
    try:
        found = np.asarray(value)
        return found.dtype.kind in "iuf" and found.size > 0 and bool(np.all(np.abs(found) <= MOST))
    except (TypeError, ValueError, OverflowError):
        return False


@dataclass(frozen=True)
class Made(Tested):
    """Role of result objects; `instead` names the function for machines if one is given in place of a slider."""

    instead: str = ""

    def refused(self, value: Any) -> ParameterError:
        if type(value).__name__ == "Machine" and "Slider" in self.words:
            return fault(f"got a Machine; allowed: a Slider, one block on one surface{self.instead}")
        return super().refused(value)


def _made(names: str, maker: str, instead: str = "") -> Tested:
    """Role of objects of classes with the given names, which the function `maker` returns.

    Classes are compared by name because core must not import them.
    """
    wanted = names.split(" | ")
    return Made(
        f"{one(' or '.join(wanted))}, such as {maker} gives",
        lambda value: any(kind.__name__ in wanted for kind in type(value).__mro__),
        f"; {instead}" if instead else "",
    )


def _is_list(value: Any) -> bool:
    """True for iterables other than texts."""
    return isinstance(value, Iterable) and not isinstance(value, (str, bytes))


def _several(each: Tested, words: str, *, alone: bool = True) -> Tested:
    """Role of lists whose items have the role `each`; a single item too if `alone`. Other iterables are not checked."""

    def passes(value: Any) -> bool:
        if isinstance(value, (list, tuple)):
            return all(map(each.passes, value))
        if each.passes(value):
            return alone
        return _is_list(value)

    return Tested(words, passes)


def slider(instead: str) -> Role:
    """Role of a Slider in functions that refuse machines; `instead` names the function for machines."""
    return _made("Slider", "read_rig", instead)


def whole(least: int, most: int = 2**31) -> Whole:
    """Role of integers from `least` to `most`; bools are refused."""
    return Whole("", least, most)


BRANCH, THREADS, SEED = whole(0, 1000), whole(1, 10_000), whole(0, 2**63)
NAME, NAMES, SIGN = Text(""), Names(""), Option((1, -1), "")
NUMBERS = Tested(f"numbers, up to {MOST:g} in size", _all_numbers)
DURATION, TIMES = finite(0, unit="s"), Measured(NUMBERS.words, NUMBERS.passes, "s")
LOW_AND_HIGH = Tested("two values, low and high", lambda v: isinstance(v, (tuple, list, np.ndarray)) and len(v) == 2)
BY_NAME = Tested("a mapping of names to values", lambda value: isinstance(value, Mapping))
SEVERAL = Tested("a list", lambda value: isinstance(value, (list, tuple)))
FLAG = Tested("True or False", lambda value: isinstance(value, (bool, np.bool_)))
FUNCTION = Tested("a function", callable)
PLACE = Tested("a path", lambda value: isinstance(value, (str, os.PathLike)) and bool(os.fspath(value)))
CONTENT = Tested("the text of a file", lambda value: isinstance(value, str))
MAKERS = {
    "Slider": "read_rig", "Machine": "read_rig", "Slider | Machine": "read_rig",
    "Fit": "fit", "Fit | Draws | Population": "fit", "Map": "read_map", "MapResult": "open_map",
    "Cycle": "cycles", "Protocol": "read_protocol", "StructureData": "machine.StructureData",
}  # fmt: skip
INTEGRATION = {"rtol": within(tolerance), "arrest": within(below_one), "most_steps": within(steps)}
BY_WORD: dict[str, Role] = INTEGRATION | {
    "branch": BRANCH, "threads": THREADS, "workers": THREADS, "seed": SEED, "text": CONTENT,
}  # fmt: skip
BY_ANNOTATION: dict[str, Role] = {
    "bool": FLAG, "str": NAME, "Sequence[str]": NAMES, "str | Sequence[str]": NAMES, "Vary": BY_NAME,
    "str | PathLike[str]": PLACE, "Paths": _several(PLACE, "a list of paths", alone=False),
    "Iterable[str]": _several(CONTENT, "a list of texts"),
    "Record | Sequence[Record]": _several(_made("Record", ""), "a Record, such as read_record gives, or several"),
    "Mapping[str, Fit] | Sequence[Fit]": Tested("Fits, by label or in a list", _is_list),
    **{names: _made(names, maker) for names, maker in MAKERS.items()},
}  # fmt: skip


def role_of(name: str, annotation: str) -> Role | None:
    """Role of an argument: by its name if the name always has one meaning, else by its annotation; None if unknown."""
    if name in BY_WORD:
        return BY_WORD[name]
    plain = annotation.removesuffix(" | None")
    if plain.startswith("Mapping[") and " | " not in plain:
        return BY_NAME
    return FUNCTION if plain.startswith("Callable[") else BY_ANNOTATION.get(plain)


def checked(**roles: Role) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator that checks the arguments of a function before it is called; default values always pass.

    Texts that the function makes about a rig have the units of the rig's file.

    `roles` are needed for arguments whose role `role_of` does not find, such as numbers with a range. Each item of a
    variable number of arguments (``*links``) is checked, and named in errors by its position: ``argument 2``.

    Raises
    ------
    ParameterError
        From the decorated function, if a value is not allowed.
    """

    def decorate(decorated: Callable[P, R]) -> Callable[P, R]:
        function = in_written_units(decorated)
        call: Callable[..., R] = function
        parameters = inspect.signature(function).parameters
        defaults = {name: item.default for name, item in parameters.items()}
        known = {
            name: role
            for name, item in parameters.items()
            if (role := roles.get(name) or role_of(name, str(item.annotation))) is not None
        }
        single = [name for name, item in parameters.items() if item.kind is not item.VAR_POSITIONAL]
        several = next((name for name, item in parameters.items() if item.kind is item.VAR_POSITIONAL), None)
        count = len(single) if several is None else list(parameters).index(several)

        @functools.wraps(function)
        def called(*args: P.args, **kwargs: P.kwargs) -> R:
            problems = []
            values: dict[Any, Any] = dict(enumerate(args)) | kwargs
            given = [(i, name, name) for i, name in enumerate(single[: min(count, len(args))])]
            given += [(i, several or "", f"argument {i + 1}") for i in range(count, len(args))]
            for key, name, label in (*given, *((name, name, name) for name in kwargs)):
                if name not in known or values[key] is (default := defaults[name]):
                    continue
                try:
                    found = known[name].checked(values[key])
                    values[key] = found if isinstance(known[name], Measured) else values[key]
                except ParameterError as error:
                    other = ", or None" if default is None else ""
                    problems += [Problem(label, fault.message + other) for fault in error.problems]
            if problems:
                raise ParameterError(problems)
            positional = [values.pop(i) for i in range(len(args))]
            return call(*positional, **values)

        return called

    return decorate
