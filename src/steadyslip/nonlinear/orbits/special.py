"""Detect and locate bifurcations (fold, period doubling, torus) between neighbouring cycles of a branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.nonlinear.continuation import Failure, Point
from steadyslip.nonlinear.orbits.cycle import Cycle, SpecialCycle
from steadyslip.nonlinear.orbits.shooting import Orbit, Shooting

NOISE = 3e-9  # relative difference of parameter values that rounding explains near the onset
MET = 2e-3  # two cycles count as the same if the logarithms of period and velocities differ by less than this
BLURRED = 10.0  # factor from the last Newton step to the uncertainty of the parameter; chosen by trial
ROUNDING = 1e-11  # relative difference of parameter values that rounding explains anywhere on a branch
FOLDED = 0.9  # a fold is rejected if all multipliers are smaller than this: at a true fold, one multiplier is 1
REAL = 1e-3  # a multiplier with a smaller relative imaginary part is real: errors split a double real multiplier so far
SMALL = 1e-2  # for a smaller amplitude of ln v, the kind of onset decides stability if a multiplier is 1 up to rounding


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A point of a branch of cycles: solution vector, shooting equations, and the cycle with its properties.

    `half` (n,) is the change of state after half a period, in natural sizes: zero if half is a whole period; `extent`
    (n,) the range of each state variable in the cycle; `begin` a start at steeper acceleration, if there is one.
    """

    point: Point
    shooting: Shooting
    cycle: Cycle
    half: Array
    extent: Array
    begin: Orbit | None = None


PointBuilder = Callable[[Shooting, Point], BranchPoint]
"""Function of shooting equations and a solution that returns the point of the branch."""


def changes(before: BranchPoint, now: BranchPoint, build: PointBuilder, index: int) -> list[SpecialCycle]:
    """Folds, period doublings and tori between two neighbouring points in the same unknowns, in order.

    If stability changes without one of these, as with symmetric cycles beyond a multiplier 1, the zero of the
    logarithm of the largest multiplier is located. If the parameter values of the points differ by rounding only, as in
    a canard, the multipliers are inaccurate too, and doublings and tori are not looked for.

    `index` is the index of the later point in the branch.
    """
    pair = [np.array(known.cycle.multipliers) for known in (before, now)]
    kinds: list[tuple[str, Callable[[Point], float]]] = []
    if before.point.tangent[-1] * now.point.tangent[-1] < 0:
        kinds.append(("fold", lambda point: float(point.tangent[-1])))
    apart = abs(before.cycle.value - now.cycle.value) > ROUNDING * abs(now.cycle.value)
    flips, turns = [doubling(m) for m in pair], [torus(m) for m in pair]
    if apart and now.shooting.flow.size > 2 and flips[0] * flips[1] < 0:
        kinds.append(("period doubling", lambda point: doubling(now.shooting.multipliers(point.u)[1])))
    if apart and min(turns) > -1 and turns[0] * turns[1] < 0:
        kinds.append(("torus", lambda point: torus(now.shooting.multipliers(point.u)[1])))
    tried = [_located(kind, before, now, measure, build, index) for kind, measure in kinds]
    found = [one for one in tried if one is not None]
    growths = [known.cycle.growth for known in (before, now)]
    changed = before.cycle.stable != now.cycle.stable and (growths[0] - 1) * (growths[1] - 1) < 0
    if changed and not found and apart and min(known.cycle.amplitude for known in (before, now)) > SMALL:
        tried = [_located("", before, now, lambda point: growth(now.shooting.multipliers(point.u)[1]), build, index)]
        found = [replace(one, kind=_passing(one.cycle)) for one in tried if one is not None]
    return sorted(found, key=lambda one: one._length)


