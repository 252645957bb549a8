"""What is known of a cycle once its equations are solved: velocities, stresses, multipliers, and that it is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from steadyslip.kernels.layout import Recorded, Sampled
from steadyslip.nonlinear.orbits.cycle import Cycle
from steadyslip.nonlinear.orbits.flow import FlowFailure
from steadyslip.nonlinear.orbits.shooting import Shooting

Array = np.ndarray
PRIMES = np.array([2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31])
SAME = 1e-4  # distance, as a share of the cycle's size, within which a state has come back


def amplitude(velocity: Array) -> float:
    """Half of ln(highest/lowest); infinite where the block stops or turns round."""
    high, low = float(velocity.max()), float(velocity.min())
    if not low > 0:
        return np.inf
    return 0.5 * (high - low) / float(velocity.mean()) if high / low - 1 < 1e-3 else 0.5 * float(np.log(high / low))


@dataclass(frozen=True, eq=False)
class Measured:
    """A cycle run through once.

    Attributes
    ----------
    cycle : Cycle
    turns : int
        How often the motion goes round a shorter cycle in the period, or a prime factor of it, up to 31: the state
        is back after so small a part of the period. 1 for a true cycle.
    half : ndarray (n,)
        How far the state is from the start after half the period, in natural sizes.
    """

    cycle: Cycle
    turns: int
    half: Array


def measured(shooting: Shooting, u: Array) -> Measured:
    """The cycle of some unknowns.

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
    velocity, spring, normal, back = [], [], [], []
    for state, begin, share in zip(orbit.states, starts, shooting.fractions, strict=True):
        span = share * orbit.period
        times = parts[(parts >= begin) & (parts < begin + span)] - begin
        outcome = flow.watched(setting, state, span, shooting.amplitude, times)
        record = outcome.recorded
        seen = flow.observed(setting, record[:, Recorded.TIME], record[:, Recorded.POINT :])
        velocity.append(np.concatenate([outcome.log[:, 2], seen["v"]]))
        normal.append(np.concatenate([outcome.log[:, 3], seen["normal_stress"]]))
        spring.append(np.concatenate([outcome.log[:, 5], seen["spring_stress"]]))
        back.append(outcome.samples[0, :, Sampled.STATE :])
        if len(velocity) == 1:
            start = {name: float(seen[name][0]) for name in [v.name for v in flow.reduction.model.variables] + ["v"]}
    v, t, sigma = (np.concatenate(part) for part in (velocity, spring, normal))
    if not np.all(np.isfinite([v, t, sigma])):  # forces do not balance at every state: the motion is none
        raise FlowFailure("stuck")
    away = (np.vstack(back)[::-1] - orbit.states[0]) / np.hypot(flow.scales, orbit.states[0])
    same = np.flatnonzero(np.abs(away).max(axis=1) < SAME * shooting.amplitude)
    cycle = Cycle(
        value=orbit.value,
        period=orbit.period,
        peak_velocity=float(v.max()),
        lowest_velocity=float(v.min()),
        amplitude=amplitude(v),
        stress_drop=float(t.max() - t.min()),
        lowest_normal_stress=float(sigma.min()),
        highest_normal_stress=float(sigma.max()),
        multipliers=tuple(complex(m) for m in others),
        trivial=trivial,
        stable=bool(np.max(np.abs(others), initial=0.0) < 1),
        start=start,
        _orbit=orbit,
    )
    return Measured(cycle, int(PRIMES[same[0]]) if len(same) else 1, away[0])
