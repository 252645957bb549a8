"""Compute the cubic coefficient to fifty digits, where double precision leaves its sign open.

Steady sliding, the position of the edge and the critical eigenvector are solved for together, by Newton's method from
their values in double precision, with residuals in fifty digits and a Jacobian in double precision. The linear
equations of the coefficient are solved in this way too (iterative refinement).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.expressions import ArrayFunction, PreciseFunction
from steadyslip.model.equations import Model
from steadyslip.model.point import OperatingPoint
from steadyslip.model.taylor import EPS, Index, arrangements, system
from steadyslip.nonlinear.onset.coefficient import even_scales

DIGITS = 50  # decimal digits, three times those of double precision: products of three doubles are exact
SETTLED = mpmath.mpf("1e-30")
"""Relative Newton step at which the iteration stops: the next step would be some nine decades smaller."""
STEPS = 40
"""Limit of Newton steps: enough if each step gains one digit; it gains as many as are correct in the matrix."""
NOTHING = 1e-20
"""c1 counts as zero below this share of its error in double precision; a vanishing c1 is computed as some 1e-34."""
STEP = 1e-6
"""Relative step of the central differences for the Jacobian, which then has nine correct digits."""
Numbers = list[Any]


class _NoConvergence(ArithmeticError):
    """Error: Newton's method does not converge, because the critical eigenvalue is multiple."""


def coefficient(
    point: OperatingPoint, along: str, omega: float, contact: int, vector: Array, error: float
) -> tuple[float, float] | None:
    """c1 (1/s) of one rig on an oscillatory edge, and a bound of its change if the rig's numbers are rounded (1/s).

    Parameters
    ----------
    point : OperatingPoint
        One rig, arrays of length 1.
    along : str
        Model parameter that is solved for, so that the rig lies on the edge.
    omega : float
        Angular frequency, rad/s.
    contact : int
        Index of the contact to whose ln v amplitudes refer.
    vector : ndarray (n,)
        Critical eigenvector.
    error : float
        Error of c1 in double precision, 1/s.

    Returns
    -------
    tuple or None
        (0, 0) where c1 vanishes in exact arithmetic; None for rigs with a delay, where numbers overflow, and where the
        critical eigenvalue is multiple.
    """
    if point.model.delays:
        return None
    try:
        with mpmath.workdps(DIGITS), np.errstate(all="ignore"):
            rig = _Rig(point, along, omega, contact, vector)
            own = rig.coefficient(rig.arguments)
            if abs(own) <= NOTHING * error:
                return 0.0, 0.0
            signs = np.random.default_rng(1).choice((-1, 1), (2, len(rig.arguments)))
            moved = [
                rig.coefficient([one + int(s) * EPS * one for one, s in zip(rig.arguments, row, strict=True)])
                for row in signs
            ]
            return float(own), 2 * float(max(abs(one - own) for one in moved))
    except (ArithmeticError, ValueError, TypeError, np.linalg.LinAlgError):  # TypeError: a complex number compared
        return None


@cached
def _steady_residuals(model: Model) -> list[sp.Expr]:
    """Residuals of steady sliding: of normal stresses and of forces carried by links (cached)."""
    residuals = [contact.steady_stress - contact.sigma_ss for contact in model.contacts]
    carried = model.carried
    if carried is not None:
        for i, rest in enumerate(carried.rest):
            row = -rest
            for entries, values, sign in (
                (carried.matrix, carried.symbols, 1),
                (carried.friction, [model.steady[contact.friction] for contact in model.contacts], -1),
                (carried.normal, [contact.sigma_ss for contact in model.contacts], -1),
            ):
                row += sp.Add(*(sign * e * values[j] for (k, j), e in entries.items() if k == i))
            residuals.append(row)
    return residuals


@cached
def _linear(model: Model) -> tuple[sp.Expr, ...]:
    """Expressions of the model's first derivatives, of the residuals of steady sliding, and of slip rates (cached)."""
    found = system(model)
    speeds = [model.steady[contact.velocity] for contact in model.contacts]
    return (*found.expressions[: len(found.entries[0])], *_steady_residuals(model), *speeds)


@cached
def _functions(model: Model) -> tuple[ArrayFunction, PreciseFunction, PreciseFunction]:
    """Three compiled functions: `_linear` in double precision and to fifty digits, and higher derivatives (cached).

    Higher derivatives are computed to fifty digits.
    """
    higher = system(model).expressions[len(system(model).entries[0]) :]
    linear = _linear(model)
    return model.function(linear), PreciseFunction(model.arguments, linear), PreciseFunction(model.arguments, higher)


