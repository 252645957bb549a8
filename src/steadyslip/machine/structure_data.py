"""Matrices of a structure in SI units, and smaller matrices by the reduction of Craig and Bampton."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.entries import Whole
from steadyslip.core.errors import ParameterError, Problem, repr_short
from steadyslip.core.options import Tested, checked
from steadyslip.core.pages import Displayed
from steadyslip.core.roles import fault

MOST_FREEDOM = 3000
"""Largest number of degrees of freedom of a structure: each matrix then takes 72 MB, eigenvalues take minutes."""
_FREE = 1e-10  # relative stiffness of a mode up to which the mode counts as rigid; files have some 11 digits
_GOOD_TO = 0.5  # share of the last mode's frequency up to which a reduction is usually taken as accurate
_LISTED = 12  # largest number of degrees of freedom that a message lists, in a line or two
_SYMMETRIC = 1e-8  # relative asymmetry of an inertia or gyroscopic matrix up to which it counts as rounding in the file
_HALVES = 4  # least size for which a triangular matrix with an entry in each row is taken for half of a symmetric one


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
            problems += [*self._inertia_problems(), *self._shape_problems()]
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
            exchanged = "; it is larger than the stiffness: are M and K exchanged?"
            yield Problem(
                "mass",
                "is not positive definite; allowed: inertia in every direction; condense massless coordinates"
                + (exchanged if largest > np.max(np.abs(self.stiffness)) else ""),
            )

    def _shape_problems(self) -> Iterator[Problem]:
        turning = self.gyroscopic
        if np.max(np.abs(turning + turning.T)) > _SYMMETRIC * np.max(np.abs(turning)):
            yield Problem(
                "gyroscopic",
                "is not skew-symmetric, so that it takes or feeds energy; allowed: G = -G.T; the rest is damping, C",
            )
        for name, letter in (("damping", "C"), ("stiffness", "K")):
            one = getattr(self, name)
            above, below = (np.count_nonzero(np.triu(half, 1)) for half in (one, one.T))
            if self.size >= _HALVES and min(above, below) == 0 < self.size - 1 <= max(above, below):
                side = "above" if above else "below"
                whole = f"{letter} + {letter}.T - diag(diag({letter}))"
                message = (
                    f"has entries {side} its diagonal only; allowed: the whole matrix, of half of a symmetric one "
                )
                yield Problem(name, f"{message}{whole}")

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.mass)

    def middle_of_slow(self, least: float) -> float:
        """Angular frequency (rad/s) of the middle mode of a structure that is held in place.

        0 if it is above `least`.
        """
        from scipy.linalg import eigvalsh  # slow to import

        stiff = 0.5 * (self.stiffness + self.stiffness.T)
        # avoids the computation of eigenvalues for nearly all structures
        if np.median(np.diag(stiff) / np.diag(self.mass)) > least**2:
            return 0.0
        squares = eigvalsh(stiff, self.mass)
        middle = squares[len(squares) // 2]
        return float(np.sqrt(middle)) if squares[0] > 0 and middle < least**2 else 0.0

    def bent(self, row: Array, force: float) -> tuple[float, float]:
        """Static displacement (m) in a direction `row` (n,) under a force (N) in this direction, and a frequency
        (rad/s).

        The angular frequency is Rayleigh's quotient of the bent shape. Both results are 0 if nothing holds the
        structure.
        """
        stiff = 0.5 * (self.stiffness + self.stiffness.T)
        try:
            shape = np.linalg.solve(stiff, row * force)
        except np.linalg.LinAlgError:
            return 0.0, 0.0
        energy, inertia = shape @ stiff @ shape, shape @ self.mass @ shape
        fastest = np.max(np.diag(stiff) / np.diag(self.mass))
        if not 0 < energy < np.inf or energy < _FREE * fastest * inertia:
            return 0.0, 0.0
        return float(row @ shape), float(np.sqrt(energy / inertia))

    @cached_property
    def digest(self) -> str:
        """Hash of the matrices, names and points."""
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
        """Index, from 0, of a degree of freedom.

        Raises
        ------
        ParameterError
            If no degree of freedom has this number, counted from 1, or this name.
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
        """Damping matrix (n, n), N s/m, with which each mode of inertia and symmetric stiffness has a damping ratio
        of 1."""
        squares, shapes = self._own_modes
        carried = self.mass @ shapes
        found: Array = (carried * (2 * np.sqrt(np.maximum(squares, 0.0)))) @ carried.T
        return found

    def __repr__(self) -> str:
        return f"StructureData({self.source or 'matrices'}, {self.size} degrees of freedom)"

    @cached_property
    def _own_modes(self) -> tuple[Array, Array]:
        """Squared frequencies (n,), rad²/s², rising, and mode shapes (n, n), from mass and symmetric stiffness."""
        from scipy.linalg import eigh  # slow to import

        squares, shapes = eigh(0.5 * (self.stiffness + self.stiffness.T), self.mass)
        return squares, shapes

    @cached_property
    def rigid_motions(self) -> Array:
        """Motions (n, k) that deform nothing; k = 0 for a structure that its stiffness holds in place."""
        squares, shapes = self._own_modes
        found: Array = shapes[:, np.abs(squares) <= _FREE * np.max(np.abs(squares), initial=0.0)]
        return found

    @property
    def gives_way(self) -> bool:
        """True if the stiffness is negative in some direction, so that nothing holds the structure without contact."""
        squares = self._own_modes[0]
        return bool(squares[0] < -_FREE * np.max(np.abs(squares)))


_KEPT = Tested("degrees of freedom, numbers from 1 or names", lambda value: isinstance(value, (tuple, list)))


@checked(kept=_KEPT, modes=Whole("number of modes", 0))
def reduced(structure: StructureData, kept: Sequence[int | str], modes: int) -> tuple[StructureData, float]:
    """Smaller matrices of a structure by the reduction of Craig and Bampton, and their error.

    Parameters
    ----------
    structure : StructureData
        Structure to be reduced; points that it has from a file of modes are kept.
    kept : sequence of int or str
        Degrees of freedom, by number from 1 or by name, that are not changed: those of links, contacts and forces.
    modes : int
        Number of modes that are added: the lowest modes of the structure with the degrees of freedom `kept` held.

    Returns
    -------
    reduced : StructureData
        Reduced structure; its first degrees of freedom are those in `kept`, in the same order.
    error : float
        Largest relative error of the structure's natural frequencies up to half that of the last mode added; without
        added modes, of the lowest frequency.

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


@lru_cache(maxsize=8)  # machines with other parameter values need the same reduction again
def reduced_once(structure: StructureData, rows: tuple[int, ...], modes: int) -> tuple[StructureData, float]:
    """Result of `reduced` for `rows` counted from 0; the result is cached."""
    return reduced(structure, tuple(row + 1 for row in rows), modes)


def _along(row: Array | None, basis: Array) -> Array | None:
    return None if row is None else row @ basis


def _frequency_error(structure: StructureData, small: StructureData, most: float) -> float:
    """Largest relative error of the natural frequencies whose squares are up to `most` (rad²/s²), at least of the
    lowest."""
    from scipy.linalg import eigvalsh  # slow to import

    whole, own = (eigvalsh(0.5 * (one.stiffness + one.stiffness.T), one.mass) for one in (structure, small))
    count = max(int(np.sum(whole <= most)), 1)
    count = min(count, small.size)
    free = _FREE * whole[-1]
    right = np.sqrt(np.maximum(whole[:count], free))
    return float(np.max(np.abs(np.sqrt(np.maximum(own[:count], free)) / right - 1)))
