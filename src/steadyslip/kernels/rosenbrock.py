"""Sparse LU solution of the linear equations of a Rosenbrock method; no operations for structural zeros."""

from __future__ import annotations

from collections.abc import Sequence

from steadyslip.kernels.nodes import Value

Pattern = set[tuple[int, int]]
Matrix = dict[tuple[int, int], Value]


def factorised(order: Sequence[int], jacobian: Matrix, diagonal: Value) -> tuple[Matrix, dict[int, Value]]:
    """LU factors of `diagonal` I − J and inverse pivots, with elimination in a given `order`.

    There is no pivoting, because the diagonal dominates for steps that are accepted.
    """
    filled: Matrix = {place: -value for place, value in jacobian.items() if place[0] != place[1]}
    filled |= {(i, i): diagonal - jacobian[i, i] if (i, i) in jacobian else diagonal for i in order}
    pivots: dict[int, Value] = {}
    for place, k in enumerate(order, start=1):
        pivots[k] = 1.0 / filled[k, k]
        for i in order[place:]:
            if (i, k) not in filled:
                continue
            filled[i, k] = filled[i, k] * pivots[k]
            for c in order[place:]:
                if (k, c) in filled:
                    product = filled[i, k] * filled[k, c]
                    filled[i, c] = filled[i, c] - product if (i, c) in filled else -product
    return filled, pivots


def substituted(matrix: tuple[Matrix, dict[int, Value]], right: Sequence[Value]) -> list[Value]:
    """Solution for one right-hand side, by substitution in the result of `factorised`."""
    filled, pivots = matrix
    order = list(pivots)
    r = list(right)
    for place, i in enumerate(order):
        for k in order[:place]:
            if (i, k) in filled:
                r[i] = r[i] - filled[i, k] * r[k]
    u: list[Value] = [0.0] * len(order)
    for place, i in reversed(list(enumerate(order, start=1))):
        known = r[i]
        for k in order[place:]:
            if (i, k) in filled:
                known = known - filled[i, k] * u[k]
        u[i] = known * pivots[i]
    return u
