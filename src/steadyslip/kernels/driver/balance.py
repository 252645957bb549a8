"""The balance of forces, solved for the velocity variable where a jump or a start leaves it open."""

from __future__ import annotations

import math

from steadyslip.kernels.layout import Array, Routines, Row, call

FIRST_REACH = 0.01  # natural sizes of w within which a balance is looked for first


def solve_balance(R: Array, routines: Routines, guess: float, y: Array) -> float:
    """The w that balances forces, nearest to the guess: bracketed outwards, then safeguarded Newton.

    Forces may balance at several w. A block without mass takes the first on the side to which forces drive it, so
    the search begins with steps much smaller than the natural size of w.
    """
    w = guess
    call(routines.balance, R, w, y)
    value = y[0]
    if value == 0.0:
        return w
    if not math.isfinite(value):
        return math.nan
    step = FIRST_REACH * R[Row.Z_SCALE] if value < 0.0 else -FIRST_REACH * R[Row.Z_SCALE]
    low = high = w
    found = False
    for _ in range(200):
        trial = w + step
        call(routines.balance, R, trial, y)
        other = y[0]
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
        call(routines.balance, R, w, y)
        value, slope = y[0], y[1]
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
