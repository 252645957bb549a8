"""Linearised machine given by matrices: E z' = A z, its eigenvalues, and its resolvent.

The states z are displacements q, velocities q', memory variables, states of contact laws, and the integral of a
controller. Stresses of contacts are eliminated contact by contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.model.numeric.balance import Balance, state_of
from steadyslip.model.numeric.contact_laws import Slopes
from steadyslip.model.numeric.machine_matrices import MachineMatrices, Site

ComplexArray = NDArray[np.complex128]

_MASSLESS = 1e-12  # relative singular value of the scaled inertia matrix up to which a motion counts as massless
_INFINITE = 1e-9  # 1/eigenvalue, scaled by typical frequencies, below which the eigenvalue is infinite; QZ loses digits
_TRUSTED = 1e-8  # relative error of the resolvent by eigenvectors, above which equations are solved instead
_SPOILT = 1e8  # condition of E above which division by E loses half of the digits
_INVERSE_STEPS = 3  # steps of inverse iteration; one step is enough if no other eigenvalue is near
_MARGIN = 10.0  # real part over its rounding error above which the sign of the real part is certain
_SURE = 1e-9  # real part, relative to the largest eigenvalue, above which rounding cannot change its sign
_ASIDE = 1e-12  # relative shift of s off an undamped mode; the response of this mode still exceeds all others
_PLAIN, _ADJOINT = 0, 2  # codes of LAPACK for equations with the matrix itself, and with its adjoint
ILL_POSED, UNDECIDED = -1, -2  # values that stand for a number of growing eigenvalues that cannot be given
_BATCH = 2**22  # most complex numbers in matrices whose equations are solved together: 64 MiB


@dataclass(frozen=True, eq=False)
class StatePencil:
    """Linearised equations E z' = A z of one machine.

    Attributes
    ----------
    e, a : ndarray (N, N)
    size : int
        Number of coordinates n; z has n displacements, then n velocities.
    posed : bool
        False if the equations of a contact are ill-posed: any small lag would make disturbances grow.
    """

    e: Array
    a: Array
    size: int
    posed: bool

    @cached_property
    def scale(self) -> tuple[Array, Array]:
        """Factors of rows and of columns after which all rows and columns of the pencil have similar size.

        Displacements are multiplied by a frequency, and then compare with velocities.
        """
        return _even(self.e, self.a, self.size)

    @cached_property
    def inertial(self) -> bool:
        """True if E can be inverted, that is, if every coordinate has inertia.

        Besides the inertia, E has ones on its diagonal, and below it the effect of accelerations on rates of memory
        variables.
        """
        from scipy.linalg import lapack  # slow to import

        moving = slice(self.size, 2 * self.size)
        rows, columns = self.scale
        even = self.e[moving, moving] * rows[moving, None] * columns[moving]
        factors, _, _ = lapack.dgetrf(even)
        estimate, _ = lapack.dgecon(factors, np.max(np.sum(np.abs(even), axis=0)))
        # norms are sums of entries: up to n times the singular values, which take longer
        if estimate > _MASSLESS * len(even):
            return True
        sizes = np.linalg.svd(even, compute_uv=False)
        return bool(sizes[-1] > _MASSLESS * sizes[0])

    @cached_property
    def _standard(self) -> tuple[Array, Array, Array]:
        """State matrix in modal coordinates, and the matrices that convert its states to z, and rows of E to its
        rates."""
        basis, left = self._modal_basis()
        at, moving, rest = slice(self.size), slice(self.size, 2 * self.size), slice(2 * self.size, None)
        left[at, at] = np.linalg.solve(left[at, at] @ basis[at, at], left[at, at])  # E is the identity there
        inertia = left[moving, moving] @ self.e[moving, moving] @ basis[moving, moving]
        left[moving, moving] = np.linalg.solve(inertia, left[moving, moving])
        left[rest, moving] = -(left[rest, rest] @ self.e[rest, moving]) @ basis[moving, moving] @ left[moving, moving]
        state = np.zeros(self.a.shape)
        state[at, moving] = left[at, at] @ basis[moving, moving]
        pushed = self.a[self.size :]
        pushed = np.hstack([pushed[:, part] @ basis[part, part] for part in (at, moving, rest)])
        state[moving] = left[moving, moving] @ pushed[: self.size]
        state[rest] = left[rest, moving] @ pushed[: self.size] + left[rest, rest] @ pushed[self.size :]
        return state, basis, left

    def _modal_basis(self) -> tuple[Array, Array]:
        """Matrices that convert modal states to z, and rows of the pencil to modal rows.

        Modes are those of the symmetric parts of stiffness and inertia; displacements are multiplied by their
        frequency. The lowest mode of a structure is then as accurate as the highest. If there are no such modes, the
        pencil is only scaled.
        """
        size, at, moving = self.size, slice(self.size), slice(self.size, 2 * self.size)
        mass, stiffness = (0.5 * (m + m.T) for m in (self.e[moving, moving], -self.a[moving, at]))
        try:
            from scipy.linalg import eigh  # slow to import

            squares, shapes = eigh(stiffness, mass)
        except np.linalg.LinAlgError:
            rows, columns = self.scale
            return np.diag(columns), np.diag(rows)
        own = np.sqrt(np.abs(squares))
        omega = np.where(own > 1e-6 * np.max(own), own, 1e-6 * np.max(own) or 1.0)  # rigid motions
        basis, left = np.zeros((2, *self.e.shape))
        basis[at, at], basis[moving, moving] = shapes / omega, shapes
        left[at, at], left[moving, moving] = omega[:, None] * (shapes.T @ mass), shapes.T
        rest = range(2 * size, len(self.e))
        inside = np.abs(self.a[2 * size :, : 2 * size] @ basis[: 2 * size]).max(axis=1, initial=0.0)
        outside = np.abs(left @ self.a[:, 2 * size :]).max(axis=0, initial=0.0)
        both = np.where((inside > 0) & (outside > 0), np.sqrt(inside / np.where(outside > 0, outside, 1.0)), 1.0)
        basis[rest, rest], left[rest, rest] = both, 1 / both
        return basis, left

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Finite eigenvalues (1/s), by falling real part."""
        found = np.linalg.eigvals(self._standard[0]) + 0j if self.inertial else _finite_eigenvalues(self)
        upper = found[found.imag > 0]
        if 2 * len(upper) == np.count_nonzero(found.imag):  # QZ gives conjugate eigenvalues that differ by rounding
            found = np.concatenate([upper, upper.conj(), found[found.imag == 0]])
        return found[np.lexsort((-found.imag, -found.real))]

    @cached_property
    def _decomposed(self) -> tuple[ComplexArray, ComplexArray, ComplexArray] | None:
        """Eigenvalues, right vectors in z and left vectors in rows of E.

        None if they do not reproduce the resolvent.
        """
        if not self.inertial:
            return None
        state, basis, left = self._standard
        values, vectors = np.linalg.eig(state)
        try:
            other = np.linalg.inv(vectors)
        except np.linalg.LinAlgError:
            return None
        right, rows = basis @ vectors, other @ left
        probe = np.linspace(-1.0, 1.0, len(state))
        # not at the median itself, which is a mode
        for s in (1.1j * np.median(np.abs(values)), 0.1j * np.max(np.abs(values))):
            fast, slow = right @ ((rows @ probe) / (s - values)), self._solved(np.array([s]), probe[:, None])[0, :, 0]
            if not np.allclose(fast * 1, slow, rtol=0, atol=_TRUSTED * np.max(np.abs(slow))):
                return None
        return values, right, rows

    def growing(self, sure: bool) -> int:
        """Number of eigenvalues with positive real part.

        `ILL_POSED` or, if `sure`, `UNDECIDED` where rounding hides a sign.
        """
        if not self.posed:
            return ILL_POSED
        roots = self.eigenvalues
        if not sure:
            return int(np.sum(roots.real > 0))
        near = roots[(roots.imag >= 0) & (np.abs(roots.real) <= _SURE * np.max(np.abs(roots), initial=0.0))]
        if any(self.error(complex(s)) >= abs(s.real) for s in near):
            return UNDECIDED
        return int(np.sum(roots.real > 0))

    def vectors(self, s: complex) -> tuple[ComplexArray, ComplexArray]:
        """Left and right null vectors of s E − A, (N,) each, for an eigenvalue s (1/s), by inverse iteration."""
        rows, columns = self.scale
        solved, found = self._solver(s), []
        for way in (_ADJOINT, _PLAIN):
            one = np.random.default_rng(0).standard_normal(len(rows)) + 0j
            for _ in range(_INVERSE_STEPS):
                one, _ = solved(one, way)
            found.append(one)
        return found[0].conj() * rows, found[1] * columns

    def _solver(self, s: complex) -> Callable[[NDArray[Any], int], tuple[NDArray[Any], float]]:
        """Function that solves equations with the scaled matrix s E − A.

        It returns unit vectors and their lengths before.
        """
        from scipy.linalg import lapack  # slow to import

        rows, columns = self.scale
        factors, pivots, _ = lapack.zgetrf(rows[:, None] * (s * self.e - self.a) * columns)
        diagonal = np.einsum("ii->i", factors)
        last, largest = np.finfo(float).eps, np.max(np.abs(diagonal), initial=0.0)
        diagonal[np.abs(diagonal) < last**2 * largest] = last * largest  # s is an eigenvalue to the last digit

        def solved(right: NDArray[Any], way: int) -> tuple[NDArray[Any], float]:
            found = lapack.zgetrs(factors, pivots, right, trans=way)[0]
            largest = np.max(np.abs(found))
            found /= largest
            size = np.linalg.norm(found)
            return found / size, float(largest * size)

        return solved

    def mode(self, s: complex) -> ComplexArray:
        """Right null vector of s E − A, (N,), for an eigenvalue s (1/s)."""
        return self.vectors(s)[1]

    def error(self, s: complex) -> float:
        """Distance (1/s) of `s` from an eigenvalue, by one step of inverse iteration on the matrices themselves.

        The result does not depend on how the eigenvalue was found. It uses the singular vectors of least singular
        value.
        """
        rows, columns = self.scale
        solved, size = self._solver(s), np.inf
        right = np.random.default_rng(0).standard_normal(len(rows)) + 0j
        for _ in range(_INVERSE_STEPS):
            left, _ = solved(right, _ADJOINT)
            right, size = solved(left, _PLAIN)
        slope = abs(left.conj() @ (rows * real_product(self.e, columns * right)))
        return float(1 / (size * slope)) if slope else np.inf

    def resolvent(self, out: Array, into: Array) -> Callable[[ComplexArray], ComplexArray]:
        """Function of s (p,) that returns `out`ᵀ (s E − A)⁻¹ `into`, (p, k, m), for `out` (N, k) and `into` (N, m)."""
        known = self._decomposed
        if known is not None:
            values, right, rows = known
            left, tail = out.T @ right, rows @ into

            def by_modes(s: ComplexArray) -> ComplexArray:
                apart = s[:, None, None] - values
                if not np.all(apart):
                    apart = np.where(apart == 0, _ASIDE * s[:, None, None], apart)
                return np.asarray((left / apart) @ tail)

            return by_modes

        def solved(s: ComplexArray) -> ComplexArray:
            found = np.empty((len(s), out.shape[1], into.shape[1]), dtype=complex)
            step = max(_BATCH // self.a.size, 1)
            for start in range(0, len(s), step):
                found[start : start + step] = out.T @ self._solved(s[start : start + step], into)
            return found

        return solved

    def _solved(self, s: ComplexArray, right: Array) -> ComplexArray:
        """Products (p, N, m) of (s E − A)⁻¹ and `right` (N, m) at s (p,).

        An s that is an eigenvalue is slightly shifted.
        """
        matrices = s[:, None, None] * self.e - self.a
        try:
            return np.asarray(np.linalg.solve(matrices, np.broadcast_to(right, (len(s), *right.shape))))
        except np.linalg.LinAlgError:
            sign, _ = np.linalg.slogdet(matrices)
            matrices[sign == 0] += _ASIDE * s[sign == 0, None, None] * self.e
            return np.asarray(np.linalg.solve(matrices, np.broadcast_to(right, (len(s), *right.shape))))


def real_product(matrix: Array, vector: NDArray[Any]) -> ComplexArray:
    """Product of a real matrix (n, n) and a complex vector (n,), without a complex copy of the matrix."""
    found = matrix @ vector.view(float).reshape(-1, 2)
    return np.asarray(found).view(complex)[:, 0]


def _even(e: Array, a: Array, size: int) -> tuple[Array, Array]:
    """Factors (..., N) of rows and of columns that give all rows and columns of pencils (..., N, N) similar size.

    All displacements of a machine are multiplied by one frequency; then every row and column is scaled to size one.
    """
    inertia = np.abs(np.diagonal(e, axis1=-2, axis2=-1)[..., size : 2 * size])
    springs = np.abs(np.diagonal(a[..., size : 2 * size, :size], axis1=-2, axis2=-1))
    some = (inertia > 0) & (springs > 0)
    squares = np.where(some, springs / np.where(some, inertia, 1.0), np.nan)
    squares = np.where(np.any(some, axis=-1)[..., None], squares, 1.0)
    omega = np.sqrt(np.nanmedian(squares, axis=-1))[..., None, None]
    both = np.abs(e) * omega + np.abs(a)
    rows, columns = np.ones(e.shape[:-1]), np.ones(e.shape[:-1])
    for _ in range(4):  # each round of scaling halves the differences in size
        for factors, axis in ((rows, -1), (columns, -2)):
            by = 1 / np.sqrt(np.maximum(np.max(both, axis=axis), 1e-300))
            factors *= by
            both *= np.expand_dims(by, axis)
    return rows, columns


def _finite_eigenvalues(pencil: StatePencil) -> ComplexArray:
    """Finite eigenvalues of a pencil whose E is singular, by QZ after the bodies without inertia are eliminated."""
    from scipy.linalg import eig  # slow to import

    rows, columns = pencil.scale
    e, a = (rows[:, None] * m * columns for m in (pencil.e, pencil.a))
    alpha, beta = eig(a, e, right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > _INFINITE * np.abs(alpha) * np.max(np.abs(e)) / np.max(np.abs(a))
    return np.asarray(alpha[finite] / beta[finite])


# --- from matrices and laws ------------------------------------------------------------------------------------------


def linearised(machine: MachineMatrices, found: Balance) -> StatePencil:
    """Pencil of one machine at steady sliding."""
    e, a, posed = pencils(machine, found)
    return StatePencil(e, a, len(machine.names), bool(posed))


def pencils(machine: MachineMatrices, found: Balance) -> tuple[Array, Array, NDArray[np.bool_]]:
    """E and A (..., N, N) of machines at steady sliding, and True (...) where the equations of all contacts are
    well-posed."""
    n, several = len(machine.names), machine.several
    kept = [len(site.laws.memory) + len(site.laws.states) for site in machine.sites]
    size = 2 * n + sum(kept) + machine.integrates
    e, a = np.zeros((*several, size, size)), np.zeros((*several, size, size))
    at, moving = slice(0, n), slice(n, 2 * n)
    e[...] = np.eye(size)
    e[..., moving, moving] = machine.mass
    a[..., at, moving] = np.eye(n)
    a[..., moving, at], a[..., moving, moving] = -machine.stiffness, -machine.damping
    if machine.integrates:
        a[..., moving, -1], a[..., -1, at] = -machine.integral_acts, machine.integral_senses
    posed, start = np.ones(several, bool), 2 * n
    for i, (site, count) in enumerate(zip(machine.sites, kept, strict=True)):
        slopes = site.laws.slopes(site.own, *state_of(site, found, i, machine.speeds))
        posed &= _add_contact(e, a, site, slopes, n, slice(start, start + count), machine.integrates)
        start += count
    inertia = e[..., moving, moving]
    finite = np.all(np.isfinite(inertia), axis=(-2, -1))
    sign, _ = np.linalg.slogdet(np.where(finite[..., None, None], inertia, np.eye(n)))
    return e, a, posed & finite & (sign >= 0)


def _flat(rows: Array) -> Array:
    return np.reshape(rows, (-1, np.shape(rows)[-1]))


def _add_contact(
    e: Array, a: Array, site: Site, slopes: Slopes, n: int, own: slice, integrates: bool
) -> NDArray[np.bool_]:
    """Add the forces and memory variables of one contact to pencils.

    False (...) where the contact's equations are ill-posed.

    τ = s_v v + s_σ σ + s_τ τ + s_m m and σ = n_x x + ... + n_τ τ are solved for both stresses first.
    """
    several, width = a.shape[:-2], a.shape[-1]
    many = len(site.laws.memory)
    memory, states = slice(own.start, own.start + many), slice(own.start + many, own.stop)
    at, moving = slice(0, n), slice(n, 2 * n)

    def of_motion(row: Array) -> Array:
        """Combination of states with the derivatives `row` for x, v, v̇ (left out), T, τ (left out), distance and
        its rate."""
        found = np.zeros((*several, width))
        share = np.moveaxis(row, -1, 0)[..., None]
        found[..., at] = share[0] * site.slip + share[3] * site.pull + share[5] * site.apart
        found[..., moving] = share[1] * site.slip + share[3] * site.pull_rate + share[6] * site.apart
        found[..., states] = row[..., 7:]
        if integrates:
            found[..., -1] += row[..., 3] * site.pull_integral
        return found

    by = np.moveaxis(slopes.strength, -1, 0)
    friction, normal = np.zeros((*several, width)), of_motion(slopes.normal)
    friction[..., moving], friction[..., memory] = by[0][..., None] * site.slip, slopes.strength[..., 3:]
    of_friction, of_acceleration = slopes.normal[..., 4], slopes.normal[..., 2]
    determinant = np.broadcast_to(1 - by[2] - by[1] * of_friction, several)
    solved = 1 / determinant  # infinite where ill-posed
    tau = solved[..., None] * (friction + by[1][..., None] * normal)  # coefficients of the states z
    sigma = solved[..., None] * (of_friction[..., None] * friction + (1 - by[2])[..., None] * normal)
    late_tau, late_sigma = solved * by[1] * of_acceleration, solved * (1 - by[2]) * of_acceleration
    area = np.asarray(site.area)[..., None, None]
    felt = np.flatnonzero(np.any(_flat(site.apart) != 0, axis=0) | np.any(_flat(site.slip) != 0, axis=0))
    apart, slip = site.apart[..., felt], site.slip[..., felt]  # a contact acts on few of a structure's coordinates
    a[..., n + felt, :] += area * (apart[..., :, None] * sigma[..., None, :] - slip[..., :, None] * tau[..., None, :])
    pushed = late_sigma[..., None] * apart - late_tau[..., None] * slip
    e[..., n + felt, moving] -= area * pushed[..., :, None] * site.slip[..., None, :]
    for j, place in enumerate(range(memory.start, memory.stop)):
        row = slopes.rates[..., j, :]
        of_v, of_sigma, of_tau = (row[..., k, None] for k in range(3))
        a[..., place, moving] += of_v * site.slip
        a[..., place, memory] += row[..., 3:]
        a[..., place, :] += of_sigma * sigma + of_tau * tau
        e[..., place, moving] -= (of_sigma * late_sigma[..., None] + of_tau * late_tau[..., None]) * site.slip
    for j, place in enumerate(range(states.start, states.stop)):
        row = slopes.state_rates[..., j, :]
        a[..., place, :] += of_motion(row) + row[..., 4, None] * tau
        e[..., place, moving] -= (row[..., 2, None] + row[..., 4, None] * late_tau[..., None]) * site.slip
    return np.asarray(determinant > 0)


def growing_roots(e: Array, a: Array, size: int, posed: NDArray[np.bool_], sure: bool) -> NDArray[np.int64]:
    """Number of growing eigenvalues of pencils (p, N, N), (p,); or a code as in `StatePencil.growing`.

    Matrices are divided by E, all at once, where this loses no digits that matter for the signs of real parts; other
    pencils are treated one by one.
    """
    good = posed & np.all(np.isfinite(a) & np.isfinite(e), axis=(-2, -1))
    found = np.where(posed, UNDECIDED, ILL_POSED)
    at = np.flatnonzero(good)
    if not at.size:
        return found
    rows, columns = _even(e[at], a[at], size)
    even, other = (rows[..., None] * one[at] * columns[:, None, :] for one in (e, a))
    condition = np.linalg.cond(even)
    regular = condition < _SPOILT
    roots = np.linalg.eigvals(np.linalg.solve(np.where(regular[:, None, None], even, np.eye(len(even[0]))), other))
    doubt = condition * np.finfo(float).eps * len(even[0]) * np.max(np.abs(roots), axis=-1)
    clear = regular & np.all(np.abs(roots.real) > _MARGIN * doubt[:, None], axis=-1)
    found[at] = np.sum(roots.real > 0, axis=-1)
    for i in at[~clear]:
        found[i] = StatePencil(e[i], a[i], size, True).growing(sure)
    return found
