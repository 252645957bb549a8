"""Expressions of a Model as programs that a page runs.

Each program reads the record R, the parameters in the Model's order and behind them σss of every contact, and writes
the array y.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from steadyslip.kernels.nodes import Node, Program, Value, as_node
from steadyslip.kernels.source import Formulas
from steadyslip.model.equations import Model

Then = Callable[[list[Node]], Sequence[Value]]


def program(
    model: Model,
    name: str,
    expressions: Sequence[Any],
    further: Sequence[sp.Symbol] = (),
    then: Then | None = None,
) -> Program:
    """Expressions in the Model's parameters, σss and `further` symbols, which stand behind them, as a program.

    What `then` makes of their values is stored instead of them, if it is given.

    Raises
    ------
    NotAvailable
        If an expression contains what cannot be printed; it is named.
    """
    made = Program(name)
    names = {symbol: f"p{i}" for i, symbol in enumerate((*model.arguments, *further))}
    formulas = Formulas(expressions, names)
    values = {n: made.load(i) for i, n in enumerate(names.values()) if n in formulas.symbols}
    found = list(map(as_node, formulas(values)))
    for place, value in enumerate(found if then is None else then(found)):
        made.store(place, value, "y")
    return made
