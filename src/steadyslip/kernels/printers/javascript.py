"""Programs as JavaScript for browsers, with the elementary functions of `runtime.js`."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from steadyslip.core.errors import InternalError
from steadyslip.kernels.layout import Layout, Routines
from steadyslip.kernels.nodes import PRIMITIVES, Node, Program
from steadyslip.kernels.printers.text import Writer

_WORDS = {"and": "&&", "or": "||"}
_IMPORT = re.compile(r"^import\b[^;]*;\n", re.M)
_EXPORT = re.compile(r"^export (?=const|let|class|function|async)", re.M)
_DECLARED = re.compile(r"^(?:export )?(?:const|let|class|function\*?|async function) (\w+)", re.M)
_FURTHER = re.compile(r"^(?:export )?const .*", re.M), re.compile(r", ([A-Z][A-Z_]+) = ")
_EXPORTED = re.compile(r"(?:^export (?:const|function)|,) (\w+)(?= =|\()", re.M)
_OWN = {"abs", "sqrt"}


def runtime(*code: str) -> str:
    """Source of `runtime.js` with the elementary functions; given some code, only the parts that the code needs."""
    whole = files("steadyslip.kernels.printers").joinpath("runtime.js").read_text(encoding="utf-8")
    if not code:
        return whole
    blocks = re.findall(r"^(?:/\*\*[^/]*?\*/\n)?(?:export |const |function )(?:.*\n)(?:[ }].*\n)*", whole, re.M)
    names = {block: {*declared_names(block), *_EXPORTED.findall(block)} for block in blocks}
    needed = "\n".join(code)
    kept: set[str] = set()
    while more := {
        block for block in blocks if block not in kept
        and any(re.search(rf"(?<![\w.\"]){name}\b", needed) for name in names[block])
    }:  # fmt: skip
        kept |= more
        needed = "".join(more)
    return "".join(block for block in blocks if block in kept)


def runtime_names() -> set[str]:
    """Names that `runtime` exports."""
    return set(_EXPORTED.findall(runtime()))


def declared_names(*modules: str) -> list[str]:
    """Names that JavaScript modules declare at their outermost level."""
    names = [name for module in modules for name in _DECLARED.findall(module)]
    return names + [
        name for module in modules for line in _FURTHER[0].findall(module) for name in _FURTHER[1].findall(line)
    ]


def as_script(*modules: str) -> str:
    """JavaScript modules joined into one scope, without `import` and `export`.

    Raises
    ------
    InternalError
        If two modules declare the same name at their outermost level.
    """
    names = declared_names(*modules)
    if twice := {name for name in names if names.count(name) > 1}:
        raise InternalError(f"one JavaScript module to declare {', '.join(sorted(twice))}, not several")
    return "\n".join(_EXPORT.sub("", _IMPORT.sub("", module)) for module in modules)


def machine(programs: Sequence[Program], layout: Layout) -> str:
    """JavaScript expression for a kernel: an object with `layout` and `routines`, for the transpiled driver."""
    known = {program.name for program in programs}
    routines = ", ".join(name if name in known else "absent" for name in Routines._fields)
    functions = "".join(map(text, programs))
    return f"(() => {{\n{functions}return {{ layout: {list(layout)}, routines: [{routines}] }};\n}})()"


def text(program: Program) -> str:
    """JavaScript source of a program as a function of record, number and array."""
    return f"function {program.name}(R, x, y) {{\n{''.join(_JavaScript(program).body())}}}\n"


def literal(value: Any) -> str:
    """JavaScript literal of a number (nan and inf included) or bool."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "(-Infinity)"
    # integers below 1e15 are exact and shorter without decimal point
    short = int(value) if abs(value) < 1e15 and value == int(value) and math.copysign(1, value) > 0 else value
    return repr(short) if math.copysign(1, value) > 0 else f"({short!r})"


class _JavaScript(Writer):
    short = True

    def number(self, value: Any) -> str:
        return literal(value)

    def select(self, condition: str, value: str, other: str) -> str:
        return f"({condition} ? {value} : {other})"

    def _written(self, node: Node) -> str:
        if node.op == "select":
            return self.select(*map(self.bare, node.operands))
        if node.op in _OWN or node.op in PRIMITIVES:
            return self.operation(node, list(map(self.bare, node.operands)))
        return super()._written(node)

    def operation(self, node: Node, arguments: Sequence[str]) -> str:
        if node.op in _WORDS and node.kind == "bool":
            return f"({arguments[0]} {_WORDS[node.op]} {arguments[1]})"
        if node.op == "not":
            return f"(!{arguments[0]})"
        if node.op not in _OWN and node.op not in PRIMITIVES:
            raise InternalError(f"a program for JavaScript without {node.op}, which needs integers of 64 bits")
        return f"{node.op}({', '.join(arguments)})"

    def named(self, name: str, value: str) -> str:
        return f"var {name} = {value};"

    carried = named

    def assigned(self, name: str, value: str) -> str:
        return f"{name} = {value};"

    def rounds(self, count: int) -> str:
        return f"for (let i = 0; i < {count}; i++) {{"

    def following(self, names: Sequence[str], values: Sequence[str]) -> str:
        return f"[{', '.join(names)}] = [{', '.join(values)}];"

    def end(self) -> str:
        return "}"
