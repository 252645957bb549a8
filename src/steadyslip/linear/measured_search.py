"""Edges of stability in one parameter of a machine whose structure is a measured response.

Growing roots are counted along the parameter; an edge lies between two values if the machine is surely stable at one
and surely unstable at the other. The bracket of the edge has the values at which errors of the response leave it open.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.linear.search import Boundary
from steadyslip.linear.status import STABLE, UNKNOWN, UNSTABLE
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.measured import MeasuredMachine, measured_machine

# Roots are counted at 10 values per decade, two decades to each side; in a bounded domain at 61 evenly spaced values.
_DECADES, _PER_DECADE, _EVEN = 2, 10, 61
_HALVINGS = 14  # most halvings of the interval between two values: to about 1e-5 of the values
_SHARE = 0.02  # precision of the ends of an undecided range, as share of its width; errors are hardly known better
_NEWTON = 30  # most steps of Newton's method; from a bracket of 1e-5 a few do
_STEP = 1e-7  # relative step of differences: about the square root of the rounding error
_LAST = 1e-12  # relative step at which Newton's method has ended


class MeasuredSearch:
    """Search of one parameter for edges; `boundaries` is the result."""

    hides = False

    def __init__(self, machine: Machine, name: str) -> None:
        self.machine, self.name = machine, name
        address = machine.parameters()[name]
        self.role, self.value = address.role, float(address.value)  # type: ignore[arg-type]
        self.own = measured_machine(machine)
        self.gaps: tuple[tuple[float, float], ...] = ()
        """Ranges of values in which edges may hide, rising; known after `boundaries`."""

    @property
    def decided(self) -> tuple[float, float]:
        """Range about the parameter's value in which stability is decided; known after `boundaries`."""
        ends = [end for gap in self.gaps for end in gap]
        return (
            max((one for one in ends if one <= self.value), default=-np.inf),
            min((one for one in ends if one >= self.value), default=np.inf),
        )

    @property
    def searched(self) -> tuple[float, float]:
        """Default range of the search."""
        grid = self._grid(None)
        return float(grid[0]), float(grid[-1])

    def _grid(self, between: tuple[float, float] | None) -> Array:
        domain, far = self.role.domain, 10.0**_DECADES
        if np.isfinite(domain.high - domain.low):
            found = np.linspace(domain.low, domain.high, _EVEN)
        else:
            found = self.value * np.geomspace(1 / far, far, 2 * _DECADES * _PER_DECADE + 1)
        found = np.unique(np.concatenate([found[domain.contains(found)], [self.value], list(between or ())]))
        return found if between is None else found[(found >= between[0]) & (found <= between[1])]

    def _at(self, value: float) -> MeasuredMachine:
        return self.own.varied(self.name, value)

    def _status(self, value: float) -> int:
        try:
            growing = self._at(value).count.growing
        except NotAvailable:  # the laws have no steady stress at this value
            return UNKNOWN
        return UNKNOWN if growing is None else UNSTABLE if growing else STABLE

    def boundaries(self, between: tuple[float, float] | None = None) -> tuple[Boundary, ...]:
        """Edges in the range `between`, by default in `searched`, by rising value."""
        grid = self._grid(between)
        status = np.array([self._status(float(one)) for one in grid])
        sure = np.flatnonzero(status != UNKNOWN)
        found: list[Boundary] = []
        gaps: list[tuple[float, float]] = []
        for i, j in pairwise(sure):
            if status[i] != status[j]:
                found.append(self._edge(float(grid[i]), float(grid[j]), int(status[i]), int(status[j])))
            elif j > i + 1:  # between two values of equal status are two edges, or none
                gaps.append((float(grid[i]), float(grid[j])))
        # if the status is sure nowhere, the whole range is a gap
        first, last = (sure[0], sure[-1]) if sure.size else (-1, -1)
        gaps = [(float(grid[0]), float(grid[first])), *gaps, (float(grid[last]), float(grid[-1]))]
        self.gaps = _joined([gap for gap in gaps if gap[0] < gap[1]])
        return tuple(found)

    def _edge(self, low: float, high: float, below: int, above: int) -> Boundary:
        """Edge between two values of different status, in the narrowest bracket that errors of the response leave."""
        outer = low, high
        for cut in range(_HALVINGS):
            middle = 0.5 * (low + high)
            status = self._status(middle)
            if status == UNKNOWN:
                left = _HALVINGS - cut
                low, high = self._last(low, middle, below, left), self._last(high, middle, above, left)
                break
            low, high = (middle, high) if status == below else (low, middle)
        value, beta = self._polished(low, high, outer)
        bracket = min(low, value), max(high, value)
        stable = "above" if above == STABLE else "below"
        kind = "oscillatory" if beta else "divergence"
        area = self.machine.printed_area(self.name)
        return Boundary(self.name, value, bracket, kind, beta, stable, self.role.unit, area)

    def _last(self, sure: float, within: float, status: int, halvings: int) -> float:
        """Last value on the way from `sure` towards `within` at which the machine surely has the given status."""
        open_ = within
        for _ in range(halvings):
            if abs(open_ - sure) <= _SHARE * abs(within - open_):
                break
            middle = 0.5 * (sure + open_)
            sure, open_ = (middle, open_) if self._status(middle) == status else (sure, middle)
        return sure

    def _polished(self, low: float, high: float, outer: tuple[float, float]) -> tuple[float, float]:
        """Value and frequency at which the determinant is zero.

        Newton's method starts at the frequency where it is smallest.
        """
        middle = 0.5 * (low + high)
        value, beta = middle, self._at(middle).count.omega
        if beta <= self.own.response.omega[0]:  # the root crosses the axis at zero: no pair to follow
            return middle, 0.0
        for _ in range(_NEWTON):
            step, turn = _STEP * abs(value), _STEP * beta
            here = self._at(value)
            now = here.determinant(1j * beta)
            by_value = (self._at(value + step).determinant(1j * beta) - now) / step
            by_beta = (here.determinant(1j * (beta + turn)) - now) / turn
            slopes = np.array([[by_value.real, by_beta.real], [by_value.imag, by_beta.imag]])
            try:
                moved = np.linalg.solve(slopes, [-now.real, -now.imag])
            except np.linalg.LinAlgError:
                break
            value, beta = value + float(moved[0]), beta + float(moved[1])
            if not outer[0] < value < outer[1] or not 0 < beta < self.own.samples.omega[-1]:
                break
            if abs(moved[0]) <= _LAST * abs(value):
                return value, beta
        return middle, self._at(middle).count.omega


def _joined(gaps: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """The rising ranges, with ranges joined where one begins at the end of the one before."""
    found: list[tuple[float, float]] = []
    for low, high in gaps:
        if found and found[-1][1] == low:
            found[-1] = found[-1][0], high
        else:
            found.append((low, high))
    return tuple(found)
