"""Access to NumPy arrays from LLVM assembly, by the memory layout of their objects.

The offsets are part of NumPy's binary interface (``PyArrayObject``, ``PyArray_Descr``), on which extension modules
rely.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from steadyslip.kernels.printers.native.lines import MEMORY, ArrayView, Lines, Operand, Scalar, Type

HEAD = object.__basicsize__  # bytes of the head of every Python object
DATA, INDICES, SIZES, DESCRIPTOR, FLAGS = HEAD, HEAD + 8, HEAD + 16, HEAD + 40, HEAD + 48
ORDER, NUMBER = HEAD + 10, HEAD + 12  # offsets in a dtype: byte order, type number
USABLE = 0x1 | 0x100 | 0x400  # flags: contiguous, aligned, writeable
SWAPPED = ord(">" if sys.byteorder == "little" else "<")
ELEMENTS = {"real": np.dtype(np.float64), "int": np.dtype(np.int64)}


def argument(text: str) -> tuple[str, int]:
    """Kind and number of indices of a declared type like ``real[:,:]`` or ``int``."""
    kind, _, rest = text.partition("[")
    return kind, rest.count(":")


def entry(symbol: str, called: tuple[str, str], types: Sequence[str], constant: int, opaque: bool) -> list[str]:
    """Assembly of a function that Python calls with arrays and integers; it checks them and calls another function.

    Parameters
    ----------
    symbol : str
        Symbol of the new function.
    called : tuple of str
        Symbol of the called function, and kind of its result: ``int`` or ``none``.
    types : sequence of str
        Types of the arguments.
    constant : int
        Number of leading arguments whose arrays never change.
    opaque : bool
        As in `Lines`.

    Returns
    -------
    list of str
        Lines. The new function returns the result of the called one (which must be >= 0; 0 for none), or -1 - i if
        argument i does not have its declared type.
    """
    body, given = Lines(opaque), list[Operand]()
    for i, text in enumerate(types):
        kind, count = argument(text)
        given.append(_array(body, i, kind, count, i < constant) if count else Scalar(kind, f"%a{i}"))
    found = body.call(called[0], called[1], given)
    body.add(f"ret i64 {found.text or 0}")
    heads = ", ".join(f"i64 %a{i}" for i in range(len(types)))
    return [f"define i64 {symbol}({heads}) nounwind {{", "entry:", *body.lines, "}"]


def types_of(types: Sequence[str], constant: int) -> tuple[Type, ...]:
    """Types of the arguments inside a translated function."""
    declared = [argument(text) for text in types]
    return tuple(ArrayView(kind, "", ("",) * count, i < constant).type if count else kind
                 for i, (kind, count) in enumerate(declared))  # fmt: skip


def _array(body: Lines, place: int, kind: str, count: int, is_constant: bool) -> ArrayView:
    """View of the array whose address is an argument; the written code returns early if its type is not as declared."""

    def at(address: str, offset: int, what: str) -> str:
        moved = body.name(f"add i64 {address}, {offset}")
        pointer = body.name(f"inttoptr i64 {moved} to {body.pointer(what)}")
        return body.name(f"load {what}, {body.pointer(what)} {pointer}")

    def check(condition: str) -> None:
        good = body.label("good")
        body.fork(condition, good, f"bad{place}")
        body.begin(good)

    owner = f"%a{place}"
    check(body.name(f"icmp eq i32 {at(owner, INDICES, 'i32')}, {count}"))
    usable = body.name(f"and i32 {at(owner, FLAGS, 'i32')}, {USABLE}")
    check(body.name(f"icmp eq i32 {usable}, {USABLE}"))
    descriptor = at(owner, DESCRIPTOR, "i64")
    check(body.name(f"icmp eq i32 {at(descriptor, NUMBER, 'i32')}, {ELEMENTS[kind].num}"))
    check(body.name(f"icmp ne i8 {at(descriptor, ORDER, 'i8')}, {SWAPPED}"))
    good = body.label("good")
    body.jump(good)
    body.begin(f"bad{place}")
    body.add(f"ret i64 {-1 - place}")
    body.begin(good)
    pointer = body.name(f"inttoptr i64 {at(owner, DATA, 'i64')} to {body.pointer(kind)}")
    sizes = at(owner, SIZES, "i64")
    return ArrayView(kind, pointer, tuple(at(sizes, 8 * i, "i64") for i in range(count)), is_constant)


def new_array(body: Lines, sizes: Sequence[str], slot: str) -> ArrayView:
    """Append instructions that allocate an array of zeros and store its address in `slot`.

    Returns a view of the array.
    """
    total = sizes[0]
    for size in sizes[1:]:
        total = body.name(f"mul nsw i64 {total}, {size}")
    pointer = body.pointer("real")
    found = body.name(f"call {pointer} @{MEMORY[0]}(i64 {total}, i64 8)")
    body.add(f"store {pointer} {found}, {body.pointer(pointer)} {slot}")
    return ArrayView("real", found, tuple(sizes))


def free_array(body: Lines, slot: str) -> None:
    """Append instructions that free an array which `new_array` has allocated."""
    pointer = body.pointer("real")
    found = body.name(f"load {pointer}, {body.pointer(pointer)} {slot}")
    body.add(f"call void @{MEMORY[1]}({pointer} {found})")
