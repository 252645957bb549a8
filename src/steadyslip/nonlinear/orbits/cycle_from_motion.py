"""Find the cycle near a simulated motion that seems to repeat itself, by Newton's method, and its properties.

Equal peaks do not prove a cycle: ringing after a kick, or a slow approach to something else, has them too. A cycle is
accepted only if the shooting equations have a solution near the motion, and its period is not a multiple of a shorter
one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.core.format import format_quantity
from steadyslip.kernels.layout import NUMBER, Recorded, Sampled
from steadyslip.kernels.runner import LOG_KINDS
from steadyslip.motion.engine import Outcome
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits.cycle import IMPRECISE, RETURNED, Cycle, CycleRange
from steadyslip.nonlinear.orbits.flow import KINDS_EACH, FlowFailure, FlowRunner, FlowSetting, passages, states_between
from steadyslip.nonlinear.orbits.shooting import ONE, Orbit, Shooting

PRIMES = np.array(
    [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31]
)  # numbers of repetitions of a shorter cycle that are tested; other numbers are products of these
STEEPER = 3.0  # a passage with an acceleration this many times larger becomes the start of the cycle; by trial
SAME = 1e-4  # distance, as a share of the cycle's size, within which a state counts as returned


def amplitude(velocity: Array) -> float:
    """Half of ln(highest slip rate/lowest slip rate); infinite where the block stops or reverses."""
    high, low = float(velocity.max()), float(velocity.min())
    if not low > 0:
        return np.inf
    return 0.5 * (high - low) / float(velocity.mean()) if high / low - 1 < 1e-3 else 0.5 * float(np.log(high / low))


def _range(velocity: Array, normal: Array, pull: Array) -> CycleRange:
    """Extremes of slip rate, normal stress and spring stress at one contact over a cycle."""
    return CycleRange(
        float(velocity.max()), float(velocity.min()), amplitude(velocity), float(pull.max() - pull.min()),
        float(normal.min()), float(normal.max()),
    )  # fmt: skip


def _start(flow: FlowRunner, seen: dict[str, Array]) -> dict[str, float]:
    """Initial values, by variable name (SI units), with which a simulation starts on the cycle.

    The velocity of a slider without mass follows from its memory.
    """
    model = flow.reduction.model
    names = [item.name for item in model.variables] + (["v"] if model.inertial and "v" in seen else [])
    return {name: float(seen[name][0]) for name in names}


@dataclass(frozen=True, eq=False)
class CycleData:
    """A cycle with its properties, computed by integrating it over one period.

    Attributes
    ----------
    cycle : Cycle
    turns : int
        Number of times that the period contains a shorter period, or a prime factor of that number, up to 31; 1 for a
        primitive cycle.
    half : ndarray (n,)
        Change of the state from the start to half the period, in natural sizes.
    extent : ndarray (n,)
        Range of each state variable in the cycle.
    begin : Orbit or None
        Approximate orbit of the cycle that starts where slip passes the load point's velocity with the largest
        acceleration; None unless this acceleration is `STEEPER` times that at the present start. A start at which slip
        only just reaches the load point's velocity disappears a little further along the branch.
    """

    cycle: Cycle
    turns: int
    half: Array
    extent: Array
    begin: Orbit | None = None


def cycle_data(shooting: Shooting, u: Array) -> CycleData:
    """Cycle of a solution vector `u` of the shooting equations, with its properties.

    Raises
    ------
    FlowFailure
        If the motion reaches states at which no velocity balances the forces.
    """
    flow, orbit = shooting.flow, shooting.orbit(u)
    setting = flow.setting(orbit.value)
    trivial, others = shooting.multipliers(u)
    starts = orbit.period * (np.cumsum(shooting.fractions) - shooting.fractions)
    parts = orbit.period / PRIMES[::-1]
    within = np.searchsorted(starts, parts * (1 + 4 * np.finfo(float).eps), side="right") - 1
    passed: list[list[tuple[Array, Array, Array]]] = []
    back, visited, ends, beginning = [], [], [], _Begin(shooting, orbit)
    for k, state in enumerate(orbit.states):
        span = shooting.fractions[k] * orbit.period
        times = np.clip(parts[within == k] - starts[k], 0.0, span)
        outcome = flow.watched(setting, state, span, shooting.amplitude, times)
        beginning.look(outcome)
        ends.append(outcome.state[0])
        visited.append(outcome.recorded[:, Recorded.STATE : Recorded.STATE + flow.size])
        passed.append(flow.at_contacts(setting, outcome))
        back.append(outcome.samples[0, :, Sampled.STATE : Sampled.STATE + flow.size])
        if len(passed) == 1:
            first = outcome.recorded[:1]
            start = _start(flow, flow.observed(setting, first[:, Recorded.TIME], first[:, Recorded.POINT :]))
    each = [tuple(map(np.concatenate, zip(*parts, strict=True))) for parts in zip(*passed, strict=True)]
    if not all(np.all(np.isfinite(column)) for columns in each for column in columns):
        raise FlowFailure("stuck")  # at some state of the cycle no velocity balances the forces
    ranges = [_range(*columns) for columns in each]
    own = ranges[flow.contact]
    names = [contact.name for contact in flow.reduction.model.contacts]
    nexts = np.roll(orbit.states, -1, axis=0)
    missed = (np.array(ends) - nexts) / np.hypot(flow.scales, nexts)
    along = flow.field(setting, nexts)[0] / np.hypot(flow.scales, nexts)
    away = (np.vstack(back)[::-1] - orbit.states[0]) / np.hypot(flow.scales, orbit.states[0])
    same = np.flatnonzero(np.abs(away).max(axis=1) < SAME * shooting.amplitude)
    cycle = Cycle(
        value=orbit.value,
        period=orbit.period,
        peak_velocity=own.peak_velocity,
        lowest_velocity=own.lowest_velocity,
        amplitude=own.amplitude,
        stress_drop=own.force_drop,
        lowest_normal_stress=own.lowest_normal_force,
        highest_normal_stress=own.highest_normal_force,
        multipliers=tuple(complex(m) for m in others),
        trivial=trivial,
        stable=bool(np.max(np.abs(others), initial=0.0) < 1),
        start=start,
        speed=setting.speed,
        contact=names[flow.contact],
        contacts=dict(zip(names, ranges, strict=True)) if names[0] else {},
        closing=closing_error(missed, along, orbit.period, shooting.amplitude),
        _orbit=orbit,
    )
    extent = np.asarray(np.ptp(np.vstack(visited), axis=0))
    return CycleData(cycle, int(PRIMES[same[0]]) if len(same) else 1, away[0], extent, beginning.orbit)


def closing_error(missed: Array, along: Array, period: float, amplitude: float) -> float:
    """Closing error of a cycle: distance between its start and end as a share of its size, or error of the period.

    The larger of the two is returned, the error of the period as a share of the period.

    The part of the distance along the motion is converted to a time: where slip begins after a long rest, a tiny error
    of the period grows to most of the cycle's size a moment later.

    Parameters
    ----------
    missed : ndarray (K, n)
        Ends of the segments minus the starts of the next, over their sizes.
    along : ndarray (K, n)
        Rates of the state at these starts, over the same sizes (1/s).
    period : float
        s.
    amplitude : float
        Size of the cycle; below 1 for small cycles.
    """
    late = np.sum(missed * along, axis=1) / np.sum(along * along, axis=1)
    across = np.abs(missed - late[:, None] * along)
    return float(max(np.max(across) / amplitude, np.max(np.abs(late)) / period))


class _Begin:
    """Search for a better starting point of a cycle: a passage of the load point's velocity that is much steeper."""

    def __init__(self, shooting: Shooting, orbit: Orbit) -> None:
        self.flow, self.now = shooting.flow, orbit
        self.orbit: Orbit | None = None
        self.setting = self.flow.setting(orbit.value)
        rates, jacobian, _ = self.flow.field(self.setting, orbit.states[:1])
        self.steepest = STEEPER * float(self.setting.slip @ jacobian[0] @ rates[0])

    def look(self, outcome: Outcome) -> None:
        """Store the orbit from the steepest passage in an integrated part of the cycle, if steeper than `steepest`."""
        times, slopes = passages(self.flow, self.setting, outcome.recorded)
        if len(slopes) and slopes.max() > self.steepest:
            self.steepest = float(slopes.max())
            at = times[[int(np.argmax(slopes))]]
            state = states_between(self.flow, self.setting, outcome.recorded, at)
            self.orbit = Orbit(state, self.now.period, self.now.value, ONE, self.now.scales)


