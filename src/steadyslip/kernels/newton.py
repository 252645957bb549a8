"""Newton's method with a fixed number of iterations for the unknowns of a Model, within a straight-line program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from steadyslip.core.errors import InternalError
from steadyslip.kernels.formulation import Formulation
from steadyslip.kernels.nodes import Loop, Node, Value, as_node, larger, select, smaller

NEWTON_STEPS = 6  # number of iterations from the solution at the last stage; by trial: each evaluates the residuals
MAX_LOG_STEP = 2.0  # largest change of ln v (or asinh v) in one iteration; chosen by trial to prevent overshoot

RTOL, ATOL = 1e-7, 1e-9  # converged if the last change is below RTOL |z| + ATOL scale; the error is near its square


def solved(
    kernel: Formulation, given: Mapping[str, Value], near: Sequence[Value], scales: Sequence[Value]
) -> list[Value]:
    """Values of the unknowns by Newton's method from the guesses `near`; all NaN if it does not converge."""
    residuals, n = kernel.residuals, kernel.unknowns
    if residuals is None:
        raise InternalError("a kernel with unknowns to have residuals")
    clamped = _clamped(kernel)

    def improved(*z: Node) -> tuple[Sequence[Value], Sequence[Value]]:
        found = residuals({**given, **kernel.named(z)})
        changes = eliminated(dict(zip(kernel.slopes, found[n:], strict=True)), found[:n])
        for k in clamped:
            changes[k] = smaller(larger(changes[k], -MAX_LOG_STEP), MAX_LOG_STEP)
        after = [own - change for own, change in zip(z, changes, strict=True)]
        return after, [*after, *changes]

    found = Loop(NEWTON_STEPS, near, improved).outcome()
    small = [
        abs(change) <= RTOL * abs(z) + ATOL * abs(as_node(scale))
        for z, change, scale in zip(found[:n], found[n:], scales, strict=True)
    ]
    good = small[0]
    for one in small[1:]:
        good = good & one
    return [select(good, z, float("nan")) for z in found[:n]]


def _clamped(kernel: Formulation) -> list[int]:
    """Indices of the unknowns that are a logarithm (or asinh) of a velocity; their Newton steps are limited."""
    reduction = kernel.reduction
    variables = [one.variable for one in reduction.slidings if one.variable is not None]
    own = {variable.w for variable in variables if variable.kind != "linear"}
    return [k for k, symbol in enumerate(reduction.unknowns) if symbol in own]


def eliminated(matrix: Mapping[tuple[int, int], Value], right: Sequence[Value]) -> list[Value]:
    """Solution of linear equations by elimination with partial pivoting; entries missing in `matrix` are zero."""
    n, right = len(right), list(right)
    rows = [{k: value for (i, k), value in matrix.items() if i == row} for row in range(n)]
    for k in range(n):
        below = [i for i in range(k + 1, n) if k in rows[i]]
        for i in below:
            if k not in rows[k]:
                rows[k], rows[i], right[k], right[i] = rows[i], rows[k], right[i], right[k]
                continue
            swapped = abs(as_node(rows[i][k])) > abs(as_node(rows[k][k]))
            top, bottom = rows[k], rows[i]
            rows[k], rows[i] = {}, {}
            for c in sorted({*top, *bottom}):
                rows[k][c] = select(swapped, bottom.get(c, 0.0), top.get(c, 0.0))
                rows[i][c] = select(swapped, top.get(c, 0.0), bottom.get(c, 0.0))
            right[k], right[i] = select(swapped, right[i], right[k]), select(swapped, right[k], right[i])
        if k not in rows[k]:
            raise InternalError("equations that determine all unknowns; the matrix is structurally singular")
        for i in below:
            if k not in rows[i]:
                continue
            share = rows[i].pop(k) / rows[k][k]
            for c, value in rows[k].items():
                if c > k:
                    rows[i][c] = rows[i].get(c, 0.0) - share * value
            right[i] = right[i] - share * right[k]
    found: dict[int, Value] = {}
    for k in reversed(range(n)):
        known = right[k]
        for c, value in found.items():
            if c in rows[k]:
                known = known - rows[k][c] * value
        found[k] = known / rows[k][k]
    return [found[k] for k in range(n)]
