"""Differential variables of a Model."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp


@dataclass(frozen=True)
class Variable:
    """Differential variable of the Model: name, symbol, SI unit, meaning.

    `kind` is ``slip``, ``velocity``, ``memory`` (of friction), ``state`` (of a contact law), ``integral`` (of a
    controller), ``held`` (force of a released drive) or ``past`` (of a late signal).
    """

    name: str
    symbol: sp.Symbol
    unit: str
    doc: str
    kind: str
