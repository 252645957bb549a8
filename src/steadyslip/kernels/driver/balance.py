"""Solution of the force balances for velocity variables w and unknowns, at the start of a run and after a jump."""

from __future__ import annotations

import math

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.places import guess_at, scale_at
from steadyslip.kernels.layout import Layout, Routines, call

# first step in the search for a bracket, over the scale of w; by trial: larger steps may skip a root
FIRST_REACH = 0.01
ROUNDS = 300  # most sweeps over coupled balances; chosen by trial
MOST_TRIALS = 200  # most steps to find a bracket, which doubling widens to 1e58 scales, and most steps inside it
SETTLED = 1e-14  # relative change of the unknowns in a sweep below which sweeps have converged: some tens of roundings
# most steps of Newton's method for all balances; steps at least halve, so that 37 lead from 1 to ROUNDED
NEWTON_STEPS = 50
ROUNDED = 1e-11  # relative change of the unknowns below which Newton's method has converged: rounding of the balances


def solve_balances(R: Array, layout: Layout, routines: Routines, y: Array) -> bool:
    """Solve all balances; the solution replaces the guesses in the record. False if no solution is found.

    The balances are solved in turn, with the other unknowns fixed, which finds the first solution in the direction of
    the forces. If balances are strongly coupled (dashpot, normal force) this converges slowly, and Newton's method for
    all unknowns completes it.
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
        if moved <= SETTLED or layout.massless == 1 or solve_together(R, layout, routines, y):
            return True
    return False


def solve_together(R: Array, layout: Layout, routines: Routines, y: Array) -> bool:
    """Newton's method for all balances, continued while each step is at most half the last; True if it converges.

    Otherwise the guesses in the record are restored.
    """
    n = layout.massless
    last, size, changes, kept = 2.0, 0.0, 2 * n, 3 * n
    for k in range(n):
        y[kept + k] = R[guess_at(layout, k)]
    for _ in range(NEWTON_STEPS):
        call(routines.balance, R, 0.0, y)
        size = 0.0
        for k in range(n):
            own = abs(y[changes + k]) / (R[scale_at(layout, k)] + abs(R[guess_at(layout, k)]))
            size = own if not own <= size else size
        if not 0.0 < size <= 0.5 * last:
            break
        for k in range(n):
            R[guess_at(layout, k)] -= y[changes + k]
        last = size
    if size <= ROUNDED:
        return True
    for k in range(n):
        R[guess_at(layout, k)] = y[kept + k]
    return False


def solve_balance(R: Array, layout: Layout, routines: Routines, k: int, y: Array) -> float:
    """Root w of balance k by a bracket that grows from the guess, then safeguarded Newton; NaN if no root is found.

    There may be several roots. A massless block moves to the first root in the direction of the force, so the first
    step is much smaller than the scale of w.
    """
    place, scale = guess_at(layout, k), R[scale_at(layout, k)]
    own = layout.massless + k
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
    for _ in range(MOST_TRIALS):
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
            if abs(step) < 1e-12 * (1.0 + abs(w)):  # the balance is not finite close to w
                break
    if not found:
        return math.nan
    w = 0.5 * (low + high)
    for _ in range(MOST_TRIALS):
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
        if trial == w or high - low <= 4e-16 * abs(trial):  # 4e-16: two rounding errors
            w = trial
            break
        w = trial
    return w
