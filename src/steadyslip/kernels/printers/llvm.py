"""Programs as LLVM assembly: scalar code for one record, vector code for several lanes.

In a program for lanes each operation is written for several vectors (chains) in turn, because a single chain of
dependent operations would leave the processor idle for most of the time.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache

from steadyslip.kernels import primitives
from steadyslip.kernels.layout import GROUP
from steadyslip.kernels.nodes import PRIMITIVES, Loop, Node, Program, reachable

_FAST = "nsz contract"  # the compiler may ignore the sign of zero, and fuse multiplications with additions
_REAL = {"add": f"fadd {_FAST}", "sub": f"fsub {_FAST}", "mul": f"fmul {_FAST}", "div": f"fdiv {_FAST}"}
_WHOLE = {"add": "add", "sub": "sub", "mul": "mul", "and": "and", "or": "or", "shl": "shl", "shr": "ashr"}
_COMPARE = {"lt": ("olt", "slt"), "le": ("ole", "sle"), "gt": ("ogt", "sgt"), "ge": ("oge", "sge")}
_SCALAR = {"real": "double", "int": "i64", "bool": "i1"}
Lines = list[str]


def assembly(programs: Sequence[Program], lanes: int, names: dict[str, str], pointer: str) -> str:
    """LLVM assembly of a module with the given programs and the elementary functions that they use.

    Parameters
    ----------
    programs : sequence of Program
        Programs named ``step`` or ``...lanes`` process all lanes; programs named ``...group`` process `GROUP` lanes, of
        which the argument `number` is the first; others process one record.
    lanes : int
        One, or a multiple of `GROUP`.
    names : dict of str to str
        Symbol of each program.
    pointer : str
        Type of a pointer to a double in this version of LLVM.
    """
    text, used = [], set()
    for program in programs:
        if program.name == "step" or program.name.endswith("lanes"):
            writer = _Writer(lanes, pointer)
        else:
            together = program.name.endswith("group")
            writer = _Writer(GROUP if together else 1, pointer, chains=1, apart=lanes if together else 1)
        text.append(writer.function(program, names[program.name]))
        used |= writer.used
    for name, width in sorted(used):
        text.append(_primitive(name, width))
    widths = sorted({width for _, width in used} | {1, GROUP})
    text += [f"declare {_type('real', w)} @llvm.{f}.{_suffix(w)}({_type('real', w)})" for w in widths
             for f in ("fabs", "sqrt")]  # fmt: skip
    return "\n".join(text) + "\n"


def _type(kind: str, width: int) -> str:
    return _SCALAR[kind] if width == 1 else f"<{width} x {_SCALAR[kind]}>"


def _suffix(width: int) -> str:
    return "f64" if width == 1 else f"v{width}f64"


@lru_cache(maxsize=64)
def _primitive(name: str, width: int) -> str:
    """Definition, in assembly, of an elementary function for vectors of a width; LLVM inlines it."""
    arguments = [Node("argument", (i,)) for i in range(2 if name in ("power", "asinh_exp") else 1)]
    result = getattr(primitives, name)(*arguments)
    writer = _Writer(width, "", chains=1)
    for node in arguments:
        writer.values[node.order] = [f"%x{node.args[0]}"]
    writer.emit(reachable([result]))
    real = _type("real", width)
    head = ", ".join(f"{real} %x{i}" for i in range(len(arguments)))
    body = "\n".join(writer.lines)
    return (
        f"define internal {real} @{name}.{width}({head}) alwaysinline nounwind {{\nentry:\n{body}\n"
        f"  ret {real} {writer.values[result.order][0]}\n}}"
    )


class _Writer:
    """Assembly of one function, for `chains` vectors of `width` lanes."""

    def __init__(self, lanes: int, pointer: str, chains: int = 0, apart: int = 0) -> None:
        self.pointer = pointer
        self.apart = apart or lanes  # distance between two rows of one lane
        self.record = "R"
        self.width = lanes if chains else min(lanes, GROUP)
        self.chains = chains or lanes // self.width
        self.lines: Lines = []
        self.values: dict[int, list[str]] = {}
        self.used: set[tuple[str, int]] = set()
        self.block, self.count = "entry", 0

    def function(self, program: Program, symbol: str) -> str:
        """Definition of the whole function."""
        self.values[program.number.order] = ["%x"] * self.chains
        if self.apart > self.width * self.chains:  # processes a group of the lanes
            self.lines.append("  %first = fptosi double %x to i64")
            self.lines.append(f"  %G = getelementptr inbounds double, {self.pointer} %R, i64 %first")
            self.record = "G"
        self.emit(program.nodes())
        for array, place, node in program.stores:
            for chain in range(self.chains):
                address = self._address(array, place, chain)
                value = f"{_type('real', self.width)} {self.values[node.order][chain]}"
                self.lines.append(f"  store {value}, {self._vector()} {address}, align 8")
        body = "\n".join(self.lines)
        array = f"{self.pointer} noalias nocapture"
        head = f"define void @{symbol}({array} %R, double %x, {array} %y) nounwind"
        aligned = "" if self.width == 1 else f" alignstack({8 * GROUP})"  # saves a fifth of the time
        return f"{head}{aligned} {{\nentry:\n{body}\n  ret void\n}}"

    def emit(self, nodes: Sequence[Node], loop: Loop | None = None) -> None:
        """Write those of the nodes that belong to `loop`, or, if it is None, those outside loops."""
        for node in nodes:
            if node.order in self.values or node.loop is not loop:
                continue
            if node.op == "number":
                self.values[node.order] = [self._constant(node)] * self.chains
            elif node.op == "result":
                self._loop(node.args[0])
                source: Node = node.args[0].results[node.args[1]]
                self.values[node.order] = self.values[source.order]
            else:
                self.values[node.order] = [self._operation(node, chain) for chain in range(self.chains)]

    def _fresh(self, prefix: str = "v") -> str:
        self.count += 1
        return f"%{prefix}{self.count}"

    def _constant(self, node: Node) -> str:
        value = node.args[0]
        text = "0x" + struct.pack(">d", value).hex().upper() if node.kind == "real" else str(int(value))
        if self.width == 1:
            return text
        return "<" + ", ".join([f"{_SCALAR[node.kind]} {text}"] * self.width) + ">"

    def _vector(self) -> str:
        """Type of pointers to loaded and stored values."""
        if self.width == 1 or self.pointer == "ptr":
            return self.pointer
        return f"{_type('real', self.width)}*"

    def _address(self, array: str, place: int, chain: int) -> str:
        index = place * self.apart + chain * self.width if array == "R" else place
        name, base = self._fresh("p"), self.record if array == "R" else array
        self.lines.append(f"  {name} = getelementptr inbounds double, {self.pointer} %{base}, i64 {index}")
        if self._vector() != self.pointer:
            plain, name = name, self._fresh("p")
            self.lines.append(f"  {name} = bitcast {self.pointer} {plain} to {self._vector()}")
        return name

    def _operation(self, node: Node, chain: int) -> str:
        real = _type("real", self.width)
        if node.op == "load":
            array, place = node.args
            address, name = self._address(array, place, chain), self._fresh()
            self.lines.append(f"  {name} = load {real}, {self._vector()} {address}, align 8")
            return name
        a = [self.values[operand.order][chain] for operand in node.operands]
        name, kind = self._fresh(), node.kind
        operand = _type(node.operands[0].kind, self.width)
        if node.op in _COMPARE:
            of_reals, of_integers = _COMPARE[node.op]
            how = f"fcmp {of_reals}" if node.operands[0].kind == "real" else f"icmp {of_integers}"
            text = f"{how} {operand} {a[0]}, {a[1]}"
        elif node.op in PRIMITIVES and node.op != "sqrt":
            self.used.add((node.op, self.width))
            text = f"call {real} @{node.op}.{self.width}(" + ", ".join(f"{real} {x}" for x in a) + ")"
        elif node.op in ("abs", "sqrt"):
            text = f"call {real} @llvm.{'fabs' if node.op == 'abs' else 'sqrt'}.{_suffix(self.width)}({real} {a[0]})"
        elif node.op == "select":
            text = f"select {operand} {a[0]}, {real} {a[1]}, {real} {a[2]}"
        elif node.op == "neg":
            text = f"fneg {_FAST} {real} {a[0]}"
        elif node.op == "not":
            true = "true" if self.width == 1 else "<" + ", ".join(["i1 true"] * self.width) + ">"
            text = f"xor {operand} {a[0]}, {true}"
        elif node.op in ("bits", "real"):
            text = f"bitcast {operand} {a[0]} to {_type(kind, self.width)}"
        elif node.op == "float":
            text = f"sitofp {operand} {a[0]} to {real}"
        else:
            text = f"{(_REAL if kind == 'real' else _WHOLE)[node.op]} {_type(kind, self.width)} {a[0]}, {a[1]}"
        self.lines.append(f"  {name} = {text}")
        return name

    def _loop(self, loop: Loop) -> None:
        """Write a loop as a block that repeats for a fixed number of rounds."""
        if loop.results[0].order in self.values:
            return
        self.emit(reachable(loop.given))
        before, label = self.block, f"loop{len(self.lines)}"
        counter, following = self._fresh("i"), self._fresh("i")
        self.lines += [f"  br label %{label}", f"{label}:"]
        self.block = label
        self.lines.append(f"  {counter} = phi i64 [ 0, %{before} ], [ {following}, %{label} ]")
        place = len(self.lines)
        for node in loop.carried:
            self.values[node.order] = [self._fresh() for _ in range(self.chains)]
        self.emit(loop.nodes, loop)
        phis = []
        for node, start, after in zip(loop.carried, loop.start, loop.following, strict=True):
            for chain, name in enumerate(self.values[node.order]):
                first, then = self.values[start.order][chain], self.values[after.order][chain]
                phis.append(
                    f"  {name} = phi {_type(node.kind, self.width)} [ {first}, %{before} ], [ {then}, %{label} ]"
                )
        self.lines[place:place] = phis
        done = self._fresh("d")
        self.lines += [
            f"  {following} = add i64 {counter}, 1",
            f"  {done} = icmp sge i64 {following}, {loop.rounds}",
            f"  br i1 {done}, label %{label}.after, label %{label}",
            f"{label}.after:",
        ]
        self.block = f"{label}.after"
