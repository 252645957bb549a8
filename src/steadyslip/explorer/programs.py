"""Programs for a page, generated from expressions of a Model.

Each program reads the array R (parameters in the order of the Model, then σss of every contact) and writes array y.
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
    model: Model, name: str, expressions: Sequence[Any], further: Sequence[sp.Symbol] = (), then: Then | None = None
) -> Program:
    """Program that evaluates expressions of a Model's parameters, σss and `further` symbols, read in this order.

    With `then`, a function of the list of values (nodes), its results are stored instead of the values.

    Raises
    ------
    NotAvailable
        If an expression has a function without JavaScript equivalent, which the message names.
    """
    made = Program(name)
    names = {symbol: f"p{i}" for i, symbol in enumerate((*model.arguments, *further))}
    formulas = Formulas(expressions, names)
    values = {n: made.load(i) for i, n in enumerate(names.values()) if n in formulas.symbols}
    found = list(map(as_node, formulas(values)))
    for place, value in enumerate(found if then is None else then(found)):
        made.store(place, value, "y")
    return made
