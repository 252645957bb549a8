"""Numerical characteristic polynomial from eigenvalues, for machines whose symbolic coefficients are too long.

The roots are the eigenvalues of the state matrix; the leading coefficient follows from the determinant of the
characteristic matrix at one real s. Structural cancellations are subject to rounding here.
"""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.questions import question
from steadyslip.model.descriptor import blocks_of, descriptor
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_rows, is_written_out, sets_of_delays
from steadyslip.model.point import OperatingPoint, stacked

Delays = tuple[sp.Expr, ...]

MOVED = 1e-6
"""Share of an eigenvalue by which rounding may move it: as much as a check of eigenvalues allows."""
_ROUNDING = 4 * np.finfo(float).eps  # relative, of what a few operations make of the rig's numbers


@question
def coefficients_from_eigenvalues(point: OperatingPoint) -> list[Array]:
    """Coefficients of the polynomial of each term of the characteristic equation, (..., n+1), lowest power first.

    Terms are ordered as in `steadyslip.model.linearisation.sets_of_delays`. The determinant is linear in each
    exp(−s delay), so the terms are differences of determinants with and without each delayed action.
    """
    sets = sets_of_delays(point.model)
    whole = {late: _polynomial(point, late) for late in sets}
    width = max(c.shape[-1] for c in whole.values())
    whole = {late: np.pad(c, [(0, 0)] * (c.ndim - 1) + [(0, width - c.shape[-1])]) for late, c in whole.items()}
    found = []
    for late in sets:
        inside = [own for own in sets if set(own) <= set(late)]
        found.append(np.sum([(-1) ** (len(late) - len(own)) * whole[own] for own in inside], axis=0))
    return found


@question
def eigenvalues_of(point: OperatingPoint, late: Delays = ()) -> NDArray[np.complex128]:
    """Eigenvalues (1/s), (..., n), by falling real part.

    Terms with the delays `late` act without delay, other delayed terms are left out. NaN without steady sliding, and as
    padding if massless bodies leave fewer states.
    """
    with np.errstate(all="ignore"):
        found = _eigenvalues(point, late)[0]
        order = np.lexsort((-found.imag, -found.real), axis=-1)
        return np.take_along_axis(found, order, axis=-1)


@question
def digits_lost(point: OperatingPoint) -> NDArray[np.bool_]:
    """True where rounding of the state matrix moves an eigenvalue by more than `MOVED` of it, (...).

    An entry of that matrix adds the stiffnesses of several links, so that rounding of the stiffest may hide others. To
    first order an eigenvalue moves by |w| |A| |v| times the relative rounding of A; w and v are its eigenvectors, with
    w v = 1. False where the characteristic polynomial is written out, or there are delays.
    """
    if point.model.delays or is_written_out(point.model):
        return np.zeros(point.shape, dtype=bool)
    with np.errstate(all="ignore"):
        found, sizes = _eigenvalues(point, ())
        return np.asarray(np.any(_ROUNDING * sizes > MOVED * np.abs(found), axis=-1))


def _polynomial(point: OperatingPoint, late: Delays) -> Array:
    """Polynomial coefficients (..., n+1) if terms with delays `late` act without delay and others are left out."""
    with np.errstate(all="ignore"):
        roots = eigenvalues_of(point, late)
        size = np.abs(roots)
        some = np.where(size > 0, size, 1.0)
        place = np.exp(np.mean(np.log(some), axis=-1)) if roots.shape[-1] else np.ones(point.shape)
        sign, logarithm = np.linalg.slogdet(_characteristic_matrix(point, late, place))
        apart = place[..., None] - roots
        logarithm = logarithm - np.sum(np.log(np.abs(apart)), axis=-1)
        sign = sign * np.prod(np.where(roots.imag == 0, np.sign(apart.real), 1.0), axis=-1)
        c = np.ones((*roots.shape[:-1], 1), dtype=complex)
        for i in range(roots.shape[-1]):
            up = np.concatenate([np.zeros_like(c[..., :1]), c], axis=-1)
            up[..., :-1] -= roots[..., i, None] * c
            c = up
        return np.asarray(c.real * (sign * np.exp(logarithm))[..., None])