class _Rig:
    """One rig near its edge; steady sliding, edge and eigenvector are solved for together, to fifty digits."""

    def __init__(self, point: OperatingPoint, along: str, omega: float, contact: int, vector: Array) -> None:
        self.model, self.contact = point.model, contact
        self.system = system(point.model)
        self.ordinary, self.linear, self.higher = _functions(point.model)
        self.n, self.count = len(self.system.unknowns), len(point.arguments)
        numbers = [float(np.ravel(one)[0]) for one in (*point.arguments, *point.steady)]
        self.arguments = [mpmath.mpf(one) for one in numbers[: self.count]]
        self.along = list(point.model.parameters).index(along)
        self.fixed = self.system.place(point.model.contacts[contact].velocity)
        start = [*numbers[self.count :], numbers[self.along], omega, *vector.real, *vector.imag]
        self.start = [mpmath.mpf(float(one)) for one in start]
        self.newton = _Inverse(self._jacobian(np.array(start)))
        self.inverses: tuple[_Inverse, ...] = ()

    def coefficient(self, arguments: Numbers) -> Any:
        """c1 (1/s) for model arguments in fifty digits; the parameter `along` is solved for."""
        unknowns = self.newton.refined(lambda y: self._residuals(arguments, y), self.start)
        values, omega, q = self._split(arguments, unknowns)
        gradient = self._entries(self.linear(*values))
        second, third = self._higher(self.higher(*values))
        conjugate = [mpmath.conj(one) for one in q]
        oscillating = [mpmath.mpc(0, omega if i < self.system.dynamic else 0) for i in range(self.n)]
        moving = [one if i < self.system.dynamic else mpmath.mpf(0) for i, one in enumerate(q)]
        matrices = (
            [*gradient, *((i, i, -one) for i, one in enumerate(oscillating) if one)],
            gradient,
            [*gradient, *((i, i, -2 * one) for i, one in enumerate(oscillating) if one)],
        )
        # bordered system of the left eigenvector π: Aᵀ π + q* t = 0 and (M q)ᵀ π = 1, with t = 0
        n = self.n
        bordered = [(j, i, e) for i, j, e in matrices[0]]
        bordered += [(i, n, one) for i, one in enumerate(conjugate)] + [(n, i, one) for i, one in enumerate(moving)]
        sides = (
            [*[mpmath.mpf(0)] * n, mpmath.mpf(1)],
            [-one for one in second(q, conjugate)],
            [-one for one in second(q, q)],
        )
        systems = list(zip((bordered, *matrices[1:]), sides, strict=True))
        if not self.inverses:
            self.inverses = tuple(_Inverse(_dense(matrix, len(side))) for matrix, side in systems)
        left, mean, double = (own.solved(*one) for own, one in zip(self.inverses, systems, strict=True))
        parts = zip(third(q, q, conjugate), second(q, mean), second(conjugate, double), strict=True)
        total = mpmath.fsum(mpmath.re(p * (a + 2 * b + c)) for p, (a, b, c) in zip(left[:n], parts, strict=True))
        return total / 2

    def _split(self, arguments: Numbers, y: Numbers) -> tuple[Numbers, Any, Numbers]:
        """Split the unknowns `y` into arguments of the functions, the frequency (rad/s) and the eigenvector."""
        many = len(y) - 2 - 2 * self.n
        values = [*arguments, *y[:many]]
        values[self.along] = y[many]
        parts = y[many + 2 :]
        return values, y[many + 1], [mpmath.mpc(a, b) for a, b in zip(parts[: self.n], parts[self.n :], strict=True)]

    def _residuals(self, arguments: Numbers, y: Numbers) -> Numbers:
        """Residuals of steady sliding, of (G − iωM) q = 0 and of the amplitude; there are as many as unknowns."""
        values, omega, q = self._split(arguments, y)
        found = self.linear(*values)
        rows = _times(self._entries(found), q, self.n)
        for i in range(self.system.dynamic):
            rows[i] -= mpmath.mpc(0, omega) * q[i]
        first, contacts = len(self.system.entries[0]), len(self.model.contacts)
        amplitude = q[self.fixed] - found[len(found) - contacts + self.contact] / 2
        rows.append(amplitude)
        return [*found[first : len(found) - contacts], *map(mpmath.re, rows), *map(mpmath.im, rows)]

    def _jacobian(self, y: Array) -> Array:
        """Jacobian of `_residuals` in double precision; columns of parameters of the rig are finite differences."""
        n, many = self.n, len(y) - 2 - 2 * self.n
        dynamic, first = self.system.dynamic, len(self.system.entries[0])
        base = np.array([*map(float, self.arguments), *y[:many]])
        places = [*range(self.count, self.count + many), self.along]
        steps = STEP * np.where(base[places] == 0, 1.0, np.abs(base[places]))
        rows = np.tile(base, (2 * len(places) + 1, 1))
        for i, (place, step) in enumerate(zip(places, steps, strict=True)):
            rows[1 + 2 * i, place] += step
            rows[2 + 2 * i, place] -= step
        table = np.stack([np.broadcast_to(e, len(rows)) for e in self.ordinary(*rows.T)])
        slopes = (table[:, 1::2] - table[:, 2::2]) / (2 * steps)
        steady = len(table) - first - len(self.model.contacts)
        q = y[many + 2 : many + 2 + n] + 1j * y[many + 2 + n :]
        gradient = np.zeros((n, n), dtype=complex)
        moved = np.zeros((n + 1, many + 1), dtype=complex)
        for e, (i, j) in enumerate(self.system.entries[0]):
            gradient[i, j] = table[e, 0]
            moved[i] += slopes[e] * q[j]
        moved[n] = -slopes[first + steady + self.contact] / 2
        critical = np.concatenate([gradient, np.zeros((1, n))])
        critical[range(dynamic), range(dynamic)] -= 1j * y[many + 1]
        critical[n, self.fixed] = 1.0
        turned = np.zeros((n + 1, 1), dtype=complex)
        turned[:dynamic, 0] = -1j * q[:dynamic]
        below = np.concatenate([moved, turned, critical, 1j * critical], axis=1)
        above = np.concatenate([slopes[first : first + steady], np.zeros((steady, 1 + 2 * n))], axis=1)
        return np.concatenate([above, below.real, below.imag])

    def _entries(self, found: Numbers) -> list[tuple[int, int, Any]]:
        """Non-zero entries (row, column, value) of the matrix of first derivatives."""
        return [(i, j, e) for (i, j), e in zip(self.system.entries[0], found, strict=False)]

    def _higher(self, found: Numbers) -> tuple[Callable[..., Numbers], Callable[..., Numbers]]:
        """Second and third derivatives as multilinear functions of direction vectors (n,)."""
        second = list(zip(self.system.entries[1], found, strict=False))
        third = list(zip(self.system.entries[2], found[len(second) :], strict=True))
        return lambda *u: _applied(second, u, self.n), lambda *u: _applied(third, u, self.n)


