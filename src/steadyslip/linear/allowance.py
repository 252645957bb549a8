"""Limit on the number of terms evaluated on the imaginary axis to count roots under delays.

Where delayed terms are nearly as large as undelayed ones, or delays are long, one count takes seconds, and a scan needs
a thousand. Inside `at_most` all counts together stop after a given number of terms, so that results do not depend on
the computer: further counts return `argument.UNKNOWN`, and `CountingAllowance.spent` is True.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

_SHARE = 16  # one step of a count may evaluate 1/16 of the terms left, as a count has about 16 steps


@dataclass
class CountingAllowance:
    """Number of terms that may still be evaluated; `spent` becomes True if a count needed more."""

    left: int
    spent: bool = False


_CURRENT: ContextVar[CountingAllowance | None] = ContextVar("allowance", default=None)


@contextmanager
def at_most(terms: int) -> Iterator[CountingAllowance]:
    """Context manager that allows `terms` terms, about half a microsecond each, for all counts inside the block."""
    own = CountingAllowance(terms)
    token = _CURRENT.set(own)
    try:
        yield own
    finally:
        _CURRENT.reset(token)


def at_a_time(most: int) -> int:
    """Number of terms that one step of a count may evaluate: at most `most`, and at most a share of those left."""
    own = _CURRENT.get()
    return most if own is None else min(most, own.left // _SHARE)


def may_take(terms: int) -> bool:
    """Subtract `terms` from the current allowance; False if fewer are left; always True outside `at_most`."""
    own = _CURRENT.get()
    if own is None:
        return True
    own.spent |= terms > own.left
    own.left -= 0 if own.spent else terms
    return not own.spent
