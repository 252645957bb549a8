"""Derivatives of an eigenvalue by parameters of a machine, and by springs, dampers and masses that could be added.

By first-order perturbation: dλ = −u (dP) v / (u P'(λ) v), with P(s) = s E − A and u, v its left and right null vectors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.pages import Displayed
from steadyslip.machine.mechanism import LOAD_POINT, NORMAL, Shares
from steadyslip.model.numeric.machine_point import MachinePoint

_STEP = 0.01  # relative step of differences of matrices; exact if the matrices are linear in the parameter
_STENCIL = np.array([-1, 9, -45, 45, -9, 1]) / 60  # central differences of sixth order: error 1e-12 if smooth
_PLACES = np.array([-3, -2, -1, 1, 2, 3])  # positions at which `_STENCIL` needs values, in steps
ADDED = ("spring", "damper", "mass")
SLIDING, TURNING = ("N/m", "N s/m", "kg"), ("N m/rad", "N m s/rad", "kg m^2")


@dataclass(frozen=True)
class ModeChange(Displayed):
    """Derivative of an eigenvalue by a parameter, or by a spring, damper or mass that is added.

    Attributes
    ----------
    name : str
        Dotted name of a parameter; or of the end or link at which something is added.
    value : float or None
        Value of the parameter (SI); None for additions.
    unit : str
    slope : complex
        dλ/dp, 1/s over `unit`; the real part is the derivative of the growth rate.
    added : str
        ``spring``, ``damper`` or ``mass``, towards the ground or in a link; empty for a parameter.
    """

    name: str
    value: float | None
    unit: str
    slope: complex
    added: str = ""

    @property
    def relative(self) -> complex:
        """Derivative dλ/d ln|p| (1/s); NaN for additions."""
        return complex(np.nan, np.nan) if self.value is None else self.slope * abs(self.value)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI units."""
        found = {"name": self.name, "value": self.value, "unit": self.unit, "added": self.added}
        return found | {"slope": [self.slope.real, self.slope.imag]}


class Perturbation:
    """Derivatives of one eigenvalue s (1/s) of a machine."""

    def __init__(self, point: MachinePoint, s: complex) -> None:
        self.point, self.s = point, s
        self.left, self.right = point.pencil.vectors(s)
        self.scale = self.left @ point.pencil.e @ self.right

    def by_parameter(self, name: str, value: float) -> complex:
        """Derivative dλ/dp by a parameter with a nonzero value; NaN if steady sliding ends close to it."""
        machines = self.point.along(name, value * (1 + _STEP * _PLACES))
        if not np.all(machines.balance.exists):
            return complex(np.nan, np.nan)
        pencils = self.s * machines.e - machines.a
        change = np.einsum("i,pij,j,p->", self.left[machines.at], pencils, self.right[machines.at], _STENCIL)
        return complex(-change / (_STEP * value * self.scale))

    def by_addition(self, row: Array, power: int) -> complex:
        """Derivative of λ by a spring, damper or mass (`power` 0, 1, 2) from the ground to the motion along `row` (n,).

        The force is −s^power · displacement.
        """
        n = len(row)
        moved, pushed = self.right[:n] @ row, self.left[n : 2 * n] @ row
        return complex(-(self.s**power) * pushed * moved / self.scale)

    def parameters(self) -> Iterator[ModeChange]:
        """Yield the derivatives by all nonzero parameters."""
        for name, one in self.point.machine.parameters().items():
            if one.value:
                yield ModeChange(name, float(one.value), one.role.unit, self.by_parameter(name, float(one.value)))

    def additions(self) -> Iterator[ModeChange]:
        """Yield the derivatives by springs, dampers and masses to the ground.

        Links get a stiffness or a damping if they have none.
        """
        machine = self.point.machine
        for end in machine.ends():
            turns = end in machine.bodies and machine.bodies[end].turns
            for name, row in ((end, machine.row(end, "x")), (end + NORMAL, machine.row(end, "y"))):
                if row:
                    yield from self._added(name, row, TURNING if turns else SLIDING)
        known = machine.parameters()
        for element in machine.mechanism().elements:
            if element.name:
                own = [known[f"{element.name}.{what}"] for what in ("stiffness", "damping")]
                units = ["" if one.value else one.role.unit for one in own]
                yield from self._added(element.name, element.senses, units)

    def _added(self, name: str, shares: Shares, units: Sequence[str]) -> Iterator[ModeChange]:
        row = np.zeros(len(self.point.matrices.names))
        for one, share in shares.items():
            if one != LOAD_POINT:
                row[self.point.matrices.names.index(one)] += float(share)
        for power, unit in enumerate(units):
            if unit:
                yield ModeChange(name, None, unit, self.by_addition(row, power), ADDED[power])


def changes_of(point: MachinePoint, s: complex) -> tuple[ModeChange, ...]:
    """Derivatives of an eigenvalue by parameters, largest effect on the growth rate first, then by additions."""
    found = Perturbation(point, s)
    known = [one for one in found.parameters() if np.isfinite(one.slope)]
    return (*sorted(known, key=lambda one: -abs(one.relative.real)), *found.additions())
