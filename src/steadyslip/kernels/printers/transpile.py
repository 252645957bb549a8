"""Translation of the driver's modules to JavaScript, from their syntax trees.

The subset of Python is the one that `native` compiles: numbers, indexed arrays, functions of positional arguments,
``for`` over a range, ``while``, ``if``. Anything else raises an error with module and line, so that a driver outside
the subset fails when it is generated and not in a browser. Arrays of several indices are nested, the innermost typed;
there is one lane.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from steadyslip.core.errors import NotAvailable
from steadyslip.kernels.driver_text import numbered, texts
from steadyslip.kernels.printers.javascript import literal

_BINARY: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_COMPARE: dict[type, str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "===", ast.NotEq: "!=="}
_BUILTIN = {
    "abs": ("abs", 1),
    "min": ("smaller", 2),
    "max": ("larger", 2),
    "int": ("Math.trunc", 1),
    "float": ("Number", 1),
}
_MATH = {"isfinite": "Number.isFinite", "log": "Math.log"}
_MATH_NUMBERS = {"nan": "NaN", "inf": "Infinity"}
_RESERVED = frozenset(
    """arguments await case catch class const debugger default delete do enum eval export extends function implements
    import in instanceof interface let new null package private protected public static super switch this throw
    try typeof var void with yield smaller larger modulo zeros Math Number""".split()  # noqa: SIM905 -- a list of words
)


def transpiled(entries: Mapping[str, str]) -> str:
    """JavaScript of functions of driver modules, and of all that they need.

    Parameters
    ----------
    entries : mapping of str to str
        Functions called from outside, and their modules.

    Raises
    ------
    NotAvailable
        If a module uses Python outside the subset; module and line are named.
    """
    found = texts(*entries.values())
    functions = {
        node.name
        for text in found.values()
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef)
    }  # fmt: skip
    return "\n".join(module_text(name, text, functions) for name, text in found.items())


def module_text(name: str, text: str, functions: set[str]) -> str:
    """JavaScript of the functions of one module; `functions` are all that may be called."""
    known = vars(import_module(name)) if name.startswith("steadyslip.") else {}
    numbers = {key: value for key, value in known.items() if type(value) in (int, float)}
    return _Module(name, functions, numbers).text(numbered(text))


class _Module:
    """Translator of one module."""

    def __init__(self, name: str, functions: set[str], numbers: Mapping[str, float]) -> None:
        self.name, self.functions, self.numbers = name, functions, numbers
        self.local: set[str] = set()

    def refuse(self, node: ast.AST, what: str) -> NotAvailable:
        """NotAvailable error for unsupported syntax (`what`), with its module and line."""
        return NotAvailable(
            f"{self.name}, line {getattr(node, 'lineno', '?')}: {what} cannot be written in JavaScript; drivers may "
            "use numbers, arrays that are indexed, functions with positional arguments, for over range, while and if"
        )

    def text(self, tree: ast.Module) -> str:
        """JavaScript of all functions of the module; constants and imports are replaced by their values."""
        lines: list[str] = []
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                lines += self._function(node)
            elif not isinstance(node, ast.Import | ast.ImportFrom | ast.Assign) and not _is_docstring(node):
                raise self.refuse(node, type(node).__name__)
        return "\n".join(lines) + "\n"

    def _function(self, node: ast.FunctionDef) -> list[str]:
        given = node.args
        if (
            node.decorator_list
            or given.defaults
            or given.kwonlyargs
            or given.vararg
            or given.kwarg
            or given.posonlyargs
        ):
            raise self.refuse(node, f"the head of {node.name}")
        arguments = [item.arg for item in given.args]
        assigned = {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
        counted = {
            one.target.id for one in ast.walk(node) if isinstance(one, ast.For) and isinstance(one.target, ast.Name)
        }
        self.local = {*arguments, *assigned}
        if wrong := sorted(self.local & (_RESERVED | self.functions)):
            raise self.refuse(node, f"the name {wrong[0]}")
        body = self._block(node.body, 1)
        declared = sorted(assigned - {*arguments} - (counted - _set_otherwise(node)))
        head = [f"    let {', '.join(declared)};"] if declared else []
        return [f"function {node.name}({', '.join(arguments)}) {{", *head, *body, "}"]

    # -- statements

    def _block(self, body: list[ast.stmt], level: int) -> list[str]:
        return [line for node in body for line in self._statement(node, level)]

    def _statement(self, node: ast.stmt, level: int) -> list[str]:
        pad = "    " * level
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=value):
                return [pad + line for line in self._several(targets, value)]
            case ast.Assign(targets=targets, value=value):
                return [pad + " = ".join(self._write(one) for one in [*targets, value]) + ";"]
            case ast.AugAssign(target=target, op=op, value=value) if type(op) in _BINARY:
                return [f"{pad}{self._write(target)} {_BINARY[type(op)]}= {self._write(value)};"]
            case ast.Expr(value=ast.Call()):
                return [f"{pad}{self._write(node.value)};"]
            case ast.Return(value=value):
                return [f"{pad}return{'' if value is None else ' ' + self._write(value)};"]
            case ast.Break():
                return [f"{pad}break;"]
            case ast.Continue():
                return [f"{pad}continue;"]
            case ast.If(test=test, body=body, orelse=orelse):
                lines = [f"{pad}if ({self._truth(test)}) {{", *self._block(body, level + 1)]
                return [*lines, *([f"{pad}}} else {{", *self._block(orelse, level + 1)] if orelse else []), pad + "}"]
            case ast.While(test=test, body=body, orelse=[]):
                return [f"{pad}while ({self._truth(test)}) {{", *self._block(body, level + 1), pad + "}"]
            case ast.For(orelse=[]):
                return self._loop(node, level)
        if _is_docstring(node):
            return []
        raise self.refuse(node, type(node).__name__)

    def _several(self, targets: list[ast.expr], value: ast.expr) -> list[str]:
        """Assignments to several targets: one after the other if no value reads a target, else all at once."""
        if isinstance(value, ast.Name):
            return [f"[{', '.join(map(self._write, targets))}] = {self._write(value)};"]
        if not isinstance(value, ast.Tuple) or len(value.elts) != len(targets):
            raise self.refuse(value, "unpacking of anything but as many values")
        pairs = [(self._write(a), self._write(b)) for a, b in zip(targets, value.elts, strict=True)]
        if _names(targets) & _names(value.elts):
            return [f"[{', '.join(a for a, _ in pairs)}] = [{', '.join(b for _, b in pairs)}];"]
        return [f"{a} = {b};" for a, b in pairs]

    def _loop(self, node: ast.For, level: int) -> list[str]:
        if not isinstance(node.target, ast.Name):
            raise self.refuse(node, "for over several names at once")
        i = node.target.id if node.target.id != "_" else f"round{level}"
        if any(isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store) and one.id == i for one in _inside(node)):
            raise self.refuse(node, f"a loop that sets its own {i}")
        pad = "    " * level
        return [f"{pad}for ({self._range(node, i)}) {{", *self._block(node.body, level + 1), pad + "}"]

    def _range(self, node: ast.For, i: str) -> str:
        """Head of a loop over a range or over a few listed values."""
        match node.iter:
            case ast.Tuple(elts=elements):
                return f"const {i} of [{', '.join(map(self._write, elements))}]"
            case ast.Call(func=ast.Name(id="range"), args=arguments, keywords=[]):
                bounds = [self._write(one) for one in arguments]
                start, stop = (bounds[0], bounds[1]) if len(bounds) > 1 else ("0", bounds[0])
                if len(bounds) > 2 and not self._rises(arguments[2]):
                    raise self.refuse(node, "a range with a step that is no rising number or name")
                step = bounds[2] if len(bounds) > 2 else "1"
                return f"let {i} = {start}, end_{i} = {stop}; {i} < end_{i}; {i} += {step}"
        raise self.refuse(node, "for over anything but a range or a tuple of numbers")

    def _rises(self, step: ast.expr) -> bool:
        return isinstance(step, ast.Name) or (
            isinstance(step, ast.Constant) and isinstance(step.value, int) and step.value > 0
        )

    # -- expressions

    def _truth(self, node: ast.expr) -> str:
        """Condition; a number is compared with zero, because NaN is true in Python and false in JavaScript."""
        if isinstance(node, ast.BinOp | ast.Subscript):
            return f"({self._write(node)} !== 0)"
        if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
            raise self.refuse(node, "a number as a condition")
        return self._write(node)

    def _write(self, node: ast.expr) -> str:
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                return literal(value)
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return f"({self._write(left)} {_BINARY[type(op)]} {self._write(right)})"
            case ast.BinOp(left=left, op=ast.FloorDiv(), right=right):
                return f"Math.floor({self._write(left)} / {self._write(right)})"
            case ast.BinOp(left=left, op=ast.Mod(), right=right):
                return f"modulo({self._write(left)}, {self._write(right)})"
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"(-{self._write(operand)})"
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"(!{self._truth(operand)})"
            case ast.BoolOp(op=op, values=values):
                return "(" + (" && " if isinstance(op, ast.And) else " || ").join(map(self._truth, values)) + ")"
            case ast.Compare():
                return self._comparison(node)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return f"({self._truth(test)} ? {self._write(body)} : {self._write(orelse)})"
            case ast.Tuple(elts=elements, ctx=ast.Load()):
                return f"[{', '.join(map(self._write, elements))}]"
            case ast.Subscript(
                value=ast.Attribute(value=array, attr="shape"), slice=ast.Constant(value=int() as place)
            ):
                return f"{self._write(array)}{'.length' if place == 0 else f'.shape[{place}]'}"
            case ast.Subscript(value=array, slice=index):
                places = index.elts if isinstance(index, ast.Tuple) else [index]
                return self._write(array) + "".join(f"[{self._place(one)}]" for one in places)
            case ast.Attribute(value=ast.Name(id="math"), attr=attr) if attr in _MATH_NUMBERS:
                return _MATH_NUMBERS[attr]
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self._call(node, function, arguments)
        raise self.refuse(node, type(node).__name__)

    def _place(self, node: ast.expr) -> str:
        if isinstance(node, ast.UnaryOp | ast.Slice):
            raise self.refuse(node, "an index that counts from the end, or a slice,")
        return self._write(node)

    def _name(self, node: ast.expr, name: str) -> str:
        if name in self.local:
            return name
        if name in self.numbers:
            return literal(self.numbers[name])
        raise self.refuse(node, f"the name {name}")

    def _comparison(self, node: ast.Compare) -> str:
        if any(isinstance(one, ast.Call) for middle in node.comparators[:-1] for one in ast.walk(middle)):
            raise self.refuse(node, "a call between two comparisons")
        parts, left = [], node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            if type(op) not in _COMPARE:
                raise self.refuse(node, type(op).__name__)
            parts.append(f"{self._write(left)} {_COMPARE[type(op)]} {self._write(right)}")
            left = right
        return "(" + " && ".join(parts) + ")"

    def _call(self, node: ast.Call, function: ast.expr, given: list[ast.expr]) -> str:
        arguments = [self._write(one) for one in given]
        match function:
            case ast.Name(id="call"):
                return f"{arguments[0]}({', '.join(arguments[1:])})"
            case ast.Name(id=name) if name in self.functions:
                return f"{name}({', '.join(arguments)})"
            case ast.Name(id=name) if name in _BUILTIN and len(arguments) == _BUILTIN[name][1]:
                return f"{_BUILTIN[name][0]}({', '.join(arguments)})"
            case ast.Attribute(value=ast.Name(id="math"), attr=attr) if attr in _MATH:
                return f"{_MATH[attr]}({', '.join(arguments)})"
            case ast.Attribute(value=ast.Name(id="np"), attr="zeros" | "empty") if len(given) == 1:
                shape = given[0]
                sizes = [self._write(one) for one in shape.elts] if isinstance(shape, ast.Tuple) else arguments
                return f"zeros({', '.join(sizes)})"
        raise self.refuse(node, f"a call of {ast.unparse(function)} with {len(given)} arguments")


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _names(nodes: list[ast.expr]) -> set[str]:
    """All names that occur in expressions."""
    return {one.id for node in nodes for one in ast.walk(node) if isinstance(one, ast.Name)}


def _inside(loop: ast.For) -> list[Any]:
    return [one for statement in loop.body for one in ast.walk(statement)]


def _set_otherwise(function: ast.FunctionDef) -> set[str]:
    """Names that are assigned outside heads of loops."""
    heads = {id(one.target) for one in ast.walk(function) if isinstance(one, ast.For)}
    names = (one for one in ast.walk(function) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store))
    return {one.id for one in names if id(one) not in heads}
