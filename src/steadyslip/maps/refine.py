"""Refinement of a map only along an edge of a result.

An edge lies between neighbouring grid points with different results, such as stable and unstable. Cells that the edge
crosses are halved along each axis, repeatedly. A cell with equal corners is included as soon as a point on its faces
differs, so that an edge is followed beyond the cells in which it was first found.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable, ParameterError, Problem, unknown_name
from steadyslip.core.format import format_quantity
from steadyslip.core.options import SEVERAL, checked, finite, whole
from steadyslip.core.pictures import draw
from steadyslip.core.results import ReadOnly
from steadyslip.files.output import write_columns
from steadyslip.files.specifications.layout import find_law
from steadyslip.maps.plan.axes import SAMPLE
from steadyslip.maps.plan.map import AnyMeasure, Map
from steadyslip.maps.plan.measures import Measure
from steadyslip.maps.view.map_result import MapResult
from steadyslip.maps.work.run import run_map

MOST_ROUNDS = 12  # largest number of halvings: 4096 steps between two points of the map; chosen by trial
MOST_AXES = 3  # largest number of axes: the number of cells along an edge grows as size^(axes - 1)


@dataclass(frozen=True, eq=False)
class Refined(ReadOnly):
    """Edge of a result of a map, and the points computed to find it.

    Attributes
    ----------
    map : MapResult
    of : str
        Name of the result whose edge it is.
    level : float or None
        Value of the result at the edge (SI units); None for a result with kinds, such as ``status``.
    rounds : int
        Number of times that cells were halved.
    points : dict of str to ndarray (m,)
        New points: varied parameters and all results, SI units.
    edge : dict of str to ndarray (n,)
        Points on the edge: varied parameters halfway between neighbours of the finest grid that differ, SI units.
    sides : ndarray (n, 2)
        Kinds of the result on both sides of the edge; for numeric results, 1 above the level and 0 below.
    spacing : dict of str to float
        Largest spacing of the finest grid along each parameter, SI units; the edge is known to half of it.
    """

    map: MapResult
    of: str
    level: float | None
    rounds: int
    points: dict[str, Array] = field(repr=False)
    edge: dict[str, Array] = field(repr=False)
    sides: Array = field(repr=False)
    spacing: dict[str, float]

    def __str__(self) -> str:
        count = len(next(iter(self.points.values()), ()))
        sizes = zip(self.map.dims, self.map.shape, strict=True)
        full = np.prod([(n - 1) * 2**self.rounds + 1 if name in self.spacing else n for name, n in sizes], dtype=float)
        lines = [
            f"edge of {self.of}{'' if self.level is None else f' at {self.level:.4g}'}: {count:,} new points, "
            f"where the whole grid would have {full:,.4g}"
        ]
        wide = max([24, *(len(name) + 2 for name in self.spacing)])
        for name, size in self.spacing.items():
            lines.append(
                f"  {name:<{wide}}known to "
                f"{format_quantity(0.5 * size, self.map.unit(name), 3, self.map.area(name))} or better"
            )
        lines.append(f"  {len(self.sides):,} points on the edge")
        return "\n".join(lines)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the points on the edge as CSV: parameters in SI units, then the kinds on both sides.

        Raises
        ------
        NotAvailable
            If the file cannot be written.
        """
        words = self.map.words(self.of)
        columns: dict[str, Any] = {f"{name} ({self.map.unit(name)})": own for name, own in self.edge.items()}
        for side, title in enumerate(("one side", "other side")):
            sides: Any = self.sides[:, side] if len(self.sides) else []
            columns[title] = [words[int(s)] if words else ("below", "above")[int(s)] for s in sides]
        write_columns(path, columns, "%r")

    def plot(self, ax: Any = None) -> Any:
        """Draw new points and edge; see `steadyslip.figures.refined`."""
        return draw(self, ax=ax)


