"""The table ``[map]`` of a rig file to a `Map`; every problem of the file is found and reported at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import (
    InternalError,
    ParameterError,
    Problem,
    RigFileError,
    SteadyslipError,
    UnknownNameError,
    unknown_name,
)
from steadyslip.core.records import Address, parameters, resolve
from steadyslip.files.specifications.layout import MAP
from steadyslip.files.specifications.lines import line_of
from steadyslip.files.specifications.read import Reader, from_tables, number, parsed, text_of
from steadyslip.maps.plan.axes import Grid, Samples
from steadyslip.maps.plan.map import Map
from steadyslip.maps.plan.measures import Measure
from steadyslip.protocol import Protocol

KEYS = ("compute", "over", "samples", "chunk")
GRID_KEYS = ("from", "to", "points", "spacing")
RANGE_KEYS = ("from", "to", "spacing")
SAMPLE_KEYS = ("over", "points", "method", "seed", "fit")
FIT_POINTS = 1000


def read_map(path: str | PathLike[str], changes: Iterable[str] = ()) -> Map:
    """Read a rig file with a table ``[map]``.

    Parameters
    ----------
    path : path
        TOML file; a fit named in it is looked for beside it.
    changes : iterable of str
        Values that replace or complete those of the file, as ``"map.over.contact.angle.points=200"``.

    Returns
    -------
    Map

    Raises
    ------
    RigFileError
        Listing everything that is wrong.
    """
    return map_from_text(text_of(path), str(path), changes, Path(path).parent)


def map_from_text(text: str, source: str = "map", changes: Iterable[str] = (), folder: Path = Path()) -> Map:
    """Read the text of such a file; see `read_map`."""
    tables, lines, problems = parsed(text, source, changes)
    reader = _MapReader(tables.pop(MAP, None), folder)
    found = None
    try:
        rig, protocol = from_tables(tables, lines, source, problems)
        if rig is None:
            raise InternalError("rig is not None")
        known = rig.parameters() | parameters(protocol or Protocol(), "protocol.")
        reader.check_names(known)
        reader.read_totals(known, rig.area)
        if reader.arguments:
            found = Map(rig, protocol=protocol, **reader.arguments)
        problems = []
    except ParameterError as error:
        problems = list(error.problems)
    problems += reader.problems
    if problems or found is None:
        placed = sorted({_placed(p, lines, reader) for p in problems}, key=lambda p: (p.line or 0, p.name))
        raise RigFileError(placed, title=source)
    return found


def _placed(problem: Problem, lines: dict[str, int], reader: _MapReader) -> Problem:
    """With its line: full names as the file writes them."""
    name = problem.name
    for prefix in ("map.over.", "map.samples.over."):
        full = "." + name.removeprefix(prefix) + "."
        for written in sorted(reader.written, key=len, reverse=True):
            if name.startswith(prefix) and f".{written}." in full:
                return Problem(name, problem.message, problem.line or line_of(prefix + written, lines))
    return Problem(name, problem.message, problem.line or line_of(name, lines))


class _MapReader:
    """The arguments of `Map` from a table, and what is wrong with it."""

    def __init__(self, table: Any, folder: Path) -> None:
        self.problems: list[Problem] = []
        self.arguments: dict[str, Any] = {}
        self.written: list[str] = []
        self.left_out: list[str] = []
        self.folder = folder
        if not isinstance(table, dict):
            came = "missing table; write" if table is None else f"got {table!r}; allowed:"
            self._problem(
                MAP, f"{came} [map] with compute = ['status'] and [map.over] with parameters and their values"
            )
            return
        self._read(table)

    def check_names(self, known: Iterable[str]) -> None:
        """Of parameters whose values are wrong already; the others are checked by the `Map`."""
        for name in self.left_out:
            try:
                resolve(name, dict.fromkeys(known))
            except UnknownNameError as error:
                self._problem(f"map.over.{name}", str(error))

    def read_totals(self, known: Mapping[str, Address], area: float | None) -> None:
        """Where the rig has an area, take values for the whole of it, as everywhere in its file."""
        if area is None or "over" not in self.arguments:  # without [map], which is told already
            return
        self.arguments["over"] = self._per_area("map.over", self.arguments["over"], known, area)
        samples = self.arguments.get("samples")
        if isinstance(samples, Samples):
            over = self._per_area("map.samples.over", samples.over, known, area)
            self.arguments["samples"] = replace(samples, over=over)

    def _per_area(
        self, place: str, over: Mapping[str, Any], known: Mapping[str, Address], area: float
    ) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, given in over.items():
            found[name] = given
            try:
                role = known[resolve(name, known)].role
            except UnknownNameError:
                continue  # the map will say so
            try:
                if isinstance(given, Grid):
                    start, stop = (number(role, end, area) for end in (given.start, given.stop))
                    found[name] = replace(given, start=start, stop=stop)
                elif isinstance(given, tuple):
                    found[name] = (number(role, given[0], area), number(role, given[1], area), *given[2:])
                elif isinstance(given, list):
                    found[name] = [number(role, value, area) for value in given]
            except ParameterError as error:
                del found[name]
                self.problems += [p.under(f"{place}.{name}") for p in error.problems]
        return found

    def _problem(self, name: str, message: str) -> None:
        self.problems.append(Problem(name, message))

    def _read(self, table: dict[str, Any]) -> None:
        known = (*KEYS, *Measure.registry)
        measures: dict[str, dict[str, Any]] = {}
        for name, value in table.items():
            if name not in KEYS and isinstance(value, dict):
                measures[name] = value
            elif name not in KEYS:
                self._problem(f"map.{name}", unknown_name("key", name, known))
        if "compute" in table or measures:
            self.arguments["compute"] = self._compute(table.get("compute", []), measures)
        over = self._flat(table.get("over", {}), "map.over")
        axes = {name: self._axis(f"map.over.{name}", value) for name, value in over.items()}
        self.arguments["over"] = {name: axis for name, axis in axes.items() if not isinstance(axis, dict)}
        self.left_out = [name for name, axis in axes.items() if isinstance(axis, dict)]
        if "chunk" in table:
            self.arguments["chunk"] = table["chunk"]
        if "samples" in table:
            self.arguments["samples"] = self._samples(table["samples"])

    def _compute(self, given: Any, options: dict[str, dict[str, Any]]) -> list[Any]:
        names = [given] if isinstance(given, str) else given
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            self._problem("map.compute", f"got {given!r}; allowed: a list of {', '.join(Measure.registry)}")
            return []
        for name in options:
            if name not in names:
                message = unknown_name("key", name, (*KEYS, *Measure.registry))
                hint = f"options of something that is not computed; add {name!r} to map.compute"
                self._problem(f"map.{name}", hint if name in Measure.registry else message)
        reader = Reader({})
        found = [self._measure(reader, name, options.get(name)) for name in names]
        self.problems += reader.problems
        return [one for one in found if one is not None]

    def _measure(self, reader: Reader, name: str, options: dict[str, Any] | None) -> Any:
        if options is None:
            return name
        if "law" in options:
            self._problem(f"map.{name}.law", "is not an option; the table is named after the result")
            return None
        return reader.record(Measure, {"law": name, **options}, f"map.{name}.")

    def _flat(self, table: Any, name: str) -> dict[str, Any]:
        """Names and values, where unquoted dots have made tables of parts of names."""
        if not isinstance(table, dict):
            self._problem(name, f"got {table!r}; allowed: parameters and their values")
            return {}
        found: dict[str, Any] = {}

        def walk(prefix: str, inner: dict[str, Any]) -> None:
            for key, value in inner.items():
                full = f"{prefix}{key}"
                is_leaf = not isinstance(value, dict) or not value or any(
                    k in GRID_KEYS and not isinstance(v, dict) for k, v in value.items()
                )  # fmt: skip
                if not is_leaf:
                    walk(f"{full}.", value)
                elif isinstance(value, dict) and isinstance(found.get(full), dict):
                    found[full] = found[full] | value
                else:
                    found[full] = value

        walk("", table)
        for name in [n for n in found if "." in n]:  # a change by full name of what the file calls by its last part
            short = next((n for n in found if n != name and name.endswith(f".{n}")), None)
            if short is not None and isinstance(found[name], dict) and isinstance(found[short], dict):
                found[short] = found[short] | found.pop(name)
        self.written += found
        return found

    def _axis(self, name: str, value: Any) -> Any:
        if not isinstance(value, dict) or not self._keys_are_right(name, value, GRID_KEYS, ("from", "to", "points")):
            return value
        return Grid(value.get("from"), value.get("to"), value.get("points", 1), value.get("spacing", "linear"))

    def _keys_are_right(
        self, name: str, table: Mapping[str, Any], known: tuple[str, ...], needed: tuple[str, ...]
    ) -> bool:
        before = len(self.problems)
        for key in table:
            if key not in known:
                self._problem(f"{name}.{key}", unknown_name("key", key, known))
        for key in needed:
            if key not in table:
                self._problem(f"{name}.{key}", f"missing; write {{ {' = ..., '.join(needed)} = ... }}")
        return len(self.problems) == before

    def _samples(self, table: Any) -> Any:
        if not isinstance(table, dict):
            self._problem("map.samples", f"got {table!r}; allowed: a table with over and points, or with fit")
            return None
        for key in table:
            if key not in SAMPLE_KEYS:
                self._problem(f"map.samples.{key}", unknown_name("key", key, SAMPLE_KEYS))
        if "fit" in table:
            return self._of_fit(table)
        over = self._flat(table.get("over", {}), "map.samples.over")
        ranges = {}
        for name, value in over.items():
            if not isinstance(value, dict):
                self._problem(f"map.samples.over.{name}", f"got {value!r}; allowed: {{from = ..., to = ...}}")
                continue
            if self._keys_are_right(f"map.samples.over.{name}", value, RANGE_KEYS, ("from", "to")):
                ranges[name] = (value["from"], value["to"], value.get("spacing", "linear"))
        if "points" not in table:
            self._problem("map.samples.points", "missing; give the number of sample points, such as 1024")
        return Samples(ranges, table.get("points", 1), table.get("method", "sobol"), table.get("seed", 0))

    def _of_fit(self, table: dict[str, Any]) -> Any:
        from steadyslip.experiments import load_fit, normal_draws

        for key in ("over", "method"):
            if key in table:
                self._problem(f"map.samples.{key}", "is for samples of ranges; a fit says itself what varies, and how")
        points, seed = table.get("points", FIT_POINTS), table.get("seed", 0)
        for key, value, least in (("points", points, 1), ("seed", seed, 0)):
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                self._problem(f"map.samples.{key}", f"got {value!r}; allowed: a whole number >= {least}")
                return None
        try:
            return normal_draws(load_fit(self.folder / str(table["fit"])), points, seed)
        except SteadyslipError as error:
            self._problem("map.samples.fit", str(error))
            return None
