"""A map on disk: a Zarr group with one array for each result, and a mark for each finished chunk.

Everything is laid out when the store is made; later only chunks are written, each by one process, whole files moved
into place. A chunk's mark is written last and holds the checksum of the chunk's files, so that a chunk counts as done
only if all its files are there and are those that were written. Arrays that hold nothing but the fill value have no
file, which the checksum covers as well.
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
from steadyslip.maps.store.layout import coordinates, lay_out, read_layout

_WRITTEN = 1 << 32  # added to every checksum, so that none is the zero of a chunk not done
_MARK = 8  # bytes


class Store:
    """An open map.

    Attributes
    ----------
    path : Path
    layout : MapLayout
        What its metadata say.
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
        self._intact: set[int] = set()  # chunks whose files have been seen to be those that were written

    def array(self, name: str) -> Any:
        """One of its Zarr arrays."""
        if name not in self._arrays:
            self._arrays[name] = self.group[name]
        return self._arrays[name]

    # -- what it holds -----------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Number of chunks."""
        return int(np.prod(self.grid, dtype=int))

    def read(self, name: str, region: Any = ...) -> np.ndarray:
        """Values of one of its arrays, fill values where no chunk is done.

        Raises
        ------
        NotAvailable
            If a file is damaged, missing, or not the one that was written.
        """
        for number in self._touched(name, region):
            if number not in self._intact and (mark := self._mark(number)):
                if not self._holds(number, mark):
                    raise self.damage(name, ValueError(f"the files of chunk {number} are not those that were written"))
                self._intact.add(number)
        try:
            values = np.asarray(self.array(name)[region])
        except (ValueError, RuntimeError, OSError) as error:  # as Zarr says it
            raise self.damage(name, error) from error
        words = self.layout.arrays[name].attributes.get("flag_meanings")
        if words is not None and values.size and not (values.min() >= -1 and values.max() + 1 < len(words.split())):
            raise self.damage(name, ValueError("it has kinds that it has no words for"))
        return values

    def _touched(self, name: str, region: Any) -> Iterator[int]:
        """Chunks that hold a part of a result or of generated samples, or lie between."""
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
        """What to say of files that cannot be read."""
        return NotAvailable(f"{str(self.path)!r} is damaged ({what}: {error}); compute the map again to repair it")

    def rig(self) -> Slider | Machine:
        """The base rig.

        Raises
        ------
        NotAvailable
            If it has a law that no file can refer to.
        """
        if not self.rig_text:
            raise NotAvailable(f"the rig of {str(self.path)!r} has a law without a name, which cannot be read back")
        return rig_from_text(self.rig_text, str(self.path))

    def region(self, number: int) -> tuple[slice, ...]:
        """The points of a chunk."""
        indices = np.unravel_index(number, self.grid)
        return tuple(
            slice(int(i) * c, min((int(i) + 1) * c, n))
            for i, c, n in zip(indices, self.chunks, self.shape, strict=True)
        )

    def points(self, number: int) -> int:
        """How many points a chunk has."""
        return int(np.prod([part.stop - part.start for part in self.region(number)], dtype=int))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """All parameters that vary."""
        return tuple(dim for dim in self.dims if dim != SAMPLE) + self.sampled

    def parameters(self, region: tuple[slice, ...], generated: bool = False) -> dict[str, Any]:
        """Stored values of the parameters that vary, shaped so that they broadcast over a chunk.

        Those that are `generated` are there only once their chunk is done.
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
        """Write a chunk's arrays, then its mark; `samples` are generated parameters, (n,)."""
        region = self.region(number)
        for file in self._files(number):
            check_room(file).unlink(missing_ok=True)  # what is left of a damaged chunk must not be read
        for name, values in results.items():
            array = self.array(name)
            extra = (slice(None),) * (array.ndim - len(region))
            array[(*region, *extra)] = values
        if self._has_samples(number):
            for name, values in samples.items():
                self.array(name)[region[-1]] = values
        self.marks[np.unravel_index(number, self.grid)] = np.uint64(self._checksum(number))

    def is_done(self, number: int) -> bool:
        """Whether a chunk has a mark."""
        return self._mark(number) != 0

    def damaged(self) -> list[int]:
        """Chunks with a mark whose files are not those that were written."""
        return [n for n, mark in enumerate(self._marks()) if mark != 0 and not self._holds(n, int(mark))]

    def forget(self, number: int) -> None:
        """Take a chunk's mark away."""
        self.marks[np.unravel_index(number, self.grid)] = np.uint64(0)

    def pending(self) -> list[int]:
        """Chunks without a mark."""
        return [int(n) for n in np.flatnonzero(self._marks() == 0)]

    def marked(self) -> int:
        """Number of chunks with a mark, damaged or not."""
        return int(np.count_nonzero(self._marks()))

    def _holds(self, number: int, mark: int) -> bool:
        try:
            return mark == self._checksum(number)
        except UnreadableFile:
            return False

    def _marks(self) -> np.ndarray:
        """Of all chunks; only files that are there are looked at."""
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
                continue  # what a process that was killed left
            here = (*at, int(entry.name))
            if len(here) == len(self.grid):
                found[here] = self._mark_in(Path(entry.path))
            elif entry.is_dir(follow_symlinks=False):
                self._collect(found, Path(entry.path), here)

    def _mark(self, number: int) -> int:
        indices = np.unravel_index(number, self.grid)
        return self._mark_in(inside(self.path, "/".join([COMPLETE, "c", *(str(int(i)) for i in indices)])))

    def _mark_in(self, file: Path) -> int:
        """A mark; 0 if there is none, or it is damaged."""
        try:
            content = read_bytes(file, _MARK, links=False)
        except UnreadableFile:
            return 0
        return int.from_bytes(content, "little") if len(content) == _MARK else 0

    def _has_samples(self, number: int) -> bool:
        """Whether a chunk is the one that writes the sample parameters of its part of the sample dimension."""
        indices = np.unravel_index(number, self.grid)
        return bool(self.generated) and not any(int(i) for i in indices[:-1])

    def _files(self, number: int) -> list[Path]:
        """The files of a chunk, in a fixed order."""
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
        return total | _WRITTEN

    def tidy(self) -> None:
        """Remove what processes that were killed left half written."""
        for file in self.path.rglob("*.partial"):
            with suppress(OSError):
                file.unlink()
        for folder in self.path.parent.glob(f".{self.path.name}.*.new"):
            shutil.rmtree(folder, ignore_errors=True)

    def restore(self, plan: Map) -> None:
        """Write coordinates again that are not those of the map, which no mark covers."""
        for name, values in coordinates(plan).items():
            inside(self.path, f"{name}/c/0")
            try:
                intact = np.array_equal(np.asarray(self.array(name)[:]), values)
            except Exception:  # damaged, whatever zarr says of it
                intact = False
            if not intact:
                self.array(name)[:] = values

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep a second run of the same map away for the time being, where the system can.

        Raises
        ------
        NotAvailable
            If there is one already.
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
            yield  # without locks on this file system: as on Windows

    def refuse_other(self, plan: Map) -> None:
        """Refuse to go on with another map, rig or version than the chunks that are there.

        Raises
        ------
        NotAvailable
            Saying what differs.
        """
        if other := of_another(self.version):
            raise NotAvailable(
                f"{str(self.path)!r} was {other}; chunks of two programs are not mixed. Give another name, or delete "
                "the map to have it computed anew; what it holds can be opened as it is"
            )
        if found := differences(self.definition, json.loads(json.dumps(plan.definition()))):
            lines = "\n".join(f"  {line.replace('map.rig.', '')}" for line in found)
            raise NotAvailable(
                f"{str(self.path)!r} holds another map; its chunks are not mixed with new ones. What changed:\n"
                f"{lines}\nUndo the change, or give another name"
            )


def open_or_create(path: Path, plan: Map) -> Store:
    """The store of a map, made if there is none.

    Raises
    ------
    NotAvailable
        If something else has that name, or it cannot be written.
    """
    if not path.exists():
        _create(path, plan)
    store = Store(path)
    store.refuse_other(plan)
    return store


def _create(path: Path, plan: Map) -> None:
    """Lay out a store under a temporary name and move it into place, so that there is never half a store."""
    new = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.new")
    try:
        new.mkdir()
        lay_out(new, plan)
        os.rename(new, path)
    except Exception as error:
        shutil.rmtree(new, ignore_errors=True)
        if path.exists():  # somebody else has made it meanwhile, and tidied up
            return
        if isinstance(error, OSError):
            raise cannot_write(path, error) from error
        raise


def cannot_write(path: Path, error: OSError) -> NotAvailable:
    """What to say of a failure to write."""
    return NotAvailable(f"cannot write {str(path)!r}: {(error.strerror or str(error)).lower()}")


def check_path(path: Path) -> None:
    """Refuse a name that no store can have, before anything is computed.

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
