"""Structures: bodies given by matrices, modes or a measured response, with named points for links and contacts."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.domains import line, real
from steadyslip.core.entries import Whole
from steadyslip.core.errors import ParameterError, Problem, repr_short
from steadyslip.core.names import Members
from steadyslip.core.options import Tested, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.records import FrozenRecord, members, parameter, setting
from steadyslip.core.roles import Entry, Schema, fault
from steadyslip.machine.bodies import Body
from steadyslip.machine.responses import ResponseData

MOST_FREEDOM = 3000
"""Most degrees of freedom of one structure: its matrices take 72 MB each, its eigenvalues minutes."""
_FREE = 1e-10  # stiffness of a mode relative to the largest that counts as none; files of 11 digits
_GOOD_TO = 0.5  # of the frequency of the last mode of a reduction, up to which it is meant to be good: usual practice
_ONE = "give exactly one of matrices, modes and response"
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
    source : str
        Name of the file; empty if made in Python.
    """

    mass: Array
    damping: Array
    stiffness: Array
    gyroscopic: Array
    points: Mapping[str, tuple[Array | None, Array | None]] = field(default_factory=dict)
    source: str = ""

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
        for name, rows in self.points.items():
            found.update(name.encode())
            for row in rows:
                found.update(b"-" if row is None else np.asarray(row, dtype=float).tobytes())
        return found.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StructureData) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

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


class StructurePoint(FrozenRecord):
    """A point of a structure where links and contacts act, with the constant force there.

    `x` and `y` are degrees of freedom of the matrices; a structure given by modes names its points in the file.
    """

    x: int | None = setting(Whole("degree of freedom along x, counted from 1", 1), default=None)
    y: int | None = setting(Whole("degree of freedom along y, counted from 1", 1), default=None)
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
        OfStructure("file of matrices: .npz, .mat, or .mtx for each of M, K, C, G"), default=None
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
    points: Any = members(StructurePoint, "points, by name", default=Members())
    is_structure: ClassVar[bool] = True

    def inconsistencies(self) -> Iterator[Problem]:
        if sum(one is not None for one in (self.matrices, self.modes, self.response)) != 1:
            yield Problem("matrices", _ONE)
            return
        for name, point in self.points.items():
            known, taken = name in self.data.points, (point.x, point.y) != (None, None)
            if known and taken:
                yield Problem(f"points.{name}", f"the file {self.data.source!r} has this point; leave x and y out")
            elif not known and not taken:
                found = ", ".join(self.data.points)
                hint = f"; the file names {found}" if found else ""
                yield Problem(f"points.{name}.x", f"missing; give the degree of freedom along x, y or both{hint}")
            for axis in ("x", "y"):
                place = getattr(point, axis)
                if place is not None and place > self.data.size:
                    yield Problem(
                        f"points.{name}.{axis}",
                        f"got {place}; allowed: 1 to {self.data.size}, the structure's degrees of freedom",
                    )

    @property
    def data(self) -> StructureData:
        """The matrices, or those of the modes; of a response a stand-in that only tells where points are."""
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
        unit = np.eye(self.data.size)
        return tuple(None if place is None else unit[place - 1] for place in (point.x, point.y))  # type: ignore[return-value]

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
        """Damping, and the gyroscopic matrix at the speed of rotation."""
        return self.data.damping + (1.0 if self.spin is None else float(self.spin)) * self.data.gyroscopic


_KEPT = Tested("numbers of degrees of freedom, counted from 1", lambda value: isinstance(value, (tuple, list)))


@checked(kept=_KEPT, modes=Whole("number of modes", 0))
def reduced(structure: StructureData, kept: Sequence[int], modes: int) -> tuple[StructureData, float]:
    """Smaller matrices of a structure by the reduction of Craig and Bampton, and their error.

    Parameters
    ----------
    structure : StructureData
        Its points that a file of modes names are kept.
    kept : sequence of int
        Degrees of freedom, counted from 1, that stay as they are: those of links, contacts and forces.
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
    size = structure.size
    inside = np.array(kept, dtype=np.int64) - 1
    problems = [Problem("kept", f"has {one}; allowed: 1 to {size}") for one in kept if not 1 <= one <= size]
    if len(set(kept)) < len(kept):
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
    small = StructureData(mass, damping, held, turning, points)
    return small, _frequency_error(structure, small, _GOOD_TO**2 * float(squares[-1]) if modes else 0.0)


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
