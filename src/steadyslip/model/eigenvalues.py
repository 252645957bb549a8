"""Numerical characteristic polynomial from eigenvalues, for machines whose symbolic coefficients are too long.

The roots are the eigenvalues of the state matrix; the leading coefficient follows from the determinant of the
characteristic matrix at one real s. Structural cancellations are subject to rounding here.

The descriptor system (differential-algebraic form) of the linearised rig has balances as algebraic equations, for
accelerations, friction stresses and velocities of massless bodies. If they are singular in these, as for a massless
body between two springs, they constrain displacements: one of the displacements is then no state, and the balance is
differentiated (index reduction).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.caching import cached
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import characteristic_rows, is_written_out, linearise, sets_of_delays
from steadyslip.model.point import OperatingPoint, stacked

ZERO_TOLERANCE = 1e-11  # an entry smaller than this share of the largest counts as 0 (sum that cancels); by trial
LEAST_PIVOT = 1e-6  # least pivot over the largest; elimination with a smaller pivot loses six of 16 digits; by trial
UNDETERMINED = "ill-posed: the balances of forces do not determine the motion"


@dataclass(frozen=True, eq=False)
class Matrices:
    """State-space matrices A, B, C, D, and the names of states, inputs and outputs."""

    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def blocks(self) -> tuple[Array, Array, Array, Array]:
        """Matrices A, B, C, D."""
        return self.a, self.b, self.c, self.d


@dataclass(frozen=True, eq=False)
class Descriptor:
    """Equations x' = A x + B u + C z, y = D x + E u + F z, 0 = P x + Q u + R z, with matrices in this order.

    x are the states, u the inputs, y the outputs, z the algebraic unknowns. `first` is True for the states that index
    reduction removes first if it can.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    first: Array
    rate_x: Array
    rate_u: Array
    rate_z: Array
    out_x: Array
    out_u: Array
    out_z: Array
    balance_x: Array
    balance_u: Array
    balance_z: Array

    def solved(self, outputs: tuple[str, ...], wanted: Sequence[str] | None) -> Matrices:
        """Reduce to state-space matrices.

        Inputs that would have to be differentiated are left out if `wanted` is None; otherwise, if they are wanted,
        NotAvailable is raised.
        """
        here, kept = self, list(self.inputs if wanted is None else wanted)
        for _ in range(len(self.states) + 1):
            bound = here._singular_balances()
            if bound is None:
                break
            rows, left = bound
            acts = np.abs(left @ here.balance_u) > ZERO_TOLERANCE * np.max(np.abs(left), axis=1)[:, None] * np.max(
                np.abs(np.concatenate([here.balance_u, here.balance_x], axis=1))
            )
            differentiated = [name for i, name in enumerate(here.inputs) if name in kept and np.any(acts[:, i])]
            if differentiated and wanted is not None:
                raise NotAvailable(
                    f"{differentiated[0]} moves a body without mass at once, so that velocities follow "
                    "from its rate and there is no state space; give the body a mass or a dashpot, or name other inputs"
                )
            kept = [name for name in kept if name not in differentiated]
            here = here._index_reduced(rows, left)
        else:
            raise NotAvailable(UNDETERMINED)
        of = [here.inputs.index(name) for name in kept]
        solved = -np.linalg.solve(here.balance_z, np.hstack([here.balance_x, here.balance_u]))
        by_x, by_u = solved[:, : len(here.states)], solved[:, len(here.states) :]
        return Matrices(
            here.rate_x + here.rate_z @ by_x, (here.rate_u + here.rate_z @ by_u)[:, of],
            here.out_x + here.out_z @ by_x, (here.out_u + here.out_z @ by_u)[:, of],
            here.states, tuple(kept), outputs,
        )  # fmt: skip

    def _singular_balances(self) -> tuple[NDArray[np.int64], Array] | None:
        """Combinations of balances in which z cancels: rows to be replaced, and coefficients.

        None if there are no such combinations.
        """
        matrix = self.balance_z
        rows = np.max(np.abs(np.hstack([matrix, self.balance_x])), axis=1)
        even = matrix / np.where(rows > 0, rows, 1.0)[:, None]
        columns = np.max(np.abs(even), axis=0)
        even = even / np.where(columns > 0, columns, 1.0)
        left, sizes, _ = np.linalg.svd(even)
        free = np.flatnonzero(sizes <= ZERO_TOLERANCE * max(float(np.max(sizes, initial=0.0)), 1.0))
        if not len(free):
            return None
        from scipy.linalg import qr  # slow to import

        combined = left[:, free].T
        gone = qr(combined, pivoting=True, mode="r")[-1][: len(free)]
        return np.asarray(gone, dtype=np.int64), combined / np.where(rows > 0, rows, 1.0)

    def _index_reduced(self, rows: NDArray[np.int64], left: Array) -> Descriptor:
        """The system with `rows` replaced by the time derivatives of the combinations `left`, and as many states
        removed."""
        constraint = left @ self.balance_x
        count, n = constraint.shape
        gone: list[int] = []
        work = constraint.copy()
        for i in range(count):  # Gauss elimination; the preferred states are pivots if large enough
            others = np.setdiff1d(np.arange(n), gone)
            best = np.max(np.abs(work[i:, others]), axis=0)
            if not np.any(best > 0):
                raise NotAvailable(UNDETERMINED)
            usable = best > LEAST_PIVOT * np.max(best)
            j = int(others[np.argmax(np.where(usable & self.first[others], np.inf, best))])
            row = i + int(np.argmax(np.abs(work[i:, j])))
            work[[i, row]] = work[[row, i]]
            work[i] /= work[i, j]
            below = np.arange(count) != i
            work[below] -= np.outer(work[below, j], work[i])
            gone.append(j)
        kept = [j for j in range(n) if j not in gone]
        whole = np.zeros((n, len(kept)))  # all states as linear functions of the remaining states
        whole[kept, range(len(kept))] = 1.0
        whole[gone] = -work[:, kept]
        others = np.delete(np.arange(len(self.balance_z)), rows)
        x, u, z = (
            np.vstack([old[others], constraint @ rate])
            for old, rate in (
                (self.balance_x, self.rate_x),
                (self.balance_u, self.rate_u),
                (self.balance_z, self.rate_z),
            )
        )
        return replace(
            self, rate_x=(self.rate_x @ whole)[kept], rate_u=self.rate_u[kept], rate_z=self.rate_z[kept],
            out_x=self.out_x @ whole, balance_x=x @ whole, balance_u=u, balance_z=z,
            states=tuple(self.states[j] for j in kept), first=self.first[kept],
        )  # fmt: skip


