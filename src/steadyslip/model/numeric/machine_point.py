"""A machine given by numbers at steady sliding, and the same machine with one parameter varied."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.caching import HasCache, cached
from steadyslip.core.errors import NoSteadySliding, NotAvailable
from steadyslip.core.format import format_quantity
from steadyslip.core.records import with_values
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric import refuse_response
from steadyslip.model.numeric.balance import Balance, balances
from steadyslip.model.numeric.machine_matrices import MachineMatrices, VariedMachine, assemble
from steadyslip.model.numeric.measured import MeasuredMachine
from steadyslip.model.numeric.pencil import StatePencil, growing_roots, linearised, pencils
from steadyslip.model.steady_results import ABSENT, SteadyContact, SteadyMachine


@dataclass(frozen=True, eq=False)
class MachinesAlong:
    """Machines that differ in one parameter: their steady sliding, and their pencils E z' = A z.

    Attributes
    ----------
    balance : Balance
        Steady sliding.
    size : int
        Number of coordinates.
    e, a : ndarray (p, K, K)
        Those rows and columns of the pencils that the parameter may change.
    posed : ndarray of bool (p,)
        As in `StatePencil`.
    own : StatePencil or None
        Pencil of the machine itself, if `e` and `a` do not contain all rows and columns; else None.
    at : ndarray of int (K,)
        Indices of the rows of `e` and `a` in the whole pencil.
    """

    balance: Balance
    size: int
    e: Array
    a: Array
    posed: NDArray[np.bool_]
    own: StatePencil | None
    at: NDArray[np.int64]

    def pencil(self, i: int) -> StatePencil | None:
        """Pencil of machine number i; None if it has no steady sliding."""
        return self._pencil(i) if self.balance.exists[i] else None

    def _pencil(self, i: int) -> StatePencil:
        if self.own is None:
            return StatePencil(self.e[i], self.a[i], self.size, bool(self.posed[i]))
        e, a, both = self.own.e.copy(), self.own.a.copy(), np.ix_(self.at, self.at)
        e[both], a[both] = self.e[i], self.a[i]
        return StatePencil(e, a, self.size, bool(self.posed[i]))

    def growing(self, sure: bool) -> NDArray[np.int64]:
        """Number of growing eigenvalues of each machine, (p,).

        It is `ILL_POSED` for ill-posed machines, and, if `sure`, `UNDECIDED` where rounding hides a sign.
        """
        if self.own is None:
            return growing_roots(self.e, self.a, self.size, self.posed, sure)
        return np.array([self._pencil(i).growing(sure) for i in range(len(self.posed))])


class MachinePoint(HasCache):
    """A machine given by numbers; matrices, steady sliding and pencil are computed when they are first needed."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self._varied: dict[str, VariedMachine] = {}

    @cached_property
    def matrices(self) -> MachineMatrices:
        """Matrices of the machine, and its contacts with the parameters of their laws."""
        return assemble(self.machine)

    @cached_property
    def balance(self) -> Balance:
        """Steady sliding in numbers; see `Balance.problem`."""
        return balances(self.matrices)

    @cached_property
    def pencil(self) -> StatePencil:
        """Linearised equations; requires steady sliding."""
        return linearised(self.matrices, self.balance)

    def varied(self, name: str, value: float) -> MachinePoint:
        """The machine with another value (SI) of a parameter, which is not checked."""
        return MachinePoint(with_values(self.machine, {name: value}))

    def along(self, name: str, values: Array) -> MachinesAlong:
        """Machines with the given values (p,), SI, of a parameter, which are not checked."""
        whole = not self.balance.exists  # a machine without steady sliding has no pencil
        matrices = self._matrices_along(name, values, whole)
        found = balances(matrices)
        e, a, posed = pencils(matrices, found)
        size = len(self.matrices.names)
        if matrices.kept is None:
            return MachinesAlong(found, size, e, a, posed, None, np.arange(e.shape[-1]))
        at = np.concatenate([matrices.kept, size + matrices.kept, np.arange(2 * size, len(self.pencil.a))])
        return MachinesAlong(found, size, e, a, posed, self.pencil, at)

    def balances_along(self, name: str, values: Array) -> Balance:
        """Steady sliding of the machines with the given values (p,), SI, of a parameter."""
        return balances(self._matrices_along(name, values))

    def _matrices_along(self, name: str, values: Array, whole: bool = False) -> MachineMatrices:
        if name not in self._varied:
            self._varied[name] = VariedMachine(self.machine, name)
        return self._varied[name].matrices(np.asarray(values, dtype=float), whole)

    @property
    def growing(self) -> int:
        """Number of eigenvalues with a positive real part."""
        return int(np.sum(self.pencil.eigenvalues.real > 0))


