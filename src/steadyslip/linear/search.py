"""The scan of one parameter for edges of stability.

The parameter is sampled over its range; where the status (stable, unstable, no steady sliding) of two samples
differs, the change is bracketed and narrowed to rounding. Dips of the damping between samples are followed,
so that a narrow window is not stepped over. Samples whose status is a matter of rounding are left out: a rig on
its edge has that edge in every parameter that moves it, and none in the others. For the stiffness itself the
edges are exact (theory 3), and so are those of whatever enters linearly in a machine (theory 11).
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.dimensions import Dimension, unit
from steadyslip.core.errors import NoSteadySliding, NotAvailable
from steadyslip.core.pages import Displayed
from steadyslip.core.telling import shown
from steadyslip.linear.linear_sets import linear_set
from steadyslip.linear.polynomials import StableSet
from steadyslip.linear.roots import Array
from steadyslip.linear.spectrum import (
    can_be_counted,
    crossing_frequency,
    is_ill_posed,
    nearness,
    static_sum,
    unstable_roots,
)
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE, on_edge, status
from steadyslip.linear.stiffness import STIFFNESS, set_of_one
from steadyslip.machine.machine import Machine
from steadyslip.machine.rig import Rig
from steadyslip.model.linearisation import linearise
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.sliding import explain_absence

_PER_DECADE = 40
_DECADES = 6
_LINEAR = 721
_ROUNDING = 64  # units of the last place within which two conditions are one, at first;
_WIDER = 6  # times that it is widened by 8: to some 1e-10 of the value, within what a verdict calls the edge
_FLAT = 1e-6  # share by which a measure falls to a dip: less is rounding on a level stretch, which hides no zero
_DIPS = 16  # lowest of a scan that are looked into: contacts that are alike have roots that jitter at every sample
_SPLIT = 32  # pieces into which a bracket is cut at each step of narrowing
_FEW = 8  # growing roots of rigs with delay, of which a dip between two samples may be a window; of more none is
_SCARCE = 6  # times fewer samples where roots have to be counted one rig after the other: with several delays


@dataclass(frozen=True)
class Boundary(Displayed):
    """One value of a parameter at which stability changes.

    Attributes
    ----------
    parameter : str
        Dotted name.
    value : float
        SI units; the middle of `bracket`.
    bracket : tuple of float
        Neighbouring values with different status.
    kind : str
        ``oscillatory`` (a pair of eigenvalues crosses at ±iβ), ``divergence`` (one crosses at zero),
        ``ill-posed`` (the effective mass or direct effect changes sign), ``lock-up``, ``lift-off`` or
        ``no solution`` (steady sliding ceases to exist).
    angular_frequency : float
        β in rad/s, 0 unless oscillatory.
    stable : str
        On which side steady sliding is stable: ``above``, ``below`` or ``neither``.
    unit : str
    area : float or None
        Of the rig, m²: people are told totals then.
    contact : str
        Of a machine: the contact that locks up or lifts off beyond.
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

    def __str__(self) -> str:
        text = f"{self.parameter} = {shown(self.value, self.unit, 6, self.area)}: {self.kind}"
        if self.contact:
            text += f" at contact {self.contact}"
        if self.kind == "oscillatory":
            text += f", period {shown(2 * np.pi / self.angular_frequency, 's')}"
        return f"{text}, stable {self.stable}" if self.stable != "neither" else text