def may_return(earlier: BranchPoint, before: BranchPoint, now: BranchPoint) -> bool:
    """True if a test function may have changed sign twice between the neighbours `before` and `now`.

    This is assumed if the extrapolation of the test function from `earlier` and `before` changes sign, or if a
    multiplier is closer to the unit circle than the distance that it moves in the step.
    """
    three = (earlier, before, now)
    lengths = [known.point.length for known in three]
    if min(known.cycle.amplitude for known in (before, now)) < SMALL or not lengths[0] < lengths[1]:
        return False
    ahead = (lengths[2] - lengths[1]) / (lengths[1] - lengths[0])
    multipliers = [np.array(known.cycle.multipliers) for known in three]
    kinds = [(doubling, 1.0), (torus, 1.0)] if now.shooting.flow.size > 2 else []
    measures = [([measure(m) for m in multipliers], moved) for measure, moved in kinds]
    if earlier.shooting is now.shooting:  # tangents are in the same unknowns; near the onset they grow by factors
        measures.append(([known.point.tangent[-1] for known in three], 0.0))
    for (was, here, there), moved in measures:
        if min(was, here, there) > -1 and here * there > 0:
            goes_on = here + ahead * (here - was)
            if goes_on * here < 0 or min(abs(here), abs(there)) < moved * abs(there - here):
                return True
    return False


def growth(multipliers: Array) -> float:
    """Test function: logarithm of the size of the largest multiplier."""
    return float(np.log(np.max(np.abs(multipliers))))


def _passing(cycle: Cycle) -> str:
    """Name of the bifurcation, from the multiplier that is nearest to the unit circle."""
    nearest = min(cycle.multipliers, key=lambda m: abs(abs(m) - 1))
    if abs(nearest.imag) > REAL * abs(nearest):
        return "torus"
    return "branch point" if nearest.real > 0 else "period doubling"


def _located(
    kind: str, before: BranchPoint, now: BranchPoint, measure: Callable[[Point], float], build: PointBuilder, index: int
) -> SpecialCycle | None:
    """Bifurcation at the zero of a test function between two points; None if none is found."""
    shooting = now.shooting
    try:
        ends = measure(before.point), measure(now.point)
        low, high = shooting.curve().located(before.point, now.point, measure, *ends, 0.1 * shooting.flow.options.rtol)
        cycle = build(shooting, high).cycle
    except Failure:
        return None
    other = shooting.orbit(low.u).value
    size = abs(cycle.value) or 1.0
    away = [abs(known.cycle.value - cycle.value) / size for known in (before, now)]
    blurred = max(NOISE, *(BLURRED * known.point.rounding for known in (before, now)))
    if kind == "fold" and cycle.growth < FOLDED:  # only the start of the cycle moves back, not the branch
        return None
    if kind == "fold" and (min(away) < blurred or cycle.amplitude < SMALL):
        return None
    precision = max(abs(other - cycle.value) / size, abs(cycle.trivial - 1) * max(away), 1e-12)
    beside = (before.cycle.value, now.cycle.value) if kind == "fold" else (other, cycle.value)
    return SpecialCycle(kind, cycle, (min(beside), max(beside)), float(precision), index, high.length)


def doubling(multipliers: Array) -> float:
    """Test function of period doubling: product of scaled 1 + μ, which changes sign where one multiplier passes −1."""
    return float(np.real(np.prod((1 + multipliers) / (1 + np.abs(multipliers)))))


def torus(multipliers: Array) -> float:
    """Test function of a torus: positive where a complex pair lies outside the unit circle; −1 without such a pair.

    Pairs that are real within `REAL` are ignored: near 1 or −1 they may be two real multipliers with errors.
    """
    pairs = multipliers[np.abs(multipliers.imag) > REAL * np.abs(multipliers)]
    return float(np.max(np.abs(pairs) - 1, initial=-1.0))


def log_features(cycle: Cycle) -> Array:
    """Logarithms of period (s) and peak velocity, and asinh of lowest velocity; (3,), to compare cycles."""
    lowest = np.arcsinh(cycle.lowest_velocity / cycle.speed)
    return np.array([np.log(cycle.period), np.log(cycle.peak_velocity), lowest])


def lies_between(a: Cycle, b: Cycle, cycle: Cycle) -> bool:
    """True if a cycle's parameter, period and velocities fit between those of two neighbours."""
    if not min(a.value, b.value) <= cycle.value <= max(a.value, b.value):
        return False
    share = (cycle.value - a.value) / (b.value - a.value) if b.value != a.value else 0.5
    spread = MET + 0.3 * np.abs(log_features(b) - log_features(a)).max() ** 2
    return bool(np.abs(log_features(a) * (1 - share) + log_features(b) * share - log_features(cycle)).max() < spread)
