"""Store of a map on disk: a Zarr group with one array per result, and a checksum ("mark") per finished chunk.

All arrays are created with the store; later only chunks are written, each by one process, by moving whole files into
place. A chunk's mark is written last and is the checksum of the chunk's files, so that a chunk counts as done only if
its files are unchanged since. For a chunk of fill values only, Zarr writes no file; the checksum covers that as well.
"""

from __future__ import annotations

import errno
import itertools
import json
import os
import shutil
import uuid
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.core.version import of_another
from steadyslip.files.inputs import UnreadableFile, check_room, inside, read_bytes
from steadyslip.files.specifications import rig_from_text
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.axes import COMPLETE, SAMPLE
from steadyslip.maps.plan.map import Map, differences
from steadyslip.maps.store.store_layout import coordinates, lay_out, read_layout

_CHECKSUM_OFFSET = 1 << 32  # a bit that is set in every checksum, so that no checksum is zero, the fill value of marks
_MARK = 8  # size of a mark, bytes


class Store:
    """Stored map, opened; writable if its folder is.

    Attributes
    ----------
    path : Path
    layout : MapLayout
        Verified metadata.
    """

    def __init__(self, path: Path) -> None:
        import zarr

        from steadyslip.maps.store.folder import MapFolder

        self.path = path
        self.layout = layout = read_layout(path)
        self.definition, self.version, self.versions = layout.definition, layout.version, layout.versions
        self.dims, self.results, self.rig_text = layout.dims, layout.results, layout.rig_text
        self.shape, self.chunks, self.grid = layout.shape, layout.chunks, layout.grid
        self.sampled, self.generated = layout.sampled, layout.generated
        writable = os.access(path, os.W_OK)
        self.folder: Any = MapFolder(path, read_only=not writable)
        self.folder.sizes = {name: one.unpacked for name, one in layout.arrays.items()}
        try:
            self.group: Any = zarr.open_group(
                self.folder, mode="r+" if writable else "r", zarr_format=3, use_consolidated=True
            )
            self.marks: Any = self.group[COMPLETE]
        except (OSError, KeyError, ValueError, TypeError) as error:
            raise self.damage("zarr.json", error) from error
        self._arrays: dict[str, Any] = {}
        self._intact: set[int] = set()  # numbers of the chunks whose checksum was verified

    def array(self, name: str) -> Any:
        """Zarr array by name (cached)."""
        if name not in self._arrays:
            self._arrays[name] = self.group[name]
        return self._arrays[name]

    # -- content -----------------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Number of chunks."""
        return int(np.prod(self.grid, dtype=int))

    def read(self, name: str, region: Any = ...) -> np.ndarray:
        """Values of an array, or of a region of it; fill values in chunks that are not done.

        Raises
        ------
        NotAvailable
            If a file is damaged, missing, or not the file that was written.
        """
        for number in self._touched(name, region):
            if number not in self._intact and (mark := self._mark(number)):
                if not self._is_intact(number, mark):
                    raise self.damage(name, ValueError(f"the files of chunk {number} are not those that were written"))
                self._intact.add(number)
        try:
            values = np.asarray(self.array(name)[region])
        except (ValueError, RuntimeError, OSError) as error:  # errors of Zarr and its codecs
            raise self.damage(name, error) from error
        words = self.layout.arrays[name].attributes.get("flag_meanings")
        if words is not None and values.size and not (values.min() >= -1 and values.max() + 1 < len(words.split())):
            raise self.damage(name, ValueError("it has numbers without a meaning in flag_meanings"))
        return values

    def _touched(self, name: str, region: Any) -> Iterator[int]:
        """Yield the chunks that a region of a result or of generated samples may overlap."""
        axes = self.dims if name in self.results else self.dims[-1:] if name in self.generated else ()
        first = len(self.dims) - len(axes)
        given = list(region) if isinstance(region, tuple) else [region]
        parts = [*itertools.takewhile(lambda part: part is not ..., given), *[slice(None)] * len(axes)]
        spans = []
        for axis, part in enumerate(parts[: len(axes)], first):
            within = range(self.shape[axis])
            chosen = within[part] if isinstance(part, slice) else [within[int(part)]]
            low, high = sorted((chosen[0], chosen[-1])) if chosen else (0, -1)
            spans.append(range(low // self.chunks[axis], high // self.chunks[axis] + 1))
        for indices in itertools.product(*spans) if spans else ():
            yield int(np.ravel_multi_index((0,) * first + indices, self.grid))

    def damage(self, what: str, error: Exception) -> NotAvailable:
        """NotAvailable error for a part of the map (`what`) that cannot be read."""
        return NotAvailable(f"{str(self.path)!r} is damaged ({what}: {error}); compute the map again to repair it")

    def rig(self) -> Slider | Machine:
        """Rig of the map, with the values of all parameters that do not vary.

        Raises
        ------
        NotAvailable
            If it has a law that cannot be written to a file.
        """
        if not self.rig_text:
            raise NotAvailable(f"the rig of {str(self.path)!r} has a law without a name, which cannot be read back")
        return rig_from_text(self.rig_text, str(self.path)).named(self.layout.rig_file)

    def region(self, number: int) -> tuple[slice, ...]:
        """Region of a chunk: one slice per dimension of the map."""
        indices = np.unravel_index(number, self.grid)
        return tuple(
            slice(int(i) * c, min((int(i) + 1) * c, n))
            for i, c, n in zip(indices, self.chunks, self.shape, strict=True)
        )

    def points(self, number: int) -> int:
        """Number of points of a chunk."""
        return int(np.prod([part.stop - part.start for part in self.region(number)], dtype=int))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all parameters that vary."""
        return tuple(dim for dim in self.dims if dim != SAMPLE) + self.sampled

    def parameters(self, region: tuple[slice, ...], generated: bool = False) -> dict[str, Any]:
        """Stored values of the varied parameters by name, shaped to broadcast over the region of a chunk.

        `generated` adds sample parameters, which are stored chunk by chunk.
        """
        found = {}
        for i, dim in enumerate(self.dims):
            shape = [1] * len(self.dims)
            shape[i] = -1
            stored = [n for n in self.sampled if generated or n not in self.generated] if dim == SAMPLE else [dim]
            for name in stored:
                found[name] = self.read(name, region[i]).reshape(shape)
        return found

    # -- chunks ------------------------------------------------------------------------------------------

    def write(self, number: int, results: Mapping[str, Any], samples: Mapping[str, Any]) -> None:
        """Write a chunk's results, then its mark; `samples` has the generated parameters, (n,) each, by name."""
        region = self.region(number)
        for file in self._files(number):
            check_room(file).unlink(missing_ok=True)  # files of a damaged chunk must not be read
        for name, values in results.items():
            array = self.array(name)
            extra = (slice(None),) * (array.ndim - len(region))
            array[(*region, *extra)] = values
        if self._has_samples(number):
            for name, values in samples.items():
                self.array(name)[region[-1]] = values
        self.marks[np.unravel_index(number, self.grid)] = np.uint64(self._checksum(number))

    def is_done(self, number: int) -> bool:
        """True if a chunk has a mark."""
        return self._mark(number) != 0

    def damaged(self) -> list[int]:
        """Numbers of the chunks that are marked as done but whose files do not match the checksum in the mark."""
        return [n for n, mark in enumerate(self._marks()) if mark != 0 and not self._is_intact(n, int(mark))]

    def forget(self, number: int) -> None:
        """Remove a chunk's mark, so that it counts as not done."""
        self.marks[np.unravel_index(number, self.grid)] = np.uint64(0)

    def pending(self) -> list[int]:
        """Numbers of the chunks without a mark."""
        return [int(n) for n in np.flatnonzero(self._marks() == 0)]

    def marked(self) -> int:
        """Number of chunks with a mark, damaged or not."""
        return int(np.count_nonzero(self._marks()))

    def _is_intact(self, number: int, mark: int) -> bool:
        try:
            return mark == self._checksum(number)
        except UnreadableFile:
            return False

    def _marks(self) -> np.ndarray:
        """Marks of all chunks, (count,); only existing files are read."""
        found = np.zeros(self.grid, dtype=np.uint64)
        self._collect(found, inside(self.path, f"{COMPLETE}/c"), ())
        return found.reshape(-1)

    def marks_of_grid(self) -> np.ndarray:
        """Marks in the shape of the grid of chunks; 0 where a chunk is not done."""
        return self._marks().reshape(self.grid)

    def _collect(self, found: np.ndarray, folder: Path, at: tuple[int, ...]) -> None:
        try:
            entries = list(os.scandir(folder))
        except (FileNotFoundError, NotADirectoryError):
            return
        for entry in entries:
            if not entry.name.isdecimal() or len(entry.name) > 9 or int(entry.name) >= self.grid[len(at)]:
                continue  # a temporary file left by a killed process
            here = (*at, int(entry.name))
            if len(here) == len(self.grid):
                found[here] = self._mark_in(Path(entry.path))
            elif entry.is_dir(follow_symlinks=False):
                self._collect(found, Path(entry.path), here)

    def _mark(self, number: int) -> int:
        indices = np.unravel_index(number, self.grid)
        return self._mark_in(inside(self.path, "/".join([COMPLETE, "c", *(str(int(i)) for i in indices)])))

    def _mark_in(self, file: Path) -> int:
        """Mark in a file; 0 if the file is missing or damaged."""
        try:
            content = read_bytes(file, _MARK, links=False)
        except UnreadableFile:
            return 0
        return int.from_bytes(content, "little") if len(content) == _MARK else 0

    def _has_samples(self, number: int) -> bool:
        """True if this chunk stores the sample parameters; of several chunks with the same samples only one does."""
        indices = np.unravel_index(number, self.grid)
        return bool(self.generated) and not any(int(i) for i in indices[:-1])

    def _files(self, number: int) -> list[Path]:
        """Files of a chunk, in a fixed order."""
        indices = tuple(int(i) for i in np.unravel_index(number, self.grid))
        rank = {name: len(one.shape) for name, one in self.layout.arrays.items()}
        keys = [(name, (*indices, *(0,) * (rank[name] - len(indices)))) for name in self.results]
        if self._has_samples(number):
            keys += [(name, indices[-1:]) for name in self.generated]
        return [inside(self.path, "/".join([name, "c", *map(str, key)])) for name, key in keys]

    def _checksum(self, number: int) -> int:
        total = 0
        most = max(one.unpacked for one in self.layout.arrays.values()) + 64
        for file in self._files(number):
            if file.exists():
                total = zlib.crc32(read_bytes(file, most, links=False), zlib.crc32(b"+", total))
            else:
                total = zlib.crc32(b"-", total)
        return total | _CHECKSUM_OFFSET

    def tidy(self) -> None:
        """Remove temporary files of processes that were killed."""
        for file in self.path.rglob("*.partial"):
            with suppress(OSError):
                file.unlink()
        for folder in self.path.parent.glob(f".{self.path.name}.*.new"):
            shutil.rmtree(folder, ignore_errors=True)

    def restore(self, plan: Map) -> None:
        """Write damaged coordinates again; unlike chunks, coordinates have no checksum."""
        for name, values in coordinates(plan).items():
            inside(self.path, f"{name}/c/0")
            try:
                intact = np.array_equal(np.asarray(self.array(name)[:]), values)
            except Exception:  # damaged files may raise anything in Zarr
                intact = False
            if not intact:
                self.array(name)[:] = values

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Context that locks the map against a second run, where the system supports it.

        Raises
        ------
        NotAvailable
            If another run has the lock.
        """
        try:
            import fcntl
        except ImportError:  # Windows
            yield
            return
        with open(self.path / "zarr.json", "rb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                    message = f"another run is working on {str(self.path)!r}; wait for it, or end it first"
                    raise NotAvailable(message) from error
            yield  # go on even if this file system has no locks

    def refuse_another_program(self) -> None:
        """Raise an error if another version of this program computed the map, because versions must not be mixed.

        Raises
        ------
        NotAvailable
            If the versions differ; the message has both.
        """
        if other := of_another(self.version):
            raise NotAvailable(
                f"{str(self.path)!r} was {other}; points of two programs are not mixed. Give another name, or delete "
                "the map to compute it anew; its present content can still be opened"
            )

    def refuse_other(self, plan: Map) -> None:
        """Raise an error unless the stored map has the definition of `plan` and this program's version.

        Raises
        ------
        NotAvailable
            If they differ; the message lists the differences.
        """
        self.refuse_another_program()
        if found := differences(self.definition, json.loads(json.dumps(plan.definition()))):
            lines = "\n".join(f"  {line.replace('map.rig.', '')}" for line in found)
            raise NotAvailable(
                f"{str(self.path)!r} holds another map; its chunks are not mixed with new ones. What changed:\n"
                f"{lines}\nUndo the change, or give another name"
            )


def open_or_create(path: Path, plan: Map) -> Store:
    """Open the store of a map; create it if it does not exist.

    Raises
    ------
    NotAvailable
        If the path exists and is not this map, or cannot be written.
    """
    if not path.exists():
        _create(path, plan)
    store = Store(path)
    store.refuse_other(plan)
    return store


def _create(path: Path, plan: Map) -> None:
    """Create a store under a temporary name and rename it, so that an incomplete store never has the final name."""
    new = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.new")
    try:
        new.mkdir()
        lay_out(new, plan)
        os.rename(new, path)
    except Exception as error:
        shutil.rmtree(new, ignore_errors=True)
        if path.exists():  # another process has created the store meanwhile
            return
        if isinstance(error, OSError):
            raise cannot_write(path, error) from error
        raise


def cannot_write(path: Path, error: OSError) -> NotAvailable:
    """NotAvailable error for a path that cannot be written, with the system's reason."""
    return NotAvailable(f"cannot write {str(path)!r}: {(error.strerror or str(error)).lower()}")


def check_path(path: Path) -> None:
    """Raise an error if no store can be written to a path; called before anything is computed.

    Raises
    ------
    NotAvailable, ParameterError
    """
    if path.suffix != ".zarr":
        raise ParameterError([Problem("output", f"got {str(path)!r}; a map is written to a name that ends in .zarr")])
    if path.exists():
        if not path.is_dir():
            raise NotAvailable(f"{str(path)!r} exists and is a file; a map is a folder, give another name")
        if not os.access(path, os.W_OK):
            raise NotAvailable(f"cannot write {str(path)!r}: it is read-only")
    elif not path.absolute().parent.is_dir():
        raise NotAvailable(f"cannot write {str(path)!r}: there is no folder {str(path.parent)!r}")
