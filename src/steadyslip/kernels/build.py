"""Programs and drivers to machine code, kept between processes in the user's cache folder.

A driver is compiled by numba once for all models; it reaches a model's routines by their addresses. The routines of a
model are straight-line programs that go to LLVM as they are. Both are stored under the hash of their text, of all
versions that matter and of the processor, in one sealed file, written under a temporary name and moved
into place. It is opened only if it and its folder are this user's and nobody else can write to them, and if its seal
(`steadyslip.files.sealed`) says that it is of this very function. Anything odd about it (damaged, of another function,
foreign owner, other version, unreadable) means that it is ignored and compiled again; a folder that cannot be written
to means that nothing is kept. ``STEADYSLIP_CACHE`` names another folder; empty, none. With ``STEADYSLIP_INTERPRET=1``
nothing is compiled, and Python runs it all.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import json
import os
import pickle
import struct
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, cast

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.files.inputs import is_private
from steadyslip.files.sealed import FileKind, read_sealed, write_sealed
from steadyslip.kernels.driver import lanes, places, states, table
from steadyslip.kernels.driver_text import numbered, text_of, texts
from steadyslip.kernels.layout import Layout, Routines
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.printers import python

ENTRIES: dict[str, tuple[ModuleType, str]] = {
    "advance": (
        lanes,
        "int64(float64[::1], int64[::1], int64[::1], float64[:,::1], float64[:,::1], float64[:,::1], "
        "float64[:,:,::1], float64[::1], int64[::1], float64[:,::1], float64[:,::1], float64[:,:,::1], "
        "float64[:,::1], float64[:,::1], int64)",
    ),
    "observe": (
        states,
        "void(float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,::1], int64[::1], int64[::1], float64[::1], "
        "float64[:,::1])",
    ),
    "field": (
        states,
        "void(float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], int64[::1], float64[:,::1])",
    ),
    "through_table": (
        table,
        "void(int64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,:,::1], float64[::1], "
        "float64[:,:,::1], float64[:,:,:,::1], float64[:,:,::1], float64[:,::1])",
    ),
}
"""What is called from outside: where it is, and its signature behind layout and routines."""
_FAST: dict[str, Any] = {"fastmath": {"contract", "nsz"}, "error_model": "numpy", "boundscheck": False}
OPTIONS = {
    "inner": _FAST | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True},
    "entry": _FAST | {"nogil": True},
    "place": _FAST | {"inline": "always"},  # a line each, which would take as long to compile as any
}
"""How numba compiles drivers."""
KERNEL = FileKind("kernel", 3, 2**26, "it is compiled again")
_MARK = "THIS"  # stands for the key in the routines' text
_lock = threading.RLock()
_drivers: dict[str, Callable[..., Any]] = {}
_loaded: dict[str, tuple[Any, dict[str, int]]] = {}


@dataclass(frozen=True, eq=False)
class Code:
    """A model's routines and the driver that calls them, ready to run.

    Attributes
    ----------
    layout : Layout
    routines : Routines
        Addresses, or functions if `plain`.
    plain : bool
        Whether everything is run by Python, slowly.
    """

    layout: Layout
    routines: Routines
    plain: bool

    def _bound(self, name: str) -> Callable[..., Any]:
        entry = getattr(ENTRIES[name][0], name) if self.plain else compiled_driver(name)
        if self.plain:
            return partial(entry, self.layout, self.routines)
        return partial(entry, np.array(self.layout, dtype=np.int64), np.array(self.routines, dtype=np.int64))

    @cached_property
    def advance(self) -> Callable[..., int]:
        """`steadyslip.kernels.driver.lanes.advance` of this model."""
        return self._bound("advance")

    @cached_property
    def observe(self) -> Callable[..., None]:
        """`steadyslip.kernels.driver.states.observe` of this model."""
        return self._bound("observe")

    @cached_property
    def field(self) -> Callable[..., None]:
        """`steadyslip.kernels.driver.states.field` of this model."""
        return self._bound("field")

    @cached_property
    def through_table(self) -> Callable[..., None]:
        """`steadyslip.kernels.driver.table.through_table` of this model."""
        return self._bound("through_table")


def interpreting() -> bool:
    """Whether everything is to be run by Python, to be stepped through."""
    return os.environ.get("STEADYSLIP_INTERPRET", "") not in ("", "0")


def interpreted(programs: Sequence[Program], layout: Layout) -> Code:
    """Everything as plain Python, slow: for tests, and to be stepped through."""
    functions = {program.name: python.function(program, interpreting()) for program in programs}
    return Code(layout, Routines(**{name: functions.get(name, _absent) for name in Routines._fields}), True)


def _absent(record: Any, number: float, array: Any) -> None:
    raise NotImplementedError("this kernel has no such routine")


def compiled(programs: Sequence[Program], layout: Layout) -> Code:
    """The same as machine code: compiled now, or found in the cache."""
    addresses = machine_code(programs, layout.lanes)
    found = {name: addresses.get(name, 0) for name in Routines._fields}
    return Code(layout, Routines(**cast(Any, found)), False)


# -- where machine code is kept


def cache_folder() -> Path | None:
    """Where machine code is kept; None if it is not."""
    chosen = os.environ.get("STEADYSLIP_CACHE")
    if chosen is not None:
        return Path(chosen) if chosen else None
    from platformdirs import user_cache_path

    return user_cache_path("steadyslip") / "kernels"


@lru_cache(maxsize=1)
def _surroundings() -> str:
    """Everything but the source that machine code depends on."""
    import llvmlite
    import llvmlite.binding as llvm
    import numba

    from steadyslip import __version__

    switches = sorted(f"{name}={value}" for name, value in os.environ.items() if name.startswith("NUMBA_"))
    processor = [llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    versions = [__version__, sys.version, numba.__version__, llvmlite.__version__, np.__version__]
    return "\n".join([*versions, *processor, *switches])


def _key(source: str) -> str:
    options = json.dumps(OPTIONS, default=sorted, sort_keys=True)
    return hashlib.sha256(f"{_surroundings()}\n{options}\n{source}".encode()).hexdigest()


@dataclass(frozen=True)
class _Kept:
    """Bytes in one sealed file, or nothing."""

    path: Path | None

    def read(self) -> bytes | None:
        """The content, if the file is sound and nobody else could have written it."""
        if self.path is None:
            return None
        try:
            if not is_private(self.path.parent.stat()):
                return None
            return bytes(read_sealed(self.path, KERNEL, self.path.name, private=True))
        except (OSError, NotAvailable):
            return None

    def write(self, content: bytes) -> None:
        """Write the file, or do without."""
        if self.path is None:
            return
        with contextlib.suppress(OSError, NotAvailable):
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if "STEADYSLIP_CACHE" not in os.environ:
                self.path.parent.chmod(0o700)  # earlier versions left it to the umask
            write_sealed(self.path, content, KERNEL, self.path.name, private=True)


def _file(key: str, name: str) -> _Kept:
    folder = cache_folder()
    return _Kept(None if folder is None else folder / f"{key}-{name}")


@contextlib.contextmanager
def _without_collection() -> Iterator[None]:
    """Compilation makes millions of objects that live; looking for garbage among them takes a third of its time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


