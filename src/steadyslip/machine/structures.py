"""Structures: bodies given by matrices, modes or a measured response, with named points for links and contacts."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from numbers import Integral
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.domains import line, nonnegative, real
from steadyslip.core.entries import Whole
from steadyslip.core.errors import ParameterError, Problem, QuantityError, repr_short
from steadyslip.core.names import Members
from steadyslip.core.options import Tested, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.quantities import parse
from steadyslip.core.records import FrozenRecord, members, parameter, setting
from steadyslip.core.roles import Entry, Schema, fault
from steadyslip.machine.bodies import Body
from steadyslip.machine.responses import ResponseData

MOST_FREEDOM = 3000
"""Most degrees of freedom of one structure: its matrices take 72 MB each, its eigenvalues minutes."""
_FREE = 1e-10  # stiffness of a mode relative to the largest that counts as none; files of 11 digits
_GOOD_TO = 0.5  # of the frequency of the last mode of a reduction, up to which it is meant to be good: usual practice
_ONE = "give exactly one of matrices, modes and response"
_UNITS = 'units of length, of mass or force, and of time, as in "mm t s" or "mm N s"'
_LISTED = 12  # degrees of freedom that a message lists: a line or two
_SYMMETRIC = 1e-8  # relative asymmetry of an inertia matrix that is taken for rounding of a file


@dataclass(frozen=True, eq=False)
class StructureData(Displayed):
    """Matrices of a structure in SI units, and the motion of its points.

    Attributes
    ----------
    mass, damping, stiffness : ndarray (n, n)
        kg, N s/m, N/m, or in units of generalised coordinates. The inertia matrix is symmetric; a gyroscopic matrix is
        a part of the damping, a circulatory one of the stiffness.
    gyroscopic : ndarray (n, n)
        Gyroscopic matrix, per unit of the body's `spin`.
    points : mapping of str to (ndarray, ndarray or None)
        Rows of displacements of points that the data themselves name: along x, and along y.
    freedoms : tuple of str
        Names of the degrees of freedom, n, in files of finite-element programs node and direction: ``105.1``; or none.
    source : str
        Name of the file; empty if made in Python.
    """

    mass: Array
    damping: Array
    stiffness: Array
    gyroscopic: Array
    points: Mapping[str, tuple[Array | None, Array | None]] = field(default_factory=dict)
    source: str = ""
    freedoms: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        named = {"mass": self.mass, "damping": self.damping, "stiffness": self.stiffness, "gyroscopic": self.gyroscopic}
        size = np.asarray(self.mass).shape[0] if np.ndim(self.mass) == 2 else 0
        problems = []
        for name, given in named.items():
            try:
                one = np.array(given, dtype=float)
            except (TypeError, ValueError):
                problems.append(Problem(name, f"got {repr_short(given)}; allowed: a real matrix"))
                continue
            one.setflags(write=False)
            object.__setattr__(self, name, one)
            if one.shape != (size, size) or not size:
                allowed = f"({size}, {size}), as the inertia" if size else "a square matrix"
                problems.append(Problem(name, f"has shape {one.shape}; allowed: {allowed}"))
            elif not np.all(np.isfinite(one)):
                problems.append(Problem(name, "has entries that are no finite numbers"))
        if not problems and size > MOST_FREEDOM:
            problems.append(Problem("mass", f"has {size} degrees of freedom; allowed: up to {MOST_FREEDOM}; reduce it"))
        if self.freedoms and len(set(self.freedoms)) != size:
            count = len(set(self.freedoms))
            problems.append(Problem("freedoms", f"names {count} degrees of freedom; allowed: {size}, one for each row"))
        if not problems:
            problems += self._inertia_problems()
        if problems:
            raise ParameterError(problems)

    def _inertia_problems(self) -> Iterator[Problem]:
        largest = np.max(np.abs(self.mass))
        if np.max(np.abs(self.mass - self.mass.T)) > _SYMMETRIC * largest:
            yield Problem("mass", "is not symmetric; allowed: a symmetric matrix, positive definite")
            return
        even = 0.5 * (self.mass + self.mass.T)
        even.setflags(write=False)
        object.__setattr__(self, "mass", even)
        try:
            np.linalg.cholesky(even)
        except np.linalg.LinAlgError:
            yield Problem(
                "mass", "is not positive definite; allowed: inertia in every direction; condense massless coordinates"
            )

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.mass)

    @cached_property
    def digest(self) -> str:
        """Hash of the content."""
        found = hashlib.sha256()
        for one in (self.mass, self.damping, self.stiffness, self.gyroscopic):
            found.update(one.tobytes())
        found.update("\n".join(self.freedoms).encode())
        for name, rows in self.points.items():
            found.update(name.encode())
            for row in rows:
                found.update(b"-" if row is None else np.asarray(row, dtype=float).tobytes())
        return found.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StructureData) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def row(self, place: int | str) -> int:
        """Row of a degree of freedom, from 0.

        Raises
        ------
        ParameterError
            If there is none of this number, counted from 1, or name.
        """
        if isinstance(place, str):
            if place in self.freedoms:
                return self.freedoms.index(place)
            if not self.freedoms:
                raise fault(f"got {place!r}; allowed: 1 to {self.size}, as the file does not name degrees of freedom")
            raise fault(self._unknown(place))
        if not 1 <= place <= self.size:
            raise fault(f"got {place}; allowed: 1 to {self.size}, the structure's degrees of freedom")
        return place - 1

    def _unknown(self, place: str) -> str:
        node = place.partition(".")[0]
        same = [one for one in self.freedoms if one.partition(".")[0] == node]
        few = self.freedoms if len(self.freedoms) <= _LISTED else (*self.freedoms[:_LISTED], "...")
        known = f"of node {node}: {', '.join(same)}" if same else ", ".join(few)
        return (
            f"got {place!r}; allowed: node and direction as in the file, {known} (held and massless ones are left out)"
        )

    @cached_property
    def modal_damping(self) -> Array:
        """Damping matrix (n, n) that gives each mode of inertia and symmetric stiffness a damping ratio of 1, N s/m."""
        squares, shapes = self._own_modes
        carried = self.mass @ shapes
        found: Array = (carried * (2 * np.sqrt(np.maximum(squares, 0.0)))) @ carried.T
        return found

    def __repr__(self) -> str:
        return f"StructureData({self.source or 'matrices'}, {self.size} degrees of freedom)"

    @cached_property
    def _own_modes(self) -> tuple[Array, Array]:
        """Squared angular frequencies (n,), rising, rad²/s², and shapes (n, n) by mass and symmetric stiffness."""
        from scipy.linalg import eigh  # slow to import

        squares, shapes = eigh(0.5 * (self.stiffness + self.stiffness.T), self.mass)
        return squares, shapes

    @cached_property
    def rigid_motions(self) -> Array:
        """Motions (n, k) that stretch nothing, k = 0 for a structure that its own stiffness holds."""
        squares, shapes = self._own_modes
        found: Array = shapes[:, np.abs(squares) <= _FREE * np.max(np.abs(squares), initial=0.0)]
        return found

    @property
    def gives_way(self) -> bool:
        """True if the stiffness is negative in some direction, so that nothing holds the structure without contact."""
        squares = self._own_modes[0]
        return bool(squares[0] < -_FREE * np.max(np.abs(squares)))


@dataclass(frozen=True)
class Unread:
    """Stands in a table for the data of a file that cannot be read."""

    reason: str


@dataclass(frozen=True)
class OfStructure(Entry):
    """Field type: data of a structure; in files the name of a file, which is read before the field is checked."""

    doc: str
    of: type = StructureData

    def checked(self, value: Any) -> Any:
        if isinstance(value, self.of):
            return value
        raise fault(value.reason) if isinstance(value, Unread) else self.refused(value)

    def allowed(self) -> str:
        return f"the name of a file beside this one; in Python {self.of.__name__}"

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1, "description": self.doc}

    def written(self, value: Any, area: float | None = None) -> str:
        if not value.source:
            raise ParameterError([Problem("matrices", "were made in Python; save them to a file and read that first")])
        return json.dumps(value.source)


@dataclass(frozen=True)
class FileUnits(Entry):
    """Field type: units of length, of mass or force, and of time, which finite-element programs leave to users."""

    doc: str

    def checked(self, value: Any) -> str:
        unit_sizes(value)
        return str(value)

    def allowed(self) -> str:
        return _UNITS

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1, "description": self.doc}


def unit_sizes(units: Any) -> tuple[float, float, float]:
    """Units of length, mass and time in m, kg and s, from text such as ``"mm t s"`` or ``"mm N s"``.

    Raises
    ------
    ParameterError
        Naming no field, if it is no such text.

    Examples
    --------
    >>> from steadyslip.machine.structures import unit_sizes
    >>> unit_sizes("mm N s")
    (0.001, 1000.0, 1.0)
    """
    words = units.replace(",", " ").split() if isinstance(units, str) else ()
    if len(words) != 3:
        raise fault(f"got {repr_short(units)}; allowed: {_UNITS}")
    try:
        length, time = parse(f"1 {words[0]}", "m"), parse(f"1 {words[2]}", "s")
        force = unit(words[1])[1] == unit("N")[1]
        inertia = parse(f"1 {words[1]}", "N") * time**2 / length if force else parse(f"1 {words[1]}", "kg")
    except QuantityError as error:
        raise fault(f"got {units!r}: {error}; allowed: {_UNITS}") from error
    return length, inertia, time


@dataclass(frozen=True)
class Freedom(Entry):
    """Field type: a degree of freedom of matrices, by its number from 1 or by its name."""

    doc: str

    def checked(self, value: Any) -> int | str:
        if isinstance(value, bool) or not (isinstance(value, (str, Integral))):
            raise self.refused(value)
        if not isinstance(value, str) and int(value) < 1:
            raise self.refused(value)
        return value if isinstance(value, str) else int(value)

    def allowed(self) -> str:
        return 'a whole number >= 1, or a name that the file has, such as "105.1"'

    def schema(self) -> Schema:
        return {"anyOf": [{"type": "integer", "minimum": 1}, {"type": "string"}], "description": self.doc}


class StructurePoint(FrozenRecord):
    """A point of a structure where links and contacts act, with the constant force there.

    `x` and `y` are degrees of freedom of the matrices; a structure given by modes names its points in the file.
    """

    x: int | str | None = setting(
        Freedom('degree of freedom along x, from 1, or node and direction, "105.1"'), default=None
    )
    y: int | str | None = setting(
        Freedom('degree of freedom along y, from 1, or node and direction, "105.2"'), default=None
    )
    angle: float = parameter(
        "rad",
        line,
        "angle φ from the structure's x to the direction of the slide, towards y",
        default=0.0,
        structural=True,
        letter="phi",
    )
    force: float = parameter(
        "N", real, "constant force in the direction of the slide", default=0.0, structural=True, letter="F"
    )
    press: float = parameter("N", real, "constant force towards the surface", default=0.0, structural=True, letter="P")


class StructureBody(Body, name="structure"):
    """A structure: matrices M, C, G, K, modes or a measured response from a file, with named points (theory 13).

    Links and contacts name its points: ``caliper.pad``. The direction of the slide makes an `angle` with the
    structure's own x; away from the surface is a quarter turn further.
    """

    matrices: StructureData | None = setting(
        OfStructure("file of matrices: .npz, .mat, .mtx for each of M, K, C, G, .sti, .op4, .pch"), default=None
    )
    units: str | None = setting(
        FileUnits('units of the matrices: length, mass or force, time, as in "mm t s"; SI units if missing'),
        default=None,
    )
    modes: StructureData | None = setting(
        OfStructure("file of modes: frequencies, damping ratios, shapes at named points"), default=None
    )
    response: ResponseData | None = setting(
        OfStructure("file of measured frequency responses: .uff, .csv or .mat", ResponseData), default=None
    )
    averages: int = setting(Whole("averages behind the coherence of each measured response", 1), default=1)
    spin: float | None = parameter(
        "rad/s", real, "speed of rotation, by which the gyroscopic matrix is multiplied; 1 unless given", default=None
    )
    kept_modes: int | None = setting(
        Whole("modes kept beside the degrees of freedom of points; all that the matrices have if missing", 0),
        default=None,
    )
    modal_damping: float | None = parameter(
        "1", nonnegative, "damping ratio of each mode of the structure alone, beside its damping matrix", default=None
    )
    points: Any = members(StructurePoint, "points, by name", default=Members())
    is_structure: ClassVar[bool] = True

    def inconsistencies(self) -> Iterator[Problem]:
        if sum(one is not None for one in (self.matrices, self.modes, self.response)) != 1:
            yield Problem("matrices", _ONE)
            return
        if self.kept_modes is not None and self.matrices is None:
            yield Problem("kept_modes", "is of matrices; allowed without them: fewer lines in the table of modes")
        for name, point in self.points.items():
            known, taken = name in self._read.points, (point.x, point.y) != (None, None)
            if known and taken:
                yield Problem(f"points.{name}", f"the file {self._read.source!r} has this point; leave x and y out")
            elif not known and not taken:
                found = ", ".join(self._read.points)
                hint = f"; the file names {found}" if found else ""
                yield Problem(f"points.{name}.x", f"missing; give the degree of freedom along x, y or both{hint}")
            for axis in ("x", "y"):
                try:
                    if (place := getattr(point, axis)) is not None:
                        self._read.row(place)
                except ParameterError as error:
                    yield Problem(f"points.{name}.{axis}", error.problems[0].message)
                    return
        most = self._read.size - len(self._rows)
        if self.kept_modes is not None and self.kept_modes > most:
            yield Problem("kept_modes", f"got {self.kept_modes}; allowed: up to {most}, the other degrees of freedom")

    @property
    def data(self) -> StructureData:
        """The matrices, reduced if so told, or those of the modes; of a response what tells where its points are."""
        return self._read if self.kept_modes is None else self._reduced[0]

    @property
    def reduction_error(self) -> float | None:
        """Largest relative error of the structure's own frequencies (`reduced`); None if it is not reduced."""
        return None if self.kept_modes is None else self._reduced[1]

    @property
    def _reduced(self) -> tuple[StructureData, float]:
        return _reduced_once(self._read, self._rows, self.kept_modes or 0)

    @property
    def _rows(self) -> tuple[int, ...]:
        """Rows of the matrices, from 0, that points name, each once."""
        places = (place for point in self.points.values() for place in (point.x, point.y) if place is not None)
        return tuple(dict.fromkeys(map(self._read.row, places)))

    @property
    def _read(self) -> StructureData:
        """Data as the file has them."""
        if self.response is not None:
            one = np.eye(len(self.response.names))
            return StructureData(one, 0 * one, one, 0 * one, self.response.points(), self.response.source)
        found = self.matrices if self.modes is None else self.modes
        if found is None:
            raise ParameterError([Problem("matrices", _ONE)])
        return found

    def point_names(self) -> tuple[str, ...]:
        """Names of the points: those of the file, and those given beside it."""
        return tuple(dict.fromkeys((*self.data.points, *self.points)))

    def axes(self, name: str) -> tuple[Array | None, Array | None]:
        """Rows of displacements of a point along the structure's own x and y; None where it does not move."""
        if name in self.data.points:
            return self.data.points[name]
        point = self.points[name]
        unit, rows = np.eye(self.data.size), self._rows
        places = (None if place is None else self._read.row(place) for place in (point.x, point.y))
        x, y = (
            None if place is None else unit[place if self.kept_modes is None else rows.index(place)] for place in places
        )
        return x, y

    def moves_away(self, name: str) -> bool:
        """True if a point has a displacement away from the surface."""
        return self.axes(name)[1] is not None or bool(self._point(name).angle != 0)

    def _point(self, name: str) -> StructurePoint:
        found: StructurePoint = self.points.get(name) or StructurePoint()
        return found

    def rows(self, name: str) -> tuple[Array, Array]:
        """Rows of displacements of a point along the slide, and away from the surface."""
        x, y = (np.zeros(self.data.size) if one is None else one for one in self.axes(name))
        angle = float(self._point(name).angle)
        return np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x

    def forces(self) -> Array:
        """Constant forces on the degrees of freedom, (n,); of symbols where forces and presses are."""
        found = np.zeros(self.data.size)
        for name, point in self.points.items():
            along, away = self.rows(name)
            found = found + point.force * along - point.press * away
        return found

    def damping_matrix(self) -> Array:
        """Damping with that of modes, and the gyroscopic matrix at the speed of rotation."""
        found = self.data.damping + (1.0 if self.spin is None else float(self.spin)) * self.data.gyroscopic
        return found + float(self.modal_damping) * self.data.modal_damping if self.modal_damping else found