@cached
def _point(machine: Machine) -> MachinePoint:
    return MachinePoint(machine)


def machine_point(machine: Machine) -> MachinePoint:
    """The machine as numbers at steady sliding; the result is cached with the machine.

    Raises
    ------
    NotAvailable
        If the machine has a structure given by its measured response.
    """
    refuse_response(machine)
    found: MachinePoint = _point(machine)
    return found


def absence(point: MachinePoint | MeasuredMachine) -> NoSteadySliding:
    """Error for a machine without steady sliding.

    It names the contact that locks up or lifts off, and the shortfall.
    """
    found = point.balance
    if not found.gain < 1:
        name = point.matrices.sites[int(np.argmax(np.abs(found.wanted)))].name
        words = ABSENT["together"].format(at=ABSENT["at"].format(name=name), margin=f"{1 - found.gain:.4g}")
        return NoSteadySliding(f"no steady sliding: {words}", "lock-up", float(1 - found.gain), name)
    least = int(np.argmin(found.wanted))
    site = point.matrices.sites[least]
    force = float(site.area * found.wanted[least]) + 0.0  # not -0
    words = ABSENT["lifted"].format(at=ABSENT["at"].format(name=site.name), left=format_quantity(force, "N"))
    return NoSteadySliding(f"no steady sliding: {words}", "lift-off", force, site.name)


def steady_of(point: MachinePoint | MeasuredMachine) -> SteadyMachine:
    """Steady sliding as a result.

    Raises
    ------
    NoSteadySliding
        If a contact locks up or lifts off; the message names it.
    NotAvailable
        If steady sliding was not found.
    """
    machine, found, matrices = point.machine, point.balance, point.matrices
    if found.problem:
        raise NotAvailable(found.problem)
    if not found.exists:
        raise absence(point)
    contacts = {}
    for i, site in enumerate(matrices.sites):
        tau, sigma = float(found.tau[i]), float(found.sigma[i])
        seen = site.laws.observed(site.own, site.velocity, sigma, tau)
        contacts[site.name] = SteadyContact(site.velocity, site.area * sigma, site.area * tau, tau / sigma, seen)
    place = {name: i for i, name in enumerate(matrices.names)}
    bodies, mechanism = machine.bodies, machine.mechanism()
    links: dict[str, float] = {}
    units: dict[str, str] = {n: "rad/s" if n in bodies and bodies[n].turns else "m/s" for n in machine.ends()}
    turning = {one.name for one in mechanism.coordinates if one.unit == "rad"}
    drive = {"drive": float(mechanism.velocity)}
    for one in mechanism.elements:
        if one.name:
            held = _along(one.senses, found.displacement, place)
            moved = _along(one.senses, matrices.speeds, place) + float(one.senses.get("drive", 0)) * drive["drive"]
            name = one.name.removeprefix("links.")
            links[name] = -float(one.stiffness) * held - float(one.damping) * moved + 0.0
            twisted = all(n in turning for n in one.acts if n in place)
            units[one.name] = "N m" if twisted else "N"
    units["drive"] = "rad/s" if machine.drive.turns else "m/s"
    speeds = {n: float(speed) for n, speed in machine.speeds().items()}
    return SteadyMachine(drive["drive"], speeds, contacts, links, units)


def _along(row: Any, values: Any, place: dict[str, int]) -> float:
    return float(sum(float(share) * values[place[name]] for name, share in row.items() if name in place))
