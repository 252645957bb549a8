"""Programs as plain Python: slow, readable, to be stepped through; where a printer for another language begins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from steadyslip.kernels import primitives
from steadyslip.kernels.nodes import PRIMITIVES, Loop, Node, Program, reachable

_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "gt": ">", "ge": ">=", "shl": "<<",
          "shr": ">>"}  # fmt: skip
_WORDS = {"and": "and", "or": "or"}
_DEEPEST = 8  # operations in one line


def function(program: Program) -> Callable[[Any, float, Any], None]:
    """A program as a Python function."""
    known = {name: getattr(primitives, name) for name in (*PRIMITIVES, "bits", "real", "as_float")}
    found: dict[str, Any] = {}
    exec(compile(text(program), f"<{program.name}>", "exec"), known | {"math": math}, found)
    made: Callable[[Any, float, Any], None] = found[program.name]
    return made


def text(program: Program) -> str:
    """Its source."""
    writer = _Writer(program)
    writer.emit(program.nodes(), 1)
    for array, place, node in program.stores:
        writer.line(1, f"{array}[{place}] = {writer.known[node.order]}")
    return f"def {program.name}(R, x, y):\n" + "".join(writer.lines) + ("" if writer.lines else "    pass\n")


class _Writer:
    """Names what is used more than once, and puts the rest into the expressions that use it."""

    def __init__(self, program: Program) -> None:
        self.lines: list[str] = []
        self.known: dict[int, str] = {program.number.order: "x"}
        self.depth: dict[int, int] = {}
        self.uses: dict[int, int] = {}
        for _, _, node in program.stores:
            self.uses[node.order] = self.uses.get(node.order, 0) + 1
        self._count(program.nodes())

    def _count(self, nodes: Sequence[Node]) -> None:
        for node in nodes:
            for operand in node.operands:
                self.uses[operand.order] = self.uses.get(operand.order, 0) + 1
            if node.op == "result":
                self._count(node.args[0].nodes())

    def line(self, level: int, statement: str) -> None:
        """Add a line."""
        self.lines.append("    " * level + statement + "\n")

    def emit(self, nodes: Sequence[Node], level: int, loop: Loop | None = None) -> None:
        """Everything that is not inside a loop, or that is inside this one."""
        for node in nodes:
            if node.order in self.known or node.loop is not loop:
                continue
            if node.op == "result":
                self._loop(node.args[0], level)
                self.known[node.order] = self.known[node.args[0].results[node.args[1]].order]
                continue
            written, depth = (
                self._written(node),
                1 + max((self.depth.get(a.order, 0) for a in node.operands), default=0),
            )
            often = self.uses.get(node.order, 0) != 1 or depth > _DEEPEST
            if node.op != "number" and (often or node.op == "load" or loop is not None):
                name = f"t{len(self.lines) + 1}"
                self.line(level, f"{name} = {written}")
                written, depth = name, 0
            self.known[node.order], self.depth[node.order] = written, depth

    def _written(self, node: Node) -> str:
        if node.op == "number":
            value = node.args[0]
            finite = not isinstance(value, float) or math.isfinite(value)
            return repr(value) if finite else f"math.{'nan' if math.isnan(value) else 'inf'}"
        if node.op == "load":
            return f"{node.args[0]}[{node.args[1]}]"
        a = [self.known[operand.order] for operand in node.operands]
        if node.op in _SIGNS or (node.op in _WORDS and node.kind == "bool"):
            return f"({a[0]} {_SIGNS.get(node.op) or _WORDS[node.op]} {a[1]})"
        if node.op == "select":
            return f"({a[1]} if {a[0]} else {a[2]})"
        if node.op in ("neg", "not"):
            return f"({'-' if node.op == 'neg' else 'not '}{a[0]})"
        return f"{'as_float' if node.op == 'float' else node.op}({', '.join(a)})"

    def _loop(self, loop: Loop, level: int) -> None:
        if loop.results[0].order in self.known:
            return
        self.emit(reachable(loop.given()), level)
        names = [f"z{len(self.lines)}_{i}" for i in range(len(loop.carried))]
        for node, name, start in zip(loop.carried, names, loop.start, strict=True):
            self.known[node.order] = name
            self.line(level, f"{name} = {self.known[start.order]}")
        self.line(level, f"for _ in range({loop.rounds}):")
        self.emit(loop.nodes(), level + 1, loop)
        following = [self.known[node.order] for node in loop.following]
        for node in loop.results:
            if self.known[node.order] in names:
                raise ValueError("a result of a loop is what it leaves, not what it began with")
        self.line(level + 1, f"{', '.join(names)} = {', '.join(following)}")
