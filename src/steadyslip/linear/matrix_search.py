"""Edges of stability in one parameter of a machine given by matrices.

The edges of a parameter that changes the matrices by a term of rank one are among the values at which a scalar response
of the unchanged machine is real, whatever the machine's size (theory 13). For other parameters roots are counted along
the parameter; if it changes a whole structure, by eigenvalues, which takes minutes for hundreds of degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.caching import cached
from steadyslip.linear import samples
from steadyslip.linear.allowance import may_take
from steadyslip.linear.roots import Array
from steadyslip.linear.search import Boundary, natural_size
from steadyslip.linear.status import ABSENT, STABLE, UNKNOWN, UNSTABLE
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.change import LowRankChange, Turns, change_between, rank_one, real_crossings
from steadyslip.model.numeric.machine_point import MachinePoint, MachinesAlong, absence, machine_point
from steadyslip.model.numeric.pencil import ILL_POSED, UNDECIDED, StatePencil, real_product

_SHARE = 4  # samples are fewer than in `search` by this factor: 10 per decade
_BRACKET = 1e-9  # relative width to which a bracket is narrowed by counting, before Newton's method
_NEAR = 1e-3  # relative width of a bracket from which Newton's method mostly converges
_BESIDE = 1e-3  # distance, over the bracket, from the end of steady sliding at which stability is evaluated
_FAR = 1e12  # ratio of two values above which the smaller value counts as a zero with rounding error
_PARTS = 32  # pieces into which a bracket is cut for a small machine, whose roots are counted for all at once
_HALVINGS = 60  # most halvings of a bracket: down to neighbouring numbers
_SMALL = 64  # rows of a pencil up to which computing eigenvalues is faster than following a response's argument
FLOPS = 40  # eigenvalues of n rows count as n**3/FLOPS terms of `allowance`, by measured time
_TOGETHER = 2**20  # most entries of matrices that are treated together, 8 MiB
_NEWTON = 12  # most steps of Newton's method; its convergence is quadratic
_LIKELY = 3  # number of eigenvalues nearest to the axis, by each of two measures, from which Newton's method starts
_REACH = 4.0  # largest distance that Newton's method may go, in widths of the bracket
_LAST = 4 * np.finfo(float).eps  # relative step at which Newton's method has converged
_ROUNDING = 1e-11  # relative step below which Newton's method ends if steps no longer fall: rounding of large matrices
_APART = 1e-7  # relative step of differences of the determinant along a nonlinear parameter: ~sqrt(eps)
_PROBES = (0.5, 2.0, 7.0)  # multiples of a parameter's value at which linearity is tested


class MatrixSearch:
    """Search of one parameter of a machine for edges; `boundaries` is the result."""

    def __init__(self, machine: Machine, name: str) -> None:
        self.machine, self.name = machine, name
        address = machine.parameters()[name]
        self.role, self.value = address.role, float(address.value)  # type: ignore[arg-type]
        self.own = machine_point(machine)

    hides = False
    decided = -np.inf, np.inf
    """`hides` and `decided` as in `Search`; without delays roots can be counted everywhere."""

    @cached_property
    def searched(self) -> tuple[float, float]:
        """Default range of the search, SI units."""
        grid = self.grid()
        return float(grid[0]), float(grid[-1])

    @cached_property
    def _sizes(self) -> tuple[float, float]:
        natural = natural_size(
            self.role.unit, self.machine.area_of(self.name) is None, self.own.balance.sigma,
            float(self.machine.drive.velocity), decay_rate(self.own), self.value,
        )  # fmt: skip
        return abs(self.value) or natural, natural

    def grid(self, between: tuple[float, float] | None = None) -> Array:
        """Values of the parameter at which roots are counted, in the range `between` or in `searched`."""
        domain = self.role.domain
        if np.isfinite(domain.high):
            found = samples.bounded(domain, _SHARE)
        else:
            far, asked = 10.0**samples.DECADES, [abs(end) for end in between or () if end]
            least, most = min([min(self._sizes) / far, *asked]), max([max(self._sizes) * far, *asked])
            zero = domain.low_allowed and not self.role.adds_state
            found = samples.unbounded(domain, zero, self._sizes[0], least, most, _SHARE)
        grid = np.unique(np.concatenate([found, [self.value], list(between or ())]))
        return grid if between is None else grid[(grid >= between[0]) & (grid <= between[1])]

    # -- the machine along the parameter

    @cached_property
    def _small(self) -> bool:
        """True if roots are counted by eigenvalues.

        That is so for small machines, and for machines that cannot slide steadily as they are.
        """
        return not self.own.balance.exists or len(self.own.pencil.a) <= _SMALL

    def _pencil(self, value: float) -> StatePencil | None:
        """Pencil at a value of the parameter; None without steady sliding."""
        return self.own.along(self.name, np.array([value])).pencil(0)

    def statuses(self, values: Array, sure: bool = True) -> NDArray[np.int64]:
        """Array (p,) with the status at each value: ABSENT, STABLE, UNSTABLE, or UNKNOWN where a body is unsupported.

        If `sure`, it is UNKNOWN also where rounding hides whether a root grows.
        """
        found = np.full(len(values), UNKNOWN)
        for part in self.parts(len(values)):
            machines = self.own.along(self.name, values[part])
            growing = self._growing(machines, sure)
            slides = np.where(growing == 0, STABLE, np.where(growing == UNDECIDED, UNKNOWN, UNSTABLE))
            balance = machines.balance
            known = np.where(balance.held & balance.settled, ABSENT, UNKNOWN)
            found[part] = np.where(balance.exists, slides, known)
        return found

    @cached_property
    def _rows(self) -> int:
        """Number of rows in the part of the pencil that the parameter may change."""
        return len(self.own.along(self.name, np.array([self.value])).a[0])

    def parts(self, count: int) -> list[slice]:
        """Slices that divide `count` machines into parts that are treated together."""
        together = max(_TOGETHER // self._rows**2, 1)
        return [slice(start, start + together) for start in range(0, count, together)]

    def _growing(self, machines: MachinesAlong, sure: bool) -> NDArray[np.int64]:
        """Array (p,) with the number of growing roots, ILL_POSED or UNDECIDED.

        For large machines it follows from the argument of a response.
        """
        if self._small or self.turns is None:
            count = len(machines.posed)
            if not self._small and not may_take(count * len(self.own.pencil.a) ** 3 // FLOPS):
                return np.full(count, UNDECIDED)
            return machines.growing(sure)
        found = np.full(len(machines.posed), ILL_POSED)
        for i in np.flatnonzero(machines.balance.exists & machines.posed):
            if np.all(np.isfinite(machines.a[i])):
                more = self.turns.more_growing(self.turns.change.core(machines.e[i], machines.a[i], machines.at))
                whole = machines.pencil(int(i)) if more is None else None
                found[i] = self.own.growing + (more or 0) if whole is None else whole.growing(sure)
        return found

    @cached_property
    def _probes(self) -> tuple[list[float], list[StatePencil]]:
        """Steps that lead from the parameter's value in the machine to `_PROBES`, inside its domain, and the pencils
        there."""
        size = abs(self.value) or self._sizes[0]
        values = [self.value + size * (f - 1) if self.value == 0 else self.value * f for f in _PROBES]
        if np.isfinite(self.role.domain.high):  # angles and shares
            low, high = max(self.role.domain.low, -1.0), min(self.role.domain.high, 1.0)
            values = [self.value + share * (high - low) for share in (-0.1, 0.05, 0.13)]
        inside = np.array([one for one in values if self.role.domain.contains(np.array([one]))[0]])
        if not inside.size:
            return [], []
        machines = self.own.along(self.name, inside)
        pencils = map(machines.pencil, range(len(inside)))
        kept = [(float(v) - self.value, p) for v, p in zip(inside, pencils, strict=True) if p is not None]
        return [step for step, _ in kept], [pencil for _, pencil in kept]

    @cached_property
    def change(self) -> LowRankChange | None:
        """Low-rank change of the pencil by the parameter; None if the parameter changes nothing."""
        return change_between(self.own.pencil, self._probes[1])

    @cached_property
    def turns(self) -> Turns | None:
        """Counts of roots from the argument of a response.

        None if the parameter changes nothing, or too much of the pencil.
        """
        return None if self.change is None or self.change.is_wide else Turns(self.change)

    # -- edges

    def boundaries(self, between: tuple[float, float] | None = None) -> tuple[Boundary, ...]:
        """Edges in the range `between`, by default in `searched`, by rising value."""
        with np.errstate(all="ignore"):
            if not self.own.balance.exists:
                return self._scanned(between)
            if self.change is None:
                return ()
            few = self.turns is not None and len(self._probes[0]) > 1
            unit = rank_one(self.change, *self._probes) if few else None
            if unit is None or self.turns is None:
                return self._scanned(between)
            return self._linear(self.change, self.turns, unit, between)

    def _linear(
        self, change: LowRankChange, turns: Turns, unit: tuple[Array, Array], between: tuple[float, float] | None
    ) -> tuple[Boundary, ...]:
        """Edges of a parameter that enters by a term of rank one."""
        low, high = self.searched if between is None else between
        steps, omega = real_crossings(change, turns, unit)
        lost = self._lost(self.grid(between))
        values, omega = np.concatenate([self.value + steps, lost]), np.concatenate([omega, np.zeros(len(lost))])
        inside = (values > low) & (values < high) & self.role.domain.contains(values)
        order = np.argsort(values[inside])
        values, omega = values[inside][order], omega[inside][order]
        values, omega = _distinct(values, omega)
        if not values.size:
            return ()
        middle = np.array([_between(low, values[0]), *map(_between, values, values[1:]), _between(values[-1], high)])
        status = self.statuses(middle).tolist()
        found = []
        for i, (value, beta) in enumerate(zip(values, omega, strict=True)):
            if status[i] != status[i + 1] and UNKNOWN not in status[i : i + 2]:
                found.append(self._described(float(value), float(beta), status[i], status[i + 1]))
        return tuple(found)

    def _lost(self, grid: Array) -> Array:
        """Values at which steady sliding begins or ends, found between the samples `grid`."""
        if not self.steady_changes:
            return np.empty(0)
        there = self._slides(grid)
        return np.array([self._end(grid[i], grid[i + 1]) for i in np.flatnonzero(np.diff(there))])

    @cached_property
    def steady_changes(self) -> bool:
        """True if the parameter changes the stresses of steady sliding or the distance from lock-up."""
        steps, rounding = np.array(self._probes[0]), 1e-12
        if len(steps) < len(_PROBES):  # some probes are out of the domain or without steady sliding
            return True
        own, other = self.own.balance, self.own.balances_along(self.name, self.value + steps)
        moved = np.abs(other.sigma - own.sigma) > rounding * own.sigma
        return bool(np.any(moved) or np.any(np.abs(other.gain - own.gain) > rounding))

    def _slides(self, values: Array) -> NDArray[np.bool_]:
        parts = self.parts(len(values))
        return np.concatenate([self.own.balances_along(self.name, values[part]).exists for part in parts])

    def _end(self, low: float, high: float) -> float:
        """Value in a bracket at which steady sliding begins or ends."""
        first, last = self._narrowed(low, high, self._slides, 0.0)
        found = 0.5 * (first + last)
        # 0 if one end of the bracket is zero and the value is rounding error
        return found if abs(found) * _FAR > max(abs(low), abs(high)) else 0.0

    def _scanned(self, between: tuple[float, float] | None) -> tuple[Boundary, ...]:
        """Edges by counting roots at samples."""
        grid = self.grid(between)
        status = self.statuses(grid).tolist()
        found = []
        for i in np.flatnonzero(np.diff(status)):
            if UNKNOWN not in status[i : i + 2]:
                found += self._edges(float(grid[i]), float(grid[i + 1]), status[i], status[i + 1])
        return tuple(found)

    def _edges(self, low: float, high: float, below: int, above: int) -> list[Boundary]:
        """Edges between two values of different status: one, or two if steady sliding ends beyond an edge."""
        if ABSENT not in (below, above):
            return [self._edge(low, high, below, above)]
        end = self._end(low, high)
        beside = end + _BESIDE * ((low if above == ABSENT else high) - end)
        status = int(self.statuses(np.array([beside]))[0])
        if above == ABSENT:
            before = [] if status == below else [self._edge(low, beside, below, status)]
            return [*before, self._described(end, 0.0, status, above)]
        after = [] if status == above else [self._edge(beside, high, status, above)]
        return [self._described(end, 0.0, below, status), *after]

    def _described(self, value: float, beta: float, below: int, above: int) -> Boundary:
        """The Boundary at a value; its kind at an end of steady sliding is the condition that fails."""
        if ABSENT not in (below, above):
            return self._boundary(value, "oscillatory" if beta else "divergence", beta, below, above)
        step = -_APART if below == ABSENT else _APART
        lost = absence(self.own.varied(self.name, value + step * (abs(value) or self._sizes[0])))
        return self._boundary(value, lost.condition, 0.0, below, above, lost.contact)

    def _edge(self, low: float, high: float, below: int, above: int) -> Boundary:
        """Edge between two values with different status."""

        def is_other(values: Array) -> NDArray[np.bool_]:
            return np.asarray(self.statuses(values, sure=False) != below)

        for width in (_NEAR, _BRACKET):
            low, high = self._narrowed(low, high, is_other, width)
            pencils = [self._pencil(value) for value in (low, high)]
            if any(one is None or not one.posed for one in pencils):
                continue
            value, beta = self._polished(low, high)
            around = self.statuses(np.array([value * (1 - _BRACKET), value * (1 + _BRACKET)]), sure=False)
            if width == _BRACKET or set(around.tolist()) == {below, above}:
                return self._described(value, beta, below, above)
        return self._boundary(0.5 * (low + high), "ill-posed", 0.0, below, above)

    def _narrowed(
        self, low: float, high: float, where: Callable[[Array], NDArray[np.bool_]], width: float
    ) -> tuple[float, float]:
        """Bracket (of relative `width`, or neighbouring numbers) around the first change of the property `where`."""
        parts, first = _PARTS if self._small else 2, bool(where(np.array([low]))[0])
        for _ in range(int(_HALVINGS / np.log2(parts))):
            inner = low + (high - low) * np.arange(1, parts) / parts
            inner = inner[(inner > low) & (inner < high)]
            if not inner.size or high - low <= width * max(abs(low), abs(high)):
                break
            other = np.flatnonzero(where(inner) != first)
            ends = np.concatenate([[low], inner, [high]])
            at = int(other[0]) if other.size else len(inner)
            low, high = float(ends[at]), float(ends[at + 1])
        return low, high

    def _polished(self, low: float, high: float) -> tuple[float, float]:
        """Value and frequency of an edge in a narrow bracket, by Newton's method on the characteristic function."""
        middle = 0.5 * (low + high)
        pencil = self._pencil(middle)
        if pencil is None:
            return middle, 0.0
        reach = _REACH * (high - low) + 1e-9 * abs(middle)
        for beta in self._likely(pencil):
            value, last = middle, np.inf
            for _ in range(_NEWTON):
                moved = self._crossing_step(value, beta)
                if moved is None or not abs(value + moved[0] - middle) <= reach:
                    break
                value, beta = value + moved[0], abs(beta + moved[1])
                step = abs(moved[0])
                if step <= _LAST * abs(value) or 0.5 * last <= step <= _ROUNDING * abs(value):
                    return value, beta
                last = step
            else:
                return value, beta
        return middle, next(self._likely_of_roots(pencil))

    def _likely(self, pencil: StatePencil) -> Iterator[float]:
        """Frequencies (rad/s) at which a root of nearby machines may cross the axis, the likeliest first."""
        if not self._small and self.turns is not None:
            yield from self.turns.least(self.turns.change.core_of(pencil), _LIKELY)
        yield from self._likely_of_roots(pencil)

    @staticmethod
    def _likely_of_roots(pencil: StatePencil) -> Iterator[float]:
        roots = pencil.eigenvalues[pencil.eigenvalues.imag >= 0]
        size, real = np.abs(roots), np.abs(roots.real)
        likely = np.concatenate([np.argsort(real / np.maximum(size, 1e-300))[:_LIKELY], np.argsort(real)[:_LIKELY]])
        yield from (float(roots[i].imag) for i in dict.fromkeys(likely.tolist()))

    def _crossing_step(self, value: float, beta: float) -> tuple[float, float] | None:
        """Newton step of value and frequency towards a root on the axis, from derivatives of an eigenvalue."""
        step = _APART * (abs(value) or self._sizes[0])
        machines = self.own.along(self.name, np.array([value, value + step]))
        here, there = machines.pencil(0), machines.pencil(1)
        if here is None or there is None:
            return None
        root, slope = _followed(here, there, 1j * beta, step)
        if not np.isfinite(root) or not slope.real:
            return None
        change = -root.real / slope.real
        return change, root.imag + slope.imag * change - beta if beta else 0.0

    def _boundary(self, value: float, kind: str, beta: float, below: int, above: int, contact: str = "") -> Boundary:
        stable = "above" if above == STABLE else "below" if below == STABLE else "neither"
        bracket = float(np.nextafter(value, -np.inf)), float(np.nextafter(value, np.inf))
        return Boundary(
            self.name, value, bracket, kind, beta, stable, self.role.unit, self.machine.printed_area(self.name), contact
        )


