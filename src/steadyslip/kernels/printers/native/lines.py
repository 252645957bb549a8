"""Lines of LLVM assembly: typed values and operations on them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

_FAST = "nsz contract"  # the compiler may ignore the sign of zero, and fuse multiplications with additions
TEXT = {"real": "double", "int": "i64", "bool": "i1", "none": "void"}
MEMORY = ("PyMem_RawCalloc", "PyMem_RawFree")
"""Functions of the Python C API for allocation; their addresses are given to LLVM for linking."""


@dataclass(frozen=True)
class Scalar:
    """A scalar value: its kind (``real``, ``int``, ``bool``; ``none`` for no value) and its text in the assembly."""

    kind: str
    text: str

    @property
    def type(self) -> Type:
        return self.kind


@dataclass(frozen=True)
class ArrayView:
    """An array: kind of its elements, pointer to the first, size along each index, True if elements never change."""

    kind: str
    pointer: str
    sizes: tuple[str, ...]
    is_constant: bool = False

    @property
    def type(self) -> Type:
        return f"{'constant ' if self.is_constant else ''}{self.kind}[{','.join(':' * len(self.sizes))}]"


@dataclass(frozen=True)
class TupleValue:
    """Tuple of values, addressed by index."""

    values: tuple[Operand, ...]

    @property
    def type(self) -> Type:
        return tuple(value.type for value in self.values)


Type = str | tuple["Type", ...]
Operand = Scalar | ArrayView | TupleValue


def real(number: float) -> Scalar:
    """Literal of a real number in assembly."""
    return Scalar("real", "0x" + struct.pack(">d", number).hex().upper())


class Lines:
    """Lines of assembly of one function, with methods that append instructions and make unused names.

    Parameters
    ----------
    opaque : bool
        True if pointers have no element type, as in LLVM from version 17 on.
    """

    def __init__(self, opaque: bool) -> None:
        self.opaque = opaque
        self.lines: list[str] = []
        self.heads: list[str] = []
        self.count = 0

    def pointer(self, kind: str) -> str:
        """Assembly type of a pointer to a kind (``real``, ``int``, ``bool``) or to an assembly type."""
        return "ptr" if self.opaque else f"{TEXT.get(kind, kind)}*"

    def add(self, line: str) -> None:
        self.lines.append(f"  {line}")

    def name(self, line: str) -> str:
        """Append an instruction; returns the new name of its result."""
        self.count += 1
        self.add(f"%t{self.count} = {line}")
        return f"%t{self.count}"

    def label(self, what: str) -> str:
        """New label that begins with the given text."""
        self.count += 1
        return f"{what}{self.count}"

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")

    def fork(self, condition: str, yes: str, no: str) -> None:
        self.add(f"br i1 {condition}, label %{yes}, label %{no}")

    def jump(self, label: str) -> None:
        self.add(f"br label %{label}")

    # -- variables

    def slot(self, kind: str) -> str:
        """Name of a new stack slot for a value of a kind, allocated at the start of the function."""
        self.count += 1
        self.heads.append(f"  %r{self.count} = alloca {TEXT.get(kind, kind)}")
        return f"%r{self.count}"

    def put(self, value: Scalar, slot: str) -> None:
        kind = TEXT.get(value.kind, value.kind)
        self.add(f"store {kind} {value.text}, {self.pointer(value.kind)} {slot}")

    def get(self, kind: str, slot: str) -> Scalar:
        return Scalar(kind, self.name(f"load {TEXT.get(kind, kind)}, {self.pointer(kind)} {slot}"))

    # -- arrays

    def place(self, array: ArrayView, indices: Sequence[str]) -> str:
        """Name of a pointer to an element, or with fewer indices to the first element of a view."""
        offset = ""
        for i, size in enumerate(array.sizes):
            if offset and offset != "0":
                offset = self.name(f"mul nsw i64 {offset}, {size}")
            if i < len(indices):
                offset = self.name(f"add nsw i64 {offset}, {indices[i]}") if offset else indices[i]
        kind = TEXT[array.kind]
        return self.name(f"getelementptr inbounds {kind}, {self.pointer(array.kind)} {array.pointer}, i64 {offset}")

    def element(self, array: ArrayView, indices: Sequence[str]) -> Scalar:
        pointer = self.place(array, indices)
        constant = ", !invariant.load !0" if array.is_constant else ""
        return Scalar(array.kind, self.name(f"load {TEXT[array.kind]}, {self.pointer(array.kind)} {pointer}{constant}"))

    # -- calls

    def flat(self, value: Operand) -> list[tuple[str, str]]:
        """Assembly types and names of the parts of a value, as passed in a call."""
        if isinstance(value, Scalar):
            return [(TEXT[value.kind], value.text)]
        if isinstance(value, ArrayView):
            return [(self.pointer(value.kind), value.pointer), *(("i64", size) for size in value.sizes)]
        return [one for part in value.values for one in self.flat(part)]

    def call(self, symbol: str, result: str, given: Sequence[Operand]) -> Scalar:
        """Append a call of a function; returns its result, of the kind `result`."""
        arguments = ", ".join(f"{kind} {text}" for kind, text in self.flat(TupleValue(tuple(given))))
        line = f"call {TEXT[result]} {symbol}({arguments})"
        if result == "none":
            self.add(line)
            return Scalar("none", "")
        return Scalar(result, self.name(line))

    # -- numbers

    def converted(self, value: Scalar, kind: str) -> Scalar | None:
        """Value converted to another kind; None if that is not possible."""
        if value.kind == kind:
            return value
        if value.kind == "int" and kind == "real" and value.text.lstrip("-").isdigit():
            return real(float(value.text))
        line = {
            ("int", "real"): "sitofp i64 {} to double", ("bool", "real"): "uitofp i1 {} to double",
            ("bool", "int"): "zext i1 {} to i64",
        }.get((value.kind, kind))  # fmt: skip
        return None if line is None else Scalar(kind, self.name(line.format(value.text)))

    def arithmetic(self, op: str, kind: str, left: str, right: str) -> Scalar:
        line = f"f{op} {_FAST} double" if kind == "real" else f"{op} i64"
        return Scalar(kind, self.name(f"{line} {left}, {right}"))

    def compared(self, how: tuple[str, str], kind: str, left: str, right: str) -> Scalar:
        """Result of a comparison; `how` has its names in LLVM for real numbers and for integers."""
        line = f"fcmp {how[0]} double" if kind == "real" else f"icmp {how[1]} {TEXT[kind]}"
        return Scalar("bool", self.name(f"{line} {left}, {right}"))

    def divided(self, left: str, right: str) -> tuple[Scalar, Scalar]:
        """Integer quotient (rounded down) and remainder (with the divisor's sign), as in Python."""
        quotient, rest = self.name(f"sdiv i64 {left}, {right}"), self.name(f"srem i64 {left}, {right}")
        signs = self.name(f"xor i64 {rest}, {right}")
        apart, inexact = self.name(f"icmp slt i64 {signs}, 0"), self.name(f"icmp ne i64 {rest}, 0")
        less = self.name(f"and i1 {apart}, {inexact}")
        down, more = self.name(f"sext i1 {less} to i64"), self.name(f"select i1 {less}, i64 {right}, i64 0")
        found = (self.name(f"add i64 {quotient}, {down}"), self.name(f"add i64 {rest}, {more}"))
        return Scalar("int", found[0]), Scalar("int", found[1])

    def chosen(self, condition: str, yes: Scalar, no: Scalar) -> Scalar:
        kind = TEXT[yes.kind]
        return Scalar(yes.kind, self.name(f"select i1 {condition}, {kind} {yes.text}, {kind} {no.text}"))
