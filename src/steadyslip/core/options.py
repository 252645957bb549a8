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

from steadyslip.core.errors import ParameterError, Problem, one
from steadyslip.core.roles import Names, Option, Role, Text, Whole

LARGEST = 1.7e308  # integers may be larger than any float
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Number(Role):
    """A finite number above one and up to another; `closed`: from it on."""

    above: float
    most: float = math.inf
    closed: bool = False

    def checked(self, value: Any) -> Any:
        plain = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        if plain and (self.above < value or (self.closed and value == self.above)) and value <= min(self.most, LARGEST):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        end = "" if math.isinf(self.above) else f" {'from' if self.closed else 'above'} {self.above:g}"
        return f"a finite number{end}" + (f", up to {self.most:g}" if math.isfinite(self.most) else "")


@dataclass(frozen=True)
class Numbers(Role):
    """Numbers or arrays of them, at least one, up to `most` in size, so that their squares are finite."""

    most: float = 1e150

    def checked(self, value: Any) -> Any:
        if type(value) is float and abs(value) <= self.most:
            return value
        try:
            found = np.asarray(value)
            good = found.dtype.kind in "iuf" and found.size > 0 and bool(np.all(np.abs(found) <= self.most))
        except (TypeError, ValueError, OverflowError):
            good = False
        if not good:
            raise self.refused(value)
        return value

    def allowed(self) -> str:
        return f"numbers, up to {self.most:g} in size"


class LowAndHigh(Role):
    """Two values."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, (tuple, list, np.ndarray)) and len(value) == 2:
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "two values, low and high"


class ByName(Role):
    """Values by name."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, Mapping):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a mapping of names to values"


class Several(Role):
    """A list of whatever the function says."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a list"


class Flag(Role):
    """A truth value."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, (bool, np.bool_)):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "True or False"


class Function(Role):
    """Something to call."""

    def checked(self, value: Any) -> Any:
        if callable(value):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a function"


class Place(Role):
    """The path of a file or folder."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, (str, os.PathLike)) and os.fspath(value):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a path"


class Content(Role):
    """What a file says, which may be nothing."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, str):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "the text of a file"


@dataclass(frozen=True)
class Made(Role):
    """An object of one of some classes, by name, which `maker` gives."""

    names: tuple[str, ...]
    maker: str

    def checked(self, value: Any) -> Any:
        if any(kind.__name__ in self.names for kind in type(value).__mro__):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return f"{one(' or '.join(self.names))}, such as {self.maker} gives"


def whole(least: int, most: int = 2**31) -> Whole:
    """Whole numbers from `least` to `most`; truth values are none."""
    return Whole("", least, most)


BRANCH, THREADS, SEED = whole(0, 1000), whole(1, 10_000), whole(0, 2**63)
NAME, NAMES, SIGN = Text(""), Names(""), Option((1, -1), "")
LOW_AND_HIGH, BY_NAME, SEVERAL = LowAndHigh(), ByName(), Several()
MAKERS = {
    "Slider": "read_rig", "Fit": "fit", "Fit | Draws": "fit", "Map": "read_map", "MapResult": "open_map",
    "Cycle": "cycles",
}  # fmt: skip
BY_WORD: dict[str, Role] = {"branch": BRANCH, "threads": THREADS, "workers": THREADS, "seed": SEED, "text": Content()}
BY_ANNOTATION: dict[str, Role] = {
    "bool": Flag(), "str": NAME, "Sequence[str]": NAMES, "str | Sequence[str]": NAMES, "Vary": BY_NAME,
    "str | PathLike[str]": Place(), **{name: Made(tuple(name.split(" | ")), made) for name, made in MAKERS.items()},
}  # fmt: skip


def role_of(name: str, annotation: str) -> Role | None:
    """What a name that always means the same, or an annotation, says of the values; None where it is too little."""
    if name in BY_WORD:
        return BY_WORD[name]
    plain = annotation.removesuffix(" | None")
    if plain.startswith("Mapping[") and " | " not in plain:
        return BY_NAME
    return Function() if plain.startswith("Callable[") else BY_ANNOTATION.get(plain)


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
