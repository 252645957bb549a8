"""Structures: bodies given by matrices, modes or a measured response, with named points for links and contacts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import permutations
from numbers import Integral
from typing import Any, ClassVar

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.dimensions import unit
from steadyslip.core.domains import line, nonnegative, real
from steadyslip.core.entries import Whole
from steadyslip.core.errors import ParameterError, Problem, QuantityError, repr_short
from steadyslip.core.format import format_percent, format_quantity
from steadyslip.core.names import Members
from steadyslip.core.quantities import parse
from steadyslip.core.records import FrozenRecord, members, parameter, setting
from steadyslip.core.roles import Entry, Schema, fault
from steadyslip.machine.bodies import Body
from steadyslip.machine.responses import ResponseData
from steadyslip.machine.structure_data import StructureData, reduced_once

_ONE = "give exactly one of matrices, modes and response"
_DAMPED = 0.1  # damping ratios of at least this size are reported as doubtful: they were probably given in percent
_FEEDING = 0.2  # share of frequencies at which, by measurement errors, a passive structure may seem to supply energy
_SLOW = 0.2  # rad/s; doubtful if half of the modes are slower: the slowest modes of towers and ships have .1 to 1
_HELD = 2 * np.pi * 10  # rad/s; slower motions under a force are not reported: they may be of a body on soft mounts
_STRONGEST = 200.0  # m/s; strain is velocity over that of sound: steel yields below 25 m/s, rubber breaks below 100
# a negative eigenvalue of a damping matrix up to this share of the largest counts as rounding in the file
_SMALL = 1e-8
_UNITS = 'units of length, of mass or force, and of time, as in "mm t s" or "mm N s"'


@dataclass(frozen=True)
class Unread:
    """Placeholder for data of a file that cannot be read, with the reason."""

    reason: str


@dataclass(frozen=True)
class OfStructure(Entry):
    """Field type whose value is the data of a structure.

    In a file the field holds the name of another file, which is read before the field is checked.
    """

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
            raise ParameterError([Problem("matrices", "were made in Python; save them to a file and read it first")])
        return json.dumps(value.source)


@dataclass(frozen=True)
class FileUnits(Entry):
    """Field type whose value names the units of length, mass or force, and time of a finite-element file, which does
    not state them."""

    doc: str

    def checked(self, value: Any) -> str:
        unit_sizes(value)
        return str(value)

    def allowed(self) -> str:
        return _UNITS

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1, "description": self.doc}


def unit_sizes(units: Any) -> tuple[float, float, float]:
    """Sizes of the units of length, mass and time in m, kg and s, from text such as ``"mm t s"`` or ``"mm N s"``.

    Raises
    ------
    ParameterError
        If the text is not three such units; the caller adds the name of the field.

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
    """Field type whose value is a degree of freedom of matrices, given by its number from 1 or by its name."""

    doc: str

    def checked(self, value: Any) -> int | str:
        if isinstance(value, bool) or not (isinstance(value, (str, Integral))):
            raise self.refused(value)
        if not isinstance(value, str) and int(value) < 1:
            raise self.refused(value)
        return value if isinstance(value, str) else int(value)

    def allowed(self) -> str:
        return 'a whole number >= 1, or a name in the file, such as "105.1"'

    def schema(self) -> Schema:
        return {"anyOf": [{"type": "integer", "minimum": 1}, {"type": "string"}], "description": self.doc}