def _applied(entries: Sequence[tuple[Index, Any]], directions: Sequence[Numbers], n: int) -> Numbers:
    """Product (n,) of a symmetric derivative tensor, given by its distinct entries, with direction vectors (n,)."""
    out = [mpmath.mpf(0)] * n
    for (row, *index), value in entries:
        for arranged in arrangements(*index):
            product = value
            for direction, place in zip(directions, arranged, strict=True):
                product = product * direction[place]
            out[row] = out[row] + product
    return out


def _times(entries: Sequence[tuple[int, int, Any]], x: Numbers, n: int) -> Numbers:
    """Product of a sparse matrix, given by entries, and a vector of n numbers."""
    out = [mpmath.mpf(0)] * n
    for i, j, e in entries:
        out[i] = out[i] + e * x[j]
    return out


def _dense(entries: Sequence[tuple[int, int, Any]], n: int) -> Array:
    """Dense complex matrix (n, n) from entries."""
    found = np.zeros((n, n), dtype=complex)
    for i, j, e in entries:
        found[i, j] += complex(e)
    return found


class _Inverse:
    """Inverse of a matrix in double precision, used to solve equations to fifty digits by iterative refinement."""

    def __init__(self, matrix: Array) -> None:
        rows, columns = even_scales(np.abs(matrix)[None])
        self.rows, self.columns = rows[0], columns[0]
        self.inverse = np.linalg.inv(self.rows[:, None] * matrix * self.columns)

    def refined(self, residuals: Callable[[Numbers], Numbers], start: Numbers) -> Numbers:
        """Zero of the residuals near `start`, to fifty digits, found by Newton steps with this inverse matrix.

        Raises
        ------
        _NoConvergence
            If the steps do not become smaller than `SETTLED`.
        """
        found = list(start)
        rows, columns = ([mpmath.mpf(float(one)) for one in own] for own in (self.rows, self.columns))
        for _ in range(STEPS):
            missed = [row * own for row, own in zip(rows, residuals(found), strict=True)]
            largest = max(map(abs, missed))
            if not mpmath.isfinite(largest):
                raise _NoConvergence
            if largest == 0:
                return found
            step = self.inverse @ np.array([complex(one / largest) for one in missed])
            taken = step if np.iscomplexobj(self.inverse) else step.real
            found = [
                own - largest * column * one for own, column, one in zip(found, columns, taken.tolist(), strict=True)
            ]
            size = max(abs(complex(own / column)) for own, column in zip(found, columns, strict=True))
            if largest * float(np.max(np.abs(step))) <= SETTLED * size:
                return found
        raise _NoConvergence

    def solved(self, matrix: Sequence[tuple[int, int, Any]], right: Numbers) -> Numbers:
        """Solution of linear equations whose matrix (sparse entries) equals the inverted one up to rounding."""
        n = len(right)

        def missed(x: Numbers) -> Numbers:
            return [own - side for own, side in zip(_times(matrix, x, n), right, strict=True)]

        return self.refined(missed, [mpmath.mpf(0)] * n)
