"""Steady sliding of a machine given by matrices: displacements and stresses at which all forces balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.model.numeric.contact_laws import SteadyNumbers
from steadyslip.model.numeric.machine_matrices import MachineMatrices, Site

_STEPS = 60  # most steps of Newton's method; two suffice if laws are linear in the stresses
_CONVERGED = 1e-13  # relative change of the stresses at which Newton's method has converged: some hundred roundings
_STALLED = 1e-6  # a relative change up to this size that no longer falls is rounding (stresses far below the forces)
_SHRINK = 0.1  # a step reduces a stress at most to this share of its value
_LARGE = 64  # number of unknowns above which solving systems of equations one by one is faster than all together
_FREE = 1e-13  # relative size of a pivot of the balances below which nothing holds some body in its place


@dataclass(frozen=True, eq=False)
class Balance:
    """Steady sliding in numbers, of one machine or of several along a leading axis (...).

    Attributes
    ----------
    sigma, tau : ndarray (..., contacts)
        Stresses (Pa); NaN without steady sliding.
    displacement : ndarray (..., n)
        Displacements of the coordinates that are not left out (`left_out`).
    integral : ndarray (...)
    gain : ndarray (...)
        Largest factor by which friction raises itself through the normal stresses; >= 1 is lock-up.
    wanted : ndarray (..., contacts)
        Normal stresses that would balance the forces, negative ones too.
    held, settled : ndarray of bool (...)
        `held` is False where nothing holds a body in its place, `settled` where Newton's method did not converge.
    """

    sigma: Array
    tau: Array
    displacement: Array
    integral: Array
    gain: Array
    wanted: Array
    held: NDArray[np.bool_]
    settled: NDArray[np.bool_]

    @property
    def problem(self) -> str:
        """Reason why steady sliding of a single machine was not found.

        Empty if it was found, or if it does not exist.
        """
        if not self.held:
            return "nothing holds some body of this machine in its place; give every body a link"
        return (
            ""
            if self.settled
            else ("steady sliding of this machine was not found: its laws depend too steeply on the load")
        )

    @property
    def exists(self) -> NDArray[np.bool_]:
        """True (...) where steady sliding exists."""
        there = self.held & self.settled & (self.gain < 1)
        return np.asarray(there & np.all(np.isfinite(self.sigma) & (self.sigma > 0), axis=-1))


def state_of(site: Site, found: Balance, i: int, speeds: Array) -> tuple[Any, ...]:
    """Arguments of the law functions at steady sliding: v, σ, T, τ, distance, stiffness."""
    return (
        site.velocity, found.sigma[..., i], spring_of(site, found.displacement, found.integral, speeds),
        found.tau[..., i], np.sum(site.apart * found.displacement, axis=-1), site.stiffness,
    )  # fmt: skip


def spring_of(site: Site, displacement: Array, integral: Array, speeds: Array) -> Array:
    """Pull T (Pa) on the body of a contact in steady sliding, (...)."""
    pulled = np.sum(site.pull * displacement + site.pull_rate * speeds, axis=-1)
    return np.asarray(pulled + site.pull_integral * integral + site.pull_moving)


def balances(machine: MachineMatrices) -> Balance:
    """Steady sliding of one machine or of several; `held` or `settled` is False where it was not found."""
    return _Newton(machine).solve()


class _Newton:
    """Newton's method for displacements, the controller's integral and normal stresses, in this order."""

    def __init__(self, machine: MachineMatrices) -> None:
        self.machine, self.sites = machine, machine.sites
        self.size, self.more = len(machine.names), int(machine.integrates)
        self.fixed = machine.force - np.einsum("...ij,...j->...i", machine.damping, machine.speeds)
        self.statics = self._statics()

    def _statics(self) -> Array:
        """Matrix of the balances and of the controller's integral, without the forces of contacts."""
        n, own = self.size, self.machine
        found = np.zeros((*own.several, n + self.more, n + self.more))
        found[..., :n, :n] = own.stiffness - own.followed
        if self.more:
            found[..., :n, n], found[..., n, :n] = own.integral_acts, own.integral_senses
        return found

    def solve(self) -> Balance:
        count, start, several = len(self.sites), self.size + self.more, self.machine.several
        unknown = np.concatenate([np.zeros((*several, start)), np.ones((*several, count))], axis=-1)
        held, settled, lifted = np.ones(several, bool), np.zeros(several, bool), np.zeros(several, bool)
        final, last = unknown, np.full(several, np.inf)
        for step in range(_STEPS):
            matrix, right = self._linear(unknown)
            new, solvable = _solved(matrix, right)
            held &= solvable | settled | lifted
            wanted, before = new[..., start:], unknown[..., start:]
            change = np.max(np.abs(wanted - before) / np.maximum(np.abs(wanted), 1e-300), axis=-1, initial=0.0)
            open_ = ~(settled | lifted)
            final = np.where(open_[..., None], new, final)
            still = (change <= _CONVERGED) | (change <= _STALLED) & (change >= 0.5 * last)
            settled |= open_ & np.all(wanted > 0, axis=-1) & still
            last = change
            if step:  # a stress that is reduced towards zero in two steps: the contact lifts off
                pressed = np.all((wanted > 0) | (before <= _SHRINK), axis=-1)
                lifted |= open_ & ~settled & np.any(wanted <= 0, axis=-1) & pressed
            if np.all(settled | lifted | ~held):
                break
            unknown = np.concatenate([new[..., :start], np.maximum(wanted, _SHRINK * before)], axis=-1)
        lifted |= ~settled & ~np.all(final[..., start:] > 0, axis=-1)
        return self._found(final, self._gain(final), held, settled & held, settled | lifted)

    def _found(
        self, unknown: Array, gain: Array, held: NDArray[np.bool_], there: NDArray[np.bool_], ended: NDArray[np.bool_]
    ) -> Balance:
        start = self.size + self.more
        unknown = np.where(held[..., None], unknown, np.nan)
        wanted, places = unknown[..., start:], unknown[..., : self.size]
        integral = unknown[..., self.size] if self.more else np.zeros(self.machine.several)
        tau = np.zeros(wanted.shape)
        for i in range(len(self.sites)):
            tau[..., i] = self._numbers(i, unknown).friction
        slides = there[..., None]
        sigma = np.where(slides & (gain < 1)[..., None], wanted, np.nan)
        return Balance(
            sigma, np.where(slides, tau, np.nan), np.where(slides, places, np.nan), np.where(there, integral, np.nan),
            gain, wanted, held, ended,
        )  # fmt: skip

    def _numbers(self, i: int, unknown: Array) -> SteadyNumbers:
        site, places = self.sites[i], unknown[..., : self.size]
        integral = unknown[..., self.size] if self.more else np.zeros(())
        sigma = unknown[..., self.size + self.more + i]
        pulled = spring_of(site, places, integral, self.machine.speeds)
        distance = np.sum(site.apart * places, axis=-1)
        first = site.laws.steady(site.own, site.velocity, sigma, pulled, 0.0, distance, site.stiffness)
        return site.laws.steady(site.own, site.velocity, sigma, pulled, first.friction, distance, site.stiffness)

    def _linear(self, unknown: Array) -> tuple[Array, Array]:
        """Matrix and right side of a Newton step."""
        n, start, more = self.size, self.size + self.more, self.more
        matrix = np.zeros((*unknown.shape, unknown.shape[-1]))
        matrix[..., :start, :start] = self.statics
        right = np.zeros(unknown.shape)
        right[..., :n] = self.fixed
        for i, site in enumerate(self.sites):
            now, row = self._numbers(i, unknown), start + i
            by_place, by_integral = self._pressing(site, now.by_spring, now.by_distance)
            load = np.zeros(unknown.shape)
            load[..., :n] = _times(site.area, site.slip)
            load[..., row] = -now.by_friction
            matrix[..., :n, row] -= _times(site.area, site.apart)
            matrix[..., row, row] += 1
            matrix[..., row, :n] -= by_place
            seen = now.by_friction * now.friction + np.sum(by_place * unknown[..., :n], axis=-1)
            if more:
                matrix[..., row, n] -= by_integral
                seen = seen + by_integral * unknown[..., n]
            right[..., row] = now.pressed - seen
            rest = now.friction - now.friction_by_stress * unknown[..., row]  # τ = rest + slope σ near here
            right -= _times(rest, load)
            matrix[..., row] += _times(now.friction_by_stress, load)
        return matrix, right

    def _pressing(self, site: Site, by_spring: Any, by_distance: Any) -> tuple[Array, Any]:
        """Derivatives of the normal stress with respect to displacements, (..., n), and to a controller's integral,
        (...)."""
        by_place = _times(by_spring, site.pull) + _times(by_distance, site.apart)
        return by_place, by_spring * site.pull_integral

    def _gain(self, unknown: Array) -> Array:
        """Largest real factor by which friction raises itself through normal stresses, (...); −inf if none is real.

        A given steady normal stress does not follow the friction of other contacts, only that of the contact itself
        (theory 4).
        """
        n, start = self.size, self.size + self.more
        without = np.zeros((*unknown.shape, unknown.shape[-1]))
        without[..., :start, :start] = self.statics
        loads = np.zeros((*unknown.shape, len(self.sites)))
        for i, site in enumerate(self.sites):
            now, row = self._numbers(i, unknown), start + i
            by_place, by_integral = self._pressing(site, now.coupled_by_spring, now.by_distance)
            without[..., :n, row] -= _times(site.area, site.apart)
            without[..., row, row] += 1
            without[..., row, :n] -= by_place
            if self.more:
                without[..., row, n] -= by_integral
            loads[..., :n, i] = _times(
                now.friction_by_stress * np.ones(self.machine.several), _times(site.area, site.slip)
            )
            loads[..., row, i] = -now.coupled_by_friction * now.friction_by_stress
        one = np.eye(unknown.shape[-1])
        good = np.all(np.isfinite(without), axis=(-2, -1)) & np.all(np.isfinite(loads), axis=(-2, -1))
        good &= np.linalg.slogdet(np.where(good[..., None, None], without, one))[0] != 0
        without = np.where(good[..., None, None], without, one)
        raised = -np.linalg.solve(without, np.where(good[..., None, None], loads, 0.0))[..., start:, :]
        for i, site in enumerate(self.sites):
            if site.laws.given:
                raised[..., i, :] = raised[..., i, i, None] * np.eye(len(self.sites))[i]
        gains = np.linalg.eigvals(raised)
        real = np.abs(gains.imag) <= 1e-9 * np.abs(gains)  # rounding, as in `steadyslip.model.steady`
        largest = np.max(np.where(real, gains.real, -np.inf), axis=-1, initial=-np.inf)
        return np.where(good, largest, np.inf)


