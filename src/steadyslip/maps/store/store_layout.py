"""Layout of a map on disk: the arrays of a `MapLayout`, created for a new map and verified when one is opened.

Zarr format 3 only, with a fixed set of element types and codecs, so that reading a map can give nothing but numbers.
The group's metadata contain those of all arrays, and a checksum of themselves.
"""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable, ParameterError
from steadyslip.core.version import version
from steadyslip.files.inputs import read_bytes
from steadyslip.files.result_tables import fits_form
from steadyslip.files.sealed import fingerprint
from steadyslip.files.specifications import stored_text
from steadyslip.maps.plan.axes import COMPLETE, MOST_POINTS, SAMPLE, Generated
from steadyslip.maps.plan.map import MOST_AXIS, MOST_CHUNKS, Map, roles
from steadyslip.maps.plan.measures import NOT_DONE
from steadyslip.maps.store.folder import METADATA

FORMAT = 2  # version number of the layout
MOST_CHUNK = 2**30  # bytes, largest chunk of one array: fits into the memory of any machine
MOST_EXTRA = 1000  # largest number of values of a result at one point; chosen by trial, far more than any measure has
_VERSIONS = ("numpy", "scipy", "llvmlite", "zarr")
_TEXTS = ("title", "rig", "rig_file", "definition", "dims", "results", "steadyslip", "versions", "coordinates",
          "seal")  # fmt: skip
_ARRAY = {"shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "attributes",
          "dimension_names", "zarr_format", "node_type", "storage_transformers"}  # fmt: skip
_FILL = {"float64": np.nan, "int8": NOT_DONE, "uint64": 0}  # fill values, which mean that nothing is computed yet
_PACKED, _PLAIN = ("bytes", "blosc", "crc32c"), ("bytes",)


REASONS = ("missing", "infinite")  # fields of `Output` that are stored as attributes of a result

Form = tuple[tuple[str, ...], tuple[int, ...], tuple[int, ...]]


class LayoutError(ValueError):
    """Error: the metadata of a folder are not those of a map."""


@dataclass(frozen=True)
class StoredArray:
    """Metadata of one array."""

    dtype: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    attributes: dict[str, Any]

    @property
    def form(self) -> Form:
        return self.dims, self.shape, self.chunks

    @property
    def unpacked(self) -> int:
        """Size of a chunk in memory (uncompressed), bytes."""
        return math.prod(self.chunks) * np.dtype(self.dtype).itemsize


