"""Growing eigenvalues of a machine under changes of one parameter, from one scalar response of the unchanged machine.

With P(s) = s E − A and a parameter that changes it by U B(s) Vᵀ of low rank, Δ(s) = det(1 + Vᵀ P(s)⁻¹ U B(s)) is the
ratio of the characteristic functions. The resolvent is computed once over frequencies, for all values of the parameter;
the number of further growing roots follows from the turns of Δ around 0 (theory 13).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.model.numeric.pencil import ComplexArray, StatePencil

_RANK = 1e-12  # relative singular value below which a direction of a change is rounding error
_LINEAR = 1e-9  # relative difference of slopes that counts as rounding of assembly and elimination
_SKETCH = 24  # number of random vectors by which the rank of a change is found; a contact or link has a smaller rank
_AROUND = (-3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0)  # frequencies near a pole, in units of its distance from the axis
_PER_DECADE = 24  # number of frequencies per decade, besides those near poles
_BEYOND = 1e3  # factor beyond the slowest and fastest root up to which frequencies are as dense
_FAR = 1e12  # factor up to which frequencies are followed: a changed machine may be that much slower or faster
_SPARSE = 6  # number of frequencies per decade from `_BEYOND` to `_FAR`
_TURN = 1.2  # rad; largest change of the argument between two frequencies; for a larger change, one is added between
_ROUNDS = 24  # most halvings of the interval between two frequencies until the argument changes little enough
# If halving leads to more than 4 times as many intervals with large changes of the argument as at first (or as 64),
# the changes are due to rounding.
_MORE, _SOME = 4, 64


@dataclass(frozen=True, eq=False)
class LowRankChange:
    """A change of the pencil s E − A by a matrix of low rank: s E − A + U (s Be − Ba) Vᵀ.

    Attributes
    ----------
    own : StatePencil
    into, out : ndarray (N, k), (N, m)
        U, and V.
    """

    own: StatePencil
    into: Array
    out: Array
    rows: Array
    columns: Array

    @property
    def is_wide(self) -> bool:
        """True if the rank may be larger than was found, as for a parameter that damps or turns a whole structure."""
        return bool(max(self.into.shape[1], self.out.shape[1]) > _SKETCH)

    def core(self, e: Array, a: Array, at: NDArray[np.int64]) -> tuple[Array, Array]:
        """Be and Ba (k, m) of a pencil that differs only in rows and columns `at` (K,), where it has `e` and `a` (K,
        K)."""
        both = np.ix_(at, at)
        before, after = self.rows[at].T, self.columns[at]
        return before @ (e - self.own.e[both]) @ after, before @ (a - self.own.a[both]) @ after

    def core_of(self, other: StatePencil) -> tuple[Array, Array]:
        """Be and Ba (k, m) of the change that leads to another pencil."""
        return self.core(other.e, other.a, np.arange(len(other.a)))

    def response(self, omega: Array) -> ComplexArray:
        """Response Vᵀ (iω E − A)⁻¹ U at frequencies ω (p,), (p, m, k)."""
        return self._resolvent(1j * omega)

    @cached_property
    def static_response(self) -> Array:
        """The response at frequency zero, (m, k)."""
        return np.asarray(self._resolvent(np.zeros(1, dtype=complex))[0].real)

    @cached_property
    def _resolvent(self) -> Callable[[ComplexArray], ComplexArray]:
        return self.own.resolvent(self.out, self.into)

    def ratio(self, omega: Array, response: ComplexArray, core: tuple[Array, Array]) -> ComplexArray:
        """Δ at frequencies (p,)."""
        if response.shape[1] > response.shape[2]:  # det(1 + R B) = det(1 + Rᵀ Bᵀ); the smaller matrix is used
            response, core = np.swapaxes(response, 1, 2), (core[0].T, core[1].T)
        flat, size = response.reshape(-1, response.shape[2]), response.shape[1]
        # all frequencies at once, which is faster
        by_rate, by_place = ((flat @ one).reshape(-1, size, size) for one in core)
        found: ComplexArray = np.linalg.det(np.eye(size) + 1j * omega[:, None, None] * by_rate - by_place)
        return found


def change_between(own: StatePencil, others: list[StatePencil]) -> LowRankChange | None:
    """Low-rank change in which pencils differ from the pencil `own`; None if they do not differ."""
    rows, columns = own.scale
    chance = np.random.default_rng(0)
    size = len(own.e)
    left, right = [], []
    for other in others:
        for new, old in ((other.e, own.e), (other.a, own.a)):
            change = rows[:, None] * (new - old) * columns
            largest = np.max(np.abs(change))
            if largest > 0:
                left.append(change @ chance.standard_normal((size, min(_SKETCH, size))) / largest)
                right.append(change.T @ chance.standard_normal((size, min(_SKETCH, size))) / largest)
    if not left:
        return None
    u, v = (_directions(np.hstack(side)) for side in (left, right))
    return LowRankChange(own, u / rows[:, None], v / columns[:, None], rows[:, None] * u, columns[:, None] * v)


def _directions(sketch: Array) -> Array:
    found, sizes, _ = np.linalg.svd(sketch, full_matrices=False)
    kept: Array = found[:, sizes > _RANK * sizes[0]]
    return kept


def frequencies(own: StatePencil, further: tuple[float, ...] = ()) -> Array:
    """Frequencies (rad/s) at which the response of a machine is computed; they are dense near its poles."""
    poles = own.eigenvalues
    size = np.abs(poles[np.abs(poles) > 0])
    sizes = np.append(size, further) if len(size) or further else np.ones(1)
    low, high = np.min(sizes) / _BEYOND, np.max(sizes) * _BEYOND
    even = np.geomspace(low, high, int(_PER_DECADE * np.log10(high / low)) + 2)
    decades = np.arange(_SPARSE * np.log10(_FAR / _BEYOND), 0, -1) / _SPARSE
    even = np.concatenate([low * 10**-decades, even, high * 10 ** decades[::-1]])
    width = np.maximum(np.abs(poles.real), 1e-9 * np.abs(poles))
    near = (np.abs(poles.imag)[:, None] + width[:, None] * np.array(_AROUND)).ravel()
    return np.unique(np.concatenate([even, near[(near > low) & (near < high)]]))


class Turns:
    """Change in the number of growing eigenvalues by a parameter, from the change of Δ's argument with frequency."""

    def __init__(self, change: LowRankChange) -> None:
        self.change = change
        self.omega = frequencies(change.own)
        self.response = change.response(self.omega)

    def more_growing(self, core: tuple[Array, Array]) -> int | None:
        """Number of growing roots after a change (Be, Ba) minus those before; None if a root is too near the axis.

        Frequencies that are added for one value of the parameter are kept, as the next value mostly needs the same.
        """
        ratio, most = self.change.ratio(self.omega, self.response, core), 0
        for _ in range(_ROUNDS):
            turn = np.angle(ratio[1:] * np.conj(ratio[:-1]))
            steep = np.flatnonzero(~(np.abs(turn) <= _TURN))
            if not steep.size:
                whole = (np.sum(turn) + self._ends(core, ratio)) / np.pi
                return -round(float(whole)) if abs(whole - round(float(whole))) < 0.25 else None
            most = most or _MORE * max(steep.size, _SOME)
            if steep.size > most:
                return None
            middle = np.sqrt(self.omega[steep] * self.omega[steep + 1])
            fresh = self.change.response(middle)
            self.omega = np.insert(self.omega, steep + 1, middle)
            self.response = np.insert(self.response, steep + 1, fresh, axis=0)
            ratio = np.insert(ratio, steep + 1, self.change.ratio(middle, fresh, core))
        return None

    def least(self, core: tuple[Array, Array], count: int) -> list[float]:
        """Frequencies (rad/s) of the smallest minima of |Δ| after a change, the smallest first."""
        size = np.abs(self.change.ratio(self.omega, self.response, core))
        inner = np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] < size[2:])) + 1
        return [float(one) for one in self.omega[inner[np.argsort(size[inner])[:count]]]]

    def _ends(self, core: tuple[Array, Array], ratio: ComplexArray) -> float:
        """Changes (rad) of Δ's argument below the first frequency and above the last, where Δ is nearly real."""

        def to_axis(one: complex) -> float:
            angle = float(np.angle(one))
            return angle - np.pi * round(angle / np.pi)

        return to_axis(complex(ratio[0])) - to_axis(complex(ratio[-1]))


