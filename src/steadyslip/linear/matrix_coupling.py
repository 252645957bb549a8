"""Edges of machines given by matrices that nothing damps: from "no root grows" to "a root grows" (theory 13).

Same method as in `coupling`; the squares of the roots are eigenvalues of −M⁻¹ K instead of roots of a polynomial.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.allowance import may_take
from steadyslip.linear.coupling import gaps, meeting, near_couplings
from steadyslip.linear.matrix_search import FLOPS, MatrixSearch
from steadyslip.linear.roots import Array, ComplexArray
from steadyslip.linear.search import Boundary
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.machine_point import MachinesAlong
from steadyslip.model.numeric.pencil import UNDECIDED, StatePencil

_PART = 1e-6
"""Relative imaginary part above which two squared roots count as a complex pair. Rounding gives a double square some
1e-8; 1e-12 (relative) beyond the edge in the parameter, the imaginary part of the pair exceeds the limit."""
_RISE = 1e-12  # squared root over the largest, up to which it counts as the zero root of an unsupported body


class UndampedMatrixSearch(MatrixSearch):
    """Search of one parameter of a machine that is undamped whatever the value of the parameter."""

    def boundaries(self, between: tuple[float, float] | None = None) -> tuple[Boundary, ...]:
        with np.errstate(all="ignore"):
            grid = self.grid(between)
            x = np.unique(np.concatenate([grid, near_couplings(grid, lambda values: gaps(self._squares(values)))]))
            status = self.statuses(x).tolist()
            pairs = [(i, status[i], status[i + 1]) for i in np.flatnonzero(np.diff(status))]
            return tuple(self._meeting(x[i], x[i + 1], *pair) for i, *pair in pairs if UNKNOWN not in pair)

    def _growing(self, machines: MachinesAlong, sure: bool) -> NDArray[np.int64]:
        """Array (p,) with 1 for machines of which a root grows, else 0."""
        if not may_take(len(machines.posed) * machines.size**3 // FLOPS):
            return np.full(len(machines.posed), UNDECIDED)
        return growing_squares(squares_along(machines)).astype(np.int64)

    def _squares(self, values: Array) -> ComplexArray:
        return np.concatenate(
            [squares_along(self.own.along(self.name, values[part])) for part in self.parts(len(values))]
        )

    def _meeting(self, low: float, high: float, below: int, above: int) -> Boundary:
        """Edge between two values, at which two squared roots meet, one passes zero, or steady sliding ends."""
        if ABSENT in (below, above):
            return self._described(self._end(low, high), 0.0, below, above)
        low, high = self._narrowed(low, high, lambda values: np.asarray(self.statuses(values) != below), 0.0)
        u = self._squares(np.array([low, high]))
        kind, beta = meeting(np.where(np.abs(u.imag) > _PART * np.abs(u), u, u.real))
        middle = 0.0 if low <= 0 <= high else low + 0.5 * (high - low)
        return Boundary(
            self.name, middle, (low, high), kind, beta, "neither", self.role.unit,
            self.machine.printed_area(self.name), "", "below" if below == STABLE else "above",
        )  # fmt: skip


def squares_along(machines: MachinesAlong) -> ComplexArray:
    """Squares of the roots (1/s²) of each machine, (p, n), rising in their real part; NaN without steady sliding."""
    found = np.full((len(machines.posed), machines.size), np.nan, dtype=complex)
    for i in np.flatnonzero(machines.balance.exists & machines.posed):
        pencil = machines.pencil(int(i))
        if pencil is not None and np.all(np.isfinite(pencil.a)):
            found[i] = squares_of(pencil)
    return found


def squares_of(pencil: StatePencil) -> ComplexArray:
    """Squares of the roots (1/s²) of an undamped machine, (n,), rising in their real part."""
    size = pencil.size
    return np.sort_complex(np.linalg.eigvals(np.linalg.solve(pencil.e[size:, size:], pencil.a[size:, :size])))


def growing_squares(u: ComplexArray) -> NDArray[np.bool_]:
    """True (...) where a root of an undamped machine grows: a squared root u (..., n) is complex or positive."""
    largest = np.max(np.abs(u), axis=-1, initial=0.0)[..., None]
    return np.asarray(np.any((np.abs(u.imag) > _PART * np.abs(u)) | (u.real > _RISE * largest), axis=-1))


def nothing_damps(pencil: StatePencil | None) -> bool:
    """True if no force of a machine depends on velocity or memory."""
    return (
        pencil is not None and len(pencil.a) == 2 * pencil.size and not np.any(pencil.a[pencil.size :, pencil.size :])
    )


def search_matrices(machine: Machine, name: str) -> MatrixSearch:
    """Search for edges of stability.

    For a machine that is undamped at all values of the parameter, for edges of growth.
    """
    found = MatrixSearch(machine, name)
    if not found.own.balance.exists or not nothing_damps(found.own.pencil):
        return found
    grid = found.grid()
    along = [found.own.along(name, grid[part]) for part in found.parts(len(grid))]
    slides = [(one, int(i)) for one in along for i in np.flatnonzero(one.balance.exists & one.posed)]
    everywhere = all(nothing_damps(one.pencil(i)) for one, i in slides)
    return UndampedMatrixSearch(machine, name) if everywhere else found
