"""Straight-line programs: typed operations in order of definition, and the array elements that they store.

A `Node` is one operation. Arithmetic on nodes makes nodes, so that a method's step written as ordinary Python becomes a
program when it is run once; a printer (`printers/`) turns that into code. There are selections instead of branches and
no calls except to the listed primitives, so that every target, vector code included, takes the same program.
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
        Nodes; for the leaves (``number``, ``load``, ``argument``, ``carried``) a value or an address.
    kind : str
        ``real``, ``int`` or ``bool``.
    loop : Loop or None
        The loop in which it is computed.
    operands : tuple of Node
        Nodes in `args`, to be computed before.
    order : int
        Position in the order in which nodes were made.
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
    """Convert a number to a node; nodes are unchanged."""
    if isinstance(value, Node):
        return value
    return Node("number", (int(value) if kind == "int" else bool(value) if kind == "bool" else float(value),), kind)


# -- operations without an operator: on nodes they make nodes, on numbers they compute


def select(condition: Any, value: Any, other: Any) -> Any:
    """`value` where the condition holds, else `other`."""
    if not isinstance(condition, Node):
        return value if condition else other
    return Node("select", (condition, as_node(value), as_node(other)))


def larger(a: Any, b: Any) -> Any:
    """Maximum of two values; `a` where `b` is NaN, as Python's max."""
    return select(b > a, b, a)


def smaller(a: Any, b: Any) -> Any:
    """Minimum of two values; `a` where `b` is NaN, as Python's min."""
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
    """Loop with a fixed number of rounds, which carry values from one round to the next.

    Attributes
    ----------
    rounds : int
    start, carried, following : tuple of Node
        Values before the first round, as a round sees them, and as it leaves them.
    results : tuple of Node
        What is wanted of the last round.
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
        """Nodes needed before the first round."""
        wanted = [*self.following, *self.results, *(a for node in self.nodes for a in node.operands)]
        return [*self.start, *(node for node in wanted if node.loop is None)]


def reachable(ends: Iterable[Node]) -> list[Node]:
    """Nodes that `ends` depend on, and `ends`, in order of definition; loops before them count as one node."""
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

    Loads see the record as it was when the function was called.
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
        """Store a value in an element."""
        self.stores.append((array, int(place), as_node(value)))

    def nodes(self) -> list[Node]:
        """Nodes to be computed, in order."""
        return reachable([node for _, _, node in self.stores])
