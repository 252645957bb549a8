"""Modes of a held rig: which contacts stick or slide, which limits of the controller are reached.

In a mode the motion is Y' = A Y (plus nonlinear friction of curved contacts) as long as every guard, a row times Y, is
not negative; the guard that becomes negative first determines the next mode by its `Switch`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.nonlinear.hunting.plant import Array, Load, Plant


class Switch(NamedTuple):
    """A change of mode: field of `HeldMode` (its name in the singular), index of contact or load, and new value."""

    name: str
    number: int
    to: int


@dataclass(frozen=True)
class HeldMode:
    """State of all contacts, loads and limits.

    Attributes
    ----------
    contacts : tuple of int
        For each contact -1, 0 or 1: sliding back, at rest, sliding forward.
    loads : tuple of int
        For each load of each contact in turn, its sign, -1 or 1.
    band : int
        Side of the dead band on which the error is, -1 or 1; 0 inside.
    clamp, limit : int
        Sign of the limit, -1 or 1, at which the integral term, or the whole force, is; 0 if within limits.
    """

    contacts: tuple[int, ...]
    loads: tuple[int, ...] = ()
    band: int = 0
    clamp: int = 0
    limit: int = 0

    def switched(self, switch: Switch) -> HeldMode:
        """Copy of this mode after the change `switch`."""
        change: Any = {switch.name: switch.to}
        if switch.name in ("contact", "load"):
            every = f"{switch.name}s"
            positions = list(getattr(self, every))
            positions[switch.number] = switch.to
            change = {every: tuple(positions)}
        return replace(self, **change)


class HeldPiece:
    """Equations of a plant in one mode; "row" is an ndarray (width,) that gives a quantity as row times state Y.

    Parameters
    ----------
    plant : Plant
    mode : HeldMode
    acceleration : float
        Acceleration of the target, m/s².
    least_load : float
        Size of a load below which its sign is ignored, N or Pa.
    """

    def __init__(self, plant: Plant, mode: HeldMode, acceleration: float, least_load: float = 0.0) -> None:
        self.plant, self.mode, self.acceleration, self.least_load = plant, mode, acceleration, least_load
        self.sampled = plant.limits.sample_time is not None

    @cached_property
    def linear(self) -> bool:
        """True if the motion is Y' = A Y: no bristles, and no sliding with drag proportional to a load."""
        contacts = zip(self.plant.contacts, self.mode.contacts, strict=True)
        return not any(one.slow or (way and one.curved) for one, way in contacts)

    @cached_property
    def banded(self) -> Array:
        """Row that gives the error that the controller integrates: zero within the dead band, else reduced by it."""
        band = self.plant.limits.dead_band
        if band is None:
            return self.plant.error()
        if not self.mode.band:
            return np.zeros(self.plant.width)
        return self.plant.error() - self.plant.row(one=self.mode.band * band)

    @cached_property
    def wanted(self) -> Array:
        """Row that gives the controller's force without its limit."""
        plant = self.plant
        (gain, damping), *others = plant.gains
        of_all = plant.limits.dead_band is not None and not plant.limits.of_integral
        rate = plant.error_rate()
        if plant.bands_rate and not self.mode.band:
            rate = np.zeros(plant.width)
        found = gain * (self.banded if of_all else plant.error()) + damping * rate
        for loop, (stiff, damped) in enumerate(others, start=1):
            found = found + stiff * plant.error(loop) + damped * plant.error_rate(loop)
        found[2 * plant.size] += plant.integral
        return found

    @cached_property
    def force(self) -> Array:
        """Row that gives the controller's force, limited if the mode is at the limit."""
        plant = self.plant
        if self.sampled:
            return plant.row(held=1.0)
        if self.mode.limit:
            return plant.row(one=self.mode.limit * (plant.limits.force or 0.0))
        return self.wanted

    @cached_property
    def pulls(self) -> tuple[tuple[Load, Array], ...]:
        """All loads, contact by contact, each with the row that gives its pull T."""
        loads = [load for contact in self.plant.contacts for load in contact.loads]
        return tuple((load, self.plant.passive(load) + load.controller * self.force) for load in loads)

    @cached_property
    def pressing(self) -> tuple[list[tuple[Load, Array]], ...]:
        """List for each contact of its loads, each with the row that gives the normal stress which the load adds."""
        sides = iter(zip(self.mode.loads, self.pulls, strict=True))
        found = []
        for contact in self.plant.contacts:
            own = [next(sides) for _ in contact.loads]
            found.append([(load, (load.forward if to > 0 else -load.back) * pull) for to, (load, pull) in own])
        return tuple(found)

    def normal(self, index: int) -> Array:
        """Row that gives the normal stress of a contact."""
        plant = self.plant
        return sum((row for _, row in self.pressing[index]), plant.row(one=plant.contacts[index].normal))

    def rest(self, index: int) -> Array:
        """Row that gives the largest friction force at rest of a contact."""
        own = self.plant.row(one=self.plant.contacts[index].rest)
        return sum((load.rest * row for load, row in self.pressing[index]), own)

    def drag(self, index: int) -> Array:
        """Row that gives the viscous coefficient (friction force per slip rate) due to loads; 0 at rest."""
        if not self.mode.contacts[index]:
            return np.zeros(self.plant.width)
        return sum((load.drag * row for load, row in self.pressing[index]), np.zeros(self.plant.width))

    def _coulomb(self, index: int) -> Array:
        own = self.plant.row(one=self.plant.contacts[index].coulomb)
        return sum((load.coulomb * row for load, row in self.pressing[index]), own)

    @cached_property
    def pushed(self) -> Array:
        """Rows (coordinates, width) that give the accelerations if contacts at rest had no friction."""
        plant, n = self.plant, self.plant.size
        rows = np.zeros((n, plant.width))
        rows[:, :n], rows[:, n : 2 * n] = -plant.stiffness, -plant.damping
        rows[:, 2 * n + 1], rows[:, 2 * n + 2] = -plant.target_stiffness, -plant.target_damping
        rows[:, -1] = plant.force
        rows += np.outer(plant.acts, self.force)
        for index, (contact, way) in enumerate(zip(plant.contacts, self.mode.contacts, strict=True)):
            if way and not contact.slow:
                friction = contact.drag * plant.slip(contact) + way * self._coulomb(index)
                rows -= np.outer(contact.row, friction)
        return rows / plant.inertia[:, None]

    @cached_property
    def resting(self) -> dict[int, Array]:
        """Rows that give the friction forces of contacts at rest, by index of the contact."""
        plant = self.plant
        own = [i for i, (one, way) in enumerate(zip(plant.contacts, self.mode.contacts, strict=True))
               if not way and not one.slow]  # fmt: skip
        if not own:
            return {}
        rows = np.array([plant.contacts[i].row for i in own])
        belts = np.array([plant.contacts[i].belt for i in own])
        carried = rows @ self.pushed
        carried[:, -1] -= belts * self.acceleration
        matrix = rows @ (rows / plant.inertia).T
        if np.linalg.matrix_rank(matrix) < len(own):
            raise NotAvailable(
                "the friction of contacts at rest is not determined, as there are more of them than bodies between "
                "which they slide; leave one out"
            )
        return dict(zip(own, np.linalg.solve(matrix, carried), strict=True))

    @cached_property
    def matrix(self) -> Array:
        """Matrix A (width, width) of Y' = A Y."""
        plant, n = self.plant, self.plant.size
        found = np.zeros((plant.width, plant.width))
        found[:n, n : 2 * n] = np.eye(n)
        found[n : 2 * n] = self.pushed
        for i, row in self.resting.items():
            found[n : 2 * n] -= np.outer(plant.contacts[i].row / plant.inertia, row)
        if plant.integral and not (self.sampled or self.mode.clamp):
            found[2 * n] = self.banded
        found[2 * n + 1, 2 * n + 2] = 1.0
        found[2 * n + 2, -1] = self.acceleration
        return found

    @cached_property
    def fastest(self) -> float:
        """Largest absolute eigenvalue of the linear system, 1/s."""
        return float(np.max(np.abs(np.linalg.eigvals(self.matrix)), initial=0.0))

    @cached_property
    def guards(self) -> tuple[Array, tuple[Switch, ...]]:
        """Guards (guards, width): rows whose values are not negative in this mode; and the switch of each guard."""
        found = [*self._of_contacts(), *self._of_loads(), *(self._of_controller() if not self.sampled else ())]
        rows = np.array([row for row, _ in found]) if found else np.zeros((0, self.plant.width))
        return rows, tuple(switch for _, switch in found)

    def _of_contacts(self) -> list[tuple[Array, Switch]]:
        plant = self.plant
        found = []
        for i, (contact, way) in enumerate(zip(plant.contacts, self.mode.contacts, strict=True)):
            slip = plant.slip(contact)
            if way:  # bristles: the guard is at half the speed, so that the contact does not switch to and fro
                found.append((way * slip - plant.row(one=0.5 * contact.slow), Switch("contact", i, 0)))
                continue
            bound, row = (plant.row(one=contact.slow), slip) if contact.slow else (self.rest(i), self.resting[i])
            found += [(bound - to * row, Switch("contact", i, to)) for to in (1, -1)]
        return found

    def _of_loads(self) -> list[tuple[Array, Switch]]:
        """Guards for the signs of loads; an offset of `least_load` keeps a zero load from switching to and fro."""
        least = self.plant.row(one=self.least_load)
        return [(to * pull + least, Switch("load", i, -to))
                for i, (to, (_, pull)) in enumerate(zip(self.mode.loads, self.pulls, strict=True))]  # fmt: skip

    def _of_controller(self) -> list[tuple[Array, Switch]]:
        plant, limits = self.plant, self.plant.limits
        found = []
        if limits.dead_band is not None:
            error = plant.error()
            found += _bounded("band", self.mode.band, error, plant.row(one=limits.dead_band))
        if limits.force is not None:
            found += _bounded("limit", self.mode.limit, self.wanted, plant.row(one=limits.force))
        if limits.integral is not None and plant.integral:
            if self.mode.clamp:
                found.append((self.mode.clamp * self.banded, Switch("clamp", 0, 0)))
            else:
                bound = plant.row(one=limits.integral / plant.integral)
                found += _bounded("clamp", 0, plant.row(integral=1.0), bound)
        return found


def _bounded(name: str, side: int, row: Array, bound: Array) -> list[tuple[Array, Switch]]:
    """Guards and switches for a quantity `row` with limits ±`bound`; `side` is 0 within them, else ±1 beyond them."""
    if side:
        return [(side * row - bound, Switch(name, 0, 0))]
    return [(bound - to * row, Switch(name, 0, to)) for to in (1, -1)]