class Search:
    """Scanning one parameter of one rig."""

    def __init__(self, rig: Rig, name: str, present: Iterable[str], branch: int) -> None:
        self.rig, self.name, self.present, self.branch = rig, name, tuple(present), branch
        address = rig.parameters()[name]
        self.role, self.value = address.role, float(address.value)  # type: ignore[arg-type]
        scarce = len(operating_point(rig, None, self.present, branch).model.delays) > 1
        self.share = _SCARCE if scarce else 1

    def values(self, x: float | Array) -> OperatingPoint:
        return operating_point(self.rig, {self.name: x}, self.present, self.branch, scan=True)

    # -- the range

    def grid(self, between: tuple[float, float] | None) -> Array:
        """Sample values of rigs that can be built, rising; the rig's own value is one of them."""
        samples = self._whole_grid() if between is None else self._grid_between(*between)
        return np.asarray(samples[np.broadcast_to(self.values(samples).valid, samples.shape)])

    def _whole_grid(self) -> Array:
        domain = self.role.domain
        if np.isfinite(domain.high):
            inset = 1e-9 * (domain.high - domain.low)
            low = domain.low if domain.low_allowed else domain.low + inset
            high = domain.high if domain.high_allowed else domain.high - inset
            samples = np.linspace(low, high, _LINEAR // self.share)
        else:
            size = abs(self.value) or self.natural_size()
            count = 2 * _DECADES * _PER_DECADE // self.share + 1
            with np.errstate(all="ignore"):
                samples = size * np.geomspace(10.0**-_DECADES, 10.0**_DECADES, count)
            samples = samples[np.isfinite(samples) & (samples > 0)]  # the ends of floating point are no parameters
            if domain.low < 0:
                samples = np.concatenate([-samples[::-1], [0.0], samples])
            elif domain.low_allowed and not self.role.adds_state:
                samples = np.concatenate([[0.0], samples])
        return np.unique(np.append(samples, self.value))

    def _grid_between(self, low: float, high: float) -> Array:
        samples = [np.linspace(low, high, _LINEAR // self.share)]
        for a, b, sign in ((low, high, 1.0), (-high, -low, -1.0)):  # even in logarithm too
            if b > 0:
                a = max(a, b * 1e-12)
                decades = np.log10(b / a)
                samples.append(sign * np.geomspace(a, b, int(_PER_DECADE * decades / self.share) + 2)[1:-1])
        return np.unique(np.concatenate(samples))

    def natural_size(self) -> float:
        """A size for a parameter that is zero, from σss, v0 and the slip distance v0/r."""
        point = operating_point(self.rig, None, self.present, self.branch)
        sigma, v0 = float(point.sigmas[0]), point.drive
        length = v0 / (_decay_rate(point) or 1.0)
        _, d = unit(self.role.unit)
        if isinstance(self.rig, Machine) and self.rig.area_of(self.name) is None:
            d = d.times(Dimension(length=-2 * d.mass))  # a total: of forces, not stresses
        by_velocity = -2 * d.mass - d.time
        sigma, v0, length = np.float64(sigma), np.float64(v0), np.float64(length)  # overflow to inf, no exception
        size = sigma**d.mass * v0**by_velocity * length ** (d.length + d.mass - by_velocity)
        return float(size) if np.isfinite(size) and size > 0 else 1.0

    # -- status along the parameter

    def status(self, x: Array) -> NDArray[np.int64]:
        return status(self.values(np.asarray(x, dtype=float)))

    def measures(self, x: Array) -> Array:
        """Two functions that pass through zero at an edge: damping of pairs, and of single eigenvalues."""
        return nearness(self.values(np.asarray(x, dtype=float)))

    def boundaries(self, between: tuple[float, float] | None) -> tuple[Boundary, ...]:
        grid = self.grid(between)
        with np.errstate(all="ignore"):
            exact = self._exact()
            if exact is not None:
                return self._of_set(exact, grid[0], grid[-1])
            grid, status = self._judged(grid)
            if len(grid) < 2:
                return ()
            known = (status[1:] != UNKNOWN) & (status[:-1] != UNKNOWN)
            at = np.flatnonzero((status[1:] != status[:-1]) & known)
            low, high = self._narrowed(grid[at], grid[at + 1], status[at])
            if self.role.domain.low == 0:  # then zero itself is the end of the domain, no edge
                inside = ~((low == 0) & (high < 1e-9 * np.abs(grid[at + 1])))
                low, high = low[inside], high[inside]
            return tuple(self._described(a, b) for a, b in zip(low, high, strict=True))

    def _judged(self, grid: Array) -> tuple[Array, NDArray[np.int64]]:
        """Samples, those of hidden windows among them, and their status; without those that rounding decides."""
        found: list[tuple[Array, NDArray[np.int64], NDArray[np.bool_]]] = []
        extra = grid
        while extra.size:
            point = self.values(extra)
            if not np.all(known := can_be_counted(point)):
                extra, point = extra[known], self.values(extra[known])
            found.append((extra, own := status(point), on_edge(point)))
            extra = np.empty(0) if len(found) > 1 else self._hidden_windows(extra, own, point)
        samples, judged, edge = (np.concatenate(parts) for parts in zip(*found, strict=True))
        samples, at = np.unique(samples, return_index=True)
        certain = ~edge[at]
        return samples[certain], judged[at][certain]

    def _hidden_windows(self, grid: Array, status: NDArray[np.int64], point: OperatingPoint) -> Array:
        """Samples at dips of the damping towards zero, where a narrow window may lie between two samples."""
        measures = nearness(point)
        same = (status[1:-1] == status[:-2]) & (status[1:-1] == status[2:]) & np.isin(status[1:-1], (STABLE, UNSTABLE))
        if point.model.delays:
            same &= unstable_roots(point)[1:-1] <= _FEW
        extra = [np.empty(0)]
        for which, measure in enumerate(measures):
            size = np.abs(measure)
            dips = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
            dips &= np.maximum(size[:-2], size[2:]) > size[1:-1] * (1 + _FLAT)
            at = np.flatnonzero(dips & same & np.isfinite(measure[1:-1])) + 1
            at = np.sort(at[np.argsort(size[at], kind="stable")[:_DIPS]])
            if at.size:
                extra += self._descended(which, np.sign(measure[at]), grid[at - 1], grid[at + 1])
        return np.concatenate(extra)

    def _descended(self, which: int, sign: Array, low: Array, high: Array) -> list[Array]:
        """Lowest points of a measure (times its sign) inside brackets, ever more closely."""
        found = []
        row = np.arange(len(low))
        for _ in range(4):
            x = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, _SPLIT + 1)
            value = sign[:, None] * self.measures(x.ravel())[which].reshape(x.shape)
            best = np.clip(np.argmin(np.where(np.isnan(value), np.inf, value), axis=-1), 1, _SPLIT - 1)
            found.append(x[row, best])
            low, high = x[row, best - 1], x[row, best + 1]
        return found

    def _narrowed(self, low: Array, high: Array, low_status: NDArray[np.int64]) -> tuple[Array, Array]:
        """Brackets down to rounding, all at once; keeps the lowest change inside each."""
        for _ in range(int(60 / np.log2(_SPLIT))):
            if not len(low):
                break
            x = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, _SPLIT + 1)
            x[:, -1] = high
            status = self.status(x.ravel()).reshape(x.shape)
            first = np.argmax(status != low_status[:, None], axis=-1)
            first = np.where(first == 0, _SPLIT, first)
            row = np.arange(len(low))
            low, high = x[row, first - 1], x[row, first]
        return low, high

    def _described(self, low: float, high: float) -> Boundary:
        low, high = self._past_rounding(low, high)
        below, above = (int(s) for s in self.status(np.array([low, high])))
        lost = self._why_none(low if below == ABSENT else high) if ABSENT in (below, above) else None
        kind, frequency = self._kind(low, high) if lost is None else (lost.condition, 0.0)
        stable = "above" if above == STABLE else "below" if below == STABLE else "neither"
        middle = 0.0 if low <= 0 <= high else low + 0.5 * (high - low)
        bracket = float(low), float(high)
        return Boundary(
            self.name, float(middle), bracket, kind, frequency, stable, self.role.unit, self.rig.area_of(self.name),
            "" if lost is None else lost.contact,
        )  # fmt: skip

    def _past_rounding(self, low: float, high: float) -> tuple[float, float]:
        """A wider bracket where steady sliding ends within rounding of the edge.

        The static stiffness vanishes there too, so that rounding alone decides which of the two is met first.
        """
        unit = max(np.spacing(abs(low)), np.spacing(abs(high)))
        reach = _ROUNDING * unit * 8.0 ** np.arange(_WIDER)  # friction hardly changes with the velocity, say
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

    def _exact(self) -> StableSet | None:
        """The stable set of the stiffness of a slider, and of whatever enters linearly in a machine."""
        point = operating_point(self.rig, None, self.present, self.branch)
        late = bool(point.model.delays)
        if self.name == STIFFNESS:
            with suppress(NotAvailable):  # windows without end
                return set_of_one(point)
            return None
        if (point.model.is_slider and not late) or not point.exists or self.role.domain.low < 0:
            return None
        return linear_set(point, self.name)

    def _of_set(self, edges: StableSet, low: float, high: float) -> tuple[Boundary, ...]:
        """The exact edges of the stable set."""
        keep = np.flatnonzero(edges.changes & (edges.edges >= low) & (edges.edges <= high))
        return tuple(
            self._exact_edge(float(edges.edges[i]), float(edges.frequencies[i]), edges.intervals) for i in keep
        )

    def _exact_edge(self, k: float, frequency: float, intervals: Array) -> Boundary:
        kind = "divergence" if frequency == 0 else "ill-posed" if np.isinf(frequency) else "oscillatory"
        stable = "above" if np.any(intervals[:, 0] == k) else "below"
        bracket = (float(np.nextafter(k, 0)), float(np.nextafter(k, np.inf)))
        beta = frequency if kind == "oscillatory" else 0.0
        return Boundary(self.name, k, bracket, kind, beta, stable, self.role.unit, self.rig.area_of(self.name))


def _decay_rate(point: OperatingPoint) -> float:
    """Fastest decay rate of the memory (1/s), zero without memory."""
    model, linear = point.model, linearise(point.model)
    numbers = dict(zip(model.arguments, (*point.arguments, *point.steady), strict=True))
    own = [linear.rows[item.symbol][item.symbol].xreplace(numbers) for item in model.memory]
    return max((abs(float(rate)) for rate in own if rate.is_number), default=0.0)