BEGINS = LOG_KINDS.index("slip begins")  # slip event begins: the block, accelerating, is as fast as the load point
RINGS = 8  # assumed number of passages per slip event, those of ringing included
RETURNS = 17  # number of returns that are compared: cycles with up to 16 returns per period are found
NEAR = 0.1  # largest distance from the motion to the solution, as a share of the cycle's size
CLOSE = 0.05  # largest distance of two returns one period apart, as a share of the motion's size
SMALLEST = 1e-5  # a motion whose range is smaller than this, in natural sizes, counts as steady sliding
MOST_TRIES = 4  # limit of numbers of returns per period that are tried
FIRST_SPAN = 60.0  # duration of the first simulation, natural times
MOST_STEPS = 40_000  # limit of integration steps per stretch of motion


def cycle_near(
    runs: FlowRunner, state: Array, value: float = 0.0, patience: int = 1, unknowns: Array | None = None
) -> Cycle | None:
    """Cycle on which a motion is, or which it approaches; None if there is none.

    Parameters
    ----------
    runs : FlowRunner
    state : ndarray (n,)
        The kernel's state variables (``outcome.state[row]``), anywhere near the suspected cycle.
    value : float
        Value of the free parameter, if `runs` has one.
    patience : int
        Limit of stretches (of up to `RETURNS` returns each) that are simulated until a cycle is found.
    unknowns : ndarray (u,), optional
        Solutions of the algebraic equations at `state`, where they are known.

    Returns
    -------
    Cycle or None
        The primitive cycle next to the motion, with multipliers; ``cycle.stable`` is True if it attracts.
        None if no cycle is near: the motion grows, settles, is irregular, or still too far from a cycle.
    """
    return motion_from(runs, state, value, patience, unknowns=unknowns).cycle