# -- the routines of a model


def machine_code(programs: Sequence[Program], lanes: int) -> dict[str, int]:
    """Addresses of programs, by name."""
    from llvmlite import ir

    from steadyslip.kernels.printers.llvm import assembly

    pointer = str(ir.DoubleType().as_pointer())
    text = assembly(programs, lanes, {program.name: f"{program.name}.{_MARK}" for program in programs}, pointer)
    key = _key(text)
    with _lock:
        if key not in _loaded:
            _loaded[key] = _linked(text.replace(f".{_MARK}(", f".{key}("), key, [program.name for program in programs])
        return _loaded[key][1]


def _linked(text: str, key: str, names: Sequence[str]) -> tuple[Any, dict[str, int]]:
    """The library that owns the code, and where its functions are."""
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import cpu_target

    codegen = cpu_target.target_context.codegen()
    file = _file(key, "routines")
    with global_compiler_lock:
        library = _kept(codegen, file.read(), key)
        if library is None:
            library = _assembled(codegen, text, key)
            _, _, (code, shared) = library.serialize_using_object_code()
            file.write(struct.pack("<Q", len(code)) + code + shared)
    return library, {name: int(library.get_pointer_to_function(f"{name}.{key}")) for name in names}


def _kept(codegen: Any, content: bytes | None, key: str) -> Any:
    """The library from a file of the cache, None if there is none or it is not one."""
    if content is None or len(content) < 8:
        return None
    size = struct.unpack("<Q", content[:8])[0]
    try:
        return codegen.unserialize_library((key, "object", (content[8 : 8 + size], content[8 + size :])))
    except Exception:  # whatever a file of another build may raise: compile instead
        return None


