"""Balances of forces, solved for the velocity variables where a jump or a start leaves them open."""

from __future__ import annotations

import math

from steadyslip.kernels.driver.places import guess_at
from steadyslip.kernels.layout import Array, Layout, Routines, Row, call

FIRST_REACH = 0.01  # natural sizes of w within which a balance is looked for first
ROUNDS = 300  # of several balances that depend on each other, solved in turn


def solve_balances(R: Array, layout: Layout, routines: Routines, y: Array) -> None:
    """All velocity variables that balances fix, in place of the guesses; NaN where there is none.

    Each is solved for with the others as they are, until none moves: friction that rises with velocity and dashpots
    make that converge.
    """
    for _ in range(ROUNDS):
        moved = 0.0
        for k in range(layout.massless):
            place = guess_at(layout, k)
            near = R[place]
            w = solve_balance(R, layout, routines, k, y)
            R[place] = w
            if not math.isfinite(w):
                return
            moved = max(moved, abs(w - near) / (1.0 + abs(w)))
        if moved <= 1e-14 or layout.massless == 1:
            return


def solve_balance(R: Array, layout: Layout, routines: Routines, k: int, y: Array) -> float:
    """The w that fulfils balance k, nearest to the guess: bracketed outwards, then safeguarded Newton.

    Forces may balance at several w. A block without mass takes the first on the side to which forces drive it, so
    the search begins with steps much smaller than the natural size of w.
    """
    place, own = guess_at(layout, k), 2 * k
    w = float(R[place])
    call(routines.balance, R, 0.0, y)
    value = y[own]
    if value == 0.0:
        return w
    if not math.isfinite(value):
        return math.nan
    step = FIRST_REACH * R[Row.Z_SCALE] if value < 0.0 else -FIRST_REACH * R[Row.Z_SCALE]
    low = high = w
    found = False
    for _ in range(200):
        trial = w + step
        R[place] = trial
        call(routines.balance, R, 0.0, y)
        other = y[own]
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
        value, slope = y[own], y[own + 1]
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
