"""Numerical descriptor system (differential-algebraic form) of the linearised rig, and its state-space matrices.

The algebraic equations are the balances, for accelerations, friction stresses and velocities of massless bodies. If
they are singular in these, as for a massless body between two springs, they constrain displacements: one of those is
no state then, and the balance is differentiated (index reduction).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from steadyslip.core.arrays import Array
from steadyslip.core.errors import NotAvailable
from steadyslip.core.expressions import ArrayFunction
from steadyslip.core.questions import question
from steadyslip.model.equations import Model
from steadyslip.model.linearisation import linearise
from steadyslip.model.point import OperatingPoint, stacked

ZERO_TOLERANCE = 1e-11  # relative to the largest number; cancelled sums of some numbers leave less; chosen by trial
LEAST_PIVOT = 1e-6  # relative to the largest; a smaller pivot would lose six of 16 digits; chosen by trial
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
    """x' = A x + B u + C z, y = D x + E u + F z, 0 = P x + Q u + R z, in this order.

    x are the states, u the inputs, y the outputs, z the algebraic unknowns. `first` marks the x that index reduction
    preferably removes.
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
        """Combinations of balances in which z cancels: rows to replace, and coefficients; None if there are none."""
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
        """Replace `rows` by the time derivatives of the combinations `left`, and remove as many states."""
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
        whole = np.zeros((n, len(kept)))  # all x as linear functions of the remaining ones
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


@question
def block_function(
    model: Model, outputs: tuple[str, ...], inputs: tuple[str, ...], at_once: tuple[sp.Expr, ...] = ()
) -> tuple[ArrayFunction, list[tuple[int, int]]]:
    """Array function of the entries of a `Descriptor`'s nine blocks, and the shapes of the blocks.

    Terms with a delay in `at_once` act without delay, terms with another delay are left out.
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
    """Values of the nine blocks of a `Descriptor` at a point, each (..., rows, columns)."""
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
