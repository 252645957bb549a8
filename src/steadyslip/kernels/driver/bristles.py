"""Rosenbrock steps of a rig that holds a place: Y' = A Y + H f(G Y), with friction and bristles f by a model's routine.

`Bristles` are these arrays: constants R of the routine; the tableau, with rows for the arguments of the stages and the
result, the couplings, the error, three rows of dense output, and γ; A, G, H; typical sizes of the variables Y.
"""

from __future__ import annotations

import math

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.layout import Held, Layout, Routines, call

Bristles = tuple[Array, Array, Array, Array, Array, Array]
Space = tuple[Array, Array, Array, Array, Array, Array, Array, Array]
LONGER = 5.0  # largest factor from one step to the next, as in Hairer & Wanner (1996)
SHORTER = 0.2  # smallest factor (same source)
SAFETY = 0.9  # factor of the step that the error estimate allows (same source)


def held_rates(layout: Layout, routines: Routines, bristles: Bristles, Y: Array, y: Array, rates: Array) -> None:
    """Write the rates Y' to `rates`, and inputs G Y, outputs f and their slopes to `y`."""
    A, G, H = bristles[2], bristles[3], bristles[4]
    size, inputs, outputs = Y.shape[0], G.shape[0], H.shape[1]
    for k in range(inputs):
        total = 0.0
        for j in range(size):
            total += G[k, j] * Y[j]
        y[k] = total
    call(routines.bristles, bristles[0], 0.0, y)
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += A[i, j] * Y[j]
        for k in range(outputs):
            total += H[i, k] * y[inputs + k]
        rates[i] = total


def held_jacobian(bristles: Bristles, y: Array, jacobian: Array) -> None:
    """Write the Jacobian of the rates to `jacobian`, from `y` as `held_rates` leaves it."""
    A, G, H = bristles[2], bristles[3], bristles[4]
    size, inputs, outputs = A.shape[0], G.shape[0], H.shape[1]
    for i in range(size):
        for j in range(size):
            jacobian[i, j] = A[i, j]
        for k in range(outputs):
            slope = 0.0
            for m in range(inputs):
                slope = y[inputs + outputs + inputs * k + m]
                for j in range(size):
                    jacobian[i, j] += H[i, k] * slope * G[m, j]


def factorise(M: Array, order: Array) -> None:
    """Replace a matrix by its LU factors with partial pivoting; row exchanges go to `order`."""
    size = M.shape[0]
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            best = i if abs(M[i, k]) > abs(M[best, k]) else best
        order[k] = best
        for j in range(size):
            kept = M[k, j]
            M[k, j] = M[best, j]
            M[best, j] = kept
        for i in range(k + 1, size):
            if M[i, k] != 0.0:
                M[i, k] /= M[k, k]
                for j in range(k + 1, size):
                    M[i, j] -= M[i, k] * M[k, j]


def solve_factorised(M: Array, order: Array, b: Array) -> None:
    """Replace the right-hand side b by the solution, from the LU factors of `factorise`."""
    size = M.shape[0]
    for k in range(size):
        best = int(order[k])
        kept = b[k]
        b[k] = b[best]
        b[best] = kept
    for i in range(size):
        for j in range(i):
            b[i] -= M[i, j] * b[j]
    for back in range(size):
        i = size - 1 - back
        for j in range(i + 1, size):
            b[i] -= M[i, j] * b[j]
        b[i] /= M[i, i]


