"""Edges of rigs that nothing damps: from "no root grows" to "a root grows" (theory 13).

Without damping and without memory of friction the characteristic polynomial has even powers of s only. If its roots in
s² are all real and negative, every disturbance oscillates for ever. Where two roots in s² meet and become a complex
pair, two oscillations couple and one grows: at the edge the polynomial has a double imaginary root, and the growth rate
beyond the edge rises from zero with the square root of the distance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from steadyslip.linear.roots import Array, ComplexArray
from steadyslip.linear.search import SPLIT, Boundary, Search
from steadyslip.linear.status import ABSENT, UNKNOWN, status
from steadyslip.linear.undamped import grows, is_undamped, squares
from steadyslip.machine.rig import Rig

QUIET, GROWS = 10, 11  # no root grows, a root grows; distinct from the values of `status`
ROUNDS = 4  # number of times that the bracket of a least distance between two roots is narrowed by a factor `SPLIT`/2


def gaps(u: ComplexArray) -> Array:
    """Least distance between neighbours in sorted squares of roots u (..., n), relative to their size; inf if n < 2."""
    apart = np.abs(u[..., 1:] - u[..., :-1]) / np.abs(u[..., 1:] + u[..., :-1])
    return np.asarray(np.min(np.where(np.isnan(apart), np.inf, apart), axis=-1, initial=np.inf))


def near_couplings(grid: Array, gaps_at: Callable[[Array], Array]) -> Array:
    """Parameter values between samples at which two squared roots come closest; a narrow window may be near."""
    gap = gaps_at(grid)
    dips = np.flatnonzero((gap[1:-1] <= gap[:-2]) & (gap[1:-1] <= gap[2:]) & np.isfinite(gap[1:-1])) + 1
    low, high, found = grid[dips - 1], grid[dips + 1], [np.empty(0)]
    for _ in range(ROUNDS if dips.size else 0):
        x = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, SPLIT + 1)
        best = np.clip(np.argmin(gaps_at(x.ravel()).reshape(x.shape), axis=1), 1, SPLIT - 1)
        row = np.arange(len(low))
        found.append(x[row, best])
        low, high = x[row, best - 1], x[row, best + 1]
    return np.concatenate(found)


def meeting(u: ComplexArray) -> tuple[str, float]:
    """Kind and frequency (rad/s) of an edge, from squared roots `u` beyond it: two squares meet, or one passes zero."""
    growing = u[np.isfinite(u) & ((u.imag != 0) | (u.real > 0))]
    paired = growing[growing.imag != 0]
    return ("coupling", float(np.sqrt(-paired.real.mean()))) if paired.size else ("divergence", 0.0)


class UndampedSearch(Search):
    """Scan of one parameter of a rig that is undamped whatever the value of the parameter."""

    def boundaries(self, between: tuple[float, float] | None) -> tuple[Boundary, ...]:
        with np.errstate(all="ignore"):
            low, high = self.searched if between is None else between
            grid = (self._usual if between is None else self._asked(between))[0]
            narrow = near_couplings(grid, lambda values: gaps(squares(self.values(values))))
            x = np.unique(np.concatenate([grid, narrow]))
            kind = self._kinds_of_growth(x)
            at = np.flatnonzero((kind[1:] != kind[:-1]) & (kind[1:] != UNKNOWN) & (kind[:-1] != UNKNOWN))
            found = [self._edge(x[i], x[i + 1], kind[i], kind[i + 1]) for i in at]
        zero = self.role.domain.low == 0  # a change at 0, the end of the domain, is not an edge
        return tuple(one for one in found if low <= one.value <= high and not (zero and one.bracket[0] == 0))

    def _kinds_of_growth(self, x: Array) -> NDArray[np.int64]:
        """Array (n,) with QUIET, GROWS, ABSENT or UNKNOWN for each parameter value (n,)."""
        point = self.values(x)
        found = status(point)
        known = (found != ABSENT) & (found != UNKNOWN)
        return np.where(known, np.where(grows(point), GROWS, QUIET), found)

    def _edge(self, low: float, high: float, below: int, above: int) -> Boundary:
        absent = low if below == ABSENT else high  # `low` and `high` are samples, where absence is not due to rounding
        for _ in range(int(60 / np.log2(SPLIT))):  # 60: more than the bits of a float
            x = np.linspace(low, high, SPLIT + 1)
            at = max(1, int(np.argmax(self._kinds_of_growth(x) != below)))
            low, high = float(x[at - 1]), float(x[at])
        quiet = "below" if below == QUIET else "above" if above == QUIET else ""
        if ABSENT in (below, above):
            lost = self._why_none(absent)
            kind, frequency, contact = lost.condition, 0.0, lost.contact
        else:
            kind, frequency, contact = *meeting(squares(self.values(np.array([low, high])))), ""
        middle = 0.0 if low <= 0 <= high else low + 0.5 * (high - low)
        return Boundary(
            self.name, middle, (low, high), kind, frequency, "neither", self.role.unit,
            self.rig.printed_area(self.name), contact, quiet,
        )  # fmt: skip


def search_for(rig: Rig, name: str, present: tuple[str, ...], branch: int) -> Search:
    """Scan of one parameter for edges of stability.

    Of growth if the machine is undamped at all values of the parameter.
    """
    found = Search(rig, name, present, branch)
    with np.errstate(all="ignore"):
        if not np.all(is_undamped(found.own)):
            return found
        point = found.on_the_grid
        everywhere = np.all(is_undamped(point) | ~np.broadcast_to(point.exists, point.shape))
    return UndampedSearch(rig, name, present, branch) if everywhere else found
