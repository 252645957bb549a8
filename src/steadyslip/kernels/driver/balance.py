"""Solution of the force balances for velocity variables and unknowns, at the start of a run and after a jump."""

from __future__ import annotations

import math

from steadyslip.core.arrays import Array
from steadyslip.kernels.driver.places import guess_at, scale_at
from steadyslip.kernels.layout import Layout, Routines, call

FIRST_REACH = 0.01  # first step of a bracket over the natural size of w; by trial: larger ones may skip a root
ROUNDS = 300  # sweeps over coupled balances before giving up; chosen by trial
MOST_TRIALS = 200  # of a bracket and of its root: doubling reaches 1e58 scales, halving the last bit after some 60
SETTLED = 1e-14  # relative change of the unknowns in a sweep, some tens of roundings, that counts as converged
NEWTON_STEPS = 50  # most Newton steps for all balances; the steps at least halve, so that 37 lead from 1 to ROUNDED
ROUNDED = 1e-11  # relative change of an unknown that rounding of the balances may cause: below it, converged


def solve_balances(R: Array, layout: Layout, routines: Routines, y: Array) -> bool:
    """Solve all balances for their unknowns and velocity variables, in place of the guesses; False if one has no root.

    Each balance is solved with the other unknowns fixed, in turn, which leads to the solution that is next in the
    direction of the forces. Where balances are strongly coupled (dashpot, normal force) this converges slowly, and
    Newton's method for all unknowns finishes it.
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
    """Apply Newton's method to all balances while each step at least halves; if it fails, return False and restore the
    guesses.
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
    """Root w of balance k nearest to the guess: bracketed outwards from it, then safeguarded Newton; NaN if none.

    Several w may be roots. A massless block moves to the first one in the direction of the force, so the first step is
    much smaller than the natural size of w.
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
            if abs(step) < 1e-12 * (1.0 + abs(w)):  # the balance is finite nowhere near
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
        if trial == w or high - low <= 4e-16 * abs(trial):  # two roundings
            w = trial
            break
        w = trial
    return w
