"""SymPy symbols for equations, and the letters with which they are displayed.

User-given names (of parameters, memory variables, bodies) are never names of symbols. A symbol is named after its
position; the user's name is only its display letter (`steadyslip.model.equations.Model.written`). So the user's names
cannot collide with the package's own, and change neither the order of terms nor the last bit of a result.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

import sympy as sp

from steadyslip.core.errors import InternalError

_PLACE = 1
"""`dummy_index` of all symbols. Indices that SymPy chooses are above a million and differ between processes."""


@cache
def inner_symbol(name: str, **assumptions: bool | None) -> sp.Dummy:
    """Symbol for equations: one object per name and assumptions, reproducible across processes.

    The symbol is unequal to every `sympy.Symbol` and to every `sympy.Dummy` made elsewhere, whatever their names.
    """
    return sp.Dummy(name, _PLACE, **{key: value for key, value in assumptions.items() if value is not None})


def inner_symbols(names: str, **assumptions: bool | None) -> tuple[sp.Dummy, ...]:
    """Symbols made by `inner_symbol`, one for each word of a text such as ``"T tau sigma"``."""
    return tuple(inner_symbol(name, **assumptions) for name in names.split())


class Letters:
    """Unique display letters of symbols; letters in `taken` are never used.

    Attributes
    ----------
    known : dict of sympy.Symbol to str
        Display letter of each symbol whose letter differs from its name.
    """

    def __init__(self, taken: Iterable[str], known: Mapping[sp.Symbol, str] | None = None) -> None:
        self.known = dict(known or {})
        self._taken = set(taken)

    def symbol(self, name: str, dotted: str, letter: str = "", **assumptions: bool | None) -> sp.Symbol:
        """New symbol with a display letter: `letter`, or else an unused one made from the user's dotted name."""
        found = inner_symbol(name, **assumptions)
        if found in self.known:
            raise InternalError(f"every symbol to be made only once, not {name} again")
        self.known[found] = letter or self.unused(dotted)
        return found

    def unused(self, dotted: str) -> str:
        """New unique letter: the last part of a dotted name, followed by earlier parts or a number if needed.

        Collisions happen: a body and a contact may have the same name, and ``a-b`` and ``a_b`` are different names.
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
