"""Exceptions and helpers for their messages: each states the parameter, its value, what is allowed and what to do."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

MOST_SHOWN = 120  # largest number of characters of a value's repr that a message contains; chosen by trial


def one(name: str) -> str:
    """A name preceded by its indefinite article.

    >>> one("Slider"), one("Evolution")
    ('a Slider', 'an Evolution')
    """
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"


def repr_short(value: object) -> str:
    """Text of a value for a message: its repr, cut after `MOST_SHOWN` characters; raises nothing.

    >>> repr_short("5 MPa"), repr_short("a" * 1000)[-32:]
    ("'5 MPa'", 'aaa... (1002 characters in all)')
    """
    try:
        text = repr(value)
    except Exception:  # integers of more than 4300 digits; foreign objects may raise anything
        text = f"a value of type {type(value).__name__} that cannot be shown"
    if len(text) > MOST_SHOWN:
        text = f"{text[:MOST_SHOWN]}... ({len(text)} characters in all)"
    return text


class SteadyslipError(Exception):
    """Base of every exception that this package raises on purpose."""


@dataclass(frozen=True)
class Problem:
    """One fault in an input.

    Parameters
    ----------
    name : str
        Dotted name of the parameter, such as ``friction.a``.
    message : str
        One sentence: the value given and what is allowed.
    line : int, optional
        Line of the rig file, counted from 1.
    """

    name: str
    message: str
    line: int | None = None

    def __str__(self) -> str:
        where = f"line {self.line}: " if self.line is not None else ""
        return f"{where}{self.name}: {self.message}"

    def under(self, prefix: str) -> Problem:
        """Copy of the problem with a prefix and a dot before its name."""
        name = ".".join(part for part in (prefix, self.name) if part)
        return Problem(name, self.message, self.line)


SHOWN = 30
"""Number of problems listed in a message (chosen by trial); `ParameterError.problems` has all of them."""
ADVICE = 40  # clauses of at least this many characters count as advice and are printed once; shorter ones in every line


class ParameterError(SteadyslipError, ValueError):
    """One or more parameters are missing, misspelt or outside their domain."""

    def __init__(self, problems: Iterable[Problem], title: str = "") -> None:
        self.problems = tuple(problems)
        self.title = title
        super().__init__(self._text())

    def _text(self) -> str:
        lines = _advised_once([str(problem) for problem in self.problems[:SHOWN]])
        if len(self.problems) > SHOWN:
            lines.append(f"... and {len(self.problems) - SHOWN} more")
        if self.title and len(lines) == 1:
            return f"{self.title}: {lines[0]}"
        if self.title:
            return "\n".join([f"{self.title}: {len(self.problems)} problems", *(f"  {i}" for i in lines)])
        return "\n".join(lines)


def _advised_once(lines: Sequence[str]) -> list[str]:
    """Lines of a message, each without the advice (long clauses after a semicolon) that an earlier line contains."""
    found: list[str] = []
    given: set[str] = set()
    for line in lines:
        parts = line.split("; ")
        kept = [part for i, part in enumerate(parts) if i == 0 or not _is_advice(part) or part not in given]
        given.update(parts[1:])
        found.append("; ".join(kept))
    return found


def _is_advice(clause: str) -> bool:
    """True for a long clause with balanced brackets, so that removing it leaves no bracket open."""
    return len(clause) >= ADVICE and clause.count("(") == clause.count(")")


class RigFileError(ParameterError):
    """A rig file cannot be read; ``problems`` lists all faults found in it."""


class QuantityError(SteadyslipError, ValueError):
    """A text is not a quantity of the expected dimension."""


class UnknownNameError(SteadyslipError, LookupError):
    """A name is not among the allowed names, which the message lists."""

    def __init__(self, what: str, name: object, allowed: Iterable[str]) -> None:
        self.message = unknown_name(what, name, allowed)
        super().__init__(self.message)

    def __str__(self) -> str:
        return self.message


class NoSteadySliding(SteadyslipError, ValueError):
    """Steady sliding at the drive's velocity does not exist.

    Attributes
    ----------
    condition : str
        The condition that fails: ``lock-up``, ``lift-off`` or ``no solution``.
    shortfall : float
        Value of the quantity that would have to be positive (Pa for lift-off, dimensionless
        for lock-up); NaN if there is no such quantity.
    contact : str
        Name of the machine's contact at which the condition fails; empty if it is not a single contact.
    """

    def __init__(self, message: str, condition: str, shortfall: float = float("nan"), contact: str = "") -> None:
        self.condition = condition
        self.shortfall = shortfall
        self.contact = contact
        super().__init__(message)


class NotAvailable(SteadyslipError, ValueError):
    """A quantity does not exist or is not implemented for this rig; the message has the reason and an alternative."""


class OutOfRangeWarning(UserWarning):
    """Some rigs of an array have no result because their numbers leave the range of floating point."""


class IllPosedWarning(UserWarning):
    """Some rigs are ill-posed: infinitely many eigenvalues have positive real part, so there is no rightmost one."""


class UndecidedWarning(UserWarning):
    """Part of a result is not known, such as edges in part of a range, or some of infinitely many eigenvalues."""


class UnitWarning(UserWarning):
    """A number in a rig file may have been meant in another unit, or for another key."""


class NotKeptWarning(UserWarning):
    """The kernel cache cannot be written, so every process compiles its kernels again."""


class InternalError(SteadyslipError, RuntimeError):
    """An assumption of the program itself is violated: a bug, not a fault of the input.

    `expected` completes the sentence "a fault in steadyslip: expected ...".
    """

    def __init__(self, expected: str) -> None:
        super().__init__(f"a fault in steadyslip: expected {expected}; please report how you came here")


def legible(name: str) -> str:
    """A name for a message: unchanged, or its short repr if it is long or has unprintable characters."""
    return name if name.isprintable() and len(name) <= MOST_SHOWN // 2 else repr_short(name)


_LETTERS = str.maketrans(
    {"α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "η": "eta", "θ": "theta", "μ": "mu", "σ": "sigma",
     "τ": "tau", "ψ": "psi", "Θ": "theta", "_": ""}
)  # fmt: skip


def _letters(word: str) -> str:
    """Last part of a dotted name in lower case without _ and -: ``dc`` for ``friction.d_c`` and for ``Dc``."""
    return word.rpartition(".")[2].replace("_", "").replace("-", "").lower()


def named_in(name: str, texts: Mapping[str, str]) -> list[str]:
    """Keys of the texts that contain `name` as a word or as a symbol, such as ``mu_s`` for μ_S.

    >>> named_in("mu_s", {"mu_static": "static friction coefficient μ_S", "mass": "mass m"})
    ['mu_static']
    """
    wanted = name.translate(_LETTERS).casefold()
    return [key for key, text in texts.items() if wanted in re.findall(r"\w+", text.translate(_LETTERS).casefold())]


def unknown_name(
    what: str, name: object, allowed: Iterable[str], guess: bool = True, meanings: Mapping[str, str] | None = None,
    taken: Iterable[str] = ()
) -> str:  # fmt: skip
    """Message that a name is unknown, with all allowed names and, if `guess`, the name that was probably meant.

    The guess is the only allowed name with the same letters or with the word in its meaning (`meanings`, text by name),
    or else the most similar name. Names that are `taken`, because the user has given them too, must be nearly equal.
    """
    allowed, taken = list(allowed), set(taken)
    free = [one for one in allowed if one not in taken]
    meant = [one for one in allowed if _letters(one) == _letters(str(name))]
    meant = meant or [one for one in named_in(str(name), meanings or {}) if one in free]
    close = meant if len(meant) == 1 else get_close_matches(str(name), free, n=1, cutoff=0.5)
    close = close or get_close_matches(str(name), taken.intersection(allowed), n=1, cutoff=0.75)
    close = close if guess else []
    if guess and not close and "." not in str(name):  # users often give the last part of a dotted name only
        last = {full.rpartition(".")[2]: full for full in free}
        close = [last[part] for part in get_close_matches(str(name), last, n=1, cutoff=0.6)]
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"unknown {what} {repr_short(name)}; {hint}allowed: {', '.join(allowed) or 'none'}"


def keywords_of(function: Callable[..., object], without: Iterable[str] = ()) -> list[str]:
    """Names of a function's arguments that can be passed by keyword, except those in `without`."""
    return [
        name
        for name, item in inspect.signature(function).parameters.items()
        if item.kind in (item.POSITIONAL_OR_KEYWORD, item.KEYWORD_ONLY) and name not in without
    ]


def refuse_unknown(function: str, given: Iterable[str], allowed: Iterable[str], what: str = "option") -> None:
    """Raise ParameterError if some of the `given` option names are not `allowed` for the public function named.

    >>> refuse_unknown("fit", ["start"], ["starts", "effort"])
    Traceback (most recent call last):
    ...
    steadyslip.core.errors.ParameterError: fit: unknown option 'start'; did you mean 'starts'? allowed: starts, effort
    """
    allowed = list(allowed)
    if problems := [Problem(function, unknown_name(what, name, allowed)) for name in given if name not in allowed]:
        raise ParameterError(problems)
