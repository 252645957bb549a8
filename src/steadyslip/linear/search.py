"""Scan of one parameter for edges of stability.

The parameter is sampled over its range; where the status (stable, unstable, no steady sliding) of two samples
differs, the change is bracketed and narrowed to rounding. Dips of the damping between samples are followed,
so that a narrow window is not stepped over. Samples whose status depends on rounding are left out: a rig on
an edge has this edge in every parameter that moves the edge, and no edge there in other parameters. For the stiffness
itself the edges are exact (theory 3), and so are those of every parameter that enters linearly in a machine (theory
11).
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import distinct
from steadyslip.core.caching import cached
from steadyslip.core.dimensions import Dimension, unit
from steadyslip.core.errors import NoSteadySliding, NotAvailable
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.format import format_quantity
from steadyslip.core.pages import Displayed
from steadyslip.linear import samples
from steadyslip.linear.linear_sets import linear_set
from steadyslip.linear.polynomials import StableSet
from steadyslip.linear.roots import Array
from steadyslip.linear.spectrum import (
    can_be_counted,
    counts,
    crossing_frequency,
    is_ill_posed,
    nearness,
    static_sum,
)
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE, is_neutral, on_edge, status_where_counted
from steadyslip.linear.stiffness import STIFFNESS, set_of_one
from steadyslip.machine.rig import Rig
from steadyslip.model import Model
from steadyslip.model.linearisation import linearise
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.sliding import explain_absence

_ROUNDING = 64  # smallest distance, in units in the last place, within which two edges are merged
_WIDER = 6  # number of distances tried, which grow by a factor of 8: up to 1e-10 of the value, which is negligible
_BESIDE = 4  # a kind is the status plus multiples of this; kind % _BESIDE is the status
# Limits of the scan, chosen by trial: computing time against edges missed where several lie close together.
_FLAT = 1e-6  # relative depth of a minimum up to which the minimum is rounding error of a constant
_DIPS = 16  # most minima of the damping that are examined, deepest first; rounding may cause one at every sample
_ROUNDS = 8  # most rounds of narrowing; where several edges lie between two samples, each round finds one more
_CHANGES = 64  # if kinds change more often, only changes of status are narrowed; the other changes are due to rounding
_MORE = 8  # a round may find this many changes more than the round before
SPLIT = 32  # pieces into which a bracket is cut at each step of narrowing
_FEW = 8  # largest number of growing roots (with delay) at which a dip between two samples is examined
_NEAR = 100.0  # roots must be countable at all samples within this factor from the parameter's value in the rig
_SCARCE = 6  # with several delays samples are fewer by this factor, as roots are counted rig by rig


@dataclass(frozen=True)
class Boundary(Displayed):
    """Edge: a value of a parameter at which stability changes.

    Attributes
    ----------
    parameter : str
        Dotted name.
    value : float
        Value at the edge, SI units; the middle of `bracket`.
    bracket : tuple of float
        Neighbouring values of the parameter with different status.
    kind : str
        ``oscillatory`` (a pair of eigenvalues crosses at ±iβ), ``divergence`` (one crosses at zero),
        ``ill-posed`` (the effective mass or direct effect changes sign), ``lock-up``, ``lift-off`` or
        ``no solution`` (steady sliding ceases to exist); for undamped rigs ``coupling`` (two oscillations meet in
        frequency, and one grows beyond) instead of ``oscillatory``.
    angular_frequency : float
        β in rad/s, 0 unless oscillatory or coupling.
    stable : str
        Side on which steady sliding is stable: ``above``, ``below`` or ``neither``.
    unit : str
    area : float or None
        Contact area of the rig, m²; where there is one, values are printed as totals.
    contact : str
        Contact of a machine that locks up or lifts off beyond the edge; empty otherwise.
    quiet : str
        For undamped rigs the side on which no root grows, ``above`` or ``below``; empty otherwise.
    """

    parameter: str
    value: float
    bracket: tuple[float, float]
    kind: str
    angular_frequency: float
    stable: str
    unit: str
    area: float | None = None
    contact: str = ""
    quiet: str = ""

    def __str__(self) -> str:
        text = f"{self.parameter} = {format_quantity(self.value, self.unit, 6, self.area)}: {self.kind}"
        if self.contact:
            text += f" at contact {self.contact}"
        if self.angular_frequency:
            text += f", period {format_quantity(2 * np.pi / self.angular_frequency, 's')}"
        if self.quiet:
            return f"{text}, no root grows {self.quiet}"
        return f"{text}, stable {self.stable}" if self.stable != "neither" else text


Sample = tuple[float, int]
"""A value of the parameter and its status."""


class Search:
    """Scan of one parameter of one rig for edges of stability; `boundaries` is the result."""

    def __init__(self, rig: Rig, name: str, present: Iterable[str], branch: int) -> None:
        self.rig, self.name, self.present, self.branch = rig, name, tuple(present), branch
        address = rig.parameters()[name]
        self.role, self.value = address.role, float(address.value)  # type: ignore[arg-type]
        self.own = operating_point(rig, None, self.present, branch)
        self.share = _SCARCE if len(self.own.model.delays) > 1 else 1
        self.hides = False  # True if edges may be missing because roots under delays cannot be counted
        self.decided = -np.inf, np.inf  # range outside which windows under delays are too many to be searched

    def values(self, x: float | Array) -> OperatingPoint:
        return operating_point(self.rig, {self.name: x}, self.present, self.branch, scan=True)

    # -- the range

    @cached_property
    def searched(self) -> tuple[float, float]:
        """Default range of the search: from the first to the last sample at which the rig can be built."""
        grid, point = self._usual
        built = grid[np.broadcast_to(point.valid, grid.shape)]
        return float(built[0]), float(built[-1])

    @cached_property
    def _usual(self) -> tuple[Array, OperatingPoint]:
        grid = self._grid(None)
        return grid, self.values(grid)

    @property
    def on_the_grid(self) -> OperatingPoint:
        """Operating point of the rig at those values of the default grid at which the rig can be built."""
        grid, point = self._usual
        valid = np.broadcast_to(point.valid, grid.shape)
        return point if np.all(valid) else self.values(grid[valid])

    def _grid(self, between: tuple[float, float] | None) -> Array:
        """Sample values in rising order, which include the parameter's value in the rig."""
        domain = self.role.domain
        if np.isfinite(domain.high):
            found = samples.bounded(domain, self.share)
        else:
            zero = domain.low_allowed and not self.role.adds_state
            found = samples.unbounded(domain, zero, self._sizes[0], *self._reach(between), self.share)
        return distinct(np.append(found, self.value))[0]

    @cached_property
    def _sizes(self) -> tuple[float, float]:
        """Size of the parameter's value in the rig (or, if that is 0, the typical size), and the typical size."""
        natural = self.natural_size()
        return abs(self.value) or natural, natural

    def _reach(self, between: tuple[float, float] | None) -> tuple[float, float]:
        """Least and largest size of samples, which cover decades around the value and the requested range."""
        far, sizes = 10.0**samples.DECADES, self._sizes
        asked = [abs(end) for end in between or () if end]
        return min([min(sizes) / far, *asked]), max([max(sizes) * far, *asked])

    def natural_size(self) -> float:
        """Typical size of the parameter by dimensional analysis, from σss, v0 and the slip distance v0/r."""
        total = self.rig.in_forces and self.rig.area_of(self.name) is None
        return natural_size(self.role.unit, total, self.own.sigmas, self.own.drive, _decay_rate(self.own), self.value)

    # -- status of sliding along the parameter

    def status(self, x: Array) -> NDArray[np.int64]:
        """Status (stable, unstable, ...) at values (n,); UNKNOWN where roots under a delay cannot be counted."""
        return status_where_counted(self.values(x))

    def kinds(self, x: Array) -> NDArray[np.int64]:
        """Status at values (n,), plus 4 where the static stiffness is positive, plus 8 where it is ill-posed."""
        point = self.values(x)
        return _kinds(point, status_where_counted(point))

    def measures(self, x: Array) -> Array:
        """Two measures (2, n) that change sign at an edge: damping of pairs of eigenvalues, and of single ones."""
        return nearness(self.values(np.asarray(x, dtype=float)))

    def boundaries(self, between: tuple[float, float] | None) -> tuple[Boundary, ...]:
        """Edges in the range `between`, by default in `searched`, by rising value."""
        with np.errstate(all="ignore"):
            low, high = self.searched if between is None else between
            exact = self._exact(between)
            if exact is not None:
                self.decided = exact.searched
                return self._of_set(exact, low, high)
            return tuple(one for one in self._found(between) if low <= one.value <= high)

    def _found(self, between: tuple[float, float] | None) -> list[Boundary]:
        """All edges that the scan finds, rising.

        Where the kinds of two neighbouring samples differ, the lowest change between them is narrowed. Further changes
        may lie close to it, so samples are added ever closer to it on both sides, until all changes have been narrowed.
        """
        x, kind = self._judged(*(self._usual if between is None else self._asked(between)))
        low, high = np.empty(0), np.empty(0)
        most = len(x)
        for _ in range(_ROUNDS):
            at = np.flatnonzero(kind[1:] != kind[:-1])
            if len(at) > _CHANGES:
                at = at[(kind[at + 1] - kind[at]) % _BESIDE != 0]
            at = at[~_within(low, x[at], x[at + 1])]
            if not 0 < at.size <= most:  # refining found more changes than before: these are rounding
                break
            most = max(at.size, _MORE)
            lower, upper = self._narrowed(x[at], x[at + 1], kind[at], kind[at + 1])
            ends = zip(lower, x[at], upper, x[at + 1], strict=True)
            beside = [samples.towards(*pair, share=self.share) for a, b, c, d in ends for pair in ((a, b), (c, d))]
            x, kind = _merged((x, kind), self._certain(np.concatenate(beside)))
            low, high = np.concatenate([low, lower]), np.concatenate([high, upper])
        order = np.argsort(low)
        low, high = low[order], high[order]
        at = np.searchsorted(x, low, side="right") - 1
        below, above = kind[at] % _BESIDE, kind[at + 1] % _BESIDE
        real = (below != above) & (below != UNKNOWN) & (above != UNKNOWN)
        if low.size and self.own.model.delays:  # a change to samples where roots cannot be counted is no edge
            hidden = np.any(self.status(np.concatenate([low, high])).reshape(2, -1) == UNKNOWN, axis=0)
            self.hides |= bool(np.any(real & hidden))
            real &= ~hidden
        if self.role.domain.low == 0:
            real &= low != 0  # 0 is the end of the domain, and no edge
        return [
            self._described(low[i], high[i], (x[at[i]], below[i]), (x[at[i] + 1], above[i]))
            for i in np.flatnonzero(real)
        ]

    def _asked(self, between: tuple[float, float]) -> tuple[Array, OperatingPoint]:
        grid = self._grid(between)
        return grid, self.values(grid)

    def _judged(self, grid: Array, point: OperatingPoint) -> tuple[Array, NDArray[np.int64]]:
        """Samples with their kinds.

        Samples at narrow windows are added, those whose status depends on rounding dropped.
        """
        valid = np.broadcast_to(point.valid, grid.shape)
        outside = grid[~valid], np.full(np.count_nonzero(~valid), UNKNOWN)
        here, point = (grid, point) if np.all(valid) else (grid[valid], self.values(grid[valid]))
        own, known = status_where_counted(point), can_be_counted(point)
        self.hides |= bool(np.any(~known & (here > self.value / _NEAR) & (here < self.value * _NEAR)))
        certain = known & ~on_edge(point)
        found = here[certain], _kinds(point, own)[certain]
        return _merged(found, outside, self._certain(self._hidden_windows(here, own, point)))

    def _certain(self, x: Array) -> tuple[Array, NDArray[np.int64]]:
        """Samples with their kinds, without those whose status depends on rounding or whose roots cannot be counted."""
        x, _ = distinct(x)
        if not x.size:
            return x, np.empty(0, dtype=np.int64)
        point = self.values(x)
        valid = np.broadcast_to(point.valid, x.shape)
        if not np.all(valid):
            outside = x[~valid], np.full(np.count_nonzero(~valid), UNKNOWN)
            return _merged(outside, self._certain(x[valid]))
        try:
            certain = can_be_counted(point) & ~on_edge(point)
        except NotAvailable:  # close to an edge, roots under a delay may be too many to count
            if len(x) == 1:
                return np.empty(0), np.empty(0, dtype=np.int64)
            return _merged(self._certain(x[: len(x) // 2]), self._certain(x[len(x) // 2 :]))
        return x[certain], _kinds(point, status_where_counted(point))[certain]

    def _hidden_windows(self, grid: Array, status: NDArray[np.int64], point: OperatingPoint) -> Array:
        """Samples at minima of the damping close to zero, where a narrow window may lie between two samples."""
        measures, (low, high) = nearness(point), self.searched
        same = (status[1:-1] == status[:-2]) & (status[1:-1] == status[2:])
        same &= (status[1:-1] == STABLE) | (status[1:-1] == UNSTABLE)
        if point.model.delays:
            same &= counts(point)[1:-1] <= _FEW
        extra = [np.empty(0)]
        for which, measure in enumerate(measures):
            size = np.abs(measure)
            dips = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
            dips &= np.maximum(size[:-2], size[2:]) > size[1:-1] * (1 + _FLAT)
            at = np.flatnonzero(dips & same & np.isfinite(measure[1:-1])) + 1
            at = at[np.argsort(size[at], kind="stable")]
            usual = (grid[at] >= low) & (grid[at] <= high)  # so that a wider request does not change edges inside
            at = np.sort(np.concatenate([at[usual][:_DIPS], at[~usual][:_DIPS]]))
            if at.size:
                extra += self._descended(which, np.sign(measure[at]), grid[at - 1], grid[at + 1])
        return np.concatenate(extra)

    def _descended(self, which: int, sign: Array, low: Array, high: Array) -> list[Array]:
        """Lowest points of a measure (times its sign) inside brackets, one array per step of refinement."""
        found = []
        row = np.arange(len(low))
        for _ in range(4):
            x = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, SPLIT + 1)
            value = sign[:, None] * self.measures(x.ravel())[which].reshape(x.shape)
            best = np.clip(np.argmin(np.where(np.isnan(value), np.inf, value), axis=-1), 1, SPLIT - 1)
            found.append(x[row, best])
            low, high = x[row, best - 1], x[row, best + 1]
        return found

    def _narrowed(
        self, low: Array, high: Array, low_kind: NDArray[np.int64], high_kind: NDArray[np.int64]
    ) -> tuple[Array, Array]:
        """Brackets narrowed to rounding around the lowest change of status or, if the status is equal, of kind."""
        low, high = low.copy(), high.copy()
        judged = (low_kind - high_kind) % _BESIDE != 0
        for rows, asked in ((np.flatnonzero(judged), self.status), (np.flatnonzero(~judged), self.kinds)):
            first = None
            for _ in range(int(60 / np.log2(SPLIT)) if rows.size else 0):
                x = low[rows, None] + (high - low)[rows, None] * np.linspace(0, 1, SPLIT + 1)
                x[:, -1] = high[rows]
                kind = asked(x.ravel()).reshape(x.shape)
                first = kind[:, :1] if first is None else first
                at = np.argmax(kind != first, axis=-1)
                at = np.where(at == 0, SPLIT, at)
                row = np.arange(len(rows))
                low[rows], high[rows] = x[row, at - 1], x[row, at]
                adjacent = np.nextafter(low[rows], high[rows]) == high[rows]
                if np.all(adjacent & (kind[row, at] != first[:, 0])):  # further rounds would change nothing
                    break
        return low, high

    def _described(self, low: float, high: float, below: Sample, above: Sample) -> Boundary:
        """Edge in a bracket between two samples whose status is certain."""
        low, high = self._past_rounding(low, high)
        absent = next((value for value, kind in (below, above) if kind == ABSENT), None)
        lost = None if absent is None else self._why_none(absent)
        kind, frequency = self._kind(low, high) if lost is None else (lost.condition, 0.0)
        stable = "above" if above[1] == STABLE else "below" if below[1] == STABLE else "neither"
        middle = 0.0 if low <= 0 <= high else low + 0.5 * (high - low)
        bracket = float(low), float(high)
        return Boundary(
            self.name, float(middle), bracket, kind, frequency, stable, self.role.unit,
            self.rig.printed_area(self.name), "" if lost is None else lost.contact,
        )  # fmt: skip

    def _past_rounding(self, low: float, high: float) -> tuple[float, float]:
        """Bracket of an edge, widened where steady sliding ends within rounding of it.

        The static stiffness is zero at the end of steady sliding too, so that rounding decides which comes first.
        """
        unit = max(np.spacing(abs(low)), np.spacing(abs(high)))
        reach = _ROUNDING * unit * 8.0 ** np.arange(_WIDER)  # wide if, for example, friction hardly depends on velocity
        wide = np.stack([low - reach, high + reach])
        wide = wide[:, : np.argmin(np.append(np.all(self.role.domain.contains(wide), axis=0), False))]
        status = self.status(wide.ravel()).reshape(wide.shape) if wide.size else np.zeros_like(wide, dtype=int)
        ends = np.sum(status == ABSENT, axis=0) == 1
        ends &= ~np.any(status == UNKNOWN, axis=0)
        return tuple(wide[:, np.argmax(ends)].tolist()) if np.any(ends) else (low, high)

    def _why_none(self, value: float) -> NoSteadySliding:
        return explain_absence(self.rig.with_values({self.name: value}), self.values(value))

    def _kind(self, low: float, high: float) -> tuple[str, float]:
        both = self.values(np.array([low, high]))
        posed, static = is_ill_posed(both), static_sum(both)
        if posed[0] != posed[1]:
            return "ill-posed", 0.0
        if static[0] * static[1] <= 0:
            return "divergence", 0.0
        frequency = crossing_frequency(self.values(np.array([low])))
        return ("oscillatory" if frequency else "divergence"), frequency

    def _exact(self, between: tuple[float, float] | None) -> StableSet | None:
        """Stable set in closed form for a slider's stiffness or a linear parameter of a machine.

        None for other parameters.
        """
        point = self.own
        late = bool(point.model.delays)
        if self.name == STIFFNESS:
            with suppress(NotAvailable):  # infinitely many windows
                return set_of_one(point)
            return None
        if (point.model.is_slider and not late) or not point.exists or self.role.domain.low < 0:
            return None
        return linear_set(point, self.name, None if self.value else self._sizes[0], self._reach(between))

    def _of_set(self, edges: StableSet, low: float, high: float) -> tuple[Boundary, ...]:
        """Those edges of a stable set that lie between `low` and `high`."""
        keep = np.flatnonzero(edges.changes & (edges.edges >= low) & (edges.edges <= high))
        return tuple(
            self._exact_edge(float(edges.edges[i]), float(edges.frequencies[i]), edges.intervals) for i in keep
        )

    def _exact_edge(self, k: float, frequency: float, intervals: Array) -> Boundary:
        kind = "divergence" if frequency == 0 else "ill-posed" if np.isinf(frequency) else "oscillatory"
        stable = "above" if np.any(intervals[:, 0] == k) else "below"
        bracket = (float(np.nextafter(k, 0)), float(np.nextafter(k, np.inf)))
        beta = frequency if kind == "oscillatory" else 0.0
        return Boundary(self.name, k, bracket, kind, beta, stable, self.role.unit, self.rig.printed_area(self.name))


def natural_size(
    unit_name: str, total: bool, stresses: Iterable[Any], drive: float, rate: float, value: float
) -> float:
    """Typical size of a parameter by dimensional analysis, from σss, v0 and the slip distance v0/r.

    Parameters
    ----------
    unit_name : str
    total : bool
        True if the parameter is a total (force), not per unit area (stress).
    stresses : iterable of float
        σss of the contacts (Pa).
    drive, rate : float
        v0 (m/s), and the fastest decay rate of a memory (1/s), 0 without memory.
    value : float
        Value in the rig; its size is returned if the result is not finite.
    """
    sigma = np.exp(np.mean(np.log([float(one) for one in stresses])))
    _, d = unit(unit_name)
    if total:
        d = d.times(Dimension(length=-2 * d.mass))
    by_velocity = -2 * d.mass - d.time
    sigma, v0, length = np.float64(sigma), np.float64(drive), np.float64(drive / (rate or 1.0))  # overflow to inf
    size = sigma**d.mass * v0**by_velocity * length ** (d.length + d.mass - by_velocity)
    return float(size) if np.isfinite(size) and size > 0 else abs(value) or 1.0


def _kinds(point: OperatingPoint, status: NDArray[np.int64]) -> NDArray[np.int64]:
    """Kind of each sample: its status, plus `_BESIDE` if the static stiffness is positive, plus 2 `_BESIDE` if
    ill-posed."""
    more = _BESIDE * ((static_sum(point) > 0) & ~is_neutral(point)) + 2 * _BESIDE * is_ill_posed(point)
    return np.asarray(status + np.where((status == STABLE) | (status == UNSTABLE), more, 0))


def _merged(*parts: tuple[Array, NDArray[np.int64]]) -> tuple[Array, NDArray[np.int64]]:
    """Samples and their kinds, joined and sorted; equal samples are kept once."""
    x, at = distinct(np.concatenate([x for x, _ in parts]))
    return x, np.concatenate([kind for _, kind in parts])[at]


def _within(places: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """True for each bracket (low, high) that contains at least one of `places`."""
    rising = np.sort(places)
    return np.asarray(np.searchsorted(rising, low) < np.searchsorted(rising, high))


@cached
def _decay_function(model: Model) -> ArrayFunction:
    """Function that returns the decay rates (1/s), with sign, of those memory variables whose rate follows from the
    rig's parameters alone."""
    linear = linearise(model)
    own = [linear.rows[item.symbol][item.symbol] for item in model.memory]
    known = {*model.arguments}
    return model.function(rate for rate in own if rate.free_symbols <= known)


def _decay_rate(point: OperatingPoint) -> float:
    """Fastest decay rate (1/s) of all memory variables; zero without memory."""
    return max((abs(float(rate)) for rate in point.evaluate(_decay_function(point.model))), default=0.0)
