"""Initial difference of a record from steady sliding, if it is known from a fit to the time before the record."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from steadyslip.core.arrays import Array


@dataclass(frozen=True)
class Beginning:
    """Known differences from steady sliding at the first sample of a record.

    Attributes
    ----------
    values : dict of str to float
        Differences of friction and of each of its memory variables (of their logarithm), by name.
    spread : tuple of tuple of float
        For each of several independent directions: changes of all differences by one standard deviation.
    """

    values: dict[str, float]
    spread: tuple[tuple[float, ...], ...] = ()

    def of(self, names: Collection[str]) -> Beginning:
        """Beginning with only the differences `names`, for a nested law with fewer memory variables."""
        kept = [name for name in self.values if name in names]
        places = [list(self.values).index(name) for name in kept]
        spread = tuple(tuple(row[k] for k in places) for row in self.spread)
        return Beginning({name: self.values[name] for name in kept}, spread)

    def rows(self) -> Array:
        """Values, then the spread in each direction, as rows of an array (1 + directions, k)."""
        return np.array([[*self.values.values()], *self.spread])

    def ends(self) -> Array:
        """Differences (1 + directions, k): the known values, then a point one standard deviation away per direction."""
        known, *spread = self.rows()
        return np.array([known, *(known + own for own in spread)])
