"""Records of velocity steps by a servo that lags or overshoots, with known truth."""

from __future__ import annotations

import numpy as np

import steadyslip as ss

SLOW, STRESS, STIFFNESS = 1e-6, 10e6, 2e10


def rig(chance, evolution):
    """A press and a sample at random."""
    friction = ss.laws.RateState(
        a=chance.uniform(0.008, 0.014), b=chance.uniform(0.009, 0.018), d_c=chance.uniform(8e-6, 25e-6),
        mu_ref=0.62, v_ref=SLOW, evolution=evolution,
    )  # fmt: skip
    contact = ss.laws.ConstantNormalStress(steady_normal_stress=STRESS)
    return ss.Slider(
        friction=friction, contact=contact, stiffness=STIFFNESS * chance.uniform(0.5, 1.5),
        drive=ss.machine.SteadyDrive(SLOW),
    )  # fmt: skip


def response(since, lag, overshoot):
    """Share of a change of rate that a servo has made `since` (s): second order, or first order without overshoot."""
    since = np.maximum(since, 0.0)
    if lag == 0 and overshoot == 0:
        return (since > 0) * 1.0
    if overshoot == 0:
        return 1 - np.exp(-since / lag)
    zeta = -np.log(overshoot) / np.hypot(np.pi, np.log(overshoot))
    omega = 4 / (zeta * (lag or 0.75))  # settled to 2 % within the lag
    fast = omega * np.sqrt(1 - zeta**2)
    return 1 - np.exp(-zeta * omega * since) * (np.cos(fast * since) + zeta * omega / fast * np.sin(fast * since))


def first_order(since, lag):
    """Share made `since` (s) by a first-order lag."""
    return -np.expm1(-np.maximum(since, 0.0) / lag)


WAYS = {
    "creep": lambda since: 0.85 * first_order(since, 0.25) + 0.15 * first_order(since, 4.0),
    "two times": lambda since: 0.6 * first_order(since, 0.1) + 0.4 * first_order(since, 1.2),
    "stick": lambda since: (since > 0.5) * (1 + 0.6 * (1 - first_order(since - 0.5, 0.5))),
    "corner": lambda since: np.interp(since, [0, 0.4, 1.6], [0, 0.7, 1]),
    "curve": lambda since: 0.5 - 0.5 * np.cos(np.pi * np.clip(since / 1.2, 0, 1)),
}
"""Shares of a change made by load points that follow in ways that are none of a servo of second order."""


def record(
    seed,
    lag=0.0,
    overshoot=0.0,
    evolution=None,
    noise=2e-4,
    sensor=5e-8,
    rate=10.0,
    steps=((60.13, 10e-6), (110.37, 1e-6)),
    way=None,
):
    """A noisy record, and the rig behind it."""
    chance = np.random.default_rng(seed)
    source = rig(chance, evolution or ss.laws.Slip())
    until = 170.0
    fine = np.unique(
        np.concatenate(
            [
                np.linspace(0, until, 1701),
                *(at + np.geomspace(1e-4, 20, 4000) for at, _ in steps),
                [at for at, _ in steps],
            ]
        )
    )
    fine = fine[fine <= until]
    v, before = np.full(len(fine), SLOW), SLOW
    for at, to in steps:
        v += (to - before) * (WAYS[way](fine - at) if way else response(fine - at, lag, overshoot))
        before = to
    place = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(fine))])
    piece = ss.protocol.LoadPointTable(time=tuple(fine), displacement=tuple(place))
    times = np.arange(0, until, 1 / rate)
    run = ss.simulate(source, ss.Protocol(pieces=(piece,), until=until), times=times, rtol=1e-9, events=False)
    if run.status != "done":
        raise ValueError("a burst: a matter of inertia")
    friction = run["friction"] + noise * chance.standard_normal(len(times))
    displacement = run["load_displacement"] + sensor * chance.standard_normal(len(times))
    return ss.record_from_arrays(
        time=run["t"], friction=friction, normal=run["normal_stress"], displacement=displacement, source="record"
    ), source
