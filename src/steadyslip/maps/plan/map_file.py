"""Table ``[map]`` of a rig file: its options, and a reader that makes a `Map` and reports all problems together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from steadyslip.core.entries import Names, Quantity, Text, Whole
from steadyslip.core.errors import InternalError, ParameterError, Problem, SteadyslipError, UnknownNameError
from steadyslip.core.names import resolve
from steadyslip.core.options import checked
from steadyslip.core.records import Settings, named, option, part, parts, setting
from steadyslip.files.specifications.layout import MAP, Section
from steadyslip.files.specifications.read import RigFileContents, read_contents, text_of
from steadyslip.maps.plan.axes import MOST_POINTS, SAMPLERS, SPACINGS, Grid, Samples
from steadyslip.maps.plan.map import Map, protocol_parameters
from steadyslip.maps.plan.measures import Measure
from steadyslip.protocol import Protocol

MOST_GIVEN = 2**24  # largest number of points of a chunk that a file may ask for: results of 8 bytes then have 128 MiB
FIT_POINTS = 1000  # default number of draws from a fit: quantiles at 2.5 % have an error of 0.5 %
LARGEST_SEED = 2**63 - 1  # largest integer of TOML


class RangeSettings(Settings):
    """Both ends of a parameter's range."""

    start: Any = setting(Quantity("first value"), key="from")
    stop: Any = setting(Quantity("last value"), key="to")
    spacing: str = option(*SPACINGS, doc="even in the value, or in its logarithm", default="linear")


class GridSettings(RangeSettings):
    """Evenly spaced values of a parameter, both ends included."""

    points: int = setting(Whole("number of values", 1, MOST_POINTS))

    def grid(self) -> Grid:
        return Grid(self.start, self.stop, self.points or 1, self.spacing)


class SampleSettings(Settings):
    """Parameters that vary together along the dimension `sample`."""

    over: Mapping[str, RangeSettings] | None = named(
        RangeSettings, "ranges by dotted name; samples are uniform in them"
    )
    points: int | None = setting(
        Whole(f"how many, {FIT_POINTS} for a fit unless given; a power of 2 suits `sobol`", 1, MOST_POINTS),
        default=None,
    )
    method: str | None = option(
        *SAMPLERS, default=None,
        doc="`sobol` (unless given): scrambled Sobol points, up to 2³²; `latin-hypercube`: up to 2²²",
    )  # fmt: skip
    seed: int = setting(Whole("samples follow from it", 0, LARGEST_SEED), default=0)
    fit: str | None = setting(
        Text("instead of `over` and `method`: a fit (`.nc`), beside this file, whose friction the rig gets and from "
             "whose covariance parameters are drawn"), default=None,
    )  # fmt: skip

    def inconsistencies(self) -> Iterator[Problem]:
        if self.fit is None:
            if self.points is None:
                yield Problem("points", "missing; give the number of sample points, such as 1024")
            return
        for key in ("over", "method"):
            if getattr(self, key) is not None:
                yield Problem(key, "is only for samples of ranges; a fit determines what varies, and how; leave it out")

    def samples(self) -> Samples:
        ranges = {name: (one.start, one.stop, one.spacing) for name, one in (self.over or {}).items()}
        return Samples(ranges, self.points or 1, self.method or SAMPLERS[0], self.seed)


class MapSettings(Settings):
    """Quantities to compute for which rigs; options of a quantity are in a table named after it."""

    compute: tuple[str, ...] | None = setting(
        Names("results, see below; unless given `status`, with `critical_stiffness` for a slider, `growth_rate` for a "
              "machine"), default=None,
    )  # fmt: skip
    chunk: int | None = setting(
        Whole("points computed in one go; by what a point costs unless given", 1, MOST_GIVEN), default=None
    )
    over: Mapping[str, Any] | None = named(
        GridSettings, listed=True,
        doc="parameters by dotted name, quoted or not, or by their unique last part; those of the protocol as "
        "`protocol.pieces.1.to`: a list of values, or a table",
    )  # fmt: skip
    samples: SampleSettings | None = part(
        SampleSettings, "parameters that vary together along the dimension `sample`", default=None
    )
    options: tuple[Measure, ...] = parts(Measure, "options of a result", default=(), by_name=True)

    def inconsistencies(self) -> Iterator[Problem]:
        for one in self.options:
            if one.name not in (self.compute or ()):
                yield Problem(one.name, f"has options but is not computed; add {one.name!r} to map.compute")

    def measures(self) -> list[Any] | None:
        """Measures to compute, as records if they have options, else as names; None if the file has no `compute`."""
        if self.compute is None:
            return None
        with_options = {one.name: one for one in self.options}
        return [with_options.get(name, name) for name in self.compute]


