"""Matrices of a machine: M q'' + C q' + K q = forces of contacts, with directions of slip and of distance.

Displacements are absolute here, measured from the unstressed state of springs, with the load point at rest at zero:
the equations are linear but for the contacts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.machine.mechanism import LOAD_POINT, ContactPort, Element, Mechanism
from steadyslip.model.numeric.contact_laws import ContactFunctions, functions_of, numbers_of


@dataclass(frozen=True, eq=False)
class Site:
    """A contact among matrices: the friction stress τ acts against `slip`, the normal stress σ along `apart`.

    Attributes
    ----------
    name : str
    slip, apart : ndarray (n,)
        Rows of slip and of the distance of the surfaces.
    area, velocity, stiffness : float
        Area, slip rate in steady sliding, and k, the stiffness between body and load point.
    pull, pull_rate : ndarray (n,)
        Rows of T with displacements and velocities.
    pull_integral, pull_moving : float
        T by the integral of a controller, and by the motion of the load point alone.
    laws : ContactFunctions
    own : ndarray
        Values of the laws' parameters.
    """

    name: str
    slip: Array
    apart: Array
    area: float
    velocity: float
    stiffness: float
    pull: Array
    pull_rate: Array
    pull_integral: float
    pull_moving: float
    laws: ContactFunctions
    own: Array


@dataclass(frozen=True, eq=False)
class MachineMatrices:
    """Matrices of a machine without its contacts, and the contacts.

    Attributes
    ----------
    names : tuple of str
        Coordinates.
    mass, damping, stiffness : ndarray (n, n)
        Bodies, links, controllers and structures. The damping has the gyroscopic matrices in it.
    force, speeds : ndarray (n,)
        Constant forces, those of dashpots at the moving load point included, and speeds in steady sliding.
    integral_acts, integral_senses : ndarray (n,)
        Integral action of a controller: force −acts · I with I' = senses · q; zero without one.
    sites : tuple of Site
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

    @property
    def integrates(self) -> bool:
        """True with integral action."""
        return bool(np.any(self.integral_acts != 0))


def assemble(mechanism: Mechanism) -> MachineMatrices:
    """Matrices of a mechanism in numbers.

    Raises
    ------
    NotAvailable
        If a controller or friction law has a delay.
    """
    return _Assembler(mechanism).matrices()


class _Assembler:
    """Builder of one `MachineMatrices`."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        parts = mechanism.structures
        self.names = tuple(one.name for one in mechanism.coordinates) + tuple(n for p in parts for n in p.coordinates)
        self.place = {name: i for i, name in enumerate(self.names)}
        self.velocity = float(mechanism.velocity)
        speeds = [float(one.speed) for one in mechanism.coordinates]
        self.speeds = np.concatenate([speeds, *(p.speeds for p in parts)]) if self.names else np.zeros(0)

    def row(self, shares: Mapping[str, Any]) -> Array:
        found = np.zeros(len(self.names))
        for name, share in shares.items():
            if name != LOAD_POINT:
                found[self.place[name]] += float(share)
        return found

    def moving(self, shares: Mapping[str, Any]) -> float:
        """Velocity that a row gets from the load point."""
        return float(shares.get(LOAD_POINT, 0)) * self.velocity

    def matrices(self) -> MachineMatrices:
        own, size = self.mechanism, len(self.names)
        mass, damping, stiffness = np.zeros((3, size, size))
        bodies = range(len(own.coordinates))
        mass[bodies, bodies] = [float(one.inertia) for one in own.coordinates]
        force = np.zeros(size)
        force[: len(own.coordinates)] = [float(one.force) for one in own.coordinates]
        start = len(own.coordinates)
        for part in own.structures:
            inside = slice(start, start + len(part.coordinates))
            mass[inside, inside], damping[inside, inside] = part.mass, part.damping
            stiffness[inside, inside], force[inside] = part.stiffness, part.force
            start = inside.stop
        for one in own.elements:
            if one.delay != 0:
                raise NotAvailable("a controller with a delay is not offered beside a structure given by matrices")
            acts, senses = self.row(one.acts), self.row(one.senses)
            at, to = np.flatnonzero(acts), np.flatnonzero(senses)
            both = np.outer(acts[at], senses[to])
            stiffness[np.ix_(at, to)] += float(one.stiffness) * both
            damping[np.ix_(at, to)] += float(one.damping) * both
            force -= acts * float(one.damping) * self.moving(one.senses)
        acts, senses = np.zeros(size), np.zeros(size)
        if own.integral is not None:
            if own.integral.delay != 0:
                raise NotAvailable("a controller with a delay is not offered beside a structure given by matrices")
            acts, senses = self.row(own.integral.acts) * float(own.integral.gain), self.row(own.integral.senses)
        sites = tuple(map(self._site, own.contacts))
        return MachineMatrices(self.names, mass, damping, stiffness, force, self.speeds, acts, senses, sites)

    def _site(self, port: ContactPort) -> Site:
        slip, area = self.row(port.slip), float(port.area)
        laws = functions_of(port.friction, port.contact)
        velocity = float(slip @ self.speeds) + self.moving(port.slip)
        size = len(self.names)
        pull, rate, integral, moving, stiffness = np.zeros(size), np.zeros(size), 0.0, 0.0, 0.0
        if laws.follows_pull:
            body, pulling, behind, whole = self._pulling(port)
            lever = float(port.slip[body]) * area
            for one in pulling:
                share = float(one.acts.get(body, 0)) / lever
                pull -= share * float(one.stiffness) * self.row(one.senses)
                rate -= share * float(one.damping) * self.row(one.senses)
                moving -= share * float(one.damping) * self.moving(one.senses)
            if whole and self.mechanism.integral is not None:
                acting = self.mechanism.integral
                integral = -float(acting.acts.get(body, 0)) * float(acting.gain) / lever
            held = (float(e.acts.get(body, 0)) * float(e.stiffness) * float(e.senses.get(body, 0)) for e in behind)
            stiffness = sum(held) / (lever * float(port.slip[body]))
        return Site(
            port.name, slip, self.row(port.separation), area, velocity, stiffness, pull, rate, integral, moving, laws,
            numbers_of(port.friction, port.contact),
        )  # fmt: skip

    def _pulling(self, port: ContactPort) -> tuple[str, list[Element], list[Element], bool]:
        """Body that a contact holds, elements whose pull is T, those whose stiffness is k, and if a controller pulls.

        As in `steadyslip.model.forces`.
        """
        body, elements = next(name for name in port.slip if name != LOAD_POINT), self.mechanism.elements
        if body not in {one.name for one in self.mechanism.coordinates}:
            raise NotAvailable(
                f"contacts.{port.name}: the normal force of this law follows the pull of a spring, which a structure "
                "does not have; write law = 'compliant' or 'constant'"
            )
        belt = LOAD_POINT in port.slip
        pulling = [one for one in elements if not (LOAD_POINT in one.senses if belt else one.grounded)]
        if port.loaded_by:
            pulling = [one for one in elements if one.name == port.loaded_by]
            body = next(name for name in port.slip if name in pulling[0].acts)
            return body, pulling, pulling, False
        behind = [one for one in pulling if (one.grounded if belt else LOAD_POINT in one.senses)]
        return body, pulling, behind, not belt