_KEPT = Tested("degrees of freedom, numbers from 1 or names", lambda value: isinstance(value, (tuple, list)))


@checked(kept=_KEPT, modes=Whole("number of modes", 0))
def reduced(structure: StructureData, kept: Sequence[int | str], modes: int) -> tuple[StructureData, float]:
    """Smaller matrices of a structure by the reduction of Craig and Bampton, and their error.

    Parameters
    ----------
    structure : StructureData
        Its points that a file of modes names are kept.
    kept : sequence of int or str
        Degrees of freedom, counted from 1 or by name, that stay as they are: those of links, contacts and forces.
    modes : int
        Modes of the rest, with the degrees of freedom `kept` held, that are added; the lowest.

    Returns
    -------
    reduced : StructureData
        Its first degrees of freedom are those `kept`, in their order.
    error : float
        Largest relative error of the structure's own frequencies, up to half that of the last mode added (of the
        lowest without modes).

    Raises
    ------
    ParameterError
        If a degree of freedom does not exist or is named twice, or there are fewer modes.

    Examples
    --------
    >>> import numpy as np
    >>> chain = 2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1)
    >>> structure = ss.machine.StructureData(np.eye(4), 0.01 * chain, 1e6 * chain, np.zeros((4, 4)))
    >>> small, error = ss.machine.reduced(structure, kept=(4,), modes=2)
    >>> small.size, error < 0.1
    (3, True)
    """
    size, problems, rows = structure.size, [], []
    for one in kept:
        try:
            rows.append(structure.row(one))
        except ParameterError as error:
            problems.append(Problem("kept", error.problems[0].message))
    inside = np.array(rows, dtype=np.int64)
    if len(set(rows)) < len(rows):
        problems.append(Problem("kept", "names a degree of freedom twice"))
    if not problems and modes > size - len(kept):
        problems.append(
            Problem("modes", f"got {modes}; allowed: up to {size - len(kept)}, the other degrees of freedom")
        )
    if problems:
        raise ParameterError(problems)
    from scipy.linalg import eigh  # slow to import

    rest = np.setdiff1d(np.arange(size), inside)
    stiffness = 0.5 * (structure.stiffness + structure.stiffness.T)
    inner, first, last = np.ix_(rest, rest), np.arange(len(inside)), np.arange(modes) + len(inside)
    basis = np.zeros((size, len(inside) + modes))
    basis[inside, first] = 1.0
    basis[np.ix_(rest, first)] = -np.linalg.solve(stiffness[inner], stiffness[np.ix_(rest, inside)])
    squares = np.zeros(0)
    if modes:
        squares, shapes = eigh(stiffness[inner], structure.mass[inner], subset_by_index=[0, modes - 1])
        basis[np.ix_(rest, last)] = shapes
    mass, damping, held, turning = (
        basis.T @ one @ basis for one in (structure.mass, structure.damping, structure.stiffness, structure.gyroscopic)
    )
    points = {name: (_along(x, basis), _along(y, basis)) for name, (x, y) in structure.points.items()}
    names = tuple(structure.freedoms[row] for row in rows) if structure.freedoms else ()
    names += tuple(f"mode {i + 1}" for i in range(modes)) if names else ()
    small = StructureData(mass, damping, held, turning, points, freedoms=names)
    return small, _frequency_error(structure, small, _GOOD_TO**2 * float(squares[-1]) if modes else 0.0)


@lru_cache(maxsize=8)  # of a file; other values of a machine's parameters ask for the same again
def _reduced_once(structure: StructureData, rows: tuple[int, ...], modes: int) -> tuple[StructureData, float]:
    return reduced(structure, tuple(row + 1 for row in rows), modes)


def _along(row: Array | None, basis: Array) -> Array | None:
    return None if row is None else row @ basis


def _frequency_error(structure: StructureData, small: StructureData, most: float) -> float:
    """Largest relative error of natural frequencies whose squares are up to `most` (rad²/s²), one at least."""
    from scipy.linalg import eigvalsh  # slow to import

    whole, own = (eigvalsh(0.5 * (one.stiffness + one.stiffness.T), one.mass) for one in (structure, small))
    count = max(int(np.sum(whole <= most)), 1)
    count = min(count, small.size)
    free = _FREE * whole[-1]
    right = np.sqrt(np.maximum(whole[:count], free))
    return float(np.max(np.abs(np.sqrt(np.maximum(own[:count], free)) / right - 1)))
