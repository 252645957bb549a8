"""Choose shooting segments such that deviations across the motion grow little within each.

A deviation along the motion is only a shift in time: in a slip event of many decades it grows and shrinks with the
velocity. It is projected out, and cuts are made where the motion is slow.
"""

from __future__ import annotations

import numpy as np

from steadyslip.core.arrays import Array
from steadyslip.kernels.layout import Recorded
from steadyslip.nonlinear.orbits.shooting import Orbit, Shooting

NODES = 48  # number of states along the cycle at which a segment may start
MOST_GROWTH = 1e3  # largest allowed factor by which deviations grow within a segment
QUICK = 30.0  # no cut is made where the state changes faster than this multiple of its mean rate in the cycle


def cut(shooting: Shooting, u: Array) -> Orbit | None:
    """The orbit divided into new segments; None if there would not be more segments than now.

    Raises
    ------
    Failure
        If the motion over a period cannot be integrated.
    """
    flow, orbit = shooting.flow, shooting.orbit(u)
    setting = flow.setting(orbit.value)
    times, states = _nodes(shooting, orbit)
    spans = np.diff(np.append(times, orbit.period))
    _, sensitivity, _ = flow.run(setting, states, spans, shooting.amplitude)
    stretch = np.hypot(flow.scales, states)
    after = np.roll(stretch, -1, axis=0)
    along = flow.field(setting, states)[0] / stretch
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.eye(flow.size) - along[:, :, None] * along[:, None, :]
    steps = np.roll(across, -1, axis=0) @ (sensitivity * stretch[:, None, :] / after[:, :, None]) @ across
    at = _cuts(steps)
    if len(at) <= shooting.segments:
        return None
    fractions = np.diff(np.append(times[at], orbit.period)) / orbit.period
    return Orbit(states[at], orbit.period, orbit.value, fractions, orbit.scales)


def _nodes(shooting: Shooting, orbit: Orbit) -> tuple[Array, Array]:
    """Times (s) and states at which cuts are possible: evenly spaced in the unknowns, where motion is slow."""
    flow = shooting.flow
    setting = flow.setting(orbit.value)
    times, states = [], []
    starts = np.cumsum(shooting.fractions) - shooting.fractions
    for begin, share, state in zip(starts, shooting.fractions, orbit.states, strict=True):
        record = flow.watched(setting, state, share * orbit.period, shooting.amplitude).recorded
        times.append(begin * orbit.period + record[:-1, Recorded.TIME])
        states.append(record[:-1, Recorded.STATE : Recorded.STATE + flow.size])
    time, every = np.concatenate(times), np.vstack(states)
    place = np.arcsinh(every / flow.scales)
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
    speed = np.linalg.norm(flow.field(setting, every)[0] / np.hypot(flow.scales, every), axis=1)
    wanted = np.searchsorted(arc, np.linspace(0.0, arc[-1], NODES + 1)[:-1])
    slow = speed * orbit.period < QUICK * arc[-1]
    slow[0] = True
    at = np.unique(wanted[slow[wanted]])
    return time[at], every[at]


def _cuts(steps: Array) -> list[int]:
    """Indices of the nodes at which segments start; each segment is as long as `MOST_GROWTH` allows."""
    found, running = [0], [steps[0]]
    for k in range(1, len(steps)):
        further = [steps[k] @ product for product in (*running, np.eye(len(steps[k])))]
        if max(np.linalg.norm(product, 2) for product in further) > MOST_GROWTH:
            found.append(k)
            further = [steps[k]]
        running = further
    return found
