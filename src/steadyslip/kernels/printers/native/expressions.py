"""Translation of the driver's expressions and variables to LLVM assembly."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from steadyslip.core.errors import NotAvailable
from steadyslip.kernels.printers.native import arrays
from steadyslip.kernels.printers.native.lines import TEXT, ArrayView, Lines, Operand, Scalar, TupleValue, Type, real

ANNOTATED = {"float": "real", "int": "int", "bool": "bool", "None": "none"}
_ARITHMETIC: dict[type, str] = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
_COMPARE: dict[type, tuple[str, str]] = {
    ast.Lt: ("olt", "slt"), ast.LtE: ("ole", "sle"), ast.Gt: ("ogt", "sgt"), ast.GtE: ("oge", "sge"),
    ast.Eq: ("oeq", "eq"), ast.NotEq: ("une", "ne"),
}  # fmt: skip
_MATH = {"nan": math.nan, "inf": math.inf}


class Others(Protocol):
    """Access of one function's translator to the other functions."""

    opaque: bool
    functions: dict[str, tuple[ast.FunctionDef, str]]

    def called(self, name: str, types: tuple[Type, ...]) -> tuple[str, str]: ...


@dataclass(frozen=True)
class _Variable:
    """Type of a variable, and a stack slot for each part of its value."""

    type: Type
    slots: tuple[str, ...]


