"""Reading of the table ``[map]`` of a rig file as a `Map`, with all problems of the file reported together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.errors import InternalError, ParameterError, Problem, SteadyslipError, UnknownNameError
from steadyslip.core.names import resolve
from steadyslip.core.options import checked
from steadyslip.files.specifications.layout import MAP, Section
from steadyslip.files.specifications.read import RigFileContents, read_contents, text_of
from steadyslip.maps.plan.axes import Grid
from steadyslip.maps.plan.map import Map, protocol_parameters
from steadyslip.maps.plan.settings import FIT_POINTS, GridSettings, MapSettings, RangeSettings, SampleSettings
from steadyslip.protocol import Protocol

TABLE = Section(
    MAP, MapSettings, required=True, hint="with compute = ['status'] and [map.over] with parameters and their values"
)


@checked()
def read_map(path: str | PathLike[str], changes: Iterable[str] = ()) -> Map:
    """Read a rig file with a table ``[map]``.

    Parameters
    ----------
    path : path
        TOML file; a path of a fit in it is relative to its folder.
    changes : iterable of str
        Values that replace or add to those of the file, as ``"map.over.contact.angle.points=200"``.

    Returns
    -------
    Map

    Raises
    ------
    RigFileError
        If anything is wrong; lists every problem.
    """
    return map_from_text(text_of(path), str(path), changes, Path(path).parent)


@checked()
def map_from_text(text: str, source: str = "map", changes: Iterable[str] = (), folder: Path = Path()) -> Map:
    """Read a map from the text of a rig file; see `read_map`."""
    spec = read_contents(text, source, changes, (TABLE,))
    settings = spec.further.get(MAP)
    plan = _MapReader(spec, settings, folder) if spec.given is not None and isinstance(settings, MapSettings) else None
    spec.refuse(*(plan.placed() if plan is not None else ()))
    if plan is None or plan.found is None:
        raise InternalError("a map in a file without problems")
    return plan.found


class _MapReader:
    """Translation of a table to a map for the rig of its file, with the problems that depend on the rig."""

    def __init__(self, spec: RigFileContents, settings: MapSettings, folder: Path) -> None:
        self.problems: list[Problem] = []
        self.found: Map | None = None
        self.spec, self.folder = spec, folder
        rig = spec.given
        if rig is None:
            raise InternalError("a rig in a file with a map")
        self.rig = rig
        self.known = rig.parameters() | protocol_parameters(rig, spec.protocol or Protocol())
        over, sampled = settings.over or {}, (settings.samples.over if settings.samples else None) or {}
        self.written = sorted([*over, *sampled], key=len, reverse=True)
        axes = {name: one.grid() if isinstance(one, GridSettings) else one for name, one in self._whole("over", over)}
        arguments: dict[str, Any] = {"over": self._per_area("map.over", axes), "chunk": settings.chunk}
        if settings.samples is not None:
            arguments["samples"] = self._samples(settings.samples)
        try:
            self.found = Map(rig, protocol=spec.protocol or Protocol(), compute=self._measures(settings), **arguments)
        except ParameterError as error:
            self.problems += error.problems

    def placed(self) -> list[Problem]:
        """Problems with the line numbers of their keys, which may be shortened names in the file."""
        return [Problem(p.name, p.message, p.line or self._line(p.name)) for p in self.problems]

    def _line(self, name: str) -> int | None:
        for prefix in ("map.over.", "map.samples.over."):
            full = "." + name.removeprefix(prefix) + "."
            for written in self.written:
                if name.startswith(prefix) and f".{written}." in full:
                    return self.spec.line(prefix + written)
        return self.spec.line(name)

    def _measures(self, settings: MapSettings) -> list[Any] | None:
        """Measures to compute, without those whose options are already reported, unless none is left."""
        names = [p.name.split(".") for p in self.spec.problems]
        faulty = {parts[1] for parts in names if len(parts) > 2 and parts[0] == MAP}
        every = settings.measures()
        if every is None:
            return None
        return [one for one in every if one not in faulty] or (["status"] if every else [])

    def _whole(self, place: str, over: Mapping[str, Any]) -> list[tuple[str, Any]]:
        """Parameters with both ends of a range; of the others the names are checked."""
        found = []
        for name, one in over.items():
            if isinstance(one, RangeSettings) and None in (one.start, one.stop):
                try:
                    resolve(name, self.known)
                except UnknownNameError as error:
                    self.problems.append(Problem(f"map.{place}.{name}", str(error)))
            else:
                found.append((name, one))
        return found

    def _per_area(self, place: str, over: Mapping[str, Any]) -> dict[str, Any]:
        """Values per unit area; where the rig or a contact has an area, its file gives totals."""
        found: dict[str, Any] = {}
        for name, one in over.items():
            found[name] = one
            try:
                full = resolve(name, self.known)
            except UnknownNameError:
                continue  # reported by Map
            role, area = self.known[full].role, self.rig.area_of(full)
            if area is None:
                continue
            try:
                if isinstance(one, Grid):
                    found[name] = replace(one, start=role.read(one.start, area), stop=role.read(one.stop, area))
                elif isinstance(one, tuple):
                    found[name] = (role.read(one[0], area), role.read(one[1], area), *one[2:])
                else:
                    found[name] = [role.read(value, area) for value in one]
            except ParameterError as error:
                del found[name]
                self.problems += [p.under(f"{place}.{name}") for p in error.problems]
        return found

    def _samples(self, settings: SampleSettings) -> Any:
        if settings.fit is not None:
            return self._fit_draws(settings, settings.fit)
        whole = dict(self._whole("samples.over", settings.over or {}))
        found = replace(settings, over=whole, points=settings.points or 1).samples()
        return replace(found, over=self._per_area("map.samples.over", found.over))

    def _fit_draws(self, settings: SampleSettings, name: str) -> Any:
        from steadyslip.experiments import load_fit, normal_draws

        try:
            return normal_draws(load_fit(self.folder / name), settings.points or FIT_POINTS, settings.seed)
        except SteadyslipError as error:
            self.problems.append(Problem("map.samples.fit", str(error)))
            return None
