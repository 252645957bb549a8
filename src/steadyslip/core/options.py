"""Options of public functions: what each may hold is a role, as of the fields of records; checked before the call."""

from __future__ import annotations

import functools
import inspect
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar

import numpy as np

from steadyslip.core.domains import Domain, below_one, steps, tolerance
from steadyslip.core.entries import Names, Option, Text, Whole
from steadyslip.core.errors import ParameterError, Problem, one
from steadyslip.core.roles import Role, fault

LARGEST = 1.7e308  # integers may be larger than any float
MOST = 1e150  # whose square is finite
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Tested(Role):
    """Whatever passes a test, and what that is in words."""

    words: str
    passes: Callable[[Any], bool]

    def checked(self, value: Any) -> Any:
        if not self.passes(value):
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return self.words


def finite(above: float, most: float = math.inf, *, closed: bool = False) -> Role:
    """A finite number above one and up to another; `closed`: from it on."""

    def passes(value: Any) -> bool:
        plain = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        return plain and (above < value or (closed and value == above)) and bool(value <= min(most, LARGEST))

    least = "" if math.isinf(above) else f" {'from' if closed else 'above'} {above:g}"
    return Tested(f"a finite number{least}" + (f", up to {most:g}" if math.isfinite(most) else ""), passes)


def within(domain: Domain) -> Role:
    """Numbers of a domain, as a parameter of a record may be one."""

    def passes(value: Any) -> bool:
        plain = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        return plain and bool(abs(value) <= LARGEST) and bool(domain.contains(value))

    return Tested(domain.text, passes)


def _all_numbers(value: Any) -> bool:
    """At least one, of a size whose square is finite."""
    if type(value) is float:
        return abs(value) <= MOST
    try:
        found = np.asarray(value)
        return found.dtype.kind in "iuf" and found.size > 0 and bool(np.all(np.abs(found) <= MOST))
    except (TypeError, ValueError, OverflowError):
        return False


@dataclass(frozen=True)
class Made(Tested):
    """An object that a function gives; `instead` tells what to ask of a machine where a slider is wanted."""

    instead: str = ""

    def refused(self, value: Any) -> ParameterError:
        if type(value).__name__ == "Machine" and "Slider" in self.words:
            return fault(f"got a Machine; allowed: a Slider, one block on one surface{self.instead}")
        return super().refused(value)


def _made(names: str, maker: str, instead: str = "") -> Role:
    """An object of one of some classes, by name, which `maker` gives."""
    wanted = names.split(" | ")
    return Made(
        f"{one(' or '.join(wanted))}, such as {maker} gives",
        lambda value: any(kind.__name__ in wanted for kind in type(value).__mro__),
        f"; {instead}" if instead else "",
    )


def slider(instead: str) -> Role:
    """A slider, in functions of which machines have others: `instead` names them."""
    return _made("Slider", "read_rig", instead)


def whole(least: int, most: int = 2**31) -> Whole:
    """Whole numbers from `least` to `most`; truth values are none."""
    return Whole("", least, most)


BRANCH, THREADS, SEED = whole(0, 1000), whole(1, 10_000), whole(0, 2**63)
NAME, NAMES, SIGN = Text(""), Names(""), Option((1, -1), "")
NUMBERS = Tested(f"numbers, up to {MOST:g} in size", _all_numbers)
LOW_AND_HIGH = Tested("two values, low and high", lambda v: isinstance(v, (tuple, list, np.ndarray)) and len(v) == 2)
BY_NAME = Tested("a mapping of names to values", lambda value: isinstance(value, Mapping))
SEVERAL = Tested("a list", lambda value: isinstance(value, (list, tuple)))
FLAG = Tested("True or False", lambda value: isinstance(value, (bool, np.bool_)))
FUNCTION = Tested("a function", callable)
PLACE = Tested("a path", lambda value: isinstance(value, (str, os.PathLike)) and bool(os.fspath(value)))
CONTENT = Tested("the text of a file", lambda value: isinstance(value, str))
MAKERS = {
    "Slider": "read_rig", "Machine": "read_rig", "Slider | Machine": "read_rig",
    "Fit": "fit", "Fit | Draws": "fit", "Map": "read_map", "MapResult": "open_map",
    "Cycle": "cycles",
}  # fmt: skip
INTEGRATION = {"rtol": within(tolerance), "arrest": within(below_one), "most_steps": within(steps)}
BY_WORD: dict[str, Role] = INTEGRATION | {
    "branch": BRANCH, "threads": THREADS, "workers": THREADS, "seed": SEED, "text": CONTENT,
}  # fmt: skip
BY_ANNOTATION: dict[str, Role] = {
    "bool": FLAG, "str": NAME, "Sequence[str]": NAMES, "str | Sequence[str]": NAMES, "Vary": BY_NAME,
    "str | PathLike[str]": PLACE, **{names: _made(names, maker) for names, maker in MAKERS.items()},
}  # fmt: skip


def role_of(name: str, annotation: str) -> Role | None:
    """What a name that always means the same, or an annotation, says of the values; None where it is too little."""
    if name in BY_WORD:
        return BY_WORD[name]
    plain = annotation.removesuffix(" | None")
    if plain.startswith("Mapping[") and " | " not in plain:
        return BY_NAME
    return FUNCTION if plain.startswith("Callable[") else BY_ANNOTATION.get(plain)


def checked(**roles: Role) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Check arguments of a function before it is called; what it has by default is allowed, given by name too.

    `roles` say what names and annotations leave open, such as the range of a number.

    Raises
    ------
    ParameterError
        From the function, if a value is not allowed.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        parameters = inspect.signature(function).parameters
        defaults = {name: item.default for name, item in parameters.items()}
        known = {
            name: role
            for name, item in parameters.items()
            if (role := roles.get(name) or role_of(name, str(item.annotation))) is not None
        }

        @functools.wraps(function)
        def called(*args: P.args, **kwargs: P.kwargs) -> R:
            problems = []
            for name, value in (dict(zip(defaults, args, strict=False)) | kwargs).items():
                if name not in known or value is (default := defaults[name]):
                    continue
                try:
                    known[name].checked(value)
                except ParameterError as error:
                    other = ", or None" if default is None else ""
                    problems += [Problem(name, fault.message + other) for fault in error.problems]
            if problems:
                raise ParameterError(problems)
            return function(*args, **kwargs)

        return called

    return decorate
