"""Definition of a map: rig, measures, varied parameters, and the partition of its points into chunks."""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from steadyslip.core.errors import InternalError, ParameterError, Problem, SteadyslipError, UnknownNameError
from steadyslip.core.names import resolve
from steadyslip.core.pages import Displayed
from steadyslip.core.records import Address, FrozenRecord, parameters
from steadyslip.core.roles import Parameter
from steadyslip.files.specifications import rig_to_text
from steadyslip.files.specifications.layout import find_law
from steadyslip.files.specifications.tables import TableReader
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.machine.slider import Slider
from steadyslip.maps.plan import edges, held  # noqa: F401 -- register their measures
from steadyslip.maps.plan.axes import (
    COMPLETE,
    SAMPLE,
    SPACINGS,
    Axis,
    Generated,
    Grid,
    Samples,
    Sampling,
    make_axis,
    make_sampling,
)
from steadyslip.maps.plan.measures import PROBES, FunctionMeasure, Measure, Output, measure, source_digest
from steadyslip.model.point import operating_point
from steadyslip.protocol import Protocol

SECONDS = 0.5  # s, CPU time of a chunk: long compared with its distribution, yet short enough to be lost
LARGEST_CHUNK = 2**20  # largest number of points of a chunk; bounds a worker's memory (8 MiB per result)
LEAST_CHUNKS = 32  # least number of chunks, so that all workers are busy until the end; chosen by trial
SHORT = 0.2  # s of CPU time; LEAST_CHUNKS does not make chunks shorter than this; chosen by trial
MOST_AXIS = 10**7  # largest number of values along one axis, which is kept in memory (80 MB)
MOST_CHUNKS = 2 * 10**6  # largest number of chunks, each a few files; chosen by trial so that file systems cope

AnyMeasure = Measure | FunctionMeasure