class StructurePoint(FrozenRecord):
    """A point of a structure to which links and contacts can be attached, with a constant force on it.

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

    def moves_across(self, point: str) -> bool:
        """True if a point has a degree of freedom y, across its x direction, or has no degree of freedom x."""
        own = self.points.get(point)
        given = None if own is None or (own.x, own.y) == (None, None) else (own.x, own.y)
        along, across = given or self._read.points[point]
        return across is not None or along is None

    def inconsistencies(self) -> Iterator[Problem]:
        if sum(one is not None for one in (self.matrices, self.modes, self.response)) != 1:
            yield Problem("matrices", _ONE)
            return
        if self.kept_modes is not None and self.matrices is None:
            yield Problem("kept_modes", "is only for matrices; to keep fewer modes, delete lines in the table of modes")
        for name, point in self.points.items():
            known, taken = name in self._read.points, (point.x, point.y) != (None, None)
            if known and taken:
                yield Problem(f"points.{name}", f"the file {self._read.source!r} has this point; leave x and y out")
            elif not known and not taken:
                found = ", ".join(self._read.points)
                hint = f"; the file names {found}" if found else ""
                yield Problem(f"points.{name}.x", f"missing; give the degree of freedom along x, y or both{hint}")
            if taken and point.x == point.y:
                message = f"is {repr_short(point.y)}, the same as x; allowed: another degree of freedom, or none"
                yield Problem(f"points.{name}.y", message)
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

    def doubts(self) -> Iterator[str]:
        """Yield a sentence for each allowed but doubtful value; it begins with the key in the body's table."""
        small = "of structures .0001 to .1 are measured, and 2 % is 0.02"
        if self.modal_damping is not None and self.modal_damping >= _DAMPED:
            yield f"modal_damping = {self.modal_damping:g} is a damping ratio; {small}"
        if self.modes is not None:
            of_modes = self.modes
            critical = 2 * np.sqrt(np.diag(of_modes.mass) * np.diag(of_modes.stiffness))
            ratios = np.diag(of_modes.damping)[critical > 0] / critical[critical > 0]
            if len(ratios) and np.min(ratios) < 0:
                yield (
                    f"modes: {of_modes.source!r} has a damping ratio of {np.min(ratios):.3g}, which feeds its mode: "
                    "is its sign right?"
                )
            if len(ratios) and np.min(ratios) >= _DAMPED:
                yield f"modes: {of_modes.source!r} has damping ratios from {np.min(ratios):.3g}; {small}"
            shapes = [row for pair in of_modes.points.values() for row in pair if row is not None]
            scaled = bool(shapes) and len(ratios) > 1 and bool(np.all(np.max(np.abs(shapes), axis=0) == 1))
            if scaled and np.all(np.diag(of_modes.mass) == 1):
                yield (
                    f"modes: {of_modes.source!r} has shapes whose largest entry is 1 in every mode, no modal masses: "
                    "are they scaled to that? Give modal masses (kg) in a column mass, or shapes of unit modal mass"
                )
            for (one, (_, y)), (other, (x, _)) in permutations(of_modes.points.items(), 2):
                alone = of_modes.points[one][0] is None and of_modes.points[other][1] is None
                if alone and y is not None and x is not None and SequenceMatcher(None, one, other).ratio() >= 0.5:
                    yield f"modes: {of_modes.source!r} has {one}.y and {other}.x alone: is that one point?"
        elif self.matrices is not None:
            own = np.linalg.eigvalsh(0.5 * (self.matrices.damping + self.matrices.damping.T))
            if own[0] < -_SMALL * np.max(np.abs(own)):
                yield "matrices: the damping C feeds some motions (it has negative eigenvalues): is its sign right?"
            if middle := self.matrices.middle_of_slow(_SLOW):
                yield (
                    f"matrices: half of the modes have periods from {format_quantity(2 * np.pi / middle, 's')} on, "
                    "slower than any structure: are M and K exchanged, or is the unit of time wrong?"
                )
        elif self.response is not None:
            wrong = {name: share for name, share in self.response.feeding().items() if share > _FEEDING}
            if turning := self.response.step_in_turns():
                steps = f"{self.response.source!r} has frequencies in steps of 2 pi times {turning:g} Hz"
                remedy = "write frequency [rad/s] at their column, or divide them by 2 pi"
                yield f"response: {steps}: are they in rad/s? Then {remedy}"
            if wrong:
                names, most = " and ".join(f"{name}/{name}" for name in wrong), format_percent(max(wrong.values()))
                what = f"{names} of {self.response.source!r} would feed energy at up to {most} of the frequencies"
                why = "are signs, phase and unit right? Motion is as exp(+i omega t), in which a structure lags"
                yield f"response: {what}: {why}"

    def overloaded(self, name: str, force: float) -> str:
        """Question to the user if a normal force (N) at a point would break any structure; empty if it would not.

        A structure of frequency ω that a force bends by d is strained as by a vibration of velocity ω d, whatever its
        size. If a file in mm and t is read as m and kg, ω stays the same, and d is a thousand times too large.
        """
        if self.response is not None:
            return ""
        along, away = self.rows(name)
        bent, omega = self.data.bent(away if np.any(away) else along, force)
        if omega < _HELD or bent * omega < _STRONGEST:
            return ""
        bends = f"the normal force of {format_quantity(force, 'N')} would bend it by {format_quantity(bent, 'm')}"
        far = f"which at its frequency of {format_quantity(omega / (2 * np.pi), 'Hz')} no material withstands"
        files = "shapes not of modal masses of 1 kg" if self.matrices is None else "matrices not in m, kg and s"
        if self.matrices is not None and self.units is None:
            files += ' (then write their units, as in units = "mm t s")'
        return f"{bends}, {far}: are the {files}, or is the force wrong?"

    @property
    def data(self) -> StructureData:
        """Matrices of the structure, reduced if `kept_modes` is given.

        For a measured response, unit matrices with its points.
        """
        return self._read if self.kept_modes is None else self._reduced[0]

    @property
    def reduction_error(self) -> float | None:
        """Largest relative error of the natural frequencies by the reduction (`reduced`); None if not reduced."""
        return None if self.kept_modes is None else self._reduced[1]

    @property
    def _reduced(self) -> tuple[StructureData, float]:
        return reduced_once(self._read, self._rows, self.kept_modes or 0)

    @property
    def _rows(self) -> tuple[int, ...]:
        """Indices (from 0) of the degrees of freedom that points name, without repetition."""
        places = (place for point in self.points.values() for place in (point.x, point.y) if place is not None)
        return tuple(dict.fromkeys(map(self._read.row, places)))

    @property
    def _read(self) -> StructureData:
        """Data of the file, not reduced. For a measured response, unit matrices with its points."""
        if self.response is not None:
            return self.response.placed
        found = self.matrices if self.modes is None else self.modes
        if found is None:
            raise ParameterError([Problem("matrices", _ONE)])
        return found

    def point_names(self) -> tuple[str, ...]:
        """Names of the points in the data file and in the rig file."""
        return tuple(dict.fromkeys((*self.data.points, *self.points)))

    def axes(self, name: str) -> tuple[Array | None, Array | None]:
        """Rows (n,) that give the displacements of a point along x and y of the structure; None where it is fixed."""
        if name in self.data.points:
            return self.data.points[name]
        point = self.points[name]
        return self._axis(point.x), self._axis(point.y)

    def _axis(self, place: int | str | None) -> Array | None:
        """Unit row (n,) that selects a degree of freedom, given by number or name; None for None."""
        if place is None:
            return None
        row, found = self._read.row(place), np.zeros(self.data.size)
        found[row if self.kept_modes is None else self._rows.index(row)] = 1.0
        return found

    def moves_away(self, name: str) -> bool:
        """True if a point can move away from the surface."""
        return self.axes(name)[1] is not None or bool(self._point(name).angle != 0)

    def _point(self, name: str) -> StructurePoint:
        found: StructurePoint = self.points.get(name) or StructurePoint()
        return found

    def rows(self, name: str) -> tuple[Array, Array]:
        """Rows (n,) that give the displacements of a point along the slide and away from the surface."""
        x, y = (np.zeros(self.data.size) if one is None else one for one in self.axes(name))
        angle = float(self._point(name).angle)
        return np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x

    def forces(self) -> Array:
        """Constant forces (N) on the degrees of freedom, (n,); symbolic if forces of points are symbols."""
        found = np.zeros(self.data.size)
        for name, point in self.points.items():
            along, away = self.rows(name)
            found = found + point.force * along - point.press * away
        return found

    def damping_matrix(self) -> Array:
        """Sum of the damping matrix, the gyroscopic matrix at the speed of rotation, and modal damping; (n, n), SI."""
        found = self.data.damping
        if np.any(self.data.gyroscopic):
            found = found + (1.0 if self.spin is None else float(self.spin)) * self.data.gyroscopic
        return found + float(self.modal_damping) * self.data.modal_damping if self.modal_damping else found