@cached
def block_function(
    model: Model, outputs: tuple[str, ...], inputs: tuple[str, ...], at_once: tuple[sp.Expr, ...] = ()
) -> tuple[ArrayFunction, list[tuple[int, int]]]:
    """Array function of the entries of a `Descriptor`'s nine blocks, and the shape of each block.

    Delayed terms whose delay is in `at_once` act without delay; other delayed terms are left out.
    """
    linear = linearise(model)
    variables = [item.symbol for item in model.variables]
    disturbances = [model.inputs[name] for name in inputs]
    accelerations = {one.velocity: one.acceleration for one in model.coordinates if one.velocity in variables}
    frictions = [contact.friction for contact in model.contacts if contact.unknown is contact.friction]
    speeds = [one.velocity for one in model.coordinates if one.velocity not in variables]
    unknowns = [*accelerations.values(), *speeds, *frictions]
    rates = [{accelerations[s]: sp.Integer(1)} if s in accelerations else linear.rows[s] for s in variables]
    forces = [linear.rows[one.velocity] for one in model.coordinates]
    laws = [linear.rows[friction] for friction in frictions]
    groups = (rates, [linear.outputs[name] for name in outputs], [*forces, *laws])
    columns: tuple[Sequence[sp.Symbol], ...] = (variables, disturbances, unknowns)
    now = [(base, late) for late, (base, delay) in model.late.items() if delay in at_once]

    def entry(row: Mapping[sp.Symbol, sp.Expr], column: sp.Symbol) -> sp.Expr:
        return sp.Add(row.get(column, sp.Integer(0)), *(row.get(late, 0) for base, late in now if base is column))

    entries = [entry(row, c) for group in groups for part in columns for row in group for c in part]
    shapes = [(len(group), len(part)) for group in groups for part in columns]
    return model.function(entries), shapes


def blocks_of(
    point: OperatingPoint, outputs: tuple[str, ...], inputs: tuple[str, ...], at_once: tuple[sp.Expr, ...] = ()
) -> list[Array]:
    """Values of the nine blocks of a `Descriptor` at a point, each of shape (..., rows, columns)."""
    function, shapes = block_function(point.model, outputs, inputs, at_once)
    with np.errstate(all="ignore"):
        found = stacked(point.evaluate(function), point)
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    parts = np.split(found, ends[:-1], axis=-1)
    return [part.reshape(*point.shape, *shape) for part, shape in zip(parts, shapes, strict=True)]