def _times(factor: Any, row: Array) -> Array:
    """Rows (..., n) times factors (...)."""
    return np.asarray(np.asarray(factor)[..., None] * row)


def _solved(matrix: Array, right: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Solutions of linear equations, and True where a solution exists.

    Rows and columns of very different size are balanced first.
    """
    rows = np.max(np.abs(matrix), axis=-1)
    even = matrix / np.where(rows > 0, rows, 1.0)[..., None]
    columns = np.max(np.abs(even), axis=-2)
    columns = np.where(columns > 0, columns, 1.0)
    even = even / columns[..., None, :]
    finite = np.all(np.isfinite(even), axis=(-2, -1)) & np.all(np.isfinite(right), axis=-1)
    one = np.eye(matrix.shape[-1])
    even = np.where(finite[..., None, None], even, one)
    good = finite & np.all(rows > 0, axis=-1)
    right = right / np.where(rows > 0, rows, 1.0)
    if matrix.shape[-1] > _LARGE:
        solved = [_solved_by_factors(*pair) for pair in zip(even.reshape(-1, *one.shape), _flat(right), strict=True)]
        found = np.array(solved).reshape(right.shape)
        good &= np.all(np.isfinite(found), axis=-1)
    else:
        good &= np.linalg.cond(even) <= 1 / _FREE
        found = np.linalg.solve(np.where(good[..., None, None], even, one), right[..., None])[..., 0]
    return np.where(good[..., None], found / columns, np.nan), good


def _flat(rows: Array) -> Array:
    return rows.reshape(-1, rows.shape[-1])


def _solved_by_factors(matrix: Array, right: Array) -> Array:
    """Solution of one system of equations; NaN if it is singular by an estimate of its condition from LU factors.

    The condition from singular values would take ten times as long for hundreds of unknowns.
    """
    from scipy.linalg import lapack  # slow to import

    factors, pivots, _ = lapack.dgetrf(matrix)
    inverse_condition, _ = lapack.dgecon(factors, np.max(np.sum(np.abs(matrix), axis=0)))
    # norms are sums of entries here, up to n times the singular values
    if not inverse_condition * len(matrix) >= _FREE:
        return np.full(len(matrix), np.nan)
    found, _ = lapack.dgetrs(factors, pivots, right)
    return np.asarray(found)
