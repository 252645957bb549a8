"""A machine in numbers at steady sliding, and the same machine with one parameter varied."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from steadyslip.core.errors import NoSteadySliding
from steadyslip.core.format import format_quantity
from steadyslip.core.questions import Keeper, question
from steadyslip.core.records import with_values
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.balance import Balance, balance
from steadyslip.model.numeric.machine_matrices import MachineMatrices, assemble
from steadyslip.model.numeric.pencil import StatePencil, linearised
from steadyslip.model.steady_results import ABSENT, SteadyContact, SteadyMachine


class MachinePoint(Keeper):
    """A machine in numbers; matrices, steady sliding and pencil are computed on first use."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine

    @cached_property
    def matrices(self) -> MachineMatrices:
        """Matrices, and contacts with the numbers of their laws."""
        return assemble(self.machine.mechanism())

    @cached_property
    def balance(self) -> Balance:
        """Steady sliding in numbers."""
        return balance(self.matrices)

    @cached_property
    def pencil(self) -> StatePencil:
        """Linearised equations; requires steady sliding."""
        return linearised(self.matrices, self.balance)

    def varied(self, name: str, value: float) -> MachinePoint:
        """The machine with another value (SI) of a parameter, which is not checked."""
        return MachinePoint(with_values(self.machine, {name: value}))

    @property
    def growing(self) -> int:
        """How many eigenvalues have a positive real part."""
        return int(np.sum(self.pencil.eigenvalues.real > 0))


@question
def _point(machine: Machine) -> MachinePoint:
    return MachinePoint(machine)


def machine_point(machine: Machine) -> MachinePoint:
    """The machine in numbers (cached with it)."""
    found: MachinePoint = _point(machine)
    return found


def absence(point: MachinePoint) -> NoSteadySliding:
    """Error for a machine without steady sliding: which contact locks up or lifts off, and by how much."""
    found = point.balance
    if not found.gain < 1:
        name = point.matrices.sites[int(np.argmax(np.abs(found.wanted)))].name
        words = ABSENT["together"].format(at=ABSENT["at"].format(name=name), margin=f"{1 - found.gain:.4g}")
        return NoSteadySliding(f"no steady sliding: {words}", "lock-up", float(1 - found.gain), name)
    least = int(np.argmin(found.wanted))
    site = point.matrices.sites[least]
    force = float(site.area * found.wanted[least])
    words = ABSENT["lifted"].format(at=ABSENT["at"].format(name=site.name), left=format_quantity(force, "N"))
    return NoSteadySliding(f"no steady sliding: {words}", "lift-off", force, site.name)


def steady_of(point: MachinePoint) -> SteadyMachine:
    """Steady sliding as a result.

    Raises
    ------
    NoSteadySliding
        Naming the contact that locks up or lifts off.
    """
    machine, found, matrices = point.machine, point.balance, point.matrices
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
