"""Kernel text to machine code, kept between processes in the user's cache folder.

A compiled function is stored under the hash of its text, of all versions and options that matter and of the
processor, in one sealed file (`steadyslip.sealed`), written under a temporary name and moved into place. Machine code
comes as a pickle, so a file is opened only if it and its folder are this user's and nobody else can write to them, and
if its seal says that it is of this very function. Anything odd about it (damaged, of another function, foreign owner,
other version, unreadable) means that it is ignored and compiled again; a folder that cannot be written to means that
nothing is kept. ``STEADYSLIP_CACHE`` names another folder; empty, none.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import json
import math
import os
import pickle
import struct
import sys
import threading
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from steadyslip.errors import NotAvailable
from steadyslip.inputs import is_private
from steadyslip.sealed import Kind, read_sealed, write_sealed

ENTRIES = {
    "advance": "int64(float64[::1], int64[::1], int64[::1], float64[:,::1], float64[:,::1], float64[:,::1], "
    "float64[:,:,::1], float64[::1], int64[::1], float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,::1], "
    "float64[:,::1], int64)",
    "observe": "void(float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], int64[::1], float64[:,::1])",
    "field": "void(float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], int64[::1], float64[:,::1])",
    "through_table": "void(float64[:,::1], float64[:,::1], float64[:,::1], float64[:,:,::1], int64[:,::1], "
    "float64[:,:,::1], float64[:,:,:,::1], float64[:,:,::1], float64[:,::1])",
}
"""Functions that are called from outside; not every kernel has all of them."""
_FAST: dict[str, Any] = {"fastmath": {"contract", "nsz"}, "error_model": "numpy", "boundscheck": False}
_INNER = _FAST | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
OPTIONS = {"PLAIN": _INNER, "FLAT": _INNER, "INLINE": _INNER | {"forceinline": True}, "ENTRY": _FAST | {"nogil": True}}
"""What a kernel's text asks of numba, by the name that it uses."""
KERNEL = Kind("kernel", 2, 2**26, "it is compiled again")
_lock = threading.RLock()
_loaded: dict[str, ModuleType] = {}


def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None if they are not."""
    chosen = os.environ.get("STEADYSLIP_CACHE")
    if chosen is not None:
        return Path(chosen) if chosen else None
    from platformdirs import user_cache_path

    return user_cache_path("steadyslip") / "kernels"


def source_of(text: str) -> str:
    """The whole source of a kernel: primitives, then its own text."""
    return files("steadyslip.compiled").joinpath("primitives.py").read_text(encoding="utf-8") + text


def interpreted(text: str) -> ModuleType:
    """The kernel as plain Python, slow: for tests of the text itself."""

    def keep(**_: Any) -> Any:
        return lambda function: function

    def bits(x: float) -> int:
        return int(struct.unpack("<q", struct.pack("<d", x))[0])

    def real(i: int) -> np.float64:
        number = struct.unpack("<d", struct.pack("<q", (i + 2**63) % 2**64 - 2**63))[0]
        return np.float64(number)  # division by zero gives infinity, as in machine code

    module = ModuleType("steadyslip_kernel_interpreted")
    module.__dict__.update(math=math, np=np, njit=keep, bits=bits, real=real, **{name: {} for name in OPTIONS})
    exec(compile(source_of(text), "<kernel>", "exec"), module.__dict__)
    return module


def compiled(text: str) -> ModuleType:
    """The kernel as machine code: compiled now, or found in the cache."""
    source = source_of(text)
    key = _key(source)
    with _lock:
        if key not in _loaded:
            _loaded[key] = _module(source, key)
        return _loaded[key]


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
    intrinsics = files("steadyslip.compiled").joinpath("bits.py").read_text(encoding="utf-8")
    return "\n".join([*versions, *processor, *switches, intrinsics])


def _key(source: str) -> str:
    options = json.dumps(OPTIONS, default=sorted, sort_keys=True)
    return hashlib.sha256(f"{_surroundings()}\n{options}\n{ENTRIES}\n{source}".encode()).hexdigest()


def _module(source: str, key: str) -> ModuleType:
    import numba

    from steadyslip.compiled.bits import bits, real

    module = ModuleType(f"steadyslip_kernel_{key}")
    sys.modules[module.__name__] = module  # numba finds a cached function's globals by module name
    module.__dict__.update(math=math, np=np, njit=numba.njit, bits=bits, real=real, **OPTIONS)
    exec(compile(source, f"<{module.__name__}>", "exec"), module.__dict__)
    folder = cache_folder()
    with _without_collection():
        for name, signature in ENTRIES.items():
            function = getattr(module, name, None)
            if function is None:
                continue
            function._cache = _FileCache(None if folder is None else folder / f"{key}-{name}")
            function.compile(signature)
            function.disable_compile()
    return module


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


class _FileCache:
    """What a numba dispatcher asks of its cache, for one function in one checked file."""

    def __init__(self, path: Path | None) -> None:
        self.path = path

    @property
    def cache_path(self) -> str:
        return str(self.path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function, or None if there is no sound file for it."""
        content = self._sound_content()
        if content is None:
            return None
        from numba.core.compiler import CompileResult

        target_context.refresh()
        try:
            return CompileResult._rebuild(target_context, *pickle.loads(content))  # type: ignore[no-untyped-call]
        except Exception:  # whatever a file of another build may raise: compile instead
            return None

    def _sound_content(self) -> memoryview | None:
        if self.path is None:
            return None
        try:
            if not is_private(self.path.parent.stat()):
                return None
            return read_sealed(self.path, KERNEL, self.path.name, private=True)
        except (OSError, NotAvailable):
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the file, or do without."""
        if self.path is None:
            return
        content = pickle.dumps(data._reduce(), protocol=-1)
        with contextlib.suppress(OSError, NotAvailable):
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if "STEADYSLIP_CACHE" not in os.environ:
                self.path.parent.chmod(0o700)  # earlier versions left it to the umask
            write_sealed(self.path, content, KERNEL, self.path.name, private=True)
