"""Options of public functions, checked in one place: a rule says what is allowed, the message also what came."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

import numpy as np

from steadyslip.core.errors import ParameterError, Problem, came

LARGEST = 1.7e308  # integers may be larger than any float
P = ParamSpec("P")
R = TypeVar("R")
Rule = Callable[[Any], str]
"""What is allowed, where a value is not; else nothing."""


def whole(least: int, most: int = 2**31, or_none: bool = False) -> Rule:
    """Whole numbers from `least` to `most`; truth values are none."""

    def rule(value: Any) -> str:
        if or_none and value is None:
            return ""
        if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and least <= value <= most:
            return ""
        return f"a whole number from {least} to {most}" + (", or None" if or_none else "")

    return rule


def real_number(above: float, most: float = math.inf, or_none: bool = False) -> Rule:
    """Finite numbers above `above`, up to `most`."""

    def rule(value: Any) -> str:
        if or_none and value is None:
            return ""
        plain = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        if plain and above < value <= most and value <= LARGEST:
            return ""
        upto = f", up to {most:g}" if math.isfinite(most) else ""
        return f"a finite number above {above:g}{upto}" + (", or None" if or_none else "")

    return rule


def real_numbers(or_none: bool = False, most: float = 1e150) -> Rule:
    """Numbers or arrays of them, of any size but none, up to `most` in size, so that their squares are finite."""

    def rule(value: Any) -> str:
        try:
            found = np.asarray(value)
            good = found.dtype.kind in "iuf" and found.size > 0 and bool(np.all(np.abs(found) <= most))
        except (TypeError, ValueError, OverflowError):
            good = False
        return (
            ""
            if good or (or_none and value is None)
            else f"numbers, up to {most:g} in size" + (", or None" if or_none else "")
        )

    return rule


def low_and_high(value: Any) -> str:
    """Two values, low and high, or None."""
    if value is None or (isinstance(value, (tuple, list, np.ndarray)) and len(value) == 2):
        return ""
    return "two values, low and high, or None"


def some_names(value: Any) -> str:
    """A name or several."""
    several = isinstance(value, (tuple, list)) and all(isinstance(one, str) for one in value)
    return "" if isinstance(value, str) or several else "a name, or a list of names"


def one_name(value: Any) -> str:
    """A name."""
    return "" if isinstance(value, str) else "a name"


def by_name(value: Any) -> str:
    """Values by name, or None."""
    return "" if value is None or isinstance(value, Mapping) else "a mapping of names to values, or None"


def sign(value: Any) -> str:
    """1 or -1."""
    return "" if isinstance(value, int) and not isinstance(value, bool) and value in (1, -1) else "1 or -1"


BRANCH, THREADS, SEED = whole(0, 1000), whole(1, 10_000, or_none=True), whole(0, 2**63)


def checked(**rules: Rule) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Check options of a function before it is called; what it has by default is allowed, given by name too.

    Raises
    ------
    ParameterError
        From the function, if a value is not allowed.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def called(*args: P.args, **kwargs: P.kwargs) -> R:
            given = signature.bind(*args, **kwargs).arguments
            told = {n: v for n, v in given.items() if n in rules and v is not signature.parameters[n].default}
            found = [(name, value, rules[name](value)) for name, value in told.items()]
            problems = [
                Problem(name, f"got {came(value)}; allowed: {allowed}") for name, value, allowed in found if allowed
            ]
            if problems:
                raise ParameterError(problems)
            return function(*args, **kwargs)

        return called

    return decorate