class Expressions:
    """Translator of the expressions of one function.

    Parameters
    ----------
    others : Others
        Access to the other functions.
    module : str
        Module of the function, for messages.
    numbers : mapping of str to float
        Module constants that the function may use.
    """

    def __init__(self, others: Others, module: str, numbers: Mapping[str, float]) -> None:
        self.others, self.module, self.numbers = others, module, numbers
        self.lines = Lines(others.opaque)
        self.variables: dict[str, _Variable] = {}
        self.tuples: dict[str, TupleValue] = {}
        self.loops: list[tuple[str, str]] = []  # labels to which continue and break jump, innermost loop last
        self.arrays_made: list[str] = []  # stack slots with the addresses of arrays that the function allocates
        self.choices = 0

    def refuse(self, node: ast.AST, what: str) -> NotAvailable:
        """NotAvailable error for unsupported syntax (`what`), with its module and line."""
        return NotAvailable(
            f"{self.module}, line {getattr(node, 'lineno', '?')}: {what} cannot be translated; drivers may use "
            "numbers, arrays that are indexed, functions with positional arguments, for over range, while and if"
        )

    # -- names

    def _assign(self, node: ast.AST, name: str, value: Operand) -> None:
        """Assign a value to a variable."""
        if isinstance(value, TupleValue):
            raise self.refuse(node, f"another value for {name}")
        known = self.variables.get(name)
        if known is None:
            kinds = [kind for kind, _ in self.lines.flat(value)]
            known = self.variables[name] = _Variable(value.type, tuple(map(self.lines.slot, kinds)))
        if isinstance(value, Scalar):
            value = self._as(node, value, str(known.type))
        elif value.type != known.type:
            raise self.refuse(node, f"an array in place of another kind of {name}")
        for (kind, text), slot in zip(self.lines.flat(value), known.slots, strict=True):
            self.lines.add(f"store {kind} {text}, {self.lines.pointer(kind)} {slot}")

    def _held(self, node: ast.AST, name: str) -> Operand:
        """Value of a variable or constant."""
        if name in self.tuples:
            return self.tuples[name]
        if name in self.variables:
            return self._kept(self.variables[name])
        if name in self.numbers:
            return self._number(self.numbers[name])
        raise self.refuse(node, f"the name {name}")

    def _kept(self, variable: _Variable) -> Operand:
        type_ = str(variable.type)
        kind, count = arrays.argument(type_.removeprefix("constant "))
        kinds = [self.lines.pointer(kind), *["i64"] * count] if "[" in type_ else [TEXT[kind]]
        names = [
            self.lines.name(f"load {one}, {self.lines.pointer(one)} {slot}")
            for one, slot in zip(kinds, variable.slots, strict=True)
        ]
        if "[" in type_:
            return ArrayView(kind, names[0], tuple(names[1:]), type_.startswith("constant "))
        return Scalar(kind, names[0])

    def _number(self, value: float) -> Scalar:
        if isinstance(value, bool):
            return Scalar("bool", str(value).lower())
        return real(value) if isinstance(value, float) else Scalar("int", str(int(value)))

    def _as(self, node: ast.AST, value: Operand, kind: str) -> Scalar:
        """Value converted to a `kind` (real, int, bool); an error is raised if that is not possible."""
        found = self.lines.converted(value, kind) if isinstance(value, Scalar) else None
        if found is None:
            raise self.refuse(node, f"{ast.unparse(node) if isinstance(node, ast.expr) else 'what it gets'} as {kind}")
        return found

    def _branches(self, test: ast.expr, yes: Callable[[], None], no: Callable[[], None]) -> None:
        """Append an if statement; `yes` and `no` are functions that append its branches."""
        lines = self.lines
        then, other, done = lines.label("then"), lines.label("else"), lines.label("done")
        lines.fork(self._truth(test), then, other)
        for label, written in ((then, yes), (other, no)):
            lines.begin(label)
            written()
            lines.jump(done)
        lines.begin(done)

    # -- expressions

    def _truth(self, node: ast.expr) -> str:
        """Assembly name of a condition; a number is compared with zero."""
        value = self._value(node)
        if not isinstance(value, Scalar) or value.kind == "none":
            raise self.refuse(node, "a condition that is not a number or bool")
        if value.kind == "bool":
            return value.text
        zero = real(0.0).text if value.kind == "real" else "0"
        return self.lines.compared(_COMPARE[ast.NotEq], value.kind, value.text, zero).text

    def _value(self, node: ast.expr) -> Operand:
        match node:
            case ast.Constant(value=bool() | int() | float() as number):
                return self._number(number)
            case ast.Name(id=name):
                return self._held(node, name)
            case ast.Tuple(elts=parts):
                return TupleValue(tuple(map(self._value, parts)))
            case ast.BinOp(left=left, op=op, right=right):
                return self._arithmetic(node, op, left, right)
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as number)):
                return self._number(-number)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                value = self._numeric(operand)
                zero = "0" if value.kind == "int" else real(-0.0).text
                return self.lines.arithmetic("sub", value.kind, zero, value.text)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Scalar("bool", self.lines.name(f"xor i1 {self._truth(operand)}, true"))
            case ast.BoolOp(op=op, values=values):
                return self._connected(isinstance(op, ast.And), values)
            case ast.Compare():
                return self._comparison(node)
            case ast.IfExp(test=test, body=yes, orelse=no):
                return self._either(test, yes, no)
            case ast.Subscript(value=ast.Attribute(value=owner, attr="shape"), slice=ast.Constant(value=int() as i)):
                return Scalar("int", self._array_of(owner).sizes[i])
            case ast.Subscript(value=owner, slice=index):
                return self._indexed(node, owner, index)
            case ast.Attribute(value=ast.Name(id="math"), attr=attr) if attr in _MATH:
                return real(_MATH[attr])
            case ast.Call(func=function, args=given, keywords=[]):
                return self._call(node, function, given)
        raise self.refuse(node, type(node).__name__)

    def _numeric(self, node: ast.expr) -> Scalar:
        value = self._value(node)
        if not isinstance(value, Scalar) or value.kind not in ("real", "int"):
            raise self.refuse(node, f"{ast.unparse(node)} as a number")
        return value

    def _whole_number(self, node: ast.expr) -> str:
        return self._as(node, self._value(node), "int").text

    def _array_of(self, node: ast.expr) -> ArrayView:
        value = self._value(node)
        if not isinstance(value, ArrayView):
            raise self.refuse(node, f"{ast.unparse(node)} as an array")
        return value

    def _places(self, index: ast.expr) -> list[str]:
        nodes = index.elts if isinstance(index, ast.Tuple) else [index]
        for one in nodes:
            if isinstance(one, ast.UnaryOp | ast.Slice):
                raise self.refuse(one, "an index that counts from the end, or a slice,")
        return [self._whole_number(one) for one in nodes]

    def _indexed(self, node: ast.expr, owner: ast.expr, index: ast.expr) -> Operand:
        """Element or view of an array, or one value of a tuple."""
        found = self._value(owner)
        if isinstance(found, TupleValue) and isinstance(index, ast.Constant) and isinstance(index.value, int):
            return found.values[index.value]
        if not isinstance(found, ArrayView):
            raise self.refuse(node, f"an index of {ast.unparse(owner)}")
        places = self._places(index)
        if len(places) == len(found.sizes):
            return self.lines.element(found, places)
        if len(places) > len(found.sizes):
            raise self.refuse(node, "more indices than an array has")
        return ArrayView(found.kind, self.lines.place(found, places), found.sizes[len(places) :], found.is_constant)

    def _pair(self, left: ast.expr, right: ast.expr) -> tuple[Scalar, Scalar]:
        """Both operands, converted to a common kind (real or int)."""
        a, b = self._numeric(left), self._numeric(right)
        kind = "real" if "real" in (a.kind, b.kind) else "int"
        return self._as(left, a, kind), self._as(right, b, kind)

    def _arithmetic(self, node: ast.AST, op: ast.operator, left: ast.expr, right: ast.expr) -> Scalar:
        a, b = self._pair(left, right)
        if type(op) in _ARITHMETIC:
            if isinstance(op, ast.Div):
                a, b = self._as(left, a, "real"), self._as(right, b, "real")
            return self.lines.arithmetic(_ARITHMETIC[type(op)], a.kind, a.text, b.text)
        if isinstance(op, ast.Pow) and a.kind == "real":
            return self.lines.call("@llvm.pow.f64", "real", [a, b])
        if isinstance(op, ast.FloorDiv | ast.Mod) and a.kind == "int":
            return self.lines.divided(a.text, b.text)[isinstance(op, ast.Mod)]
        raise self.refuse(node, f"{type(op).__name__} of {a.kind}")

    def _comparison(self, node: ast.Compare) -> Scalar:
        found, left = "", self._value(node.left)
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            right = self._value(right_node)
            if type(op) not in _COMPARE or not isinstance(left, Scalar) or not isinstance(right, Scalar):
                raise self.refuse(node, ast.unparse(node))
            kind = next((one for one in ("real", "int") if one in (left.kind, right.kind)), "bool")
            a, b = self._as(node.left, left, kind), self._as(right_node, right, kind)
            truth = self.lines.compared(_COMPARE[type(op)], kind, a.text, b.text).text
            found = self.lines.name(f"and i1 {found}, {truth}") if found else truth
            left = right
        return Scalar("bool", found)

    def _connected(self, all_of_them: bool, values: Sequence[ast.expr]) -> Scalar:
        """Result of ``and`` or ``or``; later operands are evaluated only if needed."""
        lines = self.lines
        slot, done = lines.slot("bool"), lines.label("done")
        for i, one in enumerate(values):
            truth = self._truth(one)
            lines.put(Scalar("bool", truth), slot)
            if i < len(values) - 1:
                further = lines.label("further")
                lines.fork(truth, *((further, done) if all_of_them else (done, further)))
                lines.begin(further)
        lines.jump(done)
        lines.begin(done)
        return lines.get("bool", slot)

    def _either(self, test: ast.expr, yes: ast.expr, no: ast.expr) -> Operand:
        """Result of a conditional expression; only the chosen value is evaluated."""
        self.choices += 1
        name = f"either {self.choices}"  # has a space, so that it differs from all Python names
        mixed = {"real", "int"} == {self._type(yes), self._type(no)}

        def written(node: ast.expr) -> None:
            value = self._value(node)
            self._assign(node, name, self._as(node, value, "real") if mixed else value)

        self._branches(test, lambda: written(yes), lambda: written(no))
        return self._held(test, name)

    def _type(self, node: ast.expr) -> Type:
        """Type of an expression, found by translating it and discarding the lines."""
        lines, made, known = self.lines, list(self.arrays_made), dict(self.variables)
        self.lines = Lines(self.others.opaque)
        try:
            return self._value(node).type
        finally:
            self.lines, self.arrays_made, self.variables = lines, made, known

    def _call(self, node: ast.expr, function: ast.expr, given: Sequence[ast.expr]) -> Operand:
        match function:
            case ast.Name(id="call"):
                return self._routine(given)
            case ast.Name(id=name) if name in self.others.functions:
                return self._function(node, name, given)
            case ast.Name(id="abs") if len(given) == 1:
                return self.lines.call("@llvm.fabs.f64", "real", [self._as(given[0], self._value(given[0]), "real")])
            case ast.Name(id="min" | "max" as name) if len(given) == 2:
                a, b = self._pair(*given)
                how = _COMPARE[ast.Lt if name == "min" else ast.Gt]
                return self.lines.chosen(self.lines.compared(how, a.kind, b.text, a.text).text, b, a)
            case ast.Name(id="int") if len(given) == 1:
                value = self._numeric(given[0])
                towards_zero = f"fptosi double {value.text} to i64"
                return value if value.kind == "int" else Scalar("int", self.lines.name(towards_zero))
            case ast.Name(id="float") if len(given) == 1:
                return self._as(given[0], self._value(given[0]), "real")
            case ast.Attribute(value=ast.Name(id="math"), attr="log") if len(given) == 1:
                return self.lines.call("@llvm.log.f64", "real", [self._as(given[0], self._value(given[0]), "real")])
            case ast.Attribute(value=ast.Name(id="math"), attr="isfinite") if len(given) == 1:
                value = self._as(given[0], self._value(given[0]), "real")
                size = self.lines.call("@llvm.fabs.f64", "real", [value]).text
                return self.lines.compared(_COMPARE[ast.Lt], "real", size, real(math.inf).text)
            case ast.Attribute(value=ast.Name(id="np"), attr="zeros" | "empty") if len(given) == 1:
                return self._new(node, given[0])
        raise self.refuse(node, f"a call of {ast.unparse(function)} with {len(given)} arguments")

    def _new(self, node: ast.expr, shape: ast.expr) -> ArrayView:
        if self.loops:
            raise self.refuse(node, "an array that is made in a loop")
        sizes = [self._whole_number(one) for one in (shape.elts if isinstance(shape, ast.Tuple) else [shape])]
        self.arrays_made.append(self.lines.slot(self.lines.pointer("real")))
        return arrays.new_array(self.lines, sizes, self.arrays_made[-1])

    def _function(self, node: ast.expr, name: str, given: Sequence[ast.expr]) -> Operand:
        """Result of a call of another compiled function; arguments are converted to the types in its annotations."""
        heads = self.others.functions[name][0].args.args
        if len(heads) != len(given):
            raise self.refuse(node, f"a call of {name} with {len(given)} arguments")
        values: list[Operand] = []
        for head, one in zip(heads, given, strict=True):
            value = self._value(one)
            kind = ANNOTATED.get(ast.unparse(head.annotation) if head.annotation else "")
            values.append(self._as(one, value, kind) if kind else value)
        symbol, result = self.others.called(name, tuple(value.type for value in values))
        return self.lines.call(symbol, result, values)

    def _routine(self, given: Sequence[ast.expr]) -> Scalar:
        """Append a call of a model's routine by its address; the call has no result."""
        lines, array = self.lines, self.lines.pointer("real")
        record, changed = self._array_of(given[1]), self._array_of(given[3])
        number = self._as(given[2], self._value(given[2]), "real")
        kind = f"void ({array}, double, {array})"
        routine = lines.name(f"inttoptr i64 {self._whole_number(given[0])} to {'ptr' if lines.opaque else kind + '*'}")
        lines.add(f"call void {routine}({array} {record.pointer}, double {number.text}, {array} {changed.pointer})")
        return Scalar("none", "")
