"""LLVM assembly to machine code, and machine code into this process."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from steadyslip.kernels.printers.native.lines import MEMORY, Lines

SPEED = 3
"""How hard LLVM tries."""
STRAIGHT = 1
"""The same for routines of a model: it leads to the same machine code, byte for byte, in less time."""
_MAGIC = (b"\x7fELF", b"\xcf\xfa\xed\xfe")  # for code in memory, LLVM writes ELF, on Windows too, and on macOS Mach-O
FEATURES: list[str] = []
"""Features of the processor to be used, or not (``-``), besides those that LLVM finds: for benchmarks."""


def opaque() -> bool:
    """Whether pointers of this LLVM say nothing of what they point to."""
    import llvmlite.binding as llvm

    return bool(llvm.llvm_version_info[0] >= 17)


def pointer() -> str:
    """How this LLVM writes a pointer to a real number."""
    return Lines(opaque()).pointer("real")


def surroundings() -> list[str]:
    """Versions and processor that machine code depends on."""
    import llvmlite
    import llvmlite.binding as llvm

    version = ".".join(map(str, llvm.llvm_version_info))
    return [llvmlite.__version__, version, f"{SPEED} {STRAIGHT}", llvm.get_process_triple(), *_processor()]


def _processor() -> tuple[str, str]:
    import llvmlite.binding as llvm

    try:
        features = llvm.get_host_cpu_features().flatten()
    except RuntimeError:  # LLVM does not know on every system
        features = ""
    return llvm.get_host_cpu_name(), ",".join(filter(None, [features, *FEATURES]))


@lru_cache(maxsize=1)
def _target() -> Any:
    return _new_target()


def _new_target() -> Any:
    """What machine code is made for: this very processor."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    name, features = _processor()
    where = "static" if target.name.startswith("x86") else "default"  # as LLVM wants it for code in memory
    return target.create_target_machine(
        cpu=name, features=features, opt=SPEED, reloc=where, codemodel="jitdefault", jit=True
    )


@lru_cache(maxsize=1)
def _engine() -> Any:
    """What takes machine code into memory."""
    import llvmlite.binding as llvm

    for name in MEMORY:
        llvm.add_symbol(name, ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value)
    machine = _new_target()  # which will be the engine's own
    return llvm.create_mcjit_compiler(llvm.parse_assembly(_head(machine)), machine)


def _head(machine: Any) -> str:
    import llvmlite.binding as llvm

    return f'target triple = "{llvm.get_process_triple()}"\ntarget datalayout = "{machine.target_data}"\n'


def machine_code(text: str, effort: int = SPEED) -> bytes:
    """A module of assembly as an object file."""
    import llvmlite.binding as llvm

    machine = _target()
    module = llvm.parse_assembly(_head(machine) + text)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=effort)
    # what has to be fast has no loops, or is written in vectors; the driver's loops would take half of all compilation
    options.loop_unrolling = options.loop_vectorization = options.loop_interleaving = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def is_machine_code(content: bytes, symbols: Iterable[str]) -> bool:
    """Whether something looks like an object file with these functions: LLVM ends the process if it is none."""
    return content.startswith(_MAGIC) and all(symbol.encode() in content for symbol in symbols)


def linked(code: bytes, symbols: Mapping[str, str]) -> dict[str, int]:
    """Addresses of functions of an object file, which stays in memory from now on."""
    import llvmlite.binding as llvm

    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: int(engine.get_function_address(symbol)) for name, symbol in symbols.items()}