@checked(rounds=whole(1, MOST_ROUNDS), level=finite(-math.inf), compute=SEVERAL)
def refine(
    found: MapResult,
    rounds: int = 3,
    *,
    of: str | None = None,
    level: float | None = None,
    compute: Sequence[AnyMeasure] | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    progress: bool | None = None,
) -> Refined:
    """Compute new points along an edge of a map.

    Parameters
    ----------
    found : MapResult
        Complete map over up to three parameters on grids; axes with lists of values are not refined.
    rounds : int
        Number of halvings of the cells at the edge; each needs about as many points as the edge has cells.
    of : str, optional
        Result whose edge is wanted; by default ``status``, or the map's first result.
    level : float, optional
        Value (SI units) of a numeric result at the edge; by default 0 for ``growth_rate`` and ``margin``, 1 for
        ``safety_factor``. Points without a value count as below.
    compute : sequence of Measure, optional
        Measures to compute; by default those of the map. Required if the map computes functions.
    workers, cluster, progress
        As in `run_map`. New points are stored next to the map, in a folder with its name and the ending ``.refined``.

    Returns
    -------
    Refined

    Raises
    ------
    ParameterError
        If an argument is wrong.
    NotAvailable
        If the map is not complete, has samples, or no edge, or if another program computed it.

    Examples
    --------
    >>> rig = ss.read_rig("examples/inclined-spring.toml")
    >>> grid = ss.maps.Grid("10 GPa/m", "40 GPa/m", 4)
    >>> found = ss.run_map(ss.Map(rig, {"stiffness": grid}, ["growth_rate"]), "edge.zarr")
    >>> print(ss.refine(found, 2))
    edge of growth_rate at 0: 2 new points, where the whole grid would have 13
      slider.stiffness        known to 1.25 GPa/m or better
      1 points on the edge
    """
    found.store.refuse_another_program()
    of = of or ("status" if "status" in found.results else found.results[0])
    level = _level(found, of, level)
    lattice = _Lattice(found, rounds)
    kinds = _Sides(found, of, level)
    base = found.read(of)
    nodes = lattice.flat(np.indices(found.shape).reshape(len(found.shape), -1).T * lattice.size)
    known = _KnownNodes(nodes, kinds(base.reshape(-1)))
    batch = _Batches(found, of, level, compute, lattice, workers, cluster, progress)
    cells = lattice.first_cells()
    cells = cells[_is_mixed(lattice, known, cells, lattice.size)]
    if not len(cells):
        raise NotAvailable(f"{of} is the same at all points of the map; there is no edge to refine")
    for number in range(1, rounds + 1):
        step = lattice.size // 2**number
        cells = _divided(lattice, known, cells, step, lambda flat, n=number: kinds(batch(flat, n)[of]))
    points = batch.points()
    edge, sides = _edge(lattice, known, cells)
    spacing = {name: lattice.spacing(i) for i, name in enumerate(found.dims) if lattice.divides[i]}
    return Refined(found, of, level, rounds, points, edge, sides, spacing)


def _level(found: MapResult, of: str, level: float | None) -> float | None:
    problems = []
    if of not in found.results:
        problems.append(Problem("of", unknown_name("result", of, found.results)))
    elif found.store.array(of).ndim > len(found.dims):
        problems.append(Problem("of", f"{of!r} has several numbers per point; choose another result"))
    elif found.words(of):
        if level is not None:
            problems.append(Problem("level", f"{of} has kinds, not numbers; leave the level out"))
    elif level is None:
        usual = {"growth_rate": 0.0, "margin": 0.0, "safety_factor": 1.0}
        if of not in usual:
            problems.append(Problem("level", f"missing; give the value of {of} at the edge"))
        level = usual.get(of)
    if problems:
        raise ParameterError(problems)
    if SAMPLE in found.dims:
        raise NotAvailable("samples have no neighbours; refine a map over grids")
    if not found.complete:
        raise NotAvailable(f"{str(found.path)!r} is not complete; compute the rest of it first")
    return level


class _Sides:
    """Function that returns the side of the edge on which values of a result lie.

    The side is the kind of the result or, for numbers, 1 above the level and 0 below.
    """

    def __init__(self, found: MapResult, of: str, level: float | None) -> None:
        self.level = None if found.words(of) else level

    def __call__(self, values: Array) -> Array:
        if self.level is None:
            return np.asarray(values, dtype=np.int8)
        return (np.asarray(values) > self.level).astype(np.int8)