def rank_one(change: LowRankChange, steps: list[float], others: list[StatePencil]) -> tuple[Array, Array] | None:
    """Be and Ba for a unit of the parameter if all changes are proportional to it and of rank one; None otherwise.

    `steps` are the changes of the parameter, from its value in the machine, that lead to the pencils `others`.
    """
    cores = [[own / step for own in change.core_of(other)] for step, other in zip(steps, others, strict=True)]
    units = []
    for several in zip(*cores, strict=True):
        largest = max(float(np.max(np.abs(one))) for one in several)
        if any(np.max(np.abs(one - several[0])) > _LINEAR * largest for one in several[1:]):
            return None
        units.append(several[0] / (largest or 1.0))
    if all(_rank(stacked) > 1 for stacked in (np.hstack(units), np.vstack(units))):
        return None
    return cores[0][0], cores[0][1]


def _rank(matrix: Array) -> int:
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(sizes > _LINEAR * sizes[0]))


def scalar_response(omega: Array, response: ComplexArray, unit: tuple[Array, Array]) -> ComplexArray:
    """h(iω) at frequencies ω (p,) for a change of rank one, of which Δ = 1 + θ h."""
    by = 1j * omega[:, None, None] * unit[0] - unit[1]
    found: ComplexArray = np.trace(response @ by, axis1=1, axis2=2)
    return found


