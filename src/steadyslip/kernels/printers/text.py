"""Base of printers for languages with expressions: values that are used only once are inlined."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from steadyslip.kernels.nodes import Loop, Node, Program, reachable

_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
_SUMS, _PRODUCTS = frozenset(("add", "sub")), frozenset(("mul", "div"))
_DEEPEST = 8  # most operations nested in one expression of a line, so that lines stay readable


class Writer(ABC):
    """Base of printers: values used more than once get a name, other values are inlined.

    Attributes
    ----------
    lines : list of str
        Statements so far, indented.
    short : bool
        True to inline loads that are used once, which shortens pages; names are better for debuggers.
    """

    short = False

    def __init__(self, program: Program) -> None:
        self.program = program
        self.lines: list[str] = []
        self.known: dict[int, str] = {program.number.order: "x"}
        self.signs: dict[int, str] = {}  # outermost operator of each inlined expression in brackets, by node
        self.depth: dict[int, int] = {}
        self.uses: dict[int, int] = {}
        self.changed = {array for array, _, _ in program.stores}
        for _, _, node in program.stores:
            self.uses[node.order] = self.uses.get(node.order, 0) + 1
        self._count(program.nodes())

    def body(self) -> list[str]:
        """Statements of the whole program."""
        self.emit(self.program.nodes(), 1)
        for array, place, node in self.program.stores:
            self.line(1, self.assigned(f"{array}[{place}]", self.known[node.order]))
        return self.lines

    # -- syntax of a language

    @abstractmethod
    def number(self, value: Any) -> str:
        """Literal of a number or bool."""

    @abstractmethod
    def select(self, condition: str, value: str, other: str) -> str:
        """Expression that is `value` if the condition is true, else `other`."""

    @abstractmethod
    def operation(self, node: Node, arguments: Sequence[str]) -> str:
        """Expression for an operation whose syntax differs between languages."""

    @abstractmethod
    def named(self, name: str, value: str) -> str:
        """Statement that assigns a value to a new name; the name must stay valid after a loop."""

    @abstractmethod
    def assigned(self, name: str, value: str) -> str:
        """Statement that assigns a value to an existing name."""

    @abstractmethod
    def carried(self, name: str, value: str) -> str:
        """Statement that declares a name with its first value, for a value that changes from round to round."""

    @abstractmethod
    def rounds(self, count: int) -> str:
        """Head of a loop."""

    @abstractmethod
    def following(self, names: Sequence[str], values: Sequence[str]) -> str:
        """Statement that assigns values to names simultaneously."""

    def end(self) -> str:
        """End of a loop; empty for none."""
        return ""

    # -- common to all languages

    def _count(self, nodes: Sequence[Node]) -> None:
        for node in nodes:
            for operand in node.operands:
                self.uses[operand.order] = self.uses.get(operand.order, 0) + 1
            if node.op == "result":
                self._count(node.args[0].nodes)

    def line(self, level: int, statement: str) -> None:
        """Append a line."""
        self.lines.append("    " * level + statement + "\n")

    def emit(self, nodes: Sequence[Node], level: int, loop: Loop | None = None) -> None:
        """Write those of the nodes that belong to `loop`, or, if it is None, those outside loops."""
        for node in nodes:
            if node.order in self.known or node.loop is not loop:
                continue
            if node.op == "result":
                self._loop(node.args[0], level)
                self.known[node.order] = self.known[node.args[0].results[node.args[1]].order]
                continue
            written = self._written(node)
            depth = 1 + max((self.depth.get(a.order, 0) for a in node.operands), default=0)
            often = self.uses.get(node.order, 0) != 1 or depth > _DEEPEST
            early = node.op == "load" and (not self.short or node.args[0] in self.changed)  # before it is overwritten
            if node.op != "number" and (often or early or loop is not None):
                name = f"t{len(self.lines) + 1}"
                self.line(level, self.named(name, written[1:-1] if node.op in _SIGNS else written))
                written, depth = name, 0
            elif node.op in _SIGNS:
                self.signs[node.order] = node.op
            self.known[node.order], self.depth[node.order] = written, depth

    def _written(self, node: Node) -> str:
        if node.op == "number":
            return self.number(node.args[0])
        if node.op == "load":
            return f"{node.args[0]}[{node.args[1]}]"
        a = [self.known[operand.order] for operand in node.operands]
        if node.op in _SIGNS:
            first, second = self._beside(node)
            return f"({first} {_SIGNS[node.op]} {second})"
        if node.op == "select":
            return self.select(*a)
        return f"(-{a[0]})" if node.op == "neg" else self.operation(node, a)

    def bare(self, node: Node) -> str:
        """Expression of a node without outer brackets."""
        return self.known[node.order][1:-1] if node.order in self.signs else self.known[node.order]

    def _beside(self, node: Node) -> tuple[str, str]:
        """Expressions of both operands; brackets are kept only where the order of operations needs them."""
        signs = [self.signs.get(operand.order, "") for operand in node.operands]
        product, compares = node.op in _PRODUCTS, node.op not in _SUMS | _PRODUCTS
        spare = _PRODUCTS if product else _SUMS | _PRODUCTS, _SUMS | _PRODUCTS if compares else _PRODUCTS
        bare = (signs[0] in spare[0], not product and signs[1] in spare[1])
        first, second = (self.known[operand.order] for operand in node.operands)
        return first[1:-1] if bare[0] else first, second[1:-1] if bare[1] else second

    def _loop(self, loop: Loop, level: int) -> None:
        if loop.results[0].order in self.known:
            return
        self.emit(reachable(loop.given), level)
        names = [f"z{len(self.lines)}_{i}" for i in range(len(loop.carried))]
        for node, name, start in zip(loop.carried, names, loop.start, strict=True):
            self.known[node.order] = name
            self.line(level, self.carried(name, self.known[start.order]))
        self.line(level, self.rounds(loop.rounds))
        self.emit(loop.nodes, level + 1, loop)
        values = [self.known[node.order] for node in loop.following]
        if {self.known[node.order] for node in loop.results} & set(names):
            raise ValueError("a result of a loop must be a value computed in a round, not a carried value at its start")
        self.line(level + 1, self.following(names, values))
        if self.end():
            self.line(level, self.end())