class _Lattice:
    """Finest grid with integer coordinates of its nodes: `size` steps from one point of the map's grid to the next."""

    def __init__(self, found: MapResult, rounds: int) -> None:
        over = found.store.definition["over"]
        self.names = found.dims
        self.values = [found.read(name) for name in self.names]
        self.logs = [over[name].get("spacing") == "log" for name in self.names]
        self.divides = [over[n].get("spacing", "list") != "list" and len(v) > 1 for n, v in zip(
            self.names, self.values, strict=True)]  # fmt: skip
        if not any(self.divides):
            raise NotAvailable("the map has no grid to refine; give a parameter as a grid, with from, to and points")
        if sum(self.divides) > MOST_AXES:
            raise NotAvailable(f"a map over more than {MOST_AXES} grids cannot be refined; let fewer parameters vary")
        self.size = 2**rounds
        self.shape = tuple((len(v) - 1) * self.size + 1 for v in self.values)
        if float(np.prod([float(n) for n in self.shape])) > 2.0**62:
            raise NotAvailable(f"rounds = {rounds} gives too many points to be numbered on this map; give fewer")
        unit = [1 if d else 0 for d in self.divides]
        self.corners = np.array(list(itertools.product(*((0, u) for u in unit))), dtype=np.int64)
        self.corners = np.unique(self.corners, axis=0)
        thirds = itertools.product(*((0, 1, 2) if u else (0,) for u in unit))
        self.inside = np.array(list(thirds), dtype=np.int64)

    def flat(self, nodes: Array) -> Array:
        """Flat indices (m,) of nodes (m, n)."""
        return np.asarray(np.ravel_multi_index(tuple(np.asarray(nodes).T), self.shape), dtype=np.int64)

    def nodes(self, flat: Array) -> Array:
        return np.stack(np.unravel_index(flat, self.shape), axis=-1).astype(np.int64)

    def first_cells(self) -> Array:
        """Lowest corners (m, n) of all cells of the map's grid, as nodes."""
        counts = [len(v) - 1 if d else len(v) for v, d in zip(self.values, self.divides, strict=True)]
        return np.asarray(np.indices(counts).reshape(len(counts), -1).T * self.size)

    def inner(self, cells: Array, step: int) -> Array:
        """Mask (m,) of the cells, given by their lowest corners, that are inside the grid."""
        high = np.array(self.shape) - np.where(self.divides, step, 1)
        return np.asarray(np.all((cells >= 0) & (cells <= high), axis=1))

    def parameters(self, nodes: Array) -> dict[str, Array]:
        """Values (SI units) of the parameters at nodes (m, n), which may be fractional, by name."""
        found = {}
        for i, (name, values) in enumerate(zip(self.names, self.values, strict=True)):
            place = nodes[:, i] / self.size
            below = np.minimum(np.floor(place).astype(int), max(len(values) - 2, 0))
            share = place - below
            low, high = values[below], values[np.minimum(below + 1, len(values) - 1)]
            between = low * (high / low) ** share if self.logs[i] else low + (high - low) * share
            found[name] = np.where(share == 0, low, np.where(share == 1, high, between))
        return found

    def spacing(self, axis: int) -> float:
        nodes = np.zeros((self.shape[axis], len(self.names)))
        if self.shape[axis] > 2**20:  # too many nodes for memory: between map points the spacing is taken as uniform
            return float(np.max(np.abs(np.diff(self.values[axis]))) / self.size)
        nodes[:, axis] = np.arange(self.shape[axis])
        return float(np.max(np.abs(np.diff(self.parameters(nodes)[self.names[axis]]))))


class _KnownNodes:
    """Nodes whose side of the edge has been computed, sorted by flat index."""

    def __init__(self, flat: Array, kinds: Array) -> None:
        order = np.argsort(flat)
        self.flat, self.kinds = flat[order], kinds[order]

    def has(self, flat: Array) -> Array:
        place = np.minimum(np.searchsorted(self.flat, flat), len(self.flat) - 1)
        return np.asarray(self.flat[place] == flat)

    def of(self, flat: Array) -> Array:
        return np.asarray(self.kinds[np.searchsorted(self.flat, flat)])

    def add(self, flat: Array, kinds: Array) -> None:
        both = np.concatenate([self.flat, flat])
        order = np.argsort(both, kind="stable")
        self.flat, self.kinds = both[order], np.concatenate([self.kinds, kinds])[order]


class _Batches:
    """Function that computes new points, as separate maps next to the map, so that computation can be interrupted."""

    def __init__(
        self, found: MapResult, of: str, level: float | None, compute: Sequence[AnyMeasure] | None, lattice: _Lattice,
        workers: int | None, cluster: str | None, progress: bool | None,
    ) -> None:  # fmt: skip
        self.found, self.lattice = found, lattice
        text = str(found.dataset.attrs["definition"])
        self.rig = found.rig
        self.protocol = found.protocol
        self.compute = tuple(compute) if compute is not None else _measures_of(json.loads(text)["compute"])
        name = hashlib.sha256(f"{text} {of} {level}".encode()).hexdigest()[:8]
        self.folder = found.path.with_suffix(".refined") / f"{of}-{name}"
        self.options: dict[str, Any] = {"workers": workers, "cluster": cluster, "progress": progress}
        self.counts: dict[int, int] = {}
        self.found_points: list[dict[str, Array]] = []

    def __call__(self, flat: Array, number: int) -> dict[str, Array]:
        values = self.lattice.parameters(self.lattice.nodes(flat))
        part = self.counts[number] = self.counts.get(number, 0) + 1
        plan = Map(self.rig, compute=self.compute, samples=values, protocol=self.protocol)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise NotAvailable(f"cannot write {str(self.folder)!r}: {error.strerror or error}") from error
        done = run_map(plan, self.folder / f"{number}-{part}.zarr", **self.options)
        if not done.complete:
            raise KeyboardInterrupt
        data = done.dataset
        self.found_points.append({name: data[name].values for name in (*values, *done.results)})
        return self.found_points[-1]

    def points(self) -> dict[str, Array]:
        names = self.found_points[0] if self.found_points else {}
        return {name: np.concatenate([part[name] for part in self.found_points]) for name in names}


