"""Probability of stable sliding within tolerances, for many rigs at once."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array, valid_together
from steadyslip.files.specifications.tolerance_tables import Tolerances
from steadyslip.linear.status import STABLE, status
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import operating_point
from steadyslip.verdict.spreads import GROUPS, Spreads, spreads_of
from steadyslip.verdict.tolerances import LOG2_CLOSED, LOG2_OTHERS, chance_of, log2_of

K = TypeVar("K")
PLACES = 5  # number of values tried in each interval (ends included) for one or two unknown parameters; else the ends
AT_ONCE = 2**20  # limit of rigs that are evaluated in one array operation; bounds memory
LOG2_FEW, LOG2_FEWEST = 7, 4  # log2 of the number of rigs per group, in searches over one and over two parameters


@dataclass(frozen=True)
class Chances:
    """Evaluates the probability of stable sliding of a rig, and of the rig with some values changed.

    Attributes
    ----------
    rig : Slider or Machine
    spreads : Spreads or None
        Distributions of the parameters; None without tolerances: chances are then 0 or 1.
    sizes : tuple of int
        Base-2 logarithms of the rigs per group in `whole`, `few` and `fewest`.
    unknown : tuple of mapping of str to float
        Sets of values of the parameters that are not known: a chance is the least over these sets.
    certain : bool
        True if a chance counts as 1 only where all corners of the tolerance ranges are stable as well.
    """

    rig: Slider | Machine
    spreads: Spreads | None
    sizes: tuple[int, int, int]
    unknown: tuple[Mapping[str, float], ...] = ({},)
    certain: bool = False

    @property
    def single(self) -> bool:
        """True without tolerances: a single rig is judged."""
        return self.spreads is None

    def own(self, name: str) -> float:
        """The rig's own value of a parameter, SI units."""
        return float(self.rig.parameters()[name].value or 0.0)

    def allowed(self, name: str, values: Array) -> Array:
        """Mask (m,) of the values (m,) of a parameter that are allowed and whose tolerance stays inside the domain."""
        domain = self.rig.parameters()[name].role.domain
        spread = None if self.spreads is None else self.spreads.of.get(name)
        good = np.asarray(domain.contains(values), dtype=bool)
        if spread is not None and not spread.normal:
            moved = spread.moved(values)
            good &= np.asarray(domain.contains(moved.low) & domain.contains(moved.high), dtype=bool)
        return np.asarray(good & np.broadcast_to(valid_together(self.rig, "", {name: values}), values.shape))

    def few(self, changes: Mapping[str, Array]) -> Array:
        """Chances (m,) of the rig with changed values (m,) by name, each from some thousand sampled rigs."""
        return self._chances(changes, self.sizes[1])

    def fewest(self, changes: Mapping[str, Array]) -> Array:
        """Chances (m,) of the rig with changed values (m,) by name, each from some hundred sampled rigs."""
        return self._chances(changes, self.sizes[2])

    def whole(self, changes: Mapping[str, float]) -> tuple[float, float]:
        """Chance of the rig with changed values, from the whole sample, and half-width of its 95 % interval."""
        return min(self._whole({**one, **changes}) for one in self.unknown)

    def _whole(self, changes: Mapping[str, float]) -> tuple[float, float]:
        found, possible = self._judged({name: np.array([value]) for name, value in changes.items()}, self.sizes[0])
        if self.single:
            return float(found[0, 0]), 0.0
        shape = (GROUPS, -1)
        chance, error = chance_of(found[0][possible[0]], possible[0].reshape(shape))
        at = {name: np.array([value]) for name, value in changes.items()}
        return (chance, error) if self._corners_hold(at)[0] else (min(chance, 1 - 1 / found.size), error)

    def _chances(self, changes: Mapping[str, Array], log2: int) -> Array:
        rows = max((len(values) for values in changes.values()), default=1)
        found = []
        for one in self.unknown:
            stable, possible = self._judged({name: np.full(rows, x) for name, x in one.items()} | dict(changes), log2)
            chance = np.sum(stable & possible, axis=1) / np.maximum(np.sum(possible, axis=1), 1)
            holds = self._corners_hold({name: np.full(rows, x) for name, x in one.items()} | dict(changes))
            found.append(np.where(holds, chance, np.minimum(chance, 1 - 1 / stable.shape[1])))
        return np.asarray(np.min(found, axis=0))

    def _corners_hold(self, changes: Mapping[str, Array]) -> NDArray[np.bool_]:
        """True (m,) where every possible corner of the tolerance ranges is stable, or if corners do not count."""
        if self.spreads is None or not self.certain:
            return np.ones(max((len(values) for values in changes.values()), default=1), dtype=bool)
        stable, possible = self._of_shares(changes, self.spreads.corner_shares())
        return np.asarray(np.all(stable | ~possible, axis=1))

    def _judged(self, changes: Mapping[str, Array], log2: int) -> tuple[Array, Array]:
        """Two masks (m, n) over n sampled rigs about each of m changed values: the stable and the possible ones."""
        return self._of_shares(changes, None if self.spreads is None else self.spreads.shares(log2))

    def _of_shares(self, changes: Mapping[str, Array], shares: Mapping[str, Array] | None) -> tuple[Array, Array]:
        """`_judged` for rigs at given quantiles (`shares`, by name) of each parameter's distribution."""
        count = max((len(values) for values in changes.values()), default=1)
        size = 1 if shares is None else next(iter(shares.values())).size
        step = max(1, AT_ONCE // size)
        parts = [
            self._part({name: values[i : i + step, None] for name, values in changes.items()}, shares, size)
            for i in range(0, count, step)
        ]
        return np.concatenate([one for one, _ in parts]), np.concatenate([one for _, one in parts])

    def _part(self, changes: Mapping[str, Array], shares: Any, size: int) -> tuple[Array, Array]:
        """`_of_shares` for one block of changes, of shape (m, 1); `size` is the number n of rigs for each."""
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


def chances_of(
    rig: Slider | Machine, tolerances: Mapping[str, Any] | Tolerances,
    unknown: Mapping[str, tuple[float, float]] | None = None, certain: bool = False,
) -> Chances:  # fmt: skip
    """`Chances` of a rig within tolerances, 0 or 1 where these are empty; the least over the intervals of `unknown`."""
    whole = log2_of(rig)
    few = {LOG2_CLOSED: (LOG2_FEW, LOG2_FEWEST), LOG2_OTHERS: (LOG2_FEW - 1, LOG2_FEWEST - 2)}.get(whole, (1, 0))
    sizes = (whole, *few)
    return Chances(
        rig, spreads_of(rig, tolerances) if tolerances else None, sizes, values_tried(unknown or {}), certain
    )


def places(count: int) -> int:
    """Number of values tried of each of `count` unknown parameters."""
    return PLACES if count < 3 else 2


def values_tried(unknown: Mapping[K, tuple[float, float]]) -> tuple[dict[K, float], ...]:
    """All combinations of the values tried of unknown parameters; one empty dict without unknown parameters."""
    share = np.linspace(0.0, 1.0, places(len(unknown)))
    rows = itertools.product(*(spread_over(*ends, share) for ends in unknown.values()))
    return tuple(dict(zip(unknown, map(float, row), strict=True)) for row in rows)


def spread_over(low: float, high: float, share: Array) -> Array:
    """Values at shares of an interval, on a log scale where both ends are positive."""
    if low > 0:
        return np.asarray(np.clip(low * (high / low) ** share, low, high))
    return np.asarray(low + (high - low) * share)
