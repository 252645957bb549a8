"""Balances of forces, solved for the unknowns and velocity variables where a jump or a start leaves them open."""

from __future__ import annotations

import math

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
    """The unknown w that fulfils balance k, nearest to the guess: bracketed outwards, then safeguarded Newton.

    Forces may balance at several w. A block without mass takes the first on the side to which forces drive it, so
    the search begins with steps much smaller than the natural size of w.
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