def _assembled(codegen: Any, text: str, key: str) -> Any:
    import llvmlite.binding as llvm

    library = codegen.create_library(key)
    library.enable_object_caching()
    module = llvm.parse_assembly(f"{library.create_ir_module(key)}\n{text}")
    module.verify()
    library.add_llvm_module(module)
    library.finalize()
    return library


# -- the drivers


def compiled_driver(name: str) -> Callable[..., Any]:
    """One of `ENTRIES` as machine code, that takes addresses for routines."""
    with _lock:
        if name not in _drivers:
            module, signature = ENTRIES[name]
            _drivers[name] = _compiled_entry(name, module, signature, driver_key(name))
        return _drivers[name]


def driver_key(name: str) -> str:
    """The hash of everything that the machine code of an entry depends on."""
    module, signature = ENTRIES[name]
    others = [text_of(f"steadyslip.kernels.{part}") for part in ("layout", "jump", "driver_text", "build")]
    return _key("\n".join([name, signature, *texts(module.__name__).values(), *others]))


def _compiled_entry(name: str, source: ModuleType, signature: str, key: str) -> Callable[..., Any]:
    """The functions of a module and of those it needs, for numba, calling addresses instead of routines."""
    import numba
    from numba.core.sigutils import normalize_signature

    from steadyslip.kernels.jump import jump

    module = ModuleType(f"steadyslip_driver_{key}")
    sys.modules[module.__name__] = module  # numba finds a cached function's globals by module name
    for part, text in texts(source.__name__).items():
        exec(compile(numbered(text), f"<{part}>", "exec"), module.__dict__)
    for own, function in list(vars(module).items()):
        if isinstance(function, FunctionType) and function.__module__ == module.__name__:
            kind = "entry" if own in ENTRIES else "place" if hasattr(places, own) else "inner"
            module.__dict__[own] = numba.njit(**OPTIONS[kind])(function)
    module.__dict__["call"] = jump
    arguments, result = normalize_signature(signature)  # type: ignore[no-untyped-call]
    numbers = numba.int64[::1]
    return compiled_once(module.__dict__[name], result(numbers, numbers, *arguments), _file(key, name))


def compiled_once(function: Any, signature: Any, file: _Kept) -> Callable[..., Any]:
    """A function of numba compiled for one signature, or loaded from a file."""
    with _without_collection():
        function._cache = _NumbaCache(file)
        function.compile(signature)
        function.disable_compile()
    return cast(Callable[..., Any], function)


class _NumbaCache:
    """What a numba dispatcher asks of its cache, for one function in one checked file."""

    def __init__(self, file: _Kept) -> None:
        self.file = file

    @property
    def cache_path(self) -> str:
        return str(self.file.path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function, or None if there is no sound file for it."""
        content = self.file.read()
        if content is None:
            return None
        from numba.core.compiler import CompileResult

        target_context.refresh()
        try:
            return CompileResult._rebuild(target_context, *pickle.loads(content))  # type: ignore[no-untyped-call]
        except Exception:  # whatever a file of another build may raise: compile instead
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the file, or do without."""
        self.file.write(pickle.dumps(data._reduce(), protocol=-1))