def motion_from(
    runs: FlowRunner, state: Array, value: float = 0.0, patience: int = 1, attracts: bool = False,
    unknowns: Array | None = None,
) -> Simulated:  # fmt: skip
    """Cycle that the motion from `state` approaches (None if there is none), and a description of the motion.

    Parameters are those of `cycle_near`; if `attracts` is True, unstable cycles are skipped.
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
        return Simulated(None, f"ends: {failure.place}")
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
    """Returns of a motion: times (m,), s, and states (m, n) at which slip, accelerating, passes the load point's speed.

    `extent` is the largest range of a state variable, in natural sizes, `amplitude` half the range of ln v, `speeds`
    the lowest and the highest velocity, m/s.
    """

    times: Array
    states: Array
    extent: float
    amplitude: float
    speeds: tuple[float, float]


def _stretches(
    runs: FlowRunner, setting: FlowSetting, state: Array, unknowns: Array | None, patience: int
) -> Iterator[_Stretch]:
    """Yield up to `patience` consecutive stretches of the motion, of up to `RETURNS` returns each."""
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
            returned = len(slips.times) if sticks else len(passes.times)  # without those due to ringing
            span *= 2.0 if returned < RETURNS // 2 else 1.0
        seen = slips if len(slips.times) > 1 and _since(slips, passes) < RINGS * RETURNS else passes
        times, states = seen.times[-RETURNS:], seen.states[-RETURNS:]
        if len(times) < 2:
            return
        extent = float(np.max(np.max(high, axis=0) - np.min(low, axis=0)))
        yield _Stretch(np.array(times), np.array(states), extent, amplitude(np.concatenate(speeds)), _ends(speeds))


class _Returns:
    """Times (s) and states (n,) at which a motion returned to the start of cycles."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.states: list[Array] = []

    def add(self, times: Array, states: Array) -> None:
        """Append times (m,) and states (m, n)."""
        self.times += list(times)
        self.states += list(states)


