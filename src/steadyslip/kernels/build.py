"""Compilation of programs and driver to machine code, cached in the user's cache folder.

The driver is compiled once for all models and calls a model's routines by address; routines are straight-line programs.
LLVM gets both as text. Machine code is stored in one sealed file, named by a hash of that text (or of its source), of
all relevant versions and of the processor; it is written under a temporary name and moved into place. A file is used
only if it and its folder belong to this user, nobody else can write to them, and its seal
(`steadyslip.files.sealed`) is valid; otherwise the code is compiled again. The cache is as trustworthy as the user's
account: code that somebody with the user's rights has changed and sealed again is run.
If the folder cannot be written to, nothing is cached, with one warning. ``STEADYSLIP_CACHE`` names another folder; an
empty value means no cache. With ``STEADYSLIP_INTERPRET=1`` nothing is compiled, and Python runs everything.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np

from steadyslip.core.errors import NotAvailable, NotKeptWarning
from steadyslip.core.version import RELEASE
from steadyslip.files.inputs import is_private
from steadyslip.files.sealed import FileKind, read_sealed, write_sealed
from steadyslip.kernels import linking
from steadyslip.kernels.driver import bristles, holding, lanes, states, table
from steadyslip.kernels.driver_text import text_of, texts
from steadyslip.kernels.layout import Layout, Routines
from steadyslip.kernels.nodes import Program
from steadyslip.kernels.printers import python
from steadyslip.kernels.printers.llvm import assembly
from steadyslip.kernels.printers.native.functions import translated

_REALS, _TABLE, _CUBE, _WHOLE = "real[:]", "real[:,:]", "real[:,:,:]", "int[:]"
ENTRIES: dict[str, tuple[ModuleType, tuple[str, ...]]] = {
    "advance": (
        lanes,
        (_REALS, _WHOLE, _WHOLE, _TABLE, _TABLE, _TABLE, _CUBE, _REALS, _WHOLE, _TABLE, _TABLE, _CUBE, _TABLE, _TABLE,
         "int"),
    ),
    "observe": (states, (_TABLE, _TABLE, _CUBE, _TABLE, _WHOLE, _WHOLE, _REALS, _TABLE)),
    "field": (states, (_TABLE, _TABLE, _TABLE, _TABLE, _WHOLE, _TABLE)),
    "through_table": (
        table,
        (_WHOLE, _TABLE, _TABLE, _TABLE, _CUBE, _REALS, _CUBE, "real[:,:,:,:]", _CUBE, _TABLE),
    ),
    "bristle_step": (
        bristles,
        (_REALS, _TABLE, _TABLE, _TABLE, _TABLE, _REALS, _REALS, _REALS, _TABLE, _REALS, _TABLE, "int"),
    ),
    "follow_held": (
        holding,
        (_REALS, _TABLE, _TABLE, _TABLE, _TABLE, _REALS, _TABLE, _TABLE, _TABLE, _CUBE, _TABLE, _TABLE, _REALS, _REALS,
         _REALS, _TABLE, "int"),
    ),
}  # fmt: skip
"""Functions of the driver that Python calls: module, and types of the arguments that follow layout and routines."""
DRIVERS = {"driver": ("advance", "observe", "field", "through_table"), "held": ("bristle_step", "follow_held")}
"""Groups of `ENTRIES` that are compiled together, by file name; only rigs that hold a place need the group `held`."""
KERNEL = FileKind("kernel", 4, 2**26, "it is compiled again")
_FALSE_WORDS = ("", "0", "no", "off", "false")  # values of an environment variable that mean no
_KEY_PLACEHOLDER = "THIS"  # stands in the routines' text for the key, which is a hash of this text
_lock = threading.RLock()
_drivers: dict[str, Callable[..., int]] = {}
_loaded: dict[str, dict[str, int]] = {}
_NATIVE = [f"printers.native.{part}" for part in ("functions", "expressions", "lines", "arrays")]
# modules that translate the driver; their text is a part of its key
_TRANSLATION = ("layout", "driver_text", "linking", *_NATIVE)


@dataclass(frozen=True, eq=False)
class Code:
    """Routines of a model, and the driver functions that call them.

    Attributes
    ----------
    layout : Layout
    routines : Routines
        Addresses of machine code, or Python functions if `plain`.
    plain : bool
        True if Python runs everything, slowly.
    """

    layout: Layout
    routines: Routines
    plain: bool

    def _bound(self, name: str) -> Callable[..., Any]:
        if self.plain:
            return partial(getattr(ENTRIES[name][0], name), self.layout, self.routines)
        return partial(driver(name), np.array(self.layout, dtype=np.int64), np.array(self.routines, dtype=np.int64))

    @cached_property
    def advance(self) -> Callable[..., int]:
        """`steadyslip.kernels.driver.lanes.advance` bound to this model."""
        return self._bound("advance")

    @cached_property
    def observe(self) -> Callable[..., object]:
        """`steadyslip.kernels.driver.states.observe` bound to this model."""
        return self._bound("observe")

    @cached_property
    def field(self) -> Callable[..., object]:
        """`steadyslip.kernels.driver.states.field` bound to this model."""
        return self._bound("field")

    @cached_property
    def through_table(self) -> Callable[..., object]:
        """`steadyslip.kernels.driver.table.through_table` bound to this model."""
        return self._bound("through_table")

    @cached_property
    def bristle_step(self) -> Callable[..., int]:
        """`steadyslip.kernels.driver.bristles.bristle_step` bound to this model."""
        return self._bound("bristle_step")

    @cached_property
    def follow_held(self) -> Callable[..., int]:
        """`steadyslip.kernels.driver.holding.follow_held` bound to this model."""
        return self._bound("follow_held")


def interpreting() -> bool:
    """True if the environment variable STEADYSLIP_INTERPRET requests Python instead of machine code."""
    return os.environ.get("STEADYSLIP_INTERPRET", "").strip().lower() not in _FALSE_WORDS


def interpreted(programs: Sequence[Program], layout: Layout) -> Code:
    """Routines of programs as Python functions, which are slow: for tests and debuggers."""
    functions = {program.name: python.function(program, interpreting()) for program in programs}
    return Code(layout, Routines(**{name: functions.get(name, _missing_routine) for name in Routines._fields}), True)


def _missing_routine(record: Any, number: float, array: Any) -> None:
    raise NotImplementedError("the driver called a routine that this kernel does not have; this is a bug, report it")


def compiled(programs: Sequence[Program], layout: Layout) -> Code:
    """Routines of programs as machine code, compiled now or read from the cache."""
    addresses = machine_code(programs, layout.lanes)
    found = {name: addresses.get(name, 0) for name in Routines._fields}
    return Code(layout, Routines(**cast(Any, found)), False)


def code_of(programs: Sequence[Program], layout: Layout, plain: bool) -> Code:
    """Routines of programs as Python functions if `plain`, else as machine code."""
    return (interpreted if plain else compiled)(programs, layout)


# -- where machine code is kept


def cache_folder() -> Path | None:
    """Folder of the kernel cache; None if caching is switched off."""
    chosen = os.environ.get("STEADYSLIP_CACHE")
    if chosen is not None:
        return Path(chosen).expanduser() if chosen else None
    from platformdirs import user_cache_path

    return user_cache_path("steadyslip") / "kernels"


@lru_cache(maxsize=1)
def _versions() -> str:
    """Text with all versions, and the processor, on which machine code depends."""
    return "\n".join([RELEASE, sys.version, np.__version__, *linking.surroundings()])


def _key(source: str) -> str:
    return hashlib.sha256(f"{_versions()}\n{source}".encode()).hexdigest()


@dataclass(frozen=True)
class _CachedFile:
    """Bytes cached in one sealed file; without a path nothing is cached."""

    path: Path | None

    def read(self) -> bytes | None:
        """Content of the file; None if it is missing or damaged, or another user could have written it."""
        if self.path is None:
            return None
        try:
            if not is_private(folder := self.path.parent.stat()):
                _warn_of(self.path.parent, "others may write to it, so that no code found there is run", folder.st_uid)
                return None
            return bytes(read_sealed(self.path, KERNEL, self.path.name, private=True))
        except (OSError, NotAvailable):
            return None

    def write(self, content: bytes) -> None:
        """Write the file; if that fails, warn once."""
        if self.path is None:
            return
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if "STEADYSLIP_CACHE" not in os.environ:
                self.path.parent.chmod(0o700)  # earlier versions of this package did not set the permissions
            write_sealed(self.path, content, KERNEL, self.path.name, private=True)
        except OSError as error:
            _warn_of(self.path.parent, _reason(error))
        except NotAvailable as error:
            if isinstance(error.__cause__, OSError):
                _warn_of(self.path.parent, _reason(error.__cause__))


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


@cache
def _warn_of(folder: Path, why: str, owner: int = -1) -> None:
    """Warn once per folder that nothing is cached, with reason and remedy; worker processes do not warn."""
    import multiprocessing  # slow to import

    if multiprocessing.parent_process() is not None:
        return
    mend = ""
    if owner >= 0 and owner == os.getuid():
        mend = f"remove their right to write (chmod go-w {shlex.quote(str(folder))}), or "
    warnings.warn(
        f"machine code cannot be cached in {str(folder)!r} ({why}): every start compiles it anew, which takes seconds; "
        f"{mend}name another folder in STEADYSLIP_CACHE (an empty name: no cache, no warning)",
        NotKeptWarning, stacklevel=2,
    )  # fmt: skip


def _file(key: str, name: str) -> _CachedFile:
    folder = cache_folder()
    return _CachedFile(None if folder is None else folder / f"{key}-{name}")


# -- the routines of a model


def machine_code(programs: Sequence[Program], lanes: int) -> dict[str, int]:
    """Addresses of the machine code of programs, by name, compiled now or read from the cache."""
    names = [program.name for program in programs]
    text = assembly(programs, lanes, {name: f"{name}.{_KEY_PLACEHOLDER}" for name in names}, linking.pointer())
    key = _key(text)
    with _lock:
        if key not in _loaded:
            named = text.replace(f".{_KEY_PLACEHOLDER}(", f".{key}(")
            _loaded[key] = cached_or_compiled(lambda: named, key, "routines", names, linking.STRAIGHT)
        return _loaded[key]


def cached_or_compiled(
    text: Callable[[], str], key: str, what: str, names: Sequence[str], effort: int = linking.SPEED
) -> dict[str, int]:
    """Addresses, by name, of functions with symbols ``name.key``: read from the cache, or compiled and cached."""
    file = _file(key, what)
    symbols = {name: f"{name}.{key}" for name in names}
    content = file.read()
    if content is None or not linking.is_machine_code(content, symbols.values()):
        content = linking.machine_code(text(), effort)
        file.write(content)
    return linking.linked(content, symbols)


# -- the driver


def driver(name: str) -> Callable[..., int]:
    """One of `ENTRIES`, in machine code, as a Python function.

    Its first arguments are arrays: the layout, and the addresses of the routines.
    """
    with _lock:
        if name not in _drivers:
            (group,) = (one for one, names in DRIVERS.items() if name in names)
            key = driver_key(group)
            addresses = cached_or_compiled(lambda: driver_text(key, group), key, group, DRIVERS[group])
            for entry in DRIVERS[group]:
                _drivers[entry] = callable_at(addresses[entry], entry, (_WHOLE, _WHOLE, *ENTRIES[entry][1]))
        return _drivers[name]


def driver_text(key: str, group: str) -> str:
    """LLVM assembly of one group of `DRIVERS`, with symbols ``name.key``."""
    entries = {name: (_WHOLE, _WHOLE, *ENTRIES[name][1]) for name in DRIVERS[group]}
    return translated(_driver_modules(group), entries, {name: f"{name}.{key}" for name in entries}, 2, linking.opaque())


def _driver_modules(group: str) -> dict[str, str]:
    return texts(*(ENTRIES[name][0].__name__ for name in DRIVERS[group]))


@lru_cache(maxsize=len(DRIVERS))
def driver_key(group: str = "driver") -> str:
    """Hash of everything on which the machine code of one group of `DRIVERS` depends."""
    declared = [f"{name} {ENTRIES[name][1]}" for name in DRIVERS[group]]
    others = [text_of(f"steadyslip.kernels.{part}") for part in _TRANSLATION]
    return _key("\n".join([*declared, *_driver_modules(group).values(), *others]))


def callable_at(address: int, name: str, types: Sequence[str]) -> Callable[..., int]:
    """Python function that calls the translated function at an address, without the interpreter's lock (GIL)."""
    kinds = [ctypes.py_object if "[" in one else ctypes.c_int64 for one in types]
    function = ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)(address)

    def called(*arguments: Any) -> int:
        found: int = function(*arguments)
        if found < 0:
            raise TypeError(f"{name}: argument {-found} must be a contiguous, writeable array {types[-1 - found]}")
        return found

    return called
