"""Compilation of LLVM assembly to machine code, and its loading into this process."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from steadyslip.kernels.printers.native.lines import MEMORY, Lines

SPEED = 3
"""Optimisation level of LLVM for the driver."""
STRAIGHT = 1
"""Optimisation level for routines of a model: same machine code, byte for byte, in less time."""
_MAGIC = (b"\x7fELF", b"\xcf\xfa\xed\xfe")  # first bytes of ELF (also on Windows, for code in memory) and Mach-O
FEATURES: list[str] = []
"""Processor features to use, or not (``-``), besides those that LLVM detects: for benchmarks."""


def opaque() -> bool:
    """True if pointers of this LLVM have no element type (from version 17 on)."""
    import llvmlite.binding as llvm

    return bool(llvm.llvm_version_info[0] >= 17)


def pointer() -> str:
    """Type of a pointer to a real number in the assembly of this LLVM."""
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
    except RuntimeError:  # detection is not available on every system
        features = ""
    return llvm.get_host_cpu_name(), ",".join(filter(None, [features, *FEATURES]))


@lru_cache(maxsize=1)
def _target() -> Any:
    return _new_target()


def _new_target() -> Any:
    """Target machine of LLVM: this processor."""
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
    """Execution engine of LLVM, which loads machine code into memory."""
    import llvmlite.binding as llvm

    for name in MEMORY:
        llvm.add_symbol(name, ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value)
    machine = _new_target()  # owned by the engine from here on
    return llvm.create_mcjit_compiler(llvm.parse_assembly(_head(machine)), machine)


def _head(machine: Any) -> str:
    import llvmlite.binding as llvm

    return f'target triple = "{llvm.get_process_triple()}"\ntarget datalayout = "{machine.target_data}"\n'


def machine_code(text: str, effort: int = SPEED) -> bytes:
    """Object file of a module of assembly."""
    import llvmlite.binding as llvm

    machine = _target()
    module = llvm.parse_assembly(_head(machine) + text)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=effort)
    # fast code has no loops or is written as vectors; optimising the driver's loops would take half of the compile time
    options.loop_unrolling = options.loop_vectorization = options.loop_interleaving = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def is_machine_code(content: bytes, symbols: Iterable[str]) -> bool:
    """True if bytes look like an object file with these functions (LLVM would end the process if they were not)."""
    return content.startswith(_MAGIC) and all(symbol.encode() in content for symbol in symbols)


def linked(code: bytes, symbols: Mapping[str, str]) -> dict[str, int]:
    """Addresses of functions of an object file, which stays in memory until the process ends."""
    import llvmlite.binding as llvm

    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: int(engine.get_function_address(symbol)) for name, symbol in symbols.items()}