TABLE = Section(
    MAP, MapSettings, required=True, hint="with compute = ['status'] and [map.over] with parameters and their values"
)


@checked()
def read_map(path: str | PathLike[str], changes: Iterable[str] = ()) -> Map:
    """Read a rig file with a table ``[map]``.

    Parameters
    ----------
    path : path
        TOML file; paths of fits in it are relative to its folder.
    changes : iterable of str
        Values that replace or add to those of the file, as ``"map.over.contact.angle.points=200"``.

    Returns
    -------
    Map

    Raises
    ------
    RigFileError
        If anything is wrong; lists every problem.

    Examples
    --------
    >>> plan = ss.read_map("examples/maps/safe-stiffness.toml", ["map.over.contact.angle.points=5"])
    >>> plan.size
    915
    """
    return map_from_text(text_of(path), str(path), changes, Path(path).parent)


@checked()
def map_from_text(text: str, source: str = "map", changes: Iterable[str] = (), folder: Path = Path()) -> Map:
    """Read a map from the text of a rig file; see `read_map`.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = Path("examples/maps/safe-stiffness.toml").read_text()
    >>> plan = ss.map_from_text(text)
    >>> plan.size
    14823
    """
    spec = read_contents(text, source, changes, (TABLE,))
    settings = spec.further.get(MAP)
    plan = _MapReader(spec, settings, folder) if spec.rig is not None and isinstance(settings, MapSettings) else None
    spec.refuse(*(plan.placed() if plan is not None else ()))
    if plan is None or plan.found is None:
        raise InternalError("a map in a file without problems")
    return plan.found


class _MapReader:
    """Converter of a table [map] to a Map (`found`) for the file's rig; collects problems that depend on the rig."""

    def __init__(self, spec: RigFileContents, settings: MapSettings, folder: Path) -> None:
        self.problems: list[Problem] = []
        self.found: Map | None = None
        self.spec, self.folder = spec, folder
        rig = spec.rig
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
        """Problems with the line numbers of their keys in the file, where names may be shortened."""
        return [Problem(p.name, p.message, p.line or self._line(p.name)) for p in self.problems]

    def _line(self, name: str) -> int | None:
        for prefix in ("map.over.", "map.samples.over."):
            full = "." + name.removeprefix(prefix) + "."
            for written in self.written:
                if name.startswith(prefix) and f".{written}." in full:
                    return self.spec.line(prefix + written)
        return self.spec.line(name)

    def _measures(self, settings: MapSettings) -> list[Any] | None:
        """Measures to compute, without those whose options are faulty; ``status`` if none is left."""
        names = [p.name.split(".") for p in self.spec.problems]
        faulty = {parts[1] for parts in names if len(parts) > 2 and parts[0] == MAP}
        every = settings.measures()
        if every is None:
            return None
        return [one for one in every if one not in faulty] or (["status"] if every else [])

    def _whole(self, place: str, over: Mapping[str, Any]) -> list[tuple[str, Any]]:
        """Names and values of parameters; ranges that lack an end are left out after a check of their names."""
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
        """Values by name, with totals of a rig or contact with an area converted to values per unit area."""
        found: dict[str, Any] = {}
        for name, one in over.items():
            found[name] = one
            try:
                full = resolve(name, self.known)
            except UnknownNameError:
                continue  # `Map` reports it
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
        from steadyslip.experiments import normal_draws
        from steadyslip.experiments.fitting.result import load_friction_fit

        try:
            return normal_draws(load_friction_fit(self.folder / name), settings.points or FIT_POINTS, settings.seed)
        except SteadyslipError as error:
            self.problems.append(Problem("map.samples.fit", str(error)))
            return None