def try_step(
    layout: Layout, routines: Routines, bristles: Bristles, space: Space, Y: Array, length: float, rtol: float,
    found: Array,
) -> float:  # fmt: skip
    """Root-mean-square error of a step over the allowed error; its dense output, (5, size), is written to `found`.

    Jacobian and rates at the start of the step are taken from the work space (`begin_step`).
    """
    tableau, scale = bristles[1], bristles[5]
    jacobian, M, order, first, rates, argument, y, stages = (
        space[0], space[1], space[2], space[3], space[4], space[5], space[6], space[7],
    )  # fmt: skip
    size, count = Y.shape[0], stages.shape[0]
    for i in range(size):
        for j in range(size):
            M[i, j] = -jacobian[i, j]
        M[i, i] += 1.0 / (length * tableau[2 * count + 5, 0])
    factorise(M, order)
    for s in range(count):
        own = stages[s]
        if s > 0:
            for i in range(size):
                total = Y[i]
                for k in range(s):
                    total += tableau[s, k] * stages[k, i]
                argument[i] = total
            held_rates(layout, routines, bristles, argument, y, rates)
        for i in range(size):
            total = rates[i] if s > 0 else first[i]
            for k in range(s):
                total += tableau[count + 1 + s, k] * stages[k, i] / length
            own[i] = total
        solve_factorised(M, order, own)
    square = 0.0
    for i in range(size):
        change, error, r1, r2, r3 = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(count):
            u = stages[k, i]
            change += tableau[count, k] * u
            error += tableau[2 * count + 1, k] * u
            r1 += tableau[2 * count + 2, k] * u
            r2 += tableau[2 * count + 3, k] * u
            r3 += tableau[2 * count + 4, k] * u
        found[0, i] = Y[i]
        found[1, i] = change + r1
        found[2, i] = r2 - r1
        found[3, i] = r3 - r2
        found[4, i] = -r3
        square += (error / (rtol * scale[i])) ** 2.0
    return float((square / size) ** 0.5)


def begin_step(layout: Layout, routines: Routines, bristles: Bristles, space: Space, Y: Array) -> None:
    """Write rates and Jacobian at the state Y, the start of a step, to the work space."""
    held_rates(layout, routines, bristles, Y, space[6], space[3])
    held_jacobian(bristles, space[6], space[0])


def take_step(
    layout: Layout, routines: Routines, bristles: Bristles, space: Space, Y: Array, clock: Array, most: float,
    found: Array,
) -> float:  # fmt: skip
    """Length (s, up to `most`) of a step with allowed error, written to `found`; 0 if it would be too short."""
    scale = bristles[5]
    for i in range(Y.shape[0]):
        scale[i] = max(scale[i], abs(Y[i]))
    begin_step(layout, routines, bristles, space, Y)
    length = min(float(clock[Held.LENGTH]), most)
    while True:
        error = try_step(layout, routines, bristles, space, Y, length, clock[Held.RTOL], found)
        factor = LONGER
        if not math.isfinite(error):
            factor = SHORTER
        elif error > 0.0:
            factor = min(LONGER, max(SHORTER, SAFETY * error**-0.2))  # the error is of fifth order
        if error <= 1.0:
            # the error of a step that was cut to `most` says little about the next length
            if length < most or factor < 1.0:
                clock[Held.LENGTH] = length * factor
            return length
        length = length * factor
        if not length > clock[Held.SHORTEST]:
            return 0.0


def bristle_step(
    layout: Layout, routines: Routines, R: Array, tableau: Array, A: Array, G: Array, H: Array, scale: Array, Y: Array,
    clock: Array, found: Array, rates: Array, jacobian: Array, way: int,
) -> int:  # fmt: skip
    """Write rates and Jacobian at Y, and for `way` 1 or 2 the dense output of a step from there.

    With `way` 2 the step has the length `Held.STOP`; with `way` 1 it is at most that long and has an allowed error, and
    its length is written to `Held.STOP`. Returns 1 if the step would be too short, else 0.
    """
    size, inputs, outputs = Y.shape[0], G.shape[0], H.shape[1]
    bristles = (R, tableau, A, G, H, scale)
    space = (
        jacobian, np.zeros((size, size)), np.zeros(size), rates, np.zeros(size), np.zeros(size),
        np.zeros(inputs + outputs + inputs * outputs), np.zeros((tableau.shape[1], size)),
    )  # fmt: skip
    most = clock[Held.STOP]
    if way == 1:
        length = take_step(layout, routines, bristles, space, Y, clock, most, found)
        clock[Held.STOP] = length
        return 0 if length > 0.0 else 1
    begin_step(layout, routines, bristles, space, Y)
    if way == 2:
        try_step(layout, routines, bristles, space, Y, most, clock[Held.RTOL], found)
    return 0