def _measures_of(definition: dict[str, Any]) -> tuple[Any, ...]:
    found = []
    for name, options in definition.items():
        if "function" in options:
            message = f"the map computes the function {name!r}, which is not stored with it; give compute=[...]"
            raise NotAvailable(message)
        law = find_law(Measure, name)
        found.append(law(**{key: value for key, value in options.items() if key not in ("name", "text")}))
    return tuple(found)


def _is_mixed(lattice: _Lattice, known: _KnownNodes, cells: Array, step: int) -> Array:
    """Mask of the cells (given by their lowest corners) whose corners are on different sides of the edge."""
    corners = cells[:, None, :] + step * lattice.corners
    kinds = known.of(lattice.flat(corners.reshape(-1, corners.shape[-1]))).reshape(len(cells), -1)
    return np.asarray(np.any(kinds != kinds[:, :1], axis=1))


def _divided(lattice: _Lattice, known: _KnownNodes, cells: Array, step: int, compute: Any) -> Array:
    """Lowest corners of the cells of size `step` that the edge crosses, from halving cells of size 2 `step`.

    Neighbouring cells that turn out to be crossed by the edge are halved as well.
    """
    active = np.unique(lattice.flat(cells))
    waiting = active
    unit = np.where(lattice.divides, 1, 0)
    while len(waiting):
        nodes = lattice.nodes(waiting)[:, None, :] + step * lattice.inside
        flat = np.unique(lattice.flat(nodes.reshape(-1, nodes.shape[-1])))
        new = flat[~known.has(flat)]
        if len(new):
            known.add(new, compute(new))
        # if a node on a face differs from a corner, the edge continues in the neighbouring cell
        kinds = known.of(lattice.flat(nodes.reshape(-1, nodes.shape[-1]))).reshape(len(waiting), -1)
        is_corner = np.all(lattice.inside != 1, axis=1)
        odd = np.any(kinds[:, :, None] != kinds[:, None, is_corner], axis=2) & ~is_corner
        rim = nodes[odd]
        touched = []
        for shift in itertools.product(*((0, 1) if u else (0,) for u in unit)):
            low = rim - (rim % np.where(unit, 2 * step, 1)) - np.array(shift) * 2 * step
            on_face = np.all((np.array(shift) == 0) | (rim % np.where(unit, 2 * step, 1) == 0), axis=1)
            touched.append(low[on_face])
        candidates = np.concatenate(touched) if touched else np.empty((0, len(unit)), dtype=np.int64)
        candidates = candidates[lattice.inner(candidates, 2 * step)]
        waiting = np.setdiff1d(lattice.flat(candidates), active) if len(candidates) else np.empty(0, dtype=np.int64)
        active = np.union1d(active, waiting)
    halves = (lattice.nodes(active)[:, None, :] + step * lattice.corners).reshape(-1, len(unit))
    halves = np.unique(halves, axis=0)
    return np.asarray(halves[_is_mixed(lattice, known, halves, step)])


def _edge(lattice: _Lattice, known: _KnownNodes, cells: Array) -> tuple[dict[str, Array], Array]:
    """Parameters (SI units, by name) halfway between neighbouring nodes that differ, and sides of the edge (n, 2)."""
    places, sides = [], []
    for axis in np.flatnonzero(lattice.divides):
        along = np.zeros(len(lattice.names), dtype=np.int64)
        along[axis] = 1
        starts = lattice.corners[lattice.corners[:, axis] == 0]
        low = (cells[:, None, :] + starts).reshape(-1, len(along))
        low = np.unique(low, axis=0)
        pair = np.stack([known.of(lattice.flat(low)), known.of(lattice.flat(low + along))], axis=-1)
        differs = pair[:, 0] != pair[:, 1]
        places.append(low[differs] + 0.5 * along)
        sides.append(pair[differs])
    return lattice.parameters(np.concatenate(places)), np.concatenate(sides)