def _enough(slips: _Returns, passes: _Returns, sticks: bool) -> bool:
    """True if there are enough returns to compare: starts of slip events or, without slip events, passages.

    Ringing after a slip event passes the start of cycles too, but the motion returns only with the next event: once it
    had an event (`sticks`), passages alone suffice only if far more of them follow than a slip rings.
    """
    several = len(slips.times) > 2 and len(passes.times) >= RINGS * RETURNS
    return len(slips.times) >= RETURNS or several or _since(slips, passes) >= (RINGS if sticks else 1) * RETURNS


def _since(slips: _Returns, passes: _Returns) -> int:
    """Number of `passes` after the last of `slips`, the starts of slip events."""
    last = slips.times[-1] if slips.times else -np.inf
    return int(np.sum(np.array(passes.times) > last))


def _ends(speeds: list[Array]) -> tuple[float, float]:
    """Lowest and highest value of several arrays."""
    return float(min(one.min() for one in speeds)), float(max(one.max() for one in speeds))


def _candidates(runs: FlowRunner, seen: _Stretch) -> Array:
    """Possible numbers of returns per period: that many returns ago the motion was close to its last state."""
    places = np.arcsinh(seen.states / runs.scales)
    away = np.abs(places[-2::-1] - places[-1]).max(axis=1)
    return 1 + np.flatnonzero(away < CLOSE * min(1.0, seen.extent))[:MOST_TRIES]


def _solved(runs: FlowRunner, value: float, seen: _Stretch, back: int) -> Cycle | None:
    """Cycle near the last return with `back` returns per period; None if Newton's method finds none."""
    shooting = Shooting(runs, np.ones(1), False, abs(value) or 1.0)
    shooting.amplitude = min(1.0, seen.extent)
    period = seen.times[-1] - seen.times[-1 - back]
    if not period > 0:  # the two returns differ by rounding only
        return None
    runs.begin_motion()
    guess = shooting.packed(Orbit(seen.states[-1:], period, value))
    still = np.eye(len(guess))[-1]  # the parameter is fixed
    try:
        point = shooting.curve().corrected(guess, still, 0.0, NEAR * shooting.amplitude)
        data = cycle_data(shooting, point.u)
    except (Failure, np.linalg.LinAlgError):
        return None
    cycle = replace(data.cycle, returned=_returned(runs, seen, back))
    shrunk = cycle.amplitude < 0.5 * seen.amplitude
    sure = abs(cycle.trivial - 1) <= IMPRECISE or cycle.returned <= RETURNED
    return cycle if sure and not shrunk and data.turns == 1 else None


def _returned(runs: FlowRunner, seen: _Stretch, back: int) -> float:
    """Largest distance between returns one period apart, over the last two periods; NaN for less than two periods.

    Where a bristle rings between long rests, deviations grow and shrink by many decades within a period, so that
    multipliers are inaccurate, but the simulated motion is not.
    """
    places = np.arcsinh(seen.states / runs.scales)
    last = places[-2 * back - 1 :]
    return float(np.abs(last[back:] - last[:-back]).max()) if len(places) > 2 * back else np.nan
