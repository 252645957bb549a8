"""Compute the properties of a cycle from its solved equations: velocities, stresses, Floquet multipliers, checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.kernels.layout import Recorded, Sampled
from steadyslip.motion.engine import Outcome
from steadyslip.nonlinear.orbits.cycle import Cycle, CycleRange
from steadyslip.nonlinear.orbits.flow import FlowFailure, FlowRunner, passages, states_between
from steadyslip.nonlinear.orbits.shooting import ONE, Orbit, Shooting

Array = np.ndarray
PRIMES = np.array([2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31])
STEEPER = 3.0  # factor by which another passage must be steeper to become the start of the cycle; chosen by trial
SAME = 1e-4  # distance, as a share of the cycle's size, within which a state counts as returned


def amplitude(velocity: Array) -> float:
    """Half of ln(highest/lowest) of slip rates; infinite where the block stops or turns round."""
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
    """Initial values, by variable name (SI units), with which a simulation starts on the cycle."""
    variables = [item.name for item in flow.reduction.model.variables]
    return {name: float(seen[name][0]) for name in (*variables, *(["v"] if "v" in seen else []))}


@dataclass(frozen=True, eq=False)
class CycleData:
    """A cycle with its properties, computed by integrating it over one period.

    Attributes
    ----------
    cycle : Cycle
    turns : int
        How often the motion goes round a shorter cycle in the period, or a prime factor of it, up to 31: the state
        is back after so small a part of the period. 1 for a true cycle.
    half : ndarray (n,)
        How far the state is from the start after half the period, in natural sizes.
    extent : ndarray (n,)
        Range that each state variable goes through.
    begin : Orbit or None
        The same cycle, roughly, from where slip passes the load point's velocity most steeply: where that is much
        steeper than where it begins. Where slip only just reaches that velocity, a cycle has no such beginning a little
        further along its branch.
    """

    cycle: Cycle
    turns: int
    half: Array
    extent: Array
    begin: Orbit | None = None


def cycle_data(shooting: Shooting, u: Array) -> CycleData:
    """Compute the cycle that a solution vector `u` of the shooting equations stands for, and its properties.

    Raises
    ------
    FlowFailure
        If the run meets states at which no velocity balances the forces.
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
        raise FlowFailure("stuck")  # forces do not balance at every state: the motion is none
    ranges = [_range(*columns) for columns in each]
    own = ranges[flow.contact]
    names = [contact.name for contact in flow.reduction.model.contacts]
    nexts = np.roll(orbit.states, -1, axis=0)
    missed = np.abs(np.array(ends) - nexts) / np.hypot(flow.scales, nexts)
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
        closing=float(np.max(missed)) / shooting.amplitude,
        _orbit=orbit,
    )
    extent = np.asarray(np.ptp(np.vstack(visited), axis=0))
    return CycleData(cycle, int(PRIMES[same[0]]) if len(same) else 1, away[0], extent, beginning.orbit)


class _Begin:
    """Search for a better starting point of a cycle: a passage of the load point's velocity that is much steeper."""

    def __init__(self, shooting: Shooting, orbit: Orbit) -> None:
        self.flow, self.now = shooting.flow, orbit
        self.orbit: Orbit | None = None
        self.setting = self.flow.setting(orbit.value)
        rates, jacobian, _ = self.flow.field(self.setting, orbit.states[:1])
        self.steepest = STEEPER * float(self.setting.slip @ jacobian[0] @ rates[0])

    def look(self, outcome: Outcome) -> None:
        """Keep the steepest passage in an integrated part of the cycle, if much steeper than the present start."""
        times, slopes = passages(self.flow, self.setting, outcome.recorded)
        if len(slopes) and slopes.max() > self.steepest:
            self.steepest = float(slopes.max())
            at = times[[int(np.argmax(slopes))]]
            state = states_between(self.flow, self.setting, outcome.recorded, at)
            self.orbit = Orbit(state, self.now.period, self.now.value, ONE, self.now.scales)
