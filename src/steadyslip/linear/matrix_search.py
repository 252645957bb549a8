"""Edges of stability in one parameter of a machine given by matrices.

A parameter that enters by a term of rank one, whatever the machine's size, has its edges among the values at which a
scalar response of the unchanged machine is real (theory 13). Of others roots are counted along the parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.core.questions import question
from steadyslip.linear import samples
from steadyslip.linear.roots import Array
from steadyslip.linear.search import Boundary, natural_size
from steadyslip.linear.status import ABSENT, STABLE, UNSTABLE
from steadyslip.machine.machine import Machine
from steadyslip.model.numeric.change import LowRankChange, Turns, change_between, rank_one, real_crossings
from steadyslip.model.numeric.machine_point import MachinePoint, absence, machine_point
from steadyslip.model.numeric.pencil import StatePencil

_SHARE = 4  # samples are fewer than those of a small machine by this factor: 10 per decade
_HALVINGS = 26  # of a bracket by counting, from a tenth of a decade to 1e-9; then Newton's method
_NEWTON = 12  # steps from there, quadratic
_LIKELY = 3  # eigenvalues nearest to the axis, by either measure, that are tried as the one that crosses
_REACH = 4.0  # widths of the bracket that Newton's method may go
_LAST = 4 * np.finfo(float).eps  # relative step at which Newton's method has ended
_APART = 1e-7  # relative step of differences of the determinant along a nonlinear parameter: the root of rounding
_PROBES = (0.5, 2.0, 7.0)  # multiples of a parameter at which it is asked whether it enters linearly


class MatrixSearch:
    """Search of one parameter of a machine for edges; `boundaries` is the result."""

    def __init__(self, machine: Machine, name: str) -> None:
        self.machine, self.name = machine, name
        address = machine.parameters()[name]
        self.role, self.value = address.role, float(address.value)  # type: ignore[arg-type]
        self.own = machine_point(machine)
        self.known: dict[float, tuple[int, StatePencil | None]] = {}

    hides = False
    decided = -np.inf, np.inf
    """As of `Search`: no edge lies where roots cannot be counted."""

    @cached_property
    def searched(self) -> tuple[float, float]:
        """Default range."""
        grid = self._grid(None)
        return float(grid[0]), float(grid[-1])

    @cached_property
    def _sizes(self) -> tuple[float, float]:
        natural = natural_size(
            self.role.unit, self.machine.area_of(self.name) is None, self.own.balance.sigma,
            float(self.machine.drive.velocity), decay_rate(self.own), self.value,
        )  # fmt: skip
        return abs(self.value) or natural, natural

    def _grid(self, between: tuple[float, float] | None) -> Array:
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

    def _at(self, value: float) -> tuple[bool, StatePencil | None]:
        """True with steady sliding, and the pencil there; without one where conditions of laws are broken."""
        point = self.own if value == self.value else self.own.varied(self.name, value)
        try:
            exists = point.balance.exists
        except (NotAvailable, np.linalg.LinAlgError):
            return False, None
        return exists, point.pencil if exists else None

    def status(self, value: float) -> int:
        """Status at a value: ABSENT, STABLE, UNSTABLE."""
        return self._judged(value)[0]

    def _judged(self, value: float) -> tuple[int, StatePencil | None]:
        if value not in self.known:
            exists, pencil = self._at(value)
            found = ABSENT if not exists or pencil is None else STABLE if self.growing(pencil) == 0 else UNSTABLE
            self.known[value] = found, pencil
        return self.known[value]

    def growing(self, pencil: StatePencil) -> int:
        """Number of growing roots; −1 if ill-posed."""
        if not pencil.posed or not np.all(np.isfinite(pencil.a)):
            return -1
        if self.turns is None:
            return self.own.growing
        more = self.turns.more_growing(pencil)
        if more is None:
            return int(np.sum(pencil.eigenvalues.real > 0))
        return self.own.growing + more

    @cached_property
    def _probes(self) -> tuple[list[float], list[StatePencil]]:
        """Steps from the own value, and pencils there."""
        size = abs(self.value) or self._sizes[0]
        values = [self.value + size * (f - 1) if self.value == 0 else self.value * f for f in _PROBES]
        if np.isfinite(self.role.domain.high):  # angles and shares
            low, high = max(self.role.domain.low, -1.0), min(self.role.domain.high, 1.0)
            values = [self.value + share * (high - low) for share in (-0.1, 0.05, 0.13)]
        kept = [(v - self.value, p) for v in values
                if self.role.domain.contains(np.array([v]))[0] and (p := self._at(v)[1]) is not None]  # fmt: skip
        return [step for step, _ in kept], [pencil for _, pencil in kept]

    @cached_property
    def change(self) -> LowRankChange | None:
        """Directions in which the parameter changes the pencil; None if it changes nothing."""
        return change_between(self.own.pencil, self._probes[1])

    @cached_property
    def turns(self) -> Turns | None:
        return None if self.change is None else Turns(self.change)

    # -- edges

    def boundaries(self, between: tuple[float, float] | None = None) -> tuple[Boundary, ...]:
        """Edges in a range, by default in `searched`, rising."""
        with np.errstate(all="ignore"):
            if not self.own.balance.exists:
                return self._scanned(between)
            if self.change is None or self.turns is None:
                return ()
            unit = rank_one(self.change, *self._probes) if len(self._probes[0]) > 1 else None
            return self._scanned(between) if unit is None else self._linear(self.change, self.turns, unit, between)

    def _linear(
        self, change: LowRankChange, turns: Turns, unit: tuple[Array, Array], between: tuple[float, float] | None
    ) -> tuple[Boundary, ...]:
        """Edges of a parameter that enters by a term of rank one."""
        low, high = self.searched if between is None else between
        steps, omega = real_crossings(change, turns, unit)
        values = self.value + steps
        inside = (values > low) & (values < high) & self.role.domain.contains(values)
        order = np.argsort(values[inside])
        values, omega = values[inside][order], omega[inside][order]
        values, omega = _distinct(values, omega)
        if not values.size:
            return ()
        middle = np.concatenate([[_between(low, values[0])], [*map(_between, values, values[1:])],
                                 [_between(values[-1], high)]])  # fmt: skip
        status = [self.status(float(one)) for one in middle]
        found = []
        for i, (value, beta) in enumerate(zip(values, omega, strict=True)):
            if status[i] != status[i + 1]:
                kind = "divergence" if beta == 0 else "oscillatory"
                found.append(self._boundary(float(value), kind, float(beta), status[i], status[i + 1]))
        return tuple(found)

    def _scanned(self, between: tuple[float, float] | None) -> tuple[Boundary, ...]:
        """Edges by counting roots at samples."""
        grid = self._grid(between)
        status = [self.status(float(one)) for one in grid]
        found = []
        for i in np.flatnonzero(np.diff(status)):
            found.append(self._edge(float(grid[i]), float(grid[i + 1]), status[i], status[i + 1]))
        return tuple(found)

    def _edge(self, low: float, high: float, below: int, above: int) -> Boundary:
        """Edge between two values with different status."""
        if ABSENT in (below, above):
            low, high = _halved(lambda value: self.status(value) == below, low, high, 60)
            missing = low if below == ABSENT else high
            lost = absence(self.own.varied(self.name, missing))
            return self._boundary(0.5 * (low + high), lost.condition, 0.0, below, above, lost.contact)
        low, high = _halved(lambda value: self.status(value) == below, low, high, _HALVINGS)
        pencils = [self._judged(value)[1] for value in (low, high)]
        if any(one is None or not one.posed for one in pencils):
            return self._boundary(0.5 * (low + high), "ill-posed", 0.0, below, above)
        value, beta = self._polished(low, high)
        return self._boundary(value, "oscillatory" if beta else "divergence", beta, below, above)

    def _polished(self, low: float, high: float) -> tuple[float, float]:
        """Value and frequency of an edge in a narrow bracket, by Newton's method on the characteristic function."""
        middle = 0.5 * (low + high)
        pencil = self._at(middle)[1]
        if pencil is None:
            return middle, 0.0
        roots = pencil.eigenvalues[pencil.eigenvalues.imag >= 0]
        size, real = np.abs(roots), np.abs(roots.real)
        likely = np.concatenate([np.argsort(real / np.maximum(size, 1e-300))[:_LIKELY], np.argsort(real)[:_LIKELY]])
        reach = _REACH * (high - low) + 1e-9 * abs(middle)
        for beta in (float(roots[i].imag) for i in dict.fromkeys(likely.tolist())):
            value = middle
            for _ in range(_NEWTON):
                moved = self._crossing_step(value, beta)
                if moved is None or not abs(value + moved[0] - middle) <= reach:
                    break
                value, beta = value + moved[0], abs(beta + moved[1])
                if abs(moved[0]) <= _LAST * abs(value):
                    return value, beta
            else:
                return value, beta
        return middle, float(roots[likely[0]].imag)

    def _crossing_step(self, value: float, beta: float) -> tuple[float, float] | None:
        """Newton step of value and frequency towards a root on the imaginary axis, by the eigenvalue's own slopes."""
        step = _APART * (abs(value) or self._sizes[0])
        here, there = self._at(value)[1], self._at(value + step)[1]
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
    """Eigenvalue of a pencil nearest to a place, and its slope along the parameter (first-order perturbation)."""
    at = near
    e, a = here.e, here.a
    for _ in range(2):  # inverse iteration from a place that is an eigenvalue to 1e-9
        shifted = at * e - a
        left, _, right = np.linalg.svd(shifted * np.outer(*here.scale))
        u, v = left[:, -1].conj() * here.scale[0], right[-1].conj() * here.scale[1]
        normal = u @ e @ v
        at = complex(at - (u @ shifted @ v) / normal)
    slope = u @ ((there.a - a) - at * (there.e - e)) @ v / normal / step
    return at, complex(slope)


def _between(low: float, high: float) -> float:
    """A value between two others, the geometric mean where both have one sign."""
    return float(np.sign(low) * np.sqrt(low * high)) if low * high > 0 else 0.5 * (low + high)


def _distinct(values: Array, omega: Array) -> tuple[Array, Array]:
    """Rising values without those that repeat the one before to rounding."""
    keep = np.diff(values, prepend=-np.inf) > 1e-12 * np.abs(values)
    return values[keep], omega[keep]


def _halved(is_below: Callable[[float], bool], low: float, high: float, times: int) -> tuple[float, float]:
    """Bracket halved so often that a property of its lower end changes inside."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return low, high


@question
def decay_rate(point: MachinePoint) -> float:
    """Fastest decay rate of the contacts' memory (1/s), zero without memory."""
    from steadyslip.model.numeric.balance import state_of

    rates = [0.0]
    for i, site in enumerate(point.matrices.sites):
        slopes = site.laws.slopes(site.own, *state_of(site, point.balance, i, point.matrices.speeds))
        rates += [abs(float(slopes.rates[j, 3 + j])) for j in range(len(slopes.rates))]
    return max(rates)
