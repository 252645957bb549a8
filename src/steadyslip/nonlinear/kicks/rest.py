"""Steady sliding under constant inputs: the state to which a kicked rig may return."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction
from steadyslip.model.point import OperatingPoint
from steadyslip.model.reduction import Reduction
from steadyslip.model.scales import natural_scales

NEUTRAL = 1e-8  # small motions are neutral if they grow or decay by less than this per radian of oscillation


@dataclass(frozen=True, eq=False)
class Rest:
    """Steady sliding of m rigs at constant inputs, in the n state variables of the kernels.

    Attributes
    ----------
    reduction : Reduction
    point : OperatingPoint
        Parameters of the rigs, as numbers or arrays (m,).
    velocity, force, pressure : ndarray (m,)
        Velocity of the load point, m/s; force on a body, N; added normal stress, Pa, for machines N.
    state : ndarray (m, n)
        Steady state; NaN where there is none.
    unknowns : ndarray (m, u)
        Solutions of the force balances in steady sliding, in the order of `Reduction.unknowns`.
    scales : ndarray (m, n)
        Natural sizes of the state variables.
    matrix : ndarray (m, n, n)
        Jacobian of the rates in steady sliding, in natural sizes, 1/s.
    roots : ndarray (m, n)
        Eigenvalues of `matrix`, 1/s.
    """

    reduction: Reduction
    point: OperatingPoint
    velocity: Array
    force: Array
    pressure: Array
    state: Array
    unknowns: Array
    scales: Array
    matrix: Array
    roots: Array

    @property
    def sigmas(self) -> tuple[Array, ...]:
        """Steady normal stresses (m,) of each contact at the rigs' own inputs, to which the equations refer, Pa."""
        own = (np.asarray(sigma, dtype=float) for sigma in self.point.sigmas)
        return tuple(np.broadcast_to(sigma, self.velocity.shape) for sigma in own)

    def arguments(self) -> tuple[Any, ...]:
        """Arguments of compiled functions, as of `field.field_of`, that precede the state."""
        own = (np.broadcast_to(np.asarray(one, dtype=float), self.velocity.shape) for one in self.point.steady)
        return (*self.point.arguments, *own, self.velocity, self.force, self.pressure)

    @property
    def is_machine(self) -> bool:
        """True for a machine, whose bodies and contacts have names."""
        return bool(self.reduction.model.contacts[0].name)

    @property
    def places(self) -> tuple[int, ...]:
        """Indices of the displacements in the state."""
        own = {one.displacement for one in self.reduction.model.coordinates}
        return tuple(i for i, symbol in enumerate(self.reduction.state) if symbol in own)

    @property
    def speeds(self) -> Array:
        """Typical velocity of each coordinate in `places`, shape (m, places)."""
        if not self.is_machine:
            return np.asarray(np.abs(self.velocity)[:, None])
        own, _ = natural_scales(self.point, self.reduction)
        names = [self.reduction.names[i].removesuffix("x") + "v" for i in self.places]
        faster = np.abs(self.velocity / np.asarray(self.point.drive, dtype=float))
        return np.asarray(faster[:, None] * in_columns([own[name] for name in names], len(self.velocity)))

    @property
    def natural_slip(self) -> Array:
        """Natural length (m,) of a step of the load point, m; inf where no spring connects it to a body."""
        shifts = np.abs(in_columns(self.point.evaluate(_shifts(self.reduction)), len(self.velocity)))
        with np.errstate(divide="ignore"):
            return np.asarray(np.min(self.scales[:, list(self.places)] / shifts, axis=1))

    @property
    def time(self) -> Array:
        """Natural time (m,), s: the time in which the load point, or else a body, moves by its natural length."""
        by_load = self.natural_slip / np.abs(self.velocity)
        if np.all(np.isfinite(by_load)):
            return np.asarray(by_load)
        by_body = np.min(self.scales[:, list(self.places)] / self.speeds, axis=1)
        return np.asarray(np.where(np.isfinite(by_load), by_load, by_body))

    @property
    def contact(self) -> int:
        """Index of the contact that moves most in the leading mode of the first rig; its slip defines events."""
        slidings = self.reduction.slidings
        if len(slidings) == 1 or not np.all(np.isfinite(self.matrix[0])):
            return 0
        roots, vectors = np.linalg.eig(self.matrix[0])
        mode = vectors[:, np.argmax(roots.real)] * self.scales[0]
        first = self.point.part(np.array([0]))
        rows = in_columns(first.evaluate(_slip_gradients(self.reduction)), 1).reshape(len(slidings), -1)
        ratios = in_columns(first.evaluate(_ratios(self.reduction)), 1)[0]
        return int(np.argmax(np.abs(rows @ mode) / np.abs(ratios)))

    def slip_rate(self, contact: int) -> Array:
        """Slip rate (m,) of a contact in steady sliding, m/s."""
        ratios = in_columns(self.point.evaluate(_ratios(self.reduction)), len(self.velocity))
        return np.asarray(self.velocity * ratios[:, contact])

    @property
    def exists(self) -> Array:
        """True (m,) where steady sliding exists."""
        return np.asarray(np.all(np.isfinite(self.roots), axis=1))

    @property
    def leading(self) -> Array:
        """The eigenvalue with the largest real part (m,); NaN where there is no steady sliding."""
        real = np.where(np.isnan(self.roots.real), -np.inf, self.roots.real)
        return np.take_along_axis(self.roots, np.argmax(real, axis=1)[:, None], axis=1)[:, 0]

    @property
    def neutral(self) -> Array:
        """True (m,) where small motions neither grow nor decay, within rounding."""
        leading, largest = self.leading, np.max(np.abs(self.roots), axis=1)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(leading.real) <= NEUTRAL * np.abs(leading) + 1e-15 * largest)

    @property
    def stable(self) -> Array:
        """True (m,) where small motions decay; False where they are neutral."""
        with np.errstate(invalid="ignore"):
            return np.asarray((self.leading.real < 0) & ~self.neutral)

    def part(self, which: Array) -> Rest:
        """Steady sliding of the rigs with indices `which`."""
        own = (getattr(self, name)[which] for name in (
            "velocity", "force", "pressure", "state", "unknowns", "scales", "matrix", "roots"))  # fmt: skip
        return Rest(self.reduction, self.point.part(which), *own)

    def column(self, number: Any) -> Any:
        """A number or array (m,) of a parameter, as (m, 1) if it is an array, to broadcast against (m, d) arrays."""
        return number[:, None] if np.ndim(number) and len(number) != 1 else number


def picked(array: Any, which: Array) -> Any:
    """Entries `which` of an array with one entry for each rig; the array itself if one entry is for all rigs."""
    return array[which] if np.ndim(array) and len(array) > 1 else array


@cached
def _shifts(reduction: Reduction) -> ArrayFunction:
    return reduction.model.function(reduction.shifts)


@cached
def _ratios(reduction: Reduction) -> ArrayFunction:
    return reduction.model.function(one.ratio for one in reduction.slidings)


@cached
def _slip_gradients(reduction: Reduction) -> ArrayFunction:
    return reduction.model.function(sp.diff(one.slip, s) for one in reduction.slidings for s in reduction.state)


def in_columns(numbers: Any, count: int) -> Array:
    """Array (count, columns) whose columns are numbers or arrays (count,)."""
    found = np.empty((count, len(numbers)))
    for i, number in enumerate(numbers):  # np.broadcast_to and np.column_stack take ten times as long
        found[:, i] = number
    return found
