"""Sparse LU solution of the linear equations of a Rosenbrock method, without structural zeros."""

from __future__ import annotations

from collections.abc import Sequence

from steadyslip.kernels.nodes import Value

Pattern = set[tuple[int, int]]
Matrix = dict[tuple[int, int], Value]


def factorised(n: int, jacobian: Matrix, diagonal: Value) -> tuple[Matrix, list[Value]]:
    """LU factors of `diagonal` I − J and inverse pivots; no pivoting: the diagonal dominates for accepted steps."""
    filled: Matrix = {place: -value for place, value in jacobian.items() if place[0] != place[1]}
    filled |= {(i, i): diagonal - jacobian[i, i] if (i, i) in jacobian else diagonal for i in range(n)}
    pivots: list[Value] = []
    for k in range(n):
        pivots.append(1.0 / filled[k, k])
        for i in range(k + 1, n):
            if (i, k) not in filled:
                continue
            filled[i, k] = filled[i, k] * pivots[k]
            for c in range(k + 1, n):
                if (k, c) in filled:
                    product = filled[i, k] * filled[k, c]
                    filled[i, c] = filled[i, c] - product if (i, c) in filled else -product
    return filled, pivots


def substituted(matrix: tuple[Matrix, list[Value]], right: Sequence[Value]) -> list[Value]:
    """Solution for one right side by substitution."""
    filled, pivots = matrix
    n = len(right)
    r = list(right)
    for i in range(1, n):
        for k in range(i):
            if (i, k) in filled:
                r[i] = r[i] - filled[i, k] * r[k]
    u: list[Value] = [0.0] * n
    for i in reversed(range(n)):
        known = r[i]
        for k in range(i + 1, n):
            if (i, k) in filled:
                known = known - filled[i, k] * u[k]
        u[i] = known * pivots[i]
    return u