@question
def _eigenvalues(point: OperatingPoint, late: Delays) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of the state matrix in any order, and by how much a relative change of its entries moves them."""
    blocks = blocks_of(point, (), (), late)
    rate_x, rate_z, balance_x, balance_z = (blocks[i] for i in (0, 2, 6, 8))  # in the order of `Descriptor`
    good = np.all([np.all(np.isfinite(one), axis=(-2, -1)) for one in (rate_x, rate_z, balance_x, balance_z)], axis=0)
    if all(one.inertial for one in point.model.coordinates):
        whole = np.where(good[..., None, None], balance_z, np.eye(balance_z.shape[-1]))
        good = good & (np.linalg.det(whole) != 0)
        whole = np.where(good[..., None, None], whole, np.eye(balance_z.shape[-1]))
        state = rate_x - rate_z @ np.linalg.solve(whole, np.where(good[..., None, None], balance_x, 0.0))
        good = good & np.all(np.isfinite(state), axis=(-2, -1))
        found, sizes = _of_matrix(np.where(good[..., None, None], state, 0.0))
        return np.where(good[..., None], found, np.nan), sizes
    flat = [block.reshape(good.size, *block.shape[-2:]) for block in blocks]
    rows = [_single_rig(point.model, [block[i] for block in flat]) if ok else None for i, ok in enumerate(good.ravel())]
    width = max((len(row[0]) for row in rows if row is not None), default=1)  # one NaN where none is known
    table, moved = np.full((len(rows), width), np.nan, dtype=complex), np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        if row is not None and len(row[0]) == width:
            table[i], moved[i] = row
    return table.reshape(*good.shape, width), moved.reshape(*good.shape, width)


def _of_matrix(a: Array) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of matrices (..., n, n), and by how much a relative change of all entries moves each, (..., n)."""
    found, right = np.linalg.eig(a)
    singular = np.linalg.det(right) == 0  # of an eigenvalue that is there twice with one eigenvector
    left = np.linalg.inv(np.where(singular[..., None, None], np.eye(a.shape[-1]), right))
    sizes = np.einsum("...ij,...jk,...ki->...i", np.abs(left), np.abs(a), np.abs(right))
    return found.astype(complex), np.where(singular[..., None], 0.0, sizes)


def _single_rig(model: Model, blocks: list[Array]) -> tuple[NDArray[np.complex128], Array] | None:
    """Eigenvalues of a single rig and how they move; None if the balances do not determine a finite motion."""
    try:
        a = descriptor(model, (), blocks).solved((), ()).a
    except NotAvailable:
        return None
    return _of_matrix(a) if np.all(np.isfinite(a)) else None


def _characteristic_matrix(point: OperatingPoint, late: Delays, place: Array) -> Array:
    """Characteristic matrix at real s = `place` (..., in 1/s), shape (..., n, n)."""
    function, entries = _entries(point.model, late)
    numbers = stacked(point.evaluate(function), point)
    n = 1 + max(row for row, _, _ in entries)
    found = np.zeros((*point.shape, n, n))
    for i, (row, column, power) in enumerate(entries):
        found[..., row, column] += numbers[..., i] * place**power
    good = np.all(np.isfinite(found), axis=(-2, -1))
    return np.where(good[..., None, None], found, np.nan)


@question
def _entries(model: Model, late: Delays) -> tuple[ArrayFunction, list[tuple[int, int, int]]]:
    """Array function of the nonzero entries of the characteristic matrix, and row, column and power of s of each."""
    wanted, places = [], []
    for i, row in enumerate(characteristic_rows(model).values()):
        for j, entry in enumerate(row):
            for powers, e in entry.items():
                if all(delay in late for delay, power in zip(model.delays, powers[1:], strict=True) if power):
                    wanted.append(e)
                    places.append((i, j, powers[0]))
    return model.function(wanted), places
