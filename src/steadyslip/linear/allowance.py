"""How many terms of a sum may be evaluated on the imaginary axis to count roots under delays.

Where late terms nearly outweigh what acts at once, or delays are long, one count takes seconds and a scan asks for a
thousand of them. Inside `at_most` all counts together stop after a number of terms, the same on every computer: they
come out as `argument.UNKNOWN`, and `CountingAllowance.spent` tells so.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

_SHARE = 16  # of what is left; about the number of times that pieces of the axis are halved in one count


@dataclass
class CountingAllowance:
    """Terms that are left, and whether more were asked for."""

    left: int
    spent: bool = False


_CURRENT: ContextVar[CountingAllowance | None] = ContextVar("allowance", default=None)


@contextmanager
def at_most(terms: int) -> Iterator[CountingAllowance]:
    """Allowance of so many terms, about half a microsecond each, for all that is counted inside the block."""
    own = CountingAllowance(terms)
    token = _CURRENT.set(own)
    try:
        yield own
    finally:
        _CURRENT.reset(token)


def at_a_time(most: int) -> int:
    """Number of terms that one step of a count may take, `most` at most, so that one count does not take all."""
    own = _CURRENT.get()
    return most if own is None else min(most, own.left // _SHARE)


def may_take(terms: int) -> bool:
    """True, and so many terms fewer are left, if the current allowance has them; always True without one."""
    own = _CURRENT.get()
    if own is None:
        return True
    own.spent |= terms > own.left
    own.left -= 0 if own.spent else terms
    return not own.spent
