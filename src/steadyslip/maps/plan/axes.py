"""Values of a map's varied parameters: axes (grids or lists), and samples along one common dimension."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array, checked_array
from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.core.pages import Displayed
from steadyslip.core.results import ReadOnly
from steadyslip.core.roles import Parameter

SPACINGS = ("linear", "log")
SAMPLERS = ("sobol", "latin-hypercube")
SAMPLE = "sample"
COMPLETE = "complete"  # name of the array of chunk checksums in a stored map
MOST_POINTS = 10**12  # largest number of points of a map: results of 8 bytes then have 8 TB
SOBOL_BITS = 32  # bits of the Sobol sequence: the most with which SciPy's fast_forward works
LARGEST_HYPERCUBE = 2**22  # largest number of points: all are generated even if one is needed, 34 MB per parameter


@dataclass(frozen=True)
class Grid(Displayed):
    """Evenly spaced values of a parameter, both ends included.

    Parameters
    ----------
    start, stop : float or str
        SI units, or text with a unit such as ``"10 deg"``.
    points : int
        At least 1; a single point is at `start`.
    spacing : str
        ``linear``, or ``log`` for even spacing of the logarithm.
    """

    start: Any
    stop: Any
    points: int
    spacing: str = "linear"


@dataclass(frozen=True)
class Samples(Displayed):
    """Random points in ranges of several parameters, along one dimension of the map.

    Parameters
    ----------
    over : mapping of str to (low, high) or (low, high, "log")
        Ranges by dotted name, in SI units or as text with a unit; points are uniform in the value or its logarithm.
    points : int
        A power of 2 suits Sobol points best.
    method : str
        ``sobol`` (scrambled), or ``latin-hypercube`` for up to 4 million points.
    seed : int
    """

    over: Mapping[str, Sequence[Any]]
    points: int
    method: str = "sobol"
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Axis(ReadOnly):
    """Values (SI units) of one parameter, which has a dimension of its own."""

    name: str
    role: Parameter
    values: Array = field(repr=False)
    spacing: str

    def definition(self) -> dict[str, Any]:
        if self.spacing == "list":
            return {"values": len(self.values), "digest": digest(self.values)}
        ends = {"from": float(self.values[0]), "to": float(self.values[-1])}
        return {**ends, "points": len(self.values), "spacing": self.spacing}


@dataclass(frozen=True)
class Generated:
    """Sample points that are generated from a seed, part by part.

    Attributes
    ----------
    ranges : tuple of (str, float, float, str)
        Name, ends and spacing of each parameter.
    """

    ranges: tuple[tuple[str, float, float, str], ...]
    points: int
    method: str
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for name, *_ in self.ranges)

    def part(self, start: int, stop: int) -> dict[str, Array]:
        """Parameter values (SI units) at the points from index `start` to before `stop`, by name."""
        unit = _sobol(self).part(start, stop) if self.method == "sobol" else _hypercube(self)[start:stop]
        found = {}
        for column, (name, low, high, spacing) in zip(unit.T, self.ranges, strict=True):
            value = low * (high / low) ** column if spacing == "log" else low + (high - low) * column
            found[name] = np.clip(value, min(low, high), max(low, high))
        return found

    def definition(self) -> dict[str, Any]:
        over = {name: {"from": low, "to": high, "spacing": spacing} for name, low, high, spacing in self.ranges}
        return {"points": self.points, "method": self.method, "seed": self.seed, "over": over}


class _Sobol:
    """Sobol sequence that continues where the last part ended; it restarts only if an earlier part is requested."""

    def __init__(self, dimensions: int, seed: int) -> None:
        self.dimensions, self.seed = dimensions, seed
        self._restart()

    def _restart(self) -> None:
        from scipy.stats import qmc

        self.engine, self.position = qmc.Sobol(self.dimensions, scramble=True, bits=SOBOL_BITS, seed=self.seed), 0

    def part(self, start: int, stop: int) -> Array:
        import warnings

        if start < self.position:
            self._restart()
        if start > self.position:
            self.engine.fast_forward(start - self.position)
        with warnings.catch_warnings():  # SciPy warns of lengths that are no power of 2; parts may have any
            warnings.simplefilter("ignore", UserWarning)
            found = self.engine.random(stop - start)
        self.position = stop
        return np.asarray(found)


@lru_cache(maxsize=4)
def _sobol(of: Generated) -> _Sobol:
    return _Sobol(len(of.ranges), of.seed)


@lru_cache(maxsize=2)
def _hypercube(of: Generated) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(len(of.ranges), seed=of.seed).random(of.points))


@dataclass(frozen=True, eq=False)
class Listed(ReadOnly):
    """Sample points given as arrays, such as draws of a fit.

    Attributes
    ----------
    values : dict of str to ndarray (m,)
    source : str
        Origin of the points, for the map's definition.
    """

    values: dict[str, Array] = field(repr=False)
    source: str = "list"

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.values)

    @property
    def points(self) -> int:
        return len(next(iter(self.values.values())))

    def part(self, start: int, stop: int) -> dict[str, Array]:
        """Parameter values (SI units) at the points from index `start` to before `stop`, by name."""
        return {name: column[start:stop] for name, column in self.values.items()}

    def definition(self) -> dict[str, Any]:
        over = {name: {"digest": digest(column)} for name, column in self.values.items()}
        return {"points": self.points, "source": self.source, "over": over}


Sampling = Generated | Listed


def digest(values: Array) -> str:
    """SHA-256 of the exact numbers of an array, first 16 hexadecimal digits."""
    return hashlib.sha256(np.ascontiguousarray(values, dtype="<f8").tobytes()).hexdigest()[:16]


def make_axis(name: str, role: Parameter, given: Any) -> Axis:
    """Axis of a parameter from a Grid or a list of values.

    Raises
    ------
    ParameterError
        If the range or a value is not allowed.
    """
    if isinstance(given, Grid):
        low, high = _ends(name, role, given.start, given.stop, given.spacing)
        points = _count(f"{name}.points", given.points)
        space = np.geomspace if given.spacing == "log" else np.linspace
        values = space(low, high, points)
        return Axis(name, role, np.clip(values, min(low, high), max(low, high)), given.spacing)
    if isinstance(given, (str, bytes, Mapping)) or not hasattr(given, "__len__"):
        message = f"got {given!r}; allowed: a Grid (in a file {{from, to, points}}) or a list of values"
        raise ParameterError([Problem(name, message)])
    numbers, problems = [], []
    for place, value in enumerate(given, start=1):
        try:
            numbers.append(role.checked(value))
        except ParameterError as error:
            problems += [Problem(name, f"value {place}: {p.message}") for p in error.problems]
    if not len(given):
        problems.append(Problem(name, "got an empty list; give at least one value"))
    elif not problems and len(set(numbers)) < len(numbers):
        problems.append(Problem(name, "has a value twice; give each value once"))
    if problems:
        raise ParameterError(problems[:3])
    return Axis(name, role, np.array(numbers), "list")


def make_sampling(given: Any, roles: Mapping[str, Parameter]) -> Sampling:
    """Sample points from `Samples`, or from a mapping of full names to arrays of equal length.

    Raises
    ------
    ParameterError
        If anything is wrong; lists every problem.
    """
    if isinstance(given, Samples):
        return _generated(given, roles)
    problems, columns = [], {}
    if not given:
        raise ParameterError([Problem("map.samples", "is empty; name at least one parameter and its values")])
    for name, values in given.items():
        try:
            columns[name] = np.atleast_1d(np.asarray(checked_array(name, roles[name], values), dtype=float))
            if columns[name].ndim != 1:
                problems.append(
                    Problem(f"map.samples.over.{name}", f"got an array of {columns[name].ndim} dimensions; allowed: 1")
                )
        except ParameterError as error:
            problems += (p.under("map.samples.over") for p in error.problems)
    if len({len(column) for column in columns.values()}) > 1:
        lengths = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        problems.append(Problem("map.samples", f"columns differ in length: {lengths}"))
    if problems:
        raise ParameterError(problems)
    return Listed(columns)


def _generated(given: Samples, roles: Mapping[str, Parameter]) -> Generated:
    problems, ranges = [], []
    if given.method not in SAMPLERS:
        problems.append(Problem("map.samples.method", unknown_name("method", given.method, SAMPLERS)))
    if isinstance(given.seed, bool) or not isinstance(given.seed, (int, np.integer)) or given.seed < 0:
        problems.append(Problem("map.samples.seed", f"got {given.seed!r}; allowed: a whole number >= 0"))
    try:
        points = _count("map.samples.points", given.points)
        if given.method == "latin-hypercube" and points > LARGEST_HYPERCUBE:
            message = f"got {points}; allowed for a Latin hypercube: up to {LARGEST_HYPERCUBE}; use method = 'sobol'"
            problems.append(Problem("map.samples.points", message))
        if points > 2**SOBOL_BITS:
            problems.append(Problem("map.samples.points", f"got {points}; allowed: up to {2**SOBOL_BITS}"))
    except ParameterError as error:
        problems += error.problems
    for name, ends in given.over.items():
        try:
            if not isinstance(ends, (list, tuple)) or len(ends) not in (2, 3):
                raise ParameterError([Problem(name, f"got {ends!r}; allowed: (low, high) or (low, high, 'log')")])
            spacing = ends[2] if len(ends) == 3 else "linear"
            ranges.append((name, *_ends(name, roles[name], ends[0], ends[1], spacing), spacing))
        except ParameterError as error:
            problems += (p.under("map.samples.over") for p in error.problems)
    if not given.over:
        problems.append(Problem("map.samples.over", "missing; name at least one parameter and its range"))
    if problems:
        raise ParameterError(problems)
    return Generated(tuple(ranges), points, given.method, int(given.seed))


def _ends(name: str, role: Parameter, start: Any, stop: Any, spacing: str) -> tuple[float, float]:
    problems, ends = [], []
    for word, value in (("from", start), ("to", stop)):
        try:
            ends.append(role.checked(value))
        except ParameterError as error:
            problems += [Problem(f"{name}.{word}", p.message) for p in error.problems]
    if spacing not in SPACINGS:
        problems.append(Problem(f"{name}.spacing", unknown_name("spacing", spacing, SPACINGS)))
    elif spacing == "log" and not problems and not (ends[0] > 0 and ends[1] > 0):
        problems.append(Problem(f"{name}.spacing", "'log' needs two ends > 0"))
    if len(ends) == 2 and ends[0] == ends[1]:
        problems.append(Problem(name, f"both ends are {ends[0]!r}; give a range"))
    if problems:
        raise ParameterError(problems)
    return ends[0], ends[1]


def _count(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 1 <= value <= MOST_POINTS:
        raise ParameterError([Problem(name, f"got {value!r}; allowed: a whole number from 1 to {MOST_POINTS:.0e}")])
    return int(value)
