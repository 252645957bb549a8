"""Options of public functions: what each may hold is a role, as of the fields of records; checked before the call."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, ParamSpec, TypeVar

import numpy as np

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.core.roles import Names, Option, Role, Text, Whole

LARGEST = 1.7e308  # integers may be larger than any float
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Number(Role):
    """A finite number above one and up to another."""

    above: float
    most: float = math.inf

    def checked(self, value: Any) -> Any:
        plain = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        if plain and self.above < value <= self.most and value <= LARGEST:
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        above = f" above {self.above:g}" if math.isfinite(self.above) else ""
        return f"a finite number{above}" + (f", up to {self.most:g}" if math.isfinite(self.most) else "")


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


class FilePath(Role):
    """Where a file or folder is."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, (str, PathLike)):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a path, as text or pathlib.Path"


class Several(Role):
    """A list of whatever the function says."""

    def checked(self, value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            return value
        raise self.refused(value)

    def allowed(self) -> str:
        return "a list"


def whole(least: int, most: int = 2**31) -> Whole:
    """Whole numbers from `least` to `most`; truth values are none."""
    return Whole("", least, most)


BRANCH, THREADS, SEED = whole(0, 1000), whole(1, 10_000), whole(0, 2**63)
NAME, NAMES, SIGN = Text(""), Names(""), Option((1, -1), "")
LOW_AND_HIGH, BY_NAME, PATH, SEVERAL = LowAndHigh(), ByName(), FilePath(), Several()


def checked(**roles: Role) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Check options of a function before it is called; what it has by default is allowed, given by name too.

    Raises
    ------
    ParameterError
        From the function, if a value is not allowed.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        defaults = {name: item.default for name, item in inspect.signature(function).parameters.items()}

        @functools.wraps(function)
        def called(*args: P.args, **kwargs: P.kwargs) -> R:
            problems = []
            for name, value in (dict(zip(defaults, args, strict=False)) | kwargs).items():
                if name not in roles or value is (default := defaults[name]):
                    continue
                try:
                    roles[name].checked(value)
                except ParameterError as error:
                    other = ", or None" if default is None else ""
                    problems += [Problem(name, one.message + other) for one in error.problems]
            if problems:
                raise ParameterError(problems)
            return function(*args, **kwargs)

        return called

    return decorate
