"""Translation of the driver's modules to LLVM assembly: the same subset of Python as for `transpile`, with types.

A variable keeps the type of its first assignment: number, bool, array, or tuple of these. Arguments and results have
their annotated types; arrays are contiguous, with the element kind and number of indices that the caller passes. An
array with fewer indices than dimensions is a view. Arrays that a function allocates are freed at its end. Any other
Python raises an error with module and line.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from importlib import import_module

from steadyslip.kernels.driver_text import numbered
from steadyslip.kernels.printers.native import arrays
from steadyslip.kernels.printers.native.expressions import ANNOTATED, Expressions
from steadyslip.kernels.printers.native.lines import MEMORY, TEXT, ArrayView, Lines, Operand, Scalar, TupleValue, Type


def translated(
    modules: Mapping[str, str], entries: Mapping[str, Sequence[str]], symbols: Mapping[str, str], constant: int,
    opaque: bool,
) -> str:  # fmt: skip
    """Assembly of the functions of some modules that Python calls, and of all functions that these call.

    Parameters
    ----------
    modules : mapping of str to str
        Source of each module.
    entries : mapping of str to sequence of str
        Functions called from Python: types of their arguments, ``int``, or ``real[:,:]`` for an array.
    symbols : mapping of str to str
        Symbol of each function.
    constant : int
        Number of leading arguments of each function that are arrays whose elements never change.
    opaque : bool
        True if pointers of this LLVM have no element type.

    Raises
    ------
    NotAvailable
        If a module uses Python outside the subset; module and line are named.
    """
    whole = _Whole(modules, opaque)
    lines: list[str] = []
    for name, types in entries.items():
        called = whole.called(name, arrays.types_of(types, constant))
        lines += arrays.entry(f"@{symbols[name]}", called, types, constant, opaque)
    while whole.wanted:
        lines += whole.wanted.pop().written()
    array = Lines(opaque).pointer("real")
    return "\n".join(
        [
            *lines,
            *(f"declare double @llvm.{name}.f64(double)" for name in ("fabs", "log")),
            "declare double @llvm.pow.f64(double, double)",
            f"declare noalias {array} @{MEMORY[0]}(i64, i64)",
            f"declare void @{MEMORY[1]}({array})",
            "!0 = !{}",
            "",
        ]
    )


class _Whole:
    """Registry of the translated functions; each is translated once per combination of argument types."""

    def __init__(self, modules: Mapping[str, str], opaque: bool) -> None:
        self.opaque = opaque
        self.functions: dict[str, tuple[ast.FunctionDef, str]] = {}
        self.numbers: dict[str, dict[str, float]] = {}
        self.known: dict[tuple[str, Type], tuple[str, str]] = {}
        self.wanted: list[_Function] = []
        for module, text in modules.items():
            known = vars(import_module(module)) if module.startswith("steadyslip.") else {}
            self.numbers[module] = {key: value for key, value in known.items() if type(value) in (int, float)}
            for node in numbered(text).body:
                if isinstance(node, ast.FunctionDef):
                    self.functions[node.name] = (node, module)

    def called(self, name: str, types: tuple[Type, ...]) -> tuple[str, str]:
        """Symbol of a function for given argument types, and kind of its result; schedules its translation."""
        key = (name, types)
        if key not in self.known:
            node, module = self.functions[name]
            function = _Function(self, node, module, f"@{name}.{len(self.known)}", types)
            self.known[key] = (function.symbol, function.result)
            self.wanted.append(function)
        return self.known[key]


class _Function(Expressions):
    """Translator of one function for given argument types."""

    def __init__(self, whole: _Whole, node: ast.FunctionDef, module: str, symbol: str, types: tuple[Type, ...]) -> None:
        super().__init__(whole, module, whole.numbers[module])
        self.node, self.symbol, self.types = node, symbol, types
        given = node.args
        if any((node.decorator_list, given.defaults, given.kwonlyargs, given.posonlyargs, given.vararg, given.kwarg)):
            raise self.refuse(node, f"the head of {node.name}")
        self.result = ANNOTATED.get(ast.unparse(node.returns) if node.returns else "", "")
        if not self.result:
            raise self.refuse(node, f"the result of {node.name}")

    def written(self) -> list[str]:
        """Lines of assembly that define the function."""
        heads: list[str] = []
        for argument, type_ in zip(self.node.args.args, self.types, strict=True):
            value = self._received(type_, heads)
            if isinstance(value, TupleValue):
                self.tuples[argument.arg] = value
            else:
                self._assign(self.node, argument.arg, value)
        self._block(self.node.body)
        if self.result == "none":
            self._leave(self.node, None)
        else:
            self.lines.add("unreachable")
        empty = [f"  store {self._array} null, {self.lines.pointer(self._array)} {slot}" for slot in self.arrays_made]
        head = f"define internal {TEXT[self.result]} {self.symbol}({', '.join(heads)}) nounwind {{"
        return [head, "entry:", *self.lines.heads, *empty, *self.lines.lines, "}"]

    @property
    def _array(self) -> str:
        return self.lines.pointer("real")

    def _received(self, type_: Type, heads: list[str]) -> Operand:
        """Value of an argument inside the function; its declarations are appended to `heads`."""
        if not isinstance(type_, str):
            return TupleValue(tuple(self._received(one, heads) for one in type_))
        kind, count = arrays.argument(type_.removeprefix("constant "))
        value: Operand = Scalar(kind, f"%a{len(heads)}")
        if "[" in type_:
            names = [f"%a{len(heads) + i}" for i in range(count + 1)]
            value = ArrayView(kind, names[0], tuple(names[1:]), type_.startswith("constant "))
        heads += [f"{kind} {name}" for kind, name in self.lines.flat(value)]
        return value

    # -- statements

    def _block(self, body: Sequence[ast.stmt]) -> None:
        for node in body:
            self._statement(node)

    def _statement(self, node: ast.stmt) -> None:
        lines = self.lines
        match node:
            case ast.Assign(targets=targets, value=value):
                self._assigned(targets, value)
            case ast.AugAssign(target=target, op=op, value=value):
                left = ast.copy_location(ast.parse(ast.unparse(target), mode="eval").body, node)
                self._write(target, self._arithmetic(node, op, left, value))
            case ast.Expr(value=ast.Constant(value=str())):
                pass
            case ast.Expr(value=ast.Call() as call):
                self._value(call)
            case ast.Return(value=value):
                self._leave(node, value)
                lines.begin(lines.label("after"))
            case ast.Break() | ast.Continue() if self.loops:
                lines.jump(self.loops[-1][isinstance(node, ast.Break)])
                lines.begin(lines.label("after"))
            case ast.If(test=test, body=body, orelse=orelse):
                self._branches(test, lambda: self._block(body), lambda: self._block(orelse))
            case ast.While(test=test, body=body, orelse=[]):
                again, inside, done = lines.label("again"), lines.label("inside"), lines.label("done")
                lines.jump(again)
                lines.begin(again)
                lines.fork(self._truth(test), inside, done)
                lines.begin(inside)
                self._inside(body, again, done)
                lines.jump(again)
                lines.begin(done)
            case ast.For(target=ast.Name(id=name), iter=over, body=body, orelse=[]):
                self._loop(node, name, over, body)
            case _:
                raise self.refuse(node, type(node).__name__)

    def _inside(self, body: Sequence[ast.stmt], again: str, done: str) -> None:
        self.loops.append((again, done))
        self._block(body)
        self.loops.pop()

    def _loop(self, node: ast.For, name: str, over: ast.expr, body: Sequence[ast.stmt]) -> None:
        """Append a loop over a range; for a loop over a tuple of values, the body is appended once for each value."""
        lines = self.lines
        if isinstance(over, ast.Tuple):
            done = lines.label("done")
            for one in over.elts:
                self._assign(node, name, self._value(one))
                again = lines.label("again")
                self._inside(body, again, done)
                lines.jump(again)
                lines.begin(again)
            lines.jump(done)
            lines.begin(done)
            return
        if not (isinstance(over, ast.Call) and ast.unparse(over.func) == "range" and 0 < len(over.args) < 4):
            raise self.refuse(node, "for over anything but a range or a tuple of numbers")
        bounds = [self._whole_number(one) for one in over.args]
        start, stop = (bounds[0], bounds[1]) if len(bounds) > 1 else ("0", bounds[0])
        step = bounds[2] if len(bounds) > 2 else "1"
        if step.startswith("-"):
            raise self.refuse(node, "a range with a negative step")
        check, inside, again, done = (lines.label(what) for what in ("check", "inside", "again", "done"))
        count = lines.slot("int")
        lines.put(Scalar("int", start), count)
        lines.jump(check)
        lines.begin(check)
        i = lines.get("int", count)
        lines.fork(lines.compared(("", "slt"), "int", i.text, stop).text, inside, done)
        lines.begin(inside)
        self._assign(node, name, i)
        self._inside(body, again, done)
        lines.jump(again)
        lines.begin(again)
        lines.put(Scalar("int", lines.name(f"add nsw i64 {lines.get('int', count).text}, {step}")), count)
        lines.jump(check)
        lines.begin(done)

    def _assigned(self, targets: Sequence[ast.expr], value: ast.expr) -> None:
        """Append an assignment; all values of a tuple are computed before the first is stored."""
        match targets:
            case [ast.Tuple(elts=parts)]:
                found = self._value(value)
                if not isinstance(found, TupleValue) or len(found.values) != len(parts):
                    raise self.refuse(value, "unpacking of anything but a tuple of the same length")
                for part, one in zip(parts, found.values, strict=True):
                    self._write(part, one)
            case [ast.Name(id=name)] if isinstance(value, ast.Tuple):
                if name in self.tuples or name in self.variables or self.loops:
                    raise self.refuse(value, f"another value for {name}")
                found = self._value(value)
                self.tuples[name] = TupleValue(tuple(self._lasting(value, one) for one in _parts(found)))
            case _:
                found = self._value(value)
                for target in targets:
                    self._write(target, found)

    def _lasting(self, node: ast.AST, value: Operand) -> Operand:
        if isinstance(value, Scalar):
            raise self.refuse(node, "a number among several that are kept")
        return value

    def _write(self, target: ast.expr, value: Operand) -> None:
        match target:
            case ast.Name(id=name):
                self._assign(target, name, value)
            case ast.Subscript(value=owner, slice=index):
                array = self._array_of(owner)
                places = self._places(index)
                if len(places) != len(array.sizes) or array.is_constant:
                    raise self.refuse(target, "an assignment to more than one element")
                number = self._as(target, value, array.kind)
                self.lines.put(number, self.lines.place(array, places))
            case _:
                raise self.refuse(target, type(target).__name__)

    def _leave(self, node: ast.AST, value: ast.expr | None) -> None:
        found = Scalar("none", "") if value is None else self._value(value)
        if self.result != "none":
            found = self._as(value or node, found, self.result)
        elif value is not None:
            raise self.refuse(node, "a result")
        for slot in self.arrays_made:
            arrays.free_array(self.lines, slot)
        self.lines.add(f"ret {TEXT[self.result]} {found.text if isinstance(found, Scalar) else ''}".rstrip())


def _parts(value: Operand) -> tuple[Operand, ...]:
    return value.values if isinstance(value, TupleValue) else (value,)