def descriptor(model: Model, inputs: tuple[str, ...], blocks: Sequence[Array]) -> Descriptor:
    """Make the `Descriptor` of one rig from its blocks."""
    massless = {one.displacement for one in model.coordinates if not one.inertial}
    first = np.array([item.symbol in massless for item in model.variables])
    return Descriptor(tuple(item.name for item in model.variables), inputs, first, *blocks)


Delays = tuple[sp.Expr, ...]

MOVED = 1e-6
"""Relative change of an eigenvalue by rounding that is accepted: the tolerance of the checks of eigenvalues."""
# relative error of matrix entries, which are made of parameters by a few operations
_ROUNDING = 4 * np.finfo(float).eps


@cached
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


@cached
def eigenvalues_of(point: OperatingPoint, late: Delays = ()) -> NDArray[np.complex128]:
    """Eigenvalues (1/s), shape (..., n), in order of decreasing real part.

    Terms with the delays `late` act without delay; other delayed terms are left out. NaN where there is no steady
    sliding, and as padding where massless bodies leave fewer states.
    """
    with np.errstate(all="ignore"):
        found = _eigenvalues(point, late)[0]
        order = np.lexsort((-found.imag, -found.real), axis=-1)
        return np.take_along_axis(found, order, axis=-1)


@cached
def digits_lost(point: OperatingPoint) -> NDArray[np.bool_]:
    """True for each rig where rounding of the state matrix A moves an eigenvalue by more than `MOVED` times its size.

    An entry of A is a sum of the stiffnesses of several links, in which rounding of the largest may hide the others. To
    first order an eigenvalue moves by |w| |A| |v| times the relative rounding of A, with left and right eigenvectors w
    and v, w v = 1. False if the characteristic polynomial is known in symbols, or if there are delays.
    """
    if point.model.delays or is_written_out(point.model):
        return np.zeros(point.shape, dtype=bool)
    with np.errstate(all="ignore"):
        found, sizes = _eigenvalues(point, ())
        return np.asarray(np.any(_ROUNDING * sizes > MOVED * np.abs(found), axis=-1))


def _polynomial(point: OperatingPoint, late: Delays) -> Array:
    """Polynomial coefficients (..., n+1) for the terms with delays `late`, which act without delay, and those
    without delay."""
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


@cached
def _eigenvalues(point: OperatingPoint, late: Delays) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of the state matrix (1/s), unordered, and the change of each per relative change of all entries."""
    blocks = blocks_of(point, (), (), late)
    rate_x, rate_z, balance_x, balance_z = (blocks[i] for i in (0, 2, 6, 8))  # in the order of `Descriptor`
    good = np.all([np.all(np.isfinite(one), axis=(-2, -1)) for one in (rate_x, rate_z, balance_x, balance_z)], axis=0)
    if all(one.inertial for one in point.model.coordinates):
        whole = np.where(good[..., None, None], balance_z, np.eye(balance_z.shape[-1]))
        good = good & (np.linalg.slogdet(whole)[0] != 0)  # the determinant itself may underflow
        whole = np.where(good[..., None, None], whole, np.eye(balance_z.shape[-1]))
        state = rate_x - rate_z @ np.linalg.solve(whole, np.where(good[..., None, None], balance_x, 0.0))
        good = good & np.all(np.isfinite(state), axis=(-2, -1))
        found, sizes = _of_matrix(np.where(good[..., None, None], state, 0.0))
        return np.where(good[..., None], found, np.nan), sizes
    flat = [block.reshape(good.size, *block.shape[-2:]) for block in blocks]
    rows = [_single_rig(point.model, [block[i] for block in flat]) if ok else None for i, ok in enumerate(good.ravel())]
    width = max((len(row[0]) for row in rows if row is not None), default=1)  # at least 1, for a column of NaN
    table, moved = np.full((len(rows), width), np.nan, dtype=complex), np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        if row is not None and len(row[0]) == width:
            table[i], moved[i] = row
    return table.reshape(*good.shape, width), moved.reshape(*good.shape, width)


def _of_matrix(a: Array) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of matrices (..., n, n), and the change of each per relative change of all entries, (..., n) each."""
    found, right = np.linalg.eig(a)
    singular = np.linalg.det(right) == 0  # a multiple eigenvalue with fewer eigenvectors
    left = np.linalg.inv(np.where(singular[..., None, None], np.eye(a.shape[-1]), right))
    sizes = np.einsum("...ij,...jk,...ki->...i", np.abs(left), np.abs(a), np.abs(right))
    return found.astype(complex), np.where(singular[..., None], 0.0, sizes)


def _single_rig(model: Model, blocks: list[Array]) -> tuple[NDArray[np.complex128], Array] | None:
    """Result of `_of_matrix` for a single rig; None if the balances do not determine a finite motion."""
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


@cached
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
