"""Find the cycle near a simulated motion that seems to repeat itself, by Newton's method.

Peaks that agree are no proof of a cycle: ringing after a kick, or a slow approach to something else, have them too. A
cycle is believed only where the equations of a cycle are solved, next to the motion, by a state that does not return
earlier.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from steadyslip.core.format import format_quantity
from steadyslip.kernels.layout import NUMBER, Recorded
from steadyslip.kernels.runner import LOG_KINDS
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits.cycle import IMPRECISE, Cycle
from steadyslip.nonlinear.orbits.cycle_properties import amplitude, cycle_data
from steadyslip.nonlinear.orbits.flow import KINDS_EACH, FlowFailure, FlowRunner, FlowSetting, passages, states_between
from steadyslip.nonlinear.orbits.shooting import Orbit, Shooting

Array = np.ndarray
BEGINS = LOG_KINDS.index("slip begins")  # of a slip event: the block, speeding up, is as fast as the load point
RINGS = 8  # passages per slip event, ringing included, for which further slip events are waited for
RETURNS = 17  # returns that are compared: cycles with up to 16 returns per period are found
NEAR = 0.1  # largest distance from the motion to the solution, as a share of the cycle's size
CLOSE = 0.05  # distance below which two returns may be at one place of a cycle
SMALLEST = 1e-5  # range, in natural sizes, below which a motion counts as steady sliding
MOST_TRIES = 4  # numbers of returns per period that are tried
FIRST_SPAN = 60.0  # length of the first simulation, natural times
MOST_STEPS = 40_000  # integration steps per stretch of motion


def cycle_near(
    runs: FlowRunner, state: Array, value: float = 0.0, patience: int = 1, attracts: bool = False,
    unknowns: Array | None = None,
) -> Cycle | None:  # fmt: skip
    """Cycle that a motion is on or approaches, or None.

    Parameters
    ----------
    runs : FlowRunner
    state : ndarray (n,)
        The kernel's state variables (``outcome.state[row]``), anywhere near the suspected cycle.
    value : float
        Of the free parameter, where `runs` has one.
    patience : int
        How many stretches of some returns each to go on for, as long as no cycle is close enough.
    attracts : bool
        True to skip cycles that are not stable.
    unknowns : ndarray (u,), optional
        Of the balances at `state`, where they are known.

    Returns
    -------
    Cycle or None
        The primitive cycle next to the motion, with multipliers; ``cycle.stable`` says whether it attracts.
        None if there is none: the motion grows, settles, wanders, or is still too far from any.
    """
    return motion_from(runs, state, value, patience, attracts, unknowns).cycle


def motion_from(
    runs: FlowRunner, state: Array, value: float = 0.0, patience: int = 1, attracts: bool = False,
    unknowns: Array | None = None,
) -> Simulated:  # fmt: skip
    """Simulate from a state: the cycle that the motion approaches, or a description of what it does instead.

    Parameters are those of `cycle_near`.
    """
    returns, low, high = 0, np.inf, -np.inf
    try:
        for seen in _stretches(runs, runs.setting(value), state, unknowns, patience):
            returns, low, high = returns + len(seen.times), min(low, seen.speeds[0]), max(high, seen.speeds[1])
            if seen.extent < SMALLEST:
                return Simulated(None, "settles to steady sliding")
            for back in _candidates(runs, seen):
                found = _solved(runs, value, seen, int(back))
                if found is not None and (found.stable or not attracts):
                    return Simulated(found, f"comes to a cycle of period {format_quantity(found.period, 's')}")
    except FlowFailure as failure:
        return Simulated(None, f"ends: {failure}")
    if not returns:
        return Simulated(None, "does not come back to the velocity at which cycles begin")
    between = f"velocity between {format_quantity(low, 'm/s')} and {format_quantity(high, 'm/s')}"
    return Simulated(None, f"does not repeat itself in {returns} returns, compared over up to {RETURNS - 1}: {between}")


@dataclass(frozen=True)
class Simulated:
    """Cycle that a motion approaches (or None), and a description of the motion."""

    cycle: Cycle | None
    words: str


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Returns of a motion: where and when the block, speeding up, is as fast as the load point; and their sizes.

    `extent` is the largest range of a state variable, in its natural size, `amplitude` that of ln v, `speeds` the
    lowest and the highest velocity.
    """

    times: Array
    states: Array
    extent: float
    amplitude: float
    speeds: tuple[float, float]


