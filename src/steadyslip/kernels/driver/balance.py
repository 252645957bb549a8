"""Balances of forces, solved for the unknowns and velocity variables where a jump or a start leaves them open."""

from __future__ import annotations

import math

import numpy as np

from steadyslip.kernels.driver.places import guess_at, scale_at
from steadyslip.kernels.layout import Array, Layout, Routines, call

FIRST_REACH = 0.01  # natural sizes of w within which a balance is looked for first
ROUNDS = 300  # of several balances that depend on each other, solved in turn
NEWTON_STEPS = 50
ROUNDED = 1e-11  # share of an unknown by which rounding may keep it from settling any further


def solve_balances(R: Array, layout: Layout, routines: Routines, y: Array) -> bool:
    """All unknowns and velocity variables that balances fix, in place of the guesses; False if there are none.

    Each is solved for with the others as they are: that leads to the balance which is next in the direction of the
    forces. Where a dashpot or a normal force ties them together this takes ever smaller steps, and Newton's method for
    all ends it as soon as it closes in.
    """
    for _ in range(ROUNDS):
        moved = 0.0
        for k in range(layout.massless):
            place = guess_at(layout, k)
            near = R[place]
            w = solve_balance(R, layout, routines, k, y)
            R[place] = w
            if not math.isfinite(w):
                return False
            moved = max(moved, abs(w - near) / (R[scale_at(layout, k)] + abs(w)))
        if moved <= 1e-14 or layout.massless == 1 or solve_together(R, layout, routines, y):
            return True
    return False


def solve_together(R: Array, layout: Layout, routines: Routines, y: Array) -> bool:
    """Newton's method for all balances, as long as each step is much smaller than the one before; else False, and the
    guesses are as they were.
    """
    n = layout.massless
    near, last = np.zeros(n), 2.0
    for k in range(n):
        near[k] = R[guess_at(layout, k)]
    for _ in range(NEWTON_STEPS):
        call(routines.balance, R, 0.0, y)
        eliminate(y, n)
        size = 0.0
        for k in range(n):
            own = abs(y[k]) / (R[scale_at(layout, k)] + abs(R[guess_at(layout, k)]))
            size = own if not own <= size else size
        if size <= ROUNDED and not size <= 0.5 * last:
            return True
        if not size <= 0.5 * last:
            break
        for k in range(n):
            R[guess_at(layout, k)] -= y[k]
        if size <= 1e-15:
            return True
        last = size
    for k in range(n):
        R[guess_at(layout, k)] = near[k]
    return False


def eliminate(y: Array, n: int) -> None:
    """The solution of n linear equations in place of their right side, the first n numbers; the matrix follows."""
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(y[n + i * n + k]) > abs(y[n + best * n + k]):
                best = i
        if best != k:
            for c in range(n):
                kept = y[n + k * n + c]
                y[n + k * n + c] = y[n + best * n + c]
                y[n + best * n + c] = kept
            kept = y[k]
            y[k] = y[best]
            y[best] = kept
        for i in range(k + 1, n):
            share = y[n + i * n + k] / y[n + k * n + k] if y[n + k * n + k] != 0.0 else math.nan
            for c in range(k, n):
                y[n + i * n + c] -= share * y[n + k * n + c]
            y[i] -= share * y[k]
    for j in range(n):
        k = n - 1 - j
        for c in range(k + 1, n):
            y[k] -= y[n + k * n + c] * y[c]
        y[k] = y[k] / y[n + k * n + k] if y[n + k * n + k] != 0.0 else math.nan


def solve_balance(R: Array, layout: Layout, routines: Routines, k: int, y: Array) -> float:
    """The unknown w that fulfils balance k, nearest to the guess: bracketed outwards, then safeguarded Newton.

    Forces may balance at several w. A block without mass takes the first on the side to which forces drive it, so
    the search begins with steps much smaller than the natural size of w.
    """
    place, scale = guess_at(layout, k), R[scale_at(layout, k)]
    own = layout.massless * (1 + k) + k
    w = float(R[place])
    call(routines.balance, R, 0.0, y)
    value = y[k]
    if value == 0.0:
        return w
    if not math.isfinite(value):
        return math.nan
    step = FIRST_REACH * scale if value < 0.0 else -FIRST_REACH * scale
    low = high = w
    found = False
    for _ in range(200):
        trial = w + step
        R[place] = trial
        call(routines.balance, R, 0.0, y)
        other = y[k]
        if math.isfinite(other):
            if (other > 0.0) != (value > 0.0) or other == 0.0:
                low, high = min(w, trial), max(w, trial)
                found = True
                break
            w, value = trial, other
            step = 2.0 * step
        else:
            step = 0.25 * step
            if abs(step) < 1e-12 * (1.0 + abs(w)):
                break
    if not found:
        return math.nan
    w = 0.5 * (low + high)
    for _ in range(200):
        R[place] = w
        call(routines.balance, R, 0.0, y)
        value, slope = y[k], y[own]
        if value == 0.0:
            break
        if value > 0.0:
            high = w
        else:
            low = w
        trial = w - value / slope if slope > 0.0 else math.nan
        if not (low < trial < high):
            trial = 0.5 * (low + high)
        if trial == w or high - low <= 4e-16 * abs(trial):
            w = trial
            break
        w = trial
    return w
