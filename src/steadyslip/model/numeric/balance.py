"""Steady sliding of a machine given by matrices: forces in balance at every contact's own slip rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.model.numeric.contact_laws import SteadyNumbers
from steadyslip.model.numeric.machine_matrices import MachineMatrices, Site

_STEPS = 60  # of Newton's method; laws that are linear in the stresses take two
_CONVERGED = 1e-13  # change of the stresses relative to them, some hundred units in the last place
_SHRINK = 0.1  # smallest share of a stress that one step leaves
_FREE = 1e-13  # pivot of the balances, relative to the largest, below which they leave a body free


@dataclass(frozen=True, eq=False)
class Balance:
    """Steady sliding in numbers.

    Attributes
    ----------
    sigma, tau : ndarray (contacts,)
        Stresses (Pa); NaN without steady sliding.
    displacement : ndarray (n,)
    integral : float
    gain : float
        Largest factor by which friction raises itself through the normal stresses; >= 1 is lock-up.
    wanted : ndarray (contacts,)
        Normal stresses that would balance the forces, negative ones too.
    """

    sigma: Array
    tau: Array
    displacement: Array
    integral: float
    gain: float
    wanted: Array

    @property
    def exists(self) -> bool:
        """True with steady sliding."""
        return bool(self.gain < 1 and np.all(np.isfinite(self.sigma)) and np.all(self.sigma > 0))


def state_of(site: Site, found: Balance, i: int, speeds: Array) -> tuple[float, ...]:
    """Arguments of the law functions at steady sliding: v, σ, T, τ, distance, stiffness."""
    return (
        site.velocity, float(found.sigma[i]), spring_of(site, found.displacement, found.integral, speeds),
        float(found.tau[i]), float(site.apart @ found.displacement), site.stiffness,
    )  # fmt: skip


def spring_of(site: Site, displacement: Array, integral: float, speeds: Array) -> float:
    """T (Pa) of a contact in steady sliding."""
    return float(site.pull @ displacement + site.pull_rate @ speeds) + site.pull_integral * integral + site.pull_moving


def balance(machine: MachineMatrices) -> Balance:
    """Steady sliding of a machine.

    Raises
    ------
    NotAvailable
        If the balances leave a body free, or Newton's method does not come to an end.
    """
    return _Newton(machine).solve()


class _Newton:
    """Newton's method in displacements, integral of the controller and normal stresses, in this order."""

    def __init__(self, machine: MachineMatrices) -> None:
        self.machine, self.sites = machine, machine.sites
        self.size, self.more = len(machine.names), int(machine.integrates)
        self.fixed = machine.force - machine.damping @ machine.speeds
        self.held = self._statics()

    def _statics(self) -> Array:
        """Matrix of the balances and of the controller's integral, without contacts."""
        n, own = self.size, self.machine
        found = np.zeros((n + self.more, n + self.more))
        found[:n, :n] = own.stiffness
        if self.more:
            found[:n, n], found[n, :n] = own.integral_acts, own.integral_senses
        return found

    def solve(self) -> Balance:
        count, start = len(self.sites), self.size + self.more
        unknown = np.concatenate([np.zeros(start), np.ones(count)])
        gain, wanted = -np.inf, np.full(count, np.nan)
        for step in range(_STEPS):
            matrix, right, loads, frictions = self._linear(unknown)
            new = _solved(matrix, right)
            if step == 0:
                gain = _friction_gain(matrix, loads, frictions, start)
            wanted = new[start:]
            change = np.max(np.abs(wanted - unknown[start:]) / np.maximum(np.abs(wanted), 1e-300), initial=0.0)
            if np.all(wanted > 0) and change <= _CONVERGED:
                return self._found(new, gain, wanted)
            if step and np.any(wanted <= 0) and np.all(unknown[start:][wanted <= 0] <= _SHRINK):
                break  # pressed against zero twice: the contact lifts
            unknown = np.concatenate([new[:start], np.maximum(wanted, _SHRINK * unknown[start:])])
        else:
            if not np.all(wanted > 0):
                return self._absent(gain, wanted)
            raise NotAvailable("steady sliding of this machine was not found: its laws depend too steeply on the load")
        return self._absent(gain, wanted)

    def _absent(self, gain: float, wanted: Array) -> Balance:
        nothing = np.full(len(self.sites), np.nan)
        return Balance(nothing, nothing, np.full(self.size, np.nan), np.nan, gain, wanted)

    def _found(self, unknown: Array, gain: float, wanted: Array) -> Balance:
        places, more = unknown[: self.size], unknown[self.size : self.size + self.more]
        integral = float(more[0]) if self.more else 0.0
        tau = np.array([self._numbers(i, unknown).friction for i in range(len(self.sites))])
        sigma = wanted if gain < 1 else np.full(len(self.sites), np.nan)
        return Balance(sigma, tau, places, integral, gain, wanted)

    def _numbers(self, i: int, unknown: Array) -> SteadyNumbers:
        site, places = self.sites[i], unknown[: self.size]
        integral = float(unknown[self.size]) if self.more else 0.0
        sigma = float(unknown[self.size + self.more + i])
        pulled = spring_of(site, places, integral, self.machine.speeds)
        distance = float(site.apart @ places)
        first = site.laws.steady(site.own, site.velocity, sigma, pulled, 0.0, distance, site.stiffness)
        return site.laws.steady(site.own, site.velocity, sigma, pulled, first.friction, distance, site.stiffness)

    def _linear(self, unknown: Array) -> tuple[Array, Array, Array, Array]:
        """Matrix and right side of a Newton step; the columns of friction forces, and slopes of friction with σ."""
        n, start, count = self.size, self.size + self.more, len(self.sites)
        matrix = np.zeros((start + count, start + count))
        matrix[:start, :start] = self.held
        right = np.zeros(start + count)
        right[:n] = self.fixed
        loads, frictions = np.zeros((start + count, count)), np.zeros(count)
        for i, site in enumerate(self.sites):
            now, row = self._numbers(i, unknown), start + i
            sigma = unknown[row]
            rest = now.friction - now.friction_by_stress * sigma  # τ = rest + slope σ near here
            loads[:n, i], frictions[i] = site.area * site.slip, now.friction_by_stress
            loads[row, i] = -now.by_friction
            matrix[:n, row] -= site.area * site.apart
            matrix[row, row] += 1
            matrix[row, :n] -= now.by_spring * site.pull + now.by_distance * site.apart
            if self.more:
                matrix[row, n] -= now.by_spring * site.pull_integral
            seen = now.by_friction * now.friction + now.by_distance * (site.apart @ unknown[:n])
            seen += now.by_spring * float(site.pull @ unknown[:n])
            if self.more:
                seen += now.by_spring * site.pull_integral * unknown[n]
            right[row] = now.pressed - seen
            right -= loads[:, i] * rest
            matrix[:, row] += loads[:, i] * now.friction_by_stress
        return matrix, right, loads, frictions


def _solved(matrix: Array, right: Array) -> Array:
    """Solution of linear equations; rows and columns of very different size are balanced first.

    Raises
    ------
    NotAvailable
        If the matrix is singular.
    """
    rows = np.max(np.abs(matrix), axis=1)
    even = matrix / np.where(rows > 0, rows, 1.0)[:, None]
    columns = np.max(np.abs(even), axis=0)
    columns = np.where(columns > 0, columns, 1.0)
    even = even / columns
    if np.min(rows, initial=np.inf) == 0 or np.linalg.cond(even) > 1 / _FREE:
        raise NotAvailable("nothing holds some body of this machine in its place; give every body a link")
    found: Array = np.linalg.solve(even, right / rows) / columns
    return found


def _friction_gain(matrix: Array, loads: Array, frictions: Array, start: int) -> float:
    """Largest real factor by which friction raises itself; −inf if none is real."""
    without = matrix.copy()
    without[:, start:] -= loads * frictions
    gains = np.linalg.eigvals(-np.linalg.solve(without, loads * frictions)[start:])
    real = np.abs(gains.imag) <= 1e-9 * np.abs(gains)  # rounding, as in `steadyslip.model.steady`
    return float(np.max(np.where(real, gains.real, -np.inf), initial=-np.inf))
