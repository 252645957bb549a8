"""Computed map, complete or in part: values, summary, export and figures."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.areas import outside
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.core.format import format_growth, format_percent, format_quantity, format_range
from steadyslip.core.options import checked
from steadyslip.core.pages import Displayed
from steadyslip.core.pictures import draw
from steadyslip.core.version import of_another
from steadyslip.files.specifications import protocol_from_text
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan.measures import NO_EDGE, NOT_SLIDING
from steadyslip.maps.store.map_store import Store
from steadyslip.maps.view import export
from steadyslip.protocol import Protocol

BLOCK = 2**22  # largest number of values read at a time: 32 MiB


class MapResult(Displayed):
    """Map stored on disk, complete or in part.

    Opening reads no results; `dataset` reads on demand. A map that is still being computed can be opened too; it
    contains the finished chunks.
    """

    def __init__(self, store: Store) -> None:
        self._store = store

    @property
    def path(self) -> Path:
        return self._store.path

    @property
    def store(self) -> Store:
        """Store of the map."""
        return self._store

    @property
    def rig(self) -> Slider | Machine:
        """Rig of the map, without the variations; NotAvailable if it has a law that cannot be written to a file."""
        return self._store.rig()

    @property
    def protocol(self) -> Protocol | None:
        """Protocol of measures that simulate; None if the map has none."""
        return protocol_from_text(str(self.dataset.attrs["rig"]), str(self.path))

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions: parameters on axes, and ``sample`` for parameters that vary together."""
        return self._store.dims

    @property
    def shape(self) -> tuple[int, ...]:
        return self._store.shape

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape, dtype=int))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters that vary, by full name."""
        return self._store.coordinates

    @property
    def results(self) -> tuple[str, ...]:
        """Names of the computed arrays."""
        return self._store.results

    @property
    def finished(self) -> tuple[int, int]:
        """Number of finished chunks, and of all chunks."""
        return self._store.marked(), self._store.count

    @property
    def complete(self) -> bool:
        """True if every chunk is done."""
        done, count = self.finished
        return done == count

    def damaged(self) -> list[int]:
        """Numbers of chunks whose files were changed or damaged; `run_map` computes them again."""
        return self._store.damaged()

    @property
    def dataset(self) -> Any:
        """xarray.Dataset that reads from disk on demand; units are in the attributes.

        Raises
        ------
        NotAvailable
            If a file is damaged; for chunks it is raised when they are read.
        """
        import xarray as xr

        from steadyslip.maps.view.export import lazily

        try:
            data = xr.open_zarr(
                self._store.folder.with_read_only(True),
                chunks=None,
                consolidated=True,
                decode_times=False,
                mask_and_scale=False,
            )
        except (ValueError, RuntimeError, OSError) as error:  # coordinates are read at this point
            raise self._store.damage("coordinates", error) from error
        return lazily(data, self._store)

    def words(self, name: str) -> tuple[str, ...]:
        """Meanings of the numbers 0, 1, ... of a result with kinds, such as status; empty for numeric results."""
        meanings = str(self._store.layout.arrays[self._known(name)].attributes.get("flag_meanings", ""))
        return tuple(word.replace("_", " ") for word in meanings.split()[1:])

    def _known(self, name: str) -> str:
        if name not in self.results:
            raise ParameterError([Problem("show", unknown_name("result", name, self.results))])
        return name

    def unit(self, name: str) -> str:
        """SI unit of a result or parameter."""
        if name not in (*self.results, *self.parameters):
            raise ParameterError([Problem("name", unknown_name("array", name, (*self.results, *self.parameters)))])
        return str(self._store.layout.arrays[name].attributes["units"])

    def why_missing(self, name: str) -> str:
        """Reason why points may have no value of a result (`Output.missing`); empty in maps of earlier versions."""
        return str(self._store.layout.arrays[name].attributes.get("missing", ""))

    def what_infinite(self, name: str) -> str:
        """Meaning of an infinite value of a result (`Output.infinite`); "without limit" if it is not stored."""
        return str(self._store.layout.arrays[name].attributes.get("infinite", "without limit"))

    def along(self, name: str) -> str | None:
        """Option `along` of a result that is an edge: the parameter chosen; None if none was chosen."""
        given = self._store.layout.definition["compute"].get(name, {})
        return given.get("along") if isinstance(given, dict) else None

    def area(self, name: str) -> float | None:
        """Contact area (m²) with which a result or parameter is shown as a total; None if it is shown per area."""
        try:
            return self.rig.area_of(name)
        except (NotAvailable, ParameterError):
            return None

    def statistics(self) -> dict[str, dict[str, float]]:
        """Statistics of the finished chunks by result: share of each kind, or for numbers ``low``, ``high``, ``share``.

        ``share`` is that of points with a finite value, ``infinite`` (if not zero) that of points with an infinite one.
        """
        store = self._store
        pending = store.pending()
        total = self.size - sum(store.points(number) for number in pending)
        found: dict[str, dict[str, float]] = {}
        for name in self.results if total else ():
            words = self.words(name)
            counts, low, high, exist, endless = np.zeros(len(words) + 1), np.inf, -np.inf, 0, 0
            for values in self._blocks(name):
                if words:
                    counts += np.bincount(values.reshape(-1).astype(int) + 1, minlength=len(counts))
                    continue
                finite = np.isfinite(values)
                inner = tuple(range(len(self.dims), values.ndim))
                exist += int(np.count_nonzero(finite.any(axis=inner)))
                endless += int(np.count_nonzero(np.isinf(values).any(axis=inner) & ~finite.any(axis=inner)))
                low = min(low, float(np.min(values, initial=np.inf, where=finite)))
                high = max(high, float(np.max(values, initial=-np.inf, where=finite)))
            if words:
                found[name] = {word: float(n / total) for word, n in zip(words, counts[1:], strict=True) if n}
            else:
                found[name] = {"share": exist / total} | ({"low": low, "high": high} if exist else {})
                found[name] |= {"infinite": endless / total} if endless else {}
        return found

    def _blocks(self, name: str) -> Iterator[np.ndarray]:
        """Yield the values of a result in blocks of several chunks, without blocks that have no finished chunk."""
        store = self._store
        marks = store.marks_of_grid() != 0
        extra = int(np.prod(store.layout.arrays[name].shape[len(self.dims) :], dtype=int))
        rest = [int(np.prod(self.shape[axis + 1 :], dtype=int)) * extra for axis in range(len(self.dims))]
        axis = next(i for i, n in enumerate(rest) if n * store.chunks[i] <= BLOCK or i + 1 == len(rest))
        several = max(1, BLOCK // (store.chunks[axis] * rest[axis]))  # chunks along that axis in a block
        for outer in np.argwhere(marks.any(axis=tuple(range(axis, marks.ndim)))):
            before = tuple(slice(int(i) * c, (int(i) + 1) * c) for i, c in zip(outer, store.chunks, strict=False))
            own = marks[tuple(outer)]
            for start in range(0, own.shape[0], several):
                if own[start : start + several].any():
                    along = slice(start * store.chunks[axis], (start + several) * store.chunks[axis])
                    yield self.read(name, (*before, along))

    def read(self, name: str, region: Any = ...) -> np.ndarray:
        """Values (SI units) of a result or parameter, or of a region of it.

        Raises
        ------
        NotAvailable
            If a file is damaged.
        """
        return self._store.read(name, region)

    def __str__(self) -> str:
        done, count = self.finished
        lines = [self._store.layout.title]
        state = "complete" if done == count else f"{done} of {count} chunks; run it again for the rest"
        lines.append(f"  {'in ' + str(self.path):<22}  {state}")
        if other := of_another(self._store.version):
            lines.append(f"  {'version':<22}  {other}")
        statistics = self.statistics()
        width = max([24, *(len(name) + 2 for name in statistics)])
        for name, found in statistics.items():
            if self.words(name):
                text = ", ".join(f"{word} {format_percent(share)}" for word, share in found.items())
            elif "low" in found:
                low, high, unit, area = found["low"], found["high"], self.unit(name), self.area(name)
                text = format_range(low, high, unit, area) if low < high else format_quantity(low, unit, area=area)
                text = format_growth(low, high if low < high else None) if unit == "1/s" else text
                text += "" if found["share"] == 1 else f", for {format_percent(found['share'])} of the points"
            else:
                text = "nowhere" if "infinite" not in found else "nowhere finite"
            endless = found.get("infinite", 0.0)
            text += f"; {self.what_infinite(name)} for {format_percent(endless)}" if endless else ""
            if (
                self.why_missing(name) in (NOT_SLIDING, NO_EDGE)
                and "status" not in self.results
                and round(found.get("share", 1) + endless, 12) < 1
            ):
                text += "; compute status as well to see why the others have none"
            lines.append(f"  {name:<{width}}{text}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        done, count = self.finished
        return f"<MapResult: {self._store.layout.title}, {done} of {count} chunks>"

    def to_dict(self) -> dict[str, Any]:
        """Result as JSON-ready dict in SI units: content, progress and statistics."""
        (done, count), statistics = self.finished, self.statistics()
        ends = {name: {k: v for k, v in one.items() if k in ("low", "high")} for name, one in statistics.items()}
        scaled = {name: outside(self.unit(name), self.area(name)) for name, one in ends.items() if one}
        forces = {
            name: {end: value * factor for end, value in ends[name].items()} | {"unit": unit}
            for name, (factor, unit) in scaled.items()
            if unit != self.unit(name)
        }
        return {
            "version": self._store.version,
            "path": str(self.path),
            "dims": dict(zip(self.dims, self.shape, strict=True)),
            "parameters": {name: self.unit(name) for name in self.parameters},
            "results": {name: self.unit(name) for name in self.results},
            "chunks": {"finished": done, "all": count},
            "statistics": statistics,
        } | ({"forces": {"area": self.area(next(iter(forces))), "statistics": forces}} if forces else {})

    def to_netcdf(self, path: str | PathLike[str]) -> None:
        """Write one netCDF file, with missing values in unfinished chunks.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        export.to_netcdf(self.store, self.read, path)

    def to_parquet(self, path: str | PathLike[str]) -> None:
        """Write one Parquet file with a row for each point.

        Raises
        ------
        NotAvailable
            If the file cannot be written, or pyarrow is missing.
        """
        export.to_parquet(self.store, self.read, path)

    def plot(self, x: str | None = None, y: str | None = None, show: str | None = None, **options: Any) -> Any:
        """Draw the map; see `steadyslip.figures.map_figure`."""
        return draw(self, x=x, y=y, show=show, **options)


@checked()
def open_map(path: str | PathLike[str]) -> MapResult:
    """Open a map that `run_map` made, finished or not.

    Raises
    ------
    NotAvailable
        If it does not exist.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> plan = ss.Map(rig, {"stiffness": [10e9, 40e9]}, ["status"])
    >>> found = ss.run_map(plan, "small.zarr")
    >>> ss.open_map("small.zarr").complete
    True
    """
    target = Path(path)
    if not target.exists():
        raise NotAvailable(f"there is no map {str(path)!r}")
    return MapResult(Store(target))