def real_crossings(change: LowRankChange, turns: Turns, unit: tuple[Array, Array]) -> tuple[Array, Array]:
    """All steps θ at which a root lies on the imaginary axis, 1 + θ h(iω) = 0, and their frequencies (rad/s).

    h is real at these frequencies: its imaginary part changes sign, which is narrowed to rounding. Where the imaginary
    part has a minimum close to zero between two frequencies, further frequencies are added.
    """
    omega, values = turns.omega, scalar_response(turns.omega, turns.response, unit)
    extra = _dips(omega, values.imag)
    for _ in range(4):  # rounds of adding frequencies at minima, each eight times denser
        if not extra.size:
            break
        fresh = scalar_response(extra, change.response(extra), unit)
        order = np.argsort(np.concatenate([omega, extra]), kind="stable")
        omega, values = np.concatenate([omega, extra])[order], np.concatenate([values, fresh])[order]
        extra = _dips(omega, values.imag)
    at = np.flatnonzero(np.sign(values.imag[1:]) * np.sign(values.imag[:-1]) < 0)
    low, high = omega[at], omega[at + 1]
    below = values.imag[at]
    for _ in range(60):  # halvings down to rounding; the secant method would stick at poles of h
        middle = 0.5 * (low + high)
        now = scalar_response(middle, change.response(middle), unit).imag
        same = np.sign(now) == np.sign(below)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found = 0.5 * (low + high)
    static = scalar_response(np.zeros(1), change.static_response[None], unit).real
    h = np.concatenate([static, scalar_response(found, change.response(found), unit).real])
    with np.errstate(divide="ignore"):
        steps = -1 / h
    places = np.concatenate([[0.0], found])
    good: NDArray[np.bool_] = np.isfinite(steps)
    return steps[good], places[good]


def _dips(omega: Array, imaginary: Array) -> Array:
    """Frequencies around minima of the size of the imaginary part at which it does not change sign."""
    size = np.abs(imaginary)
    inner = (size[1:-1] < size[:-2]) & (size[1:-1] < size[2:])
    alike = (np.sign(imaginary[:-2]) == np.sign(imaginary[1:-1])) & (np.sign(imaginary[2:]) == np.sign(imaginary[1:-1]))
    at = np.flatnonzero(inner & alike) + 1
    shares = np.array([0.125, 0.25, 0.5, 0.75])
    left = omega[at - 1, None] + (omega[at] - omega[at - 1])[:, None] * shares
    right = omega[at, None] + (omega[at + 1] - omega[at])[:, None] * shares
    return np.unique(np.concatenate([left.ravel(), right.ravel()]))
