"""A map on disk: a Zarr group with one array for each result, and a mark for each finished chunk.

Everything is laid out when the store is made; later only chunks are written, each by one process, whole files moved
into place. A chunk's mark is written last and holds the checksum of the chunk's files, so that a chunk counts as done
only if all its files are there and are those that were written. Arrays that hold nothing but the fill value have no
file, which the checksum covers as well.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import uuid
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.config import rig_from_text, rig_to_text
from steadyslip.errors import NotAvailable, ParameterError, Problem
from steadyslip.slider import Slider
from steadyslip.sweep.axes import COMPLETE, SAMPLE, Generated
from steadyslip.sweep.plan import Map, differences, roles

FORMAT = 1
_WRITTEN = 1 << 32  # added to every checksum, so that none is the zero of a chunk not done
_VERSIONS = ("numpy", "scipy", "numba", "zarr")


class Store:
    """An open map.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        import zarr

        self.path = path
        try:
            self.group: Any = zarr.open_group(str(path), mode="r+" if os.access(path, os.W_OK) else "r")
            attributes = dict(self.group.attrs)
            if int(str(attributes.get("steadyslip_map", 0))) != FORMAT:
                raise KeyError("steadyslip_map")
            self.definition: dict[str, Any] = json.loads(str(attributes["definition"]))
            self.version = str(attributes["steadyslip"])
            self.versions: dict[str, str] = json.loads(str(attributes["versions"]))
            self.rig_text = str(attributes["rig"])
            self.dims: tuple[str, ...] = tuple(json.loads(str(attributes["dims"])))
            self.results: tuple[str, ...] = tuple(json.loads(str(attributes["results"])))
            self.marks: Any = self.group[COMPLETE]
        except (OSError, KeyError, ValueError, TypeError) as error:
            raise NotAvailable(
                f"{str(path)!r} exists and is not a map of this program, or its zarr.json is damaged; give another "
                "name, or move it away"
            ) from error
        self.grid: tuple[int, ...] = tuple(int(n) for n in self.marks.shape)
        self._arrays: dict[str, Any] = {}

    def array(self, name: str) -> Any:
        """One of its Zarr arrays."""
        if name not in self._arrays:
            self._arrays[name] = self.group[name]
        return self._arrays[name]

    # -- what it holds -----------------------------------------------------------------------------------

    @cached_property
    def shape(self) -> tuple[int, ...]:
        return tuple(int(n) for n in self.array(self.results[0]).shape[: len(self.dims)])

    @cached_property
    def chunks(self) -> tuple[int, ...]:
        return tuple(int(n) for n in self.array(self.results[0]).chunks[: len(self.dims)])

    @property
    def count(self) -> int:
        """Number of chunks."""
        return int(np.prod(self.grid, dtype=int))

    @cached_property
    def sampled(self) -> tuple[str, ...]:
        """Parameters along the sample dimension."""
        return tuple(self.definition["samples"].get("over", ()))

    @cached_property
    def generated(self) -> tuple[str, ...]:
        """Those of them whose values are written chunk by chunk."""
        return self.sampled if "method" in self.definition["samples"] else ()

    def read(self, name: str, region: Any = ...) -> np.ndarray:
        """Values of one of its arrays.

        Raises
        ------
        NotAvailable
            If a file is damaged.
        """
        try:
            return np.asarray(self.array(name)[region])
        except (ValueError, RuntimeError, OSError) as error:  # as Zarr says it
            raise self.damage(name, error) from error

    def damage(self, what: str, error: Exception) -> NotAvailable:
        """What to say of files that cannot be read."""
        return NotAvailable(f"{str(self.path)!r} is damaged ({what}: {error}); compute the map again to repair it")

    def rig(self) -> Slider:
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
        place = np.unravel_index(number, self.grid)
        return tuple(
            slice(int(i) * c, min((int(i) + 1) * c, n)) for i, c, n in zip(place, self.chunks, self.shape, strict=True)
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
            file.unlink(missing_ok=True)  # what is left of a damaged chunk must not be read
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
        except OSError:
            return False

    def _marks(self) -> np.ndarray:
        try:
            return np.asarray(self.marks[...]).reshape(-1)
        except Exception:  # a damaged mark, whatever zarr says of it
            return np.array([self._mark(n) for n in range(self.count)], dtype=np.uint64)

    def _mark(self, number: int) -> int:
        try:
            return int(np.asarray(self.marks[np.unravel_index(number, self.grid)]))
        except Exception:  # as above
            return 0

    def _has_samples(self, number: int) -> bool:
        """Whether a chunk is the one that writes the sample parameters of its part of the sample dimension."""
        place = np.unravel_index(number, self.grid)
        return bool(self.generated) and not any(int(i) for i in place[:-1])

    def _files(self, number: int) -> list[Path]:
        """The files of a chunk, in a fixed order."""
        place = tuple(int(i) for i in np.unravel_index(number, self.grid))
        keys = [(name, (*place, *(0,) * (self.array(name).ndim - len(place)))) for name in self.results]
        if self._has_samples(number):
            keys += [(name, place[-1:]) for name in self.generated]
        return [self.path / name / self.array(name).metadata.encode_chunk_key(key) for name, key in keys]

    def _checksum(self, number: int) -> int:
        total = 0
        for file in self._files(number):
            try:
                total = zlib.crc32(file.read_bytes(), zlib.crc32(b"+", total))
            except FileNotFoundError:
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
        for name, values in _coordinates(plan).items():
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
        from steadyslip import __version__

        found = []
        if self.version != __version__:
            found.append(f"steadyslip: was {self.version}, is {__version__}")
        found += differences(self.definition, json.loads(json.dumps(plan.definition())))
        if found:
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


def _coordinates(plan: Map) -> dict[str, np.ndarray]:
    """Parameters whose values are written when the store is made."""
    found = {axis.name: axis.values for axis in plan.axes}
    if plan.sampling and not isinstance(plan.sampling, Generated):
        found |= plan.sampling.part(0, plan.sampling.points)
    return found


def _create(path: Path, plan: Map) -> None:
    """Lay out a store under a temporary name and move it into place, so that there is never half a store."""
    new = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.new")
    try:
        new.mkdir()
        _lay_out(new, plan)
        for file in new.rglob("*"):
            if file.is_file():  # nothing recalculates these
                with open(file, "rb") as written:
                    os.fsync(written.fileno())
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


def _lay_out(path: Path, plan: Map) -> None:
    import zarr
    from zarr.codecs import BloscCodec, BytesCodec, Crc32cCodec

    from steadyslip import __version__

    try:
        rig = rig_to_text(plan.rig, plan.protocol)
    except ParameterError:
        rig = ""
    outputs = plan.outputs()
    group = zarr.create_group(str(path), zarr_format=3)
    group.attrs.update(
        {
            "steadyslip_map": FORMAT,
            "title": str(plan),
            "rig": rig,
            "definition": json.dumps(plan.definition()),
            "dims": json.dumps(plan.dims),
            "results": json.dumps([output.name for output in outputs]),
            "steadyslip": __version__,
            "versions": json.dumps(versions()),
            "coordinates": " ".join(plan.sampling.names) if plan.sampling else "",
        }
    )

    def array(name: str, dims: Any, shape: Any, chunks: Any, dtype: str, fill: Any, **attributes: Any) -> Any:
        wide = np.dtype(dtype).itemsize > 1
        packed = BloscCodec(cname="zstd", clevel=1, shuffle="shuffle" if wide else "noshuffle")
        return group.create_array(
            name, shape=tuple(shape), chunks=tuple(chunks), dtype=dtype, fill_value=fill, dimension_names=tuple(dims),
            compressors=(packed, Crc32cCodec()), serializer=BytesCodec() if wide else "auto", attributes=attributes,
        )  # fmt: skip

    known = roles(plan)
    given = _coordinates(plan)
    for name in plan.varied:
        n = len(given[name]) if name in given else plan.shape[-1]
        part = n if name in given else plan.chunks[-1]
        dim = name if name in plan.dims else SAMPLE
        made = array(name, [dim], [n], [part], "float64", np.nan, units=known[name].unit, long_name=known[name].doc)
        if name in given:
            made[:] = given[name]
    for output in outputs:
        sizes = [size for _, size in output.extra]
        attributes: dict[str, Any] = {"units": output.unit, "long_name": output.meaning}
        if output.flags:
            attributes["flag_values"] = list(range(-1, len(output.flags)))
            attributes["flag_meanings"] = " ".join(word.replace(" ", "_") for word in ("not computed", *output.flags))
        array(
            output.name, [*plan.dims, *(dim for dim, _ in output.extra)], [*plan.shape, *sizes],
            [*plan.chunks, *sizes], output.dtype, output.fill, **attributes,
        )  # fmt: skip
    grid = [-(-n // c) for n, c in zip(plan.shape, plan.chunks, strict=True)]
    group.create_array(
        COMPLETE, shape=tuple(grid), chunks=(1,) * len(grid), dtype="uint64", fill_value=0, compressors=None,
        dimension_names=[f"{dim}_chunk" for dim in plan.dims],
        attributes={"units": "1", "long_name": "checksum of each finished chunk, 0 until then"},
    )  # fmt: skip
    with warnings.catch_warnings():  # readers list nothing then; the specification is on its way
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(path))


def versions() -> dict[str, str]:
    """Of the packages that numbers depend on."""
    from importlib.metadata import version

    return {name: version(name) for name in _VERSIONS}


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
