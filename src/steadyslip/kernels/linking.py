"""Compilation of LLVM assembly to machine code, and loading of machine code into this process."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from steadyslip.kernels.printers.native.lines import MEMORY, Lines

SPEED = 3
"""Optimisation level of LLVM for the driver."""
STRAIGHT = 1
"""Optimisation level of LLVM for a model's routines: gives the same machine code as level 3 in less time."""
_MAGIC = (b"\x7fELF", b"\xcf\xfa\xed\xfe")  # first bytes of ELF (also on Windows, for code in memory) and Mach-O
FEATURES: list[str] = []
"""Processor features to use (``+name``) or not (``-name``) besides those that LLVM detects; set by benchmarks."""


def opaque() -> bool:
    """True if pointers of this LLVM have no element type (from version 17 on)."""
    import llvmlite.binding as llvm

    return bool(llvm.llvm_version_info[0] >= 17)


def pointer() -> str:
    """Type of a pointer to a double in the assembly of this LLVM version."""
    return Lines(opaque()).pointer("real")


def surroundings() -> list[str]:
    """Versions, processor and settings of LLVM on which machine code depends."""
    import llvmlite
    import llvmlite.binding as llvm

    version = ".".join(map(str, llvm.llvm_version_info))
    return [llvmlite.__version__, version, f"{SPEED} {STRAIGHT}", llvm.get_process_triple(), *_processor()]


def _processor() -> tuple[str, str]:
    import llvmlite.binding as llvm

    try:
        features = llvm.get_host_cpu_features().flatten()
    except RuntimeError:  # detection is not available on every system
        features = ""
    return llvm.get_host_cpu_name(), ",".join(filter(None, [features, *FEATURES]))


@lru_cache(maxsize=1)
def _target() -> Any:
    return _new_target()


def _new_target() -> Any:
    """LLVM target machine for this processor."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    name, features = _processor()
    where = "static" if target.name.startswith("x86") else "default"  # LLVM's requirement for code in memory
    return target.create_target_machine(
        cpu=name, features=features, opt=SPEED, reloc=where, codemodel="jitdefault", jit=True
    )


@lru_cache(maxsize=1)
def _engine() -> Any:
    """LLVM execution engine, which loads machine code into memory (cached)."""
    import llvmlite.binding as llvm

    for name in MEMORY:
        llvm.add_symbol(name, ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value)
    machine = _new_target()  # owned by the engine from here on
    return llvm.create_mcjit_compiler(llvm.parse_assembly(_head(machine)), machine)


def _head(machine: Any) -> str:
    import llvmlite.binding as llvm

    return f'target triple = "{llvm.get_process_triple()}"\ntarget datalayout = "{machine.target_data}"\n'


def machine_code(text: str, effort: int = SPEED) -> bytes:
    """Object file (bytes) compiled from a module of LLVM assembly."""
    import llvmlite.binding as llvm

    machine = _target()
    module = llvm.parse_assembly(_head(machine) + text)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=effort)
    # loops are not optimised: fast code has none or is vector code, and for the driver's loops it would double compile
    # time

    options.loop_unrolling = options.loop_vectorization = options.loop_interleaving = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def is_machine_code(content: bytes, symbols: Iterable[str]) -> bool:
    """True if `content` looks like an object file with these functions; LLVM would crash on anything else."""
    return content.startswith(_MAGIC) and all(symbol.encode() in content for symbol in symbols)


def linked(code: bytes, symbols: Mapping[str, str]) -> dict[str, int]:
    """Addresses, by name, of functions of an object file, which stays in memory until the process ends."""
    import llvmlite.binding as llvm

    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: int(engine.get_function_address(symbol)) for name, symbol in symbols.items()}
