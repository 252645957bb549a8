"""Programs as Python: slow and readable, for debuggers and tests."""

from __future__ import annotations

import itertools
import linecache
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from steadyslip.kernels import primitives
from steadyslip.kernels.nodes import PRIMITIVES, Node, Program
from steadyslip.kernels.printers.text import Writer

_WORDS = {"and": "and", "or": "or"}
_numbers = itertools.count(1)
_FLOAT = re.compile(r"-?\d+(\.\d+(e[+-]\d+)?|e[+-]\d+)|\(?-?math\.(inf|nan)\)?")  # literals of floats
_OF_INTEGERS = {"shl": "<<", "shr": ">>"}


def function(program: Program, steppable: bool = False) -> Callable[[Any, float, Any], None]:
    """Program as a Python function; if `steppable`, debuggers can show its source lines."""
    known = {name: _as_numpy(getattr(primitives, name)) for name in PRIMITIVES} | {"float64": np.float64}
    known |= {name: getattr(primitives, name) for name in ("bits", "real", "as_float")}
    found: dict[str, Any] = {}
    source, file = text(program), f"<program {next(_numbers)}: {program.name}>"
    if steppable:
        linecache.cache[file] = len(source), None, source.splitlines(keepends=True), file
    exec(compile(source, file, "exec"), known | {"math": math}, found)
    made: Callable[[Any, float, Any], None] = found[program.name]
    return made


def _as_numpy(primitive: Callable[..., Any]) -> Callable[..., np.float64]:
    """Primitive with NumPy floats as results, because division by zero must give inf or NaN, not an exception."""
    return lambda *given: np.float64(primitive(*given))


def text(program: Program) -> str:
    """Python source of a program, as a function of record R, number x and array y."""
    return f"def {program.name}(R, x, y):\n" + ("".join(_Python(program).body()) or "    pass\n")


class _Python(Writer):
    def number(self, value: Any) -> str:
        if not isinstance(value, float) or math.isfinite(value):
            return repr(value)
        return "math.nan" if math.isnan(value) else "math.inf" if value > 0 else "(-math.inf)"

    def select(self, condition: str, value: str, other: str) -> str:
        # a literal becomes a NumPy float, because the value may be a divisor: Python's floats raise on division by zero
        value, other = (f"float64({one})" if _FLOAT.fullmatch(one) else one for one in (value, other))
        return f"({value} if {condition} else {other})"

    def operation(self, node: Node, arguments: Sequence[str]) -> str:
        word = _OF_INTEGERS.get(node.op) or (_WORDS.get(node.op) if node.kind == "bool" else None)
        if word is not None:
            return f"({arguments[0]} {word} {arguments[1]})"
        if node.op == "not":
            return f"(not {arguments[0]})"
        return f"{'as_float' if node.op == 'float' else node.op}({', '.join(arguments)})"

    def named(self, name: str, value: str) -> str:
        return f"{name} = {value}"

    assigned = carried = named

    def rounds(self, count: int) -> str:
        return f"for _ in range({count}):"

    def following(self, names: Sequence[str], values: Sequence[str]) -> str:
        return f"{', '.join(names)} = {', '.join(values)}"