@dataclass(frozen=True)
class MapLayout:
    """Metadata of a map.

    Attributes
    ----------
    definition, versions : dict
    version, title, rig_text, rig_file : str
        `version` is that of the program that computed the map; `rig_file` is the name of the file from which the rig
        was read, empty if there is none.
    dims, results, sampled, generated : tuple of str
        Names of the dimensions; of the results; of the parameters along the sample dimension, and of those among them
        that are generated and stored chunk by chunk.
    shape, chunks, grid : tuple of int
        Points of the map, points of a chunk, and number of chunks, along each dimension.
    arrays : dict of str to StoredArray
    """

    definition: dict[str, Any]
    versions: dict[str, str]
    version: str
    title: str
    rig_text: str
    rig_file: str
    dims: tuple[str, ...]
    results: tuple[str, ...]
    sampled: tuple[str, ...]
    generated: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    arrays: dict[str, StoredArray]

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of chunks along each dimension."""
        return tuple(-(-n // c) for n, c in zip(self.shape, self.chunks, strict=True))

    def form(self, name: str, extra: Sequence[tuple[str, int]] = ()) -> Form:
        """Dimensions, shape and chunks of an array: a result (with dimensions `extra`), a parameter, or the marks."""
        if name == COMPLETE:
            return tuple(f"{dim}_chunk" for dim in self.dims), self.grid, (1,) * len(self.dims)
        if name in self.results:
            dims, sizes = (tuple(each) for each in zip(*extra, strict=True)) if extra else ((), ())
            return (*self.dims, *dims), (*self.shape, *sizes), (*self.chunks, *sizes)
        dim = SAMPLE if name in self.sampled else name
        size, part = ((column[self.dims.index(dim)],) for column in (self.shape, self.chunks))
        return (dim,), size, part if name in self.generated else size


# -- reading


def read_layout(path: Path) -> MapLayout:
    """Read and verify the layout of the map in a folder.

    Raises
    ------
    NotAvailable
        If there is no map, or its layout is not one that this program writes.
    """
    try:
        return _layout(json.loads(read_bytes(path / "zarr.json", METADATA, links=False)))
    except (NotAvailable, ValueError, RecursionError) as error:
        reason = str(error) if isinstance(error, (LayoutError, NotAvailable)) else "zarr.json is not JSON"
        raise NotAvailable(
            f"{str(path)!r} exists and is not a map of this program, or its zarr.json is damaged ({reason}); give "
            "another name, or move it away"
        ) from error


def _layout(document: Any) -> MapLayout:
    _require(fits_form(document, {"attributes": dict, "zarr_format": int, "consolidated_metadata": dict,
                                 "node_type": str}), "it is no Zarr group of format 3")  # fmt: skip
    _require((document["zarr_format"], document["node_type"]) == (3, "group"), "it is no Zarr group of format 3")
    attributes = {"rig_file": ""} | document["attributes"]  # maps of earlier versions have no rig_file
    _require("steadyslip_map" in attributes, "it has no steadyslip_map")
    version = attributes["steadyslip_map"]
    _require(version == FORMAT, f"its layout has version {version!r:.20}, and this program reads version {FORMAT}")
    form = {"steadyslip_map": int} | dict.fromkeys(_TEXTS, str)
    _require(fits_form(attributes, form), "its attributes are not those of a map")
    _require(_seal(document) == attributes["seal"], "it was changed since it was written")
    definition = _json(attributes, "definition", {"rig": dict, "compute": dict, "over": {str: dict}, "samples": dict})
    dims, results = (tuple(_json(attributes, name, [str])) for name in ("dims", "results"))
    samples = definition["samples"]
    over = samples.get("over", {})
    tables = isinstance(over, dict) and all(isinstance(one, dict) for one in over.values())
    _require(tables, "its samples have no valid over")
    sampled = tuple(over)
    defined = (*definition["over"], *([SAMPLE] if samples else []))
    _require(dims == defined and dims, "dims do not agree with its definition")
    sizes = [one.get("points", one.get("values")) for one in definition["over"].values()]
    sizes += [samples.get("points")] if samples else []
    _require(fits_form(sizes, [int]) and all(n > 0 for n in sizes), "the definition has no numbers of points")
    stored = document["consolidated_metadata"].get("metadata")
    _require(isinstance(stored, dict), "the metadata of its arrays are missing")
    varied = (*definition["over"], *sampled)
    names = (*varied, *results, COMPLETE)
    _require(len(set(names)) == len(names) and set(stored) == set(names), "its arrays are not those of its definition")
    arrays = {name: _array(name, stored[name], _PLAIN if name == COMPLETE else _PACKED) for name in names}
    _require(results, "it has no results")
    chunks = arrays[results[0]].chunks[: len(dims)]
    _require(len(chunks) == len(dims), f"{results[0]!r:.60} has {len(chunks)} dimensions")
    found = MapLayout(
        definition, _json(attributes, "versions", {str: str}), attributes["steadyslip"], attributes["title"],
        attributes["rig"], attributes["rig_file"], dims, results, sampled, sampled if "method" in samples else (),
        tuple(sizes), chunks, arrays,
    )  # fmt: skip
    _check_arrays(found)
    return found


def _require(condition: object, message: str) -> None:
    if not condition:
        raise LayoutError(message)


def _json(attributes: dict[str, Any], name: str, form: Any) -> Any:
    found = json.loads(attributes[name])
    _require(fits_form(found, form), f"its attribute {name} has a wrong structure")
    return found


def _array(name: str, stored: Any, codecs: tuple[str, ...]) -> StoredArray:
    def demand(condition: object, what: str) -> None:
        _require(condition, f"{name!r:.60}: {what}")

    demand(name not in ("", ".", "..", "zarr.json") and not {"/", "\0"} & set(name), "is no name of an array")
    demand(isinstance(stored, dict) and set(stored) == _ARRAY, "wrong keys in its metadata")
    format_ = (stored["zarr_format"], stored["node_type"], stored["storage_transformers"])
    demand(format_ == (3, "array", []), "wrong Zarr format")
    dtype = stored["data_type"]
    demand(dtype in ("uint64",) if codecs == _PLAIN else dtype in ("float64", "int8"), "wrong element type")
    demand(stored["fill_value"] == ("NaN" if dtype == "float64" else _FILL[dtype]), "wrong fill value")
    kinds = [one.get("name") if isinstance(one, dict) else None for one in _listed(stored["codecs"])]
    demand(tuple(kinds) == codecs, f"codecs are {kinds!r:.60}, allowed: {', '.join(codecs)}")
    options = [one.get("configuration", {}) for one in stored["codecs"]]
    demand(fits_form(options, [dict]) and options[0].get("endian", "little") == "little", "wrong codec options")
    demand(len(options) == 1 or options[1].get("cname") == "zstd", "wrong codec options")
    keys = {"name": "default", "configuration": {"separator": "/"}}
    demand(stored["chunk_key_encoding"] == keys, "wrong chunk_key_encoding")
    parts = stored["chunk_grid"]
    demand(fits_form(parts, {"name": str, "configuration": {"chunk_shape": [int]}}), "wrong chunk_grid")
    dims, shape, chunks = stored["dimension_names"], stored["shape"], parts["configuration"]["chunk_shape"]
    demand(parts["name"] == "regular" and fits_form(dims, [str]) and fits_form(shape, [int]), "wrong shape or chunks")
    demand(len(dims) == len(shape) == len(chunks) <= 32, "wrong number of dimensions")
    demand(all(c > 0 and n > 0 for n, c in zip(shape, chunks, strict=True)), f"has shape {shape} in chunks of {chunks}")
    attributes = stored["attributes"]
    demand(isinstance(attributes, dict) and isinstance(attributes.get("units"), str), "has no units")
    demand(isinstance(attributes.get("long_name"), str), "has no long_name")
    words = attributes.get("flag_meanings")
    demand((dtype == "int8") == isinstance(words, str), "flag_meanings missing, or given for floats")
    return StoredArray(dtype, tuple(dims), tuple(shape), tuple(chunks), attributes)


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _check_arrays(layout: MapLayout) -> None:
    """Raise an error if a shape does not follow from the definition, or an array is too large."""
    rank = len(layout.dims)
    _require(math.prod(layout.shape) <= MOST_POINTS, f"it has more than {MOST_POINTS:.0e} points")
    _require(math.prod(layout.grid) <= MOST_CHUNKS, f"it has {math.prod(layout.grid)} chunks, allowed: {MOST_CHUNKS}")
    for name, one in layout.arrays.items():
        extra = tuple(zip(one.dims, one.shape, strict=True))[rank:] if name in layout.results else ()
        _require(one.form == layout.form(name, extra), f"{name!r:.60} has shape {one.shape} in {one.chunks}")
        if name in layout.results:
            small = math.prod(size for _, size in extra) <= MOST_EXTRA and one.unpacked <= MOST_CHUNK
            _require(small, f"a chunk of {name!r:.60} is too large")
        elif name != COMPLETE:
            _require(one.dtype == "float64", f"{name!r:.60} has no numbers")
            small = name in layout.generated or one.shape[0] <= MOST_AXIS
            _require(small, f"{name!r:.60} has more than {MOST_AXIS} values")


def _seal(document: dict[str, Any]) -> str:
    attributes = {name: value for name, value in document["attributes"].items() if name != "seal"}
    return fingerprint(document | {"attributes": attributes})


# -- writing


def new_layout(plan: Map) -> MapLayout:
    """MapLayout of a map that is to be created, with its arrays."""
    try:
        rig = stored_text(plan.rig, plan.protocol)
    except ParameterError:
        rig = ""
    outputs = plan.outputs()
    sampled = tuple(plan.sampling.names) if plan.sampling else ()
    layout = MapLayout(
        plan.definition(), versions(), version(), str(plan), rig, plan.rig.read_from, tuple(plan.dims),
        tuple(o.name for o in outputs), sampled, sampled if isinstance(plan.sampling, Generated) else (),
        tuple(plan.shape), tuple(plan.chunks), {},
    )  # fmt: skip
    known = roles(plan)
    for name in plan.varied:
        described = {"units": known[name].unit, "long_name": known[name].doc}
        layout.arrays[name] = StoredArray("float64", *layout.form(name), described)
    for output in outputs:
        attributes: dict[str, Any] = {"units": output.unit, "long_name": output.meaning}
        if output.flags:
            attributes["flag_values"] = list(range(-1, len(output.flags)))
            attributes["flag_meanings"] = " ".join(word.replace(" ", "_") for word in ("not computed", *output.flags))
        attributes |= {key: text for key in REASONS if (text := getattr(output, key))}
        layout.arrays[output.name] = StoredArray(output.dtype, *layout.form(output.name, output.extra), attributes)
    described = {"units": "1", "long_name": "checksum of each finished chunk, 0 until then"}
    layout.arrays[COMPLETE] = StoredArray("uint64", *layout.form(COMPLETE), described)
    return layout


def lay_out(path: Path, plan: Map) -> None:
    """Create all arrays of a map in an empty folder, and write its coordinates."""
    import zarr
    from zarr.codecs import BloscCodec, BytesCodec, Crc32cCodec

    layout = new_layout(plan)
    group = zarr.create_group(str(path), zarr_format=3)
    group.attrs.update(
        {
            "steadyslip_map": FORMAT,
            "title": layout.title,
            "rig": layout.rig_text,
            "rig_file": layout.rig_file,
            "definition": json.dumps(layout.definition),
            "dims": json.dumps(layout.dims),
            "results": json.dumps(layout.results),
            "steadyslip": layout.version,
            "versions": json.dumps(layout.versions),
            "coordinates": " ".join(layout.sampled),
        }
    )
    for name, one in layout.arrays.items():
        wide = np.dtype(one.dtype).itemsize > 1
        packed = BloscCodec(cname="zstd", clevel=1, shuffle="shuffle" if wide else "noshuffle")
        group.create_array(
            name, shape=one.shape, chunks=one.chunks, dtype=one.dtype, fill_value=_FILL[one.dtype],
            dimension_names=one.dims, compressors=None if name == COMPLETE else (packed, Crc32cCodec()),
            serializer=BytesCodec() if wide else "auto", attributes=one.attributes,
        )  # fmt: skip
    for name, values in coordinates(plan).items():
        group[name][:] = values
    with warnings.catch_warnings():  # Zarr warns that consolidated metadata are not yet part of format 3
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(path))
    _seal_file(path / "zarr.json")
    for file in path.rglob("*"):
        if file.is_file():  # flush metadata and coordinates to disk, because they cannot be recomputed
            with open(file, "rb") as written:
                os.fsync(written.fileno())


def _seal_file(file: Path) -> None:
    document = json.loads(file.read_bytes())
    document["attributes"]["seal"] = _seal(document)
    file.write_text(json.dumps(document, indent=2), encoding="utf-8")


def coordinates(plan: Map) -> dict[str, np.ndarray]:
    """Values (SI units), by name, of the parameters that are written when the store is created."""
    found = {axis.name: axis.values for axis in plan.axes}
    if plan.sampling and not isinstance(plan.sampling, Generated):
        found |= plan.sampling.part(0, plan.sampling.points)
    return found


def versions() -> dict[str, str]:
    """Versions, by name, of the installed packages on which results depend."""
    from importlib.metadata import version

    return {name: version(name) for name in _VERSIONS}
