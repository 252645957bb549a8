"""Matrices of a machine: M q'' + C q' + K q = forces of contacts, with directions of slip and of distance.

Displacements are absolute here, measured from the unstressed state of springs, with the load point at rest at zero:
the equations are linear except for the contacts. Machines that differ in one parameter are assembled together, as
arrays with a leading axis: shapes (...) are () for one machine, (p,) for p values of a parameter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.records import with_values
from steadyslip.core.symbols import inner_symbol
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT, ContactPort, Element, Mechanism
from steadyslip.model.numeric.contact_laws import ContactFunctions, functions_of, numbers_of
from steadyslip.model.numeric.left_out import LeftOut, alike, left_out, touched

_VARIED = inner_symbol("n_varied", real=True)
NO_PULL = (
    "contacts.{name}: the normal force of this law follows the pull of a spring, which a structure does not have; "
    "write law = 'compliant' or 'constant'"
)
_DELAYED = "a controller with a delay is not offered beside a structure given by matrices"


@dataclass(frozen=True, eq=False)
class Site:
    """A contact in terms of matrices: the friction stress τ acts against `slip`, the normal stress σ along `apart`.

    Attributes
    ----------
    name : str
    slip, apart : ndarray (..., n)
        Coefficients of the displacements in the slip, and in the distance of the surfaces.
    area, velocity, stiffness : float or ndarray (...)
        Area, slip rate in steady sliding, and k, the stiffness between body and load point.
    pull, pull_rate : ndarray (..., n)
        Coefficients of displacements and of velocities in the pull T.
    pull_integral, pull_moving : float or ndarray (...)
        Pull T per unit of a controller's integral, and the part of T due to the motion of the load point.
    laws : ContactFunctions
    own : tuple of float or ndarray (...)
        Values of the laws' parameters.
    """

    name: str
    slip: Array
    apart: Array
    area: Any
    velocity: Any
    stiffness: Any
    pull: Array
    pull_rate: Array
    pull_integral: Any
    pull_moving: Any
    laws: ContactFunctions
    own: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class MachineMatrices:
    """Matrices of a machine without its contacts, and the contacts.

    Attributes
    ----------
    names : tuple of str
        Coordinates.
    mass, damping, stiffness : ndarray (..., n, n)
        Contributions of bodies, links, controllers and structures. The damping includes gyroscopic matrices.
    force, speeds : ndarray (..., n)
        Constant forces, including those of dashpots at the moving load point; speeds in steady sliding.
    integral_acts, integral_senses : ndarray (..., n)
        Integral action of a controller: force −acts · I with I' = senses · q; zero without one.
    sites : tuple of Site
    kept : ndarray of int (n,) or None
        Indices of `names` among all coordinates of the machine, if some are left out.
    followed : ndarray (n, n) or ()
        Stiffness to be subtracted in steady sliding because of the coordinates left out.
    """

    names: tuple[str, ...]
    mass: Array
    damping: Array
    stiffness: Array
    force: Array
    speeds: Array
    integral_acts: Array
    integral_senses: Array
    sites: tuple[Site, ...]
    kept: NDArray[np.int64] | None = None
    followed: Array = field(default_factory=lambda: np.zeros(()))

    @property
    def integrates(self) -> bool:
        """True if a controller has integral action."""
        return bool(np.any(self.integral_acts != 0))

    @property
    def several(self) -> tuple[int, ...]:
        """The leading axis: () for one machine, (p,) for p machines."""
        return self.force.shape[:-1]


_OF_MACHINES = ("mass", "damping", "stiffness", "force", "speeds", "integral_acts", "integral_senses")
_OF_SITES = (
    "slip", "apart", "area", "velocity", "stiffness", "pull", "pull_rate", "pull_integral", "pull_moving",
)  # fmt: skip


def assemble(machine: Machine) -> MachineMatrices:
    """Matrices of a machine.

    Raises
    ------
    NotAvailable
        If a controller or friction law has a delay.
    """
    return _Assembler(machine.mechanism(), np.zeros(())).matrices()


class VariedMachine:
    """A machine as a function of one parameter; coordinates that it does not change are left out if they are many."""

    def __init__(self, machine: Machine, name: str) -> None:
        kind, _, rest = name.partition(".")
        self.machine, self.name = machine, name
        self.own = machine.mechanism()
        self._left: dict[frozenset[str], LeftOut | None] = {}
        self.of_structure = kind == "bodies" and machine.bodies[rest.partition(".")[0]].is_structure
        if not self.of_structure:  # methods of structures take numbers, not symbols
            self.mechanism = with_values(machine, {name: _VARIED}).mechanism()
            self.left = left_out(self.own, touched(self.own))

    def matrices(self, values: Array, whole: bool = False) -> MachineMatrices:
        """Matrices of the machines with parameter `values` (p,), SI, which are not checked.

        If `whole`, of all coordinates.
        """
        if self.of_structure:
            mechanisms = [with_values(self.machine, {self.name: float(one)}).mechanism() for one in values]
            left = None if whole else self._left_of(mechanisms)
            nothing = np.zeros(())
            return _stacked([_Assembler(one, nothing, left).matrices() for one in mechanisms])
        return _Assembler(self.mechanism, values, None if whole else self.left).matrices()

    def _left_of(self, mechanisms: Sequence[Mechanism]) -> LeftOut | None:
        """Coordinates that can be left out of all the machines; None if their structures differ."""
        if not all(alike(one.structures, self.own.structures) for one in mechanisms):
            return None
        names = frozenset().union(*map(touched, (self.own, *mechanisms)))
        if names not in self._left:
            self._left[names] = left_out(self.own, names)
        return self._left[names]


def _stacked(several: list[MachineMatrices]) -> MachineMatrices:
    """Machines that differ in numbers only, combined along a leading axis."""

    def together(records: Sequence[Any], names: tuple[str, ...]) -> dict[str, Any]:
        return {name: np.stack([getattr(one, name) for one in records]) for name in names}

    first = several[0]
    sites = []
    for own in zip(*(one.sites for one in several), strict=True):
        numbers = tuple(np.array(values) for values in zip(*(one.own for one in own), strict=True))
        sites.append(replace(own[0], own=numbers, **together(own, _OF_SITES)))
    return replace(first, sites=tuple(sites), **together(several, _OF_MACHINES))


@lru_cache(maxsize=256)
def _function_of(given: sp.Expr) -> ArrayFunction:
    return ArrayFunction([_VARIED], [given])


class _Assembler:
    """Builder of one `MachineMatrices`; numbers of the mechanism may contain the varied parameter."""

    def __init__(self, mechanism: Mechanism, values: Array, left: LeftOut | None = None) -> None:
        mechanism = mechanism if left is None else left.of(mechanism)
        self.mechanism, self.values, self.left = mechanism, values, left
        self.known: dict[sp.Expr, Array] = {}
        parts = mechanism.structures
        self.names = tuple(one.name for one in mechanism.coordinates) + tuple(n for p in parts for n in p.coordinates)
        self.place = {name: i for i, name in enumerate(self.names)}
        self.velocity = self.number(mechanism.velocity)
        self.speeds = self.zeros(len(self.names))
        for i, one in enumerate(mechanism.coordinates):
            self.speeds[..., i] = self.number(one.speed)
        start = len(mechanism.coordinates)
        for part in parts:
            pace = np.asarray(self.number(part.pace))[..., None]
            self.speeds[..., start : start + len(part.coordinates)] = part.motion * pace
            start += len(part.coordinates)

    def number(self, given: Any) -> Any:
        """A number of the mechanism as a float, or, if it depends on the varied parameter, one float per value (p,)."""
        if not isinstance(given, sp.Basic) or _VARIED not in given.free_symbols:
            return float(given)
        if given not in self.known:
            found = _function_of(given)(self.values)[0]
            self.known[given] = np.broadcast_to(np.asarray(found, dtype=float), self.values.shape)
        return self.known[given]

    def zeros(self, *shape: int) -> Array:
        return np.zeros((*self.values.shape, *shape))

    def row(self, shares: Mapping[str, Any]) -> Array:
        found = self.zeros(len(self.names))
        for name, share in shares.items():
            if name != LOAD_POINT:
                found[..., self.place[name]] += self.number(share)
        return found

    def moving(self, shares: Mapping[str, Any]) -> Any:
        """Velocity (m/s) that the motion of the load point contributes to the quantity with these coefficients."""
        return self.number(shares.get(LOAD_POINT, 0)) * self.velocity

    def matrices(self) -> MachineMatrices:
        own, size, left = self.mechanism, len(self.names), self.left
        mass, damping, stiffness = self.zeros(size, size), self.zeros(size, size), self.zeros(size, size)
        force = self.zeros(size)
        for i, body in enumerate(own.coordinates):
            mass[..., i, i], force[..., i] = self.number(body.inertia), self.number(body.force)
        start = len(own.coordinates)
        for part in own.structures:
            inside = slice(start, start + len(part.coordinates))
            mass[..., inside, inside], damping[..., inside, inside] = part.mass, part.damping
            stiffness[..., inside, inside], force[..., inside] = part.stiffness, part.force
            start = inside.stop
        for one in own.elements:
            if one.delay != 0:
                raise NotAvailable(_DELAYED)
            self._add_element(one, stiffness, damping, force)
        acts, senses = self.zeros(size), self.zeros(size)
        if own.integral is not None:
            if own.integral.delay != 0:
                raise NotAvailable(_DELAYED)
            acts = self.row(own.integral.acts) * np.asarray(self.number(own.integral.gain))[..., None]
            senses = self.row(own.integral.senses)
        sites, followed = tuple(map(self._site, own.contacts)), np.zeros(())
        if left is not None:
            paces = np.stack([np.broadcast_to(self.number(one.pace), self.values.shape) for one in own.structures], -1)
            force, followed = force - left.force - paces @ left.force_by_pace.T, left.stiffness
        return MachineMatrices(
            self.names, mass, damping, stiffness, force, self.speeds, acts, senses, sites,
            None if left is None else left.kept, followed,
        )  # fmt: skip

    def _add_element(self, one: Element, stiffness: Array, damping: Array, force: Array) -> None:
        spring, dashpot = self.number(one.stiffness), self.number(one.damping)
        behind = dashpot * self.moving(one.senses)
        for name, act in one.acts.items():
            if name == LOAD_POINT:
                continue
            i, share = self.place[name], self.number(act)
            force[..., i] -= share * behind
            for other, sense in one.senses.items():
                if other != LOAD_POINT:
                    both = share * self.number(sense)
                    stiffness[..., i, self.place[other]] += spring * both
                    damping[..., i, self.place[other]] += dashpot * both

    def _site(self, port: ContactPort) -> Site:
        slip, area = self.row(port.slip), self.number(port.area)
        laws = functions_of(port.friction, port.contact)
        velocity = np.sum(slip * self.speeds, axis=-1) + self.moving(port.slip)
        size = len(self.names)
        pull, rate, integral, moving, stiffness = self.zeros(size), self.zeros(size), 0.0, 0.0, 0.0
        if laws.follows_pull:
            body, pulling, behind, whole = self._pulling(port)
            lever = self.number(port.slip[body]) * area
            for one in pulling:
                share = self.number(one.acts.get(body, 0)) / lever
                row = self.row(one.senses)
                pull -= np.asarray(share * self.number(one.stiffness))[..., None] * row
                rate -= np.asarray(share * self.number(one.damping))[..., None] * row
                moving = moving - share * self.number(one.damping) * self.moving(one.senses)
            if whole and self.mechanism.integral is not None:
                acting = self.mechanism.integral
                integral = -self.number(acting.acts.get(body, 0)) * self.number(acting.gain) / lever
            for one in behind:
                both = self.number(one.acts.get(body, 0)) * self.number(one.senses.get(body, 0))
                stiffness = stiffness + both * self.number(one.stiffness)
            stiffness = stiffness / (lever * self.number(port.slip[body]))
        return Site(
            port.name, slip, self.row(port.separation), area, velocity, stiffness, pull, rate, integral, moving, laws,
            tuple(self.number(one) for one in numbers_of(port.friction, port.contact)),
        )  # fmt: skip

    def _pulling(self, port: ContactPort) -> tuple[str, list[Element], list[Element], bool]:
        """The body that a contact holds, the elements of T, the elements of k, and True if a controller may pull too.

        T and k are defined as in `steadyslip.model.forces`.
        """
        body, pulling = next(name for name in port.slip if name != LOAD_POINT), self.mechanism.pulling(port)
        if body not in {one.name for one in self.mechanism.coordinates}:
            raise NotAvailable(NO_PULL.format(name=port.name))
        belt = LOAD_POINT in port.slip
        if port.loaded_by:
            body = next(name for name in port.slip if name in pulling[0].acts)
            return body, pulling, pulling, False
        behind = [one for one in pulling if (one.grounded if belt else LOAD_POINT in one.senses)]
        return body, pulling, behind, not belt
