"""Chances of stable sliding for many rigs at once, each with tolerances about its own values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from steadyslip.core.arrays import Array, valid_together
from steadyslip.files.specifications.tolerance_tables import Tolerances
from steadyslip.linear.status import STABLE, status
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.verdict.spreads import GROUPS, Spreads, spreads_of
from steadyslip.verdict.tolerances import LOG2_CLOSED, LOG2_OTHERS, chance_of, log2_of

AT_ONCE = 2**20  # rigs judged together; bounds memory
LOG2_FEW, LOG2_FEWEST = 7, 4  # rigs of one group in searches: of one parameter, of two; fewer without closed form


@dataclass(frozen=True)
class Chances:
    """Chances of a rig and of those that differ from it in some values.

    Attributes
    ----------
    rig : Slider or Machine
    spreads : Spreads or None
        None without tolerances: chances are 0 or 1.
    sizes : tuple of int
        Base-2 logarithms of the number of rigs of one group: of the whole sample, of few and of the fewest.
    """

    rig: Slider | Machine
    spreads: Spreads | None
    sizes: tuple[int, int, int]

    @property
    def single(self) -> bool:
        """True without tolerances."""
        return self.spreads is None

    def own(self, name: str) -> float:
        """The rig's own value of a parameter, SI units."""
        return float(self.rig.parameters()[name].value or 0.0)

    def allowed(self, name: str, values: Array) -> Array:
        """Mask of the values of a parameter whose tolerance stays inside its domain, and that the rig can have."""
        domain = self.rig.parameters()[name].role.domain
        spread = None if self.spreads is None else self.spreads.of.get(name)
        good = np.asarray(domain.contains(values), dtype=bool)
        if spread is not None and not spread.normal:
            moved = spread.moved(values)
            good &= np.asarray(domain.contains(moved.low) & domain.contains(moved.high), dtype=bool)
        return np.asarray(good & np.broadcast_to(valid_together(self.rig, "", {name: values}), values.shape))

    def few(self, changes: Mapping[str, Array]) -> Array:
        """Chances of rigs with other values (m,), each from some thousand rigs."""
        return self._chances(changes, self.sizes[1])

    def fewest(self, changes: Mapping[str, Array]) -> Array:
        """The same from some hundred rigs."""
        return self._chances(changes, self.sizes[2])

    def whole(self, changes: Mapping[str, float]) -> tuple[float, float]:
        """Chance of one rig with other values from the whole sample, and half-width of its 95 % interval."""
        found, possible = self._judged({name: np.array([value]) for name, value in changes.items()}, self.sizes[0])
        if self.single:
            return float(found[0, 0]), 0.0
        shape = (GROUPS, -1)
        return chance_of(found[0][possible[0]], possible[0].reshape(shape))

    def _chances(self, changes: Mapping[str, Array], log2: int) -> Array:
        stable, possible = self._judged(changes, log2)
        return np.asarray(np.sum(stable & possible, axis=1) / np.maximum(np.sum(possible, axis=1), 1))

    def _judged(self, changes: Mapping[str, Array], log2: int) -> tuple[Array, Array]:
        """Whether each of n rigs about each of m values is stable, and whether it is possible, (m, n)."""
        count = max((len(values) for values in changes.values()), default=1)
        shares = None if self.spreads is None else self.spreads.shares(log2)
        size = 1 if shares is None else next(iter(shares.values())).size
        step = max(1, AT_ONCE // size)
        parts = [
            self._part({name: values[i : i + step, None] for name, values in changes.items()}, shares, size)
            for i in range(0, count, step)
        ]
        return np.concatenate([one for one, _ in parts]), np.concatenate([one for _, one in parts])

    def _part(self, changes: Mapping[str, Array], shares: Any, size: int) -> tuple[Array, Array]:
        """The same for changes (m, 1)."""
        rows = max((len(values) for values in changes.values()), default=1)
        varied = {name: np.broadcast_to(values, (rows, size)) for name, values in changes.items()}
        for name, spread in () if self.spreads is None else self.spreads.of.items():
            moved = spread.moved(changes[name]) if name in changes else spread
            varied[name] = np.broadcast_to(moved.quantile(shares[name].ravel()), (rows, size))
        flat = {name: values.ravel() for name, values in varied.items()}
        possible = np.broadcast_to(valid_together(self.rig, "", flat), rows * size) if flat else np.array([True])
        point = operating_point(self.rig, flat, self.rig.kept_zeros(), scan=True)
        found = np.broadcast_to(status(point) == STABLE, rows * size)
        return found.reshape(rows, size), possible.reshape(rows, size)


def chances_of(rig: Slider | Machine, tolerances: Mapping[str, Any] | Tolerances) -> Chances:
    """Chances of a rig within tolerances; certain ones where these are empty."""
    whole = log2_of(rig)
    few = {LOG2_CLOSED: (LOG2_FEW, LOG2_FEWEST), LOG2_OTHERS: (LOG2_FEW - 1, LOG2_FEWEST - 2)}.get(whole, (1, 0))
    sizes = (whole, *few)
    return Chances(rig, spreads_of(rig, tolerances) if tolerances else None, sizes)