@dataclass(frozen=True, eq=False)
class Map(Displayed):
    """Definition of a map: what to compute for which rigs.

    Parameters
    ----------
    rig : Slider or Machine
        Base rig, with the values of all parameters that do not vary.
    over : mapping of str to Grid or array_like, optional
        Parameters of the rig or protocol by dotted name with their values; each is a dimension.
    compute : sequence of str, Measure or function
        Measures by name (``status``, ``growth_rate``, ``frequency``, ``edge``, ``stable_values``, ``safety_factor``,
        ``margin``, ``onset``, ``events``, ``threshold``; of sliders ``critical_stiffness``, ``stable_stiffness``; of
        rigs that hold a place ``hunt`` alone), with
        options as records such as ``Events(until=200.0)`` or ``Edge(along="drive.kp")``, or functions of a rig; see
        `measure`. By default the status, for sliders with the critical stiffness, or ``hunt``.
    samples : Samples, mapping of str to array_like, Fit or Draws, optional
        Parameters that vary together along the dimension ``sample``: from ranges, lists, or draws of a fit, in which
        case the rig gets the fit's friction as in `predict`.
    protocol : Protocol or piece, optional
        Protocol of measures that simulate.
    chunk : int, optional
        Points per chunk; by default chosen by their cost.

    Raises
    ------
    ParameterError
        If anything is wrong; lists every problem.
    """

    rig: Slider | Machine
    over: Mapping[str, Any] = field(default_factory=dict, repr=False)
    compute: Any = None
    samples: Any = None
    protocol: Any = field(default_factory=Protocol, repr=False)
    chunk: int | None = None
    axes: tuple[Axis, ...] = field(init=False, default=())
    sampling: Sampling | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        problems: list[Problem] = []
        if not isinstance(self.rig, Rig):
            message = f"got {self.rig!r}; allowed: a Slider or Machine, such as read_rig gives"
            raise ParameterError([Problem("rig", message)])
        self._set("protocol", Protocol.of(self.protocol))
        self._set("compute", _measures(default_measures(self.rig) if self.compute is None else self.compute, problems))
        self._read_samples(problems)
        self._read_axes(problems)
        whole = isinstance(self.chunk, int) and not isinstance(self.chunk, bool)
        if self.chunk is not None and not (whole and 1 <= self.chunk <= 2**24):
            problems.append(Problem("map.chunk", f"got {self.chunk!r}; allowed: a whole number from 1 to {2**24}"))
        if not (self.axes or self.sampling or problems):
            problems.append(Problem("map.over", "missing; name at least one parameter and its values"))
        for one in self.compute:
            for problem in _unfit(one, self.rig) or one.problems(self.rig, self.protocol):
                message = problem.message if problem.name else f"{one.name!r} {problem.message}"
                problems.append(Problem(f"map.{one.name}.{problem.name}" if problem.name else "map.compute", message))
        if problems:
            raise ParameterError(problems)
        names = [output.name for one in self.compute for output in one.outputs(self.rig, ())]
        extra = {dim for one in self.compute for output in one.outputs(self.rig, ()) for dim, _ in output.extra}
        taken = {*names} & {*self.known(), SAMPLE, COMPLETE, *extra}
        problems += [
            Problem("map.compute", f"{n!r} is the name of something else; give another") for n in sorted(taken)
        ]
        twice = sorted({n for n in names if names.count(n) > 1})
        problems += [Problem("map.compute", f"{n!r} is computed twice; name it once") for n in twice]
        if problems:
            raise ParameterError(problems)

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _read_samples(self, problems: list[Problem]) -> None:
        given = self.samples
        if given is None:
            return
        try:
            if isinstance(given, Samples):
                over = self._resolved(given.over, "map.samples.over", problems)
                found: Any = Samples(over, given.points, given.method, given.seed)
            elif isinstance(given, Mapping):
                found = self._resolved(given, "map.samples.over", problems)
            else:
                rig, found = _fit_draws(self.rig, given)
                self._set("rig", rig)
            roles = {name: address.role for name, address in self.known().items()}
            self._set("sampling", make_sampling(found, roles))
            for name in self.sampling.names if self.sampling else ():
                probe = np.unique([values[name] for values in self._extremes(name)])
                problems += (p.under("map.samples.over") for p in self._allowed(name, probe))
        except ParameterError as error:
            problems += error.problems

    def _extremes(self, name: str) -> list[dict[str, Any]]:
        """Two dicts {`name`: value}, with the smallest and with the largest value of a sampled parameter."""
        if isinstance(self.sampling, Generated):
            return [{n: end} for n, low, high, _ in self.sampling.ranges for end in (low, high) if n == name]
        if self.sampling is None:
            raise InternalError("a map with samples")
        column = self.sampling.part(0, self.sampling.points)[name]
        return [{name: column.min()}, {name: column.max()}]

    def _read_axes(self, problems: list[Problem]) -> None:
        axes = []
        over = self._resolved(self.over, "map.over", problems)
        sampled = self.sampling.names if self.sampling else ()
        for name, given in over.items():
            if name in sampled:
                problems.append(Problem(f"map.over.{name}", "varies twice, in over and in samples; name it once"))
                continue
            points = getattr(given, "points", 0)
            if isinstance(points, int) and points > MOST_AXIS:
                message = f"got {points}; allowed: up to {MOST_AXIS} along one parameter; let two vary, or use samples"
                problems.append(Problem(f"map.over.{name}.points", message))
                continue
            try:
                axis = make_axis(name, self.known()[name].role, given)
                problems += (p.under("map.over") for p in self._allowed(name, axis.values[[0, -1]]))
                axes.append(axis)
            except ParameterError as error:
                problems += (p.under("map.over") for p in error.problems)
        self._set("axes", tuple(axes))
        if not problems:
            problems += (p.under("map.over") for p in self._allowed_together())

    def _allowed_together(self) -> tuple[Problem, ...]:
        """Problems of the rigs at the corners of the map, where every varied parameter is at an end of its range."""
        known = self.rig.parameters()
        axes = [a for a in self.axes if a.name in known and not known[a.name].role.adds_state]
        corners = np.meshgrid(*(a.values[[0, -1]] for a in axes), indexing="ij", sparse=True)
        try:
            self._build({a.name: ends for a, ends in zip(axes, corners, strict=True)})
        except ParameterError as error:
            return error.problems
        return ()

    def _build(self, vary: Mapping[str, np.ndarray], scan: bool = False) -> None:
        """Build the rigs with the values in `vary`, so that errors in these values are raised."""
        if not self.rig.holds:
            operating_point(self.rig, vary, scan=scan)
            return
        for values in zip(*(a.reshape(-1) for a in np.broadcast_arrays(*vary.values())), strict=True):
            if not self.rig.with_values(dict(zip(vary, map(float, values), strict=True))).holds:
                message = "cannot be varied: the rig of this map holds a place, so that its velocity must be 0"
                raise ParameterError([Problem("drive.velocity", message)])

    def known(self) -> dict[str, Address]:
        """All parameters of rig and protocol that may vary, by full name."""
        return self.rig.parameters() | protocol_parameters(self.rig, self.protocol)

    def _resolved(self, given: Mapping[str, Any], place: str, problems: list[Problem]) -> dict[str, Any]:
        """Given values by full name; unknown and repeated names are added to `problems`."""
        found: dict[str, Any] = {}
        if not isinstance(given, Mapping):
            problems.append(Problem(place, f"got {given!r}; allowed: names and their values"))
            return found
        for name, value in given.items():
            try:
                full = resolve(str(name), self.known())
                if full in found:
                    problems.append(Problem(f"{place}.{full}", "is named twice; name it once"))
                found[full] = self._per_area(full, value)
            except UnknownNameError as error:
                problems.append(Problem(f"{place}.{name}", str(error)))
            except ParameterError as error:
                problems += [p.under(place) for p in error.problems]
        return found

    def _per_area(self, name: str, given: Any) -> Any:
        """Values of a parameter with texts converted to SI by `Rig.read`, such as totals of a contact with an area."""
        if name.startswith("protocol."):
            return given
        if isinstance(given, Grid):
            return replace(given, start=self._end(name, "from", given.start), stop=self._end(name, "to", given.stop))
        if isinstance(given, (list, tuple)):
            return type(given)(one if one in SPACINGS else self.rig.read(name, one) for one in given)
        return given

    def _end(self, name: str, which: str, given: Any) -> Any:
        """SI value of an end of a grid by `Rig.read`; problems name it ``from`` or ``to`` (`which`)."""
        try:
            return self.rig.read(name, given)
        except ParameterError as error:
            raise ParameterError([Problem(f"{one.name}.{which}", one.message) for one in error.problems]) from error

    def _allowed(self, name: str, values: Any) -> tuple[Problem, ...]:
        """Problems that arise if a parameter takes these values."""
        if name.startswith("protocol."):
            if any(one.moves for one in self.compute):
                return ()
            return (Problem(name, "varies, but no measure simulates the protocol; add 'events' to compute"),)
        role = self.known()[name].role
        if any(one.moves for one in self.compute) and role.adds_state:
            return ()  # points with and without the state are simulated as separate groups
        try:
            self._build({name: np.asarray(values, dtype=float)}, scan=True)
        except ParameterError as error:
            return error.problems
        except SteadyslipError as error:
            return (Problem(name, str(error)),)
        return ()

    # -- shape -----------------------------------------------------------------------------------------

    @property
    def varied(self) -> tuple[str, ...]:
        """Full names of all parameters that vary."""
        return tuple(axis.name for axis in self.axes) + (self.sampling.names if self.sampling else ())

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions: those of the axes, then ``sample``."""
        return tuple(axis.name for axis in self.axes) + ((SAMPLE,) if self.sampling else ())

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(axis.values) for axis in self.axes) + ((self.sampling.points,) if self.sampling else ())

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    def outputs(self) -> tuple[Output, ...]:
        """Declarations of all result arrays of the map."""
        varied = [n for n in self.varied if n in self.rig.parameters()]
        return tuple(output for one in self.compute for output in one.outputs(self.rig, varied))

    @cached_property
    def chunks(self) -> tuple[int, ...]:
        """Points of a chunk along each dimension: all along the last dimensions, some along the one before, else 1."""
        target = self.chunk or self._suited_chunk()
        found: list[int] = []
        for size in reversed(self.shape):
            most = max(1, min(size, target))
            count = math.ceil(size / most)
            found.append(math.ceil(size / count))
            target //= found[-1]
        return tuple(reversed(found))

    @cached_property
    def seconds(self) -> float:
        """Estimated CPU time per point, s."""
        probes = self.probes()
        return float(sum(one.seconds(self.rig, self.protocol, _relevant(one, probes)) for one in self.compute))

    def _suited_chunk(self) -> int:
        """Number of points per chunk that takes about `SECONDS`, within the limits of chunk size and number."""
        seconds = self.seconds
        points = min(SECONDS / seconds, LARGEST_CHUNK)
        least = -(-2 * self.size // MOST_CHUNKS)  # the factor 2 is needed because the last chunk of a row may be small
        return max(1, int(max(min(points, self.size / LEAST_CHUNKS), min(points, SHORT / seconds))), least)

    def probes(self) -> dict[str, Any]:
        """Parameter values (SI units) at up to `PROBES` random points of the map; reproducible, by name."""
        generator = np.random.default_rng(0)
        count = min(PROBES, self.size)
        found = {axis.name: generator.choice(axis.values, count) for axis in self.axes}
        if self.sampling:
            start = int(generator.integers(0, max(1, min(self.sampling.points, 2**16) - count)))
            part = self.sampling.part(start, min(start + count, self.sampling.points))
            found |= {name: np.resize(column, count) for name, column in part.items()}
        return found

    def definition(self) -> dict[str, Any]:
        """JSON-ready dict with everything that the results of the map depend on."""
        return {
            "rig": rig_definition(self.rig, self.protocol),
            "compute": {one.name: one.definition() for one in self.compute},
            "over": {axis.name: axis.definition() for axis in self.axes},
            "samples": self.sampling.definition() if self.sampling else {},
        }

    def __str__(self) -> str:
        parts = [f"{axis.name} ({len(axis.values)})" for axis in self.axes]
        if self.sampling:
            parts.append(f"{self.sampling.points} samples of {', '.join(self.sampling.names)}")
        what = ", ".join(one.name for one in self.compute)
        return f"map of {what} over {' x '.join(parts)}: {self.size:,} points"


def default_measures(rig: Rig) -> tuple[str, ...]:
    """Names of the measures that are computed for a rig by default."""
    if rig.holds:
        return ("hunt",)
    return ("status", "critical_stiffness" if rig.default_along else "growth_rate")


def _unfit(one: AnyMeasure, rig: Rig) -> list[Problem]:
    """List with a Problem if the measure does not suit the rig.

    Measures of steady sliding do not suit a rig that holds a place, and hunting does not suit a rig that slides.
    """
    if one.held is None or one.held == rig.holds:
        return []
    if one.held:
        return [Problem("", "is only for a drive that holds a place: a controller with drive.velocity = 0")]
    message = "needs steady sliding, but the drive holds a place (velocity = 0); compute 'hunt', or a function of a rig"
    return [Problem("", message)]


def protocol_parameters(rig: Slider | Machine, protocol: Protocol) -> dict[str, Address]:
    """Parameters of a protocol by dotted name, in the SI units for this rig; motions are those of the drive."""
    reader = TableReader()
    with reader.of_rig(rig):
        reader.feed = 1.0, rig.drive.turns
        return {
            name: replace(one, role=reader.in_file_unit(one.role))
            for name, one in parameters(protocol, "protocol.").items()
        }


def _relevant(one: AnyMeasure, vary: Mapping[str, Any]) -> dict[str, Any]:
    """Varied parameters that affect a measure; parameters of the protocol only if the measure simulates."""
    return {name: a for name, a in vary.items() if one.moves or not name.startswith("protocol.")}


def evaluate(
    rig: Slider | Machine, protocol: Protocol, compute: Iterable[AnyMeasure], vary: Mapping[str, Any]
) -> dict[str, Any]:
    """Result arrays of all measures by name, each (..., extra), for parameter arrays that broadcast to (...)."""
    shape = np.broadcast_shapes(*(np.shape(a) for a in vary.values()))
    results: dict[str, Any] = {}
    for one in compute:
        own = _relevant(one, vary)
        found = one.arrays(rig, protocol, own)
        for output in one.outputs(rig, [n for n in own if n in rig.parameters()]):
            extra = tuple(size for _, size in output.extra)
            given = np.asarray(found[output.name])
            inner = given.shape[given.ndim - len(extra) :]
            if inner != extra:
                padded = np.full((*given.shape[: given.ndim - len(extra)], *extra), output.fill)
                region: Any = (..., *(slice(0, n) for n in inner))
                padded[region] = given
                given = padded
            results[output.name] = np.broadcast_to(given, (*shape, *extra)).astype(output.dtype, copy=False)
    return results


def _measures(given: Any, problems: list[Problem]) -> tuple[AnyMeasure, ...]:
    found: list[AnyMeasure] = []
    single = isinstance(given, (str, Measure, FunctionMeasure)) or not isinstance(given, (list, tuple))
    for one in [given] if single else given:
        try:
            if isinstance(one, (Measure, FunctionMeasure)):
                found.append(one)
            elif isinstance(one, type) and issubclass(one, Measure):
                found.append(one())
            elif callable(one):
                found.append(measure(one))
            else:
                law = find_law(Measure, one)
                if not issubclass(law, Measure):
                    raise InternalError(f"a measure, not {law.__name__}, under its registered name")
                found.append(law())
        except ParameterError as error:
            problems += [p.under("map.compute") for p in error.problems]
    if not found and not problems:
        problems.append(Problem("map.compute", f"is empty; allowed: {', '.join(Measure.registry)}"))
    return tuple(found)


def _fit_draws(rig: Slider | Machine, given: Any) -> tuple[Slider, dict[str, Any]]:
    """Rig with a fit's friction, and draws of its parameters."""
    from steadyslip.experiments import Draws, Fit, Population
    from steadyslip.experiments.answers.predict import transferred

    if not isinstance(given, (Fit, Draws, Population)):
        message = f"got {given!r}; allowed: Samples, names and their values, a Fit, Draws of one, or a Population"
        raise ParameterError([Problem("map.samples", message)])
    if not isinstance(rig, Slider):
        message = "a fit has friction of one block; for a machine, give values for the parameters of a contact by name"
        raise ParameterError([Problem("map.samples", message)])
    target, _, vary = transferred(rig, given)
    return target, dict(vary)