def _stretches(
    runs: FlowRunner, setting: FlowSetting, state: Array, unknowns: Array | None, patience: int
) -> Iterator[_Stretch]:
    """Yield the motion in parts of some returns each."""
    span, spent, sticks = FIRST_SPAN * runs.time, 0, False
    for _ in range(patience):
        slips, passes = _Returns(), _Returns()
        low, high, speeds = [], [], []
        now = 0.0
        while not _enough(slips, passes, sticks) and spent < MOST_STEPS * patience:
            outcome = runs.watched(setting, state, span, unknowns=unknowns)
            record, log = outcome.recorded, outcome.log
            visited = record[:, Recorded.STATE : Recorded.STATE + runs.size]
            begun = log[(log[:, 0] == BEGINS + runs.contact * KINDS_EACH) & (log[:, 1] > 0) & (log[:, NUMBER] > 0), 1]
            for returns, at in ((slips, begun), (passes, passages(runs, setting, record)[0])):
                returns.add(now + at, states_between(runs, setting, record, at))
            low.append(np.arcsinh(visited.min(axis=0) / runs.scales))
            high.append(np.arcsinh(visited.max(axis=0) / runs.scales))
            speeds.append(runs.speeds(setting, outcome))
            if np.max(high[-1] - low[-1]) < SMALLEST:
                yield _Stretch(np.array(slips.times), np.array(slips.states), 0.0, 0.0, _ends(speeds[-1:]))
                return
            sticks = sticks or len(slips.times) > 0
            state, unknowns = outcome.state[0], outcome.unknowns[0]
            now, spent = now + span, spent + len(record)
            span *= 2.0 if max(len(slips.times), len(passes.times)) < RETURNS // 2 else 1.0
        seen = slips if len(slips.times) > 1 and _since(slips, passes) < RINGS * RETURNS else passes
        times, states = seen.times[-RETURNS:], seen.states[-RETURNS:]
        if len(times) < 2:
            return
        extent = float(np.max(np.max(high, axis=0) - np.min(low, axis=0)))
        yield _Stretch(np.array(times), np.array(states), extent, amplitude(np.concatenate(speeds)), _ends(speeds))


class _Returns:
    """Times and states at which a motion was at the place where cycles begin."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.states: list[Array] = []

    def add(self, times: Array, states: Array) -> None:
        """Further ones."""
        self.times += list(times)
        self.states += list(states)


def _enough(slips: _Returns, passes: _Returns, sticks: bool) -> bool:
    """True if there are enough returns to compare: starts of slip events, or all passages if there are none.

    Ringing after a slip event passes the same place, but returns only with the next event: once a motion had one
    (`sticks`), passages count alone only where far more of them follow than a slip rings.
    """
    several = len(slips.times) > 2 and len(passes.times) >= RINGS * RETURNS
    return len(slips.times) >= RETURNS or several or _since(slips, passes) >= (RINGS if sticks else 1) * RETURNS


def _since(slips: _Returns, passes: _Returns) -> int:
    """Number of passages after the last slip event."""
    last = slips.times[-1] if slips.times else -np.inf
    return int(np.sum(np.array(passes.times) > last))


def _ends(speeds: list[Array]) -> tuple[float, float]:
    """Lowest and highest of several arrays."""
    return float(min(one.min() for one in speeds)), float(max(one.max() for one in speeds))


def _candidates(runs: FlowRunner, seen: _Stretch) -> Array:
    """Numbers of returns that a period may have: those after which the motion was close to its present place."""
    places = np.arcsinh(seen.states / runs.scales)
    away = np.abs(places[-2::-1] - places[-1]).max(axis=1)
    return 1 + np.flatnonzero(away < CLOSE * min(1.0, seen.extent))[:MOST_TRIES]


def _solved(runs: FlowRunner, value: float, seen: _Stretch, back: int) -> Cycle | None:
    """Solve for the cycle next to the last return, with `back` returns per period; None if there is none."""
    shooting = Shooting(runs, np.ones(1), False, abs(value) or 1.0)
    shooting.amplitude = min(1.0, seen.extent)
    period = seen.times[-1] - seen.times[-1 - back]
    if not period > 0:  # returns within rounding of each other
        return None
    guess = shooting.packed(Orbit(seen.states[-1:], period, value))
    still = np.eye(len(guess))[-1]  # the parameter stays
    try:
        point = shooting.curve().corrected(guess, still, 0.0, NEAR * shooting.amplitude)
        seen_once = cycle_data(shooting, point.u)
    except (Failure, np.linalg.LinAlgError):
        return None
    cycle = seen_once.cycle
    shrunk = cycle.amplitude < 0.5 * seen.amplitude
    sure = abs(cycle.trivial - 1) <= IMPRECISE or _closes(runs, seen, back)
    return cycle if sure and not shrunk and seen_once.turns == 1 else None


def _closes(runs: FlowRunner, seen: _Stretch, back: int) -> bool:
    """True if the motion itself came back each time, several times over, whatever the precision of the multipliers.

    Where a bristle rings between long rests, deviations grow and shrink by many decades within a period, and the
    multipliers lose their digits; the motion does not.
    """
    places = np.arcsinh(seen.states / runs.scales)
    return len(places) > 2 * back and bool(np.abs(places[back:] - places[:-back]).max() < SMALLEST)
