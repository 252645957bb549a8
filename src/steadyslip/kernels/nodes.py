"""Straight-line programs: typed operations in order of definition, and stores of results to array elements.

A `Node` is one operation. Arithmetic on nodes makes new nodes, so that running an integration step written as ordinary
Python once records it as a program; a printer (`printers/`) converts the program to code. Programs have selections in
place of branches and no calls except to the listed primitives, so that one program serves all targets, vectors as well.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, cast

PRIMITIVES = (
    "exp", "log", "log1p", "expm1", "sinh", "cosh", "tanh", "asinh", "asinh_exp", "sin", "cos", "sqrt", "power", "sign",
    "rough_log",
)  # fmt: skip
"""Elementary functions that programs may use, defined in `steadyslip.kernels.primitives`."""
_order = itertools.count()


def _operator(op: str, kind: str | None = None, swapped: bool = False) -> Callable[[Node, Any], Node]:
    """Method of `Node` for a binary operator of Python."""
    return lambda self, other: self._with(op, other, kind, swapped)


class Node:
    """One operation.

    Attributes
    ----------
    op : str
    args : tuple
        Operands, which are nodes; for ``number``, ``load``, ``argument`` and ``carried`` a value or address.
    kind : str
        ``real``, ``int`` or ``bool``.
    loop : Loop or None
        Loop in which the node is computed.
    operands : tuple of Node
        Nodes in `args`, which must be computed first.
    order : int
        Serial number: nodes are numbered in order of creation.
    """

    __slots__ = ("args", "kind", "loop", "op", "operands", "order")

    def __init__(self, op: str, args: tuple[Any, ...], kind: str = "real", loop: Loop | None = None) -> None:
        self.op, self.args, self.kind = op, args, kind
        self.operands = tuple([a for a in args if isinstance(a, Node)])
        self.loop: Loop | None = loop or next((a.loop for a in self.operands if a.loop is not None), None)
        self.order = next(_order)

    def _with(self, op: str, other: Any, kind: str | None = None, swapped: bool = False) -> Node:
        other = as_node(other, self.kind)
        pair = (other, self) if swapped else (self, other)
        return Node(op, pair, kind or self.kind)

    __add__, __radd__ = _operator("add"), _operator("add", swapped=True)
    __sub__, __rsub__ = _operator("sub"), _operator("sub", swapped=True)
    __mul__, __rmul__ = _operator("mul"), _operator("mul", swapped=True)
    __truediv__, __rtruediv__ = _operator("div"), _operator("div", swapped=True)
    __lt__, __le__ = _operator("lt", "bool"), _operator("le", "bool")
    __gt__, __ge__ = _operator("gt", "bool"), _operator("ge", "bool")
    __and__, __or__ = _operator("and"), _operator("or")
    __lshift__, __rshift__ = _operator("shl"), _operator("shr")

    def __neg__(self) -> Node:
        return Node("neg", (self,))

    def __abs__(self) -> Node:
        return Node("abs", (self,))

    def __invert__(self) -> Node:
        return Node("not", (self,), "bool")

    def __bool__(self) -> bool:
        raise TypeError("a program has no branches; use select(condition, value, other)")


Value = Node | float


def as_node(value: Any, kind: str = "real") -> Node:
    """Node of a number; a node is returned unchanged."""
    if isinstance(value, Node):
        return value
    return Node("number", (int(value) if kind == "int" else bool(value) if kind == "bool" else float(value),), kind)


# -- functions for operations without a Python operator: nodes give a new node, numbers give a number


def select(condition: Any, value: Any, other: Any) -> Any:
    """`value` if the condition is true, else `other`."""
    if not isinstance(condition, Node):
        return value if condition else other
    return Node("select", (condition, as_node(value), as_node(other)))


def larger(a: Any, b: Any) -> Any:
    """Maximum of two values; `a` where `b` is NaN, like Python's max."""
    return select(b > a, b, a)


def smaller(a: Any, b: Any) -> Any:
    """Minimum of two values; `a` where `b` is NaN, like Python's min."""
    return select(b < a, b, a)


def primitive(name: str, *arguments: Any) -> Node:
    """Node that applies one of `PRIMITIVES`."""
    return Node(name, tuple(map(as_node, arguments)))


exp, log, sin, cos = (partial(primitive, name) for name in ("exp", "log", "sin", "cos"))


def weighted(weights: Iterable[float], terms: Iterable[Value]) -> Value:
    """Weighted sum; terms of weight zero are left out."""
    parts = [term if weight == 1.0 else weight * term for weight, term in zip(weights, terms, strict=False) if weight]
    if not parts:
        return 0.0
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


class Loop:
    """Loop with a fixed number of rounds; its carried values change from round to round.

    Attributes
    ----------
    rounds : int
    start, carried, following : tuple of Node
        Carried values: before the first round, at the start of a round, and at its end.
    results : tuple of Node
        Values from the last round that are used after the loop.
    """

    def __init__(self, rounds: int, start: Sequence[Value], body: Callable[..., tuple[Any, Any]]) -> None:
        self.rounds = rounds
        self.start = tuple(map(as_node, start))
        self.carried = tuple(Node("carried", (i,), loop=self) for i in range(len(start)))
        following, results = body(*self.carried)
        self.following, self.results = tuple(following), tuple(results)

    def outcome(self) -> list[Node]:
        """Nodes of the results, for use after the loop."""
        return [Node("result", (self, i)) for i in range(len(self.results))]

    @cached_property
    def nodes(self) -> list[Node]:
        """Nodes that each round computes, in order."""
        return [node for node in reachable([*self.following, *self.results]) if node.loop is self]

    @cached_property
    def given(self) -> list[Node]:
        """Nodes outside the loop that must be computed before the first round."""
        wanted = [*self.following, *self.results, *(a for node in self.nodes for a in node.operands)]
        return [*self.start, *(node for node in wanted if node.loop is None)]


def reachable(ends: Iterable[Node]) -> list[Node]:
    """Nodes in `ends` and all nodes on which they depend, in order of definition; nodes inside loops are left out."""
    found: dict[int, Node] = {}
    waiting = list(ends)
    while waiting:
        node = waiting.pop()
        if node.order in found:
            continue
        found[node.order] = node
        waiting += cast(Loop, node.args[0]).given if node.op == "result" else node.operands
    return [found[order] for order in sorted(found)]


@dataclass(eq=False)
class Program:
    """Function ``(record, number, array) -> None`` as a straight-line program.

    All loads read the arrays as they were when the function was called.
    """

    name: str
    stores: list[tuple[str, int, Node]] = field(default_factory=list)
    number: Node = field(default_factory=lambda: Node("argument", ()))
    _loads: dict[tuple[str, int], Node] = field(default_factory=dict)

    def load(self, place: int, array: str = "R") -> Node:
        """Node that loads element `place` of the record R or of the array y."""
        key = (array, int(place))
        if key not in self._loads:
            self._loads[key] = Node("load", key)
        return self._loads[key]

    def store(self, place: int, value: Value, array: str = "R") -> None:
        """Append an instruction that stores `value` in element `place` of the record R or the array y."""
        self.stores.append((array, int(place), as_node(value)))

    def nodes(self) -> list[Node]:
        """Nodes on which the stored values depend, in order of computation."""
        return reachable([node for _, _, node in self.stores])