def rig_definition(rig: Slider | Machine, protocol: Protocol) -> dict[str, Any]:
    """JSON-ready dict of rig and protocol; laws from outside this package are represented by a hash of their source."""
    foreign = {
        type(record).__qualname__: source_digest(type(record))
        for record in (*_records(rig), *_records(protocol))
        if not type(record).__module__.startswith("steadyslip.")
    }
    try:
        tables = tomllib.loads(rig_to_text(rig, protocol))
    except ParameterError:  # a law without a name cannot be written as TOML
        tables = {"description": f"{rig!r} {protocol!r}"}
    return tables | ({"laws": foreign} if foreign else {})


def _records(record: FrozenRecord) -> Iterator[FrozenRecord]:
    yield record
    for item in fields(record):  # type: ignore[arg-type]
        value = getattr(record, item.name)
        for inner in value if isinstance(value, tuple) else (value,):
            if isinstance(inner, FrozenRecord):
                yield from _records(inner)


def differences(old: Any, new: Any, name: str = "map") -> list[str]:
    """Differences between two definitions, one line of text each."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        found = []
        for key in dict.fromkeys(itertools.chain(old, new)):
            found += differences(old.get(key), new.get(key), f"{name}.{key}")
        if not found and list(old) != list(new):
            found.append(f"{name}: the order was {', '.join(old)}, now {', '.join(new)}")
        return found
    return [] if old == new else [f"{name}: was {_plain(old)}, is {_plain(new)}"]


def _plain(value: Any) -> str:
    return "absent" if value is None else str(value)


def roles(plan: Map) -> dict[str, Parameter]:
    """Role (unit, meaning) of each parameter that varies, by full name."""
    known = plan.known()
    return {name: known[name].role for name in plan.varied}
