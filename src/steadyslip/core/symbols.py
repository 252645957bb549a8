"""Symbols that stand in equations: one factory for all of them.

A name that a user gives (of a parameter, a memory, a body) is never the name of a symbol: it is a letter, which people
are shown (`steadyslip.model.equations.Model.written`), while the symbol is called by its place. So no name meets one of
the package's own, and names change neither the order of terms nor the last bit of a number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

import sympy as sp

from steadyslip.core.errors import InternalError

_PLACE = 1
"""`dummy_index` of all of them: SymPy's own are above a million, and differ from process to process."""


@cache
def inner_symbol(name: str, **assumptions: bool | None) -> sp.Dummy:
    """Symbol of the equations, the same object for the same name and assumptions, alike in every process.

    It equals no `sympy.Symbol`, whatever that is called, and no `sympy.Dummy` made elsewhere.
    """
    return sp.Dummy(name, _PLACE, **{key: value for key, value in assumptions.items() if value is not None})


def inner_symbols(names: str, **assumptions: bool | None) -> tuple[sp.Dummy, ...]:
    """One `inner_symbol` for each word."""
    return tuple(inner_symbol(name, **assumptions) for name in names.split())


class Letters:
    """By what people know symbols: no letter is used twice.

    Attributes
    ----------
    known : dict of sympy.Symbol to str
        Letters of symbols that are not known by their own names.
    """

    def __init__(self, taken: Iterable[str], known: Mapping[sp.Symbol, str] | None = None) -> None:
        self.known = dict(known or {})
        self._taken = set(taken)

    def symbol(self, name: str, dotted: str, letter: str = "", **assumptions: bool | None) -> sp.Symbol:
        """`inner_symbol` of a name, with a letter, or else an unused one for a dotted name that a user gave."""
        found = inner_symbol(name, **assumptions)
        if found in self.known:
            raise InternalError("a symbol stands for one thing")
        self.known[found] = letter or self.unused(dotted)
        return found

    def unused(self, dotted: str) -> str:
        """The last part of a dotted name, with as many earlier parts behind it as make it unique, or else a number.

        A body and a contact may have the same name, and ``a-b`` and ``a_b`` are two.
        """
        *before, letter = dotted.replace("-", "_").split(".")
        if before and before[-1].isdigit():
            letter = f"{letter}_{before.pop()}"
        while letter in self._taken and before:
            letter = f"{letter}_{before.pop()}"
        free = (letter, *(f"{letter}_{number}" for number in range(2, len(self._taken) + 3)))
        letter = next(one for one in free if one not in self._taken)
        self._taken.add(letter)
        return letter