def _followed(here: StatePencil, there: StatePencil, near: complex, step: float) -> tuple[complex, complex]:
    """Eigenvalue of the pencil `here` near `near` (1/s), and its derivative by the parameter (to first order)."""
    u, v = here.vectors(near)
    rates, places = real_product(here.e, v), real_product(here.a, v)
    normal = u @ rates
    at = near - (u @ (near * rates - places)) / normal
    moved = (real_product(there.a, v) - places) - at * (real_product(there.e, v) - rates)
    return complex(at), complex(u @ moved / normal / step)


def _between(low: float, high: float) -> float:
    """Geometric mean of two values if they have the same sign and a moderate ratio, else their arithmetic mean."""
    ratio = high / low if low else 0.0
    return float(np.sign(low) * np.sqrt(low * high)) if 1 / _FAR < ratio < _FAR else 0.5 * (low + high)


def _distinct(values: Array, omega: Array) -> tuple[Array, Array]:
    """The rising values with their frequencies.

    Values that differ from the value before only by rounding are left out.
    """
    keep = np.diff(values, prepend=-np.inf) > 1e-12 * np.abs(values)
    return values[keep], omega[keep]


@cached
def decay_rate(point: MachinePoint) -> float:
    """Fastest decay rate (1/s) of the memory of all contacts; zero if no contact has memory."""
    from steadyslip.model.numeric.balance import state_of

    rates = [0.0]
    for i, site in enumerate(point.matrices.sites):
        slopes = site.laws.slopes(site.own, *state_of(site, point.balance, i, point.matrices.speeds))
        rates += [abs(float(slopes.rates[j, 3 + j])) for j in range(len(slopes.rates))]
    return max(rates)
